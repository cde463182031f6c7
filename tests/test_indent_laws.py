"""The two laws of what remains, Hertz' coefficient, EXPE ACR in a deck, named contacts."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.deck.catalogue import CONTACTS
from fecm.deck.format import format_deck
from fecm.deck.model import Indentation
from fecm.mechanics.contact_law import YangSunPermanent, hertz_coefficient
from fecm.problem.loading import load_deck
from tests.calls import call
from tests.decks import DATA_CARDS, LONG, small
from tests.indentation_tests import K

ALPHA_CR = 3.16e-3
HALF_INCH = "  1330000. 0.0006564     0.094       2.5\n"
LAW_CARD = "  1912000. 0.0006564     0.094       2.0\n"


# The laws and their numbers ----------------------------------------------------------------------


def rigidities(tmp_path: Path, *options: str) -> list[list[float]]:
    """Table of ``--rigidity`` for the 0.5 in indenter, without its header."""
    deck = tmp_path / "half.inp"
    deck.write_text(LONG.read_text().replace(LAW_CARD, HALF_INCH))
    done = call("indent", "curve", deck, "--rigidity", *options)
    assert done.exit_code == 0
    rows = list(csv.reader(io.StringIO(done.stdout)))
    assert rows[0] == ["alpha_m", "s_3_9", "s_3_7"]
    return [[float(cell) for cell in row] for row in rows[1:]]


def test_rigidities_at_four_thousandths_are_the_reports(tmp_path: Path) -> None:
    peak, by_3_9, by_3_7 = rigidities(tmp_path, "--path", "3e-3,4e-3", "--points", "1")[1]
    assert peak == 4e-3
    assert by_3_9 / K == pytest.approx(306.7, abs=0.06)
    assert by_3_7 / K == pytest.approx(316.5, abs=0.05)


def test_the_two_rigidities_differ_most_at_alpha_cr_by_21_percent(tmp_path: Path) -> None:
    rows = rigidities(tmp_path, "--path", "0,4e-3", "--points", "400")
    peak, by_3_9, by_3_7 = max(rows, key=lambda row: abs(row[1] / row[2] - 1.0))
    assert peak == pytest.approx(3.16e-3, abs=1e-9)
    assert by_3_9 / by_3_7 - 1.0 == pytest.approx(0.21, abs=0.005)


def test_hertz_is_the_sphere_on_a_half_space() -> None:
    # A rigid sphere, E* = E_t: F = 4/3 E* R^1/2 alpha^3/2; equal moduli halve it at nu = 0.
    assert hertz_coefficient(4.0, 1e30, 0.3, 3.0) == pytest.approx(8.0, rel=1e-12)
    assert hertz_coefficient(4.0, 3.0, 0.0, 3.0) == pytest.approx(4.0, rel=1e-12)
    done = call("indent", "hertz", "--radius", 4, "--es", 3, "--nus", 0, "--et", 3)
    assert done.stdout.splitlines()[1].split() == ["4.0", "0.0", "0.0", "1.5"]


def test_the_alpha_cr_law_unloads_with_one_rigidity() -> None:
    law = YangSunPermanent(K, ALPHA_CR)
    assert law.permanent(3.1e-3) == 0.0
    assert law.permanent(0.0) == law.permanent(-1.0) == 0.0
    peaks = np.array([3.2e-3, 4e-3, 8e-3])
    np.testing.assert_allclose(law.rigidity(peaks), K / ALPHA_CR, rtol=1e-12)
    expected = [a * (1.0 - (ALPHA_CR / a) ** 0.4) for a in peaks]
    np.testing.assert_allclose(law.permanent(peaks), expected, rtol=1e-12)
    assert law.permanent(4e-3) == pytest.approx(expected[1], rel=1e-12)


# EXPE ACR in a deck ------------------------------------------------------------------------------


def acr_deck(card: str, word: str = "ACR", program: str = "") -> str:
    """The small plate with another law."""
    data = DATA_CARDS.replace("EXPE\n" + LAW_CARD, f"EXPE {word}\n{card}\n")
    return small(program, data=data) if program else small(data=data)


def test_expe_acr_is_read_written_and_aligned() -> None:
    deck = fecm.read_one(acr_deck("  1912000.   0.00316"))
    law = deck.require(Indentation)
    assert (law.k, law.alpha_p, law.word) == (1.912e6, 0.00316, "ACR")
    assert fecm.read_deck(deck.to_text()) == deck
    aligned = format_deck(acr_deck("1912000., 0.00316"))
    assert fecm.read_deck(aligned) == deck


def test_a_run_of_expe_acr_leaves_what_equation_3_7_says() -> None:
    program = "LMAS\nDT        .5E-6\nLOOP        200\nTIME\nRODP         50\nNEXT\n"
    result = fecm.run(acr_deck("  1912000.   0.0001", program=program))
    other = fecm.run(small(program))
    assert isinstance(result, Result)
    assert isinstance(other, Result)
    peak = result.indentation.max()
    assert peak > 2e-4
    assert result.indentation[-1] < peak
    left = float(result.history.attributes["permanent_indentation"])
    assert left == pytest.approx(peak * (1.0 - (1e-4 / peak) ** 0.4), rel=1e-12)
    assert np.abs(result.force - other.force).max() > 1.0
    top = int(result.indentation.argmax())
    falls = np.diff(result.indentation[top:]) < 0.0
    falling = top + 1 + np.arange(int(np.argmin(falls)))
    assert len(falling) > 3
    expected = 1.912e6 / 1e-4 * (result.indentation[falling] - left) ** 2.5
    np.testing.assert_allclose(result.force[falling], expected, rtol=0.03)


@pytest.mark.parametrize(
    ("card", "what"),
    [
        ("  1912000.       0.0", "critical indentation alpha_cr"),
        ("  1912000.   0.00316     0.094", "constant s_p"),
        ("  1912000.   0.00316       0.0       2.0", "unloading power q"),
        ("       0.0   0.00316", "contact coefficient k"),
    ],
)
def test_expe_acr_with_a_wrong_constant_is_an_error(card: str, what: str) -> None:
    (error,) = load_deck(acr_deck(card)).errors()
    assert error.code == "E412"
    assert what in error.message


def test_another_word_behind_expe_is_warned_of_and_not_read() -> None:
    prepared = load_deck(acr_deck(LAW_CARD.rstrip(), "ARC"))
    assert prepared.errors() == []
    assert "W416" in {finding.code for finding in prepared.findings}
    assert prepared.problems[0].deck.require(Indentation).word == ""


# Named contacts ----------------------------------------------------------------------------------


def test_named_contacts_have_the_coefficients_of_table_3_1() -> None:
    table = {
        "report-0.5": 1.330e6, "report-0.5a": 1.284e6, "report-0.5b": 1.376e6,
        "report-0.75": 1.912e6, "report-0.75a": 1.833e6, "report-0.75b": 1.990e6,
        "report-0.5-fit": 1.330e6, "report-0.75-fit": 1.912e6,
        "yang-0.5": 9.694e5,
    }  # fmt: skip
    assert {name: contact.law.k for name, contact in CONTACTS.items()} == table
    done = call("indent", "contacts", "--format", "json")
    listed = [json.loads(line) for line in done.stdout.splitlines()]
    assert {one["name"]: one["k"] for one in listed} == table


def test_contacts_convert_to_other_units() -> None:
    law = CONTACTS["report-0.5"].converted("mm-N-s")
    assert law.k == pytest.approx(1.330e6 * 4.4482216 / 25.4**1.5, rel=1e-5)
    assert law.alpha_p == pytest.approx(6.564e-4 * 25.4, rel=1e-5)
    assert (law.s_p, law.q) == (0.094, 2.5)


PLATE = ("new", "-", "--size", "6x4", "--mesh", "6x4", "--layup", "[0/90]s", "--ply-thickness",
         ".0265", "--velocity", "115", "--duration", "1e-5")  # fmt: skip


def test_a_new_deck_takes_a_named_contact_in_the_plys_units() -> None:
    done = call(*PLATE, "--material", "report", "--contact", "yang-0.5")
    deck = fecm.read_one(done.stdout)
    assert deck.require(Indentation) == Indentation(9.694e5, 3.16e-3, 0.0, 2.5, "ACR")
    metric = call(
        *PLATE,
        "--material",
        "report",
        "--units",
        "m-N-s",
        "--contact",
        "report-0.75",
        "--projectile",
        "mass:0.05",
    )
    deck = fecm.read_one(metric.stdout)
    assert deck.require(Indentation).alpha_p == pytest.approx(6.564e-4 * 0.0254, rel=1e-5)


@pytest.mark.parametrize(
    "options",
    [
        ("--material", "report"),
        ("--material", "report", "--contact", "none"),
        ("--material", "report", "--contact", "yang-0.5", "--law", "1e6,0,0,2"),
        ("--ply", "1e-4,.3,2e7,1e6,8e5,8e5,8e5", "--contact", "yang-0.5"),
    ],
)
def test_a_new_deck_needs_one_law(options: tuple[str, ...]) -> None:
    done = call(*PLATE, *options)
    assert done.exit_code == 2
    assert "--contact" in done.stderr
    assert done.stdout == ""
