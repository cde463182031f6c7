"""Where a panel was hit, from strain gages
========================================

Four strain gages record an impact at an unknown place. :func:`fecm.locate` finds the place and the
history of the force, with standard errors, from a deck of the panel. The strains are a series
solution with a scatter of 2 %, so that the truth is known: 112.5, 81 mm and 161 N.
"""

import fecm

deck = fecm.examples.path("panel-with-gages.inp")
strains = fecm.examples.path("panel-strains.csv")
found = fecm.locate(deck, strains, noise=3.7e-6)

print(f"x = {found.x:.2f} ± {found.sd_x:.2f} {found.unit('x')}")
print(f"y = {found.y:.2f} ± {found.sd_y:.2f} {found.unit('y')}")
print(f"peak force {found.peak_force:.0f} {found.unit('peak_force')}")
print(f"impulse    {found.impulse:.4f} {found.unit('impulse')}")
print(f"misfit     {found.misfit:.2f} times the noise; second place {found.second.ratio:.1f}")
found.plot("located.png")
