"""Meshes of mesh generators: elements and groups of nodes from a file or arrays."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fecm._errors import FecmError
from fecm._inputs import read_input
from fecm._typing import Bools, Floats
from fecm.deck.grid import (
    IN_PLANE,
    RESTRAINTS,
    SUPPORTS,
    EdgeStiffness,
    boundary_cards,
    held_in_plane,
    round_to,
)
from fecm.deck.model import Boundary, Control, Coordinates, Elements, NodeValues, Springs
from fecm.deck.reader import identify_program
from fecm.mechanics.joints import (
    coincident,
    hanging_nodes,
    merged,
    representatives,
    sides_of_cells,
)
from fecm.mechanics.supports import side_weights
from fecm.problem.abaqus_sets import (
    AbaqusSetError,
    abaqus_cards,
    element_sets,
    node_sets,
    nodes_and_elements,
)
from fecm.problem.mesh_readers import (
    ALIKE_ELEMENTS,
    LARGEST,
    NastranError,
    physical_groups,
    read_nastran,
)

Integers = NDArray[np.int_]
# meshio's names of cells by their number of nodes, and by their number of corners.
KINDS = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
CORNERS = {3: 3, 4: 4, 6: 3, 8: 4, 9: 4}  # by the number of nodes
DIMENSIONS = {"vertex": 0, "line": 1, "line3": 1}  # of the cells of groups of nodes
LINES = tuple(DIMENSIONS)
# meshio's names of VTK's types of cells.
VTK_KINDS = {
    1: "vertex", 3: "line", 21: "line3", 5: "triangle", 9: "quad", 22: "triangle6", 23: "quad8",
    28: "quad9",
}  # fmt: skip
# Name of all sides that belong to one element, unless the mesh has a group of that name.
BOUNDARY = "boundary"
PHYSICAL = "gmsh:physical"  # name of the numbers of physical groups
XDMF = (".xdmf", ".xmf")  # whose data may be in other files
FORM = re.compile(rb"""Format\s*=\s*["'](\w+)""", re.IGNORECASE)  # of such data
NASTRAN = (".bdf", ".fem", ".nas")
BULK = re.compile(rb"^[^\S\n]*BEGIN[ ,]+BULK", re.IGNORECASE | re.MULTILINE)
# Elements of Abaqus that meshio knows by another name.
ALIKE = {"S8": "S8R", "S6": "STRI65"}
# Cards of Abaqus that may occur once, because meshio does not read further ones; and the remedy.
ABAQUS_ONCE = {
    "Part": "write the part of the plate alone",
    "Instance": "write the part of the plate alone",
    "Node": "give the nodes of the plate in one, without points of reference",
}
ABAQUS_UNREAD = (
    rb"\*(system|ngen|nfill|nmap|ncopy|elgen|elcopy)\s*(,|$)|\*node\s*,.*\bsystem\s*=\s*[cs]"
)
LONGEST_NAME = 10_000  # characters of the name of a group
HEAD = 10_000  # bytes that identify the program of a file
SAME = 1e-9  # largest difference of equal coordinates, over the size of the mesh
NO_AREA = 1e-12  # largest area of a degenerate element, over the square of the size
NAMED = 8  # largest number of elements named in a message


class MeshError(FecmError, ValueError):
    """A mesh can't be used for a plate."""


