"""Plane waves and wave fronts in an infinite laminate, report chapter 2, without its symmetries.

Conventions: angles are in degrees, counter-clockwise from the x-axis, and give the direction of
propagation, which is the normal n of a wave front; t is n turned by +90 degrees.  A point moves by
u0 + z phi in the plane, so that kappa = grad(phi) and gamma = grad(w) + phi (the report's text,
equations 2-6 to 2-9).  The unknowns of the 5 x 5 problem stand in the order u_n, u_t, phi_n, phi_t,
w: components along n and t, in which the inertia does not depend on the direction.

Names: a mode is named by the component that has the largest share of its kinetic energy.  A front
has one name for all normals, from its shares over all of them; a harmonic wave is in-plane or
flexural by its shares at its own wavelength, and of the two in-plane ones the faster is the
extension, as it is among the fronts.  Each name goes to one mode: where several could take it the
sum of the shares decides, and of equal sums the one that gives the faster mode the earlier name.
"""

from fecm.studies.waves.dispersion import MODES, Dispersion, dispersion
from fecm.studies.waves.fronts import FRONTS, Cusp, Fronts, WaveSurfaces
from fecm.studies.waves.medium import Medium

__all__ = [
    "FRONTS",
    "MODES",
    "Cusp",
    "Dispersion",
    "Fronts",
    "Medium",
    "WaveSurfaces",
    "dispersion",
]
