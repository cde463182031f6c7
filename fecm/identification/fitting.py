"""Least-squares fit of the parameters of an impact to a measured force, on one plate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._errors import StudyError
from fecm._typing import Floats
from fecm.authoring.case import Case
from fecm.authoring.strike_values import Strike
from fecm.authoring.values import check_names, strike_of_case
from fecm.deck.model import Deck
from fecm.identification.alignment import IdentifyError, contact_points
from fecm.identification.plates import ExactPlate, force_after
from fecm.mechanics.contact_law import Law
from fecm.results.comparison import Measurement
from fecm.studies.rod_test.filters import Filter
from fecm.sweeps.impact_columns import impacts_from_cards
from fecm.sweeps.outcome import Outcome

DELAY = "delay"  # measured time at which the projectile touches the plate
OFFSET = "offset"  # measured force without a contact
OF_RECORD = {DELAY: "time", OFFSET: "force"}  # dimensions of the parameters of the record
STEP = 1e-3  # half the step of central differences in delay and offset
POINTS = 10  # fewest measured points of a fit
LOST = 0.2  # largest share of the contact's points that may be outside the run of the deck
SINGULAR = 1e-3  # smallest allowed singular value of the Jacobian with unit columns
NO_EFFECT = 1e-6  # column of the Jacobian, rms over peak, below which a parameter has no effect
SHARE = 0.1  # share of a parameter in a singular vector above which the vector concerns it
SETTLED = 0.01  # step, over a standard error, below which the fit ends
MOST_EVALUATIONS = 60  # evaluations of a fit
FIRST_EVALUATIONS = 6  # evaluations of the short fit from each start of the delay
MOST_FITS = 4  # fits in turn: the delay decides which points the run of the deck covers


def fitted(deck: Deck, values: Mapping[str, float]) -> Strike:
    """Return the strike of a deck with fitted values; parameters of the record are ignored."""
    case: Case = {name: v for name, v in values.items() if name not in OF_RECORD}
    check_names(case)
    return strike_of_case(deck, case)


def rounded(values: Mapping[str, float]) -> dict[str, float]:
    """Return values with the digits of the fitted deck."""
    return {name: float(f"{value:.5g}") for name, value in values.items()}


class ForceModel(NamedTuple):
    """Contact forces of a deck with trial values, on one plate."""

    deck: Deck
    plate: ExactPlate
    sensor: Filter | None
    law: Law | None = None  # user's contact law, which replaces the law of the deck
    computed: Callable[[int], object] = lambda forces: None  # called with the number of forces

    def outcome(self, trials: Sequence[Strike], *, judged: bool) -> Outcome:
        """Compute impacts on the plate of the deck, under the law of this model."""
        impacts = impacts_from_cards(dict(enumerate(trials)), self.law)
        return self.plate.outcomes(impacts, judged=judged)

    def histories(self, trials: Sequence[Mapping[str, float]]) -> tuple[Floats, Floats]:
        """Return the forces of trials, (times, trials), after their times.

        The times start one duration of the run before the contact.
        """
        strikes = [fitted(self.deck, trial) for trial in trials]
        impacts = impacts_from_cards(dict(enumerate(strikes)), self.law)
        times, after = self.plate.forces(impacts, trials)
        failed = np.flatnonzero(~np.isfinite(after).all(axis=0))
        if self.law is not None and len(failed):  # a judged run gives the reason
            judged = self.outcome([fitted(self.deck, trials[failed[0]])], judged=True)
            raise IdentifyError(str(judged.status[0]))
        self.computed(len(trials))
        clock = np.concatenate([-times[:0:-1], times])
        forces = np.vstack([np.zeros((len(times) - 1, len(trials))), after])
        return clock, forces if self.sensor is None else self.sensor(clock, forces)

    def covering(self, duration: float) -> ForceModel:
        """Return the model in runs of a duration, if that saves time."""
        return self._replace(plate=self.plate.covering(duration))

    def beside(self, deck: Deck) -> ForceModel:
        """Return the model with the exact forces of another deck."""
        plate = self.plate.like(deck)
        return self._replace(deck=deck, plate=plate)

    def of_run(self, time: Floats, values: Mapping[str, float], run: Outcome) -> Floats:
        """Return the measured force, (times,), that a run with these values predicts."""
        times, force = force_after(run)
        clock = np.concatenate([-times[:0:-1], times])
        forces = np.append(np.zeros(len(times) - 1), force)[:, None]
        if self.sensor is not None:
            forces = self.sensor(clock, forces)
        return recorded(time, [values], clock, forces)[:, 0]

    def at(self, time: Floats, trials: Sequence[Mapping[str, float]]) -> Floats:
        """Return the measured forces that trial values predict, (times, trials)."""
        return recorded(time, trials, *self.histories(trials))


def recorded(
    time: Floats, trials: Sequence[Mapping[str, float]], clock: Floats, forces: Floats
) -> Floats:
    """Return the forces of trials, (clock, trials), in a record with their delays and offsets."""
    columns = [
        trial.get(OFFSET, 0.0) + np.interp(time - trial.get(DELAY, 0.0), clock, force)
        for trial, force in zip(trials, forces.T, strict=True)
    ]
    return np.column_stack(columns)


@dataclass(frozen=True)
class Scaling:
    """Parameters as functions of the scaled parameters x.

    A parameter is start exp(x) if its size is 0, otherwise start + size x.
    """

    start: dict[str, float]
    size: Floats
    low: Floats  # bounds of x
    high: Floats

    def values(self, x: Floats) -> dict[str, float]:
        """Return the values of the parameters by name."""
        middle = np.array(list(self.start.values()))
        numbers = np.where(self.size > 0.0, middle + self.size * x, middle * np.exp(x))
        return dict(zip(self.start, numbers.tolist(), strict=True))

    def slopes(self, x: Floats) -> Floats:
        """Return the derivatives of the values with respect to x."""
        return np.where(self.size > 0.0, self.size, list(self.values(x).values()))


@dataclass(frozen=True, eq=False)
class FittedPoints:
    """Fitted parameters, and the points to which they were fitted."""

    scaling: Scaling
    x: Floats
    time: Floats
    force: Floats
    model: Floats  # fitted force
    jacobian: Floats  # derivatives of the fitted force with respect to x, (points, names)
    converged: bool
    active: NDArray[np.int64]  # (names,): -1 or 1 at a bound
    lost: float  # share of the contact's points that are outside the run of the deck

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by name."""
        return self.scaling.values(self.x)

    @property
    def residual(self) -> Floats:
        """Measured minus fitted force."""
        return self.force - self.model

    @property
    def variance(self) -> float:
        """Variance of the residual."""
        return float(self.residual @ self.residual) / (len(self.time) - len(self.x))


