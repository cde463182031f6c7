"""Whether the mesh resolves the bending waves of an impact."""

from __future__ import annotations

import numpy as np

from fecm._dataclasses import frozen
from fecm.deck import model
from fecm.mechanics.mesh import longest_sides
from fecm.problem.parts import build_projectile
from fecm.problem.problem import Problem

# Elements per bending wave of the contact's duration that are enough for a peak.
ENOUGH_PER_WAVE = 8
MOST_ERROR = 0.5  # largest mesh error of the peak that is estimated
FULL = 3  # shear order at which 9-node elements have no zero-energy modes


@frozen
class Resolution:
    """Resolution of an impact by the mesh."""

    # Duration of a Hertz contact on a rigid target, 2.94 (5 m v^2/4 k)^(2/5)/v: S. P.
    # Timoshenko and J. N. Goodier, Theory of Elasticity, on the impact of spheres.
    contact: float
    wave: float  # length of the bending wave of that half period, 2 pi (D/(m (pi/contact)^2))^(1/4)
    side: float  # longest side of the elements at the impact node, length
    # Estimated mesh error of the peak force, relative to it; None for elements without
    # mid-side nodes.
    error: float | None

    @property
    def elements(self) -> float:
        """Elements per bending wave."""
        return self.wave / self.side


def resolution(problem: Problem) -> Resolution | None:
    """Compare the elements at the impact node with the bending waves of the impact.

    None without an approach, or where a number overflows.
    """
    deck, mesh = problem.deck, problem.mesh
    impact, law = deck.require(model.Impact), deck.require(model.Indentation)
    if impact.velocity <= 0.0:
        return None
    laminate, mass = problem.laminate, build_projectile(deck).total_mass
    v = np.float64(impact.velocity)  # a division by zero is then infinite, not an error
    rigidity = float(min(laminate.D[0, 0], laminate.D[1, 1]))
    with np.errstate(all="ignore"):
        contact = 2.94 * (5.0 * mass * v**2 / (4.0 * law.k)) ** 0.4 / v
        wave = 2.0 * np.pi * (rigidity / (laminate.mass * (np.pi / contact) ** 2)) ** 0.25
    touching = (mesh.elements == impact.node).any(axis=1)
    side = float(longest_sides(mesh.elements[touching], mesh.coordinates).max())
    if not np.isfinite(wave):
        return None
    quadratic = bool((mesh.elements[touching, 4:8] > 0).all()) and mesh.elements.shape[1] <= 9
    shear = deck.require(model.Material).integration.shear
    # Fitted to point forces and shear strains by quadrature.
    fitted = quadratic and problem.patch is None and not problem.plate.rules.assumes_shear
    error = mesh_error(wave / side, side / laminate.thickness, shear) if fitted else None
    return Resolution(float(contact), float(wave), side, error)


def mesh_error(elements: float, slenderness: float, shear: int) -> float:
    """Estimate the relative mesh error of the peak force, within a factor of about two.

    Fitted to the peaks of 14 meshes of 8- or 9-node elements with L2 = 3, and compared with 18
    with L2 = 2, each against a mesh of 15 to 30 elements per wave: AS/3501 plates of
    100 x 100 x 1, 2 and 4 mm, and the report's plate.

    `elements` are those per bending wave of the contact's duration, `slenderness` is the side of an
    element over the thickness (under L2 = 3 a slender element locks), `shear` the order L2.
    """
    if shear < FULL:
        return 0.045 * ENOUGH_PER_WAVE / elements
    return (0.031 + 0.0011 * slenderness**2) * (ENOUGH_PER_WAVE / elements) ** 2


def said_error(error: float) -> str:
    """Text of an estimated mesh error of the peak force."""
    if error > MOST_ERROR:
        return f"mesh error of the peak above {MOST_ERROR:.0%}"
    return f"mesh error of the peak about {error:.1%}"
