"""Application of the values of a case to a deck, or to the strike on its plate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from fecm.authoring.case import Case, CasesError, pair_of_text
from fecm.authoring.plates import PlateSetter, check_free_in_plane, free_in_plane
from fecm.authoring.strike import Strike, StrikeSetter, strike_of
from fecm.authoring.timing import stable_time_step, with_time_step
from fecm.authoring.values import (
    PLATE_VALUES,
    REFINEMENT,
    STRIKE_VALUES,
    SweepValue,
    check_names,
)
from fecm.deck.model import Deck
from fecm.problem.parts import is_coupled, is_curved

if TYPE_CHECKING:
    from fecm.authoring.objects import Objects


_Setter = TypeVar("_Setter", PlateSetter, StrikeSetter)
# Values are applied in the order of the parts that they change, and then of the table. Exceptions:
# a layup takes the ply thickness of the deck, the centre of a patch needs the patch, and a mass or
# an energy needs the rest of the projectile.
_EARLY = ("layup", "angle")
_LATE = ("at", "mass", "rod_mass", "energy")


def _ordered_setters(variables: Iterable[SweepValue[_Setter]]) -> dict[str, _Setter]:
    def rank(variable: SweepValue[_Setter]) -> tuple[int, bool, int]:
        late = _LATE.index(variable.name) if variable.name in _LATE else -1
        return variable.changes, variable.name not in _EARLY, late

    return {variable.name: variable.setter for variable in sorted(variables, key=rank)}


_PLATE_SETTERS = _ordered_setters((REFINEMENT, *PLATE_VALUES))
_STRIKE_SETTERS = _ordered_setters(STRIKE_VALUES)


def apply_case(deck: Deck, case: Case, objects: Objects | None = None) -> Deck:
    """Return a deck with new parts, `objects`, and then with the values of a case.

    A layup takes the ply thickness of the deck, so more plies give a thicker plate. The thickness
    of the laminate scales all layers. A mass scales the density of a rod. A time step changes the
    number of steps, and the duration stays. The time step 0 is 0.9 of the critical time step of the
    case. A deck without a patch gets a disc.

    A deck with B = 0 may restrain u and v at every node, because they are zero anyway. If the case
    has B != 0, only nodes that restrain w restrain them, as in a deck of ``fecm new``.

    Raises CasesError if a value is invalid for this deck.
    """
    check_names(case)
    changed = deck
    if objects is not None:
        point = pair_of_text("at", str(case["at"])) if "at" in case else None
        changed = objects.with_plate(deck, point)
        if objects.plate is not None:  # the new plate has this impact point already
            case = {name: value for name, value in case.items() if name != "at"}
    for name, setter in _PLATE_SETTERS.items():
        if name in case:
            changed = setter(changed, case[name])
    if objects is not None:
        changed = objects.with_strike(changed)
    if not case.keys().isdisjoint(_STRIKE_SETTERS):
        changed = strike_of_case(changed, case).deck()
    if not is_coupled(deck) and is_coupled(changed):
        changed = free_in_plane(changed)
    if is_curved(changed) and not is_curved(deck):
        check_free_in_plane(changed)
    return replace(_apply_times(deck, changed, case), text="")


def strike_of_case(plate: Deck, case: Case) -> Strike:
    """Return the strike of a plate with the values of a case; ignore values of the plate."""
    strike = strike_of(plate)
    for name, setter in _STRIKE_SETTERS.items():
        if name in case:
            strike = setter(strike, case[name])
    return strike


def _apply_times(deck: Deck, changed: Deck, case: Case) -> Deck:
    """Apply the time step and the duration of a case to a deck that has its other values."""
    dt, duration = (float(case[n]) if n in case else None for n in ("dt", "duration"))
    if duration is not None and not duration > 0.0:
        raise CasesError(f"duration must be positive, not {duration:g}")
    if dt == 0.0:
        dt = stable_time_step(changed)
    if dt is None and duration is None:
        return changed
    is_fixed = all(macro.value for macro in deck.macros if macro.word == "DT")
    return with_time_step(changed, dt, 0.0 if is_fixed else stable_time_step(deck), duration)
