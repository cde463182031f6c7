"""Impact on the static plate: deflection of the linear plate, curve of a nonlinear one, duration.

The kinetic energy of the projectile is stored in the plate and in the indentation.  Nothing here
knows waves: a light projectile bends the plate less.
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from fecm._errors import FecmError
from fecm.deck.model import Impact, Indentation
from fecm.mechanics.quick_models import contact_time_on_curve, static_peak, static_plate
from fecm.mechanics.solutions import ConvergenceError, SingularStiffnessError, static_stiffness
from fecm.mechanics.static_curve import StaticCurve, static_curve
from fecm.problem.contact_estimates import wave_impedance
from fecm.problem.parts import build_projectile
from fecm.problem.problem import Problem

MOST_SOLVED = 1000  # elements up to which checks and notes take static solutions
# First step of a static curve: a fraction of the linear plate's deflection, and of the thickness.
CURVE_STEPS = 20
LONGEST_STEP = 0.25
NO_CURVE = "there is no nonlinear static plate"
# Simulated time over half a period of the projectile on the plate's static stiffness, and least
# simulated time over the contact of the two with the indentation in series: a plate that vibrates
# ends it up to 2 % later.
HALF_PERIODS = 1.25
CONTACT_TIMES = 1.1


class NoCurveError(FecmError, ValueError):
    """A nonlinear plate has no static curve."""


def static_deflection(problem: Problem) -> float:
    """Estimate the largest deflection of the linear plate under the impact, length.

    It is the deflection of the static plate, or that of an infinite plate where this is smaller: an
    infinite plate moves by I/(8 sqrt(m D*)) under an impulse I, here at most twice the momentum of
    the projectile.  NaN for a plate that its supports do not hold.

    Parameters
    ----------
    problem : Problem
        Problem of an impact without errors.
    """
    contact = problem.contact
    assert contact is not None  # the program has impact steps
    mass, velocity = build_projectile(problem.deck).total_mass, _velocity(problem)
    stiffness = static_stiffness(problem.moving_plate, contact)
    if not (math.isfinite(stiffness) and velocity > 0.0):
        return math.nan
    wave = 2.0 * mass * velocity / wave_impedance(problem.laminate)
    try:
        peak = static_peak(mass, velocity, _coefficient(problem), stiffness)
    except OverflowError:  # of a k that the checks doubt
        return math.nan
    return min(wave, peak / stiffness)


def nonlinear_curve(problem: Problem, energy: float, force: float) -> StaticCurve:
    """Static curve of a nonlinear plate up to an energy, and up to a force unless it is NaN.

    Raises NoCurveError if the plate has none.
    """
    contact = problem.contact
    assert contact is not None  # the program has impact steps
    if problem.mesh.forces.any():
        raise NoCurveError(f"{NO_CURVE}: the deck has FORC")
    stiffness = static_stiffness(problem.moving_plate, contact)
    if math.isnan(stiffness):
        raise NoCurveError(f"{NO_CURVE}: the plate is free")
    linear = max(math.sqrt(2.0 * energy / stiffness), np.nan_to_num(force) / stiffness)
    step = min(linear / CURVE_STEPS, LONGEST_STEP * problem.laminate.thickness)

    def enough(_: float, reached: float, work: float) -> bool:
        return work >= energy and not reached < force

    try:
        curve = static_curve(problem.moving_plate, contact, step, enough)
    except (SingularStiffnessError, ConvergenceError) as error:
        raise NoCurveError(f"{NO_CURVE}: {error}") from None
    if (falls := np.diff(curve.force) < 0.0).any():
        limit = float(curve.force[np.argmax(falls)])
        raise NoCurveError(f"{NO_CURVE}: the panel snaps through at the force {limit:.4g}")
    return curve


def contact_duration(problem: Problem) -> float:
    """Simulated time that is longer than the contact of the projectile with the static plate.

    A nonlinear plate has its static curve where there is one, and is taken as linear otherwise.
    """
    contact = problem.contact
    assert contact is not None
    mass, velocity = build_projectile(problem.deck).total_mass, _velocity(problem)
    if problem.plate.nonlinear and velocity > 0.0:
        with suppress(NoCurveError, OverflowError):
            curve = nonlinear_curve(problem, 0.5 * mass * velocity**2, math.nan)
            bare = contact_time_on_curve(mass, velocity, math.inf, curve)
            whole = contact_time_on_curve(mass, velocity, _coefficient(problem), curve)
            return _rounded(max(HALF_PERIODS * bare, CONTACT_TIMES * whole))
    stiffness = static_stiffness(problem.moving_plate, contact)
    duration = HALF_PERIODS * math.pi * math.sqrt(mass / stiffness)
    if velocity > 0.0:
        with suppress(OverflowError):  # of a k that the checks doubt
            k = _coefficient(problem)
            duration = max(
                duration, CONTACT_TIMES * static_plate(mass, velocity, k, stiffness).duration
            )
    return _rounded(duration)


def _velocity(problem: Problem) -> float:
    return problem.deck.require(Impact).velocity


def _coefficient(problem: Problem) -> float:
    """Contact coefficient k, force/length^1.5."""
    return problem.deck.require(Indentation).k


def _rounded(duration: float) -> float:
    return float(f"{duration:.2g}")
