"""fecm estimate: quick models beside the run, and the velocity that reaches the threshold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.deck.model import Impact
from fecm.problem.loading import load_deck
from fecm.studies.estimate import quick_estimate
from tests.calls import call
from tests.decks import MESH, PROGRAM, small

# w is held along the lower and the upper edge.
HELD = MESH[: MESH.index("BOUN")] + (
    "BOUN\n    1    1   -1   -1   -1    0    0\n    5    1   -1   -1    1    0    0\n"
    "   21    1   -1   -1   -1    0    0\n   25    0    1    1    1    0    0\n\n"
)


def deck(segments: str = "", *, mesh: str = MESH) -> str:
    text = small(PROGRAM.replace("         10", "        400"), mesh=mesh)
    return text.replace("EXPE", f"PATC\nDISC,.2\n{segments}EXPE")


def test_the_row_of_the_run_is_the_run(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(deck("DELA\n.001,\n"))
    assert "delamination at the latest from these" in call("estimate", "d.inp", cwd=tmp_path).stdout
    done = call("estimate", "d.inp", "--format", "json", cwd=tmp_path)
    assert done.exit_code == 0
    document = json.loads(done.stdout)
    assert [row["model"] for row in document["models"]] == ["infinite plate", "run"]
    full = fecm.run_one(tmp_path / "d.inp")
    assert document["models"][1]["peak_force"] == pytest.approx(full.force.max(), rel=1e-9)
    assert document["models"][1]["threshold"] == pytest.approx(full.threshold["force"], rel=1e-12)


@pytest.mark.long
def test_a_model_out_of_its_range_is_marked(tmp_path: Path) -> None:
    ratios = {"small": 1e-6, "medium": 1.0, "large": 1e3}
    expected = {"small": [True, False], "medium": [False, False], "large": [False, True]}
    plate = load_deck(deck(mesh=HELD)).problems[0]
    text = ""
    for name, ratio in ratios.items():
        mass = ratio * plate.plate.area() * plate.laminate.mass
        text = deck(f"PROJ\n0, 0, {mass:.9g}\n\n", mesh=HELD)
        estimate = quick_estimate(load_deck(text).problems[0])
        assert estimate.mass_ratio == pytest.approx(ratio, rel=1e-6)
        assert [model.applies for model in estimate.models] == expected[name]
    (tmp_path / "d.inp").write_text(text)
    lines = call("estimate", "d.inp", cwd=tmp_path).stdout.splitlines()
    assert not any(line.startswith("  infinite plate") for line in lines)  # for small masses
    assert any(line.startswith("  static plate  ") for line in lines)


def test_a_held_plate_has_a_static_model_with_its_own_stiffness() -> None:
    (free,) = load_deck(deck()).problems
    assert np.isnan(quick_estimate(free).stiffness)
    program = "TANG\nFORM\nSOLV\nDISP\n"
    held = quick_estimate(load_deck(deck(mesh=HELD)).problems[0])
    static = fecm.run_one(
        small(program, mesh=HELD).replace("EXPE", "PATC\nDISC,.2,1.,1.,1000.\nEXPE")
    )
    w = static["tape3/w"][0, static["patch/node"] - 1] @ static["patch/weight"]
    assert held.stiffness == pytest.approx(1000.0 / w, rel=1e-9)
    assert [model.name for model in held.models] == ["infinite plate", "static plate"]


def test_models_reach_the_threshold_at_their_velocity() -> None:
    (problem,) = load_deck(deck("DELA\n.5,\n", mesh=HELD)).problems
    estimate = quick_estimate(problem)
    for model in estimate.models:
        segments = tuple(
            replace(s, velocity=model.velocity) if isinstance(s, Impact) else s
            for s in problem.deck.segments
        )
        again = quick_estimate(replace(problem, deck=replace(problem.deck, segments=segments)))
        (same,) = (m for m in again.models if m.name == model.name)
        assert same.impact.peak == pytest.approx(model.threshold, rel=1e-6)


def test_a_deck_without_impact_or_velocity_is_refused(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small("LMAS\nEIGE,2\n"))
    done = call("estimate", "d.inp", cwd=tmp_path)
    assert done.exit_code == 2
    assert "the deck has no impact" in done.stderr
    (tmp_path / "d.inp").write_text(deck().replace("     115.0", "       0.0"))
    done = call("estimate", "d.inp", cwd=tmp_path)
    assert done.exit_code == 2
    assert "the velocity of ROD is 0: the projectile does not approach" in done.stderr
