"""Back ends that compute impacts on one plate.

A linear plate is stepped once under a unit force, and every impact follows by convolution with its
response. A nonlinear plate is run in full for each impact, or reduced to some bending modes.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._machine import require_memory
from fecm._typing import Floats, Indices
from fecm.authoring.time_values import lengthened
from fecm.deck.macros import flat
from fecm.judge.limits import ENERGY_BALANCE
from fecm.mechanics import kernels
from fecm.mechanics.contact_law import HystereticLaw, Law
from fecm.mechanics.own_law import CaseByCase
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.build import build_model
from fecm.problem.problem import Problem
from fecm.results.metrics import BAND, EXPOSURES, GAGE, Projectiles, impact_metrics
from fecm.sweeps.checks import ADVANCED_BYTES
from fecm.sweeps.impact_columns import Impacts
from fecm.sweeps.in_full import (
    CasePeaks,
    judge_cases,
    run_in_full,
    thresholds_of,
    whole_force,
)
from fecm.sweeps.outcome import Outcome, merge, outcome_of
from fecm.sweeps.recovered import NOTHING, Measured, NeededTimes, Recovery
from fecm.sweeps.reduced import ReducedImpacts, by_halvings, duration_of_steps, reduced
from fecm.sweeps.responses import (
    ComputedImpacts,
    Hits,
    impacts,
    largest_sums,
    plate_response,
)
from fecm.sweeps.search import LONGER, UNTIL_OVER
from fecm.sweeps.task import Measure

# Contact forces that are computed before they are evaluated, where none are stored: 16 MB, which
# the C library keeps for the next ones and does not give back to the system.
FORCES = 2_000_000
# Coordinates of a reduced plate that are stored before they are evaluated: 32 MB.
MOST_STORED = 4_000_000


def only_impacts(checked: Problem, names: Collection[str] = ()) -> bool:
    """Return whether a program has only impact steps of one size, and the plate no other loads.

    `names` are the names of the values of cases; the time step ``dt`` replaces all sizes.
    """
    words = [macro.word for macro in flat(checked.program)]
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if "RODP" not in words or not sizes or words.index("DT") > words.index("RODP"):
        return False
    if len(sizes) > 1 and "dt" not in names:
        return False
    return {"EXCD", "TANG", "FORM", "SOLV"}.isdisjoint(words) and not checked.mesh.forces.any()


def shares_plate(checked: Problem, names: Collection[str] = ()) -> bool:
    """Return whether cases of a linear plate share a response: see :func:`only_impacts`."""
    return checked.deck.is_linear and only_impacts(checked, names)


@dataclass
class ImpulseResponse:
    """Back end for a linear plate, stepped once under a unit force; impacts by convolution."""

    problem: Problem
    measures: Sequence[Measure] = ()
    history: bool = True
    computes_together = True
    lengthens = True
    _longer: dict[float, ImpulseResponse] = field(default_factory=dict)

    @property
    def durations(self) -> Sequence[float]:
        """Factors on the duration of the program; see :class:`Backend`."""
        return UNTIL_OVER if self.problem.work.at_most else LONGER

    @cached_property
    def response(self) -> PlateResponse:
        """Response of the plate to a unit force."""
        return _plate_response(self.problem, gages=Measure.GAGES in self.measures)

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Compute impacts; see :class:`Backend`."""
        most = max(1, FORCES // self.response.steps)
        by_kernels = kernels.LIBRARY is not None and impacts.own_law is None
        if len(impacts) <= most or self.history or not by_kernels:  # NumPy likes many at a time
            return self._outcome(impacts, judged=judged)
        parts = np.split(np.arange(len(impacts)), range(most, len(impacts), most))
        outcomes = [self._outcome(impacts.select(rows), judged=judged) for rows in parts]
        return merge(outcomes, history=False)

    def _outcome(self, impacts: Impacts, *, judged: bool) -> Outcome:
        return _outcome_together(
            self.problem, self.response, self.measures, impacts, judged, history=self.history
        )

    def lengthened(self, factor: float) -> ImpulseResponse:
        """Return the back end of a run `factor` times as long."""
        if factor == 1:
            return self
        if factor not in self._longer:
            problem = lengthened(self.problem, factor)
            self._longer[factor] = ImpulseResponse(problem, self.measures, self.history)
        return self._longer[factor]


@dataclass
class BendingModes:
    """Back end for a nonlinear plate in some bending modes; impacts are advanced together."""

    problem: Problem
    measures: Sequence[Measure]
    modes: int
    history: bool = True
    # Halvings of the time step of all impacts, at least; None if each has as many as it needs.
    halvings: int | None = None
    longer_than: BendingModes | None = None  # the same plate in the program of the deck
    has_fields: bool = True  # without displacement fields, no outcome can be judged
    computes_together = False  # a search would try velocities far beyond the model

    @property
    def lengthens(self) -> bool:
        """Whether cases go on for longer: the program says so, as the reduction takes time."""
        return self.problem.work.at_most

    @property
    def durations(self) -> Sequence[float]:
        """Factors on the duration of the program; see :class:`Backend`."""
        return UNTIL_OVER if self.problem.work.at_most else LONGER

    @cached_property
    def plate(self) -> ReducedImpacts:
        """Impacts on the reduced plate; CasesError if it can't be reduced."""
        if self.longer_than is not None:
            return self.longer_than.plate.lasting(duration_of_steps(self.problem))
        return reduced(self.problem, self.modes, has_fields=self.has_fields)

    @cached_property
    def recovery(self) -> Recovery:
        """Evaluator of the plate's displacement fields."""
        if self.longer_than is not None:
            return self.longer_than.recovery
        fields = self.plate.plate.fields
        assert fields is not None
        return Recovery(self.problem, self.measures, fields)

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Compute impacts, together if their time steps are halved as often."""
        parts = []
        for times, rows in self._by_halvings(impacts).items():
            plate = ReducedResponse(self.plate.halved(times), self.recovery if judged else None)
            for some in np.array_split(rows, math.ceil(len(rows) / plate.most_cases)):
                parts.append(
                    _outcome_together(
                        self.problem,
                        plate,
                        self.measures,
                        impacts.select(some),
                        judged,
                        history=self.history,
                    )
                )
        return merge(parts, history=self.history)

    def _by_halvings(self, impacts: Impacts) -> Mapping[int, Indices]:
        """Group rows of impacts by the halvings of their time step."""
        groups = by_halvings(self.plate, impacts)
        if self.halvings is None:
            return groups
        return {max(self.halvings, *groups): np.arange(len(impacts))}

    def lengthened(self, factor: float) -> BendingModes:
        """Return the back end of a run `factor` times as long."""
        if factor == 1:
            return self
        return replace(self, problem=lengthened(self.problem, factor), longer_than=self)


@dataclass
class FullRuns:
    """Back end for any plate: one full run for each impact."""

    problem: Problem
    measures: Sequence[Measure] = ()
    computes_together = False
    lengthens = False
    durations = LONGER  # a run with OVER ends when it is decided

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Run each impact."""
        return merge([self._outcome(impacts, row) for row in range(len(impacts))])

    def _outcome(self, impacts: Impacts, row: int) -> Outcome:
        problem = replace(self.problem, deck=impacts.deck(row))
        (outcome,) = run_in_full(
            {impacts.numbers[row]: problem}, self.measures, law=impacts.own_law
        )
        return outcome

    def lengthened(self, factor: float) -> FullRuns:
        """Return the back end of a run `factor` times as long."""
        return replace(self, problem=lengthened(self.problem, factor)) if factor != 1 else self


class PlateResponse(NamedTuple):
    """Response of a plate to a unit force in its first step of size `dt`, and the mass it moves."""

    response: Floats
    dt: float
    node_mass: float
    mobility: float  # of the rigid motion, see :class:`~fecm.judge.validity.Judge`
    strains: dict[str, Floats]  # response of every gage that is measured, by the name of its column

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.response)

    def impacts(self, hits: Hits) -> ComputedImpacts:
        """Compute many impacts."""
        return impacts(self.response, self.dt, self.node_mass, hits, self.mobility)

    def measured(self, struck: ComputedImpacts, rows: Impacts) -> Measured:
        """Measure the gages in many impacts."""
        sums = ((name, largest_sums(r, struck.force)) for name, r in self.strains.items())
        return Measured({name: CasePeaks(*values) for name, values in sums}, {}, {})


