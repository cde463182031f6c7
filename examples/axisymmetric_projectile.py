"""The projectile as a solid
=========================

On page 100 the report compares its projectile of 20 rod elements with one of 112 axisymmetric
elements, and finds no significant difference in the middle. Here the contact force of
``impact-patch`` acts on the tip of 28 × 4 axisymmetric elements, and the force that their front
half passes on is compared with the transducer of the rod. Needs scikit-fem:
``pip install 'fecm[examples]'``.
"""

import matplotlib.pyplot as plt
import numpy as np
import skfem
from scipy.sparse.linalg import splu

import fecm

result = fecm.run_one(fecm.examples.path("impact-patch.inp"))
dt = result.time[0]
length, modulus, density, poisson = 1.0, 30e6, 6.875e-4, 0.3  # in, lbf, s
radii = np.array([0.22, 0.36, 0.43, 0.48, 0.5] + 15 * [0.625]) / 2  # of the rod's elements

# %%
# A mesh over length and radius, with the profile of the rod, and elements of second order:
grid = skfem.MeshQuad.init_tensor(np.linspace(0, 1, 5), np.linspace(0, length, 29))
radius = np.interp(grid.p[1], (np.arange(20) + 0.5) * length / 20, radii)
mesh = skfem.MeshQuad(np.array([grid.p[0] * radius, grid.p[1]]), grid.t)
mesh = mesh.with_boundaries({"tip": lambda x: x[1] < 1e-9})
basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()), intorder=4)

# %%
# Elastic energy of the strains :math:`\varepsilon_{rr}`, :math:`\varepsilon_{zz}`,
# :math:`\varepsilon_{tt}` and :math:`\gamma_{rz}`, consistent mass, and a uniform traction of
# resultant 1 on the tip:


@skfem.BilinearForm
def stiffness(u, v, w):
    r, G = w.x[0], modulus / (2 + 2 * poisson)
    e, t = ([a.grad[0, 0], a.grad[1, 1], a[0] / r] for a in (u, v))
    shear = (u.grad[0, 1] + u.grad[1, 0]) * (v.grad[0, 1] + v.grad[1, 0])
    normal = poisson / (1 - 2 * poisson) * sum(e) * sum(t)
    return 2 * np.pi * r * G * (2 * normal + 2 * sum(map(np.multiply, e, t)) + shear)


@skfem.BilinearForm
def mass(u, v, w):
    return 2 * np.pi * w.x[0] * density * (u[0] * v[0] + u[1] * v[1])


@skfem.LinearForm
def traction(v, w):
    return w.x[0] * v[1]


K, M = stiffness.assemble(basis), mass.assemble(basis)
load = traction.assemble(skfem.FacetBasis(mesh, basis.elem, facets="tip", intorder=4))
axial = np.zeros(basis.N)
for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
    axial[dofs[1]] = 1
load /= load @ axial
print(f"mass {axial @ M @ axial:.4e} lb s2/in")

# %%
# Average acceleration over the steps of the run. The force in the middle is the contact force less
# the inertia of the front half.
middle = np.clip(0.5 + 1e6 * (length / 2 - basis.doflocs[1]), 0, 1)
front = M @ (middle * axial)
solve = splu((M + dt**2 / 4 * K).tocsc()).solve
u, v, a = (np.zeros(basis.N) for _ in range(3))
solid = []
for force in result.force:
    moved = u + dt * v + dt**2 / 4 * a
    after = solve(force * load - K @ moved)
    u, v, a = moved + dt**2 / 4 * after, v + dt / 2 * (a + after), after
    solid.append(force - front @ a)


# %%
# Both ring, the solid more. Averaged over a period of the ringing the two agree:
def compare(name, force, other):
    rms = np.sqrt(np.mean((force - other) ** 2) / np.mean(other**2))
    peaks = f"{force.max():.2f} and {other.max():.2f} lb, {force.max() / other.max() - 1:+.1%}"
    print(f"{name:8}  peak {peaks}, rms of the difference {rms:.1%}")


window = np.full(42, 1 / 42)  # steps in 8.4 µs
rod = result.transducer
compare("as is", np.array(solid), rod)
compare("averaged", np.convolve(solid, window, "same"), np.convolve(rod, window, "same"))

figure, ax = plt.subplots(figsize=(7.2, 3.2), layout="constrained")
ax.plot(1e6 * result.time, rod, label="20 rod elements", lw=0.9)
ax.plot(1e6 * result.time, solid, label="112 axisymmetric elements", lw=0.9)
ax.set(xlabel="Time (µs)", ylabel="Force in the middle (lbf)", xlim=(0, 800))
ax.legend(frameon=False)
figure.savefig("projectile.png")
