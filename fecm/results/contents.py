"""Contents of a result file, for `fecm info`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

import numpy as np

from fecm._typing import FiniteFloat
from fecm.results.groups import GROUPS
from fecm.results.schema import DATASETS
from fecm.results.stored import row_blocks

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import FileContents


class DatasetJson(TypedDict):
    """Dataset of a result file in JSON."""

    name: str
    shape: Sequence[int]
    dtype: str
    description: str
    dimension: str
    unit: str
    min: FiniteFloat | None
    max: FiniteFloat | None
    not_finite: int
    different: Annotated[int | None, "Number of different texts; null for numbers."]


class GroupJson(TypedDict):
    """Group of a result file in JSON."""

    name: str
    description: str
    rows: int | None
    attributes: dict[str, Any]
    datasets: list[DatasetJson]


def describe_groups(contents: FileContents) -> list[GroupJson]:
    """Describe the groups and datasets of a result file of a run or a sweep.

    Each group has ``name`` (empty for the file itself), ``description``, ``rows`` (stored instants,
    or None), ``attributes`` and ``datasets``. Each dataset has ``name`` (its path), ``shape``,
    ``dtype`` (``"text"`` for texts), ``description``, ``dimension``, ``unit``, ``min`` and ``max``
    of the finite numbers (None without any), ``not_finite`` and, for texts, the number of
    ``different`` texts.
    """
    members: dict[str, list[DatasetJson]] = {name: [] for name in contents.groups}
    for path in _sorted(contents, DATASETS):
        members.setdefault(path.rpartition("/")[0], []).append(_describe(contents, path))
    groups: list[GroupJson] = []
    for name in _sorted(members, GROUPS):
        attributes = dict(contents.groups.get(name, {})) if name else {}
        description = str(attributes.pop("description", ""))
        rows, *_ = contents.shapes.get(f"{name}/step") or (None,)
        groups.append(
            {
                "name": name,
                "description": description,
                "rows": rows,
                "attributes": attributes,
                "datasets": members[name],
            }
        )
    return groups


def _sorted(names: Iterable[str], order_of_known: Iterable[str]) -> list[str]:
    """Return known names in their order, then other names sorted."""
    order = {name: number for number, name in enumerate(order_of_known)}
    return sorted(names, key=lambda name: (order.get(name, len(order)), name))


def _describe(contents: FileContents, path: str) -> DatasetJson:
    """Return shape, type, attributes and range of one dataset."""
    attributes, texts = contents.attributes_of(path), contents.lists.get(path)
    minimum, maximum, not_finite = (None, None, 0) if texts is not None else _range(contents, path)
    return {
        "name": path,
        "shape": contents.shapes[path],
        "dtype": str(contents.dtypes[path]) if texts is None else "text",
        "description": str(attributes.get("description", "")),
        "dimension": str(attributes.get("dimension", "")),
        "unit": str(attributes.get("unit", "")),
        "min": minimum,
        "max": maximum,
        "not_finite": not_finite,
        "different": None if texts is None else len(set(texts)),
    }


def _range(contents: FileContents, path: str) -> tuple[float | None, float | None, int]:
    """Return minimum and maximum of the finite numbers, and the count of others."""
    minimum, maximum, not_finite = math.inf, -math.inf, 0
    for start, stop in row_blocks(contents.shapes[path]):
        block = contents.rows(path, start, stop)
        finite = np.isfinite(block)
        not_finite += int(block.size - np.count_nonzero(finite))
        if finite.any():
            minimum = min(minimum, block[finite].min().item())
            maximum = max(maximum, block[finite].max().item())
    return (minimum, maximum, not_finite) if minimum <= maximum else (None, None, not_finite)
