"""Strains ply by ply
==================

The largest strain along the fibres of every ply, away from the load.
"""

import matplotlib.pyplot as plt
import numpy as np

import fecm

plate = fecm.Plate.rectangle((120, 80), (30, 20), support="simple")
laminate = fecm.Laminate("[45/0/-45/90]2s", "AS4/8552")
ball, steel = fecm.RigidMass(2e-5), fecm.Contact.estimate(radius=8)  # t, mm
impact = {"energy": 40, "duration": 1e-3, "patch": "disc:4", "plies": 50}  # mJ, s, mm, steps
result = fecm.run_one(fecm.impact(plate, laminate, ball, steel, **impact))

plies = result.plies()
strain = abs(plies.eps_1)  # rows, elements, points, plies, faces
away = plies.under_load == 0  # plate theory does not hold under the load
largest = 1e6 * strain[:, away].max(axis=(0, 1, 2, 4))
row = np.unravel_index(strain[:, away].argmax(), strain[:, away].shape)[0]
print(f"{largest.max():.0f} um/m at {1e3 * plies.time[row]:.3f} ms")

names = [f"{number} ({angle:.0f}°)" for number, angle in enumerate(plies.angles, start=1)]
figure, ax = plt.subplots(figsize=(5, 4), layout="constrained")
ax.barh(names, largest)
ax.invert_yaxis()
ax.set(xlabel="Strain along the fibres (µm/m)", ylabel="Ply, from the struck face")
figure.savefig("strains.png")
