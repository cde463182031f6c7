"""Reads the pages that reports write, as a program of their reader would."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = ("meta", "img", "br")
# Power of ten of the prefixes in front of a unit.
PREFIXES = {"n": -9, "µ": -6, "m": -3, "": 0, "k": 3, "M": 6, "G": 9}
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass
class Cell:
    """A cell of a table: its text, and the number that stands beside it."""

    text: str = ""
    value: float | None = None


@dataclass
class Page:
    """What a page holds."""

    headings: list[str] = field(default_factory=list)
    captions: list[str] = field(default_factory=list)
    rows: list[list[Cell]] = field(default_factory=list)
    terms: list[list[Cell]] = field(default_factory=list)  # of lists of names and values
    pictures: list[dict[str, str]] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    addresses: list[str] = field(default_factory=list)
    names: list[str] = field(default_factory=list)  # of all elements
    ids: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """All text, in one line."""
        return " ".join(" ".join(self.texts).split())

    def row(self, name: str) -> list[Cell]:
        """The first row whose heading is this name, without it."""
        return next(row[1:] for row in self.rows if row[0].text == name)

    def term(self, name: str) -> list[Cell]:
        """The values of a name in the head."""
        return next(row[1:] for row in self.terms if row[0].text == name)

    def numbers(self) -> Iterator[Cell]:
        """Cells with a number."""
        rows = [*self.terms, *self.rows]
        return (cell for row in rows for cell in row if cell.value is not None)


class _Reader(HTMLParser):
    """Fills a page; refuses elements that are not closed in their order."""

    def __init__(self) -> None:
        super().__init__()
        self.page = Page()
        self.open: list[str] = []

    def _cell(self) -> Cell:
        """The last cell, of a table or of a list of names and values."""
        rows = self.page.terms if {"dt", "dd"} & set(self.open) else self.page.rows
        return rows[-1][-1]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        given = {name: value or "" for name, value in attrs}
        self.page.names.append(tag)
        self.page.addresses += [given[name] for name in ("src", "href") if name in given]
        self.page.ids += [given["id"]] if "id" in given else []
        if tag == "tr":
            self.page.rows.append([])
        if tag in ("td", "th"):
            self.page.rows[-1].append(Cell())
        if tag == "dt":
            self.page.terms.append([])
        if tag in ("dt", "dd"):
            self.page.terms[-1].append(Cell())
        if tag == "data":
            self._cell().value = float(given["value"])
        if tag == "img":
            self.page.pictures.append(given)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Close an element."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Note a text."""
        if {"style"} & set(self.open):
            return
        self.page.texts.append(data)
        if {"td", "th", "dt", "dd"} & set(self.open):
            self._cell().text += data
        elif self.open and self.open[-1] in ("h1", "h2", "h3"):
            self.page.headings.append(data)
        elif self.open and self.open[-1] == "caption":
            self.page.captions.append(data)


def read_page(html: str) -> Page:
    """Contents of a page."""
    reader = _Reader()
    reader.feed(html)
    reader.close()
    assert reader.open == []
    return reader.page


def agrees(cell: Cell) -> bool:
    """Whether the number of a cell is the one that its text shows, up to a prefix of its unit."""
    assert cell.value is not None
    actual = NUMBER.search(cell.text)
    assert actual is not None, cell
    said, value = float(actual[0]), cell.value
    digits = len(re.sub(r"e.*|\D", "", actual[0]).lstrip("0"))
    powers = [0, -2, *PREFIXES.values()]  # per cent too
    tolerance = 0.5000001 * 10.0 ** (1 - digits) if digits > 1 else 0.5000001
    return value == said == 0.0 or any(
        abs(said * 10.0**power - value) <= tolerance * abs(value) * 1.0 + 1e-300 for power in powers
    )
