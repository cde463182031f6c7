"""Stresses through the thickness
==============================

The stresses of every ply at the place and the time of the largest stress along the fibres, and
the interlaminar stress where it is largest; both away from the load.
"""

import matplotlib.pyplot as plt
import numpy as np

import fecm

plate = fecm.Plate.rectangle((120, 80), (30, 20), support="simple")
laminate = fecm.Laminate("[45/0/-45/90]2s", "AS4/8552")
ball, steel = fecm.RigidMass(2e-5), fecm.Contact.estimate(radius=8)  # t, mm
impact = {"energy": "40mJ", "duration": 1e-3, "patch": "disc:4", "plies": (50, 150)}
result = fecm.run_one(fecm.impact(plate, laminate, ball, steel, **impact))
plies = result.plies()
away = ~plies.under_load  # plate theory does not hold under the load


def at_largest(stress):
    """Return the stress through the thickness, where and when it is largest."""
    stress = stress[:, away]
    row, *place = np.unravel_index(abs(stress).argmax(), stress.shape)
    print(f"{abs(stress).max():.1f} MPa at {1e3 * plies.time[row]:.3f} ms")
    return stress[(row, *place[:-2])].ravel()


figure, (left, right) = plt.subplots(1, 2, figsize=(6, 3.5), layout="constrained", sharey=True)
left.plot(at_largest(plies.sigma_1), plies.z[:, ::2].ravel())
right.plot(at_largest(plies.tau_xz), plies.z.ravel())
left.set(xlabel="σ1 (MPa)", ylabel="z from the middle (mm)")
right.set(xlabel="τxz (MPa)")
left.invert_yaxis()  # the struck face is above
figure.savefig("stresses.png")
