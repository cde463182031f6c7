"""The stretching of plates that bend, broken on purpose."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fecm.mechanics import membrane, reduced_plate
from fecm.mechanics.elements import gauss
from fecm.mechanics.membrane import MembraneForces, QuadraticStrains
from tests.breaks import Breaks, changed, in_numpy, instead

EVERY_STRIP = ("w in the middle",)


def without_component(component: int) -> Any:
    """Leave out e_11, e_22 or e_12, of energy and forces alike."""

    def broken(right: Any, strains: Any, *args: Any) -> None:
        right(strains, *args)
        strains.to_global[:, component] = 0.0

    return instead(QuadraticStrains, "__init__", broken)


def untied(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the quadratic strains at the points of quadrature."""
    points = gauss(3)
    own = SimpleNamespace(tying_points=lambda *_: points, tying_weights=lambda *_: np.eye(9))
    monkeypatch.setattr(membrane, "assumed_shear", own)
    monkeypatch.setattr(membrane, "TYING", 9)
    monkeypatch.setattr(membrane, "_CORNERS", points)
    monkeypatch.setattr(membrane, "_corner_weights", lambda _: np.eye(9))


BREAKS: Breaks = {
    "quadratic strains where they are not tied": (
        in_numpy(untied), {"cylindrical-bending": ("w over the linear",)},
    ),
    "w,x^2/2 left out": (
        in_numpy(without_component(0)),
        {"stretching-plate": ("",), "cylindrical-bending": EVERY_STRIP, "stretching-disc": ("",),
         "stretching-impact": ("largest",)},
    ),
    "w,x w,y left out": (
        in_numpy(without_component(2)), {"stretching-plate": ("",), "stretching-disc": ("",)},
    ),
    "a strain energy without the quadratic strains' share": (
        in_numpy(changed(MembraneForces, "forces", lambda found: (found[0], 0.0))),
        {"stretching-impact": ("worst",)},
    ),
    "a quartic energy of the reduced model 2 % too large": (
        changed(
            reduced_plate, "_integrated", lambda found: found._replace(quartic=1.02 * found.quartic)
        ),
        {"reduced-plate": ("force",)},
    ),
}  # fmt: skip
