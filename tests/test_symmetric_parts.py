"""Halves and quarters of plates: forces and energies that are shown are of the whole plate."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import fecm
from fecm._errors import StudyError
from fecm.deck import model
from fecm.deck.findings import Finding
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck
from fecm.results.exposures import largest_exposures
from tests.calls import call
from tests.symmetric_parts import mesh_of, part_of, whole_deck, window_deck, with_segments
from tests.test_nonlinear_cards import with_codes
from tests.test_several_materials import laminates

PLATES: dict[str, dict[str, Any]] = {
    "linear": {"giic": 0.05},
    "curved": {"giic": 0.05, "radius_x": 400.0},
    "nonlinear": {"giic": 0.05, "kinematics": "von-karman", "duration": 4e-4},
    "rod": {"projectile": fecm.Rod(200.0, (20.0,) * 5, 2e5, 7.85e-9)},
}
PARTS = {"right half": (0,), "upper half": (1,), "quarter": (0, 1)}
# 1 less the force over the threshold is about 0 where the threshold is found.
ROUNDING = 1e-12


@cache
def deck(plate: str, part: str = "") -> fecm.Deck:
    """Deck of a plate, or of one of its parts."""
    whole = whole_deck(**PLATES[plate])
    return part_of(whole, PARTS[part]) if part else whole


@cache
def run(plate: str, part: str = "") -> fecm.Result:
    """Result of a plate, or of one of its parts."""
    return fecm.run_one(deck(plate, part))


def findings(text: fecm.Deck) -> dict[str, Finding]:
    """Findings of a deck by their codes."""
    return {finding.code: finding for finding in load_deck(text).findings}


def assert_same_columns(sweep: fecm.SweepResult, whole: fecm.SweepResult) -> None:
    """The sweeps have the same numbers in every column."""
    assert {*sweep.summary} - {*whole.summary} == {"symmetry_factor"}
    for name, values in whole.summary.items():
        if values.dtype.kind == "f":
            assert sweep[name] == pytest.approx(values, rel=1e-9, abs=ROUNDING, nan_ok=True)
        else:
            assert sweep[name].tolist() == values.tolist()


# Runs --------------------------------------------------------------------------------------------


@pytest.mark.few(5)
@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("plate", PLATES)
def test_the_metrics_of_a_part_are_those_of_the_whole_plate(plate: str, part: str) -> None:
    whole, result = run(plate), run(plate, part)
    assert result.symmetry_factor == 2 ** len(PARTS[part])
    assert result.metrics == pytest.approx(whole.metrics, rel=1e-9, nan_ok=True)
    # These two runs end before the projectile leaves clearly.
    assert np.isfinite(result.metrics["peak_force"]) or plate in ("rod", "nonlinear")
    assert result.validity == whole.validity
    first, first_of_whole = result.first_failures, whole.first_failures
    assert len(first) == len(first_of_whole)
    for failure, of_whole in zip(first, first_of_whole, strict=True):
        assert (failure.force, failure.energy) == pytest.approx(
            (of_whole.force, of_whole.energy), rel=1e-9
        )
    exposures = [exposure.exposure for exposure in largest_exposures(result)]
    expected = [exposure.exposure for exposure in largest_exposures(whole)]
    assert exposures == pytest.approx(expected, rel=1e-9)


def with_pad(deck: fecm.Deck) -> fecm.Deck:
    """The plate with 1 mm more under the load, in four elements."""
    layers = ((0.0, 0.5, 1), (90.0, 0.5, 1), (90.0, 1.0, 1), (0.0, 0.5, 1), (0.0, 0.5, 1))
    pad = model.Zones(tuple(model.Zone(number, 0, 0, 2) for number in (15, 16, 21, 22)))
    return with_segments(deck, laminates(layers), pad)


def sandwich() -> fecm.Deck:
    """A plate of two faces and a thick core, of two materials."""
    face, core = "IM7/8552", "E-glass/MY750"
    plies = [(0, "C", 0.25), (90, "C", 0.25), (0, "G", 6.0), (90, "C", 0.25), (0, "C", 0.25)]
    return whole_deck(laminate=fecm.Laminate(plies, {"C": face, "G": core}), duration=3e-4)


def for_listing() -> fecm.Deck:
    """A plate that the printed program can compute."""
    deck = whole_deck(damage=False, duration=3e-4)
    segments = tuple(one for one in deck.segments if not isinstance(one, model.Shear))
    return replace(deck, segments=segments, text="")


OTHER_PLATES: dict[str, tuple[Callable[[], fecm.Deck], Literal["report", "listing"]]] = {
    "sandwich": (sandwich, "report"),
    "zones": (lambda: with_pad(whole_deck(duration=3e-4)), "report"),
    "zones on a window": (lambda: with_pad(window_deck()), "report"),
    "window": (window_deck, "report"),
    "triangles": (lambda: whole_deck(plate=mesh_of(3), duration=3e-4), "report"),
    "four nodes": (lambda: whole_deck(plate=mesh_of(4), duration=3e-4), "report"),
    "eight nodes": (lambda: whole_deck(plate=mesh_of(8), duration=3e-4), "report"),
    "listing": (for_listing, "listing"),
}


# A quarter has the lines of both halves.
@pytest.mark.parametrize(
    "part", [pytest.param(part, marks=[pytest.mark.long] * (part != "quarter")) for part in PARTS]
)
@pytest.mark.parametrize("plate", OTHER_PLATES)
def test_every_kind_of_plate_has_parts_with_the_numbers_of_the_whole(plate: str, part: str) -> None:
    build, mode = OTHER_PLATES[plate]
    deck, axes = build(), PARTS[part]
    whole, result = fecm.run_one(deck, mode=mode), fecm.run_one(part_of(deck, axes), mode=mode)
    assert result.symmetry_factor == 2 ** len(axes)
    assert result.metrics == pytest.approx(whole.metrics, rel=1e-9, abs=1e-12, nan_ok=True)
    assert result.whole("force") == pytest.approx(whole.force, abs=1e-9 * whole.force.max())
    assert result.end == whole.end
    notes, expected = ([n.split(" at (")[0] for n in one.notes] for one in (result, whole))
    assert notes == expected
    codes, expected_codes = (
        {finding.code for finding in load_deck(one).findings} for one in (part_of(deck, axes), deck)
    )
    assert codes == expected_codes
    exposures, expected_exposures = (largest_exposures(one) for one in (result, whole))
    for one, of_whole in zip(exposures, expected_exposures, strict=True):
        assert one.exposure == pytest.approx(of_whole.exposure, rel=1e-9)
        assert one.band == pytest.approx(of_whole.band, rel=1e-9)


def test_the_rim_of_half_a_window_is_outside_the_supports_which_pull_as_those_of_the_whole() -> (
    None
):
    whole = window_deck().with_(at=(50.0, 80.0 - 80.0 / 12.0))
    half = part_of(whole, (0,))
    assert {"W556"} <= findings(whole).keys() & findings(half).keys()
    runs = fecm.run_one(whole), fecm.run_one(half)
    pulls = [[note for note in one.notes if "supports pull" in note] for one in runs]
    assert len(pulls[0]) == 1
    assert pulls[1] == pulls[0]
    assert "W556" not in findings(part_of(window_deck(), (0, 1)))


def test_the_lengths_that_a_plate_is_judged_by_are_those_of_the_whole() -> None:
    laminate = fecm.Laminate("[0/90]2", "T300/5208", 0.25)
    warped = whole_deck(laminate=laminate, in_plane="free", cure=-100.0)
    free = whole_deck("free")
    for axes in PARTS.values():
        warps = [findings(one)["W464"].message for one in (part_of(warped, axes), warped)]
        assert warps[0] == warps[1]
        spans = [load_deck(one).problems[0].span for one in (part_of(free, axes), free)]
        assert spans[0].name == spans[1].name == "plate's shorter side"
        assert spans[0].length == pytest.approx(80.0)


@pytest.mark.parametrize("part", PARTS)
def test_the_datasets_of_a_part_are_those_of_the_deck(part: str) -> None:
    whole, result = run("linear"), run("linear", part)
    factor = result.symmetry_factor
    assert factor * result.force == pytest.approx(whole.force, rel=1e-9)
    assert result.whole("force") == pytest.approx(whole.force, rel=1e-9)
    assert result.whole("plate_w") == pytest.approx(result.plate_w)
    initial = result.energy.attributes["initial"]
    assert factor * initial == pytest.approx(whole.energy.attributes["initial"])
    # A moment is a force per length, which the parts do not share.
    assert np.array_equal(result.whole("laminate/D"), whole["laminate/D"])


def test_the_summary_of_a_quarter_says_so_and_has_the_numbers_of_the_whole_plate() -> None:
    whole, text = str(run("linear")).splitlines(), str(run("linear", "quarter")).splitlines()
    (said,) = (line.strip() for line in text if line.startswith("  symmetry"))
    assert said.startswith("symmetry          quarter model: forces, energies and masses are those")
    assert said.endswith("of the whole plate, 4 times the model's")
    compared = ("steps", "peak", "contact", "largest", "energy", "delamination", "first",
                "left")  # fmt: skip
    shown, expected = (
        [lines[1], *(line for line in lines if line.strip().startswith(compared))]
        for lines in (text, whole)
    )
    assert shown == expected
    assert len(expected) >= 8


def test_a_part_reaches_the_threshold_when_the_whole_plate_does(tmp_path: Path) -> None:
    of_whole, of_part = run("linear").threshold, run("linear", "quarter").threshold
    assert of_part["force"] == of_whole["force"]
    assert of_part["time"] == of_whole["time"] > 0.0
    run("linear", "quarter").save(tmp_path / "quarter.h5")
    about = json.loads(call("info", tmp_path / "quarter.h5", "--format", "json").stdout)
    assert about["metrics"]["peak_force"] == run("linear", "quarter").metrics["peak_force"]
    assert fecm.load(tmp_path / "quarter.h5").symmetry_factor == 4


@pytest.mark.parametrize("part", PARTS)
def test_the_rigid_motion_of_a_free_part_is_that_of_the_whole_plate(part: str) -> None:
    free = whole_deck("free", duration=3e-4)
    notes, expected = (
        [note.split(" at (")[0] for note in fecm.run_one(built).notes]
        for built in (part_of(free, PARTS[part]), free)
    )
    assert notes == expected
    assert expected[0].startswith("the deflection without the rigid-body motion reaches")


def test_a_whole_plate_has_no_attribute_of_symmetry() -> None:
    assert "symmetry_factor" not in run("linear").attributes
    assert run("linear").symmetry_factor == 1


def test_a_measured_force_is_compared_with_that_on_the_whole_plate() -> None:
    whole = run("linear")
    comparison = run("linear", "quarter").compare((whole.time, whole.force))
    assert comparison.rms == pytest.approx(0.0, abs=1e-6 * whole.force.max())
    axes = run("linear", "quarter").plot("force")
    assert axes.get_ylabel().startswith("Contact force, whole plate")
    assert axes.lines[0].get_ydata() == pytest.approx(whole.force, rel=1e-9)


def test_a_page_has_the_numbers_of_the_whole_plate(tmp_path: Path) -> None:
    run("linear", "quarter").report(tmp_path / "quarter.html")
    page = (tmp_path / "quarter.html").read_text()
    peak = pytest.approx(run("linear").force.max(), rel=1e-9)
    assert "quarter model: forces, energies and masses are those of the whole plate" in page
    assert sum(float(value) == peak for value in re.findall(r'data value="(.*?)"', page)) >= 2
    assert "A mass of 20 g at 8000 mm/s (640 mJ) on a plate of 100 × 80 mm" in page


# Before a run ------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize(
    "plate", ["linear", "curved", pytest.param("nonlinear", marks=pytest.mark.long)]
)
def test_check_and_estimate_have_the_numbers_of_the_whole_plate(plate: str, part: str) -> None:
    summaries = [fecm.check(deck(plate, name)).problems[0] for name in ("", part)]
    whole, of_part = (summary.to_dict() for summary in summaries)
    names = ("plate_mass", "projectile_mass", "velocity", "energy", "threshold", "rise",
             "elements_per_wave")  # fmt: skip
    for name in names:
        assert of_part[name] == pytest.approx(whole[name], rel=1e-9)
    assert of_part["symmetry_factor"] == 2 ** len(PARTS[part])
    estimates = [fecm.estimate(deck(plate, name)) for name in ("", part)]
    assert estimates[1].stiffness == pytest.approx(estimates[0].stiffness, rel=1e-9)
    assert estimates[1].mass_ratio == pytest.approx(estimates[0].mass_ratio, rel=1e-9)
    for name, expected in estimates[0].models.items():
        numbers = vars(estimates[1].models[name])
        assert numbers == pytest.approx(vars(expected), rel=1e-9, nan_ok=True)


def test_check_names_the_lines_of_symmetry_and_the_masses_of_the_whole_plate() -> None:
    lines = fecm.check(deck("linear", "quarter")).problems[0].lines()
    rows = {line[2:22].strip(): line[22:] for line in lines}
    assert rows["symmetry"].startswith("x = 50 and y = 40, quarter model: forces")
    assert rows["projectile mass"].endswith("(20 g)")
    assert rows["impact"] == "8000 mm/s, 640 mJ"


# Sweeps ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plate", ["linear", pytest.param("nonlinear", marks=pytest.mark.long)])
def test_energies_of_a_sweep_are_those_of_the_whole_plate(plate: str) -> None:
    values: dict[str, Any] = {"energy": [500.0, 1500.0]}
    whole = fecm.sweep(deck(plate), values, history=True)
    sweep = fecm.sweep(deck(plate, "quarter"), values, history=True)
    assert_same_columns(sweep, whole)
    assert sweep["symmetry_factor"].tolist() == [4.0, 4.0]
    assert sweep.force == pytest.approx(whole.force, rel=1e-9)


@pytest.mark.parametrize("part", PARTS)
def test_a_search_for_the_threshold_finds_the_energy_of_the_whole_plate(part: str) -> None:
    values: dict[str, Any] = {"giic": [0.05, 0.1]}
    whole, sweep = (
        fecm.sweep(deck("linear", name), values, until="threshold") for name in ("", part)
    )
    assert_same_columns(sweep, whole)
    assert sweep["found_energy"] == pytest.approx(whole["found_energy"], rel=1e-9)


def test_a_search_for_an_exposure_finds_the_energy_of_the_whole_plate() -> None:
    whole, sweep = (
        fecm.sweep(deck("linear", name), {"giic": [0.1]}, until={"exposure": 0.5})
        for name in ("", "quarter")
    )
    assert_same_columns(sweep, whole)


def test_with_takes_the_energy_and_the_radius_of_the_whole_impact() -> None:
    whole, part = (
        deck("linear", name).with_(energy="2J", radius="8mm") for name in ("", "quarter")
    )
    assert part.require(model.Impact).velocity == pytest.approx(
        whole.require(model.Impact).velocity, rel=1e-12
    )
    k = whole.require(model.Indentation).k
    assert part.require(model.Indentation).k == pytest.approx(k / 4.0, rel=1e-12)


# What is refused and doubted ---------------------------------------------------------------------


def test_a_quarter_needs_no_word_of_doubt() -> None:
    for plate in PLATES:
        for part in PARTS:
            # W469: the toughness is low, so that the threshold is reached.
            assert findings(deck(plate, part)).keys() <= {"W449", "W415", "W469"}


def test_an_impact_beside_the_line_is_taken_once_and_its_images_are_named() -> None:
    quarter = deck("linear", "quarter")
    beside = quarter.with_(at=(75.0, 40.0))
    doubt = findings(beside)["W565"]
    assert doubt.message.startswith("The edge x = 50 is a line of symmetry, and the impact at (75,")
    result = fecm.run_one(beside)
    assert result.symmetry_factor == 2  # of the line y = 40, which it is on
    with pytest.warns(fecm.FecmWarning, match=r"2 cases beside the line of symmetry x = 50.*W565"):
        sweep = fecm.sweep(quarter, {"at": ["50,40", "75,40", "75,60"]})
    assert sweep["symmetry_factor"].tolist() == [4.0, 2.0, 1.0]


@pytest.mark.parametrize(
    ("layup", "options", "said"),
    [
        ("[45/-45/0/90]s", {}, "the laminate has D16 or D26"),
        ("[0/90]s", {"preload": (1.0, 1.0, 1.0)}, "the preload has N0xy"),
        ("[45/-45]2", {"in_plane": "free"}, "the laminate has B16 or B26"),
        ("[0/90]s", {}, ""),
        ("[0/90]", {"in_plane": "free"}, ""),
    ],
)
def test_a_plate_without_the_symmetry_is_doubted(
    layup: str, options: dict[str, Any], said: str
) -> None:
    laminate = fecm.Laminate(layup, "IM7/8552", 0.25)
    half = part_of(whole_deck(laminate=laminate, damage=False, **options), (0,))
    doubt = findings(half).get("W566")
    assert (doubt is not None) == bool(said)
    if doubt is not None:
        assert f"not symmetric about it: {said}" in doubt.message


def test_an_antisymmetric_angle_ply_plate_has_lines_that_hold_the_displacement_along_them() -> None:
    laminate = fecm.Laminate("[45/-45]2", "IM7/8552", 0.25)
    whole = whole_deck(laminate=laminate, damage=False, in_plane="tangential")
    half = part_of(whole, (0,))
    mesh = generate(half)
    codes = (mesh.codes != 0).astype(int)
    line = np.isclose(mesh.coordinates[:, 0], 50.0)
    moving = line & (codes[:, 2] == 0)  # the supports at its ends hold u
    codes[moving, 0], codes[line, 1] = 0, 1
    along = with_codes(half, codes)
    assert "W566" not in findings(along)
    result, expected = fecm.run_one(along), fecm.run_one(whole)
    assert result.metrics == pytest.approx(expected.metrics, rel=1e-9, nan_ok=True)


def free(rows: Callable[[Any], Any], *dofs: int) -> fecm.Deck:
    """The right half with dofs set free at nodes of its line of symmetry."""
    half = deck("linear", "right half")
    mesh = generate(half)
    codes = (mesh.codes != 0).astype(int)
    line = np.isclose(mesh.coordinates[:, 0], 50.0)
    codes[np.ix_(line & rows(mesh.coordinates), dofs)] = 0
    return with_codes(half, codes)


def test_restraints_at_the_impact_node_alone_make_no_line_of_symmetry() -> None:
    alone = free(lambda places: ~np.isclose(places[:, 1], 40.0), 3)
    doubt = findings(alone)["W567"]
    assert "theta_x is restrained at 1 of 11 nodes with free w" in doubt.message
    assert fecm.run_one(alone).symmetry_factor == 1


def test_a_clamped_edge_that_may_deflect_is_no_line_of_symmetry() -> None:
    half = deck("linear", "right half")
    mesh = generate(half)
    codes = (mesh.codes != 0).astype(int)
    codes[np.isclose(mesh.coordinates[:, 0], 50.0), 3:] = 1  # the twist too
    assert fecm.run_one(with_codes(half, codes)).symmetry_factor == 1


def test_fits_and_locations_need_the_whole_plate() -> None:
    quarter, time = deck("linear", "quarter"), np.linspace(0.0, 1e-4, 40)
    with pytest.raises(StudyError, match="identify needs the whole plate"):
        fecm.identify(quarter, time, np.sin(3e4 * time), "k")
    gages = tuple(model.Gage(n, 60.0 + 5 * n, 50.0, 1.0, 0.0) for n in (1, 2, 3))
    gaged = replace(quarter, segments=(model.Gages(gages), *quarter.segments), text="")
    table = {"time": time, **{f"gage_{n}": 1e-3 * np.sin(n * 3e4 * time) for n in (1, 2, 3)}}
    with pytest.raises(StudyError, match="the line of symmetry x = 50 and y = 40"):
        fecm.locate(gaged, table)
