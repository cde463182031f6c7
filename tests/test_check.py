"""Checks of decks, and what a user of a wrong deck sees."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.problem import parts, problem
from fecm.problem.loading import load_deck
from fecm.problem.summary import deck_summary
from tests import decks
from tests.calls import call
from tests.decks import APPENDIX, DATA, LONG, MESH, PROGRAM, ROOT

WRONG = sorted((Path(__file__).parent / "wrong").glob("*.inp"))

# The small plate with a symmetric laminate, whose supports hold it in its plane at every node.
DATA_CARDS = decks.DATA_CARDS.replace("    2  90. ", "    2   0. ")


def small(program: str = PROGRAM, *, mesh: str = MESH, data: str = DATA_CARDS) -> str:
    """A deck of the small plate with a symmetric laminate."""
    return decks.small(program, mesh=mesh, data=data)


ENDLESS = PROGRAM.replace("         10", "      99999").replace("          5", "")


def codes(text: str) -> list[str]:
    """Codes of a deck's findings, without the projectile that small decks never give."""
    return [f.code for f in load_deck(text).findings if f.code not in ("N414", "W415")]


def with_data(old: str, new: str) -> str:
    """The small deck with a change in its data."""
    assert old in DATA_CARDS
    return small(data=DATA_CARDS.replace(old, new))


def test_check_and_run_of_a_deck_build_plate_and_laminate_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    built: Counter[str] = Counter()

    def count(module: ModuleType, name: str) -> None:
        original = getattr(module, name)

        def counted(*args: Any, **kwargs: Any) -> Any:
            built[name] += 1
            return original(*args, **kwargs)

        monkeypatch.setattr(module, name, counted)

    count(parts, "PlateModel")
    count(parts, "laminate")
    count(problem, "estimate_work")
    assert call("run", APPENDIX, "-o", tmp_path / "a.h5").exit_code == 0
    assert built == {"PlateModel": 1, "laminate": 1, "estimate_work": 1}
    slips = ("--slip", "g12", "-o", tmp_path / "b.h5")
    assert call("run", APPENDIX, *slips).exit_code == 0
    assert built == {"PlateModel": 3, "laminate": 3, "estimate_work": 2}


@pytest.mark.parametrize("deck", WRONG, ids=lambda path: path.stem)
def test_a_wrong_deck_shows_its_user_exactly_this(
    deck: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / deck.name).write_text(deck.read_text())
    monkeypatch.chdir(tmp_path)
    checked = call("check", deck.name)
    assert checked.exit_code == 1
    assert checked.stdout == deck.with_suffix(".txt").read_text()
    ran = call("run", deck.name)
    assert ran.exit_code == 2
    assert ran.stdout == ""
    assert ran.stderr.startswith(checked.stdout)
    assert [path.name for path in tmp_path.iterdir()] == [deck.name]


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        ("PATC\n\n", ["PATC"]),
        ("SHEA MITC\n", ["SHEA MITC"]),
        ("SHEA EQUI MITC\n", ["SHEA MITC", "SHEA EQUI"]),
        ("SHEA\n       0.9\n", []),
    ],
)
def test_listing_mode_refuses_words_that_the_printed_program_lacks(
    cards: str, words: list[str]
) -> None:
    findings = load_deck(small(data=cards + DATA_CARDS), "listing").findings
    values = [f.message for f in findings if f.code == "E603"]
    assert values == [f"The printed program has no {word}." for word in words]


def test_five_independent_errors_are_five_findings_in_one_run() -> None:
    deck = next(path for path in WRONG if path.stem == "five-errors")
    assert [f.code for f in load_deck(deck).findings] == ["E005", "E408", "E101", "E403", "E501"]


def test_the_summary_has_the_reports_critical_time_step_to_1_per_cent() -> None:
    checked = call("check", str(LONG))
    assert checked.exit_code == 0
    match = re.search(r"critical time step +([0-9.e+-]+)", checked.stdout)
    assert match is not None
    assert float(match[1]) == pytest.approx(0.4748e-6, rel=1e-2)
    for words in (
        "nodes               609",
        "equations           1827",
        "projectile mass",
        "16.5 MB",
    ):
        assert words in checked.stdout


