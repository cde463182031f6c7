"""Limits of quantities: what a search reaches, and what random values may exceed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from fecm.sweeps.case import CasesError, number

THRESHOLD = "threshold"  # instead of a number: the delamination threshold
PEAK_FORCE = "peak_force"
NO_THRESHOLD = (
    "the threshold needs a DELA segment and a plate without a core, which the deck does not have"
)


class Limit(NamedTuple):
    """A quantity whose probability of exceedance is asked for, and its limit."""

    quantity: str
    value: float | str  # a number or :data:`THRESHOLD`


def parse_exceed(text: str) -> Limit:
    """Read ``QUANTITY=NUMBER`` or ``peak_force=threshold``; CasesError if it is neither."""
    name, _, value = (part.strip() for part in text.partition("="))
    if not name or not value or (value == THRESHOLD and name != PEAK_FORCE):
        raise CasesError(f"`{text}`: write QUANTITY=NUMBER or {PEAK_FORCE}={THRESHOLD}")
    return Limit(name, value if value == THRESHOLD else number(name, value))


def check_limits(limits: Sequence[Limit], known: Sequence[str], *, threshold: bool) -> None:
    """Raise CasesError if a quantity is not among the known ones, or the deck has no threshold."""
    for limit in limits:
        if limit.quantity not in known:
            names = ", ".join(known)
            raise CasesError(f"there is no quantity `{limit.quantity}`; there are {names}")
        if limit.value == THRESHOLD and not threshold:
            raise CasesError(NO_THRESHOLD)
