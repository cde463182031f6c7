"""Problem: a deck with its mesh and program, for the checks and the run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.deck import model
from fecm.deck.macros import Body, WorkEstimate, estimate_work, flat, hits, moves_only
from fecm.deck.model import Deck
from fecm.judge.validity import Judge, in_plane_of
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.failure import CRITERIA, PlyExposure, largest_in_plies
from fecm.mechanics.interpolation import W
from fecm.mechanics.joints import ElementSides, coincident, sides_of
from fecm.mechanics.laminate import LaminateSection, effective_rigidity, threshold_force
from fecm.mechanics.mesh import (
    MeshArrays,
    element_centres,
    extent,
    inner_corners,
    longest_sides,
)
from fecm.mechanics.plate import PlateModel, UnsoundPlateError
from fecm.mechanics.ply_stresses import uniform_stresses
from fecm.mechanics.points import RADIUS_PER_THICKNESS, containing_elements, patch_weights
from fecm.mechanics.solutions import (
    SingularStiffnessError,
    StaticResponse,
    buckling_factor,
    static_response,
)
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.symmetry import half_turn_images, restrain_resting_dofs
from fecm.mechanics.time_step import critical_time_step, safe_time_step
from fecm.problem.contact_estimates import ContactStep, contact_step
from fecm.problem.outline import Span, outside_supports, unsupported
from fecm.problem.parts import (
    build_plate,
    build_projectile,
    residuals_of_deck,
    rules,
    strengths_of_deck,
)
from fecm.problem.symmetry import PartSymmetry, symmetry_of
from fecm.results.groups import GROUPS
from fecm.results.schema import values_per_row

if TYPE_CHECKING:
    from fecm.mechanics.ply_stresses import Residual

MEMBRANE_VALUES = 10  # numbers in a row of the group `membrane`


class Threshold(NamedTuple):
    """Force at which delaminations grow, and the values it is computed from."""

    force: float
    rigidity: float  # effective rigidity D*, force*length
    number: int  # number of delaminations at `force`
    interfaces: int  # interfaces between plies of different angle: the largest possible number
    band: tuple[float, float]  # force for a delamination in each interface, and for a single one


class ContactPatch(NamedTuple):
    """Circle on which the contact force acts, and its nodal weights."""

    shape: str  # ``"DISC"`` or ``"HERT"``
    # Radius and centre, length.
    radius: float
    x: float
    y: float
    weights: Floats  # (numnp,): shares of the nodes in a unit force; 0 where w is restrained


@dataclass(frozen=True)
class Problem:
    """Checked problem; each part is built once, when it is first needed."""

    deck: Deck
    mesh: MeshArrays
    program: Body  # the macro program with nested loops

    def __getstate__(self) -> dict[str, object]:
        """Return the deck, mesh and program: a copy in another process builds its own parts."""
        return {"deck": self.deck, "mesh": self.mesh, "program": self.program}

    @cached_property
    def rules(self) -> tuple[Quadrature, Quadrature, Quadrature]:
        """Quadrature of bending, transverse shear and stored strains."""
        return rules(self.deck.require(model.Material))

    @cached_property
    def sides(self) -> ElementSides:
        """Sides of the elements."""
        return sides_of(self.mesh.families, self.mesh.elements)

    @cached_property
    def coincident_nodes(self) -> Indices:
        """Pairs of rows of nodes in the same place, (n, 2)."""
        return coincident(self.mesh.coordinates, self.sides)

    @cached_property
    def longer_side(self) -> float:
        """Longer side of the rectangle around the whole plate, length."""
        low, high = extent(self.symmetry.unfolded(self.mesh.coordinates))
        return float((high - low).max())

    @cached_property
    def span(self) -> Span:
        """Distance between supports that counts for bending."""
        whole = self.symmetry.unfolded(self.mesh.coordinates[self.mesh.used])
        return unsupported(self.plate.supported, self.load_place, whole)

    @cached_property
    def outside_supports(self) -> Bools:
        """Whether every element lies on a free rim outside the supports, (numel,)."""
        return outside_supports(self.plate.supported, self.symmetry.nodes(self.mesh))

    @cached_property
    def plate(self) -> PlateModel:
        """The plate of report mode."""
        return build_plate(self.deck, self.mesh)

    @property
    def laminate(self) -> LaminateSection:
        """The laminate of report mode under the load, with the shear correction factor."""
        return self.plate.laminates[self.laminate_number]

    @cached_property
    def laminate_number(self) -> int:
        """Number from 0 of the laminate under the load, or of element 1 without a load."""
        place = self.load_place
        return self._laminate_number_at(place) if place else self._laminate_numbers[0]

    @cached_property
    def _laminate_numbers(self) -> list[int]:
        """Number from 0 of the laminate of every element."""
        numbers = self.plate.laminate_numbers
        return [0] * self.deck.control.numel if numbers is None else numbers.tolist()

    def _laminate_number_at(self, place: tuple[float, float]) -> int:
        """Return the number from 0 of the laminate at a place.

        The first element that contains the place counts.
        """
        if self.plate.laminate_numbers is None:
            return 0
        rows = [
            int(family.rows[member])
            for family in self.mesh.families
            for member in containing_elements(family, np.array([place]))[0].tolist()
        ]
        return self._laminate_numbers[min(rows, default=0)]

    @property
    def used_laminates(self) -> list[int]:
        """Numbers from 0 of the laminates of the elements."""
        return sorted(set(self._laminate_numbers))

    @cached_property
    def moving_plate(self) -> PlateModel:
        """The plate with only the dofs free that the program moves."""
        if not moves_only(self.program):
            return self.plate
        return restrain_resting_dofs(self.plate, self.contact)

    @cached_property
    def static(self) -> StaticResponse | None:
        """Response of the moving plate to a static unit force; None if nothing holds the plate.

        Raises ConvergenceError if the plate finds no rest on its one-sided supports.
        """
        assert self.contact is not None  # the program has impact steps
        try:
            return static_response(self.moving_plate, self.contact)
        except SingularStiffnessError:
            return None

    @cached_property
    def rests(self) -> Bools:
        """Nodes whose w is held both ways, and whose rotations are free, (numnp,).

        Springs hold w and rotations too. Such a node stands for a window, a ring, a knife edge or
        the tip of a clamp.
        """
        free = self.moving_plate.mesh.equations > 0
        turns = np.asarray((free | self.symmetry.held(self.mesh))[:, W + 1 :].all(axis=1))
        held = ~free[:, W]
        if (supports := self.moving_plate.supports) is not None:
            springs = supports.select(~supports.is_one_sided)
            held[springs.node[springs.dof == W]] = True
            turns[springs.node[springs.dof > W]] = False
        return np.asarray(held & turns)

    @cached_property
    def knife_edges(self) -> Bools:
        """Nodes on lines that hold w both ways, but no rotation, (numnp,).

        Such a line stands for a ring, a window or a knife edge, which can only push.
        """
        rests = self.rests
        on_line = np.zeros(len(rests), dtype=bool)
        lines = self.sides.take(np.asarray(rests[self.sides.ends].all(axis=1)))
        on_line[lines.nodes[lines.nodes >= 0]] = True
        return on_line & rests

    @cached_property
    def safe_time_step(self) -> float:
        """Lower bound of the critical time step, from the elements alone."""
        return safe_time_step(self.moving_plate)

    @cached_property
    def critical_time_step(self) -> float:
        """Critical time step of the moving plate, which limits the program."""
        return critical_time_step(self.moving_plate)

    @cached_property
    def share_of_step(self) -> float:
        """Critical time step over the one without springs and one-sided supports.

        The share is NaN for a plate that has no critical time step, which the check reports.
        """
        try:
            without = critical_time_step(replace(self.moving_plate, supports=None))
            return min(1.0, self.critical_time_step / without)
        except UnsoundPlateError:
            return math.nan

    @cached_property
    def buckling_factor(self) -> float:
        """Factor on the preload at which the plate buckles; infinite if that is far away."""
        if not self.plate.is_compressed:
            return math.inf
        return buckling_factor(self.plate)

    @cached_property
    def elements_per_buckle(self) -> float:
        """Least number of elements along a half wave of the buckled panel; infinite if flat.

        The half wave of a cylinder under axial compression is pi (D R^2/(E h))^(1/4), or 1.73 (R
        h)^(1/2) of an isotropic one (Timoshenko and Gere, Theory of Elastic Stability, 11.1).
        """
        largest = max(map(abs, self.plate.curvature))
        if not largest:
            return math.inf
        x, y = (np.diff(self.mesh.coordinates[self.sides.ends], axis=1)[:, 0]).T
        return 1.73 * math.sqrt(self.laminate.thickness / largest) / float(np.hypot(x, y).max())

    @cached_property
    def contact_step(self) -> ContactStep | None:
        """Limit of the time step from the contact, for the largest DT; None without impact."""
        bound = self.safe_time_step
        steps = (macro.value for macro in self.deck.macros if macro.word == "DT")
        largest = max(dt or SAFE * bound for dt in steps)
        factor = self.symmetry.factor
        return contact_step(self.deck, self.moving_plate, self.contact, largest, bound, factor)

    @cached_property
    def has_impact(self) -> bool:
        """Whether the program takes impact steps."""
        return hits(self.program)

    @cached_property
    def patch(self) -> ContactPatch | None:
        """Contact patch of a sound mesh; None without a PATC segment.

        Raises PatchError if the patch is not entirely on the plate.
        """
        if (card := self.deck.last(model.Patch)) is None:
            return None
        x, y = (card.x, card.y) if card.x is not None and card.y is not None else self._struck
        if (radius := card.radius) is None:
            thickness = self.plate.laminates[self._laminate_number_at((x, y))].thickness
            radius = RADIUS_PER_THICKNESS[card.shape] * thickness
        weights = patch_weights(self.mesh, card.shape, radius, x, y)
        images = half_turn_images(self.mesh.coordinates)
        if images is not None and np.allclose(weights, weights[images], 0.0, 1e-12):
            weights = (weights + weights[images]) / 2.0  # exactly symmetric
        free = np.where(self.mesh.codes[:, W] == 0, weights, 0.0)
        return ContactPatch(card.shape, radius, x, y, free)

    @property
    def _struck(self) -> tuple[float, float]:
        x, y = self.mesh.coordinates[self.deck.require(model.Impact).node - 1].tolist()
        return x, y

    @cached_property
    def load_place(self) -> tuple[float, float] | None:
        """Centre of the patch, or the impact node; None without either."""
        if self.patch is not None:
            return self.patch.x, self.patch.y
        return self._struck if self.has_impact else None

    @cached_property
    def distances(self) -> Floats:
        """Distance of the centre of every element from the load, (numel,); 0 without a load."""
        if self.load_place is None:
            return np.zeros(len(self.mesh.elements))
        return np.asarray(np.hypot(*(self._centres - self.load_place).T))

    @cached_property
    def _centres(self) -> Floats:
        """Mean of the corners of every element, (numel, 2)."""
        return element_centres(self.mesh.elements, self.mesh.coordinates)

    @property
    def reach_of_load(self) -> float:
        """Distance from the load within which plate theory does not hold: patch's radius + h/2."""
        return self.laminate.thickness / 2.0 + (0.0 if self.patch is None else self.patch.radius)

    def under_load(self, x: Floats, y: Floats) -> Bools:
        """Return whether plate theory fails at points: under the load, and at corners of supports.

        A support along a line pulls with a single force where the line turns inside the plate, and
        the moments beside it grow without bound on finer meshes.
        """
        wrong = np.zeros(x.shape, dtype=bool)
        if self.load_place is not None:
            distance = np.hypot(x - self.load_place[0], y - self.load_place[1])
            wrong |= distance < self.reach_of_load
        for corner in self.inner_corners:
            wrong |= np.hypot(x - corner[0], y - corner[1]) < self.laminate.thickness / 2.0
        return wrong

    @cached_property
    def under_load_by_centre(self) -> Bools:
        """Whether plate theory does not hold at the centre of each element, (numel,)."""
        return self.under_load(*self._centres.T)

    @cached_property
    def inner_corners(self) -> Floats:
        """Corners of lines of supported nodes inside the plate, (n, 2).

        At such a node the sides of elements whose ends are held in w run in two directions.
        """
        return inner_corners(
            self.mesh.families, self.mesh.coordinates, self.plate.supported.equations[:, W] == 0
        )

    def coarseness(self, elements: Indices) -> float:
        """Return the longest side of some elements over the reach of the load."""
        return float(self._longest_sides[elements].max(initial=0.0)) / self.reach_of_load

    @cached_property
    def patch_side(self) -> float:
        """Longest side of the elements at the centre of the patch, length; 0 without a patch."""
        if self.patch is None:
            return 0.0
        place = np.array([[self.patch.x, self.patch.y]])
        rows = [block.rows[containing_elements(block, place)[0]] for block in self.mesh.families]
        return float(self._longest_sides[np.concatenate(rows)].max(initial=0.0))

    @cached_property
    def _longest_sides(self) -> Floats:
        """Longest side of every element, (numel,), length."""
        return longest_sides(self.mesh.elements, self.mesh.coordinates)

    @cached_property
    def factors_to_circle(self) -> Floats:
        """Distance from the load over the reach of the load, for elements next to it, (numel,).

        These are elements whose centre is farther away than the reach by at most their longest
        side. Other elements have 0.
        """
        reach, distances = self.reach_of_load, self.distances
        is_next = (distances >= reach) & (distances <= reach + self._longest_sides)
        return np.where(is_next & ~self.under_load_by_centre, distances / reach, 0.0)

    @cached_property
    def contact(self) -> Floats | None:
        """Distribution of a unit contact force over the dofs, (numnp, 5); None without impact."""
        return self.unit_load if self.has_impact else None

    @property
    def unit_load(self) -> Floats | None:
        """Unit force on the patch, or on the dof of ROD, (numnp, 5); None without both."""
        load = np.zeros(self.mesh.equations.shape)
        if self.patch is not None:
            load[:, W] = self.patch.weights
        elif (card := self.deck.last(model.Impact)) is not None:
            load[card.node - 1, card.dof - 1] = 1.0
        else:
            return None
        return load

    @cached_property
    def threshold(self) -> Threshold | None:
        """Delamination threshold; None without a DELA segment, and for a sandwich.

        The threshold holds for a solid laminate: the faces of a sandwich delaminate, or leave the
        core, at a small part of it.
        """
        card = self.deck.last(model.Delamination)
        if card is None or self.laminate.has_core:
            return None
        rigidity, interfaces = effective_rigidity(self.laminate), self.laminate.unlike_interfaces
        number = int(card.number)
        force, least, largest = (
            threshold_force(rigidity, card.toughness, n) for n in (number, max(1, interfaces), 1)
        )
        return Threshold(force, rigidity, number, interfaces, (least, largest))

    @cached_property
    def residual(self) -> Residual | None:
        """Residual stresses of the plies under the load; None without a CURE segment."""
        return None if self.residuals is None else self.residuals[self.laminate_number]

    @cached_property
    def residuals(self) -> tuple[Residual, ...] | None:
        """Residual stresses of the plies of each laminate; None without a CURE segment."""
        return residuals_of_deck(self.deck, self.plate.laminates)

    @property
    def worst_at_rest(self) -> PlyExposure | None:
        """Largest exposure before anything moves; None without strengths or without stresses."""
        worst = self.worst_under()
        return None if worst is None else worst[0]

    def worst_under(
        self, *, preload: bool = True, cure: bool = True
    ) -> tuple[PlyExposure, int] | None:
        """Return the largest exposure under the preload and residual stresses, and its laminate.

        Returns None without strengths or without these stresses. The laminate is its number on the
        card.
        """
        residuals = self.residuals if cure else None
        preload = preload and self.plate.is_preloaded
        if not self.deck.has(model.Allowables) or (residuals is None and not preload):
            return None
        strengths, cards = strengths_of_deck(self.deck), list(self.deck.layers)
        exposures: list[tuple[PlyExposure, int]] = []
        for number in self.used_laminates:
            laminate = self.plate.laminates[number]
            strain = self.plate.preload_strain if preload else np.zeros(3)
            stresses = uniform_stresses(laminate, strain)
            if residuals is not None:
                stresses += residuals[number].stresses
            exposures += [
                (exposure, cards[number])
                for exposure in largest_in_plies(
                    strengths[number], laminate.plies.constants, stresses
                )
            ]
        return max(exposures, key=lambda pair: pair[0].exposure, default=None)

    @cached_property
    def symmetry(self) -> PartSymmetry:
        """Lines of symmetry of the plate; none without an impact."""
        return symmetry_of(self.deck, self.mesh) if self.has_impact else PartSymmetry()

    @property
    def projectile_mass(self) -> float:
        """Mass of the projectile that hits the whole plate."""
        return self.symmetry.factor * build_projectile(self.deck).total_mass

    @property
    def plate_mass(self) -> float:
        """Mass of the whole plate."""
        return self.symmetry.factor * self.plate.total_mass()

    @property
    def contact_coefficient(self) -> float:
        """Coefficient k of the contact with the whole plate, force/length^1.5."""
        return self.symmetry.factor * self.deck.require(model.Indentation).k

    @cached_property
    def judge(self) -> Judge:
        """Judge of the validity of an impact on the plate."""
        mobility = 0.0
        if self.contact is not None:
            mobility = self.moving_plate.rigid_mobility(self.contact[:, W])
        return Judge(
            self.laminate.thickness,
            in_plane_of(self.mesh.codes, self.mesh.coordinates, self.symmetry.cut),
            mobility,
            plate_mass=self.moving_plate.total_mass(),
            preloaded=self.plate.is_preloaded,
            curved=self.plate.is_curved,
            nonlinear=self.plate.nonlinear,
            struck=self.laminate.struck_thickness if self.laminate.has_core else None,
        )

    @property
    def damping(self) -> float:
        """Mass-proportional damping a of the plate, 1/time; 0 without a DAMP segment."""
        return card.coefficient if (card := self.deck.last(model.Damping)) else 0.0

    @cached_property
    def work(self) -> WorkEstimate:
        """Number of macros, steps and stored rows."""
        return estimate_work(self.program)

    @cached_property
    def stored_bytes(self) -> dict[str, int]:
        """Size of the result's large datasets, by the macro that stores them."""
        control, work = self.deck.control, self.work
        an_element = len(self.rules[2].xi)
        points = control.numel * an_element
        gages = len(segment.records) if (segment := self.deck.last(model.Gages)) else 0
        layers = max(map(len, self.deck.layers.values()))
        chosen = next((int(m.second) for m in flat(self.program) if m.word == "PLYS"), 0)
        sizes = {
            **{"numnp": control.numnp, "ndf": control.ndf, "numel": control.numel},
            **{"nps": an_element, "npp": an_element, "layers": layers},
            "members": chosen or control.numel,
        }
        field = 4 if self.deck.has(model.Compact) else 8  # bytes of a number of a field
        numbers = {
            info.macro: field * work.passes[info.macro] * values_per_row(group, sizes)
            for group, info in GROUPS.items()
            if info.by_pass
        }
        numbers["FAIL"] = (
            # Exposure, time and mode of both faces of a ply.
            min(1, work.passes["FAIL"]) * len(CRITERIA) * (2 * 8 + 1) * points * layers * 2
            + 8 * work.passes["FAIL"] * len(CRITERIA) * 5
        )
        history = work.steps * (18 + gages + bool(self.damping))
        numbers["RODP"] = work.contact_rows * (field * points * 5 + 8 * 8) + 8 * history
        if self.deck.has(model.Nonlinear):
            numbers["DISP"] += 8 * work.passes["DISP"] * MEMBRANE_VALUES
            numbers["RODP"] += 8 * work.contact_rows * MEMBRANE_VALUES
        return numbers

    @cached_property
    def stored_rows(self) -> dict[str, int]:
        """Number of rows of the result's large datasets, by the macro that stores them."""
        work = self.work
        rows = {"RODP": work.contact_rows} | {
            word: work.passes[word] for word in ("DISP", "STRE", "PLYS", "FAIL")
        }
        return {word: count for word, count in rows.items() if count}

    @property
    def output_bytes(self) -> int:
        """Size of the result's large datasets."""
        return sum(self.stored_bytes.values())
