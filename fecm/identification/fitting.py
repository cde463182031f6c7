"""Least squares between a measured force and the forces of one plate with trial values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.authoring.case import Case
from fecm.authoring.impacts import impacts_from_cards
from fecm.authoring.strike import Strike
from fecm.authoring.values import check_names
from fecm.authoring.vary import strike_of_case
from fecm.deck.model import Deck
from fecm.identification.alignment import IdentifyError, contact_points
from fecm.mechanics.contact_law import Law
from fecm.results.comparison import Measurement
from fecm.studies import StudyError
from fecm.studies.rod_test.filters import Filter
from fecm.sweeps.outcome import Backend, Outcome

DELAY = "delay"  # measured time at which the approach of the projectile ends in a contact
OFFSET = "offset"  # measured force without a contact
OF_RECORD = {DELAY: "time", OFFSET: "force"}  # dimensions of values that no deck has
STEP = 1e-3  # half of the step of central differences, in the scaled parameters
POINTS = 10  # fewest measured points
LOST = 0.2  # largest share of the points of the contact that may be outside the run of the deck
SINGULAR = 1e-3  # smallest singular value of the Jacobian with unit columns
NO_EFFECT = 1e-6  # smallest column of the Jacobian, rms over peak
SHARE = 0.1  # share of a parameter in a singular vector above which the vector concerns it
SETTLED = 0.01  # share of a standard error: the fit ends with a step below it
MOST_EVALUATIONS = 60  # of a fit
FIRST_EVALUATIONS = 6  # of each start of the delay
MOST_FITS = 4  # with fewer points each, as the points of the deck's run depend on the delay


def fitted(deck: Deck, values: Mapping[str, float]) -> Strike:
    """Return the strike of a deck with the fitted values of the deck, not those of the record."""
    case: Case = {name: v for name, v in values.items() if name not in OF_RECORD}
    check_names(case)
    return strike_of_case(deck, case)


class ForceModel(NamedTuple):
    """Contact forces of a deck with trial values, all from one response of the plate."""

    deck: Deck
    backend: Backend
    sensor: Filter | None
    law: Law | None = None  # a user's contact law instead of the deck's
    computed: Callable[[int], object] = lambda forces: None  # called with the number of forces

    def outcome(self, trials: Sequence[Strike], *, judged: bool) -> Outcome:
        """Compute impacts on the plate of the deck, under the law of this model."""
        impacts = impacts_from_cards(dict(enumerate(trials)), self.law)
        return self.backend.outcomes(impacts, judged=judged)

    def histories(self, trials: Sequence[Mapping[str, float]]) -> tuple[Floats, Floats]:
        """Return times, from one duration before the contact on, and forces (times, trials)."""
        outcome = self.outcome([fitted(self.deck, trial) for trial in trials], judged=False)
        assert outcome.force is not None
        failed = np.flatnonzero(~np.isfinite(outcome.force).all(axis=1))
        if self.law is not None and len(failed):  # the run alone tells why
            trial = self.outcome([fitted(self.deck, trials[failed[0]])], judged=True)
            raise IdentifyError(str(trial.status[0]))
        self.computed(len(trials))
        steps = outcome.force.shape[1]
        clock = float(outcome.columns["dt"][0]) * np.arange(-steps, steps + 1.0)
        forces = np.vstack([np.zeros((steps + 1, len(trials))), outcome.force.T])
        return clock, forces if self.sensor is None else self.sensor(clock, forces)

    def at(self, time: Floats, trials: Sequence[Mapping[str, float]]) -> Floats:
        """Return the measured forces that trial values predict, (times, trials)."""
        clock, forces = self.histories(trials)
        columns = [
            trial.get(OFFSET, 0.0) + np.interp(time - trial.get(DELAY, 0.0), clock, force)
            for trial, force in zip(trials, forces.T, strict=True)
        ]
        return np.column_stack(columns)


@dataclass(frozen=True)
class Scaling:
    """Parameters as functions of x: start exp(x) where the size is 0, otherwise start + size x."""

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
        """Return the derivatives of the values."""
        return np.where(self.size > 0.0, self.size, list(self.values(x).values()))


@dataclass(frozen=True)
class FittedPoints:
    """Parameters of least squares, and the points that were fitted."""

    scaling: Scaling
    x: Floats
    time: Floats
    force: Floats
    model: Floats  # fitted force
    jacobian: Floats  # of the fitted force by x, (points, names)
    converged: bool
    active: NDArray[np.int64]  # (names,): -1 or 1 at a bound
    lost: float  # share of the points of the contact that are outside the run of the deck

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
    """Return a mask of the measured times that the histories of a model cover."""
    return np.asarray(np.abs(time - delay) <= clock[-1] * (1.0 + 1e-9))


def share_lost(force: Floats, inside: NDArray[np.bool_]) -> float:
    """Return the share of the points of the contact that are outside the run of the deck."""
    loaded = contact_points(force)
    return float(np.mean(~inside[loaded]))


def fit_parameters(
    model: ForceModel, measured: Measurement, scaling: Scaling, x: Floats, evaluations: int
) -> FittedPoints | None:
    """Fit parameters from x; the delay selects the points that the run of the deck covers.

    Returns None if there are fewer than :data:`POINTS`.
    """
    clock, _ = model.histories([scaling.start])

    def within(x: Floats) -> NDArray[np.bool_]:
        return during_run(measured.time, clock, scaling.values(x).get(DELAY, 0.0))

    inside, points = within(x), None
    for number in range(MOST_FITS):
        if np.count_nonzero(inside) < POINTS:
            return None
        points = _least_squares(model, measured, inside, scaling, x, evaluations)
        still = within(points.x)
        if number:  # points at the end of the run don't come and go
            still &= inside
        if np.array_equal(still, inside):
            break
        inside, x = still, points.x
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

    @lru_cache(maxsize=1)
    def evaluate(*given: float) -> tuple[Floats, Floats]:
        """Return force over peak and its Jacobian."""
        x, steps = np.array(given), STEP * np.eye(len(given))
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
        xtol=1e-7,
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

    Raises IdentifyError if the residual does not determine them.
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
        both = [n for n, share in zip(names, right[-1], strict=True) if abs(share) > SHARE]
        text = f"a combination of {join_names(both)} (singular value {singular[-1]:.1g})"
        hint = "give one of them the known value in the deck and leave it out"
        raise IdentifyError(f"the force determines only {text}; {hint}")
    root = right.T / singular / columns[:, None]
    found_covariance: Floats = points.variance / peak**2 * root @ root.T
    errors = zip(names, np.sqrt(np.diagonal(found_covariance)), strict=True)
    # Delay and offset may be 0, which no error can be compared with.
    vague = [f"{n} ({100.0 * e:.0f} %)" for n, e in errors if e > 1.0 and n not in OF_RECORD]
    if vague:
        hint = (
            "the standard error is above 100 %; set known values in the deck, and do not fit them"
        )
        raise IdentifyError(f"the measurement does not determine {join_names(vague)}: {hint}")
    return found_covariance


def join_names(names: Sequence[str]) -> str:
    """Names with commas and an `and`."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def parameter_bounds(
    name: str, start: float, sizes: Mapping[str, float]
) -> tuple[float, float, float]:
    """Return the size of a parameter (0: exponential) and the bounds of its x.

    `sizes` are a time for the delay, a force for the offset and an indentation for alpha_p.
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
