"""Units in text: masses and energies under their own names."""

from __future__ import annotations

import pytest

from fecm.deck.units import quantity


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (2e-5, "N*s^2/mm", "20 g"), (5.5e-3, "N*s^2/mm", "5.5 kg"), (0.5, "N*s^2/m", "500 g"),
        (2.0, "N*s^2/mm", "2 t"), (1225.0, "N*mm", "1.225 J"), (78.8549, "N*mm", "78.8549 mJ"),
        (999.9999999, "N*mm", "1 J"), (0.0, "N*mm", "0 N*mm"), (3.0, "lbf*in", "3 lbf*in"),
        (4.3e-3, "s", "0.0043 s"), (-1.5e3, "N*mm", "-1.5 J"), (7.0, "", "7"),
    ],
)  # fmt: skip
def test_masses_are_shown_in_grams_and_energies_in_joules(
    value: float, unit: str, text: str
) -> None:
    assert quantity(value, unit) == text
