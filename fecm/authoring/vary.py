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
# Values are applied by what they change, and then in the order of the table, but for these: a layup
# takes the thickness of its plies from the deck, the centre of a patch needs the patch, and a mass
# or an energy need the rest of the projectile.
_EARLY = ("layup", "angle")
_LATE = ("at", "mass", "rod_mass", "energy")


def _in_order(variables: Iterable[SweepValue[_Setter]]) -> dict[str, _Setter]:
    def turn(variable: SweepValue[_Setter]) -> tuple[int, bool, int]:
        late = _LATE.index(variable.name) if variable.name in _LATE else -1
        return variable.changes, variable.name not in _EARLY, late

    return {variable.name: variable.setter for variable in sorted(variables, key=turn)}


_PLATE_SETTERS = _in_order((REFINEMENT, *PLATE_VALUES))
_STRIKE_SETTERS = _in_order(STRIKE_VALUES)


def apply_case(deck: Deck, case: Case, objects: Objects | None = None) -> Deck:
    """Return a deck with the values of a case, on top of objects.

    A layup uses the ply thickness of the deck, so that more plies give a thicker plate; the
    thickness of the laminate scales every layer.  A mass scales the density of a rod.  A time step
    changes the number of steps, so that the duration is kept; 0 is 0.9 of the critical time step of
    the case.

    A deck with B = 0 may restrain u and v at every node, because they are zero anyway.  If the case
    has B != 0, they are restrained only at the nodes that restrain w, as in a deck of ``fecm new``.

    A deck without a patch gets a disc.  Raises CasesError if a value is invalid for this deck.
    """
    check_names(case)
    changed = deck
    if objects is not None:
        at = pair_of_text("at", str(case["at"])) if "at" in case else None
        changed = objects.with_plate(deck, at)
        if objects.plate is not None:  # which is struck there already
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
    return replace(_timed(deck, changed, case), text="")


def strike_of_case(plate: Deck, case: Case) -> Strike:
    """Return the strike of a plate with the values of a case; values of the plate are ignored."""
    strike = strike_of(plate)
    for name, setter in _STRIKE_SETTERS.items():
        if name in case:
            strike = setter(strike, case[name])
    return strike


def _timed(deck: Deck, changed: Deck, case: Case) -> Deck:
    """Apply time step and duration to a deck with the other values of a case."""
    dt, duration = (float(case[n]) if n in case else None for n in ("dt", "duration"))
    if duration is not None and not duration > 0.0:
        raise CasesError(f"duration must be positive, not {duration:g}")
    if dt == 0.0:
        dt = stable_time_step(changed)
    if dt is None and duration is None:
        return changed
    are_fixed = all(macro.value for macro in deck.macros if macro.word == "DT")
    return with_time_step(changed, dt, 0.0 if are_fixed else stable_time_step(deck), duration)
