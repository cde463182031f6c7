"""At what energy does it delaminate?
==================================

The peak force of a drop weight over its energy, and the energy at which it reaches the delamination
threshold. The plate is stepped once for all energies.
"""

import fecm

deck = fecm.read_one(fecm.examples.path("drop-weight-held.inp"))
energies = [500.0 * n for n in range(1, 21)]  # mJ
result = fecm.sweep(deck, {"energy": energies, "duration": [0.005]})

# %%
# A search finds the energy at the threshold to six digits:
onset = fecm.sweep(deck, until="threshold")["found_energy"][0]
print(f"it delaminates from {onset / 1000:.2f} J on")

ax = result.plot(over="energy")
ax.axvline(onset, color="black", linewidth=0.8)
ax.annotate(f" {onset / 1000:.1f} J", (onset, 1000))
ax.figure.savefig("energy.png", bbox_inches="tight")
