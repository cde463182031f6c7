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
from fecm.sweeps.cases import CasesError

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


def with_time_step(
    deck: Deck, dt: float | None, taken: float = 0.0, duration: float | None = None
) -> Deck:
    """Change every DT of a deck, and the loops so that the duration is kept, or is another.

    `taken` is the time step that DT 0 means in the deck; 0 if no DT is 0.  If the new one is None,
    every DT is kept; if it is not positive, only the DT cards change.  Macros that store rows keep
    approximately their number of rows.

    Raises CasesError if whole numbers of passes miss the duration by a step and by 1 %.
    """
    loops = _innermost_loops(deck.macros)
    before, _ = _duration(deck.macros, taken)
    share = 1.0 if duration is None or not before else duration / before
    ratios: dict[int, float] = {}
    now = 0.0
    for macro, loop in zip(deck.macros, loops, strict=True):
        if macro.word == "DT":
            now = macro.value or taken
        elif macro.word in STEPS and loop is not None and now > 0.0 and (dt is None or dt > 0.0):
            ratios[loop] = share * (1.0 if dt is None else now / dt)

    def changed(place: int, macro: Macro) -> Macro:
        loop = loops[place]
        if macro.word == "DT" and dt is not None:
            return replace(macro, value=dt, source=None)
        if macro.word == "LOOP" and place in ratios:
            count = min(max(1.0, macro.value) * ratios[place], LONGEST)
            return replace(macro, value=float(max(1, math.ceil(count - 1e-9))), source=None)
        if macro.word in STORING and loop in ratios:
            count = min(every(macro) * ratios[loop], LONGEST)
            return replace(macro, value=float(max(1, round(count))), source=None)
        return macro

    macros = tuple(changed(place, macro) for place, macro in enumerate(deck.macros))
    wanted, (made, step) = share * before, _duration(macros, taken)
    if ratios and abs(made - wanted) > max(0.01 * wanted, step):
        raise CasesError(
            f"the loops of the deck give the duration {made:.6g} instead of {wanted:.6g}; take all "
            "steps in one loop"
        )
    return replace(deck, macros=macros)


def _duration(macros: Sequence[Macro], taken: float) -> tuple[float, float]:
    """Time of all steps of a program, and its largest time step."""
    passes, total, now, largest = [1.0], 0.0, 0.0, 0.0
    for macro in macros:
        if macro.word == "LOOP":
            passes.append(passes[-1] * max(1.0, macro.value))
        elif macro.word == "NEXT" and len(passes) > 1:
            passes.pop()
        elif macro.word == "DT":
            now = macro.value or taken
        elif macro.word in STEPS:
            total, largest = total + passes[-1] * now, max(largest, now)
    return total, largest


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
