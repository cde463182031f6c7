"""Tables and summaries of decks, results and fits for terminals, notebooks and pages.

A quantity is described once, as a row. Terminals, notebooks and report pages show the same rows. A
summary begins with the line that answers; its rows follow in groups.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import NamedTuple, TypeAlias


class ShownNumber(NamedTuple):
    """Number and the text that shows it."""

    value: float
    text: str


Cell: TypeAlias = str | ShownNumber
Row: TypeAlias = tuple[Cell, ...]  # an empty label continues the row before

LABEL_WIDTH = 18  # of the labels in a terminal
INDENT = "  "  # of the rows of a group
LEAST_COLUMNS = 20  # of wrapped lines
LABEL = re.compile(r"\s*\S+(?: \S+)*  +(?=\S)")  # of a value on the same line


@dataclass(frozen=True)
class Table:
    """Title, header and rows of cells.

    Attributes
    ----------
    rows : tuple of tuples
        Rows of cells.  The first cell of a row is its label.
    header : tuple of str
        Names of the columns; empty for a table of labels and values.
    title : str
        What the table is about.
    """

    rows: tuple[Row, ...]
    header: tuple[str, ...] = ()
    title: str = ""


@dataclass(frozen=True)
class Summary:
    """Line that answers, groups of rows, and notes.

    Attributes
    ----------
    title : str
        What the summary is about.
    answer : str
        What the reader wants to know first, in one line.
    groups : tuple of Table
        Tables with their headings; a group without rows is not shown.
    notes : tuple of str
        Reasons to doubt the numbers.
    """

    title: str
    answer: str
    groups: tuple[Table, ...]
    notes: tuple[str, ...] = ()

    @property
    def rows(self) -> tuple[Row, ...]:
        """Rows of the groups of labels and values."""
        return tuple(row for group in self.groups if not group.header for row in group.rows)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the groups, without headings."""
        for group in self.groups:
            yield from text_lines(group)

    def with_rows(self, title: str, *rows: Row) -> Summary:
        """Return the summary with more rows in the group of this title, or in a new one."""
        more = Table(rows, title=title)
        if self.groups and (last := self.groups[-1]).title == title:
            more = replace(last, rows=(*last.rows, *rows))
        return replace(self, groups=(*(g for g in self.groups if g.title != title), more))

    def __str__(self) -> str:
        lines = [line.text for line in summary_lines(self)]
        return "\n".join([*lines, *[""][: len(self.notes)], *(f"note: {n}" for n in self.notes)])


class Part(Enum):
    """Part of a summary to which a line belongs."""

    TITLE = auto()
    ANSWER = auto()
    HEADING = auto()
    ROW = auto()


class Line(NamedTuple):
    """Line of a summary."""

    text: str
    part: Part


def summary_lines(summary: Summary, columns: int | None = None) -> Iterator[Line]:
    """Yield title, answer, and each group after a blank line; `columns` is the longest line."""
    yield from (Line(text, Part.TITLE) for text in wrapped(summary.title, columns))
    yield from (Line(text, Part.ANSWER) for text in wrapped(summary.answer, columns))
    for group in summary.groups:
        if group.rows:
            yield Line("", Part.ROW)
            yield from (Line(text, Part.HEADING) for text in wrapped(group.title, columns))
            lines = text_lines(group, columns=None if columns is None else columns - len(INDENT))
            yield from (Line(f"{INDENT}{text}".rstrip(), Part.ROW) for text in lines)


