"""fecm new --fixture: plates on the edges of a window, and what a test standard prescribes."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.deck.model import Impact, Patch
from fecm.mechanics.solutions import (
    compliance,
    pull_of_supports,
    static_stiffness,
    window_compliances,
)
from fecm.mechanics.symmetry import with_codes
from fecm.problem.loading import load_deck
from fecm.problem.parts import build_projectile
from fecm.results.summary import run_summary
from tests.calls import assert_unusable, call, new, new_deck

WINDOW = "150x100 plate, w=0 along the window"
ISOTROPIC = "2.7e-9,.3,6e4,6e4,23076.9231,23076.9231,23076.9231"
IM7 = "1.58e-9,.32,161000,11380,5170,5170,3980"
# The ply constants of IM7 give D of the table threshold_loads.csv to nine digits.
PLIES = {
    "isotropic E=60 GPa nu=.3 h=5, K=1": ("[0]", "5", ISOTROPIC),
    "IM7/8552 [45/0/-45/90]3s h=4.416, K=1": ("[45/0/-45/90]3s", ".184", IM7),
}  # fmt: skip
PLATE = ("--layup", "[45/0/-45/90]3s", "--ply-thickness", ".184", "--ply", IM7)
QUICK = ("--mesh", "8x6", "--duration", "1e-4", "--dt", "1e-7")


@pytest.mark.parametrize("plate", PLIES)
@pytest.mark.few(1)  # of 2, 0.9 s each
def test_the_static_stiffness_of_d7136_is_that_of_another_code(plate: str) -> None:
    with (Path(__file__).parent / "data" / "d7136_stiffness.csv").open() as file:
        (row,) = (r for r in csv.DictReader(file) if (r["plate"], r["support"]) == (plate, WINDOW))
    layup, thickness, ply = PLIES[plate]
    answer = new(
        "--fixture",
        "D7136",
        "--layup",
        layup,
        "--ply-thickness",
        thickness,
        "--ply",
        ply,
        "--patch",
        "disc:2",
        "--law",
        "5e4,0,0,1.5",
        "--duration",
        "1e-4",
        "--dt",
        "1e-7",
        "--mesh",
        "20x14",
        "--grading",
        "6",
        "--shear-factor",
        "1",
    )
    (problem,) = load_deck(answer.stdout).problems
    assert problem.contact is not None
    stiffness = static_stiffness(problem.moving_plate, problem.contact)
    assert stiffness == pytest.approx(float(row["n=3"]), rel=0.01)


def test_d7136_prescribes_mass_energy_patch_and_units() -> None:
    deck = new_deck("--fixture", "D7136", *PLATE, *QUICK)
    assert build_projectile(deck).total_mass == 5.5e-3
    assert deck.last(Patch) == Patch("HERT")
    energy = 0.5 * 5.5e-3 * deck.require(Impact).velocity ** 2
    assert energy == pytest.approx(6700 * 4.416, rel=1e-5)


def test_w_is_held_along_the_window_and_nowhere_else() -> None:
    answer = new("--fixture", "D7136", *PLATE, *QUICK)
    assert "! Clamps and lift-off are not modelled." in answer.stdout
    (problem,) = load_deck(answer.stdout).problems
    held = problem.mesh.equations[:, 2] == 0
    x, y = np.abs(problem.mesh.coordinates - (75.0, 50.0)).T
    on = (np.isclose(x, 62.5) & (y < 37.5001)) | (np.isclose(y, 37.5) & (x < 62.5001))
    assert (held == on).all()
    assert on.any()
    assert (problem.mesh.equations[:, 3:] > 0).all()


def test_supports_pull_at_the_corners_with_what_kirchhoff_gives() -> None:
    # Timoshenko and Woinowsky-Krieger, table 23: a square under a central force P, simply supported
    # (nu = .3), is held down by 0.1219 P in each corner.
    text = new(
        *("--size", "100x100", "--mesh", "16x16", "--units", "mm-N-s", "--support", "simple"),
        *("--layup", "[0]", "--ply-thickness", "1", "--ply", ISOTROPIC, "--patch", "none"),
        *("--projectile", "mass:2e-3", "--law", "5e4,0,0,1.5", "--velocity", "100"),
        *("--duration", "1e-4", "--dt", "1e-7", "--kinematics", "linear"),
    ).stdout
    (hard,) = load_deck(text).problems
    assert hard.contact is not None
    assert not hard.knife_edges.any()
    free_rotations = re.sub(r"(?m)^(( +\d+){2}( +-?1){3})( +-?[01]){2}$", r"\1    0    0", text)
    (soft,) = load_deck(free_rotations).problems
    assert soft.contact is not None
    assert soft.static is not None
    forces = pull_of_supports(soft.moving_plate, soft.static, soft.contact)
    assert forces[soft.knife_edges].sum() == pytest.approx(4 * 0.1219, rel=0.03)


@pytest.mark.parametrize(
    ("layup", "mass", "velocity", "duration", "pulls"),
    [
        ("[45/0/-45/90]3s", 5.5e-3, 1000.0, 5e-3, True),
        ("[45/0/-45/90]3s", 1e-6, 20000.0, 5e-5, False),  # gone before the supports know of it
    ],
)
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_a_run_on_a_window_says_with_how_much_its_supports_pull(
    layup: str, mass: float, velocity: float, duration: float, pulls: bool
) -> None:
    deck = fecm.impact(
        fecm.Plate.on_fixture("D7136", (4, 4)),
        fecm.Laminate(layup, "IM7/8552", 0.18333),
        fecm.RigidMass(mass),
        velocity=velocity,
        duration=duration,
        kinematics="linear",
    )
    result = fecm.run_one(deck)
    notes = [note for note in result.notes if "supports pull" in note]
    assert bool(notes) == pulls
    # An independent code gives 56 % for the first plate on a finer mesh.
    assert not pulls or "with 5" in notes[0]


def test_energy_gives_the_velocity_of_the_mass() -> None:
    deck = new_deck(
        "--fixture",
        "window:60x40,50x30",
        *PLATE,
        *QUICK,
        "--projectile",
        "mass:2e-3",
        "--energy",
        "4000",
        "--law",
        "5e4,0,0,1.5",
    )
    assert deck.require(Impact).velocity == pytest.approx(2000.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--fixture", "D1"], "'D1' is not a fixture: D7136 or window:LXxLY,WXxWY"),
        (["--fixture", "window:10x10,10x5"], "is not smaller than the plate"),
        (["--fixture", "D7136", "--size", "6x4"], "leave out --size"),
        (["--fixture", "D7136", "--support", "free"], "leave out --support"),
        (["--fixture", "D7136", "--units", "m-N-s"], "leave out --units"),
        (["--fixture", "D7136", "--velocity", "1", "--energy", "1"], "--velocity or --energy"),
    ],
)
def test_what_does_not_go_with_a_fixture_is_refused(options: list[str], message: str) -> None:
    answer = new(*options, *PLATE, *QUICK)
    assert_unusable(answer)
    assert message in answer.stderr


def test_a_laminate_outside_the_standard_is_warned_of() -> None:
    answer = new("--fixture", "D7136", "--layup", "[0/90]s", *PLATE[2:], *QUICK)
    assert "note: D7136 is for laminates of 4 to 6 mm; this one has 0.736 mm" in answer.stderr
    assert "D7136 is for" not in new("--fixture", "D7136", *PLATE, *QUICK).stderr


SPHERE = ("--size", "100x80", "--mesh", "4x4", "--projectile", "mass:1e-3", "--velocity", "1000",
          "--duration", "1e-5", "--patch", "none")  # fmt: skip


@pytest.mark.parametrize("ply", [PLATE, (*PLATE[:4], "--material", "AS4/8552")])
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_contact_estimate_is_that_of_indent_estimate_and_says_so_in_the_deck(
    ply: tuple[str, ...],
) -> None:
    answer = new(*SPHERE, *ply, "--contact", "estimate:8", "--units", "mm-N-s")
    printed = call(
        "indent",
        "estimate",
        *ply,
        "--radius",
        "8",
        "--es",
        "207e3",
        "--nus",
        ".3",
        "--units",
        "mm-N-s",
    )
    card = printed.stdout.splitlines()[-1]
    assert card in answer.stdout
    assert "! k of EXPE is estimated by the laminate's indentation modulus" in answer.stdout
    fixture = new("--fixture", "D7136", *ply, *QUICK, "--contact", "estimate")
    assert card in fixture.stdout


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--contact", "estimate"], "--contact estimate needs the sphere's radius"),
        (["--contact", "estimate:0"], "'0' is not of the form estimate:RADIUS[,ES,NUS]"),
        (["--contact", "estimate:8"], "with constants of a --ply needs --units"),
        (["--contact", "estimate:8,2e5,0.9"], "k cannot be estimated: nu_s must lie between"),
    ],
)
def test_an_estimate_that_cannot_be_made_is_refused(options: list[str], message: str) -> None:
    answer = new(*SPHERE, *PLATE, *options)
    assert_unusable(answer)
    assert message in answer.stderr


def test_no_contact_is_estimated_on_a_fabric() -> None:
    answer = new("--fixture", "D7136", *PLATE[:4], "--material", "AS4-5H/3501-6", *QUICK)
    assert_unusable(answer)
    assert "the ply is a fabric" in answer.stderr
    assert "`fecm indent hertz --et E3`" in answer.stderr


def test_the_mesh_of_a_window_is_obeyed_whatever_the_radius_of_the_patch() -> None:
    window = ("--fixture", "D7136", *PLATE[:4], "--material", "IM7/8552", *QUICK)
    wide, narrow = (new(*window, "--patch", f"disc:{c}") for c in (20, 2))
    (wide_mesh, narrow_mesh) = (fecm.read_one(built.stdout).control for built in (wide, narrow))
    assert narrow_mesh.numel == wide_mesh.numel
    assert "is larger than the radius of the patch, 2" in narrow.stderr


def test_the_default_mesh_of_a_window_has_elements_as_short_as_the_radius_of_the_patch() -> None:
    window = ("--fixture", "D7136", *PLATE[:4], "--material", "IM7/8552", *QUICK[2:])
    for radius, least in ((2.0, 20 * 12 + 1), (20.0, 20 * 12)):
        deck = new(*window, "--patch", f"disc:{radius}")
        assert "W447" not in deck.stderr
        assert fecm.read_one(deck.stdout).control.numel >= least


# A window that only pushes, and clamps ------------------------------------------------------------

TEST = ("--fixture", "D7136", *PLATE, "--energy", "5J", "--kinematics", "linear")


def test_a_window_that_only_pushes_has_200_rows_of_displacements_and_a_held_one_100() -> None:
    for window, rows in (("push", 200), ("held", 100)):
        (problem,) = load_deck(new(*TEST, "--window", window, *QUICK).stdout).problems
        assert problem.stored_rows == {"RODP": 50, "DISP": rows}


def test_a_window_that_only_pushes_has_supports_on_its_edges_and_holds_no_w() -> None:
    (problem,) = load_deck(new(*TEST, "--window", "push", *QUICK).stdout).problems
    (held,) = load_deck(new(*TEST, *QUICK).stdout).problems
    assert not (problem.mesh.equations[:, 2] == 0).any()
    supports = problem.plate.supports
    assert supports is not None
    assert (supports.side == 1.0).all()
    rows = np.flatnonzero(held.mesh.equations[:, 2] == 0)
    assert sorted(supports.node.tolist()) == rows.tolist()


@pytest.mark.parametrize(
    ("clamps", "stiffness"), [("held", None), ("2kN/mm", 2000.0), ("350", 350.0)]
)
def test_clamps_hold_or_spring_the_nodes_nearest_to_their_tips(
    clamps: str, stiffness: float | None
) -> None:
    answer = new(*TEST, "--window", "push", "--clamps", clamps, *QUICK)
    (problem,) = load_deck(answer.stdout).problems
    plate = problem.plate
    assert plate.supports is not None
    springs = plate.supports.select(~plate.supports.is_one_sided)
    nodes = springs.node
    if stiffness is None:
        (nodes,) = np.nonzero(problem.mesh.equations[:, 2] == 0)
        assert not len(springs.node)
    else:
        assert springs.stiffness.tolist() == [stiffness] * 4
        assert springs.dof.tolist() == [2] * 4
    x, y = problem.mesh.coordinates.T
    for tip in [(19.0, 6.0), (131.0, 6.0), (19.0, 94.0), (131.0, 94.0)]:
        assert np.hypot(x - tip[0], y - tip[1]).argmin() in nodes
    assert len(nodes) == 4
    # Clamps hold the plate down on purpose: they are no window that pulls.
    assert not problem.knife_edges.any()


def test_a_new_deck_tells_the_flexibility_of_the_three_kinds_of_its_window() -> None:
    window = "--window", "push"
    decks = [
        new(*TEST, *QUICK, *more).stdout for more in ((), window, (*window, "--clamps", "held"))
    ]
    compliances = [load_deck(deck).problems[0].static.compliance for deck in decks]  # type: ignore[union-attr]
    for deck in decks:  # the comment does not depend on which of them the deck has
        stated = re.findall(r"([0-9.]+) mm/N", deck)
        # The supports of a deck that only push give way by 0.1 %.
        assert list(map(float, stated)) == pytest.approx(compliances, rel=2e-3)
        shares = [float(share) for share in re.findall(r"\(([+-][0-9.]+)%\)", deck)]
        held, *others = compliances
        assert shares == pytest.approx([100.0 * (c / held - 1.0) for c in others], abs=0.25)


def test_one_factorisation_gives_the_compliances_of_three_plates_on_a_window() -> None:
    (problem,) = load_deck(new(*TEST, *QUICK, "--window", "push").stdout).problems
    plate, contact = problem.moving_plate, problem.contact
    assert plate.supports is not None
    assert contact is not None
    x, y = problem.mesh.coordinates.T
    tips = np.array([np.hypot(x - a, y - b).argmin() for a in (19, 131) for b in (6, 94)])
    codes = plate.mesh.codes.copy()
    codes[tips, 2] = 1
    closed = replace(plate, supports=plate.supports.held())
    expected = [compliance(p, contact) for p in (closed, plate, with_codes(plate, codes))]
    assert window_compliances(plate, contact, tips) == pytest.approx(expected, rel=1e-9)


def test_the_note_of_a_window_that_pulls_has_the_band_that_a_pushing_window_confirms() -> None:
    program = ("--giic", ".8", "--mesh", "8x6", "--duration", "6ms", "--every", "200")
    held, pushed = (
        fecm.run_one(new(*TEST, *program, *window).stdout) for window in ((), ("--window", "push"))
    )
    (note,) = [note for note in held.notes if note.startswith("the supports pull")]
    softer, low, high = map(
        float, re.findall(r"then ([0-9.]+)% .* between ([0-9.]+) N and ([0-9.]+) N", note)[0]
    )
    energies = map(float, re.findall(r"threshold between ([0-9.]+) J and ([0-9.]+) J", note)[0])
    # The lower end is the energy in the headline of the run, the upper end that of the other run.
    stated, of_pushed = (
        float(re.findall(r"about ([0-9.]+) J", "\n".join(run_summary(result)))[0])
        for result in (held, pushed)
    )
    assert list(energies) == [stated, pytest.approx(of_pushed, rel=0.03)]
    assert 5.0 < softer < 20.0
    assert high == pytest.approx(held.history.force.max(), rel=1e-3)
    # The band is that of the impact on the static plate.
    assert low == pytest.approx(pushed.history.force.max(), rel=0.02)
    assert not [note for note in pushed.notes if note.startswith("the supports pull")]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--size", "100x100", "--mesh", "8x8", "--window", "push"),
            "--window belongs to a --fixture",
        ),
        (("--fixture", "window:100x100,80x80", "--clamps", "held"), "those of a standard, D7136"),
        (("--fixture", "D7136", "--clamps", "-5"), "clamps"),
        (("--fixture", "D7136", "--clamps", "5 J"), "clamps"),
    ],
)
def test_a_window_and_clamps_that_can_not_be_are_refused(
    options: tuple[str, ...], message: str
) -> None:
    answer = call("new", "-", *options, *PLATE, "--energy", "5J", *QUICK)
    assert_unusable(answer)
    assert message in answer.stderr
