"""Decks made from what an engineer knows, and decks rewritten."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fecm
from fecm.deck.catalogue import MATERIALS
from fecm.deck.format import format_deck
from fecm.deck.grid import (
    ElementGrid,
    graded,
    grid_lines,
    listed_sections,
    longest_at,
    refined_sections,
    uniform_section,
)
from fecm.deck.layup import LayupError, parse_layup
from fecm.deck.model import (
    Allowables,
    Control,
    Deck,
    Delamination,
    Impact,
    Material,
    Patch,
    Projectile,
    Shear,
)
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck
from fecm.problem.parts import build_projectile
from tests.calls import assert_unusable, call, new
from tests.decks import APPENDIX, LONG, small

REPORT = [
    "--title", "**LOW VELOCITY IMPACT OF LAMINATED PLATE**",
    "--columns", "3*.5,8*.375,3*.5", "--rows", "1*.5,8*.375,1*.5",
    "--layup", "[0/45/0/-45/0]2s", "--ply-thickness", ".0053", "--material", "report",
    "--velocity", "115", "--law", "1912000,.0006564,.094,2.0",
    "--duration", "800e-6", "--dt", "2e-7", "--every", "20", "--patch", "none", "--shear", "full",
    "--precision", "double",
]  # fmt: skip
PLATE = [
    "--size", "0.3x0.2", "--mesh", "6x4", "--layup", "[0/90]s", "--ply-thickness", "0.25e-3",
    "--material", "T300/5208", "--units", "m-N-s", "--velocity", "3", "--law", "1e9,1e-5,.1,2.5",
    "--duration", "1e-4", "--projectile", "mass:0.05",
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "angles"),
    [
        ("[0/45/0/-45/0]2s", [0, 45, 0, -45, 0] * 2 + [0, -45, 0, 45, 0] * 2),
        ("[0_2/90]s", [0, 0, 90, 90, 0, 0]),
        ("[0_{2}/90]_{s}", [0, 0, 90, 90, 0, 0]),
        ("[0/90]T", [0, 90]),
        ("[±45]2s", [45, -45] * 2 + [-45, 45] * 2),
        ("[+-30/0]", [30, -30, 0]),
        ("[0/(45/-45)2/90]s", [0, 45, -45, 45, -45, 90, 90, -45, 45, -45, 45, 0]),
        ("0/90", [0, 90]),
        ("[ 22.5 / -67.5 ]", [22.5, -67.5]),
    ],
)
def test_layups_read_as_the_literature_writes_them(text: str, angles: list[float]) -> None:
    assert parse_layup(text) == angles


@pytest.mark.parametrize("text", ["", "[", "[]", "[0/]", "[0/x]", "[0/90]q", "[0]99999", "[0_0]"])
def test_what_is_no_layup_is_refused(text: str) -> None:
    with pytest.raises(LayupError):
        parse_layup(text)


def test_the_reports_numbers_give_the_reports_deck() -> None:
    answer = new(*REPORT)
    assert answer.exit_code == 0
    assert fecm.read_deck(answer.stdout) == fecm.read_deck(LONG)


def test_a_new_deck_is_sound_and_declares_its_units() -> None:
    answer = new(*PLATE)
    assert answer.exit_code == 0
    prepared = load_deck(answer.stdout)
    assert prepared.errors() == []
    deck = prepared.problems[0].deck
    assert deck.control == Control(117, 24, 4, 2, 5, 9)
    material = deck.require(Material)
    assert material.ply.e1 == 181e9
    assert material.integration.thickness == 1e-3
    assert deck.require(Impact).node == 59  # the middle of 13 x 9 nodes
    dt = next(m.value for m in deck.macros if m.word == "DT")
    critical = load_deck(answer.stdout).problems[0]
    from fecm.problem.parts import build_plate

    ratio = dt / critical_time_step(build_plate(critical.deck, critical.mesh))
    assert 0.8 < ratio <= 0.9


EQUI = Shear(assumed=True, equilibrium=True)


@pytest.mark.parametrize(
    ("options", "patch", "shear", "note"),
    [
        ([], Patch(), EQUI, "a uniform pressure of radius 0.000327 (0.327 of the "),
        (["--patch", "hertz"], Patch("HERT"), EQUI,
         "Hertz's pressure of radius 0.000377 (0.377 of the thickness) instead of a point force"),
        (["--patch", "disc:0.09"], Patch("DISC", 0.09), EQUI, "of radius 0.09 ins"),
        (["--patch", "none"], None, EQUI, "note: the deck has assumed shear strai"),
        (["--patch", "none", "--shear-factor", "1"], None, Shear(assumed=True), "(SHEA MITC)"),
        (["--shear", "full"], Patch(), None, "point force (PATC); omit it with --patch none"),
        (["--patch", "none", "--shear", "full"], None, None, ""),
    ],
)  # fmt: skip
def test_a_new_deck_has_patch_and_assumed_shear_and_says_so_in_a_line(
    options: list[str], patch: Patch | None, shear: Shear | None, note: str
) -> None:
    answer = new(*PLATE, *options)
    deck = fecm.read_one(answer.stdout)
    assert (deck.last(Patch), deck.last(Shear)) == (patch, shear)
    notes = [line for line in answer.stderr.splitlines() if line.startswith("fecm: note")]
    assert sum("SHEA MITC" in line or "PATC" in line for line in notes) == bool(note)
    assert note in "".join(notes)
    assert "W447" not in answer.stderr


@pytest.mark.parametrize("options", [[], ["--grading", "2"]])
def test_a_mesh_is_obeyed_whatever_the_radius_of_the_patch(options: list[str]) -> None:
    wide, narrow = (new(*PLATE, "--patch", f"disc:{c}", *options) for c in (0.09, 0.01))
    assert fecm.read_one(narrow.stdout).control.numel == 6 * 4
    assert "at the patch" not in wide.stderr
    assert "is larger than the radius of the patch, 0.01" in narrow.stderr  # W447
    wide_mesh, narrow_mesh = (generate(fecm.read_one(built.stdout)) for built in (wide, narrow))
    np.testing.assert_array_equal(wide_mesh.coordinates, narrow_mesh.coordinates)


@pytest.mark.parametrize("options", [["--patch", "disc:0.2"], ["--at", "0,0.1"]])
def test_a_patch_beyond_an_edge_is_refused_with_the_way_out(options: list[str]) -> None:
    answer = new(*PLATE, *options)
    assert (answer.exit_code, answer.stdout) == (2, "")
    assert "E445" in answer.stderr
    assert "fecm new --patch none" in answer.stderr


@settings(max_examples=30)
@given(st.floats(0.1, 100.0), st.integers(2, 12), st.floats(0.1, 0.9), st.floats(0.001, 0.9))
def test_a_side_is_refined_to_what_is_asked_and_not_much_further(
    length: float, count: int, part: float, share: float
) -> None:
    side = share * length / count
    built = refined_sections(length, count, part * length, 1.0, side)
    assert count <= len(built) < count * (1.0 - np.log(share)) + 8
    assert longest_at(built, part * length) <= side


def test_a_named_ply_is_converted_between_systems_of_units() -> None:
    ply = MATERIALS["T300/5208"].converted("in-lbf-s")
    assert ply.e1 == pytest.approx(181e9 / 6894.757, rel=1e-5)  # Pa in a psi
    assert ply.density == pytest.approx(1600 * 9.357e-8, rel=1e-3)  # kg/m^3 in lbf s^2/in^4
    assert MATERIALS["T300/5208"].converted("mm-N-s").density == pytest.approx(1.6e-9, rel=1e-6)


@pytest.mark.parametrize(
    ("support", "w", "theta_x", "theta_y"),
    [("free", 0, 0, 0), ("simple", 1, 0, 1), ("pinned", 1, 0, 1), ("clamped", 1, 1, 1)],
)
def test_supports_hold_what_their_names_say(
    support: str, w: int, theta_x: int, theta_y: int
) -> None:
    linear = ("--kinematics", "linear")
    deck = fecm.read_one(new(*PLATE, "--edge", f"left={support}", *linear).stdout)
    mesh = generate(deck)
    left = np.flatnonzero(mesh.coordinates[:, 0] == 0.0)
    inside = np.setdiff1d(np.arange(117), left)
    held = (mesh.equations == 0).astype(int)
    assert (held[left] == [1, 1, w, theta_x, theta_y]).all()
    assert (held[inside] == [1, 1, 0, 0, 0]).all()


def test_a_coupled_laminate_keeps_its_in_plane_unknowns() -> None:
    options = [o if o != "[0/90]s" else "[0/90]" for o in PLATE]
    deck = fecm.read_one(new(*options, "--edge", "left=clamped").stdout)
    mesh = generate(deck)
    assert (mesh.equations[mesh.coordinates[:, 0] > 0] > 0).all()


@pytest.mark.parametrize(
    "options",
    [
        ["--layup", "[0/"], ["--size", "6"], ["--mesh", "2.5x3"], ["--law", "1,2,3"],
        ["--at", "9,9"], ["--units", "cubits"], ["--material", "cheese"], ["--edge", "left=glued"],
        ["--columns", "3*1"], ["--duration", "-1"], ["--mesh", "2000x2000"], ["--velocity", "x"],
        ["--ply", "1,2,3,4,5,6,7"], ["--grading", "0.5"], ["--patch", "square:0.1"],
        ["--patch", "disc:0"], ["--patch", "disc:"],
        ["--shear", "reduced"],
    ],
)  # fmt: skip
def test_options_that_cannot_be_meant_exit_2(options: list[str]) -> None:
    answer = new(*PLATE, *options)
    assert_unusable(answer)


def test_a_new_deck_never_replaces_an_old_one_unasked(tmp_path: Path) -> None:
    target = tmp_path / "plate.inp"
    target.write_text("precious")
    refused = call("new", str(target), *PLATE)
    assert refused.exit_code == 2
    assert target.read_text() == "precious"
    assert call("new", str(target), *PLATE, "--overwrite").exit_code == 0
    assert load_deck(target).errors() == []


@given(st.floats(0.1, 100.0), st.integers(2, 30), st.floats(0.1, 0.9), st.floats(1.0, 20.0))
def test_a_graded_side_fills_its_length_and_is_finest_at_its_centre(
    length: float, count: int, part: float, ratio: float
) -> None:
    sections = graded(length, count, part * length, ratio)
    sizes = np.diff([0.0, *(section.end for section in sections)])
    assert len(sections) == count
    assert sections[-1].end == length
    assert (sizes > 0.0).all()
    at = int(np.argmin(sizes))
    assert (np.diff(sizes[: at + 1]) < 1e-5 * length).all()
    assert (np.diff(sizes[at:]) > -1e-5 * length).all()


def test_the_cards_of_a_grid_generate_its_nodes() -> None:
    grid = ElementGrid(listed_sections("2*0.5,1*0.25"), uniform_section(1.0, 2))
    deck = Deck("", Control(35, 6, 1, 2, 5, 9), (grid.coordinates(), grid.element_cards()), ())
    mesh = generate(deck)
    x, y = np.meshgrid(grid_lines(grid.columns), grid_lines(grid.rows))
    np.testing.assert_allclose(
        mesh.coordinates, np.column_stack([x.ravel(), y.ravel()]), atol=1e-12
    )
    centres = mesh.coordinates[mesh.elements[:, 8] - 1]
    corners = mesh.coordinates[mesh.elements[:, :4] - 1].mean(axis=1)
    np.testing.assert_allclose(centres, corners, atol=1e-12)


@pytest.mark.parametrize("path", [APPENDIX, LONG])
def test_formatting_changes_neither_model_nor_itself(path: Path) -> None:
    text = path.read_text()
    formatted = format_deck(text)
    assert formatted != text
    assert fecm.read_deck(formatted) == fecm.read_deck(text)
    assert format_deck(formatted) == formatted


BLANKS = """\
PATC
HERT                     3.0                25.0
ALLO
     100.0      90.0      40.0      80.0      20.0                30.0
                 0.4
