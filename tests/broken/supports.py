"""Springs and one-sided supports broken on purpose."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fecm.identification import edges
from fecm.mechanics import solutions
from fecm.mechanics.plate import PlateModel
from fecm.problem import supports
from tests.breaks import Breaks, changed, instead


def held(right: Any, plate: PlateModel, contact: Any) -> Any:
    return right(replace(plate, supports=plate.supports and plate.supports.held()), contact)


BREAKS: Breaks = {
    "half of the springs": (
        changed(supports, "spring_stiffness", lambda springs: 0.5 * springs),
        {"elastic-edges": ("f",)},
    ),
    "edges of half their length": (
        changed(edges.ElasticPlate, "_lengths", lambda lengths: 0.5 * lengths),
        {"edge-stiffness": ("k",)},
    ),
    "a window that pulls": (
        instead(solutions, "static_response", held),
        {"pushing-window": ("flexibility",)},
    ),
}
