"""The proportional load: FORC's factor as a function of the clock (the listing's PROPLD)."""

from __future__ import annotations

import math

from fecm.deck.records import LoadTable


def load_factor(table: LoadTable, clock: float) -> float:
    """A1 + A2 t + A3 sin(A4 t + A5)^L between t_min and t_max, 0 outside.

    Parameters
    ----------
    table : LoadTable
        The card's values; an exponent L below 1 counts as 1.
    clock : float
        Time of the TIME macro.
    """
    if not table.begin <= clock <= table.end:
        return 0.0
    a1, a2, a3, a4, a5 = table.constants
    wave = math.sin(a4 * clock + a5)
    return a1 + a2 * clock + a3 * wave ** max(table.exponent, 1)
