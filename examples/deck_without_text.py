"""A drop-weight test from objects, its deck as text, and the same with more energy."""

from pathlib import Path

import fecm

deck = fecm.impact(
    fecm.Plate.rectangle((100, 100), (10, 10), support="clamped", grading=2.0),
    fecm.Laminate("[45/0/-45/90]2s", "IM7/8552", 0.184),
    fecm.RigidMass(5e-5),  # t
    fecm.Contact.estimate(radius=8),
    velocity=1500,  # mm/s
    duration=1e-3,
    units="mm-N-s",
    title="50 g on a clamped plate",
)
result = fecm.run_one(deck)
print(f"{result.metrics['peak_force']:.0f} N, {1e3 * result.metrics['contact_time']:.3f} ms")

faster = fecm.run_one(deck.with_(velocity=2000))
print(f"{faster.metrics['peak_force']:.0f} N at 2 m/s")
Path("plate.inp").write_text(deck.to_text())
