"""What ``fecm new --fixture`` takes from a fixture, and from the standard of its test."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import click

from fecm.api import load_deck
from fecm.cli.types import POSITIVE, ListOf
from fecm.deck.catalogue import CONTACTS, NamedContact, convert
from fecm.deck.model import Deck, Indentation, Patch, Projectile
from fecm.deck.records import Ply
from fecm.deck.units import MODULUS
from fecm.mechanics.contact_law import hertz_coefficient
from fecm.mechanics.patch import HERTZ
from fecm.problem.build import build_projectile
from fecm.problem.fixture import DropWeight, Fixture
from fecm.studies import StudyError
from fecm.studies.estimate import static_stiffness
from fecm.studies.indentation_test.modulus import effective_stiffness, indentation_modulus

# Options that a fixture sets.
REPLACED = ("size", "columns", "rows", "support", "edges")
# Elements of the window where --mesh does not give them, and their grading.
MESH, GRADING = (20, 12), 3.0
# Simulated time over half a period of the projectile on the plate's static stiffness.
CONTACT_TIMES = 1.25
ESTIMATE = "estimate:RADIUS[,ES,NUS]"
# Units of the standards.
UNITS = "mm-N-s"
# Young's modulus (MPa) and Poisson's ratio of steel.
E_S, NU_S = 207e3, 0.3


@dataclass(frozen=True)
class Sphere:
    """Elastic contact of a sphere, its k estimated from the ply's constants.

    Attributes
    ----------
    radius : float or None
        None where a standard prescribes it.
    e_s, nu_s : float or None
        Elastic constants; None for steel.
    """

    radius: float | None = None
    e_s: float | None = None
    nu_s: float | None = None

    def law(
        self, ply: Ply, layup: Sequence[float], nu23: float, system: str | None
    ) -> tuple[Indentation, str]:
        """Law of contact, and comment lines of the deck which say how k was computed."""
        if self.radius is None:
            raise click.UsageError(f"--contact estimate needs the sphere: {ESTIMATE}")
        if self.e_s is None and system is None:
            raise click.UsageError(
                "--contact estimate with --ply needs --units, or the sphere's elastic constants: "
                f"{ESTIMATE}"
            )
        e_s = self.e_s or convert(E_S, MODULUS, UNITS, system or UNITS)
        nu_s = NU_S if self.nu_s is None else self.nu_s
        try:
            stiffness = effective_stiffness(ply, layup, [1.0] * len(layup), nu23)
            modulus = indentation_modulus(stiffness)
            k = float(f"{hertz_coefficient(self.radius, e_s, nu_s, modulus):.6g}")
        except (StudyError, ValueError, ArithmeticError) as error:
            raise click.UsageError(f"k cannot be estimated: {error}; give --law") from None
        return Indentation(k, 0.0, 0.0, 1.5), (
            "! k of EXPE is estimated by the laminate's indentation modulus "
            f"{modulus:.5g}: a sphere of radius {self.radius:g},\n"
            f"! E {e_s:g} and nu {nu_s:g}; nu23 of the ply {nu23:g}.  A measured k may be larger; "
            "the law is elastic.\n"
        )


def parse_contact(text: str) -> NamedContact | Sphere:
    """Named contact, or a sphere whose k is estimated.

    Raises
    ------
    ValueError
        If the text is neither.
    """
    word, _, values = text.partition(":")
    if word == "estimate":
        parts = ListOf(ESTIMATE, POSITIVE, [1, 3])(values) if values else ()
        return Sphere(*parts)
    if text not in CONTACTS:
        raise ValueError(f"{text!r} is none of {', '.join(CONTACTS)}, {ESTIMATE}")
    return CONTACTS[text]


def complete(options: dict[str, Any], given: Collection[str]) -> list[str]:
    """Fill in the options of ``fecm new`` that a fixture sets; return notes about them.

    Parameters
    ----------
    options : dict
        Values of the options, changed in place.
    given : collection of str
        Names of those on the command line.
    """
    fixture: Fixture = options["fixture"]
    for name in REPLACED:
        if name in given:
            word = "edge" if name == "edges" else name
            raise click.UsageError(f"--fixture has its own plate and supports; leave out --{word}")
    options["size"] = fixture.window
    if options["mesh"] is None:
        options["mesh"] = MESH
        if "grading" not in given:
            options["grading"] = GRADING
    return [] if fixture.test is None else _prescribe(fixture, fixture.test, options, given)


def _prescribe(
    fixture: Fixture, test: DropWeight, options: dict[str, Any], given: Collection[str]
) -> list[str]:
    """Fill in what the standard of a test prescribes."""
    if options["units"] not in (None, UNITS):
        raise click.UsageError(f"--fixture {fixture.name} is in {UNITS}; leave out --units")
    options["units"] = UNITS
    thickness = len(options["layup"]) * options["ply_thickness"]
    notes: list[str] = []
    if not test.thinnest <= round(thickness, 9) <= test.thickest:
        notes.append(
            f"warning: {fixture.name} is for laminates of {test.thinnest:g} to {test.thickest:g} "
            f"mm; this one has {thickness:.4g} mm"
        )
    if options["projectile"] is None:
        options["projectile"] = Projectile(0, 0, test.mass)
    if "patch" not in given:
        options["patch"] = Patch(HERTZ)
    if options["velocity"] is None and options["energy"] is None:
        energy = options["energy"] = test.energy * thickness
        notes.append(
            f"the energy is {energy / 1000.0:.4g} J, {test.energy / 1000.0:g} J per mm of thickness"
        )
    if options["law"] is None and options["contact"] in (None, Sphere()):
        options["contact"] = Sphere(test.radius)
    return notes


def duration_of(deck: Deck) -> float:
    """Simulated time for a deck: longer than half a period of projectile and static plate.

    That of a deck with errors, which is refused later, is 1.
    """
    loaded = load_deck(deck.to_text())
    if loaded.errors():
        return 1.0
    (problem,) = loaded.problems
    assert problem.contact is not None
    stiffness = static_stiffness(problem.moving_plate, problem.contact)
    half = math.pi * math.sqrt(build_projectile(deck).total_mass / stiffness)
    return float(f"{CONTACT_TIMES * half:.2g}")
