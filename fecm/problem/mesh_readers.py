"""Readers of mesh files: physical groups of Gmsh 4.1, bulk data of Nastran.

Gmsh: physical groups of curves and surfaces. meshio knows all named groups of an entity, but only
the first of the groups without a name.

Nastran: nodes and the elements CQUAD4, CQUADR, CTRIA3, CTRIAR, CQUAD8, CTRIA6. Coordinates are
converted from the systems of CP and GRDSET to the basic system. INCLUDE is followed. What a plate
of fecm does not have, such as offsets, angles of elements and stiffeners, is refused. Bars without
a property, as Gmsh writes lines, are groups of nodes named by the number of the property.
This reader is our own: pyNastran 1.4 requires NumPy 1, and refuses these bars.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._inputs import read_input
from fecm._typing import Floats

_HEAD = re.compile(rb"\s*\$MeshFormat\s+4\.1 ([01]) 8\r?\n(....)?", re.DOTALL)
_SECTION = re.compile(rb"^\$Entities *\r?\n", re.MULTILINE)
_DOUBLES = {0: 3, 1: 6, 2: 6}  # coordinates of an entity by its dimension

Take = Callable[[str, int], list[int]]  # numbers of a kind, `i` or `N` or `d`


def physical_groups(text: bytes) -> dict[tuple[int, int], list[int]]:
    """Return the physical groups of an entity, by its dimension and number.

    The result is empty for a file that is not of Gmsh 4.1 or is damaged.
    """
    head, section = _HEAD.match(text), _SECTION.search(text)
    if head is None or section is None:
        return {}
    body = text[section.end() :]
    order = "<" if head[2] == b"\1\0\0\0" else ">"
    take = _binary(body, order) if head[1] == b"1" else _ascii(body)
    try:
        return dict(_entities(take))
    except (ValueError, struct.error):
        return {}


def _entities(take: Take) -> Iterator[tuple[tuple[int, int], list[int]]]:
    """Yield dimension and number of points, curves and surfaces, and their groups."""
    counts = take("N", 4)
    for dimension, doubles in _DOUBLES.items():
        for _ in range(counts[dimension]):
            (number,) = take("i", 1)
            take("d", doubles)
            groups = take("i", *take("N", 1))
            if dimension:
                take("i", *take("N", 1))  # entities around it
            yield (dimension, number), [abs(group) for group in groups]


def _ascii(body: bytes) -> Take:
    words = iter(body.partition(b"$End")[0].split())

    def take(kind: str, count: int) -> list[int]:
        taken_words = list(islice(words, count))
        if len(taken_words) < count:
            raise ValueError(f"{len(taken_words)} of {count} numbers are there")
        return [] if kind == "d" else [int(word) for word in taken_words]

    return take


def _binary(body: bytes, order: str) -> Take:
    position = 0
    letters = {"i": "i", "N": "Q", "d": "d"}

    def take(kind: str, count: int) -> list[int]:
        nonlocal position
        form = f"{order}{count}{letters[kind]}"
        taken_words = struct.unpack_from(form, body, position)
        position += struct.calcsize(form)
        return [] if kind == "d" else list(taken_words)

    return take


# What to do with a mesh of quadrilaterals and triangles.
ALIKE_ELEMENTS = (
    "mesh the plate with triangles alone, or with quadrilaterals alone (in Gmsh, "
    "Mesh.SubdivisionAlgorithm = 1 splits all elements into quadrilaterals)"
)
INCLUDE = "INCLUDE"
LONGEST_NAME = 1000  # characters of a line with the name of a file
DEPTH = 10  # deepest nesting of INCLUDE
LARGEST = 1e30  # coordinate: products of three are finite
MOST_DIGITS = 18  # of a whole number
SHOWN = 40  # characters of a field in a message
MOST_SYSTEMS = 100  # within one another
PARALLEL = 1e-9
_NUMBER = re.compile(
    r"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+))(?:[EeDd]([+-]?[0-9]+)|([+-][0-9]+))?"
)
_OPEN_INCLUDE = re.compile(r"\s*INCLUDE\s*(?:'[^']*|\"[^\"]*)", re.IGNORECASE)
_BULK = re.compile(r"\s*BEGIN\b", re.IGNORECASE)
_SYSTEM = re.compile(r"CORD([12])([RCS])")
# Cards that start with C but are not elements.
_OTHERS = re.compile(r"C(AERO|LOAD|OMPOSIT|ONV|ORD|REEP|SET|SSCHD|SUP|YAX|YJOIN|YSUP|YSYM)")
_LINES = ("CBAR", "CBEAM", "CROD")
_OF_LINES = re.compile(r"PB(AR|EAM)L?|PBCOMP|PROD")  # properties
_RIGID = re.compile(r"R(BAR|BE[123]|ROD|SPLINE|SSCON|TRPLT)")


class NastranError(ValueError):
    """Bulk data can't be read as a plate."""


