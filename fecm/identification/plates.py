"""Plates of fits: linear ones, whose forces are exact, and ones that stretch, in bending modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import ClassVar, NamedTuple, Self

import numpy as np

from fecm._errors import StudyError
from fecm._typing import Floats
from fecm.authoring.time_values import duration_of
from fecm.deck.model import Deck
from fecm.identification.alignment import IdentifyError
from fecm.problem.loading import sole_problem
from fecm.problem.problem import Problem
from fecm.results.sinks import MemorySink
from fecm.simulation.run import seconds_of_steps
from fecm.sweeps.backends import BendingModes, FullRuns, ImpulseResponse, only_impacts
from fecm.sweeps.impact_columns import Impacts
from fecm.sweeps.in_full import motion
from fecm.sweeps.outcome import About, Backend, Outcome
from fecm.sweeps.task import MODES

USUAL_RUNS = 5  # of fitted decks, and those of the errors of the plate


class ForceExpansion(NamedTuple):
    """Force of an impact, and its derivatives with respect to the values of the impact."""

    times: Floats  # from 0 on
    force: Floats  # (times,)
    place: Mapping[str, float]  # values of the impact
    slopes: Mapping[str, Floats]  # derivatives by name, (times,) each

    def at(self, trials: Sequence[Mapping[str, float]]) -> Floats:
        """Return the forces at the values of trials, (times, trials)."""
        columns = []
        for trial in trials:
            force = self.force
            for name, slope in self.slopes.items():
                force = force + (trial[name] - self.place[name]) * slope
            columns.append(force)
        return np.stack(columns, axis=1)

    def about(self, values: Mapping[str, float], run: Outcome) -> Self:
        """Return the expansion with the force of a run with these values, and these derivatives."""
        force = np.interp(self.times, *force_after(run), right=0.0)
        return self._replace(force=force, place=values)


@dataclass(frozen=True)
class ExactPlate:
    """Plate whose trial forces are exact: a linear plate, or a plate in full runs."""

    problem: Problem
    backend: Backend
    is_exact: ClassVar[bool] = True
    step: ClassVar[float] = 1e-3  # half that of central differences in scaled values of the impact
    settled: ClassVar[float] = 1e-7  # step of a fit, relative to the scaled parameters, at its end

    @property
    def modes(self) -> int:
        """Number of bending modes of the first trial forces; 0 if they are exact."""
        return 0

    def outcomes(self, impacts: Impacts, *, judged: bool) -> Outcome:
        """Compute impacts."""
        return self.backend.outcomes(impacts, judged=judged)

    def covering(self, duration: float) -> Self:
        """Return the plate in runs of a duration, if that saves time."""
        return self

    def forces(
        self, impacts: Impacts, values: Sequence[Mapping[str, float]]
    ) -> tuple[Floats, Floats]:
        """Return times from 0 on, and the forces of impacts with these values, (times, impacts).

        Raises IdentifyError if a full run fails.
        """
        outcome = self.outcomes(impacts, judged=False)
        if outcome.force is None:
            raise IdentifyError(outcome.status[0])
        dt = float(outcome.columns[About.DT][0])
        force = np.vstack([np.zeros(len(impacts)), outcome.force.T])
        return dt * np.arange(float(len(force))), force

    def near(self, expansion: ForceExpansion) -> ExpandedPlate:
        """Return the plate with forces of full runs near one."""
        return ExpandedPlate(self.problem, self.backend, self, expansion)

    @property
    def alone(self) -> ExactPlate:
        """The plate without a full run that gives its forces."""
        return self

    def like(self, deck: Deck) -> ExactPlate:
        """Return the plate of another deck, in runs as long as here."""
        return plate_of_fit(deck)

    def seconds_of_runs(self, parameters: int) -> float:
        """Return the seconds of the full runs of a fit of some values of the impact."""
        return 0.0


@dataclass(frozen=True)
class ModalPlate(ExactPlate):
    """Plate that stretches: trial forces by the reduced model, judged impacts by full runs."""

    backend: BendingModes
    share: float = 1.0  # duration of the runs, over that of the program
    is_exact: ClassVar[bool] = False
    # The force has fast vibrations, of some .1 % of the peak, which full runs don't have.  Their
    # phase changes as soon as k changes by .1 %.
    step: ClassVar[float] = 0.1
    settled: ClassVar[float] = 1e-2

    @property
    def modes(self) -> int:
        """Number of bending modes of the trial forces."""
        return self.backend.modes

    def outcomes(self, impacts: Impacts, *, judged: bool) -> Outcome:
        """Compute impacts; if judged, in full."""
        backend: Backend = self._full_runs if judged else self._trials
        return backend.outcomes(impacts, judged=judged)

    @cached_property
    def _full_runs(self) -> FullRuns:
        return FullRuns(self.problem).lengthened(self.share)

    @cached_property
    def _trials(self) -> BendingModes:
        return self.backend.lengthened(self.share)

    def covering(self, duration: float) -> Self:
        """Return the plate in runs of a duration; a program with OVER has steps for longer ones."""
        if not self.problem.work.at_most:
            return self
        return replace(self, share=min(1.0, duration / duration_of(self.problem)))

    def like(self, deck: Deck) -> ExactPlate:
        """Return the plate of another deck, in full runs as long as here."""
        problem = sole_problem(deck, warns=False)
        return ExactPlate(problem, FullRuns(problem).lengthened(self.share))

    def seconds_of_runs(self, parameters: int) -> float:
        """Return the seconds of the full runs of a fit, from some steps."""
        before, step = seconds_of_steps(
            lambda observer: motion([self.problem], MemorySink(), (), observers=[observer])
        )
        steps = self.backend.durations[0] * self.problem.work.steps
        return (USUAL_RUNS + parameters) * (before + step * steps)


@dataclass(frozen=True)
class ExpandedPlate(ExactPlate):
    """Plate with forces of full runs near one."""

    plate: ExactPlate
    expansion: ForceExpansion
    is_exact: ClassVar[bool] = False

    @property
    def modes(self) -> int:
        """Number of bending modes of the first trial forces."""
        return self.plate.modes

    def outcomes(self, impacts: Impacts, *, judged: bool) -> Outcome:
        """Compute impacts in full."""
        return self.plate.outcomes(impacts, judged=True)

    def forces(
        self, impacts: Impacts, values: Sequence[Mapping[str, float]]
    ) -> tuple[Floats, Floats]:
        """Return times from 0 on, and the forces at values, (times, values)."""
        return self.expansion.times, self.expansion.at(values)

    def near(self, expansion: ForceExpansion) -> ExpandedPlate:
        """Return the plate with forces of full runs near another one."""
        return replace(self, expansion=expansion)

    @property
    def alone(self) -> ExactPlate:
        """The plate without a full run that gives its forces."""
        return self.plate.alone

    def like(self, deck: Deck) -> ExactPlate:
        """Return the plate of another deck, in full runs as long as here."""
        return self.plate.like(deck)


def force_after(run: Outcome) -> tuple[Floats, Floats]:
    """Return times from 0 on, and the force of an outcome of one case."""
    assert run.force is not None
    (force,) = run.force
    dt = float(run.columns[About.DT][0])
    return dt * np.arange(len(force) + 1.0), np.append(0.0, force)


@lru_cache(maxsize=4)
def plate_of_fit(deck: Deck, *, replaces_law: bool = False) -> ExactPlate:
    """Return the plate of a deck.

    `replaces_law` says that a user's contact law replaces EXPE. Raises StudyError if impacts of the
    deck can't be fitted.
    """
    problem = sole_problem(deck, warns=False)
    if problem.plate.lifts:
        raise StudyError(
            "identify needs supports that hold, and the deck has UNIL, from which the plate lifts "
            "off: fit the test on supports that hold (fecm new --window held)"
        )
    if not only_impacts(problem):
        loads = "FORC, EXCD, TANG, FORM and SOLV"
        needed = f"impact steps (RODP) of one size, and a plate without {loads}"
        raise StudyError(f"identify needs {needed}")
    if problem.symmetry.lines:
        raise StudyError(
            "identify needs the whole plate, and the deck has lines of symmetry: a measured force "
            "is that of the whole plate, mass and k are those of the part"
        )
    if deck.is_linear:
        return ExactPlate(problem, ImpulseResponse(problem))
    if replaces_law:
        raise StudyError(
            "the contact law takes the place of EXPE, which the reduced model of a plate that "
            "stretches (NONL) needs: leave out the law, or NONL"
        )
    # With time steps of one size the forces are smooth functions of the trial values.
    modes = BendingModes(problem, (), MODES, has_fields=False, halvings=0)
    return ModalPlate(problem, modes)
