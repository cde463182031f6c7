"""``fecm new`` and ``fecm materials``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from fecm._files import check_outputs
from fecm.api import load_deck
from fecm.cli.common import RefusedError, echo, echo_file, note, write_text
from fecm.cli.fixtures import ESTIMATE, Sphere, complete, duration_of, parse_contact
from fecm.cli.laminate_options import PLIES, laminate_options, ply_of_options
from fecm.cli.outputs import STANDARD_OUTPUT
from fecm.cli.types import POSITIVE, Finite, ListOf, Parsed, assignment
from fecm.deck.catalogue import MATERIALS, NU23, STRENGTHS, SYSTEM, SYSTEMS, NamedContact, NamedPly
from fecm.deck.format import format_deck
from fecm.deck.grid import Grid, Section, framed, graded, listed, longest_at, refined, uniform
from fecm.deck.model import Deck, Indentation, Material, Patch, Projectile, Segment, Shear, Units
from fecm.deck.records import Ply, RodDiameter
from fecm.mechanics.patch import DISC, HERTZ, RADIUS_PER_THICKNESS
from fecm.problem.build import build_projectile
from fecm.problem.fixture import CUSTOM, FIXTURES, Fixture, parse_fixture
from fecm.problem.new import EDGES, SUPPORTS, new_deck

# Most elements in one direction, and in all.
MOST, MOST_ELEMENTS = 2000, 500_000
# Least radius of a patch to which a mesh is refined, over the plate's side.
LEAST_RADIUS = 1e-3
# Elements of a rod, as many as the report's has.
ROD_ELEMENTS = 20

# Shapes of the contact patch; "none" is a point force.
PATCHES = {"disc": DISC, "hertz": HERTZ}
NO_PATCH = "none"
MITC, FULL = "mitc", "full"

# Constants of a named ply, as `fecm materials` lists them.
LINES = (
    ("E1", "E2", "nu12", "nu23", "G12", "G13", "G23", "density", "thickness"),
    (*STRENGTHS, "S13", "S23"), ("GIc", "GIIc"),
)  # fmt: skip

PROJECTILES = {"mass": "M", "rod": "LENGTH,DIAMETER,E,DENSITY"}


def _projectile(text: str) -> Projectile:
    """Read a rigid mass or a cylindrical rod."""
    kind, _, values = text.partition(":")
    if kind not in PROJECTILES:
        raise ValueError(f"{text!r} is not mass:M or rod:{PROJECTILES['rod']}")
    form = PROJECTILES[kind]
    numbers = ListOf(f"{kind}:{form}", Finite(), [form.count(",") + 1])(values)
    if kind == "mass":
        return Projectile(0, 0, *numbers)
    length, diameter, modulus, density = numbers
    ends = (RodDiameter(1, 1, diameter), RodDiameter(ROD_ELEMENTS, 0, diameter))
    return Projectile(ROD_ELEMENTS, 0, length, modulus, density, ends)


def _patch(text: str) -> Patch | None:
    """Read a contact patch; None for a point force."""
    shape, colon, radius = text.partition(":")
    if text == NO_PATCH:
        return None
    if shape not in PATCHES:
        raise ValueError(f"{text!r} is not none, disc, hertz, disc:RADIUS or hertz:RADIUS")
    return Patch(PATCHES[shape], POSITIVE(radius) if colon else None)


def _edge(text: str) -> tuple[str, str]:
    """Read the support of an edge."""
    edge, kind = assignment(text)
    if edge not in EDGES or kind not in SUPPORTS:
        raise ValueError(
            f"{text!r} is not EDGE=SUPPORT with an edge of {', '.join(EDGES)} and a support of "
            f"{', '.join(SUPPORTS)}"
        )
    return edge, kind


@click.command(short_help="Write a deck from plate, layup, supports and impact.")
@click.argument("output", type=click.Path(path_type=Path, allow_dash=True), metavar="DECK")
@click.option("--title", default="", help="Title of the deck.")
@click.option("--size", type=ListOf("6x4", POSITIVE, [2], "[xX×]"), metavar="LXxLY",
              help="Size of the plate, as in 6x4.")  # fmt: skip
@click.option("--mesh", type=ListOf("14x10", click.IntRange(1, MOST), [2], "[xX×]"),
              metavar="NXxNY", help="Elements along x and y, as in 14x10.")  # fmt: skip
@click.option("--grading", type=Finite(min=1.0), default=1.0, metavar="RATIO",
              help="Largest over smallest element; the smallest at the impact point.")  # fmt: skip
@click.option("--columns", type=Parsed(listed), metavar="LIST",
              help="Elements along x one by one, as in 3*0.5,8*0.375,3*0.5, instead of --size and "
                   "--mesh.")  # fmt: skip
@click.option("--rows", type=Parsed(listed), metavar="LIST", help="The same along y.")
@laminate_options(required=True)
@click.option("--damage", is_flag=True,
              help="Add strengths and toughness of a named ply: failure exposures (ALLO, FAIL) and "
                   "the delamination threshold (DELA).")  # fmt: skip
@click.option("--support", type=click.Choice(SUPPORTS), default="free", show_default=True,
              help="Support of all edges.")  # fmt: skip
@click.option("--edge", "edges", type=Parsed(_edge), multiple=True, metavar="EDGE=SUPPORT",
              help="Support of one edge: left, right, bottom or top; may be repeated.")  # fmt: skip
@click.option("--fixture", type=Parsed(parse_fixture), metavar="NAME",
              help=f"Fixture of a drop-weight test: {', '.join(FIXTURES)} or {CUSTOM}, a plate on "
                   "the edges of a window; --mesh then counts the window's elements.")  # fmt: skip
@click.option("--at", type=ListOf("X,Y", Finite(), [2]), metavar="X,Y",
              help="Impact point.  [default: the plate's centre]")  # fmt: skip
@click.option("--velocity", type=Finite(), help="Approach velocity.")
@click.option("--energy", type=POSITIVE,
              help="Impact energy in the deck's units (mJ in mm-N-s), instead of "
                   "--velocity.")  # fmt: skip
@click.option("--law", type=ListOf("K,ALPHA_P,S_P,Q", Finite(), [4]), metavar="K,ALPHA_P,S_P,Q",
              help="Parameters of the indentation law.")  # fmt: skip
@click.option("--contact", type=Parsed(parse_contact), metavar="NAME",
              help="Named law, instead of --law; `fecm indent contacts` lists them.  "
                   f"{ESTIMATE} estimates the k of a sphere (default: steel) as `fecm indent "
                   "estimate` does.")  # fmt: skip
@click.option("--projectile", type=Parsed(_projectile), metavar="PROJECTILE",
              help="mass:M, or rod:LENGTH,DIAMETER,E,DENSITY.  [default in lbf, in and s: the "
                   "report's rod]")  # fmt: skip
@click.option("--patch", type=Parsed(_patch), default="disc", show_default=True, metavar="PATCH",
              help="Area of the contact force: disc or hertz, with :RADIUS, to which the mesh is "
                   "then refined; or none, a point force.  D7136 takes hertz.")  # fmt: skip
@click.option("--shear", type=click.Choice([MITC, FULL]), default=MITC, show_default=True,
              help="Transverse shear: assumed strains, or full quadrature.")  # fmt: skip
@click.option("--duration", type=POSITIVE,
              help="Simulated time.  [default with --fixture: 1.25 times half a period of the "
                   "projectile on the plate]")  # fmt: skip
@click.option("--dt", type=POSITIVE, help="Time step.  [default: 0.9 of the critical one]")
@click.option("--every", type=click.IntRange(min=1),
              help="Steps between stored rows.  [default: for about 200 rows]")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace an existing deck.")
def new(output: Path, overwrite: bool, **options: Any) -> None:
    """Write a deck that is ready to run from plate, layup, supports and impact.

    DECK is the file to write; - is standard output.
    """
    to_file = output != STANDARD_OUTPUT
    if to_file:
        check_outputs([output], overwrite)
    notes: list[str] = []
    if options["fixture"] is not None:
        source = click.get_current_context().get_parameter_source
        given = {name for name in options if source(name) is ParameterSource.COMMANDLINE}
        notes += complete(options, given)
    deck, comments, more = deck_of_options(**options)
    notes += more
    text = comments + format_deck(deck.to_text())
    prepared = load_deck(text)
    if errors := prepared.errors():
        for finding in errors:
            echo(finding.render("the new deck"), err=True)
        raise RefusedError("these options do not give a valid deck; nothing was written")
    for line in notes:
        note(line)
    for finding in prepared.findings:
        echo(finding.render(str(output) if to_file else "the new deck"), err=True)
    if to_file:
        write_text(output, text, overwrite=overwrite)
        echo(output)
    else:
        echo_file(text)


@click.command()
@click.argument("plies", type=PLIES, metavar="[FILE.toml]", required=False)
def materials(plies: dict[str, NamedPly] | None) -> None:
    """List the named plies of `fecm new`, or those of a file, with their sources."""
    for name, material in (plies or MATERIALS).items():
        click.echo(f"{name} ({material.system})")
        values = {"G13": material.ply.g13, "G23": material.ply.g23} | material.values
        for keys in LINES:
            if line := ", ".join(f"{key} {values[key]:g}" for key in keys if key in values):
                click.echo(f"  {line}")
        texts = "; ".join(filter(None, (material.source, material.assumed)))
        click.echo(f"  {texts or '(no source)'}")


def deck_of_options(
    *,
    title: str,
    size: tuple[float, float] | None,
    mesh: tuple[int, int] | None,
    grading: float,
    columns: list[Section] | None,
    rows: list[Section] | None,
    layup: Sequence[float],
    ply_thickness: float,
    ply: Sequence[float] | None,
    material: NamedPly | None,
    damage: bool,
    units: str | None,
    support: str,
    edges: Sequence[tuple[str, str]],
    fixture: Fixture | None,
    at: tuple[float, float] | None,
    velocity: float | None,
    energy: float | None,
    law: Sequence[float] | None,
    contact: NamedContact | Sphere | None,
    projectile: Projectile | None,
    patch: Patch | None,
    shear: str,
    duration: float | None,
    dt: float | None,
    every: int | None,
) -> tuple[Deck, str, list[str]]:
    """Deck of the options of ``fecm new``, its comments, and notes about what is not stated."""
    radius = None if patch is None else patch.radius
    grid = _grid(size, mesh, grading, columns, rows, at, radius, fixture)
    x, y = at or (grid.columns[-1].end / 2.0, grid.rows[-1].end / 2.0)
    constants = ply_of_options(ply, material, units)
    system = units or (material.system if material else None)
    if projectile is None and system not in (None, SYSTEM):
        raise click.UsageError(
            f"give --projectile mass:M or rod:{PROJECTILES['rod']}: without it the projectile is "
            f"the report's steel rod, whose numbers are in {SYSTEM}"
        )
    if (velocity is None) == (energy is None):
        raise click.UsageError("give either --velocity or --energy")
    if duration is None and fixture is None:
        raise click.UsageError("Missing option '--duration'.")
    nu23 = material.nu23 if material else NU23
    indentation, comment = _law(law, contact, system, constants, layup, nu23)
    segments, notes = _damage(material, system) if damage else ((), [])
    make = partial(
        new_deck,
        title=title,
        grid=grid,
        angles=layup,
        ply_thickness=ply_thickness,
        ply=constants,
        supports=dict.fromkeys(EDGES, support) | dict(edges),
        at=(x, y),
        law=indentation,
        projectile=projectile,
        every=every,
        units=None if units is None else Units(*SYSTEMS[units].values()),
        patch=patch,
        shear=Shear(assumed=True) if shear == MITC else None,
        window=None if fixture is None else fixture.window,
        damage=segments,
    )
    if velocity is None or duration is None:
        first = make(velocity=velocity or 1.0, duration=duration or dt or 1.0, dt=dt)
        dt = next(macro.value for macro in first.macros if macro.word == "DT")
        if velocity is None:
            velocity = _velocity(energy or 0.0, first)
        if duration is None:
            duration = duration_of(first)
    deck = make(velocity=velocity, duration=duration, dt=dt)
    node, node_x, node_y = grid.nearest(x, y)
    distance = math.hypot(node_x - x, node_y - y)
    if distance > 1e-9 * grid.columns[-1].end:
        asked = "the plate's centre" if at is None else "--at"
        notes.append(
            f"the impact point is moved by {distance:.4g}: from {asked} at {x:g}, {y:g} to the "
            f"nearest node, {node} at {node_x:g}, {node_y:g}"
        )
    if mesh and fixture is None and grid.elements > mesh[0] * mesh[1]:
        notes.append(
            f"the mesh has {grid.across // 2}x{grid.up // 2} elements instead of {mesh[0]}x"
            f"{mesh[1]}: their sides at the patch are at most its radius {radius:g}"
        )
    if patch is not None or shear == MITC:
        notes.append(_additions(deck))
    if comment:
        notes.append(
            f"k = {indentation.k:g} is estimated from the ply's constants (fecm indent estimate) "
            "for an elastic law; --law takes a measured one"
        )
    return deck, (fixture.comment if fixture else "") + comment, notes


def _damage(material: NamedPly | None, system: str | None) -> tuple[tuple[Segment, ...], list[str]]:
    """Strengths and toughness of a named ply, and a note about what it does not have."""
    if material is None or system is None:
        raise click.UsageError("--damage needs --material, a ply with strengths or toughness")
    parts = {
        " and ".join(key for key in STRENGTHS if key not in material.values): (
            material.allowables(system), "no failure exposures (ALLO, FAIL)"
        ),
        "GIIc": (material.delamination(system), "no delamination threshold (DELA)"),
    }  # fmt: skip
    missing = [f"no {key}, so {what}" for key, (part, what) in parts.items() if part is None]
    if len(missing) == len(parts):
        raise click.UsageError(f"--damage: {material.name} has {'; '.join(missing)}")
    notes = [f"{material.name} has {text}" for text in missing]
    return tuple(part for part, _ in parts.values() if part is not None), notes


def _velocity(energy: float, deck: Deck) -> float:
    """Velocity of a deck's projectile with an energy, in as many digits as its card has."""
    mass = build_projectile(deck).total_mass
    velocity = math.sqrt(2.0 * energy / mass) if mass > 0.0 else math.inf
    if not 0.0 < velocity < math.inf:
        raise click.UsageError(f"no velocity gives the energy {energy:g} to the mass {mass:g}")
    return float(f"{velocity:.6g}")


