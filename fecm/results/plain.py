"""Values from files made plain: fit for one line of text and for JSON.

JSON knows no NaN and no infinity; they become the texts ``"NaN"``, ``"Infinity"`` and
``"-Infinity"``, as in the tapes.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any


def printable(text: str) -> str:
    """One line that any terminal takes: control characters and lone surrogates are escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: Any, width: int = 60, *, exact: bool = False) -> str:
    """A value in one short line; numbers to six digits, or to all that they have."""
    if isinstance(value, list | tuple):
        text = "[" + ", ".join(shown(item, width, exact=exact) for item in value) + "]"
    elif isinstance(value, float):
        text = repr(value) if exact else f"{value:.6g}"
    else:
        text = printable(str(value))
    return text if len(text) <= width else text[: width - 1] + "…"


def told_apart(one: Any, other: Any, width: int = 60) -> tuple[str, str]:
    """Two values that differ, each in a short line that shows where."""
    short = shown(one, width), shown(other, width)
    if short[0] != short[1]:
        return short
    whole = [shown(value, sys.maxsize, exact=True) for value in (one, other)]
    pairs = zip(*whole, strict=False)
    same = next((n for n, (a, b) in enumerate(pairs) if a != b), min(map(len, whole)))
    begin = max(0, same - width // 2)
    texts = [("…" if begin else "") + text[begin:] for text in whole]
    return shown(texts[0], width), shown(texts[1], width)


def jsonable(value: Any) -> Any:
    """A value that :func:`json.dumps` writes as valid JSON."""
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        if math.isfinite(value):
            return value
        return "NaN" if math.isnan(value) else ("Infinity" if value > 0 else "-Infinity")
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item) for item in value]
    return str(value)
