"""The interpreter of macro programs: nested loops on an explicit stack, resumable at any macro."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

from fecm.deck.macros import Body, Loop
from fecm.deck.model import Macro

Action = Callable[[], "bool | None"]  # carries out a macro; True leaves the innermost loop
# Runs complete passes of a loop from their start; False if it ran none.
Passes = Callable[[], bool]
Position = Sequence[tuple[int, int]]  # index of the next item and pass of every open loop


class EndedError(Exception):
    """The program ended before its last macro."""


class _BoundLoop(NamedTuple):
    """Loop whose macros are bound to actions. The program itself is a loop of one pass."""

    items: list[_Item]
    last_pass: int = 1
    passes: Passes | None = None  # carries out many of them together


_Item: TypeAlias = Action | _BoundLoop


class _Frame:
    """Open loop with its next item and its pass."""

    __slots__ = ("index", "loop", "number")

    def __init__(self, loop: _BoundLoop, index: int = 0, number: int = 1) -> None:
        self.loop = loop
        self.index = index  # of the next item
        self.number = number  # of the pass, from 1


class Interpreter:
    """Interpreter of a nested program."""

    def __init__(self, program: Body) -> None:
        self._program = program
        self._stack: list[_Frame] = []

    @property
    def position(self) -> list[tuple[int, int]]:
        """Index of the next item and pass, from the program itself to the innermost loop."""
        return [(frame.index, frame.number) for frame in self._stack]

    @property
    def current_pass(self) -> int:
        """Pass of the innermost loop, from 1."""
        return self._stack[-1].number

    @property
    def passes_to_come(self) -> int:
        """Passes of the innermost loop after this one."""
        return self._stack[-1].loop.last_pass - self.current_pass

    def skip(self, passes: int, item: int = 0) -> None:
        """Continue in a later pass of the innermost loop, at the start or at an item."""
        self._stack[-1].number += passes
        self._stack[-1].index = item

    def run(
        self,
        bind: Callable[[Macro], Action],
        start: Position = (),
        on_macro: Callable[[], object] = lambda: None,
        bind_loop: Callable[[Body], Passes | None] = lambda body: None,
    ) -> None:
        """Run the program, optionally from a `position`.

        `bind` returns the action of a macro and is called once per card. `on_macro` is called after
        each macro, each loop and each pass of an empty loop. `bind_loop` returns a function that
        runs several passes of a loop together and calls :meth:`skip`, or None if the loop needs
        single steps. Raises ValueError if the program has no such position.
        """
        stack = self._stack
        try:
            program = _BoundLoop(_bound(self._program, bind, bind_loop))
            stack += _frames(program, start or [(0, 1)])
            while True:
                frame = stack[-1]
                loop = frame.loop
                if not frame.index and loop.passes is not None and loop.passes():
                    pass  # which has skipped them
                elif frame.index < len(loop.items):
                    item = loop.items[frame.index]
                    frame.index += 1
                    if isinstance(item, _BoundLoop):
                        stack.append(_Frame(item))
                        continue
                    if item():
                        stack.pop()
                elif frame.number < loop.last_pass:
                    frame.index = 0
                    frame.number += 1
                    if loop.items:
                        continue
                elif len(stack) > 1:
                    stack.pop()
                else:
                    return
                on_macro()
        except EndedError:
            return
        finally:
            stack.clear()  # the actions may refer to the owner of this interpreter


def _bound(
    body: Body, bind: Callable[[Macro], Action], bind_loop: Callable[[Body], Passes | None]
) -> list[_Item]:
    """Bind the macros of a body to actions, and its loops to bound loops."""
    return [
        _BoundLoop(_bound(item.body, bind, bind_loop), item.count, bind_loop(item.body))
        if isinstance(item, Loop)
        else bind(item)
        for item in body
    ]


def _frames(program: _BoundLoop, position: Position) -> list[_Frame]:
    """Return the open loops at a position.

    Raises ValueError if the program has no such position.
    """
    frames: list[_Frame] = []
    loop: _Item = program
    for index, number in position:
        if frames:
            loop = frames[-1].loop.items[frames[-1].index - 1]
        if not (
            isinstance(loop, _BoundLoop)
            and 0 <= index <= len(loop.items)
            and 1 <= number <= loop.last_pass
        ):
            raise ValueError(f"the program has no position {list(position)}")
        frames.append(_Frame(loop, index, number))
    return frames
