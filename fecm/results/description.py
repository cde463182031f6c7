"""Description of a result file: its groups and datasets."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm.results.blocks import row_blocks
from fecm.results.groups import GROUPS
from fecm.results.schema import DATASETS

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents


def describe_groups(contents: Contents) -> list[dict[str, Any]]:
    """Describe the groups and datasets of a result file, of a run or of a sweep.

    Of each group ``name`` (empty for the file itself), ``description``, ``rows`` (stored instants,
    or None), ``attributes`` and ``datasets``; of each dataset ``name`` (its path), ``shape``,
    ``dtype`` (``"text"`` for texts), ``description``, ``dimension``, ``unit``, ``min`` and ``max``
    of the finite numbers (None without any), ``not_finite`` and, for texts, the number of
    ``different`` ones.
    """
    members: dict[str, list[dict[str, Any]]] = {name: [] for name in contents.groups}
    for path in _sorted(contents, DATASETS):
        members.setdefault(path.rpartition("/")[0], []).append(_describe(contents, path))
    groups: list[dict[str, Any]] = []
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


def _sorted(names: Iterable[str], known: Iterable[str]) -> list[str]:
    """Known names in their order, then others by name."""
    order = {name: number for number, name in enumerate(known)}
    return sorted(names, key=lambda name: (order.get(name, len(order)), name))


def _describe(contents: Contents, path: str) -> dict[str, Any]:
    """Shape, type, attributes and range of one dataset."""
    attributes, texts = contents.attributes_of(path), contents.lists.get(path)
    minimum, maximum, not_finite = (None, None, 0) if texts is not None else _range(contents, path)
    return {
        "name": path,
        "shape": contents.shapes[path],
        "dtype": str(contents.dtypes[path]) if texts is None else "text",
        **{key: str(attributes.get(key, "")) for key in ("description", "dimension", "unit")},
        "min": minimum,
        "max": maximum,
        "not_finite": not_finite,
        "different": None if texts is None else len(set(texts)),
    }


def _range(contents: Contents, path: str) -> tuple[float | None, float | None, int]:
    """Minimum and maximum of the finite numbers, and number of others, by blocks of rows."""
    minimum, maximum, not_finite = math.inf, -math.inf, 0
    for start, stop in row_blocks(contents.shapes[path]):
        block = contents.rows(path, start, stop)
        finite = np.isfinite(block)
        not_finite += int(block.size - np.count_nonzero(finite))
        if finite.any():
            minimum = min(minimum, block[finite].min().item())
            maximum = max(maximum, block[finite].max().item())
    return (minimum, maximum, not_finite) if minimum <= maximum else (None, None, not_finite)
