"""Reasons to doubt a fit: missing delay, offset or filter, wrong model, errors of the plate."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.authoring.case import Case
from fecm.authoring.time_values import step_of
from fecm.authoring.values import apply_case
from fecm.deck.model import Material
from fecm.deck.units import unit_of
from fecm.identification.fitting import (
    DELAY,
    OF_RECORD,
    OFFSET,
    FittedPoints,
    ForceModel,
    join_names,
    recorded,
)
from fecm.judge.fits import (
    COLOURED,
    FEW_RUNS,
    FILTERED,
    FORCE_WITHOUT_CONTACT,
    MISSING_PARAMETER,
    PERHAPS_FILTERED,
    UNDESCRIBED,
)
from fecm.studies.rod_test.filters import Filter, FilterKind
from fecm.sweeps.outcome import Outcome

RISES = np.geomspace(3e-3, 0.3, 14)  # rise times that are tried, over the time of the contact
FINER = 7  # rise times around the best one, which are tried next
CLEARLY = 0.9  # residual with a filter over the residual with delay or offset, for a proposal
FAINT = 1e-3  # share of the peak up to which residuals are errors of arithmetic
CERTAIN = 5.0  # standard errors above which a delay, an offset or a filter is not noise
LIKELY = 4.0  # the same for a note about a filter
HALF = 0.5  # share of the systematic residual that a proposal must remove
QUIET = 1e-3  # share of the peak below which a force means no contact
LEAST_QUIET = 10  # fewest points without contact that show an offset
SMALL = 5e-3  # share of the peak up to which an offset without contact is not reported
# Relative change of a property of the plate that gives the derivatives. It is small because
# vibrations shift in phase, which is not linear.
CHANGED = 1e-3
PERCENT = 0.01  # the relative change whose effect is reported
PROPERTIES = ("thickness", "e1")


def neighbour_correlation(residual: Floats) -> float:
    """Return the correlation of neighbouring residuals."""
    return float(residual[1:] @ residual[:-1] / (residual @ residual))


def sign_runs(residual: Floats) -> float:
    """Return how far the number of sign runs is from its mean for independent errors.

    The unit is the standard deviation (Wald and Wolfowitz 1940). Returns 0 if all signs are equal.

    >>> bool(abs(sign_runs(np.random.default_rng(0).normal(size=4000))) < 3.0)
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


def has_shape(points: FittedPoints) -> bool:
    """Return whether the residual has a shape and exceeds the errors of arithmetic."""
    return not _is_negligible(points) and neighbour_correlation(points.residual) > COLOURED


def _is_negligible(points: FittedPoints) -> bool:
    """Return whether the residual is an error of arithmetic."""
    return math.sqrt(points.variance) <= FAINT * float(points.force.max())


def undescribed(points: FittedPoints, units: dict[str, str]) -> str:
    """Describe why the model does not fit the data; empty if it does."""
    if _is_negligible(points) or _describes(points.residual, points.force):
        return ""
    rms = f"{math.sqrt(points.variance):.3g} {unit_of('force', units)}".rstrip()
    share = 100.0 * math.sqrt(points.variance) / float(np.std(points.force))
    why = f"the rms of the residual, {rms}, is {share:.0f} % of the standard deviation"
    return UNDESCRIBED.say(why=why)


def _describes(residual: Floats, force: Floats) -> bool:
    """Return whether a fit with this residual describes the force."""
    share = float(residual @ residual) / (len(force) * float(np.var(force)))
    shaped = neighbour_correlation(residual) > COLOURED
    return share < 1.0 and (share <= UNDESCRIBED.value or not shaped)


# A delay or an offset that was left out -----------------------------------------------------------


class LargerFit(NamedTuple):
    """Fit with a delay, an offset or a filter in addition."""

    added: dict[str, float]  # values of the added parameters
    residual: Floats
    certain: bool  # whether each added value is beyond its noise

    def explains(self, before: Floats, force: Floats) -> bool:
        """Return whether the model describes the force.

        Less than half of a systematic residual may remain. The covariance of neighbours estimates
        the systematic part, to which the noise of independent points does not contribute.
        """
        systematic = float(before[1:] @ before[:-1]) / len(before)
        remaining = float(self.residual[1:] @ self.residual[:-1]) / len(self.residual)
        chance = float(self.residual @ self.residual) / len(self.residual) ** 1.5
        halved = systematic > 0.0 and remaining < max(HALF**2 * systematic, 2.0 * chance)
        return self.certain and halved and _describes(self.residual, force)