@dataclass(frozen=True, eq=False, repr=False)
class PlateMesh:
    """Quadrilaterals of 4 or 9 nodes, counter-clockwise in the deck's order."""

    points: Floats  # coordinates, length
    cells: Integers  # nodes of the elements, from 0
    groups: dict[str, Integers]  # nodes by the name of a group, from 0
    middles: Integers  # nodes put in the middles of straight sides, from 0
    surfaces: Mapping[str, Integers] = field(default_factory=dict)  # elements of groups, from 0

    def __repr__(self) -> str:
        return f"<{self.nodes} nodes, {self.elements} elements, groups {list(self.groups)}>"

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def elements(self) -> int:
        """Number of elements."""
        return len(self.cells)

    @property
    def most_nodes(self) -> int:
        """Nodes per element."""
        return int(self.cells.shape[1])

    @property
    def extent(self) -> tuple[list[float], list[float]]:
        """Lowest and highest coordinates."""
        return self.points.min(axis=0).tolist(), self.points.max(axis=0).tolist()

    def nearest(self, x: float, y: float) -> tuple[int, float, float]:
        """Return number and place of the node nearest to a point."""
        row = int(np.hypot(*(self.points - (x, y)).T).argmin())
        return row + 1, *self.points[row].tolist()

    @property
    def _control(self) -> Control:
        return Control(self.nodes, self.elements, layers=1, ndm=2, ndf=5, nen=self.most_nodes)

    def coordinates(self) -> Coordinates:
        """Return COOR cards, one per node."""
        numbers = np.arange(1, self.nodes + 1)
        cards = np.column_stack((numbers, np.zeros(self.nodes), self.points))
        return Coordinates.of(self._control, cards)

    def element_cards(self) -> Elements:
        """Return ELEM cards, one per element."""
        numbers = np.arange(1, self.elements + 1)
        cards = np.column_stack((numbers, self.cells + 1, np.zeros(self.elements)))
        return Elements.of(self._control, cards)

    def supported(
        self, everywhere: Sequence[int], supports: Mapping[str, str], *, in_plane: str = "held"
    ) -> Boundary | None:
        """Return BOUN cards of the supports of groups; None where nothing is restrained.

        The support of the boundary leaves out the other groups. `in_plane` is the support of u and
        v. Raises MeshError if it depends on the direction of a side that is along neither x nor y.
        """
        return boundary_cards(self._codes(everywhere, supports, in_plane))

    def _codes(
        self, everywhere: Sequence[int], supports: Mapping[str, str], in_plane: str
    ) -> Integers:
        """Return the restraint codes of all nodes, (nodes, 5); see :meth:`supported`."""
        codes = np.tile(np.array(everywhere), (self.nodes, 1))
        for name, support in supports.items():
            rows = self._group(name)
            if name == BOUNDARY and name not in self.groups:
                for other in supports.keys() - {name}:
                    rows = np.setdiff1d(rows, self._group(other))
            if support == "free":
                continue
            sides, _, counts = _sides(self.cells)
            sides = sides[_inside(sides, counts, rows)]
            along = self._along_axes(sides)
            straight = len(sides) > 0 and bool(along.any(axis=1).all())
            lines = [np.unique(sides[along[:, axis]]) for axis in (1, 0)]  # along x, along y
            bending = RESTRAINTS[support]
            everywhere_held = np.minimum(*bending)  # whatever the direction of the side
            if straight:
                for on, code in zip(lines, bending, strict=True):
                    codes[on, 2:] = np.maximum(codes[on, 2:], code)
            elif bending.along_x != bending.along_y:
                # Three nodes in a line, on the polygon of a curve, would hold the rotation too.
                rows = np.setdiff1d(rows, self.middles)
            codes[rows, 2:] = np.maximum(codes[rows, 2:], everywhere_held)
            held = held_in_plane(support, in_plane)
            if held == "held":
                codes[rows, :2] = 1
            elif held != "free":
                if not straight:
                    raise MeshError(
                        f"the sides of {name!r} are not all along x or y: u and v are not {held} "
                        "to them"
                    )
                for on, code in zip(lines, IN_PLANE[held], strict=True):
                    codes[on, :2] = np.maximum(codes[on, :2], code)
        return codes

    def springs(
        self, groups: Mapping[str, EdgeStiffness], supports: Mapping[str, str]
    ) -> Springs | None:
        """Return SPRI cards of the nodes of groups with springs; None without any stiffness.

        A node has the stiffness of the length that it stands for. Restrained dofs have none.
        `supports` are those of all groups, as for :meth:`supported`. Raises MeshError if a group
        has no sides, or springs of rotations on sides that are along neither x nor y.
        """
        total = np.zeros((self.nodes, 5))
        ends, number, counts = _sides(self.cells[:, :4])
        middle = np.full(len(ends), -1)
        if self.most_nodes > 4:
            middle[number] = self.cells[:, 4:8]
        for name, stiffness in groups.items():
            chosen = _inside(ends, counts, self._group(name))
            if name == BOUNDARY and name not in self.groups:
                for other in supports.keys() - {name}:
                    chosen &= ~_inside(ends, counts, self._group(other))
            if not chosen.any():
                raise MeshError(f"no side of an element lies in {name!r}: it can't have springs")
            along_y, along_x = self._along_axes(ends[chosen]).T
            if stiffness.rotation and not (along_x | along_y).all():
                raise MeshError(
                    f"the sides of {name!r} are not all along x or y: they can have springs "
                    "against w alone, spring:0,KW"
                )
            first, last = ends[chosen].T
            between = np.where(middle[chosen] >= 0, middle[chosen], first)
            lengths = sum(
                np.hypot(*(self.points[b] - self.points[a]).T)
                for a, b in ((first, between), (between, last))
            )
            for on, values in ((along_y, stiffness.along_y()), (~along_y, stiffness.along_x())):
                parts = ends[chosen][on], middle[chosen][on], lengths[on]
                total += np.outer(side_weights(*parts, self.nodes), values)
        total[self._codes((0,) * 5, supports, "free") != 0] = 0.0
        (rows,) = np.nonzero(total.any(axis=1))
        cards = [
            NodeValues(row + 1, 0, tuple(float(f"{k:.6g}") for k in total[row].tolist()))
            for row in rows.tolist()
        ]
        return Springs(tuple(cards)) if cards else None

    def _along_axes(self, sides: Integers) -> Bools:
        """Return whether the x, and the y, of the nodes of sides are equal, (sides, 2)."""
        return np.asarray(np.ptp(self.points[sides], axis=1) <= SAME * np.ptp(self.points))

    def _group(self, name: str) -> Integers:
        if name in self.groups or name != BOUNDARY:
            return self.groups[name]
        sides, number, _ = _sides(self.cells)
        # A seam, where nodes are in the same place, is not a boundary.
        pairs = coincident(self.points, sides_of_cells(self.cells, min(self.most_nodes, 4)))
        joined = representatives(self.nodes, pairs)[self.cells]
        _, of_joined, counts = _sides(joined)
        return np.unique(sides[number[counts[of_joined] == 1]])

    def supports(self, requested: Mapping[str, str]) -> dict[str, str]:
        """Return the supports of groups; a group named after a support has it.

        Raises MeshError if a group does not exist.
        """
        for name, support in requested.items():
            if name not in self.groups and name != BOUNDARY:
                names = ", ".join(sorted({*self.groups, BOUNDARY}))
                raise MeshError(f"the mesh has no group {name!r}; its groups are {names}")
            if support not in SUPPORTS:
                raise MeshError(f"{name}={support}: the supports are {', '.join(SUPPORTS)}")
        return {name: name for name in SUPPORTS if name in self.groups} | dict(requested)


