"""Heads of the pages of sweeps: the answers follow from the cases."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

import fecm
from fecm.report.content import Answer
from tests.decks import DATA_CARDS, PROGRAM, small

pytest.importorskip("jinja2")
pytest.importorskip("matplotlib")

from fecm.report.report import page_of

STEPS = PROGRAM.replace("LOOP         10", "LOOP        400")
PLAIN = small(STEPS, data=DATA_CARDS + "UNIT\nmm N s\n")
DELA = PLAIN.replace("EXPE", "DELA\n.22\nEXPE")
MASSES = (1e-4, 2e-4)  # t
VELOCITIES = (20.0, 60.0, 100.0, 140.0)


@pytest.fixture(autouse=True)
def _undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pictures out, which take most of the time."""
    monkeypatch.setattr("fecm.report.figures.drawn", lambda *_, **__: iter(()))


def answers_of(sweep: fecm.SweepResult) -> Mapping[str, str]:
    """Answers of the page of a sweep, by question."""
    lines = page_of({"sweep": sweep}).verdict
    return {
        line.question: f"{line.answer}{line.rest}" for line in lines if isinstance(line, Answer)
    }


def figures_of(sweep: fecm.SweepResult) -> Mapping[str, str]:
    """Headline figures of the page of a sweep, by name."""
    return {figure.name: str(figure.value) for figure in page_of({"sweep": sweep}).headlines}


def test_the_page_says_from_which_energy_of_mass_and_velocity_the_plate_delaminates() -> None:
    sweep = fecm.sweep(DELA, {"mass": MASSES, "velocity": VELOCITIES})
    energies = np.array([0.5 * m * v**2 for m in MASSES for v in VELOCITIES])  # mJ
    reached = sweep["peak_force"] > sweep["threshold_force"]
    assert 0 < reached.sum() < len(sweep)
    text = answers_of(sweep)["Delaminates"]
    assert text.startswith(f"in {reached.sum()} of 8 cases")
    for energy in (energies[reached].min(), energies[~reached].max()):
        assert f"{1e3 * energy:.4g} µJ" in text
    ends = f"{1e3 * energies.min():.4g} µJ to {energies.max():.4g} mJ"
    assert figures_of(sweep)["impact energy"] == ends


def test_one_velocity_after_the_other_brackets_the_energy() -> None:
    sweep = fecm.sweep(DELA, {"velocity": VELOCITIES, "mass": MASSES[:1]})
    energies = 0.5 * MASSES[0] * np.square(VELOCITIES) * 1e3  # µJ
    reached = sweep["peak_force"] > sweep["threshold_force"]
    least, most = energies[reached].min(), energies[~reached].max()
    assert least > most
    text = answers_of(sweep)["Delaminates"]
    assert text.endswith(f"at the latest from {least:.4g} µJ on; not up to {most:.4g} µJ")


def test_no_case_at_the_threshold_is_a_no_up_to_the_largest_energy() -> None:
    sweep = fecm.sweep(DELA, {"velocity": VELOCITIES[:1], "mass": MASSES})
    assert answers_of(sweep)["Delaminates"] == f"no, up to {0.5 * 2e-4 * 400 * 1e3:.4g} µJ"


def test_without_a_toughness_nothing_is_said_about_delamination() -> None:
    sweep = fecm.sweep(PLAIN, {"velocity": VELOCITIES[:2]})
    assert answers_of(sweep)["Delaminates"] == "not judged, as the deck has no DELA"


def test_the_page_of_a_search_begins_with_the_energy_and_its_bracket() -> None:
    sweep = fecm.sweep(DELA, until="threshold")
    text = answers_of(sweep)["Delaminates"]
    assert text.startswith(f"at the latest from {1e3 * sweep['found_energy'][0]:.4g} µJ on")
    assert text.endswith("bracketed to 1e-06 of the velocity")


def test_the_page_of_a_random_sweep_says_how_probable_delamination_is() -> None:
    sweep = fecm.sweep(DELA, random=["velocity=uniform:20,140"], samples=16)
    share = (sweep["peak_force"] > sweep["threshold_force"]).mean()
    ((question, text),) = answers_of(sweep).items()
    assert question.startswith("Probability that the peak force exceeds the delamination threshold")
    assert text.startswith(f"{share:.4g} (")


@pytest.mark.parametrize(("laws", "is_wide"), [(1, False), (2, True)])
def test_the_scatter_of_one_law_leaves_room_beside_it_on_the_first_sheet(
    laws: int, is_wide: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: dict[str, bool] = {}
    monkeypatch.setattr(
        "fecm.report.figures.drawn",
        lambda kind, *_, wide=False, **__: iter(drawn.update({kind: wide}) or ()),
    )
    random = ["velocity=uniform:20,140", "k=uniform:1e6,2e6"][:laws]
    page_of({"sweep": fecm.sweep(DELA, random=random, samples=16)})
    assert drawn["scatter"] is is_wide


def test_what_is_the_same_in_nearly_every_impact_has_no_row() -> None:
    page = page_of({"sweep": fecm.sweep(PLAIN, {"velocity": VELOCITIES[:2]})})
    results = next(section for section in page.sections if section.title == "Results")
    names = [row[0] for block in results.blocks for row in getattr(block, "rows", ())]
    assert "peak force" in names
    assert "contacts" not in names