def _additions(deck: Deck) -> str:
    """Say what a deck has besides the cards of the report's program."""
    parts: list[str] = []
    if (patch := deck.last(Patch)) is not None:
        share = RADIUS_PER_THICKNESS[patch.shape]
        thickness = deck.require(Material).integration.thickness
        radius = patch.radius or share * thickness
        about = "" if patch.radius else f" ({share:g} of the thickness)"
        pressure = "a uniform pressure" if patch.shape == DISC else "Hertz's pressure"
        parts.append(f"{pressure} of radius {radius:.4g}{about} instead of a point force (PATC)")
    if deck.has(Shear):
        parts.append("assumed shear strains (SHEA MITC)")
    return f"the deck has {' and '.join(parts)}; --patch none and --shear full leave them out"


def _grid(
    size: tuple[float, float] | None,
    mesh: tuple[int, int] | None,
    grading: float,
    columns: list[Section] | None,
    rows: list[Section] | None,
    at: tuple[float, float] | None,
    radius: float | None,
    fixture: Fixture | None,
) -> Grid:
    """Grid of elements from sizes, refined to the radius of a patch, or from lists.

    With a fixture the sizes are those of its window.
    """
    if columns and rows:
        if size or mesh or grading != 1.0:
            raise click.UsageError("--columns and --rows replace --size, --mesh and --grading")
        grid = Grid(columns, rows)
    elif columns or rows or not (size and mesh):
        raise click.UsageError("give --size and --mesh, or --columns and --rows")
    else:
        whole = fixture.size if fixture else size
        rims = [(length - side) / 2.0 for length, side in zip(whole, size, strict=True)]
        place = at or (whole[0] / 2.0, whole[1] / 2.0)
        centre = (x - rim for x, rim in zip(place, rims, strict=True))
        columns, rows = (
            _sections(length, count, middle, grading, radius)
            for length, count, middle in zip(size, mesh, centre, strict=True)
        )
        if fixture:
            columns, rows = framed(columns, whole[0]), framed(rows, whole[1])
        grid = Grid(columns, rows)
    if max(grid.across, grid.up) // 2 > MOST or grid.elements > MOST_ELEMENTS:
        raise click.UsageError(
            f"the mesh would have {grid.elements} elements; at most {MOST_ELEMENTS}, and {MOST} "
            "in one direction, are allowed"
        )
    if at and not (0.0 <= at[0] <= grid.columns[-1].end and 0.0 <= at[1] <= grid.rows[-1].end):
        raise click.UsageError("--at is outside the plate")
    return grid


