"""Places that gages can't tell apart: images under a symmetry of the plate that gages share."""

from __future__ import annotations

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Floats, Indices
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.symmetry import images

SAME = 1e-9  # relative difference of equal stiffnesses and rows


@frozen
class Symmetry:
    """A symmetry of a plate."""

    name: str  # in messages
    flip: tuple[float, float]  # factors of x and y from the centre

    @property
    def is_mirror(self) -> bool:
        """Whether it reverses angles, and is not the half turn."""
        return self.flip[0] != self.flip[1]

    @property
    def signs(self) -> Floats:
        """Signs of u, v, w, theta_x, theta_y of the image, (5,)."""
        x, y = self.flip
        return np.array([x, y, 1.0, x, y])


SYMMETRIES = (
    Symmetry("mirror across the middle of x", (-1.0, 1.0)),
    Symmetry("mirror across the middle of y", (1.0, -1.0)),
    Symmetry("half turn about the centre", (-1.0, -1.0)),
)


def shared_symmetry(plate: PlateModel, rows: Floats) -> Symmetry | None:
    """A symmetry of plate, supports and laminates that leaves every gage's reading; None without.

    `rows` are the strains of the gages per displacement, (gages, nodes, 5).
    """
    for one in SYMMETRIES:
        nodes = images(plate.mesh.coordinates, one.flip)
        if nodes is None or not _maps(plate, one, nodes):
            continue
        turned = one.signs * rows[:, nodes]
        if np.abs(turned - rows).max() <= SAME * np.abs(rows).max():
            return one
    return None


def _maps(plate: PlateModel, one: Symmetry, nodes: Indices) -> bool:
    """Whether a symmetry of the nodes maps elements, supports, laminates and loads too."""
    mesh = plate.mesh
    if ((mesh.codes != 0) != (mesh.codes[nodes] != 0)).any():
        return False
    if one.is_mirror and not _unturned(plate):
        return False
    numbers = np.zeros(len(mesh.elements), int)
    if plate.laminate_numbers is not None:
        numbers = plate.laminate_numbers
    return np.array_equal(_elements(mesh, numbers, None), _elements(mesh, numbers, nodes))


def _elements(mesh: Mesh, numbers: Indices, nodes: Indices | None) -> Floats:
    """Sorted nodes and laminate of every element, in one order; with images for its nodes."""
    own = mesh.elements.astype(np.intp)
    if nodes is not None:
        own = np.where(own > 0, nodes[own - 1] + 1, 0)
    every = np.column_stack([np.sort(own, axis=1), numbers])
    return np.asarray(every[np.lexsort(every.T[::-1])])


def _unturned(plate: PlateModel) -> bool:
    """Whether laminates, preload and curvature are those of reversed angles."""
    for laminate in plate.laminates:
        for matrix in (laminate.A, laminate.B, laminate.D):
            scale = SAME * np.abs(laminate.A if matrix is laminate.B else matrix).max()
            if matrix is laminate.B:
                scale *= laminate.thickness
            if np.abs(matrix[:2, 2]).max() > scale:
                return False
        if abs(laminate.shear[0, 1]) > SAME * np.abs(laminate.shear).max():
            return False
    return plate.preload[2] == 0.0 and plate.curvature[2] == 0.0
