"""What speaks against a fit: a delay or an offset left out, another model, errors of the plate."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.deck.model import Deck, Material
from fecm.deck.units import unit_of
from fecm.identification.fitting import DELAY, OF_RECORD, OFFSET, Model, Solution, listed
from fecm.sweeps.vary import apply_case

COLOURED = 0.5  # a finding reports a larger correlation of neighbouring residuals
FAINT = 1e-3  # share of the peak up to which residuals are the errors of arithmetic
# Share of the variance of the force in a residual with a shape, above which the model does not
# describe it.
UNDESCRIBED = 0.05
CERTAIN = 5.0  # standard errors from 0, beyond which a delay or an offset is not noise
HALF = 0.5  # of the systematic part of the residual, which a proposal must remove
QUIET = 1e-3  # share of the peak up to which there is no contact
LEAST_QUIET = 10  # fewest points without contact
SMALL = 5e-3  # share of the peak up to which an offset without contact is not reported
# Relative change of a property of the plate that gives the derivatives.  Vibrations shift in phase,
# so that larger changes are not linear.
CHANGED = 1e-3
PERCENT = 0.01  # the relative change whose effect is reported
PROPERTIES = ("thickness", "e1")


def neighbours(residual: Floats) -> float:
    """Correlation of neighbouring residuals."""
    return float(residual[1:] @ residual[:-1] / (residual @ residual))


def coloured(found: Solution) -> bool:
    """Whether the residual has a shape, and is not as small as the errors of arithmetic."""
    return not _faint(found) and neighbours(found.residual) > COLOURED


def _faint(found: Solution) -> bool:
    return math.sqrt(found.variance) <= FAINT * float(found.force.max())


def undescribed(found: Solution, units: dict[str, str]) -> str:
    """Say that the model does not describe the data; empty if it does."""
    if _faint(found) or _describes(found.residual, found.force):
        return ""
    rms = f"{math.sqrt(found.variance):.3g} {unit_of('force', units)}".rstrip()
    share = 100.0 * math.sqrt(found.variance) / float(np.std(found.force))
    return wrong_model(
        f"the rms of the residual, {rms}, is {share:.0f} % of the standard deviation"
    )


def wrong_model(why: str) -> str:
    """Say that the model does not describe the data, and what to look at."""
    hint = "compare supports, laminate, patch, mesh and filter with those of the test"
    return f"the model does not describe the data: {why}; {hint}"


def _describes(residual: Floats, force: Floats) -> bool:
    share = float(residual @ residual) / (len(force) * float(np.var(force)))
    shaped = neighbours(residual) > COLOURED
    return share < 1.0 and (share <= UNDESCRIBED or not shaped)


# A delay or an offset that was left out -----------------------------------------------------------


class Trial(NamedTuple):
    """A fit with more parameters."""

    added: dict[str, float]  # values of the added parameters
    residual: Floats
    certain: bool  # whether each added value is beyond its noise

    def explains(self, before: Floats, force: Floats) -> bool:
        """Whether the model describes the force with less than half of a systematic residual.

        The systematic part is estimated by the covariance of neighbours, in which noise of
        independent points has no part.
        """
        first = float(before[1:] @ before[:-1]) / len(before)
        rest = float(self.residual[1:] @ self.residual[:-1]) / len(self.residual)
        white = float(self.residual @ self.residual) / len(self.residual) ** 1.5
        halved = first > 0.0 and rest < max(HALF**2 * first, 2.0 * white)
        return self.certain and halved and _describes(self.residual, force)


def proposal(
    model: Model,
    found: Solution,
    refit: Callable[[], Solution | None],
    units: dict[str, str],
) -> str:
    """Propose to fit a delay or an offset too; empty if neither explains the residual.

    Linearised fits with one or both come first; if the residual has a shape, `refit` fits the delay
    too, from several starts.
    """
    before = found.residual
    missing = [name for name in (OFFSET, DELAY) if name not in found.scaling.start]
    choices = [[name] for name in missing] + ([missing] if len(missing) > 1 else [])
    if _faint(found):
        return ""
    for names in choices:
        trial = _linear(model, found, names)
        if trial.explains(before, found.force):
            return _told(trial, before, units)
    if DELAY in missing and coloured(found) and (other := refit()) is not None:
        trial = Trial({DELAY: other.values[DELAY]}, other.residual, certain=True)
        if trial.explains(before, other.force):
            return _told(trial, before, units)
    if OFFSET in missing and (level := _out_of_contact(model, found)):
        force = f"{level:.3g} {unit_of('force', units)}".rstrip()
        return f"fit {OFFSET} too: without contact the measured force is {force}, beyond its noise"
    return ""


def _linear(model: Model, found: Solution, names: Sequence[str]) -> Trial:
    """Add parameters to the linearised fit."""
    columns = {OFFSET: np.ones(len(found.time))}
    if DELAY in names:
        values, step = found.values, float(np.median(np.diff(found.time)))
        trials = [{**values, DELAY: values.get(DELAY, 0.0) + s * step} for s in (1.0, -1.0)]
        columns[DELAY] = model.at(found.time, trials) @ [1.0, -1.0] / (2.0 * step)
    old = len(found.x)
    jac = np.column_stack([found.jacobian, *(columns[name] for name in names)])
    size = np.linalg.norm(jac, axis=0)
    size[size == 0.0] = 1.0
    left, singular, right = np.linalg.svd(jac / size, full_matrices=False)
    kept = singular > 1e-10 * singular[0]
    root = right[kept].T / singular[kept]
    x = root @ (left[:, kept].T @ found.residual) / size
    rest = found.residual - jac @ x
    variance = float(rest @ rest) / (len(rest) - len(x))
    errors = np.sqrt(variance * np.sum(root**2, axis=1)) / size
    certain = bool(np.all(np.abs(x[old:]) > CERTAIN * errors[old:]))
    return Trial(dict(zip(names, x[old:].tolist(), strict=True)), rest, certain)


def _told(trial: Trial, before: Floats, units: dict[str, str]) -> str:
    values = [
        f"{name} {value:.3g} {unit_of(OF_RECORD[name], units)}".rstrip()
        for name, value in trial.added.items()
    ]
    rms = [float(np.sqrt(np.mean(e**2))) for e in (before, trial.residual)]
    force = f"{rms[1]:.3g} {unit_of('force', units)}".rstrip()
    effect = f"with {listed(values)} the rms of the residual falls from {rms[0]:.3g} to {force}"
    return f"fit {listed(list(trial.added))} too: {effect}; the values given here are biased"


def _out_of_contact(model: Model, found: Solution) -> float:
    """Median force before the contact, or after it; 0 if it is noise, or there is no such time.

    After the contact the force must have no shape, which another model could explain.
    """
    without = {**found.values, OFFSET: 0.0}
    model_force = model.at(found.time, [without])[:, 0]
    quiet = model_force <= QUIET * model_force.max()
    before = quiet & (found.time <= found.values.get(DELAY, 0.0))
    if np.count_nonzero(before) >= LEAST_QUIET:
        quiet = before  # whatever the model is
    elif np.count_nonzero(quiet) < LEAST_QUIET:
        return 0.0
    force = found.force[quiet]
    level = float(np.median(force))
    deviation = float(np.median(np.abs(force - level))) / 0.6745
    error = 1.2533 * deviation / math.sqrt(len(force))  # of a median
    least = max(CERTAIN * error, SMALL * float(found.force.max()))
    shaped = quiet is not before and deviation > 0.0 and neighbours(force - level) > COLOURED
    return level if abs(level) > least and not shaped else 0.0


# Errors of the plate ------------------------------------------------------------------------------


def plate_errors(
    model: Model, found: Solution, runs: Callable[[Deck], Model]
) -> dict[str, dict[str, float]]:
    """Changes of the fitted values with 1 % more thickness, or E1, of the plate in the deck.

    The fit is linearised.  `runs` gives the model of another deck.  A property is left out if the
    plate can't be run with the time step of the deck.
    """
    material = model.deck.require(Material)
    own = {"thickness": sum(y.thickness for y in material.layers), "e1": material.ply.e1}
    clock, _ = model.histories([found.values])
    dt = float(clock[len(clock) // 2 + 1])  # the first time after 0
    errors: dict[str, dict[str, float]] = {}
    for name in PROPERTIES:
        for change in (CHANGED, -CHANGED):  # one of them may be unstable
            try:
                other = runs(apply_case(model.deck, {name: (1.0 + change) * own[name], "dt": dt}))
                force = other.at(found.time, [found.values])[:, 0]
            except FecmError:
                continue
            x = np.linalg.lstsq(found.jacobian, found.model - force, rcond=None)[0]
            changes = PERCENT / change * found.scaling.slopes(found.x) * x
            errors[name] = dict(zip(found.scaling.start, changes.tolist(), strict=True))
            break
    return errors
