"""The page on measured specimens has the figures of the data and of the threshold."""

from __future__ import annotations

import csv
import re
from math import pi, sqrt

import pytest

import fecm
from fecm.mechanics.laminate import threshold_force
from fecm.problem.loading import load_deck
from tests.decks import ROOT

PAGE = (ROOT / "docs" / "measured.md").read_text(encoding="utf-8")
# 27 specimens in groups of three: Data in Brief 42 (2022) 108462 and 60 (2025) 111509.
with (ROOT / "tests" / "data" / "measured_areas.csv").open(newline="") as file:
    GROUPS = list(csv.DictReader(file))
# F_d of the page's table, by layup.
FORCES = re.findall(r"^\| (\[\S+) \| (\d+) N \|", PAGE, re.MULTILINE)


@pytest.mark.parametrize("row", GROUPS, ids=lambda row: f"{row['layup']}-{row['energy J']}")
def test_the_page_shows_the_means_of_the_measured_groups(row: dict[str, str]) -> None:
    area, energy = float(row["area mm2"]), float(row["energy J"])
    line = (
        f" | {row['thickness mm']} mm | {energy:.2f} J"
        f" | {area:.0f} ± {float(row['sd mm2']):.0f} mm² | {area / energy:.1f} mm²/J |"
    )
    assert line in PAGE


def test_the_groups_are_27_specimens() -> None:
    assert sum(int(row["specimens"]) for row in GROUPS) == 27


@pytest.mark.parametrize(("layup", "force"), FORCES)
@pytest.mark.few(2)  # of 5, 0.2 s each
def test_the_page_shows_the_threshold_of_the_first_group_of_a_layup(layup: str, force: str) -> None:
    row = next(row for row in GROUPS if row["layup"] == layup)
    deck = fecm.impact(
        fecm.Plate.on_fixture("D7136", (4, 4)),
        fecm.Laminate(layup, "T800S/M21", float(row["thickness mm"]) / int(row["plies"])),
        contact=fecm.Contact(4e4, 0.0, 0.0, 1.5),
        energy=1000.0,
        duration=1e-4,
        dt=1e-7,
        damage=True,
        units="mm-N-s",
    )
    (problem,) = load_deck(deck.to_text()).problems
    assert problem.threshold
    assert problem.threshold.force == pytest.approx(float(force), abs=0.6)


def test_all_thresholds_of_the_page_are_tested() -> None:
    assert {layup for layup, _ in FORCES} == {row["layup"] for row in GROUPS}


def test_the_formula_of_the_area_gives_the_number_of_delaminations_of_the_page() -> None:
    # [45/0/-45/90]3s at 15.47 J: E_d = 4.67 J of the page, G_IIc of the ply, area of the data.
    toughness = fecm.materials()["T800S/M21"].constants("mm-N-s")["GIIc"]
    value = (15.47 - 4.67) * 1e3 / (2.0 * toughness * 534.3)
    assert f"{value:.1f} at 15.47 J" in PAGE


def test_the_threshold_of_bvid_fe_is_that_of_dela_over_the_root_of_twelve() -> None:
    # For an isotropic plate, as the page "How it compares" says.
    rigidity, toughness = 43956.044, 0.8
    of_bvid_fe = pi * sqrt(8.0 * toughness * rigidity / 9.0)
    assert threshold_force(rigidity, toughness, 1) / of_bvid_fe == pytest.approx(sqrt(12.0))
