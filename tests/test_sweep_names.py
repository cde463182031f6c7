"""Names that sweeps vary, against decks written with those values; and columns on request."""

from __future__ import annotations

import functools
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.authoring.case import Case, CasesError
from fecm.authoring.values import VARIABLES, Changes, apply_case
from fecm.deck.model import Deck, Impact, Indentation, Material, Patch
from fecm.judge.criteria import ALL_CRITERIA
from fecm.problem.generate import generate
from fecm.results.exposures import largest_exposures
from fecm.sweeps import methods
from fecm.sweeps.case_tables import parse_vary, read_cases
from fecm.sweeps.summary import summary_of_sweep
from tests.calls import call
from tests.decks import DATA_CARDS, PROGRAM, model, small

PLATE = {
    "--size": "100x100", "--mesh": "2x2", "--layup": "[0]8", "--ply-thickness": ".25",
    "--material": "T300/5208", "--units": "mm-N-s", "--velocity": "3000",
    "--law": "45000,.016,.094,2.5", "--projectile": "mass:2e-5", "--duration": "5e-5",
    "--support": "simple", "--kinematics": "linear", "--shear-factor": "1",
}  # fmt: skip
ESTIMATE = ("--layup", "[0]8", "--ply-thickness", ".25", "--material", "T300/5208")


@functools.cache
def new(**options: str) -> Deck:
    """Deck that ``fecm new`` writes, with other options."""
    given = PLATE | {f"--{name}": value for name, value in options.items()}
    answer = call("new", "-", *(text for pair in given.items() for text in pair))
    assert answer.exit_code == 0, answer.stderr
    return model(answer.stdout)


@functools.cache
def gaged() -> Deck:
    """A plate with gages and failure criteria, hit for a time after which it is free."""
    return fecm.impact(
        fecm.Plate.rectangle((100, 80), (3, 3), support="clamped"),
        fecm.Laminate("[0/45/-45/90]s", "AS4/3501-6", 0.25),
        fecm.RigidMass(2e-6),
        fecm.Contact.estimate(radius=8),
        velocity=3000,
        duration=3e-4,
        units="mm-N-s",
        gages=[(30, 20, 1, 0), (60, 60, -1, 45)],
        damage=True,
        every=20,
    )


# Values against decks that are written with them --------------------------------------------------


CASES: list[tuple[Case, dict[str, str]]] = [
    ({"size": "150x60"}, {"size": "150x60"}),
    ({"support": "clamped"}, {"support": "clamped"}),
    ({"at": "(25,75)"}, {"at": "25,75"}),
    ({"duration": 3.3e-5}, {"duration": "3.3e-5"}),
    ({"angle": 90.0}, {"layup": "[90]8"}),
    ({"layup": "[0_4/90_4]", "support": "clamped"}, {"layup": "[0_4/90_4]", "support": "clamped"}),
    ({"size": "200x150", "support": "simple", "angle": 90.0, "duration": 4e-5, "at": "(50,75)"},
     {"size": "200x150", "layup": "[90]8", "duration": "4e-5", "at": "50,75"}),
]  # fmt: skip


@pytest.mark.parametrize(("number", "patch"), [(n, "disc" if n % 2 else "none") for n in range(7)])
@pytest.mark.few(3)  # of 7, 0.1 s each
def test_a_case_is_the_deck_that_new_writes_with_its_values(number: int, patch: str) -> None:
    case, options = CASES[number]
    swept = fecm.sweep(new(patch=patch), cases=[case], history=True)
    expected = fecm.run_one(new(**options, patch=patch))
    assert swept.completed.all()
    assert swept.force is not None
    assert swept.dt[0] == expected.time[0]
    # The duration of a deck is a number of its own steps.
    more = swept.steps[0] - len(expected.time)
    assert more == 0 if "duration" in case else more in (0, 1)
    difference = np.abs(swept.force[0, : len(expected.time)] - expected.force).max()
    assert difference <= 1e-10 * expected.force.max()


@pytest.mark.parametrize("number", [0, 1, 5, 6])
def test_the_mesh_of_a_case_is_that_of_new(number: int) -> None:
    case, options = CASES[number]
    built, expected = generate(apply_case(new(), case)), generate(new(**options))
    np.testing.assert_allclose(built.coordinates, expected.coordinates, rtol=1e-14, atol=1e-12)
    np.testing.assert_array_equal(built.codes != 0, expected.codes != 0)
    np.testing.assert_array_equal(built.elements, expected.elements)


