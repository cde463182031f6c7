"""Decks from objects without an impact: statics and natural modes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.parameters import ObjectError

E, NU, RHO, H, SIDE = 70000.0, 0.3, 2.7e-9, 1.0, 100.0
METAL = fecm.Laminate([0], fecm.Ply(RHO, NU, E, E, *[E / (2.0 * (1.0 + NU))] * 3), H)
SQUARE = fecm.Plate.rectangle((SIDE, SIDE), (8, 8), support="simple")
RIGIDITY = E * H**3 / (12.0 * (1.0 - NU**2))
STATIC = "TANG\nFORM\nSOLV\nDISP"
NEWTON = "LOOP,,20\nTANG\nFORM\nSOLV\nCONV\nNEXT\nDISP"
MODES = "LMAS\nEIGE,,3"


def deflection(deck: fecm.Deck) -> float:
    """The largest static deflection."""
    return float(fecm.run_one(deck).tape3.w.max())


def test_modes_of_a_plate_from_objects_are_those_of_bending() -> None:
    deck = fecm.plate_deck(SQUARE, METAL, MODES, units="mm-N-s")
    angular_frequency = fecm.run_one(deck).modes.angular_frequency
    # Thin plate on simple supports: 1, 1 and the pair 1, 2 (Leissa).
    lowest = 2.0 * (math.pi / SIDE) ** 2 * math.sqrt(RIGIDITY / (RHO * H))
    np.testing.assert_allclose(angular_frequency, lowest * np.array([1.0, 2.5, 2.5]), rtol=0.01)


def test_the_static_deflection_of_a_plate_from_objects_is_timoshenkos() -> None:
    deck = fecm.plate_deck(SQUARE, METAL, STATIC, force=10.0, units="mm-N-s")
    assert deflection(deck) == pytest.approx(0.01160 * 10.0 * SIDE**2 / RIGIDITY, rel=0.01)
    assert deck == fecm.plate_deck(SQUARE, METAL, STATIC, force="10N", units="mm-N-s")
    on_node = fecm.plate_deck(SQUARE, METAL, STATIC, force=10.0, patch=None, units="mm-N-s")
    assert deflection(on_node) == pytest.approx(deflection(deck), rel=0.02)


def test_a_plate_without_impact_has_no_segment_of_an_impact_and_is_linear() -> None:
    deck = fecm.plate_deck(SQUARE, METAL, STATIC, force=5000.0, units="mm-N-s")
    keywords = {segment.keyword for segment in deck.segments}
    assert keywords.isdisjoint({"ROD", "EXPE", "PROJ", "NONL"})
    assert fecm.check(deck).ok
    assert "projectile" not in str(fecm.check(deck))
    # Beyond h/2 too: the force of an impact would choose a nonlinear plate.
    with pytest.warns(fecm.FecmWarning, match="deflection"):
        assert deflection(deck) > 5.0 * H


def test_a_plate_without_impact_stretches_if_asked() -> None:
    loaded: dict[str, Any] = {"force": 2000.0, "units": "mm-N-s"}
    with pytest.warns(fecm.FecmWarning):
        linear = deflection(fecm.plate_deck(SQUARE, METAL, STATIC, **loaded))
    stretched = fecm.plate_deck(SQUARE, METAL, NEWTON, kinematics="von-karman", **loaded)
    assert H < deflection(stretched) < 0.7 * linear


def test_a_preload_and_curvature_raise_the_frequencies_of_a_plate_without_impact() -> None:
    def lowest(**values: Any) -> float:
        deck = fecm.plate_deck(SQUARE, METAL, MODES, units="mm-N-s", **values)
        return float(fecm.run_one(deck).modes.angular_frequency[0])

    # omega^2 grows by N (pi/a)^2/(rho h).
    tension = 20.0 * (math.pi / SIDE) ** 2 / (RHO * H)
    assert lowest(preload=(20.0, 0.0)) ** 2 - lowest() ** 2 == pytest.approx(tension, rel=1e-3)
    assert lowest(radius_x=300.0) > 1.1 * lowest()


def test_a_plate_without_impact_takes_other_plies() -> None:
    deck = fecm.plate_deck(SQUARE, METAL, MODES, units="mm-N-s")
    thicker = fecm.run_one(deck.with_(ply_thickness=2.0))
    first = fecm.run_one(deck)
    ratio = thicker.modes.angular_frequency[0] / first.modes.angular_frequency[0]
    assert ratio == pytest.approx(2.0, rel=0.01)


def test_the_force_of_a_plate_without_impact_stays_in_the_middle_of_another_plate() -> None:
    deck = fecm.plate_deck(SQUARE, METAL, STATIC, force=10.0, units="mm-N-s")
    half = fecm.Plate.rectangle((SIDE / 2.0, SIDE / 2.0), (8, 8), support="simple")
    changed = deck.with_(plate=half)
    assert deflection(changed) == pytest.approx(deflection(deck) / 4.0, rel=0.01)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"at": (50.0, 50.0)}, "`at` is the place of `force`"),
        ({"force": "10J"}, "`force` is '10J', not a number or one with a unit, as in 6kN"),
        ({"force": math.nan}, "`force` is nan; it must be a finite number"),
        ({"kinematics": "auto"}, "`kinematics` is 'auto', none of linear, von-karman"),
        ({"program": 3}, "`program` is 3, not the cards of a macro program"),
        ({"failure": True}, "`failure` needs a named ply with strengths"),
        ({"force": 1.0, "at": (200.0, 0.0)}, "`at` is outside the plate"),
    ],
)
def test_mistakes_of_a_plate_without_impact_name_the_parameter(
    values: dict[str, Any], message: str
) -> None:
    arguments: dict[str, Any] = {"program": STATIC, "units": "mm-N-s", **values}
    with pytest.raises(ObjectError, match=message.replace("(", r"\(")):
        fecm.plate_deck(SQUARE, METAL, **arguments)


def test_a_program_with_impact_steps_needs_an_impact() -> None:
    steps = "LMAS\nDT\nLOOP,,3\nTIME\nRODP\nNEXT"
    with pytest.raises(fecm.DeckError, match="ROD"):
        fecm.plate_deck(SQUARE, METAL, steps, units="mm-N-s")
