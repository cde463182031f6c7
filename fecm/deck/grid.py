"""Grids of 9-node elements on a rectangle: their lines of nodes, and the cards that define them."""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm.deck.mesh_cards import (
    Boundary,
    Coordinates,
    ElementNodes,
    Elements,
    NodeCodes,
    NodeValues,
)
from fecm.deck.support_cards import LINE, Springs

# Digits of coordinates, relative to the size of the plate: they must fit their columns.
DIGITS = 6
LEAST_BESIDE = 2  # smallest number of elements between a window and an edge


class EdgeCodes(NamedTuple):
    """Restraint codes of an edge's nodes, by the direction of the edge."""

    along_x: tuple[int, ...]
    along_y: tuple[int, ...]

    def of(self, edge: str) -> tuple[int, ...]:
        """Return the codes of one of the :data:`EDGES`."""
        return self.along_y if edge in ("left", "right") else self.along_x


# Codes of w, theta_x and theta_y. A simple support holds theta_x along x, and theta_y along y; a
# soft one holds w alone.
W_HELD = (1, 0, 0)
W_FREE = (0, 0, 0)
SUPPORTS = {
    "free": EdgeCodes(along_x=W_FREE, along_y=W_FREE),
    "soft": EdgeCodes(along_x=W_HELD, along_y=W_HELD),
    "simple": EdgeCodes(along_x=(1, 1, 0), along_y=(1, 0, 1)),
    "pinned": EdgeCodes(along_x=(1, 1, 0), along_y=(1, 0, 1)),
    "clamped": EdgeCodes(along_x=(1, 1, 1), along_y=(1, 1, 1)),
}
# Codes of u and v.
IN_PLANE = {
    "held": EdgeCodes(along_x=(1, 1), along_y=(1, 1)),
    "normal": EdgeCodes(along_x=(0, 1), along_y=(1, 0)),
    "tangential": EdgeCodes(along_x=(1, 0), along_y=(0, 1)),
    "free": EdgeCodes(along_x=(0, 0), along_y=(0, 0)),
}
# Restraints besides the supports that users name: an edge whose springs alone hold w.
ON_SPRINGS = "on springs"
RESTRAINTS = {**SUPPORTS, ON_SPRINGS: EdgeCodes(along_x=W_FREE, along_y=W_FREE)}
EDGES = ("left", "right", "bottom", "top")


class EdgeStiffness(NamedTuple):
    """Stiffness of the springs along an edge, per length."""

    w: float  # force/length^2
    rotation: float  # of the rotation across the edge: moment per rotation and length

    def along_x(self) -> tuple[float, ...]:
        """Return the stiffness of the dofs on an edge along x."""
        return (0.0, 0.0, self.w, 0.0, self.rotation)

    def along_y(self) -> tuple[float, ...]:
        """Return the stiffness of the dofs on an edge along y."""
        return (0.0, 0.0, self.w, self.rotation, 0.0)


def held_in_plane(support: str, in_plane: str) -> str:
    """Return how a support restrains u and v, as a key of :data:`IN_PLANE`.

    ``"pinned"`` holds both. ``"clamped"`` also does, if the other supports hold the tangential
    displacement.
    """
    holds_both = support == "pinned" or (support == "clamped" and in_plane == "tangential")
    return "held" if holds_both else in_plane


class GridSection(NamedTuple):
    """Row of equally long elements in one direction."""

    # Coordinates of both ends (length).
    start: float
    end: float
    elements: int  # number of elements


def uniform_section(length: float, elements: int) -> list[GridSection]:
    """Return a single section of equal elements."""
    return [GridSection(0.0, length, elements)]


def listed_sections(text: str) -> list[GridSection]:
    """Parse a list of counts and sizes, ``3*0.5,8*0.375,3*0.5``, into sections.

    Raises ValueError if the text is not such a list.
    """
    sections: list[GridSection] = []
    start = 0.0
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,6})\s*[*x]\s*([0-9.eE+-]+)\s*", part)
        size = float(match[2]) if match else 0.0
        if match is None or int(match[1]) < 1 or not 0.0 < size < math.inf:
            raise ValueError(f"`{part.strip()}` is not COUNT*SIZE, as in 3*0.5,8*0.375,3*0.5")
        end = start + int(match[1]) * size
        sections.append(GridSection(start, round_to(end, end), int(match[1])))
        start = sections[-1].end
    return sections


def graded(length: float, elements: int, centre: float, ratio: float) -> list[GridSection]:
    """Return sections of one element each, geometrically smaller towards `centre`.

    Two elements meet at `centre`. `ratio` is the length of the largest element of a side over the
    length of the smallest.
    """
    if not 0.0 < centre < length or elements < 2:
        side = _series(length, elements, ratio)
        steps = side if centre <= 0.0 else side[::-1]
    else:

        def mismatch(n: int) -> float:
            """Compare the smallest elements of both sides if n elements are on the left."""
            right = _series(length - centre, elements - n, ratio)
            return abs(math.log(_series(centre, n, ratio)[0] / right[0]))

        on_left = min(range(1, elements), key=mismatch)
        steps = _series(centre, on_left, ratio)[::-1]
        steps += _series(length - centre, elements - on_left, ratio)
    inner = [round_to(total, length) for total in accumulate(steps[:-1])]
    return [GridSection(start, end, 1) for start, end in pairwise([0.0, *inner, length])]


