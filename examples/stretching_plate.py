"""Thin plates stretch
===================

A plate whose edges cannot approach each other stretches as it bends. The force of an impact on the
linear plate and on the one that stretches, over the energy.
"""

import matplotlib.pyplot as plt

import fecm

plate = fecm.Plate.rectangle((100, 100), (12, 12), support="clamped", grading=2.0)
laminate = fecm.Laminate("[45/0/-45/90]2s", "IM7/8552", 0.131)
mass, contact = fecm.RigidMass(1e-3), fecm.Contact.estimate(radius=8)  # 1 kg
settings = {"duration": "4ms", "every": 100, "patch": "hertz:6", "units": "mm-N-s"}
energies = (100, 300, 1000, 3000, 10000)  # mJ
figure, ax = plt.subplots(figsize=(5, 3), layout="constrained")

# %%
# The same impacts twice. A linear plate is as soft at ten joules as at a tenth of one.
for stretches, name in ((False, "linear"), (True, "stretches as it bends")):
    forces = []
    for energy in energies:
        model = fecm.impact(
            plate, laminate, mass, contact, energy=energy, nonlinear=stretches, **settings
        )
        run = fecm.run_one(model)
        forces.append(run.force.max())
        print(f"{name}: {forces[-1]:.0f} N, {run.plate_w.max() / 2.096:.2f} h at {energy} mJ")
    ax.loglog(energies, forces, "o-", label=name)
ax.set(xlabel="Energy (mJ)", ylabel="Largest force (N)")
ax.legend()
figure.savefig("stretching.png")
