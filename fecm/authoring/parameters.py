"""Checks of parameters, their units, and the error about invalid parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from types import UnionType
from typing import TypeGuard

from fecm._errors import FecmError
from fecm.deck import quantities
from fecm.deck.quantities import is_number
from fecm.deck.units import MASS, UnitsError
from fecm.mechanics.projectile import DeckProjectile, RigidMass


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


def parameter_in_units(
    name: str, value: object, dimension: str, system: str | None
) -> float | None:
    """Convert a parameter with a unit as :func:`fecm.deck.quantities.in_units`.

    Raises ObjectError if it can't be converted.
    """
    try:
        return quantities.in_units(name, value, dimension, system)
    except UnitsError as error:
        raise ObjectError(str(error)) from None


def number_pair(name: str, value: Iterable[float]) -> tuple[float, float]:
    """Return the two numbers of a parameter; raise ObjectError if it has no two numbers."""
    try:
        x, y = map(float, value)
    except (TypeError, ValueError):
        raise ObjectError(f"`{name}` is {value!r}, not two numbers") from None
    return x, y


def lengths_in_units(
    name: str, values: Iterable[float | str], count: int, system: str | None
) -> list[float]:
    """Return the lengths of a parameter, each a number or one with a unit, in a system of units.

    Raises ObjectError if the parameter does not have `count` lengths.
    """
    items: list[float | str] = []
    with suppress(TypeError):  # not a sequence
        items = [] if isinstance(values, str) else list(values)
    lengths = [parameter_in_units(name, item, "length", system) for item in items]
    numbers = [float(length) for length in lengths if length is not None]
    if not len(lengths) == len(numbers) == count:
        raise ObjectError(f"`{name}` is {values!r}, not {count} numbers")
    return numbers


def projectile_in_units(projectile: DeckProjectile | str, system: str | None) -> DeckProjectile:
    """Return a projectile; the text of a mass, as in ``5.5kg``, gives a rigid mass.

    Raises ObjectError if the mass is not positive, or its unit can't be converted.
    """
    if isinstance(projectile, DeckProjectile):
        return projectile
    mass = parameter_in_units("projectile", projectile, MASS, system)
    check_positive(projectile=mass)
    assert mass is not None  # the projectile is not
    return RigidMass(mass)
