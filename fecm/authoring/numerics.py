"""Contact patch, transverse shear, time step and program of an impact."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from fecm._dataclasses import frozen
from fecm.api import load_deck
from fecm.authoring.contact import parse_patch
from fecm.authoring.parameters import ObjectError, check_positive
from fecm.deck.model import Allowables, Deck, Macro, Patch, Shear
from fecm.deck.outputs import PLY_ROWS, Rows, RowsOfPlies, with_outputs
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.points import HERTZ
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.generate import generate
from fecm.problem.parts import build_plate
from fecm.problem.problem import Problem
from fecm.problem.static_plate import contact_duration

ROWS = 200  # default number of stored rows of strains and displacements

# Elements whose ply stresses are stored with `damage`: those nearer to the load than so many times
# the distance within which plate theory does not hold, and at least so many.
AROUND_LOAD = 3.0
FEWEST_ELEMENTS = 24

AUTO = "auto"  # the default patch: a disc, or what a standard has
EQUI: Literal["equi"] = "equi"  # the shear stiffness from equilibrium
Quadrature = Literal["mitc", "full"]  # of the transverse shear
MITC: Quadrature = "mitc"
FULL: Quadrature = "full"


@frozen
class Numerics:
    """How an impact is computed."""

    patch: str | Patch | None = AUTO
    shear: Quadrature = MITC
    # Of the shear stiffness; by default EQUI with assumed strains, and the report's 1 without.
    shear_factor: float | Literal["equi"] | None = None
    duration: float | str | None = None
    dt: float | None = None
    every: int | None = None  # steps between stored rows
    plies: RowsOfPlies | None = None  # the same of ply stresses, with `damage` of some elements
    failure: Rows | None = None  # the same of failure exposures, by default as `every`
    damage: bool = False  # whether the deck is to show damage

    def contact_patch(self, *, prescribed: bool) -> Patch | None:
        """Contact patch; `prescribed` says whether a standard has the default one."""
        if self.patch == AUTO:
            return Patch(HERTZ) if prescribed else Patch()
        return parse_patch(self.patch) if isinstance(self.patch, str) else self.patch

    def shear_segment(self) -> Shear | None:
        """SHEA segment; None for the report's shear stiffness and quadrature."""
        factor, assumed = self.shear_factor, self.shear == MITC
        if factor is None:
            factor = EQUI if assumed else 1.0
        if factor == EQUI:
            return Shear(assumed=assumed, equilibrium=True)
        if isinstance(factor, str):
            raise ObjectError(f"`shear_factor` is {factor!r}, not a number or {EQUI}")
        check_positive(shear_factor=factor)
        return Shear(factor, assumed=assumed) if assumed or factor != 1.0 else None

    def time_step(self, deck: Deck) -> float:
        """Time step, by default 0.9 of the critical one."""
        if self.dt is not None:
            return self.dt
        mesh = generate(deck)
        if not mesh.number_of_equations:
            return 1.0  # the deck is refused later
        try:
            return rounded_time_step(critical_time_step(build_plate(deck, mesh)))
        except UnsoundPlateError:
            if load_deck(replace(deck, macros=self.program(deck, 1.0, 1.0))).errors():
                return 1.0  # the deck is refused later
            raise

    def program(
        self, deck: Deck, dt: float, duration: float, elements: int | None = None
    ) -> tuple[Macro, ...]:
        """Macro program of an impact; unless asked otherwise with ply stresses of `elements`."""
        steps = max(1, math.ceil(duration / dt - 1e-9))
        rows = float(self.every if self.every is not None else max(1, steps // ROWS))
        words = {"LMAS": 0.0, "DT": dt, "LOOP": float(steps), "TIME": 0.0}
        words |= {"RODP": rows, "DISP": rows, "NEXT": 0.0}
        macros = [Macro(word, value=value) for word, value in words.items()]
        failure = deck.has(Allowables) if self.failure is None else self.failure
        plies = self.plies
        if plies is None and elements is not None:
            plies = (max(1, steps // PLY_ROWS), elements)
        return with_outputs(macros, failure=failure, plies=plies)

    def with_program(self, deck: Deck, dt: float, duration: float | None) -> Deck:
        """The deck with its program; without a duration, it is longer than the contact.

        With `damage` and strengths the program also stores ply stresses around the load.
        """
        with_plies = self.damage and deck.has(Allowables)
        elements = None
        if duration is None or with_plies:
            loaded = load_deck(replace(deck, macros=self.program(deck, dt, dt)))
            if loaded.errors():  # the deck is refused later
                return replace(deck, macros=self.program(deck, dt, duration or dt))
            (problem,) = loaded.problems
            duration = contact_duration(problem) if duration is None else duration
            elements = elements_around_load(problem) if with_plies else None
        return replace(deck, macros=self.program(deck, dt, duration, elements))


def elements_around_load(problem: Problem) -> int:
    """Number of elements about the load in which the plies are most stressed, and those beside."""
    near = int((problem.distances < AROUND_LOAD * problem.reach_of_load).sum())
    return min(max(near, FEWEST_ELEMENTS), problem.deck.control.numel)