class NastranCard(NamedTuple):
    """Card with its continuations."""

    place: str  # file and line
    fields: list[str]  # without the keyword

    def error(self, keyword: str, what: str) -> NastranError:
        """Return an error that names the card."""
        number = f" {self.fields[0][:SHOWN]}" if self.fields and self.fields[0] else ""
        return NastranError(f"{self.place}: {keyword}{number} {what}")

    def text(self, place: int) -> str:
        """Return a field after the keyword, from 0; empty beyond the last field."""
        return self.fields[place] if place < len(self.fields) else ""

    def real(self, keyword: str, place: int) -> float:
        """Return the number in a field; 0 for a blank field."""
        text = self.text(place)
        match = _NUMBER.fullmatch(text) if text else None
        value = float(f"{match[1]}e{match[2] or match[3] or 0}") if match else 0.0
        if (text and match is None) or abs(value) > LARGEST:
            what = f"which is not a finite number up to {LARGEST:g}"
            raise self.error(keyword, f"has `{text[:SHOWN]}`, {what}")
        return value

    def whole(self, keyword: str, place: int, default: int | None = None) -> int:
        """Return the whole number in a field; the default for a blank field."""
        text = self.text(place)
        if not text and default is not None:
            return default
        if not re.fullmatch(rf"\+?[0-9]{{1,{MOST_DIGITS}}}", text):
            shown = f"`{text[:SHOWN]}`" if text else "a blank field"
            raise self.error(keyword, f"has {shown} in place of a whole number")
        return int(text)


class NastranElement(NamedTuple):
    """Positions of the fields of an element. The first node is field 2."""

    nodes: int
    angle: int  # THETA or MCID
    offset: int | None
    thicknesses: tuple[int, ...] = ()  # T1 to T4


_QUAD4 = NastranElement(4, 6, 7, (10, 11, 12, 13))
_TRIA3 = NastranElement(3, 5, 6, (10, 11, 12))
_QUAD9 = NastranElement(9, 11, None)
ELEMENTS = {
    "CQUAD4": _QUAD4,
    "CQUADR": _QUAD4,
    "CTRIA3": _TRIA3,
    "CTRIAR": _TRIA3,
    "CQUAD8": NastranElement(8, 14, 15, (10, 11, 12, 13)),
    "CTRIA6": NastranElement(6, 8, 9, (10, 11, 12)),
    "CQUAD": _QUAD9,
    "CQUAD9": _QUAD9,  # of meshio
}

NOT_OF_PLATE = f"is not part of a plate: leave it out; the elements are {', '.join(ELEMENTS)}"


class System(NamedTuple):
    """Coordinate system in basic coordinates."""

    kind: str  # R, C or S
    origin: Floats
    axes: Floats  # its x, y and z in rows

    def basic(self, place: Floats) -> Floats:
        """Return the basic coordinates of a place; angles are in degrees."""
        a, b, c = place.tolist()
        turn, rise = np.radians(b), np.radians(c)
        if self.kind == "C":
            place = np.array([a * np.cos(turn), a * np.sin(turn), c])
        elif self.kind == "S":
            flat = a * np.sin(turn)
            place = np.array([flat * np.cos(rise), flat * np.sin(rise), a * np.cos(turn)])
        return np.asarray(self.origin + place @ self.axes)


