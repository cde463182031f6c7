"""Physics broken on purpose, and the rows of ``fecm verify`` that have to see it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.deck import records
from fecm.mechanics import (
    assumed_shear,
    element_matrices,
    failure,
    half_space,
    interpolation,
    ply_stresses,
    points,
    projectile,
    strains,
)
from fecm.mechanics import impact as impacts
from fecm.mechanics import laminate as laminates
from fecm.mechanics.contact_law import (
    UNLOADING,
    VIRGIN,
    HystereticLaw,
    LinearPermanent,
    YangSunPermanent,
)
from fecm.mechanics.impact import ImpactSystem
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.ply_stresses import FailureMonitor
from fecm.mechanics.stiffness_product import ElementProduct
from fecm.problem import build
from fecm.simulation.recorder import Recorder
from fecm.studies import estimate
from fecm.studies.rod_test import pulse_test
from fecm.studies.waves import Fronts, Medium
from fecm.sweeps import cases, convergence, fitting, random_result
from fecm.sweeps.responses import Convolution
from fecm.verification import CASES, carry_out, chosen
from tests.breaks import (
    Break,
    bent_with_stretching_held,
    changed,
    doubled,
    entry,
    equal_shares,
    exchanged_matrices,
    exchanged_on_tape8,
    halved,
    in_laminate,
    in_plate_axes,
    in_stiffness,
    in_strains,
    instead,
    lighter_begin,
    mirrored,
    moved_midplane,
    negative,
    nothing,
    of_q16,
    of_the_first,
    of_the_last,
    other_power,
    partly_given,
    plane_stress_of_strain,
    quarter_of_mass,
    ray_without_slope,
    resultants,
    rotary_for_mass,
    rotations_reversed,
    standing_plate,
    turned,
    value,
    without_coupling,
    without_q26,
    without_shea,
    without_shear_stress,
    work_of_the_new_force,
)

# What is broken, how, and the rows that have to see it: a case, and the beginnings of quantities.
BREAKS: dict[str, tuple[Break, dict[str, tuple[str, ...]]]] = {
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
        changed(ElementProduct, "_sum", lambda force: (1.0 - 1e-9) * force),
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
        instead(build, "laminate_of_deck", without_shea), {"resultants": ("γ_xz", "γ_yz")},
    ),
    "sign of the rotation in the stiffness of transverse shear": (
        changed(element_matrices, "_transverse_shear", rotations_reversed),
        {"patch": ("κ", "γ_xz", "M_x")},
    ),
    "sign of the rotation in the strain of transverse shear": (
        in_strains(4, 3), {"patch": ("γ_xz",), "tape8": ("γ_xz",)},
    ),
    "sign of theta_y,x in the twist": (
        in_strains(2, 4), {"patch": ("γ_xy", "κ_xy"), "tape8": ("κ_xy",)},
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
                lambda right, f, gage, t: right(f, replace(gage, z=-gage.z), t)),
        {"forced-plate": ("strain",)},
    ),
    "a gage turned the other way": (
        instead(points, "_functional",
                lambda right, f, gage, t: right(f, replace(gage, direction=-gage.direction), t)),
        {"forced-plate": ("strain",)},
    ),
    "the exponent of PROP ignored": (
        instead(records, "load_factor",
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
    "normal velocity's slope forgotten in the ray": (
        instead(Fronts, "ray", ray_without_slope), {"wave-fronts": ("its ray",)},
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
        value(projectile.report_rod, "__defaults__", (projectile.LISTING_DENSITY,)),
        {"rod-pulse": ("mass",)},
    ),
    "force of the wrong station": (
        instead(pulse_test, "force_row", lambda right, bar, x: right(bar, x - 0.05 * bar.length)),
        {"rod-pulse": ("largest", "the same", "mean")},
    ),
    "k a^1.4": (
        value(fecm.mechanics.contact_law, "LOADING_POWER", 1.4),
        {
            "indentation": ("F(α_p)", "F at the peak", "F halfway down", "F back", "F halfway up",
                            "work", "ACR: F at the peak"),
            "rigid-target": ("deepest", "largest", "contact", "ACR"), "supported-plate": ("",),
            "small-mass": ("largest force of",),
        },
    ),
    "permanent indentation halved": (
        changed(LinearPermanent, "permanent", halved),
        {"indentation": ("F halfway down", "F at α₀", "work")},
    ),
    "permanent indentation of ACR halved": (
        changed(YangSunPermanent, "permanent", halved),
        {"indentation": ("ACR: F halfway", "ACR: F at α₀"),
         "rigid-target": ("ACR: contact", "ACR: velocity")},
    ),
    "the unloading power of ACR 2 for 5/2": (
        instead(YangSunPermanent, "__init__", other_power), {"indentation": ("ACR: F halfway",)},
    ),
    "unloading from nine tenths of the force": (
        turned(lambda before, after: bool(before.branch == VIRGIN), f=0.9),
        {"indentation": ("jump of F where unloading", "F halfway down", "work"),
         "rigid-target": ("velocity",)},
    ),
    "reloading always from the permanent indentation": (
        instead(HystereticLaw, "_reloading",
                lambda right, law, m, last: right(law, m, last._replace(force=0.0))),
        {"indentation": ("jump of F where reloading",)},
    ),
    "reloading to nine tenths of the peak": (
        changed(HystereticLaw, "_reloading", lambda curve: curve._replace(f=0.9 * curve.f)),
        {"indentation": ("F halfway up",)},
    ),
    "the first curve goes on at nine tenths": (
        turned(lambda before, after: bool(after.branch == VIRGIN), f=0.9),
        {"indentation": ("F back",)},
    ),
    "a steeper unloading": (
        turned(lambda before, after: bool(after.branch == UNLOADING), p=1.05),
        {"indentation": ("F halfway down", "work"), "rigid-target": ("velocity", "contact")},
    ),
    "a plate that does not move": (
        instead(ImpactSystem, "__init__", standing_plate),
        {"infinite-plate": ("",), "supported-plate": ("largest force",),
         "report-impact": ("worst",)},
    ),
    "action without equal reaction": (
        changed(ImpactSystem, "applied", lambda p: p._replace(force=1.01 * p.force)),
        {"report-impact": ("worst",)},
    ),
    "work of the new force alone": (
        instead(impacts, "couple_step", work_of_the_new_force), {"report-impact": ("worst",)},
    ),
    "a patch of half the radius": (
        instead(points, "patch_weights",
                lambda right, mesh, shape, c, *place: right(mesh, shape, c / 2.0, *place)),
        {"patch-compliance": ("W",), "patch-impact": ("largest", "its time")},
    ),
    "Hertz's pressure taken for a uniform one": (
        instead(points, "patch_weights",
                lambda right, mesh, shape, *circle: right(mesh, points.DISC, *circle)),
        {"patch-compliance": ("W, Hertz",)},
    ),
    "MITC ignored": (
        changed(build, "has_assumed_shear", lambda found: False), {"assumed-shear": ("w",)},
    ),
    "tying points on the sides of the element": (
        value(assumed_shear, "TYING", {9: (assumed_shear.TYING[9][0], (-1.0, 0.0, 1.0), 3)}),
        {"assumed-shear": ("γ_yz",)},
    ),
    "half of DAMP": (
        instead(PlateMotion, "__init__", lambda right, *a: right(*a[:-1], a[-1] / 2.0)),
        {"free-plate": ("",)},
    ),
    "D for 12 D in the delamination threshold": (
        changed(laminates, "threshold_force", lambda force: force / 12.0**0.5),
        {"threshold": ("",)},
    ),
    "Olsson's D* in the delamination threshold": (
        instead(laminates, "_agm", lambda right, a, b: (a * b) ** 0.5),
        {"threshold": ("the report", "the same")},
    ),
    "a tenth of the plate's inertia missing in Zener's parameter": (
        instead(estimate, "infinite_plate", lambda right, *a: right(*a[:-1], a[-1] / 0.9**0.5)),
        {"small-mass": ("F T", "t_peak")},
    ),
    "4 for 8 in Zener's parameter": (
        changed(estimate, "inelasticity", doubled),
        {"small-mass": ("λ", "largest force on")},
    ),
    "nine tenths of the plate's stiffness": (
        instead(estimate, "static_plate", lambda right, *a: right(*a[:-1], 0.9 * a[-1])),
        {"large-mass": ("largest",)},
    ),
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
        changed(failure, "interlaminar", of_the_first),
        {"failure-states": ("interlaminar shear, -45",)},
    ),
    "interlaminar failure of the ply below alone": (
        changed(failure, "interlaminar", of_the_last),
        {"failure-states": ("interlaminar shear, 30",)},
    ),
    "failure without the shear stress": (
        without_shear_stress,
        {"failure-states": ("maximum stress, 90", "Tsai and Wu", "Hashin, 30", "Hashin, -45",
                            "Hashin, 90", "Puck, -45", "Puck, 90")},
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
        {"ply-stresses": ("σ2",), "failure": ("",)},
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
    "a millionth of a step's force missing in the convolution": (
        instead(Convolution, "give", partly_given), {"convolution": ("largest",)},
    ),
    "the matrices A and B exchanged": (
        instead(cases, "matrix", exchanged_matrices), {"random-values": ("first", "total")},
    ),
    "the median of a lognormal law taken for its mean": (
        instead(cases.Law, "values",
                lambda right, law, unit: right(law, unit) * np.exp(-law.parameters[1] ** 2 / 2.0)),
        {"random-values": ("mean", "its")},
    ),
    "an interval of 90 %": (
        value(random_result, "Z", 1.6448536), {"random-values": ("lower", "upper")},
    ),
    "meshes in the opposite order": (
        instead(convergence, "_limit", lambda right, values, order: right(values[::-1], order)),
        {"refinement": ("",)},
    ),
    "the computed force 1 % too large": (
        changed(fitting.Model, "at", lambda force: 1.01 * force), {"identification": ("",)},
    ),
    "E3 taken for the indentation modulus": (
        instead(half_space, "indentation_modulus", lambda _, C: 1.0 / np.linalg.inv(C)[2, 2]),
        {"contact-coefficient": ("",)},
    ),
}  # fmt: skip


# The program's own errors of a motion that cannot be.
REFUSALS = ("DivergenceError", "PlyError", "StudyError")
ROWS = {(one.name, c.quantity) for one in CASES for c in one.checks if c.label != "against change"}


def seen() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Each break with each case that has to see it."""
    for name, (_, seen_by) in BREAKS.items():
        for case, quantities in seen_by.items():
            yield name, case, quantities


