"""Places of an impact on a linear plate, and the response to a force at each.

The response is a sum of natural modes, the same for all places, and of a few Ritz vectors of the
load.  These are Lanczos vectors beside the modes.  The first is what the modes leave out of the
static displacement, so that the compliance is exact.  Ritz vectors move as modes do, and none is
faster than the mesh.  All move by the central differences of a run: with all modes the response is
that of the run.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fecm._typing import Bools, Floats
from fecm.authoring.plate_values import set_place
from fecm.deck.findings import Findings
from fecm.mechanics.interpolation import W
from fecm.mechanics.mesh import extent
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.reduced_plate import lanczos, ritz_vectors
from fecm.mechanics.solutions import Modes, Tangent, modes
from fecm.problem.check import check_place
from fecm.problem.outline import element_sides
from fecm.problem.problem import Problem
from fecm.problem.rules.time_step import unstable_contact

# Mass that the load accelerates, over that at the deck's place, from which on the contact is as
# stable as there.
LIGHT = 0.9
BESIDE = 4  # Ritz vectors of a load beside the modes


class Place(NamedTuple):
    """Place of an impact, and the vectors under the load there: modes, then Ritz vectors."""

    x: float
    y: float
    deflection: Floats  # (modes + BESIDE,): displacement under the load
    stiffness: Floats  # (BESIDE,): squares of the angular frequencies of the Ritz vectors


@dataclass(frozen=True)
class _MovedProblem(Problem):
    """Problem whose deck differs from that of another in the place of the impact alone."""

    other: Problem

    @property
    def plate(self) -> PlateModel:
        """The plate, which both share."""
        return self.other.plate

    @property
    def outside_supports(self) -> Bools:
        """Whether every element lies on a free rim outside the supports, (numel,)."""
        return self.other.outside_supports


class ModalResponses:
    """Responses of a plate that is held, in its lowest modes, to forces at places."""

    def __init__(self, problem: Problem, count: int) -> None:
        self._problem, self._plate = problem, problem.moving_plate
        self._modes: Modes = modes(self._plate, count, consistent=False)
        self._tangent = Tangent(self._plate)

    @property
    def stiffness(self) -> Floats:
        """Squares of the angular frequencies of the modes, (modes,)."""
        return self._modes.angular_frequency**2

    @property
    def own(self) -> Place:
        """The place of the deck."""
        return self._place(self._problem)

    def places(self) -> Iterator[Place]:
        """Yield the corners of elements at which a run has no other findings than at its own place.

        The laminate there is that under the load of the deck.
        """
        problem, mesh = self._problem, self._problem.mesh
        own, number, mass = _findings(problem), problem.laminate_number, self._mass(problem)
        for node in np.unique(element_sides(mesh).corners).tolist():
            if mesh.codes[node, W]:
                continue
            x, y = mesh.coordinates[node].tolist()
            deck = set_place(problem.deck, f"{x!r},{y!r}")
            moved = _MovedProblem(deck, mesh, problem.program, problem)
            if not _findings(moved) <= own or moved.laminate_number != number:
                continue
            if self._mass(moved) >= LIGHT * mass or not unstable_contact(moved):
                yield self._place(moved)

    def response(self, place: Place, dt: float, steps: int) -> Floats:
        """Return the displacement under the load after 1 to `steps` steps, the first with force 1.

        See :mod:`~fecm.mechanics.plate_motion`.
        """
        from scipy.signal import lfilter  # 0.2 s, which most pages don't need

        b = 0.5 * self._problem.damping * dt
        keep, share = (1.0 - b) / (1.0 + b), dt * dt / (1.0 + b)
        pulse, response = np.eye(1, steps)[0], np.zeros(steps)
        stiffness = np.append(self.stiffness, place.stiffness)
        for square, deflection in zip(stiffness, place.deflection, strict=True):
            denominator = [1.0, share * square - 1.0 - keep, keep]
            response += lfilter([share * deflection**2], denominator, pulse)
        return response

    def _place(self, problem: Problem) -> Place:
        assert problem.load_place is not None
        shapes, mass, load = self._modes.shapes, self._plate.mass, self._load(problem)
        basis = lanczos(self._tangent, mass, self._tangent.solve(load), BESIDE, shapes)
        stiffness, _, deflection = ritz_vectors(self._plate.stiffness, mass, load, basis)
        missing = (0, BESIDE - len(stiffness))  # where the modes leave nothing out
        stiffness, deflection = np.pad(stiffness, missing), np.pad(deflection, missing)
        return Place(*problem.load_place, np.append(shapes @ load, deflection), stiffness)

    def _load(self, problem: Problem) -> Floats:
        assert problem.contact is not None  # the program has impact steps
        return np.asarray(problem.contact[self._plate.mesh.equations > 0])

    def _mass(self, problem: Problem) -> float:
        """Return the mass that the load accelerates."""
        return float(1.0 / (self._load(problem) ** 2 / self._plate.mass).sum())


def picture(problem: Problem) -> dict[str, Any]:
    """Return the lowest x and y and the highest of a plate, and paths of its sides and supports."""
    sides, coordinates = element_sides(problem.mesh), problem.mesh.coordinates

    def path(chosen: Bools) -> str:
        ends = coordinates[np.unique(sides.corners[chosen], axis=0)]
        return "".join(f"M{a:.6g} {b:.6g}L{c:.6g} {d:.6g}" for a, b, c, d in ends.reshape(-1, 4))

    return {
        "extent": np.concatenate(extent(coordinates)).tolist(),
        "outline": path(sides.is_outline),
        "supports": path(sides.is_held),
    }


def _findings(problem: Problem) -> set[str]:
    """Return the codes of errors and warnings about the place of an impact."""
    findings = Findings()
    check_place(problem, findings)
    return {code for code in findings.counts if not code.startswith("N")}
