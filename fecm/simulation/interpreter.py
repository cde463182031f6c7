"""The interpreter of macro programs: nested loops on an explicit stack, resumable at any macro."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from fecm.deck.macros import Body, Loop
from fecm.deck.records import Macro

Action = Callable[[], "bool | None"]  # carries out a macro; True leaves the innermost loop
# Carries out complete passes of a loop at their begin; False if there are none to carry out so.
Passes = Callable[[], bool]


class EndedError(Exception):
    """The program ends before its last macro."""


class Interpreter:
    """Carries out a nested program."""

    def __init__(self, program: Body) -> None:
        self._program = program
        # A frame per open loop: actions, number of passes, what carries out many of them, index of
        # the next action, pass.
        self._stack: list[list[Any]] = []

    @property
    def position(self) -> list[tuple[int, int]]:
        """Index of the next item and pass, from the program itself to the innermost loop."""
        return [(frame[3], frame[4]) for frame in self._stack]

    @property
    def current_pass(self) -> int:
        """Pass of the innermost loop, from 1."""
        return int(self._stack[-1][4])

    @property
    def passes_to_come(self) -> int:
        """Passes of the innermost loop after this one."""
        return int(self._stack[-1][1]) - self.current_pass

    def skip(self, passes: int) -> None:
        """Go on at the begin of a later pass of the innermost loop."""
        self._stack[-1][4] += passes

    def run(
        self,
        bind: Callable[[Macro], Action],
        start: Sequence[tuple[int, int]] = (),
        on_macro: Callable[[], object] = lambda: None,
        bind_loop: Callable[[Body], Passes | None] = lambda body: None,
    ) -> None:
        """Carry out the program, from a `position` on; a ValueError if it has no such one.

        `bind` returns the action of a macro and is called once per card; `on_macro` is called after
        each macro, each loop and each pass of an empty loop.  `bind_loop` returns a function that
        carries out passes of a loop together and calls :meth:`skip`; None if there is none.
        """
        stack = self._stack
        try:
            stack += _frames(_bound(self._program, bind, bind_loop), start or [(0, 1)])
            while True:
                frame = stack[-1]
                actions, count, passes, index, current = frame
                if not index and passes is not None and passes():
                    on_macro()
                elif index < len(actions):
                    frame[3] = index + 1
                    action = actions[index]
                    if type(action) is tuple:
                        stack.append([*action, 0, 1])
                        continue
                    if action():
                        stack.pop()
                elif current < count:
                    frame[3:] = 0, current + 1
                    if actions:
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
) -> list[Any]:
    """Actions of a body; a loop is a tuple that begins a frame."""
    return [
        (_bound(item.body, bind, bind_loop), item.count, bind_loop(item.body))
        if isinstance(item, Loop)
        else bind(item)
        for item in body
    ]


def _frames(actions: list[Any], position: Sequence[tuple[int, int]]) -> list[list[Any]]:
    """Frames of a position."""
    frames: list[list[Any]] = []
    count, passes = 1, None
    for index, current in position:
        if frames:
            actions, count, passes = frames[-1][0][frames[-1][3] - 1]
        if not (0 <= index <= len(actions) and 1 <= current <= count):
            raise ValueError(f"the program has no position {list(position)}")
        frames.append([actions, count, passes, index, current])
    return frames