def longest_at(sections: Sequence[GridSection], place: float) -> float:
    """Return the length of the longest element at a place; 0 outside the sections."""
    touching = (s for s in sections if s.start <= place <= s.end)
    return max(((s.end - s.start) / s.elements for s in touching), default=0.0)


def refined_sections(
    length: float, elements: int, centre: float, ratio: float, side: float
) -> list[GridSection]:
    """Return graded elements that are at most `side` long at `centre`.

    The result has `elements` elements, or more if it needs them. `ratio` is raised, if necessary,
    to the length of `elements` equal elements over `side`.
    """
    ratio = max(ratio, length / elements / side)
    # Compared with equal elements of the largest length, a geometric series of ratio R needs
    # R ln R/(R - 1) < 1 + ln R times as many.
    counts = range(elements, int(elements * (1.0 + math.log(ratio))) + 8)

    def fits(count: int) -> bool:
        return longest_at(graded(length, count, centre, ratio), centre) <= side

    return graded(length, elements + bisect_left(counts, True, key=fits), centre, ratio)


def framed(inner: Sequence[GridSection], length: float) -> list[GridSection]:
    """Extend the sections of a centred window to the edges of a plate of a given length."""
    start = (length - inner[-1].end) / 2.0
    ends = [round_to(start + section.end, length) for section in inner]
    starts = [round_to(start, length), *ends]
    sizes = [(section.end - section.start) / section.elements for section in inner]
    before, after = (max(LEAST_BESIDE, math.ceil(start / size)) for size in (sizes[0], sizes[-1]))
    middle = map(GridSection, starts, ends, (section.elements for section in inner))
    return [GridSection(0.0, starts[0], before), *middle, GridSection(ends[-1], length, after)]


def _series(length: float, count: int, ratio: float) -> list[float]:
    """Return sizes that add up to `length`; the last is `ratio` times the first."""
    growth = ratio ** (1.0 / (count - 1)) if count > 1 else 1.0
    sizes = [growth**n for n in range(count)]
    return [length * size / sum(sizes) for size in sizes]


def round_to(value: float, scale: float) -> float:
    """Round a coordinate to :data:`DIGITS` digits of the plate's size, `scale`."""
    return round(value, DIGITS - math.floor(math.log10(scale)))


def grid_lines(sections: Sequence[GridSection]) -> list[float]:
    """Return the coordinates of the lines of nodes: two for each element, and the last one."""
    lines: list[float] = []
    for section in sections:
        count = 2 * section.elements
        step = (section.end - section.start) / count
        lines += [section.start + i * step for i in range(count)]
    return [*lines, sections[-1].end]


