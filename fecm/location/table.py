"""Tables of measured strains."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fecm._errors import StudyError, warn
from fecm._measured_tables import (
    IN_MEMORY,
    MeasuredTable,
    Record,
    factor,
    read_table,
    same_name,
    unit_free,
    unit_in,
)
from fecm._record_faults import record_faults
from fecm._typing import Floats

_K = TypeVar("_K")

# A CSV file; times and strains, (points, gages); or columns by name, as of a DataFrame.
StrainSource = str | Path | tuple[Any, Any] | Mapping[str, Any]

LARGEST = 0.1  # strain above which a table must be in another unit
USUAL = (1e-5, 1e-2)  # largest strains of impacts that leave the plate linear
DIVISORS = {"per cent": 100.0, "per mille": 1e3, "microstrain": 1e6}
FEWEST = 10  # points of a table
_NUMBER = re.compile(r"(?:gage|gauge|strain)?[ _-]?([0-9]{1,9})")


class StrainTable(NamedTuple):
    """Measured strains of some gages."""

    name: str
    time: Floats  # (points,), increasing
    gages: NDArray[np.int32]  # (gages,): numbers on the cards
    strains: Floats  # (gages, points)
    record: Record = IN_MEMORY

    def faults(self, clock: str) -> list[str]:
        """Describe the faults of the records, for times in a unit, with causes and remedies."""
        return [
            f"{self.name}: {fault}"
            for gage, strains in zip(self.gages.tolist(), self.strains, strict=True)
            for fault in record_faults(f"gage {gage}", strains, self.time, clock=clock, ends=False)
        ]


def strain_table(
    source: StrainSource, units: Mapping[str, str], numbers: Sequence[int]
) -> StrainTable:
    """Return the strains in a table, in its order of gages.

    `numbers` are the gages of the deck. `units` has the names of the deck's units, which may be
    empty. Raises StudyError if the table is invalid, in other units, or not of strains. Raises
    OSError if a file can't be read.
    """
    if isinstance(source, str | Path):
        table = _from_file(Path(source), units, numbers)
    elif isinstance(source, tuple):
        table = _from_arrays(source, numbers)
    else:
        table = _from_columns(source, units, numbers)
    _check(table)
    return table


def _check(table: StrainTable) -> None:
    """Raise StudyError if times or strains are invalid, too few, or in another unit."""
    name, time, strains = table.name, table.time, table.strains
    if not (np.isfinite(time).all() and np.isfinite(strains).all()):
        raise StudyError(f"{name}: times and strains must be finite numbers")
    if not (np.diff(time) > 0.0).all():
        raise StudyError(f"{name}: the times must increase")
    if len(table.gages) < 2:
        raise StudyError(
            f"{name} has {len(table.gages)} gage; a place needs the strains of two gages at least"
        )
    if len(time) < FEWEST:
        raise StudyError(f"{name} has {len(time)} points; at least {FEWEST} are needed")
    if (largest := float(np.abs(strains).max())) > LARGEST:
        raise StudyError(f"{name}: the largest strain is {largest:.3g}{_likely_unit(largest)}")
    if not strains.any():
        raise StudyError(f"{name}: all strains are 0")


def _likely_unit(largest: float) -> str:
    """Suggest units in which a strain that is too large would be usual, and the remedy."""
    texts = [
        f"{unit} ({largest / divisor:.2g}; divide by {divisor:g})"
        for unit, divisor in DIVISORS.items()
        if USUAL[0] <= largest / divisor <= USUAL[1]
    ]
    if not texts:
        return "; strains are length over length"
    return (
        f", which looks like {' or '.join(texts)}; or name the unit in the header, as in "
        "`gage 1 (µm/m)` or `gage 1 (%)`"
    )


def _match_columns(name: str, heads: Mapping[_K, str], numbers: Sequence[int]) -> dict[_K, int]:
    """Return the gage of each column of strains.

    Columns without a number are left out if others have one. If no column has a number, the columns
    are in the order of the deck.
    """
    matches = {n: _NUMBER.fullmatch(unit_free(head).casefold()) for n, head in heads.items()}
    numbers_of_deck = ", ".join(map(str, numbers))
    if not any(matches.values()):
        if len(heads) != len(numbers):
            raise StudyError(
                f"{name} has {len(heads)} columns of strains, and the deck {len(numbers)} gages: "
                f"{numbers_of_deck}; name the columns by the numbers of their gages"
            )
        listing = ", ".join(f"{heads[n]} of {m}" for n, m in zip(heads, numbers, strict=True))
        warn(f"{name}: the columns name no gages; their strains are taken as {listing}")
        return dict(zip(heads, numbers, strict=True))
    gages = {n: int(match[1]) for n, match in matches.items() if match}
    for n, gage in gages.items():
        if gage not in numbers:
            raise StudyError(
                f"{name}: {heads[n]} is not a gage of the deck; its gages are {numbers_of_deck}"
            )
    if len(set(gages.values())) < len(gages):
        raise StudyError(f"{name}: a gage has two columns")
    return gages


def _as_table(name: str, time: Any, gages: Sequence[int], strains: Any) -> StrainTable:
    return StrainTable(
        name,
        np.asarray(time, dtype=float),
        np.array(gages, np.int32),
        np.ascontiguousarray(strains, dtype=float),
    )


# A table in memory --------------------------------------------------------------------------------


def _from_arrays(source: tuple[Any, Any], numbers: Sequence[int]) -> StrainTable:
    """Read a pair of times and strains, (points, gages), in the order of the deck."""
    hint = "the strains are a CSV file, columns by name, or a pair of times and strains"
    try:
        time, strains = (np.asarray(values, dtype=float) for values in source)
    except (TypeError, ValueError):
        raise StudyError(f"{hint}, all numbers") from None
    if time.ndim != 1 or strains.shape != (len(time), len(numbers)):
        raise StudyError(
            f"{hint}: {len(numbers)} gages of the deck need times (points,) and strains (points, "
            f"{len(numbers)}), not {time.shape} and {strains.shape}"
        )
    return _as_table("the table", time, numbers, strains.T)


def _from_columns(
    source: Mapping[str, Any], units: Mapping[str, str], numbers: Sequence[int]
) -> StrainTable:
    """Read columns of times and strains, by name."""
    try:
        columns = {str(name): np.asarray(source[name], dtype=float) for name in source}
    except (TypeError, ValueError):
        raise StudyError("the columns of the table must be numbers") from None
    times = [name for name in columns if same_name(name, "time")]
    if len(times) != 1:
        raise StudyError(f"the table needs a column time; its columns are {', '.join(columns)}")
    time = columns.pop(times[0])
    if time.ndim != 1 or any(column.shape != time.shape for column in columns.values()):
        raise StudyError("the columns of the table differ in length")
    gages = _match_columns("the table", {name: name for name in columns}, numbers)
    time = time * factor("the table: time", unit_in(times[0]), units.get("time", ""), "time")
    strains = [columns[n] * factor(f"the table: {n}", unit_in(n), "", "strain") for n in gages]
    return _as_table("the table", time, list(gages.values()), strains)


# A file -------------------------------------------------------------------------------------------


def _from_file(path: Path, units: Mapping[str, str], numbers: Sequence[int]) -> StrainTable:
    """Read a CSV file with a column per gage, or with a row for every time and gage."""
    table = read_table(path)
    name = table.record.file
    if all(map(table.has, ("time", "gage", "strain"))):
        return _from_long(table, name, units, numbers)._replace(record=table.record)
    width = len(table.rows[0][1]) if table.rows else 0
    heads = table.head[1] or [f"column {n}" for n in range(1, width + 1)]
    has_time = table.has("time") or not table.head[1]
    clock = table.find(["time"])[0] if has_time else table.column("time", 0)
    gages = _match_columns(
        name, {n: head for n, head in enumerate(heads) if n != clock.place}, numbers
    )
    columns = [clock, *(table.column(f"gage {gage}", place) for place, gage in gages.items())]
    time, *strains = table.values(columns, units, increasing="time")
    return _as_table(name, time, list(gages.values()), strains)._replace(record=table.record)


def _from_long(
    table: MeasuredTable, name: str, units: Mapping[str, str], numbers: Sequence[int]
) -> StrainTable:
    """Read a table with a row for every time and gage, as written by ``fecm export``."""
    time, gage, strain = table.values(table.find(("time", "gage", "strain"), units=units), units)
    gages = [number for number in numbers if (gage == number).any()]
    if unknown := sorted(set(gage.tolist()) - set(gages)):
        numbers_of_deck = ", ".join(map(str, numbers))
        raise StudyError(
            f"{name}: {unknown[0]:g} is not a gage of the deck; its gages are {numbers_of_deck}"
        )
    rows = [gage == number for number in gages]
    if any(not np.array_equal(time[row], time[rows[0]]) for row in rows):
        raise StudyError(f"{name}: the gages have different times")
    return _as_table(name, time[rows[0]], gages, [strain[row] for row in rows])
