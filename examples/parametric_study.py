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
found = fecm.sweep(deck, values)  # output="map.h5" keeps the results
print(found)

peak = found["peak_force"]
worst = peak.argmax()
print(f"{peak[worst]:.1f} lbf at {found['velocity'][worst]:g} in/s, k {found['k'][worst]:g}")
found.plot("map", "map.png", quantity="peak_force", overwrite=True)
