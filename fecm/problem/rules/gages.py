"""Rules about strain gages."""

from __future__ import annotations

import math

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, reports, rule
from fecm.deck.units import unit_names
from fecm.mechanics.points import containing_elements
from fecm.problem.problem import Problem
from fecm.problem.rules.laminate import are_like_radians
from fecm.problem.rules.units import USED, needed_unit

# Each gage is compared with every element.
MOST_GAGES = 10_000
MOST_GAGE_PAIRS = 10**8
SHALLOW = 0.01  # distance from the mid-plane over the thickness that no gage has


@reports("E012")
def too_many_gages(problem: Problem) -> Reports:
    """Report more gages than can be located in reasonable time."""
    segment, elements = problem.deck.require(model.Gages), len(problem.mesh.elements)
    count = len(segment.records)
    if count > MOST_GAGES or count * elements > MOST_GAGE_PAIRS:
        most = f"{MOST_GAGES} gages and {MOST_GAGE_PAIRS:.0e} pairs of gage and element are allowed"
        message = f"{count} gages on {elements} elements are too many: at most {most}."
        yield Report(message, segment.place())


@rule("E425", Subject.POINTS)
def repeated_gage(problem: Problem) -> Reports:
    """A gage is defined twice.

    Remedy: Its own number for each gage.
    """
    seen: set[int] = set()
    for record in problem.deck.require(model.Gages).records:
        if record.number in seen:
            message = f"Gage {record.number} is defined twice."
            yield Report(message, record.place("gage"), "give each gage its own number")
        seen.add(record.number)


@rule("E424", Subject.POINTS)
def gage_off_the_plate(problem: Problem) -> Reports:
    """A gage is not on the plate.

    Remedy: Correct its place.
    """
    for record in problem.deck.require(model.Gages).records:
        point = np.array([[record.x, record.y]])
        if not any(len(containing_elements(family, point)[0]) for family in problem.mesh.families):
            message = f"Gage {record.number} at ({record.x:g}, {record.y:g}) is not on the plate."
            yield Report(message, record.place("gage's x"))


@rule("W426", Subject.POINTS)
def gage_outside_laminate(problem: Problem) -> Reports:
    """A gage is outside the laminate.

    Remedy: z from -h/2 to h/2.
    """
    half = max(laminate.thickness for laminate in problem.plate.laminates) / 2.0
    for record in problem.deck.require(model.Gages).records:
        if abs(record.z) > half * (1.0 + 1e-9):
            what = f"Gage {record.number} at z = {record.z:g} is outside the laminate"
            message = f"{what}, whose faces are at {half:g} from the mid-plane."
            yield Report(message, record.place("gage's z"))


@rule("W452", Subject.POINTS)
def gage_under_force(problem: Problem, segment: model.Gages) -> Reports:
    """A gage is nearer than the thickness to the impact node.

    Strains under a point force depend on the mesh.

    Remedy: Another place, or PATC.
    """
    x, y = problem.mesh.coordinates[problem.deck.require(model.Impact).node - 1]
    for record in segment.records:
        distance = float(np.hypot(record.x - x, record.y - y))
        if distance < problem.laminate.thickness * (1.0 - 1e-9):
            what = f"Gage {record.number} is {distance:.3g} from the impact node"
            why = "strains at the impact node of a point force depend on the mesh"
            hint = (
                f"put it at least the thickness {problem.laminate.thickness:.3g} away, or give the "
                "contact force an area by a PATC segment"
            )
            yield Report(f"{what}: {why}.", record.place("gage's x"), hint)


@rule("W477", Subject.POINTS)
def shallow_gage(problem: Problem, segment: model.Gages) -> Reports:
    """A gage is almost in the mid-plane.

    It is nearer than h/100, but not in it.

    Remedy: z in the deck's unit of length.
    """
    thickness, names = problem.laminate.thickness, unit_names(problem.deck)
    shallow = [r for r in segment.records if 0.0 < abs(r.z) < SHALLOW * thickness]
    if not shallow:
        return
    first = shallow[0]
    more = f" (and {len(shallow) - 1} more)" if len(shallow) > 1 else ""
    message = (
        f"Gage {first.number}{more} at z = {first.z:g} is almost in the mid-plane; the faces "
        f"are at {thickness / 2.0:g}"
    )
    for unit, factor in USED["length"].items():
        inside = abs(first.z) * factor / USED["length"].get(names.get("length", ""), math.inf)
        if 0.25 * thickness <= inside <= 0.51 * thickness:
            message += f"; z looks like {unit}; {needed_unit('length', names)}"
    yield Report(f"{message}.", first.place("gage's z"), "0 is the mid-plane itself")


@rule("W478", Subject.POINTS)
def directions_in_radians(problem: Problem, segment: model.Gages) -> Reports:
    """The directions of all gages are multiples of 5° in radians.

    Remedy: Degrees.
    """
    turned = [record for record in segment.records if record.direction]
    if turned and are_like_radians([record.direction for record in turned]):
        first = turned[0]
        message = (
            f"The direction {first.direction:g} of gage {first.number} looks like radians: "
            f"{math.degrees(first.direction):.0f} degrees."
        )
        yield Report(message, first.place("gage's direction"), "directions are in degrees")


OF_COUNT = (too_many_gages,)
OF_GAGES = (repeated_gage, gage_off_the_plate, gage_outside_laminate)
OF_POINT_FORCE = (gage_under_force,)
VALUES = (shallow_gage, directions_in_radians)
