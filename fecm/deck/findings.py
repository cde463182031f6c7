"""Findings: errors, warnings and notes about a deck, each with its place and a remedy.

A finding has a stable code whose first letter is its severity: ``E`` for an error, ``W`` for a
warning, ``N`` for a note.  Lines and columns are counted from 1.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from enum import StrEnum
from typing import Annotated, Literal, NamedTuple, TypedDict

from fecm._errors import FecmError
from fecm._table import hanging

MOST = 1000  # largest number of errors to keep; the same limit holds for warnings
WIDEST = 200  # characters of a card that are shown
LONGEST = 600  # characters of a message that are shown


class Severity(StrEnum):
    """Severity of a finding."""

    ERROR = "error"  # the deck is refused
    WARNING = "warning"
    NOTE = "note"


class FindingJson(TypedDict):
    """Finding in JSON."""

    kind: Literal["finding"]
    severity: Annotated[str, Severity]
    code: Annotated[str, re.compile("^[EWN][0-9]{3}$")]
    message: str
    file: str
    line: Annotated[int | None, "From 1; null if no single card is the cause."]
    column: Annotated[int | None, "First column of the field, from 1."]
    end_column: Annotated[int | None, "Last column of the field."]
    field: str
    card: str
    hint: str


SEVERITIES = {"E": Severity.ERROR, "W": Severity.WARNING, "N": Severity.NOTE}  # by a code's letter


class CardPlace(NamedTuple):
    """Place of a value: line, first and last column, and the text of the card."""

    line: int
    first: int
    last: int
    text: str
    field: str = ""


class Finding(NamedTuple):
    """One error, warning or note.

    Attributes
    ----------
    code : str
        Stable identifier, ``E101`` for an error, ``W301`` for a warning, ``N414`` for a note.
    message : str
        One self-contained sentence.
    place : Place or None
        None if no single card is the cause.
    hint : str
        Remedy; may be empty.
    """

    code: str
    message: str
    place: CardPlace | None = None
    hint: str = ""

    @property
    def severity(self) -> Severity:
        """Severity, given by the first letter of the code."""
        return SEVERITIES[self.code[0]]

    def to_dict(self, source: str) -> FindingJson:
        """Return the finding as plain values for JSON; `source` is the name of the deck's file."""
        place = self.place
        return {
            "kind": "finding",
            "severity": self.severity.value,
            "code": self.code,
            "message": self.message,
            "file": source,
            "line": place.line if place else None,
            "column": place.first if place else None,
            "end_column": place.last if place else None,
            "field": place.field if place else "",
            "card": place.text if place else "",
            "hint": self.hint,
        }

    def render(self, source: str, columns: int | None = None) -> str:
        """Format the finding as text, with the card and a caret under the field.

        A note is one line, without its card. The text starts with `source`, the name of the file.
        Lines have at most some columns; of a longer card the part around the field is shown.
        """
        head = f"{self.severity}[{self.code}]: {self.message}"
        place = self.place
        where = f"{source}:{place.line}:{place.first}" if place else source
        lines = hanging(f"{where}: {head}", columns)
        if place and self.severity is not Severity.NOTE:
            lines += _marked_card(place, columns)
        if self.hint:
            lines += hanging(f"   hint: {self.hint}", columns)
        # A terminal would interpret control characters.
        return "\n".join("".join(c if c.isprintable() else "·" for c in line) for line in lines)


def _marked_card(place: CardPlace, columns: int | None) -> list[str]:
    """Return the card with its line number, and a caret under the field."""
    card = place.text.rstrip()
    start, last = 0, place.last
    number = str(place.line)
    margin = " " * len(number)
    room = WIDEST if columns is None else columns - len(f" {number} | ")
    widest = min(WIDEST, room)
    if len(card) > widest:  # show the part around the place
        start = max(0, place.first - 1 - widest // 2)
        card = card[start : start + widest]
        last = min(last, start + len(card))
    mark = " " * (place.first - start - 1) + "^" * max(1, last - place.first + 1)
    return [f" {number} | {card}", f" {margin} | {mark} {place.field}".rstrip()]


def _shorten(text: str) -> str:
    """Cut the middle out of a long text."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


class Findings:
    """List of findings that grows while a deck is read and checked."""

    def __init__(self) -> None:
        self._all: list[Finding] = []
        self.counts: Counter[str] = Counter()  # number of findings by code, kept or not
        self.error_count: int = 0
        self.closed: bool = False  # whether the list is full, so that reading can stop

    def add(self, code: str, message: str, place: CardPlace | None = None, hint: str = "") -> None:
        """Add a finding. After :data:`MOST` errors, report that there are more, and close."""
        is_error = code.startswith("E")
        self.counts[code] += 1
        self.error_count += is_error
        if self.closed or (not is_error and len(self) - self.error_count > MOST):
            return
        self._all.append(Finding(code, _shorten(message), place, _shorten(hint)))
        if self.error_count == MOST:
            self.closed = True
            message = f"There are {MOST} errors or more; the rest of the file is not checked."
            self._all.append(Finding("E000", message))

    def extend(self, findings: Iterable[Finding]) -> None:
        """Add findings as :meth:`add` does."""
        for finding in findings:
            self.add(finding.code, finding.message, finding.place, finding.hint)

    def __iter__(self) -> Iterator[Finding]:
        """Iterate in the order of the deck; findings without a place come last."""
        more = len(self) - self.error_count - MOST
        findings = list(self._all)
        if more > 0:
            findings.append(Finding("W000", f"{more} more warnings are not shown."))
        return iter(
            sorted(findings, key=lambda f: (f.place is None, f.place.line if f.place else 0))
        )

    def __len__(self) -> int:
        return self.counts.total()

    @property
    def errors(self) -> list[Finding]:
        """The errors, which make the deck unusable."""
        return [finding for finding in self if finding.severity is Severity.ERROR]


class DeckError(FecmError, ValueError):
    """Error of a deck that can't be used, with every finding about it.

    Attributes
    ----------
    findings : list of Finding
        Errors and warnings in the deck's order.
    source : str
        The deck's file name, or ``<text>``.
    """

    def __init__(self, findings: list[Finding], source: str) -> None:
        self.findings = findings
        self.source = source
        super().__init__("\n".join(finding.render(source) for finding in findings))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the error with its arguments and its notes."""
        return DeckError, (self.findings, self.source), self.__dict__