@dataclass(frozen=True)
class ReducedResponse:
    """Impacts on a reduced plate, and what is measured in them; nothing without `recovery`."""

    plate: ReducedImpacts
    recovery: Recovery | None

    @property
    def dt(self) -> float:
        """Time step."""
        return self.plate.dt

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.plate.steps

    @cached_property
    def rows(self) -> NeededTimes | None:
        """Times at which the coordinates of the plate are needed."""
        return None if self.recovery is None else self.recovery.rows(self.dt, self.steps)

    @property
    def most_cases(self) -> int:
        """Number of cases whose coordinates are stored at once."""
        if self.rows is None:
            return MOST_STORED
        a_case = len(self.rows.times) * len(self.plate.plate.stiffness)
        return max(1, MOST_STORED // max(a_case, 1))

    def impacts(self, hits: Hits) -> ComputedImpacts:
        """Compute many impacts."""
        times = None if self.rows is None else self.rows.times
        return replace(self.plate, times=times).impacts(hits)

    def measured(self, struck: ComputedImpacts, rows: Impacts) -> Measured:
        """Measure many impacts."""
        if self.recovery is None or self.rows is None or struck.coordinates is None:
            return NOTHING
        decks = [rows.plate(row) for row in range(len(rows))]
        return self.recovery.measured(self.rows, struck.coordinates, struck.force, self.dt, decks)


def _plate_response(checked: Problem, *, gages: bool) -> PlateResponse:
    setup = build_model(checked)
    assert setup.impact is not None  # the program has impact steps
    load, steps = setup.impact.contact.load, checked.work.steps
    dt = next(macro.value for macro in flat(checked.program) if macro.word == "DT")
    dt = dt or taken_time_step(checked.critical_time_step)
    measured = setup.gages if gages else None
    names, sums = [], None
    if measured is not None:
        names = [f"{GAGE}{number}" for number in measured.numbers]
        sums = setup.motion.dof_sums(measured.dof_indices, measured.weights)
    with np.errstate(all="ignore"):
        response, strains = plate_response(setup.motion, load, dt, steps, sums)
    return PlateResponse(
        response,
        dt,
        1.0 / load.inverse_mass,
        checked.judge.mobility,
        dict(zip(names, strains, strict=True)),
    )


class _ByKind(NamedTuple):
    """Impacts sorted by the kind of their projectile."""

    numbers: list[int]
    rows: Impacts
    hits: Hits
    projectiles: Projectiles
    toughness: Floats
    back: NDArray[np.intp]  # rows in the order of the impacts


def _by_kind(impacts: Impacts) -> _ByKind:
    order = np.argsort(impacts.kind, kind="stable")
    rows = impacts.select(order)
    law: Law[Floats] = HystereticLaw(rows.constants)
    if rows.own_law is not None:
        law = CaseByCase(rows.own_law, len(rows))
    return _ByKind(
        numbers=rows.numbers,
        rows=rows,
        hits=Hits(rows.kinds, rows.kind, rows.scale, law, rows.velocity),
        projectiles=Projectiles(rows.mass, rows.velocity),
        toughness=rows.toughness,
        back=np.argsort(order),
    )


def _outcome_together(
    checked: Problem,
    plate: PlateResponse | ReducedResponse,
    measures: Sequence[Measure],
    impacts: Impacts,
    judged: bool,
    *,
    history: bool,
) -> Outcome:
    """Compute impacts on a plate; if judged, impacts with doubtful energies in full."""
    steps, dt = plate.steps, plate.dt
    require_memory(ADVANCED_BYTES * steps * len(impacts), f"{len(impacts)} cases of {steps} steps")
    with np.errstate(all="ignore"):
        ordered = _by_kind(impacts)
        struck = plate.impacts(ordered.hits)
        metrics = impact_metrics(
            struck.force,
            np.add.accumulate(np.full(steps, dt)),
            struck.indentation,
            ordered.projectiles,
            struck.plate,
            thresholds_of(checked, ordered.toughness),
            checked.judge.mobility,
            checked.symmetry.factor,
            checked.judge.plate_mass,
        )
        measured = plate.measured(struck, ordered.rows) if judged else NOTHING
    outcome = outcome_of(
        ordered.numbers,
        metrics,
        last=struck.force[-1],
        steps=steps,
        dt=dt,
        unsettled=struck.unconverged_steps,
        force=whole_force(struck.force.T, checked.symmetry.factor) if history else None,
    )
    largest = struck.indentation.largest
    judge_cases(
        outcome,
        checked,
        measures,
        metrics,
        peaks=measured.peaks,
        indentation=largest,
        largest=measured.largest,
    )
    columns = outcome.columns
    columns |= measured.columns
    # An exposure that is open has no band.
    exposures = [columns[name] for name in EXPOSURES if name in measured.peaks]
    for name in BAND if exposures else ():
        columns[name] = np.where(np.isnan(exposures).any(axis=0), np.nan, columns[name])
    outcome = outcome.select(ordered.back)

    settled = (struck.error < ENERGY_BALANCE.value) & (struck.unconverged_steps == 0)
    doubtful = ~settled[ordered.back]
    if not (judged and doubtful.any()):
        return outcome
    # Cases near the limits of a run are run in full, which accepts or rejects them.
    full = FullRuns(checked, measures).outcomes(impacts.select(np.flatnonzero(doubtful)))
    return merge([outcome.select(np.flatnonzero(~doubtful)), full])
