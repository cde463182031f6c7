"""Animation of the plate
======================

The report's plate and rod, from objects: the moving plate as a GIF, and its largest deflection.
Deflections are drawn many times larger than they are.
"""

import fecm

deck = fecm.impact(
    fecm.Plate.rectangle((6, 4), (12, 8)),  # in
    fecm.Laminate("[0/45/0/-45/0]2s", "report", 0.0053),
    fecm.Rod.cylinder(1, 0.5, 30e6, 6.875e-4),
    "report-0.75",
    velocity=115,
    duration=8e-4,
    every=100,
    units="in-lbf-s",
)
result = fecm.run_one(deck)
result.plot("animation", "plate.gif", overwrite=True)

# %%
# One instant, the one with the largest range of deflection unless ``times`` says otherwise:
result.plot("surface", "plate.png", overwrite=True)
