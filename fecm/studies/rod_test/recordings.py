"""Time histories of results and of measured tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path

import numpy as np

from fecm._dataclasses import frozen
from fecm._errors import warn
from fecm._inputs import open_input
from fecm._measured_tables import read_table
from fecm._typing import Floats
from fecm.deck.source_text import HDF5
from fecm.results.result import Result, load
from fecm.results.schema import DATASETS
from fecm.studies import StudyError

TRANSDUCER = "transducer"


@frozen
class TimeHistory:
    """A quantity in time."""

    name: str
    time: Floats  # (rows,)
    values: Floats  # (rows,)
    dimension: str  # empty if unknown
    first: int = 0  # first recorded row; the rows before it are the state of rest
    beside: Mapping[str, Floats] = field(default_factory=dict)  # others for the same plot
    units: Mapping[str, str] = field(default_factory=dict)  # names; empty if unknown


def recorded(path: Path, column: str | None = None) -> TimeHistory:
    """Read a history from a result file or a CSV file.

    The column is by default the transducer, or the second of a CSV file.  Raises StudyError if the
    history does not exist, or the CSV file is invalid, ResultFileError if the result file is
    damaged, OSError if the file cannot be read.
    """
    with open_input(path) as file:
        is_result = file.read(len(HDF5)) == HDF5
    return _of_result(path, load(path), column) if is_result else _of_table(path, column)


def _of_result(path: Path, result: Result, column: str | None) -> TimeHistory:
    known = [name.partition("/")[2] for name in result if name.startswith("history/")]
    if not known:
        raise StudyError(f"{path} has no history: the run has no impact step")
    choice = [name for name in known if name not in ("step", "time")]
    name = column or TRANSDUCER
    if name not in choice:
        raise StudyError(f"{path} has no history of {name}; it has {', '.join(choice)}")
    # Histories begin after the first step; before it, the rod is at rest.
    dataset = DATASETS.get(f"history/{name}")
    dimension = dataset.dimension if dataset else ""
    rest = [0.0] if dimension in ("force", "length") else []

    def begun(column: str) -> Floats:
        return np.concatenate([rest, result[f"history/{column}"]])

    beside = {"contact force": begun("force")} if name == TRANSDUCER else {}
    units = result.units
    return TimeHistory(name, begun("time"), begun(name), dimension, len(rest), beside, units)


def _of_table(path: Path, column: str | None) -> TimeHistory:
    table = read_table(path)
    heads, clock, value = table.head[1], "", column or ""
    if heads and column and not (column.isdecimal() or table.has(column)):
        raise StudyError(f"{path} has no column {column}; it has {', '.join(table.names)}")
    if heads and not table.has("time"):
        clock = "1"
    if heads and not value:
        first = table.places(["time"])[0] if not clock else 0
        value = TRANSDUCER if table.has(TRANSDUCER) else "2" if first == 0 else "1"
        if value != TRANSDUCER and len(heads) > 2:
            warn(f"{path}: the column {heads[int(value) - 1]} is filtered; --column takes another")
    places = table.places(("time", "value"), (clock, value))
    time, values = table.columns(("time", "value"), places=places, increasing="time").values()
    unit = table.unit(places[0])
    name = table.names[places[1]] if heads else "value"
    return TimeHistory(name, time, values, dimension="", units={"time": unit} if unit else {})
