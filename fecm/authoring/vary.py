"""Values of a case applied to a deck or to its strike, of many cases as columns.

A card, a projectile and a strike for every case would take longer than its impact.  Here values of
cases are arrays.  Columns have only the cases whose values are certainly valid; the others get
their strike, or the reason why they have none, one by one from :mod:`fecm.authoring.strike`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.authoring.case import Case, CasesError, pair_of_text
from fecm.authoring.plates import PlateSetter, check_free_in_plane, free_in_plane
from fecm.authoring.strike import Strike, StrikeSetter, strike_of
from fecm.authoring.timing import stable_time_step, with_time_step
from fecm.authoring.values import (
    FAILURE_NAMES,
    PLATE_VALUES,
    REFINEMENT,
    STRIKE_VALUES,
    SweepValue,
    check_names,
    plate_values,
)
from fecm.deck import model
from fecm.deck.model import Deck
from fecm.mechanics.contact_law import ContactParameters, Law, stack_parameters
from fecm.mechanics.projectile import DeckProjectile, RigidMass
from fecm.problem.parts import constants_of, is_coupled, is_curved
from fecm.problem.problem import Problem
from fecm.problem.rules.contact import limits_of

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
    made = deck
    if objects is not None:
        at = pair_of_text("at", str(case["at"])) if "at" in case else None
        made = objects.with_plate(deck, at)
        if objects.plate is not None:  # which is struck there already
            case = {name: value for name, value in case.items() if name != "at"}
    for name, setter in _PLATE_SETTERS.items():
        if name in case:
            made = setter(made, case[name])
    if objects is not None:
        made = objects.with_strike(made)
    if not case.keys().isdisjoint(_STRIKE_SETTERS):
        made = strike_of_case(made, case).deck()
    if not is_coupled(deck) and is_coupled(made):
        made = free_in_plane(made)
    if is_curved(made) and not is_curved(deck):
        check_free_in_plane(made)
    return replace(_timed(deck, made, case), text="")


def strike_of_case(plate: Deck, case: Case) -> Strike:
    """Return the strike of a plate with the values of a case; those of the plate don't count."""
    made = strike_of(plate)
    for name, setter in _STRIKE_SETTERS.items():
        if name in case:
            made = setter(made, case[name])
    return made


def _timed(deck: Deck, made: Deck, case: Case) -> Deck:
    """Apply time step and duration to a deck with the other values of a case."""
    dt, duration = (float(case[n]) if n in case else None for n in ("dt", "duration"))
    if duration is not None and not duration > 0.0:
        raise CasesError(f"duration must be positive, not {duration:g}")
    if dt == 0.0:
        dt = stable_time_step(made)
    if dt is None and duration is None:
        return made
    given = all(macro.value for macro in deck.macros if macro.word == "DT")
    return with_time_step(made, dt, 0.0 if given else stable_time_step(deck), duration)


UNIT = RigidMass(1.0)
CONSTANTS = ("k", "alpha_p", "s_p", "q")
MASSES = ("mass", "rod_mass")
TABLED = {"velocity", "energy", *CONSTANTS, *MASSES, *FAILURE_NAMES}


class StrikeColumns(NamedTuple):
    """Strikes as arrays, (cases,) each."""

    velocity: Floats
    constants: ContactParameters[Floats]
    kinds: list[DeckProjectile]  # of projectiles; all rigid masses are a unit mass
    kind: NDArray[np.intp]  # places in them
    mass: Floats
    scale: Floats  # mass and stiffness over those of the kind
    toughness: Floats  # G_IIc, force/length; NaN without a DELA segment

    def of_cases(self, rows: NDArray[np.intp]) -> StrikeColumns:
        """Select some cases."""
        return StrikeColumns(
            velocity=self.velocity[rows],
            constants=self.constants.of_cases(rows),
            kinds=self.kinds,
            kind=self.kind[rows],
            mass=self.mass[rows],
            scale=self.scale[rows],
            toughness=self.toughness[rows],
        )


class StrikeTable(Mapping[int, Strike]):
    """Strikes by the numbers of their cases; each is made when it is asked for."""

    def __init__(
        self,
        plate: model.Deck,
        cases: Mapping[int, Case],
        own_law: Law | None,
        columns: StrikeColumns,
    ) -> None:
        self.plate, self.cases, self.own_law = plate, cases, own_law
        self.columns = columns

    def __getitem__(self, number: int) -> Strike:
        return strike_of_case(self.plate, self.cases[number])._replace(own_law=self.own_law)

    def __contains__(self, number: object) -> bool:
        return number in self.cases

    def __iter__(self) -> Iterator[int]:
        return iter(self.cases)

    def __len__(self) -> int:
        return len(self.cases)

    def part(self, start: int, numbers: Sequence[int]) -> StrikeTable:
        """The strikes of successive cases, given by their first row and their numbers."""
        rows = np.arange(start, start + len(numbers))
        cases = {number: self.cases[number] for number in numbers}
        return StrikeTable(self.plate, cases, self.own_law, self.columns.of_cases(rows))


