"""From a deck to the parts of a run.

Here, and only here, the slips that are on become parameters of the plate, the projectile, the law
and the transducer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fecm.assembly import PlateModel, Rules, assemble
from fecm.choices import Choices
from fecm.deck.model import Deck, Indentation, Material
from fecm.deck.model import Gages as GageCards
from fecm.deck.model import Impact as ImpactCard
from fecm.deck.model import Projectile as ProjectileCard
from fecm.dynamics import PlateMotion
from fecm.elements.quadrature import HIGHEST_ORDER, Rule, gauss, nodal
from fecm.gages import Gages, gages
from fecm.impact import Contact, Impact
from fecm.indentation import Constants, CriticalConstants, Law, Measured, MemoryLaw, StickyLaw
from fecm.laminate import laminate_of_deck
from fecm.mesh import Mesh, generate, rod_diameters
from fecm.plate import StrainField
from fecm.program import Body, hits, moves_only
from fecm.projectile import (
    LISTING_DENSITY,
    REPORT_DENSITY,
    STEPS,
    Projectile,
    RigidMass,
    Rod,
    Station,
    report_rod,
)
from fecm.reduction import moving, reduction
from fecm.rod_method import WILSON
from fecm.solvers import CSR
from fecm.workers import Workers, available

# Moving unknowns from which on threads save more than they cost.
WORTH_SHARING = 100_000


@dataclass(frozen=True)
class Setup:
    """A problem's parts, ready to run.

    Attributes
    ----------
    plate : PlateModel
    motion : PlateMotion
        The plate in time; its own plate has only what moves free.
    impact : Impact or None
        Plate and projectile; None where nothing hits.
    station : Station
        The transducer.
    strains, stress_points : StrainField
        Points of tape8, and of the stresses.
    gages : Gages or None
        Strain gages.
    """

    plate: PlateModel
    motion: PlateMotion
    impact: Impact | None
    station: Station
    strains: StrainField
    stress_points: StrainField
    gages: Gages | None


def rules(material: Material) -> tuple[Rule, Rule, Rule]:
    """Quadrature of a MATE card: bending (L1), transverse shear (L2), stored strains (K).

    L1 and L2 outside 1 to 4 count as the nearest of these, as in the listing.

    Raises
    ------
    ValueError
        If K is 0 or beyond 4.
    """
    card = material.integration
    bending, shear = (min(HIGHEST_ORDER, max(1, n)) for n in (card.bending, card.shear))
    points = gauss(card.points) if card.points > 0 else nodal(-card.points)
    return gauss(bending), gauss(shear), points


def build_plate(deck: Deck, mesh: Mesh, slips: frozenset[str] = frozenset()) -> PlateModel:
    """Make the plate of a deck, with the slips that are on."""
    material = deck.need(Material)
    bending, shear, points = rules(material)
    laminate = laminate_of_deck(deck, isotropic_g12="g12" in slips)
    if "small-stiffness" in slips:
        laminate = laminate.without_small_entries()
    return assemble(
        mesh,
        laminate,
        Rules(
            bending=bending,
            shear=bending if "shear-order" in slips else shear,
            strains=bending if "tapes" in slips else points,
            transposed="jacobian" in slips,
        ),
    )


def build_projectile(deck: Deck, slips: frozenset[str] = frozenset()) -> Projectile:
    """Make the projectile of a deck; without a PROJ segment the report's, with the slips on."""
    card = deck.last(ProjectileCard)
    if card is None:
        return report_rod(LISTING_DENSITY if "density" in slips else REPORT_DENSITY)
    if not card.elements:
        return RigidMass(card.size)
    diameters = tuple(rod_diameters(card).tolist())
    return Rod(card.size, diameters, card.modulus, card.density)


def build_constants(measured: Indentation) -> Measured:
    """Make what an EXPE segment says of the indentation law."""
    if measured.word == Indentation.ACR:
        return CriticalConstants(measured.k, measured.alpha_p)
    return Constants(*measured.values())


