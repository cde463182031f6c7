"""Quick models of an impact, without a mesh.

Small mass (Zener 1941, Olsson 1992): the plate under the contact is a dashpot,
a'' + 3/2 lambda sqrt(a) a' + a^1.5 = 0 in units of the contact.  Large mass: the kinetic energy is
stored in the plate, by its static force over deflection, and in the indentation.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Floats
from fecm.mechanics.roots import root
from fecm.mechanics.static_curve import StaticCurve

MIDPOINTS = 1000  # of the quadratures over the force and the deflection
# Expansions of the motion on an infinite plate.
ORDER = 20
ROUNDING = 1e-14  # of the last terms, relative to the first
LONGEST = 1e6  # time of a contact


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

    F = a^1.5 M V/T with the time scale T = (M/(k sqrt(V)))^0.4.  The duration is infinite if the
    contact lasts longer than 10^6 T.
    """
    motions = _motion(parameter)
    turning = next(motion for motion in motions if motion.turns)
    last = next(one for one in chain([turning], motions) if one.leaves or one.time[0] > LONGEST)
    peak, time = turning.peak()
    duration = last.end() if last.leaves else math.inf
    scale = _time_scale(mass, velocity, k)
    return QuickImpact(peak * mass * velocity / scale, time * scale, duration * scale)


def peak_on_infinite_plate(mass: float, velocity: float, k: float, parameter: float) -> float:
    """Peak force of :func:`infinite_plate`, without the motion after it."""
    peak, _ = next(motion for motion in _motion(parameter) if motion.turns).peak()
    return peak * mass * velocity / _time_scale(mass, velocity, k)


def _time_scale(mass: float, velocity: float, k: float) -> float:
    return float((mass / (k * velocity**0.5)) ** 0.4)


class _Expansion(NamedTuple):
    """Motion of the contact up to a step: coefficients of the powers of s, from 0 on.

    With z = sqrt(a) and dt = 2 z ds the equation has no square roots: dz/ds = w, the velocity of
    the indentation, and dw/ds = -3 lambda z^2 w - 2 z^4.
    """

    z: list[float]
    w: list[float]
    time: list[float]
    step: float

    @classmethod
    def of(cls, z: float, w: float, time: float, parameter: float) -> _Expansion:
        """Expand the motion from a state on."""
        zs, ws, times = [z], [w], [time]
        squares: list[float] = []  # z^2
        for k in range(ORDER):
            squares.append(_product(zs, zs))
            slowing = 3.0 * parameter * _product(squares, ws) + 2.0 * _product(squares, squares)
            zs.append(ws[k] / (k + 1))
            times.append(2.0 * zs[k] / (k + 1))
            ws.append(-slowing / (k + 1))
        small = ROUNDING * (z or 1.0)
        last = range(ORDER - 4, ORDER + 1)  # without damping, powers are missing
        step = min((small / abs(zs[k])) ** (1.0 / k) for k in last if zs[k])
        return cls(zs, ws, times, step)

    @property
    def turns(self) -> bool:
        """Whether the indentation has its peak within the step."""
        return self.w[0] > 0.0 >= _value(self.w, self.step)

    @property
    def leaves(self) -> bool:
        """Whether the contact ends within the step."""
        return _value(self.z, self.step) <= 0.0

    def peak(self) -> tuple[float, float]:
        """Largest a^1.5, and its time."""
        at = root(lambda s: _value(self.w, s), 0.0, self.step, ROUNDING * self.step)
        return _value(self.z, at) ** 3, _value(self.time, at)

    def end(self) -> float:
        """Time at which the contact ends."""
        at = root(lambda s: _value(self.z, s), 0.0, self.step, ROUNDING * self.step)
        return _value(self.time, at)


def _motion(parameter: float) -> Iterator[_Expansion]:
    """The motion from the first contact on, step by step; it has no end."""
    z, w, time = 0.0, 1.0, 0.0
    while True:
        motion = _Expansion.of(z, w, time, parameter)
        yield motion
        z, w, time = (_value(powers, motion.step) for powers in motion[:3])


def _product(first: list[float], second: list[float]) -> float:
    """Last coefficient of the product of two series of the same length."""
    total: float = sum(map(operator.mul, first, reversed(second)))
    return total


