"""How likely is it to delaminate?
===============================

The energy of a drop weight and its contact scatter, and so does the force: the probability that it
exceeds a value, and that it exceeds the delamination threshold, from 512 impacts.
"""

import fecm

deck = fecm.read_one(fecm.examples.path("drop-weight-held.inp")).with_(energy="4.3J")
laws = {"energy": "normal:4300,200", "k": "lognormal:42000,0.2"}  # mJ, N/mm^1.5
result = fecm.sweep(deck, random=laws, samples=512, exceed={"peak_force": "threshold"})
chance = result.random.exceedance
print(f"{chance.probability.item():.0%} ({chance.lower.item():.0%} to {chance.upper.item():.0%})")

result.plot("exceedance", "probability.png", overwrite=True)
