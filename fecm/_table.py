"""Tables: summaries of decks, results and fits for terminals, notebooks and pages.

A quantity is described once, as a row. Terminals, notebooks and report pages show the same rows.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias


class ShownNumber(NamedTuple):
    """Number and the text that shows it."""

    value: float
    text: str


Cell: TypeAlias = str | ShownNumber
Row: TypeAlias = tuple[Cell, ...]  # an empty label continues the row before

LABEL_WIDTH = 18  # of the labels in a terminal


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


def label_lines(rows: Iterable[Row], width: int = LABEL_WIDTH) -> list[str]:
    """Return the lines of labels and values for a terminal.

    Examples
    --------
    >>> label_lines([("peak force", "86.2 lb"), ("", "in contact 2")])
    ['peak force        86.2 lb', '                  in contact 2']
    """
    return [f"{_text(label):{width}}{_text(value)}".rstrip() for label, value in rows]


def text_lines(table: Table, width: int = LABEL_WIDTH) -> list[str]:
    """Return the lines of a table without its title, for a terminal."""
    if not table.header:
        return label_lines(table.rows, width)
    return aligned([table.header, *(tuple(map(_text, row)) for row in table.rows)])


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines in which each column is as wide as its longest text."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def html_table(*tables: Table) -> str:
    """Return tables as HTML, for notebooks."""
    return "".join(map(_html, tables))


def html_summary(subject: object, rows: Iterable[Row]) -> str:
    """Return labels and values of a subject as HTML, under its ``repr``, for notebooks."""
    return html_table(Table(tuple(rows), title=repr(subject)[1:-1]))


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
