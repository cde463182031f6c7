"""Fit parameters of an impact to a measured force history."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fecm._errors import FecmError, warn
from fecm._typing import Floats
from fecm.deck.model import Deck, Impact, Indentation, Projectile
from fecm.deck.units import KNOWN, unit_names
from fecm.mechanics.projectile import RigidMass
from fecm.problem.build import build_projectile
from fecm.studies import StudyError
from fecm.studies.comparison import Measurement, measurement_of
from fecm.studies.rod_test.filters import Filter, filter_of
from fecm.sweeps.api import problem_of
from fecm.sweeps.batch import Runs, runs_of
from fecm.sweeps.plan import RUN, shares_plate
from fecm.sweeps.vary import apply_case

DELAY = "delay"  # measured time at which the approach of the projectile ends in a contact
CARDS: dict[str, type[Impact | Indentation | Projectile]] = {
    **dict.fromkeys(("velocity", "energy"), Impact),
    **dict.fromkeys(("k", "alpha_p", "s_p", "q"), Indentation),
    **dict.fromkeys(("mass", "rod_length", "rod_modulus", "rod_density"), Projectile),
}
FREE = (*CARDS, DELAY)
STEP = 1e-3  # half of the step of central differences, in the scaled parameters
BOUND = 1e3  # factor between the parameters of the deck and their bounds
OFF = 20.0  # factor between measured and computed peak or duration: a unit must be wrong
POINTS, TOP_POINTS = 10, 3  # fewest measured points, and fewest above half of the peak
# Smallest singular value of the Jacobian with unit columns, and smallest column (rms over peak).
SINGULAR, NO_EFFECT = 1e-3, 1e-6
SHARE = 0.1  # share of a parameter in a singular vector above which the vector concerns it
# A finding reports a larger correlation: of two parameters, and of neighbouring residuals where the
# force exceeds a share of its peak.
CORRELATED, COLOURED, FAINT = 0.99, 0.5, 1e-3
SETTLED = 0.01  # share of a standard error: the fit ends with a step below it
MOST_EVALUATIONS = 60


class IdentifyError(FecmError):
    """The measurement does not determine the parameters."""

    exit_code = 1


@dataclass(frozen=True)
class Identification:
    """Parameters fitted to a measured force.

    Attributes
    ----------
    values, errors : dict of str to float
        Fitted values and their standard errors, by name.
    start : dict of str to float
        Values before the fit.
    correlation : ndarray (names, names)
        Correlation matrix of the values, in their order.
    time, force, model : ndarray (points,)
        Measured times and forces that were fitted, and the fitted force at these times.
    converged : bool
        Whether the fit has converged.
    deck : Deck
        The deck with the fitted values, rounded to five digits.
    notes : tuple of str
        Reasons to doubt the values.
    """

    values: dict[str, float]
    errors: dict[str, float]
    start: dict[str, float]
    correlation: Floats
    time: Floats
    force: Floats
    model: Floats
    converged: bool
    deck: Deck
    notes: tuple[str, ...]

    @property
    def residual(self) -> Floats:
        """Measured minus fitted force, (points,)."""
        return self.force - self.model

    @property
    def dof(self) -> int:
        """Degrees of freedom: points minus parameters."""
        return len(self.time) - len(self.values)

    @property
    def rms(self) -> float:
        """Standard deviation of the residual, with `dof` in its denominator (force)."""
        return float(np.sqrt(self.residual @ self.residual / self.dof))

    @property
    def share(self) -> float:
        """`rms` over the measured peak force."""
        return self.rms / float(self.force.max())

    def cards(self) -> str:
        """Cards of the deck with fitted values."""
        kinds = dict.fromkeys(CARDS[name] for name in self.values if name in CARDS)
        segments = (self.deck.require(kind) for kind in kinds)
        return "\n".join(line for s in segments for line in s.cards(self.deck.control)).rstrip()


def identify(
    deck: str | Path | Deck,
    time: Any,
    force: Any,
    free: str | Sequence[str],
    filter: str | Filter | None = None,
) -> Identification:
    """Fit parameters of an impact to a measured contact force.

    The values of the deck are the start of the fit, by least squares with equal weights.  Standard
    errors are those of independent errors of the measured points, with the variance of the
    residual.  The notes of the result are :class:`FecmWarning`.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem.
    time, force : array_like (points,)
        Measured contact force, positive in compression, at increasing times, in the deck's units.
        Time 0 is that of the deck: the projectile touches the plate.
    free : str or sequence of str
        Parameters to fit: ``"velocity"``, ``"energy"``, ``"k"``, ``"alpha_p"``, ``"s_p"``, ``"q"``,
        ``"mass"``, ``"rod_length"``, ``"rod_modulus"``, ``"rod_density"``; and ``"delay"``, the
        measured time at which the projectile touches the plate.
    filter : str, optional
        Filter of the measurement, which the computed force passes too: ``"first-order:RISE"``,
        ``"moving-average:RISE"`` or ``"cfc:CLASS"``.

    Returns
    -------
    Identification
        Fitted values, their errors and correlations, and the deck with them.

    Raises
    ------
    IdentifyError
        If the measurement does not determine the parameters.
    StudyError
        If the measurement is invalid, in other units, or too short; or if a name or the filter is
        unknown.
    DeckError
        If the deck has errors.
    CasesError
        If the deck has several problems, or its cases do not share a plate.

    Examples
    --------
    >>> import numpy as np
    >>> table = fecm.examples.path("measured-force.csv")
    >>> time, force = np.loadtxt(table, delimiter=",", skiprows=3, unpack=True)
    >>> found = fecm.identify("impact-115.inp", time, force, ["k"], filter="first-order:5e-6")
    >>> round(found.values["k"], -4)
    1900000.0
    """
    measured = measurement_of((time, force), {})
    known = filter_of(filter) if isinstance(filter, str) else filter
    names = (free,) if isinstance(free, str) else tuple(free)
    found = fit(problem_of(deck).deck, measured, names, known)
    for text in found.notes:
        warn(text)
    return found


class _Model(NamedTuple):
    """Contact forces of a deck with trial values, all from one response of the plate."""

    deck: Deck
    runs: Runs
    sensor: Filter | None

    def histories(self, trials: Sequence[Mapping[str, float]]) -> tuple[Floats, Floats]:
        """Times, from one duration before the contact on, and forces (times, trials)."""
        found = self.runs({n: _fitted(self.deck, one) for n, one in enumerate(trials)}, False)
        assert found.force is not None
        steps = found.force.shape[1]
        clock = float(found.columns["dt"][0]) * np.arange(-steps, steps + 1.0)
        forces = np.vstack([np.zeros((steps + 1, len(trials))), found.force.T])
        return clock, forces if self.sensor is None else self.sensor(clock, forces)

    def at(self, time: Floats, trials: Sequence[Mapping[str, float]]) -> Floats:
        """Forces at measured times, (times, trials)."""
        clock, forces = self.histories(trials)
        columns = zip((trial.get(DELAY, 0.0) for trial in trials), forces.T, strict=True)
        return np.column_stack([np.interp(time - d, clock, force) for d, force in columns])


@lru_cache(maxsize=4)
def _shared(deck: Deck) -> Runs:
    """The function that runs cases of a deck by one response of its plate."""
    problem = problem_of(deck)
    if not shares_plate(problem):
        loads = "FORC, EXCD, TANG, FORM and SOLV"
        needed = f"impact steps (RODP) of one size, and a plate without {loads}"
        raise StudyError(f"identify needs {needed}")
    return runs_of(problem)


def fit(
    deck: Deck, measured: Measurement, free: Sequence[str], sensor: Filter | None = None
) -> Identification:
    """Fit parameters of a deck to a measurement; see :func:`identify`."""
    from scipy.optimize import least_squares

    if not free or not set(free) <= set(FREE) or len(set(free)) < len(free):
        given = ", ".join(map(str, free)) or "none"
        raise StudyError(f"can't fit {given}; fit different ones of {', '.join(FREE)}")
    units = unit_names(deck)
    sensor = None if sensor is None else sensor.in_unit(units.get("time", ""))
    model = _Model(deck, _shared(deck), sensor)
    clock, own = model.histories([{}])
    first, width = _check(measured, clock, own[:, 0], units)
    if DELAY not in free and abs(first) > width:
        side = "after" if first > 0.0 else "before"
        text = f"the force rises {abs(first):.3g} {side} that of the deck's own run"
        raise StudyError(f"{measured.name}: {text}; fit delay too, or shift the times")
    start = {name: first if name == DELAY else _start(deck, name) for name in free}
    # A value is start exp(x), or start + size x; x is between low and high.
    depth = (own.max() / deck.require(Indentation).k) ** (2.0 / 3.0)
    size, low, high = np.array([_scale(n, v, width, depth) for n, v in start.items()]).T
    middle = np.array(list(start.values()))
    inside = np.abs(measured.time - start.get(DELAY, 0.0)) <= clock[-1] * (1.0 + 1e-9)
    time, force = measured.time[inside], measured.force[inside]
    if len(time) < POINTS:
        text = f"{len(time)} points during the run of the deck; at least {POINTS} are needed"
        raise StudyError(f"{measured.name} has {text}")
    peak = float(force.max())

    def trial(x: Floats) -> dict[str, float]:
        values = np.where(size > 0.0, middle + size * x, middle * np.exp(x))
        return dict(zip(start, values.tolist(), strict=True))

    @lru_cache(maxsize=1)
    def evaluate(*given: float) -> tuple[Floats, Floats]:
        """Force over peak and its Jacobian."""
        x, steps = np.array(given), STEP * np.eye(len(given))
        up, down = np.minimum(x + steps, high), np.maximum(x - steps, low)
        forces = model.at(time, [trial(row) for row in (x, *up, *down)]) / peak
        above, below = np.split(forces[:, 1:], 2, axis=1)
        return forces[:, 0], (above - below) / np.diagonal(up - down)

    found = least_squares(
        lambda x: evaluate(*x)[0] - force / peak, np.zeros(len(start)), lambda x: evaluate(*x)[1],
        (low, high), max_nfev=MOST_EVALUATIONS, ftol=SETTLED**2 / len(time), xtol=1e-7,
    )  # fmt: skip
    values = trial(found.x)
    cov = _covariance(found.jac, 2.0 * found.cost / (len(time) - len(start)), list(start))
    deviation = np.sqrt(np.diagonal(cov))
    correlation = cov / np.outer(deviation, deviation)
    np.fill_diagonal(correlation, 1.0)
    errors = deviation * np.where(size > 0.0, size, list(values.values()))
    made = Identification(
        values, dict(zip(start, errors.tolist(), strict=True)), start, correlation,
        time, force, found.fun * peak + force, found.status > 0,
        _fitted(deck, {n: float(f"{v:.5g}") for n, v in values.items()}), (),
    )  # fmt: skip
    return replace(made, notes=tuple(_notes(made, measured, found.active_mask, model)))


def _fitted(deck: Deck, values: Mapping[str, float]) -> Deck:
    return apply_case(deck, {name: value for name, value in values.items() if name != DELAY})


def _start(deck: Deck, name: str) -> float:
    rod = build_projectile(deck)
    if name == "mass":
        return rod.total_mass
    if name == "energy":
        return 0.5 * rod.total_mass * deck.require(Impact).velocity ** 2
    if CARDS[name] is not Projectile:
        return float(getattr(deck.require(CARDS[name]), name))
    if isinstance(rod, RigidMass):
        raise StudyError(f"{name}: the projectile of the deck is a rigid mass")
    return float(getattr(rod, name.removeprefix("rod_")))


def _scale(name: str, start: float, width: float, depth: float) -> tuple[float, float, float]:
    """Size (0: exponential) and bounds of x; `width` is a time, `depth` an indentation."""
    if name == DELAY:
        return width, -BOUND, BOUND
    if name == "s_p":
        return 1.0, -start, max(1e-9, 1.0 - 1e-6 - start)
    if name == "alpha_p" and not start:
        return depth, 0.0, BOUND
    if not start > 0.0:
        raise StudyError(f"{name} is {start:g} in the deck; the fit must start from a positive one")
    return 0.0, -math.log(BOUND), math.log(BOUND)


def _top(time: Floats, force: Floats) -> tuple[float, float]:
    """First time above half of the peak, and the time from there to the last."""
    top = time[force > 0.5 * force.max()]
    return (float(top[0]), float(np.ptp(top))) if len(top) else (0.0, 0.0)


def _check(
    measured: Measurement, clock: Floats, own: Floats, units: Mapping[str, str]
) -> tuple[float, float]:
    """Compare a measurement with the deck's own run.

    Returns its delay at half of the peak, and the time that the own run is above it.
    """
    name, force, peak = measured.name, measured.force, float(own.max())
    begin, width = _top(clock, own)
    if measured.column != "force":
        text = "has a column transducer and no force; the contact force is fitted"
        raise StudyError(f"{name} {text}")
    if not (peak > 0.0 and width > 0.0):
        raise StudyError("the deck's own run has no contact force to compare with; check its ROD")
    if -force.min() > force.max():
        raise StudyError(f"{name}: the contact force is negative; it is positive in compression")
    if np.count_nonzero(force > 0.5 * force.max()) < TOP_POINTS:
        raise StudyError(f"{name} has fewer than {TOP_POINTS} points above half of its peak")
    first, long = _top(measured.time, force)
    for dimension, found, expected in (("force", force.max(), peak), ("time", long, width)):
        if not 1.0 / OFF < found / expected < OFF:
            what = {"force": "peak force", "time": "time above half of the peak"}[dimension]
            unit, cause = units.get(dimension, ""), _cause(dimension, found / expected, units)
            usual = f"that of the deck's own run {expected:.3g} {unit}".rstrip()
            raise StudyError(f"{name}: the {what} is {found:.3g}, {usual}; {cause}")
    return first - begin, width


def _cause(dimension: str, ratio: float, units: Mapping[str, str]) -> str:
    """Likely cause of a measurement that is off by a factor, and the remedy."""
    known, own = KNOWN[dimension], units.get(dimension, "")
    text = f"is the column in another unit of {dimension}?  Convert it"
    if own in known:
        unit = min(known, key=lambda one: abs(math.log(ratio * known[one] / known[own])))
        if 0.2 < ratio * known[unit] / known[own] < 5.0:
            text = f"the column seems to be in {unit}; convert it to {own}"
    return f"{text}, or exchange time and force if they are swapped"


def _covariance(jac: Floats, variance: float, names: Sequence[str]) -> Floats:
    """Covariance of the scaled parameters; IdentifyError if the residual doesn't determine them."""
    columns = np.sqrt(np.sum(jac**2, axis=0))
    if idle := [n for n, c in zip(names, columns, strict=True) if c < NO_EFFECT * len(jac) ** 0.5]:
        text = f"the force does not depend on {_listed(idle)} here"
        hint = f"leave {'it' if len(idle) == 1 else 'them'} out of the free parameters"
        raise IdentifyError(f"{text} (does the indentation reach alpha_p?); {hint}")
    _, singular, right = np.linalg.svd(jac / columns, full_matrices=False)
    if singular[-1] < SINGULAR:
        both = [n for n, share in zip(names, right[-1], strict=True) if abs(share) > SHARE]
        text = f"a combination of {_listed(both)} (singular value {singular[-1]:.1g})"
        hint = "give one of them the known value in the deck and leave it out"
        raise IdentifyError(f"the force determines only {text}; {hint}")
    root = right.T / singular / columns[:, None]
    covariance: Floats = variance * root @ root.T
    errors = zip(names, np.sqrt(np.diagonal(covariance)), strict=True)
    if vague := [f"{name} ({100.0 * error:.0f} %)" for name, error in errors if error > 1.0]:
        hint = "the standard error is above 100 %; give known values in the deck and leave them out"
        raise IdentifyError(f"the measurement does not determine {_listed(vague)}: {hint}")
    return covariance


