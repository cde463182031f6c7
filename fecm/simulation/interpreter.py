"""The interpreter of macro programs: nested loops on an explicit stack, resumable at any macro."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from fecm.deck.macros import Body, Loop
from fecm.deck.records import Macro

# Carries out a macro; True leaves the innermost loop.
Action = Callable[[], "bool | None"]


class EndedError(Exception):
    """The program ends before its last macro."""


class Interpreter:
    """Carries out a nested program."""

    def __init__(self, program: Body) -> None:
        self._program = program
        # A frame per open loop: actions, number of passes, index of the next action, pass.
        self._stack: list[list[Any]] = []

    @property
    def position(self) -> list[tuple[int, int]]:
        """Index of the next item and pass, from the program itself to the innermost loop."""
        return [(frame[2], frame[3]) for frame in self._stack]

    @property
    def current_pass(self) -> int:
        """Pass of the innermost loop, from 1."""
        return int(self._stack[-1][3])

    def run(
        self,
        bind: Callable[[Macro], Action],
        start: Sequence[tuple[int, int]] = (),
        on_macro: Callable[[], object] = lambda: None,
    ) -> None:
        """Carry out the program, from a `position` on; a ValueError if it has no such one.

        `bind` returns the action of a macro and is called once per card; `on_macro` is called after
        each macro, each loop and each pass of an empty loop.
        """
        stack = self._stack
        try:
            stack += _frames(_bound(self._program, bind), start or [(0, 1)])
            while True:
                frame = stack[-1]
                actions, count, index, current = frame
                if index < len(actions):
                    frame[2] = index + 1
                    action = actions[index]
                    if type(action) is tuple:
                        stack.append([*action, 0, 1])
                        continue
                    if action():
                        stack.pop()
                elif current < count:
                    frame[2:] = 0, current + 1
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


def _bound(body: Body, bind: Callable[[Macro], Action]) -> list[Any]:
    """Actions of a body; a loop is a tuple of its actions and its number of passes."""
    return [
        (_bound(item.body, bind), item.count) if isinstance(item, Loop) else bind(item)
        for item in body
    ]


def _frames(actions: list[Any], position: Sequence[tuple[int, int]]) -> list[list[Any]]:
    """Frames of a position."""
    frames: list[list[Any]] = []
    count = 1
    for index, current in position:
        if frames:
            actions, count = frames[-1][0][frames[-1][2] - 1]
        if not (0 <= index <= len(actions) and 1 <= current <= count):
            raise ValueError(f"the program has no position {list(position)}")
        frames.append([actions, count, index, current])
    return frames
