"""Time steps of a sweep's cases: the duration of the deck is kept.

A deck whose DT is 0, or is the one that ``fecm new`` writes for its plate, takes each case's time
step from the critical one of its own plate.  Any other DT holds for every case.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fecm.deck.macros import STEPS, every, flat
from fecm.deck.model import Deck
from fecm.deck.records import Macro
from fecm.mechanics.time_step import rounded_time_step, taken_time_step
from fecm.problem.problem import Problem

# No loop is made longer than this; the checks refuse a program that is shorter.
LONGEST = 1e15
# Words that count steps or passes, and store at every N-th.
STORING = ("RODP", "DISP", "STRE")


@dataclass(frozen=True)
class Clock:
    """Rule by which each plate has its own time step.

    Attributes
    ----------
    dt : float
        Time step of the deck itself (time).
    rounded : bool
        Whether it is the one of ``fecm new``, not the one that DT 0 takes.
    """

    dt: float
    rounded: bool

    def time_step(self, critical: float) -> float:
        """Time step of a plate with a critical one."""
        return rounded_time_step(critical) if self.rounded else taken_time_step(critical)


def clock_of(checked: Problem) -> Clock | None:
    """Find the rule of a deck; None where its DT holds for every case."""
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if len(sizes) != 1:
        return None
    (dt,) = sizes
    critical = critical_of(checked)
    if not dt:
        return Clock(taken_time_step(critical), rounded=False)
    return Clock(dt, rounded=True) if dt == rounded_time_step(critical) else None


def critical_of(checked: Problem) -> float:
    """Critical time step of a problem (time)."""
    return checked.critical_time_step


def with_time_step(deck: Deck, dt: float, taken: float = 0.0) -> Deck:
    """Change every DT of a deck; loops get as many steps as the same duration takes.

    Parameters
    ----------
    deck : Deck
    dt : float
        The new time step (time).  Where it is not positive only the DT cards change.
    taken : float
        What DT 0 stands for in the deck; 0 where no DT is 0.

    Returns
    -------
    Deck
        Storing macros in the loops keep their number of rows, about.
    """
    ratios: dict[int, float] = {}
    open_loops: list[int] = []
    now = 0.0
    for place, macro in enumerate(deck.macros):
        if macro.word == "DT":
            now = macro.value or taken
        elif macro.word == "LOOP":
            open_loops.append(place)
        elif macro.word == "NEXT" and open_loops:
            open_loops.pop()
        elif macro.word in STEPS and open_loops and now > 0.0 and dt > 0.0:
            ratios[open_loops[-1]] = now / dt

    def changed(place: int, macro: Macro) -> Macro:
        if macro.word == "DT":
            return replace(macro, value=dt, source=None)
        if macro.word == "LOOP":
            open_loops.append(place)
            if place in ratios:
                count = min(max(1.0, macro.value) * ratios[place], LONGEST)
                return replace(macro, value=float(max(1, math.ceil(count - 1e-9))), source=None)
        elif macro.word == "NEXT" and open_loops:
            open_loops.pop()
        elif macro.word in STORING and open_loops and open_loops[-1] in ratios:
            count = min(every(macro) * ratios[open_loops[-1]], LONGEST)
            return replace(macro, value=float(max(1, round(count))), source=None)
        return macro

    open_loops.clear()
    return replace(
        deck, macros=tuple(changed(place, macro) for place, macro in enumerate(deck.macros))
    )
