"""Slips: differences between the report's printed program and its text or evident intent."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from fecm._errors import OptionsError

Mode = Literal["report", "listing"]
REPORT: Mode = "report"
LISTING: Mode = "listing"
MODES = (REPORT, LISTING)
# Each slip has a row on the errata page, docs/errata.md.
NAMES = (
    "target", "density", "rod-start", "reload", "jacobian", "station", "tapes", "g12",
    "shear-order", "time", "prop", "force-scale", "rod-force", "prop-contact", "counter",
    "small-stiffness", "rod-dt", "check-end",
)  # fmt: skip


def active_slips(mode: str = REPORT, single: Iterable[str] = ()) -> frozenset[str]:
    """Return the names of the active slips: single ones in report mode, all in listing mode.

    Raises OptionsError if the mode or a slip is unknown, or if single slips are passed in listing
    mode.
    """
    names = frozenset(single)
    if mode not in MODES:
        raise OptionsError(f"unknown mode {mode!r}; known are {', '.join(MODES)}")
    if unknown := sorted(names - set(NAMES)):
        raise OptionsError(f"unknown slip {unknown[0]!r}; known are {', '.join(NAMES)}")
    if mode == LISTING:
        if names:
            raise OptionsError("listing mode has every slip; single slips go with report mode")
        return frozenset(NAMES)
    return names


def refuse_on_nonlinear(slips: frozenset[str]) -> None:
    """Raise OptionsError if one of the slips needs a linear plate."""
    if "jacobian" in slips:
        raise OptionsError("the slip jacobian is for linear plates only, and the deck has NONL")


def mode_of(slips: frozenset[str]) -> str:
    """Return the mode of a result with these slips."""
    return LISTING if slips == frozenset(NAMES) else REPORT
