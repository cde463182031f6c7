"""``fecm verify``: its figures, its output, and what its rows see when physics is broken."""

from __future__ import annotations
import __future__

import inspect
import json
import math
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fecm
from fecm import laminate as laminates
from fecm import plate, projectile, rod, stresses
from fecm.deck.model import Deck, Material
from fecm.impact import Impact, meet
from fecm.indentation import Constants, MemoryLaw
from fecm.mesh import generate
from fecm.sweeps.responses import Convolution
from fecm.verification import CASES, INDEPENDENT, carry_out, chosen, table
from fecm.verification.case import Case, Check, Row
from fecm.verification.decks import report_impact
from fecm.waves.fronts import Fronts
from fecm.waves.medium import Medium
from tests.builders import table as reference
from tests.calls import assert_unusable, call
from tests.decks import LONG, ROOT

PAGE = ROOT / "docs" / "verification.md"


def check_of(case: str, quantity: str) -> Check:
    """A check by its case and the beginning of its quantity."""
    (one,) = chosen([case])
    (found,) = [check for check in one.checks if check.quantity.startswith(quantity)]
    return found


# Output ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    """Every row, computed once."""
    return [row for one in CASES for row in carry_out(one)]


def test_every_row_is_within_its_tolerance(rows: list[Row]) -> None:
    assert [(r.case, r.check.quantity, r.error, r.failure) for r in rows if not r.within] == []


def test_the_page_is_made_from_the_cases(rows: list[Row]) -> None:
    def fixed(text: str) -> list[list[str]]:
        # Everything but the cells that differ between machines.
        lines = [line.split(" | ") for line in text.splitlines()]
        return [cells[:3] + cells[5:] if len(cells) == 8 else cells for cells in lines]

    assert fixed(PAGE.read_text()) == fixed(table.page(rows))
    assert "**" not in PAGE.read_text().partition("## ")[2]  # no row of it has failed


def test_some_cases_are_computed_and_told_in_a_table() -> None:
    done = call("verify", "time-step", "cross-ply")
    assert done.exit_code == 0
    assert done.stderr == ""
    head, *body, last = done.stdout.splitlines()
    assert head.split() == list(table.HEAD)
    assert [line.split()[0] for line in body] == ["cross-ply"] * 8 + ["time-step"] * 2
    assert all(line.endswith("independent  ok") for line in body)
    assert {line.index("independent") for line in body} == {head.index("label")}
    assert last == "10 rows, all within tolerance"


