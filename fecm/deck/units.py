"""Systems of units with names such as ``mm-N-s``, and names of units for output and axes.

The numbers of a deck are never converted. Text and pictures show masses in g and energies in J if
the units of the deck differ from these by powers of ten.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from fecm._errors import FecmError
from fecm._text import DIGITS, printable, significant
from fecm.deck.model import Deck, Units

# Known units, in m, N and s.
KNOWN = {
    "length": {
        "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6,
        "in": 0.0254, "inch": 0.0254, "ft": 0.3048,
    },
    "force": {
        "N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "kgf": 9.80665,
        "lb": 4.4482216152605, "lbf": 4.4482216152605, "kip": 4448.2216152605,
    },
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6},
}  # fmt: skip
# Units that take prefixes, with their base unit and power of ten.
PREFIXED = {
    "s": ("s", 0), "ms": ("s", -3), "us": ("s", -6), "µs": ("s", -6),
    "m": ("m", 0), "mm": ("m", -3), "N": ("N", 0), "kN": ("N", 3), "J": ("J", 0),
    "N*m": ("J", 0), "N*mm": ("J", -3), "kN*mm": ("J", 0), "kN*m": ("J", 3),
    "N*s^2/m": ("g", 3), "N*s^2/mm": ("g", 6), "kN*s^2/m": ("g", 6), "kN*s^2/mm": ("g", 9),
    "N*ms^2/mm": ("g", 0), "kN*ms^2/mm": ("g", 3),
}  # fmt: skip
PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Dimensions.
MASS = "force*time^2/length"
INERTIA = "force*length*time^2"  # of rotation
MODULUS = "force/length^2"
TOUGHNESS = "force/length"
DENSITY = "force*time^2/length^4"
VELOCITY = "length/time"
COEFFICIENT = "force/length^1.5"  # of Hertz's law
# Units of products and quotients that have their own names, in m, N and s.
NAMED = {
    "force*length": {"J": 1.0, "mJ": 1e-3, "kJ": 1e3},
    MASS: {"kg": 1.0, "g": 1e-3, "t": 1e3},
    MODULUS: {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    TOUGHNESS: {"J/m^2": 1.0, "kJ/m^2": 1e3},
    DENSITY: {"kg/m^3": 1.0, "g/cm^3": 1e3, "t/m^3": 1e3},
}


def unit_names(deck: Deck) -> dict[str, str]:
    """Return the names of the units of length, force and time; empty if the deck has no units.

    A known unit gets its usual name, whatever its capitals: MM is mm.
    """
    units = deck.last(Units)
    return {} if units is None else {n: _usual_name(n, getattr(units, n)) for n in Units.NAMES}


def _usual_name(dimension: str, name: str) -> str:
    """Return the usual name of a unit; the name itself if only its capitals tell two apart."""
    alike = [unit for unit in KNOWN[dimension] if unit.casefold() == name.casefold()]
    return alike[0] if len(alike) == 1 and name not in KNOWN[dimension] else name


def declared_units(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Return the names of the units of length, force and time in the attributes of a result."""
    names = {name: str(attributes.get(f"unit_{name}", "")) for name in Units.NAMES}
    return names if all(names.values()) else {}


def unit_of(dimension: str, names: dict[str, str]) -> str:
    """Return the unit of a dimension: ``lbf/in`` for ``force/length``; empty without names."""
    if not names or not dimension:
        return ""
    return re.sub(r"length|force|time", lambda match: names[match[0]], dimension)


# A unit or a dimension, and the columns that have it.
_OF_COLUMNS = re.compile(r"(\S+) \(([^)]*)\)")


def units_of_columns(unit: str, columns: Sequence[str]) -> list[str]:
    """Return the unit of each column of an array; empty if one unit holds for all.

    Examples
    --------
    >>> units_of_columns("mm (u, w), 1 (theta_x)", ["u", "w", "theta_x"])
    ['mm', 'mm', '1']
    >>> units_of_columns("mm", ["x", "y"])
    []
    """
    units = {
        name: unit_of_some
        for unit_of_some, names in _OF_COLUMNS.findall(unit)
        for name in names.split(", ")
    }
    return [units[name] for name in columns] if units else []


def column_name(name: str, unit: str) -> str:
    """Return the heading of a column: ``force (N)``, or the name alone without a unit."""
    return f"{name} ({printable(short_name(unit))})" if unit else name


