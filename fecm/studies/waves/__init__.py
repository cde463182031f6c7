"""Plane waves and wave fronts in an infinite laminate of any layup, report chapter 2.

Conventions: angles are in degrees, counter-clockwise from the x-axis, and give the direction of
propagation, the normal n of a wave front; t is n rotated by +90 degrees.  In-plane displacements
are u0 + z phi, so that kappa = grad(phi) and gamma = grad(w) + phi (equations 2-6 to 2-9).  The
components of the 5 x 5 problem are u_n, u_t, phi_n, phi_t, w; along n and t the inertia does not
depend on the direction.

Names: a mode is named by the component with the largest share of its kinetic energy.  A front has
one name for all normals, from its mean shares; a harmonic wave is in-plane or flexural by its
shares at its wavelength, and the faster of the two in-plane waves is the extension.  Each name is
used once: the assignment maximises the sum of the shares, and of equal sums it gives the faster
mode the earlier name.

`medium` describes the laminate, `harmonic` solves for waves of given lengths, `sheets` for fronts
of given normals, and `fronts` tracks the fronts over all normals.
"""

from fecm.studies.waves.fronts import FRONTS, Cusp, Fronts, WaveSurfaces
from fecm.studies.waves.harmonic import MODES, Dispersion, Medium, dispersion

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
