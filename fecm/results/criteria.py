"""Failure criteria of a result, and the plies or interfaces that they belong to, in words."""

from __future__ import annotations

from fecm.mechanics.failure import CRITERIA

INTERLAMINAR = "interlaminar"  # criterion of the interfaces; the others belong to plies
ALL_CRITERIA = (*CRITERIA, INTERLAMINAR)


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
