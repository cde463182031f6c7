"""What ``fecm new --fixture`` takes from a fixture, and from the standard of its test."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

import click

from fecm.api import load_deck
from fecm.cli.laminate_options import ply_of_options
from fecm.deck.model import Deck, Patch, Projectile
from fecm.deck.records import Ply
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
# Units of the standards.
UNITS = "mm-N-s"
# Young's modulus (MPa) and Poisson's ratio of a standard's projectile, steel; nu23 of the ply.
E_S, NU_S, NU23 = 207e3, 0.3, 0.4


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
    if options["law"] is None and options["contact"] is None:
        ply = ply_of_options(options["ply"], options["material"], UNITS)
        options["law"] = (_coefficient(test, ply, options["layup"]), 0.0, 0.0, 1.5)
        notes.append(
            f"the law of contact is elastic, its k an estimate from the ply's constants for a "
            f"steel sphere of radius {test.radius:g} mm (fecm indent estimate); --law takes a "
            "measured one"
        )
    return notes


def _coefficient(test: DropWeight, ply: Ply, layup: Sequence[float]) -> float:
    """Contact coefficient of the standard's projectile by the laminate's indentation modulus."""
    try:
        stiffness = effective_stiffness(ply, layup, [1.0] * len(layup), NU23)
        modulus = indentation_modulus(stiffness)
        return float(f"{hertz_coefficient(test.radius, E_S, NU_S, modulus):.6g}")
    except (StudyError, ValueError, ArithmeticError) as error:
        raise click.UsageError(f"k cannot be estimated: {error}; give --law") from None


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