def test_findings_and_summary_are_json_lines_for_programs() -> None:
    sound = call("check", str(LONG), "--format", "json")
    *findings, last = (json.loads(line) for line in sound.stdout.splitlines())
    assert [f["code"] for f in findings] == ["N414", "W415"]
    assert last["kind"] == "summary"
    assert last["equations"] == 1827
    assert last["D"][0][0] == pytest.approx(1287.414844365, rel=1e-10)
    wrong = call("check", str(WRONG[0]), "--format", "json")
    (finding,) = (json.loads(line) for line in wrong.stdout.splitlines())
    assert wrong.exit_code == 1
    assert finding["severity"] == "error"
    card = WRONG[0].read_text().splitlines()[finding["line"] - 1]
    assert card == finding["card"]
    assert card[finding["column"] - 1 : finding["end_column"]].strip() in finding["message"]


def test_check_runs_nothing_and_writes_nothing(tmp_path: Path) -> None:
    assert call("check", APPENDIX, cwd=tmp_path).exit_code == 0
    assert list(tmp_path.iterdir()) == []


def test_a_sound_deck_has_no_findings_but_the_projectile() -> None:
    assert [f.code for f in load_deck(APPENDIX).findings] == ["N414", "W415"]
    assert codes(small()) == []


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("    3    3   -3", "    3    3    0", "E402"),
        ("    3    3   -3", "    3    3    5", "E402"),
        ("    3    3   -3", "    5    3   -3", "W401"),
        ("    3    3   -3", "    1    3   -3", "E315"),
        ("    3    3   -3", "    3    2   -3", "E321"),
        ("  0.000148", "       0.0", "E403"),
        ("  1150000.", "       0.0", "E403"),
        ("       0.3 ", "      3.95 ", "E404"),
        ("    1   0.     0.053", "    1   0.     -.053", "E405"),
        ("    1   0.     0.053", "    7   0.     0.053", "W408"),
        ("      .106", "       0.0", "E406"),
        ("   13    3", "   26    3", "E408"),
        ("   13    3", "   13    6", "E409"),
        ("   13    3", "   13    1", "E410"),
        ("   13    3", "   13    4", "E413"),
        ("     115.0", "    -115.0", "E411"),
        ("     115.0", "       0.0", "W411"),
        ("  1912000.", "       -1.", "E412"),
        ("     0.094", "     1.094", "E412"),
        (" 17500000.", "   1.E+308", "E417"),
        ("   800000.\n", "   1.E-300\n", "E534"),
        ("EXPE", "EXPE\n  1912000. 0.0006564     0.094       2.0\nEXPE", "W204"),
    ],
)
def test_data_that_cannot_be_meant_are_found(old: str, new: str, code: str) -> None:
    assert codes(with_data(old, new)) == [code]


@pytest.mark.parametrize(
    ("program", "code"),
    [
        (PROGRAM.replace("RODP          5", "RODP         50"), "W510"),
        (PROGRAM.replace("DISP          5", "DISP         50"), "W510"),
        ("LMAS\n", "W511"),
        (PROGRAM.replace(".5E-6", ".8E-6"), "E508"),
        ("LOOP          9\n" + ENDLESS + "NEXT\n", "W512"),
        (PROGRAM.replace("TIME\n", ""), "W507"),
    ],
)
def test_a_program_that_makes_a_wrong_result_look_right_is_found(program: str, code: str) -> None:
    assert codes(small(program)) == [code]


def test_two_nodes_in_one_place_are_a_cut_in_the_plate() -> None:
    mesh = MESH.replace("    5    0       2.0       0.0", "    5    0       2.0       0.5")
    assert "W314" in codes(small(mesh=mesh)) or "E313" in codes(small(mesh=mesh))
    doubled = MESH.replace("   10    0       2.0", "   10    0       2.0")
    assert codes(small(mesh=doubled)) == []