def during_run(time: Floats, clock: Floats, delay: float) -> NDArray[np.bool_]:
    """Return a mask of the measured times that the run of the deck covers."""
    return np.asarray(np.abs(time - delay) <= clock[-1] * (1.0 + 1e-9))


def share_lost(force: Floats, inside: NDArray[np.bool_]) -> float:
    """Return the share of the contact's points that are outside the run of the deck."""
    in_contact = contact_points(force)
    return float(np.mean(~inside[in_contact]))


def fit_parameters(
    model: ForceModel, measured: Measurement, scaling: Scaling, x: Floats, evaluations: int
) -> FittedPoints | None:
    """Fit parameters from the start x, to the points that the run of the deck covers.

    The delay decides which points these are. Returns None if they are fewer than :data:`POINTS`.
    """
    clock, _ = model.histories([scaling.start])

    def within(x: Floats) -> NDArray[np.bool_]:
        return during_run(measured.time, clock, scaling.values(x).get(DELAY, 0.0))

    inside, points = within(x), None
    for fit_number in range(MOST_FITS):
        if np.count_nonzero(inside) < POINTS:
            return None
        points = _least_squares(model, measured, inside, scaling, x, evaluations)
        still_inside = within(points.x)
        if fit_number:  # once lost, a point stays lost
            still_inside &= inside
        if np.array_equal(still_inside, inside):
            break
        inside, x = still_inside, points.x
    return points