def test_an_energy_is_half_of_mass_times_velocity_squared() -> None:
    deck = new()
    changed = apply_case(deck, {"energy": 80.0, "mass": 5e-5})
    assert changed.require(Impact).velocity == pytest.approx(math.sqrt(2 * 80.0 / 5e-5), rel=1e-15)
    rod = fecm.Rod.cylinder(200.0, 10.0, 2e5, 7.8e-9)
    changed = apply_case(
        fecm.impact(
            fecm.Plate.rectangle((100, 100), (4, 4)),
            fecm.Laminate("[0]8", "T300/5208", 0.25),
            rod,
            fecm.Contact(45000.0, 0.016, 0.094, 2.5),
            velocity=1.0,
            duration=1e-4,
            units="mm-N-s",
        ),
        {"energy": 80.0},
    )
    mass = math.pi / 4.0 * 10.0**2 * 200.0 * 7.8e-9
    assert changed.require(Impact).velocity == pytest.approx(math.sqrt(2 * 80.0 / mass), rel=1e-6)
    swept = fecm.sweep(deck, {"energy": [80.0], "mass": [2e-5, 5e-5]})
    speeds = [math.sqrt(2 * 80.0 / mass) for mass in (2e-5, 5e-5)]
    expected = fecm.sweep(
        deck,
        cases=[
            {"velocity": speed, "rod_mass": mass}
            for speed, mass in zip(speeds, (2e-5, 5e-5), strict=True)
        ],
    )
    np.testing.assert_array_equal(swept["peak_force"], expected["peak_force"])


def test_a_radius_is_the_k_of_indent_estimate_for_a_steel_sphere() -> None:
    def estimated(units: str, radius: float, modulus: float) -> float:
        done = call(
            "indent",
            "estimate",
            *ESTIMATE,
            "--units",
            units,
            "--radius",
            radius,
            "--es",
            modulus,
            "--nus",
            ".3",
            "--nu23",
            ".4",
            "--format",
            "json",
        )
        return float(json.loads(done.stdout)["k"])

    k = apply_case(new(), {"radius": 8.0}).require(Indentation).k
    assert k == pytest.approx(estimated("mm-N-s", 8.0, 207e3), rel=1e-12)
    # 1 lbf/in^2 is 6894.757293168361 Pa; the constants of the ply are converted to six digits.
    inch = new(units="in-lbf-s", velocity="115")
    k = apply_case(inch, {"radius": 0.5}).require(Indentation).k
    assert k == pytest.approx(estimated("in-lbf-s", 0.5, 207e9 / 6894.757293168361), rel=1e-9)
    quasi = apply_case(new(), {"radius": 8.0, "layup": "[0/45/-45/90]s"}).require(Indentation)
    assert quasi.k != pytest.approx(k, rel=1e-3)
    assert (quasi.alpha_p, quasi.s_p, quasi.q) == (0.016, 0.094, 2.5)
    with pytest.raises(CasesError, match="needs the units of the deck; add a UNIT segment"):
        apply_case(model(small()), {"radius": 0.5})
    with pytest.raises(CasesError, match="radius must be positive, not -1"):
        apply_case(new(), {"radius": -1.0})


def test_centre_of_patch_and_gages_are_scaled_with_the_plate() -> None:
    deck = gaged().with_(x0=40, y0=20)
    built = deck.with_(size=(50, 160))
    patch = built.require(Patch)
    assert (patch.x, patch.y) == (20.0, 40.0)
    places = [(gage.x, gage.y, gage.z) for gage in built.require(fecm.deck.model.Gages).records]
    assert places == [(15.0, 40.0, 1.0), (30.0, 120.0, -1.0)]
    assert deck.with_(size="50x160", at=(10, 30)).require(Patch).x == 10.0


def test_places_that_can_not_be_hit_are_cases_with_a_reason() -> None:
    places = [(50, 50), (49, 52), (0, 50), (130, 50)]
    swept = fecm.sweep(new(patch="none"), {"at": places, "velocity": [2000.0, 3000.0]})
    assert swept["at"].tolist()[::2] == ["(50,50)", "(49,52)", "(0,50)", "(130,50)"]
    assert swept.completed.tolist() == [True] * 4 + [False] * 4
    assert swept["status"][4].startswith("Dof 3 of the impact node 11 is restrained")
    assert swept["status"][6] == "at (130,50) is outside the plate"
    np.testing.assert_array_equal(swept["hit_x"], [50.0] * 4 + [np.nan] * 4)
    np.testing.assert_array_equal(swept["peak_force"][:2], swept["peak_force"][2:4])
    assert swept.unit("hit_x") == "mm"
    (line,) = [line for line in summary_of_sweep(swept).lines() if line.startswith("moved")]
    assert line == "moved             2: to the nearest node, up to 2.236 mm away"
    patched = fecm.sweep(new(), {"at": places})
    assert patched["hit_x"][:2].tolist() == [50.0, 49.0]
    assert not patched.completed[2:].any()


