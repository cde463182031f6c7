"""Tables of texts: for the terminal, for notebooks, and the header of a CSV."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table, each column as wide as its longest text."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def csv_line(texts: Iterable[str]) -> str:
    """A line of CSV with its end; texts with commas or quotes are quoted."""
    import csv  # only where a table is written
    import io

    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(texts)
    return line.getvalue()


def html_table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """Return a table of two columns with a title."""
    from html import escape  # 1 ms, only in notebooks

    cells = (
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(text)}</td></tr>"
        for name, text in rows
    )
    return f"<table><caption>{escape(title)}</caption>{''.join(cells)}</table>"