BASIC = System("R", np.zeros(3), np.eye(3))


class Bulk(NamedTuple):
    """Points (n, 3) in the basic system; cells (m, k) and groups refer to their rows, from 0."""

    points: Floats
    cells: NDArray[np.int_]
    groups: dict[str, list[int]]


def read_nastran(path: Path) -> Bulk:
    """Read points, cells and groups of a file.

    Raises NastranError with the place and the remedy.
    """
    reader = _Reader()
    for keyword, card in _cards(path):
        reader.add(keyword, card)
    return reader.mesh(path)


class _Reader:
    """Collector of the cards that are used."""

    def __init__(self) -> None:
        self._grids: dict[int, NastranCard] = {}
        self._systems: dict[int, tuple[str, NastranCard, int]] = {}  # with the first of its fields
        self._elements: list[tuple[str, NastranCard]] = []
        self._lines: list[tuple[str, NastranCard]] = []
        self._properties: set[int] = set()  # of lines
        self._default_system = 0
        self._places: dict[int, Floats] = {}
        self._found: dict[int, System] = {0: BASIC}
        self._open: list[int] = []  # systems that are being resolved

    def add(self, keyword: str, card: NastranCard) -> None:
        """Add a card."""
        if keyword.startswith("=") or "=" in card.fields:
            raise card.error(keyword, "repeats the card before it by `=`; write the card in full")
        if keyword == "GRID":
            number = card.whole(keyword, 0)
            if number in self._grids:
                raise card.error(keyword, f"is given twice, first at {self._grids[number].place}")
            self._grids[number] = card
        elif keyword == "GRDSET":
            self._default_system = card.whole(keyword, 1, 0)
        elif match := _SYSTEM.fullmatch(keyword):
            for first in (0, 4) if match[1] == "1" else (0,):
                if card.text(first):
                    self._systems[card.whole(keyword, first)] = (keyword, card, first)
        elif keyword in ELEMENTS:
            self._elements.append((keyword, card))
        elif keyword in _LINES:
            self._lines.append((keyword, card))
        elif _OF_LINES.fullmatch(keyword):
            self._properties.add(card.whole(keyword, 0))
        elif _RIGID.match(keyword) or (keyword.startswith("C") and not _OTHERS.match(keyword)):
            raise card.error(keyword, NOT_OF_PLATE)

    def mesh(self, path: Path) -> Bulk:
        """Return points, cells and groups."""
        if not self._elements:
            names = ", ".join(ELEMENTS)
            raise NastranError(f"{path} has no elements of a plate, which are {names}")
        rows = {number: row for row, number in enumerate(self._grids)}
        cells = []
        first, _ = self._elements[0]
        for keyword, card in self._elements:
            if ELEMENTS[keyword].nodes != ELEMENTS[first].nodes:
                raise card.error(
                    keyword,
                    f"is beside {first}; all elements must have the same number of nodes: "
                    f"{ALIKE_ELEMENTS}",
                )
            cells.append([rows[node] for node in self._nodes(keyword, card)])
        groups: dict[str, list[int]] = {}
        for keyword, card in self._lines:
            number = card.whole(keyword, 1, 0)
            if number in self._properties:
                raise card.error(keyword, NOT_OF_PLATE)
            ends = [self._node(keyword, card, place) for place in (2, 3)]
            groups.setdefault(str(number), []).extend(rows[node] for node in ends)
        points = np.array([self._place(number) for number in self._grids])
        return Bulk(points, np.array(cells), groups)

    def _node(self, keyword: str, card: NastranCard, place: int) -> int:
        """Return the number of the node that a GRID card defines."""
        node = card.whole(keyword, place)
        if node not in self._grids:
            raise card.error(keyword, f"has the node {node}, which no GRID card gives")
        return node

    def _nodes(self, keyword: str, card: NastranCard) -> list[int]:
        """Return the nodes of an element, which must have no other data."""
        kind = ELEMENTS[keyword]
        nodes = [self._node(keyword, card, 2 + n) for n in range(kind.nodes)]
        if kind.offset is not None and card.real(keyword, kind.offset):
            raise card.error(
                keyword,
                f"has the offset ZOFFS {card.text(kind.offset)[:SHOWN]}; the nodes of a plate are "
                "in its midplane: leave it out",
            )
        if angle := card.text(kind.angle):
            self._check_angle(keyword, card, angle, kind.angle)
        if any(card.text(place) for place in kind.thicknesses):
            raise card.error(
                keyword, "has thicknesses of corners; give zones of other laminates instead"
            )
        return nodes

    def _check_angle(self, keyword: str, card: NastranCard, angle: str, place: int) -> None:
        """Refuse an angle of the material; MCID may be a system along x."""
        if angle.isdecimal():
            system = self._system(card.whole(keyword, place), keyword, card)
            if system.kind == "R" and abs(system.axes[0, 0] - 1.0) < PARALLEL:
                return
            what = f"MCID {angle}"
        elif not card.real(keyword, place):
            return
        else:
            what = f"THETA {angle[:SHOWN]}"
        raise card.error(
            keyword,
            f"has {what}, which turns its plies; angles of plies are counted from x: turn the "
            "layup of the plate or of a zone instead, and leave it out",
        )

    def _place(self, number: int) -> Floats:
        """Return the basic coordinates of a node."""
        if number not in self._places:
            card = self._grids[number]
            coordinates = np.array([card.real("GRID", n) for n in (2, 3, 4)])
            system = self._system(card.whole("GRID", 1, self._default_system), "GRID", card)
            self._places[number] = system.basic(coordinates)
        return self._places[number]

    def _system(self, number: int, keyword: str, user: NastranCard) -> System:
        """Return the system with a number, which a card uses."""
        if number in self._found:
            return self._found[number]
        if number not in self._systems:
            raise user.error(keyword, f"has the system {number}, which no CORD card gives")
        name, card, first = self._systems[number]
        if number in self._open:
            raise card.error(name, "depends on itself")
        if len(self._open) == MOST_SYSTEMS:
            raise card.error(name, f"is within more than {MOST_SYSTEMS} other systems")
        self._open.append(number)
        if name[4] == "2":
            within = self._system(card.whole(name, 1, 0), name, card)
            values = [card.real(name, n) for n in range(2, 11)]
            points = [within.basic(np.array(values[n : n + 3])) for n in (0, 3, 6)]
        else:
            nodes = [self._node(name, card, first + n) for n in (1, 2, 3)]
            points = [self._place(node) for node in nodes]
        self._open.pop()
        origin, on_z, in_xz = points
        z = on_z - origin
        y = np.cross(z, in_xz - origin)
        if not (np.any(z) and np.any(y)):
            raise card.error(name, "has three points in a line")
        z, y = z / np.linalg.norm(z), y / np.linalg.norm(y)
        self._found[number] = System(name[5], origin, np.array([np.cross(y, z), y, z]))
        return self._found[number]


