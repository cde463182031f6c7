"""What a page consists of: sections of tables, judgements, notes, pictures and listings.

Numbers keep their value beside the text that shows them, so that a reader's program can take them
from the page: ``<data value="16169.7">16169.7 N</data>``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from enum import StrEnum

from fecm._dataclasses import frozen
from fecm._text import DIGITS
from fecm.deck.units import quantity, thousands, with_prefix

UNKNOWN = "–"  # of a value that is not known
MOST_TEXT = 200_000  # characters of a listing
SCALED = ("N", "kN", "s", "ms", "us", "µs")  # units that take a prefix


class Level(StrEnum):
    """Whether a number may be trusted, in words."""

    WITHIN = "within range"
    DOUBTFUL = "doubtful"
    OUTSIDE = "outside the model"
    UNJUDGED = "not judged"


@frozen
class Number:
    """A number and the text that shows it."""

    value: float
    text: str


Cell = str | Number


@frozen
class Judgement:
    """A quantity, its size, and whether it is within the range of the model."""

    level: Level
    name: str
    size: Cell
    words: str = ""


@frozen
class Block:
    """A part of a section; each kind has its template, a macro of this name in page.html."""

    @property
    def kind(self) -> str:
        """Name of the macro."""
        return type(self).__name__.lower()


@frozen
class Table(Block):
    """A table; the first cell of a row is its heading."""

    header: tuple[str, ...]  # empty for a table of names and values
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""


@frozen
class Judgements(Block):
    """A table of judgements."""

    rows: tuple[Judgement, ...]
    caption: str = ""


@frozen
class Notes(Block):
    """Sentences, as a list."""

    texts: tuple[str, ...]
    title: str = ""


@frozen
class Picture(Block):
    """A picture inside the page."""

    source: str  # ``data:`` address
    alternative: str  # what it shows, in words, for readers who do not see it
    caption: str
    wide: bool = False


@frozen
class Listing(Block):
    """A long text, folded."""

    title: str
    text: str


@frozen
class Section:
    """A heading and what stands below it."""

    title: str
    blocks: tuple[Block, ...]


@frozen
class Page:
    """A page about one or more results."""

    title: str
    verdict: tuple[str, ...]  # sentences
    level: Level  # the worst of the page
    sections: tuple[Section, ...]


def shown(value: float, unit: str = "", digits: int = DIGITS) -> str:
    """A value with its unit; forces and times with a prefix, as 16.2 kN of 16200 N."""
    if unit in SCALED and 0.0 < abs(value) < math.inf:
        power = thousands(float(f"{abs(value):.{digits}g}"))
        if name := with_prefix(unit, power):
            return f"{value / 10.0**power:.{digits}g} {name}"
    return quantity(value, unit, digits)


def number(value: float, unit: str = "", digits: int = DIGITS) -> Cell:
    """A number with its unit; a dash for one that is not known."""
    return UNKNOWN if math.isnan(value) else Number(float(value), shown(value, unit, digits))


def share(value: float, digits: int = 3) -> Cell:
    """A ratio in per cent."""
    return UNKNOWN if math.isnan(value) else Number(float(value), f"{100.0 * value:.{digits}g} %")


def table(
    rows: Iterable[Sequence[Cell]], header: Sequence[str] = (), caption: str = ""
) -> list[Block]:
    """A table as a list of blocks, which is empty without rows."""
    found = tuple(tuple(row) for row in rows)
    return [Table(tuple(header), found, caption)] if found else []


def notes(texts: Iterable[str], title: str = "") -> list[Block]:
    """A list of sentences as a list of blocks, which is empty without sentences."""
    found = tuple(dict.fromkeys(texts))
    return [Notes(found, title)] if found else []


def listing(title: str, text: str) -> Listing:
    """A listing, cut where it would make the page large; its checksum is that of the whole text."""
    if len(text) <= MOST_TEXT:
        return Listing(title, text)
    kept = text[:MOST_TEXT].rpartition("\n")[0]
    left = text.count("\n") - kept.count("\n") - 1
    return Listing(title, f"{kept}\n... {left} more lines, which the result has")


def sections(given: Iterable[tuple[str, Iterable[Block]]]) -> tuple[Section, ...]:
    """Sections of titles and blocks; those without blocks are left out."""
    found = ((title, tuple(blocks)) for title, blocks in given)
    return tuple(Section(title, blocks) for title, blocks in found if blocks)


def worst(judgements: Iterable[Judgement]) -> Level:
    """The worst level of some judgements."""
    order = (Level.OUTSIDE, Level.DOUBTFUL)
    levels = {one.level for one in judgements}
    return next((level for level in order if level in levels), Level.WITHIN)
