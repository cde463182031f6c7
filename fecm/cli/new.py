"""``fecm new``."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import click
from click import option
from click.core import ParameterSource

from fecm._files import check_outputs
from fecm._machine import format_bytes
from fecm._text import printable
from fecm.authoring.deck_options import AUTO, ImpactOptions
from fecm.authoring.elastic_edges import FORM, SPRING
from fecm.authoring.new_deck import author
from fecm.authoring.parameters import ObjectError
from fecm.authoring.plate import CUSTOM, FIXTURES, Plate, Window
from fecm.cli import new_values
from fecm.cli.common import DASH, RefusedError, echo_findings, echo_path, inform, note, write_text
from fecm.cli.isolation import reads
from fecm.cli.laminate_options import LaminateOptions, as_options, laminate_options, unique
from fecm.cli.options import (
    FILE_PATH,
    POSITIVE,
    Finite,
    GroupedCommand,
    Parsed,
    collected,
    groups_of,
    job_options,
    list_of,
    typical,
)
from fecm.deck.format import format_deck
from fecm.deck.grid import SUPPORTS
from fecm.deck.macros import EXTENDED
from fecm.deck.model import Compact, Deck, Indentation, Material, Nonlinear, Patch, Ply, Shear
from fecm.mechanics.points import DISC, RADIUS_PER_THICKNESS
from fecm.problem.loading import load_deck
from fecm.problem.plate_mesh import BOUNDARY
from fecm.problem.problem import Problem
from fecm.problem.summary import format_rows

RECTANGLE = ("size", "grading", "columns", "rows")  # besides the mesh
OF_FIXTURE = ("window", "clamps")  # options of a fixture
FIXED = ("size", "columns", "rows", "support", "edges")  # options that a fixture sets

# Headings of the help page, with the command's own options before and after those of the deck.
FIRST = {
    "Plate": ["size", "mesh", "grading", "columns", "rows"],
    "Laminate": ["layup", "ply_thickness", "material", "file", "ply", "ply_of", "core", "units"],
    "Supports": ["fixture", "window", "clamps", "support", "edges"],
}
LAST = {
    "Plate": [],
    "Laminate": [],
    "Supports": [],
    "Impact": ["law"],
    "Numerics": [],
    "Other options": ["overwrite"],
}


@dataclass(frozen=True)
class PlateOptions:
    """Mesh and supports of a plate, or its fixture."""

    size: tuple[float, float] | None
    mesh: tuple[int, int] | Path | None
    grading: float
    columns: str
    rows: str
    support: str
    edges: tuple[tuple[str, str], ...]
    fixture: str | None
    window: Window
    clamps: str | None

    def plate(self, on_command_line: Collection[str]) -> Plate:
        """Return mesh and supports; `on_command_line` are the options on the command line."""
        if self.fixture:
            return self._plate_on_fixture(self.fixture, on_command_line)
        for name in OF_FIXTURE:
            if name in on_command_line:
                raise ObjectError(f"`{name}` belongs to a `fixture`")
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
        return Plate.on_fixture(
            fixture,
            self.mesh,
            grading=grading,
            window=self.window,
            clamps=self.clamps,
        )


ARGUMENTS = "fecm.arguments"  # of the command, in the context
WIDTH = 98  # of comment lines


class NewCommand(GroupedCommand):
    """Command that knows its arguments as they were typed."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the arguments, and parse them."""
        ctx.meta[ARGUMENTS] = list(args)
        return super().parse_args(ctx, args)


def _command_comment(arguments: Sequence[str], output: Path) -> str:
    """Return comment lines with the command that writes the deck again."""
    words = [output.name if word == str(output) else word for word in arguments]
    lines = ["! fecm new"]
    for word in (shlex.quote(printable(word)) for word in words if word != "--overwrite"):
        if len(lines[-1]) + len(word) > WIDTH:
            lines[-1] += " \\"
            lines.append("!  ")
        lines[-1] += f" {word}"
    return "\n".join([*lines, ""])


