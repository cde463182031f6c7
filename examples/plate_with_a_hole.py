"""A plate with a hole
===================

Impact beside a hole, on a mesh of Gmsh that comes with the package. Needs meshio:
``pip install 'fecm[examples]'``.
"""

import fecm

mesh = fecm.examples.path("hole.msh")  # groups: edge, hole
plate = fecm.Plate.from_mesh(mesh, {"edge": "clamped", "hole": "free"})
deck = fecm.impact(
    plate,
    fecm.Laminate("[0/90]4s", "T300/5208", 0.125),
    fecm.RigidMass(2e-5),  # t
    fecm.Contact.estimate(radius=6),
    at=(20, 20),  # mm
    velocity=1000,
    duration=4e-4,
    units="mm-N-s",
)
result = fecm.run_one(deck)
print(f"{result.metrics['peak_force']:.0f} N, w {result.metrics['max_deflection']:.4f} mm")
result.plot("contour", times=(1.2e-4,), path="hole.png", overwrite=True)
result.plot("mesh", path="mesh.png", overwrite=True)
