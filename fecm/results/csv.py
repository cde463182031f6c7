"""CSV: datasets of a result as tables in long form, for spreadsheets and data frames.

Key columns come first (step and time, then node, element or point, from 1), then values.  Units
follow the names in the header, as tables of measured data have them.  Numbers are written by
Python's repr and can be read back exactly.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from fecm._tables import csv_line
from fecm._typing import Array
from fecm.deck.units import column_name
from fecm.results import schema
from fecm.results.errors import ExportError
from fecm.results.exposures import LOWER_BOUNDS
from fecm.results.groups import STORED_BY
from fecm.results.missing import remedy, suggestion
from fecm.results.plies import IN_PLANE, INTERLAMINAR
from fecm.results.stored import Stored

CLOCK = ("step", "time", "number")  # key columns of rows: the instant, or the number of a mode
# Axes with named positions become columns.
NAMED: dict[str | int, tuple[str, ...]] = {
    **schema.AXIS_NAMES,
    "nen": tuple(f"node_{n}" for n in range(1, 13)),
    3: ("xx", "yy", "xy"),
    2: ("xz", "yz"),
    "faces": ("lower", "upper"),
    "levels": ("lower", "middle", "upper"),
    "directions": ("xz", "yz"),
}
# Names of the other axes' columns.
KEYS = {
    **{size: name for size, (name, _) in schema.SCALES.items()},
    "members": "element",
    "npp": "point",
    "patch_nodes": "node",
}
# Datasets that number the positions along an axis.
LABELS = {"gages": "gages/number", "members": "plies/element", "patch_nodes": "patch/node"}
# Datasets of the table of ply stresses.
PLIES = tuple(f"plies/{name}" for name in (*IN_PLANE, *INTERLAMINAR))
FAILURE = ("failure", "exposures")  # groups of FAIL
# A unit and the components of a dataset that have it.
OF_COMPONENTS = re.compile(r"(\S+) \(([^)]*)\)")
HISTORY = "history"  # the group that is exported by default
BLOCK = 100_000  # lines per block


def lines(
    result: Stored, name: str = HISTORY, note: Callable[[str], None] = lambda text: None
) -> Iterator[str]:
    """Lines of one dataset such as ``tape3/w``, or of all datasets of a group such as ``history``.

    The first is the header.  `note` receives a sentence about values that are not final.  Raises
    ExportError if there is no such dataset or group, or the group's datasets differ in shape.
    """
    plain = name.strip("/")
    members = _members(result, plain)
    if plain.partition("/")[0] in FAILURE and result.still_in_contact:
        note(LOWER_BOUNDS)
    group = members[0].rpartition("/")[0]
    beside = [f"{group}/{column}" for column in CLOCK]
    clock = [path for path in beside if path in result and _in_rows(path)]
    values = [path for path in members if path not in clock]
    if clock and values and not any(map(_in_rows, values)):
        clock = []
    elif clock:
        values = list(filter(_in_rows, values))  # the others do not change
    if plain == "tape3":
        values = ["tape3/displacement"]  # w is one of its columns
    instants = [result[path] for path in clock]
    if not values:  # only step or time
        return _lines(
            _headings(result, clock), zip(*(times.tolist() for times in instants), strict=True)
        )
    values = [path for path in values if path not in LABELS.values()] or values
    arrays = [result[path] for path in values]
    if plain == "plies" and len(values) > len(PLIES):
        values = list(PLIES)
        *in_plane, xz, yz = (result[path] for path in values)
        # Interlaminar stresses are the same at every point of an element.
        whole = [np.broadcast_to(t[:, :, None, :, ::2], in_plane[0].shape) for t in (xz, yz)]
        arrays = in_plane + whole
    shape = arrays[0].shape
    if any(array.shape != shape for array in arrays):
        choice = f"choose {', '.join(values[:-1])} or {values[-1]}"
        raise ExportError(f"the datasets of {name} do not fit into one table; {choice}")
    dataset = schema.dataset_of(values[0], len(shape))
    known = shape if dataset is None else dataset.shape
    axes = list(zip(known, shape, strict=True))[bool(clock) :]
    columns = _headings(result, values)
    if len(values) == 1 and axes and len(names := NAMED.get(axes[-1][0], ())) >= axes[-1][1]:
        columns = _components(names[: axes.pop()[1]], result.unit(values[0]))
    keys = tuple(KEYS.get(str(size), "row") for size, _ in axes)
    numbers: list[Sequence[int]] = []  # along each axis: those that are stored, else from 1
    for size, length in axes:
        path = LABELS.get(str(size), "")
        numbers.append(result[path].tolist() if path in result else range(1, length + 1))
    return _lines((*_headings(result, clock), *keys, *columns), _rows(arrays, instants, numbers))


def _lines(header: Sequence[str], rows: Iterator[tuple[float, ...]]) -> Iterator[str]:
    """Lines of a header and of rows of numbers."""
    texts = (",".join(map(repr, row)) + "\n" for row in rows)
    return itertools.chain([csv_line(header)], texts)


def _members(result: Stored, name: str) -> list[str]:
    """Paths of a dataset, or of a group's datasets in the schema's order."""
    if name in result:
        return [name]
    if members := [path for path in result if path.startswith(f"{name}/")]:
        known = list(schema.DATASETS)
        return sorted(members, key=lambda path: known.index(path) if path in known else len(known))
    group = name.partition("/")[0]
    if group in STORED_BY and not any(path.startswith(f"{group}/") for path in result):
        raise ExportError(f"the result has no {name}{remedy(name)}")
    raise ExportError(f"the result has no dataset {name}{suggestion(name, result)}")


def _headings(result: Stored, paths: Sequence[str]) -> tuple[str, ...]:
    """Names of datasets within their groups, with units."""
    return tuple(column_name(path.rpartition("/")[2], result.unit(path)) for path in paths)


def _components(names: Sequence[str], unit: str) -> tuple[str, ...]:
    """Names of the components of a dataset, with units.

    `unit` is that of all, or says which has which: ``mm (u, v, w), 1 (theta_x, theta_y)``.
    """
    shared = OF_COMPONENTS.findall(unit)
    own = {name: one for one, members in shared for name in members.split(", ") if one != "1"}
    return tuple(column_name(name, own.get(name, "") if shared else unit) for name in names)


def _in_rows(path: str) -> bool:
    """Whether the rows of a dataset in a group with step and time are instants."""
    return path not in schema.DATASETS or schema.DATASETS[path].shape[0] == "rows"


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
