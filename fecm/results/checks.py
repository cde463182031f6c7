"""Checks of a file's contents against the schema."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fecm._text import shown
from fecm.results.criteria import OWN_CRITERIA, criteria_of
from fecm.results.exposures import AT_REST, LOAD_FACTOR
from fecm.results.metrics import MOBILITY
from fecm.results.schema import FIXED, dataset_of


def shape_error(
    shapes: Mapping[str, tuple[int, ...]], kinds: Mapping[str, str], criteria: int
) -> str:
    """Message about the first dataset with a wrong shape or type; empty if there is none.

    `criteria` is the number of failure criteria.  The others are by path; kinds are NumPy's
    letters: ``"f"``, ``"i"``, ``"u"`` or ``"b"``.
    """
    sizes: dict[str | int, tuple[int, str]] = {n: (s, "every result") for n, s in FIXED.items()}
    sizes["criteria"] = (criteria, "this result")
    for path, shape in shapes.items():
        if (dataset := dataset_of(path, len(shape))) is None:
            continue
        if kinds[path] not in ("f" if dataset.dtype.startswith("f") else "iu"):
            return f"{path} has the wrong type: expected {dataset.dtype}"
        if len(shape) != len(dataset.shape):
            return f"{path} has the shape {shape}, not ({', '.join(map(str, dataset.shape))})"
        for name, size in zip(dataset.shape, shape, strict=True):
            known = (name, "every result") if isinstance(name, int) else (size, path)
            key = f"{dataset.group} {name}" if name == "rows" else name
            expected, source = sizes.setdefault(key, known)
            if size != expected:
                return f"{path} has the shape {shape}, but {name} is {expected} in {source}"
    return ""


# Attributes that are numbers, and lists of texts, by group.  A result without those of history and
# energy only lacks its summary.
NUMBERS = {
    "energy": ("initial",),
    "history": ("permanent_indentation", "unsettled_steps", MOBILITY),
    "threshold": ("force", "time", "margin"),
    "patch": ("x", "y", "radius"),
}
TEXTS = {"failure": ("modes", OWN_CRITERIA)}
COMPLETE = ("threshold",)  # groups that have all of these attributes


def attribute_error(groups: Mapping[str, Mapping[str, Any]]) -> str:
    """Message about the first attribute of a wrong type or missing; empty if there is none.

    Attributes are by group and name.
    """
    criteria = criteria_of(groups.get("failure", {}))
    numbers = NUMBERS | {f"failure/{name}": (AT_REST, LOAD_FACTOR) for name in criteria}
    for table, fits, what in ((numbers, _is_number, "a number"), (TEXTS, _is_texts, "texts")):
        for group, names in table.items():
            found = groups.get(group, {})
            missing = [name for name in names if name not in found]
            if group in groups and group in COMPLETE and missing:
                return f"{group} has no attribute {missing[0]}"
            for name in names:
                if name in found and not fits(found[name]):
                    return f"the attribute {name} of {group} is {shown(found[name])}, not {what}"
    return ""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(text, str) for text in value)
