"""``fecm new``."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import click
from click import option
from click.core import ParameterSource

from fecm._files import check_outputs
from fecm.authoring.contact import Sphere, parse_patch
from fecm.authoring.impact import Authored, ImpactParameters, Request, author
from fecm.authoring.mesh import InPlane
from fecm.authoring.numerics import (
    AUTO,
    FULL,
    LIMIT,
    MITC,
    Kinematics,
    Numerics,
    Quadrature,
    kinematics_of,
)
from fecm.authoring.parameters import ObjectError
from fecm.authoring.plate import CUSTOM, FIXTURES, Plate, Support
from fecm.authoring.zones import Zone
from fecm.cli import new_values
from fecm.cli.common import DASH, RefusedError, echo, echo_path, note, write_text
from fecm.cli.isolation import reads
from fecm.cli.laminate_options import LaminateOptions, as_options, laminate_options, unique
from fecm.cli.options import (
    FILE_PATH,
    POSITIVE,
    Finite,
    GroupedCommand,
    Parsed,
    assignment,
    collected,
    list_of,
    typical,
)
from fecm.deck.catalogue import (
    NamedContact,
)
from fecm.deck.format import format_deck
from fecm.deck.grid import IN_PLANE, SUPPORTS
from fecm.deck.macros import RowsOfPlies
from fecm.deck.model import Deck, Indentation, Material, Nonlinear, Patch, Ply, Shear
from fecm.mechanics.points import DISC, RADIUS_PER_THICKNESS
from fecm.mechanics.projectile import RigidMass, Rod
from fecm.problem.loading import load_deck
from fecm.problem.plate_mesh import BOUNDARY

RECTANGLE = ("size", "grading", "columns", "rows")  # besides the mesh
FIXED = ("size", "columns", "rows", "support", "edges")  # options that a fixture sets

GROUPS = {
    "Plate": (
        "size",
        "mesh",
        "grading",
        "columns",
        "rows",
        "radius_x",
        "radius_y",
        "kinematics",
        "nonlinear",
        "preload",
    ),
    "Laminate": (
        "layup",
        "ply_thickness",
        "material",
        "file",
        "ply",
        "ply_of",
        "core",
        "zone",
        "units",
        "damage",
        "giic",
        "cure",
    ),
    "Supports": ("fixture", "support", "edges", "in_plane"),
    "Impact": ("energy", "velocity", "at", "projectile", "contact", "law"),
    "Numerics": ("patch", "shear", "shear_factor", "duration", "dt", "every", "plies", "failure"),
}


@dataclass(frozen=True)
class NewOptions:
    """Argument and options of ``fecm new``."""

    output: Path
    overwrite: bool
    title: str | None
    size: tuple[float, float] | None
    mesh: tuple[int, int] | Path | None
    grading: float
    columns: str
    rows: str
    radius_x: str | None
    radius_y: str | None
    kinematics: Kinematics | None
    nonlinear: bool
    preload: tuple[str, ...] | None
    laminate: LaminateOptions
    damage: bool
    giic: str | None
    cure: str | None
    ply_of: dict[str, Ply]
    core: tuple[tuple[str, float], ...]
    zone: tuple[Zone, ...]
    support: Support
    edges: tuple[tuple[str, Support], ...]
    fixture: str | None
    in_plane: InPlane | None
    at: tuple[float, float] | None
    velocity: str | None
    energy: str | None
    law: tuple[float, float, float, float] | None
    contact: NamedContact | Sphere | None
    projectile: Rod | RigidMass | None
    patch: Patch | None
    shear: Quadrature
    shear_factor: float | Literal["equi"] | None
    duration: str | None
    dt: str | None
    every: int | None
    plies: tuple[int, ...] | None
    failure: int | None

    def plate(self, on_command_line: Collection[str]) -> Plate:
        """Return mesh and supports; `on_command_line` are the options on the command line."""
        if self.fixture:
            return self._plate_on_fixture(self.fixture, on_command_line)
        if isinstance(self.mesh, Path):
            for name in RECTANGLE:
                if name in on_command_line:
                    raise ObjectError(f"`mesh` is a file; leave out `{name}`")
            supports = {BOUNDARY: self.support} if "support" in on_command_line else {}
            return Plate.from_mesh(self.mesh, supports | dict(self.edges))
        return Plate.rectangle(
            self.size,
            self.mesh,
            support=self.support,
            edges=dict(self.edges),
            grading=self.grading,
            columns=self.columns,
            rows=self.rows,
        )

    def _plate_on_fixture(self, fixture: str, on_command_line: Collection[str]) -> Plate:
        """Return a plate on a fixture, which has its own size and supports."""
        for name in FIXED:
            if name in on_command_line:
                raise ObjectError(f"`fixture` has its own plate and supports; leave out `{name}`")
        if isinstance(self.mesh, Path):
            raise ObjectError("`fixture` has its own plate and supports; `mesh` is NXxNY")
        grading = self.grading if "grading" in on_command_line else None
        return Plate.on_fixture(fixture, self.mesh, grading=grading)


@click.command(
    "new",
    cls=GroupedCommand,
    groups=GROUPS,
    short_help="Write a deck from plate, layup, supports and impact.",
    epilog=typical(
        'fecm new d7136.inp --fixture D7136 --layup "[45/0/-45/90]4s" --material IM7/8552 '
        "--energy 10J --damage",
        'fecm new plate.inp --size 100x80 --mesh 10x8 --support clamped --layup "[0/90]4s" '
        "--material IM7/8552 --projectile mass:1e-3 --contact estimate:8 --velocity 3m/s "
        "--duration 1ms",
    ),
)
@click.argument("output", type=FILE_PATH, metavar="DECK")
@option("--title", help="Title of the deck.  [default: plate, layup, ply and energy]")
@option(
    "--size",
    type=list_of("6x4", POSITIVE, [2], "[xX×]"),
    metavar="LXxLY",
    help="Size of the plate, as in 6x4.",
)
@option(
    "--mesh",
    type=Parsed(new_values.mesh_of_text, "NXxNY|FILE"),
    help="Elements along x and y, as in 14x10; or a mesh, Gmsh's .msh or another that meshio "
    "reads, with groups of lines for --edge.",
)
@option(
    "--grading",
    type=Finite(min=1.0),
    default=1.0,
    metavar="RATIO",
    help="Length of the largest over the smallest element; the smallest is at the impact point.",
)
@option(
    "--columns",
    default="",
    metavar="LIST",
    help="Elements along x one by one, as in 3*0.5,8*0.375,3*0.5, instead of --size and --mesh.",
)
@option("--rows", default="", metavar="LIST", help="The same along y.")
@option(
    "--radius-x",
    metavar="R[UNIT]",
    help="Radius of a shallow curved panel (CURV) along x, also with a unit, as in 1m; positive if "
    "the struck face is the hollow one.",
)
@option("--radius-y", metavar="R[UNIT]", help="The same along y.")
@option(
    "--kinematics",
    type=click.Choice(list(get_args(Kinematics))),
    help="Linear plate, or one that stretches as it bends (von-karman: NONL); auto takes the "
    f"latter where the static estimate of the deflection exceeds {LIMIT:g} of the thickness.  "
    "[default: auto]",
)
@option("--nonlinear", is_flag=True, help="The same as --kinematics von-karman.")
@option(
    "--preload",
    type=list_of("NX,NY[,NXY]", str, [2, 3]),
    help="Membrane force in the plate before the impact (PREL), force/length, tension positive; "
    "in the deck's units or with a unit, as in -50N/mm,0.",
)
@laminate_options(required=True)
@option(
    "--ply-of",
    type=Parsed(new_values.ply_of, "NAME=RHO,NU12,E1,E2,G12,G13,G23"),
    multiple=True,
    callback=lambda context, parameter, values: unique(values, context, parameter),
    help="Constants of a material, in the deck's units.  NAME is a letter of the layup, or a core.",
)
@option(
    "--core",
    type=Parsed(new_values.core, "NAME:T"),
    multiple=True,
    help="Core of a sandwich and its thickness, as in Divinycell-H60:10: a named material, which "
    "is K in the layup, as in [0/90/K/90/0]; or a letter of the layup.",
)
@option(
    "--zone",
    type=Parsed(new_values.zone, "X0,Y0,X1,Y1:LAYUP"),
    multiple=True,
    help="Layup, from the same materials, of elements whose centres lie in a rectangle, or of a "
    "group of surfaces of the mesh, as in PATCH:[0/90]4s.  A later zone overrides an earlier one.",
)
@option(
    "--damage",
    is_flag=True,
    help="Add strengths and toughness of a named ply: failure exposures (ALLO, FAIL), ply "
    "stresses around the load (PLYS) and the delamination threshold (DELA).",
)
@option(
    "--giic",
    metavar="G[UNIT]",
    help="Toughness G_IIc of the delamination threshold (DELA), force/length, also with a unit, as "
    "in 800J/m^2; replaces the toughness of a named ply.",
)
@option(
    "--cure",
    metavar="DT|FREE:USE",
    help="Residual stresses of the cure (CURE) of a named ply with coefficients of expansion: "
    "change of temperature since the plies were free of stress, as in -100; or the stress-free "
    "temperature, by default the ply's, and the temperature of use, as in 177:20 or :20.",
)
@option(
    "--support",
    type=click.Choice(tuple(SUPPORTS)),
    default="free",
    show_default=True,
    help="Support of all edges: simple holds w and the rotation along the edge (a hard support).",
)
@option(
    "--edge",
    "edges",
    type=Parsed(assignment, "EDGE=SUPPORT"),
    multiple=True,
    help="Support of one edge: left, right, bottom or top, or a group of the mesh; may be "
    "repeated.",
)
@option(
    "--fixture",
    metavar="NAME",
    help=f"Fixture of a drop-weight test: {', '.join(FIXTURES)} or {CUSTOM}, a plate on the "
    "edges of a window; --mesh then counts the window's elements.",
)
@option(
    "--in-plane",
    type=click.Choice(list(IN_PLANE)),
    help="In-plane displacements on the supports of a curved or von-karman plate, or a coupled "
    "laminate: held, normal (held across the edge only), tangential (held along it only) or free.  "
    "[default: held; with --radius-x or --radius-y tangential on simple edges; with --fixture "
    "free]",
)
@option(
    "--at", type=list_of("X,Y", Finite(), [2]), help="Impact point.  [default: the plate's centre]"
)
@option(
    "--velocity",
    metavar="V[UNIT]",
    help="Approach velocity in the deck's units, or with a unit, as in 3m/s.",
)
@option(
    "--energy",
    metavar="E[UNIT]",
    help="Impact energy instead of --velocity: in the deck's units (mJ in mm-N-s), or with a "
    "unit, as in 10J.",
)
@option(
    "--law",
    type=list_of("K,ALPHA_P,S_P,Q", Finite(), [4]),
    help="Parameters of the indentation law.",
)
@option(
    "--contact",
    type=Parsed(new_values.contact, "NAME"),
    help="Named law, instead of --law; `fecm indent contacts` lists them.  "
    f"{new_values.ESTIMATE} estimates the k of a sphere (default: steel) as `fecm indent estimate` "
    "does.",
)
@option(
    "--projectile",
    type=Parsed(new_values.projectile, "PROJECTILE"),
    help="mass:M, or rod:LENGTH,DIAMETER,E,DENSITY.  [default in lbf, in and s: the report's rod]",
)
@option(
    "--patch",
    type=Parsed(parse_patch, "PATCH"),
    default="disc",
    show_default=True,
    help="Area of the contact force: disc or hertz, with :RADIUS, to which a rectangle's mesh "
    "is then refined; or none, a point force.  D7136 takes hertz.",
)
@option(
    "--shear",
    type=click.Choice([MITC, FULL]),
    default=MITC,
    show_default=True,
    help="Transverse shear: assumed strains, or full quadrature.",
)
@option(
    "--shear-factor",
    type=Parsed(new_values.shear_factor, "K|equi"),
    help="Factor of the transverse shear stiffness, or equi, the stiffness from equilibrium "
    "(SHEA EQUI).  [default: equi; with --shear full 1]",
)
@option(
    "--duration",
    metavar="T[UNIT]",
    help="Simulated time, also with a unit, as in 4ms.  [default: until the impact is over (OVER), "
    "at most 4 times the expected time]",
)
@option(
    "--dt",
    metavar="T[UNIT]",
    help="Time step, also with a unit, as in 0.5us.  [default: 0.9 of the critical one]",
)
@option(
    "--every",
    type=click.IntRange(min=1),
    help="Steps between stored rows.  [default: for about 200 rows]",
)
@option(
    "--plies",
    type=list_of("N[,M]", click.IntRange(min=0), [1, 2]),
    help="Store ply stresses at every N-th step (PLYS), of all elements or the M nearest to the "
    "load; 0 stores none.  [default with --damage: about 20 rows of the elements around the load]",
)
@option(
    "--failure",
    type=click.IntRange(min=1),
    metavar="N",
    help="Evaluate the failure criteria at every N-th step (ALLO, FAIL); needs a named ply with "
    "strengths.  [default with --damage: as --every]",
)
@option("--overwrite", is_flag=True, help="Replace an existing deck.")
@reads("mesh")
@collected(NewOptions)
def new_command(options: NewOptions) -> None:
    """Write a deck that is ready to run from plate, layup, supports and impact.

    DECK is the file to write; - is standard output.
    """
    output, overwrite = options.output, options.overwrite
    to_file = output != DASH
    if to_file:
        check_outputs([output], overwrite)
    context = click.get_current_context()
    source = context.get_parameter_source
    on_command_line = {
        name for name in context.params if source(name) is ParameterSource.COMMANDLINE
    }
    try:
        authored = _author(options, on_command_line)
    except (ObjectError, ImportError) as error:
        raise click.UsageError(as_options(str(error), context.params)) from None
    notes = [as_options(text, context.params) for text in (*authored.doubts, *authored.notes)]
    notes += _additions(authored.deck)
    text = authored.comments + format_deck(authored.deck.to_text())
    prepared = load_deck(text)
    if errors := prepared.errors():
        note(*(as_options(text, context.params) for text in authored.doubts))
        for finding in errors:
            echo(finding.render("the new deck"), err=True)
        raise RefusedError("these options do not give a valid deck; nothing was written")
    note(*notes)
    for finding in prepared.findings:
        echo(finding.render(str(output) if to_file else "the new deck"), err=True)
    write_text(output, text, overwrite=overwrite)
    if to_file:
        echo_path(output)


def _author(options: NewOptions, on_command_line: Collection[str]) -> Authored:
    """Return the deck of the options of ``fecm new``.

    `on_command_line` has the options on the command line.
    """
    plate = options.plate(on_command_line)
    prescribed = plate.fixture is not None and plate.fixture.test is not None
    law, contact = options.law, options.contact
    if (law is None) == (contact is None) and (law is not None or not prescribed):
        raise ObjectError("give either `law` or `contact`")
    laminate = options.laminate
    return author(
        Request(
            plate,
            laminate.authored(options.ply_of, options.core),
            ImpactParameters(
                options.projectile,
                contact if law is None else Indentation(*law),
                options.velocity,
                options.energy,
                options.at,
            ),
            Numerics(
                options.patch if "patch" in on_command_line else AUTO,
                options.shear,
                options.shear_factor,
                options.duration,
                options.dt,
                options.every,
                _rows_of_plies(options.plies),
                options.failure,
                options.damage,
            ),
            units=laminate.units,
            in_plane=options.in_plane,
            radius_x=options.radius_x,
            radius_y=options.radius_y,
            kinematics=kinematics_of(options.kinematics, options.nonlinear or None),
            preload=options.preload,
            giic=options.giic,
            cure=options.cure,
            title=options.title,
            zones=options.zone,
        )
    )


def _rows_of_plies(numbers: tuple[int, ...] | None) -> RowsOfPlies | None:
    """Return the steps between rows of ply stresses, and perhaps the number of elements."""
    if numbers is None:
        return None
    steps, *elements = numbers
    return (steps, elements[0]) if elements else steps or False


def _additions(deck: Deck) -> list[str]:
    """List what a deck has by default besides the cards of the report's program."""
    parts: list[str] = []
    options: list[str] = []
    if (patch := deck.last(Patch)) is not None:
        share = RADIUS_PER_THICKNESS[patch.shape]
        thickness = deck.require(Material).integration.thickness
        radius = patch.radius or share * thickness
        about = "" if patch.radius else f" ({share:g} of the thickness)"
        pressure = "a uniform pressure" if patch.shape == DISC else "Hertz's pressure"
        parts.append(f"{pressure} of radius {radius:.4g}{about} instead of a point force (PATC)")
        options.append("--patch none")
    if (shear := deck.last(Shear)) is not None and not deck.has(Nonlinear):
        words = " ".join([Shear.keyword, *shear.words()])
        if shear.assumed:
            parts.append(f"assumed shear strains ({words})")
        elif shear.equilibrium:
            parts.append(f"shear stiffness from equilibrium ({words})")
        options.append("--shear full")
    if not parts:
        return []
    them = "them" if len(parts) > 1 else "it"
    return [f"the deck has {' and '.join(parts)}; omit {them} with {' and '.join(options)}"]
