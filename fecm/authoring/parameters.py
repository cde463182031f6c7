"""Checks of parameters, their units, and the error about invalid parameters."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from numbers import Real
from types import UnionType
from typing import TypeGuard

from fecm._errors import FecmError
from fecm.deck.units import MASS, MODULUS, in_si, unit_in_si, units_of

NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"

# Examples of values with a unit, by dimension, for messages.
EXAMPLES = {
    "force*length": "10J",
    "length/time": "3m/s",
    "time": "4ms",
    "force/length": "50N/mm",
    "length": "6mm",
    "force": "10N",
    MASS: "5kg",
    MODULUS: "60MPa",
}


class ObjectError(FecmError, ValueError):
    """The objects do not make a deck. Messages have the names of parameters in backquotes."""


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a parameter is a number other than True and False."""
    return isinstance(value, Real) and not isinstance(value, bool)


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


def text_of(value: object) -> object:
    """Return a quantity of pint, unyt or astropy as a text such as ``3.0 m/s``.

    Other values are returned unchanged.
    """
    number = getattr(value, "magnitude", getattr(value, "value", None))
    unit = getattr(value, "units", getattr(value, "unit", None))
    if number is None or unit is None:
        return value
    try:
        name = format(unit, "~C")  # pint's format for short names
    except (TypeError, ValueError):
        name = str(unit)
    return f"{number} {name}"


def in_units(name: str, value: object, dimension: str, system: str | None) -> float | None:
    """Convert a parameter with a unit, such as ``10J``, to a system of units.

    A number, None, or the number of a text without a unit stays as it is. Raises ObjectError if the
    value is not a number, the unit does not have the dimension, or the system is not known.
    """
    value = text_of(value)
    if value is None or is_number(value):
        return value
    if not isinstance(value, str):
        raise ObjectError(f"`{name}` is {value!r}, not a number or a text")
    match = re.fullmatch(rf"\s*({NUMBER})\s*(\S.*)?", value)
    unit = match[2] if match else None
    factor = unit_in_si(unit, dimension) if unit else 1.0
    if match is None or factor is None or not math.isfinite(float(match[1])):
        raise ObjectError(
            f"`{name}` is {value!r}, not a number or one with a unit, as in {EXAMPLES[dimension]}"
        )
    if unit is None:
        return float(match[1])
    size = in_si(dimension, units_of(system)) if system else None
    if size is None:
        raise ObjectError(f"`{name}` is {value!r}: give the deck's `units`")
    return float(f"{float(match[1]) * factor / size:.9g}")


def number_pair(name: str, value: Sequence[float]) -> tuple[float, float]:
    """Return the two numbers of a parameter; raise ObjectError if it has no two numbers."""
    try:
        x, y = map(float, value)
    except (TypeError, ValueError):
        raise ObjectError(f"`{name}` is {value!r}, not two numbers") from None
    return x, y
