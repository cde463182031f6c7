"""A case of a sweep: its values by name, and how the numbers in its texts are read."""

from __future__ import annotations

import math
import re
from contextlib import suppress

from fecm._errors import FecmError

Value = float | int | str
Case = dict[str, Value]
MOST_CASES = 1_000_000
# Forms and separators of the names whose text is two numbers.
PAIRS = {
    "at": ("({},{})", r"[,;\s]+"),
    "size": ("{}x{}", "[xX×]"),
}


class CasesError(FecmError, ValueError):
    """The cases are invalid."""


def number(name: str, text: str) -> float:
    """Finite number of a text; CasesError if it is none."""
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise CasesError(f"{name} must be a finite number, not `{text.strip()}`")


def pair(name: str, text: str) -> tuple[float, float]:
    """Two numbers of a text, as in ``(3,2)`` or ``6x4``; raises CasesError if it has none."""
    form, separators = PAIRS[name]
    parts = re.split(separators, text.strip().removeprefix("(").removesuffix(")").strip())
    if len(parts) != 2:
        raise CasesError(f"{name} must be two numbers as in {form.format(6, 4)}, not `{text}`")
    return number(name, parts[0]), number(name, parts[1])


def normal_pair(name: str, text: str) -> str:
    """The text of two numbers in its usual form."""
    form, _ = PAIRS[name]
    return form.format(*(repr(value).removesuffix(".0") for value in pair(name, text)))


def check_count(count: int, cases: str = "") -> None:
    """Raise CasesError if there are no cases or too many; `cases` says which."""
    if not count:
        raise CasesError("a sweep needs at least one case")
    if count > MOST_CASES:
        raise CasesError(f"{cases or f'{count} cases'}; at most {MOST_CASES} are allowed")
