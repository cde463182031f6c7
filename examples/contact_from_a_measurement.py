"""A contact law from a measured force
===================================

Contact coefficient and velocity of a run are fitted to a measured force history, with standard
errors. The "measurement" is computed, with a scatter of 2 % of its peak, so that the truth is
known.
"""

import matplotlib.pyplot as plt
import numpy as np

import fecm

deck = fecm.read_one(fecm.examples.path("impact-patch.inp"))
truth = fecm.run_one(deck.with_(k=1.6e6, velocity=120))
time = truth.time[::20]
scatter = np.random.default_rng(0).normal(size=len(time))
force = truth.force[::20] + 0.02 * truth.force.max() * scatter

fit = fecm.identify(deck, time, force, ["k", "velocity"])
for name, value in fit.values.items():
    print(f"{name}: {value:.4g} ± {fit.errors[name]:.2g}")

figure, ax = plt.subplots(figsize=(5, 3), layout="constrained")
ax.plot(1e6 * time, force, ".", label="measured")
ax.plot(1e6 * time, fit.model, label="fitted")
ax.set(xlabel="Time (µs)", ylabel="Contact force (lbf)")
ax.legend(frameon=False)
figure.savefig("fitted.png")