def test_a_mesh_too_coarse_for_the_impacts_waves_is_found() -> None:
    assert "W415" in [f.code for f in load_deck(small()).findings]
    fine = (DATA / "plate-100x100x2.inp").read_text().replace("    3000.0", "     100.0")
    assert "W415" not in [f.code for f in load_deck(fine).findings]


def test_numbers_at_the_edge_of_their_range_end_in_findings_not_in_exceptions() -> None:
    # Velocities whose square is no number any more.
    for velocity in ("    1.E-300", "    1.E-200", "    1.E+300"):
        text = small(data=DATA_CARDS.replace("     115.0", velocity[1:]))
        assert load_deck(text).errors() == []


def test_a_clock_of_static_loads_has_no_critical_time_step() -> None:
    static = "DT         1.0\nTANG\nLOOP          3\nTIME\nFORM\nSOLV\nDISP\nNEXT\n"
    static_data = DATA_CARDS[DATA_CARDS.index("MATE") :]
    assert codes(small(static, data=static_data)) == []
    assert codes(small(static + "LMAS\nEXCD\n", data=static_data)) == ["E508"]


def test_control_characters_of_a_deck_never_reach_the_terminal() -> None:
    prepared = load_deck(small(data=DATA_CARDS.replace("     115.0", "  \x1b[31m\t5")))
    shown = "\n".join(finding.render("deck\x07.inp") for finding in prepared.findings)
    assert "E103" in shown
    assert shown.replace("\n", "").isprintable()
    card, caret = (line for line in shown.splitlines() if " | " in line)
    assert card[caret.index("^")] == "·"


def test_loops_that_would_run_for_years_are_found_at_once() -> None:
    years = "LMAS\nDT        .5E-6\n" + "LOOP      99999\n" * 9 + "TIME\nRODP\n" + "NEXT\n" * 9
    (finding,) = [f for f in load_deck(small(years)).findings if f.code.startswith("E")]
    assert finding.code == "E509"


def test_units_are_named_in_summary_and_result(tmp_path: Path) -> None:
    deck = tmp_path / "units.inp"
    deck.write_text(small(data="UNIT\nin lbf s\n" + DATA_CARDS))
    checked = call("check", str(deck))
    assert re.search(r"critical time step  \S+ s\n", checked.stdout)
    assert "lbf*in" in checked.stdout
    ran = call("run", str(deck), "-o", str(tmp_path / "u.h5"))
    assert re.search(r"peak force +at least \S+ lbf at time \S+ s", ran.stdout)
    import h5py

    with h5py.File(tmp_path / "u.h5") as file:
        assert file.attrs["unit_force"] == "lbf"
        assert file["history/acceleration"].attrs["unit"] == "in/s^2"
        assert "unit" not in file["tape8/gamma_xz"].attrs


@pytest.mark.parametrize("card", ["in lbf", "in lbf s lb", ""])
def test_units_need_three_names(card: str) -> None:
    assert codes(small(data=f"UNIT\n{card}\n" + DATA_CARDS)) == ["E010"]


@pytest.mark.parametrize("units", ["", "in lbf s", "inch lb sec"])
def test_the_reports_rod_is_a_note_of_one_line_in_a_deck_of_its_units(units: str) -> None:
    segment = f"UNIT\n{units}\n" if units else ""
    loaded = load_deck(small(data=segment + DATA_CARDS))
    (note,) = (finding for finding in loaded.findings if finding.code == "N414")
    line = note.render("small.inp")
    assert re.fullmatch(r"small.inp:\d+:1: note\[N414\]: no PROJ: the report's .* is taken", line)
    assert note.to_dict("small.inp")["severity"] == "note"


