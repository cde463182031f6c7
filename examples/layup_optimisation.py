"""Optimising a layup
==================

The angles of a laminate [±a/±b]2s at which a plate deflects least under an impact, by the method
of Nelder and Mead. It may try any angles, also such as 1e-05.
"""

import matplotlib.pyplot as plt
from scipy.optimize import minimize

import fecm

plate = fecm.Plate.rectangle((80, 60), (8, 6), support="simple")
laminate = fecm.Laminate("[45/-45]4s", "AS4/8552")
ball, steel = fecm.RigidMass(2e-5), fecm.Contact.estimate(radius=8)  # t, mm
deck = fecm.impact(plate, laminate, ball, steel, energy="40mJ", duration=1e-3)
tried = []


def deflection(angles):
    """Largest deflection under the load, mm."""
    a, b = angles
    half = 2 * [a, -a, b, -b]
    run = fecm.run_one(deck.with_(layup=half + half[::-1], dt="auto"))
    tried.append((a, b, run.metrics["max_deflection"]))
    return tried[-1][-1]


options = {"initial_simplex": [(0, 0), (45, 0), (0, 45)], "xatol": 4, "fatol": 1e-3}
best = minimize(deflection, (0, 0), method="Nelder-Mead", options=options)
print(f"{best.fun:.4f} mm at {best.x.round()} degrees after {best.nfev} runs")
print(f"{tried[0][-1]:.4f} mm at 0 degrees")

a, b, w = zip(*tried, strict=True)
figure, ax = plt.subplots(figsize=(5, 3.5), layout="constrained")
figure.colorbar(ax.scatter(a, b, c=w), label="Largest deflection (mm)")
ax.set(xlabel="a (degrees)", ylabel="b (degrees)", aspect="equal")
figure.savefig("angles.png")
