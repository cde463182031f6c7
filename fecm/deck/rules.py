"""Rules: the codes of findings, their texts, and the functions that find the faults.

Most rules are functions with the decorator :func:`rule`. Such a function checks a segment or a
problem and yields a :class:`Report` for each fault. Its docstring is the text of the rule. Faults
that the reader itself finds have no such function; ``reader_rules.py`` declares their codes.
``fecm/problem/findings_page.py`` generates the page ``docs/findings.md`` from the declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from enum import StrEnum
from typing import NamedTuple, ParamSpec, TypeAlias

from fecm.deck.findings import CardPlace, Finding, Findings

P = ParamSpec("P")


class Subject(StrEnum):
    """Subjects of rules. They are the headings of the page of findings, in this order."""

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
    """Fault that a rule found: a finding without its code."""

    message: str
    place: CardPlace | None = None
    hint: str = ""


Reports: TypeAlias = Iterator[Report]
RULES: dict[str, Rule] = {}  # rules of all imported modules, by code


def declare(code: str, subject: Subject, summary: str, *, remedy: str, cause: str = "") -> None:
    """Declare the text of a code; raise ValueError if another rule has the code."""
    if code in RULES:
        raise ValueError(f"the code {code} is taken: {RULES[code].summary}")
    RULES[code] = Rule(code, subject, summary, remedy, cause)


def reports(code: str) -> Callable[[Callable[P, Reports]], Callable[P, list[Finding]]]:
    """Decorate a function to return its reports as findings with a code declared elsewhere."""

    def decorate(function: Callable[P, Reports]) -> Callable[P, list[Finding]]:
        def find(*args: P.args, **kwargs: P.kwargs) -> list[Finding]:
            return [Finding(code, *report) for report in function(*args, **kwargs)]

        find.__name__, find.__doc__ = function.__name__, function.__doc__
        return find

    return decorate


def rule(
    code: str, subject: Subject
) -> Callable[[Callable[P, Reports]], Callable[P, list[Finding]]]:
    """Decorate a function as the rule of a code, with its docstring as the text of the code.

    The first paragraph of the docstring is the summary. The last paragraph starts with "Remedy:".
    The paragraphs between them are the cause.
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
    """Apply rules one after the other; return True if they find no error."""
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
    """Apply rules up to the first rule with a finding; later rules would only repeat it."""
    for rule_function in rules:
        if results := rule_function(*args, **kwargs):
            findings.extend(results)
            return
