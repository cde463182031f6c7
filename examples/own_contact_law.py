"""A contact law of your own
=========================

Hertz's law up to a force at which the surface yields, in the place of the deck's law. Any object
with these four methods is a :class:`law <fecm.Law>`.
"""

import fecm
from fecm.plot.pictures import draw_results


class Yielding:
    """F = k a^1.5, continued by its tangent above an indentation; without hysteresis."""

    k, a_y = 1.912e6, 8e-4  # lbf/in^1.5, in

    def start(self):
        return None

    def trial(self, memory, last, indentation):
        a = min(max(indentation, 0.0), self.a_y)
        above = max(indentation - self.a_y, 0.0)
        return self.k * a**1.5 + 1.5 * self.k * a**0.5 * above, memory

    def accept(self, memory, last, indentation):
        return memory

    def permanent(self, memory, last):
        return 0.0


deck = fecm.read_one(fecm.examples.path("impact-patch.inp"))
results = {"deck": fecm.run_one(deck), "yielding": fecm.run_one(deck, law=Yielding())}
for name, result in results.items():
    print(f"{name}: {result.force.max():.1f} lbf")
draw_results("loop", results, "laws.png")
