"""Plate, laminate and contact as objects, of which :func:`fecm.impact` makes a deck."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from numbers import Real
from pathlib import Path
from typing import Literal, Self

from numpy.typing import ArrayLike

from fecm._errors import FecmError
from fecm._frozen import frozen
from fecm.deck import grid as grids
from fecm.deck.catalogue import (
    CONTACTS,
    STANDARD,
    STEEL_MODULUS,
    STEEL_POISSON,
    SYSTEMS,
    NamedContact,
    NamedPly,
    convert,
)
from fecm.deck.grid import EDGES, SUPPORTS, Grid, Section
from fecm.deck.layup import parse_layup
from fecm.deck.model import Indentation, Patch
from fecm.deck.records import Ply
from fecm.deck.units import MODULUS, in_si, unit_in_si
from fecm.mechanics.contact_law import hertz_coefficient
from fecm.mechanics.half_space import effective_stiffness, indentation_modulus
from fecm.mechanics.points import DISC, HERTZ
from fecm.problem import plate_mesh
from fecm.problem.plate_mesh import BOUNDARY, MeshLike, PlateMesh

MOST, MOST_ELEMENTS = 2000, 500_000  # most elements in one direction, and in all
LEAST_RADIUS = 1e-3  # least radius of a patch to which a mesh is refined, over the plate's side
# Elements of the window where the mesh does not give them, and their grading.
WINDOW_MESH, WINDOW_GRADING = (20, 12), 3.0
# Shapes of the contact patch.
PATCHES = {"disc": DISC, "hertz": HERTZ}
CUSTOM = "window:LXxLY,WXxWY"
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"

Support = Literal["free", "simple", "clamped"]


class ObjectError(FecmError, ValueError):
    """Objects that make no deck; messages quote the names of parameters in backquotes."""


@frozen
class DropWeight:
    """What a test standard prescribes besides its fixture, in mm, N, s and t."""

    mass: float  # of the rigid projectile
    radius: float
    energy: float  # impact energy per thickness, force
    thinnest: float  # limits of the laminate's thickness, length
    thickest: float
    least_energy: float = 100.0  # per thickness, below which a unit is probably mistaken, force


@frozen
class Fixture:
    """A plate on the edges of a window in its middle."""

    name: str
    # Sides of the plate and of the window, length.
    size: tuple[float, float]
    window: tuple[float, float]
    test: DropWeight | None = None  # what the standard prescribes; None for a custom fixture

    @property
    def comment(self) -> str:
        """Comment lines of a deck."""
        (lx, ly), (wx, wy) = self.size, self.window
        return (
            f"! Fixture {self.name}: a plate of {lx:g} x {ly:g}, w = 0 along the edges of a "
            f"window of {wx:g} x {wy:g}.\n"
            "! Clamps and lift-off are not modelled.\n"
        )


# ASTM D7136/D7136M: 5.5 kg, hemisphere of 16 mm diameter, 6.7 J per mm of thickness.
D7136 = DropWeight(5.5e-3, 8.0, 6700.0, 4.0, 6.0)
FIXTURES = {"D7136": Fixture("D7136", (150.0, 100.0), (125.0, 75.0), D7136)}


def parse_fixture(text: str) -> Fixture:
    """Fixture of a name, or of ``window:LXxLY,WXxWY``, smaller than the plate."""
    if text in FIXTURES:
        return FIXTURES[text]
    number = r"\s*(\d+\.?\d*|\.\d+)\s*"
    match = re.fullmatch(f"window:{number}[xX×]{number},{number}[xX×]{number}", text)
    if match is None:
        raise ObjectError(f"{text!r} is not a fixture: {', '.join(FIXTURES)} or {CUSTOM}")
    lx, ly, wx, wy = map(float, match.groups())
    if not (0.0 < wx < lx < 1e30 and 0.0 < wy < ly < 1e30):
        message = f"the window of {wx:g} x {wy:g} is not smaller than the plate of {lx:g} x {ly:g}"
        raise ObjectError(message)
    return Fixture("window", (lx, ly), (wx, wy))


@frozen
class Plate:
    """Mesh and supports of a plate.

    :meth:`rectangle`, :meth:`on_fixture` and :meth:`from_mesh` make one.

    Attributes
    ----------
    supports : dict
        Support by the name of an edge or of a group.
    size : tuple of float or None
        Sides of a rectangle, or of a fixture's window, length.
    mesh : tuple of int or None
        Elements along x and y.
    grading : float
        Largest over smallest element.
    columns, rows : tuple of Section
        Elements along x and y one by one.
    fixture : Fixture or None
    imported : PlateMesh or None
    """

    supports: Mapping[str, str]
    size: tuple[float, float] | None = None
    mesh: tuple[int, int] | None = None
    grading: float = 1.0
    columns: tuple[Section, ...] = field(default=(), repr=False)
    rows: tuple[Section, ...] = field(default=(), repr=False)
    fixture: Fixture | None = None
    imported: PlateMesh | None = None

    @classmethod
    def rectangle(
        cls,
        size: tuple[float, float] | None = None,
        mesh: tuple[int, int] | None = None,
        *,
        support: Support = "free",
        edges: Mapping[str, Support] | None = None,
        grading: float = 1.0,
        columns: str = "",
        rows: str = "",
    ) -> Self:
        """Rectangle of elements with nine nodes, one corner at the origin.

        Parameters
        ----------
        size : tuple of float
            Sides along x and y, length.
        mesh : tuple of int
            Elements along x and y.
        support : str
            Support of all edges: ``"free"``, ``"simple"`` or ``"clamped"``.
        edges : dict, optional
            Support of single edges: ``"left"``, ``"right"``, ``"bottom"`` or ``"top"``.
        grading : float
            Largest over smallest element; the smallest is at the impact point.
        columns, rows : str
            Elements along x and y one by one, as in ``"3*0.5,8*0.375"``, instead of `size`, `mesh`.

        Raises
        ------
        ValueError
            If a value makes no sense.

        Examples
        --------
        >>> import fecm
        >>> fecm.Plate.rectangle((100, 80), (10, 8), edges={"left": "clamped"}).size
        (100.0, 80.0)
        """
        supports = dict.fromkeys(EDGES, str(support)) | dict(edges or {})
        for edge, kind in supports.items():
            if edge not in EDGES or kind not in SUPPORTS:
                raise ObjectError(
                    f"{edge}={kind}: the edges are {', '.join(EDGES)}, the supports "
                    f"{', '.join(SUPPORTS)}"
                )
        check_positive(grading=grading)
        if grading < 1.0:
            raise ObjectError(f"`grading` is {grading:g}; it must be 1 or more")
        if columns and rows:
            if size or mesh or grading != 1.0:
                raise ObjectError("`columns` and `rows` replace `size`, `mesh` and `grading`")
            try:
                x_sections, y_sections = grids.listed(columns), grids.listed(rows)
                return cls(supports, columns=tuple(x_sections), rows=tuple(y_sections))
            except ValueError as error:
                raise ObjectError(f"`columns` and `rows`: {error}") from None
        if columns or rows or size is None or mesh is None:
            raise ObjectError("give `size` and `mesh`, or `columns` and `rows`")
        x, y = pair("size", size)
        check_positive(size=min(x, y))
        nx, ny = pair("mesh", mesh)
        if not all(1 <= n <= MOST and n == int(n) for n in (nx, ny)):
            raise ObjectError(f"`mesh` is {mesh!r}, not two numbers of elements from 1 to {MOST}")
        return cls(supports, (x, y), (int(nx), int(ny)), float(grading))

    @classmethod
    def on_fixture(
        cls, name: str, mesh: tuple[int, int] | None = None, *, grading: float | None = None
    ) -> Self:
        """Plate on the edges of a window; with a standard's name its test gives defaults.

        Parameters
        ----------
        name : str
            ``"D7136"`` or ``"window:LXxLY,WXxWY"``: sides of the plate and of the window.
        mesh : tuple of int, optional
            Elements of the window along x and y; 20 and 12 by default.
        grading : float, optional
            Largest over smallest element; 3 where `mesh` is not given, otherwise 1.

        Raises
        ------
        ValueError
            If the name or a value makes no sense.
        """
        fixture = parse_fixture(name)
        ratio = grading or (WINDOW_GRADING if mesh is None else 1.0)
        plain = cls.rectangle(fixture.window, mesh or WINDOW_MESH, grading=ratio)
        return replace(plain, fixture=fixture)

    @classmethod
    def from_mesh(
        cls,
        mesh: str | Path | MeshLike | tuple[ArrayLike, ArrayLike],
        support: Mapping[str, Support] | Support | None = None,
        *,
        groups: Mapping[str, ArrayLike] | None = None,
    ) -> Self:
        """Plate with the elements of a mesh generator.

        All elements are triangles of 3 or 6 nodes, or all quadrilaterals of 4, 8 or 9.  They are
        turned counter-clockwise, and nodes without an element dropped.  A triangle becomes three
        quadrilaterals of 4 nodes; one of 8 nodes gets its centre.

        Parameters
        ----------
        mesh : str, Path, meshio.Mesh or tuple of arrays
            A file that meshio reads, such as Gmsh's `.msh`; or points (n, 2) and cells (m, k) with
            points counted from 0.
        support : dict or str, optional
            Support by the name of a group of lines: ``"free"``, ``"simple"`` or ``"clamped"``.  The
            group ``"boundary"``, or a single support, means all outer sides and those of holes
            that are in no other group named here.  A group with the name of a support has it.
        groups : dict, optional
            Points of groups, for arrays.

        Raises
        ------
        ValueError
            If the mesh or a support cannot be used.
        ImportError
            If a file is given and meshio is not installed.
        OSError
            If the file can't be read.

        Examples
        --------
        >>> import fecm
        >>> corners = [(0, 0), (2, 0), (2, 1), (0, 1)]
        >>> fecm.Plate.from_mesh((corners, [[0, 1, 2, 3]]), "clamped").supports
        {'boundary': 'clamped'}
        """
        if isinstance(mesh, tuple):
            found = plate_mesh.plate_mesh(mesh[0], mesh[1], groups or {})
        elif groups is not None:
            raise ObjectError("`groups` are for arrays; a mesh has its own")
        elif isinstance(mesh, str | Path):
            found = plate_mesh.read_mesh(mesh)
        else:
            found = plate_mesh.from_meshio(mesh)
        wanted = {BOUNDARY: support} if isinstance(support, str) else support or {}
        if not isinstance(wanted, Mapping):
            raise ObjectError(f"`support` is {support!r}, not a dictionary of groups")
        return cls(found.supports(wanted), imported=found)


@frozen
class Laminate:
    """Layup of a plate.

    Attributes
    ----------
    layup : str or sequence of float
        As in ``"[0/45]2s"``, or angles in degrees, from the struck face on.
    ply : str or Ply or NamedPly
        Name of a ply, which `fecm materials` lists, or constants in the deck's units.
    ply_thickness : float, optional
        Thickness of one ply, length; a named ply's own by default, where it is known.

    Examples
    --------
    >>> import fecm
    >>> fecm.Laminate("[0/45]s", "T300/5208", 0.125).angles
    (0.0, 45.0, 45.0, 0.0)
    """

    layup: str | Sequence[float]
    ply: str | Ply | NamedPly
    ply_thickness: float | None = None

    @property
    def angles(self) -> tuple[float, ...]:
        """Angles of the plies, degrees."""
        if isinstance(self.layup, str):
            return tuple(parse_layup(self.layup))
        try:
            if angles := tuple(map(float, self.layup)):
                return angles
        except (TypeError, ValueError):
            pass
        raise ObjectError(f"the layup {self.layup!r} is not a list of angles")

    @property
    def thickness(self) -> float:
        """Total thickness, length; ValueError without the thickness of a ply."""
        if self.ply_thickness is None:
            raise ObjectError("`ply_thickness` is missing")
        return float(f"{len(self.angles) * self.ply_thickness:.9g}")


@frozen
class Sphere:
    """Elastic contact of a sphere, its k estimated from the ply's constants."""

    radius: float | None = None  # length; None where a standard prescribes it
    # Elastic constants; None for steel.
    modulus: float | None = None
    poisson: float | None = None

    def law(
        self, laminate: Laminate, ply: Ply, nu23: float, system: str | None
    ) -> tuple[Indentation, str]:
        """Law of contact, and comment lines of the deck which say how k was computed."""
        if self.radius is None:
            raise ObjectError("the `contact` estimate needs the sphere's radius")
        if self.modulus is None and system is None:
            raise ObjectError(
                "the `contact` estimate with constants of a `ply` needs `units`, or the sphere's "
                "elastic constants"
            )
        modulus = self.modulus or convert(STEEL_MODULUS, MODULUS, STANDARD, system or STANDARD)
        poisson = STEEL_POISSON if self.poisson is None else self.poisson
        angles = laminate.angles
        try:
            stiffness = effective_stiffness(ply, angles, [1.0] * len(angles), nu23)
            effective = indentation_modulus(stiffness)
            k = float(f"{hertz_coefficient(self.radius, modulus, poisson, effective):.6g}")
        except (ValueError, ArithmeticError) as error:
            raise ObjectError(f"k cannot be estimated: {error}; give a law") from None
        return Indentation(k, 0.0, 0.0, 1.5), (
            "! k of EXPE is estimated by the laminate's indentation modulus "
            f"{effective:.5g}: a sphere of radius {self.radius:g},\n"
            f"! E {modulus:g} and nu {poisson:g}; nu23 of the ply {nu23:g}.  A measured k may be "
            "larger; the law is elastic.\n"
        )


