"""Plates: mesh, supports, and fixtures of drop-weight tests."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Literal, NamedTuple, Self, get_args

from numpy.typing import ArrayLike

from fecm._table import Table, html_table
from fecm.authoring.elastic_edges import check_support, is_elastic
from fecm.authoring.parameters import (
    ObjectError,
    check_positive,
    lengths_in_units,
    number_pair,
)
from fecm.deck import grid as grids
from fecm.deck.catalogue import STANDARD
from fecm.deck.grid import EDGES, GridSection
from fecm.deck.quantities import is_number, text_of
from fecm.problem import plate_mesh
from fecm.problem.plate_mesh import BOUNDARY, GridLike, MeshLike, PlateMesh

CUSTOM = "window:LXxLY,WXxWY"


class DropWeight(NamedTuple):
    """Values that a test standard prescribes besides its fixture, in mm, N, s and t."""

    mass: float  # mass of the rigid projectile
    radius: float  # radius of its tip
    energy: float  # impact energy per thickness, force
    # Limits of the thickness of the laminate, length.
    thinnest: float
    thickest: float
    least_energy: float = 100.0  # smallest plausible energy per thickness, force

    def allows(self, thickness: float) -> bool:
        """Return whether the thickness of a laminate is in the range of the standard."""
        return self.thinnest <= round(thickness, 9) <= self.thickest


Window = Literal["held", "push"]  # support of w on the edges of a window
HELD: Literal["held"] = "held"
PUSH: Literal["push"] = "push"


class Fixture(NamedTuple):
    """Fixture that supports a plate on the edges of a window in its middle."""

    name: str
    # Sides of the plate and of the window, length.
    size: tuple[float, float]
    window: tuple[float, float]
    test: DropWeight | None = None  # values of the standard; None for a custom fixture
    clamp: tuple[float, float] | None = None  # tip of a clamp from the corner, length
    support: Window = HELD
    # Stiffness of a clamp, force/length, "held" for rigid clamps, or None without clamps.
    clamps: float | str | None = None

    @property
    def tips(self) -> list[tuple[float, float]]:
        """Places of the tips of clamps, modelled or not."""
        if self.clamp is None:
            return []
        (lx, ly), (x, y) = self.size, self.clamp
        return [(x, y), (lx - x, y), (x, ly - y), (lx - x, ly - y)]

    @property
    def comment(self) -> str:
        """Comment lines for a deck."""
        (lx, ly), (wx, wy) = self.size, self.window
        window = f"the edges of a window of {wx:g} x {wy:g}"
        rests = f"w = 0 along {window}"
        if self.support == PUSH:
            rests = f"{window} push it (UNIL), and do not pull"
        if self.clamps == HELD:
            clamps = "w = 0 at the nodes nearest to the tips of the four clamps"
        elif self.clamps is not None:
            clamps = f"Springs (SPRI) of {self.clamps} at the nodes nearest to the four clamps"
        else:
            clamps = "Clamps are not modelled"
            if self.support == HELD:
                clamps = "Clamps and lift-off are not modelled"
        return f"! Fixture {self.name}: a plate of {lx:g} x {ly:g}, {rests}.\n! {clamps}.\n"


# ASTM D7136/D7136M: 5.5 kg, hemisphere of 16 mm diameter, 6.7 J per mm of thickness.
D7136 = DropWeight(mass=5.5e-3, radius=8.0, energy=6700.0, thinnest=4.0, thickest=6.0)
# The standard prescribes where clamps press, but not exactly: some 19 and 6 mm from the corners.
FIXTURES = {"D7136": Fixture("D7136", (150.0, 100.0), (125.0, 75.0), D7136, (19.0, 6.0))}


def parse_fixture(text: str) -> Fixture:
    """Return a named fixture, or parse ``window:LXxLY,WXxWY``: sides of the plate and the window.

    Raises ObjectError if the text is neither, or the window is not smaller than the plate.
    """
    if text in FIXTURES:
        return FIXTURES[text]
    number = r"\s*(\d+(?:\.\d*)?|\.\d+)\s*"
    match = re.fullmatch(f"window:{number}[xX×]{number},{number}[xX×]{number}", text)
    if match is None:
        raise ObjectError(f"{text!r} is not a fixture: {', '.join(FIXTURES)} or {CUSTOM}")
    lx, ly, wx, wy = map(float, match.groups())
    if not (0.0 < wx < lx < 1e30 and 0.0 < wy < ly < 1e30):
        message = f"the window of {wx:g} x {wy:g} is not smaller than the plate of {lx:g} x {ly:g}"
        raise ObjectError(message)
    return Fixture("window", (lx, ly), (wx, wy))


MOST = 2000  # largest number of elements in one direction
# Default number of elements of the window, and their grading.
WINDOW_MESH = (20, 12)
WINDOW_GRADING = 3.0

Support = Literal["free", "soft", "simple", "pinned", "clamped"]


@dataclass(frozen=True)
class Plate:
    """Mesh and supports of a plate.

    :meth:`rectangle`, :meth:`on_fixture` and :meth:`from_mesh` create one.

    Attributes
    ----------
    supports : dict
        Supports by the name of an edge or of a group.
    size : tuple of float or str, or None
        Sides of a rectangle, or of the window of a fixture, length. :meth:`sides` converts them to
        a system of units.
    mesh : tuple of int or None
        Numbers of elements along x and y.
    grading : float
        Length of the largest element over the length of the smallest.
    columns, rows : tuple of Section
        Sections of elements along x and y.
    fixture : Fixture or None
    imported : PlateMesh or None
    """

    supports: Mapping[str, str]
    size: tuple[float | str, float | str] | None = None
    mesh: tuple[int, int] | None = None
    grading: float = 1.0
    columns: tuple[GridSection, ...] = field(default=(), repr=False)
    rows: tuple[GridSection, ...] = field(default=(), repr=False)
    fixture: Fixture | None = None
    imported: PlateMesh | None = None

    def __hash__(self) -> int:
        supports = frozenset(self.supports.items())
        return hash((supports, self.size, self.mesh, self.grading, self.columns, self.rows))

    def _repr_html_(self) -> str:
        """Return a table of the parts of the plate, for notebooks."""
        values = ((field.name, getattr(self, field.name)) for field in fields(self) if field.repr)
        return html_table(
            Table(tuple((name, str(value)) for name, value in values if value), title="Plate")
        )

    @classmethod
    def rectangle(
        cls,
        size: tuple[float | str, float | str] | None = None,
        mesh: tuple[int, int] | None = None,
        *,
        support: Support | str = "free",
        edges: Mapping[str, Support | str] | None = None,
        grading: float = 1.0,
        columns: str = "",
        rows: str = "",
    ) -> Self:
        """Return a rectangular plate of 9-node elements with one corner at the origin.

        Parameters
        ----------
        size : tuple of float or str
            Sides along x and y, length; in the deck's units or with a unit, as in
            ``("150mm", "100mm")``.
        mesh : tuple of int
            Numbers of elements along x and y.
        support : str
            Support of all edges: ``"free"``, ``"soft"``, ``"simple"``, ``"pinned"`` or
            ``"clamped"``; or springs, ``"spring:KR[,KW]"``: KR against the rotation across the
            edge, moment per rotation and length, and KW against w, force/length², each also with a
            unit. Without KW the edge holds w and the rotation along it.
        edges : dict, optional
            Support of single edges: ``"left"``, ``"right"``, ``"bottom"`` or ``"top"``.
        grading : float
            Length of the largest element over the length of the smallest, which is at the impact
            point.
        columns, rows : str
            Counts and lengths of the elements along x and y, as in ``"3*0.5,8*0.375"``. They
            replace `size`, `mesh` and `grading`.

        Raises
        ------
        ValueError
            If a value is missing or invalid.

        Examples
        --------
        >>> import fecm
        >>> fecm.Plate.rectangle((100, 80), (10, 8), edges={"left": "clamped"}).size
        (100.0, 80.0)
        """
        supports = dict.fromkeys(EDGES, str(support)) | dict(edges or {})
        for edge, kind in supports.items():
            if edge not in EDGES:
                raise ObjectError(f"{edge}={kind}: the edges are {', '.join(EDGES)}")
            check_support(edge, kind)
        check_positive(grading=grading)
        if grading < 1.0:
            raise ObjectError(f"`grading` is {grading:g}; it must be 1 or more")
        if columns and rows:
            if size or mesh or grading != 1.0:
                raise ObjectError("`columns` and `rows` replace `size`, `mesh` and `grading`")
            try:
                x_sections, y_sections = grids.listed_sections(columns), grids.listed_sections(rows)
                return cls(supports, columns=tuple(x_sections), rows=tuple(y_sections))
            except ValueError as error:
                raise ObjectError(f"`columns` and `rows`: {error}") from None
        if columns or rows or size is None or mesh is None:
            raise ObjectError("give `size` and `mesh`, or `columns` and `rows`")
        # Any system: the texts are checked.
        check_positive(size=min(lengths_in_units("size", size, 2, STANDARD)))
        x, y = (float(side) if is_number(text_of(side)) else side for side in size)
        nx, ny = number_pair("mesh", mesh)
        if not all(1 <= n <= MOST and n == int(n) for n in (nx, ny)):
            raise ObjectError(f"`mesh` is {mesh!r}, not two numbers of elements from 1 to {MOST}")
        return cls(supports, (x, y), (int(nx), int(ny)), float(grading))

    def sides(self, system: str | None) -> tuple[float, float] | None:
        """Return the sides of a rectangle, or of the window of a fixture, in a system of units.

        Raises ObjectError if a side has a unit and the system is None.
        """
        if self.size is None:
            return None
        x, y = lengths_in_units("size", self.size, 2, system)
        return x, y

    @classmethod
    def on_fixture(
        cls,
        name: str,
        mesh: tuple[int, int] | None = None,
        *,
        grading: float | None = None,
        window: Window = HELD,
        clamps: float | str | None = None,
    ) -> Self:
        """Return a plate that lies on the edges of a window.

        A standard also prescribes defaults for the projectile, the energy and the contact.

        Parameters
        ----------
        name : str
            Name of a standard, ``"D7136"``, or ``"window:LXxLY,WXxWY"``, the sides of the plate and
            of the window.
        mesh : tuple of int, optional
            Numbers of elements of the window along x and y; 20 and 12 by default.
        grading : float, optional
            Length of the largest element over the length of the smallest. The default is 3 with the
            default mesh, and 1 with another mesh.
        window : str
            ``"held"``: w is 0 on the edges of the window, which pull as well. ``"push"``: they only
            push (UNIL). The real plate lies between both.
        clamps : float or str, optional
            Clamps of a standard that press the plate on the window: ``"held"`` for w = 0 at their
            tips, or the stiffness of each, force/length, also with a unit, as in ``"2kN/mm"``.

        Raises
        ------
        ValueError
            If the name or a value is invalid.
        """
        fixture = parse_fixture(name)
        if window not in get_args(Window):
            raise ObjectError(f"`window` is {window!r}; it is {' or '.join(get_args(Window))}")
        if clamps is not None and fixture.clamp is None:
            raise ObjectError(
                f"`clamps` are those of a standard, {', '.join(FIXTURES)}, which tells their places"
            )
        fixture = fixture._replace(support=window, clamps=clamps)
        ratio = grading or (WINDOW_GRADING if mesh is None else 1.0)
        plain = cls.rectangle(fixture.window, mesh or WINDOW_MESH, grading=ratio)
        return replace(plain, fixture=fixture)

    @classmethod
    def from_mesh(
        cls,
        mesh: str | Path | MeshLike | GridLike | tuple[ArrayLike, ArrayLike],
        support: Mapping[str, Support | str] | Support | str | None = None,
        *,
        groups: Mapping[str, ArrayLike] | None = None,
    ) -> Self:
        """Return a plate with the mesh of a mesh generator.

        The elements are triangles of 3 or 6 nodes, or quadrilaterals of 4, 8 or 9 nodes, and all
        have the same type. Clockwise elements are reversed, and nodes without an element dropped. A
        triangle becomes three quadrilaterals of 4 nodes. An element of 8 nodes gets a node at its
        centre.

        Parameters
        ----------
        mesh : str, Path, meshio.Mesh, pyvista.DataSet or tuple of arrays
            A file that meshio reads, such as Gmsh's `.msh`; a mesh of meshio or PyVista; or points
            (n, 2) and cells (m, k) with points counted from 0.
        support : dict or str, optional
            Supports by the names of groups of lines, as those of :meth:`rectangle`. The group
            ``"boundary"`` has all sides of the outline and of holes that are in no other group
            named here. A single support applies to this group. A group that is named like a support
            has that support.
        groups : dict, optional
            Points of groups; only for a mesh of arrays.

        Raises
        ------
        ValueError
            If the mesh or a support can't be used.
        ImportError
            If the mesh is a file and meshio is not installed.
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
            plate = plate_mesh.plate_mesh(mesh[0], mesh[1], groups or {})
        elif groups is not None:
            raise ObjectError("`groups` are for arrays; a mesh has its own")
        elif isinstance(mesh, str | Path):
            plate = plate_mesh.read_mesh(mesh)
        elif isinstance(mesh, GridLike):
            plate = plate_mesh.from_pyvista(mesh)
        else:
            plate = plate_mesh.from_meshio(mesh)
        supports = {BOUNDARY: support} if isinstance(support, str) else support or {}
        if not isinstance(supports, Mapping):
            raise ObjectError(f"`support` is {support!r}, not a dictionary of groups")
        named = {name: text for name, text in supports.items() if not is_elastic(text)}
        elastic = {name: text for name, text in supports.items() if is_elastic(text)}
        for name, text in elastic.items():
            check_support(name, text)
        plate.supports(dict.fromkeys(elastic, "free"))  # the groups exist
        return cls({**plate.supports(named), **elastic}, imported=plate)
