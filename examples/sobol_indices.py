"""Sobol' indices by SALib
=======================

How much velocity and contact law contribute to the scatter of the permanent indentation. SALib
draws the cases (Saltelli's scheme), ``fecm`` runs them, SALib evaluates them; beside it the indices
of ``fecm`` itself. Needs SALib: ``pip install 'fecm[examples]'``.
"""

import pandas as pd
from SALib.analyze import sobol
from SALib.sample.sobol import sample

import fecm

deck = fecm.examples.path("impact-patch.inp")
ends = {"velocity": (110, 170), "k": (1.5e6, 2.4e6), "alpha_p": (1e-4, 1e-3)}  # in/s, lbf, in
problem = {"names": list(ends), "num_vars": len(ends), "bounds": list(ends.values())}
draws = sample(problem, 256, calc_second_order=False, seed=1)
by_salib = fecm.sweep(deck, cases=pd.DataFrame(draws, columns=problem["names"]))
dents = by_salib["permanent_indentation"]
of_salib = sobol.analyze(problem, dents, calc_second_order=False, seed=1)

# %%
# The same study by ``fecm``, with a sample of its own:
laws = {name: f"uniform:{a},{b}" for name, (a, b) in ends.items()}
result = fecm.sweep(deck, random=laws, samples=256, design="sobol", sensitivity=True)
indices = result.random.sensitivity["permanent_indentation"]
print("first-order index      SALib (95 %)            fecm (95 %)")
for n, name in enumerate(ends):
    low, high = indices.first_interval[n]
    salib = f"{of_salib['S1'][n]:.3f} ± {of_salib['S1_conf'][n]:.3f}"
    print(f"{name:20} {salib:>14}  {indices.first[n]:.3f} ({low:.3f} to {high:.3f})")
