"""A posterior by emcee
====================

What a measured force tells about the contact coefficient and the velocity: samples of their joint
distribution by emcee. The measurement is the force of a run, with the rise time of a transducer and
a scatter of 0.8 lbf. The plate is run once, for a grid of forces between which each sample is
interpolated. Needs emcee: ``pip install 'fecm[examples]'``.
"""

import emcee
import matplotlib.pyplot as plt
import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.signal import lfilter

import fecm

deck = fecm.examples.path("impact-patch.inp")
truth = fecm.run_one(deck)
grid = {"velocity": np.linspace(113, 117, 9), "k": np.linspace(1.7e6, 2.1e6, 9)}
result = fecm.sweep(deck, grid, history=True)


# %%
# The transducer is a first-order filter with a rise time of 5 µs, read every 20 steps.
def read(force):
    decay = np.exp(-result.dt[0] * np.log(9) / 5e-6)
    return lfilter([1 - decay, 1 - decay], [2, -2 * decay], force)[..., 19::20]


random = np.random.default_rng(0)
measured = read(truth.force) + random.normal(scale=0.8, size=len(truth.force) // 20)
forces = read(result.force).reshape(9, 9, -1)
model = RegularGridInterpolator(tuple(grid.values()), forces, bounds_error=False)


def log_probability(values):
    """Of Gaussian errors, and of values that are equally probable within the grid."""
    squares = np.sum(((model(values) - measured) / 0.8) ** 2, axis=1)
    return np.where(np.isnan(squares), -np.inf, -squares / 2)


sampler = emcee.EnsembleSampler(16, 2, log_probability, vectorize=True)
sampler.random_state = np.random.RandomState(0).get_state()
start = random.uniform([114, 1.8e6], [116, 2.0e6], (16, 2))
sampler.run_mcmc(start, 2000)
velocity, k = sampler.get_chain(discard=200, flat=True).T
print(f"velocity {velocity.mean():.2f} ± {velocity.std():.2f} in/s; the true velocity is 115")
print(f"k {k.mean():.3e} ± {k.std():.1e} lbf/in^1.5; the true k is 1.912e+06")

figure, ax = plt.subplots(figsize=(5, 3.5), layout="constrained")
ax.hexbin(velocity, k, gridsize=40, cmap="Blues")
ax.plot(115, 1.912e6, "r+")
ax.set(xlabel="Velocity (in/s)", ylabel="k (lbf/in$^{1.5}$)")
figure.savefig("posterior.png")
