"""Checks of parameters, their units, and the error about invalid parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import UnionType
from typing import TypeGuard

from fecm._errors import FecmError
from fecm.deck import quantities
from fecm.deck.quantities import is_number
from fecm.deck.units import UnitsError


class ObjectError(FecmError, ValueError):
    """The objects do not make a deck. Messages have the names of parameters in backquotes."""


def is_finite(value: object) -> TypeGuard[float]:
    """Return whether a parameter is a finite number."""
    return is_number(value) and math.isfinite(value)


def check_numbers(**values: object) -> None:
    """Raise ObjectError if a parameter is not a number; None is allowed."""
    for name, value in values.items():
        if value is not None and not is_number(value):
            raise ObjectError(f"`{name}` is {value!r}; it must be a number")


def check_positive(**values: float | None) -> None:
    """Raise ObjectError if a parameter is not a positive number; None is allowed."""
    for name, value in values.items():
        if value is not None and not (is_finite(value) and value > 0.0):
            raise ObjectError(f"`{name}` is {value!r}; it must be a positive number")


def check_kind(name: str, value: object, kind: type | UnionType) -> None:
    """Raise ObjectError if a parameter is not an object of fecm."""
    if not isinstance(value, kind):
        raise ObjectError(f"`{name}` is {value!r}, not a {name} of fecm")


def in_units(name: str, value: object, dimension: str, system: str | None) -> float | None:
    """Convert a parameter with a unit as :func:`fecm.deck.quantities.in_units`.

    Raises ObjectError if it can't be converted.
    """
    try:
        return quantities.in_units(name, value, dimension, system)
    except UnitsError as error:
        raise ObjectError(str(error)) from None


def number_pair(name: str, value: Sequence[float]) -> tuple[float, float]:
    """Return the two numbers of a parameter; raise ObjectError if it has no two numbers."""
    try:
        x, y = map(float, value)
    except (TypeError, ValueError):
        raise ObjectError(f"`{name}` is {value!r}, not two numbers") from None
    return x, y
