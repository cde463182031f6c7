"""Measured indentation tests: tables of indentation and force in any units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fecm._dataclasses import frozen
from fecm._measured_tables import read_table, unit_size
from fecm._typing import Floats
from fecm.studies import StudyError

NAMES = ("indentation", "force")  # columns
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

    The columns are named as in :data:`WORDS`, or `columns` has their names or numbers (from 1).
    Values are converted to `units` of length and force; by default, a file in inches and pounds to
    in and lbf, others to m and N or mm and N.  A file without units is assumed to be in `units`.
    Raises StudyError if a column is missing, a unit is unknown, or a number is invalid.  Raises
    OSError if the file cannot be read.
    """
    table = read_table(path)
    places = table.places(NAMES, columns)
    indentation, load = table.columns(NAMES, places=places).values()
    length, force = (table.unit(n) for n in places)
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
    sizes = unit_size(path, length, "length"), unit_size(path, force, "force")
    target = dict(zip(("length", "force"), units or _system(length, force), strict=True))
    wanted = [unit_size(path, unit, dimension) for dimension, unit in target.items()]
    indentation, load = indentation * (sizes[0] / wanted[0]), load * (sizes[1] / wanted[1])
    return Test(indentation, load, target, (length, force))


def _system(length: str, force: str) -> tuple[str, str]:
    """Return units of length and force of the same system as those of the file."""
    if {length.casefold(), force.casefold()} <= IMPERIAL:
        return "in", "lbf"
    return ("m" if length == "m" else "mm"), "N"
