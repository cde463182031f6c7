"""What curvature changes
======================

Skins that are flat or curved: the static stiffness is many times as large, the peak force of a
light and fast impact is the same.
"""

import matplotlib.pyplot as plt

import fecm

plate = fecm.Plate.rectangle((300, 200), (30, 20), support="simple")
laminate = fecm.Laminate("[0/90/0/90/0]s", "IM7/8552", 0.2)
mass, contact = fecm.RigidMass(5e-6), fecm.Contact(5e4)  # 5 g, N/mm^1.5
settings = {"velocity": "1m/s", "duration": "0.8ms", "patch": "disc:10", "units": "mm-N-s"}

# %%
# Radii along y, the shorter side; None is flat.
radii, stiffness, peak = (None, 4000, 2000, 1000, 700, 500), [], []
for radius in radii:
    deck = fecm.impact(plate, laminate, mass, contact, radius_y=radius, **settings)
    estimate = fecm.estimate(deck)
    stiffness.append(estimate.stiffness)
    peak.append(estimate.models["run"].peak_force)
    print(f"radius {radius}: {stiffness[-1]:.0f} N/mm, peak force {peak[-1]:.1f} N")

figure, ax = plt.subplots(figsize=(5, 3), layout="constrained")
curvature = [1e3 / radius if radius else 0.0 for radius in radii]
for values, name in ((stiffness, "static stiffness"), (peak, "peak force at 1 m/s")):
    ax.plot(curvature, [value / values[0] for value in values], "o-", label=name)
ax.set(xlabel="Curvature (1/m)", ylabel="Over that of the flat plate", ylim=(0, None))
ax.legend()
figure.savefig("curved-stiffness.png")

# %%
# The last panel to scale, with its deflection enlarged.
fecm.run_one(deck).plot("surface", "curved-surface.png")
