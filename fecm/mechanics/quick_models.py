"""Quick models of an impact, without a mesh.

Small mass (Zener 1941, Olsson 1992): the plate under the contact is a dashpot,
a'' + 3/2 lambda sqrt(a) a' + a^1.5 = 0 in units of the contact.  Large mass: the kinetic energy is
stored in the plate, by its static force over deflection, and in the indentation.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fecm._frozen import frozen
from fecm._typing import Floats
from fecm.mechanics.static_curve import StaticCurve

MIDPOINTS = 1000  # of the quadratures over the force and the deflection


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


def curved_plate(mass: float, velocity: float, k: float, curve: StaticCurve) -> QuickImpact:
    """Impact of :func:`static_plate` on a nonlinear plate, whose curve reaches the energy.

    M V^2/2 is the integral of F dW in the plate, and (2/5) F^(5/3)/k^(2/3) in the contact.  The
    duration is 2 times the integral of dW/v without indentation; the variable s of W = W_m (1 -
    s^2) leaves no singularity.
    """
    energy = 0.5 * mass * velocity**2
    most = curve.deflection[-1]
    tight = 1e-12 * most
    deflection = brentq(lambda w: stored_at(curve, k, w)[1] - energy, 0.0, most, xtol=tight)
    alone = brentq(lambda w: curve.at(w)[1] - energy, 0.0, most, xtol=tight)  # without indentation
    s = (np.arange(MIDPOINTS) + 0.5) / MIDPOINTS
    _, work = curve.at(alone * (1.0 - s * s))
    duration = 2.0 * float(np.mean(2.0 * alone * s / np.sqrt(2.0 * (energy - work) / mass)))
    return QuickImpact(stored_at(curve, k, deflection)[0], duration / 2.0, duration)


def stored_at(curve: StaticCurve, k: float, deflection: float) -> tuple[float, float]:
    """Force at a deflection, and the energy in the plate and in the contact."""
    force, work = curve.at(np.array(deflection))
    return float(force), float(work + 0.4 * np.cbrt(force**5 / k**2))
