"""CSV: datasets of a result as tables in long form, for spreadsheets and data frames.

Key columns come first (step and time, then node, element or point, from 1), then values.  Numbers
are written by Python's repr and can be read back exactly.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm.deck.records import AXES, DOF_NAMES
from fecm.results.result import Result
from fecm.results.schema import DATASETS, SCALES, STORED_BY, ExportError, suggestion

Array = NDArray[Any]

# Key columns of rows: the instant, or the number of a mode.
CLOCK = ("step", "time", "number")
# Axes with named positions become columns.
NAMED: dict[str | int, tuple[str, ...]] = {
    "ndf": DOF_NAMES,
    "ndm": AXES,
    "nen": tuple(f"node_{n}" for n in range(1, 13)),
    3: ("xx", "yy", "xy"),
    2: ("xz", "yz"),
}
# Lines per block.
BLOCK = 100_000


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    header : tuple of str
        Names of the columns.
    rows : iterator of tuple
        Values of the columns, row by row.
    """

    header: tuple[str, ...]
    rows: Iterator[tuple[float, ...]]

    def lines(self) -> Iterator[str]:
        """All lines with line ends, beginning with the header."""
        yield ",".join(self.header) + "\n"
        for row in self.rows:
            yield ",".join(map(repr, row)) + "\n"


def table(result: Result, name: str = "history") -> Table:
    """Table of one dataset, or of all datasets of a group.

    Parameters
    ----------
    result : Result
    name : str
        A dataset such as ``tape3/w``, or a group such as ``history``.

    Raises
    ------
    ExportError
        If there is no such dataset or group, or the group's datasets differ in shape.
    """
    members = _members(result, name.strip("/"))
    group = members[0].rpartition("/")[0]
    beside = [f"{group}/{column}" for column in CLOCK]
    clock = [path for path in beside if path in result and _in_rows(path)]
    values = [path for path in members if path not in clock]
    if clock and values and not any(map(_in_rows, values)):
        clock = []
    elif clock:
        values = list(filter(_in_rows, values))  # the others do not change
    if name.strip("/") == "tape3":
        values = ["tape3/displacement"]  # w is one of its columns
    instants = [result[path] for path in clock]
    if not values:  # only step or time
        return Table(_names(clock), zip(*(times.tolist() for times in instants), strict=True))
    arrays = [result[path] for path in values]
    shape = arrays[0].shape
    if any(array.shape != shape for array in arrays):
        choice = f"{', '.join(values[:-1])} or {values[-1]}"
        raise ExportError(f"the datasets of {name} do not fit into one table; choose {choice}")
    known = DATASETS[values[0]].shape if values[0] in DATASETS else shape
    axes = list(zip(known, shape, strict=True))[bool(clock) :]
    columns = _names(values)
    if len(values) == 1 and axes and len(names := NAMED.get(axes[-1][0], ())) >= axes[-1][1]:
        columns = names[: axes.pop()[1]]
    keys = tuple(SCALES[str(size)][0] if str(size) in SCALES else "row" for size, _ in axes)
    rows = _rows(arrays, instants, [_labels(result, *axis) for axis in axes])
    return Table((*_names(clock), *keys, *columns), rows)


def _members(result: Result, name: str) -> list[str]:
    """Paths of a dataset, or of a group's datasets in the schema's order."""
    if name in result:
        return [name]
    members = [path for path in result if path.startswith(f"{name}/")]
    if members:
        known = list(DATASETS)
        return sorted(members, key=lambda path: known.index(path) if path in known else len(known))
    group = name.partition("/")[0]
    if group in STORED_BY and not any(path.startswith(f"{group}/") for path in result):
        macro = STORED_BY[group]
        raise ExportError(
            f"the result has no {name}; add {macro} to the deck's program and run it again"
        )
    raise ExportError(f"the result has no dataset {name}{suggestion(name, result)}")


def _names(paths: Sequence[str]) -> tuple[str, ...]:
    """Names of datasets within their groups."""
    return tuple(path.rpartition("/")[2] for path in paths)


def _in_rows(path: str) -> bool:
    """Whether the rows of a dataset in a group with step and time are instants."""
    return path not in DATASETS or DATASETS[path].shape[0] == "rows"


def _labels(result: Result, size: str | int, length: int) -> Sequence[int]:
    """Numbers along an axis: those of the gage cards for gages, else from 1."""
    if size == "gages" and "gages/number" in result:
        return [int(number) for number in result["gages/number"]]
    return range(1, length + 1)


def _rows(
    arrays: Sequence[Array], clock: Sequence[Array], keys: Sequence[Sequence[int]]
) -> Iterator[tuple[float, ...]]:
    """Rows of arrays with the axes (instants, keys, columns); instants only with a clock."""
    if not clock:
        arrays = [array[None] for array in arrays]
    numbers = list(itertools.product(*keys))
    step = max(1, BLOCK // len(numbers))
    for start in range(0, len(arrays[0]), step):
        block = slice(start, start + step)
        instants = list(zip(*(times[block].tolist() for times in clock), strict=True))
        parts = [array[block] for array in arrays]
        tables = np.concatenate(
            [part.reshape(len(part), len(numbers), -1) for part in parts], axis=2
        ).tolist()
        for instant, rows in zip(instants or [()], tables, strict=True):
            for number, row in zip(numbers, rows, strict=True):
                yield (*instant, *number, *row)
