"""Cases of a sweep: a full grid of values, or a table with one row per case."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from fecm._errors import FecmError
from fecm.deck.grid import SUPPORTS
from fecm.results.metrics import COLUMNS
from fecm.studies import StudyError
from fecm.studies.tables import read_rows

Value = float | int | str
Case = dict[str, Value]
# A limit of a quantity whose probability of exceedance is asked for: a number, or this.
THRESHOLD = "threshold"
Limit = tuple[str, float | str]

# Names that change the projectile, its velocity or the contact law; where the force acts, which
# needs another response of the plate; and the plate or its time steps.
CONTACT = (
    "velocity", "energy", "k", "radius", "alpha_p", "s_p", "q",
    "mass", "rod_mass", "rod_length", "rod_modulus", "rod_density",
)  # fmt: skip
LOAD = ("at", "impact_node", "patch", "x0", "y0")
LAMINATE = (
    "thickness", "density", "nu12", "e1", "e2", "g12", "g13", "g23", "layup", "angle",
)  # fmt: skip
PLATE = (*LOAD, *LAMINATE, "size", "support", "dt", "duration")
NAMES = (*CONTACT, *PLATE)
REFINE = "refine"  # factor of a refinement study, which varies nothing else
# Of each of these names only one can vary.
EXCLUDING = (
    ("velocity", "energy"), ("k", "radius"), ("mass", "rod_mass", "rod_density"),
    ("at", "impact_node"), ("at", "x0"), ("at", "y0"),
)  # fmt: skip
TEXTS = ("layup", "at", "size", "support")  # names with texts
PAIRS = {"at": ("({},{})", r"[,;\s]+"), "size": ("{}x{}", "[xX×]")}  # their forms and separators
INTEGERS = ("impact_node",)
# Names of results, which are no names of cases or of measured columns.
RESERVED = ("case", "step", "steps", "status", "force", "unsettled_steps", *COLUMNS)
MOST = 1_000_000  # largest number of cases


class CasesError(FecmError, ValueError):
    """The cases are invalid."""


def parse_vary(text: str) -> tuple[str, list[Value]]:
    """Read ``NAME=FROM:TO:N`` (N values, both ends included) or ``NAME=a,b,c``.

    Raises CasesError if the text has neither form, or the name is unknown.
    """
    name, equals, text_of_values = (part.strip() for part in text.partition("="))
    _known(name, text)
    if not equals or not text_of_values:
        raise CasesError(f"`{text}`: write {name}=FROM:TO:N or {name}=A,B,C")
    if name in TEXTS or ":" not in text_of_values:  # split at commas outside brackets
        parts = re.split(r",(?![^\[]*\]|[^(]*\))", text_of_values)
        return name, [_value(name, part) for part in parts if part.strip()]
    parts = text_of_values.split(":")
    if len(parts) != 3 or not re.fullmatch(r"\d+", parts[2].strip()) or not int(parts[2]):
        raise CasesError(f"`{text}`: a range is FROM:TO:N with N of at least 1")
    begin, end, count = _number(name, parts[0]), _number(name, parts[1]), int(parts[2])
    if count > MOST:
        raise CasesError(f"`{text}`: {count} values; at most {MOST} are allowed")
    with np.errstate(all="ignore"):
        values = np.linspace(begin, end, count).tolist()
    if not all(map(math.isfinite, values)):
        raise CasesError(f"`{text}`: the range is beyond the range of numbers")
    return name, [_value(name, repr(v)) for v in values]


def parse_until(text: str) -> float | str:
    """Read ``peak_force=NUMBER`` or ``peak_force=threshold``; CasesError if it is neither."""
    name, _, value = (part.strip() for part in text.partition("="))
    if name != "peak_force" or not value:
        raise CasesError(f"`{text}`: write peak_force=NUMBER or peak_force={THRESHOLD}")
    return parse_exceed(text)[1]


def parse_exceed(text: str) -> Limit:
    """Read ``QUANTITY=NUMBER`` or ``peak_force=threshold``; CasesError if it is neither."""
    name, _, value = (part.strip() for part in text.partition("="))
    if not name or not value or (value == THRESHOLD and name != "peak_force"):
        raise CasesError(f"`{text}`: write QUANTITY=NUMBER or peak_force={THRESHOLD}")
    return name, value if value == THRESHOLD else _number(name, value)


def check_names(names: Collection[str]) -> None:
    """Raise CasesError if names exclude each other."""
    for group in EXCLUDING:
        if len(given := [name for name in group if name in names]) > 1:
            raise CasesError(f"{given[0]} and {given[1]} exclude each other; vary one of them")


def pair(name: str, text: str) -> tuple[float, float]:
    """Two numbers of a text, as in ``(3,2)`` or ``6x4``; raises CasesError if it has none."""
    form, separators = PAIRS[name]
    parts = re.split(separators, text.strip().removeprefix("(").removesuffix(")").strip())
    if len(parts) != 2:
        raise CasesError(f"{name} must be two numbers as in {form.format(6, 4)}, not `{text}`")
    return _number(name, parts[0]), _number(name, parts[1])


def plate_values(case: Case) -> Case:
    """The values of a case that need another response of the plate."""
    return {name: value for name, value in case.items() if name in (*PLATE, REFINE)}


def grid(varied: Sequence[tuple[str, Sequence[Value]]]) -> list[Case]:
    """Return every combination of the values; the last name varies fastest.

    Raises CasesError if a name is repeated, or there are too many cases.
    """
    names = [name for name, _ in varied]
    for name in names:
        if names.count(name) > 1:
            raise CasesError(f"{name} is varied twice")
    count = math.prod(len(values) for _, values in varied)
    if count > MOST:
        raise CasesError(f"{count} cases; at most {MOST} are allowed")
    combinations = itertools.product(*(values for _, values in varied))
    return [dict(zip(names, values, strict=True)) for values in combinations]


def read_cases(path: Path) -> list[Case]:
    """Read a CSV table with a header of names and one row per case.

    Raises CasesError if the table is invalid; the message states the line.  Raises OSError if the
    file cannot be read.
    """
    try:
        rows = [(line, row) for line, row in read_rows(path) if any(row)]
    except StudyError as error:
        raise CasesError(str(error)) from None
    if len(rows) < 2:
        raise CasesError(f"{path}: a table of cases has a header of names and at least one row")
    header = rows[0][1]
    for name in header:
        _known(name, f"{path}:{rows[0][0]}")
        if header.count(name) > 1:
            raise CasesError(f"{path}:{rows[0][0]}: column {name} is repeated")
    cases: list[Case] = []
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise CasesError(f"{path}:{line}: {len(row)} values, but {len(header)} names")
        try:
            cases.append({n: _value(n, text) for n, text in zip(header, row, strict=True)})
        except CasesError as error:
            raise CasesError(f"{path}:{line}: {error}") from None
    if len(cases) > MOST:
        raise CasesError(f"{path} has {len(cases)} cases; at most {MOST} are allowed")
    return cases


def combined(vary: Mapping[str, Iterable[Any]], *, free: bool = False) -> list[Case]:
    """Return every combination of lists of values, given by name; see :func:`grid`.

    With `free`, names and values are any.  Raises CasesError if a name is unknown, a value is
    invalid, or values are not in a list.
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
        cases = checked(({name: value} for value in values), "vary", free=free)
        lists.append((name, [case[name] for case in cases]))
    return grid(lists)