class MeshLike(Protocol):
    """Attributes of a `meshio.Mesh` that are used."""

    points: Any
    cells: Any
    point_data: Any
    cell_data: Any
    cell_sets: Any
    point_sets: Any
    field_data: Any


@runtime_checkable
class GridLike(Protocol):
    """Attributes of a data set of PyVista that are used."""

    def cast_to_unstructured_grid(self) -> Any:
        """Convert the data set to a grid with points, cells and types of cells."""


def read_mesh(path: str | Path) -> PlateMesh:
    """Read a mesh: bulk data of Nastran, or with meshio Gmsh's `.msh` and other formats.

    Raises MeshError if the file is not the mesh of a plane plate, ImportError without meshio.
    """
    path = Path(path)
    text = read_input(path)
    if path.suffix.lower() in NASTRAN or BULK.search(text):
        try:
            bulk = read_nastran(path)
        except NastranError as error:
            raise MeshError(str(error)) from None
        return plate_mesh(*bulk, f"{path}: ")
    try:
        import meshio
    except ModuleNotFoundError:
        raise ImportError("meshes need meshio: pip install 'fecm[mesh]'") from None
    head = text[:HEAD].decode("latin-1").splitlines()
    if (program := identify_program(head)) is not None and program.export:
        raise MeshError(f"{path} is {program.what}, whose mesh is not read: {program.export}")
    _check_whole(path, text)
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            read = _read_abaqus(text) if path.suffix.lower() == ".inp" else meshio.read(path)
    except AbaqusSetError as error:
        raise MeshError(f"{path}:{error}") from None
    except (Exception, SystemExit) as error:
        raise MeshError(_why_unreadable(path, text, error, printed.getvalue())) from None
    _add_groups(read, physical_groups(text))
    return from_meshio(read, f"{path}: ")