def _cards(path: Path) -> Iterator[tuple[str, NastranCard]]:
    """Yield the cards of the bulk data."""
    keyword, card, expected = "", NastranCard("", []), ""
    for place, line in _lines(path, 0, []):
        fields, name, here, follows = _fields(line)
        if name[:1] in ("", "+", "*"):
            if not keyword:
                raise NastranError(f"{place}: a continuation without its card")
            if expected and here and expected != here:
                raise NastranError(
                    f"{place}: the continuation `{name[:SHOWN]}` does not follow its card; sort "
                    "the cards"
                )
            card.fields.extend(fields)
        else:
            if keyword:
                yield keyword, card
            keyword, card = name.rstrip("*").upper(), NastranCard(place, fields)
        most = 6 if "*" in name else 10
        if any(field.strip() for field in line.split(",")[most:]) and _is_used(keyword):
            raise card.error(
                keyword,
                f"has more than {most} fields in a line; continue it in a line that begins with a "
                "comma",
            )
        expected = follows
    if keyword:
        yield keyword, card


def _is_used(keyword: str) -> bool:
    return keyword == "GRID" or keyword in ELEMENTS or _SYSTEM.fullmatch(keyword) is not None


def _fields(line: str) -> tuple[list[str], str, str, str]:
    """Return the fields of a line, its first field, and the marks of its continuations."""
    if "," in line:
        name, *fields = (field.strip() for field in line.split(","))
        width = 4 if "*" in name else 8
        follows = fields[width] if len(fields) > width else ""
        fields = (fields[:width] + [""] * width)[:width]
    else:
        name, size = line[:8].strip(), 16 if "*" in line[:8] else 8
        fields = [line[n : n + size].strip() for n in range(8, 72, size)]
        follows = line[72:80].strip()
    return fields, name, name.lstrip("+*"), follows.lstrip("+*")


