"""fecm new: energies with units, plies and supports by default, shear factor, help."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.authoring.contact import Sphere, doubts_of_soft_tip
from fecm.cli.new import new_command as command
from fecm.deck.catalogue import MATERIALS
from fecm.deck.model import Delamination, Impact, Material, Nonlinear, Shear
from fecm.mechanics.solutions import Tangent, in_plane_pins, static_stiffness
from fecm.problem.loading import load_deck
from fecm.problem.summary import deck_summary
from tests import closed_forms
from tests.builders import DATA
from tests.calls import assert_unusable, call, new, new_deck
from tests.closed_forms_plies import equilibrium_shear

LAW = ("--law", "5e4,0,0,1.5")  # an estimate doubles the time of a call
MM = ("--material", "IM7/8552", "--projectile", "mass:1e-3", *LAW)
PLATE = (*MM, "--size", "100x80", "--mesh", "5x4")
D7136 = ("--fixture", "D7136", "--mesh", "8x6", "--material", "IM7/8552", "--layup",
         "[45/0/-45/90]4s", *LAW)  # fmt: skip
QUICK = ("--duration", "1e-4", "--dt", "1e-7")


def held_in_plane(*options: str) -> dict[str, list[bool]]:
    """Whether u and v are restrained in the middles of the edges and of the plate."""
    (problem,) = load_deck(new(*options, *QUICK).stdout).problems
    mesh = problem.mesh
    places = {
        "left": (0, 40), "right": (100, 40), "bottom": (50, 0), "top": (50, 80), "inside": (50, 40)
    }  # fmt: skip
    by_name = {}
    for name, place in places.items():
        node = np.hypot(*(mesh.coordinates - place).T).argmin()
        by_name[name] = (mesh.equations[node, :2] == 0).tolist()
    return by_name


# Energy and velocity -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "velocity"),
    [
        (("--energy", "4.5J"), 3000.0),
        (("--energy", "4500"), 3000.0),
        (("--energy", "4500mJ"), 3000.0),
        (("--energy", "4500 N*mm"), 3000.0),
        (("--velocity", "3m/s"), 3000.0),
        (("--velocity", "3000"), 3000.0),
        (("--velocity", "10 ft/s"), 3048.0),
    ],
)
@pytest.mark.few(3)  # of 7, 0.05 s each
def test_energy_and_velocity_take_a_unit(options: tuple[str, ...], velocity: float) -> None:
    answer = new(*PLATE, "--layup", "[0/90]4s", *QUICK, *options)
    deck = fecm.read_one(answer.stdout)
    assert deck.require(Impact).velocity == pytest.approx(velocity, rel=1e-6)
    joules = 0.5 * (velocity / 1e3) ** 2  # of 1 kg
    assert f"note: energy {joules:.4g} J, {velocity:g} mm/s" in answer.stderr


def test_plies_thickness_and_stress_of_a_preload_are_said() -> None:
    # A layup that is symmetric and gets an s again has twice the plies.
    answer = new(*PLATE, "--layup", "[0/90/90/0]2s", *QUICK, "--velocity", "3", "--preload", "8,0")
    h = fecm.read_one(answer.stdout).require(Material).integration.thickness
    assert f"the laminate [0/90/90/0]2s has 16 plies and is {h:.4g} mm thick" in answer.stderr
    assert f"the preload 8 N/mm is a mean stress of {8.0 / h:.4g} N/mm^2" in answer.stderr


def test_a_duration_takes_a_unit() -> None:
    deck = new_deck(*PLATE, "--layup", "[0/90]4s", "--velocity", "3m/s", "--duration", "0.1ms")
    values = {macro.word: macro.value for macro in deck.macros}
    assert values["DT"] * values["LOOP"] == pytest.approx(1e-4, rel=0.02)


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--energy", "10kg", "--energy is '10kg', not a number or one with a unit, as in 10J"),
        ("--energy", "J", "as in 10J"),
        ("--energy", "-1J", "--energy is -1000.0; it must be a positive number"),
        ("--velocity", "3 m s", "as in 3m/s"),
        ("--velocity", "1e999", "as in 3m/s"),
        ("--duration", "4J", "as in 4ms"),
    ],
)
def test_units_that_cannot_be_meant_are_refused(option: str, value: str, message: str) -> None:
    answer = new(*PLATE, "--layup", "[0/90]4s", *QUICK, option, value)
    assert_unusable(answer)
    assert message in answer.stderr


def test_a_unit_needs_the_decks_own() -> None:
    ply = ("--ply", "1.58e-9,.32,161000,11380,5170,5170,3980", "--ply-thickness", "0.125")
    answer = new(
        *ply,
        *PLATE[2:],
        "--layup",
        "[0/90]4s",
        *QUICK,
        "--energy",
        "4J",
    )
    assert_unusable(answer)
    assert "--energy is '4J': give the deck's --units" in answer.stderr


def test_a_fixtures_energy_in_millijoules_is_doubted() -> None:
    doubt = "where D7136 has 6.7: --energy is in mJ unless it has a unit"
    answer = new(*D7136, *QUICK, "--energy", "10")
    assert answer.exit_code == 0
    assert "note: the energy is 0.01 J, 0.0024 J per mm of thickness, " + doubt in answer.stderr
    assert "note: energy 0.01 J (0.00239 J per mm of thickness), 60.3 mm/s" in answer.stderr
    assert doubt not in new(*D7136, *QUICK, "--energy", "10J").stderr
    plate = fecm.Plate.on_fixture("D7136", (8, 6))
    laminate = fecm.Laminate("[45/0/-45/90]4s", "IM7/8552")
    with pytest.warns(fecm.FecmWarning, match="is in mJ unless it has a unit"):
        fecm.impact(plate, laminate, energy=10, duration=1e-4)
    deck = fecm.impact(plate, laminate, energy="10J", duration="0.1ms")
    assert 0.5 * 5.5 * (deck.require(Impact).velocity / 1e3) ** 2 == pytest.approx(10.0, rel=1e-5)


def test_a_bare_number_that_is_small_for_an_energy_is_doubted() -> None:
    plate = (
        *(
            "--size",
            "150x100",
            "--mesh",
            "6x4",
            "--support",
            "simple",
            "--layup",
            "[45/0/-45/90]3s",
        ),
        *("--ply-thickness", ".184", "--material", "IM7/8552", "--units", "mm-N-s"),
        *("--projectile", "mass:5.5e-3", "--law", "4e4,0,0,1.5", "--duration", "1e-4"),
    )
    doubt = "where drop-weight tests have 1 to 10: --energy is in mJ unless it has a unit"
    bare = new(*plate, "--energy", "10")
    assert "note: the energy is 0.01 J, 0.0023 J per mm of thickness, " + doubt in bare.stderr
    for meant in ("10mJ", "10J", "10000"):
        assert "unless it has a unit" not in new(*plate, "--energy", meant).stderr


def test_a_patch_is_doubted_that_the_contact_circle_of_a_soft_tip_outgrows() -> None:
    # 10 J on k = 97.8 indent by (2.5 E/k)^0.4 = 9.19, and the circle's radius is (8 * 9.19)^(1/2).
    def doubts(radius: float, modulus: float) -> int:
        tip = Sphere(8.0, modulus, 0.48)
        return len(doubts_of_soft_tip(tip, "mm-N-s", radius, 97.8, 1e4, 10.3e3))

    assert [doubts(radius, 20.0) for radius in (0.5, 2.0, 8.0, 20.0)] == [1, 1, 0, 0]
    assert doubts(0.5, 2.1e5) == 0


@pytest.mark.long
def test_the_patch_of_a_soft_tip_is_doubted() -> None:
    # Rubber of 20 MPa: 10 J on k = 97.8 indent by (2.5 E/k)^0.4 = 9.19, and (8 * 9.19)^(1/2) = 8.6.
    thin = (*THIN, *QUICK, "--energy", "10J")
    soft = new(*thin, "--contact", "estimate:8,20,.48")
    assert "the tip is soft: its contact circle has a radius of up to 8.6" in soft.stderr
    steel = new(*thin, "--contact", "estimate:8")
    assert "contact circle" not in steel.stderr
    wide = new(*thin, "--contact", "estimate:8,20,.48", "--patch", "disc:6")
    assert "contact circle" not in wide.stderr


def test_a_moved_impact_point_is_said_beside_an_error() -> None:
    held = new(*D7136, *QUICK, "--at", "13,50")
    assert held.exit_code == 2
    assert "E410" in held.stderr
    assert "the impact point is moved by" in held.stderr


def test_a_core_that_is_thinner_than_a_ply_is_doubted() -> None:
    plate = (
        *("--size", "150x100", "--mesh", "6x4", "--support", "simple", "--layup", "[0/90/K/90/0]"),
        *("--ply-thickness", ".13", "--material", "AS4/8552", "--shear-factor", "equi"),
        *("--projectile", "mass:2e-3", "--law", "4e4,0,0,1.5", "--duration", "1e-4"),
        *("--velocity", "1000"),
    )
    typed = new(*plate, "--core", "Divinycell-H60:0.012")
    assert "W558" in typed.stderr
    assert "The core is 0.012 thick, less than the thinnest ply of the faces, 0.13." in typed.stderr
    assert "W558" not in new(*plate, "--core", "Divinycell-H60:12").stderr


# Mistakes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((*PLATE, *QUICK, "--layup", "[0/90]s", "--velocity", "3m/s"),
         "nothing supports the plate (--support is free): it flies away"),
        ((*PLATE, *QUICK, "--layup", "[0/90]2", "--velocity", "3m/s", "--support", "simple"),
         "not symmetric, B is not zero: 4 plies of --ply-thickness 0.131 are 0.524 thick"),
        ((*D7136[:-2], "--duration", "4", "--contact", "estimate:8"),
         '--duration is in the deck\'s unit of time unless it has a unit, as in "4ms"'),
        ((*D7136[:-2], *QUICK, "--contact", "estimate:16"),
         "takes the sphere's radius; 16 is the diameter of the standard's indenter"),
        ((*D7136[:-2], *QUICK, "--contact", "estimate:8,210,.3"),
         "modulus 210 in the --contact estimate looks like GPa; mm, N and s need MPa"),
        ((*D7136, *QUICK, "--energy", "10kJ"), "W555"),
        ((*D7136, *QUICK, "--at", "5,50"), "W556"),
    ],
    ids=["no support", "no s", "duration in ms", "diameter", "modulus in GPa", "10 kJ", "rim"],
)  # fmt: skip
def test_a_likely_mistake_of_an_option_is_named(options: tuple[str, ...], message: str) -> None:
    answer = new(*options)
    assert answer.exit_code == 0
    assert message in answer.stderr


def test_sound_options_are_not_doubted() -> None:
    rubber = new(*D7136[:-2], *QUICK, "--contact", "estimate:8,20,.49")
    assert "looks like" not in rubber.stderr
    titanium = new(*D7136[:-2], *QUICK, "--contact", "estimate:8,110000,.3")
    assert "estimate looks" not in titanium.stderr
    assert "W555" not in new(*D7136, *QUICK, "--energy", "150J").stderr
    assert "W556" not in new(*D7136, *QUICK, "--at", "14,50").stderr  # 1.5 mm inside the window


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((*D7136, "--ply-thickness", ".000184"), "--ply-thickness is 0.000184 mm, thinner than"),
        ((*PLATE[2:-4], *PLATE[-4:], *QUICK, "--layup", "[0/90]s", "--ply-thickness", ".2",
          "--units", "mm-N-s", "--velocity", "3m/s", "--support", "simple", "--ply",
          "1.6e-9,.3,9000,171000,5000,5000,3000"), "E1 and E2 look exchanged"),
        ((*PLATE[2:4], *PLATE[-4:], *QUICK, "--layup", "[0/90]s", "--ply-thickness", ".2",
          "--units", "mm-N-s", "--velocity", "3m/s", "--support", "simple", "--ply",
          "1.6e-9,.3,9000,171000,5000,5000,3000", "--contact", "estimate:8"),
         "E2 = 171000 is 19 times E1 = 9000"),
    ],
    ids=["plies in m", "E1 and E2", "E1 and E2 with an estimate"],
)  # fmt: skip
def test_a_mistake_that_gives_no_deck_is_named_with_its_cause(
    options: tuple[str, ...], message: str
) -> None:
    answer = new(*options)
    assert answer.exit_code == 2
    assert message in answer.stderr


# Plies -------------------------------------------------------------------------------------------


def test_a_named_ply_has_its_own_thickness_in_the_decks_units() -> None:
    options = ("--size", "100x80", "--mesh", "5x4", "--layup", "[0/90]4s", "--velocity", "3000",
               "--law", "1e4,0,0,1.5", "--projectile", "mass:1e-3", *QUICK)  # fmt: skip
    answer = new(*options, "--material", "T300/5208", "--units", "mm-N-s")
    assert "note: the plies are 0.125 mm thick, as T300/5208 is listed" in answer.stderr
    deck = fecm.read_one(answer.stdout)
    assert deck.require(Material).layers[0].thickness == 0.125
    (thinner,) = {
        layer.thickness
        for layer in new_deck(
            *options, "--material", "T300/5208", "--units", "mm-N-s", "--ply-thickness", "0.1"
        )
        .require(Material)
        .layers
    }
    assert thinner == 0.1
    unknown = new(*options, "--material", "T700/2510")
    assert_unusable(unknown)
    assert "--ply-thickness is missing: T700/2510 has no known one" in unknown.stderr


def test_a_ply_thickness_in_another_unit_is_named_against_the_plates_side() -> None:
    answer = new(*D7136, *QUICK, "--ply-thickness", "125")
    assert_unusable(answer)
    assert "32 plies of --ply-thickness 125 are 4000 thick" in answer.stderr
    assert "the plate's shorter side is 100" in answer.stderr


@pytest.mark.long
def test_a_toughness_stands_in_for_one_that_a_ply_does_not_have() -> None:
    ply = ("--material", "T700/2510", "--ply-thickness", "0.15", "--damage")
    assert MATERIALS["T700/2510"].delamination("mm-N-s") is None
    without = new(*D7136[:4], *D7136[6:], *ply, *QUICK)
    assert "so no delamination threshold (DELA); --giic gives it" in without.stderr
    deck = new_deck(*D7136[:4], *D7136[6:], *ply, *QUICK, "--giic", "0.9")
    assert deck.require(Delamination) == Delamination(0.9)
    assert new_deck(*D7136, *QUICK, "--giic", "0.9").require(Delamination).toughness == 0.9
    toughness = new_deck(*D7136, *QUICK, "--damage").require(Delamination).toughness
    assert toughness == MATERIALS["IM7/8552"].value("GIIc", "mm-N-s")


STORED = (*D7136, "--damage", "--duration", "5e-6", "--dt", "1e-7")


@pytest.mark.parametrize("mesh", ["6x4", "16x12"])
@pytest.mark.few(1)  # of 2, 0.9 s each
def test_damage_stores_ply_stresses_on_both_sides_of_the_edge_of_the_load(mesh: str) -> None:
    result = fecm.run_one(new(*STORED, "--mesh", mesh).stdout)
    under = result["plies/under_load"] == 1
    assert under.any()
    assert np.count_nonzero(~under) >= np.count_nonzero(under)
    assert len(result["plies/time"]) == 25  # 50 steps, every second


def test_plies_says_how_often_damage_stores_ply_stresses_and_of_how_many_places() -> None:
    plain = new_deck(*STORED, "--plies", "0")
    words = [macro.word for macro in plain.macros]
    assert "FAIL" in words
    assert "PLYS" not in words
    asked = new_deck(*STORED, "--plies", "10,3")
    (card,) = (macro for macro in asked.macros if macro.word == "PLYS")
    assert (card.value, card.second) == (10.0, 3.0)


# Supports in the plane ---------------------------------------------------------------------------

COUPLED = (*PLATE, "--layup", "[0_4/90_4]", "--velocity", "3000")


NONLINEAR = (*PLATE, "--layup", "[0/90]2s", "--velocity", "3000", "--nonlinear")


@pytest.mark.parametrize("plate", [COUPLED, NONLINEAR], ids=["coupled", "nonlinear"])
@pytest.mark.parametrize(
    ("support", "in_plane", "left", "bottom"),
    [
        ("simple", None, [True, True], [True, True]),
        ("clamped", "held", [True, True], [True, True]),
        ("simple", "normal", [True, False], [False, True]),
        ("clamped", "normal", [True, False], [False, True]),
        ("simple", "free", [False, False], [False, False]),
    ],
)
@pytest.mark.few(3)  # of 10, 0.1 s each
def test_the_edges_of_a_plate_that_stretches_are_held_in_the_plane_as_asked(
    plate: tuple[str, ...],
    support: str,
    in_plane: str | None,
    left: list[bool],
    bottom: list[bool],
) -> None:
    asked = () if in_plane is None else ("--in-plane", in_plane)
    actual = held_in_plane(*plate, "--support", support, *asked)
    assert actual == {
        "left": left,
        "right": left,
        "bottom": bottom,
        "top": bottom,
        "inside": [False, False],
    }


def test_an_imported_mesh_is_held_across_its_straight_edges_only() -> None:
    mesh = ("--mesh", str(DATA / "hole-quad8.msh"))
    options = (*MM, "--layup", "[0/90]", "--velocity", "1000", *QUICK, "--in-plane", "normal")
    answer = new(*mesh, *options, "--support", "simple")
    assert answer.exit_code == 2
    assert "the sides of 'boundary' are not all along x or y" in answer.stderr


def test_a_laminate_without_coupling_stays_held_everywhere() -> None:
    options = (*PLATE, "--layup", "[0/90]2s", "--velocity", "3000", "--support", "simple", *QUICK,
               "--kinematics", "linear")  # fmt: skip
    plain, free = new(*options), new(*options, "--in-plane", "free")
    assert fecm.read_deck(free.stdout) == fecm.read_deck(plain.stdout)
    assert "--in-plane has no effect: the laminate is not coupled" in free.stderr


def test_a_coupled_laminate_slides_on_the_window_of_a_fixture() -> None:
    # N/mm on 20 x 12 elements, with u and v of the window's nodes restrained and freed by hand.
    for in_plane, expected in (("held", 3060.0), (None, 2199.0)):
        asked = () if in_plane is None else ("--in-plane", in_plane)
        answer = new(
            "--fixture",
            "D7136",
            "--mesh",
            "10x8",
            "--layup",
            "[0_8/90_8]",
            "--ply-thickness",
            ".276",
            "--material",
            "IM7/8552",
            *LAW,
            *asked,
            "--shear-factor",
            "1",
            "--kinematics",
            "linear",
        )
        assert ("! The plate slides on the window" in answer.stdout) == (in_plane is None)
        (problem,) = load_deck(answer.stdout).problems
        assert problem.contact is not None
        actual = static_stiffness(problem.moving_plate, problem.contact)
        assert actual == pytest.approx(expected, rel=0.015)


def test_as_many_dofs_are_pinned_as_rigid_motions_in_the_plane_are_free() -> None:
    counts = {"free": 3, "held": 0}
    for in_plane, count in counts.items():
        answer = new(*COUPLED, "--support", "simple", "--in-plane", in_plane, *QUICK)
        (problem,) = load_deck(answer.stdout).problems
        assert len(in_plane_pins(problem.plate)) == count
    one_edge = ("--edge", "left=simple", "--in-plane", "normal")
    (problem,) = load_deck(new(*COUPLED, *one_edge, *QUICK).stdout).problems
    (pin,) = in_plane_pins(problem.plate)
    assert pin in problem.plate.mesh.equations[:, 1] - 1  # v, along the edge


def test_a_static_solution_pins_the_rigid_motion_in_the_plane_without_a_reaction() -> None:
    answer = new(*COUPLED, "--support", "simple", "--in-plane", "free", *QUICK)
    (problem,) = load_deck(answer.stdout).problems
    plate, contact = problem.plate, problem.contact
    assert contact is not None
    load = contact[plate.mesh.equations > 0]
    moved = Tangent(plate).solve(load)
    assert np.abs(moved[in_plane_pins(plate)]).max() < 1e-12 * np.abs(moved).max()
    assert np.abs(plate.stiffness @ moved - load).max() < 1e-9 * np.abs(load).max()


# Time --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "layup", [pytest.param("[45/-45]8s", marks=pytest.mark.long), "[0_16/90_16]"]
)
@pytest.mark.long
def test_the_default_duration_of_a_fixture_ends_after_the_contact(layup: str) -> None:
    # Indentation makes the contact of a stiff plate longer at a low energy than half a period.
    deck = new_deck(
        "--fixture",
        "D7136",
        "--mesh",
        "6x4",
        "--layup",
        layup,
        "--ply-thickness",
        "0.18",
        "--material",
        "IM7/8552",
        "--energy",
        "1J",
    )
    result = fecm.run_one(deck)
    assert result.force.max() > 0.0
    assert result.force[-1] == 0.0


@pytest.mark.parametrize("options", [("--velocity", "0"), ("--law", "1e200,0,0,1.5")])
@pytest.mark.long
def test_an_impact_whose_contact_cannot_be_estimated_gets_half_periods(
    options: tuple[str, ...],
) -> None:
    by_default = (*D7136[: -len(LAW)], "--kinematics", "linear")
    answer = new(*by_default, *options)
    plain = new_deck(*by_default)
    deck = fecm.read_one(answer.stdout)
    time, expected = (
        {macro.word: macro.value for macro in one.macros}["LOOP"] for one in (deck, plain)
    )
    assert time == pytest.approx(expected, rel=0.1)


# Transverse shear --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), Shear(assumed=True, equilibrium=True)),
        (("--shear-factor", "1"), Shear(assumed=True)),
        (("--shear-factor", "0.8"), Shear(0.8, assumed=True)),
        (("--shear-factor", "equi"), Shear(assumed=True, equilibrium=True)),
        (("--shear-factor", "equi", "--shear", "full"), Shear(equilibrium=True)),
        (("--shear", "full"), None),
    ],
)
@pytest.mark.few(2)  # of 6, 0.2 s each
def test_the_shear_factor_is_written_beside_the_assumed_strains(
    options: tuple[str, ...], expected: Shear | None
) -> None:
    assert new_deck(*D7136, *QUICK, *options).last(Shear) == expected


@pytest.mark.parametrize("value", ["0", "-1", "x", "nan"])
def test_what_is_no_shear_factor_is_refused(value: str) -> None:
    assert_unusable(new(*D7136, *QUICK, "--shear-factor", value))


SQUARE = ("--size", "1x1", "--mesh", "12x12", "--layup", "[0/90]s", "--ply-thickness", ".02",
          "--ply", "1,.3,25,1,.5,.5,.2", "--patch", "disc:.1", "--projectile", "mass:1",
          "--velocity", "1e-3", "--law", "1,0,0,1.5", "--duration", "1",
          "--dt", "1e-3")  # fmt: skip


def test_check_says_how_much_equilibrium_changes_the_static_deflection() -> None:
    deck = new(*SQUARE, "--support", "simple", "--shear-factor", "1").stdout
    ply, angles, h = fecm.read_one(deck).require(Material).ply, [0.0, 90.0, 90.0, 0.0], 0.08
    D, S = closed_forms.bending_and_shear(ply, angles, h)
    equal_energy = equilibrium_shear(ply, angles, h).diagonal()
    one, other = (
        closed_forms.compliance(D, shear, (1.0, 1.0), closed_forms.disc, 0.1)
        for shear in (S, equal_energy)
    )
    expected = other / one - 1.0
    assert expected > 0.1
    actual = summary_of(deck)
    assert actual["equilibrium_change"] == pytest.approx(expected, rel=2e-3)


def summary_of(deck: str) -> dict[str, float | None]:
    (problem,) = load_deck(deck).problems
    values: dict[str, float | None] = json.loads(json.dumps(deck_summary(problem).to_dict()))
    return values


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--shear-factor", "1"), "the plate is not held: no static deflection"),
        (
            ("--support", "simple", "--mesh", "13x12", "--shear-factor", "1"),
            "is computed up to 150 elements",
        ),
        (("--support", "simple", "--shear-factor", "equi"), ""),
        (("--support", "simple", "--shear-factor", "0.9"), ""),
        (("--support", "simple", "--shear", "full"), ""),
    ],
)
@pytest.mark.few(2)  # of 5, 0.1 s each
def test_check_compares_with_equilibrium_where_that_is_cheap_and_has_a_meaning(
    options: tuple[str, ...], line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fecm.problem.summary.MOST_SOLVED", 150)
    (problem,) = load_deck(new(*SQUARE, *options).stdout).problems
    view = deck_summary(problem)
    assert view.equilibrium_change is None
    lines = "\n".join(view.lines())
    assert ("shear factor " in lines) == bool(line)
    assert line in lines


# Help --------------------------------------------------------------------------------------------


def test_help_has_every_option_once_in_groups_and_typical_calls_at_the_end() -> None:
    text = call("new", "--help").stdout
    titles = ["Plate:", "Laminate:", "Supports:", "Impact:", "Numerics:", "Other options:"]
    assert [line for line in text.splitlines() if line in titles] == titles
    shown = [line.split()[0].rstrip(",") for line in text.splitlines() if line.startswith("  -")]
    options = [option.opts[0] for option in command.params if option.opts[0].startswith("-")]
    assert sorted(shown) == sorted([*options, "-h"])
    assert "Typical calls:" in text[text.index("--overwrite") :]


# Kinematics and title ----------------------------------------------------------------------------

THIN = ("--fixture", "D7136", "--mesh", "6x4", "--layup", "[45/0/-45/90]2s", "--ply-thickness",
        ".131", "--material", "IM7/8552")  # fmt: skip


@pytest.mark.long
def test_a_plate_that_deflects_beyond_0_3_h_stretches_and_the_note_says_so() -> None:
    soft, stiff = new(*THIN, "--energy", "10J"), new(*THIN, "--energy", "0.02J")
    assert fecm.read_one(soft.stdout).has(Nonlinear)
    # The linear run deflects by 2.66 h.
    assert "the static estimate of the deflection is 2.7 h, beyond 0.3 h" in soft.stderr
    assert "(NONL), on a window on which the plate slides; --kinematics linear" in soft.stderr
    assert not fecm.read_one(stiff.stdout).has(Nonlinear)
    assert "static estimate" not in stiff.stderr


@pytest.mark.long
def test_the_older_name_and_full_quadrature_decide_the_kinematics() -> None:
    named = new(*THIN, "--energy", "0.02J", "--kinematics", "von-karman").stdout
    older = new(*THIN, "--energy", "0.02J", "--nonlinear").stdout
    assert named == older.replace("--nonlinear", "--kinematics von-karman", 1)  # in the comment
    assert fecm.read_one(named).has(Nonlinear)
    full = new(*THIN, "--energy", "10J", "--shear", "full")
    assert not fecm.read_one(full.stdout).has(Nonlinear)
    assert "the plate stays linear, too soft there: NONL needs assumed shear" in full.stderr
    both = new(*THIN, "--energy", "10J", "--nonlinear", "--kinematics", "linear")
    assert both.exit_code == 2
    assert "give one" in both.stderr


@pytest.mark.long
def test_a_plate_that_stretches_is_run_for_the_shorter_contact_of_its_static_curve() -> None:
    times = []
    for kinematics in ("linear", "von-karman"):
        answer = new(*THIN, "--energy", "30J", "--kinematics", kinematics)
        words = {macro.word: macro.value for macro in fecm.read_one(answer.stdout).macros}
        # Four times the expected passes, as OVER ends the loop.
        times.append(words["DT"] * words["LOOP"] / 4)
    assert times[0] == pytest.approx(12e-3, rel=0.01)
    assert 6.3e-3 < times[1] < 8.5e-3  # the contact of a run is over at 6.3 ms


@pytest.mark.parametrize(
    ("options", "title"),
    [
        ((), "D7136 [45/0/-45/90]2s IM7/8552, 10 J"),
        (("--layup", "[0/90/0]"), "D7136 [0/90/0] IM7/8552, 10 J"),
        (("--title", "mine"), "mine"),
    ],
)
@pytest.mark.few(1)  # of 3, 0.2 s each
def test_a_title_names_plate_layup_ply_and_energy(options: tuple[str, ...], title: str) -> None:
    assert fecm.read_one(new(*THIN, *QUICK, "--energy", "10J", *options).stdout).title == title


@pytest.mark.parametrize(
    "option",
    [("--projectile", "mass:5.5kg"), ("--contact", "estimate:8mm"), ("--ply-thickness", ".184 kg")],
)
def test_a_unit_where_a_number_is_needed_is_named(option: tuple[str, str]) -> None:
    answer = new(*D7136, *QUICK, *option)
    assert_unusable(answer)
    number = option[1].partition(":")[2] or option[1]
    assert f"{number!r} has a unit; give the number alone, in the deck's units" in answer.stderr


@pytest.mark.parametrize("every", [(), ("--every", "7"), ("--every", "300")])
def test_rows_of_ply_stresses_have_displacements_for_paraview(every: tuple[str, ...]) -> None:
    deck = new_deck(*D7136, "--energy", "10J", "--damage", *every, *QUICK)
    numbers = {macro.word: macro.value for macro in deck.macros}
    assert numbers["PLYS"] % numbers["DISP"] == 0
    rows = numbers["LOOP"] // numbers["PLYS"]
    assert 20 <= rows <= 22 or numbers["PLYS"] == numbers["DISP"]


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        (("--projectile", "mass:5.5kg"), "mm, N and s have the mass in t, 1 kg = 1e-3 t"),
        (("--pressure", "5"), "No such option '--pressure'; see fecm new --help"),
        (("--velocty", "5"), "Did you mean '--velocity'?"),
    ],
)
def test_a_slip_on_the_command_line_ends_with_its_remedy(
    options: tuple[str, ...], remedy: str
) -> None:
    refused = call("new", *options)
    assert refused.exit_code == 2
    assert remedy in refused.stderr


def test_a_new_deck_begins_with_the_command_that_writes_it_again(tmp_path: Path) -> None:
    words = (*PLATE, "--layup", "[0/90]2s", "--velocity", "3000", *QUICK, "--title", "one's $x")
    deck = tmp_path / "plate.inp"
    assert call("new", deck, *words, "--overwrite", cwd=tmp_path).exit_code == 0
    text = deck.read_text()
    head, _, _ = text.partition("\nFECM")
    lines = (line.removeprefix("!").removesuffix("\\") for line in head.split("\n"))
    typed = shlex.split(" ".join(lines))
    assert typed == ["fecm", "new", "plate.inp", *words]
    deck.unlink()
    assert call(*typed[1:], cwd=tmp_path).exit_code == 0
    assert deck.read_text() == text
