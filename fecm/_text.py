"""Texts for terminals, JSON and CSV."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from types import SimpleNamespace
from typing import Any, Literal, TypeAlias

Json: TypeAlias = "dict[str, Json] | list[Json] | str | int | float | bool | None"


def jsonable(value: object) -> Json:
    """Convert to a value that :func:`json.dumps` writes as valid JSON.

    Infinities, NaN and values of any other type become texts.

    Examples
    --------
    >>> jsonable({"peak": 3.5, "time": float("nan"), "slips": ("tapes",)})
    {'peak': 3.5, 'time': 'NaN', 'slips': ['tapes']}
    """
    import json  # 2 ms at start, and few commands write JSON

    match value:
        case Mapping():
            return {str(key): jsonable(item) for key, item in value.items()}
        case list() | tuple():
            return [jsonable(item) for item in value]
        case float() if not math.isfinite(value):
            return json.dumps(value)
        case None | bool() | int() | float():
            return value
        case _:
            return str(value)


FORMULA = re.compile(r"[=+@\x00-\x1f-]")  # how a formula of a spreadsheet begins


Decimal = Literal["point", "comma"]  # decimal mark of a table
DECIMALS: tuple[Decimal, ...] = ("point", "comma")


def csv_lines(rows: Iterable[Iterable[object]], decimal: Decimal = "point") -> Iterator[str]:
    r"""Return the lines of a CSV table, with line ends.

    Numbers are written as Python's repr, which preserves every bit.  An apostrophe precedes texts
    that a spreadsheet would read as formulas. With a decimal comma, semicolons separate the values.

    Examples
    --------
    >>> list(csv_lines([("time (s)", "force (N)"), (2e-07, 0.1)]))
    ['time (s),force (N)\n', '2e-07,0.1\n']
    >>> list(csv_lines([("time (s)", "force (N)"), (2e-07, 0.1)], "comma"))
    ['time (s);force (N)\n', '2e-07;0,1\n']
    """
    import csv  # only where a table is written

    echo: Any = SimpleNamespace(write=str)  # writerow returns what write returns
    has_comma = decimal == "comma"
    writer = csv.writer(echo, lineterminator="\n", delimiter=";" if has_comma else ",")
    for row in rows:
        values = [f"'{v}" if isinstance(v, str) and FORMULA.match(v) else v for v in row]
        if has_comma:
            values = [repr(v).replace(".", ",") if isinstance(v, float) else v for v in values]
        yield writer.writerow(values)


# Significant digits that are printed.  Errors of the model are some per cent; JSON and HDF5 keep
# all digits.
DIGITS = 4  # of computed values
FITTED_DIGITS = 5  # of values fitted to a measurement; their errors have two
DECK_DIGITS = 6  # of values that the deck gives


def printable(text: str) -> str:
    """Escape control characters and lone surrogates, giving one line for any terminal."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def significant(value: float, digits: int = DIGITS) -> str:
    """Format a number to a few significant digits, without an exponent below a million.

    Examples
    --------
    >>> significant(14064.6), significant(0.00184092)
    ('14060', '0.001841')
    """
    return f"{float(f'{value:.{digits}g}'):.{max(digits, 6)}g}"


def short_text(value: object, width: int = 60, *, exact: bool = False) -> str:
    """Format a value in one short line, numbers to six digits or exactly."""
    if isinstance(value, list | tuple):
        text = "[" + ", ".join(short_text(item, width, exact=exact) for item in value) + "]"
    elif isinstance(value, float):
        text = repr(value) if exact else f"{value:.6g}"
    else:
        text = printable(str(value))
    return text if len(text) <= width else text[: width - 1] + "…"


def shown_apart(first: object, second: object, width: int = 60) -> tuple[str, str]:
    """Format two different values in short lines that show where they differ."""
    short = short_text(first, width), short_text(second, width)
    if short[0] != short[1]:
        return short
    whole = [short_text(value, sys.maxsize, exact=True) for value in (first, second)]
    pairs = zip(*whole, strict=False)
    same = next((n for n, (a, b) in enumerate(pairs) if a != b), min(map(len, whole)))
    begin = max(0, same - width // 2)
    texts = [("…" if begin else "") + text[begin:] for text in whole]
    return short_text(texts[0], width), short_text(texts[1], width)
