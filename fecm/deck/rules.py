"""Rules: the meaning of each code of a finding, beside the function that finds it.

Most rules are functions, decorated with :func:`rule`, that check a segment or a problem and yield a
:class:`Report` for each fault. The docstring is the text of the rule. Faults in cards that are
being read have no such function; ``reader_rules.py`` declares their codes.
``fecm/problem/findings_page.py`` generates the page ``docs/findings.md`` from the declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from enum import StrEnum
from typing import NamedTuple, ParamSpec, TypeAlias

from fecm.deck.findings import CardPlace, Finding, Findings

P = ParamSpec("P")


class Subject(StrEnum):
    """Subjects of rules: the headings of the page, in its order."""

    FRAME = "Frame of the file"
    NUMBERS = "Numbers"
    SEGMENTS = "Counts and segments"
    MESH = "Mesh"
    LAMINATE = "Laminate"
    IMPACT = "Impact, contact and projectile"
    POINTS = "Patch, shear, gages, ply stresses"
    DAMAGE = "Damage and damping"
    PROGRAM = "Macro program"
    LISTING = "Listing mode"


class Rule(NamedTuple):
    """Text of a rule."""

    code: str
    subject: Subject
    summary: str  # the fault, in one sentence without markup
    remedy: str  # sentences in Markdown
    cause: str  # more about the fault, in Markdown; may be empty


class Report(NamedTuple):
    """Fault found by a rule: the finding without its code."""

    message: str
    place: CardPlace | None = None
    hint: str = ""


Reports: TypeAlias = Iterator[Report]
RULES: dict[str, Rule] = {}  # rules of the modules that are imported, by code


def declare(code: str, subject: Subject, summary: str, *, remedy: str, cause: str = "") -> None:
    """Declare the text of a code.

    Raises ValueError if the code is taken.
    """
    if code in RULES:
        raise ValueError(f"the code {code} is taken: {RULES[code].summary}")
    RULES[code] = Rule(code, subject, summary, remedy, cause)


def reports(code: str) -> Callable[[Callable[P, Reports]], Callable[P, list[Finding]]]:
    """Give the reports of a function a code that is declared elsewhere."""

    def decorate(function: Callable[P, Reports]) -> Callable[P, list[Finding]]:
        def find(*args: P.args, **kwargs: P.kwargs) -> list[Finding]:
            return [Finding(code, *report) for report in function(*args, **kwargs)]

        find.__name__, find.__doc__ = function.__name__, function.__doc__
        return find

    return decorate


def rule(
    code: str, subject: Subject
) -> Callable[[Callable[P, Reports]], Callable[P, list[Finding]]]:
    """Declare a code by the docstring of a function, and give it to the function's reports.

    The first paragraph of the docstring is the summary. The last one starts with "Remedy:". The
    paragraphs between them are the cause.
    """

    def decorate(function: Callable[P, Reports]) -> Callable[P, list[Finding]]:
        # Python with -OO has no docstrings; the findings do not need them.
        text = function.__doc__ or f"{code}.\n\nRemedy: "
        summary, *cause, remedy = [" ".join(part.split()) for part in text.split("\n\n")]
        declare(
            code, subject, summary, remedy=remedy.removeprefix("Remedy: "), cause=" ".join(cause)
        )
        return reports(code)(function)

    return decorate


def apply(
    rules: Iterable[Callable[P, list[Finding]]],
    findings: Findings,
    *args: P.args,
    **kwargs: P.kwargs,
) -> bool:
    """Apply rules one after the other; return whether they found no error."""
    before = findings.error_count
    for rule_function in rules:
        findings.extend(rule_function(*args, **kwargs))
    return findings.error_count == before


def apply_first(
    rules: Iterable[Callable[P, list[Finding]]],
    findings: Findings,
    *args: P.args,
    **kwargs: P.kwargs,
) -> None:
    """Apply rules up to the first with a finding; the others would repeat it."""
    for rule_function in rules:
        if has_findings := rule_function(*args, **kwargs):
            findings.extend(has_findings)
            return
