"""Which ply fails first, and where?
=================================

Exposures of every ply in a drop-weight test, at the energy at which the plate delaminates. The map
looks down on the plate: outlined cells are beyond failure, hatched ones are too near to the load
for plate theory.
"""

import fecm

deck = fecm.read_one(fecm.examples.path("drop-weight.inp")).with_(energy="4.5J")
result = fecm.run_one(deck)
for failure in result.first_failures:
    print(
        f"{failure.criterion:12} {failure.mode}, ply {failure.ply}: "
        f"{failure.force:.0f} N, {failure.energy:.0f} mJ"
    )

result.plot("failure", "failure.png", width="full", overwrite=True)
