"""Laminates broken on purpose."""

from __future__ import annotations

from dataclasses import replace

from fecm.mechanics import laminate as laminates
from tests.breaks import (
    Breaks,
    changed,
    entry,
    in_laminate,
    instead,
    moved_midplane,
    of_q16,
    plane_stress_of_strain,
)

BREAKS: Breaks = {
    "Poisson's ratio forgotten in Q": (
        instead(laminates, "reduced_stiffness", plane_stress_of_strain),
        {
            "isotropic-ply": ("A11", "A12", "A66", "A16", "D11", "D12", "D66"),
            "cross-ply": ("A11", "A12", "B11", "B22", "D11"),
            "angle-ply": ("A11", "A12", "A66", "B16", "D11", "D66"),
            "wave-fronts": ("extension, 0", "in-plane", "bending", "twisting", "extension, 45"),
            "dispersion": ("ω, wavelength 10",),
            "static-bending": ("w",), "large-mass": ("stiffness",),
        },
    ),
    "half of G12": (
        changed(laminates, "reduced_stiffness", entry(2, 2, 0.5)),
        {
            "cross-ply": ("A66", "D66"), "wave-fronts": ("its ray", "in-plane", "twisting"),
            "angle-ply": ("A11", "A12", "D11"),
        },
    ),
    "sign of Q16's second part": (
        instead(laminates, "transformed_stiffness", of_q16), {"angle-ply": ("B16",)},
    ),
    "-45 taken for +45": (
        instead(laminates, "transformed_stiffness", lambda right, q, angle: right(q, abs(angle))),
        {"angle-ply": ("A16", "B16"), "angle-ply-plate": ("ω",)},
    ),
    "midplane not in the middle": (
        changed(laminates, "laminate", moved_midplane),
        {
            "isotropic-ply": ("A16", "D11", "D12", "D66"), "cross-ply": ("B11", "B22", "D66"),
            "angle-ply": ("B11", "D11", "D66"),
        },
    ),
    "factor 1/2 dropped in B": (
        in_laminate(B=lambda B: 2.0 * B),
        {
            "cross-ply": ("B11", "B22"), "angle-ply": ("B16",), "patch": ("M_x",),
            "cross-ply-plate": ("ω", "w", "u"), "angle-ply-plate": ("ω", "w", "u"),
            "resultants": ("ε", "γ_xy", "κ"),
        },
    ),
    "layers stacked from the other face": (
        instead(laminates, "laminate",
                lambda right, ply, angles, *rest: right(ply, angles[::-1], *rest)),
        {"cross-ply": ("B11", "B22"), "angle-ply": ("B16",), "patch": ("M_x",)},
    ),
    "D with 1/2 for 1/3": (
        in_laminate(D=lambda D: 1.5 * D),
        {
            "isotropic-ply": ("D11", "D12", "D66"), "cross-ply": ("D11", "D66"),
            "angle-ply": ("D11", "D66"), "patch": ("M_x",), "static-bending": ("w",),
            "frequencies": ("ω11", "ω13", "ω33"), "time-step": ("θ_x",),
            "wave-fronts": ("bending", "twisting"), "dispersion": ("ω, wavelength",),
            "cross-ply-plate": ("ω", "w"), "angle-ply-plate": ("ω", "w"),
            "forced-plate": ("w", "strain"), "supported-plate": ("",),
            "stretching-impact": ("largest",),
        },
    ),
    "a shear correction of 5/6": (
        in_laminate(shear=lambda shear: shear * 5.0 / 6.0),
        {
            "isotropic-ply": ("A*55",), "cross-ply": ("A*55",), "angle-ply": ("A*45",),
            "static-bending": ("w at", "w in the middle, κ", "w in the middle, L2"),
            "resultants": ("γ_xz", "γ_yz"),
            "frequencies": ("ω11", "ω13", "ω33", "cut-off"),
            "time-step": ("w", "θ_x"), "wave-fronts": ("transverse",),
            "dispersion": ("ω, wavelength", "cut-off"),
            "cross-ply-plate": ("ω", "w"), "angle-ply-plate": ("ω", "w"),
        },
    ),
    "sign of A*45, the report's own misprint": (
        changed(laminates, "transformed_shear", entry(0, 1, -1.0)),
        {"angle-ply": ("A*45",), "resultants": ("γ_xz", "γ_yz")},
    ),
    "mass without the thickness": (
        changed(laminates, "laminate", lambda made: replace(made, mass=made.mass / made.thickness)),
        {"isotropic-ply": ("mass",), "frequencies": ("ω11", "ω13", "ω33"),
         "wave-fronts": ("extension", "in-plane", "transverse")},
    ),
    "rotary inertia ten times too small": (
        in_laminate(rotary_inertia=lambda inertia: inertia / 10.0),
        {
            "isotropic-ply": ("rotary",), "frequencies": ("ω11", "ω13", "ω33", "cut-off"),
            "time-step": ("θ_x",), "wave-fronts": ("bending", "twisting"),
            "dispersion": ("ω, wavelength", "cut-off"), "cross-ply-plate": ("ω",),
        },
    ),
}  # fmt: skip
