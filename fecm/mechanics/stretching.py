"""Energies, slopes, strains and membrane forces of the midplane of a nonlinear plate.

The strain energy without the part of the preload is

    1/2 int n A^-1 n dA + 1/2 int (kappa (D - B A^-1 B) kappa + gamma S gamma) dA,
    n = A eps + B kappa,  eps = eps_l + eps_q,

where eps_l contains the strains w/R of a curved plate.  The first integral is the energy of the
membrane; it is 1/2 int eps A eps dA if B is zero.  The membrane force is N0 + n.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics import strains as assumed_shear
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.interpolation import interpolate, jacobian_determinants
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.membrane import QuadraticStrains
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.ply_stresses import strains_of
from fecm.mechanics.points import containing_elements
from fecm.mechanics.strains import StrainField, strain_of_deflection

# Elements per block.
BLOCK = 1024


class MidplaneField(NamedTuple):
    """Midplane of a plate in displacement fields, (fields,) each.

    The largest values are taken over the points of quadrature.
    """

    energy: Floats  # energy of the membrane, force*length
    strain_energy: Floats  # strain energy of the plate, force*length
    preload_energy: Floats  # 1/2 int N0_ij w,i w,j dA, force*length
    largest_slope: Floats  # |grad w|
    # Absolute principal strain of both faces away from the load, including the preload's strain.
    largest_strain: Floats
    largest_force: Floats  # principal membrane force, tension positive, force/length
    # Absolute principal membrane force (force/length) and moment (force) at the load.
    force_at_load: Floats
    moment_at_load: Floats


class LargestOfMidplane(NamedTuple):
    """Largest slope, strain of a face and membrane force; see :class:`MidplaneField`."""

    slope: float
    strain: float
    force: float


class _Midplane(NamedTuple):
    """Strains, curvatures and slopes of a block, (ne, points, components)."""

    strains: Floats
    curvatures: Floats
    slopes: Floats


class _Elements:
    """Elements of a block at the points of a rule."""

    def __init__(self, plate: PlateModel, block: ElementBlock, rule: Quadrature) -> None:
        self.block, self.rule = block, rule
        self.laminate = plate.laminate_of(block)
        self.compliance = np.linalg.inv(self.laminate.A)
        shapes = interpolate(block, rule)
        self.area = shapes.jxw  # (ne, points): area that each point represents
        self.x, self.y = np.einsum("pn,eni->iep", shapes.N, block.coordinates)
        self._nodes, self._slopes = block.nodes, shapes.dN
        self._tied = QuadraticStrains(block, rule)
        self._values = shapes.N
        self._curved = strain_of_deflection(plate.curvature)

    def midplane(self, field: Floats) -> _Midplane:
        """Evaluate the midplane in a displacement field, (numnp, 5)."""
        q = field[self._nodes]
        q[..., 3:] *= -1.0  # curvatures are the strains of the negative rotations
        slopes = self._slopes @ q[:, None]
        strains = strains_of(slopes[..., [0, 1, 3, 4]])
        stretch = self._tied.of(q[..., 2].T).transpose(2, 1, 0)
        stretch += (self._values @ q[..., 2:3]) * self._curved
        return _Midplane(strains[..., :3] + stretch, strains[..., 3:], slopes[..., 2])

    def forces(self, midplane: _Midplane) -> Floats:
        """Return the membrane forces n, (ne, points, 3)."""
        return np.asarray(
            midplane.strains @ self.laminate.A + midplane.curvatures @ self.laminate.B
        )

    def moments(self, midplane: _Midplane) -> Floats:
        """Return the moments, (ne, points, 3)."""
        return np.asarray(
            midplane.strains @ self.laminate.B + midplane.curvatures @ self.laminate.D
        )


def nowhere(x: Floats, y: Floats) -> Bools:
    """Return a mask in which no point is near the load."""
    return np.zeros(np.broadcast_shapes(x.shape, y.shape), dtype=bool)


class Stretching:
    """Evaluator of the midplane of a nonlinear plate.

    `near` returns a mask of the points, x and y, that are too near to the load for their strains to
    count.  `load` is the place of the load.
    """

    def __init__(
        self,
        plate: PlateModel,
        near: Callable[[Floats, Floats], Bools] = nowhere,
        load: tuple[float, float] | None = None,
    ) -> None:
        self.has_load = load is not None
        self._plate, self._near = plate, near
        self._preload = np.array(plate.preload)
        self._at_load = [] if load is None else _elements_at(plate, load)

    @cached_property
    def _parts(self) -> list[tuple[_Elements, Bools]]:
        """Elements in blocks, and which of their points are near the load."""
        plate = self._plate
        blocks = (block for family in plate.families for block in family.blocks(BLOCK))
        parts = [_Elements(plate, block, plate.rules.bending) for block in blocks]
        return [(part, self._near(part.x, part.y)) for part in parts]

    @cached_property
    def _sheared(self) -> list[tuple[StrainField, Indices, Floats, Floats]]:
        """Points of the transverse shear by family: rows of the elements, areas and stiffness."""
        plate, sheared = self._plate, []
        for family in plate.families:
            rule = assumed_shear.quadrature(family)
            area = jacobian_determinants(family, rule) * rule.weights
            shear = plate.laminate_of(family).shear
            sheared.append((plate.strain_field(rule), family.rows, area, shear))
        return sheared

    def evaluate(self, fields: Floats) -> MidplaneField:
        """Evaluate displacement fields, (fields, numnp, 5)."""
        return MidplaneField(*np.array([self._values(field) for field in fields]).T)

    def _values(self, field: Floats) -> tuple[float, ...]:
        """Return the values of :class:`MidplaneField` of a displacement field."""
        energies, largest = np.zeros(3), np.full(3, -np.inf)
        for part, near in self._parts:
            midplane = part.midplane(field)
            energies += self._energies(part, midplane)
            largest = np.maximum(largest, self._largest(part, midplane, near))
        membrane, bending, preload = energies.tolist()
        strain_energy = membrane + bending + preload + self._shear_energy(field)
        return membrane, strain_energy, preload, *largest.tolist(), *self._under_load(field)

    def slopes(self, field: Floats) -> Floats:
        """Return the slopes of w at the points of a displacement field, (points, 2)."""
        return np.concatenate(
            [part.midplane(field).slopes.reshape(-1, 2) for part, _ in self._parts]
        )

    def largest(self, field: Floats) -> LargestOfMidplane:
        """Return the largest values in a displacement field, (numnp, 5)."""
        largest = [self._largest(part, part.midplane(field), near) for part, near in self._parts]
        return LargestOfMidplane(*np.max(largest, axis=0).tolist())

    def largest_linear(self, field: Floats) -> float:
        """Return the largest strain of a face away from the load, without quadratic strains.

        The strain of the preload is left out too.
        """
        largest = 0.0
        for part, near in self._parts:
            there, back = part.midplane(field), part.midplane(-field)
            strains = (there.strains - back.strains) / 2.0
            largest = max(largest, _largest_face(part, strains, there.curvatures, near))
        return largest

    @property
    def preload_strain(self) -> float:
        """Largest principal strain of the preload."""
        return max(
            float(largest_principal(np.linalg.inv(laminate.A) @ self._preload * [1.0, 1.0, 0.5]))
            for laminate in map(self._plate.laminate_of, self._plate.families)
        )

    def _energies(self, part: _Elements, midplane: _Midplane) -> Floats:
        """Return the energies of the membrane, of bending and of the preload."""
        n, kappa = part.forces(midplane), midplane.curvatures
        x, y = np.moveaxis(midplane.slopes, -1, 0)
        squares = np.stack([x * x, y * y, 2.0 * x * y], axis=-1)
        densities = [
            (n * (n @ part.compliance)).sum(axis=-1),
            (kappa * (kappa @ bending_stiffness(part.laminate))).sum(axis=-1),
            squares @ self._preload,
        ]
        return np.array([0.5 * (part.area * density).sum() for density in densities])

    def _shear_energy(self, field: Floats) -> float:
        """Return the energy of the transverse shear."""
        energy = 0.0
        for strains, rows, area, shear in self._sheared:
            gamma = strains.evaluate(field)[[4, 3]][:, rows]
            density = np.einsum("iep,ij,jep->ep", gamma, shear, gamma)
            energy += 0.5 * float((area * density).sum())
        return energy

    def _largest(self, part: _Elements, midplane: _Midplane, near: Bools) -> Floats:
        """Return the largest slope, strain of a face away from the load, and membrane force."""
        slope = np.hypot(midplane.slopes[..., 0], midplane.slopes[..., 1])
        middle = midplane.strains + part.compliance @ self._preload
        strain = _largest_face(part, middle, midplane.curvatures, near)
        mean, radius = principal_values(self._preload + part.forces(midplane))
        return np.array([slope.max(), strain, (mean + radius).max()])

    def _under_load(self, field: Floats) -> tuple[float, float]:
        """Return membrane force and moment at the load, averaged over the adjacent elements.

        Both are 0 without a load.
        """
        states = [(part, part.midplane(field)) for part in self._at_load]
        if not states:
            return 0.0, 0.0
        force = np.mean([part.forces(midplane)[0, 0] for part, midplane in states], axis=0)
        moment = np.mean([part.moments(midplane)[0, 0] for part, midplane in states], axis=0)
        return float(largest_principal(self._preload + force)), float(largest_principal(moment))


def bending_stiffness(laminate: LaminateSection) -> Floats:
    """Return D - B A^-1 B, (3, 3)."""
    A, B, D = laminate.A, laminate.B, laminate.D
    return np.asarray(D - B @ np.linalg.solve(A, B))


def _largest_face(part: _Elements, strains: Floats, curvatures: Floats, near: Bools) -> float:
    """Return the largest absolute principal strain of both faces at points that are not near."""
    bent = 0.5 * part.laminate.thickness * curvatures
    # gamma_xy is twice the tensor component.
    faces = [largest_principal(face * [1.0, 1.0, 0.5]) for face in (strains - bent, strains + bent)]
    return float(np.where(near, 0.0, np.maximum(*faces)).max())


def principal_values(tensor: Floats) -> tuple[Floats, Floats]:
    """Return mean and half difference of the principal values of xx, yy, xy (..., 3)."""
    xx, yy, xy = np.moveaxis(tensor, -1, 0)
    return 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)


def largest_principal(tensor: Floats) -> Floats:
    """Return the largest absolute principal value of xx, yy, xy (..., 3)."""
    mean, radius = principal_values(tensor)
    return np.asarray(np.abs(mean) + radius)


def _elements_at(plate: PlateModel, place: tuple[float, float]) -> list[_Elements]:
    """Return the elements that contain a place, each evaluated at this place only."""
    return [
        _Elements(plate, family.take(np.array([member])), Quadrature(xi[:1], xi[1:], np.ones(1)))
        for family in plate.families
        for member, _, xi in zip(*containing_elements(family, np.array([place])), strict=True)
    ]
