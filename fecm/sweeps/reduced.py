"""Cases of a nonlinear plate in a few modes (the model ``reduced``), and full runs beside them.

:mod:`~fecm.mechanics.reduced_plate` has the theory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._errors import ResultFileError
from fecm._table import Row
from fecm._typing import Floats, Indices
from fecm._watch import Watch
from fecm.authoring.case import CasesError
from fecm.authoring.time_values import step_of
from fecm.authoring.values import strike_of_case
from fecm.mechanics.contact_law import ContactPoint
from fecm.mechanics.impact import ContactState, couple_step
from fecm.mechanics.impact_sweep import sweep_reduced
from fecm.mechanics.plate import ASSEMBLED, PlateModel
from fecm.mechanics.reduced_plate import (
    MOST_STATIC,
    SAME_TIME,
    VECTORS,
    ReducedMotion,
    ReducedPlate,
    ReductionError,
    SeriesLaw,
    StoredTimes,
    bytes_of_pairs,
    motion_struct,
    reduced_plate,
)
from fecm.problem.memory import factor_bytes
from fecm.problem.problem import Problem
from fecm.results.metrics import EXPOSURES, GAGE, RATIO, IndentationMetrics
from fecm.results.schema import SWEEP_DATASETS
from fecm.sweeps.impact_columns import Impacts
from fecm.sweeps.outcome import About, Column, Outcome, merge
from fecm.sweeps.responses import (
    BLOCK,
    ComputedImpacts,
    Convolution,
    DeflectionRecord,
    Hits,
    TipState,
    TipSteps,
    Work,
    balance_errors,
    by_kernel,
    known_constants,
)
from fecm.sweeps.task import Method, Plan, Prepared, RunTasks, Task, tasks

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import FileContents


# Time step times the angular frequency of the fastest bending vector, of the contact on the plate,
# and of the projectile on the contact.
MODE_PHASE = 1.0
PLATE_PHASE = 1.5
PROJECTILE_PHASE = 0.2
# A contact that is still stiffer is left to the balance of energy.
MOST_HALVINGS = 10
MOST_MODES = 40


@dataclass(frozen=True)
class ReducedImpacts:
    """ComputedImpacts on a reduced plate with one time step."""

    plate: ReducedPlate
    dt: float
    steps: int
    times: Floats | None = None  # (rows,): times at which the coordinates are stored, ascending

    def halved(self, times: int) -> ReducedImpacts:
        """Return these impacts with a time step that is halved `count` times."""
        return replace(self, dt=self.dt / 2**times, steps=self.steps * 2**times)

    def lasting(self, duration: float) -> ReducedImpacts:
        """Return these impacts with a duration, in steps of the same size."""
        return replace(self, steps=math.ceil(duration / self.dt * (1.0 - SAME_TIME)))

    def impacts(self, hits: Hits) -> ComputedImpacts:
        """Compute impacts."""
        if (constants := known_constants(hits.law)) is not None:
            stored = self.stored
            kernel = partial(sweep_reduced, motion_struct(self.plate, self.dt, stored))
            shape = len(stored.step), len(self.plate.stiffness)
            return by_kernel(kernel, self.steps, self.dt, hits, constants, stored=shape)
        return self.by_numpy(hits)

    @property
    def stored(self) -> StoredTimes:
        """Steps in which the stored times lie."""
        times = np.empty(0) if self.times is None else self.times
        return StoredTimes.of(times, self.dt, self.steps)

    def by_numpy(self, hits: Hits) -> ComputedImpacts:
        """Compute impacts step by step, all cases together."""
        cases = len(hits.speed)
        flexibility, none = self.plate.flexibility, np.zeros(cases)
        law = SeriesLaw(hits.law, flexibility)
        motion = ReducedMotion(self.plate, self.dt, cases)
        tips = TipSteps(hits, self.dt, self.steps)
        sums = Convolution(tips.responses[None], hits.kind)
        state = ContactState(
            rod=TipState(none, -hits.speed, none),
            memory=law.start(),
            contact=ContactPoint(none, none),
            plate_w=none,
            contact_work=np.zeros(cases),  # summed in place
            unconverged_steps=np.zeros(cases, dtype=np.int64),
        )
        force, deepest, w, work = np.empty((self.steps, cases)), none, none, none
        record = DeflectionRecord(tips)
        done: list[Floats] = []
        ends, backs = self.stored
        coordinates = np.empty((cases, len(ends), len(self.plate.stiffness)))
        for step in range(self.steps):
            moved = motion.advance(state.contact.force)
            for row in np.flatnonzero(ends == step):
                coordinates[:, row] = motion.coordinates(float(backs[row]))
            (tips.sums,) = sums.next()
            couple_step(tips, law, state, moved)
            sums.give(state.contact.force)
            last, before = force[step - 1] if step else none, w
            force[step] = state.contact.force
            w = moved + flexibility * state.contact.force
            work = work + 0.5 * (last + force[step]) * (w - before)
            deepest = np.maximum(deepest, law.of_law(state.contact).indentation)
            record.add(w, work, w)
            if not (step + 1) % BLOCK or step + 1 == self.steps:
                done.append(state.contact_work + motion.energy(state.contact.force))
        permanent = law.permanent(state.memory, state.contact)
        last = law.of_law(state.contact).indentation
        return ComputedImpacts(
            force=force,
            indentation=IndentationMetrics(deepest, last, permanent, state.contact_work),
            unconverged_steps=state.unconverged_steps,
            plate=record.deflection,
            error=balance_errors(force, Work(np.array(done), none), tips),
            coordinates=coordinates,
        )


def reduced(checked: Problem, modes: int, *, has_fields: bool = True) -> ReducedImpacts:
    """Return impacts on the plate of a problem, reduced to bending modes.

    Raises CasesError if that is not possible.
    """
    return impacts_on(reduced_to(checked, modes, has_fields=has_fields), checked)


def duration_of_steps(checked: Problem) -> float:
    """Return the duration of all steps of a problem, whose steps have one size."""
    return step_of(checked) * checked.work.steps


def impacts_on(plate: ReducedPlate, checked: Problem) -> ReducedImpacts:
    """Return impacts on a reduced plate, as long as those of a problem."""
    duration = duration_of_steps(checked)
    steps = math.ceil(duration * plate.fastest / MODE_PHASE)
    return ReducedImpacts(plate, duration / steps, steps)


def reduced_to(checked: Problem, modes: int, *, has_fields: bool = True) -> ReducedPlate:
    """Reduce the plate of a problem to bending modes.

    Raises CasesError if that is not possible.
    """
    assert checked.contact is not None  # the program has impact steps
    try:
        return reduced_plate(
            checked.plate, checked.contact, modes, checked.damping, has_fields=has_fields
        )
    except ReductionError as error:
        raise CasesError(str(error)) from None


def by_halvings(model: ReducedImpacts, impacts: Impacts) -> Mapping[int, Indices]:
    """Group rows of impacts by the halvings of the time step that resolve their contact."""
    largest = np.maximum(largest_time_steps(model.plate, impacts), model.dt / 2**MOST_HALVINGS)
    times = np.maximum(0, np.ceil(np.log2(model.dt / largest))).astype(int)
    return {number: np.flatnonzero(times == number) for number in np.unique(times).tolist()}


def largest_time_steps(plate: ReducedPlate, impacts: Impacts) -> Floats:
    """Return the largest time steps that resolve the contacts, (rows,); infinite at velocity 0.

    The contact is at most as stiff as at the force that all of the energy would give, in loading or
    unloading, and in series with the omitted modes.
    """
    law, energy = impacts.constants, 0.5 * impacts.mass * impacts.velocity**2
    force = (2.5 * energy * law.k ** (2.0 / 3.0)) ** 0.6  # of (2/5) F^(5/3)/k^(2/3)
    indentation = (force / law.k) ** (2.0 / 3.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        width = indentation - law.permanent(indentation)
        compliance = np.minimum(indentation / 1.5, width / law.q) / force + plate.flexibility
    mobility = float((plate.deflection**2).sum())
    element_times = np.array([kind.element_time for kind in impacts.kinds])[impacts.kind]
    steps = [
        PLATE_PHASE * np.sqrt(compliance / mobility),
        PROJECTILE_PHASE * np.sqrt(compliance * impacts.mass),
        element_times,
    ]
    return np.where(indentation > 0.0, np.minimum.reduce(steps), np.inf)


GROUP = "reduced"
LIMIT = 0.02  # largest difference of the peaks, relative to the full run
TRIALS = 3  # cases that are run in full where the model holds
MEASURED_TRIALS = ("exposure", "gage_strain")
TRIAL_COLUMNS = tuple(d.name for d in SWEEP_DATASETS.values() if d.group == GROUP)


class MisfitError(CasesError):
    """The reduced model differs too much from full runs."""


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """Reduced model of a sweep, beside full runs of some of its cases.

    Attributes
    ----------
    modes : int
        Largest number of bending modes.
    columns : dict of ndarray (n,)
        Columns of the cases that were also run in full: ``case``, their numbers; ``peak_force`` and
        ``deflection_ratio`` by the model; ``full_peak_force`` and ``full_deflection_ratio`` by the
        full runs. Where they are measured, ``exposure`` and ``gage_strain`` are those of the
        criterion and of the gage that differ most.
    limit : float
        Largest difference that is allowed, relative to the full run.
    in_full : int
        Number of cases, with the largest energies, that were run in full because the model differs
        too much.
    """

    modes: int
    columns: dict[str, Column]
    limit: float = LIMIT
    in_full: int = 0

    def difference(self, name: str) -> Column:
        """Return the relative difference of the model from the full runs, (n,)."""
        full = self.columns[f"full_{name}"]
        return np.asarray((self.columns[name] - full) / full)

    @property
    def _modes(self) -> str:
        return f"{self.modes} mode{'' if self.modes == 1 else 's'}"

    def rows(self) -> Iterator[Row]:
        """Yield the rows about the model for the summary of the sweep."""
        yield ("reduced model", f"{self._modes} of bending; difference from full runs:")
        brief = {"peak_force": ("peak", 2), RATIO: ("w", 3)}
        brief |= {name: (name.replace("_", " "), 2) for name in self.measured}
        differences = [self.difference(name) for name in brief]
        for case, *values in zip(self.columns["case"], *differences, strict=True):
            parts = [
                f"{word} open" if np.isnan(value) else f"{word} {value:+.{digits}%}"
                for (word, digits), value in zip(brief.values(), values, strict=True)
            ]
            yield ("", f"{', '.join(parts)} (case {case})")
        if self.in_full:
            cases = "1 case" if self.in_full == 1 else f"{self.in_full} cases"
            yield ("", f"{cases} of the largest energies: in full, as above {self.limit:.0%}")

    @property
    def measured(self) -> list[str]:
        """Names of the measured quantities that were compared."""
        return [name for name in MEASURED_TRIALS if name in self.columns]

    def check(self) -> None:
        """Raise MisfitError if a quantity differs by more than the limit."""
        name, _ = self._worst
        if not abs(self.difference(name)).max() <= self.limit:
            raise MisfitError(f"{self._misfit}; at most {self.limit:.0%} is allowed")

    @property
    def note(self) -> str:
        """Sentence about the cases that are run in full, and the reason."""
        cases = f"the {self.in_full} cases of the largest energies are"
        if self.in_full == 1:
            cases = "the case of the largest energy is"
        more = "" if self.modes >= MOST_MODES else "; with more modes they may be fewer"
        return f"{self._misfit}: {cases} run in full{more}"

    @property
    def _misfit(self) -> str:
        """Largest difference of a quantity."""
        name, worst = self._worst
        return (
            f"the {name.replace('_', ' ')} of the reduced model with {self._modes} differs by "
            f"{self.difference(name)[worst]:+.1%} from the full run of case "
            f"{self.columns['case'][worst]}"
        )

    @property
    def _worst(self) -> tuple[str, int]:
        """Quantity with the largest difference, and its row."""
        rows = {
            name: int(np.nan_to_num(np.abs(self.difference(name))).argmax())
            for name in ("peak_force", *self.measured)
        }
        return max(
            rows.items(), key=lambda item: np.nan_to_num(abs(self.difference(item[0])[item[1]]))
        )


def by_energy(definition: Plan) -> list[int]:
    """Return the cases with an energy, the smallest first.

    Raises CasesError if no case has an energy.
    """
    energies: list[tuple[float, int]] = []
    for number, case in enumerate(definition.cases):
        with suppress(CasesError):  # the case will fail
            energies.append((strike_of_case(definition.settings.deck, case).energy, number))
    ordered = [number for energy, number in sorted(energies) if energy > 0.0]
    if not ordered:
        raise CasesError("no case has an energy, so the reduced model can't be checked")
    return ordered


class Trials:
    """Cases that were run in full, by the method `in_full`, and by the model.

    The tasks of case n have the numbers `count` + 2 n and, by the model, `count` + 2 n + 1: they
    follow the numbers of the tasks of all `count` cases. `limit` is the largest difference.
    """

    def __init__(self, definition: Plan, in_full: Method, limit: float, run: RunTasks) -> None:
        self._definition, self._in_full, self._run = definition, in_full, run
        self._limit = limit
        self._fulls: dict[int, Outcome] = {}
        self._models: dict[int, Outcome] = {}

    def full_run(self, case: int) -> Task:
        """Return the task of the full run of a case."""
        return self._task(self._in_full, case, 0)

    def _task(self, method: Method, case: int, place: int) -> Task:
        cases = self._definition.cases
        number = len(cases) + 2 * case + place
        return Task(self._definition.settings, method, number, (case,), (cases[case],))

    def failing(self, cases: Iterable[int]) -> set[int]:
        """Run cases that have not been run, and return those for which the model fails."""
        pairs = [
            (self.full_run(case), self._task(self._definition.method, case, 1))
            for case in dict.fromkeys(cases)
            if case not in self._fulls
        ]
        if pairs:
            outcomes = {task.number: outcome for task, outcome in self._run([*chain(*pairs)])}
            for full_task, model_task in pairs:
                (case,) = full_task.numbers
                self._fulls[case] = outcomes[full_task.number]
                self._models[case] = outcomes[model_task.number]
        full, model = self._merged()
        forces = [part.columns[About.REACHED] for part in (model, full)]
        fits = np.abs(forces[0] - forces[1]) <= self._limit * forces[1]
        for modelled, in_full in measured_pairs(model, full).values():
            fits &= ~(np.abs(modelled - in_full) > self._limit * in_full)  # open values fit
        holds = ~full.fine | (model.fine & fits)
        return {number for number, part in zip(full.numbers, holds, strict=True) if not part}

    def _merged(self) -> tuple[Outcome, Outcome]:
        """Return the outcomes of the full runs, and of the model."""
        parts = [*self._fulls.values()], [*self._models.values()]
        full, model = (merge(outcomes, history=False) for outcomes in parts)
        return full, model

    def compared(self) -> ReducedModel:
        """Compare the model with the full runs.

        Raises CasesError if all failed.
        """
        return compared(self._definition.settings.modes, *self._merged(), self._limit)

    def outcomes(self) -> Iterator[tuple[Task, Outcome]]:
        """Yield the tasks of the full runs and their outcomes."""
        return ((self.full_run(case), outcome) for case, outcome in self._fulls.items())


def tasks_beside_full_runs(
    definition: Plan, in_full: Method, limit: float, run: RunTasks, watch: Watch
) -> Prepared:
    """Compare the reduced model with full runs, and return the tasks by the model or in full.

    Raises MisfitError if the model holds for no case, and CasesError if it can't be checked.
    """
    ordered = by_energy(definition)
    tried = Trials(definition, in_full, limit, run)
    held = count_held(ordered, tried.failing)
    model = replace(tried.compared(), in_full=len(ordered) - held)
    if not held:
        model.check()
    beyond = set(ordered[held:])
    if not beyond:
        return Prepared(tasks(definition), model)
    watch.note(model.note)
    rest = [case for case in range(len(definition.cases)) if case not in beyond]
    fulls = [tried.full_run(case) for case in sorted(beyond)]
    computed = [(task, part) for task, part in tried.outcomes() if beyond.issuperset(task.numbers)]
    return Prepared([*tasks(definition, rest), *fulls], model, computed)


def tasks_in_full(definition: Plan, in_full: Method) -> list[Task]:
    """Return the tasks of full runs of all cases, with numbers after those of :class:`Trials`."""
    first = 3 * len(definition.cases)
    whole = tasks(replace(definition, method=in_full))
    return [replace(task, number=first + task.number) for task in whole]


def tasks_of_search(definition: Plan, in_full: Method, limit: float, run: RunTasks) -> Prepared:
    """Search the velocities of cases by the model, and confirm the highest energy by a full run.

    Raises MisfitError if the model does not hold there, and CasesError if it can't be checked.
    """
    whole = tasks(definition)
    done = run(whole)
    outcome = merge([part for _, part in done], history=False)
    energies = outcome.columns.get("found_energy", np.full(len(outcome.numbers), np.nan))
    if np.isnan(energies).all():  # the cases have their reasons
        return Prepared(whole, outcomes=done)
    row = int(np.nanargmax(energies))
    case = outcome.numbers[row]
    velocity = float(outcome.columns["found_velocity"][row])
    settings = replace(definition.settings, search=None)
    values = {**definition.cases[case], "velocity": velocity}
    count = len(definition.cases)
    pair = [
        Task(settings, method, count + place, (case,), (values,))
        for place, method in enumerate((in_full, definition.method))
    ]
    confirmed = {task.number: part for task, part in run(pair)}
    model = compared(settings.modes, confirmed[count], confirmed[count + 1], limit)
    model.check()
    return Prepared(whole, model, done)


def count_held(ordered: Sequence[int], failing: Callable[[Iterable[int]], set[int]]) -> int:
    """Count the cases, ordered by energy, for which the model holds; the others are run in full.

    The model fits worst where the plate bends most. The case of the largest energy is therefore
    tried first. If it fails and the case of the smallest energy holds, bisection finds the last
    case that holds. A case in the middle is tried too.
    """
    held = len(ordered)
    if failing(ordered[-1:]):
        held -= 1
        if ordered[0] in failing(ordered[:1]):
            return 0
        low = min(1, held)
        while low < held:
            middle = (low + held) // 2
            if ordered[middle] in failing([ordered[middle]]):
                held = middle
            else:
                low = middle + 1
    if held:
        wrong = failing([ordered[0], ordered[held // 2]])
        held = next((n for n in range(held) if ordered[n] in wrong), held)
    return held


def compared(modes: int, full: Outcome, model: Outcome, limit: float = LIMIT) -> ReducedModel:
    """Compare outcomes of the trials.

    Raises CasesError if all failed.
    """
    fine = np.flatnonzero(full.fine & model.fine)
    if not len(fine):
        (failed, *_) = (outcome for outcome in (model, full) if not outcome.fine.all())
        reason = failed.status[int(np.flatnonzero(~failed.fine)[0])]
        raise CasesError(f"the reduced model can't be checked by full runs: {reason}")
    full, model = full.select(fine), model.select(fine)
    return ReducedModel(
        modes,
        {
            "case": np.array(full.numbers),
            "peak_force": model.columns[About.REACHED],
            "full_peak_force": full.columns[About.REACHED],
            RATIO: model.columns[RATIO],
            f"full_{RATIO}": full.columns[RATIO],
            **{
                f"{prefix}{name}": values
                for name, pair in measured_pairs(model, full).items()
                for prefix, values in zip(("", "full_"), pair, strict=True)
            },
        },
        limit,
    )


def measured_pairs(model: Outcome, full: Outcome) -> dict[str, tuple[Floats, Floats]]:
    """Return the exposure, and the strain of a gage, that differ most in each case.

    They are those by the model and by the full runs. Differences of gages are compared with the
    largest strain of all gages, so that a gage which is hardly strained does not count.
    """
    pairs = {}
    gages = [name for name in full.columns if name.startswith(GAGE)]
    exposures = [name for name in EXPOSURES if name in full.columns]
    for quantity, names in zip(MEASURED_TRIALS, (exposures, gages), strict=True):
        names = [name for name in names if name in model.columns]
        if not names:
            continue
        of_model, in_full = (
            np.array([part.columns[name] for name in names]) for part in (model, full)
        )
        if quantity == "gage_strain":
            least = np.nanmax(in_full, axis=0, initial=0.0)
            of_model, in_full = of_model + (least - in_full), np.broadcast_to(least, in_full.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            worst = np.nan_to_num(np.abs(of_model / in_full - 1.0)).argmax(axis=0)
        rows = np.arange(len(worst))
        pairs[quantity] = of_model[worst, rows], in_full[worst, rows]
    return pairs


def reduced_attributes(model: ReducedModel) -> dict[str, Any]:
    """Return the attributes of the group in the file."""
    in_full = {"in_full": model.in_full} if model.in_full else {}
    return {"modes": model.modes, "limit": model.limit, **in_full}


def reduced_of(contents: FileContents) -> ReducedModel | None:
    """Return the reduced model of a sweep's file, None without one.

    Raises ResultFileError if it is incomplete.
    """
    if GROUP not in contents.groups:
        return None
    try:
        about = contents.groups[GROUP]
        modes, in_full = int(about["modes"]), int(about.get("in_full", 0))
        limit = float(about.get("limit", LIMIT))  # earlier files lack it
        columns = {
            name: contents[f"{GROUP}/{name}"]
            for name in TRIAL_COLUMNS
            if name.removeprefix("full_") not in MEASURED_TRIALS or f"{GROUP}/{name}" in contents
        }
    except (KeyError, ValueError, TypeError) as error:
        message = f"{contents.path}: what is stored of the reduced model is incomplete ({error})"
        raise ResultFileError(message) from None
    if len({np.shape(values) for values in columns.values()}) != 1:
        raise ResultFileError(f"{contents.path}: columns of the reduced model differ in length")
    return ReducedModel(modes, columns, limit, in_full)


def reduction_bytes(model: PlateModel, modes: int) -> int:
    """Return the bytes of the reduction of a plate to some bending modes."""
    n, in_plane = model.neq, int(np.count_nonzero(model.mesh.equations[:, :2]))
    vectors = 2 * min(n, VECTORS * modes)
    factors = factor_bytes(model, {"TANG"})
    return (
        ASSEMBLED * model.entries
        + factors
        + 8 * n * vectors
        + bytes_of_pairs(model, in_plane, modes + MOST_STATIC)
    )
