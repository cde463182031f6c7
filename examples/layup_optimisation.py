"""Optimising a layup
==================

The angle of a laminate [a/-a]4s at which a plate deflects least under an impact, by SciPy.
"""

import matplotlib.pyplot as plt
from scipy.optimize import minimize_scalar

import fecm

deck = fecm.impact(
    fecm.Plate.rectangle((120, 80), (12, 8), support="simple"),
    fecm.Laminate("[45/-45]4s", "AS4/8552", 0.13),
    fecm.RigidMass(2e-5),  # t
    fecm.Contact.estimate(radius=8),
    energy=40,  # mJ
    duration=2e-3,
    dt=3e-7,  # stable for all angles
    units="mm-N-s",
)
tried = {}


def deflection(angle):
    """Largest deflection under the load, mm."""
    run = fecm.run_one(deck.with_(layup=f"[{angle:.2f}/{-angle:.2f}]4s"))
    return tried.setdefault(angle, run.metrics["max_deflection"])


best = minimize_scalar(deflection, bounds=(0, 90), options={"xatol": 2.0})
print(f"{best.fun:.4f} mm at {best.x:.0f} degrees; {deflection(0.0):.4f} mm at 0")

figure, ax = plt.subplots(figsize=(5, 3), layout="constrained")
ax.plot(*zip(*sorted(tried.items()), strict=True), "o")
ax.set(xlabel="Angle (degrees)", ylabel="Largest deflection (mm)")
figure.savefig("angles.png")
