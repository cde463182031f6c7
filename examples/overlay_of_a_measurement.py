"""A measurement beside a run
==========================

A measured force over the computed one, with peak, impulse, rms of the difference and correlation.
"""

import fecm

measured = fecm.examples.path("measured-force.csv")  # columns time, force
result = fecm.run_one(fecm.examples.path("impact-patch.inp"))

comparison = result.compare(measured)
print(comparison)
print(f"correlation {comparison.correlation:.4f}")

ax = result.plot("force", overlay=measured, width="full")
ax.set_title("115 in/s")
ax.figure.savefig("overlay.png")
