"""Quick estimates of a problem's impact, and of the velocity that reaches DELA's threshold."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from fecm._errors import StudyError
from fecm.deck.model import Impact
from fecm.mechanics.laminate import SMALL_MASS, effective_rigidity
from fecm.mechanics.quick_models import (
    QuickImpact,
    StaticCurve,
    curved_plate,
    inelasticity,
    infinite_plate,
    peak_on_infinite_plate,
    static_peak,
    static_plate,
    stored_at,
)
from fecm.mechanics.roots import root
from fecm.problem.estimates import NoCurveError, nonlinear_curve, whole_stiffness
from fecm.problem.problem import Problem

# Mass of the projectile over the mass of the plate.
SMALL = 0.1  # ratio below which waves control the impact
LARGE = 50.0  # ratio above which the impact is quasi-static
INFINITE_PLATE = "infinite plate"  # name of the model for small masses
# Remark on the nonlinear static plate, from clamped and simply supported isotropic circular plates.
LOW = "the nonlinear static plate is 9 to 26 % low in force at M/M_plate = 24"


@dataclass(frozen=True)
class QuickModel:
    """Quick model of an impact."""

    name: str
    impact: QuickImpact
    threshold: float  # delamination threshold that applies to the model, force; NaN without DELA
    velocity: float  # velocity at which the model reaches the threshold; NaN without DELA
    applies: bool  # whether the mass ratio is in the range of the model


class QuickEstimate(NamedTuple):
    """Quick estimates of an impact."""

    mass: float  # of the projectile
    mass_ratio: float  # to the mass of the plate
    parameter: float  # Zener's lambda
    stiffness: float  # of the plate under its load, force/length; NaN for a free plate
    models: tuple[QuickModel, ...]
    remark: str = ""  # about the static model of a nonlinear plate

    @property
    def response(self) -> str:
        """Class of the response by the mass ratio."""
        if self.mass_ratio < SMALL:
            high = "which has no transverse shear: on laminates the force is 6 to 12 % too high"
            return f"wave-controlled: the infinite plate applies, {high}"
        if self.mass_ratio > LARGE:
            low = "which underestimates the force by about 10 %"
            return f"quasi-static: the static plate applies, {low}"
        return "neither small nor large: run it"


def quick_estimate(problem: Problem) -> QuickEstimate:
    """Estimate the impact of a checked problem.

    Raises StudyError if the problem has no impact.
    """
    contact = problem.contact
    if contact is None:
        raise StudyError("the deck has no impact: RODP in the program, with ROD and EXPE")
    deck, laminate = problem.deck, problem.laminate
    mass, velocity = problem.projectile_mass, deck.require(Impact).velocity
    if not velocity > 0.0:
        raise StudyError(f"the velocity of ROD is {velocity:g}: the projectile does not approach")
    k = problem.contact_coefficient
    ratio = mass / problem.plate_mass
    force = math.nan if problem.threshold is None else problem.threshold.force
    parameter = _inelasticity(problem, mass, velocity)

    small = infinite_plate(mass, velocity, k, parameter)
    reached = _velocity_at_peak(
        _peaks_on_infinite_plate(problem, mass), velocity, SMALL_MASS * force
    )
    models = [QuickModel(INFINITE_PLATE, small, SMALL_MASS * force, reached, applies=ratio < SMALL)]
    stiffness = whole_stiffness(problem)
    if not math.isfinite(stiffness):
        return QuickEstimate(mass, ratio, parameter, stiffness, tuple(models))
    large = static_plate(mass, velocity, k, stiffness)
    reached = _velocity_at_peak(lambda v: static_peak(mass, v, k, stiffness), velocity, force)
    static = QuickModel("static plate", large, force, reached, applies=ratio > LARGE)
    models.append(static)
    remark = ""
    if problem.plate.nonlinear:
        limit = problem.judge.deflection.value * laminate.thickness
        if static.impact.peak > limit * stiffness:
            models[-1] = replace(static, applies=False)
        try:
            curve = nonlinear_curve(problem, 0.5 * mass * velocity**2, force)
            models.append(_nonlinear_model(curve, mass, velocity, k, force, applies=ratio > LARGE))
            remark = LOW
        except NoCurveError as error:
            remark = str(error)
    return QuickEstimate(mass, ratio, parameter, stiffness, tuple(models), remark)


def velocity_at(problem: Problem, force: float) -> float:
    """Return the velocity at which the better quick model reaches a peak force.

    Between the ranges of the two models, both underestimate the force. Where no model applies, as
    for a free plate under a large mass, the velocity of the deck is returned.
    """
    contact = problem.contact
    assert contact is not None  # the program has impact steps
    mass, velocity = problem.projectile_mass, problem.deck.require(Impact).velocity
    k = problem.contact_coefficient
    if mass < problem.plate_mass:
        return _velocity_at_peak(_peaks_on_infinite_plate(problem, mass), velocity, force)
    try:
        return _static_velocity(nonlinear_curve(problem, 0.0, force), mass, k, force)
    except NoCurveError:
        stiffness = whole_stiffness(problem)
    if math.isnan(stiffness):
        return velocity
    return _velocity_at_peak(lambda v: static_peak(mass, v, k, stiffness), velocity, force)


def _nonlinear_model(
    curve: StaticCurve, mass: float, velocity: float, k: float, threshold: float, *, applies: bool
) -> QuickModel:
    """Return the static model of a nonlinear plate."""
    at_threshold = math.nan
    if math.isfinite(threshold):
        at_threshold = _static_velocity(curve, mass, k, threshold)
    impact = curved_plate(mass, velocity, k, curve)
    return QuickModel("nonlinear static plate", impact, threshold, at_threshold, applies)


def _static_velocity(curve: StaticCurve, mass: float, k: float, force: float) -> float:
    """Return the velocity at which the static model reaches a force."""
    largest = curve.deflection[-1]
    deflection = root(lambda w: stored_at(curve, k, w)[0] - force, 0.0, largest, 1e-12 * largest)
    return math.sqrt(2.0 * stored_at(curve, k, deflection)[1] / mass)


def _inelasticity(problem: Problem, mass: float, velocity: float) -> float:
    """Return Zener's parameter of an impact on the plate of a problem."""
    laminate, k = problem.laminate, problem.contact_coefficient
    return inelasticity(mass, velocity, k, laminate.mass, effective_rigidity(laminate))


def _peaks_on_infinite_plate(problem: Problem, mass: float) -> Callable[[float], float]:
    """Return the peak force on the infinite plate as a function of the velocity."""
    k = problem.contact_coefficient
    return lambda v: peak_on_infinite_plate(mass, v, k, _inelasticity(problem, mass, v))


def _velocity_at_peak(peak: Callable[[float], float], start: float, force: float) -> float:
    """Return the velocity at which an increasing peak reaches a force; NaN if not finite."""
    if not math.isfinite(force):
        return math.nan
    low = high = start
    while peak(low) > force:
        low /= 2.0
    while peak(high) < force:
        high *= 2.0
    if low == high:
        low /= 2.0
    return root(lambda v: peak(v) - force, low, high, 1e-12 * high)