def _least_squares(
    model: ForceModel,
    measured: Measurement,
    inside: NDArray[np.bool_],
    scaling: Scaling,
    x0: Floats,
    evaluations: int,
) -> FittedPoints:
    from scipy.optimize import least_squares  # takes 0.2 s to import

    time, force = measured.time[inside], measured.force[inside]
    peak = float(np.abs(force).max()) or 1.0
    of_impact = model.plate.step
    steps = np.diag([STEP if name in OF_RECORD else of_impact for name in scaling.start])

    @lru_cache(maxsize=1)
    def evaluate(*parameters: float) -> tuple[Floats, Floats]:
        """Return force over peak and its Jacobian."""
        x = np.array(parameters)
        up, down = np.minimum(x + steps, scaling.high), np.maximum(x - steps, scaling.low)
        forces = model.at(time, [scaling.values(row) for row in (x, *up, *down)]) / peak
        above, below = np.split(forces[:, 1:], 2, axis=1)
        return forces[:, 0], (above - below) / np.diagonal(up - down)

    solution = least_squares(
        lambda x: evaluate(*x)[0] - force / peak,
        x0,
        jac=lambda x: evaluate(*x)[1],
        bounds=(scaling.low, scaling.high),
        max_nfev=evaluations,
        ftol=SETTLED**2 / len(time),
        xtol=model.plate.settled,
    )
    return FittedPoints(
        scaling=scaling,
        x=solution.x,
        time=time,
        force=force,
        model=solution.fun * peak + force,
        jacobian=solution.jac * peak,
        converged=solution.status > 0,
        active=solution.active_mask,
        lost=share_lost(measured.force, inside),
    )


def covariance(points: FittedPoints) -> Floats:
    """Return the covariance of the scaled parameters.

    Raises IdentifyError if the measurement does not determine them.
    """
    names, peak = list(points.scaling.start), float(np.abs(points.force).max())
    jac = points.jacobian / peak
    columns = np.sqrt(np.sum(jac**2, axis=0))
    if idle := [n for n, c in zip(names, columns, strict=True) if c < NO_EFFECT * len(jac) ** 0.5]:
        text = f"the force does not depend on {join_names(idle)} here"
        hint = f"leave {'it' if len(idle) == 1 else 'them'} out of the free parameters"
        raise IdentifyError(f"{text} (does the indentation reach alpha_p?); {hint}")
    _, singular, right = np.linalg.svd(jac / columns, full_matrices=False)
    if singular[-1] < SINGULAR:
        combined = [n for n, share in zip(names, right[-1], strict=True) if abs(share) > SHARE]
        text = f"a combination of {join_names(combined)} (singular value {singular[-1]:.1g})"
        hint = "give one of them the known value in the deck and leave it out"
        raise IdentifyError(f"the force determines only {text}; {hint}")
    root = right.T / singular / columns[:, None]
    matrix: Floats = points.variance / peak**2 * root @ root.T
    errors = zip(names, np.sqrt(np.diagonal(matrix)), strict=True)
    # Delay and offset may be 0: they have no relative error.
    vague = [
        f"{name} ({'over 1000' if error > 10.0 else f'{100.0 * error:.0f}'} %)"
        for name, error in errors
        if error > 1.0 and name not in OF_RECORD
    ]
    if vague:
        hint = (
            "the standard error is above 100 %; set known values in the deck, and do not fit them"
        )
        raise IdentifyError(f"the measurement does not determine {join_names(vague)}: {hint}")
    return matrix


def join_names(names: Sequence[str]) -> str:
    """Join names with commas and `and`."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def parameter_bounds(
    name: str, start: float, sizes: Mapping[str, float]
) -> tuple[float, float, float]:
    """Return the size of a parameter, 0 if it is exponential in x, and the bounds of its x.

    `sizes` has a time for the delay, a force for the offset and an indentation for alpha_p.
    """
    bound = 1e3
    if name in OF_RECORD:
        return sizes[name], -bound, bound
    if name == "s_p":
        return 1.0, -start, max(1e-9, 1.0 - 1e-6 - start)
    if name == "alpha_p" and not start:
        return sizes[name], 0.0, bound
    if not start > 0.0:
        raise StudyError(f"{name} is {start:g} in the deck; the fit must start from a positive one")
    return 0.0, -math.log(bound), math.log(bound)
