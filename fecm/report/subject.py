"""What hits what: projectile and plate of a run."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fecm.deck import model
from fecm.deck.units import unit_names, unit_of
from fecm.problem.parts import build_projectile
from fecm.problem.problem import Problem
from fecm.results.result import Result
from fecm.results.run_metrics import impact_energy


class Impactor(NamedTuple):
    """Projectile of a run. Slips and a user's projectile differ from the deck."""

    name: str
    mass: float
    velocity: float
    energy: float


def impactor(result: Result, deck: model.Deck) -> Impactor | None:
    """Return the projectile of a run, as it hits the whole plate; None without impact.

    Its mass follows from the initial energy.
    """
    impact = deck.last(model.Impact)
    if impact is None:
        return None
    projectile = build_projectile(deck)
    mass, velocity = result.symmetry_factor * projectile.total_mass, impact.velocity
    energy = impact_energy(result)
    if math.isfinite(energy) and velocity:
        mass = 2.0 * energy / velocity**2
    user_projectile = result.attributes.get("projectile")
    name = f"{user_projectile}, instead of PROJ" if user_projectile else projectile.kind
    return Impactor(name, mass, velocity, 0.5 * mass * velocity**2)


def plate_extent(problem: Problem) -> str:
    """Return the extent of the plate as a text, of the whole plate for a symmetric part."""
    unit = unit_of("length", unit_names(problem.deck))
    places = problem.symmetry.unfolded(problem.mesh.coordinates[:, :2])
    low, high = (f(places, axis=0) for f in (np.min, np.max))
    a, b = (f"{side:.5g}" for side in high - low)
    return f"{a} × {b} {unit}".rstrip()
