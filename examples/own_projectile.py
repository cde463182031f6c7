"""Another projectile
==================

A rod of aluminium that gets thicker along its length, and a rigid mass, on the report's plate.
"""

import fecm
from fecm.plot.pictures import plot

plate = fecm.Plate.rectangle((6, 4), (12, 8))  # in
laminate = fecm.Laminate("[0/45/0/-45/0]2s", "report", 0.0053)
diameters = [0.3 + 0.02 * n for n in range(20)]
rod = fecm.Rod(1.5, diameters, 10.5e6, 2.5e-4)  # length, diameters, E, density; lbf, in, s
mass = fecm.RigidMass(1e-4)

results = {}
for projectile in (rod, mass):
    deck = fecm.impact(
        plate,
        laminate,
        projectile,
        "report-0.75",
        velocity=115,
        duration=8e-4,
        every=100,
        units="in-lbf-s",
    )
    name = type(projectile).__name__
    results[name] = fecm.run_one(deck)
    print(name, f"{results[name].metrics['peak_force']:.1f} lbf")
plot("force", results, "projectiles.png")
