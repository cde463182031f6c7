"""Full runs beside a fit by the reduced model: they give its forces and confirm the values.

The first fit takes the forces of the reduced model. A full run at the fitted values then gives the
force, and the reduced model its derivatives at the first values: the parameters are fitted again to
a force that is linear in them. This is repeated with the next full run (Newton iteration with a
fixed derivative), until the values settle. So the fitted force is that of a full run. Full runs
beside it then give the derivatives for the standard errors and for the errors of the plate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fecm.identification.fitting import (
    OF_RECORD,
    OFFSET,
    FittedPoints,
    ForceModel,
    fitted,
)
from fecm.identification.plates import ForceExpansion
from fecm.judge.fits import UNCONFIRMED, UNSETTLED
from fecm.sweeps.impact_columns import impacts_from_cards
from fecm.sweeps.outcome import Outcome

# Effect of a full run on the values, in standard errors, and its difference from the fitted force,
# over the peak, below which the values are settled.
SETTLED, SAME = 0.1, 1e-4
MOST_FITS = 6  # to forces near full runs
BESIDE = 2e-3  # change of a scaled parameter for the derivative of full runs


class FullRun(NamedTuple):
    """Full run of the fitted deck, beside the fitted force.

    Attributes
    ----------
    modes : int
        Bending modes of the reduced model, which computed the forces of the first fit.
    fits : int
        Number of fits to forces near full runs.
    peak : float
        Peak of the fitted force over the peak of the full run, minus 1.
    misfit : float
        Root mean square of the difference of both forces, over the peak of the full run.
    largest : float
        Largest difference of both forces, over the peak of the full run.
    effect : float
        Change of the values if the full run replaced the fitted force, in standard errors.
    alone : float
        Peak of the reduced model without full runs over the peak of the full run, minus 1.
    """

    modes: int
    fits: int
    peak: float
    misfit: float
    largest: float
    effect: float
    alone: float

    @property
    def is_settled(self) -> bool:
        """Whether another full run would hardly change the values."""
        return self.effect <= SETTLED or self.largest <= SAME

    @property
    def doubt(self) -> str:
        """Reason to reject or to doubt the values; empty if there is none."""
        if self.rejects:
            return UNCONFIRMED.say(largest=f"{self.largest:.1%}")
        if self.is_settled:
            return ""
        return UNSETTLED.say(effect=f"{self.effect:.2g}", fits=self.fits)

    @property
    def rejects(self) -> bool:
        """Whether the fitted force is not that of the full run."""
        return not self.largest <= UNCONFIRMED.value


class Confirmed(NamedTuple):
    """Fit and the run of the fitted deck."""

    model: ForceModel
    points: FittedPoints
    outcome: Outcome  # run of the fitted deck
    full_run: FullRun | None = None  # None if the trial forces are exact, or the run fails

    @property
    def rejects(self) -> bool:
        """Whether the run rejects the values."""
        if self.full_run is not None:
            return self.full_run.rejects
        return not (self.model.plate.is_exact or bool(self.outcome.fine[0]))


def confirmed(
    model: ForceModel,
    points: FittedPoints,
    fit_again: Callable[[ForceModel, FittedPoints], FittedPoints | None],
) -> Confirmed:
    """Run the fitted deck; correct the model by full runs and fit again, until the values settle.

    `fit_again` fits the parameters of a corrected model, from the values of a fit.
    """
    fits, expansion = 0, None
    while True:
        outcome = model.outcome([fitted(model.deck, points.values)], judged=True)
        if model.plate.is_exact or not outcome.fine[0]:
            return Confirmed(model, points, outcome)
        full_run = _compared(model, points, outcome, fits)
        if fits == MOST_FITS or full_run.is_settled:
            points = _with_derivatives_of_runs(model, points, outcome)
            return Confirmed(model, points, outcome, full_run)
        expansion = (expansion or _expansion(model, points)).about(points.values, outcome)
        corrected = model._replace(plate=model.plate.near(expansion))
        again = fit_again(corrected, points)
        if again is None:
            return Confirmed(model, points, outcome, full_run)
        model, points, fits = corrected, again, fits + 1


def _expansion(model: ForceModel, points: FittedPoints) -> ForceExpansion:
    """Return the expansion of the forces of a model about the values of a fit."""
    scaling, trials = points.scaling, [points.values]
    names = [name for name in scaling.start if name not in OF_RECORD]
    for row, name in enumerate(scaling.start):
        if name in names:
            step = model.plate.step * np.eye(len(points.x))[row]
            for x in (points.x + step, points.x - step):
                trials.append(scaling.values(np.clip(x, scaling.low, scaling.high)))
    impacts = impacts_from_cards(dict(enumerate(fitted(model.deck, trial) for trial in trials)))
    times, forces = model.plate.forces(impacts, trials)
    model.computed(len(trials))
    slopes = {}
    for row, name in zip(range(1, len(trials), 2), names, strict=True):
        change = trials[row][name] - trials[row + 1][name]
        slopes[name] = (forces[:, row] - forces[:, row + 1]) / change
    return ForceExpansion(times, forces[:, 0], points.values, slopes)


def _with_derivatives_of_runs(
    model: ForceModel, points: FittedPoints, run: Outcome
) -> FittedPoints:
    """Return fitted points with the derivatives of full runs beside the run of the fitted values.

    Where a run fails, the derivative of the model remains.
    """
    scaling, jacobian = points.scaling, points.jacobian.copy()
    before = model.of_run(points.time, points.values, run)
    for number, name in enumerate(scaling.start):
        if name in OF_RECORD:
            continue
        x = points.x.copy()
        x[number] += BESIDE if x[number] + BESIDE < scaling.high[number] else -BESIDE
        values = scaling.values(x)
        beside = model.outcome([fitted(model.deck, values)], judged=True)
        if beside.fine[0]:
            change = model.of_run(points.time, values, beside) - before
            jacobian[:, number] = change / (x[number] - points.x[number])
    return replace(points, jacobian=jacobian)


def _deviation(points: FittedPoints) -> float:
    return math.sqrt(max(points.variance, np.finfo(float).tiny))


def _compared(model: ForceModel, points: FittedPoints, run: Outcome, fits: int) -> FullRun:
    """Compare the fitted force with the run of the fitted deck."""
    values = points.values | {OFFSET: 0.0}
    alone = model._replace(plate=model.plate.alone)
    force, force_alone = (trial.at(points.time, [values])[:, 0] for trial in (model, alone))
    in_full = model.of_run(points.time, values, run)
    peak, change = float(in_full.max()), in_full - force
    moved = points.jacobian @ np.linalg.lstsq(points.jacobian, change, rcond=None)[0]
    return FullRun(
        modes=model.plate.modes,
        fits=fits,
        peak=float(force.max()) / peak - 1.0,
        misfit=float(np.sqrt(np.mean(change**2))) / peak,
        largest=float(np.abs(change).max()) / peak,
        effect=float(np.linalg.norm(moved)) / _deviation(points),
        alone=float(force_alone.max()) / peak - 1.0,
    )
