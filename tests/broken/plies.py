"""Stresses of plies and their failure broken on purpose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fecm.deck.model import Cure
from fecm.mechanics import failure, ply_stresses
from fecm.mechanics import laminate as laminates
from fecm.mechanics.failure_monitor import FailureMonitor
from fecm.problem import parts
from tests.breaks import (
    Breaks,
    bent_with_stretching_held,
    changed,
    in_numpy,
    in_plate_axes,
    instead,
    mirrored,
    of_one_material,
    of_the_first,
    of_the_last,
    unturned,
    without_q26,
    without_shear_stress,
)

BREAKS: Breaks = {
    "EQUI ignored": (
        instead(ply_stresses, "equilibrium_shear_stiffness", lambda right, plate: plate.shear),
        {"equilibrium-shear": ("A*",)},
    ),
    "D for D - B A⁻¹ B in EQUI": (
        instead(ply_stresses, "equilibrium_shear_stiffness", bent_with_stretching_held),
        {"equilibrium-shear": ("A*55 of [0/90]", "A*44 of [0/90]", "A*55 of [30", "A*44 of [30")},
    ),
    "Q26 forgotten in the equilibrium of the plies": (
        changed(ply_stresses, "_moments", without_q26),
        {"equilibrium-shear": ("A*55 of [30", "A*44 of [30", "A*45 of [30"),
         "failure-states": ("interlaminar",)},
    ),
    "interlaminar stresses turned the other way": (
        instead(FailureMonitor, "__init__", mirrored), {"failure-states": ("interlaminar",)},
    ),
    "interlaminar failure of the ply above alone": (
        in_numpy(changed(failure, "interlaminar", of_the_first)),
        {"failure-states": ("interlaminar shear, -45",)},
    ),
    "interlaminar failure of the ply below alone": (
        in_numpy(changed(failure, "interlaminar", of_the_last)),
        {"failure-states": ("interlaminar shear, 30",)},
    ),
    "failure without the shear stress": (
        in_numpy(without_shear_stress),
        {"failure-states": ("maximum stress, 90", "Tsai and Wu", "Hashin, 30", "Hashin, -45",
                            "Hashin, 90", "Puck, -45", "Puck, 90")},
    ),
    "one material for all layers": (
        instead(parts, "_laminate_of", of_one_material),
        {"sandwich": ("σ", "τ", "100 w"), "unlike-densities": ("",)},
    ),
    "faces of a ply exchanged": (
        changed(ply_stresses, "in_plane_stresses", lambda found: found[:, ::-1]),
        {"ply-stresses": ("σ", "τ12")},
    ),
    "stresses of a ply in the plate's axes": (
        instead(ply_stresses, "in_plane_stresses", in_plate_axes),
        {"ply-stresses": ("σ1 at z = h/6",),
         "failure-states": ("maximum stress", "Tsai and Wu", "Hashin", "Puck")},
    ),
    "σ2 a tenth too small": (
        changed(ply_stresses, "in_plane_stresses",
                lambda found: found * np.array([1.0, 0.9, 1.0])[:, None]),
        {"ply-stresses": ("σ2",), "failure": ("",), "inclined-failure": ("",)},
    ),
    "free strains of a ply in its own axes": (
        instead(ply_stresses, "free_strains",
                lambda right, plate, along, across: right(unturned(plate), along, across)),
        {"residual-stresses": ("",)},
    ),
    "a free plate that stays flat": (
        changed(ply_stresses, "in_plane_stresses",
                lambda found: np.concatenate([found[..., :3], 0.0 * found[..., 3:]], axis=-1)),
        {"residual-stresses": ("σ1 of [0/90], outer", "σ2 of [0/90], outer")},
    ),
    "moisture forgotten": (
        instead(Cure, "strains",
                lambda right, cure, material: right(replace(cure, delta_c=0.0), material)),
        {"residual-stresses": ("σ2 of [0/90]s, 0.5 %",)},
    ),
    "mode C with another resistance of the action plane": (
        in_numpy(changed(failure, "puck_limits", lambda limits: (1.1 * limits[0], limits[1]))),
        {"inclined-failure": ("σ2 = -180, τ12", "σ2 = -150")},
    ),
    "the rotary inertia of the mean density": (
        changed(laminates, "laminate",
                lambda made: replace(made, rotary_inertia=made.mass * made.thickness**2 / 12.0)),
        {"unlike-densities": ("rotary",)},
    ),
    "FAIL takes half of the residual stresses": (
        instead(FailureMonitor, "with_residual",
                lambda right, self, stresses: right(self, [0.5 * own for own in stresses])),
        {"cured-failure": ("",)},
    ),
    "interlaminar stresses of x and y exchanged": (
        changed(ply_stresses, "interlaminar_stresses",
                lambda found: (found[0][:, :, ::-1], found[1])),
        {"ply-stresses": ("τ_xz", "τ_yz"), "ply-shear": ("τ_xz at z = 0", "τ_xz at z = h")},
    ),
    "interlaminar stresses that do not begin at 0": (
        changed(ply_stresses, "interlaminar_stresses",
                lambda found: (found[0] + 0.1 * found[0].max(), found[1])),
        {"ply-stresses": ("τ_xz", "τ_yz"), "ply-shear": ("τ_xz at z = ±h/2",)},
    ),
}  # fmt: skip
