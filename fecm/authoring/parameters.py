"""Numbers and units of parameters, and the error about them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from numbers import Real
from types import UnionType
from typing import TypeGuard

from fecm._errors import FecmError
from fecm.deck.units import MASS, MODULUS, in_si, unit_in_si, units_of

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"

# A value with a unit of a dimension, for messages.
EXAMPLES = {
    "force*length": "10J",
    "length/time": "3m/s",
    "time": "4ms",
    "force/length": "50N/mm",
    "length": "6mm",
    MASS: "5kg",
    MODULUS: "60MPa",
}


class ObjectError(FecmError, ValueError):
    """Objects do not give a deck; messages quote the names of parameters in backquotes."""


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a parameter is a number; True and False are not."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_finite(value: object) -> TypeGuard[float]:
    """Return whether a parameter is a finite number."""
    return is_number(value) and math.isfinite(value)


def check_numbers(**values: object) -> None:
    """Refuse parameters that are not numbers; None is a missing parameter."""
    for name, value in values.items():
        if value is not None and not is_number(value):
            raise ObjectError(f"`{name}` is {value!r}; it must be a number")


def check_positive(**values: float | None) -> None:
    """Refuse parameters that are not positive numbers; None is a missing parameter."""
    for name, value in values.items():
        if value is not None and not (is_finite(value) and value > 0.0):
            raise ObjectError(f"`{name}` is {value!r}; it must be a positive number")


def check_kind(name: str, value: object, kind: type | UnionType) -> None:
    """Refuse a parameter that is not an object of fecm."""
    if not isinstance(value, kind):
        raise ObjectError(f"`{name}` is {value!r}, not a {name} of fecm")


def text_of(value: object) -> object:
    """Return the text of a quantity of pint, unyt or astropy, such as ``3.0 m/s``.

    Any other value stays as it is.
    """
    number = getattr(value, "magnitude", getattr(value, "value", None))
    unit = getattr(value, "units", getattr(value, "unit", None))
    if number is None or unit is None:
        return value
    try:
        name = format(unit, "~C")  # the short names of pint
    except (TypeError, ValueError):
        name = str(unit)
    return f"{number} {name}"


def in_units(name: str, value: object, dimension: str, system: str | None) -> float | None:
    """Return a parameter in a system of units; a number or None stays as it is.

    Raises ObjectError if a text, as in ``10J`` or ``3m/s``, or a quantity is not a number with a
    unit of the dimension, the system is not known, or the value has another type.
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
        raise ObjectError(f"`{name}` is {value!r}: give `units`, the deck's")
    return float(f"{float(match[1]) * factor / size:.9g}")


def number_pair(name: str, value: Sequence[float]) -> tuple[float, float]:
    """Return the two numbers of a parameter."""
    try:
        x, y = map(float, value)
    except (TypeError, ValueError):
        raise ObjectError(f"`{name}` is {value!r}, not two numbers") from None
    return x, y