def proposal(
    model: ForceModel,
    points: FittedPoints,
    refit: Callable[[], FittedPoints | None],
    filtered: Callable[[Filter], FittedPoints | None],
    units: dict[str, str],
) -> tuple[str, str]:
    """Return a proposal that rejects the fit, and a note; both are empty if there is no reason.

    The proposal is to fit a delay or an offset too, or to name a filter. Linearised fits come
    first. If the residual has a shape, `refit` also fits the delay, from several starts. `filtered`
    fits with the most likely filter of first order. A filter that lowers the residual by more than
    chance, but does not explain half of its shape, gives the note.
    """
    record_fit, text = _propose_record_parameter(model, points, refit, units)
    filter_fit, sensor = _find_filter(model, points, filtered)
    if filter_fit is None or (
        record_fit and _rms(filter_fit.residual) > CLEARLY * _rms(record_fit.residual)
    ):
        return text, ""
    name, effect = (
        f"first-order:{sensor.size:.2g}",
        _format_fall(filter_fit, points.residual, units),
    )
    if filter_fit.explains(points.residual, points.force):
        return FILTERED.say(filter=name, effect=effect), ""
    return text, PERHAPS_FILTERED.say(filter=name, effect=effect)


def _rms(residual: Floats) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def _propose_record_parameter(
    model: ForceModel,
    points: FittedPoints,
    refit: Callable[[], FittedPoints | None],
    units: dict[str, str],
) -> tuple[LargerFit | None, str]:
    """Return the fit with a delay or an offset that explains the residual, and its proposal.

    Returns None and an empty text if neither explains it.
    """
    before = points.residual
    missing = [name for name in (OFFSET, DELAY) if name not in points.scaling.start]
    choices = [[name] for name in missing] + ([missing] if len(missing) > 1 else [])
    if _is_negligible(points):
        return None, ""
    for names in choices:
        trial = _linear(model, points, names)
        if trial.explains(before, points.force):
            return trial, _format_proposal(trial, before, units)
    if DELAY in missing and has_shape(points) and (refitted := refit()) is not None:
        trial = LargerFit({DELAY: refitted.values[DELAY]}, refitted.residual, certain=True)
        if trial.explains(before, refitted.force):
            return trial, _format_proposal(trial, before, units)
    if OFFSET in missing and (level := _force_without_contact(model, points)):
        force = f"{level:.3g} {unit_of('force', units)}".rstrip()
        return None, FORCE_WITHOUT_CONTACT.say(name=OFFSET, force=force)
    return None, ""


def _find_filter(
    model: ForceModel, points: FittedPoints, filtered: Callable[[Filter], FittedPoints | None]
) -> tuple[LargerFit | None, Filter]:
    """Return the fit with the likeliest filter of first order, and the filter.

    The fit is None if chance explains the fall of the residual.
    """
    no_filter = Filter(FilterKind.FIRST_ORDER, 0.0)
    if model.sensor is not None or _is_negligible(points):
        return None, no_filter
    top = points.time[points.model > 0.5 * points.model.max()]
    width = float(np.ptp(top)) if len(top) else 0.0

    clock, forces = model.histories([points.values])

    def remaining_squares(rise: float) -> float:
        """Return the sum of squares of the linearised fit with a filter."""
        filtered_forces = Filter(FilterKind.FIRST_ORDER, rise)(clock, forces)
        residual = (
            points.force - recorded(points.time, [points.values], clock, filtered_forces).ravel()
        )
        x = np.linalg.lstsq(points.jacobian, residual, rcond=None)[0]
        return float(((residual - points.jacobian @ x) ** 2).sum())

    if width <= 0.0:
        return None, no_filter
    rises = width * RISES
    best = min(rises.tolist(), key=remaining_squares)
    step = float(RISES[1] / RISES[0])
    best = min((best * np.geomspace(1.0 / step, step, FINER)).tolist(), key=remaining_squares)
    sensor, remaining = Filter(FilterKind.FIRST_ORDER, best), remaining_squares(best)
    before = float(points.residual @ points.residual)
    fall = (before - remaining) / remaining * max(1, len(points.residual) - len(points.x) - 1)
    if fall < LIKELY**2:
        return None, sensor
    refitted = filtered(sensor)
    if refitted is None or _rms(refitted.residual) >= _rms(points.residual):
        return None, sensor
    return LargerFit({}, refitted.residual, certain=fall > CERTAIN**2), sensor


