"""Values and foreign texts in one short line for any terminal."""

from __future__ import annotations

import sys

DIGITS = 4  # of computed values that are printed; the model's errors are per cent


def printable(text: str) -> str:
    """Escape control characters and lone surrogates, giving one line for any terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def significant(value: float, digits: int = DIGITS) -> str:
    """Format a number to a few significant digits, without an exponent below a million.

    Examples
    --------
    >>> significant(14064.6), significant(0.00184092)
    ('14060', '0.001841')
    """
    return f"{float(f'{value:.{digits}g}'):.{max(digits, 6)}g}"


def shown(value: object, width: int = 60, *, exact: bool = False) -> str:
    """Format a value in one short line; numbers to six digits, or exactly."""
    if isinstance(value, list | tuple):
        text = "[" + ", ".join(shown(item, width, exact=exact) for item in value) + "]"
    elif isinstance(value, float):
        text = repr(value) if exact else f"{value:.6g}"
    else:
        text = printable(str(value))
    return text if len(text) <= width else text[: width - 1] + "…"


def shown_apart(one: object, other: object, width: int = 60) -> tuple[str, str]:
    """Format two different values in short lines that show where they differ."""
    short = shown(one, width), shown(other, width)
    if short[0] != short[1]:
        return short
    whole = [shown(value, sys.maxsize, exact=True) for value in (one, other)]
    pairs = zip(*whole, strict=False)
    same = next((n for n, (a, b) in enumerate(pairs) if a != b), min(map(len, whole)))
    begin = max(0, same - width // 2)
    texts = [("…" if begin else "") + text[begin:] for text in whole]
    return shown(texts[0], width), shown(texts[1], width)