@pytest.mark.parametrize("units", ["mm N s", "in kip s", "in lbf ms", "furlong lbf s"])
def test_the_reports_rod_is_a_warning_in_a_deck_of_other_units(units: str) -> None:
    findings = load_deck(small(data=f"UNIT\n{units}\n" + DATA_CARDS)).findings
    (warning,) = (finding for finding in findings if finding.code in ("N414", "W414"))
    assert warning.severity == "warning"


def test_masses_are_shown_in_grams_beside_the_decks_unit() -> None:
    # 100 mm x 100 mm x 2 mm at 1.6e-9 t/mm^3; the report's plate of 6 x 4 x 0.106 in is 65.9 g.
    shown = call("check", str(DATA / "plate-100x100x2.inp")).stdout
    assert "plate mass          3.2e-05 N*s^2/mm (32 g)" in shown
    named = re.sub("^COOR", "UNIT\nin lbf s\nCOOR", APPENDIX.read_text(), flags=re.M)
    lines = deck_summary(load_deck(named).problems[0]).lines()
    (line,) = (line for line in lines if "plate mass" in line)
    assert float(line.split("(")[1].split()[0]) == pytest.approx(65.94, rel=1e-3)
    assert line.endswith(" g)")


def test_every_impact_has_its_elements_per_wave_in_the_summary() -> None:
    # The report's mesh: its first peak of 78.7 lb goes down to 75.5 lb on one eight times as fine.
    view = deck_summary(load_deck(APPENDIX).problems[0])
    assert view.elements_per_wave == pytest.approx(6.83, abs=0.01)
    assert view.mesh_error == pytest.approx(78.7 / 75.5 - 1.0, rel=0.5)
    assert re.search(
        r"elements per wave +6\.8 \(mesh error of the peak about", "\n".join(view.lines())
    )
    frequencies = deck_summary(load_deck(ROOT / "decks" / "natural-frequencies.inp").problems[0])
    assert frequencies.elements_per_wave is None


@pytest.mark.parametrize("velocity", ["    -115.0", "     -1E-9"])
def test_a_velocity_away_from_the_plate_is_refused(velocity: str) -> None:
    (error,) = load_deck(with_data("     115.0", velocity)).errors()
    assert (error.code, error.place.field if error.place else "") == (
        "E411",
        "cols 11-20: impact velocity",
    )
    assert "must be positive" in error.message


def test_a_checkerboard_of_a_free_plate_runs_only_when_forced() -> None:
    reduced = with_data("    3    3   -3", "    3    2   -3")
    prepared = load_deck(reduced)
    assert [f.code for f in prepared.errors()] == ["E321"]
    assert prepared.errors(force=True) == []
    # The printed program takes L1 for L2, so that nothing is wrong there.
    assert load_deck(reduced, "listing").errors() == []


@pytest.mark.parametrize(
    ("cards", "code"),
    [
        ("    1    1   -1   -1    0    0    0\n    2    0    1    1    1    0    0", "W319"),
        ("    1    1   -1   -1   -1    0    0\n    3    0    1    1    1    0    0\n"
         "    4    1   -1   -1    0    0    0", ""),
    ],
    ids=["one", "three"],
)  # fmt: skip
def test_one_or_two_nodes_that_hold_w_are_no_support(cards: str, code: str) -> None:
    start, end = MESH.index("BOUN\n"), MESH.index("   25    0    1    1")
    mesh = f"{MESH[:start]}BOUN\n{cards}\n    5    1   -1   -1    0    0    0\n{MESH[end:]}"
    assert codes(small(mesh=mesh)) == ([code] if code else [])


def test_a_contact_too_stiff_for_the_time_step_is_found_before_the_run() -> None:
    base = (DATA / "plate-100x100x2.inp").read_text()
    for k, actual in (("  100000.0", False), ("       4E6", False), ("       1E7", True)):
        text = base.replace("  100000.0     0.017", f"{k}     0.017")
        assert ("W517" in codes(text)) is actual


def test_impact_steps_beside_central_differences_are_warned_of() -> None:
    assert codes(small(PROGRAM + "EXCD\n")) == ["W518"]


