"""Contents of a result file, for `fecm info`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from fecm.results.hdf5_reader import Contents
from fecm.results.result import Result
from fecm.results.schema import DATASETS, GROUP_DESCRIPTIONS, row_blocks
from fecm.results.summary import summary


def describe_groups(contents: Contents) -> list[dict[str, Any]]:
    """Describe the groups and datasets of a result file, of a run or of a sweep.

    Of each group ``name`` (empty for the file itself), ``description``, ``rows`` (stored instants,
    or None), ``attributes`` and ``datasets``; of each dataset ``name`` (its path), ``shape``,
    ``dtype`` (``"text"`` for texts), ``description``, ``dimension``, ``unit``, ``min`` and ``max``
    of the finite numbers (None without any), ``not_finite`` and, for texts, the number of
    ``different`` ones.
    """
    datasets = [_describe(contents, path) for path in contents]
    members: dict[str, list[dict[str, Any]]] = {name: [] for name in contents.groups}
    for dataset in datasets:
        members.setdefault(dataset["name"].rpartition("/")[0], []).append(dataset)
    groups: list[dict[str, Any]] = []
    for name in sorted(members, key=lambda name: _order(GROUP_DESCRIPTIONS, name)):
        if not name and not members[name]:
            continue
        attributes = dict(contents.groups.get(name, {})) if name else {}
        description = str(attributes.pop("description", ""))
        clock = contents.shapes.get(f"{name}/step", ())
        own = sorted(members[name], key=lambda d: _order(DATASETS, d["name"]))
        rows = clock[0] if clock else None
        groups.append({"name": name, "description": description, "rows": rows,
                       "attributes": attributes, "datasets": own})  # fmt: skip
    return groups


def _order(known: Mapping[str, Any], name: str) -> tuple[int, str]:
    """Sort key: known names in their order, then others by name."""
    names = list(known)
    return names.index(name) if name in known else len(names), name


def _describe(contents: Contents, path: str) -> dict[str, Any]:
    """Shape, type, attributes and range of one dataset."""
    attributes = contents.attributes_of(path)
    texts = contents.lists.get(path)
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


def about_run(result: Result) -> dict[str, Any]:
    """Steps, first and last time, metrics and summary of a run."""
    steps = len(result["history/time"]) if "history/time" in result else 0
    missing = _missing(result)
    return {
        "steps": steps,
        "time": result["history/time"][[0, -1]].tolist() if steps else None,
        "still_in_contact": result.still_in_contact,
        "notes": list(result.notes),
        "metrics": {} if missing else result.metrics,
        "summary": missing or summary(result),
    }


def _missing(result: Result) -> list[str]:
    """Reason why an incomplete file has no summary; empty if it has one."""
    needed = ("history/time", "history/indentation", "history/plate_w", "energy/balance_error")
    if "history/force" in result:
        if not len(result["history/force"]) or any(name not in result for name in needed):
            return ["no summary: history or energies are not complete"]
        permanent = result.history.attributes.get("permanent_indentation")
        initial = result.energy.attributes.get("initial")
        if not all(isinstance(value, int | float) for value in (permanent, initial)):
            return ["no summary: permanent_indentation or the initial energy is missing"]
    return []
