"""Build the parts of a run from a deck; active slips become parameters of these parts."""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Bools, Floats
from fecm.deck import model
from fecm.deck.macros import Body, WorkEstimate, estimate_work, flat, hits, moves_only
from fecm.deck.model import Deck
from fecm.deck.records import RodDiameter
from fecm.mechanics import contact_law
from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.elements import HIGHEST_ORDER, Quadrature, gauss, nodal
from fecm.mechanics.exposures import OutsideLoad
from fecm.mechanics.failure import CRITERIA
from fecm.mechanics.impact import ImpactConditions, ImpactSystem
from fecm.mechanics.impact_steps import ImpactSteps, supports
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.kernels.failure import CompiledMonitor
from fecm.mechanics.kernels.strains import CompiledStrains
from fecm.mechanics.laminate import Laminate, effective_rigidity, laminate, threshold_force
from fecm.mechanics.mesh import Mesh, element_centres
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.ply_stresses import FailureMonitor, PlyStresses, equilibrium_shear_stiffness
from fecm.mechanics.points import RADIUS_PER_THICKNESS, GageArray, gages, patch_weights
from fecm.mechanics.projectile import (
    LISTING_DENSITY,
    REPORT_DENSITY,
    STEPS,
    Projectile,
    RigidMass,
    Rod,
    RodMethod,
    Transducer,
    report_rod,
)
from fecm.mechanics.stiffness_product import AUTO, CSR, KERNELS, SOLVERS, Workers, available
from fecm.mechanics.strains import StrainField
from fecm.mechanics.symmetry import half_turn_images, restrain_resting_dofs, symmetry_reduction
from fecm.mechanics.time_step import critical_time_step, safe_time_step
from fecm.problem.generate import generate, rod_diameters
from fecm.results.linear_plate import in_plane_of
from fecm.results.validity import Judge

W = 2  # dof w, from 0
ENERGY_LIMIT = 0.1  # relative error of the energy balance that ends a run
WORTH_SHARING = 100_000  # number of equations above which threads save more than they cost
# Slips that change the plate or its loads.
PLATE_SLIPS = {"g12", "small-stiffness", "shear-order", "tapes", "jacobian", "rod-force"}


@frozen
class RunOptions:
    """Options of a run, by default the report's.  Raises ValueError if a value is not valid."""

    # Slips of the printed program that are on: see :func:`~fecm.problem.slips.active_slips`.
    slips: frozenset[str] = frozenset()
    # Computation of K·u, one of ``SOLVERS``: compiled kernels where there are any, else NumPy; or
    # one of them; or a sparse matrix.
    solver: str = AUTO
    # Threads that share the work of a step; 0 takes every core for a large mesh.  The result does
    # not depend on it.
    threads: int = 0
    rod_method: RodMethod = field(default_factory=RodMethod)  # the rod's mass matrix and integrator
    # Error of the energy balance, relative to the supplied energy, that ends a run without slips.
    energy_limit: float = ENERGY_LIMIT
    law: contact_law.Law | None = None  # contact law instead of the deck's

    def __post_init__(self) -> None:
        if self.solver not in SOLVERS:
            raise ValueError(f"unknown solver {self.solver!r}; known are {', '.join(SOLVERS)}")
        if self.solver == KERNELS and LIBRARY is None:
            raise ValueError("this installation has no compiled kernels; take the solver numpy")
        if self.threads < 0:
            raise ValueError(f"threads is {self.threads}; it must be 0 or more")
        if not self.energy_limit > 0.0:
            raise ValueError(f"energy_limit is {self.energy_limit:g}; it must be positive")


class Threshold(NamedTuple):
    """Force at which delaminations grow, and what it is computed from."""

    force: float
    rigidity: float  # effective rigidity D*, force*length
    number: int  # delaminations of `force`
    interfaces: int  # between plies of different angle: the largest possible number
    band: tuple[float, float]  # forces for a delamination in each of them, and for a single one


@frozen
class ContactPatch:
    """Circle on which the contact force acts, and its nodal weights."""

    shape: str  # ``"DISC"`` or ``"HERT"``
    # Radius and centre, length.
    radius: float
    x: float
    y: float
    weights: Floats  # (numnp,): shares of the nodes in a unit force; 0 where w is restrained


