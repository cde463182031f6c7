"""Impacts on one plate as columns: velocity, contact law, projectile and toughness of many cases.

Building cards, a projectile and a strike for a case would take longer than computing its impact.
The values are therefore arrays, and the rules of the cards check whole arrays. Only an invalid case
is built, to get the message of its card.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats, Indices
from fecm.authoring.case import Case, CasesError
from fecm.authoring.strike_values import Strike, strike_of
from fecm.authoring.values import FAILURE_NAMES, OF_PLATE, strike_of_case, with_exposure_values
from fecm.deck import model
from fecm.deck.model import Deck
from fecm.mechanics.contact_law import ContactParameters, Law, stack_parameters
from fecm.mechanics.projectile import DeckProjectile
from fecm.problem.parts import constants_of
from fecm.problem.problem import Problem
from fecm.problem.rules.contact import limits_of

CONSTANTS = ("k", "alpha_p", "s_p", "q")
MASSES = ("mass", "rod_mass")
AS_COLUMNS = {"velocity", "energy", *CONSTANTS, *MASSES, *FAILURE_NAMES}


@dataclass(frozen=True)
class Impacts:
    """Impacts on one plate, one per row. All arrays are (rows,)."""

    numbers: list[int]  # numbers of the cases, ascending
    velocity: Floats
    constants: ContactParameters[Floats]
    kinds: list[DeckProjectile]  # different projectiles; see `_unit`
    kind: Indices  # index into `kinds`
    mass: Floats
    scale: Floats  # factor for the mass and the stiffness of the kind
    toughness: Floats  # G_IIc, force/length; NaN without a DELA segment
    factor: int  # symmetric parts of the plate, of which the deck has one with its part of the mass
    own_law: Law | None  # contact law of the user, instead of the constants
    cards: Callable[[int], Strike]  # impact of a row as cards
    plate: Callable[[int], Deck]  # deck of the plate, with the strengths of a row

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def energy(self) -> Floats:
        """Kinetic energy of the projectile that hits the whole plate, force*length."""
        return 0.5 * self.factor * self.mass * self.velocity**2

    def select(self, rows: NDArray[np.intp]) -> Impacts:
        """Return the impacts of some rows."""
        return replace(self._take(rows), numbers=[self.numbers[row] for row in rows.tolist()])

    def at_velocities(self, rows: NDArray[np.intp], velocity: Floats) -> Impacts:
        """Return the impacts of some rows at other velocities. A row may appear several times."""

        def cards(row: int) -> Strike:
            return self.cards(int(rows[row])).with_velocity(float(velocity[row]))

        trials, numbers = self._take(rows), list(range(len(rows)))
        return replace(trials, numbers=numbers, velocity=velocity, cards=cards)

    def deck(self, row: int) -> Deck:
        """Return the deck of the plate with the impact of a row."""
        return self.cards(row).deck()

    def _take(self, rows: NDArray[np.intp]) -> Impacts:
        return replace(
            self,
            velocity=self.velocity[rows],
            constants=self.constants.of_cases(rows),
            kind=self.kind[rows],
            mass=self.mass[rows],
            scale=self.scale[rows],
            toughness=self.toughness[rows],
            cards=lambda row: self.cards(int(rows[row])),
            plate=lambda row: self.plate(int(rows[row])),
        )


def impacts_of(
    checked: Problem, numbers: Sequence[int], cases: Sequence[Case], own_law: Law | None = None
) -> tuple[Impacts | None, dict[int, str]]:
    """Return the impacts of cases on the plate of a problem, and the faults of invalid cases.

    The impacts are None if no case is valid. The faults are texts by the number of the case.
    """
    impacts = _from_values(checked, numbers, cases, own_law)
    valid = set() if impacts is None else set(impacts.numbers)
    strikes: dict[int, Strike] = {}
    reasons: dict[int, str] = {}
    for number, case in zip(numbers, cases, strict=True):
        if number in valid:
            continue
        try:
            strike = strike_of_case(checked.deck, case)
            strike.check(checked)
            strikes[number] = strike
        except CasesError as error:
            reasons[number] = str(error)
    if not strikes:
        return impacts, reasons
    if impacts is not None:
        strikes |= {number: impacts.cards(row) for row, number in enumerate(impacts.numbers)}
    strikes = dict(sorted(strikes.items()))
    return impacts_from_cards(strikes, own_law, checked.symmetry.factor), reasons


def impacts_from_cards(
    strikes: Mapping[int, Strike], own_law: Law | None = None, factor: int = 1
) -> Impacts:
    """Return the impacts of strikes, given by the numbers of their cases.

    `factor` is the number of symmetric parts of the plate, of which the deck has one.
    """
    rows = list(strikes.values())
    units = [_unit(row.projectile) for row in rows]
    kinds = {unit: place for place, unit in enumerate(dict.fromkeys(units))}
    mass = np.array([row.projectile.total_mass for row in rows])
    return Impacts(
        numbers=list(strikes),
        velocity=np.array([row.velocity for row in rows]),
        constants=stack_parameters([row.law for row in rows]),
        kinds=list(kinds),
        kind=np.array([kinds[unit] for unit in units], dtype=np.intp),
        mass=mass,
        scale=mass / [unit.total_mass for unit in units],
        toughness=np.array([_toughness(row) for row in rows]),
        factor=factor,
        own_law=own_law,
        cards=rows.__getitem__,
        plate=lambda row: rows[row].plate,
    )


def _from_values(
    checked: Problem, numbers: Sequence[int], cases: Sequence[Case], own_law: Law | None
) -> Impacts | None:
    """Return the impacts of the valid cases; None if columns can't hold the values."""
    strike = strike_of(checked.deck)
    names = cases[0].keys() - OF_PLATE
    if strike.impact is None or strike.indentation is None or not _fits_columns(strike, names):
        return None
    values = {name: np.array([float(case[name]) for case in cases]) for name in names}
    factor = checked.symmetry.factor
    columns, valid = _columns(strike, strike.indentation, values, len(cases), factor)
    rows = np.flatnonzero(valid)
    try:  # everything else is the same for all cases, so one check is enough
        strike.check(checked)
    except CasesError:
        return None
    impacts = replace(
        columns,
        numbers=list(numbers),
        own_law=own_law,
        cards=lambda row: strike_of_case(checked.deck, cases[row]),
        plate=lambda row: with_exposure_values(checked.deck, cases[row]),
    )
    if len(rows) == len(cases):
        return impacts
    return impacts.select(rows) if len(rows) else None


