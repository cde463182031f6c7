"""Estimates of an impact before the run: peak force, and the stable time step with the contact."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.units import MODULUS, in_si, unit_names
from fecm.mechanics.laminate import LaminateSection, effective_rigidity
from fecm.mechanics.plate import PlateModel, UnsoundPlateError
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.parts import build_constants, build_projectile

STEEL_IN_SI, STEEL_POISSON = 207e9, 0.3  # elastic constants of steel, in m, N and s
# A clamped square plate under a central force has the stiffness D/(0.0056 a^2): Timoshenko and
# Woinowsky-Krieger, Theory of Plates and Shells, Table 35.  The square of its
# force over the force 8 v (m D)^(1/2) of a wave is this factor times the ratio of the masses.
CLAMPED = 1.0 / (64.0 * 0.0056)


def wave_impedance(laminate: LaminateSection) -> float:
    """Return force over velocity at a point of an infinite plate, 8 (m D*)^(1/2).

    The result is force*time/length.
    """
    return 8.0 * math.sqrt(laminate.mass * effective_rigidity(laminate))


def expected_peak(deck: model.Deck, plate: PlateModel, factor: int = 1) -> float:
    """Estimate the peak force; the estimate is high rather than low.

    It is the smaller of two values: the Hertz contact on a rigid target, k^(2/5) (5 m v^2/4)^(3/5),
    and the response of the plate, by the bending wave for a light projectile and the stiffness of a
    clamped plate for a heavy one. A deck of one of `factor` symmetric parts has its part of the
    peak.
    """
    impact, law = deck.require(model.Impact), deck.require(model.Indentation)
    mass, v = build_projectile(deck).total_mass, np.abs(np.float64(impact.velocity))
    ratio = mass / plate.total_mass()
    rigid = law.k**0.4 * (1.25 * mass) ** 0.6 * v**1.2
    impedance = max(map(wave_impedance, plate.laminates)) / factor
    return float(min(rigid, impedance * v * np.sqrt(1.0 + CLAMPED * ratio)))


def contact_stiffness(deck: model.Deck, plate: PlateModel, factor: int = 1) -> float:
    """Return the larger tangent stiffness of loading (3-1) and unloading (3-3) at the peak."""
    law = build_constants(deck.require(model.Indentation))
    with np.errstate(all="ignore"):  # infinite where the unloading curve is a vertical line
        force = np.float64(expected_peak(deck, plate, factor))
        peak = (force / law.k) ** (2.0 / 3.0)
        if not peak > 0.0:
            return 0.0
        return float(force * max(1.5 / peak, law.q / (peak - law.permanent(peak))))


def mean_pressure(deck: model.Deck, ply: model.Ply, force: float, parts: int) -> float:
    """Return the mean pressure under a sphere with the k of the deck on an isotropic ply.

    `force` is the force on the whole plate. The deck models one of `parts` equal parts of it, and
    its k is the k of the part. The sphere's radius R follows from equation 3-2; the sphere is of
    steel where UNIT names the units, otherwise rigid. The radius of the contact is (R
    alpha)^(1/2). The result is force/area.
    It is 0 if the law has a permanent indentation at this force: such a law is that of a metal that
    flows.
    """
    law = build_constants(deck.require(model.Indentation))
    k = parts * law.k
    indentation = (force / k) ** (2.0 / 3.0)
    if not indentation > 0.0 or law.permanent(indentation) > 0.0:
        return 0.0
    compliance = (1.0 - ply.nu12**2) / ply.e1
    if (size := in_si(MODULUS, unit_names(deck))) is not None:
        compliance += (1.0 - STEEL_POISSON**2) / (STEEL_IN_SI / size)
    radius = (0.75 * k * compliance) ** 2
    return float(force / (math.pi * radius * indentation))


class ContactStep(NamedTuple):
    """Limit of the time step due to the contact."""

    stiffness: float  # tangent stiffness of the contact, force/length
    mass: float  # the smaller of the plate's mass at the impact dof and the projectile's at its tip
    limit: float  # largest stable time step; infinite where the time step is certainly stable


def contact_step(
    deck: model.Deck,
    plate: PlateModel,
    contact: Floats | None,
    dt: float,
    bound: float,
    factor: int = 1,
) -> ContactStep | None:
    """Return the largest stable time step of plate and contact together; None without impact.

    `contact` is the distribution of a unit contact force over the dofs, (numnp, 5), or None.
    `bound` is a lower bound of the plate's critical time step. `dt` is the deck's time step, 0 for
    0.9 of the critical one. `factor` is the number of symmetric parts of which the deck has one.
    The limit is computed only where the bound does not show that `dt` is stable.
    """
    if contact is None:
        return None
    weights = contact[plate.mesh.equations > 0]
    stiffness = contact_stiffness(deck, plate, factor)
    projectile = build_projectile(deck)
    tip = float(projectile.mass()[0])
    at_node = 1.0 / float((weights**2 / plate.mass).sum())
    mass = min(tip, at_node)
    if not stiffness > 0.0:
        return ContactStep(stiffness, mass, math.inf)
    # The projectile's implicit step is iterated: a fixed point only below this (beta is 1/6).
    iterated = math.sqrt(6.0 * tip / stiffness)
    step = dt or SAFE * bound
    if step < iterated and (step / bound) ** 2 + step**2 * stiffness / (4.0 * at_node) < 1.0:
        return ContactStep(stiffness, mass, math.inf)
    limit = iterated
    with suppress(UnsoundPlateError):  # the contact's stiffness is out of range
        limit = min(iterated, critical_time_step(plate, (weights, stiffness)))
    return ContactStep(stiffness, mass, limit)
