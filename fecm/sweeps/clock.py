"""Time steps of the cases of a sweep; the duration of the deck is kept.

If DT of the deck is 0, or the value that ``fecm new`` writes for its plate, the time step of each
case follows from the critical time step of its plate.  Any other DT applies to every case.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fecm.deck.macros import STEPS, every, flat
from fecm.deck.model import Deck
from fecm.deck.records import Macro
from fecm.mechanics.time_step import rounded_time_step, taken_time_step
from fecm.problem.problem import Problem

# Longest loop; the checks reject much shorter programs.
LONGEST = 1e15
# Macros that store every N-th step or pass.
STORING = ("RODP", "DISP", "STRE", "PLYS")


@dataclass(frozen=True)
class Clock:
    """Rule for the time step of each plate."""

    dt: float  # time step of the deck (time)
    rounded: bool  # whether the rule is that of ``fecm new`` instead of that of DT 0

    def time_step(self, critical: float) -> float:
        """Return the time step for a critical time step."""
        return rounded_time_step(critical) if self.rounded else taken_time_step(critical)


def clock_of(checked: Problem) -> Clock | None:
    """Find the rule of a deck; None if its DT applies to every case."""
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if len(sizes) != 1:
        return None
    (dt,) = sizes
    critical = checked.critical_time_step
    if not dt:
        return Clock(taken_time_step(critical), rounded=False)
    return Clock(dt, rounded=True) if dt == rounded_time_step(critical) else None


def with_time_step(deck: Deck, dt: float, taken: float = 0.0) -> Deck:
    """Change every DT of a deck, and the loops so that the duration is kept.

    `taken` is the time step that DT 0 means in the deck; 0 if no DT is 0.  If the new one is not
    positive, only the DT cards change.  Macros that store rows keep approximately their number of
    rows.
    """
    loops = _innermost_loops(deck.macros)
    ratios: dict[int, float] = {}
    now = 0.0
    for macro, loop in zip(deck.macros, loops, strict=True):
        if macro.word == "DT":
            now = macro.value or taken
        elif macro.word in STEPS and loop is not None and now > 0.0 and dt > 0.0:
            ratios[loop] = now / dt

    def changed(place: int, macro: Macro) -> Macro:
        loop = loops[place]
        if macro.word == "DT":
            return replace(macro, value=dt, source=None)
        if macro.word == "LOOP" and place in ratios:
            count = min(max(1.0, macro.value) * ratios[place], LONGEST)
            return replace(macro, value=float(max(1, math.ceil(count - 1e-9))), source=None)
        if macro.word in STORING and loop in ratios:
            count = min(every(macro) * ratios[loop], LONGEST)
            return replace(macro, value=float(max(1, round(count))), source=None)
        return macro

    macros = tuple(changed(place, macro) for place, macro in enumerate(deck.macros))
    return replace(deck, macros=macros)


def _innermost_loops(macros: Sequence[Macro]) -> list[int | None]:
    """Place of the innermost LOOP around each macro."""
    open_loops: list[int] = []
    found: list[int | None] = []
    for place, macro in enumerate(macros):
        if macro.word == "NEXT" and open_loops:
            open_loops.pop()
        found.append(open_loops[-1] if open_loops else None)
        if macro.word == "LOOP":
            open_loops.append(place)
    return found
