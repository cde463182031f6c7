"""What is in a result file, for `fecm info`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fecm.results.hdf5_reader import Contents, FileArrays, OpenArrays
from fecm.results.result import Result
from fecm.results.schema import DATASETS, GROUP_DESCRIPTIONS, declared_units
from fecm.results.summary import summary

# Bytes of a block of rows.
BLOCK = 4_000_000


@dataclass(frozen=True)
class DatasetInformation:
    """One dataset.

    Attributes
    ----------
    path : str
    shape : tuple of int
    dtype : str
        ``"text"`` for texts.
    description, dimension, unit : str
        Empty where there is none.
    minimum, maximum : float or None
        Of its finite numbers; None where it has none.
    not_finite : int
        How many of its numbers are NaN or infinite.
    different : int or None
        How many of its texts are; None of numbers.
    """

    path: str
    shape: tuple[int, ...]
    dtype: str
    description: str
    dimension: str
    unit: str
    minimum: float | None
    maximum: float | None
    not_finite: int
    different: int | None = None


@dataclass(frozen=True)
class GroupInformation:
    """One group.

    Attributes
    ----------
    name : str
        Empty for the file itself.
    description : str
    rows : int or None
        Stored instants; None where it stores none.
    attributes : mapping
        All but the description.
    datasets : list of DatasetInformation
    """

    name: str
    description: str
    rows: int | None
    attributes: Mapping[str, Any]
    datasets: list[DatasetInformation]


@dataclass(frozen=True)
class Information:
    """One result file.

    Attributes
    ----------
    path : Path
    size : int
        Bytes on disk.
    attributes : mapping
        Those of the file.
    units : mapping
        Names of the units of length, force and time; empty where the deck gave none.
    groups : list of GroupInformation
    texts : mapping
        Number of lines of every text, by name.
    """

    path: Path
    size: int
    attributes: Mapping[str, Any]
    units: Mapping[str, str]
    groups: list[GroupInformation]
    texts: Mapping[str, int]


def information(contents: Contents) -> Information:
    """Tell what is in a result file, of a run or of a sweep.

    Raises
    ------
    ResultFileError
        If the file can't be read.
    """
    with OpenArrays(contents.path) as opened:
        told = [_dataset(opened, contents.arrays, name) for name in contents.arrays]
        told += [_texts(opened, name, values) for name, values in contents.lists.items()]
    return Information(
        path=contents.path,
        size=contents.path.stat().st_size,
        attributes=contents.attributes,
        units=declared_units(contents.attributes),
        groups=_groups(told, contents.groups),
        texts={name: len(text.splitlines()) for name, text in contents.texts.items()},
    )


def summary_of_run(result: Result) -> list[str]:
    """Summary of a run; a file that lacks something of a result still has the rest told."""
    needed = ("history/time", "history/indentation", "energy/balance_error")
    if "history/force" in result:
        if not len(result["history/force"]) or any(name not in result for name in needed):
            return ["no summary: history or energies are not complete"]
        permanent = result.history.attributes.get("permanent_indentation")
        initial = result.energy.attributes.get("initial")
        if not all(isinstance(value, int | float) for value in (permanent, initial)):
            return ["no summary: permanent_indentation or the initial energy is missing"]
    return summary(result)


def _groups(
    told: list[DatasetInformation], attributes: Mapping[str, Mapping[str, Any]]
) -> list[GroupInformation]:
    """Groups in the schema's order, then others by name."""
    members: dict[str, list[DatasetInformation]] = {name: [] for name in attributes}
    for dataset in told:
        members.setdefault(dataset.path.rpartition("/")[0], []).append(dataset)
    known = list(GROUP_DESCRIPTIONS)
    groups: list[GroupInformation] = []
    for name in sorted(members, key=lambda n: (known.index(n) if n in known else len(known), n)):
        datasets = sorted(members[name], key=_order)
        if not name and not datasets:
            continue
        own = {} if not name else dict(attributes.get(name, {}))
        description = str(own.pop("description", ""))
        clock = next((d for d in datasets if d.path == f"{name}/step" and d.shape), None)
        rows = clock.shape[0] if clock else None
        groups.append(GroupInformation(name, description, rows, own, datasets))
    return groups


def _order(dataset: DatasetInformation) -> tuple[int, str]:
    """Place of a dataset in its group: as the schema has it, then by name."""
    known = list(DATASETS)
    place = known.index(dataset.path) if dataset.path in DATASETS else len(known)
    return place, dataset.path


def _dataset(opened: OpenArrays, arrays: FileArrays, path: str) -> DatasetInformation:
    """Shape, attributes and range of one dataset, read in blocks of rows."""
    shape = arrays.shapes[path]
    minimum, maximum, strange = math.inf, -math.inf, 0
    rows = shape[0] if shape else 1
    step = max(1, BLOCK // (8 * max(1, math.prod(shape[1:]))))
    for start in range(0, rows, step):
        block = opened.rows(path, start, min(start + step, rows))
        finite = np.isfinite(block)
        strange += int(block.size - np.count_nonzero(finite))
        if finite.any():
            minimum = min(minimum, block[finite].min().item())
            maximum = max(maximum, block[finite].max().item())
    return DatasetInformation(
        path,
        shape,
        str(arrays.dtypes[path]),
        *_words(opened, path),
        minimum=minimum if minimum <= maximum else None,
        maximum=maximum if minimum <= maximum else None,
        not_finite=strange,
    )


def _texts(opened: OpenArrays, path: str, values: Sequence[str]) -> DatasetInformation:
    """A dataset of texts."""
    return DatasetInformation(
        path, (len(values),), "text", *_words(opened, path), None, None, 0, len(set(values))
    )


def _words(opened: OpenArrays, path: str) -> tuple[str, str, str]:
    """Description, dimension and unit of a dataset."""
    attributes = opened.attributes(path)
    told = [str(attributes.get(name, "")) for name in ("description", "dimension", "unit")]
    return told[0], told[1], told[2]
