"""State of a run as values and arrays by path, for its checkpoint."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np


def _names(value: object) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass or named tuple."""
    if dataclasses.is_dataclass(value):
        return tuple(f.name for f in dataclasses.fields(value) if f.init)
    return getattr(value, "_fields", ())


def saved_values(value: object, path: str, seen: set[int] | None = None) -> dict[str, Any]:
    """Return values and arrays of a dataclass and its members, by path.

    Shared members occur once.
    """
    names = _names(value)
    seen = set() if seen is None else seen
    if not names:
        return {path: value.copy() if isinstance(value, np.ndarray) else value}
    if id(value) in seen:
        return {}
    seen.add(id(value))
    members = (saved_values(getattr(value, name), f"{path}/{name}", seen) for name in names)
    return {name: saved for member in members for name, saved in member.items()}


def restore(value: Any, path: str, stored: Mapping[str, Any], seen: set[int] | None = None) -> Any:
    """Restore a dataclass to the state that :func:`saved_values` returned for one of its type."""
    names = _names(value)
    seen = set() if seen is None else seen
    if not names:
        new = stored[path]
        if not isinstance(value, np.ndarray):
            # The memory of a user's law, which JSON has made lists of.
            return _tuples(new) if value is None or isinstance(value, tuple) else new
        if new.shape != value.shape or new.dtype != value.dtype:
            raise ValueError(f"{path} has another shape or type")
        value[...] = new
        return value
    if id(value) in seen:
        return value
    seen.add(id(value))
    new = {name: restore(getattr(value, name), f"{path}/{name}", stored, seen) for name in names}
    if isinstance(value, tuple) or "__setattr__" in vars(type(value)):  # frozen
        return type(value)(**new)
    for name, saved in new.items():
        setattr(value, name, saved)
    return value


def _tuples(value: Any) -> Any:
    """Return a value with its lists turned into tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def subset(stored: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Return the entries whose names have a prefix, without it."""
    return {n.removeprefix(prefix): v for n, v in stored.items() if n.startswith(prefix)}
