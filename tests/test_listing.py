"""Listing mode where a deck leaves the report's own: loads, counters, units, meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import DeckError, Result
from fecm.listing.slips import NAMES, Mode
from fecm.listing.variant import variant_of
from fecm.problem.loading import load_deck
from tests.calls import call
from tests.decks import DATA_CARDS, PROGRAM, ready, small

ZERO = "       0.0"
CENTRE = f"FORC\n   13    0{ZERO}{ZERO}       2.5\n\n"


# A 9-node element, and beside it one that has no node in its centre.
TWO_KINDS = """\
COOR
1, 1, 0.0, 0.0
5, 0, 2.0, 0.0
6, 1, 0.0, 0.5
8, 0, 1.0, 0.5
9, 0, 2.0, 0.5
10, 1, 0.0, 1.0
14, 0, 2.0, 1.0

ELEM
    1    1    3   12   10    2    8   11    6    7
    2    3    5   14   12    4    9   13    8

BOUN
    1    1   -1   -1    0    0    0
   14    0    1    1    0    0    0

"""
MIXED = (
    small(mesh=TWO_KINDS, data=DATA_CARDS.replace("   13    3", "    8    3"))
    .replace("   25    4", "   14    2")
    .replace(".5E-6", ".2E-6")
)


def run(text: str, mode: Mode = "listing", *slips: str) -> Result:
    """Result of a deck of one problem."""
    return fecm.run_one(text, mode=mode, slips=slips)


def test_rod_replaces_the_force_of_a_forc_before_it() -> None:
    alone, before = run(small()), run(small(data=CENTRE + DATA_CARDS))
    assert alone.tape3.w[-1, 12] > 0.0
    np.testing.assert_array_equal(before.tape3.w, alone.tape3.w)


def test_a_forc_behind_rod_scales_the_contact_force_that_the_plate_feels() -> None:
    # The listing's contact law sees a plate that stands still, so that the force is the same.
    alone, behind = run(small()), run(small(data=DATA_CARDS + CENTRE))
    np.testing.assert_array_equal(behind.force, alone.force)
    np.testing.assert_allclose(behind.tape3.w, 2.5 * alone.tape3.w, rtol=1e-12)
    nothing = run(small(data=DATA_CARDS + CENTRE.replace("2.5", "0.0")))
    assert nothing.force[-1] == alone.force[-1] > 0.0
    assert not nothing.tape3.w.any()


def test_the_report_adds_forc_and_contact_in_any_order() -> None:
    before, behind = (
        run(small(data=data), "report") for data in (CENTRE + DATA_CARDS, DATA_CARDS + CENTRE)
    )
    np.testing.assert_array_equal(behind.tape3.w, before.tape3.w)
    assert behind.tape3.w[-1, 12] > run(small(), "report").tape3.w[-1, 12]


def test_rodp_counts_from_its_last_output_against_the_n_of_its_own_card() -> None:
    start = "LMAS\nDT        .5E-6\n"
    changing = start + (
        "LOOP          4\nRODP          3\nNEXT\nLOOP         10\nRODP          4\nNEXT\n"
    )
    assert run(small(changing)).tape8.step.tolist() == [3, 7, 11]
    assert run(small(changing), "report").tape8.step.tolist() == [3, 8, 12]
    shrinking = start + (
        "LOOP          4\nRODP          5\nNEXT\nLOOP          5\nRODP          2\nNEXT\n"
    )
    # Four steps are counted already, so that the fifth only starts the count of two.
    assert run(small(shrinking)).tape8.step.tolist() == [7, 9]
    two = start + "LOOP          8\nRODP          5\nRODP          3\nNEXT\n"
    assert "tape8/step" not in run(small(two))
    assert run(small(two), "report").tape8.step.tolist() == [5, 6, 12, 15]


def test_stiffness_below_1e_6_is_lost_in_any_units() -> None:
    ply = "    3    3   -3      .01\n       1.0       0.3       1.0       1.0\n"
    ply = ply.replace("       1.0\n", "       1.0" + "  0.384615" * 3 + "\n")
    data = f"MATE\n{ply}    1   0.      0.01\n"
    text = small("LMAS\nLOOP\nDISP\nNEXT\n", data=data).replace(
        "   25    4    2    2", "   25    4    1    2"
    )
    report, listing = run(text, "report"), run(text)
    # E h³/12(1 - ν²) and E h/(1 - ν²).
    assert report.laminate.D[0, 0] == pytest.approx(1e-6 / 12.0 / 0.91, rel=1e-12)
    assert not listing.laminate.D.any()
    assert listing.laminate.A[0, 0] == pytest.approx(1e-2 / 0.91, rel=1e-12)
    assert listing.laminate.shear[0, 0] == pytest.approx(3.84615e-3, rel=1e-5)


def test_stiffness_of_the_reports_units_is_left_alone() -> None:
    report, listing = run(small(), "report"), run(small())
    for name in ("A", "B", "D"):
        np.testing.assert_array_equal(listing[f"laminate/{name}"], report[f"laminate/{name}"])


def test_prop_inside_a_loop_replaces_the_contact_force_on_the_plate() -> None:
    program = "LMAS\nDT        .5E-6\nPROP          1\nLOOP         20\nPROP\nRODP\nDISP\nNEXT\n"
    table = "    1    1       0.0       1.0     100.0\n"
    text = f"{small(program, stop=False)}{table}STOP\n"
    plate = ready(small()).plate
    result = run(text)
    moment = plate.mass @ result.tape3.displacement[-1][plate.mesh.equations > 0]
    # Leapfrog from rest under 100 lb in all steps but the first, which begins with PROP = 0.
    assert moment == pytest.approx(100.0 * (5e-7) ** 2 * 19 * 20 / 2, rel=1e-9)
    alone = program.replace("PROP          1\n", "").replace("PROP\n", "")
    np.testing.assert_array_equal(result.force, run(small(alone)).force)


def test_prop_between_two_loops_replaces_the_contact_force_of_one_step() -> None:
    program = (
        "LMAS\nDT        .5E-6\nLOOP         10\nRODP\nNEXT\nPROP\nLOOP         10\nRODP\n"
        "DISP         10\nNEXT\n"
    )
    plain = run(small(program.replace("PROP\n", "")))
    zero = "    1    1\nSTOP\n"  # a table of nothing
    actual = run(small(program.replace("PROP", "PROP          1"), stop=False) + zero)
    plate = ready(small()).plate
    rows = [r.tape3.displacement[-1][plate.mesh.equations > 0] for r in (plain, actual)]
    # The force that is missing in the first of the last ten steps moves the plate for all of them.
    missing = plate.mass @ (rows[0] - rows[1])
    assert missing == pytest.approx(plain.force[9] * (5e-7) ** 2 * 10, rel=1e-9)


def test_a_forced_edge_stands_at_its_whole_value_until_the_first_impact_step() -> None:
    held = "BOUN\n    1    5    0    0   -1    0    0\n   21    0    0    0   -1    0    0\n\n"
    forced = f"FORC\n    1    5{ZERO}{ZERO}     0.001\n   21    0{ZERO}{ZERO}     0.001\n\n"
    text = small("DISP\n" + PROGRAM, data=DATA_CARDS + held + forced)
    result = run(text)
    # The listing's one load factor is 1 at first, and then the contact force.
    np.testing.assert_array_equal(result.tape3.w[0, ::5], 1e-3)
    np.testing.assert_allclose(result.tape3.w[1:, 0], 1e-3 * result.force[[4, 9]], rtol=1e-12)


def test_a_mesh_of_two_kinds_of_elements_is_refused_with_the_reason() -> None:
    assert load_deck(MIXED).errors() == []
    with pytest.raises(DeckError, match=r"E601.*Element 2 has other nodes than element 1 \(8 ag"):
        fecm.run(MIXED, mode="listing")


def test_more_layers_than_the_arrays_hold_are_refused_with_the_reason() -> None:
    def layered(count: int) -> str:
        head = DATA_CARDS.partition("    1   0.")[0].replace("      .106", f"{0.005 * count:10.3f}")
        cards = "".join(f"{n:5}   0.     0.005\n" for n in range(1, count + 1))
        return small(data=head + cards).replace("4    2    2    5", f"4   {count}    2    5")

    assert load_deck(layered(25), "listing").errors() == []
    assert load_deck(layered(26)).errors() == []
    (actual,) = load_deck(layered(26), "listing").errors()
    assert (actual.code, "26 layers are more than the 25" in actual.message) == ("E602", True)
    assert actual.place is not None
    assert actual.place.text.startswith("   26")


def test_a_deck_that_listing_mode_refuses_is_unusable_input(tmp_path: Path) -> None:
    deck = tmp_path / "mixed.inp"
    deck.write_text(MIXED)
    done = call("run", deck, "--mode", "listing", "-o", tmp_path / "mixed.h5")
    assert done.exit_code == 2
    assert "error[E601]" in done.stderr
    assert call("check", deck, "--mode", "listing").exit_code == 1
    assert call("check", deck).exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["mixed.inp"]


@pytest.mark.parametrize("slip", NAMES)
def test_every_slip_changes_a_parameter_and_shares_it_with_no_other(slip: str) -> None:
    def changed(slips: frozenset[str]) -> set[tuple[str, str]]:
        return {
            (part, name)
            for part, values in variant_of(slips)._asdict().items()
            for name, value in values._asdict().items()
            if value != type(values)._field_defaults[name]
        }

    assert not changed(frozenset())
    assert changed(frozenset({slip}))
    assert not changed(frozenset({slip})) & changed(frozenset(NAMES) - {slip})
