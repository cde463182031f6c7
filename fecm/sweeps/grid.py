"""Grids: lists of values by name, of which all combinations are run."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from fecm.sweeps.case import MOST_CASES, Case, CasesError, Value, check_count, number
from fecm.sweeps.cases import checked
from fecm.sweeps.values import Kind, check_known, kind_of, parse_value, without_unit


def parse_vary(text: str, system: str | None = None) -> tuple[str, list[Value]]:
    """Read ``NAME=FROM:TO:N`` (N values with both ends) or ``NAME=a,b,c``; else CasesError.

    Values with a unit, as in ``energy=5J:30J:6``, are converted to a system of units.
    """
    name, equals, text_of_values = (part.strip() for part in text.partition("="))
    check_known(name, text)
    if not equals or not text_of_values:
        raise CasesError(f"`{text}`: write {name}=FROM:TO:N or {name}=A,B,C")
    if kind_of(name) is Kind.TEXT or ":" not in text_of_values:  # split at commas outside brackets
        parts = re.split(r",(?![^\[]*\]|[^(]*\))", text_of_values)
        if name == "at" and not re.search("[(; ]", text_of_values):
            parts = _points(parts)
        return name, [parse_value(name, part, system) for part in parts if part.strip()]
    parts = text_of_values.split(":")
    if len(parts) != 3 or not re.fullmatch(r"\d+", parts[2].strip()) or not int(parts[2]):
        raise CasesError(f"`{text}`: a range is FROM:TO:N with N of at least 1")
    begin, end = (number(name, without_unit(name, part, system)) for part in parts[:2])
    count = int(parts[2])
    if count > MOST_CASES:
        raise CasesError(f"`{text}`: {count} values; at most {MOST_CASES} are allowed")
    with np.errstate(all="ignore"):
        values = np.linspace(begin, end, count).tolist()
    if not all(map(math.isfinite, values)):
        raise CasesError(f"`{text}`: the range is beyond the range of numbers")
    return name, [parse_value(name, repr(v)) for v in values]


def _points(numbers: Sequence[str]) -> list[str]:
    """One point from two numbers; CasesError, with the brackets to write, if there are more."""
    if len(numbers) == 2:
        return [",".join(numbers)]
    pairs = [f"({','.join(numbers[n : n + 2])})" for n in range(0, len(numbers) - 1, 2)]
    example = ",".join(pairs) or f"({numbers[0]},Y)"
    raise CasesError(f"at has two numbers a point; write at={example}")


def grid(varied: Sequence[tuple[str, Sequence[Value]]]) -> list[Case]:
    """Every combination of the values, the last name fastest; CasesError if there are too many."""
    names = [name for name, _ in varied]
    for name in names:
        if names.count(name) > 1:
            raise CasesError(f"{name} is varied twice")
    count = math.prod(len(values) for _, values in varied)
    check_count(count)
    combinations = itertools.product(*(values for _, values in varied))
    return [dict(zip(names, values, strict=True)) for values in combinations]


def combined(
    vary: Mapping[str, Iterable[Any]], *, free: bool = False, system: str | None = None
) -> list[Case]:
    """Return every combination of lists of values, given by name; with `free` both are any.

    Texts with a unit are converted to a system of units.

    Raises CasesError if a name is unknown, a value is invalid, or values are not in a list.
    """
    if not isinstance(vary, Mapping):
        raise CasesError(f'vary is {vary!r}; write a mapping such as {{"velocity": [50.0, 115.0]}}')
    lists: list[tuple[str, list[Value]]] = []
    for name, given in vary.items():
        values: list[Any] | None = None
        with suppress(TypeError):
            values = None if isinstance(given, str | bytes) else list(given)
        if values is None:
            raise CasesError(f'vary: {name} is one value; write a list: {{"{name}": [{given!r}]}}')
        if not values:
            raise CasesError(f"vary: {name} has no values")
        cases = checked(({name: value} for value in values), "vary", free=free, system=system)
        lists.append((name, [case[name] for case in cases]))
    return grid(lists)
