"""A map of 96 impacts
===================

Peak force of the report's plate over velocity and contact coefficient. The plate is stepped once;
each impact is a convolution with its response.
"""

import fecm

deck = fecm.examples.path("impact-patch.inp")
values = {
    "velocity": [50.0 + 15.0 * n for n in range(16)],  # in/s
    "k": [1.0e6, 1.2e6, 1.4e6, 1.6e6, 1.8e6, 2.0e6],  # lbf/in^1.5
}
result = fecm.sweep(deck, values)  # output="map.h5" keeps the results
print(result)

peak = result["peak_force"]
worst = peak.argmax()
print(f"{peak[worst]:.1f} lbf at {result['velocity'][worst]:g} in/s, k {result['k'][worst]:g}")
result.plot("map", "map.png", quantity="peak_force", overwrite=True)
