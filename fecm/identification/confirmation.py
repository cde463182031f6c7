"""Full runs beside a fit by the reduced model: they correct its forces and confirm the values.

The run of the deck corrects the reduced model for the first fit. At the fitted values full runs
give the force and its derivatives, which take the place of the model: the parameters are fitted
again to a force that is linear in the values of the impact (Gauss-Newton iteration), until the
values settle. So the values and their standard errors are those of full runs, and the last full run
has the values of the fitted deck.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.identification.fitting import (
    OF_RECORD,
    OFFSET,
    FittedPoints,
    ForceModel,
    fitted,
)
from fecm.identification.plates import ForceExpansion, force_after
from fecm.judge.fits import UNCONFIRMED, UNSETTLED
from fecm.sweeps.impact_columns import impacts_from_cards
from fecm.sweeps.outcome import About, Outcome

# Effect of a full run on the values, in standard errors, and its difference from the fitted force,
# over the peak, below which the values are settled.
SETTLED, SAME = 0.1, 1e-4
# Change of a scaled parameter for the derivative of full runs.
BESIDE = 2e-3
FALLS = 0.5  # effect of a full run, over that of the run before, above which a step is halved
MOST_FITS = 6  # to forces near full runs


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


def beside_full_run(model: ForceModel) -> ForceModel:
    """Return a model that fits the run of the deck, if that needs one and does not fail."""
    if model.plate.is_exact:
        return model
    impact = fitted(model.deck, {})
    outcome = model.outcome([impact], judged=True)
    if not outcome.fine[0]:
        return model
    plate = model.plate.following(impacts_from_cards({0: impact}), outcome)
    return model._replace(plate=plate)


def confirmed(
    model: ForceModel,
    points: FittedPoints,
    fit_again: Callable[[ForceModel, FittedPoints], FittedPoints | None],
) -> Confirmed:
    """Run the fitted deck; correct the model by full runs and fit again, until the values settle.

    `fit_again` fits the parameters of a corrected model, from the values of a fit.
    """
    fits, effect, is_halved = 0, math.inf, False
    while True:
        outcome = model.outcome([fitted(model.deck, points.values)], judged=True)
        if model.plate.is_exact or not outcome.fine[0]:
            return Confirmed(model, points, outcome)
        full_run = _compared(model, points, outcome, fits)
        if fits == MOST_FITS or (fits and full_run.is_settled and not is_halved):
            return Confirmed(model, points, outcome, full_run)
        corrected = model._replace(plate=model.plate.near(_expansion(model, points, outcome)))
        again = fit_again(corrected, points)
        if again is None:
            return Confirmed(model, points, outcome, full_run)
        # Steps to and fro have the values between them.
        is_halved = full_run.effect > FALLS * effect and fits + 1 < MOST_FITS
        if is_halved:
            again = _halfway(corrected, points, again)
        model, points, fits, effect = corrected, again, fits + 1, full_run.effect


def _halfway(model: ForceModel, before: FittedPoints, after: FittedPoints) -> FittedPoints:
    """Return the values half-way between those of two fits, and their force."""
    middle = replace(after, x=(before.x + after.x) / 2.0)
    return replace(middle, model=model.at(middle.time, [middle.values])[:, 0])


def _expansion(model: ForceModel, points: FittedPoints, run: Outcome) -> ForceExpansion:
    """Return the expansion about a full run, by full runs beside it.

    A derivative is left out, as 0, where a run fails.
    """
    times, _ = model.plate.forces(impacts_from_cards({0: fitted(model.deck, {})}), [points.values])
    dt = float(run.columns[About.DT][0])
    times = dt * np.arange(math.ceil(times[-1] / dt) + 1.0)
    force, slopes = _force_at(times, run), {}
    for number, name in enumerate(points.scaling.start):
        if name in OF_RECORD:
            continue
        x = points.x.copy()
        x[number] += BESIDE if x[number] + BESIDE < points.scaling.high[number] else -BESIDE
        values = points.scaling.values(x)
        beside = model.outcome([fitted(model.deck, values)], judged=True)
        if beside.fine[0]:
            change = values[name] - points.values[name]
            slopes[name] = (_force_at(times, beside) - force) / change
    return ForceExpansion(times, force, points.values, slopes)


def _force_at(times: Floats, run: Outcome) -> Floats:
    """Return the force of a run, which is 0 after its end."""
    return np.asarray(np.interp(times, *force_after(run), right=0.0))


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