def short_name(unit: str) -> str:
    """Return the short name of a unit: t for the mass N*s^2/mm; other units as they are."""
    return with_prefix(unit, 0) if PREFIXED.get(unit, ("",))[0] == "g" else unit


def in_si(dimension: str, names: dict[str, str]) -> float | None:
    """Return the size in m, N and s of one unit of a dimension such as ``force*time^2/length^4``.

    The dimension has at most one division. Returns None if a name is missing or not in
    :data:`KNOWN`.
    """
    value = 1.0
    for sign, product in zip((1.0, -1.0), dimension.split("/"), strict=False):
        for term in product.split("*"):
            word, _, power = term.partition("^")
            if (unit := KNOWN[word].get(names.get(word, ""))) is None:
                return None
            value *= unit ** (sign * float(power or 1))
    return value


def unit_in_si(unit: str, dimension: str) -> float | None:
    """Return the size in m, N and s of a unit such as ``mm/s`` or ``J``; None if it is not valid.

    The dimension is a product or a quotient of powers of length, force and time.

    Examples
    --------
    >>> unit_in_si("N/mm", TOUGHNESS), unit_in_si("g/cm^3", DENSITY)
    (1000.0, 1000.0)
    """
    if (value := NAMED.get(dimension, {}).get(unit)) is not None:
        return value
    words, names = re.split(r"([*/])", dimension), re.split(r"([*/])", unit.replace(" ", ""))
    if len(words) != len(names) or words[1::2] != names[1::2]:
        return None
    pairs = [
        (*word.partition("^")[::2], *name.partition("^")[::2])
        for word, name in zip(words[::2], names[::2], strict=True)
    ]
    if any(power != given for _, power, _, given in pairs):
        return None
    return in_si(dimension, {word: name for word, _, name, _ in pairs})


def thousands(value: float) -> int:
    """Return the power of ten, a multiple of 3, that scales a positive value to 1 to 1000."""
    return 3 * math.floor(math.log10(value) / 3.0)


def with_prefix(unit: str, power: int) -> str:
    """Return the name of 10^power units: kN for 10^3 N. The text is empty if no prefix fits."""
    base, power_of_unit = PREFIXED.get(unit, ("", 0))
    if not base or power + power_of_unit not in PREFIXES:
        return ""
    name = PREFIXES[power + power_of_unit] + base
    return "t" if name == "Mg" else name


def quantity(value: float, unit: str, digits: int = DIGITS) -> str:
    """Format a value with its unit: 20 g for 2e-05 N*s^2/mm, 1.5 J for 1500 N*mm."""
    power, name = readable(value, unit, digits)
    return f"{significant(value / 10.0**power, digits)} {name}".rstrip()


def readable(value: float, unit: str, digits: int = DIGITS) -> tuple[int, str]:
    """Return the power of ten and the name of a convenient unit for a mass or an energy.

    For other quantities they are 0 and `unit`.
    """
    base, _ = PREFIXED.get(unit, ("", 0))
    if base in ("g", "J") and 0.0 < abs(value) < math.inf:
        power = thousands(float(f"{abs(value):.{digits}g}"))
        if name := with_prefix(unit, power):
            return power, name
    return 0, unit


def prefixed(value: float, unit: str, digits: int = DIGITS) -> str:
    """Format a value as :func:`quantity` does, with prefixes for times and forces too.

    Examples
    --------
    >>> prefixed(0.002695, "s"), prefixed(7752.0, "N"), prefixed(150.0, "mm"), prefixed(86.2, "lbf")
    ('2.695 ms', '7.752 kN', '150 mm', '86.2 lbf')
    """
    base, _ = PREFIXED.get(unit, ("", 0))
    if base not in ("s", "N") or not 0.0 < abs(value) < math.inf:
        return quantity(value, unit, digits)
    power = thousands(float(f"{abs(value):.{digits}g}"))
    name = with_prefix(unit, power)
    return f"{significant(value / 10.0**power, digits)} {name}" if name else quantity(value, unit)


