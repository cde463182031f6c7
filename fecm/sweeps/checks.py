"""The checks of ``fecm check`` on the deck of a case: its first error is that of the case."""

from __future__ import annotations

from fecm.deck.findings import Findings
from fecm.deck.model import Deck
from fecm.deck.reader import ParsedProblem
from fecm.problem.check import check
from fecm.problem.problem import Problem
from fecm.problem.rules.time_step import UNSTABLE
from fecm.sweeps.case import CasesError


def check_deck(deck: Deck) -> Problem:
    """Check a complete deck.  Raises CasesError if it has an error; the first is the message."""
    findings = Findings()
    checked = check(ParsedProblem(deck), findings)
    raise_first(findings)
    assert checked is not None  # the deck has a control card
    return checked


def raise_first(findings: Findings) -> None:
    """Raise the first error as that of a case."""
    if findings.errors:
        first = findings.errors[0]
        remedy = " Vary dt=auto, or take DT 0." if first.code == UNSTABLE else ""
        raise CasesError(f"{first.message}{remedy}")