class Contact(Indentation):
    """Measured indentation law in the deck's units; :meth:`named` and :meth:`estimate` find one.

    Parameters
    ----------
    k : float
        Contact coefficient, force/length^1.5.
    alpha_p : float
        Critical indentation (length), beyond which an indentation remains.
    s_p : float
        Slope of the permanent over the maximum indentation.
    q : float
        Power of the unloading curve.

    Examples
    --------
    >>> import fecm
    >>> fecm.Contact(1.912e6, 6.564e-4, 0.094, 2.0).k
    1912000.0
    """

    @staticmethod
    def named(name: str) -> NamedContact:
        """Published law, which `fecm indent contacts` lists; converted to the deck's units.

        Raises
        ------
        ValueError
            If there is none of this name.
        """
        if name not in CONTACTS:
            raise ObjectError(f"{name!r} is not a named contact: {', '.join(CONTACTS)}")
        return CONTACTS[name]

    @staticmethod
    def estimate(
        radius: float | None = None, modulus: float | None = None, poisson: float | None = None
    ) -> Sphere:
        """Elastic law of a sphere on the laminate, as `fecm indent estimate` has it.

        Parameters
        ----------
        radius : float, optional
            Length; a standard's where it is not given.
        modulus, poisson : float, optional
            Elastic constants of the sphere; steel's where they are not given.
        """
        check_positive(radius=radius, modulus=modulus)
        return Sphere(radius, modulus, poisson)