@frozen
class Problem:
    """A checked problem; each part is built once, when it is first needed."""

    deck: Deck
    mesh: Mesh
    program: Body  # the macro program with nested loops

    def __getstate__(self) -> dict[str, object]:
        """The deck, mesh and program: a copy in another process builds its own parts."""
        return {"deck": self.deck, "mesh": self.mesh, "program": self.program}

    @cached_property
    def rules(self) -> tuple[Quadrature, Quadrature, Quadrature]:
        """Quadrature of bending, transverse shear and stored strains."""
        return rules(self.deck.require(model.Material))

    @cached_property
    def plate(self) -> PlateModel:
        """The plate of report mode."""
        return build_plate(self.deck, self.mesh)

    @property
    def laminate(self) -> Laminate:
        """The laminate of report mode, with the shear correction factor."""
        return self.plate.laminate

    @cached_property
    def moving_plate(self) -> PlateModel:
        """The plate with only the dofs free that the program moves."""
        if not moves_only(self.program):
            return self.plate
        return restrain_resting_dofs(self.plate, self.contact)

    @cached_property
    def safe_time_step(self) -> float:
        """Lower bound of the critical time step, from the elements alone."""
        return safe_time_step(self.moving_plate)

    @cached_property
    def critical_time_step(self) -> float:
        """Critical time step of the moving plate, which limits the program."""
        return critical_time_step(self.moving_plate)

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
        if (radius := card.radius) is None:
            thickness = self.deck.require(model.Material).integration.thickness
            radius = RADIUS_PER_THICKNESS[card.shape] * thickness
        x, y = (card.x, card.y) if card.x is not None and card.y is not None else self._struck
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
        centres = element_centres(self.mesh.elements, self.mesh.coordinates)
        return np.asarray(np.hypot(*(centres - self.load_place).T))

    def under_load(self, x: Floats, y: Floats) -> Bools:
        """Whether plate theory does not hold at points: within the patch's radius + h/2 of it."""
        if self.load_place is None:
            return np.zeros(x.shape, dtype=bool)
        reach = self.laminate.thickness / 2.0 + (0.0 if self.patch is None else self.patch.radius)
        return np.asarray(np.hypot(x - self.load_place[0], y - self.load_place[1]) < reach)

    @cached_property
    def contact(self) -> Floats | None:
        """Distribution of a unit contact force over the dofs, (numnp, 5); None without impact."""
        if not self.has_impact:
            return None
        contact = np.zeros(self.mesh.equations.shape)
        if self.patch is not None:
            contact[:, W] = self.patch.weights
        else:
            card = self.deck.require(model.Impact)
            contact[card.node - 1, card.dof - 1] = 1.0
        return contact

    @cached_property
    def threshold(self) -> Threshold | None:
        """Delamination threshold; None without a DELA segment."""
        if (card := self.deck.last(model.Delamination)) is None:
            return None
        rigidity, interfaces = effective_rigidity(self.laminate), self.laminate.unlike_interfaces
        number = int(card.number)
        force, least, largest = (
            threshold_force(rigidity, card.toughness, n) for n in (number, max(1, interfaces), 1)
        )
        return Threshold(force, rigidity, number, interfaces, (least, largest))

    @cached_property
    def judge(self) -> Judge:
        """What the validity of an impact on the plate depends on."""
        mobility = 0.0
        if self.contact is not None:
            mobility = self.moving_plate.rigid_mobility(self.contact[:, W])
        return Judge(self.laminate.thickness, in_plane_of(self.mesh.codes), mobility)

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
        points, field = control.numel * an_element, control.numnp * control.ndf
        gages = len(segment.records) if (segment := self.deck.last(model.Gages)) else 0
        layers = len(self.deck.require(model.Material).layers)
        chosen = next((int(m.second) for m in flat(self.program) if m.word == "PLYS"), 0)
        plies = (chosen or control.numel) * (layers * (6 * an_element + 6) + 2)
        history = work.steps * (18 + gages + bool(self.damping))
        numbers = {
            "DISP": work.passes["DISP"] * (field + control.numnp),
            "STRE": work.passes["STRE"] * points * 16,
            "REAC": work.passes["REAC"] * field,
            "EIGE": work.passes["EIGE"] * field,
            "PLYS": work.passes["PLYS"] * plies,
            "FAIL": (
                min(1, work.passes["FAIL"]) * 9 * points * layers * 2  # both faces of a ply
                + work.passes["FAIL"] * len(CRITERIA) * 5
            ),
            "RODP": work.contact_rows * (points * 5 + 8) + history,
        }
        return {word: 8 * count for word, count in numbers.items()}

    @property
    def output_bytes(self) -> int:
        """Size of the result's large datasets."""
        return sum(self.stored_bytes.values())


