"""A drop-weight test
==================

ASTM D7136 on a laminate of 24 plies: 5.5 kg fall on a plate of 150 × 100 mm. The force passes the
delamination threshold long before its peak; from there on the run is that of an elastic plate.
"""

import fecm

deck = fecm.read_one(fecm.examples.path("drop-weight.inp")).with_(energy="10J")
result = fecm.run_one(deck)
print(result)

ax = result.plot("force")
ax.set_title("5.5 kg, 10 J")
ax.figure.savefig("force.png")