def _value(powers: list[float], s: float) -> float:
    """Sum of a power series."""
    value = 0.0
    for coefficient in reversed(powers):
        value = value * s + coefficient
    return value


def static_peak(mass: float, velocity: float, k: float, stiffness: float) -> float:
    """Peak force of :func:`static_plate`."""
    energy = 0.5 * mass * velocity**2
    most = velocity * math.sqrt(stiffness * mass)  # without indentation

    def missing(force: float) -> float:
        return force**2 / (2.0 * stiffness) + 0.4 * math.cbrt(force**5 / k**2) - energy

    return root(missing, 0.0, most, 1e-12 * most)


def static_plate(mass: float, velocity: float, k: float, stiffness: float) -> QuickImpact:
    """Impact whose energy M V^2/2 is F^2/(2 k_b) in bending and (2/5) F^(5/3)/k^(2/3) in contact.

    k_b is the static stiffness of the plate under its patch, force/length.  Plate and contact are
    springs in series.  The displacement of the mass at the force F is x = F/k_b + (F/k)^(2/3), and
    the duration is 2 times the integral of dx/v up to the peak F_m; the variable s of
    F = F_m (1 - s^2)^3 leaves no singularity.
    """
    peak = static_peak(mass, velocity, k, stiffness)
    s = (np.arange(MIDPOINTS) + 0.5) / MIDPOINTS
    rest = 1.0 - s * s
    force = peak * rest**3
    stored = force**2 / (2.0 * stiffness) + 0.4 * np.cbrt(force**5 / k**2)
    left = np.sqrt(velocity**2 - 2.0 * stored / mass)
    slope = 1.0 / stiffness + 2.0 / 3.0 / np.cbrt(force * k**2)
    duration = 2.0 * float(np.mean(slope * 6.0 * peak * rest**2 * s / left))
    return QuickImpact(peak, duration / 2.0, duration)


def curved_plate(mass: float, velocity: float, k: float, curve: StaticCurve) -> QuickImpact:
    """Impact of :func:`static_plate` on a nonlinear plate, whose curve reaches the energy.

    M V^2/2 is the integral of F dW in the plate, and (2/5) F^(5/3)/k^(2/3) in the contact.
    """
    energy = 0.5 * mass * velocity**2
    most = curve.deflection[-1]
    deflection = root(lambda w: stored_at(curve, k, w)[1] - energy, 0.0, most, 1e-12 * most)
    duration = contact_time_on_curve(mass, velocity, k, curve)
    return QuickImpact(stored_at(curve, k, deflection)[0], duration / 2.0, duration)


def contact_time_on_curve(mass: float, velocity: float, k: float, curve: StaticCurve) -> float:
    """Duration of the contact of :func:`curved_plate`, with the indentation.

    The time is 2 times the integral of dx/v over the displacement x = W + (F/k)^(2/3) of the mass,
    by the midpoints of the variable s of W = W_m (1 - s^2)^3.  An infinite `k` leaves out the
    indentation.
    """
    energy = 0.5 * mass * velocity**2

    def stored(force: Floats, work: Floats) -> Floats:
        return np.asarray(work + 0.4 * np.cbrt(force**5 / k**2))

    most = curve.deflection[-1]
    turn = root(lambda w: float(stored(*curve.at(w))) - energy, 0.0, most, 1e-12 * most)
    s = np.arange(2 * MIDPOINTS + 1) / (2 * MIDPOINTS)
    deflection = turn * (1.0 - s * s) ** 3
    force, work = curve.at(deflection)
    force = np.maximum(force, 0.0)  # rounding at rest
    x = deflection + np.cbrt((force / k) ** 2)
    left = (energy - stored(force, work))[1::2]
    return 2.0 * float((-np.diff(x[::2]) / np.sqrt(2.0 * left / mass)).sum())


def stored_at(curve: StaticCurve, k: float, deflection: float) -> tuple[float, float]:
    """Force at a deflection, and the energy in the plate and in the contact."""
    force, work = curve.at(np.array(deflection))
    return float(force), float(work + 0.4 * np.cbrt(force**5 / k**2))
