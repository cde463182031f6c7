"""Tables of measured strains."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._dataclasses import frozen
from fecm._errors import StudyError
from fecm._measured_tables import Table, read_table, same_name, unit_size
from fecm._text import printable
from fecm._typing import Floats

# A CSV file; times and strains, (points, gages); or columns by name, as of a DataFrame.
StrainSource = str | Path | tuple[Any, Any] | Mapping[str, Any]

LARGEST = 0.1  # strain beyond which a table must be in another unit
USUAL = (1e-5, 1e-2)  # largest strains of impacts that leave the plate linear
DIVISORS = {"per cent": 100.0, "per mille": 1e3, "microstrain": 1e6}
FEWEST = 10  # points
_NUMBER = re.compile(r"(?:gage|gauge|strain)?[ _-]?([0-9]+)")


@frozen
class StrainTable:
    """Measured strains of some gages."""

    name: str
    time: Floats  # (points,), increasing
    gages: NDArray[np.int32]  # (gages,): numbers on the cards
    strains: Floats  # (gages, points)


def strain_table(
    source: StrainSource, units: Mapping[str, str], numbers: Sequence[int]
) -> StrainTable:
    """Strains of gages with these numbers on the cards, in the order of the table.

    `units` are the names of the deck's, which may be empty.  Raises StudyError if the table is
    invalid, in other units, or not of strains; OSError if a file can't be read.
    """
    if isinstance(source, str | Path):
        made = _from_file(Path(source), units, numbers)
    elif isinstance(source, tuple):
        made = _from_arrays(source, numbers)
    else:
        made = _from_columns(source, numbers)
    _check(made)
    return made


def _check(made: StrainTable) -> None:
    """Refuse strains that are no numbers, too few, or in microstrain."""
    name, time, strains = made.name, made.time, made.strains
    if not (np.isfinite(time).all() and np.isfinite(strains).all()):
        raise StudyError(f"{name}: times and strains must be finite numbers")
    if not (np.diff(time) > 0.0).all():
        raise StudyError(f"{name}: the times must increase")
    if len(made.gages) < 2:
        raise StudyError(
            f"{name} has {len(made.gages)} gage; a place needs the strains of two gages at least"
        )
    if len(time) < FEWEST:
        raise StudyError(f"{name} has {len(time)} points; at least {FEWEST} are needed")
    if (largest := float(np.abs(strains).max())) > LARGEST:
        raise StudyError(f"{name}: the largest strain is {largest:.3g}{_likely_unit(largest)}")
    if not strains.any():
        raise StudyError(f"{name}: all strains are 0")


def _likely_unit(largest: float) -> str:
    """Units in which a strain that is too large would be a usual one, and the remedy."""
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


def _numbered(name: str, heads: Sequence[str], numbers: Sequence[int]) -> list[int]:
    """Numbers of the gages of columns; in the order of the deck if the columns have no numbers."""
    found = [_NUMBER.fullmatch(head.partition("(")[0].strip().casefold()) for head in heads]
    known = ", ".join(map(str, numbers))
    if not any(found):
        if len(heads) != len(numbers):
            raise StudyError(
                f"{name} has {len(heads)} columns of strains, and the deck {len(numbers)} gages: "
                f"{known}; name the columns by the numbers of their gages"
            )
        return list(numbers)
    gages = [int(one[1]) if one else None for one in found]
    for head, gage in zip(heads, gages, strict=True):
        if gage not in numbers:
            raise StudyError(f"{name}: {head} is not a gage of the deck; its gages are {known}")
    if len(set(gages)) < len(gages):
        raise StudyError(f"{name}: a gage has two columns")
    return [gage for gage in gages if gage is not None]


def _made(name: str, time: Any, gages: Sequence[int], strains: Any) -> StrainTable:
    return StrainTable(
        name,
        np.asarray(time, dtype=float),
        np.array(gages, np.int32),
        np.ascontiguousarray(strains, dtype=float),
    )


# A table in memory --------------------------------------------------------------------------------


def _from_arrays(source: tuple[Any, Any], numbers: Sequence[int]) -> StrainTable:
    """Times and strains, (points, gages), in the order of the deck."""
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
    return _made("the table", time, numbers, strains.T)


def _from_columns(source: Mapping[str, Any], numbers: Sequence[int]) -> StrainTable:
    """A column of times and those of gages, by name."""
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
    gages = _numbered("the table", list(columns), numbers)
    return _made("the table", time, gages, list(columns.values()))


# A file -------------------------------------------------------------------------------------------


def _from_file(path: Path, units: Mapping[str, str], numbers: Sequence[int]) -> StrainTable:
    table = read_table(path)
    name, names = printable(path.name), table.names
    if all(any(same_name(one, known) for one in names) for known in ("time", "gage", "strain")):
        return _from_long(table, name, units, numbers)
    width = len(table.rows[0][1]) if table.rows else 0
    heads = names or [f"column {n}" for n in range(1, width + 1)]
    clock = table.places(["time"])[0] if table.has("time") else 0
    places = [n for n in range(len(heads)) if n != clock]
    gages = _numbered(name, [heads[n] for n in places], numbers)
    keys = ["time", *(f"gage {gage}" for gage in gages)]
    columns = table.columns(keys, increasing="time", places=[clock, *places])
    time, *strains = columns.values()
    sizes = [unit_size(name, table.unit(place), "strain") for place in places]
    converted = [size * strain for size, strain in zip(sizes, strains, strict=True)]
    return _made(name, time * _clock(table, name, clock, units), gages, converted)


def _clock(table: Table, name: str, place: int, units: Mapping[str, str]) -> float:
    """Factor from the unit of a column of times to the deck's; 1 if one of them has no name."""
    unit, deck = table.unit(place), units.get("time", "")
    if not unit or not deck or unit == deck:
        return 1.0
    return unit_size(name, unit, "time") / unit_size(name, deck, "time")


def _from_long(
    table: Table, name: str, units: Mapping[str, str], numbers: Sequence[int]
) -> StrainTable:
    """A row for every time and gage, as ``fecm export`` writes them."""
    columns = table.columns(("time", "gage", "strain"))
    clock, strain = (
        next(n for n, one in enumerate(table.names) if same_name(one, known))
        for known in ("time", "strain")
    )
    gages = [gage for gage in numbers if (columns["gage"] == gage).any()]
    if unknown := sorted(set(columns["gage"].tolist()) - set(gages)):
        known = ", ".join(map(str, numbers))
        raise StudyError(f"{name}: {unknown[0]:g} is not a gage of the deck; its gages are {known}")
    rows = [columns["gage"] == gage for gage in gages]
    times = [columns["time"][row] for row in rows]
    if any(not np.array_equal(time, times[0]) for time in times):
        raise StudyError(f"{name}: the gages have different times")
    size = unit_size(name, table.unit(strain), "strain")
    strains = [size * columns["strain"][row] for row in rows]
    return _made(name, times[0] * _clock(table, name, clock, units), gages, strains)
