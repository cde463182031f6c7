"""The moving plate as a GIF, and a picture of its largest deflection."""

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
result.plot("animation", "plate.gif")
result.plot("surface", "plate.png")