def _fits_columns(strike: Strike, names: Collection[str]) -> bool:
    """Return whether columns can hold the values of these names.

    They can't hold the mass of a rod: a rod of another mass is another kind of projectile.
    """
    changes_mass = not {*MASSES}.isdisjoint(names)
    return AS_COLUMNS.issuperset(names) and (strike.projectile.scales or not changes_mass)


def _columns(
    strike: Strike,
    law: model.Indentation,
    values: Mapping[str, Floats],
    count: int,
    factor: int,
) -> tuple[Impacts, Bools]:
    """Return the columns of cases, and a mask of the valid cases.

    `values` has the values of the cases by name. The strike of the deck has all other values.
    `factor` is the number of symmetric parts of the plate: energies are those of the whole plate.
    """
    unit, stated_mass = _unit(strike.projectile), strike.projectile.total_mass
    total = next((values[name] for name in MASSES if name in values), stated_mass)
    mass = np.array(np.broadcast_to(total, count))
    valid = mass > 0.0
    velocity = np.array(np.broadcast_to(values.get("velocity", strike.velocity), count))
    with np.errstate(all="ignore"):
        if "energy" in values:
            valid &= values["energy"] >= 0.0
            velocity = np.sqrt(2.0 * values["energy"] / factor / mass)
        valid &= velocity >= 0.0
    stated = [
        np.array(np.broadcast_to(values.get(name, constant), count))
        for name, constant in zip(CONSTANTS, law.values(), strict=True)
    ]
    for within, _ in limits_of(law.word, *stated):
        valid &= within
    toughness = np.array(np.broadcast_to(values.get("giic", _toughness(strike)), count))
    if "giic" in values:
        valid &= toughness > 0.0
    columns = Impacts(
        numbers=[],
        velocity=velocity,
        constants=constants_of(law.word, *stated),
        kinds=[unit],
        kind=np.zeros(count, dtype=np.intp),
        mass=mass,
        scale=mass / unit.total_mass,
        toughness=toughness,
        factor=factor,
        own_law=None,
        cards=lambda row: strike,
        plate=lambda row: strike.plate,
    )
    return columns, valid


def _unit(projectile: DeckProjectile) -> DeckProjectile:
    """Return the projectile that stands for all multiples of a projectile in mass and stiffness."""
    return projectile.with_total_mass(1.0) if projectile.scales else projectile


def _toughness(strike: Strike) -> float:
    """Return the toughness of a strike; NaN without a DELA segment."""
    return math.nan if strike.delamination is None else strike.delamination.toughness
