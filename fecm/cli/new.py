"""From the options of ``fecm new`` to a deck."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from fecm._errors import FecmError
from fecm.deck.catalogue import CONTACTS, MATERIALS, SYSTEMS
from fecm.deck.catalogue import SYSTEM as REPORT_SYSTEM
from fecm.deck.grid import Grid, Section, graded, listed, uniform
from fecm.deck.layup import LayupError, parse_layup
from fecm.deck.model import Deck, Indentation, Projectile, Units
from fecm.deck.records import Ply, RodDiameter
from fecm.problem.new import EDGES, SUPPORTS, Specification, new_deck

# Most elements in one direction.
MOST = 2000
# Elements of a rod, as many as the report's has.
ROD_ELEMENTS = 20


class OptionError(FecmError, ValueError):
    """An option is invalid."""


def deck_of_options(
    *,
    title: str,
    size: str | None,
    mesh: str | None,
    grading: float,
    columns: str | None,
    rows: str | None,
    layup: str,
    ply_thickness: float,
    ply: str | None,
    material: str | None,
    units: str | None,
    support: str,
    edges: Sequence[str],
    at: str | None,
    velocity: float,
    law: str | None,
    contact: str | None,
    projectile: str | None,
    duration: float,
    dt: float | None,
    every: int | None,
) -> tuple[Deck, list[str]]:
    """Make a deck, and notes for the user, of the command's options.

    Raises
    ------
    OptionError
        If an option is invalid; the message names it.
    """
    try:
        angles = parse_layup(layup)
    except LayupError as error:
        raise OptionError(str(error)) from None
    for name, value in (
        ("--ply-thickness", ply_thickness),
        ("--duration", duration),
        ("--dt", 1.0 if dt is None else dt),
    ):
        if not 0.0 < value < math.inf:
            raise OptionError(f"{name} must be positive, not {value:g}")
    point = None if at is None else _numbers("--at", at, 2)
    grid = _grid(size, mesh, grading, columns, rows, point)
    x, y = point or (grid.columns[-1].end / 2.0, grid.rows[-1].end / 2.0)
    constants, system = ply_of_options(ply, material, units)
    spec = Specification(
        title=title,
        grid=grid,
        angles=angles,
        ply_thickness=ply_thickness,
        ply=constants,
        supports=_supports(support, edges),
        at=(x, y),
        velocity=velocity,
        law=_law(law, contact, units, material),
        projectile=_projectile(projectile),
        duration=duration,
        dt=dt,
        every=every,
        units=None if system is None else Units(*SYSTEMS[system][0]),
    )
    if projectile is None and (system or material_system(material)) not in (None, REPORT_SYSTEM):
        raise OptionError(
            "give --projectile mass:M or rod:LENGTH,DIAMETER,E,DENSITY: without it the projectile "
            f"is the report's steel rod, whose numbers are in {REPORT_SYSTEM}"
        )
    notes: list[str] = []
    node, node_x, node_y = grid.nearest(x, y)
    distance = math.hypot(node_x - x, node_y - y)
    if distance > 1e-9 * grid.columns[-1].end:
        asked = "the plate's middle" if at is None else "--at"
        notes.append(
            f"the impact point is moved by {distance:.4g}: from {asked} at {x:g}, {y:g} to the "
            f"nearest node, {node} at {node_x:g}, {node_y:g}"
        )
    return new_deck(spec), notes


def material_system(name: str | None) -> str | None:
    """System of units of a named ply; None without one."""
    return None if name is None else MATERIALS[name].system


def _numbers(option: str, text: str, count: int) -> list[float]:
    """Numbers separated by commas."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise OptionError(f"{option} takes {count} numbers with commas between them, not `{text}`")
    return values


def _projectile(text: str | None) -> Projectile | None:
    """A rigid mass, or a cylindrical rod."""
    if text is None:
        return None
    kind, _, values = text.partition(":")
    if kind == "mass":
        (mass,) = _numbers("--projectile mass", values, 1)
        return Projectile(0, 0, mass)
    if kind == "rod":
        length, diameter, modulus, density = _numbers("--projectile rod", values, 4)
        ends = (RodDiameter(1, 1, diameter), RodDiameter(ROD_ELEMENTS, 0, diameter))
        return Projectile(ROD_ELEMENTS, 0, length, modulus, density, ends)
    raise OptionError(f"--projectile takes mass:M or rod:LENGTH,DIAMETER,E,DENSITY, not `{text}`")