def _read_abaqus(text: bytes) -> MeshLike:
    """Read an input of Abaqus: nodes and elements by meshio, sets by :mod:`abaqus_sets`."""
    import meshio

    cards = list(abaqus_cards(text.decode(errors="replace")))
    read: MeshLike = meshio.read(io.StringIO(nodes_and_elements(cards)), file_format="abaqus")
    read.point_sets = node_sets(cards)
    read.cell_sets = element_sets(cards, [block.data.shape[1] for block in read.cells])
    return read


def _add_groups(read: MeshLike, groups: Mapping[tuple[int, int], list[int]]) -> None:
    """Add the groups without a name that are not the first of their entity."""
    named = {tuple(pair) for pair in read.field_data.values() if _is_group(pair)}
    entities = read.cell_data.get("gmsh:geometrical", [])
    for (dimension, entity), numbers in groups.items():
        for number in numbers[1:]:
            if (number, dimension) in named:
                continue
            unnamed = [
                np.flatnonzero((tags == entity) & (block.dim == dimension))
                for block, tags in zip(read.cells, entities, strict=False)
            ]
            before = read.cell_sets.get(str(number), [[]] * len(unnamed))
            read.cell_sets[str(number)] = list(map(np.append, before, unnamed))


def _check_whole(path: Path, text: bytes) -> None:
    """Refuse files that refer to others, and several parts in one."""
    suffix, abaqus = path.suffix.lower(), path.suffix.lower() == ".inp"
    elsewhere = suffix in XDMF and any(form.lower() != b"xml" for form in FORM.findall(text))
    if elsewhere or (abaqus and b"*include" in text.lower()):
        raise MeshError(f"{path} refers to other files, which are not read; put it into one file")
    if abaqus:
        _check_abaqus(path, text)
    names = text.partition(b"$PhysicalNames")[2].partition(b"$EndPhysicalNames")[0]
    if max(map(len, names.splitlines()), default=0) > LONGEST_NAME:  # meshio takes seconds for it
        raise MeshError(
            f"{path} has a physical group with a name of more than {LONGEST_NAME} characters; "
            "give it a shorter one"
        )


