"""Numbers and words as Fortran reads and writes them in the columns of a card."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache

LONGEST = 100  # characters of the longest number that is read
WITHOUT_LETTER = 10  # least columns of a field whose exponent may be written without its letter
# No two parts of a pattern match the same characters, so that a mismatch takes linear time.
_INTEGER = re.compile(r"[+-]?[0-9]+")
_REAL = re.compile(
    r"(?P<mantissa>[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+))"
    r"(?:[EeDd](?P<marked>[+-]?[0-9]+)|(?P<bare>[+-][0-9]+))?"
)


def capitals(word: str) -> str:
    """A word without the blanks around it, in capitals.

    Letters beyond ASCII stay as they are: the capitals of some are two letters, and the word would
    outgrow its field.
    """
    return "".join(c.upper() if c.isascii() else c for c in word.strip())


def parse_integer(text: str) -> int | None:
    """Read an integer without blanks, or None; the caller limits its length."""
    return int(text) if _INTEGER.fullmatch(text) else None


def parse_real(text: str) -> float | None:
    """Read an F field without blanks; None if it is not a number.

    Understands every Fortran form: ``45.``, ``.2E-6``, ``1.5D+3``, ``1.5-3``.  A number beyond the
    range of double precision is infinite.  The caller limits the length to :data:`LONGEST`
    characters.
    """
    if (match := _REAL.fullmatch(text)) is None:
        return None
    exponent = match["marked"] or match["bare"] or "0"
    return float(f"{match['mantissa']}e{exponent}")


def format_real(value: float, width: int) -> str | None:
    """Write a finite number into `width` columns so that reading it gives the same number again.

    The most readable form that fits, not padded; None if none fits.  Only fields of ten columns or
    more get an exponent without its letter: 2.5E-7 as ``25-8`` is hard to read.
    """
    numeral = repr(value)
    mantissa, has_exponent, _ = numeral.partition("e")
    is_finite = "n" not in numeral  # neither nan nor inf
    if is_finite and not has_exponent and len(numeral) < width:
        return numeral
    digits = mantissa.lstrip("-").replace(".", "").strip("0")
    if is_finite and len(digits) > width:
        return None
    return _formatted(numeral, width)


@lru_cache(4096)
def _formatted(numeral: str, width: int) -> str | None:
    """Write the number of a numeral of Python into `width` columns; decks repeat their numbers."""
    for letter in ("E", "") if width >= WITHOUT_LETTER else ("E",):
        forms = list(_forms(numeral, letter))
        for room in (width - 1, width):  # with a blank between two numbers if it fits
            for text in forms:
                if len(text) <= room:
                    return text
    return None


def _forms(numeral: str, letter: str) -> Iterator[str]:
    """Forms of a number, the most readable first, with `letter` before an exponent."""
    from decimal import Decimal  # 0.8 ms, and only what writes decks needs it

    number = Decimal(numeral).normalize()
    sign, numerals, exponent = number.as_tuple()
    if not isinstance(exponent, int):  # infinite or no number
        raise ValueError(f"{numeral} can't be written on a card")
    if not number:
        exponent = 0
    minus = "-" if sign else ""
    digits = "".join(map(str, numerals))
    if -20 < exponent < 20:
        fixed = format(abs(number), "f")
        whole = "." not in fixed
        forms = (f"{fixed}.0", f"{fixed}.") if whole else (fixed, fixed.removeprefix("0"))
        yield from (minus + form for form in forms)
    marked = "" if letter else "+"
    for before in (1, *range(2, len(digits) + 1), 0):
        power = exponent + len(digits) - before
        if power or letter:
            yield f"{minus}{digits[:before]}.{digits[before:]}{letter}{power:{marked}d}"
    if not letter:
        yield f"{minus}{digits}{exponent:+d}" if exponent else f"{minus}{digits}"