def _pair(option: str, text: str | None) -> tuple[float, float]:
    """Two positive numbers with an x between them."""
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*[xX×]\s*([0-9.eE+-]+)\s*", text or "")
    try:
        a, b = (float(match[1]), float(match[2])) if match else (0.0, 0.0)
    except ValueError:
        a = b = 0.0
    if not (0.0 < a < math.inf and 0.0 < b < math.inf):
        raise OptionError(f"{option} takes two numbers as in 6x4, not `{text or ''}`")
    return a, b


def _grid(
    size: str | None,
    mesh: str | None,
    grading: float,
    columns: str | None,
    rows: str | None,
    point: Sequence[float] | None,
) -> Grid:
    """The grid of elements, from sizes or from lists."""
    if (columns is None) != (rows is None):
        raise OptionError("--columns and --rows belong together")
    if columns is not None and rows is not None:
        if size or mesh or grading != 1.0:
            raise OptionError("--columns and --rows stand for --size, --mesh and --grading")
        try:
            grid = Grid(listed(columns), listed(rows))
        except ValueError as error:
            raise OptionError(str(error)) from None
    else:
        lengths = _pair("--size", size)
        counts = _pair("--mesh", mesh)
        if not all(n.is_integer() and n <= MOST for n in counts):
            raise OptionError(f"--mesh takes whole numbers up to {MOST}, not `{mesh}`")
        directions: list[list[Section]] = []
        for axis in (0, 1):
            length, count = lengths[axis], int(counts[axis])
            centre = length / 2.0 if point is None else point[axis]
            directions.append(
                graded(length, count, centre, grading) if grading > 1.0 else uniform(length, count)
            )
        grid = Grid(*directions)
    if grid.across // 2 > MOST or grid.up // 2 > MOST or grid.elements > 500_000:
        raise OptionError(f"the mesh would have {grid.elements} elements; 500000 is the most")
    if point is not None and not (
        0.0 <= point[0] <= grid.columns[-1].end and 0.0 <= point[1] <= grid.rows[-1].end
    ):
        raise OptionError("--at lies outside the plate")
    return grid


def ply_of_options(
    text: str | None, name: str | None, system: str | None
) -> tuple[Ply, str | None]:
    """Constants of the ply, and the system of units that the deck declares.

    Parameters
    ----------
    text : str or None
        The constants, as ``--ply`` takes them.
    name : str or None
        A named ply, as ``--material`` takes it, instead.
    system : str or None
        A key of :data:`fecm.deck.catalogue.SYSTEMS`.

    Raises
    ------
    OptionError
        If an option is invalid; the message names it.
    """
    if system is not None and system not in SYSTEMS:
        raise OptionError(f"--units takes {', '.join(SYSTEMS)}, not `{system}`")
    if (text is None) == (name is None):
        raise OptionError("give either --ply or --material")
    if text is not None:
        return Ply(*_numbers("--ply", text, 7)), system
    material = MATERIALS.get(name or "")
    if material is None:
        raise OptionError(f"--material takes {', '.join(MATERIALS)}, not `{name}`")
    return material.converted(system or material.system), system


def _law(
    text: str | None, name: str | None, system: str | None, material: str | None
) -> Indentation:
    """The indentation law, a named one in the units of the ply."""
    if (text is None) == (name is None):
        raise OptionError("give either --law or --contact")
    if text is not None:
        k, alpha_p, s_p, q = _numbers("--law", text, 4)
        return Indentation(k, alpha_p, s_p, q)
    contact = CONTACTS.get(name or "")
    if contact is None:
        raise OptionError(f"--contact takes {', '.join(CONTACTS)}, not `{name}`")
    if system is None and material is None:
        raise OptionError("--contact with --ply needs --units, which say what the ply is given in")
    return contact.converted(system or MATERIALS[material or ""].system)


def _supports(support: str, edges: Sequence[str]) -> dict[str, str]:
    """Support of every edge."""
    supports = dict.fromkeys(EDGES, support)
    for text in edges:
        edge, _, kind = text.partition("=")
        if edge not in EDGES or kind not in SUPPORTS:
            raise OptionError(
                f"--edge takes one of {', '.join(EDGES)}, =, and one of {', '.join(SUPPORTS)}, "
                f"not `{text}`"
            )
        supports[edge] = kind
    return supports
