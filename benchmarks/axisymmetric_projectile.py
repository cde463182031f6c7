"""The report's projectile by 112 axisymmetric elements, against its 20 rod elements.

    python benchmarks/axisymmetric_projectile.py [PICTURE.png]

The contact force of decks/impact-115.inp acts on the tip of 28 x 4 axisymmetric elements of second
order (scikit-fem: ``pip install 'fecm[docs]'``), integrated by average acceleration.  The force
that the front half passes on to the rear half, F less the front half's inertia, is compared with
the transducer of the rod.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

import fecm
from fecm.mechanics.projectile import report_rod

DECK = Path(__file__).parents[1] / "decks" / "impact-115.inp"
ALONG, ACROSS = 28, 4
POISSON = 0.3
VELOCITY = 115.0
# Steps of a period of the ringing, 8.4 µs, over which forces are averaged.
RINGING = 42

Floats = NDArray[np.float64]
ROD = report_rod()


@skfem.BilinearForm
def stiffness(u: Any, v: Any, w: Any) -> Any:
    """Elastic energy of the strains rr, zz, tt and rz."""
    r, E, nu = w.x[0], ROD.modulus, POISSON

    def strains(a: Any) -> tuple[Any, ...]:
        return a.grad[0, 0], a.grad[1, 1], a[0] / r, a.grad[0, 1] + a.grad[1, 0]

    e, t = strains(u), strains(v)
    shear = E / (2.0 * (1.0 + nu))
    pressure = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)) * (e[0] + e[1] + e[2])
    normal = sum((pressure + 2.0 * shear * e[i]) * t[i] for i in range(3))
    return 2.0 * np.pi * r * (normal + shear * e[3] * t[3])


@skfem.BilinearForm
def mass(u: Any, v: Any, w: Any) -> Any:
    """Consistent mass."""
    return 2.0 * np.pi * w.x[0] * ROD.density * (u[0] * v[0] + u[1] * v[1])


@skfem.LinearForm
def traction(v: Any, w: Any) -> Any:
    """Uniform axial traction."""
    return 2.0 * np.pi * w.x[0] * v[1]


def midpoint_force(force: Floats, dt: float) -> Floats:
    """Force in the middle of the projectile under a history of the contact force."""
    grid = skfem.MeshQuad.init_tensor(
        np.linspace(0.0, 1.0, ACROSS + 1), np.linspace(0.0, ROD.length, ALONG + 1)
    )
    middles = (np.arange(ROD.elements) + 0.5) * ROD.length / ROD.elements
    radius = np.interp(grid.p[1], middles, np.array(ROD.diameters) / 2.0)
    mesh = skfem.MeshQuad(np.array([grid.p[0] * radius, grid.p[1]]), grid.t).with_boundaries(
        {"tip": lambda x: x[1] < 1e-9}
    )
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()), intorder=4)
    K, M = stiffness.assemble(basis), mass.assemble(basis)
    axial = np.zeros(basis.N)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        axial[dofs[1]] = 1.0
    load = traction.assemble(skfem.FacetBasis(mesh, basis.elem, facets="tip", intorder=4))
    load /= load @ axial
    front = M @ (np.clip(0.5 + 1e6 * (ROD.length / 2.0 - basis.doflocs[1]), 0.0, 1.0) * axial)
    print(f"mass {axial @ M @ axial:.5g}, of the rod {ROD.total_mass:.5g} lb s2/in")
    u, v, a = np.zeros(basis.N), -VELOCITY * axial, np.zeros(basis.N)
    solve = splu((M + dt**2 / 4.0 * K).tocsc()).solve
    found = np.empty(len(force))
    for step, value in enumerate(force):
        moved = u + dt * v + dt**2 / 4.0 * a
        after = solve(value * load - K @ moved)
        v += dt / 2.0 * (a + after)
        u, a = moved + dt**2 / 4.0 * after, after
        found[step] = value - front @ a
    return found


def smoothed(values: Floats) -> Floats:
    """Average over a period of the ringing."""
    return np.convolve(values, np.full(RINGING, 1.0 / RINGING), "same")


def main() -> None:
    """Print the differences, and draw both histories if a picture is named."""
    warnings.simplefilter("ignore", fecm.FecmWarning)
    result = fecm.run_one(DECK)
    time, rod = result.time, result.transducer
    solid = midpoint_force(result.force, float(time[0]))
    for name, one, other in (("peak", solid, rod), ("smoothed", smoothed(solid), smoothed(rod))):
        rms = np.sqrt(np.mean((one - other) ** 2) / np.mean(other**2))
        print(f"{name:9} {one.max():.2f} and {other.max():.2f} lb, rms of the difference {rms:.1%}")
    print(f"correlation {np.corrcoef(solid, rod)[0, 1]:.3f}")
    if len(sys.argv) > 1:
        figure, axes = plt.subplots(figsize=(7.2, 3.2), layout="constrained")
        axes.plot(1e6 * time, rod, label="20 rod elements", lw=0.9)
        axes.plot(1e6 * time, solid, label="112 axisymmetric elements", lw=0.9)
        axes.set(xlabel="Time (µs)", ylabel="Force in the middle (lbf)", xlim=(0.0, 800.0))
        axes.legend(frameon=False)
        figure.savefig(sys.argv[1], dpi=200)


if __name__ == "__main__":
    main()