def _check_abaqus(path: Path, text: bytes) -> None:
    """Refuse what meshio omits from an input of Abaqus, or reads in another way."""
    for card, remedy in ABAQUS_ONCE.items():
        if len(lines := _lines_with(text, rb"\*%b\s*(,|$)" % card.encode())) > 1:
            raise MeshError(f"{path}:{lines[1]}: a second *{card}; {remedy}")
    for line in _lines_with(text, ABAQUS_UNREAD):
        card = text.splitlines()[line - 1].decode("latin-1").strip()[:60]
        raise MeshError(
            f"{path}:{line}: `{card}` makes or moves nodes or elements, and is not read; write "
            "all of them in full, with coordinates x and y"
        )
    for generated in abaqus_cards(text.decode(errors="replace")):
        if generated.keyword not in ("NSET", "ELSET") or "GENERATE" not in generated.parameters:
            continue
        numbers = " ".join(generated.data).replace(",", " ").split()
        if len(numbers) != 3 or not re.fullmatch("0*[1-9][0-9]{0,17}", numbers[2]):
            shown = " ".join(generated.data).strip()[:60]
            raise MeshError(
                f"{path}:{generated.line}: GENERATE has `{shown}`; write first, last and a "
                "positive increment in one line"
            )


def _why_unreadable(path: Path, text: bytes, error: BaseException, printed: str) -> str:
    """Say what meshio can't read, where it is, and what helps."""
    why = " ".join(str(error).split()) if isinstance(error, Exception) else ""
    if match := re.search(r"Element type not available: (\S+)", f"{printed} {why}"):
        kind = match[1]
        lines = _lines_with(text, rb"\*element\b.*type\s*=\s*" + re.escape(kind).encode() + rb"\b")
        instead = f"; write it as {ALIKE[kind]}" if kind in ALIKE else ""
        instead = instead or "; write the plate alone, of S4R, S8R, S3 or STRI65 elements"
        return f"{path}:{lines[0] if lines else 1}: meshio has no elements of type {kind}{instead}"
    if PHYSICAL in why:
        return (
            f"{path}: some elements are in a physical group and others in none (Gmsh's "
            "Mesh.SaveAll); save the mesh as MSH 2.2, or without SaveAll"
        )
    if path.suffix.lower() == ".inp" and "could not convert" in why:
        for line, row in enumerate(text.splitlines(), start=1):
            first, *others = (field.strip() for field in row.rstrip(b" \t,").split(b","))
            if first.isdigit() and b"" in others:
                return f"{path}:{line}: a coordinate is blank; write 0."
        for line in _lines_with(text, rb"\s*[0-9]+\s*(,[^,\n]+){2,3},\s*$"):
            return f"{path}:{line}: a comma follows the last coordinate; delete it in all nodes"
    if lines := _lines_with(text, rb"\$ParametricNodes\b"):
        return (
            f"{path}:{lines[0]}: meshio does not read $ParametricNodes; save the mesh without "
            "Gmsh's Mesh.SaveParametric"
        )
    what = f": {why[:200]}" if why else ""
    return f"{path} can't be read as a mesh by meshio{what}; save it as MSH 2.2 or VTK"


def _lines_with(text: bytes, pattern: bytes) -> list[int]:
    """Return the numbers of the lines that start with a pattern."""
    begins = re.compile(pattern, re.IGNORECASE)
    return [n for n, line in enumerate(text.splitlines(), start=1) if begins.match(line)]


def from_pyvista(grid: GridLike) -> PlateMesh:
    """Return the plate of a data set of PyVista.

    Groups are numbers in the cell data `gmsh:physical`.
    """
    data_set = grid.cast_to_unstructured_grid()
    blocks: list[Any] = []
    physical: list[Any] = []
    for number, cells in data_set.cells_dict.items():
        kind = VTK_KINDS.get(int(number), f"VTK's type {number}")
        blocks.append(SimpleNamespace(type=kind, data=cells))
        if PHYSICAL in data_set.cell_data:
            physical.append(np.asarray(data_set.cell_data[PHYSICAL])[data_set.celltypes == number])
    cell_data = {PHYSICAL: physical} if physical else {}
    none: dict[str, Any] = {}
    read = SimpleNamespace(
        points=data_set.points,
        cells=blocks,
        point_data=none,
        cell_data=cell_data,
        cell_sets=none,
        point_sets=none,
        field_data=none,
    )
    return from_meshio(read)


