"""Quantities that users write, such as ``10J``, in the units of a deck."""

from __future__ import annotations

import math
import re
from numbers import Real
from typing import TypeGuard

from fecm.deck.units import (
    COEFFICIENT,
    DENSITY,
    INERTIA,
    MASS,
    MODULUS,
    VELOCITY,
    UnitsError,
    in_si,
    unit_in_si,
    units_of,
)

NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"

# Examples of values with a unit, by dimension, for messages.
EXAMPLES = {
    "force*length": "10J",
    VELOCITY: "3m/s",
    "time": "4ms",
    "force": "6kN",
    "force/length": "50N/mm",
    "length": "6mm",
    MASS: "5kg",
    INERTIA: "2N*mm*s^2",
    MODULUS: "60MPa",
    DENSITY: "1600kg/m^3",
    COEFFICIENT: "4e4N/mm^1.5",
}


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a parameter is a number other than True and False."""
    return isinstance(value, Real) and not isinstance(value, bool)


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
    return f"{number} {name.replace('**', '^')}"


def in_units(name: str, value: object, dimension: str, system: str | None) -> float | None:
    """Convert a quantity with a unit, such as ``10J``, to a system of units.

    A number, None, or the number of a text without a unit stays as it is. Raises UnitsError if the
    value is not a number, the unit does not have the dimension, or the system is not known.

    Examples
    --------
    >>> in_units("energy", "10J", "force*length", "mm-N-s")
    10000.0
    """
    value = text_of(value)
    if value is None or is_number(value):
        return value
    if not isinstance(value, str):
        raise UnitsError(f"`{name}` is {value!r}, not a number or a text")
    match = re.fullmatch(rf"\s*({NUMBER})\s*(\S.*)?", value)
    unit = match[2] if match else None
    factor = unit_in_si(unit, dimension) if unit else 1.0
    if match is None or factor is None or not math.isfinite(float(match[1])):
        raise UnitsError(
            f"`{name}` is {value!r}, not a number or one with a unit, as in {EXAMPLES[dimension]}"
        )
    if unit is None:
        return float(match[1])
    size = in_si(dimension, units_of(system)) if system else None
    if size is None:
        raise UnitsError(f"`{name}` is {value!r}: give the deck's `units`")
    return float(f"{float(match[1]) * factor / size:.9g}")
