"""Numbers as Fortran reads them from a card's field, and writes them into one.

On the report's machine a blank inside a numeric field was a zero, and a field of blanks was 0.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from decimal import Decimal

# Characters of the longest number that is read.
LONGEST = 100

# Columns from which on an exponent may be written without its letter.
_LETTERLESS = 10

# No two parts of a pattern match the same characters, so that a mismatch takes linear time.
_INTEGER = re.compile(r"[+-]?[0-9]+")
_REAL = re.compile(
    r"(?P<mantissa>[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+))"
    r"(?:[EeDd](?P<marked>[+-]?[0-9]+)|(?P<bare>[+-][0-9]+))?"
)


def parse_integer(text: str) -> int | None:
    """Read an I field without blanks in it; None when it is no whole number.

    The caller limits the length to :data:`LONGEST` characters.
    """
    return int(text) if _INTEGER.fullmatch(text) else None


def parse_real(text: str) -> float | None:
    """Read an F field without blanks in it; None when it is no number.

    Understands every Fortran form: ``45.``, ``.2E-6``, ``1.5D+3``, ``1.5-3``.  A number beyond the
    range of double precision is infinite.  The caller limits the length to :data:`LONGEST`
    characters.
    """
    match = _REAL.fullmatch(text)
    if match is None:
        return None
    exponent = match["marked"] or match["bare"] or "0"
    return float(f"{match['mantissa']}e{exponent}")


def format_real(value: float, width: int) -> str | None:
    """Write a number into `width` columns so that reading it gives the same number again.

    Parameters
    ----------
    value : float
        A finite number.
    width : int
        Columns to be had.

    Returns
    -------
    str or None
        The most readable form that fits, not padded; None when none does.  Only fields of ten
        columns or more get an exponent without its letter: 2.5E-7 as ``25-8`` is hard to read.
    """
    for letter in ("E", "") if width >= _LETTERLESS else ("E",):
        forms = list(_forms(value, letter))
        for room in (width - 1, width):  # a blank between two numbers where it can be had
            for text in forms:
                if len(text) <= room:
                    return text
    return None


def _forms(value: float, letter: str) -> Iterator[str]:
    """Forms of a number, the most readable first, with `letter` before an exponent."""
    if not math.isfinite(value):
        raise ValueError(f"{value} can't be written on a card")
    number = Decimal(repr(value)).normalize()
    sign, numerals, exponent = number.as_tuple()
    if not isinstance(exponent, int):  # never for a finite number
        raise ValueError(f"{value} can't be written on a card")
    if value == 0.0:
        exponent = 0
    minus = "-" if sign else ""
    digits = "".join(map(str, numerals))
    if -20 < exponent < 20:
        fixed = format(abs(number), "f")
        if "." not in fixed:
            yield f"{minus}{fixed}.0"
            yield f"{minus}{fixed}."
        else:
            yield minus + fixed
            yield minus + fixed.removeprefix("0")
    marked = "" if letter else "+"
    for whole in (1, *range(2, len(digits) + 1), 0):
        power = exponent + len(digits) - whole
        if power or letter:
            yield f"{minus}{digits[:whole]}.{digits[whole:]}{letter}{power:{marked}d}"
    if not letter:
        yield f"{minus}{digits}{exponent:+d}" if exponent else f"{minus}{digits}"