def from_meshio(read: MeshLike, where: str = "") -> PlateMesh:
    """Return the plate of a `meshio.Mesh`; see :func:`plate_mesh`."""
    if not all(hasattr(read, name) for name in MeshLike.__annotations__):
        raise MeshError(
            f"{read!r} is not a file, a meshio.Mesh, a grid of PyVista, or points and cells"
        )
    blocks = {n: block for n, block in enumerate(read.cells) if block.type not in LINES}
    kinds = sorted({block.type for block in blocks.values()})
    if len(kinds) != 1 or kinds[0] not in KINDS.values():
        what = "no elements with an area (in Gmsh, give the surface a physical group too)"
        what = f"{' and '.join(kinds)} elements" if kinds else what
        must = "all must be triangles of 3 or 6 nodes, or all quadrilaterals of 4, 8 or 9"
        must += f": {ALIKE_ELEMENTS}" if len(kinds) > 1 else ""
        raise MeshError(f"{where}the mesh has {what}; {must}")
    groups: dict[str, list[Any]] = {}
    surfaces: dict[str, list[Any]] = {}
    first = 0  # number of the next element
    names = {tuple(pair): name for name, pair in read.field_data.items() if _is_group(pair)}
    families = getattr(read, "cell_tags", {})  # names of groups by family, in MED files
    for number, block in enumerate(read.cells):
        targets, rows = groups, block.data
        if number in blocks:
            targets, rows = surfaces, np.arange(len(block.data)) + first
            first += len(block.data)
        if PHYSICAL in read.cell_data:
            tags = read.cell_data[PHYSICAL][number]
            for tag in np.unique(tags[tags > 0]).tolist():
                name = names.get((tag, 2 if number in blocks else DIMENSIONS[block.type]), str(tag))
                targets.setdefault(name, []).append(rows[tags == tag])
        for name, sets in read.cell_sets.items():
            if not name.startswith("gmsh:"):
                targets.setdefault(name, []).append(rows[np.asarray(sets[number], int)])
        for family, of_family in families.items():
            for name in of_family:
                tags = read.cell_data["cell_tags"][number]
                targets.setdefault(name, []).append(rows[tags == family])
    for name, rows in read.point_sets.items():
        groups.setdefault(name, []).append(rows)
    for family, of_family in getattr(read, "point_tags", {}).items():
        for name in of_family:
            tags = read.point_data["point_tags"]
            groups.setdefault(name, []).append(np.flatnonzero(tags == family))
    cells = np.concatenate([block.data for block in blocks.values()])
    return plate_mesh(read.points, cells, _joined(groups), where, _joined(surfaces))


def _is_group(value: Any) -> bool:
    """Return whether field data are the number and dimension of a group; MED files have others."""
    return len(value) == 2 and all(isinstance(item, int | np.integer) for item in value)


def _joined(groups: Mapping[str, list[Any]]) -> dict[str, Integers]:
    """Return the numbers of each group that is not empty."""
    flat = {name: np.concatenate([np.ravel(p) for p in parts]) for name, parts in groups.items()}
    return {name: np.unique(numbers) for name, numbers in flat.items() if len(numbers)}