def wrapped(text: str, columns: int | None, indent: int = 0) -> list[str]:
    """Return the lines of a text that are not longer than some columns, except for long words."""
    if columns is None or len(text) <= columns:
        return [text]
    from textwrap import wrap  # only for terminals

    return wrap(
        text,
        max(columns, LEAST_COLUMNS),
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def hanging(text: str, columns: int | None) -> list[str]:
    """Return the lines of a text; those after the first begin under the value of a label.

    Examples
    --------
    >>> hanging("  peak force  86.2 lb at 1.2 ms", 22)
    ['  peak force  86.2 lb', '              at 1.2', '              ms']
    >>> hanging("note: the plate is thin", 20)
    ['note: the plate is', '  thin']
    """
    indent = len(text) - len(text.lstrip()) + len(INDENT)
    if columns is not None and (label := LABEL.match(text)) and label.end() < 2 * columns // 3:
        indent = label.end()
    return wrapped(text, columns, indent)


def label_lines(
    rows: Iterable[Row], width: int = LABEL_WIDTH, columns: int | None = None
) -> list[str]:
    """Return the lines of labels and values for a terminal.

    Values are wrapped so that lines have at most so many columns.

    Examples
    --------
    >>> label_lines([("peak force", "86.2 lb"), ("", "in contact 2")])
    ['peak force        86.2 lb', '                  in contact 2']
    """
    lines, rows = [], list(rows)
    width = max(width, *(len(_text(label)) + 2 for label, _ in rows)) if rows else width
    for label, value in rows:
        room = None if columns is None else columns - width
        first, *others = wrapped(_text(value), room)
        lines += [f"{_text(label):{width}}{first}".rstrip()]
        lines += [f"{'':{width}}{line}" for line in others]
    return lines


def text_lines(table: Table, width: int = LABEL_WIDTH, columns: int | None = None) -> list[str]:
    """Return the lines of a table without its title, for a terminal.

    A table that is wider than `columns` is printed in parts; each has the first column.
    """
    if not table.header:
        return label_lines(table.rows, width, columns)
    columns_of = zip(*table.rows, strict=True)
    are_numbers = [not any(isinstance(cell, str) and cell for cell in c) for c in columns_of]
    rows = [table.header, *(tuple(map(_text, row)) for row in table.rows)]
    lines: list[str] = []
    for part in _parts(rows, columns):
        cells = [[row[number] for number in part] for row in rows]
        lines += aligned(cells, [are_numbers[number] for number in part])
    return lines


def titled_lines(*tables: Table, width: int = LABEL_WIDTH, columns: int | None = None) -> list[str]:
    """Return the title of the first table, and the lines of all tables under it."""
    room = None if columns is None else columns - len(INDENT)
    lines = [line for table in tables for line in text_lines(table, width, room)]
    return [tables[0].title, *(f"{INDENT}{line}" for line in lines)]


def _parts(rows: Sequence[Sequence[str]], columns: int | None) -> Iterator[list[int]]:
    """Yield the numbers of the table's columns that fit beside the first, part by part."""
    first, *widths = (max(map(len, column)) for column in zip(*rows, strict=True))
    part, width = [0], first
    for number, more in enumerate(widths, 1):
        if columns is not None and len(part) > 1 and width + 2 + more > columns:
            yield part
            part, width = [0], first
        part.append(number)
        width += 2 + more
    yield part


def aligned(rows: Sequence[Sequence[str]], to_the_right: Sequence[bool] = ()) -> list[str]:
    """Return lines in which each column is as wide as its longest text."""
    columns = list(zip(*rows, strict=True))
    sides = to_the_right or [False] * len(columns)
    padded = [
        [f"{text:{'>' if right else '<'}{max(map(len, column))}}" for text in column]
        for column, right in zip(columns, sides, strict=True)
    ]
    return ["  ".join(row).rstrip() for row in zip(*padded, strict=True)]


def html_table(*tables: Table) -> str:
    """Return tables as HTML, for notebooks."""
    return "".join(map(_html, tables))


def html_summary(subject: object, rows: Iterable[Row]) -> str:
    """Return labels and values of a subject as HTML, under its ``repr``, for notebooks."""
    return html_table(Table(tuple(rows), title=repr(subject)[1:-1]))


def html_of(subject: object, summary: Summary) -> str:
    """Return a summary of a subject as HTML, under its ``repr``, for notebooks."""
    from html import escape  # 1 ms, only in notebooks

    notes = Table(tuple(("note", note) for note in summary.notes), title="Notes")
    tables = html_table(*(group for group in (*summary.groups, notes) if group.rows))
    title, answer = escape(repr(subject)[1:-1]), escape(summary.answer)
    return f"<p>{title}</p><p><b>{answer}</b></p>{tables}"


def _html(table: Table) -> str:
    from html import escape  # 1 ms, only in notebooks

    def tagged(tag: str, cells: Iterable[Cell]) -> str:
        return "".join(
            f"<{tag} style='text-align:left'>{escape(_text(cell))}</{tag}>" for cell in cells
        )

    rows = [tagged("th", table.header)] if table.header else []
    rows += (tagged("th", row[:1]) + tagged("td", row[1:]) for row in table.rows)
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f"<table><caption>{escape(table.title)}</caption>{body}</table>"


def _text(cell: Cell) -> str:
    return cell if isinstance(cell, str) else cell.text
