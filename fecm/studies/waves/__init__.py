"""Plane waves and wave fronts in an infinite laminate of any layup, report chapter 2.

Conventions: angles are in degrees, counter-clockwise from the x-axis. They give the direction of
propagation, which is the normal n of a wave front; t is n rotated by +90 degrees. In-plane
displacements are u0 + z phi, so that kappa = grad(phi) and gamma = grad(w) + phi (equations 2-6 to
2-9). The components of the 5 x 5 problem are u_n, u_t, phi_n, phi_t, w; along n and t the inertia
does not depend on the direction.

Names: a mode is named after the component with the largest share of its kinetic energy. A front has
one name for all normals, from its mean shares. A harmonic wave is in-plane or flexural by the
shares at its wavelength; the faster of the two in-plane waves is the extension. Each name is used
once: the assignment maximises the sum of the shares. If sums are equal, the faster mode gets the
earlier name.

`harmonic` describes the laminate and solves for waves of given lengths. `fronts` solves for fronts
of given normals and tracks them over all normals. `study` has the functions for users.
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
