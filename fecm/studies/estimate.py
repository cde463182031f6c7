"""Quick estimates of an impact: models without a mesh, and when they reach the threshold of DELA.

Small mass (Zener 1941, Olsson 1992): the plate under the contact is a dashpot,
a'' + 3/2 lambda sqrt(a) a' + a^1.5 = 0 in units of the contact.  Large mass: the kinetic energy is
stored in the bending of the plate and in the indentation.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fecm._frozen import frozen
from fecm._typing import Floats
from fecm.deck.model import Impact, Indentation
from fecm.mechanics.laminate import SMALL_MASS, effective_rigidity
from fecm.mechanics.solutions import static_stiffness
from fecm.problem.parts import build_projectile
from fecm.problem.problem import Problem
from fecm.studies import StudyError

# Masses over the plate's.
SMALL = 0.1  # below, waves control the impact
LARGE = 50.0  # above, the impact is quasi-static
MIDPOINTS = 1000  # of the quadrature over the force


@frozen
class QuickImpact:
    """Result of a quick model."""

    peak: float  # contact force
    time: float  # of the peak
    duration: float  # of the contact


def inelasticity(
    mass: float, velocity: float, k: float, plate_mass: float, rigidity: float
) -> float:
    """Zener's parameter lambda = k^0.4 V^0.2 M^0.6/(8 sqrt(m D*)).

    M and V are of the projectile, m is the plate's mass per area, k the contact coefficient in
    force/length^1.5, and D* the effective bending stiffness in force*length.
    """
    return float(k**0.4 * velocity**0.2 * mass**0.6) / (8.0 * math.sqrt(plate_mass * rigidity))


def infinite_plate(mass: float, velocity: float, k: float, parameter: float) -> QuickImpact:
    """Impact on an infinite plate with the parameter lambda.

    F = a^1.5 M V/T with the time scale T = (M/(k sqrt(V)))^0.4.
    """

    def rate(_: float, state: Floats) -> Floats:
        root = np.sqrt(max(state[0], 0.0))
        return np.array([state[1], -1.5 * parameter * root * state[1] - root**3])

    def leaves(_: float, state: Floats) -> float:
        return float(state[0])

    def turns(_: float, state: Floats) -> float:
        return float(state[1])

    leaves.terminal, leaves.direction, turns.direction = True, -1.0, -1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        rate, (0.0, 1e6), [0.0, 1.0], "DOP853", events=(leaves, turns), rtol=1e-11, atol=1e-13
    )
    scale = (mass / (k * velocity**0.5)) ** 0.4
    peak = float(found.y_events[1][0][0]) ** 1.5 * mass * velocity / scale
    ends = found.t_events[0]
    duration = float(ends[0]) * scale if len(ends) else float("inf")
    return QuickImpact(peak, float(found.t_events[1][0]) * scale, duration)


def static_plate(mass: float, velocity: float, k: float, stiffness: float) -> QuickImpact:
    """Impact whose energy M V^2/2 is F^2/(2 k_b) in bending and (2/5) F^(5/3)/k^(2/3) in contact.

    k_b is the static stiffness of the plate under its patch, force/length.
    """
    energy = 0.5 * mass * velocity**2
    most = velocity * math.sqrt(stiffness * mass)  # without indentation

    def missing(force: float) -> float:
        return force**2 / (2.0 * stiffness) + 0.4 * math.cbrt(force**5 / k**2) - energy

    duration = math.pi * math.sqrt(mass / stiffness)
    peak = float(brentq(missing, 0.0, most, xtol=1e-12 * most))
    return QuickImpact(peak, duration / 2.0, duration)


def contact_time(mass: float, velocity: float, k: float, stiffness: float) -> float:
    """Duration of the contact of :func:`static_plate`, with the indentation.

    Plate and contact are springs in series.  The displacement of the mass at the force F is
    x = F/k_b + (F/k)^(2/3), and the time is 2 times the integral of dx/v up to the peak F_m; the
    variable s of F = F_m (1 - s^2)^3 leaves no singularity.
    """
    peak = static_plate(mass, velocity, k, stiffness).peak
    s = (np.arange(MIDPOINTS) + 0.5) / MIDPOINTS
    root = 1.0 - s * s
    force = peak * root**3
    stored = force**2 / (2.0 * stiffness) + 0.4 * np.cbrt(force**5 / k**2)
    left = np.sqrt(velocity**2 - 2.0 * stored / mass)
    slope = 1.0 / stiffness + 2.0 / 3.0 / np.cbrt(force * k**2)
    return 2.0 * float(np.mean(slope * 6.0 * peak * root**2 * s / left))


@frozen
class Model:
    """One quick model of an impact."""

    name: str
    impact: QuickImpact
    threshold: float  # delamination threshold that applies to the model, force; NaN without DELA
    velocity: float  # at which the model reaches it; NaN without DELA
    applies: bool  # whether the mass ratio is in the model's range


@frozen
class Estimate:
    """Quick estimates of an impact."""

    mass: float  # of the projectile
    mass_ratio: float  # to the plate's
    parameter: float  # Zener's lambda
    stiffness: float  # of the plate under its load, force/length; NaN for a free plate
    models: tuple[Model, ...]

    @property
    def response(self) -> str:
        """Class of the response by the mass ratio."""
        if self.mass_ratio < SMALL:
            return "wave-controlled: the infinite plate applies"
        if self.mass_ratio > LARGE:
            low = "which underestimates the force by about 10 %"
            return f"quasi-static: the static plate applies, {low}"
        return "neither small nor large: run it"


def estimate(problem: Problem) -> Estimate:
    """Estimate the impact of a checked problem; without an impact, raise a StudyError."""
    contact = problem.contact
    if contact is None:
        raise StudyError("the deck has no impact: RODP in the program, with ROD and EXPE")
    deck, laminate = problem.deck, problem.laminate
    mass, velocity = build_projectile(deck).total_mass, deck.require(Impact).velocity
    k, rigidity = deck.require(Indentation).k, effective_rigidity(laminate)
    ratio = mass / (problem.plate.area() * laminate.mass)
    force = math.nan if problem.threshold is None else problem.threshold.force

    def small(v: float) -> QuickImpact:
        return infinite_plate(mass, v, k, inelasticity(mass, v, k, laminate.mass, rigidity))

    def large(v: float) -> QuickImpact:
        return static_plate(mass, v, k, stiffness)

    applies = ratio < SMALL
    models = [_model("infinite plate", small, velocity, SMALL_MASS * force, applies=applies)]
    stiffness = static_stiffness(problem.moving_plate, contact)
    if math.isfinite(stiffness):
        models.append(_model("static plate", large, velocity, force, applies=ratio > LARGE))
    parameter = inelasticity(mass, velocity, k, laminate.mass, rigidity)
    return Estimate(mass, ratio, parameter, stiffness, tuple(models))


def _model(
    name: str,
    impact: Callable[[float], QuickImpact],
    velocity: float,
    threshold: float,
    *,
    applies: bool,
) -> Model:
    """A model, with the velocity at which its peak reaches the threshold."""
    found = math.nan
    if math.isfinite(threshold):
        low = high = velocity
        while impact(low).peak > threshold:
            low /= 2.0
        while impact(high).peak < threshold:
            high *= 2.0
        if low == high:
            low /= 2.0
        found = float(brentq(lambda v: impact(v).peak - threshold, low, high, rtol=1e-9))
    return Model(name, impact(velocity), threshold, found, applies)
