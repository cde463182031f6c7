"""Elements, their strains and masses, and plates in motion, broken on purpose."""

from __future__ import annotations

from dataclasses import replace

from fecm.deck import macros as deck_macros
from fecm.mechanics import element_matrices, interpolation, points, strains
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.stiffness_product import ElementProduct
from fecm.problem import parts
from fecm.simulation.recorder import Recorder
from tests.breaks import (
    Breaks,
    changed,
    doubled,
    entry,
    equal_shares,
    exchanged_forces,
    exchanged_on_tape8,
    in_numpy,
    in_stiffness,
    in_strains,
    instead,
    negative,
    nothing,
    resultants,
    rotary_for_mass,
    rotations_reversed,
    without_coupling,
    without_preload,
    without_shea,
)

BREAKS: Breaks = {
    "sign of B in the stiffness": (
        in_stiffness(B=negative),
        {
            "cross-ply-plate": ("u",), "angle-ply-plate": ("u",), "forced-plate": ("strain",),
            "resultants": ("ε", "κ", "γ_xy"),
        },
    ),
    "B dropped in the stiffness": (
        in_stiffness(B=nothing),
        {
            "cross-ply-plate": ("ω", "w", "u"), "angle-ply-plate": ("ω", "w", "u"),
            "forced-plate": ("w", "strain"), "resultants": ("ε", "κ", "γ_xy", "N", "M"),
        },
    ),
    "sign of A16 in the stiffness": (
        in_stiffness(A=entry(0, 2, -1.0)), {"resultants": ("ε_x", "γ_xy")},
    ),
    "sign of D16 in the stiffness": (
        in_stiffness(D=entry(0, 2, -1.0)), {"resultants": ("κ_x ", "κ_xy")},
    ),
    "sign of A*45 in the stiffness": (
        in_stiffness(shear=entry(0, 1, -1.0)), {"resultants": ("γ_xz", "γ_yz", "Q")},
    ),
    "a billionth of the internal force missing in the steps": (
        in_numpy(changed(ElementProduct, "_sum", lambda force: (1.0 - 1e-9) * force)),
        {"internal-force": ("largest",)},
    ),
    "xz taken for yz in the stiffness": (
        in_stiffness(shear=lambda shear: shear[::-1, ::-1]), {"resultants": ("γ_xz", "γ_yz", "Q")},
    ),
    "membrane stiffness doubled": (
        in_stiffness(A=lambda A: 2.0 * A),
        {"resultants": ("ε", "γ_xy", "N"), "cross-ply-plate": ("ω11", "w", "u")},
    ),
    "SHEA ignored": (
        instead(parts, "laminates_of_deck", without_shea), {"resultants": ("γ_xz", "γ_yz")},
    ),
    "geometric stiffness doubled": (
        changed(element_matrices, "geometric_stiffness", doubled),
        {"preload": ("buckling", "ω", "w")},
    ),
    "N_x and N_y exchanged in the geometric stiffness": (
        instead(element_matrices, "geometric_stiffness", exchanged_forces),
        {"preload": ("buckling load N_y", "ω13")},
    ),
    "preload missing in the membrane forces": (
        instead(strains, "strains_and_resultants", without_preload), {"preload": ("N_",)},
    ),
    "preload missing in the plies": (
        changed(PlateModel, "preload_strain", nothing), {"preload": ("σ",)},
    ),
    "sign of the rotation in the stiffness of transverse shear": (
        changed(element_matrices, "_transverse_shear", rotations_reversed),
        {"patch": ("κ", "γ_xz", "M_x")},
    ),
    "sign of the rotation in the strain of transverse shear": (
        in_numpy(in_strains(4, 3)), {"patch": ("γ_xz",), "tape8": ("γ_xz",)},
    ),
    "sign of theta_y,x in the twist": (
        in_numpy(in_strains(2, 4)), {"patch": ("γ_xy", "κ_xy"), "tape8": ("κ_xy",)},
    ),
    "strains of x and y exchanged on tape8": (
        instead(Recorder, "rows", exchanged_on_tape8),
        {"tape8": ("κ_x ", "κ_y ", "γ_yz", "γ_xz")},
    ),
    "Jacobian transposed": (
        instead(interpolation, "inverse_jacobian",
                lambda right, *args, **other: right(
                    *args, transposed_jacobian=not other.get("transposed_jacobian", False))),
        {"patch": ("ε_x", "ε_y", "γ_xy", "κ_x", "κ_y", "κ_xy", "γ_xz", "M_x")},
    ),
    "coupling of stretching to couples forgotten": (
        without_coupling("M"), {"patch": ("M_x",), "resultants": ("M",)},
    ),
    "coupling of bending to forces forgotten": (without_coupling("N"), {"resultants": ("N",)}),
    "transverse forces doubled": (
        changed(strains, "strains_and_resultants", resultants(Q_x=2.0, Q_y=2.0)),
        {"resultants": ("Q_x", "Q_y")},
    ),
    "transverse forces exchanged": (
        changed(strains, "strains_and_resultants",
                lambda found: found | {"Q_x": found["Q_y"], "Q_y": found["Q_x"]}),
        {"resultants": ("Q_x", "Q_y")},
    ),
    "a gage on the other face": (
        instead(points, "_functional",
                lambda right, f, gage, *rest: right(f, replace(gage, z=-gage.z), *rest)),
        {"forced-plate": ("strain",)},
    ),
    "a gage turned the other way": (
        instead(points, "_functional",
                lambda right, f, gage, *rest: right(
                    f, replace(gage, direction=-gage.direction), *rest)),
        {"forced-plate": ("strain",)},
    ),
    "the exponent of PROP ignored": (
        instead(deck_macros, "load_factor",
                lambda right, table, clock: right(replace(table, exponent=1), clock)),
        {"forced-plate": ("w", "strain")},
    ),
    "half of the load in EXCD": (
        instead(PlateMotion, "central_difference",
                lambda right, motion, state, dt, factor: right(motion, state, dt, factor / 2.0)),
        {"forced-plate": ("w", "strain")},
    ),
    "equal shares of the lumped mass": (
        instead(element_matrices, "lumped_mass", equal_shares),
        {"frequencies": ("ω11, lumped", "ω13, lumped"), "time-step": ("w", "θ_x")},
    ),
    "rotary inertia taken for mass in the consistent matrix": (
        instead(element_matrices, "consistent_mass", rotary_for_mass),
        {"frequencies": ("ω11, cons", "ω33, cons")},
    ),
}  # fmt: skip
