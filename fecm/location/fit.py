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

NEGLIGIBLE = 1e-9  # norm of a hat's strains over the largest, below which it is left out
PASSES = 40  # of the Gauss-Newton iteration
HALVINGS = 8  # of a step that does not lower the misfit
SETTLED = 3e-3  # change of the place, in standard errors, that ends the iteration
STEP = 0.02  # of central differences, over the side of an element
VALUES = 2  # strains per value of a force, at least
MOST_TURN = 1.0  # change of the logarithm of a gain in a pass
SINGULAR = 1e-12  # least singular value of the scaled Jacobian


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
    def active(self) -> Bools:
        """Mask of the hats that the force has, (hats,)."""
        return np.asarray(self.force > 0.0)

    @property
    def basis(self) -> Floats:
        """Strains per coefficient of the force, with gains, (values, hats)."""
        return (self.gains[:, None, None] * self.design).reshape(-1, self.design.shape[2])


class Errors(NamedTuple):
    """Standard errors of a fit."""

    place: Floats  # (2, 2): covariance of x and y
    shift: float
    gains: Floats  # (gages,)
    # (hats,): of the force; of a hat that it has not, those with this hat added.
    force: Floats
    covariance: Floats  # (hats, hats): of the force; 0 for hats that it has not
    # Changes of place, (2,), and force, (hats,), with the strains of another model; that of the
    # place is in its covariance.
    place_change: Floats
    force_change: Floats