def test_an_impact_deck_that_moves_its_plate_without_the_projectile_is_doubted() -> None:
    assert codes(small("LMAS\nEIGE          2\n")) == []
    assert codes(small("LMAS\nDT        .5E-6\nLOOP          3\nTIME\nDISP\nNEXT\n")) == ["E519"]


def test_a_thickness_whose_cube_is_beyond_the_range_of_numbers_is_found() -> None:
    thick = DATA_CARDS.replace("      .106", "   2.E+110").replace("    0.053", "  1.E+110")
    assert "E417" in codes(small(data=thick))


def test_a_stiffness_beyond_all_range_is_found_where_the_time_step_is_left_to_the_run() -> None:
    text = with_data(" 17500000.", "   1.E+308").replace("DT        .5E-6", "DT          0.0")
    assert codes(text) == ["E417"]
    modes = text[: text.index("MACR")] + "MACR\nLMAS\nEIGE          1\nEND\nSTOP\n"
    assert np.isnan(deck_summary(load_deck(modes).problems[0]).critical_time_step)


def test_a_coupled_laminate_held_in_its_plane_at_every_node_is_a_finding() -> None:
    coupled = decks.small()
    assert "W318" in codes(coupled)
    assert "W318" not in codes(small())
    assert "W318" not in codes(coupled.replace(MESH[MESH.index("BOUN") :], ""))


def test_a_run_says_how_many_fewer_steps_the_time_step_of_dt_0_takes(tmp_path: Path) -> None:
    (tmp_path / "small.inp").write_text(small())
    shown = call("run", "small.inp", "--overwrite", cwd=tmp_path).stdout
    assert "time step" not in shown  # above half of the critical one
    (tmp_path / "small.inp").write_text(small(PROGRAM.replace(".5E-6", ".5E-7")))
    shown = call("run", "small.inp", "--overwrite", cwd=tmp_path).stdout
    actual = re.search(r"at most (\S+) of the .* DT 0 takes at least (\S+): (\S+) times", shown)
    assert actual is not None
    share, taken, fewer = map(float, actual.groups())
    critical = load_deck(tmp_path / "small.inp").problems[0].critical_time_step
    assert 0.9 * share < 0.5e-7 / critical < share
    assert 0.8 * critical < taken < 0.9 * critical
    assert fewer == pytest.approx(taken / 0.5e-7, rel=0.02)


def test_the_summary_has_impact_kinematics_cure_and_threshold() -> None:
    deck = fecm.impact(
        fecm.Plate.rectangle((100, 100), (4, 4), support="simple"),
        fecm.Laminate("[0/90]2s", "T300/5208", 0.25),
        fecm.RigidMass(2e-3),
        fecm.Contact(5e4),
        velocity=1000.0,
        duration=1e-4,
        units="mm-N-s",
        cure=-155.0,
        giic=0.5,
    )
    view = deck_summary(load_deck(deck).problems[0])
    assert (view.velocity, view.cure) == (1000.0, -155.0)
    assert view.energy == pytest.approx(1000.0, rel=1e-12)  # N*mm: 1 J
    lines = "\n".join(view.lines())
    for line in (
        "impact              1000 mm/s, 1 J",
        "thickness           2 mm",
        "cure                -155 K",
        "kinematics  ",
    ):
        assert line in lines
    assert "delamination        at the latest from " in lines
    several = re.sub(r"DELA\n.*", "DELA\n.5,7", deck.to_text())
    lines = "\n".join(deck_summary(load_deck(several).problems[0]).lines())
    assert re.search("delamination        from .* N .7 delaminations", lines)


def test_the_coupling_of_a_symmetric_laminate_is_printed_as_zero() -> None:
    (problem,) = fecm.check(ROOT / "decks/impact-115.inp").problems
    assert np.abs(problem.B).max() > 0.0  # rounding
    lines = problem.lines()
    start = next(n for n, line in enumerate(lines) if line.startswith("  B "))
    assert [line.split()[-3:] for line in lines[start : start + 3]] == [["0", "0", "0"]] * 3