def rows_of(case: str, beginnings: tuple[str, ...]) -> set[tuple[str, str]]:
    """Rows of a case whose quantities begin with one of these."""
    return {row for row in ROWS if row[0] == case and row[1].startswith(beginnings)}


def parameters() -> Iterator[Any]:
    """Those of the default run: a case of every break, and a break of every row."""
    names, rows = set[str](), set[tuple[str, str]]()
    for name, case, quantities in seen():
        new = rows_of(case, quantities) - rows
        marks = () if new or name not in names else pytest.mark.long
        yield pytest.param(name, case, quantities, marks=marks, id=f"{name} is seen by {case}")
        names, rows = names | {name}, rows | new


@pytest.mark.parametrize(("name", "case", "quantities"), list(parameters()))
def test_broken_physics_is_seen(
    name: str, case: str, quantities: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fecm.mechanics.kernels.LIBRARY", None)  # NumPy is what is broken
    BREAKS[name][0](monkeypatch)
    (one,) = chosen([case])
    with np.errstate(all="ignore"):
        found = carry_out(one)
    for beginning in quantities:
        rows = [row for row in found if row.check.quantity.startswith(beginning)]
        assert rows, f"no quantity of {case} begins with {beginning}"
        assert not [row.check.quantity for row in rows if row.within]
        # A break that raises an error of Python's is broken itself.
        assert {row.failure.partition(":")[0] for row in rows} <= {"", *REFUSALS}


def test_every_row_that_can_be_wrong_has_a_break_that_it_sees() -> None:
    assert set().union(*(rows_of(case, quantities) for _, case, quantities in seen())) == ROWS
