"""Names of a deck's units, for output and axes; nothing is ever converted."""

from __future__ import annotations

import re

from fecm.deck.model import Deck, Units

# Units that are known by name, in m, N and s.
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
MASS = "force*time^2/length"
MODULUS = "force/length^2"
TOUGHNESS = "force/length"
DENSITY = "force*time^2/length^4"


def unit_names(deck: Deck) -> dict[str, str]:
    """Names of the units of length, force and time; empty where the deck gives none."""
    units = deck.last(Units)
    return {} if units is None else {name: getattr(units, name) for name in Units.NAMES}


def unit_of(dimension: str, names: dict[str, str]) -> str:
    """Unit of a dimension: ``lbf/in`` of ``force/length``; empty without names or dimension."""
    if not names or not dimension:
        return ""
    return re.sub(r"length|force|time", lambda match: names[match[0]], dimension)


def in_si(dimension: str, names: dict[str, str]) -> float | None:
    """One unit of a physical dimension, such as ``force*time^2/length^4``, in m, N and s.

    The dimension has at most one division.  None where the deck names no units, or one that is not
    in :data:`KNOWN`.
    """
    value = 1.0
    for sign, product in zip((1.0, -1.0), dimension.split("/"), strict=False):
        for term in product.split("*"):
            word, _, power = term.partition("^")
            if (unit := KNOWN[word].get(names.get(word, ""))) is None:
                return None
            value *= unit ** (sign * float(power or 1))
    return value


def mass_in_si(mass: float, names: dict[str, str]) -> str:
    """A mass in t where the deck's unit of mass is the tonne, otherwise in kg; may be empty."""
    if (unit := in_si(MASS, names)) is None:
        return ""
    tonnes = abs(unit / 1e3 - 1.0) < 1e-9
    return f"{mass:.4g} t" if tonnes else f"{mass * unit:.4g} kg"
