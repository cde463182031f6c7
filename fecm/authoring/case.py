"""Case of a sweep: its values by name, the check of its deck, and limits of quantities."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

from fecm._errors import FecmError
from fecm.deck.findings import Findings
from fecm.deck.model import Deck
from fecm.deck.quantities import EXAMPLES, in_units
from fecm.deck.reader import ParsedProblem
from fecm.deck.units import UnitsError
from fecm.problem.check import check_problem
from fecm.problem.problem import Problem
from fecm.problem.rules.time_step import UNSTABLE
from fecm.results.metrics import COLUMNS

Value = float | int | str
Case = dict[str, Value]
MOST_CASES = 1_000_000
# Names whose values are texts of two numbers, with the form of the text and its separators.
PAIRS = {
    "at": ("({},{})", r"[,;\s]+"),
    "size": ("{}x{}", "[xX×]"),
}


class CasesError(FecmError, ValueError):
    """The cases are invalid."""


def number_of_text(name: str, text: str) -> float:
    """Parse a finite number; raise CasesError if the text is not one."""
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise CasesError(f"{name} must be a finite number, not `{text.strip()}`")


def pair_of_text(name: str, text: str) -> tuple[float, float]:
    """Parse a text of two numbers, such as ``(3,2)`` or ``6x4``.

    Raises CasesError if the text does not have two numbers.
    """
    form, separators = PAIRS[name]
    parts = re.split(separators, text.strip().removeprefix("(").removesuffix(")").strip())
    if len(parts) != 2:
        raise CasesError(f"{name} must be two numbers as in {form.format(6, 4)}, not `{text}`")
    return number_of_text(name, parts[0]), number_of_text(name, parts[1])


def normal_pair(name: str, text: str) -> str:
    """Return a text of two numbers in its usual form."""
    form, _ = PAIRS[name]
    return form.format(*(repr(value).removesuffix(".0") for value in pair_of_text(name, text)))


def check_count(count: int, cases: str = "") -> None:
    """Raise CasesError if there are no cases or too many; `cases` names them in the message."""
    if not count:
        raise CasesError("a sweep needs at least one case")
    if count > MOST_CASES:
        raise CasesError(f"{cases or f'{count} cases'}; at most {MOST_CASES} are allowed")


def check_deck(deck: Deck) -> Problem:
    """Check a complete deck; raise CasesError with its first error."""
    findings = Findings()
    checked = check_problem(ParsedProblem(deck), findings)
    raise_first(findings)
    assert checked is not None  # the deck has a control card
    return checked


def raise_first(findings: Findings) -> None:
    """Raise CasesError with the first error, if there is one."""
    if findings.errors:
        first = findings.errors[0]
        remedy = " Vary dt=auto, or take DT 0." if first.code == UNSTABLE else ""
        raise CasesError(f"{first.message}{remedy}")


THRESHOLD = "threshold"  # the delamination threshold, in place of a number
PEAK_FORCE = "peak_force"
NO_THRESHOLD = (
    "the threshold needs a DELA segment and a plate without a core, which the deck does not have"
)


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