@frozen
class ImpactModel:
    """Model of a problem, ready to run."""

    plate: PlateModel
    motion: PlateMotion  # motion of the plate; its own plate has only the moving dofs
    impact: ImpactSystem | None  # plate and projectile; None without impact
    steps: ImpactSteps | None  # its steps by the compiled kernels; None where they can't take them
    station: Transducer
    # Points of tape8 and of the stresses.
    strains: StrainField
    stress_points: StrainField
    gages: GageArray | None
    patch: ContactPatch | None
    plies: PlyStresses | None  # elements whose ply stresses are stored; None without PLYS
    failure: FailureMonitor | None  # failure criteria; None without FAIL
    outside: OutsideLoad | None  # where their exposures count; None without FAIL
    # (numel, points): where plate theory does not hold; None without PLYS and FAIL.
    under_load: Bools | None


def rules(material: model.Material) -> tuple[Quadrature, Quadrature, Quadrature]:
    """Quadrature of a MATE card: bending (L1), transverse shear (L2), stored strains (K).

    L1 and L2 outside 1 to 4 count as the nearest of these, as in the listing.  Raises ValueError if
    K is 0 or beyond 4.
    """
    card = material.integration
    bending, shear = (min(HIGHEST_ORDER, max(1, n)) for n in (card.bending, card.shear))
    points = gauss(card.points) if card.points > 0 else nodal(-card.points)
    return gauss(bending), gauss(shear), points


def build_plate(deck: Deck, mesh: Mesh, slips: frozenset[str] = frozenset()) -> PlateModel:
    """Build the plate of a deck with the active slips."""
    bending, shear, points = rules(deck.require(model.Material))
    laminate = laminate_of_deck(deck, isotropic_g12="g12" in slips)
    if "small-stiffness" in slips:
        laminate = laminate.without_small_entries()
    used = IntegrationRules(
        bending=bending,
        shear=bending if "shear-order" in slips else shear,
        strains=bending if "tapes" in slips else points,
        transposed_jacobian="jacobian" in slips,
        assumes_shear=has_assumed_shear(deck),
    )
    return PlateModel(mesh, laminate, used)


def build_projectile(deck: Deck, slips: frozenset[str] = frozenset()) -> Projectile:
    """Build the projectile of a deck; without a PROJ segment the report's rod."""
    if (card := deck.last(model.Projectile)) is None:
        return report_rod(LISTING_DENSITY if "density" in slips else REPORT_DENSITY)
    if not card.elements:
        return RigidMass(card.size)
    return Rod(card.size, tuple(rod_diameters(card).tolist()), card.modulus, card.density)


def projectile_segment(rod: Projectile, transducer: int = 0) -> model.Projectile:
    """PROJ segment of a projectile."""
    if isinstance(rod, RigidMass):
        return model.Projectile(0, 0, rod.total_mass)
    cards = [RodDiameter(n, 0, diameter) for n, diameter in enumerate(rod.diameters, start=1)]
    if len(set(rod.diameters)) == 1 < len(cards):  # those between two cards are generated
        cards = [replace(cards[0], increment=1), cards[-1]]
    return model.Projectile(
        rod.elements, transducer, rod.length, rod.modulus, rod.density, tuple(cards)
    )


def build_constants(measured: model.Indentation) -> contact_law.ContactParameters:
    """Build the contact parameters of an EXPE segment."""
    if measured.word == model.Indentation.ACR:
        return contact_law.YangSunPermanent(measured.k, measured.alpha_p)
    return contact_law.LinearPermanent(*measured.values())


def build_station(deck: Deck, projectile: Projectile, slips: frozenset[str]) -> Transducer:
    """Build the transducer: PROJ's node, or the rod's middle (the next node under its slip)."""
    sign = 1.0 if "station" in slips else -1.0
    if isinstance(projectile, RigidMass):
        return Transducer(0, sign)
    card = deck.last(model.Projectile)
    middle = projectile.elements // 2 + (2 if "station" in slips else 1)
    return Transducer(middle if card is None or not card.transducer else card.transducer, sign)


def build_law(
    deck: Deck, slips: frozenset[str] = frozenset()
) -> contact_law.HystereticLaw | contact_law.ListingLaw:
    """Build the contact law of a deck with the active slips."""
    constants = build_constants(deck.require(model.Indentation))
    if "reload" in slips:
        return contact_law.ListingLaw(constants)
    return contact_law.HystereticLaw(constants)


