"""Names of a deck's units, for output and axes; nothing is ever converted."""

from __future__ import annotations

import re

from fecm.deck.model import Deck, Units


def unit_names(deck: Deck) -> dict[str, str]:
    """Names of the units of length, force and time; empty where the deck gives none."""
    units = deck.last(Units)
    if units is None:
        return {}
    return {"length": units.length, "force": units.force, "time": units.time}


def unit_of(dimension: str, names: dict[str, str]) -> str:
    """Unit of a physical dimension: ``force/length`` in lbf and in is ``lbf/in``.

    Parameters
    ----------
    dimension : str
        Written with the words length, force and time.
    names : dict
        As :func:`unit_names` gives them.

    Returns
    -------
    str
        Empty where the deck names no units or the dimension is none.
    """
    if not names or not dimension:
        return ""
    return re.sub(r"length|force|time", lambda match: names[match[0]], dimension)
