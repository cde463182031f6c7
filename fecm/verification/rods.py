"""The rod against the waves of a thin bar."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import eigh

from fecm.mechanics.projectile import Rod, report_rod
from fecm.mechanics.rod_integrators import CONSISTENT
from fecm.studies.rod_test.pulse_test import simulate_pulse
from fecm.studies.rod_test.pulses import GaussPulse, SinePulse
from fecm.verification.case import AGAINST_CHANGE, Check, case

# The report's steel bar of section 4.2, and its pulse (lb, in, s).
MODULUS, DENSITY, DIAMETER = 30.0e6, 7.33e-4, 0.625
BAR = Rod(1.0, (DIAMETER,) * 20, MODULUS, DENSITY)
PULSE = GaussPulse(1000.0, 200e-6, 40e-6)
LATER, LATER_FORCE = GaussPulse(1000.0, 300e-6, 40e-6), 338.387590747
DT, DURATION = 2e-7, 600e-6
SPEED = math.sqrt(MODULUS / DENSITY)
# Impulse of the pulse: the area of the Gaussian without its tail before t = 0.
IMPULSE = 1000.0 * 40e-6 * math.sqrt(math.pi) * (1.0 + math.erf(2.5))
MASS = DENSITY * math.pi * DIAMETER**2 / 4.0
JUMP = "the pulse starts with a jump of 1.93 lb, which 20 elements can't follow"


@case(
    "rod-pulse",
    "free 1 in steel rod under the pulse of equation 4-5",
    Check("largest force in the middle (lb)", 501.2940, "d'Alembert", 1e-3, JUMP),
    Check(
        "the same pulse 100 µs later, at 250 µs (lb)", LATER_FORCE, "d'Alembert", 1e-5,
        "without a jump; a pulse over 200 elements",
    ),
    Check(
        "mean of its ratio to the applied one", 0.498, "the report, section 4.2", 1.1e-3,
        "three digits; the density and the 1 % from which on it is taken are this program's choice",
        AGAINST_CHANGE,
    ),
    Check(
        "velocity of the far end after it (in/s)", IMPULSE / MASS, "impulse over mass", 1e-3,
        "the rod rings after the pulse's jump",
    ),
    Check("mass of the report's projectile (lb s²/in)", 1.81e-4, "the report, page 81", 2.8e-3,
          "three digits; the density is read so that they agree", AGAINST_CHANGE),
)  # fmt: skip
def rod_pulse() -> Sequence[float]:
    """Forces in the middle, final velocity, mass."""
    found = simulate_pulse(BAR, PULSE, DT, DURATION, (0.5,))
    later = simulate_pulse(BAR, LATER, DT, 300e-6, (0.5,))
    at = float(np.interp(250e-6, later.time, later.forces[:, 0]))
    velocity = float(found.accelerations[:, 2].sum()) * DT
    ratio = float(found.mean_ratios[0])
    return [float(found.forces.max()), at, ratio, velocity, report_rod().total_mass]


LONG = Rod(5.0, (DIAMETER,) * 100, MODULUS, DENSITY)
SHORT = SinePulse(1000.0, 8e-6)
FAST = "a pulse over 32 elements; falls with the square of element and step"


@case(
    "rod-waves",
    "bar waves in a 5 in rod; longitudinal vibrations of the 1 in rod",
    Check("wave speed (in/s)", SPEED, "√(E/ρ)", 1e-3, FAST),
    Check("peak after 4 in (lb)", 1000.0, "a bar wave keeps its form", 3e-2, FAST),
    Check(
        "first free frequency, lumped mass (1/s)", math.pi * SPEED, "π c/L", 2e-3,
        "20 elements; the lumped mass' error falls with their square",
    ),
    Check(
        "first free frequency, consistent mass (1/s)", math.pi * SPEED, "π c/L", 1e-6,
        "20 cubic elements; falls with their 4th power or faster",
    ),
)  # fmt: skip
def rod_waves() -> Sequence[float]:
    """Speed of the pulse's centroid between two stations; frequencies."""
    ends = (1.0, 4.0)
    found = simulate_pulse(LONG, SHORT, DT / 2.0, 29e-6, ends)
    centroids = (found.time @ found.forces) / found.forces.sum(axis=0)
    speed = (ends[1] - ends[0]) / float(centroids[1] - centroids[0])
    rods = (BAR, BAR.with_mass(CONSISTENT))
    return [speed, float(found.forces[:, 1].max()), *map(_first_frequency, rods)]


def _first_frequency(rod: Rod) -> float:
    """Lowest angular frequency after that of the rigid motion."""
    mass = rod.mass()
    squares = eigh(rod.stiffness(), np.diag(mass) if mass.ndim == 1 else mass, eigvals_only=True)
    return math.sqrt(float(squares[1]))


CASES = (rod_pulse, rod_waves)
