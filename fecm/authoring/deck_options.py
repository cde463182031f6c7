"""Values of a new deck, declared once: name, type, default and help of each.

:class:`ImpactOptions` has the values of :func:`fecm.impact` and ``fecm new``,
:class:`PlateDeckOptions` the values of :func:`fecm.plate_deck`, and :class:`DeckOptions` the values
that both take. Signatures, docstrings, options of the command and its help page follow from the
fields. A parameter in backquotes is an
option on the help page.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Literal, get_args

from fecm._options import documented, option
from fecm.authoring.contact import AnyContact, Sphere
from fecm.authoring.laminate import Laminate, Layup
from fecm.authoring.masses import PlacedMass
from fecm.authoring.mesh import InPlane
from fecm.authoring.parameters import ObjectError, check_kind
from fecm.authoring.plate import DropWeight, Plate
from fecm.deck.catalogue import NamedContact
from fecm.deck.grid import IN_PLANE
from fecm.deck.model import Indentation, Patch, Projectile
from fecm.deck.quantities import text_of
from fecm.judge.validity import DEFLECTION
from fecm.judge.validity import InPlane as MembraneEdges
from fecm.mechanics.projectile import DeckProjectile, RigidMass, Rod

AUTO = "auto"  # the default patch: a disc, or Hertz's patch with a standard
EQUI: Literal["equi"] = "equi"  # shear stiffness from equilibrium
Quadrature = Literal["mitc", "full"]  # treatment of transverse shear
MITC: Quadrature = "mitc"
FULL: Quadrature = "full"
Kinematics = Literal["auto", "linear", "von-karman"]
Precision = Literal["single", "double"]
AUTO_KINEMATICS: Kinematics = "auto"  # the static estimate of the deflection decides
LINEAR: Literal["linear"] = "linear"
VON_KARMAN: Literal["von-karman"] = "von-karman"
# Largest deflection over the thickness of a linear plate, auto.
LIMIT = DEFLECTION[MembraneEdges.UNKNOWN].value

AnyProjectile = DeckProjectile | Projectile | str


@dataclass(frozen=True)
class DeckOptions:
    """Values of a new deck with or without an impact."""

    plate: Plate
    laminate: Laminate
    _: KW_ONLY
    patch: str | Patch | None = option(
        AUTO,
        "Area of the contact force: disc or hertz, with :RADIUS[UNIT], which elements there "
        "should not exceed; or none, a point force.  D7136 takes hertz.",
        python="None is a force on the nearest node.",
        default_text="disc",
        group="Numerics",
    )
    shear: Quadrature = option(
        MITC,
        "Transverse shear: assumed strains, or full quadrature.",
        group="Numerics",
        choices=get_args(Quadrature),
    )
    shear_factor: float | Literal["equi"] | None = option(
        None,
        "Factor of the transverse shear stiffness, or equi, the stiffness from equilibrium (SHEA "
        "EQUI).",
        default_text="equi; with `shear` full 1",
        group="Numerics",
    )
    units: str | None = option(
        None,
        "Units of length, force and time, as in mm-N-s, or of length, time and mass, as in "
        "mm-ms-kg.  Named plies and contacts are converted to them.",
        default_text="those of the source of a named ply",
    )
    in_plane: InPlane | None = option(
        None,
        "In-plane displacements on the supports of a curved or von-karman plate, or a coupled "
        "laminate: held, normal (held across the edge only), tangential (held along it only) or "
        "free.",
        python="Pinned edges always hold both.",
        default_text="held; with `radius_x` or `radius_y` tangential on simple edges; on a fixture "
        "free",
        group="Supports",
        choices=list(IN_PLANE),
    )
    radius_x: float | str | None = option(
        None,
        "Radius of a shallow curved panel (CURV) along x, also with a unit, as in 1m; positive if "
        "the struck face is the hollow one.",
        group="Plate",
        metavar="R[UNIT]",
    )
    radius_y: float | str | None = option(
        None, "The same along y.", group="Plate", metavar="R[UNIT]"
    )
    preload: Sequence[float | str] | None = option(
        None,
        "Membrane force in the plate before the impact (PREL), force/length, tension positive; in "
        "the deck's units or with a unit, as in -50N/mm,0.",
        python="As N0x, N0y and perhaps N0xy.",
        group="Plate",
    )
    gages: Iterable[tuple[float | str, float | str, float | str, float]] = option(
        (),
        "Strain gages: x, y and z (length, z from the mid-plane) and direction (degrees) of each.",
    )
    cure: float | str | None = option(
        None,
        "Residual stresses of the cure (CURE) of a named ply with coefficients of expansion: "
        "change of temperature since the plies were free of stress, as in -100; or the stress-free "
        "temperature, by default the ply's, and the temperature of use, as in 177:20 or :20.",
        group="Laminate",
        metavar="DT|FREE:USE",
    )
    masses: Iterable[PlacedMass] = option(
        (),
        "Point mass (MASS) at the node nearest to X,Y, and its rotary inertia, in the deck's units "
        "or with units, as in 20,30:5g.",
        python="As x, y, mass, and perhaps the rotary inertia, of each.",
        group="Plate",
        flag="--mass-at",
    )
    title: str | None = option(
        None,
        "Title of the deck.",
        default_text="plate, layup, ply, and energy of an impact",
        group="Other options",
    )
    zones: Sequence[tuple[str | Sequence[float | str], Layup | Laminate]] = option(
        (),
        "Layup, from the same materials, of elements whose centres lie in a rectangle, or of a "
        "group of surfaces of the mesh, as in PATCH:[0/90]4s.  A later zone overrides an earlier "
        "one.",
        python="As pairs of a place, a rectangle (x0, y0, x1, y1) or the name of a group, and a "
        "layup, or a Laminate of other materials.  All laminates share the mid-plane.",
        group="Laminate",
        flag="--zone",
    )

    @property
    def test(self) -> DropWeight | None:
        """Values that the standard of the fixture prescribes; None without a standard."""
        return self.plate.fixture.test if self.plate.fixture else None

    def check(self) -> None:
        """Raise ObjectError if a value is not an object of fecm, or a text is invalid."""
        check_kind("plate", self.plate, Plate)
        check_kind("laminate", self.laminate, Laminate)
        check_kind("patch", self.patch, str | Patch | None)
        check_choice("shear", self.shear, get_args(Quadrature))
        check_choice("in_plane", self.in_plane, (None, *IN_PLANE))
        if "\n" in (self.title or ""):
            raise ObjectError("`title` has more than one line")


@documented
@dataclass(frozen=True)
class ImpactOptions(DeckOptions):
    """Values of the deck of an impact.

    Parameters
    ----------
    plate : Plate
        Mesh and supports.
    laminate : Laminate
        Layup and ply.
    {parameters}
    """

    projectile: Rod | RigidMass | Projectile | str | None = option(
        None,
        "Projectile in the units of the deck, or a rigid mass with its unit, as in 5.5kg.",
        default_text="the mass that the standard of a fixture prescribes; in lbf, in and s the "
        "report's rod",
        group="Impact",
    )
    contact: Indentation | NamedContact | Sphere | str | None = option(
        None,
        "Indentation law, as :class:`Contact`, or the name of a published law.",
        group="Impact",
    )
    _: KW_ONLY
    velocity: float | str | None = option(
        None,
        "Approach velocity in the deck's units, or with a unit, as in 3m/s.",
        group="Impact",
        metavar="V[UNIT]",
    )
    energy: float | str | None = option(
        None,
        "Impact energy instead of `velocity`: in the deck's units (mJ in mm-N-s), or with a unit, "
        "as in 10J.",
        group="Impact",
        metavar="E[UNIT]",
    )
    at: tuple[float | str, float | str] | None = option(
        None,
        "Impact point.",
        python="The projectile hits the nearest node.  On an imported mesh the patch is centred at "
        "the point itself.",
        default_text="the plate's centre",
        group="Impact",
    )
    duration: float | str | None = option(
        None,
        "Simulated time, also with a unit, as in 4ms.",
        python="The expected time is 1.25 half periods of the projectile on the plate, or 1.1 "
        "times the duration of the contact with the indentation if that is longer.",
        default_text="until the impact is over (OVER), at most 4 times the expected time",
        group="Numerics",
        metavar="T[UNIT]",
    )
    dt: float | str | None = option(
        None,
        "Time step, also with a unit, as in 0.5us.",
        default_text="0.9 of the critical one",
        group="Numerics",
        metavar="T[UNIT]",
    )
    every: int | None = option(
        None,
        "Steps between stored rows.",
        default_text="for about 100 rows of displacements and 50 of strains",
        group="Numerics",
    )
    precision: Precision = option(
        "single",
        "Precision of stored displacements, strains and stresses; single also "
        "compresses the file (COMP).",
        choices=get_args(Precision),
        group="Numerics",
    )
    plies: int | bool | tuple[int, int] | None = option(
        None,
        "Store ply stresses at every N-th step (PLYS), of all elements or the M nearest to the "
        "load; 0 stores none.",
        python="A pair has N and M; True stores about 20 rows.  :attr:`Result.plies` has them.",
        default_text="with `damage` about 20 rows of the elements around the load",
        group="Numerics",
    )
    failure: int | bool | None = option(
        None,
        "Evaluate the failure criteria at every N-th step (ALLO, FAIL); needs a named ply with "
        "strengths.",
        python="True evaluates them as by default.",
        default_text="with `damage` as `every`, or about 200 times",
        group="Numerics",
        metavar="N",
    )
    kinematics: Kinematics | None = option(
        None,
        "Linear plate, or one that stretches as it bends (von-karman: NONL); auto takes the "
        f"latter where the static estimate of the deflection exceeds {LIMIT:g} of the thickness.",
        python="With von-karman `shear` must be mitc.",
        default_text=AUTO_KINEMATICS,
        group="Plate",
        choices=get_args(Kinematics),
    )
    nonlinear: bool | None = option(
        None,
        "The same as `kinematics` von-karman.",
        python="False is the same as linear.",
        group="Plate",
    )
    damage: bool = option(
        False,
        "Add strengths and toughness of a named ply: failure exposures (ALLO, FAIL), ply "
        "stresses around the load (PLYS) and the delamination threshold (DELA).",
        group="Laminate",
    )
    giic: float | str | None = option(
        None,
        "Toughness G_IIc of the delamination threshold (DELA), force/length, also with a unit, as "
        "in 800J/m^2; replaces the toughness of a named ply.",
        group="Laminate",
        metavar="G[UNIT]",
    )

    def check(self) -> None:
        """Raise ObjectError if a value is not an object of fecm, or a text is invalid."""
        super().check()
        check_kind("projectile", text_of(self.projectile), AnyProjectile | None)
        check_kind("contact", self.contact, AnyContact | None)
        check_choice("kinematics", self.kinematics, (None, *get_args(Kinematics)))

    def chosen_kinematics(self) -> Kinematics:
        """Return the kinematics; raise ObjectError if its two options contradict each other."""
        if self.nonlinear is None:
            return self.kinematics or AUTO_KINEMATICS
        named = VON_KARMAN if self.nonlinear else LINEAR
        if self.kinematics in (None, named):
            return named
        raise ObjectError(
            f"`kinematics` is {self.kinematics}, and `nonlinear` means {named}: give one"
        )


@documented
@dataclass(frozen=True)
class PlateDeckOptions(DeckOptions):
    r"""Values of the deck of a plate without an impact.

    Parameters
    ----------
    plate : Plate
        Mesh and supports.
    laminate : Laminate
        Layup and ply.
    program : str
        Cards of the macro program, between MACR and END: ``"LMAS\nEIGE,,3"`` for the three lowest
        modes, ``"TANG\nFORM\nSOLV\nDISP"`` for the static deflection.
    {parameters}
    """

    program: str
    _: KW_ONLY
    force: float | str | None = option(
        None,
        "Static transverse force, positive along w, also with a unit, as in 1kN.  PROP scales it.",
    )
    at: tuple[float | str, float | str] | None = option(
        None, "Place of the force.", default_text="the plate's centre"
    )
    kinematics: Literal["linear", "von-karman"] = option(
        LINEAR,
        "Linear plate, or one that stretches as it bends (von-karman: NONL), whose static solution "
        "is a loop with TANG, FORM, SOLV and CONV.",
    )
    failure: bool = option(
        False, "Add the strengths of named plies, for FAIL and PLYS in the program."
    )

    def check(self) -> None:
        """Raise ObjectError if a value is not an object of fecm, or a text is invalid."""
        super().check()
        check_choice("kinematics", self.kinematics, (LINEAR, VON_KARMAN))
        if not isinstance(self.program, str):
            raise ObjectError(f"`program` is {self.program!r}, not the cards of a macro program")
        if self.force is None and self.at is not None:
            raise ObjectError("`at` is the place of `force`: give both, or none")


def check_choice(name: str, value: str | None, choices: Sequence[str | None]) -> None:
    """Raise ObjectError if a text is not one of the choices."""
    if value not in choices:
        listed = ", ".join(choice for choice in choices if choice is not None)
        raise ObjectError(f"`{name}` is {value!r}, none of {listed}")
