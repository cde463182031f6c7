"""Limits of quantities: probabilities that they are exceeded, and levels that searches reach."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from fecm.authoring.case import NO_THRESHOLD, CasesError, number_of_text
from fecm.deck.quantities import EXAMPLES, in_units
from fecm.deck.units import UnitsError
from fecm.results.metrics import COLUMNS

THRESHOLD = "threshold"  # the delamination threshold, in place of a number
PEAK_FORCE = "peak_force"


class Limit(NamedTuple):
    """Quantity whose probability of exceedance is requested, and its limit."""

    quantity: str
    value: float | str  # a number or :data:`THRESHOLD`


def level_of(quantity: str, text: str, system: str | None) -> float:
    """Parse a level of a quantity; one with a unit is converted to a system of units.

    Raises CasesError if the text is not a finite number, or the unit does not fit.
    """
    dimension = COLUMNS[quantity].dimension if quantity in COLUMNS else ""
    if dimension not in EXAMPLES:
        return number_of_text(quantity, text)
    try:
        return number_of_text(quantity, repr(in_units(quantity, text, dimension, system)))
    except UnitsError as error:
        raise CasesError(str(error)) from None


def parse_exceed(text: str, system: str | None = None) -> Limit:
    """Parse ``QUANTITY=NUMBER`` or ``peak_force=threshold``; raise CasesError for other texts.

    A number with a unit, as in ``peak_force=6kN``, is converted to the system of units.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    if not name or not value or (value == THRESHOLD and name != PEAK_FORCE):
        raise CasesError(f"`{text}`: write QUANTITY=NUMBER or {PEAK_FORCE}={THRESHOLD}")
    return Limit(name, value if value == THRESHOLD else level_of(name, value, system))


def check_limits(limits: Sequence[Limit], quantities: Sequence[str], *, threshold: bool) -> None:
    """Raise CasesError if a quantity is unknown, or the deck has no threshold."""
    for limit in limits:
        if limit.quantity not in quantities:
            names = ", ".join(quantities)
            raise CasesError(f"there is no quantity `{limit.quantity}`; there are {names}")
        if limit.value == THRESHOLD and not threshold:
            raise CasesError(NO_THRESHOLD)
