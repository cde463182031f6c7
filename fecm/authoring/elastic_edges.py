"""Elastic edges: the texts of their springs, and the stiffness in the units of a deck."""

from __future__ import annotations

from typing import NamedTuple

from fecm.authoring.parameters import ObjectError, is_finite, parameter_in_units
from fecm.deck.catalogue import STANDARD
from fecm.deck.grid import ON_SPRINGS, SUPPORTS, EdgeStiffness
from fecm.deck.units import MODULUS

SPRING = "spring"
FORM = f"{SPRING}:KR[,KW]"


class ElasticEdge(NamedTuple):
    """Springs along an edge, and what restrains it besides."""

    stiffness: EdgeStiffness
    restraint: str  # of fecm.deck.grid.RESTRAINTS


def is_elastic(support: object) -> bool:
    """Return whether the text of a support is one of springs."""
    return isinstance(support, str) and support.partition(":")[0] == SPRING


def elastic_edge(name: str, support: str, system: str | None) -> ElasticEdge:
    """Return the springs of the text ``spring:KR[,KW]`` in a system of units.

    KR is the moment per rotation across the edge and length, a force, and KW the force per length
    and deflection. Without KW the edge holds w and the rotation along it, as a simple support does.

    Raises ObjectError if the text has another form, or a value is negative.
    """
    values = support.partition(":")[2].split(",")
    if len(values) not in (1, 2) or not all(values):
        raise ObjectError(f"{name}={support}: springs are {FORM}, as in spring:1e4 or spring:0,10")
    dimensions = "force", MODULUS
    numbers = [
        parameter_in_units(f"{name}={support}", text, dimension, system)
        for text, dimension in zip(values, dimensions, strict=False)
    ]
    if not all(is_finite(number) and number >= 0.0 for number in numbers):
        raise ObjectError(f"{name}={support}: the stiffness of a spring is 0 or more")
    rotation, w = (float(number or 0.0) for number in [*numbers, 0.0][:2])
    return ElasticEdge(EdgeStiffness(w, rotation), "simple" if len(values) == 1 else ON_SPRINGS)


def check_support(name: str, support: object) -> None:
    """Raise ObjectError if a support of an edge or a group has neither a name nor springs."""
    if isinstance(support, str) and is_elastic(support):
        elastic_edge(name, support, STANDARD)  # any system: the texts are checked
    elif support not in SUPPORTS:
        raise ObjectError(f"{name}={support}: the supports are {', '.join(SUPPORTS)}, {FORM}")