# Time step and duration --------------------------------------------------------------------------


def test_dt_auto_is_dt_0_of_the_deck_of_the_case() -> None:
    deck = new(dt="2e-7")
    swept = fecm.sweep(deck, {"dt": ["auto", 2e-7], "thickness": [2.0, 8.0]})
    assert swept["dt"].tolist() == [0.0, 0.0, 2e-7, 2e-7]
    assert swept.completed.all()
    for case, thickness in enumerate((2.0, 8.0)):
        expected = fecm.run_one(deck.with_(thickness=thickness, dt=0))
        assert swept.dt[case] == expected.time[0] > 2e-7
        # The last step is the first at or after the duration.
        assert swept.steps[case] == len(expected.time) == math.ceil(5e-5 / swept.dt[case])
    assert swept.steps[2] == 250


def test_an_unstable_case_names_the_critical_step_and_the_remedy() -> None:
    deck = new(dt="5e-7")
    swept = fecm.sweep(deck, {"size": ["100x100", "15x15"]})
    assert swept.completed.tolist() == [True, False]
    assert "critical time step" in swept["status"][1]
    assert swept["status"][1].endswith("Vary dt=auto, or take DT 0.")
    assert fecm.sweep(deck, {"size": ["15x15"], "dt": ["auto"]}).completed.all()


def test_a_duration_is_reached_with_any_time_step_and_rounded_up_to_a_step() -> None:
    deck = new(dt="2e-7")
    swept = fecm.sweep(deck, {"duration": [2e-5, 2.01e-5], "dt": [2e-7, 4e-7]})
    expected = [math.ceil(d / dt - 1e-9) for d, dt in zip(swept["duration"], swept.dt, strict=True)]
    assert swept.steps.tolist() == expected == [100, 50, 101, 51]
    bad = fecm.sweep(deck, {"duration": [0.0, -1.0]})
    assert bad["status"].tolist() == [f"duration must be positive, not {d}" for d in (0, -1)]


def test_loops_that_can_not_keep_the_duration_are_told() -> None:
    nested = PROGRAM.replace("LOOP         10\n", "LOOP        100\nLOOP          2\n") + "NEXT\n"
    (status,) = fecm.sweep(small(nested), {"dt": [4e-7]})["status"]
    assert status == (
        "the loops of the deck give the duration 0.00012 instead of 0.0001; take all steps in one "
        "loop"
    )
    assert fecm.sweep(small(nested), {"dt": [2.5e-7]}).steps[0] == 400


# Columns on request ------------------------------------------------------------------------------


def test_measured_columns_are_those_of_full_runs(tmp_path: Path) -> None:
    deck, speeds = gaged(), [1500.0, 3000.0]
    quick = fecm.sweep(deck, {"velocity": speeds}, measure=("gages", "max_deflection"))
    path = tmp_path / "s.h5"
    whole = fecm.sweep(
        deck, {"velocity": speeds}, measure=["failure", "gages", "max_deflection"], output=path
    )
    for case, speed in enumerate(speeds):
        result = fecm.run_one(deck.with_(velocity=speed))
        expected = dict(
            zip(("gage_1", "gage_2"), np.abs(result.gages.strain).max(axis=0), strict=True)
        ) | {"max_deflection": result.metrics["max_deflection"]}
        for name, value in expected.items():
            assert quick[name][case] == pytest.approx(value, rel=1e-9, nan_ok=True)
            np.testing.assert_equal(whole[name][case], value)
        exposures = {one.criterion: one.exposure for one in largest_exposures(result)}
        assert set(exposures) == set(ALL_CRITERIA)
        for name, value in exposures.items():
            assert whole[f"exposure_{name}"][case] == value
    loaded = fecm.load_sweep(path)
    assert loaded.unit("max_deflection") == "mm"
    np.testing.assert_array_equal(loaded["exposure_puck"], whole["exposure_puck"])
    said = json.loads(call("info", path, "--format", "json").stdout)["groups"]
    said = {d["name"]: d["description"] for group in said for d in group["datasets"]}
    assert said["summary/gage_2"] == "largest absolute strain of gage 2"
    assert said["summary/exposure_puck"] == "largest exposure puck outside the load"


