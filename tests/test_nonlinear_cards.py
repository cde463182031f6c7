"""NONL and PREL in decks: what is refused or doubted, what new and check say, and sweeps."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.values import apply_case
from fecm.deck.findings import Finding
from fecm.deck.model import Boundary, Curvature, Delamination, Nonlinear, Preload, Shear
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck, sole_problem
from fecm.problem.parts import build_plate
from fecm.sweeps.backends import shares_plate
from tests.builders import DATA
from tests.calls import assert_unusable, call
from tests.decks import ROOT

LAW = fecm.Contact(1e5, 0.0, 0.0, 1.5)
MASS = fecm.RigidMass(1e-3)
PLIES = fecm.Laminate("[0/90]2s", "IM7/8552", 0.184)
QUICK: dict[str, Any] = {
    "velocity": 1000.0, "duration": 1e-5, "units": "mm-N-s", "patch": None
}  # fmt: skip
HELD = "    1    1   -1   -1    0    0    0\n"


def plate(support: Any = "clamped", **edges: Any) -> fecm.Plate:
    """A plate of 4 x 4 elements with 9 nodes."""
    return fecm.Plate.rectangle((100, 80), (4, 4), support=support, edges=edges)


def deck(**options: Any) -> fecm.Deck:
    """Deck of a nonlinear plate."""
    where = options.pop("plate", plate())
    return fecm.impact(where, PLIES, MASS, LAW, **QUICK | {"nonlinear": True} | options)


def findings(text: str | fecm.Deck, mode: Any = "report") -> dict[str, Finding]:
    """Findings of a deck by their codes."""
    return {finding.code: finding for finding in load_deck(text, mode).findings}


def with_codes(made: fecm.Deck, codes: np.ndarray[Any, Any]) -> fecm.Deck:
    """A deck with other restraint codes, (numnp, 5)."""
    others = tuple(s for s in made.segments if not isinstance(s, Boundary))
    rows = (fecm.deck.model.NodeCodes(n, 0, tuple(row)) for n, row in enumerate(codes.tolist(), 1))
    return replace(made, segments=(*others, Boundary(tuple(rows))), text="")


# What is refused ---------------------------------------------------------------------------------


def test_a_nonlinear_deck_of_new_has_no_findings_of_its_words() -> None:
    for in_plane in ("held", "normal", "free"):
        codes = findings(deck(in_plane=in_plane, preload=(5.0, 5.0)))
        assert codes.keys() <= {"W415"}  # its mesh is coarse


def test_a_plane_that_is_held_everywhere_is_an_error_at_the_card_of_nodes_inside() -> None:
    linear = fecm.impact(plate(), PLIES, MASS, LAW, kinematics="linear", **QUICK).to_text()
    deck_findings = findings(linear.replace("EXPE\n", "NONL\nEXPE\n"))
    assert deck_findings.keys() == {"E490"}
    assert deck_findings["E490"].place is not None
    codes = deck_findings["E490"].place.text.split()[2:]
    assert codes == ["-1", "-1", "0", "0", "0"]
    assert "fecm new --nonlinear --in-plane" in deck_findings["E490"].hint
    # What the hint says, done on every card of such nodes.
    mended = linear.replace("   -1   -1    0    0    0\n", "    0    0    0    0    0\n")
    mended = mended.replace("    1    1    0    0    0\n", "    0    0    0    0    0\n")
    assert "E490" not in findings(mended.replace("EXPE\n", "NONL\nEXPE\n"))


def test_supports_in_the_plane_at_single_nodes_are_enough() -> None:
    codes = generate(deck(in_plane="free")).codes
    codes[:, :2] = 1
    assert "E490" in findings(with_codes(deck(), codes))
    codes[40, 0] = 0
    assert "E490" not in findings(with_codes(deck(), codes))


@pytest.mark.parametrize("word", ["NONL", "PREL"])
def test_listing_mode_refuses_the_word(word: str) -> None:
    built = fecm.read_one(deck(preload=(5, 5)).to_text())
    other = Preload if word == "NONL" else Nonlinear
    left = tuple(s for s in built.segments if not isinstance(s, other))
    actual = load_deck(replace(built, segments=left, text="").to_text(), "listing").errors()
    assert f"The printed program has no {word}." in [finding.message for finding in actual]


def test_a_nonlinear_plate_has_no_sparse_matrix_and_no_transposed_jacobian(tmp_path: Path) -> None:
    path = tmp_path / "d.inp"
    path.write_text(deck().to_text())
    for option, name in (("--solver", "csr"), ("--slip", "jacobian")):
        done = call("run", path, option, name, cwd=tmp_path)
        assert_unusable(done)
        assert name in done.stderr
        assert "NONL" in done.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["d.inp"]
    with pytest.raises(ValueError, match="take one of auto, kernels, numpy"):
        fecm.run(path, solver="csr")


# What is doubted ---------------------------------------------------------------------------------


def half(u: int) -> fecm.Deck:
    """The left half of a plate, its right edge on a line of symmetry; `u` is the code of u there.

    The other edges are clamped and free in the plane.
    """
    text = deck(in_plane="free", plate=plate(right="free"))
    mesh = generate(text)
    codes = mesh.codes.copy()
    line = mesh.coordinates[:, 0] == 100.0
    codes[line, 0] = u
    codes[line, 3] = 1
    return with_codes(text, codes)


def test_a_line_of_symmetry_that_may_move_across_itself_is_named() -> None:
    doubt = findings(half(0))["W495"]
    assert doubt.message.startswith("On the edge x = 100 theta_x is restrained at 7 nodes")
    assert "W495" not in findings(half(1))


def test_clamped_edges_that_slide_are_no_lines_of_symmetry() -> None:
    assert "W495" not in findings(deck(in_plane="free"))
    assert "W495" not in findings(deck(in_plane="free", plate=plate("simple")))


@pytest.mark.parametrize(
    ("forces", "share"), [((800.0, 0.0), None), ((1500.0, 0.0), 1.12), ((0.0, 0.0, 100.0), 1.28)]
)
def test_a_preload_beyond_one_per_cent_strain_is_doubted(
    forces: tuple[float, ...], share: float | None
) -> None:
    # E of [0/90]2s in tension is (E1 + E2)/2 but for contraction, its shear modulus G12.
    codes = findings(deck(preload=forces))
    assert ("W484" in codes) == (share is not None)
    if share is not None:
        said = float(codes["W484"].message.split()[-1].rstrip("%."))
        assert said == pytest.approx(share, rel=0.03)


def test_a_preload_bends_an_unsymmetric_laminate_unless_it_is_zero() -> None:
    impact_deck = fecm.impact(
        plate(), fecm.Laminate("[0/90]", "IM7/8552", 0.184), MASS, LAW, **QUICK
    )
    text = impact_deck.to_text()
    loaded, empty = (findings(text.replace("EXPE\n", f"PREL\n{n},\nEXPE\n")) for n in ("1.", "0."))
    assert "E483" in loaded
    assert "E483" not in empty
    assert "W485" in empty


# What new writes ---------------------------------------------------------------------------------


def test_a_linear_deck_of_new_writes_none_of_the_words() -> None:
    linear = fecm.impact(plate(), PLIES, MASS, LAW, kinematics="linear", **QUICK)
    assert not linear.has(Nonlinear)
    assert not linear.has(Preload)
    assert (generate(linear).codes[:, :2] != 0).all()


def test_a_nonlinear_plate_lies_on_the_window_of_its_fixture() -> None:
    impact_deck = fecm.impact(
        fecm.Plate.on_fixture("D7136", (6, 4)),
        fecm.Laminate("[45/0/-45/90]3s", "IM7/8552", 0.184),
        nonlinear=True,
        duration=1e-5,
    )
    mesh = generate(impact_deck)
    assert not mesh.codes[:, :2].any()
    assert mesh.codes[:, 2].any()


def test_the_time_step_is_that_of_all_five_unknowns() -> None:
    # Fibres along the short sides of the elements are in the middle of the laminate only: there
    # the plate is faster in its plane than in bending.
    plies = fecm.Laminate("[90_3/0]s", "IM7/8552", 1.5)
    narrow = fecm.Plate.rectangle((40, 400), (8, 4), support="clamped")
    steps = []
    for nonlinear in (False, True):
        impact_deck = fecm.impact(narrow, plies, MASS, LAW, **QUICK | {"nonlinear": nonlinear})
        (dt,) = (macro.value for macro in impact_deck.macros if macro.word == "DT")
        critical = critical_time_step(build_plate(impact_deck, generate(impact_deck)))
        assert 0.86 * critical < dt <= 0.9 * critical
        steps.append(dt)
    assert steps[1] < 0.8 * steps[0]


def test_a_preload_takes_units_and_a_missing_shear_is_zero() -> None:
    impact_deck = fecm.impact(
        fecm.Plate.rectangle((0.1, 0.08), (4, 4), support="clamped"),
        fecm.Laminate("[0/90]2s", "IM7/8552", 1.84e-4),
        fecm.RigidMass(1.0),
        fecm.Contact(1e9, 0.0, 0.0, 1.5),
        velocity=1.0,
        duration=1e-5,
        units="m-N-s",
        preload=("50N/mm", -20.0),
    )
    assert impact_deck.require(Preload) == Preload(50e3, -20.0, 0.0)


@pytest.mark.parametrize(
    ("dt", "giic", "radius"),
    [(2e-7, 0.8, 1000.0), ("0.2us", "800J/m^2", "1m"), ("2e-7", "0.8N/mm", "1000")],
)
def test_step_toughness_and_radii_take_units(
    dt: float | str, giic: float | str, radius: float | str
) -> None:
    impact_deck = fecm.impact(
        fecm.Plate.rectangle((100, 80), (4, 4), support="simple"),
        fecm.Laminate("[0/90]2s", "IM7/8552", 0.184),
        fecm.RigidMass(1e-3),
        fecm.Contact(1e5, 0.0, 0.0, 1.5),
        velocity=1000.0,
        duration=1e-5,
        units="mm-N-s",
        dt=dt,
        giic=giic,
        radius_x=radius,
        radius_y=radius,
    )
    assert impact_deck.require(Delamination).toughness == pytest.approx(0.8, rel=1e-8)
    curvature = impact_deck.require(Curvature)
    assert (curvature.radius_x, curvature.radius_y) == (1000.0, 1000.0)
    assert next(m.value for m in impact_deck.macros if m.word == "DT") == 2e-7


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--dt", "4mm"], "--dt is '4mm', not a number or one with a unit, as in 4ms"),
        (["--giic", "3J"], "as in 50N/mm"),
        (["--radius-x", "1kg"], "--radius-x is '1kg'"),
        (["--nonlinear", "--shear", "full"], "--kinematics von-karman needs assumed shear strains"),
        (["--preload", "5"], "NX,NY[,NXY]"),
        (["--preload", "5J,3"], "as in 50N/mm"),
        (["--preload", "inf,3"], "--preload"),
        (["--preload", "1,2,3,4"], "NX,NY[,NXY]"),
    ],
)
def test_new_says_what_is_wrong_with_the_options(options: list[str], said: str) -> None:
    done = call(
        *("new", "-", "--size", "100x80", "--mesh", "4x4", "--layup", "[0/90]2s"),
        *("--material", "IM7/8552", "--ply-thickness", "0.184", "--velocity", "1000"),
        *("--law", "1e5,0,0,1.5", "--projectile", "mass:1e-3", "--duration", "1e-5", *options),
    )
    assert_unusable(done)
    assert said in done.stderr


@pytest.mark.parametrize("preload", [5.0, (1.0,), (1.0, 2.0, 3.0, 4.0), (np.nan, 1.0), (None, 1.0)])
def test_a_preload_that_is_no_force_is_refused(preload: Any) -> None:
    with pytest.raises(ValueError, match=r"`preload` is .*, not"):
        deck(preload=preload)


def test_a_mesh_of_a_generator_is_held_in_its_plane_as_asked() -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    hole = fecm.Plate.from_mesh(DATA / "hole-quad8.msh", {"clamped": "clamped"})
    for in_plane, expected in (("held", True), ("free", False)):
        text = deck(plate=hole, in_plane=in_plane, at=(15, 20))
        codes = generate(text).codes != 0
        assert text.require(Shear).assumed
        assert (codes[:, :2] == (codes[:, 2:3] & expected)).all()


# What check says ---------------------------------------------------------------------------------


def test_check_names_kinematics_and_preload_in_one_line_each(tmp_path: Path) -> None:
    path = tmp_path / "d.inp"
    path.write_text(deck(preload=(50.0, -2.5)).to_text())
    lines = call("check", path).stdout.splitlines()
    assert "  kinematics          von Kármán plate, u and v free at 49 of 81 nodes" in lines
    assert "  preload             N0x 50 N/mm, N0y -2.5 N/mm, N0xy 0 N/mm" in lines
    summary = json.loads(call("check", path, "--format", "json").stdout.splitlines()[-1])
    assert summary["nonlinear"] is True
    assert summary["free_in_plane"] == 49
    assert summary["preload"] == [50.0, -2.5, 0.0]


# Preload by a static solution --------------------------------------------------------------------


def test_displaced_edges_before_an_impact_are_the_preload_of_their_strain() -> None:
    page = (ROOT / "docs" / "stretching.md").read_text(encoding="utf-8")
    (recipe,) = re.findall(r"```\n(FORC\n.*?END\n)```", page, re.DOTALL)
    displaced, newton = recipe.split("...\nMACR\n")
    newton = newton[: newton.index("LMAS")]
    text = deck()
    rigidity = load_deck(text).problems[0].laminate.A
    forces = rigidity @ [0.0004, 0.0, 0.0]
    loaded = text.to_text().replace("EXPE\n", f"{displaced}EXPE\n")
    results = [
        fecm.run_one(loaded.replace("MACR\n", f"MACR\n{newton}")),
        fecm.run_one(text.with_(preload_x=forces[0], preload_y=forces[1])),
        fecm.run_one(text),
    ]
    by_hand, by_card, without = (result.force for result in results)
    peak = without.max()
    assert np.abs(by_hand - by_card).max() < 1e-9 * peak
    assert np.abs(by_card - without).max() > 1e-6 * peak


# Sweeps ------------------------------------------------------------------------------------------


def test_a_swept_preload_is_that_of_a_deck_changed_by_hand() -> None:
    text = fecm.impact(plate(), PLIES, MASS, LAW, **QUICK).to_text()
    by_hand = fecm.read_one(text.replace("EXPE\n", "PREL\n20.,0.,-3.\nEXPE\n"))
    built = fecm.read_one(text).with_(preload_x=20.0, preload_xy=-3.0)
    assert built.require(Preload) == by_hand.require(Preload)
    again = by_hand.with_(preload_y=7.0)
    assert again.require(Preload) == Preload(20.0, 7.0, -3.0)
    assert len(again.all(Preload)) == 1

    swept = fecm.sweep(fecm.read_one(text), {"preload_x": [0.0, 200.0]}, history=True)
    assert swept.force is not None
    for case, force in enumerate((0.0, 200.0)):
        result = fecm.run_one(text.replace("EXPE\n", f"PREL\n{force},\nEXPE\n"))
        steps = min(int(swept.steps[case]), len(result.force))
        difference = np.abs(swept.force[case, :steps] - result.force[:steps]).max()
        assert difference < 1e-9 * result.force.max()


def test_a_support_of_a_nonlinear_plate_leaves_it_free_inside() -> None:
    changed = apply_case(deck(), {"support": "simple"})
    assert (generate(changed).codes[:, :2] == 0).all(axis=1).sum() == 49


def test_nonlinear_plates_share_no_impulse_response() -> None:
    linear = fecm.impact(plate(), PLIES, MASS, LAW, kinematics="linear", **QUICK)
    assert shares_plate(sole_problem(linear))
    assert not shares_plate(sole_problem(deck()))