def parse_patch(text: str) -> Patch | None:
    """Contact patch of ``disc``, ``hertz``, ``disc:RADIUS`` or ``hertz:RADIUS``.

    ``none`` is a point force, None.  Raises ValueError if the text is none of these.
    """
    shape, colon, given = text.partition(":")
    if text == "none":
        return None
    try:
        radius = float(given) if colon else None
        check_positive(radius=radius)
        return Patch(PATCHES[shape], radius)
    except (KeyError, ValueError):
        message = f"{text!r} is not none, disc, hertz, disc:RADIUS or hertz:RADIUS"
        raise ObjectError(message) from None


def check_positive(**values: float | None) -> None:
    """Refuse parameters that are not positive numbers; None is not given."""
    for name, value in values.items():
        if value is not None and not (isinstance(value, Real) and 0.0 < value < math.inf):
            raise ObjectError(f"`{name}` is {value!r}; it must be a positive number")


def in_units(
    name: str, value: float | str | None, dimension: str, system: str | None
) -> float | None:
    """A parameter in a system of units; one that is a number or None stays as it is.

    Raises ObjectError if a text, as in ``10J`` or ``3m/s``, is no positive number with a unit of
    the dimension, or the system is not known.
    """
    if not isinstance(value, str):
        return value
    match = re.fullmatch(rf"\s*({NUMBER})\s*(\S.*)?", value)
    unit = match[2] if match else None
    known = unit_in_si(unit, dimension) if unit else 1.0
    if match is None or known is None or not math.isfinite(float(match[1])):
        example = {"force*length": "10J", "length/time": "3m/s"}.get(dimension, "4ms")
        raise ObjectError(
            f"`{name}` is {value!r}, not a number or one with a unit, as in {example}"
        )
    if unit is None:
        return float(match[1])
    own = in_si(dimension, SYSTEMS[system]) if system else None
    if own is None:
        raise ObjectError(f"`{name}` is {value!r}: give `units`, the deck's")
    return float(f"{float(match[1]) * known / own:.9g}")


