"""How thick a core?
=================

A sandwich of carbon faces and a foam core: the largest force of an impact over the thickness of the
core, with the shear stiffness of equilibrium and with the plain sum of the layers, with which
the plate is far too stiff.
"""

import matplotlib.pyplot as plt

import fecm

plate = fecm.Plate.rectangle((100, 100), (16, 16), support="simple", grading=4.0)
faces = fecm.Laminate("[0/90/0/90/0]", "IM7/8552", 0.25)
mass, contact = fecm.RigidMass(1e-4), fecm.Contact.estimate(radius=8)  # 0.1 kg; mm, N, s
settings = {"velocity": 1000, "duration": "4ms", "every": 100, "patch": "disc:3"}
deck = fecm.impact(plate, faces, mass, contact, units="mm-N-s", **settings).to_text()

# %%
# The layer in the middle becomes foam: material 2 of MATS.
foam = "MATS\n    2\n1.1E-10,.3,92.,92.,35.,35.,35.\n\n"
middle, whole = "    3  0.0      0.25", "      1.25\n"
cores = (1.0, 2.0, 4.0, 8.0)
figure, ax = plt.subplots(figsize=(5, 3), layout="constrained")
for words, name in (("SHEA MITC EQUI", "equilibrium"), ("SHEA MITC", "sum of the layers")):
    forces = []
    for core in cores:
        text = deck.replace(middle, f"    3  0.0{core:10.2f}    2")
        text = text.replace(whole, f"{1.0 + core:10.2f}\n", 1)
        run = fecm.run_one(text.replace("SHEA MITC", foam + words))
        forces.append(run.force.max())
        print(f"{name}: {forces[-1]:.0f} N with a core of {core:g} mm")
    ax.plot(cores, forces, "o-", label=name)
ax.set(xlabel="Thickness of the core (mm)", ylabel="Largest force (N)", ylim=(0, None))
ax.legend()
figure.savefig("sandwich.png")
