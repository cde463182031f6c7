"""Where a panel was hit, from strain gages
========================================

Four strain gages record an impact at an unknown place. :func:`fecm.locate` finds the place and the
history of the force, with standard errors, from a deck of the panel. The strains are a series
solution with a scatter of 2 %, so that the truth is known: 112.5, 81 mm and 161 N.
"""

import fecm

deck = fecm.examples.path("panel-with-gages.inp")
strains = fecm.examples.path("panel-strains.csv")
location = fecm.locate(deck, strains, noise=3.7e-6)

print(f"x = {location.x:.2f} ± {location.sd_x:.2f} {location.unit('x')}")
print(f"y = {location.y:.2f} ± {location.sd_y:.2f} {location.unit('y')}")
print(f"peak force {location.peak_force:.0f} {location.unit('peak_force')}")
print(f"impulse    {location.impulse:.4f} {location.unit('impulse')}")
print(f"misfit     {location.misfit:.2f} times the noise; second place {location.second.ratio:.1f}")
location.plot("located.png")