def plate_mesh(
    points: ArrayLike,
    cells: ArrayLike,
    groups: Mapping[str, ArrayLike],
    where: str = "",
    surfaces: Mapping[str, ArrayLike] | None = None,
) -> PlateMesh:
    """Return the elements of a plate from points and cells.

    Cells are turned counter-clockwise and nodes without a cell dropped. Three quadrilaterals of 4
    nodes replace a triangle; a quadrilateral of 8 nodes gets its centre as the ninth.

    The points, (n, 2) or (n, 3), are in a plane z = const. Cells, (m, k), and groups have points
    from 0; a cell has corners, mid-sides (the first between corners 1 and 2), centre. Surfaces have
    cells from 0. `where` starts the messages. Raises MeshError if they are not the mesh of a plane
    plate.
    """
    try:
        places, nodes = np.array(points, float), np.array(cells)
        rows = {name: np.unique(np.asarray(group, int)) for name, group in groups.items()}
    except (TypeError, ValueError, OverflowError) as error:
        raise MeshError(f"{where}points, cells or groups are not arrays: {error}") from None
    if places.ndim != 2 or places.shape[1] not in (2, 3):
        raise MeshError(f"{where}points must be numbers, (n, 2) or (n, 3)")
    if not (np.abs(places) <= LARGEST).all():
        raise MeshError(f"{where}points must be finite numbers up to {LARGEST:g}")
    if nodes.ndim != 2 or nodes.shape[1] not in KINDS or nodes.dtype.kind not in "iu":
        raise MeshError(f"{where}cells must be integers, (m, k) with k one of 3, 4, 6, 8 and 9")
    nodes, size = nodes.astype(int), float(np.ptp(places[:, :2], axis=0).max(initial=0.0))
    for name, part in {"cells": nodes, **rows}.items():
        if not part.size or part.min() < 0 or part.max() >= len(places):
            raise MeshError(f"{where}{name} must name points 0 to {len(places) - 1}")
    if places.shape[1] == 3 and np.ptp(places[np.unique(nodes), 2]) > SAME * size:
        low, high = places[:, 2].min(), places[:, 2].max()
        raise MeshError(f"{where}the mesh is not in a plane z = const: z is {low:g} to {high:g}")
    nodes = _turned(places[:, :2], nodes, size, where)
    _check_joints(places[:, :2], nodes, where)
    rows = {name: _with_middles(nodes, group) for name, group in rows.items()}
    count, asked = len(places), len(nodes)
    places, nodes, new = _quadrilaterals(places[:, :2], nodes, rows)
    used, numbers = np.unique(nodes, return_inverse=True)
    kept = {name: np.flatnonzero(np.isin(used, group)) for name, group in rows.items()}
    if lost := [name for name, group in kept.items() if not len(group)]:
        raise MeshError(f"{where}no node of the group {lost[0]!r} belongs to an element")
    rounded = [[round_to(value, size) for value in place] for place in places[used].tolist()]
    middles = np.flatnonzero((used >= count) & (used < count + new))
    parts = len(nodes) // asked  # elements that replace a cell
    zones = {
        name: (parts * np.asarray(rows, int)[:, None] + np.arange(parts)).ravel()
        for name, rows in (surfaces or {}).items()
    }
    mesh = PlateMesh(np.array(rounded), numbers.reshape(nodes.shape), kept, middles, zones)
    if (_sides(mesh.cells)[2] > 2).any():
        raise MeshError(f"{where}elements overlap: more than two share a side")
    return mesh


def _turned(places: Floats, nodes: Integers, size: float, where: str) -> Integers:
    """Return the cells counter-clockwise; cells without an area, or given twice, are refused."""
    count = CORNERS[nodes.shape[1]]
    x, y = np.moveaxis(places[nodes[:, :count]], 2, 0)
    area = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2.0
    ordered = np.sort(nodes, axis=1)
    collapsed = (np.abs(area) <= NO_AREA * size**2) | (np.diff(ordered, axis=1) == 0).any(axis=1)
    _, first = np.unique(ordered, axis=0, return_index=True)
    twice = ~np.isin(np.arange(len(nodes)), first)
    for wrong, what in ((collapsed, "without an area"), (twice, "given twice")):
        if wrong.any():
            numbers = ", ".join(map(str, (np.flatnonzero(wrong)[:NAMED] + 1).tolist()))
            numbers += ", ..." if wrong.sum() > NAMED else ""
            text = f"{wrong.sum()} elements {what}: number {numbers} of the plane elements"
            raise MeshError(f"{where}{text}")
    back = [0, *range(count - 1, 0, -1)]
    if nodes.shape[1] > count:  # mid-sides follow their corners
        back += [2 * count - 1 - n for n in range(count)]
    back += range(2 * count, nodes.shape[1])
    return np.where(area[:, None] < 0.0, nodes[:, back], nodes)