def test_programs_get_every_number_and_what_could_not_be_computed_is_null(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done = call("verify", "indentation", "--format", "json")
    told = json.loads(done.stdout)
    assert (done.exit_code, told["ok"], len(told["rows"])) == (0, True, 9)
    first = told["rows"][0]
    assert first["expected"] == 22.4
    assert first["error"] == pytest.approx(first["got"] / 22.4 - 1.0)
    monkeypatch.setattr(Constants, "loading", None)
    done = call("verify", "indentation", "--format", "json")
    told = json.loads(done.stdout)
    assert (done.exit_code, told["ok"], told["rows"][0]["got"]) == (1, False, None)
    assert told["rows"][0]["failure"].startswith("TypeError: ")


def test_a_row_beyond_its_tolerance_is_told_and_the_answer_is_no(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mutate(laminates.transformed_shear, "g13 * m**2 +", "2.0 * g13 * m**2 +")(monkeypatch)
    done = call("verify", "cross-ply", "angle-ply")
    assert done.exit_code == 1
    assert [line.split()[-1] for line in done.stdout.splitlines()].count("FAILED") == 1
    assert done.stderr == "fecm: error: 1 of 17 rows is beyond tolerance\n"


def test_a_case_that_can_not_be_computed_says_why_and_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(plate, "stiffness", lambda *_, **__: 1 / 0)
    done = call("verify", "static-bending")
    assert done.exit_code == 1
    assert "\n  ZeroDivisionError: division by zero\n" in done.stdout
    assert done.stderr == "fecm: error: 4 of 4 rows are beyond tolerance\n"
    assert "Traceback" not in done.stdout


def test_a_list_names_the_cases_without_computing_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fecm.verification.carry_out", None)
    done = call("verify", "--list")
    assert [line.split()[0] for line in done.stdout.splitlines()] == [one.name for one in CASES]
    told = json.loads(call("verify", "--list", "patch", "--format", "json").stdout)
    assert [(one["case"], one["rows"]) for one in told["cases"]] == [("patch", 8)]


def test_what_can_not_be_meant_is_refused() -> None:
    done = call("verify", "patches")
    assert_unusable(done)
    assert "no case patches; there are isotropic-ply, cross-ply" in done.stderr
    for options in (("--list",), ("--format", "json")):
        assert_unusable(call("verify", "--markdown", *options))


def test_numbers_that_are_missing_or_not_finite_are_never_within() -> None:
    check = Check("x", 1.0, "nowhere", 0.1, "")
    for given in ([], [math.nan], [math.inf], [1.0, 1.0]):
        (row,) = carry_out(Case("made", "", (check,), lambda given=given: given))  # type: ignore[misc]
        assert not row.within
        assert table.cells(row)[-1] == "FAILED"


# Figures -----------------------------------------------------------------------------------------


def test_the_deck_made_in_python_is_the_reports() -> None:
    made, given = report_impact(), fecm.read_deck(LONG)
    assert isinstance(given, Deck)
    ours, theirs = generate(made), generate(given)
    for name in ("coordinates", "elements", "codes", "equations"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert made.need(Material) == given.need(Material)
    (dt,) = [macro.value for macro in made.macros if macro.word == "DT"]
    assert dt == 2e-7


def test_zeners_figures_are_the_solution_of_his_equations() -> None:
    m, k, v = 2.0e-5, 5.0e4, 100.0
    slope = 1.0 / (8.0 * math.sqrt(1.0e7 * 0.1**3 / 12.0 / (1.0 - 0.3**2) * 2.5e-4 * 0.1))

    def rate(_: float, y: Any) -> list[float]:
        force = k * max(y[0], 0.0) ** 1.5
        return [y[1] - slope * force, -force / m]  # approach; velocity of the mass

    found = solve_ivp(
        rate, (0.0, 200e-6), [0.0, v], method="DOP853", rtol=1e-12, atol=1e-16,
        dense_output=True, events=lambda t, y: rate(t, y)[0],
    )  # fmt: skip
    time = found.t_events[0][0]
    figures = (
        ("largest force", k * found.sol(time)[0] ** 1.5),
        ("its time", time),
        ("velocity at 200", -found.y[1, -1]),
    )
    for quantity, value in figures:
        assert check_of("infinite-plate", quantity).expected == pytest.approx(value, rel=1e-8)


def test_dalemberts_figures_are_the_sums_of_his_waves() -> None:
    through = math.sqrt(7.33e-4 / 30.0e6)

    def middle(time: np.ndarray[Any, Any], tau: float) -> Any:
        total = np.zeros_like(time)
        for turn in range(70):
            for sign, path in ((1.0, 2 * turn + 0.5), (-1.0, 2 * turn + 1.5)):
                late = time - path * through
                pulse = 1000.0 * np.exp(-(((late - tau) / 80e-6) ** 2))
                total += np.where(late >= 0.0, sign * pulse, 0.0)
        return total

    # Its largest value lies just before a jump comes by.
    peak = middle(np.linspace(190e-6, 210e-6, 200_001), 200e-6).max()
    assert check_of("rod-pulse", "largest force").expected == pytest.approx(peak, rel=1e-6)
    later = middle(np.array([250e-6]), 300e-6)[0]
    assert check_of("rod-pulse", "the same pulse").expected == pytest.approx(later, rel=1e-9)


def test_figures_of_series_and_of_waves_are_those_of_the_reference_files() -> None:
    def of(name: str, key: str, column: str, **where: str) -> float:
        (value,) = [
            float(row[column])
            for row in reference(name)
            if key in row[next(iter(row))] and all(row[k] == v for k, v in where.items())
        ]
        return value

    static = "static_ssss_mindlin.csv"
    expected = [check.expected for check in chosen(["static-bending"])[0].checks]
    series = [
        of(static, f"h/a={ratio}", column, load="uni (unit)")
        for ratio, column in (
            ("0.1 ks=1.0", "w_centre"), ("0.1 ks=1.0", "quarter_point w(a/4,b/4)"),
            ("0.01 ks=1.0", "w_centre"), ("0.1 ks=0.83", "w_centre"),
        )
    ]  # fmt: skip
    assert expected == pytest.approx(series, rel=1e-10)
    for quantity, m, n in (("ω11, lumped", 1, 1), ("ω13, lumped", 1, 3), ("ω33, cons", 3, 3)):
        value = of("freq_ssss_mindlin.csv", "h/a=0.1 ks=1.0", "omega_flex_rad/s_or_nondim",
                   m=str(m), n=str(n))  # fmt: skip
        assert check_of("frequencies", quantity).expected == pytest.approx(value, rel=1e-11)
    (along,) = [r for r in reference("waves_normal_velocity.csv") if r["theta_deg"] == "0"]
    given = [float(value) for value in list(along.values())[1:6]]
    fronts = [check.expected for check in chosen(["wave-fronts"])[0].checks[:5]]
    assert fronts == pytest.approx(given, rel=1e-13)


# Breaks ------------------------------------------------------------------------------------------

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
        {"rod-pulse": ("largest", "the same", "mean", "velocity"), "rod-waves": ("peak",)},
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
        mutate(Impact.point_force, "state.contact.force)", "1.01 * state.contact.force)"),
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