def build_station(deck: Deck, projectile: Projectile, slips: frozenset[str]) -> Station:
    """Make the transducer: PROJ's node, or the rod's middle (one node on under its slip)."""
    sign = 1.0 if "station" in slips else -1.0
    if isinstance(projectile, RigidMass):
        return Station(0, sign)
    card = deck.last(ProjectileCard)
    middle = projectile.elements // 2 + (2 if "station" in slips else 1)
    return Station(middle if card is None or not card.transducer else card.transducer, sign)


def build_gages(deck: Deck, mesh: Mesh, plate: PlateModel) -> Gages | None:
    """Make the strain gages of a deck; None without a GAGE segment."""
    segment = deck.last(GageCards)
    if segment is None:
        return None
    return gages(mesh, segment.records, transposed=plate.rules.transposed)


def build_law(deck: Deck, slips: frozenset[str] = frozenset()) -> Law:
    """Make the indentation law of a deck, with the slips that are on."""
    constants = build_constants(deck.need(Indentation))
    return StickyLaw(constants) if "reload" in slips else MemoryLaw(constants)


def build_impact(
    deck: Deck,
    motion: PlateMotion,
    rod: Projectile,
    slips: frozenset[str],
    integrator: str = WILSON,
    share: float = 1.0,
) -> Impact:
    """Make projectile, law and contact, with the slips that are on.

    The plate feels the given share of the contact force.
    """
    card = deck.need(ImpactCard)
    contact = Contact(
        row=motion.row(card.node - 1, card.dof - 1),
        velocity=card.velocity,
        plate_moves="target" not in slips,
        strains_start_moving="rod-start" in slips,
        keeps_first_step="rod-dt" in slips,
        share=share,
    )
    return Impact(motion, rod, build_law(deck, slips), contact, STEPS[integrator])


def moving_plate(deck: Deck, mesh: Mesh, program: Body) -> PlateModel:
    """Make the plate of a deck, of which only what a program moves is free.

    Its critical time step is the one that limits the program.
    """
    plate = build_plate(deck, mesh)
    return moving(plate, _hit(deck) if hits(program) else None) if moves_only(program) else plate


def _hit(deck: Deck) -> tuple[int, int]:
    """Row of the node that is hit, and which of its unknowns, from 0."""
    card = deck.need(ImpactCard)
    return card.node - 1, card.dof - 1


def set_up(
    deck: Deck,
    mesh: Mesh,
    choices: Choices | None = None,
    *,
    hits: bool = True,
    moves_only: bool = False,
) -> Setup:
    """Make the parts of a checked problem, as it is to be run.

    Parameters
    ----------
    deck : Deck
    mesh : Mesh
    choices : Choices, optional
        The report's way without it.
    hits : bool
        Whether there is a projectile.
    moves_only : bool
        Whether the plate only moves from rest, so that what provably stays at rest can be left out.
    """
    chosen = choices or Choices()
    slips, solver, method = chosen.slips, chosen.solver, chosen.rod_method
    rod = build_projectile(deck, slips).with_mass(method.mass)
    hit = _hit(deck) if hits else None
    share = 1.0
    if hit is not None and "rod-force" in slips:
        forces = generate(deck, unit_force=True).forces
        share = float(forces[hit])
        forces[hit] = 0.0
        mesh = replace(mesh, forces=forces)
    plate = build_plate(deck, mesh, slips)
    mobile = moving(plate, hit) if moves_only else plate
    reduced = reduction(mobile, hit) if moves_only and solver != CSR else None
    count = mobile.neq if reduced is None else reduced.count
    workers = Workers(chosen.threads or (available() if count >= WORTH_SHARING else 1))
    motion = PlateMotion(mobile, solver, reduced, workers)
    return Setup(
        plate=plate,
        motion=motion,
        impact=build_impact(deck, motion, rod, slips, method.integrator, share) if hits else None,
        station=build_station(deck, rod, slips),
        strains=plate.strain_field(plate.rules.strains),
        stress_points=plate.strain_field(rules(deck.need(Material))[2]),
        gages=build_gages(deck, mesh, plate),
    )