def build_model(problem: Problem, options: RunOptions | None = None) -> ImpactModel:
    """Build the model of a checked problem, with its own plate unless a slip changes that."""
    chosen = options or RunOptions()
    deck, slips, method = problem.deck, chosen.slips, chosen.rod_method
    rod = build_projectile(deck, slips).with_mass(method.mass)
    contact, share, mesh = problem.contact, 1.0, problem.mesh
    if contact is not None and "rod-force" in slips:
        card = deck.require(model.Impact)
        hit = card.node - 1, card.dof - 1
        forces = generate(deck, unit_force=True).forces
        share = float(forces[hit])
        forces[hit] = 0.0
        mesh = replace(mesh, forces=forces)
    only_moves = moves_only(problem.program)
    if slips & PLATE_SLIPS:
        plate = build_plate(deck, mesh, slips)
        mobile = restrain_resting_dofs(plate, contact) if only_moves else plate
    else:
        plate, mobile = problem.plate, problem.moving_plate
    reduced = symmetry_reduction(mobile, contact) if only_moves and chosen.solver != CSR else None
    count = mobile.neq if reduced is None else reduced.count
    workers = Workers(chosen.threads or (available() if count >= WORTH_SHARING else 1))
    motion = PlateMotion(mobile, chosen.solver, reduced, workers, problem.damping)
    impact = None
    if contact is not None:
        card = deck.require(model.Impact)
        conditions = ImpactConditions(
            load=motion.load(contact),
            velocity=card.velocity,
            plate_moves="target" not in slips,
            strains_start_moving="rod-start" in slips,
            keeps_first_step="rod-dt" in slips,
            share=share,
        )
        law = chosen.law or build_law(deck, slips)
        impact = ImpactSystem(motion, rod, law, conditions, STEPS[method.integrator])
    compiled = motion.solver == KERNELS
    stress_points = plate.strain_field(problem.rules[2])
    plies = failure = None
    words = {macro.word: macro for macro in flat(problem.program)}
    points = problem.rules[2]
    if "PLYS" in words:  # the M elements nearest to the load, or all
        nearest = np.argsort(problem.distances.round(9), kind="stable")
        rows = np.sort(nearest[: int(words["PLYS"].second) or None])
        plies = PlyStresses(problem.mesh, plate.laminate, points, rows)
    if "FAIL" in words:
        kind = CompiledMonitor if compiled else FailureMonitor
        stresses = PlyStresses(problem.mesh, plate.laminate, points)
        failure = kind(stresses, plate.laminate, deck.require(model.Allowables))
    places = stress_points.places(mesh.coordinates) if plies or failure else None
    cards, transposed = deck.last(model.Gages), plate.rules.transposed_jacobian
    read = None if cards is None else gages(mesh, cards.records, transposed_jacobian=transposed)
    station, steps = build_station(deck, rod, slips), None
    if impact is not None and supports(impact):
        sums = None if read is None else motion.dof_sums(read.dof_indices, read.weights)
        steps = ImpactSteps(impact, sums, station.dof, workers.count)
    strains = plate.strain_field(plate.rules.strains, CompiledStrains if compiled else StrainField)
    under_load = outside = None
    if places is not None:
        under_load = problem.under_load(*places)
        outside = OutsideLoad(under_load, *places) if failure else None
    return ImpactModel(
        plate=plate, motion=motion, impact=impact, steps=steps, station=station, strains=strains,
        stress_points=stress_points, gages=read, patch=problem.patch, plies=plies,
        failure=failure, outside=outside, under_load=under_load,
    )  # fmt: skip


def laminate_of(material: model.Material, *, isotropic_g12: bool = False) -> Laminate:
    """Laminate of a deck's MATE segment; its inertia uses the card's total thickness.

    With `isotropic_g12` E1/2(1+nu12) replaces G12 where E1 = E2 (the slip ``g12``).
    """
    ply = material.ply
    if isotropic_g12 and ply.e1 == ply.e2:
        ply = replace(ply, g12=ply.e1 / (2.0 * (1.0 + ply.nu12)))
    angles = [layer.angle for layer in material.layers]
    thicknesses = [layer.thickness for layer in material.layers]
    return laminate(ply, angles, thicknesses, material.integration.thickness)


def laminate_of_deck(deck: Deck, *, isotropic_g12: bool = False) -> Laminate:
    """Laminate of a deck, with its shear correction factor; LookupError without a MATE segment."""
    shear = deck.last(model.Shear) or model.Shear()
    plain = laminate_of(deck.require(model.Material), isotropic_g12=isotropic_g12)
    stiffness = equilibrium_shear_stiffness(plain) if shear.equilibrium else plain.shear
    return replace(plain, shear=shear.factor * stiffness)


def has_assumed_shear(deck: Deck) -> bool:
    """Whether the transverse shear strains of a deck are assumed (``SHEA MITC``)."""
    return (deck.last(model.Shear) or model.Shear()).assumed


@lru_cache(maxsize=256)
def is_coupled(material: model.Material) -> bool:
    """Whether B of a deck's laminate is not 0; False where the MATE segment is invalid."""
    try:
        with np.errstate(all="ignore"):
            return laminate_of(material).is_coupled
    except (ArithmeticError, ValueError):
        return False