def pair(name: str, value: Sequence[float]) -> tuple[float, float]:
    """Two numbers of a parameter."""
    try:
        x, y = map(float, value)
    except (TypeError, ValueError):
        raise ObjectError(f"`{name}` is {value!r}, not two numbers") from None
    return x, y


def grid_of(plate: Plate, at: tuple[float, float] | None, radius: float | None) -> Grid:
    """Grid of a rectangular plate, refined to the radius of a patch.

    With a fixture, size and mesh are those of its window.
    """
    columns, rows = list(plate.columns), list(plate.rows)
    if plate.size and plate.mesh:
        whole = plate.fixture.size if plate.fixture else plate.size
        place = at or (whole[0] / 2.0, whole[1] / 2.0)
        columns, rows = (
            _sections(side, count, x - (length - side) / 2.0, plate.grading, radius)
            for side, count, x, length in zip(plate.size, plate.mesh, place, whole, strict=True)
        )
        if plate.fixture:
            columns, rows = grids.framed(columns, whole[0]), grids.framed(rows, whole[1])
    grid = Grid(columns, rows)
    if max(grid.across, grid.up) // 2 > MOST or grid.elements > MOST_ELEMENTS:
        raise ObjectError(
            f"the mesh would have {grid.elements} elements; at most {MOST_ELEMENTS}, and {MOST} "
            "in one direction, are allowed"
        )
    return grid


def _sections(
    length: float, count: int, centre: float, grading: float, radius: float | None
) -> list[Section]:
    """Elements in one direction."""
    if grading > 1.0:
        made = grids.graded(length, count, centre, grading)
    else:
        made = grids.uniform(length, count)
    if radius is None or grids.longest_at(made, centre) <= radius:
        return made
    if radius < LEAST_RADIUS * length:
        raise ObjectError(
            f"the mesh is not refined to a radius of {radius:g}, less than {LEAST_RADIUS:g} times "
            f"the plate's side of {length:g}; give `columns` and `rows`"
        )
    return grids.refined(length, count, centre, grading, radius)
