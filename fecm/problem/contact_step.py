"""The largest stable time step of plate and contact together.

The plate moves explicitly under the contact force of the last step, so the contact acts on it
as a spring with the tangent stiffness of the indentation law.
"""

from __future__ import annotations

import math

import numpy as np

from fecm._frozen import frozen
from fecm.deck.model import Deck, Impact, Indentation
from fecm.mechanics.laminate import Laminate
from fecm.mechanics.plate import PlateModel, UnsoundPlateError
from fecm.mechanics.projectile import RigidMass
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import Problem, build_constants, build_projectile

# A clamped square plate under a central force has the stiffness D/(0.0056 a^2): Timoshenko and
# Woinowsky-Krieger, Theory of Plates and Shells, Table 35.  In terms of the force 8 v (m D)^(1/2)
# of a wave, that is this factor on the ratio of the masses.
CLAMPED = 1.0 / (64.0 * 0.0056)


def wave_impedance(laminate: Laminate) -> float:
    """Force over velocity of a point of an infinite plate, 8 (m D*)^(1/2) (force*time/length).

    D* is the effective bending stiffness of an orthotropic plate: R. Olsson, Impact response of
    orthotropic composite plates predicted from a one-parameter differential equation, AIAA Journal
    30 (1992) 1587-1596.
    """
    D = laminate.D
    mean = math.sqrt(D[0, 0] * D[1, 1])
    return 8.0 * math.sqrt(laminate.mass * (mean + D[0, 1] + 2.0 * D[2, 2]) / 2.0)


def expected_peak(deck: Deck, plate: PlateModel) -> float:
    """Estimate the peak force, high rather than low.

    The minimum of the Hertz contact on a rigid target, k^(2/5) (5 m v^2/4)^(3/5), and of the
    response of the plate: the bending wave for a light projectile, the stiffness of a clamped plate
    for a heavy one.
    """
    impact, law = deck.require(Impact), deck.require(Indentation)
    mass, v = build_projectile(deck).total_mass, np.abs(np.float64(impact.velocity))
    ratio = mass / (plate.area() * plate.laminate.mass)
    rigid = law.k**0.4 * (1.25 * mass) ** 0.6 * v**1.2
    return float(min(rigid, wave_impedance(plate.laminate) * v * np.sqrt(1.0 + CLAMPED * ratio)))


def contact_stiffness(deck: Deck, plate: PlateModel) -> float:
    """Tangent stiffness of the indentation law at the expected peak (force/length).

    The maximum of loading (equation 3-1) and unloading (equation 3-3).
    """
    law = build_constants(deck.require(Indentation))
    with np.errstate(all="ignore"):
        force = expected_peak(deck, plate)
    peak = (force / law.k) ** (2.0 / 3.0)
    if not peak > 0.0:
        return 0.0
    return float(force * max(1.5 / peak, law.q / (peak - law.permanent(peak))))


@frozen
class ContactStep:
    """Limit of the time step from the contact."""

    stiffness: float  # tangent stiffness of the contact, force/length
    mass: float  # the smaller of the plate's mass at the impact dof and the projectile's at its tip
    limit: float  # largest stable time step; infinite where the time step is certainly stable


def contact_step(
    problem: Problem, plate: PlateModel, dt: float, bound: float
) -> ContactStep | None:
    """Largest time step at which plate and contact are stable together; None without impact.

    `bound` is a lower bound of the plate's critical time step, `dt` the deck's, 0 for 0.9 of the
    critical one.  The limit is computed only where the bound does not show that this is stable.
    """
    if problem.contact is None:
        return None
    weights = problem.contact[plate.mesh.equations > 0]
    stiffness = contact_stiffness(problem.deck, plate)
    projectile = build_projectile(problem.deck)
    rigid = isinstance(projectile, RigidMass)
    tip = projectile.total_mass if rigid else float(projectile.mass()[0])
    at_node = 1.0 / float((weights**2 / plate.mass).sum())
    mass = min(tip, at_node)
    if not stiffness > 0.0:
        return ContactStep(stiffness, mass, math.inf)
    # The projectile's implicit step is iterated: a fixed point only below this (beta is 1/6).
    iterated = math.sqrt(6.0 * tip / stiffness)
    step = dt or SAFE * bound
    if step < iterated and (step / bound) ** 2 + step**2 * stiffness / (4.0 * at_node) < 1.0:
        return ContactStep(stiffness, mass, math.inf)
    try:
        critical = critical_time_step(plate, (weights, stiffness))
    except UnsoundPlateError:  # the contact's stiffness is out of range
        critical = iterated
    return ContactStep(stiffness, mass, min(iterated, critical))
