"""Effects of the slips on the parts of a run, as parameters of these parts.

The defaults are the report's.  A part asks its variant for a value, a rule or a factor.  The part
does not know which slips are active, or which mode the run is in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from fecm.deck.macros import LoadTable, WorkEstimate, load_factor
from fecm.deck.material_cards import Ply
from fecm.listing.law import ListingLaw
from fecm.mechanics.contact_law import ContactParameters, HystereticLaw
from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.projectile import REPORT_DENSITY

MISREAD_DENSITY = 0.0003225  # density of the report's rod in the listing


class PlateVariant(NamedTuple):
    """Parameters of the plate."""

    isotropic_g12: bool = False  # plies with E1 = E2 have G12 = E/(2 (1 + nu))
    cuts_small_stiffness: bool = False  # entries of A, B and D below 1e-6 are 0
    shear_at_bending_points: bool = False  # L1 holds for transverse shear too
    strains_at_bending_points: bool = False  # L1 holds for stored strains too
    transposed_jacobian: bool = False

    def ply(self, ply: Ply) -> Ply:
        """Return the constants of a ply of the deck."""
        if self.isotropic_g12 and ply.e1 == ply.e2:
            return replace(ply, g12=ply.e1 / (2.0 * (1.0 + ply.nu12)))
        return ply

    def laminate(self, laminate: LaminateSection) -> LaminateSection:
        """Return the section of MATE's laminate."""
        return laminate.without_small_entries() if self.cuts_small_stiffness else laminate

    def rules(self, rules: IntegrationRules) -> IntegrationRules:
        """Return the quadrature rules of the plate."""
        return replace(
            rules,
            shear=rules.bending if self.shear_at_bending_points else rules.shear,
            strains=rules.bending if self.strains_at_bending_points else rules.strains,
            transposed_jacobian=self.transposed_jacobian,
        )


class ImpactVariant(NamedTuple):
    """Parameters of projectile, contact and transducer."""

    rod_density: float = REPORT_DENSITY  # without a PROJ segment
    law: Callable[[ContactParameters], HystereticLaw | ListingLaw] = HystereticLaw
    plate_moves: bool = True  # the contact law takes the plate's motion into account
    strains_start_moving: bool = False  # the rod's du/dx start at the approach velocity
    keeps_first_step: bool = False  # the rod's integrator keeps the constants of the first step
    nodal_force_scales: bool = False  # FORC's force at ROD's dof scales the contact force
    station_after_middle: int = 0  # nodes from the rod's middle to the transducer
    station_sign: float = -1.0


class ProgramVariant(NamedTuple):
    """Parameters of the macro program."""

    clock_rate: float = 1.0  # rate of TIME's clock
    last_words: frozenset[str] = frozenset()  # macros that end the program
    table_stands: bool = False  # PROP has the table's value at t = 0
    prop_replaces_contact: bool = False  # PROP's factor is the force on the plate in the next step
    contact_scales_forces: bool = False  # the contact force is the factor of FORC's values
    counts_from_output: bool = False  # RODP's N counts steps since the last output
    strains_precede_step: bool = False  # RODP stores the strains before its step
    contact_at_every_step: bool = False  # tape9 has every step instead of every N-th

    def table_factor(self, table: LoadTable, clock: float, first: float) -> float:
        """Return the load factor of a table at a clock time; `first` is the last PROP's factor."""
        return first if self.table_stands else load_factor(table, clock)

    def prop_force(self, factor: float) -> float | None:
        """Return the force on the plate in the step after PROP; None for the contact force."""
        return factor if self.prop_replaces_contact else None

    def force_factor(self, factor: float, contact: float | None) -> float:
        """Return the factor of FORC's values.

        `factor` is the load factor, `contact` the contact force on the plate in an impact.
        """
        return factor if contact is None or not self.contact_scales_forces else contact

    def is_output(self, step: int, since: int, every: int) -> bool:
        """Return whether RODP stores strains at a step, `since` steps after the last output."""
        return since == every if self.counts_from_output else not step % every

    def has_contact(self, is_output: bool) -> bool:
        """Return whether RODP stores the contact of a step."""
        return is_output or self.contact_at_every_step

    def contact_rows(self, work: WorkEstimate) -> int:
        """Return the largest number of steps whose contact is stored."""
        return work.steps if self.contact_at_every_step else work.contact_rows


REPORT_PLATE = PlateVariant()
REPORT_IMPACT = ImpactVariant()


class Variant(NamedTuple):
    """Parameters of all parts."""

    plate: PlateVariant
    impact: ImpactVariant
    program: ProgramVariant

    @property
    def is_report(self) -> bool:
        """Whether no slip is active."""
        return self == REPORT


REPORT = Variant(REPORT_PLATE, REPORT_IMPACT, ProgramVariant())


def variant_of(slips: frozenset[str]) -> Variant:
    """Return the parameters of the parts with these slips."""
    plate = PlateVariant(
        isotropic_g12="g12" in slips,
        cuts_small_stiffness="small-stiffness" in slips,
        shear_at_bending_points="shear-order" in slips,
        strains_at_bending_points="tapes" in slips,
        transposed_jacobian="jacobian" in slips,
    )
    impact = ImpactVariant(
        rod_density=MISREAD_DENSITY if "density" in slips else REPORT_DENSITY,
        law=ListingLaw if "reload" in slips else HystereticLaw,
        plate_moves="target" not in slips,
        strains_start_moving="rod-start" in slips,
        keeps_first_step="rod-dt" in slips,
        nodal_force_scales="rod-force" in slips,
        station_after_middle=int("station" in slips),
        station_sign=1.0 if "station" in slips else -1.0,
    )
    program = ProgramVariant(
        clock_rate=float("time" not in slips),
        last_words=frozenset({"CHEC"} if "check-end" in slips else ()),
        table_stands="prop" in slips,
        prop_replaces_contact="prop-contact" in slips,
        contact_scales_forces="force-scale" in slips,
        counts_from_output="counter" in slips,
        strains_precede_step="tapes" in slips,
        contact_at_every_step="tapes" in slips,
    )
    return Variant(plate, impact, program)