def test_a_peak_at_the_end_of_an_open_run_is_not_known() -> None:
    deck = gaged().with_(duration=1e-5)
    swept = fecm.sweep(deck, {"velocity": [3000.0]}, measure="max_deflection")
    assert swept["status"].tolist() == ["still in contact"]
    assert np.isnan(swept["max_deflection"]).all()
    assert math.isnan(fecm.run_one(deck).metrics["max_deflection"])


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("gages", "no strain gages; add a GAGE segment"),
        (["failure"], "has no FAIL; add it to the loop"),
        (["deflection"], "measure has 'deflection'; the names are max_deflection, gages, failure"),
        (5, "measure is 5, not a function or names"),
    ],
)
def test_columns_that_a_deck_does_not_have_are_refused(names: object, message: str) -> None:
    with pytest.raises(CasesError, match=message):
        fecm.sweep(small(), {"k": [1e6]}, measure=names)  # type: ignore[arg-type]


def test_the_command_measures_and_counts_what_failed(tmp_path: Path) -> None:
    deck, path = tmp_path / "p.inp", tmp_path / "s.h5"
    deck.write_text(gaged().to_text())
    done = call(
        "sweep",
        deck,
        "--vary",
        "at=(50,40),(25,40),(500,0)",
        "--measure",
        "gages,failure",
        "-o",
        path,
    )
    assert done.exit_code == 1
    assert done.stdout.splitlines()[-1] == "3 cases: 1 failed"
    assert done.stderr.count("B is not zero") == 0
    swept = fecm.load_sweep(path)
    assert swept["gage_1"][0] > 0.0
    assert np.isnan(swept["gage_1"][2])
    lacking = call("sweep", deck, "--vary", "k=1e5", "--measure", "speed", "-o", path)
    assert lacking.exit_code == 2
    assert "'max_deflection', 'gages', 'failure'" in lacking.stderr


# Forms -------------------------------------------------------------------------------------------


def test_places_and_sizes_are_read(tmp_path: Path) -> None:
    assert parse_vary("at=(3,2),(1.50, 1)") == ("at", ["(3,2)", "(1.5,1)"])
    assert parse_vary("at=75,50") == ("at", ["(75,50)"])
    with pytest.raises(CasesError, match=r"write at=\(75,50\),\(80,50\)$"):
        parse_vary("at=75,50,80,50")
    assert parse_vary("size=6x4,9×6.0") == ("size", ["6x4", "9x6"])
    assert parse_vary("dt=auto,1e-7") == ("dt", [0.0, 1e-7])
    assert parse_vary("layup=[0/(45,90)2]s,[0]") == ("layup", ["[0/(45,90)2]s", "[0]"])
    table = tmp_path / "cases.csv"
    table.write_text('at,size\n"(3,2)",6x4\n"1.5, 1",9 x 6\n')
    assert read_cases(table) == [{"at": "(3,2)", "size": "6x4"}, {"at": "(1.5,1)", "size": "9x6"}]
    table.write_text("at;k\n(3,2);1\n")
    assert read_cases(table) == [{"at": "(3,2)", "k": 1.0}]


@pytest.mark.parametrize(
    "text",
    ["at=3", "at=(3)", "at=(3,x)", "at=1:2:3", "size=6", "size=axb", "support=welded", "energy=a",
     "duration=auto", "at=(nan,1)"],
)  # fmt: skip
def test_what_is_no_place_size_or_support_is_refused(text: str) -> None:
    with pytest.raises(CasesError):
        parse_vary(text)


@pytest.mark.parametrize(
    "names",
    [("velocity", "energy"), ("k", "radius"), ("mass", "rod_mass"), ("mass", "rod_density"),
     ("rod_mass", "rod_density"), ("at", "impact_node"), ("at", "x0")],
)  # fmt: skip
def test_names_that_exclude_each_other_are_told_before_a_case_runs(names: tuple[str, str]) -> None:
    case = {name: "(1,1)" if name == "at" else 1.0 for name in names}
    with pytest.raises(CasesError, match=f"{names[0]} and {names[1]} exclude each other"):
        fecm.sweep(small(), cases=[case])


