"""Measured indentation tests: tables of indentation and force in any units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fecm._dataclasses import frozen
from fecm._measured_tables import read_table
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
    stated = (table.unit(places[0]), table.unit(places[1]))
    if units is None and any(stated) and not all(stated):
        text = f"{path}: one column is in {stated[0] or stated[1]}, the other has no unit"
        raise StudyError(f"{text}; state both, or give both in `units`")
    names = units or (_system(*stated) if any(stated) else None)
    target = dict(zip(("length", "force"), names, strict=True)) if names else {}
    indentation, force = table.columns(NAMES, columns, target, places=places).values()
    if names and any(stated):
        stated = (stated[0] or names[0], stated[1] or names[1])
    return Test(indentation, force, target, stated)


def _system(length: str, force: str) -> tuple[str, str]:
    """Return units of length and force of the same system as those of the file."""
    if {length.casefold(), force.casefold()} <= IMPERIAL:
        return "in", "lbf"
    return ("m" if length == "m" else "mm"), "N"
