"""Place and force of an impact on a plate that stretches (NONL).

Its strains are not a sum of responses to the force. The reduced plate at a place
(:mod:`fecm.mechanics.reduced_plate`) gives the strains of a force history, and their derivatives
with respect to the values of the force and to the place. A Gauss-Newton iteration starts at the
place and force found on the linear plate. Runs of the whole plate under the fitted force then
correct the strains, until the place hardly moves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.deck.model import Gages, Nonlinear
from fecm.judge.locations import BEYOND_PLATE, UNCONFIRMED_STRAINS, UNSETTLED_PLACE
from fecm.location.fit import LocationFit, PlaceTrial, is_determined
from fecm.location.location import LocateError
from fecm.location.model import StrainModel, moving_plate
from fecm.location.prepare import steps_between
from fecm.location.search import Region
from fecm.mechanics.impact import ImpactConditions, ImpactSystem
from fecm.mechanics.interpolation import NDOF, W
from fecm.mechanics.plate_motion import AppliedForce, PlateMotion
from fecm.mechanics.points import gages
from fecm.mechanics.projectile import RigidMass
from fecm.mechanics.reduced_plate import (
    ReducedMotion,
    ReductionError,
    reduced_plate,
    small_products,
)
from fecm.problem.loading import sole_problem
from fecm.problem.problem import Problem
from fecm.sweeps.responses import NO_FORCE
from fecm.sweeps.task import MODES

# Error of the strains of the linear plate, over the largest, up to which its derivatives are taken.
NEARLY_LINEAR = 0.2
PASSES = 6  # most passes of the iteration with the reduced plate
NEAR = 0.25  # change of the place in a pass, over the side of an element, that ends the iteration
MOST_RUNS = 5  # of the whole plate; derivatives that need more are too far off
SETTLED = 0.2  # effect of a run of the whole plate on the place, in standard deviations
PHASE = 1.0  # time step of the reduced plate times its largest angular frequency
# Changes for derivatives: of a value of the force, over the peak; of the place, over an element.
CHANGE, MOVE = 0.01, 0.05

# Strains at a place, (cases, gages, samples), of values (hats, cases) of a model's narrow hats.
StrainsOf = Callable[[Floats, StrainModel, Floats], Floats]


def linear_problem(problem: Problem) -> Problem:
    """Return the problem without NONL."""
    if not problem.plate.nonlinear:
        return problem
    deck = problem.deck
    kept = tuple(s for s in deck.segments if not isinstance(s, Nonlinear))
    return sole_problem(replace(deck, segments=kept, text=""), warns=False)


@dataclass(frozen=True)
class StretchingModel(StrainModel):
    """Strains of a plate that stretches, linear in force and place about one of its motions."""

    place: tuple[float, float]
    force: Floats  # of the motion, values of narrow hats
    motion: Floats  # strains, (gages, samples)
    tangent: Floats  # derivatives with respect to the narrow hats, (gages, samples, narrow hats)
    slopes: Floats  # derivatives with respect to x and y, (2, gages, samples)

    def every_hat(self, x: float, y: float, shift: float) -> Floats:
        """Return the derivatives of the strains, (gages, hats, samples).

        They change with the place so that the force of the motion has the strains of the place.
        """
        moved = np.tensordot(np.array([x, y]) - self.place, self.slopes, 1)
        size = float(self.force @ self.force) or 1.0
        tangent = self.tangent + moved[:, :, None] * (self.force / size)
        gages, samples, narrow = tangent.shape
        every = small_products(tangent.reshape(-1, narrow), self.narrow_hats)
        return every.reshape(gages, samples, -1).swapaxes(1, 2)

    @property
    def narrow_hats(self) -> Floats:
        """Share of each hat in the narrow ones, (narrow hats, hats)."""
        narrow = np.arange(1, len(self.force) + 1) * self.unit
        peaks = np.arange(1, self.hats + 1) * self.width
        return np.asarray(np.maximum(1.0 - np.abs(narrow[:, None] - peaks) / self.width, 0.0))

    @property
    def constant(self) -> Floats:
        """Strains that do not depend on the force, (gages, samples)."""
        return np.asarray(self.motion - np.einsum("gsh,h->gs", self.tangent, self.force))

    def strains(self, x: float, y: float, shift: float, force: Floats) -> Floats:
        """Return the strains of a force at the samples, (gages, samples)."""
        return self.constant + super().strains(x, y, shift, force)


def corrected(fit: LocationFit, change: Floats) -> LocationFit:
    """Return a fit with other strains of the plate, by a change (gages, samples)."""
    model = fit.model
    assert isinstance(model, StretchingModel)
    seen = model.observation
    observation = replace(seen, values=seen.values - seen.of(change))
    moved = replace(model, motion=model.motion + change, observation=observation)
    return replace(fit, model=moved)


class GagedPlate:
    """Plate that stretches, with gages and the footprint of the force."""

    def __init__(self, problem: Problem, numbers: Sequence[int], linear: LocationFit) -> None:
        self._problem, self._linear = problem, linear
        self._plate = moving_plate(problem.plate)
        cards = {card.number: card for card in problem.deck.require(Gages).records}
        self._gages = gages(
            problem.mesh,
            [cards[number] for number in numbers],
            curvature=problem.plate.curvature,
            nonlinear=True,
        )

    @property
    def _interval(self) -> float:
        """Time between two samples."""
        return self._linear.model.observation.interval

    def _load(self, place: Floats) -> Floats:
        """Return the nodal forces of a unit force at a place, (nodes, 5)."""
        load = np.zeros((len(self._problem.mesh.coordinates), NDOF))
        load[:, W] = self._linear.model.footprint.weights(*place.tolist())
        return load

    def _on_linear_plate(self, place: Floats, model: StrainModel, values: Floats) -> Floats:
        """Return the strains of values of narrow hats, (hats, cases), on the linear plate."""
        x, y = place.tolist()
        hats = replace(model, width=model.unit).every_hat(x, y, 0.0)
        return np.asarray(np.einsum("hc,ghs->cgs", values, hats))

    def _on_reduced_plate(self, place: Floats, model: StrainModel, values: Floats) -> Floats:
        """Return the same on the reduced plate, (cases, gages, samples).

        Raises LocateError if the plate is not held.
        """
        force = small_products(histories(model, model.unit), values)
        load, damping = self._load(place), self._problem.damping
        try:
            plate = reduced_plate(self._plate, load, MODES, damping, has_fields=True)
        except ReductionError as error:
            raise LocateError(str(error)) from None
        fields, read = plate.fields, self._gages
        assert fields is not None
        in_plane = np.zeros((len(fields.in_plane), *load.shape))
        in_plane[:, :, :W] = fields.in_plane
        rows = np.concatenate([fields.moving, in_plane]).reshape(fields.count, -1)
        readings = (rows[:, read.dof_indices] * read.weights).sum(axis=2)
        every = math.ceil(self._interval * plate.fastest / PHASE)
        motion = ReducedMotion(plate, self._interval / every, force.shape[1])
        strains = np.zeros((force.shape[1], len(read.numbers), len(force)))
        for sample in range(1, len(force)):
            for at_step in between(force, sample, every):
                motion.advance(at_step)
            amplitudes = fields.amplitudes(motion.coordinates(0.0), force[sample])
            strains[:, :, sample] = read.strains(small_products(amplitudes, readings))
        if not np.isfinite(strains).all():
            x, y = place.tolist()
            raise LocateError(BEYOND_PLATE.say(x=x, y=y, force=float(force.max())))
        return strains

    def _in_full(self, fit: LocationFit, trial: PlaceTrial) -> Floats:
        """Return the strains of a trial on the whole plate, (gages, samples)."""
        motion = PlateMotion(self._plate, damping=self._problem.damping)
        load = motion.load(self._load(trial.place))
        conditions = ImpactConditions(load, 0.0)
        state = ImpactSystem(motion, RigidMass(1.0), NO_FORCE, conditions).start().plate
        every = steps_between(self._problem, self._interval, self._problem.critical_time_step)
        sums = motion.dof_sums(self._gages.dof_indices, self._gages.weights)
        force = histories(fit.model, fit.model.width) @ trial.force
        strains = np.zeros((len(self._gages.numbers), len(force)))
        for sample in range(1, len(force)):
            for at_step in between(force, sample, every):
                applied = AppliedForce(load, float(at_step))
                motion.advance(state, self._interval / every, 0.0, applied)
            strains[:, sample] = self._gages.strains(sums.evaluate(state, 0.0))
        return strains

    def _about(
        self, trial: PlaceTrial, model: StrainModel, box: Floats, strains_of: StrainsOf
    ) -> LocationFit:
        """Return the fit about a trial of the linear model, with the narrow hats of another."""
        place, hats = trial.place, math.ceil(model.length / model.unit)
        narrow = model.unit * self._interval * np.arange(1, hats + 1)
        knots = self._linear.model.knots(0.0)
        values = np.interp(narrow, np.append(0.0, knots), np.append(0.0, trial.force))
        change = CHANGE * float(trial.force.max())
        cases = np.column_stack([values, values[:, None] + change * np.eye(hats)])
        strains = strains_of(place, model, cases)
        slopes = []
        for step in MOVE * self._linear.side * np.eye(2):
            end = place + step if (place + step <= box[1]).all() else place - step
            moved = strains_of(end, model, values[:, None])[0] - strains[0]
            slopes.append(moved / (end - place).sum())
        tangent = np.moveaxis(strains[1:] - strains[0], 0, 2) / change
        seen = model.observation
        about = StretchingModel(
            footprint=model.footprint,
            observation=seen,
            nodes=model.nodes,
            responses=model.responses,
            unit=model.unit,
            width=model.width,
            length=model.length,
            place=(trial.x, trial.y),
            force=values,
            motion=strains[0],
            tangent=tangent,
            slopes=np.array(slopes),
        )
        observation = replace(seen, values=seen.values - seen.of(about.constant))
        return replace(self._linear, model=replace(about, observation=observation))

    def approached(
        self, start: PlaceTrial, region: Region, pitch: float | None
    ) -> tuple[LocationFit, PlaceTrial]:
        """Return fit and trial on the reduced plate, from a trial on the linear plate.

        A pass moves x and y by the distance of the candidates of the search at most.
        """
        model, box = self._linear.model, np.array([region.low, region.high])
        trial = with_determined_force(self._linear, start)
        strains = fitted_strains(self._linear, trial)
        change = self._in_full(self._linear, trial) - strains
        if np.abs(change).max() <= NEARLY_LINEAR * np.abs(strains).max():
            fit = corrected(self._about(trial, model, box, self._on_linear_plate), change)
            return fit, refined(fit, trial, box)
        reach = region.size / [len(places) for places in region.grid(pitch)]
        for _ in range(PASSES):
            wide, place = replace(model, unit=model.width), trial.place
            fit = self._about(trial, wide, box, self._on_reduced_plate)
            trial = refined(fit, trial, np.clip(box, place - reach, place + reach))
            if math.dist(trial.place, place) <= NEAR * self._linear.side:
                break
        fit = self._about(trial, model, box, self._on_reduced_plate)
        return fit, refined(fit, trial, box)

    def settled(
        self, fit: LocationFit, trial: PlaceTrial, region: Region
    ) -> tuple[LocationFit, PlaceTrial, Floats]:
        """Return fit and trial by runs of the whole plate, and the last change of the strains.

        The change is (gages, samples). Raises LocateError if the place does not settle.
        """
        box = np.array([region.low, region.high])
        kept, effect = is_determined(fit.errors(trial, 1.0).force), math.inf
        for _ in range(MOST_RUNS):
            trial = trial._replace(force=np.where(kept, trial.force, 0.0))
            change = self._in_full(fit, trial) - fitted_strains(fit, trial)
            errors = fit.errors(trial, fit.deviation(trial), fit.model.observation.of(change))
            effect = math.hypot(*errors.place_change) / math.sqrt(np.trace(errors.place))
            if effect <= SETTLED:
                return fit, trial, change
            fit = corrected(fit, change)
            trial = fit.refined(fit.at(trial.x, trial.y), box)
        raise LocateError(UNSETTLED_PLACE.say(runs=MOST_RUNS, effect=f"{effect:.2g}"))


def fitted_strains(fit: LocationFit, trial: PlaceTrial) -> Floats:
    """Return the strains of a trial, (gages, samples)."""
    return fit.model.strains(trial.x, trial.y, trial.shift, trial.force)


def refined(fit: LocationFit, trial: PlaceTrial, box: Floats) -> PlaceTrial:
    """Return the best trial in a box from the place of a trial, see :meth:`LocationFit.refined`."""
    return with_determined_force(fit, fit.refined(fit.at(trial.x, trial.y), box))


def with_determined_force(fit: LocationFit, trial: PlaceTrial) -> PlaceTrial:
    """Return a trial without the force that no strain shows: it may have any size, and bend."""
    determined = is_determined(fit.errors(trial, 1.0).force)
    return trial._replace(force=np.where(determined, trial.force, 0.0))


def unconfirmed(change: Floats, strains: Floats) -> list[str]:
    """Return the reason to reject strains that a run changes, if the change is large."""
    largest = float(np.abs(change).max() / np.abs(strains).max())
    return [UNCONFIRMED_STRAINS.say(largest=largest)] if largest > UNCONFIRMED_STRAINS.value else []


def histories(model: StrainModel, width: int) -> Floats:
    """Return the forces of hats at the samples, (samples, hats); the hats are `width` wide."""
    samples = np.arange(model.responses.shape[2])
    peaks = width * np.arange(1, math.ceil(model.length / width) + 1)
    return np.asarray(np.maximum(1.0 - np.abs(samples[:, None] - peaks) / width, 0.0))


def between(force: Floats, sample: int, count: int) -> Iterator[Any]:
    """Yield the forces at the starts of the steps before a sample."""
    for step in range(count):
        yield force[sample - 1] + step / count * (force[sample] - force[sample - 1])
