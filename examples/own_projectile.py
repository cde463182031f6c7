"""Another projectile for a deck: a rod of aluminium that gets thicker, and a rigid mass."""

import fecm

plate = fecm.Plate.rectangle((6, 4), (12, 8))  # in
laminate = fecm.Laminate("[0/45/0/-45/0]2s", "report", 0.0053)
diameters = [0.3 + 0.02 * n for n in range(20)]
rod = fecm.Rod(1.5, diameters, 10.5e6, 2.5e-4)  # length, diameters, E, density; lbf, in, s
mass = fecm.RigidMass(1e-4)

for projectile in (rod, mass):
    deck = fecm.impact(
        plate, laminate, projectile, "report-0.75",
        velocity=115, duration=8e-4, every=100, units="in-lbf-s",
    )  # fmt: skip
    result = fecm.run_one(deck)
    print(type(projectile).__name__, f"{result.metrics['peak_force']:.1f} lbf")
