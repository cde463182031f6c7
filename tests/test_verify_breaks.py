"""Physics broken on purpose, and the rows of ``fecm verify`` that have to see it."""

from __future__ import annotations
import __future__

import inspect
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import fecm
from fecm import laminate as laminates
from fecm import plate, projectile, rod, stresses
from fecm.impact import Impact, meet
from fecm.indentation import Constants, MemoryLaw
from fecm.sweeps.responses import Convolution
from fecm.verification import CASES, INDEPENDENT, carry_out, chosen
from fecm.waves.fronts import Fronts
from fecm.waves.medium import Medium

Break = Callable[[pytest.MonkeyPatch], None]


def mutate(function: Any, old: str, new: str) -> Break:
    """Make a function compute something else: another text in the place of one in its source."""
    function = getattr(function, "fget", function)  # of a property

    def apply(monkeypatch: pytest.MonkeyPatch) -> None:
        source = textwrap.dedent(inspect.getsource(function))
        assert source.count(old) == 1, f"`{old}` stands {source.count(old)} times"
        source = source.replace("@property\n", "").replace(old, new)
        space: dict[str, Any] = {}
        flags = __future__.annotations.compiler_flag
        exec(compile(source, "<broken>", "exec", flags), function.__globals__, space)
        (broken,) = space.values()
        monkeypatch.setattr(function, "__code__", broken.__code__)

    return apply


def value(owner: Any, name: str, new: object) -> Break:
    """Make a constant another one."""
    return lambda monkeypatch: monkeypatch.setattr(owner, name, new)


LAMINATE = laminates.laminate
STRAINS = plate.StrainField.evaluate
TURNED = MemoryLaw._turned

