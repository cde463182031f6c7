"""Curved panels broken on purpose."""

from __future__ import annotations

from fecm.mechanics import curvature
from tests.breaks import Breaks, changed

BREAKS: Breaks = {
    "w/R left out": (
        changed(curvature, "strain_of_deflection", lambda strains: 0.0 * strains),
        {"curved-panel": ("w", "N", "M", "ω"), "curved-impact": ("w",)},
    ),
}
