"""Largest strain along the fibres, ply by ply, away from the load."""

import numpy as np

import fecm

text = fecm.examples.path("plate-with-gages.inp").read_text()
text = text.replace("\nDISC\n", "\nDISC,7\n")  # a patch that the mesh resolves
result = fecm.run_one(text.replace("\nRODP ", "\nPLYS,,20\nRODP "))  # every 20th step

plies = result.plies()
strain = abs(plies.eps_1)  # rows, elements, points, plies, faces
away = plies.under_load == 0  # plate theory does not hold under the load
largest = strain[:, away].max(axis=(0, 1, 2, 4))
for number, (angle, value) in enumerate(zip(plies.angles, largest, strict=True), start=1):
    print(f"ply {number:2d} {angle:4.0f} degrees {1e6 * value:6.0f} um/m")

row = np.unravel_index(strain[:, away].argmax(), strain[:, away].shape)[0]
print(f"largest at {1e3 * plies.time[row]:.3f} ms")
