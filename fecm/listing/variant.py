"""What slips change in the parts of a run, as parameters of these parts.

The defaults are the report's.  No part asks which slips are active, or in which mode it is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from fecm.listing.law import ListingLaw
from fecm.mechanics.contact_law import ContactParameters, HystereticLaw
from fecm.mechanics.projectile import REPORT_DENSITY

MISREAD_DENSITY = 0.0003225  # of the report's rod, in the listing


class PlateVariant(NamedTuple):
    """Parameters of the plate."""

    isotropic_g12: bool = False  # plies with E1 = E2 have G12 = E/(2 (1 + nu))
    cuts_small_stiffness: bool = False  # entries of A, B and D below 1e-6 are 0
    shear_at_bending_points: bool = False  # L1 holds for transverse shear too
    strains_at_bending_points: bool = False  # L1 holds for stored strains too
    transposed_jacobian: bool = False


class ImpactVariant(NamedTuple):
    """Parameters of projectile, contact and transducer."""

    rod_density: float = REPORT_DENSITY  # without a PROJ segment
    law: Callable[[ContactParameters], HystereticLaw | ListingLaw] = HystereticLaw
    plate_moves: bool = True  # in the contact law
    strains_start_moving: bool = False  # the rod's du/dx start at the approach velocity
    keeps_first_step: bool = False  # in the constants of the rod's integrator
    nodal_force_scales: bool = False  # FORC's force at ROD's dof scales the contact force
    station_after_middle: int = 0  # nodes from the rod's middle to the transducer
    station_sign: float = -1.0


class ProgramVariant(NamedTuple):
    """Parameters of the macro program."""

    clock_stands: bool = False  # TIME does nothing
    table_stands: bool = False  # PROP has the table's value at t = 0
    prop_replaces_contact: bool = False  # as the force on the plate, in the step after PROP
    contact_scales_forces: bool = False  # FORC's values have the contact force as factor
    counts_from_output: bool = False  # RODP's N counts steps since the last output
    strains_precede_step: bool = False  # strains of the field before RODP's step
    contact_at_every_step: bool = False  # on tape9, instead of every N-th
    ends_at_check: bool = False  # CHEC ends the program


REPORT_PLATE = PlateVariant()
REPORT_IMPACT = ImpactVariant()


class Variant(NamedTuple):
    """Parameters of all parts."""

    plate: PlateVariant
    impact: ImpactVariant
    program: ProgramVariant


def variant_of(slips: frozenset[str]) -> Variant:
    """Parameters of the parts with these slips."""
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
        clock_stands="time" in slips,
        table_stands="prop" in slips,
        prop_replaces_contact="prop-contact" in slips,
        contact_scales_forces="force-scale" in slips,
        counts_from_output="counter" in slips,
        strains_precede_step="tapes" in slips,
        contact_at_every_step="tapes" in slips,
        ends_at_check="check-end" in slips,
    )
    return Variant(plate, impact, program)