def _sections(
    length: float, count: int, centre: float, grading: float, radius: float | None
) -> list[Section]:
    """Elements in one direction."""
    made = graded(length, count, centre, grading) if grading > 1.0 else uniform(length, count)
    if radius is None or longest_at(made, centre) <= radius:
        return made
    if radius < LEAST_RADIUS * length:
        raise click.UsageError(
            f"the mesh is not refined to a radius of {radius:g}, less than {LEAST_RADIUS:g} times "
            f"the plate's side of {length:g}; give --columns and --rows"
        )
    return refined(length, count, centre, grading, radius)


def _law(
    law: Sequence[float] | None, contact: NamedContact | Sphere | None, system: str | None,
    ply: Ply, layup: Sequence[float], nu23: float,
) -> tuple[Indentation, str]:  # fmt: skip
    """Indentation law, a named one in the units of the ply, and comment lines about it."""
    if (law is None) == (contact is None):
        raise click.UsageError("give either --law or --contact")
    if law is not None:
        k, alpha_p, s_p, q = law
        return Indentation(k, alpha_p, s_p, q), ""
    if isinstance(contact, Sphere):
        return contact.law(ply, layup, nu23, system)
    if system is None or contact is None:
        raise click.UsageError("--contact with --ply needs --units, the units of the ply")
    return contact.converted(system), ""
