"""Case: values by name, their texts, and the check of its deck."""

from __future__ import annotations

import math
import re
from contextlib import suppress

from fecm._errors import FecmError
from fecm.deck.findings import Findings
from fecm.deck.model import Deck
from fecm.deck.reader import ParsedProblem
from fecm.problem.check import check_problem
from fecm.problem.problem import Problem
from fecm.problem.rules.time_step import UNSTABLE

Value = float | int | str
Case = dict[str, Value]
MOST_CASES = 1_000_000
# Names whose values are texts of two numbers, with the form of the text and its separators.
PAIRS = {
    "at": ("({},{})", r"[,;\s]+"),
    "size": ("{}x{}", "[xX×]"),
}

NO_THRESHOLD = (
    "the threshold needs a DELA segment and a plate without a core, which the deck does not have"
)


class CasesError(FecmError, ValueError):
    """The cases are invalid."""


def number_of_text(name: str, text: str) -> float:
    """Parse a finite number; raise CasesError if the text is not one."""
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise CasesError(f"{name} must be a finite number, not `{text.strip()}`")


def parts_of_pair(name: str, text: str) -> list[str]:
    """Return the two parts of a text such as ``(3,2)`` or ``6x4``; raise CasesError otherwise."""
    form, separators = PAIRS[name]
    parts = re.split(separators, text.strip().removeprefix("(").removesuffix(")").strip())
    if len(parts) != 2:
        raise CasesError(f"{name} must be two numbers as in {form.format(6, 4)}, not `{text}`")
    return parts


def pair_of_text(name: str, text: str) -> tuple[float, float]:
    """Parse a text of two numbers; raise CasesError if it does not have them."""
    first, second = parts_of_pair(name, text)
    return number_of_text(name, first), number_of_text(name, second)


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
