"""Measured indentation tests: tables of indentation and force in any units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fecm._dataclasses import frozen
from fecm._measured_tables import Table, read_table, same_name
from fecm._typing import Floats
from fecm.studies import StudyError

# Accepted names of the columns; the first is the default.
NAMES = {
    "indentation": ("indentation", "displacement", "extension", "stroke", "depth"),
    "force": ("force", "load"),
}

# Units in m and N.  The pound-force is 0.45359237 kg times 9.80665 m/s^2.
LENGTHS = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9,
    "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "mil": 2.54e-5, "mils": 2.54e-5,
}  # fmt: skip
FORCES = {
    "N": 1.0, "mN": 1e-3, "daN": 10.0, "kN": 1e3, "MN": 1e6, "kgf": 9.80665, "gf": 9.80665e-3,
    "lbf": 4.4482216152605, "lb": 4.4482216152605, "lbs": 4.4482216152605,
    "kip": 4448.2216152605, "kips": 4448.2216152605,
}  # fmt: skip
IMPERIAL = {"in", "inch", "inches", "mil", "mils", "lbf", "lb", "lbs", "kip", "kips"}


@frozen
class Test:
    """An indentation test."""

    indentation: Floats  # (rows,), in `units`
    force: Floats  # (rows,)
    units: Mapping[str, str]  # names of the units of length and force; empty if unknown
    stated: tuple[str, str]  # units of both in the file; empty texts if none


def read_test(
    path: Path, columns: Sequence[str] = (), units: tuple[str, str] | None = None
) -> Test:
    """Read an indentation test in consistent units.

    The columns are named as in `NAMES`, or `columns` has their names or numbers (from 1).  Values
    are converted to `units` of length and force; by default, a file in inches and pounds to in and
    lbf, others to m and N or mm and N.  A file without units is assumed to be in `units`.  Raises
    StudyError if a column is missing, a unit is unknown, or a number is invalid.  Raises OSError
    if the file cannot be read.
    """
    table = read_table(path)
    places = [_place(table, *asked) for asked in zip(NAMES, columns or ("", ""), strict=True)]
    indentation, load = table.columns(tuple(NAMES), places=places).values()
    length, force = (table.units[n] if n < len(table.units) else "" for n in places)
    if not (length or force):
        names = {} if units is None else dict(zip(("length", "force"), units, strict=True))
        return Test(indentation, load, names, ("", ""))
    if units is None and not (length and force):
        raise StudyError(
            f"{path}: one column is in {length or force}, the other has no unit; state both, or "
            "give both in `units`"
        )
    missing = units or (length, force)
    length, force = length or missing[0], force or missing[1]
    sizes = _size(path, length, "length"), _size(path, force, "force")
    target = dict(zip(("length", "force"), units or _system(length, force), strict=True))
    wanted = [_size(path, unit, dimension) for dimension, unit in target.items()]
    indentation, load = indentation * (sizes[0] / wanted[0]), load * (sizes[1] / wanted[1])
    return Test(indentation, load, target, (length, force))


def _place(table: Table, name: str, column: str) -> int:
    """Return the number of a column, from 0."""
    present = table.names
    if column.isdecimal() and int(column) and not any(same_name(column, one) for one in present):
        return int(column) - 1
    if not present and not column:
        return list(NAMES).index(name)
    for wanted in (column,) if column else NAMES[name]:
        found = [place for place, one in enumerate(present) if same_name(wanted, one)]
        if len(found) == 1:
            return found[0]
        if found:
            break
    names = ", ".join(present)[:80] or "unnamed"
    raise StudyError(
        f"{table.path}: the columns are {names}; one must be named {column or name}"
        + (f" (or {', '.join(NAMES[name][1:])})" if not column else "")
        + "; `columns` of indentation and force selects others by name or number"
    )


def _size(path: Path, unit: str, dimension: str) -> float:
    """Return the size of a unit in m or N."""
    sizes = LENGTHS if dimension == "length" else FORCES
    folded = [name for name in sizes if name.casefold() == unit.casefold()]
    if unit not in sizes and len(folded) != 1:
        known = ", ".join(sizes)
        raise StudyError(f"{path}: unknown unit of {dimension} `{unit}`; known units: {known}")
    return sizes[unit if unit in sizes else folded[0]]


def _system(length: str, force: str) -> tuple[str, str]:
    """Return units of length and force of the same system as those of the file."""
    if {length.casefold(), force.casefold()} <= IMPERIAL:
        return "in", "lbf"
    return ("m" if length == "m" else "mm"), "N"