def _with_whole_includes(lines: list[str]) -> list[str]:
    """Return lines with the name of a file that continues in the next lines in one of them.

    Blank lines take the place of the lines that are moved.
    """
    whole: list[str] = []
    opened = -1  # row of an INCLUDE whose name is not closed
    for row, line in enumerate(lines):
        if opened >= 0:
            whole[opened] += line.partition("$")[0].strip()
            whole.append("")
            is_whole = whole[opened][-1:] in ("'", '"') or len(whole[opened]) > LONGEST_NAME
            opened = -1 if is_whole else opened
            continue
        whole.append(line)
        if _OPEN_INCLUDE.fullmatch(line):
            whole[row] = line.partition("$")[0].rstrip()
            opened = row
    return whole


def _lines(path: Path, depth: int, read: list[Path]) -> Iterator[tuple[str, str]]:
    """Yield places and texts of the lines of bulk data, including other files.

    `read` has the files that are read already. The first one is the main file.
    """
    text = read_input(path).decode("latin-1")
    read.append(path.resolve())
    lines = re.split("\r\n|\r|\n", text)
    lines = _with_whole_includes(lines)
    starts = [number for number, line in enumerate(lines) if _BULK.match(line)]
    begin = starts[0] + 1 if starts else 0
    for number, line in enumerate(lines[begin:], start=begin + 1):
        place = f"{path}:{number}"
        line = line.partition("$")[0].expandtabs(8).rstrip()
        if line.strip().upper() == "ENDDATA":
            return
        if not line or line.startswith(("//", "#")):
            continue
        name = _included(line)
        if not name:
            yield place, line
            continue
        if depth == DEPTH:
            raise NastranError(f"{place}: INCLUDE is nested deeper than {DEPTH} files")
        included = path.parent / name
        if fault := _fault(included, read):
            raise NastranError(f"{place}: INCLUDE: {included} {fault}")
        try:
            yield from _lines(included, depth + 1, read)
        except OSError as error:
            why = error.strerror or str(error)
            raise NastranError(
                f"{place}: INCLUDE: {included} can't be read ({why}); put it beside this file"
            ) from None


def _included(line: str) -> str:
    """Return the name of the file that a line includes; empty if it includes none."""
    word, name = line.lstrip()[: len(INCLUDE)], line.lstrip()[len(INCLUDE) :].strip()
    if word.upper() != INCLUDE:
        return ""
    is_quoted = len(name) > 2 and name[0] == name[-1] and name[0] in "'\""
    return name[1:-1] if is_quoted else name


def _fault(included: Path, read: Sequence[Path]) -> str:
    """Explain why a file is not included; empty if it is.

    A file of another folder may not be meant for reading, and repeated files multiply.
    """
    if not str(included).isprintable():
        return "is not the name of a file"
    file, folder = included.resolve(), read[0].parent
    if not file.is_relative_to(folder):
        return f"is outside {folder}; put it beside the main file, or into a folder there"
    if file in read:
        return "is included before; delete this line"
    return ""
