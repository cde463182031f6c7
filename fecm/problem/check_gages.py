"""Checks of strain gages."""

from __future__ import annotations

import math

import numpy as np

from fecm.deck import model
from fecm.deck.findings import Findings
from fecm.deck.units import unit_names
from fecm.mechanics.mesh import Mesh, element_blocks
from fecm.mechanics.points import locate
from fecm.problem.build import Problem
from fecm.problem.check_plausibility import are_like_radians
from fecm.problem.check_units import USED, needed_unit

MOST_GAGES, MOST_GAGE_PAIRS = 10_000, 10**8  # each gage is compared with every element
SHALLOW = 0.01  # distance from the mid-plane over the thickness that no gage has


def check_gages(segment: model.Gages, mesh: Mesh, deck: model.Deck, findings: Findings) -> None:
    """Check a GAGE segment on a mesh without errors."""
    count = len(segment.records)
    if count > MOST_GAGES or count * len(mesh.elements) > MOST_GAGE_PAIRS:
        most = f"{MOST_GAGES} gages and {MOST_GAGE_PAIRS:.0e} pairs of gage and element are allowed"
        message = f"{count} gages on {len(mesh.elements)} elements are too many: at most {most}."
        findings.add("E012", message, segment.place())
        return
    families = element_blocks(mesh.elements, mesh.coordinates)
    seen: set[int] = set()
    for record in segment.records:
        if record.number in seen:
            message = f"Gage {record.number} is defined twice."
            findings.add("E425", message, record.place("gage"), "give each gage its own number")
        seen.add(record.number)
        point = np.array([[record.x, record.y]])
        if not any(len(locate(family, point)[0]) for family in families):
            message = f"Gage {record.number} at ({record.x:g}, {record.y:g}) is not on the plate."
            findings.add("E424", message, record.place("gage's x"))
        half = deck.require(model.Material).integration.thickness / 2.0
        if abs(record.z) > half * (1.0 + 1e-9):
            what = f"Gage {record.number} at z = {record.z:g} is outside the laminate"
            message = f"{what}, whose faces are at {half:g} from the mid-plane."
            findings.add("W426", message, record.place("gage's z"))


def check_gages_under_force(problem: Problem, findings: Findings) -> None:
    """Warn of gages nearer than the thickness to the impact node of a point force."""
    segment = problem.deck.last(model.Gages)
    if segment is None or problem.deck.has(model.Patch):
        return
    x, y = problem.mesh.coordinates[problem.deck.require(model.Impact).node - 1]
    for record in segment.records:
        distance = float(np.hypot(record.x - x, record.y - y))
        if distance < problem.laminate.thickness * (1.0 - 1e-9):
            what = f"Gage {record.number} is {distance:.3g} from the impact node"
            why = "strains at the impact node of a point force depend on the mesh"
            hint = f"put it at least the thickness {problem.laminate.thickness:.3g} away"
            hint += ", or give the contact force an area by a PATC segment"
            findings.add("W452", f"{what}: {why}.", record.place("gage's x"), hint)


def check_gage_places(problem: Problem, findings: Findings) -> None:
    """Warn of gages just beside the mid-plane, and of directions in radians."""
    segment = problem.deck.last(model.Gages)
    if segment is None:
        return
    thickness, names = problem.laminate.thickness, unit_names(problem.deck)
    shallow = [r for r in segment.records if 0.0 < abs(r.z) < SHALLOW * thickness]
    if shallow:
        first = shallow[0]
        others = f" (and {len(shallow) - 1} more)" if len(shallow) > 1 else ""
        message = (
            f"Gage {first.number}{others} at z = {first.z:g} is almost in the mid-plane; the faces "
            f"are at {thickness / 2.0:g}"
        )
        for unit, factor in USED["length"].items():
            inside = abs(first.z) * factor / USED["length"].get(names.get("length", ""), math.inf)
            if 0.25 * thickness <= inside <= 0.51 * thickness:
                message += f"; z looks like {unit}; {needed_unit('length', names)}"
        findings.add("W477", f"{message}.", first.place("gage's z"), "0 is the mid-plane itself")
    turned = [record for record in segment.records if record.direction]
    if turned and are_like_radians([record.direction for record in turned]):
        first = turned[0]
        message = (
            f"The direction {first.direction:g} of gage {first.number} looks like radians: "
            f"{math.degrees(first.direction):.0f} degrees."
        )
        findings.add("W478", message, first.place("gage's direction"), "directions are in degrees")
