"""Findings: what is wrong with a deck, where, and how to mend it.

A finding has a stable code whose first letter is its severity: ``E`` for an error, ``W`` for a
warning.  Lines and columns are counted from 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Place:
    """Where a value stands: its line, its first and last column, and the card's text."""

    line: int
    first: int
    last: int
    text: str
    field: str = ""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong with a deck.

    Attributes
    ----------
    code : str
        Stable identifier, ``E101`` for an error or ``W301`` for a warning.
    message : str
        One sentence that stands alone.
    place : Place or None
        Where it is; None when no single card is to blame.
    hint : str
        How to mend it; may be empty.
    """

    code: str
    message: str
    place: Place | None = None
    hint: str = ""

    @property
    def severity(self) -> str:
        """``"error"`` or ``"warning"``."""
        return "error" if self.code.startswith("E") else "warning"

    def to_dict(self, source: str) -> dict[str, object]:
        """The finding as plain values, for JSON.

        Parameters
        ----------
        source : str
            Name of the deck's file.
        """
        place = self.place
        return {
            "kind": "finding",
            "severity": self.severity,
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

    def render(self, source: str) -> str:
        """Write the finding as a person reads it, with the card and a caret under the field.

        Parameters
        ----------
        source : str
            Name of the deck's file, for the ``FILE:LINE:COLUMN`` that opens the text.
        """
        head = f"{self.severity}[{self.code}]: {self.message}"
        if self.place is None:
            lines = [f"{source}: {head}"]
        else:
            place = self.place
            number = str(place.line)
            margin = " " * len(number)
            width = max(1, place.last - place.first + 1)
            mark = " " * (place.first - 1) + "^" * width
            if place.field:
                mark += f" {place.field}"
            lines = [
                f"{source}:{place.line}:{place.first}: {head}",
                f" {number} | {place.text.rstrip()}",
                f" {margin} | {mark}",
            ]
        if self.hint:
            lines.append(f"   hint: {self.hint}")
        return "\n".join(map(_printable, lines))


def _printable(text: str) -> str:
    """A text that a terminal shows as it stands: control characters become dots."""
    return "".join(char if char.isprintable() else "·" for char in text)


class Findings:
    """A list of findings that grows while a deck is read and checked."""

    def __init__(self) -> None:
        self._all: list[Finding] = []

    def add(self, code: str, message: str, place: Place | None = None, hint: str = "") -> None:
        """Note one more finding."""
        self._all.append(Finding(code, message, place, hint))

    def __iter__(self) -> Iterator[Finding]:
        """Iterate in the order of the deck; findings without a place come last."""
        return iter(
            sorted(
                self._all,
                key=lambda f: (f.place is None, f.place.line if f.place else 0),
            )
        )

    def __len__(self) -> int:
        return len(self._all)

    @property
    def errors(self) -> list[Finding]:
        """The findings that make the deck unusable."""
        return [finding for finding in self if finding.severity == "error"]

    @property
    def warnings(self) -> list[Finding]:
        """The findings that a person should know of."""
        return [finding for finding in self if finding.severity == "warning"]


class DeckError(ValueError):
    """A deck can't be used; carries every finding, not just the first.

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