@click.command(
    "new",
    cls=NewCommand,
    groups=groups_of(ImpactOptions, LAST, FIRST),
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
@job_options(
    ImpactOptions,
    patch={"default": "disc", "metavar": "PATCH"},
    shear_factor={"type": Parsed(new_values.shear_factor, "K|equi")},
    preload={"type": list_of("NX,NY[,NXY]", str, [2, 3])},
    masses={"type": Parsed(new_values.mass_at, "X,Y:M[,J]")},
    zones={"type": Parsed(new_values.zone, "X0,Y0,X1,Y1:LAYUP")},
    projectile={
        "type": Parsed(new_values.projectile, "PROJECTILE"),
        "help": f"{new_values.PROJECTILE_FORMS}.  [default in lbf, in and s: the report's rod]",
    },
    contact={
        "type": Parsed(new_values.contact, "NAME"),
        "help": "Named law, instead of --law; `fecm indent contacts` lists them.  "
        f"{new_values.ESTIMATE} estimates the k of a sphere (default: steel) as `fecm indent "
        "estimate` does.",
    },
    at={"type": list_of("X,Y", Finite(), [2])},
    every={"type": click.IntRange(min=1)},
    plies={"type": Parsed(new_values.rows_of_plies, "N[,M]")},
    failure={"type": click.IntRange(min=1)},
    nonlinear={"is_flag": True, "default": None},
)
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
    "--support",
    type=Parsed(new_values.support, "SUPPORT", (*SUPPORTS, f"{SPRING}:")),
    default="free",
    show_default=True,
    help=f"Support of all edges: {', '.join(SUPPORTS)}, or springs, {FORM}.  simple holds w and "
    "the rotation along the edge (a hard support), soft holds w alone: frequencies of angle plies "
    "are up to 6 % lower.  Springs have KR, moment per rotation across the edge and length, and "
    "KW, force per length and deflection, also with units, as in spring:10kN,10N/mm^2; without KW "
    "the edge also holds what simple does.",
)
@option(
    "--edge",
    "edges",
    type=Parsed(new_values.edge, "EDGE=SUPPORT"),
    multiple=True,
    help="Support of one edge: left, right, bottom or top, or a group of the mesh, as in "
    "left=clamped or left=spring:10kN; may be repeated.",
)
@option(
    "--fixture",
    metavar="NAME",
    help=f"Fixture of a drop-weight test: {', '.join(FIXTURES)} or {CUSTOM}, a plate on the "
    "edges of a window; --mesh then counts the window's elements.",
)
@option(
    "--window",
    type=click.Choice(get_args(Window)),
    default="held",
    show_default=True,
    help="Edges of the window: held, where they pull as well, or push (UNIL). The real plate lies "
    "between both.",
)
@option(
    "--clamps",
    metavar="K|held",
    help="Clamps of D7136: the stiffness of each, force/length, also with a unit, as in 2kN/mm; or "
    "held, w = 0 at their tips.  [default: no clamps]",
)
@option(
    "--law",
    type=list_of("K,ALPHA_P,S_P,Q", Finite(), [4]),
    help="Parameters of the indentation law.",
)
@option("--overwrite", is_flag=True, help="Replace an existing deck.")
@reads("mesh")
@collected(PlateOptions, "plate")
def new_command(
    output: Path,
    options: dict[str, Any],
    plate: PlateOptions,
    laminate: LaminateOptions,
    ply_of: dict[str, Ply],
    core: tuple[tuple[str, float], ...],
    law: tuple[float, float, float, float] | None,
    overwrite: bool,
) -> None:
    """Write a deck that is ready to run from plate, layup, supports and impact.

    DECK is the file to write; - is standard output.
    """
    to_file = output != DASH
    if to_file:
        check_outputs([output], overwrite)
    context = click.get_current_context()
    source = context.get_parameter_source
    on_command_line = {
        name for name in context.params if source(name) is ParameterSource.COMMANDLINE
    }
    if "patch" not in on_command_line:
        options["patch"] = AUTO
    try:
        built = plate.plate(on_command_line)
        prescribed = built.fixture is not None and built.fixture.test is not None
        contact = options["contact"]
        if (law is None) == (contact is None) and (law is not None or not prescribed):
            raise ObjectError("give either `law` or `contact`")
        if law is not None:
            options["contact"] = Indentation(*law)
        plies = laminate.authored(ply_of, core)
        authored = author(ImpactOptions(built, plies, units=laminate.units, **options))
    except (ObjectError, ImportError) as error:
        raise click.UsageError(as_options(str(error), context.params)) from None
    doubts, notes = (
        [as_options(text, context.params) for text in texts]
        for texts in (authored.doubts, authored.notes)
    )
    command = _command_comment(context.meta[ARGUMENTS], output)
    text = command + authored.comments + format_deck(authored.deck.to_text())
    prepared = load_deck(text)
    if errors := prepared.errors():
        note(*doubts)
        echo_findings(errors, "the new deck")
        raise RefusedError("these options do not give a valid deck; nothing was written")
    note(*doubts)
    inform(*notes, *_additions(authored.deck), *map(_about_file, prepared.problems))
    echo_findings(prepared.findings, str(output) if to_file else "the new deck")
    write_text(output, text, overwrite=overwrite)
    if to_file:
        echo_path(output)


def _about_file(problem: Problem) -> str:
    """Return size and rows of the file of a run; OVER ends it after the expected time."""
    share = 1.0 / EXTENDED if problem.work.at_most else 1.0
    rows = {word: max(1, round(share * count)) for word, count in problem.stored_rows.items()}
    before = " before compression" if problem.deck.has(Compact) else ""
    size = format_bytes(round(share * problem.output_bytes))
    return f"a run stores about {size}{before}: rows {format_rows(rows)}"


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
