"""Model of a run, built from a checked problem and its options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fecm._errors import OptionsError
from fecm._machine import free_processors
from fecm._typing import Bools, Indices
from fecm.deck import model
from fecm.deck.macros import flat, moves_only
from fecm.listing.slips import refuse_on_nonlinear
from fecm.listing.variant import REPORT_PLATE, ImpactVariant, PlateVariant, Variant, variant_of
from fecm.mechanics import contact_law
from fecm.mechanics.failure import OwnCriterion
from fecm.mechanics.impact import ImpactConditions, ImpactSystem
from fecm.mechanics.impact_steps import ImpactSteps, can_step
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.kernels.strains import CompiledStrains
from fecm.mechanics.mesh import Ints, MeshArrays
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import Load, PlateMotion
from fecm.mechanics.ply_stresses import PlyStresses
from fecm.mechanics.points import GageArray, gages
from fecm.mechanics.projectile import STEPS, Projectile, RodMethod, Transducer
from fecm.mechanics.stiffness_product import AUTO, CSR, KERNELS, SOLVERS, Workers
from fecm.mechanics.strains import StrainField
from fecm.mechanics.symmetry import restrain_resting_dofs, symmetry_reduction
from fecm.problem.estimates import load_mesh
from fecm.problem.generate import generate
from fecm.problem.parts import (
    build_law,
    build_plate,
    build_projectile,
    build_station,
    materials_of_deck,
    residuals_of_deck,
    strengths_of_deck,
)
from fecm.problem.problem import ContactPatch, Problem

if TYPE_CHECKING:
    from fecm.judge.exposure_bands import LoadMesh
    from fecm.mechanics.exposures import PlyPoints
    from fecm.mechanics.failure_monitor import FailureMonitor
    from fecm.mechanics.ply_stresses import Residual
    from fecm.mechanics.stretching import Stretching
    from fecm.mechanics.support_forces import SupportForces

ENERGY_LIMIT = 0.1  # relative error of the energy balance that ends a run
WORTH_SHARING = 100_000  # number of equations above which threads save more than they cost


@dataclass(frozen=True)
class RunOptions:
    """Options of a run; the defaults follow the report.

    Raises OptionsError if a value is not valid.
    """

    # Slips of the printed program that are on: see :func:`~fecm.listing.slips.active_slips`.
    slips: frozenset[str] = frozenset()
    # Computation of K·u, one of ``SOLVERS``.  "auto" takes the compiled kernels if there are any,
    # NumPy otherwise.
    solver: str = AUTO
    # Threads that share the work of a step.  With 0 a large mesh takes a thread for each free
    # processor.  The result does not depend on it.
    threads: int = 0
    rod_method: RodMethod = field(default_factory=RodMethod)  # the rod's mass matrix and integrator
    # Error of the energy balance, relative to the supplied energy, that ends a run without slips.
    energy_limit: float = ENERGY_LIMIT
    # Contact law instead of the deck's; see :func:`~fecm.mechanics.own_law.own_law`.
    law: contact_law.Law | None = None
    projectile: Projectile | None = None  # user's projectile instead of the deck's
    criteria: tuple[OwnCriterion, ...] = ()  # user-defined criteria

    def __post_init__(self) -> None:
        if self.solver not in SOLVERS:
            raise OptionsError(f"unknown solver {self.solver!r}; known are {', '.join(SOLVERS)}")
        if self.solver == KERNELS and LIBRARY is None:
            raise OptionsError("this installation has no compiled kernels; take the solver numpy")
        if self.threads < 0:
            raise OptionsError(f"threads is {self.threads}; it must be 0 or more")
        if not self.energy_limit > 0.0:
            raise OptionsError(f"energy_limit is {self.energy_limit:g}; it must be positive")


def check_run_options(problem: Problem, options: RunOptions) -> None:
    """Raise OptionsError if a problem lacks what an option needs, or has what it excludes."""
    if options.criteria and not problem.work.passes["FAIL"]:
        names = ", ".join(criterion.name for criterion in options.criteria)
        raise OptionsError(
            f"criteria {names}: the program of the deck has no FAIL to evaluate them"
        )
    if not problem.deck.has(model.Nonlinear):
        return
    if options.solver == CSR:
        solvers = ", ".join(solver for solver in SOLVERS if solver != CSR)
        raise OptionsError(
            f"the solver {CSR} has one matrix for all displacements, and the plate is nonlinear "
            f"(NONL); take one of {solvers}"
        )
    refuse_on_nonlinear(options.slips)


class ImpactModel(NamedTuple):
    """Model of a problem, ready to run."""

    plate: PlateModel
    motion: PlateMotion  # motion of the plate; its own plate has only the moving dofs
    impact: ImpactSystem | None  # plate and projectile; None without impact
    steps: ImpactSteps | None  # steps by the compiled kernels; None if they can't take them
    station: Transducer
    # Points of tape8 and of the stresses.
    strains: StrainField
    stress_points: StrainField
    gages: GageArray | None
    stretching: Stretching | None  # of a nonlinear plate
    supports: SupportForces | None  # of springs and one-sided supports
    patch: ContactPatch | None
    plies: PlyStresses | None  # elements whose ply stresses are stored; None without PLYS
    failure: FailureMonitor | None  # failure criteria; None without FAIL
    load_mesh: LoadMesh | None  # elements on the circle of the failure criteria, if there is one
    stress_places: PlyPoints | None  # points of these stresses; None without PLYS and FAIL
    # (numel, points): where plate theory does not hold; None without PLYS and FAIL.
    under_load: Bools | None
    # Residual stresses of the plies of each laminate; None without CURE.
    cure: Sequence[Residual] | None
    laminates: tuple[int, ...]  # numbers of the laminates on the cards
    materials: Ints | None  # of the plies of each laminate; None if there is one material
    variant: Variant  # parameters of the parts that slips change

    @property
    def is_stressed_at_rest(self) -> bool:
        """Whether FAIL has exposures before anything moves."""
        has_residual = self.failure is not None and self.failure.has_residual
        return self.failure is not None and (has_residual or self.plate.is_preloaded)


def build_model(problem: Problem, options: RunOptions | None = None) -> ImpactModel:
    """Build the model of a checked problem, with the problem's plate unless options change it."""
    chosen = options or RunOptions()
    deck, variant = problem.deck, variant_of(chosen.slips)
    projectile = chosen.projectile or build_projectile(deck, variant.impact)
    rod = projectile.with_mass(chosen.rod_method.mass)
    mesh, share = problem.mesh, 1.0
    if problem.contact is not None and variant.impact.nodal_force_scales:
        mesh, share = _share_of_contact_force(problem)
    plate, mobile = _plates(problem, mesh, variant.plate)
    motion, workers = _motion(problem, mobile, chosen)
    impact = None
    if problem.contact is not None:
        conditions = _conditions(problem, motion.load(problem.contact), share, variant.impact)
        law = chosen.law or build_law(deck, variant.impact)
        impact = ImpactSystem(motion, rod, law, conditions, STEPS[chosen.rod_method.integrator])
    compiled = motion.solver == KERNELS
    cure = residuals_of_deck(deck, plate.laminates)
    stress_points = plate.strain_field(problem.rules[2])
    places = under_load = None
    if {"PLYS", "FAIL"} & {macro.word for macro in flat(problem.program)}:
        from fecm.mechanics.exposures import PlyPoints  # 1 ms, for stresses of plies only

        places = PlyPoints(*stress_points.places(mesh.coordinates))
        under_load = problem.under_load(places.x, places.y)
    plies, failure = _stresses(problem, plate, motion, cure, chosen.criteria, under_load)
    around = None if failure is None else failure.around
    read, station = (
        _gages(problem, mesh, plate),
        build_station(deck, rod, variant.impact, is_own=chosen.projectile is not None),
    )
    steps = None  # the kernels take many steps at once only for the report's program
    if impact is not None and variant.is_report and can_step(impact):
        sums = None if read is None else motion.dof_sums(read.dof_indices, read.weights)
        steps = ImpactSteps(impact, sums, station.dof, workers.count)
    return ImpactModel(
        plate=plate,
        motion=motion,
        impact=impact,
        steps=steps,
        station=station,
        strains=plate.strain_field(
            plate.rules.strains, CompiledStrains if compiled else StrainField
        ),
        stress_points=stress_points,
        gages=read,
        stretching=_stretching(problem, plate, compiled=compiled),
        supports=_support_forces(plate),
        patch=problem.patch,
        plies=plies,
        failure=failure,
        load_mesh=None if around is None else load_mesh(problem, around.circle.elements),
        stress_places=places,
        under_load=under_load,
        cure=cure,
        laminates=tuple(deck.layers),
        materials=materials_of_deck(deck),
        variant=variant,
    )