def has_few_sign_runs(points: FittedPoints) -> bool:
    """Return whether the residual changes its sign less often than chance explains."""
    return not _is_negligible(points) and -sign_runs(points.residual) > FEW_RUNS.value


def _linear(model: ForceModel, points: FittedPoints, names: Sequence[str]) -> LargerFit:
    """Return the linearised fit with more parameters."""
    columns = {OFFSET: np.ones(len(points.time))}
    if DELAY in names:
        values, step = points.values, float(np.median(np.diff(points.time)))
        trials = [{**values, DELAY: values.get(DELAY, 0.0) + s * step} for s in (1.0, -1.0)]
        columns[DELAY] = model.at(points.time, trials) @ [1.0, -1.0] / (2.0 * step)
    first_added = len(points.x)
    jac = np.column_stack([points.jacobian, *(columns[name] for name in names)])
    size = np.linalg.norm(jac, axis=0)
    size[size == 0.0] = 1.0
    left, singular, right = np.linalg.svd(jac / size, full_matrices=False)
    kept = singular > 1e-10 * singular[0]
    root = right[kept].T / singular[kept]
    x = root @ (left[:, kept].T @ points.residual) / size
    residual = points.residual - jac @ x
    variance = float(residual @ residual) / (len(residual) - len(x))
    errors = np.sqrt(variance * np.sum(root**2, axis=1)) / size
    certain = bool(np.all(np.abs(x[first_added:]) > CERTAIN * errors[first_added:]))
    return LargerFit(dict(zip(names, x[first_added:].tolist(), strict=True)), residual, certain)


def _format_proposal(trial: LargerFit, before: Floats, units: dict[str, str]) -> str:
    """Propose to fit the added parameters too."""
    values = [
        f"{name} {value:.3g} {unit_of(OF_RECORD[name], units)}".rstrip()
        for name, value in trial.added.items()
    ]
    effect = f"with {join_names(values)} {_format_fall(trial, before, units)}"
    return MISSING_PARAMETER.say(names=join_names(list(trial.added)), effect=effect)


def _format_fall(trial: LargerFit, before: Floats, units: dict[str, str]) -> str:
    """Describe how much the residual falls with a trial."""
    force = f"{_rms(trial.residual):.3g} {unit_of('force', units)}".rstrip()
    return f"the rms of the residual falls from {_rms(before):.3g} to {force}"


def _force_without_contact(model: ForceModel, points: FittedPoints) -> float:
    """Return the median force before the contact, or after it; 0 if it is noise.

    Returns 0 also if the record has too few points there, or if the force after the contact has a
    shape, which another model could explain.
    """
    without = {**points.values, OFFSET: 0.0}
    model_force = model.at(points.time, [without])[:, 0]
    quiet = model_force <= QUIET * model_force.max()
    before = quiet & (points.time <= points.values.get(DELAY, 0.0))
    if np.count_nonzero(before) >= LEAST_QUIET:
        quiet = before  # free of errors of the model
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
    model: ForceModel, points: FittedPoints, run: Outcome
) -> dict[str, dict[str, float]]:
    """Return the changes of the fitted values for a plate with 1 % more thickness or E1.

    The fit is linearised. `run` has the fitted values. A property is left out if the changed plate
    can't be run with the time step of the deck.
    """
    if not run.fine[0]:
        return {}
    material = model.deck.require(Material)
    properties = {
        "thickness": sum(layer.thickness for layer in material.layers),
        "e1": material.ply.e1,
    }
    dt = step_of(model.plate.problem)
    before = model.of_run(points.time, points.values, run)
    errors: dict[str, dict[str, float]] = {}
    for name in PROPERTIES:
        for change in (CHANGED, -CHANGED):  # one of the two plates may be unstable
            try:
                case: Case = {name: (1.0 + change) * properties[name], "dt": dt}
                changed = model.beside(apply_case(model.deck, case))
                force = changed.at(points.time, [points.values])[:, 0]
            except FecmError:
                continue
            x = np.linalg.lstsq(points.jacobian, before - force, rcond=None)[0]
            changes = PERCENT / change * points.scaling.slopes(points.x) * x
            errors[name] = dict(zip(points.scaling.start, changes.tolist(), strict=True))
            break
    return errors