def checked(
    cases: Iterable[Mapping[str, Any]], source: str = "", *, free: bool = False
) -> list[Case]:
    """Validate cases given as mappings, which must all have the same names.

    With `free`, the names are any but those of results, and a value is a number or a text.  Raises
    CasesError if the cases are invalid; the message states the source, or else the number of the
    case.
    """
    made: list[Case] = []
    remedy = 'write a list of mappings such as [{"velocity": 50.0}]'
    if not isinstance(cases, Iterable):
        raise CasesError(f"cases is {cases!r}; {remedy}")
    for number, case in enumerate(cases):
        where = source or f"case {number}"
        if not isinstance(case, Mapping):
            raise CasesError(f"{where} is {case!r}, not a mapping of names to values; {remedy}")
        for name in case:
            if not free:
                _known(name, where)
            elif fault := name_fault(name):
                raise CasesError(f"{where}: {fault}")
        if made and case.keys() != made[0].keys():
            raise CasesError(f"{where} has other names than case 0")
        made.append({name: _given(name, v, where, free) for name, v in case.items()})
    if not made:
        raise CasesError("a sweep needs at least one case")
    for name in made[0]:
        if len({isinstance(case[name], str) for case in made}) > 1:
            raise CasesError(f"{name} has numbers and texts")
    return made


def name_fault(name: object) -> str:
    """Why a name can't be that of a column; empty if it can."""
    if not (isinstance(name, str) and name.isidentifier()):
        return f"`{name}` is not a name such as width"
    return f"`{name}` is a name of the results; choose another" if name in RESERVED else ""


def _given(name: str, value: Any, where: str, free: bool) -> Value:
    """Validate a value given in Python."""
    if isinstance(value, np.generic):
        value = value.item()
    if free:
        if not (
            isinstance(value, str) or (isinstance(value, float | int) and math.isfinite(value))
        ):
            raise CasesError(f"{where}: {name} is {value!r}, not a finite number or a text")
        return value
    if name in TEXTS and isinstance(value, Iterable) and not isinstance(value, str):
        value = {"at": ",", "size": "x"}.get(name, "/").join(map(str, value))
    try:
        return _value(name, value if isinstance(value, str) else repr(float(value)))
    except (TypeError, ValueError) as error:
        text = str(error) if isinstance(error, CasesError) else f"{name} can't be {value!r}"
        raise CasesError(f"{where}: {text}") from None


def _known(name: str, where: str) -> None:
    if name not in NAMES:
        raise CasesError(f"{where}: `{name}` cannot be varied; the names are {', '.join(NAMES)}")


def _number(name: str, text: str) -> float:
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise CasesError(f"{name} must be a finite number, not `{text.strip()}`")


def _value(name: str, text: str) -> Value:
    if name in PAIRS:
        return PAIRS[name][0].format(*(repr(v).removesuffix(".0") for v in pair(name, text)))
    if name == "support" and text.strip() not in SUPPORTS:
        raise CasesError(f"support must be {', '.join(SUPPORTS)}, not `{text.strip()}`")
    if name in TEXTS:
        return text.strip()
    value = 0.0 if name == "dt" and text.strip() == "auto" else _number(name, text)
    if name not in INTEGERS:
        return value
    if not value.is_integer():
        raise CasesError(f"{name} must be an integer, not {value:g}")
    return int(value)
