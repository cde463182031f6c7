"""Failure criteria of a result, and the plies or interfaces that they belong to, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fecm.mechanics.failure import CRITERIA

INTERLAMINAR = "interlaminar"  # criterion of the interfaces; the others belong to plies
ALL_CRITERIA = (*CRITERIA, INTERLAMINAR)


OWN_CRITERIA = "own_criteria"  # attribute of failure: names of users' criteria of the plies


def criteria_of(failure: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the criteria of a result, from the attributes of its group ``failure``."""
    own = failure.get(OWN_CRITERIA, ())
    return (*ALL_CRITERIA, *(map(str, own) if isinstance(own, list | tuple) else ()))


def spelt(criterion: str) -> str:
    """Name of a criterion in words."""
    return criterion.replace("_", " ")


def where(criterion: str, ply: int) -> str:
    """A ply, or of the interlaminar criterion an interface, in words."""
    if criterion == INTERLAMINAR:
        return f"interface of plies {ply} and {ply + 1}"
    return f"ply {ply}"


def plies_of(criterion: str, ply: int) -> str:
    """The ply, or the plies of the interface, in words."""
    return f"plies {ply} and {ply + 1}" if criterion == INTERLAMINAR else f"ply {ply}"