def _listed(names: Sequence[str]) -> str:
    """Names with commas and an `and`."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _notes(found: Identification, given: Measurement, active: Any, model: _Model) -> Iterator[str]:
    if not found.converged:
        yield "the fit has not converged; start from better values in the deck"
    if out := len(given.time) - len(found.time):
        yield f"{out} of {len(given.time)} points are outside the run of the deck and left out"
    for name, side in zip(found.values, active, strict=True):
        if side:
            yield f"{name} is at its bound {found.values[name]:.6g}; its standard error is void"
    names = list(found.values)
    for i, j in zip(*np.nonzero(np.triu(np.abs(found.correlation) > CORRELATED, 1)), strict=True):
        text = f"{names[i]} and {names[j]} have the correlation {found.correlation[i, j]:.4f}"
        yield f"{text}: their values can hardly be told apart"
    e = found.residual
    if found.share > FAINT and (near := float(e[1:] @ e[:-1] / (e @ e))) > COLOURED:
        text = "the model does not describe the measurement down to its noise"
        text = f"{text}, and the standard errors are too small"
        yield f"neighbouring residuals have the correlation {near:.2f}: {text}"
    if (status := model.runs({0: found.deck}, True).status[0]) not in RUN:
        yield f"the run of the fitted deck fails: {status}"
