"""Decks changed in Python: parts as objects, values, and what the macro program stores."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest

import fecm
from fecm import Plate
from fecm.authoring import changes
from fecm.authoring.plate import Support
from fecm.authoring.values import NAMES
from fecm.deck.layup import parse_layup, parse_plies
from fecm.deck.model import (
    Allowables,
    Boundary,
    Delamination,
    Impact,
    Indentation,
    Macro,
    Projectile,
)
from fecm.problem.generate import generate
from tests.decks import LONG, ROOT

PLATE = fecm.Plate.rectangle((100, 80), (4, 4), support="simple")
OTHER_PLATE = fecm.Plate.rectangle((120, 60), (6, 4), support="clamped", grading=2.0)
PLIES = fecm.Laminate("[0/90]2s", "IM7/8552", 0.25)
COUPLED = fecm.Laminate("[45/-45/0]", "AS4/8552")
CONSTANTS = fecm.Ply(1.6e-9, 0.3, 140e3, 9e3, 5e3, 5e3, 3e3)
MASS = fecm.RigidMass(1e-3)
ROD = fecm.Rod.cylinder(20.0, 16.0, 2e5, 8e-9)
SPHERE = fecm.Contact.estimate(radius=8)
FIRM = fecm.Contact(4e4, 0.0, 0.0, 1.5)  # an estimate takes longer than the rest of a deck
QUICK: dict[str, Any] = {"velocity": 1000.0, "duration": 2e-5, "units": "mm-N-s",
                         "kinematics": "linear"}  # fmt: skip
DAMAGED: dict[str, Any] = QUICK | {"damage": True}
DECK = fecm.impact(PLATE, PLIES, MASS, SPHERE, plies=False, **DAMAGED)


def parts(deck: fecm.Deck) -> list[str]:
    """Control card, restrained dofs and the other segments of a deck, in no order."""
    others = (f"{s.keyword} {s!r}" for s in deck.segments if not isinstance(s, Boundary))
    return sorted([repr(deck.control), str((generate(deck).codes != 0).tolist()), *others])


def program(deck: fecm.Deck) -> list[tuple[str, float, float]]:
    return [(macro.word, macro.value, macro.second) for macro in deck.macros]


# Angles ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [1e-5, -1e-16, 100.0 / 3.0, 5e-324, np.float64(1e-7), 0.0])
def test_an_angle_that_is_a_number_reaches_the_cards_unchanged(angle: float) -> None:
    deck = DECK.with_(layup=[0, angle, angle, 0])
    read = fecm.read_one(deck.to_text())
    assert [layer.angle for layer in read.layers[1]] == [0.0, angle, angle, 0.0]


def test_a_sweep_runs_a_layup_of_tiny_angles() -> None:
    layups = [[0, 1e-5, 0], [0, 0, 0]]
    swept = fecm.sweep(DECK, {"layup": layups, "dt": [2e-7]}, history=True)
    assert set(swept["status"]) == {"still in contact"}
    assert swept.force is not None
    tiny, none = swept.force
    assert tiny == pytest.approx(none, rel=1e-9)


def test_a_small_letter_is_an_exponent_and_a_capital_a_material() -> None:
    assert parse_layup("[1e-05/-2.5e1/±3e0]s") == [1e-5, -25.0, 3.0, -3.0, -3.0, 3.0, -25.0, 1e-5]
    assert [tuple(ply) for ply in parse_plies("[1e1E/0E]")] == [(10.0, "E"), (0.0, "E")]
    for wrong in ("[1e]", "[1E-5]", "[e5]", "[1e999]", "[1e1.0]"):
        with pytest.raises(ValueError, match="can't be read"):
            parse_plies(wrong)


# Parts -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"plate": OTHER_PLATE}, (OTHER_PLATE, PLIES, MASS, SPHERE)),
        ({"laminate": COUPLED, "contact": SPHERE}, (PLATE, COUPLED, MASS, SPHERE)),
        ({"projectile": ROD}, (PLATE, PLIES, ROD, SPHERE)),
        (
            {"plate": OTHER_PLATE, "laminate": COUPLED, "projectile": ROD, "contact": SPHERE},
            (OTHER_PLATE, COUPLED, ROD, SPHERE),
        ),
    ],
    ids=["plate", "laminate", "projectile", "all"],
)
def test_a_deck_with_other_parts_is_the_deck_made_of_them(given: Any, wanted: Any) -> None:
    impact_deck = fecm.impact(*wanted, **DAMAGED)
    deck = DECK.with_(**given)
    assert parts(deck) == parts(impact_deck)
    assert deck.macros[1] == impact_deck.macros[1]  # DT
    assert fecm.read_one(deck.to_text()) == deck


def test_a_new_plate_is_struck_where_the_impact_is_asked_for() -> None:
    deck = fecm.impact(OTHER_PLATE, PLIES, MASS, SPHERE, at=(30, 20), **DAMAGED)
    assert parts(DECK.with_(plate=OTHER_PLATE, at=(30, 20))) == parts(deck)
    moved = DECK.with_(at=(30, 20)).with_(plate=PLATE)  # in its middle again
    assert parts(moved) == parts(DECK)


def test_values_go_on_top_of_parts() -> None:
    deck = DECK.with_(projectile=ROD, mass=2e-3, energy="2J")
    velocity = deck.require(Impact).velocity
    assert 0.5 * 2e-3 * velocity**2 == pytest.approx(2000.0)
    assert deck.with_(contact="report-0.75", k=1e5).require(Indentation).k == 1e5


def test_a_contact_is_converted_to_the_units_of_the_deck() -> None:
    law = DECK.with_(contact="report-0.75").require(Indentation)
    named = fecm.impact(PLATE, PLIES, MASS, "report-0.75", **QUICK).require(Indentation)
    assert law == named
    assert law.alpha_p == pytest.approx(6.564e-4 * 25.4, rel=1e-5)


def test_an_estimated_contact_is_the_same_in_units_of_force_and_of_mass() -> None:
    k, in_kilonewtons = (
        fecm.impact(PLATE, PLIES, MASS, SPHERE, velocity=1.0, duration=1e-5, units=units)
        .require(Indentation)
        .k
        for units in ("mm-N-s", "mm-ms-kg")
    )
    assert in_kilonewtons == pytest.approx(k / 1000.0, rel=1e-5)


def test_a_ply_with_other_constants_brings_its_strengths_or_is_refused() -> None:
    strengths = DECK.with_(laminate=COUPLED).require(Allowables)
    assert strengths == fecm.impact(PLATE, COUPLED, MASS, FIRM, **DAMAGED).require(Allowables)
    assert strengths != DECK.require(Allowables)
    with pytest.raises(ValueError, match="`laminate` has other plies; the deck needs their"):
        DECK.with_(laminate=fecm.Laminate("[0]8", CONSTANTS, 0.25))
    bare = fecm.impact(PLATE, PLIES, MASS, FIRM, **QUICK)
    assert bare.with_(laminate=fecm.Laminate("[0]8", CONSTANTS, 0.25)).plies == {1: CONSTANTS}


def test_an_estimated_contact_of_a_sandwich_is_doubted() -> None:
    faces = [(0, "IM7/8552", 0.25), (90, "IM7/8552", 0.25)]
    core: Any = (0, "Divinycell-H60", 10.0)
    sandwich = fecm.Laminate([*faces, core, *faces[::-1]])
    bare = fecm.impact(PLATE, PLIES, MASS, FIRM, **QUICK)
    with pytest.warns(fecm.FecmWarning, match="k is estimated of a sandwich"):
        bare.with_(laminate=sandwich, contact=SPHERE)


BENDING = ROOT / "decks" / "static-bending.inp"
ZONED = fecm.impact(
    PLATE, PLIES, MASS, FIRM, zones=[((0, 0, 50, 40), "[0/90]4s")], patch=None, **QUICK
)


@pytest.mark.parametrize(
    ("deck", "given", "message"),
    [
        (DECK, {"projectile": 3}, "`projectile` is 3, not a projectile of fecm"),
        (DECK, {"plate": "x"}, "`plate` is 'x', not a plate of fecm"),
        (DECK, {"contact": "cheese"}, "'cheese' is not a named contact"),
        (DECK, {"projectle": MASS}, "with_: `projectle` cannot be varied; did you mean projectile"),
        (DECK, {"energy": "10"}, None),
        (DECK, {"energy": "10V"}, "`energy` is '10V', not a number or one with a unit"),
        (DECK, {"layup": [[0], [90]], "angle": "x"}, "with_: angle must be a finite number"),
        (DECK, {"velocity": True}, "`velocity` is True, not a number or a text"),
        (DECK, {"angle": True}, "with_: angle can't be True"),
        (DECK, {"nonlinear": True}, "with_: the deck has no NONL"),
        (DECK, {"nonlinear": 0}, "with_: nonlinear is 0, not True or False"),
        (ZONED, {"plate": PLATE}, "`plate` can't be replaced in a deck with ZONE"),
        (ZONED, {"laminate": PLIES}, "`laminate` can't be replaced in a deck with LAMS and ZONE"),
        (BENDING, {"velocity": 2}, "with_: the deck has no ROD segment"),
        (BENDING, {"plate": PLATE}, "`plate` can't be replaced in a deck with FORC"),
        (LONG, {"contact": "report-0.75"}, "`contact` needs the units of the deck"),
        (LONG, {"laminate": PLIES}, "the deck needs a UNIT segment"),
        (LONG, {"plate": fecm.Plate.on_fixture("D7136")}, "standard is in mm-N-s, and the deck"),
    ],
)
def test_what_can_not_be_changed_is_refused_by_its_name(
    deck: fecm.Deck | Path, given: Any, message: str | None
) -> None:
    built = deck if isinstance(deck, fecm.Deck) else fecm.read_one(deck)
    if message is None:
        assert built.with_(**given) != built
        return
    with pytest.raises(ValueError, match=message):
        built.with_(**given)


def test_a_quantity_of_pint_is_the_text_that_it_prints() -> None:
    pint = pytest.importorskip("pint")
    units = pint.UnitRegistry()
    speed, energy, time = (units(text) for text in ("3 m/s", "2 J", "50 microsecond"))
    assert DECK.with_(velocity=speed).require(Impact).velocity == 3000.0
    assert DECK.with_(energy=energy, duration=time) == DECK.with_(energy="2J", duration="50us")
    deck = fecm.impact(PLATE, PLIES, MASS, FIRM, **QUICK | {"velocity": speed, "duration": time})
    texts = {"velocity": "3m/s", "duration": "50us"}
    assert deck == fecm.impact(PLATE, PLIES, MASS, FIRM, **QUICK | texts)
    swept = fecm.sweep(DECK, {"energy": [0.1, 0.2] * units.J})
    assert swept["energy"].tolist() == [100.0, 200.0]
    with pytest.raises(ValueError, match="`energy` is '2 mm', not a number or one with a unit"):
        DECK.with_(energy=2 * units.mm)
    dense = DECK.with_(density=1600 * units.kg / units.m**3)
    assert dense == DECK.with_(density=1.6e-9)
    with pytest.raises(ValueError, match=r"density` is '1600(\.0)? kg', not a number or one with"):
        DECK.with_(density=1600 * units.kg)


def test_the_unit_of_a_quantity_is_never_dropped_where_float_would_drop_it() -> None:
    class Quantity(float):  # as unyt's: a number with `value` and `units`
        value, units = 3.0, "m/s"

    class Length(float):
        value, units = 12.0, "cm"

    assert DECK.with_(velocity=Quantity(3.0)).require(Impact).velocity == 3000.0
    plate = fecm.Plate.rectangle((Length(12.0), 80), (6, 4))
    assert DECK.with_(plate=plate) == DECK.with_(plate=fecm.Plate.rectangle((120, 80), (6, 4)))


UNNAMED = fecm.impact(
    PLATE, fecm.Laminate("[0/90]2s", CONSTANTS, 0.25), MASS, FIRM, **QUICK | {"units": None}
)


def impact_on(size: Any, **options: Any) -> fecm.Deck:
    projectile, contact = options.pop("projectile", MASS), options.pop("contact", FIRM)
    plate = fecm.Plate.rectangle(size, (6, 4))
    return fecm.impact(plate, PLIES, projectile, contact, **QUICK | options)


@pytest.mark.parametrize(
    ("lengths", "numbers"),
    [
        ({"size": ("10 cm", 80)}, {}),
        ({"at": ("4cm", "40 mm")}, {"at": (40, 40)}),
        ({"gages": [("1cm", 20, "-1 mm", 45)]}, {"gages": [(10, 20, -1, 45)]}),
        ({"zones": [((0, "0", "5cm", 80), "[0]4")]}, {"zones": [((0, 0, 50, 80), "[0]4")]}),
        ({"patch": "hertz:0.8 cm"}, {"patch": "hertz:8"}),
        ({"projectile": "50 g"}, {"projectile": fecm.RigidMass(5e-5)}),
        ({"contact": fecm.Contact.estimate("0.8cm", "207GPa", 0.3)},
         {"contact": fecm.Contact.estimate(8, 207e3, 0.3)}),
    ],
)  # fmt: skip
def test_parts_with_units_give_the_deck_of_their_numbers(
    lengths: dict[str, Any], numbers: dict[str, Any]
) -> None:
    assert impact_on(**{"size": (100, 80)} | lengths) == impact_on((100, 80), **numbers)


def test_parts_with_units_are_converted_to_the_units_of_each_deck() -> None:
    plate = fecm.Plate.rectangle(("4in", "2in"), (4, 2))
    tip = fecm.Contact.estimate("0.5in", "70GPa", 0.3)
    # 1 lbf s^2/in is 175.126835 kg.
    for units, inch, mass in (("mm-N-s", 25.4, 5.5e-3), ("in-lbf-s", 1.0, 5.5 / 175.126835)):
        deck = fecm.impact(
            plate, fecm.Laminate("[0/90]2s", "AS4/8552"), "5.5kg", tip, energy="1J",
            duration="10us", units=units, at=("1in", "1in"),
        )  # fmt: skip
        sides = np.ptp(generate(deck).coordinates, axis=0)
        assert sides == pytest.approx([4 * inch, 2 * inch])
        assert deck.require(Projectile).size == pytest.approx(mass)
        moved = deck.with_(at=("2in", "1in"))
        assert moved == deck.with_(at=(2 * inch, inch)) != deck
        assert deck.with_(size=("8in", "2in")) == deck.with_(size=(8 * inch, 2 * inch))
        assert deck.with_(projectile="11 kg") == deck.with_(mass="11 kg")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: impact_on(("1kg", 80)), "`size` is '1kg', not a number or one with a unit, as in"),
        (lambda: impact_on("64"), "`size` is '64', not 2 numbers"),
        (lambda: impact_on(("-1mm", 80)), "`size` is -1.0; it must be a positive number"),
        (lambda: fecm.Contact.estimate("8kg"), "`radius` is '8kg', not a number or one"),
        (lambda: impact_on((100, 80), projectile="5mm"), "`projectile` is '5mm', not a number or"),
        (lambda: impact_on((100, 80), projectile="-5kg"), "`projectile` is -0.005; it must be"),
        (lambda: impact_on((100, 80), at=(40,)), "`at` is .*, not 2 numbers"),
        (lambda: impact_on((100, 80), patch="disc:8kg"), "`patch` is '8kg', not a number or one"),
        (lambda: impact_on((100, 80), gages=[(1, 2)]), "`gages` are not x, y, z and degrees"),
        (lambda: UNNAMED.with_(at=("5mm", 1)), "at: `5mm` has a unit, but the deck names no units"),
        (lambda: UNNAMED.with_(projectile="5kg"), "`projectile` is '5kg': give the deck's `units`"),
    ],
)  # fmt: skip
def test_a_part_with_a_wrong_unit_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (fecm.RigidMass, "`total_mass` of RigidMass is '5.5'; it must be a number"),
        (lambda text: fecm.Rod.cylinder(20.0, text, 2e5, 8e-9), "`diameter` of Rod is '5.5'"),
        (lambda text: fecm.Rod(20.0, (16.0,), text, 8e-9), "`modulus` of Rod is '5.5'"),
        (fecm.Contact, "`k` is '5.5'; it must be a number"),
        (lambda text: fecm.Contact.estimate(8, 2e5, text), "`poisson` is '5.5'; it must be a num"),
        (
            lambda text: fecm.Laminate("[0]", fecm.Ply(1e-9, 0.3, 1e5, text, 5e3, 5e3, 3e3), 0.2),
            "`e2` is '5.5'; it must be a number",
        ),
    ],
)
def test_a_text_in_the_place_of_a_number_is_refused_where_it_is_given(
    make: Any, message: str
) -> None:
    with pytest.raises(fecm.FecmError, match=message):
        make("5.5")


def test_a_nonlinear_deck_without_nonl_moves_as_the_deck_that_is_made_linear() -> None:
    common = QUICK | {"velocity": 2e4, "duration": 1e-4}
    linear, nonlinear = (
        fecm.impact(PLATE, PLIES, MASS, FIRM, **common | {"kinematics": kinematics})
        for kinematics in ("linear", "von-karman")
    )
    assert nonlinear.with_(nonlinear=True) == nonlinear
    force = fecm.run_one(nonlinear.with_(nonlinear=False)).force
    np.testing.assert_allclose(force, fecm.run_one(linear).force, rtol=1e-9)
    assert np.abs(fecm.run_one(nonlinear).force / force - 1.0)[force > 0.0].max() > 0.01


def test_the_type_of_the_values_has_every_name_that_can_be_given() -> None:
    assert set(changes.Values.__annotations__) == {
        *NAMES,
        *changes.Parts._fields,
        changes.NONLINEAR,
    }
    known = {"Plate": Plate, "Laminate": fecm.Laminate, "Support": Support}
    known |= {"AnyProjectile": fecm.Rod, "AnyContact": fecm.Contact}
    hints = get_type_hints(changes.Values, localns=known)
    assert hints["velocity"] == float | str


def test_a_time_step_that_was_chosen_for_the_plate_follows_a_new_one() -> None:
    def steps(deck: fecm.Deck) -> list[float]:
        return [macro.value for macro in deck.macros if macro.word in ("DT", "LOOP")]

    impact_deck = fecm.impact(OTHER_PLATE, PLIES, MASS, SPHERE, **DAMAGED)
    (dt, count), (before, own_count) = steps(DECK.with_(plate=OTHER_PLATE)), steps(DECK)
    assert dt == steps(impact_deck)[0] != before
    assert 0.0 <= dt * count - before * own_count < dt
    own = DECK.with_(dt=1e-8)
    assert steps(own.with_(plate=OTHER_PLATE)) == steps(own)
    assert steps(DECK.with_(e1=2e5)) == steps(DECK)
    assert steps(DECK.with_(plate=OTHER_PLATE, dt=1e-8)) == steps(own)


# The program -------------------------------------------------------------------------------------


def test_a_program_stores_what_it_is_asked_for_within_the_loop_that_takes_steps() -> None:
    deck = fecm.read_one(LONG)
    assert [word for word, *_ in program(deck)][2:] == ["LOOP", "TIME", "RODP", "DISP", "NEXT"]
    steps = deck.macros[2].value
    built = program(deck.with_program(plies=(50, 4), failure=7, every=9))[4:]
    assert built == [
        ("RODP", 9, 0), ("DISP", 9, 0), ("FAIL", 7, 0), ("PLYS", 50, 4), ("NEXT", 0, 0),
    ]  # fmt: skip
    (word, value, _) = program(deck.with_program(plies=True))[-2]
    assert (word, value) == ("PLYS", steps // 20)  # DISP is at every 20th step
    (word, value, _) = program(deck.with_program(plies=True, every=9))[-2]
    assert (word, value) == ("PLYS", 198)
    assert deck.with_program(plies=True, failure=True).with_program(
        plies=False, failure=False
    ) == dataclasses.replace(deck, text="")


def test_each_loop_of_steps_stores_and_others_do_not() -> None:
    text = (
        "LMAS\nDT,,1E-8\nLOOP,3\nLOOP,100\nTIME\nRODP,10\nNEXT\nNEXT\nLOOP,40\nTIME\nRODP,10\nNEXT"
    )
    words = program(DECK.with_program(text, plies=True, failure=True))
    assert [row[0] for row in words] == [
        "LMAS", "DT", "LOOP", "LOOP", "TIME", "RODP", "FAIL", "PLYS", "NEXT", "NEXT",
        "LOOP", "TIME", "RODP", "FAIL", "PLYS", "NEXT",
    ]  # fmt: skip
    assert [row[1] for row in words if row[0] == "PLYS"] == [5, 2]
    assert [row[1] for row in words if row[0] == "FAIL"] == [10, 10]
    static = DECK.with_program("TANG\nFORM\nSOLV", plies=3)
    assert program(static)[-1] == ("PLYS", 3, 0)


def test_a_program_brings_the_load_tables_that_follow_its_end() -> None:
    ramp = "    1    1        0.       10.        0.        1."
    loaded = DECK.with_program(f"TANG\nLOOP,4\nTIME\nPROP,1\nFORM\nSOLV\nNEXT\nEND\n{ramp}\n")
    assert [(table.begin, table.end, table.constants[1]) for table in loaded.tables] == [
        (0.0, 10.0, 1.0)
    ]
    assert loaded.with_program("TANG\nPROP,1\nFORM\nSOLV").tables == loaded.tables
    with pytest.raises(fecm.DeckError, match="E011"):
        DECK.with_program("TANG\nPROP,1\nFORM\nSOLV")


def test_a_program_of_cards_or_macros_replaces_the_decks() -> None:
    modes = DECK.with_program("LMAS\nEIGE,,3\n")
    assert program(modes) == [("LMAS", 0, 0), ("EIGE", 3, 0)]
    assert modes == DECK.with_program([Macro("LMAS"), Macro("EIGE", value=3.0)])
    assert fecm.run_one(modes)["modes/number"].tolist() == [1, 2, 3]
    with pytest.raises(fecm.DeckError, match=r"E501.*`EIGA` is not a macro"):
        DECK.with_program("LMAS\nEIGA,,3")
    with pytest.raises(fecm.DeckError, match="The LOOP is not closed"):
        DECK.with_program("LOOP,3")


@pytest.mark.parametrize(
    "options",
    [{"plies": 0}, {"plies": (1, 2, 3)}, {"plies": 2.5}, {"failure": -1}, {"every": True}],
)
def test_numbers_of_steps_that_are_not_whole_and_positive_are_refused(options: Any) -> None:
    (name,) = options
    with pytest.raises(fecm.FecmError, match=f"`{name}` is "):
        DECK.with_program(**options)


def test_ply_stresses_are_asked_for_without_a_card() -> None:
    deck = fecm.impact(PLATE, PLIES, MASS, FIRM, plies=(np.int64(10), 2), **QUICK)  # type: ignore[arg-type]
    plies = fecm.run_one(deck).plies()
    assert plies.sigma_1.shape[1] == 2
    assert set(np.diff(plies.step)) == {10}
    with pytest.raises(fecm.FecmError, match=r"run deck.with_program\(plies=True\)"):
        fecm.run_one(DECK).plies()
    assert fecm.run_one(DECK.with_program(plies=10)).plies().sigma_1.shape[1] == 16


def test_failure_is_evaluated_with_the_strengths_of_a_named_ply_alone() -> None:
    deck = fecm.impact(PLATE, PLIES, MASS, FIRM, failure=5, **QUICK)
    assert ("FAIL", 5, 0) in program(deck)
    assert not deck.has(Delamination)
    assert float(fecm.run_one(deck).failure.puck.exposure.max()) > 0.0
    silent = fecm.impact(PLATE, PLIES, MASS, FIRM, failure=False, **DAMAGED)
    assert silent.require(Allowables) == DECK.require(Allowables)
    assert "FAIL" not in [word for word, *_ in program(silent)]
    with pytest.raises(ValueError, match="`failure` needs a named ply with strengths"):
        fecm.impact(
            PLATE, fecm.Laminate("[0]8", CONSTANTS, 0.25), MASS, FIRM, failure=True, **QUICK
        )


# Objects -----------------------------------------------------------------------------------------


def test_a_contact_of_k_alone_is_elastic() -> None:
    assert fecm.Contact(k=1e6).values() == (1e6, 0.0, 0.0, 1.5)
    with pytest.raises(TypeError, match=r"^Contact"):
        fecm.Contact()  # type: ignore[call-arg]


@pytest.mark.parametrize(
    "made",
    [ROD, fecm.Rod(1.5, (0.3, 0.4), 1e7, 2e-4), SPHERE, fecm.Contact.estimate(1.0, 2.0, 0.3)],
)
def test_an_object_is_shown_as_the_call_that_makes_it(made: object) -> None:
    shown = repr(made)
    assert len(shown) < 100
    assert eval(shown, {"Rod": fecm.Rod, "Contact": fecm.Contact}) == made


def test_a_laminate_takes_the_thickness_of_its_named_ply() -> None:
    assert fecm.Laminate("[0/90]2s", "AS4/8552").thickness == pytest.approx(8 * 0.13)
    given = fecm.Laminate("[0C/90G]s", {"C": "AS4/8552", "G": "T300/5208"}, {"G": 0.2})
    assert given.thickness == pytest.approx(2 * 0.13 + 2 * 0.2)
    inches = fecm.impact(
        fecm.Plate.rectangle((6, 4), (4, 4)),
        COUPLED,
        fecm.RigidMass(1e-4),
        fecm.Contact(1e6),
        velocity=1.0,
        duration=1e-5,
        units="in-lbf-s",
    )
    assert inches.layers[1][0].thickness == pytest.approx(0.13 / 25.4, rel=1e-5)


def test_a_projectile_of_a_deck_is_replaced_in_its_card() -> None:
    assert DECK.with_(projectile=ROD).require(Projectile).elements == 20


def test_an_output_in_no_folder_is_named_once(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as refused:
        fecm.run_one(DECK, output=tmp_path / "none" / "x.h5")
    assert str(refused.value).count(str(tmp_path / "none" / "x.h5")) == 1


def test_the_examples_offer_their_two_functions() -> None:
    assert dir(fecm.examples) == ["names", "path"]
