"""Consistent systems of units, by names such as ``mm-N-s`` and ``mm-ms-kg``."""

from __future__ import annotations

import math
from functools import lru_cache

from fecm._errors import FecmError
from fecm.deck.model import Units
from fecm.deck.units import KNOWN, in_si

# Systems that help and completion name; any other of known units is accepted.
NAMES = ("in-lbf-s", "m-N-s", "mm-N-s", "mm-kN-ms", "mm-N-ms")
# Units of mass in kg, from which the unit of force may follow.
MASSES = {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "t": 1e3, "tonne": 1e3}
FORM = "length, force and time, as in mm-N-s, or length, time and mass, as in mm-ms-kg"


class UnitsError(FecmError, ValueError):
    """A name is not that of a consistent system of units."""


@lru_cache
def system_named(name: str) -> str:
    """Name of a system as length, force and time, whose parts may be given in any order.

    Raises
    ------
    UnitsError
        If a unit is unknown or missing, or force and mass do not belong together.

    Examples
    --------
    >>> system_named("g-mm-ms"), system_named("kg-mm-ms"), system_named("t-mm-s")
    ('mm-N-ms', 'mm-kN-ms', 'mm-N-s')
    """
    own: dict[str, str] = {}
    kinds = {**KNOWN, "mass": MASSES}
    for unit in name.split("-"):
        kind = next((kind for kind, known in kinds.items() if unit in known), "")
        if not kind or kind in own:
            raise UnitsError(f"{name!r} is not a system of units: name {FORM}")
        own[kind] = unit
    if not {"length", "time"} <= own.keys() or not {"force", "mass"} & own.keys():
        raise UnitsError(f"{name!r} is not a whole system of units: name {FORM}")
    if "mass" in own:
        said = f"the force of {own['mass']}, {own['length']} and {own['time']}"
        implied = force_of(own["mass"], own["length"], own["time"])
        if not implied:
            raise UnitsError(f"{name!r}: {said} is not one of {', '.join(KNOWN['force'])}")
        if own.setdefault("force", implied) != implied:
            raise UnitsError(f"{name!r} is not consistent: {said} is {implied}")
    return "-".join(own[kind] for kind in Units.NAMES)


def force_of(mass: str, length: str, time: str) -> str:
    """Unit of force that accelerates a unit of mass by a unit of length over time squared.

    Empty if it has no name, or a unit is unknown.
    """
    if mass not in MASSES or length not in KNOWN["length"] or time not in KNOWN["time"]:
        return ""
    newton = MASSES[mass] * KNOWN["length"][length] / KNOWN["time"][time] ** 2
    same = (name for name, size in KNOWN["force"].items() if math.isclose(size, newton))
    return next(same, "")


def units_of(system: str) -> dict[str, str]:
    """Names of the units of length, force and time of a system."""
    return dict(zip(Units.NAMES, system_named(system).split("-"), strict=True))


def convert(value: float, dimension: str, system: str, other: str) -> float:
    """A value in another system of units, with as many digits as the field of a card has."""
    before, after = in_si(dimension, units_of(system)), in_si(dimension, units_of(other))
    if before is None or after is None:
        raise LookupError(f"no unit of {dimension}")
    return value if before == after else float(f"{value * (before / after):.6g}")