def tabled(
    checked: Problem, numbers: Sequence[int], cases: Sequence[Case], own_law: Law | None
) -> Mapping[int, Strike]:
    """Strikes of the cases whose values are certainly valid; none if columns can't hold them."""
    own = strike_of(checked.deck)
    names = cases[0].keys() - plate_values(cases[0]).keys()
    if own.impact is None or own.indentation is None or not _holds(own, names):
        return {}
    values = {name: np.array([float(case[name]) for case in cases]) for name in names}
    columns, valid = _columns(own, own.indentation, values, len(cases))
    rows = np.flatnonzero(valid)
    try:  # what does not depend on these values is the same for all
        for row in rows[:1].tolist():
            strike_of_case(checked.deck, cases[row]).check(checked)
    except CasesError:
        return {}
    kept = {numbers[row]: cases[row] for row in rows.tolist()}
    if len(kept) < len(cases):
        columns = columns.of_cases(rows)
    return StrikeTable(checked.deck, kept, own_law, columns)


def _holds(own: Strike, names: Collection[str]) -> bool:
    """Whether columns can hold values of these names: a rod of another mass is another kind."""
    rigid = isinstance(own.projectile, RigidMass)
    return TABLED.issuperset(names) and (rigid or not {*MASSES}.intersection(names))


def _columns(
    own: Strike, law: model.Indentation, values: Mapping[str, Floats], count: int
) -> tuple[StrikeColumns, Bools]:
    """Columns of cases with values by name, the others of their deck; and which are valid."""
    projectile, rigid = own.projectile, isinstance(own.projectile, RigidMass)
    total = next((values[name] for name in MASSES if name in values), projectile.total_mass)
    mass = np.array(np.broadcast_to(total, count))
    valid = mass > 0.0
    velocity = np.array(np.broadcast_to(values.get("velocity", own.velocity), count))
    with np.errstate(all="ignore"):
        if "energy" in values:
            valid &= values["energy"] >= 0.0
            velocity = np.sqrt(2.0 * values["energy"] / mass)
        valid &= velocity >= 0.0
    given = [
        np.array(np.broadcast_to(values.get(name, constant), count))
        for name, constant in zip(CONSTANTS, law.values(), strict=True)
    ]
    for within, _ in limits_of(law.word, *given):
        valid &= within
    toughness = np.array(np.broadcast_to(values.get("giic", _toughness(own)), count))
    if "giic" in values:
        valid &= toughness > 0.0
    columns = StrikeColumns(
        velocity=velocity,
        constants=constants_of(law.word, *given),
        kinds=[UNIT if rigid else projectile],
        kind=np.zeros(count, dtype=np.intp),
        mass=mass,
        scale=mass if rigid else np.ones(count),
        toughness=toughness,
    )
    return columns, valid


def _toughness(one: Strike) -> float:
    """Toughness of a strike; NaN without a DELA segment."""
    return math.nan if one.delamination is None else one.delamination.toughness


def columns_of(strikes: Mapping[int, Strike]) -> StrikeColumns:
    """Columns of strikes."""
    if isinstance(strikes, StrikeTable):
        return strikes.columns
    made = list(strikes.values())
    units = [UNIT if isinstance(one.projectile, RigidMass) else one.projectile for one in made]
    kinds = {unit: place for place, unit in enumerate(dict.fromkeys(units))}
    mass = np.array([one.projectile.total_mass for one in made])
    return StrikeColumns(
        velocity=np.array([one.velocity for one in made]),
        constants=stack_parameters([one.law for one in made]),
        kinds=list(kinds),
        kind=np.array([kinds[unit] for unit in units], dtype=np.intp),
        mass=mass,
        scale=np.where([unit is UNIT for unit in units], mass, 1.0),
        toughness=np.array([_toughness(one) for one in made]),
    )


def split(strikes: Mapping[int, Strike], most: int) -> Iterator[Mapping[int, Strike]]:
    """Parts of strikes, of at most so many cases."""
    numbers = list(strikes)
    for start in range(0, len(numbers), most):
        some = numbers[start : start + most]
        if isinstance(strikes, StrikeTable):
            yield strikes.part(start, some)
        else:
            yield {number: strikes[number] for number in some}
