"""Optimising a layup
==================

The angle of a laminate [a/-a]4s at which a plate deflects least under an impact, by SciPy.
"""

import matplotlib.pyplot as plt
from scipy.optimize import minimize_scalar

import fecm

deck = fecm.impact(
    fecm.Plate.rectangle((120, 80), (12, 8), support="simple"),
    fecm.Laminate("[45/-45]4s", "AS4/8552"),
    fecm.RigidMass(2e-5),  # t
    fecm.Contact.estimate(radius=8),
    energy=40,  # mJ
    duration=2e-3,
)
tried = {}


def deflection(angle):
    """Largest deflection under the load, mm."""
    layup = 4 * [angle, -angle] + 4 * [-angle, angle]
    run = fecm.run_one(deck.with_(layup=layup, dt="auto"))
    return tried.setdefault(angle, run.metrics["max_deflection"])


best = minimize_scalar(deflection, bounds=(0, 90), options={"xatol": 2.0})
print(f"{best.fun:.4f} mm at {best.x:.0f} degrees; {deflection(0.0):.4f} mm at 0")

figure, ax = plt.subplots(figsize=(5, 3), layout="constrained")
ax.plot(*zip(*sorted(tried.items()), strict=True), "o")
ax.set(xlabel="Angle (degrees)", ylabel="Largest deflection (mm)")
figure.savefig("angles.png")
