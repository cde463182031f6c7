"""Least squares for the place and the history of a force.

The strains do not determine every value of the force; the standard errors decide which.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Bools, Floats
from fecm.location.model import StrainModel, triangular

NEGLIGIBLE = 1e-9  # norm of a hat's strains, over the largest, below which the hat is left out
PASSES = 40  # most passes of the Gauss-Newton iteration
HALVINGS = 8  # most halvings of a step that does not lower the misfit
SETTLED = 3e-3  # change of the place, in standard errors, that ends the iteration
STEP = 0.02  # of central differences, over the side of an element
VALUES = 2  # fewest strains per value of the force
MOST_TURN = 1.0  # largest change of the logarithm of a gain in a pass
SINGULAR = 1e-12  # smallest singular value of the scaled Jacobian, over the largest


class PlaceTrial(NamedTuple):
    """Force at a place, and its misfit."""

    x: float
    y: float
    shift: float
    gains: Floats  # (gages,)
    force: Floats  # (hats,)
    design: Floats  # (gages, rows, hats), without gains
    residual: Floats  # (gages, rows)
    square: float  # sum of the squares of the residual

    @property
    def place(self) -> Floats:
        """X and y."""
        return np.array([self.x, self.y])

    @property
    def active(self) -> Bools:
        """Mask of the hats with a positive force, (hats,)."""
        return np.asarray(self.force > 0.0)

    @property
    def basis(self) -> Floats:
        """Strains per unit force of each hat, with gains, (values, hats)."""
        return (self.gains[:, None, None] * self.design).reshape(-1, self.design.shape[2])


class Errors(NamedTuple):
    """Standard errors of a fit."""

    place: Floats  # (2, 2): covariance of x and y
    shift: float
    gains: Floats  # (gages,)
    # (hats,): of the force. For a hat without force, the error if this hat were added.
    force: Floats
    covariance: Floats  # (hats, hats): of the force; 0 for hats without force
    # Changes of the place, (2,), and of the force, (hats,), with the strains of another model. The
    # covariance of the place includes the change of the place.
    place_change: Floats
    force_change: Floats


@dataclass(frozen=True)
class LocationFit:
    """Least-squares fit of place and force, and optionally of shift and gains."""

    model: StrainModel
    side: float  # of an element
    shift: bool = False
    gains: bool = False

    def at(self, x: float, y: float, shift: float = 0.0, gains: Floats | None = None) -> PlaceTrial:
        """Return the best force at a place.

        Raises PatchError or OutsideError if the force is not on the plate.
        """
        observation = self.model.observation
        gains_used = np.ones(len(observation.values)) if gains is None else gains
        design = self.model.design(x, y, shift)
        basis = (gains_used[:, None, None] * design).reshape(-1, design.shape[2])
        force = non_negative(basis, observation.values.ravel())
        residual = observation.values - gains_used[:, None] * (design @ force)
        square = float((residual**2).sum() + observation.remainder.sum())
        return PlaceTrial(x, y, shift, gains_used, force, design, residual, square)

    def halved(self) -> LocationFit | None:
        """Return the fit with hats of half the width; None if strains or samples are too few."""
        parts, odd = divmod(self.model.width // self.model.unit, 2)
        if odd or not parts:
            return None
        half = replace(self.model, width=parts * self.model.unit)
        observation = self.model.observation
        if half.basis < observation.step or VALUES * half.hats > observation.count:
            return None
        return replace(self, model=half)

    def deviation(self, trial: PlaceTrial) -> float:
        """Return the standard deviation of the residual."""
        observation = self.model.observation
        parameters = self._count_besides_force(trial) + int(trial.active.sum())
        return math.sqrt(trial.square / max(1, observation.count - parameters))

    def _count_besides_force(self, trial: PlaceTrial) -> int:
        """Return the number of fitted parameters besides the force."""
        return 2 + self.shift + self.gains * (len(trial.gains) - 1)

    def jacobian(self, trial: PlaceTrial) -> Floats:
        """Return the derivatives of the strains, (values, parameters).

        The parameters are x, y, the shift and the gains if they are fitted, and the active hats.
        The gains change with their product fixed.
        """
        h, t = STEP * self.side, 0.5 * self.model.observation.interval
        columns = [self._slope(trial, h, 0.0, 0.0), self._slope(trial, 0.0, h, 0.0)]
        if self.shift:
            columns.append(self._slope(trial, 0.0, 0.0, t))
        if self.gains:
            strains_of_force = trial.gains[:, None] * (trial.design @ trial.force)
            directions = gain_directions(len(strains_of_force))
            columns += [direction[:, None] * strains_of_force for direction in directions]
        besides_force = np.stack([column.ravel() for column in columns], axis=1)
        return np.hstack([besides_force, trial.basis[:, trial.active]])

    def _slope(self, trial: PlaceTrial, dx: float, dy: float, dt: float) -> Floats:
        """Return the derivative of the strains in one direction, (gages, rows).

        The difference is central, one-sided at an edge of the plate, and 0 between two edges.
        """
        ends, reach = [], 0.0
        for sign in (1.0, -1.0):
            place = trial.x + sign * dx, trial.y + sign * dy, trial.shift + sign * dt
            try:
                design = self.model.design(*place)
                reach += 1.0
            except FecmError:  # off the plate
                design = trial.design
            ends.append(trial.gains[:, None] * (design @ trial.force))
        return np.asarray((ends[0] - ends[1]) / (max(reach, 1.0) * (dx + dy + dt)))

    def refined(self, start: PlaceTrial, box: Floats) -> PlaceTrial:
        """Refine a trial by Gauss-Newton iteration.

        The place stays in a box, which has the lowest and the highest coordinates.
        """
        best = start
        for _ in range(PASSES):
            jacobian = self.jacobian(best)
            size = scales(jacobian)
            augmented = triangular(np.column_stack([jacobian / size, best.residual.ravel()]))
            change = np.linalg.lstsq(augmented[:, :-1], augmented[:, -1], 1e-10)[0] / size
            better = self._find_lower(best, change[: self._count_besides_force(best)], box)
            if better is None:
                break
            gain, best = best.square - better.square, better
            if gain <= SETTLED**2 * best.square / best.residual.size:
                break
        return best

    def _find_lower(self, best: PlaceTrial, change: Floats, box: Floats) -> PlaceTrial | None:
        """Return a trial with a smaller misfit along a change, or None."""
        for halving in range(HALVINGS):
            fraction = 0.5**halving
            x, y = np.clip(np.array([best.x, best.y]) + fraction * change[:2], *box).tolist()
            shift, gains = best.shift, best.gains
            if self.shift:
                limit = self.model.basis
                shift += float(np.clip(fraction * change[2], -limit, limit))
            if self.gains:
                directions = gain_directions(len(gains))
                turn = fraction * (change[-len(directions) :] @ directions)
                gains = gains * np.exp(np.clip(turn, -MOST_TURN, MOST_TURN))
            try:
                trial = self.at(x, y, shift, gains)
            except FecmError:  # off the plate
                continue
            if trial.square < best.square:
                return trial
        return None

    def errors(self, trial: PlaceTrial, noise: float, change: Floats | None = None) -> Errors:
        """Return the standard errors of a trial, by the Cramér-Rao bound.

        `noise` is the standard deviation of the strains. `change` is the difference between the
        strains of a more exact model and of this one, (gages, rows). The place moves when it is
        fitted to this difference, and the movement counts as an error.
        """
        jacobian = self.jacobian(trial)
        idle = trial.basis[:, ~trial.active]
        size = scales(jacobian)
        extra = np.zeros((len(jacobian), 1)) if change is None else change.reshape(-1, 1)
        factor = triangular(np.hstack([jacobian / size, idle, extra]))
        count, first_force = jacobian.shape[1], self._count_besides_force(trial)
        left, singular, right = np.linalg.svd(factor[:, :count], full_matrices=False)
        root = right.T / np.maximum(singular, SINGULAR * singular[0]) / size[:, None]
        covariance = noise**2 * root @ root.T
        moved = root @ (left.T @ factor[:, -1])
        force = np.empty(len(trial.force))
        force[trial.active] = np.sqrt(np.diagonal(covariance)[first_force:])
        orthogonal = factor[:, count:-1] - left @ (left.T @ factor[:, count:-1])
        least = SINGULAR * float(scales(trial.basis).max())
        force[~trial.active] = noise / np.maximum(np.linalg.norm(orthogonal, axis=0), least)
        gains = np.zeros(len(trial.gains))
        if self.gains:
            directions = gain_directions(len(gains))
            last = slice(first_force - len(directions), first_force)
            block = covariance[last, last]
            gains = trial.gains * np.sqrt(np.diagonal(directions.T @ block @ directions))
        shift = float(np.sqrt(covariance[2, 2])) if self.shift else 0.0
        active = np.ix_(trial.active, trial.active)
        force_covariance = np.zeros((len(trial.force), len(trial.force)))
        force_covariance[active] = covariance[first_force:, first_force:]
        force_change = np.zeros(len(trial.force))
        force_change[trial.active] = moved[first_force:]
        place = covariance[:2, :2] + np.outer(moved[:2], moved[:2])
        return Errors(place, shift, gains, force, force_covariance, moved[:2], force_change)


def scales(matrix: Floats) -> Floats:
    """Return the norms of the columns; 1 where a norm is 0."""
    size = np.linalg.norm(matrix, axis=0)
    return np.where(size > 0.0, size, 1.0)


def non_negative(matrix: Floats, values: Floats) -> Floats:
    """Solve non-negative least squares; return the coefficients, (columns,)."""
    from scipy.optimize import nnls  # takes 0.2 s to import

    size = np.linalg.norm(matrix, axis=0)
    kept = size > NEGLIGIBLE * size.max(initial=0.0)
    solution = np.zeros(matrix.shape[1])
    if kept.any():
        # The triangular factor has the same solution with fewer rows.
        augmented = triangular(np.column_stack([matrix[:, kept] / size[kept], values]))
        most = 30 * augmented.shape[1]
        solution[kept] = nnls(augmented[:, :-1], augmented[:, -1], maxiter=most)[0] / size[kept]
    return solution


def gain_directions(gages: int) -> Floats:
    """Return orthonormal changes of the gains' logarithms with the sum 0, (gages - 1, gages)."""
    rows = np.tri(gages - 1, gages) - np.diag(np.arange(1.0, gages), 1)[: gages - 1]
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