def test_a_support_needs_a_deck_without_nodal_forces() -> None:
    load = "FORC\n    8    0       0.0       0.0       1.0\n\n"
    (status,) = fecm.sweep(small(data=load + DATA_CARDS), {"support": ["simple"]})["status"]
    assert status.startswith("support: the deck must have no FORC")


def test_a_support_of_an_unsymmetric_laminate_frees_the_plane_without_a_note(
    tmp_path: Path,
) -> None:
    deck = tmp_path / "p.inp"
    deck.write_text(new().to_text())
    vary = ("--vary", "support=simple", "--vary", "layup=[0_4/90_4]", "-o", tmp_path / "s.h5")
    assert "B is not zero" not in call("sweep", deck, *vary).stderr
    assert new().require(Material).ply.e1 > 0.0


# The table of values ------------------------------------------------------------------------------

SHARING = (Changes.FAILURE, Changes.STRIKE)  # what cases of one plate differ in


def test_the_page_of_names_has_the_table_of_the_values() -> None:
    signs = str.maketrans({"*": "·"})
    rows = [
        f"| `{name}` | {variable.dimension.translate(signs)} | {variable.meaning} | "
        f"{'one for all cases' if variable.changes in SHARING else 'one per value'} |"
        for name, variable in VARIABLES.items()
    ]
    page = (Path(__file__).parent.parent / "docs" / "sweep-names.md").read_text()
    assert [line for line in page.splitlines() if line.startswith("| `")] == rows


def test_the_help_of_the_command_lists_every_name() -> None:
    text = " ".join(call("sweep", "--help").stdout.split())
    listed = text.split("Names: ")[1].split(".")[0]
    assert listed.split(", ") == list(VARIABLES)


@pytest.mark.parametrize("name", VARIABLES)
def test_a_value_is_stored_in_the_unit_of_its_dimension(name: str) -> None:
    units, none = {"length": "mm", "force": "N", "time": "s"}, np.zeros(0)
    swept = fecm.SweepResult({name: none}, {}, none, none, units=units)
    expected = VARIABLES[name].dimension
    for dimension, unit in units.items():
        expected = expected.replace(dimension, unit)
    assert swept.unit(name) == expected


def test_cases_that_differ_in_their_strikes_share_one_deck(monkeypatch: pytest.MonkeyPatch) -> None:
    decks: list[Case] = []

    def applied(deck: Deck, case: Case) -> Deck:
        decks.append(case)
        return apply_case(deck, case)

    monkeypatch.setattr(methods, "apply_case", applied)
    vary = {"angle": [30.0], "velocity": [60.0, 115.0], "k": [1e6, 2e6], "mass": [2e-4, 3e-4]}
    swept = fecm.sweep(model(small()), vary)
    assert len(swept) == 8
    assert len(set(swept["peak_force"].tolist())) == 8
    assert decks == [{"angle": 30.0}]


def test_values_with_a_unit_are_those_of_the_deck() -> None:
    """5 J are 5000 N*mm in a deck of mm, N and s, whose mass unit is the tonne."""
    assert parse_vary("energy=5J:30J:6", "mm-N-s")[1] == [5e3, 1e4, 1.5e4, 2e4, 2.5e4, 3e4]
    assert parse_vary("energy=500mJ,1 J", "mm-N-s")[1] == [500.0, 1000.0]
    assert parse_vary("duration=12ms", "mm-N-ms")[1] == [12.0]
    assert parse_vary("mass=5.5kg,2000", "mm-N-s")[1] == pytest.approx([5.5e-3, 2000.0])
    assert parse_vary("xt=2.3GPa", "mm-N-s")[1] == [2300.0]
    assert parse_vary("giic=0.8kJ/m^2", "mm-N-s")[1] == pytest.approx([0.8])
    assert parse_vary("k=1e6,2E+5", "mm-N-s")[1] == [1e6, 2e5]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("energy=5m", "energy must be a finite number, or one with a unit as in 10J, not `5m`"),
        ("nu12=0.3J", "nu12 must be a finite number, not `0.3J`"),
        ("energy=5J:3s:6", "as in 10J, not `3s`"),
    ],
)
def test_another_unit_is_refused_with_an_example(text: str, message: str) -> None:
    with pytest.raises(CasesError, match=re.escape(message)):
        parse_vary(text, "mm-N-s")


def test_a_unit_needs_a_deck_that_names_its_units() -> None:
    with pytest.raises(CasesError, match=re.escape("the deck names no units; add UNIT")):
        parse_vary("energy=5J")
