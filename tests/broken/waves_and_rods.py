"""Waves and rods broken on purpose."""

from __future__ import annotations

from fecm.listing.variant import MISREAD_DENSITY
from fecm.mechanics import (
    projectile,
)
from fecm.studies.rod_test import pulse_test
from fecm.studies.waves import Fronts, Medium
from tests.breaks import (
    Breaks,
    changed,
    entry,
    instead,
    lighter_begin,
    quarter_of_mass,
    ray_without_slope,
    value,
)

BREAKS: Breaks = {
    "normal velocity's slope forgotten in the ray": (
        instead(Fronts, "ray", ray_without_slope), {"wave-fronts": ("its ray",)},
    ),
    "strength by the spreading of the rays, not by its root": (
        changed(Fronts, "strength", lambda strength: strength**2), {"wave-fronts": ("strength",)},
    ),
    "rotary inertia of one direction doubled": (
        changed(Medium, "inertia", entry(2, 2, 2.0)),
        {"wave-fronts": ("bending",), "dispersion": ("ω, wavelength", )},
    ),
    "theta of Wilson's method dropped": (
        value(projectile.WilsonStep, "theta", 1.0),
        {"rod-pulse": ("largest", "the same", "mean", "velocity")},
    ),
    "theta of Wilson's method 4": (
        value(projectile.WilsonStep, "theta", 4.0), {"rod-waves": ("wave", "peak")},
    ),
    "lumped mass of a quarter": (
        changed(projectile.Rod, "lumped_mass", quarter_of_mass),
        {"rod-pulse": ("the same", "velocity"),
         "rod-waves": ("wave", "first free frequency, lumped")},
    ),
    "consistent mass with 140 for 156": (
        instead(projectile.Rod, "consistent_mass", lighter_begin),
        {"rod-waves": ("first free frequency, cons",)},
    ),
    "the density that is misread in the listing": (
        value(projectile.report_rod, "__defaults__", (MISREAD_DENSITY,)),
        {"rod-pulse": ("mass",)},
    ),
    "force of the wrong station": (
        instead(pulse_test, "force_row", lambda right, bar, x: right(bar, x - 0.05 * bar.length)),
        {"rod-pulse": ("largest", "the same", "mean")},
    ),
}  # fmt: skip