# What is broken, how, and the rows that have to see it: a case, and the beginnings of quantities.
BREAKS: dict[str, tuple[Break, dict[str, tuple[str, ...]]]] = {
    "Poisson's ratio forgotten in Q": (
        mutate(laminates.reduced_stiffness, "full = 1.0 - nu12**2 * e2 / e1", "full = 1.0"),
        {
            "isotropic-ply": ("A11", "A12", "A66", "A16", "D11", "D12", "D66"),
            "cross-ply": ("A11", "A12", "B11", "B22", "D11"),
            "angle-ply": ("A11", "A12", "A66", "B16", "D11", "D66"),
            "wave-fronts": ("extension, 0", "in-plane", "bending", "twisting", "extension, 45"),
            "dispersion": ("ω, wavelength 10",),
            "static-bending": ("w",),
        },
    ),
    "half of G12": (
        mutate(laminates.reduced_stiffness, "0.0, ply.g12]", "0.0, ply.g12 / 2.0]"),
        {
            "cross-ply": ("A66", "D66"), "wave-fronts": ("its ray", "in-plane", "twisting"),
            "angle-ply": ("A11", "A12", "D11"),
        },
    ),
    "sign of Q16's second part": (
        mutate(laminates.transformed_stiffness, "a * m**3 * n + b * m * n**3",
               "a * m**3 * n - b * m * n**3"),
        {"angle-ply": ("B16",)},
    ),
    "-45 taken for +45": (
        mutate(laminates.transformed_stiffness, "np.sin(np.deg2rad(angle))",
               "np.sin(np.deg2rad(abs(angle)))"),
        {"angle-ply": ("A16", "B16")},
    ),
    "midplane not in the middle": (
        mutate(LAMINATE, "faces -= faces[-1] / 2.0", "faces -= faces[-1] / 3.0"),
        {
            "isotropic-ply": ("A16", "D11", "D12", "D66"), "cross-ply": ("B11", "B22", "D66"),
            "angle-ply": ("B11", "D11", "D66"),
        },
    ),
    "factor 1/2 dropped in B": (
        mutate(LAMINATE, ".sum(axis=0) / 2.0", ".sum(axis=0)"),
        {"cross-ply": ("B11", "B22"), "angle-ply": ("B16",), "patch": ("M_x",)},
    ),
    "layers stacked from the other face": (
        mutate(LAMINATE, "angle) for angle in angles])\n    shears",
               "angle) for angle in angles[::-1]])\n    shears"),
        {"cross-ply": ("B11", "B22"), "angle-ply": ("B16",), "patch": ("M_x",)},
    ),
    "D with 1/2 for 1/3": (
        mutate(LAMINATE, ".sum(axis=0) / 3.0", ".sum(axis=0) / 2.0"),
        {
            "isotropic-ply": ("D11", "D12", "D66"), "cross-ply": ("D11", "D66"),
            "angle-ply": ("D11", "D66"), "patch": ("M_x",), "static-bending": ("w",),
            "frequencies": ("ω11", "ω13", "ω33"), "time-step": ("θ_x",),
            "wave-fronts": ("bending", "twisting"), "dispersion": ("ω, wavelength",),
        },
    ),
    "a shear correction of 5/6": (
        mutate(LAMINATE, "shear=(shears * (upper - lower)).sum(axis=0)",
               "shear=(shears * (upper - lower)).sum(axis=0) * 5.0 / 6.0"),
        {
            "isotropic-ply": ("A*55",), "cross-ply": ("A*55",), "angle-ply": ("A*45",),
            "static-bending": ("w",), "frequencies": ("ω11", "ω13", "ω33", "cut-off"),
            "time-step": ("w", "θ_x"), "wave-fronts": ("transverse",),
            "dispersion": ("ω, wavelength", "cut-off"),
        },
    ),
    "sign of A*45, the report's own misprint": (
        mutate(laminates.transformed_shear, "(g13 - g23)", "(g23 - g13)"),
        {"angle-ply": ("A*45",)},
    ),
    "mass without the thickness": (
        mutate(LAMINATE, "mass=ply.density * h,", "mass=ply.density,"),
        {"isotropic-ply": ("mass",), "frequencies": ("ω11", "ω13", "ω33"),
         "wave-fronts": ("extension", "in-plane", "transverse"), "infinite-plate": ("",)},
    ),
    "rotary inertia ten times too small": (
        mutate(LAMINATE, "rotary_inertia=ply.density * h**3 / 12.0",
               "rotary_inertia=ply.density * h**3 / 120.0"),
        {
            "isotropic-ply": ("rotary",), "frequencies": ("ω11", "ω13", "ω33", "cut-off"),
            "time-step": ("θ_x",), "wave-fronts": ("bending", "twisting"),
            "dispersion": ("ω, wavelength", "cut-off"),
        },
    ),
    "sign of the rotation in the stiffness of transverse shear": (
        mutate(plate._transverse_shear, "= -at.N", "= at.N"),
        {"patch": ("κ", "γ_xz", "M_x")},
    ),
    "sign of the rotation in the strain of transverse shear": (
        mutate(STRAINS, "dx[:, :, 0] - values[:, :, 1]", "dx[:, :, 0] + values[:, :, 1]"),
        {"patch": ("γ_xz",)},
    ),
    "sign of theta_x,y in the twist": (
        mutate(STRAINS, "0.0 - dy[:, :, 1] - dx[:, :, 2]", "0.0 - dy[:, :, 1] + dx[:, :, 2]"),
        {"patch": ("γ_xy", "κ_xy")},
    ),
    "Jacobian transposed": (
        mutate(plate.inverse_jacobian, "if transposed:", "if not transposed:"),
        {"patch": ("ε_x", "ε_y", "γ_xy", "κ_x", "κ_y", "κ_xy", "γ_xz", "M_x")},
    ),
    "coupling of stretching to couples forgotten": (
        mutate(stresses.strains_and_resultants, "M = np.tensordot(laminate.B, membrane, 1) + ",
               "M = "),
        {"patch": ("M_x",)},
    ),
    "equal shares of the lumped mass": (
        mutate(plate.lumped_mass, "values**2", "values**0"),
        {"frequencies": ("ω11, lumped", "ω13, lumped"), "time-step": ("w", "θ_x")},
    ),
    "rotary inertia taken for mass in the consistent matrix": (
        mutate(plate.consistent_mass, "(3, 2))", "(2, 3))"),
        {"frequencies": ("ω11, cons", "ω33, cons")},
    ),
    "normal velocity's slope forgotten in the ray": (
        mutate(Fronts.ray, "c * sin + s * cos", "c * sin"), {"wave-fronts": ("its ray",)},
    ),
    "rotary inertia of one direction doubled": (
        mutate(Medium.inertia, "[p, p, i, i, p]", "[p, p, 2.0 * i, i, p]"),
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
        mutate(projectile.Rod.lumped_mass, "[0.5,", "[0.25,"),
        {"rod-pulse": ("the same", "velocity"),
         "rod-waves": ("wave", "first free frequency, lumped")},
    ),
    "consistent mass with 140 for 156": (
        mutate(projectile.Rod.consistent_mass, "[156.0, 22.0", "[140.0, 22.0"),
        {"rod-waves": ("first free frequency, cons",)},
    ),
    "the density that is misread in the listing": (
        value(projectile.report_rod, "__defaults__", (projectile.LISTING_DENSITY,)),
        {"rod-pulse": ("mass",)},
    ),
    "force of the wrong station": (
        mutate(rod.force_row, "3.0 * s**2 - 2.0 * s,", "3.0 * s**2 - 2.1 * s - 0.01,"),
        {"rod-pulse": ("largest", "the same", "mean")},
    ),
    "k a^1.4": (
        value(fecm.indentation, "LOADING_POWER", 1.4),
        {
            "indentation": ("F(α_p)", "F at the peak", "F halfway down", "F back", "F halfway up",
                            "work"),
            "rigid-target": ("deepest", "largest", "contact"), "infinite-plate": ("",),
        },
    ),
    "permanent indentation halved": (
        mutate(Constants.permanent, "self.s_p * (peak", "0.5 * self.s_p * (peak"),
        {"indentation": ("F halfway down", "F at α₀", "work")},
    ),
    "unloading from nine tenths of the force": (
        mutate(TURNED, "begin = _select(leaves, peak_force",
               "begin = _select(leaves, 0.9 * peak_force"),
        {"indentation": ("jump of F where unloading", "F halfway down", "work"),
         "rigid-target": ("velocity",)},
    ),
    "reloading always from the permanent indentation": (
        mutate(MemoryLaw._reloading, "(last.force > 0.0) & (last.force < m.peak_force)",
               "last.force > 1e300"),
        {"indentation": ("jump of F where reloading",)},
    ),
    "reloading to nine tenths of the peak": (
        mutate(MemoryLaw._reloading, "RELOADING, _select(width > 0.0, m.peak_force",
               "RELOADING, _select(width > 0.0, 0.9 * m.peak_force"),
        {"indentation": ("F halfway up",)},
    ),
    "the first curve goes on at nine tenths": (
        mutate(TURNED, "Memory(VIRGIN, c.k,", "Memory(VIRGIN, 0.9 * c.k,"),
        {"indentation": ("F back",)},
    ),
    "a steeper unloading": (
        mutate(TURNED, "_select(width > 0.0, width, 1.0), c.q,",
               "_select(width > 0.0, width, 1.0), c.q + 0.1,"),
        {"indentation": ("F halfway down", "work"), "rigid-target": ("velocity", "contact")},
    ),
    "a plate that does not move": (
        mutate(Impact.move_projectile, "if self.contact.plate_moves else", "if False else"),
        {"infinite-plate": ("",), "report-impact": ("worst",)},
    ),
    "action without equal reaction": (
        mutate(Impact.point_force, "self.contact.share * given", "1.01 * given"),
        {"report-impact": ("worst",)},
    ),
    "work of the new force alone": (
        mutate(meet, "(last.force + force) / 2.0", "force"), {"report-impact": ("worst",)},
    ),
    "half of the last step's force in the convolution": (
        mutate(Convolution.give, "self._near[:left] * values", "0.5 * self._near[:left] * values"),
        {"convolution": ("largest",)},
    ),
}  # fmt: skip


def seen() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Each break with each case that has to see it."""
    for name, (_, cases) in BREAKS.items():
        for case, quantities in cases.items():
            yield name, case, quantities


@pytest.mark.parametrize(
    ("name", "case", "quantities"),
    [pytest.param(*one, id=f"{one[0]} is seen by {one[1]}") for one in seen()],
)
def test_broken_physics_is_seen(
    name: str, case: str, quantities: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    BREAKS[name][0](monkeypatch)
    (one,) = chosen([case])
    with np.errstate(all="ignore"):
        found = carry_out(one)
    for beginning in quantities:
        rows = [row for row in found if row.check.quantity.startswith(beginning)]
        rows = [row for row in rows if row.check.label == INDEPENDENT]
        assert rows, f"no quantity of {case} begins with {beginning}"
        assert not [row.check.quantity for row in rows if row.within]


def test_every_independent_row_has_a_break_that_it_sees() -> None:
    rows = {(one.name, c.quantity) for one in CASES for c in one.checks if c.label == INDEPENDENT}
    covered = {
        (case, quantity)
        for _, case, beginnings in seen()
        for (own, quantity) in rows
        if own == case and quantity.startswith(beginnings)
    }
    assert sorted(rows - covered) == []
