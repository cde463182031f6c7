"""Mesh error of the peak force: ``fecm check --mesh-error``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import fecm
from fecm.judge.criteria import ALL_CRITERIA
from tests.calls import call
from tests.decks import PROGRAM, ROOT, small

STEPS = PROGRAM.replace("LOOP         10", "LOOP        150")


def new(mesh: str, *options: str) -> str:
    """Deck of a plate that a bending wave of the impact covers."""
    answer = call(
        "new",
        "-",
        "--size",
        "40x40",
        "--mesh",
        mesh,
        "--layup",
        "[0/90]2s",
        "--units",
        "mm-N-s",
        "--ply-thickness",
        ".25",
        "--material",
        "T300/5208",
        "--velocity",
        "3000",
        "--law",
        "45000,.016,.094,2.5",
        "--projectile",
        "mass:2e-5",
        "--duration",
        "5e-5",
        *options,
    )
    assert answer.exit_code == 0, answer.stderr
    return answer.stdout


def peak(deck: str) -> float:
    """Peak force of a run."""
    result = fecm.run_one(deck)
    return float(result.force.max())


@pytest.mark.parametrize("options", [["--patch", "none", "--shear", "full"], ["--patch", "hertz"]])
@pytest.mark.few(1)  # of 2, 0.5 s each
def test_the_second_peak_is_that_of_the_plate_with_elements_of_half_the_side(
    tmp_path: Path, options: list[str]
) -> None:
    options += ["--dt", "5e-8"]
    deck = tmp_path / "plate.inp"
    deck.write_text(new("4x4", *options))
    done = call("check", deck, "--mesh-error", "--format", "json")
    document = json.loads(done.stdout.splitlines()[-1])
    coarse, fine = peak(new("4x4", *options)), peak(new("8x8", *options))
    assert (document["elements"], document["refined_elements"]) == (16, 64)
    assert document["peak_force"] == pytest.approx(coarse, rel=1e-9)
    assert document["refined_peak_force"] == pytest.approx(fine, rel=1e-9)
    assert document["relative_change"] == pytest.approx(fine / coarse - 1.0, rel=1e-6)
    assert document["undecided"]  # as the force still rises at the end
    in_python = fecm.mesh_error(deck)
    assert in_python.refined_peak_force == document["refined_peak_force"]
    assert in_python.relative_change == document["relative_change"]
    if "hertz" not in options:
        return
    text = call("check", deck, "--mesh-error").stdout
    assert f"{fine:.5g} N on 64, within " in text
    assert f"({fine / coarse - 1.0:+.2%})" in text


def test_a_time_step_that_the_finer_mesh_does_not_bear_is_shortened(tmp_path: Path) -> None:
    deck = tmp_path / "plate.inp"
    deck.write_text(new("4x4"))  # with 0.9 of the critical step
    done = call("check", deck, "--mesh-error")
    assert done.exit_code == 0
    assert "on 64, within" in done.stdout


EIGHT = """\
COOR
1,0,0.,0.
2,0,1.,0.
3,0,2.,0.
4,0,0.,1.
5,0,2.,1.
6,0,0.,2.
7,0,1.,2.
8,0,2.,2.

ELEM
1,1,3,8,6,2,5,7,4,0,0

"""
ONE_ELEMENT = (
    small(STEPS, mesh=EIGHT)
    .replace("   25    4    2    2", "    8    1    2    2")
    .replace("   13    3     115.0", "    5    3     115.0")
    .replace("DT        .5E-6", "DT        .2E-6")
)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ((ROOT / "decks" / "static-bending.inp").read_text(), "the deck has no impact"),
        (small(STEPS).replace("     115.0", "       0.0"), "the deck has no impact"),
        (ONE_ELEMENT, "element 1 cannot be bisected: it does not have four or nine nodes"),
    ],
    ids=["no impact", "no velocity", "8-node element"],
)
def test_a_deck_without_a_second_mesh_says_why(tmp_path: Path, text: str, reason: str) -> None:
    deck = tmp_path / "plate.inp"
    deck.write_text(text)
    done = call("check", deck, "--mesh-error")
    assert done.exit_code == 2
    assert f"fecm: error: {reason}" in done.stderr


@pytest.mark.long
def test_the_largest_force_of_a_run_that_is_cut_off_is_not_called_a_peak(tmp_path: Path) -> None:
    deck = tmp_path / "plate.inp"
    deck.write_text(new("4x4", "--duration", "1.5e-4"))
    whole = fecm.mesh_error(deck)
    short = tmp_path / "short.inp"
    short.write_text(new("4x4"))
    counted: list[tuple[int, int]] = []
    cut = fecm.mesh_error(short, progress=lambda done, steps: counted.append((done, steps)))
    assert (whole.undecided, cut.undecided) == (False, True)
    assert cut.peak_force < whole.peak_force
    assert counted[-1][0] == counted[-1][1]
    done = call("check", short, "--mesh-error")
    assert "largest force so far" in done.stdout
    assert "peak force  " not in done.stdout
    assert "lower bounds" in done.stderr


def test_exposures_on_both_meshes_are_those_of_runs_on_them() -> None:
    options = ("--damage", "--patch", "disc:10", "--dt", "5e-8", "--kinematics", "linear")
    coarse, fine = new("4x4", *options), new("8x8", *options)
    estimate = fecm.mesh_error(fecm.read_one(coarse))
    pairs = ((coarse, estimate.exposures), (fine, estimate.refined_exposures))
    for deck, exposures in pairs:
        largest = fecm.run_one(deck)["exposures/exposure"][-1]
        assert list(exposures.values()) == pytest.approx(largest[: len(exposures)], rel=1e-9)
    assert list(estimate.exposures) == list(ALL_CRITERIA)
