"""A deck from objects
===================

A drop-weight test as Python objects: no card is typed. The deck that they make is text, like any
other.
"""

import fecm
from fecm.plot.pictures import draw_results

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

# %%
# Any value of a deck can be changed afterwards; here the same mass hits faster.
faster = fecm.run_one(deck.with_(velocity=2000))
print(f"{faster.metrics['peak_force']:.0f} N at 2 m/s")
draw_results("loop", {"1.5 m/s": result, "2 m/s": faster}, "faster.png", against="displacement")

# %%
# The deck begins like this; ``Path("plate.inp").write_text(deck.to_text())`` writes it.
print("\n".join(deck.to_text().splitlines()[:12]))
