"""Full runs beside a fit by the reduced model: they correct its forces and confirm the values.

The difference between full runs and the reduced model, linear in the parameters, is added to the
forces of the model, and the parameters are fitted again (N. M. Alexandrov and R. M. Lewis,
Optimization and Engineering 2, 2001, 413: first-order consistency). Near the full runs, force and
derivatives are then those of full runs, and so are the standard errors. Full runs beside the first
fit give the derivatives, and each later one corrects them (C. G. Broyden, Mathematics of
Computation 19, 1965, 577).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fecm.identification.corrections import NO_CORRECTIONS
from fecm.identification.fitting import (
    OF_RECORD,
    OFFSET,
    FittedPoints,
    ForceModel,
    fitted,
)
from fecm.judge.fits import UNCONFIRMED, UNSETTLED
from fecm.sweeps.impact_columns import impacts_from_cards
from fecm.sweeps.outcome import Outcome

# Effect of a full run on the values, in standard errors, and its difference from the fitted force,
# over the peak, below which the values are settled.
SETTLED, SAME = 0.2, 1e-4
# Change of a scaled parameter for the derivative of full runs.
BESIDE = 2e-3
MOST_FITS = 6  # of a corrected model


class FullRun(NamedTuple):
    """Full run of the fitted deck, beside the fitted force.

    Attributes
    ----------
    modes : int
        Bending modes of the reduced model, which computed the trial forces.
    fits : int
        Number of fits with forces that full runs corrected.
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
            return UNCONFIRMED.say(largest=f"{self.largest:.1%}", modes=self.modes)
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


def beside_full_run(model: ForceModel) -> ForceModel:
    """Return a model that fits the run of the deck, if that needs one and does not fail."""
    if model.plate.is_exact:
        return model
    impact = fitted(model.deck, {})
    outcome = model.outcome([impact], judged=True)
    if not outcome.fine[0]:
        return model
    plate = model.plate.following(impacts_from_cards({0: impact}), outcome)
    return model._replace(plate=plate).corrected({}, outcome)


def confirmed(
    model: ForceModel,
    points: FittedPoints,
    fit_again: Callable[[ForceModel, FittedPoints], FittedPoints | None],
) -> Confirmed:
    """Run the fitted deck; correct the model by full runs and fit again, until the values settle.

    `fit_again` fits the parameters of a corrected model, from the values of a fit.
    """
    fits = 0
    while True:
        outcome = model.outcome([fitted(model.deck, points.values)], judged=True)
        if model.plate.is_exact or not outcome.fine[0]:
            return Confirmed(model, points, outcome)
        full_run = _compared(model, points, outcome, fits)
        if fits == MOST_FITS or (fits and full_run.is_settled):
            return Confirmed(model, points, outcome, full_run)
        corrected = model.corrected(points.values, outcome)
        if fits:
            sizes = dict(zip(points.values, points.scaling.slopes(points.x).tolist(), strict=True))
            corrections = corrected.corrections.meeting(model.corrections, sizes)
            corrected = corrected._replace(corrections=corrections)
        else:
            corrected = _with_slopes(corrected, points)
        again = fit_again(corrected, points)
        if again is None:
            return Confirmed(model, points, outcome, full_run)
        model, points, fits = corrected, again, fits + 1


def _with_slopes(model: ForceModel, points: FittedPoints) -> ForceModel:
    """Return the model with the derivatives of full runs beside the last one.

    A derivative is that of the reduced model where a run fails.
    """
    corrections, slopes = model.corrections, {}
    for number, name in enumerate(points.scaling.start):
        if name in OF_RECORD:
            continue
        x = points.x.copy()
        x[number] += BESIDE if x[number] + BESIDE < points.scaling.high[number] else -BESIDE
        values = points.scaling.values(x)
        run = model.outcome([fitted(model.deck, values)], judged=True)
        if run.fine[0]:
            _, difference = model.difference(values, run)
            change = values[name] - points.values[name]
            slopes[name] = (difference - corrections.difference) / change
    return model._replace(corrections=corrections._replace(slopes=slopes))


def _deviation(points: FittedPoints) -> float:
    return math.sqrt(max(points.variance, np.finfo(float).tiny))


def _compared(model: ForceModel, points: FittedPoints, run: Outcome, fits: int) -> FullRun:
    """Compare the fitted force with the run of the fitted deck."""
    values = points.values | {OFFSET: 0.0}
    alone = model._replace(corrections=NO_CORRECTIONS)
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
