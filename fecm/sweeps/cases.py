"""Cases of a sweep: what varies, a full grid of it or a table, one row a case."""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from fecm._errors import FecmError

Value = float | int | str
Case = dict[str, Value]

# What changes the projectile, its approach or the law; and what changes the plate.
CONTACT = (
    "velocity", "k", "alpha_p", "s_p", "q",
    "rod_length", "rod_modulus", "rod_density", "rod_mass",
)  # fmt: skip
PLATE = (
    "impact_node", "thickness", "density", "nu12", "e1", "e2", "g12", "g13", "g23", "layup", "dt",
)  # fmt: skip
NAMES = (*CONTACT, *PLATE)
TEXTS = ("layup",)
WHOLE = ("impact_node",)
# More cases than this are a mistake.
MOST = 1_000_000


class CasesError(FecmError, ValueError):
    """What was asked for is no set of cases."""


def parse_vary(text: str) -> tuple[str, list[Value]]:
    """Read ``NAME=FROM:TO:N`` (N values, both ends included) or ``NAME=a,b,c``.

    Raises
    ------
    CasesError
        If it is neither, or the name is unknown.
    """
    name, equals, given = (part.strip() for part in text.partition("="))
    _known(name, text)
    if not equals or not given:
        raise CasesError(f"`{text}`: give values as in {name}=FROM:TO:N or {name}=A,B,C")
    if name not in TEXTS and ":" in given:
        parts = given.split(":")
        if len(parts) != 3 or not re.fullmatch(r"\d+", parts[2].strip()) or not int(parts[2]):
            raise CasesError(f"`{text}`: a range is FROM:TO:N, N values from 1 on")
        begin, end = (_number(name, part) for part in parts[:2])
        count = int(parts[2])
        if count > MOST:
            raise CasesError(f"`{text}`: {count} values are more than {MOST}")
        with np.errstate(all="ignore"):
            values = np.linspace(begin, end, count).tolist()
        if not all(map(math.isfinite, values)):
            raise CasesError(f"`{text}`: the range is beyond the range of numbers")
        return name, [_value(name, repr(v)) for v in values]
    return name, [_value(name, part) for part in _split(given)]


def grid(varied: Sequence[tuple[str, Sequence[Value]]]) -> list[Case]:
    """Every combination of the values, the last name varying fastest.

    Raises
    ------
    CasesError
        If a name comes twice, or there are too many cases.
    """
    names = [name for name, _ in varied]
    for name in names:
        if names.count(name) > 1:
            raise CasesError(f"{name} is varied twice")
    count = math.prod(len(values) for _, values in varied)
    if count > MOST:
        raise CasesError(f"that makes {count} cases; {MOST} is the most")
    return [
        dict(zip(names, values, strict=True))
        for values in itertools.product(*(values for _, values in varied))
    ]


def read_cases(path: Path) -> list[Case]:
    """Read a table with a header of names and a row a case (CSV).

    Raises
    ------
    CasesError
        If it is no such table; the message names the line.
    OSError
        If it can't be read.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise CasesError(f"{path} is no text") from None
    rows = [(n, row) for n, row in enumerate(csv.reader(text.splitlines()), 1) if any(row)]
    if len(rows) < 2:
        raise CasesError(f"{path} has no header and rows: the first line names what varies")
    header = [name.strip() for name in rows[0][1]]
    for name in header:
        _known(name, f"{path}:{rows[0][0]}")
        if header.count(name) > 1:
            raise CasesError(f"{path}:{rows[0][0]}: the column {name} comes twice")
    cases: list[Case] = []
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise CasesError(
                f"{path}:{line}: {len(row)} values where the header names {len(header)}"
            )
        try:
            cases.append({n: _value(n, text) for n, text in zip(header, row, strict=True)})
        except CasesError as error:
            raise CasesError(f"{path}:{line}: {error}") from None
    if len(cases) > MOST:
        raise CasesError(f"{path} has {len(cases)} cases; {MOST} is the most")
    return cases


def checked(cases: Iterable[Mapping[str, Value]]) -> list[Case]:
    """Take cases from Python, with the same names and values in each.

    Raises
    ------
    CasesError
        If they are none.
    """
    made = [
        {name: _value(name, value if isinstance(value, str) else repr(float(value)))
         for name, value in case.items()}
        for case in cases
    ]  # fmt: skip
    if not made:
        raise CasesError("there are no cases")
    for number, case in enumerate(made):
        for name in case:
            _known(name, f"case {number}")
        if case.keys() != made[0].keys():
            raise CasesError(f"case {number} varies other things than case 0")
    return made


def _known(name: str, where: str) -> None:
    if name not in NAMES:
        raise CasesError(f"{where}: `{name}` can't be varied; known are {', '.join(NAMES)}")


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CasesError(f"{name} takes numbers, not `{text.strip()}`")
    return value


def _value(name: str, text: str) -> Value:
    if name in TEXTS:
        return text.strip()
    value = _number(name, text)
    if name in WHOLE:
        if not value.is_integer():
            raise CasesError(f"{name} takes whole numbers, not {value:g}")
        return int(value)
    return value


def _split(text: str) -> list[str]:
    """Parts between commas that stand outside of brackets."""
    return [part for part in re.split(r",(?![^\[]*\])", text) if part.strip()]