def _check_joints(places: Floats, nodes: Integers, where: str) -> None:
    """Refuse nodes inside a side of an element that does not have them."""
    sides = sides_of_cells(nodes, CORNERS[nodes.shape[1]])
    hanging, elements = hanging_nodes(merged(sides, coincident(places, sides)), places)
    if not len(hanging):
        return
    (x, y), node, element = places[hanging[0]], hanging[0] + 1, elements[0] + 1
    more = f", and so do {len(hanging) - 1} others" if len(hanging) > 1 else ""
    raise MeshError(
        f"{where}point {node} at {x:g}, {y:g} lies inside a side of number {element} of the plane "
        f"elements, which does not have it{more}: the plate is cut there; elements must have the "
        "same nodes along their common side"
    )


def _with_middles(nodes: Integers, group: Integers) -> Integers:
    """Add the middles of its sides to a group of nodes that has only corners."""
    corners = CORNERS[nodes.shape[1]]
    middles = nodes[:, corners : 2 * corners]
    if not middles.shape[1] or np.isin(middles, group).any():
        return group
    sides, number, counts = _sides(nodes[:, :corners])
    middle = np.empty(len(sides), int)
    middle[number] = middles
    return np.concatenate([group, middle[_inside(sides, counts, group)]])


def _quadrilaterals(
    places: Floats, nodes: Integers, groups: dict[str, Integers]
) -> tuple[Floats, Integers, int]:
    """Return points, cells of 4 or 9 nodes, and the number of new mid-sides.

    New mid-sides follow the old points.
    """
    count, new = nodes.shape[1], 0
    if count in (4, 9):
        return places, nodes, new
    if count == 3:  # new nodes in the middles of the sides
        sides, number, counts = _sides(nodes)
        new = len(sides)
        for name, group in groups.items():
            middles = np.flatnonzero(_inside(sides, counts, group))
            groups[name] = np.concatenate([group, len(places) + middles])  # with middles
        nodes = np.hstack([nodes, len(places) + number])
        places = np.vstack([places, places[sides].mean(axis=1)])
    # The element's own shape functions at its centre.
    corners = len(nodes[0]) // 2
    share = np.repeat([-1 / 9, 4 / 9] if corners == 3 else [-0.25, 0.5], corners)
    centre = len(places) + np.arange(len(nodes))
    places = np.vstack([places, np.einsum("i,nij->nj", share, places[nodes])])
    if corners == 4:
        return places, np.column_stack([nodes, centre]), new
    parts = [
        np.column_stack([nodes[:, n], nodes[:, 3 + n], centre, nodes[:, 3 + (n + 2) % 3]])
        for n in range(3)
    ]
    return places, np.stack(parts, axis=1).reshape(-1, 4), new


def _sides(cells: Integers) -> tuple[Integers, Integers, Integers]:
    """Return the nodes of the sides, (n, 2) or (n, 3), the elements' sides, and their shares."""
    corners = min(cells.shape[1], 4)
    parts = [cells[:, :corners], np.roll(cells[:, :corners], -1, axis=1), cells[:, 4:8]]
    sides = np.stack(parts[: 2 if cells.shape[1] == corners else 3], axis=2)
    sides = np.sort(sides, axis=2).reshape(-1, sides.shape[2])
    unique, number, counts = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    return unique, number.reshape(-1, corners), counts


def _inside(sides: Integers, counts: Integers, group: Integers) -> Bools:
    """Return which sides lie in a group of nodes.

    If all nodes of the group are on the boundary, only sides of the boundary count.
    """
    edge = counts == 1
    within = np.asarray(np.isin(sides, group).all(axis=1))
    return within & edge if np.isin(group, sides[edge]).all() else within
