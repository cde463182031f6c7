"""Waves in the report's laminate against the closed forms of its chapter 2 (lb, in, s)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fecm.deck.records import Ply
from fecm.mechanics.laminate import Laminate, laminate
from fecm.studies.waves import FRONTS, MODES, Medium, WaveSurfaces, dispersion
from fecm.verification.case import Check, case

CLOSED = "closed form, to the digits stated"


def report_laminate() -> Laminate:
    """Stack [0/45/0/-45/0]2s of the report's graphite/epoxy."""
    half = [0.0, 45.0, 0.0, -45.0, 0.0] * 2
    ply = Ply(0.000148, 0.3, 17.5e6, 1.15e6, 0.8e6, 0.8e6, 0.8e6)
    return laminate(ply, half + half[::-1], [0.0053] * 20)


@case(
    "wave-fronts",
    "fronts in the report's laminate",
    Check("extension, 0° (in/s)", 294407.05115866, "√(A11/P)", 1e-11, CLOSED),
    Check("in-plane shear, 0° (in/s)", 124300.34606670, "√(A66/P)", 1e-11, CLOSED),
    Check("bending, 0° (in/s)", 296304.98915263, "determinant 2-70", 1e-11, CLOSED),
    Check("twisting, 0° (in/s)", 122459.06491923, "determinant 2-70", 1e-11, CLOSED),
    Check("transverse shear, 0° (in/s)", 73521.46220938, "√(G13/ρ)", 1e-11, CLOSED),
    Check("extension, 45° (in/s)", 236877.60935881, "determinant 2-69", 1e-11, CLOSED),
    Check("its ray's direction (degrees)", 15.916812, "equation 2-84", 1e-6, CLOSED),
)
def wave_fronts() -> Sequence[float]:
    """Normal velocities, and a ray."""
    found = WaveSurfaces(Medium(report_laminate())).fronts([0.0, 45.0])
    along = dict(zip(FRONTS, found.velocity[0].tolist(), strict=True))
    names = ("extension", "in_plane_shear", "bending", "twisting", "transverse_shear")
    extension = FRONTS.index("extension")
    return [
        *(along[name] for name in names), found.velocity[1, extension],
        found.ray_angle[1, extension],
    ]  # fmt: skip


CUTOFF = math.sqrt(12.0 * 0.8e6 / 0.000148) / 0.106


@case(
    "dispersion",
    "harmonic flexural waves along 0° in the report's laminate",
    Check("ω, wavelength 10 h (1/s)", 2.5518238987e5, "determinant 2-30", 1e-9, CLOSED),
    Check("ω, wavelength h (1/s)", 4.3146696888e6, "determinant 2-30", 1e-9, CLOSED),
    Check("cut-off ω (1/s)", CUTOFF, "√(12 G13/ρ)/h, the report, chapter 2", 1e-7,
          "at a wavelength of 10⁵ h"),
)  # fmt: skip
def harmonic() -> Sequence[float]:
    """Angular frequencies."""
    found = dispersion(Medium(report_laminate()), 0.0, [10.0, 1.0, 1e5]).angular_frequency
    first, last = MODES.index("flexural_1"), MODES.index("flexural_3")
    return [found[0, first], found[1, first], found[2, last]]


CASES = (wave_fronts, harmonic)
