"""The interpreter of macro programs: loops carried out in order, resumable at any macro."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace

from fecm.deck.macros import STEPS, Body, Loop, WorkEstimate, estimate_work, every, flat
from fecm.deck.records import Macro

# Given the pass; whether to leave the innermost loop.
Act = Callable[[int], "bool | None"]

Bind = Callable[[Macro], Act]


class EndedError(Exception):
    """The program ends before its last macro."""


class Course:
    """A program being carried out, which knows where it is and can go on there.

    Parameters
    ----------
    body : tuple
        The program.

    Attributes
    ----------
    place : list of (int, int)
        From the program itself to the innermost loop: which of its items is being carried out, and
        in which pass.
    """

    def __init__(self, body: Body) -> None:
        self.place: list[tuple[int, int]] = []
        self._body = body
        self._goal: list[tuple[int, int]] = []

    def run(
        self,
        bind: Bind,
        after: Sequence[tuple[int, int]] = (),
        between: Callable[[], object] = lambda: None,
    ) -> None:
        """Carry the program out.

        Parameters
        ----------
        bind : callable
            Gives what a macro does.  It is not kept: whoever carries out a program may hold on to
            its course without holding on to itself.
        after : sequence of (int, int)
            Begin behind the macro at this place.
        between : callable
            Called behind each macro and each pass of a loop, when `place` tells where to go on.
        """
        self._goal = [(int(index), int(current)) for index, current in after]
        with contextlib.suppress(EndedError):
            self._bound(self._body, bind, between, 0)(1)

    def _bound(self, body: Body, bind: Bind, between: Callable[[], object], depth: int) -> Act:
        """Bind a program's macros to what they do, so that a pass only has to call them."""
        acts = [
            self._repeated(item, bind, between, depth + 1) if isinstance(item, Loop) else bind(item)
            for item in body
        ]
        self.place += [(0, 0)] * (depth + 1 - len(self.place))
        place, count = self.place, len(acts)

        def carry_out(current: int) -> bool:
            for index in range(self._first(depth), count):
                place[depth] = index, current
                if acts[index](current):
                    return True
                between()
            return False

        return carry_out

    def _repeated(self, loop: Loop, bind: Bind, between: Callable[[], object], depth: int) -> Act:
        """Bind a loop, whose body is at a depth."""
        carry_out = self._bound(loop.body, bind, between, depth)
        empty = not loop.body

        def repeat(_: int) -> None:
            first = self._goal[depth][1] if self._goal else 1
            for current in range(first, loop.count + 1):
                if carry_out(current):
                    break
                if empty:
                    between()  # an empty body has no place: the loop counts as done
            self.place[depth:] = [(0, 0)] * (len(self.place) - depth)

        return repeat

    def _first(self, depth: int) -> int:
        """Which of a body's items comes first: not the first one on the way to where to go on."""
        if not self._goal:
            return 0
        index, _ = self._goal[depth]
        if any(current for _, current in self._goal[depth + 1 :]):
            return index  # a loop, in which it is still going on
        self._goal = []
        return index + 1


def tally(
    body: Body, between: Callable[[], object] = lambda: None, *, counts_anew: bool = False
) -> WorkEstimate:
    """Count exactly what a program does and stores; carries out its loops where it must.

    Parameters
    ----------
    body : tuple
        The program.
    between : callable
        Called between two macros; may raise.
    counts_anew : bool
        Whether RODP counts the steps since the last output (the slip ``counter``): then
        `contact_rows` is an upper bound where RODP cards differ.
    """
    counted = estimate_work(body)
    if len({every(m) if m.word == "RODP" else 0 for m in flat(body) if m.word in STEPS}) <= 1:
        return counted
    if counts_anew:
        least = min(every(m) for m in flat(body) if m.word == "RODP")
        return replace(counted, contact_rows=counted.steps // least)
    step = rows = 0

    def bind(macro: Macro) -> Act:
        steps, every_nth = macro.word in STEPS, every(macro) if macro.word == "RODP" else 0

        def act(_: int) -> None:
            nonlocal step, rows
            step += steps
            rows += every_nth > 0 and step % every_nth == 0

        return act

    Course(body).run(bind, between=between)
    return WorkEstimate(counted.macros, counted.steps, rows, counted.passes)