def uncertain(value: float, error: float, unit: str = "") -> str:
    """Format a value with its uncertainty in units of the last digit, in brackets.

    The uncertainty has one digit, or two if they are less than 20. A value without a prefix of its
    unit has a power of ten instead.

    Examples
    --------
    >>> uncertain(52730.0, 710.0, "N/mm^1.5"), uncertain(7752.0, 101.0, "N"), uncertain(0.31, 0.02)
    ('52.7(7)·10³ N/mm^1.5', '7.75(10) kN', '0.31(2)')
    """
    if not (0.0 < error < math.inf and 0.0 < abs(value) < math.inf):
        return prefixed(value, unit)
    power = thousands(abs(value))
    base, _ = PREFIXED.get(unit, ("", 0))
    name = with_prefix(unit, power) if base in ("s", "N", "g", "J") else ""
    if not name:
        name, power = unit, power if power > 0 or power < -3 else 0
    size = error / 10.0**power
    first = math.floor(math.log10(float(f"{size:.2g}")))
    if float(f"{size:.2g}") < 2.0 * 10.0**first:
        first -= 1
    scale = max(0, -first)
    mantissa = f"{round(value / 10.0**power, -first):.{scale}f}"
    bracket = f"{round(size, -first) * 10.0**scale:.0f}"
    times = "" if name != unit or not power else f"·10{str(power).translate(SUPERSCRIPTS)}"
    return f"{mantissa}({bracket}){times} {name}".rstrip()


def mass_in_si(mass: float, names: dict[str, str]) -> str:
    """Format a mass in g, kg or t; empty if the units of the deck are not known."""
    unit = in_si(MASS, names)
    return "" if unit is None else quantity(mass * unit, "N*s^2/m")


# Systems in the help and the completion. Any other system of known units is accepted too.
NAMES = ("in-lbf-s", "m-N-s", "mm-N-s", "mm-kN-ms", "mm-N-ms")
# Units of mass in kg. A system may name the mass instead of the force.
MASSES = {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "t": 1e3, "tonne": 1e3}
FORM = "length, force and time, as in mm-N-s, or length, time and mass, as in mm-ms-kg"


class UnitsError(FecmError, ValueError):
    """A name is not a consistent system of units."""


@lru_cache
def system_named(name: str) -> str:
    """Return the name of a system as length, force and time; the argument may have any order.

    Raises
    ------
    UnitsError
        If a unit is unknown or missing, or force and mass do not belong together.

    Examples
    --------
    >>> system_named("g-mm-ms"), system_named("kg-mm-ms"), system_named("t-mm-s")
    ('mm-N-ms', 'mm-kN-ms', 'mm-N-s')
    """
    parts: dict[str, str] = {}
    kinds = {**KNOWN, "mass": MASSES}
    for unit in name.split("-"):
        kind = next((kind for kind, units in kinds.items() if unit in units), "")
        if not kind or kind in parts:
            raise UnitsError(f"{name!r} is not a system of units: name {FORM}")
        parts[kind] = unit
    if not {"length", "time"} <= parts.keys() or not {"force", "mass"} & parts.keys():
        raise UnitsError(f"{name!r} is not a whole system of units: name {FORM}")
    if "mass" in parts:
        force_text = f"the force of {parts['mass']}, {parts['length']} and {parts['time']}"
        implied = force_of(parts["mass"], parts["length"], parts["time"])
        if not implied:
            raise UnitsError(f"{name!r}: {force_text} is not one of {', '.join(KNOWN['force'])}")
        if parts.setdefault("force", implied) != implied:
            raise UnitsError(f"{name!r} is not consistent: {force_text} is {implied}")
    return "-".join(parts[kind] for kind in Units.NAMES)


def force_of(mass: str, length: str, time: str) -> str:
    """Return the unit of force that accelerates a unit of mass by length over time squared.

    Returns an empty text if the force has no name or a unit is unknown.
    """
    if mass not in MASSES or length not in KNOWN["length"] or time not in KNOWN["time"]:
        return ""
    newton = MASSES[mass] * KNOWN["length"][length] / KNOWN["time"][time] ** 2
    same = (name for name, size in KNOWN["force"].items() if math.isclose(size, newton))
    return next(same, "")


def units_of(system: str) -> dict[str, str]:
    """Return the names of the units of length, force and time of a system."""
    return dict(zip(Units.NAMES, system_named(system).split("-"), strict=True))


def convert(value: float, dimension: str, system: str, target: str) -> float:
    """Convert a value to another system of units, with the digits of a field of a card."""
    before, after = in_si(dimension, units_of(system)), in_si(dimension, units_of(target))
    if before is None or after is None:
        raise LookupError(f"no unit of {dimension}")
    return value if before == after else float(f"{value * (before / after):.6g}")