@dataclass(frozen=True)
class LocationFit:
    """Least squares of a model, with the parameters that are fitted besides place and force."""

    model: StrainModel
    side: float  # of an element
    shift: bool = False
    gains: bool = False

    def at(self, x: float, y: float, shift: float = 0.0, gains: Floats | None = None) -> PlaceTrial:
        """Return the best force at a place.

        Raises PatchError or OutsideError if the force is not on the plate.
        """
        seen = self.model.observation
        gains_used = np.ones(len(seen.values)) if gains is None else gains
        design = self.model.design(x, y, shift)
        basis = (gains_used[:, None, None] * design).reshape(-1, design.shape[2])
        force = non_negative(basis, seen.values.ravel())
        residual = seen.values - gains_used[:, None] * (design @ force)
        square = float((residual**2).sum() + seen.left.sum())
        return PlaceTrial(x, y, shift, gains_used, force, design, residual, square)

    def halved(self) -> LocationFit | None:
        """Return the fit with hats of half the width; None if strains or responses are too few."""
        parts, odd = divmod(self.model.width // self.model.unit, 2)
        if odd or not parts:
            return None
        half = replace(self.model, width=parts * self.model.unit)
        seen = self.model.observation
        if half.basis < seen.step or VALUES * half.hats > seen.count:
            return None
        return replace(self, model=half)

    def deviation(self, trial: PlaceTrial) -> float:
        """Return the standard deviation of the residual."""
        seen = self.model.observation
        parameters = self._others(trial) + int(trial.active.sum())
        return math.sqrt(trial.square / max(1, seen.count - parameters))

    def _others(self, trial: PlaceTrial) -> int:
        """Return the number of fitted parameters besides the force."""
        return 2 + self.shift + self.gains * (len(trial.gains) - 1)

    def jacobian(self, trial: PlaceTrial) -> Floats:
        """Return the strains per x, y, shift, gains, as far as they are fitted, and active hat.

        The result is (values, parameters). The gains change without their product.
        """
        h, t = STEP * self.side, 0.5 * self.model.observation.interval
        columns = [self._slope(trial, h, 0.0, 0.0), self._slope(trial, 0.0, h, 0.0)]
        if self.shift:
            columns.append(self._slope(trial, 0.0, 0.0, t))
        if self.gains:
            strains_of_force = trial.gains[:, None] * (trial.design @ trial.force)
            columns += [turn[:, None] * strains_of_force for turn in ratios(len(strains_of_force))]
        columns_of_rest = np.stack([column.ravel() for column in columns], axis=1)
        return np.hstack([columns_of_rest, trial.basis[:, trial.active]])

    def _slope(self, trial: PlaceTrial, dx: float, dy: float, dt: float) -> Floats:
        """Return the strains per length or time in one direction, (gages, rows).

        Differences are central, one-sided at an edge of the plate, and 0 between two edges.
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
        """Refine a trial by Gauss-Newton iteration; the place stays in a box.

        The box has the lowest and the highest coordinates.
        """
        best = start
        for _ in range(PASSES):
            jacobian = self.jacobian(best)
            size = scales(jacobian)
            both = triangular(np.column_stack([jacobian / size, best.residual.ravel()]))
            change = np.linalg.lstsq(both[:, :-1], both[:, -1], 1e-10)[0] / size
            better = self._lower(best, change[: self._others(best)], box)
            if better is None:
                break
            gain, best = best.square - better.square, better
            if gain <= SETTLED**2 * best.square / best.residual.size:
                break
        return best

    def _lower(self, best: PlaceTrial, change: Floats, box: Floats) -> PlaceTrial | None:
        """Return a trial with a smaller misfit along a change, or None."""
        for halving in range(HALVINGS):
            part = 0.5**halving
            x, y = np.clip(np.array([best.x, best.y]) + part * change[:2], *box).tolist()
            shift, gains = best.shift, best.gains
            if self.shift:
                most = self.model.basis
                shift += float(np.clip(part * change[2], -most, most))
            if self.gains:
                turns = ratios(len(gains))
                turned = np.clip(part * (change[-len(turns) :] @ turns), -MOST_TURN, MOST_TURN)
                gains = gains * np.exp(turned)
            try:
                trial = self.at(x, y, shift, gains)
            except FecmError:  # off the plate
                continue
            if trial.square < best.square:
                return trial
        return None

    def errors(self, trial: PlaceTrial, noise: float, change: Floats | None = None) -> Errors:
        """Return standard errors by the Cramer-Rao bound for a standard deviation of the strains.

        `change` has the strains by which a more exact model of the plate differs, (gages, rows).
        The shift of the place that is fitted to them is added as an error.
        """
        jacobian = self.jacobian(trial)
        idle = trial.basis[:, ~trial.active]
        size = scales(jacobian)
        extra = np.zeros((len(jacobian), 1)) if change is None else change.reshape(-1, 1)
        factor = triangular(np.hstack([jacobian / size, idle, extra]))
        count, count_of_rest = jacobian.shape[1], self._others(trial)
        left, singular, right = np.linalg.svd(factor[:, :count], full_matrices=False)
        root = right.T / np.maximum(singular, SINGULAR * singular[0]) / size[:, None]
        covariance = noise**2 * root @ root.T
        moved = root @ (left.T @ factor[:, -1])
        force = np.empty(len(trial.force))
        force[trial.active] = np.sqrt(np.diagonal(covariance)[count_of_rest:])
        rest = factor[:, count:-1] - left @ (left.T @ factor[:, count:-1])
        least = SINGULAR * float(scales(trial.basis).max())
        force[~trial.active] = noise / np.maximum(np.linalg.norm(rest, axis=0), least)
        gains = np.zeros(len(trial.gains))
        if self.gains:
            turns = ratios(len(gains))
            block = covariance[
                count_of_rest - len(turns) : count_of_rest,
                count_of_rest - len(turns) : count_of_rest,
            ]
            gains = trial.gains * np.sqrt(np.diagonal(turns.T @ block @ turns))
        shift = float(np.sqrt(covariance[2, 2])) if self.shift else 0.0
        full = np.zeros((len(trial.force), len(trial.force)))
        full[np.ix_(trial.active, trial.active)] = covariance[count_of_rest:, count_of_rest:]
        force_change = np.zeros(len(trial.force))
        force_change[trial.active] = moved[count_of_rest:]
        place = covariance[:2, :2] + np.outer(moved[:2], moved[:2])
        return Errors(place, shift, gains, force, full, moved[:2], force_change)


def scales(matrix: Floats) -> Floats:
    """Return the norms of columns, 1 for norms that are 0."""
    size = np.linalg.norm(matrix, axis=0)
    return np.where(size > 0.0, size, 1.0)


def non_negative(matrix: Floats, values: Floats) -> Floats:
    """Solve least squares with coefficients that are not negative, (columns,)."""
    from scipy.optimize import nnls  # takes 0.2 s to import

    size = np.linalg.norm(matrix, axis=0)
    kept = size > NEGLIGIBLE * size.max(initial=0.0)
    solution = np.zeros(matrix.shape[1])
    if kept.any():
        # The triangular factor has the same solution, and few rows.
        both = triangular(np.column_stack([matrix[:, kept] / size[kept], values]))
        solution[kept] = nnls(both[:, :-1], both[:, -1], maxiter=30 * both.shape[1])[0] / size[kept]
    return solution


def ratios(gages: int) -> Floats:
    """Return orthonormal changes of logarithms of gains that keep their sum, (gages - 1, gages)."""
    rows = np.tri(gages - 1, gages) - np.diag(np.arange(1.0, gages), 1)[: gages - 1]
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


UNCERTAIN = 5.0  # standard deviation of a force that is not determined, over the usual one
USUAL = 25.0  # percentile of the standard deviations that is the usual one
FEWEST = 3  # hats whose impulse shows the end of the contact
REST = 1.0 / 3.0  # time without an impulse after the contact, over the time of the contact
CLEAR = 3.0  # standard deviations of a force or an impulse that is not 0
ONSET = 0.1  # share of the peak that a force passes at its beginning
DRAWS = 2000  # of the bias of a peak


def is_determined(error: Floats) -> Bools:
    """Return whether the standard errors determine a force at the peaks of hats.

    A force shortly before the end of the record has hardly reached a gage: its standard error is
    far above the others.
    """
    return np.asarray(error <= UNCERTAIN * float(np.percentile(error, USUAL)))


class Force(NamedTuple):
    """A fitted force as far as it is determined."""

    determined: Bools  # (hats,)
    sd: Floats  # (hats,)
    determined_until: float
    peak: float
    peak_sd: float
    peak_bias: float  # how much the largest of noisy values is too high on average
    time_of_peak: float
    end: float | None  # of the contact
    impulse: float
    impulse_sd: float


def judged_force(time: Floats, force: Floats, errors: Errors, basis: float) -> Force:
    """Judge a force and its errors at the peaks of hats.

    The determined values and the end of the contact follow from the noise. The standard deviations
    include the change of the force with the strains of another model.
    """
    error, covariance, change = errors.force, errors.covariance, errors.force_change
    sd = np.hypot(error, change)
    determined = is_determined(error)
    determined_force = np.where(determined, force, 0.0)
    both = covariance * np.outer(determined, determined)
    top = int(determined_force.argmax())
    last = int(np.flatnonzero(determined)[-1])
    end = _end(determined_force[: last + 1], both, top)
    variance = float(both[:end, :end].sum()) + float((change * determined)[:end].sum()) ** 2
    return Force(
        determined=determined,
        sd=sd,
        determined_until=float(time[last]),
        peak=float(determined_force[top]),
        peak_sd=float(sd[top]),
        peak_bias=_bias(determined_force, both),
        time_of_peak=float(time[top]),
        end=None if end is None else float(time[end]),
        impulse=basis * float(determined_force[:end].sum()),
        impulse_sd=basis * math.sqrt(max(0.0, variance)),
    )


def _end(force: Floats, covariance: Floats, top: int) -> int | None:
    """Return the first hat after which the force has no impulse beyond its noise, or None.

    The force may be small for long, with each of its values below its noise. Sums show it: no sum
    over the following hats, for a third of the time of the contact, may exceed its standard error.
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


def _bias(force: Floats, covariance: Floats) -> float:
    """Return the mean excess of the largest force with errors over the largest without errors."""
    squares, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(squares, 0.0))
    draws = np.random.default_rng(0).normal(size=(DRAWS, len(force))) @ root.T
    return max(0.0, float((force + draws).max(axis=1).mean() - force.max()))