DELA
       2.0
"""


@pytest.mark.parametrize(
    "cards",
    [BLANKS, "PATC\nHERT,,3.0,,25.0\nALLO\n100,90,40,80,20,,30\n,0.4,\nDELA\n2.0,\n"],
    ids=["columns", "commas"],
)
def test_formatting_keeps_fields_blank_whose_default_is_not_zero(cards: str) -> None:
    text = small().replace("END\nMACR", f"{cards}END\nMACR")
    deck = fecm.read_one(text)
    patch, strengths = deck.require(Patch), deck.require(Allowables)
    assert (patch.radius, patch.x, patch.y, patch.load) == (None, 3.0, None, 25.0)
    assert (strengths.s12, strengths.s13, strengths.s23) == (20.0, 20.0, 30.0)
    assert (strengths.f12, strengths.p_plus, strengths.p_minus) == (-0.5, 0.4, 0.3)
    assert deck.require(Delamination).number == 1.0
    assert fecm.read_deck(format_deck(text)) == deck
    assert fecm.read_deck(deck.to_text()) == deck


def test_a_formatted_deck_runs_to_the_same_tapes(tmp_path: Path) -> None:
    formatted = tmp_path / "formatted.inp"
    answer = call("fmt", str(APPENDIX), "-o", str(formatted))
    assert answer.exit_code == 0
    for path in (APPENDIX, formatted):
        out = tmp_path / f"{path.stem}.h5"
        assert call("run", str(path), "-o", str(out)).exit_code == 0
        assert call("tapes", str(out), "-d", str(tmp_path / path.stem)).exit_code == 0
    for name in ("tape3", "tape8", "tape9"):
        one, other = (tmp_path / stem / name for stem in ("appendix", "formatted"))
        assert one.read_bytes() == other.read_bytes()


def test_comments_stay_where_they_are() -> None:
    text = (
        small()
        .replace("COOR\n", "! corners first\nCOOR\n")
        .replace("   2.0\nMATE", "   2.0 ! q\nMATE")
    )
    formatted = format_deck(text)
    assert "! corners first\nCOOR\n" in formatted
    assert "       2.0  ! q\nMATE" in formatted


def test_rulers_name_the_columns_above_which_they_stand() -> None:
    lines_ = format_deck(small()).splitlines()
    row = lines_.index("ROD")
    assert lines_[row + 1 : row + 3] == ["!:nod  dof  velocity", "   13    3     115.0"]


def test_a_deck_that_cannot_be_read_is_left_alone(tmp_path: Path) -> None:
    deck = tmp_path / "wrong.inp"
    deck.write_text(small().replace("115.0", "1l5.0"))
    done = call("fmt", str(deck))
    assert done.exit_code == 2
    assert "E101" in done.stderr
    assert deck.read_text() == small().replace("115.0", "1l5.0")


def test_fmt_check_answers_whether_a_deck_would_change(tmp_path: Path) -> None:
    deck = tmp_path / "small.inp"
    deck.write_text(small())
    assert call("fmt", "--check", str(deck)).exit_code == 1
    assert call("fmt", str(deck)).exit_code == 0
    assert call("fmt", "--check", str(deck)).exit_code == 0


def test_a_new_deck_carries_its_own_projectile_in_its_own_units() -> None:
    rigid = new(*PLATE, "--projectile", "mass:0.05")
    assert rigid.exit_code == 0
    assert not {"N414", "W414"} & {f.code for f in load_deck(rigid.stdout).findings}
    deck = fecm.read_one(rigid.stdout)
    assert deck.require(Projectile) == Projectile(0, 0, 0.05)
    rod = fecm.read_one(new(*PLATE, "--projectile", "rod:.02,.016,210e9,7800").stdout)
    mass = 7800 * 0.02 * np.pi * 0.008**2
    assert build_projectile(rod).total_mass == pytest.approx(mass, rel=1e-9)


@pytest.mark.parametrize("text", ["0.05", "mass:", "mass:-1", "mass:x", "rod:1,2,3", "ball:1"])
def test_what_is_no_projectile_is_refused(text: str) -> None:
    result = new(*PLATE, "--projectile", text)
    assert result.exit_code == 2
    assert result.stdout == ""


def test_the_reports_rod_is_never_put_into_a_deck_of_other_units() -> None:
    options = PLATE[: PLATE.index("--projectile")]
    options = [option for option in options if option not in ("--units", "m-N-s")]
    for units in (["--units", "m-N-s"], ["--units", "mm-N-s"], []):
        refused = new(*options, *units)
        assert refused.exit_code == 2
        assert "give --projectile" in refused.stderr
        assert refused.stdout == ""
    assert new(*options, "--units", "in-lbf-s").exit_code == 0


def test_a_moved_impact_point_is_named_with_both_points_and_their_distance() -> None:
    moved = new(*PLATE, "--at", "0.103,0.11")
    assert "moved by 0.01044: from --at at 0.103, 0.11 to the nearest node, 57 at 0.1, 0.1" in (
        moved.stderr
    )
    assert "moved" not in new(*PLATE).stderr


def test_a_new_deck_shows_the_warnings_that_check_shows(tmp_path: Path) -> None:
    deck = tmp_path / "plate.inp"
    answer = call("new", str(deck), *PLATE, "--velocity", "3000")
    assert answer.exit_code == 0
    shown = [f.render(str(deck)) for f in load_deck(deck).findings]
    assert {"W415", "W435"} <= {f.code for f in load_deck(deck).findings}
    assert all(text in answer.stderr for text in shown)


def test_numbers_of_another_system_of_units_are_named_for_the_units_declared() -> None:
    si = "1580,.32,161e9,11.4e9,5.17e9,5.17e9,3.98e9"
    cut = PLATE.index("--material")
    options = [*PLATE[:cut], *PLATE[cut + 4 :], "--ply", si, "--units", "mm-N-s"]
    answer = new(*options)
    assert "W435" in answer.stderr
    assert "mass density 1580 is 1.58e+15 kg/m^3" in answer.stderr