UNCERTAIN = 5.0  # standard deviation, over the usual one, above which a force is not determined
USUAL = 25.0  # percentile of the standard deviations that counts as the usual one
FEWEST = 3  # hats whose impulse shows the end of the contact
REST = 1.0 / 3.0  # time without an impulse after the contact, over the time of the contact
CLEAR = 3.0  # standard deviations above which a force or an impulse is not 0
ONSET = 0.1  # share of the peak that a force passes when the contact starts
DRAWS = 2000  # random draws for the bias of a peak


def is_determined(error: Floats) -> Bools:
    """Return a mask of the hats whose force is determined, from the standard errors.

    A force shortly before the end of the record has hardly reached a gage, so that its standard
    error is far above the others.
    """
    return np.asarray(error <= UNCERTAIN * float(np.percentile(error, USUAL)))


class Force(NamedTuple):
    """Determined part of a fitted force."""

    determined: Bools  # (hats,)
    sd: Floats  # (hats,)
    determined_until: float
    peak: float
    peak_sd: float
    peak_bias: float  # mean excess of the largest noisy value over the largest true value
    time_of_peak: float
    end: float | None  # of the contact
    impulse: float
    impulse_sd: float


def judged_force(time: Floats, force: Floats, errors: Errors, basis: float) -> Force:
    """Return the determined part of a force, from its values and errors at the peaks of the hats.

    The noise decides which values are determined and when the contact ends. The standard deviations
    include the change of the force with the strains of another model.
    """
    error, change = errors.force, errors.force_change
    sd = np.hypot(error, change)
    determined = is_determined(error)
    determined_force = np.where(determined, force, 0.0)
    covariance = errors.covariance * np.outer(determined, determined)
    top = int(determined_force.argmax())
    last = int(np.flatnonzero(determined)[-1])
    end = _find_contact_end(determined_force[: last + 1], covariance, top)
    variance = float(covariance[:end, :end].sum()) + float((change * determined)[:end].sum()) ** 2
    return Force(
        determined=determined,
        sd=sd,
        determined_until=float(time[last]),
        peak=float(determined_force[top]),
        peak_sd=float(sd[top]),
        peak_bias=_peak_bias(determined_force, covariance),
        time_of_peak=float(time[top]),
        end=None if end is None else float(time[end]),
        impulse=basis * float(determined_force[:end].sum()),
        impulse_sd=basis * math.sqrt(max(0.0, variance)),
    )


def _find_contact_end(force: Floats, covariance: Floats, top: int) -> int | None:
    """Return the first hat after which the impulse stays within its noise, if there is one.

    A long weak force may have every value below the noise, but its sums exceed it. The contact has
    ended if, for a third of its duration, no sum over the following hats exceeds its noise.
    """
    first = int(np.argmax(force > ONSET * force[top]))
    for hat in range(top + 1, len(force)):
        length = max(FEWEST, math.ceil(REST * (hat - first)))
        if hat + length > len(force):
            return None
        window = slice(hat, hat + length)
        sums = np.cumsum(force[window])
        # Variances of the sums of the first 1, 2, ... hats.
        variances = np.diagonal(covariance[window, window].cumsum(axis=0).cumsum(axis=1))
        if (sums <= CLEAR * np.sqrt(np.maximum(variances, 0.0))).all():
            return hat
    return None


def _peak_bias(force: Floats, covariance: Floats) -> float:
    """Return the mean excess of the largest force with errors over the largest force without."""
    squares, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(squares, 0.0))
    draws = np.random.default_rng(0).normal(size=(DRAWS, len(force))) @ root.T
    return max(0.0, float((force + draws).max(axis=1).mean() - force.max()))
