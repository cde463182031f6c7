"""Symmetric part of a plate: which edges are lines of symmetry, and what the whole plate has.

A quarter of a plate, struck at its corner, carries a quarter of the force, the energy and the
masses, and has a quarter of the contact coefficient k. Displacements, strains, stresses and times
are the same. The deck describes the part; forces and energies that are judged or summarised are of
the whole plate.

On a line of symmetry w is free, the slope across the line is zero, and the tangential rotation is
free. In the plane the line does not move across itself. A linear, flat plate of antisymmetric
angle-ply laminates has the other symmetry: the line does not move along itself (J. N. Reddy,
Mechanics of Laminated Composite Plates and Shells, chapter 7).
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats
from fecm.deck import model
from fecm.deck.model import Deck
from fecm.mechanics.interpolation import W
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.mesh import MeshArrays, extent
from fecm.mechanics.symmetry import Mirror
from fecm.problem.generate import generate
from fecm.problem.parts import THETA_X, moves_in_plane

AXES = "xy"
# Distance of an edge's nodes from its line, over the size of the mesh: cards round coordinates.
SAME_LINE = 1e-6
# Largest entry of a stiffness that symmetry forbids, over the largest entry.
NEGLIGIBLE = 1e-6


class InPlaneHold(StrEnum):
    """Displacement in the plane that is held along a line of symmetry."""

    ACROSS = "across"
    ALONG = "along"  # the line of an antisymmetric angle-ply plate
    REST = "rest"  # both, or the plate does not move in its plane


class SymmetryLine(NamedTuple):
    """Straight edge whose restraints are those of a line of symmetry."""

    axis: int  # 0 for a line x = place, 1 for y = place
    place: float
    is_high: bool  # whether the plate lies below the place
    hold: InPlaneHold

    @property
    def mirror(self) -> Mirror:
        """The line for stresses that are averaged with those of the mirrored element."""
        across = self.axis if self.hold is not InPlaneHold.ALONG else 1 - self.axis
        return Mirror(self.axis, self.place, (across, THETA_X + self.axis))

    def __str__(self) -> str:
        return f"{AXES[self.axis]} = {self.place:.6g}"


class PartSymmetry(NamedTuple):
    """Lines of symmetry of a plate of which a deck has one part."""

    struck: tuple[SymmetryLine, ...] = ()  # lines through the impact node
    mirrors: tuple[SymmetryLine, ...] = ()  # other lines, which mirror the load

    @property
    def factor(self) -> int:
        """Number of equal parts that share the force of one projectile: 1, 2 or 4."""
        return 1 << len(self.struck)

    @property
    def lines(self) -> tuple[SymmetryLine, ...]:
        """All lines of symmetry."""
        return (*self.struck, *self.mirrors)

    @property
    def cut(self) -> Bools:
        """Sides of the mesh at lines of symmetry, (2, 2): low and high, in x and y."""
        sides = np.zeros((2, 2), dtype=bool)
        for line in self.lines:
            sides[int(line.is_high), line.axis] = True
        return sides

    def unfolded(self, coordinates: Floats) -> Floats:
        """Return places of the part, (n, 2), and their images in the whole plate."""
        for line in self.struck:
            images = coordinates.copy()
            images[:, line.axis] = 2.0 * line.place - images[:, line.axis]
            coordinates = np.concatenate([coordinates, images])
        return coordinates

    def nodes(self, mesh: MeshArrays) -> tuple[Bools, ...]:
        """Return a mask of the used nodes on every line, (numnp,)."""
        return tuple(nodes_on(mesh, line.axis, line.place) for line in self.lines)

    def held(self, mesh: MeshArrays) -> Bools:
        """Return a mask of the dofs that symmetry holds, (numnp, 5)."""
        mask = np.zeros(mesh.codes.shape, dtype=bool)
        for line, nodes in zip(self.lines, self.nodes(mesh), strict=True):
            mask[nodes, line.mirror.odd[0]] = mask[nodes, line.mirror.odd[1]] = True
        return mask

    def images(self, mesh: MeshArrays) -> Floats:
        """Return the number of nodes of the whole plate that each node of the part stands for."""
        counts = np.ones(len(mesh.coordinates))
        for line in self.struck:
            counts[~nodes_on(mesh, line.axis, line.place)] *= 2.0
        return counts

    @property
    def places(self) -> str:
        """Name the lines through the impact node."""
        return " and ".join(map(str, self.struck))


def symmetry_of(deck: Deck, mesh: MeshArrays) -> PartSymmetry:
    """Return the lines of symmetry of the plate of a deck with an impact."""
    lines = tuple(symmetry_lines(deck, mesh))
    struck = tuple(line for line in lines if _is_struck(line, deck, mesh))
    return PartSymmetry(struck, tuple(line for line in lines if line not in struck))


def symmetry_factor(deck: Deck) -> int:
    """Return the number of equal parts of the plate of a deck: see :class:`PartSymmetry`."""
    return symmetry_of(deck, generate(deck)).factor


def _is_struck(line: SymmetryLine, deck: Deck, mesh: MeshArrays) -> bool:
    """Return whether the impact node is on a line; a patch is inside the part, on no line."""
    impact = deck.last(model.Impact)
    if impact is None or impact.dof != W + 1 or deck.has(model.Patch):
        return False
    if not 1 <= impact.node <= len(mesh.coordinates):
        return False
    return bool(nodes_on(mesh, line.axis, line.place)[impact.node - 1])


def symmetry_lines(deck: Deck, mesh: MeshArrays) -> Iterator[SymmetryLine]:
    """Yield the straight edges with the restraints of a line of symmetry."""
    if not mesh.used.any() or np.isnan(mesh.coordinates[mesh.used]).any():
        return
    low, high = extent(mesh.coordinates[mesh.used])
    for axis in range(2):
        for is_high, corner in enumerate((low, high)):
            place = float(corner[axis])
            if (hold := _hold_of_line(deck, mesh, axis, place)) is not None:
                yield SymmetryLine(axis, place, bool(is_high), hold)


def nodes_on(mesh: MeshArrays, axis: int, place: float) -> Bools:
    """Return a mask of the used nodes on the line at a place of an axis, (numnp,)."""
    low, high = extent(mesh.coordinates[mesh.used])
    near = SAME_LINE * float((high - low).max())
    return np.asarray(mesh.used & (np.abs(mesh.coordinates[:, axis] - place) <= near))


def _hold_of_line(deck: Deck, mesh: MeshArrays, axis: int, place: float) -> InPlaneHold | None:
    """Return what holds an edge in the plane; None if it is no line of symmetry."""
    held = mesh.codes != 0
    other = 1 - axis
    moving = nodes_on(mesh, axis, place) & ~held[:, W]
    if np.count_nonzero(moving) < 2 or not held[moving, THETA_X + axis].all():
        return None
    # The ends may lie on another line of symmetry, which holds the tangential rotation.
    low, high = extent(mesh.coordinates[mesh.used])
    ends = nodes_on(mesh, other, float(low[other])) | nodes_on(mesh, other, float(high[other]))
    inner = moving & ~ends
    if held[inner, THETA_X + other].any():
        return None
    across, along = (bool(held[inner, dof].all()) for dof in (axis, other))
    if (across and along) or not moves_in_plane(deck):
        return InPlaneHold.REST
    if across:
        return InPlaneHold.ACROSS
    return InPlaneHold.ALONG if along else None


def broken_entries(laminate: LaminateSection, hold: InPlaneHold, *, in_plane: bool) -> list[str]:
    """Return the stiffnesses of a laminate that break the symmetry about a line.

    `hold` is what the line holds in the plane, `in_plane` whether the midplane moves. A mirror
    changes the sign of the entries 16 and 26 of A, B and D, and of A45. With the in-plane
    displacements of the opposite sign, which leave the energy of A as it is, it changes the other
    entries of B.
    """
    twisting = np.zeros((3, 3), dtype=bool)
    twisting[:2, 2] = twisting[2, :2] = True
    size_a, size_d = (float(np.abs(matrix).max()) for matrix in (laminate.A, laminate.D))
    of_b = ~twisting if hold is InPlaneHold.ALONG else twisting
    checked = [("D16 or D26", laminate.D, twisting, size_d)]
    if in_plane:
        checked.append(("A16 or A26", laminate.A, twisting, size_a))
        names = "B11, B12, B22 or B66" if hold is InPlaneHold.ALONG else "B16 or B26"
        checked.append((names, laminate.B, of_b, float(np.sqrt(size_a * size_d))))
    off = np.array([[False, True], [True, False]])
    checked.append(("A45", laminate.shear, off, float(np.abs(laminate.shear).max())))
    return [
        name
        for name, matrix, entries, size in checked
        if np.abs(matrix[entries]).max() > NEGLIGIBLE * size
    ]
