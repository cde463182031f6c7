"""Curved panels broken on purpose."""

from __future__ import annotations

from typing import Any

from fecm.mechanics import membrane
from fecm.mechanics import strains as curvature
from tests.breaks import Breaks, changed, instead


def of_the_squares(_: Any, plate: Any, points: Any, field: Any) -> Any:
    return membrane.quadratic_strains_at(points, field) if plate.nonlinear else None


BREAKS: Breaks = {
    "w/R left out of the strains of a nonlinear panel": (
        instead(membrane, "strains_of_deflection", of_the_squares),
        {"curved-strains": ("ε_x", "ε_y", "γ_xy")},
    ),
    "a twist that counts once": (
        changed(curvature, "strain_of_deflection", lambda strains: strains * [1.0, 1.0, 0.5]),
        {"curved-strains": ("γ_xy", "pressure")},
    ),
    "w/R left out": (
        changed(curvature, "strain_of_deflection", lambda strains: 0.0 * strains),
        {"curved-panel": ("w", "N", "M", "ω"), "curved-impact": ("w",), "curved-strains": ("",)},
    ),
}
