"""Units in text: masses and energies under their own names."""

from __future__ import annotations

import pytest

import fecm
from fecm._text import significant
from fecm.deck.units import quantity, unit_names
from tests.decks import small


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (14064.6, "14060"), (0.00184092, "0.001841"), (999960.0, "1e+06"), (2.5, "2.5"),
        (123456789.0, "1.235e+08"), (0.0, "0"), (-78.8549, "-78.85"), (float("nan"), "nan"),
    ],
)  # fmt: skip
def test_a_number_of_four_digits_has_no_exponent_below_a_million(value: float, text: str) -> None:
    assert significant(value) == text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (2e-5, "N*s^2/mm", "20 g"), (5.5e-3, "N*s^2/mm", "5.5 kg"), (0.5, "N*s^2/m", "500 g"),
        (2.0, "N*s^2/mm", "2 t"), (1225.0, "N*mm", "1.225 J"), (78.8549, "N*mm", "78.85 mJ"),
        (999.9999999, "N*mm", "1 J"), (0.0, "N*mm", "0 N*mm"), (3.0, "lbf*in", "3 lbf*in"),
        (4.3e-3, "s", "0.0043 s"), (-1.5e3, "N*mm", "-1.5 J"), (7.0, "", "7"),
    ],
)  # fmt: skip
def test_masses_are_shown_in_grams_and_energies_in_joules(
    value: float, unit: str, text: str
) -> None:
    assert quantity(value, unit) == text


@pytest.mark.parametrize(
    ("card", "names"),
    [
        ("MM n S", ("mm", "N", "s")),
        ("IN LBF S", ("in", "lbf", "s")),
        ("mm Mn s", ("mm", "Mn", "s")),  # MN or mN
    ],
)
def test_capitals_of_a_unit_are_its_usual_ones_unless_they_tell_two_units_apart(
    card: str, names: tuple[str, ...]
) -> None:
    deck = fecm.read_one(small().replace("ROD", f"UNIT\n{card}\nROD", 1))
    assert tuple(unit_names(deck).values()) == names