@dataclass(frozen=True)
class ElementGrid:
    """Grid of 9-node elements; node numbers run along x first."""

    # Sections along x and along y.
    columns: list[GridSection]
    rows: list[GridSection]
    most_nodes: ClassVar[int] = 9  # nodes per element

    @property
    def across(self) -> int:
        """Number of nodes along x."""
        return 2 * sum(section.elements for section in self.columns) + 1

    @property
    def up(self) -> int:
        """Number of nodes along y."""
        return 2 * sum(section.elements for section in self.rows) + 1

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return self.across * self.up

    @property
    def elements(self) -> int:
        """Number of elements."""
        return (self.across // 2) * (self.up // 2)

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Lowest and highest coordinates."""
        return (0.0, 0.0), (self.columns[-1].end, self.rows[-1].end)

    def nearest(self, x: float, y: float) -> tuple[int, float, float]:
        """Return the number, x and y of the node nearest to a point."""
        xs, ys = grid_lines(self.columns), grid_lines(self.rows)
        i = min(range(len(xs)), key=lambda k: abs(xs[k] - x))
        j = min(range(len(ys)), key=lambda k: abs(ys[k] - y))
        return 1 + i + j * self.across, xs[i], ys[j]

    def coordinates(self) -> Coordinates:
        """Return COOR cards: one for the start of each section in each line of nodes."""
        records: list[NodeValues] = []
        for line, y in enumerate(grid_lines(self.rows)):
            node = 1 + line * self.across
            y = round_to(y, self.rows[-1].end)
            for section in self.columns:
                records.append(NodeValues(node, 1, (section.start, y)))
                node += 2 * section.elements
            records.append(NodeValues(node, 0, (self.columns[-1].end, y)))
        return Coordinates(tuple(records))

    def element_cards(self) -> Elements:
        """Return ELEM cards: one for the first element of each row."""
        a = self.across
        records: list[ElementNodes] = []
        for row in range(self.up // 2):
            n = 1 + 2 * row * a
            corners = (n, n + 2, n + 2 + 2 * a, n + 2 * a)
            sides = (n + 1, n + 2 + a, n + 1 + 2 * a, n + a)
            number = 1 + row * (a // 2)
            records.append(ElementNodes(number, (*corners, *sides, n + 1 + a), 2))
        return Elements(tuple(records))

    def supported(
        self,
        everywhere: Sequence[int],
        supports: Mapping[str, str],
        window: tuple[float, float] | None = None,
        *,
        in_plane: str = "held",
        holds_w: bool = True,
        points: Sequence[int] = (),
    ) -> Boundary | None:
        """Return BOUN cards for the supports of the edges.

        `in_plane`, a key of :data:`IN_PLANE`, tells how the supports restrain u and v. See
        :meth:`boundary` for the other parameters.
        """
        codes: dict[str, tuple[int, ...]] = {}
        for edge, support in supports.items():
            if support != "free":
                held = IN_PLANE[held_in_plane(support, in_plane)]
                codes[edge] = (*held.of(edge), *RESTRAINTS[support].of(edge))
        return self.boundary(
            everywhere, codes, window, in_plane=in_plane, holds_w=holds_w, points=points
        )

    def boundary(
        self,
        everywhere: Sequence[int],
        edges: Mapping[str, Sequence[int]],
        window: tuple[float, float] | None = None,
        *,
        in_plane: str = "held",
        holds_w: bool = True,
        points: Sequence[int] = (),
    ) -> Boundary | None:
        """Return BOUN cards; None if nothing is restrained.

        `everywhere` has the codes of all nodes, and `edges` further codes of the nodes on each of
        the :data:`EDGES`. `window` has the sides of a window in the middle of the plate: its edges
        hold u and v as `in_plane` tells, and w unless `holds_w` is false. w of the nodes `points`,
        from 1, is held too.
        """
        codes = np.tile(np.array(everywhere), (self.up, self.across, 1))
        parts = {"left": codes[:, 0], "right": codes[:, -1], "bottom": codes[0], "top": codes[-1]}
        for name, code in edges.items():
            np.maximum(parts[name], code, out=parts[name])
        if window is not None:
            first, last = _nearest_lines(self.columns, window[0])
            low, high = _nearest_lines(self.rows, window[1])
            across, up = slice(first, last + 1), slice(low, high + 1)
            bending = W_HELD if holds_w else W_FREE
            along_x, along_y = (np.array([*held, *bending]) for held in IN_PLANE[in_plane])
            for line in (low, high):
                codes[line, across] = np.maximum(codes[line, across], along_x)
            for line in (first, last):
                codes[up, line] = np.maximum(codes[up, line], along_y)
        of_nodes = codes.reshape(self.nodes, -1)
        of_nodes[np.array(points, dtype=int) - 1, 2] = 1
        return boundary_cards(of_nodes)

    def springs(
        self, edges: Mapping[str, EdgeStiffness], supports: Mapping[str, str]
    ) -> Springs | None:
        """Return SPRI LINE cards of the springs of edges; None without any stiffness."""
        last_row = self.nodes - self.across + 1
        ends = {
            "left": (1, last_row),
            "right": (self.across, self.nodes),
            "bottom": (1, self.across),
            "top": (last_row, self.nodes),
        }
        records = [
            NodeValues(*ends[edge], k.along_y() if edge in ("left", "right") else k.along_x())
            for edge, k in edges.items()
            if any(k)
        ]
        return Springs(tuple(records), word=LINE) if records else None

    def window_lines(self, window: tuple[float, float]) -> list[tuple[int, int]]:
        """Return the nodes, from 1, at the ends of each side of a window in the middle."""
        first, last = _nearest_lines(self.columns, window[0])
        low, high = _nearest_lines(self.rows, window[1])
        corners = [
            1 + i + j * self.across
            for i, j in ((first, low), (last, low), (last, high), (first, high))
        ]
        return list(pairwise([*corners, corners[0]]))


def _nearest_lines(sections: Sequence[GridSection], side: float) -> tuple[int, int]:
    """Return the two lines of nodes nearest to the edges of a centred window of a given side."""
    places = np.array(grid_lines(sections))
    ends = ((sections[-1].end + distance) / 2.0 for distance in (-side, side))
    first, last = (int(np.abs(places - end).argmin()) for end in ends)
    return first, last


def boundary_cards(codes: NDArray[np.int_]) -> Boundary | None:
    """Return BOUN cards for restraint codes (numnp, ndf); a run of equal codes takes two cards."""
    starts = [0, *(np.flatnonzero((np.diff(codes, axis=0) != 0).any(axis=1)) + 1).tolist()]
    records: list[NodeCodes] = []
    for start, end in pairwise([*starts, len(codes)]):
        code = tuple(codes[start].tolist())
        if not any(code):
            continue
        if end - start > 1:  # a negative code extends to the next card
            records.append(NodeCodes(start + 1, 1, tuple(-c for c in code)))
        records.append(NodeCodes(end, 0, code))
    return Boundary(tuple(records)) if records else None
