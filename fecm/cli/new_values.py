"""Parsers of the options of ``fecm new``. ValueError says what is wrong."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import click

from fecm.authoring.contact import Sphere
from fecm.authoring.deck_options import EQUI
from fecm.authoring.elastic_edges import check_support
from fecm.authoring.masses import PlacedMass
from fecm.authoring.plate import MOST
from fecm.authoring.zones import Zone
from fecm.cli.options import POSITIVE, Finite, assignment, list_of
from fecm.deck.catalogue import CONTACTS, NamedContact
from fecm.deck.layup import parse_plies
from fecm.deck.macros import RowsOfPlies
from fecm.deck.model import Ply
from fecm.mechanics.projectile import DeckProjectile, RigidMass, Rod

ESTIMATE = "estimate:RADIUS[,ES,NUS]"

# Values of each kind of projectile, and what makes it of them.
PROJECTILES: dict[str, tuple[str, Callable[..., DeckProjectile]]] = {
    "mass": ("M", RigidMass),
    "rod": ("LENGTH,DIAMETER,E,DENSITY", Rod.cylinder),
}
PROJECTILE_FORMS = " or ".join(f"{kind}:{form}" for kind, (form, _) in PROJECTILES.items())


def projectile(text: str) -> DeckProjectile:
    """Parse a projectile by its kind and its values."""
    kind, _, values = text.partition(":")
    if kind not in PROJECTILES:
        raise ValueError(f"{text!r} is not {PROJECTILE_FORMS}")
    form, made_of = PROJECTILES[kind]
    return made_of(*list_of(f"{kind}:{form}", Finite(), [form.count(",") + 1])(values))


def contact(text: str) -> NamedContact | Sphere:
    """Parse a named contact, or a sphere whose k is estimated."""
    word, _, values = text.partition(":")
    if word == "estimate":
        return Sphere(*(list_of(ESTIMATE, POSITIVE, [1, 3])(values) if values else ()))
    if text not in CONTACTS:
        raise ValueError(f"{text!r} is not one of {', '.join(CONTACTS)}, {ESTIMATE}")
    return CONTACTS[text]


def support(text: str) -> str:
    """Check the support of all edges: a name, or springs."""
    check_support("support", text)
    return text


def edge(text: str) -> tuple[str, str]:
    """Parse the name of an edge or a group and its support; ``spring:KR,KW`` has a comma."""
    name, support = assignment(text)
    check_support(name, support)
    return name, support


def mass_at(text: str) -> PlacedMass:
    """Parse the place of a point mass, the mass, and perhaps its rotary inertia."""
    place, colon, values = text.partition(":")
    texts = *place.split(","), *values.split(",")
    if not colon or place.count(",") != 1 or len(texts) not in (3, 4) or not all(texts):
        raise ValueError(f"{text!r} is not X,Y:M[,J], as in 20,30:5g")
    return texts


def mesh_of_text(text: str) -> tuple[int, int] | Path:
    """Parse numbers of elements, or the file of a mesh."""
    if re.fullmatch(r"[\s\d.+-]+[xX×][\s\d.+-]+", text):
        counts = list_of("14x10", click.IntRange(1, MOST), [2], "[xX×]")(text)
        return counts[0], counts[1]
    path = Path(text)
    if not path.suffix and not path.exists():
        raise ValueError(f"{text!r} is not NXxNY, as in 14x10, or the file of a mesh")
    return path


def ply_of(text: str) -> tuple[str, Ply]:
    """Parse name and constants of a material."""
    name, equals, values = text.partition("=")
    if not (name and equals):
        raise ValueError(f"{text!r} is not NAME=RHO,NU12,E1,E2,G12,G13,G23")
    return name, Ply(*list_of("RHO,NU12,E1,E2,G12,G13,G23", Finite(), [7])(values))


def core(text: str) -> tuple[str, float]:
    """Parse name and thickness of a core."""
    name, _, thickness = text.rpartition(":")
    if not name:
        raise ValueError(f"{text!r} is not NAME:T, as in Divinycell-H60:10")
    return name, float(POSITIVE.convert(thickness, None, None))


def zone(text: str) -> Zone:
    """Parse the rectangle or group of a zone, and its layup."""
    place, _, layup = text.rpartition(":")
    if not place:
        raise ValueError(f"{text!r} is not X0,Y0,X1,Y1:LAYUP or GROUP:LAYUP")
    plies = parse_plies(layup)
    if place.count(",") != 3:
        return place, plies
    return list_of("X0,Y0,X1,Y1", Finite(), [4])(place), plies


def rows_of_plies(text: str) -> RowsOfPlies:
    """Parse the steps between rows of ply stresses, and perhaps the number of elements."""
    steps, *elements = list_of("N[,M]", click.IntRange(min=0), [1, 2])(text)
    return (steps, elements[0]) if elements else steps or False


def shear_factor(text: str) -> float | str:
    """Parse a factor, or the word for the stiffness from equilibrium."""
    try:
        return text if text == EQUI else float(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a number or {EQUI}") from None
