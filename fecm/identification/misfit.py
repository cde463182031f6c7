"""Reasons against a fit: a missing delay, offset or filter, another model, the plate."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.authoring.vary import apply_case
from fecm.deck.model import Deck, Material
from fecm.deck.units import unit_of
from fecm.identification.fitting import (
    DELAY,
    OF_RECORD,
    OFFSET,
    FittedPoints,
    ForceModel,
    join_names,
)
from fecm.studies.rod_test.filters import Filter, FilterKind

FEW_RUNS = -4.0  # standard deviations of the number of runs of equal signs in a residual
RISES = np.geomspace(3e-3, 0.3, 14)  # of filters that are tried, over the time of the contact
FINER = 7  # rise times around the best of them
CLEARLY = 0.9  # rms of the residual with a filter over that with a delay or an offset
COLOURED = 0.5  # a finding reports a larger correlation of neighbouring residuals
FAINT = 1e-3  # share of the peak up to which residuals are the errors of arithmetic
# Share of the variance of the force in a residual with a shape, above which the model does not
# describe it.
UNDESCRIBED = 0.05
CERTAIN = 5.0  # standard errors from 0, beyond which a delay or an offset is not noise
LIKELY = 4.0  # the same of a filter, for a note
HALF = 0.5  # of the systematic part of the residual, which a proposal must remove
QUIET = 1e-3  # share of the peak below which a force means no contact
LEAST_QUIET = 10  # fewest points without contact
SMALL = 5e-3  # share of the peak up to which an offset without contact is not reported
# Relative change of a property of the plate that gives the derivatives.  Vibrations shift in phase,
# so that larger changes are not linear.
CHANGED = 1e-3
PERCENT = 0.01  # the relative change whose effect is reported
PROPERTIES = ("thickness", "e1")


def neighbour_correlation(residual: Floats) -> float:
    """Return the correlation of neighbouring residuals."""
    return float(residual[1:] @ residual[:-1] / (residual @ residual))


def sign_runs(residual: Floats) -> float:
    """Return the number of runs of equal signs, in standard deviations from independent errors.

    Wald and Wolfowitz 1940; 0 if all signs are equal.

    >>> bool(abs(runs(np.random.default_rng(0).normal(size=4000))) < 3.0)
    True
    """
    signs = residual > 0.0
    above = float(np.count_nonzero(signs))
    count = float(len(signs))
    product = 2.0 * above * (count - above)
    if not product or product <= count:
        return 0.0
    number = 1.0 + np.count_nonzero(signs[1:] != signs[:-1])
    mean, variance = product / count + 1.0, product * (product - count) / count**2 / (count - 1.0)
    return float((number - mean) / math.sqrt(variance))


def coloured(points: FittedPoints) -> bool:
    """Return whether the residual has a shape, and exceeds the errors of arithmetic."""
    return not _faint(points) and neighbour_correlation(points.residual) > COLOURED


def _faint(points: FittedPoints) -> bool:
    return math.sqrt(points.variance) <= FAINT * float(points.force.max())


def undescribed(points: FittedPoints, units: dict[str, str]) -> str:
    """Say that the model does not describe the data; empty if it does."""
    if _faint(points) or _describes(points.residual, points.force):
        return ""
    rms = f"{math.sqrt(points.variance):.3g} {unit_of('force', units)}".rstrip()
    share = 100.0 * math.sqrt(points.variance) / float(np.std(points.force))
    return wrong_model(
        f"the rms of the residual, {rms}, is {share:.0f} % of the standard deviation"
    )


def wrong_model(why: str) -> str:
    """Say that the model does not describe the data, and what to look at."""
    hint = "compare supports, laminate, patch, mesh and filter with the test"
    return f"the model does not describe the data: {why}; {hint}"


def _describes(residual: Floats, force: Floats) -> bool:
    share = float(residual @ residual) / (len(force) * float(np.var(force)))
    shaped = neighbour_correlation(residual) > COLOURED
    return share < 1.0 and (share <= UNDESCRIBED or not shaped)


# A delay or an offset that was left out -----------------------------------------------------------


class LargerFit(NamedTuple):
    """Fit with more parameters."""

    added: dict[str, float]  # values of the added parameters
    residual: Floats
    certain: bool  # whether each added value is beyond its noise

    def explains(self, before: Floats, force: Floats) -> bool:
        """Return whether the model describes the force.

        Less than half of a systematic residual may remain. The covariance of neighbours estimates
        the systematic part; noise of independent points has no share in it.
        """
        first = float(before[1:] @ before[:-1]) / len(before)
        rest = float(self.residual[1:] @ self.residual[:-1]) / len(self.residual)
        white = float(self.residual @ self.residual) / len(self.residual) ** 1.5
        halved = first > 0.0 and rest < max(HALF**2 * first, 2.0 * white)
        return self.certain and halved and _describes(self.residual, force)


def proposal(
    model: ForceModel,
    points: FittedPoints,
    refit: Callable[[], FittedPoints | None],
    filtered: Callable[[Filter], FittedPoints | None],
    units: dict[str, str],
) -> tuple[str, str]:
    """Propose to fit a delay or an offset too, or to name a filter, and note a likely filter.

    Both texts are empty if nothing explains the residual. Linearised fits come first. If the
    residual has a shape, `refit` fits the delay too, from several starts, and `filtered` fits with
    the most likely filter of first order. A filter that lowers the residual by more than chance,
    but does not explain half of its shape, is a note.
    """
    trial, text = _of_record(model, points, refit, units)
    other, sensor = _filter(model, points, filtered)
    if other is None or (trial and _rms(other.residual) > CLEARLY * _rms(trial.residual)):
        return text, ""
    seems = (
        f"the measurement seems to be filtered: with --filter first-order:{sensor.size:.2g} "
        f"{_fall(other, points.residual, units)}"
    )
    if other.explains(points.residual, points.force):
        return f"{seems}; the values given here are biased", ""
    return text, f"{seems}, which is more than chance; the values may be biased"


def _rms(residual: Floats) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _of_record(
    model: ForceModel,
    points: FittedPoints,
    refit: Callable[[], FittedPoints | None],
    units: dict[str, str],
) -> tuple[LargerFit | None, str]:
    """Return a delay or an offset that explains the residual, and the proposal; else empty."""
    before = points.residual
    missing = [name for name in (OFFSET, DELAY) if name not in points.scaling.start]
    choices = [[name] for name in missing] + ([missing] if len(missing) > 1 else [])
    if _faint(points):
        return None, ""
    for names in choices:
        trial = _linear(model, points, names)
        if trial.explains(before, points.force):
            return trial, _told(trial, before, units)
    if DELAY in missing and coloured(points) and (other := refit()) is not None:
        trial = LargerFit({DELAY: other.values[DELAY]}, other.residual, certain=True)
        if trial.explains(before, other.force):
            return trial, _told(trial, before, units)
    if OFFSET in missing and (level := _out_of_contact(model, points)):
        force = f"{level:.3g} {unit_of('force', units)}".rstrip()
        text = f"fit {OFFSET} too: without contact the measured force is {force}, beyond its noise"
        return None, text
    return None, ""


def _filter(
    model: ForceModel, points: FittedPoints, filtered: Callable[[Filter], FittedPoints | None]
) -> tuple[LargerFit | None, Filter]:
    """Return the fit with the likeliest filter of first order; None if chance explains it."""
    none = Filter(FilterKind.FIRST_ORDER, 0.0)
    if model.sensor is not None or _faint(points):
        return None, none
    top = points.time[points.model > 0.5 * points.model.max()]
    width = float(np.ptp(top)) if len(top) else 0.0

    def rest(rise: float) -> float:
        """Return the remaining squares if the linearised fit has a filter."""
        filtered_model = model._replace(sensor=Filter(FilterKind.FIRST_ORDER, rise))
        residual = points.force - filtered_model.at(points.time, [points.values])[:, 0]
        x = np.linalg.lstsq(points.jacobian, residual, rcond=None)[0]
        return float(((residual - points.jacobian @ x) ** 2).sum())

    if width <= 0.0:
        return None, none
    rises = width * RISES
    best = min(rises.tolist(), key=rest)
    step = float(RISES[1] / RISES[0])
    best = min((best * np.geomspace(1.0 / step, step, FINER)).tolist(), key=rest)
    sensor, remaining = Filter(FilterKind.FIRST_ORDER, best), rest(best)
    before = float(points.residual @ points.residual)
    fall = (before - remaining) / remaining * max(1, len(points.residual) - len(points.x) - 1)
    if fall < LIKELY**2:
        return None, sensor
    other = filtered(sensor)
    if other is None or _rms(other.residual) >= _rms(points.residual):
        return None, sensor
    return LargerFit({}, other.residual, certain=fall > CERTAIN**2), sensor


def is_runs_few(points: FittedPoints) -> bool:
    """Return whether the residual changes its sign less often than chance explains."""
    return not _faint(points) and sign_runs(points.residual) < FEW_RUNS


def _linear(model: ForceModel, points: FittedPoints, names: Sequence[str]) -> LargerFit:
    """Add parameters to the linearised fit."""
    columns = {OFFSET: np.ones(len(points.time))}
    if DELAY in names:
        values, step = points.values, float(np.median(np.diff(points.time)))
        trials = [{**values, DELAY: values.get(DELAY, 0.0) + s * step} for s in (1.0, -1.0)]
        columns[DELAY] = model.at(points.time, trials) @ [1.0, -1.0] / (2.0 * step)
    old = len(points.x)
    jac = np.column_stack([points.jacobian, *(columns[name] for name in names)])
    size = np.linalg.norm(jac, axis=0)
    size[size == 0.0] = 1.0
    left, singular, right = np.linalg.svd(jac / size, full_matrices=False)
    kept = singular > 1e-10 * singular[0]
    root = right[kept].T / singular[kept]
    x = root @ (left[:, kept].T @ points.residual) / size
    rest = points.residual - jac @ x
    variance = float(rest @ rest) / (len(rest) - len(x))
    errors = np.sqrt(variance * np.sum(root**2, axis=1)) / size
    certain = bool(np.all(np.abs(x[old:]) > CERTAIN * errors[old:]))
    return LargerFit(dict(zip(names, x[old:].tolist(), strict=True)), rest, certain)


def _told(trial: LargerFit, before: Floats, units: dict[str, str]) -> str:
    values = [
        f"{name} {value:.3g} {unit_of(OF_RECORD[name], units)}".rstrip()
        for name, value in trial.added.items()
    ]
    effect = f"with {join_names(values)} {_fall(trial, before, units)}"
    return f"fit {join_names(list(trial.added))} too: {effect}; the values given here are biased"


def _fall(trial: LargerFit, before: Floats, units: dict[str, str]) -> str:
    """Return how much smaller the residual of a trial is."""
    force = f"{_rms(trial.residual):.3g} {unit_of('force', units)}".rstrip()
    return f"the rms of the residual falls from {_rms(before):.3g} to {force}"


def _out_of_contact(model: ForceModel, points: FittedPoints) -> float:
    """Return the median force before the contact, or after it; 0 if it is noise.

    It is also 0 if there is no such time. After the contact the force must have no shape, which
    another model could explain.
    """
    without = {**points.values, OFFSET: 0.0}
    model_force = model.at(points.time, [without])[:, 0]
    quiet = model_force <= QUIET * model_force.max()
    before = quiet & (points.time <= points.values.get(DELAY, 0.0))
    if np.count_nonzero(before) >= LEAST_QUIET:
        quiet = before  # whatever the model is
    elif np.count_nonzero(quiet) < LEAST_QUIET:
        return 0.0
    force = points.force[quiet]
    level = float(np.median(force))
    deviation = float(np.median(np.abs(force - level))) / 0.6745
    error = 1.2533 * deviation / math.sqrt(len(force))  # of a median
    least = max(CERTAIN * error, SMALL * float(points.force.max()))
    shaped = (
        quiet is not before and deviation > 0.0 and neighbour_correlation(force - level) > COLOURED
    )
    return level if abs(level) > least and not shaped else 0.0


# Errors of the plate ------------------------------------------------------------------------------


def plate_errors(
    model: ForceModel, points: FittedPoints, runs: Callable[[Deck], ForceModel]
) -> dict[str, dict[str, float]]:
    """Return the changes of the fitted values with 1 % more thickness, or E1, of the deck's plate.

    The fit is linearised. `runs` returns the model of another deck. A property is left out if the
    plate can't be run with the time step of the deck.
    """
    material = model.deck.require(Material)
    properties = {"thickness": sum(y.thickness for y in material.layers), "e1": material.ply.e1}
    clock, _ = model.histories([points.values])
    dt = float(clock[len(clock) // 2 + 1])  # the first time after 0
    errors: dict[str, dict[str, float]] = {}
    for name in PROPERTIES:
        for change in (CHANGED, -CHANGED):  # one of them may be unstable
            try:
                other = runs(
                    apply_case(model.deck, {name: (1.0 + change) * properties[name], "dt": dt})
                )
                force = other.at(points.time, [points.values])[:, 0]
            except FecmError:
                continue
            x = np.linalg.lstsq(points.jacobian, points.model - force, rcond=None)[0]
            changes = PERCENT / change * points.scaling.slopes(points.x) * x
            errors[name] = dict(zip(points.scaling.start, changes.tolist(), strict=True))
            break
    return errors