def _share_of_contact_force(problem: Problem) -> tuple[MeshArrays, float]:
    """Return the mesh, and the share of the contact force that acts on it.

    The share is the nodal force of ROD's dof. A FORC card may have replaced the unit force of this
    dof, or added to it.
    """
    card = problem.deck.require(model.Impact)
    hit = card.node - 1, card.dof - 1
    forces = generate(problem.deck, unit_force=True).forces
    share = float(forces[hit])
    forces[hit] = 0.0
    return replace(problem.mesh, forces=forces), share


def _plates(
    problem: Problem, mesh: MeshArrays, variant: PlateVariant
) -> tuple[PlateModel, PlateModel]:
    """Return the plate, and the plate in which only the dofs that the program moves are free."""
    if mesh is problem.mesh and variant == REPORT_PLATE:
        return problem.plate, problem.moving_plate
    plate = build_plate(problem.deck, mesh, variant)
    if moves_only(problem.program):
        return plate, restrain_resting_dofs(plate, problem.contact)
    return plate, plate


def _motion(
    problem: Problem, mobile: PlateModel, chosen: RunOptions
) -> tuple[PlateMotion, Workers]:
    """Return the motion of the plate, and the threads that share its work."""
    reduced = None
    if moves_only(problem.program) and chosen.solver != CSR:
        reduced = symmetry_reduction(mobile, problem.contact)
    count = mobile.neq if reduced is None else reduced.count
    workers = Workers(chosen.threads or (free_processors() if count >= WORTH_SHARING else 1))
    return PlateMotion(mobile, chosen.solver, reduced, workers, problem.damping), workers


def _conditions(
    problem: Problem, load: Load, share: float, variant: ImpactVariant
) -> ImpactConditions:
    """Return the conditions of an impact.

    `share` is the share of the contact force that acts on the plate.
    """
    return ImpactConditions(
        load=load,
        velocity=problem.deck.require(model.Impact).velocity,
        plate_moves=variant.plate_moves,
        strains_start_moving=variant.strains_start_moving,
        keeps_first_step=variant.keeps_first_step,
        share=share,
    )


def _stresses(
    problem: Problem,
    plate: PlateModel,
    motion: PlateMotion,
    cure: Sequence[Residual] | None,
    criteria: Sequence[OwnCriterion],
    under_load: Bools | None,
) -> tuple[PlyStresses | None, FailureMonitor | None]:
    """Return the ply stresses of PLYS and the failure criteria of FAIL; None without the macro."""
    words = {macro.word: macro for macro in flat(problem.program)}
    points = problem.rules[2]
    initial = plate.preload_strain if plate.is_preloaded else None
    zones = plate.rows_by_laminate
    stretches = motion.moves_in_plane or plate.is_curved or plate.nonlinear or plate.is_preloaded

    def made(rows: Indices | None) -> PlyStresses:
        return PlyStresses(
            problem.mesh,
            zones,
            points,
            rows,
            initial,
            curvature=plate.curvature,
            nonlinear=plate.nonlinear,
            stretches=stretches,
        )

    plies = failure = None
    if "PLYS" in words:  # the M elements nearest to the load, or all
        nearest = np.argsort(problem.distances.round(9), kind="stable")
        rows = np.sort(nearest[: int(words["PLYS"].second) or None])
        plies = made(rows)
    if "FAIL" in words:
        # Modules for FAIL only, 1 ms.
        from fecm.mechanics.exposures import CircleStresses
        from fecm.mechanics.failure_monitor import Around, FailureMonitor
        from fecm.mechanics.kernels.failure import CompiledMonitor

        kind = CompiledMonitor if motion.solver == KERNELS else FailureMonitor
        strengths = strengths_of_deck(problem.deck)
        first = next((ply for plies in strengths for ply in plies if ply is not None), None)
        user_criteria = (
            [] if first is None else [criterion.with_modes(first) for criterion in criteria]
        )
        counts = None if under_load is None else ~under_load
        around = None
        if problem.load_place is not None:
            circle = CircleStresses(
                problem.mesh.families,
                problem.load_place,
                problem.reach_of_load,
                zones,
                initial,
                curvature=plate.curvature,
                nonlinear=plate.nonlinear,
                stretches=stretches,
                mirrors=[line.mirror for line in problem.symmetry.lines],
            )
            around = Around(
                circle,
                problem.load_place,
                problem.factors_to_circle,
            )
        far = ~problem.under_load_by_centre
        failure = kind(made(None), strengths, user_criteria, counts, far, around)
        failure = failure.for_half(motion.reduction.represented_by)
        if cure is not None:
            failure = failure.with_residual([criterion.stresses for criterion in cure])
    return plies, failure


def _gages(problem: Problem, mesh: MeshArrays, plate: PlateModel) -> GageArray | None:
    """Return the strain gages; None without a GAGE segment."""
    if (cards := problem.deck.last(model.Gages)) is None:
        return None
    return gages(
        mesh,
        cards.records,
        transposed_jacobian=plate.rules.transposed_jacobian,
        curvature=plate.curvature,
        nonlinear=plate.nonlinear,
    )


def _support_forces(plate: PlateModel) -> SupportForces | None:
    """Return the evaluator of the supports; None for a plate that only restraints hold."""
    if plate.supports is None:
        return None
    from fecm.mechanics.support_forces import SupportForces  # 0.3 ms, for SPRI and UNIL only

    return SupportForces(plate)


def _stretching(problem: Problem, plate: PlateModel, *, compiled: bool) -> Stretching | None:
    """Return the evaluator of the stretching of a nonlinear plate; None if it is not stored."""
    work = problem.work
    rows = work.contact_rows if problem.has_impact else work.passes["DISP"]
    if not (plate.nonlinear and rows):
        return None
    # Modules for NONL only, 1 ms.
    from fecm.mechanics.kernels.stretching import CompiledStretching
    from fecm.mechanics.stretching import Stretching

    kind = CompiledStretching if compiled else Stretching
    return kind(plate, problem.under_load, problem.load_place)
