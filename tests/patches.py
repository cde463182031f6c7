"""Patch tests and reference solutions of plates, shared by the tests of elements."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from fecm.mechanics.plate import PlateModel
from tests.builders import (
    Corners,
    Floats,
    Ints,
    boundary,
    general_plate,
    isotropic_plate,
    nothing,
    rules,
    simple_support,
    table,
    with_restraints,
)

Indices = NDArray[np.signedinteger]
MeshMaker = Callable[[int, int, int], tuple[Floats, Ints]]

# Corners are always there, each of the other five nodes may be absent.
PATTERNS = [np.array([True] * 4 + list(rest)) for rest in product((False, True), repeat=5)]


def stretched(coordinates: Floats, strain: Floats) -> Floats:
    """Field of a constant midplane strain xx, yy, xy with a rotation in the plane."""
    x, y = coordinates.T
    field = np.zeros((len(coordinates), 5))
    field[:, 0] = 0.2 + strain[0] * x + (0.5 * strain[2] - 0.3) * y
    field[:, 1] = -0.1 + (0.5 * strain[2] + 0.3) * x + strain[1] * y
    return field


def bent(coordinates: Floats, curvature: Floats) -> Floats:
    """Field of a constant curvature xx, yy, xy without transverse shear: theta is w's gradient."""
    x, y = coordinates.T
    kx, ky, kxy = curvature
    field = np.zeros((len(coordinates), 5))
    field[:, 2] = 0.4 - 0.2 * x + 0.1 * y - 0.5 * (kx * x**2 + ky * y**2 + kxy * x * y)
    field[:, 3] = -0.2 - kx * x - 0.5 * kxy * y
    field[:, 4] = 0.1 - ky * y - 0.5 * kxy * x
    return field


STRAIN = np.array([0.7, -0.4, 0.9])
CURVATURE = np.array([1.1, -0.6, 0.8])


def area_of(corners: Corners) -> float:
    """A polygon's area, by the shoelace formula."""
    x, y = np.array(corners).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def equilibrium(model: PlateModel) -> Floats:
    """Displacements of every node under the mesh's loads and prescribed displacements."""
    return model.field(spsolve(model.stiffness.tocsc(), model.nodal_loads))


def patch(
    mesh: tuple[Floats, Ints], field: Floats, shear: int = 3, *, transposed_jacobian: bool = False
) -> PlateModel:
    """Prescribe a field on a patch's boundary."""
    held = boundary(*mesh)
    values = np.where(held, field, 0.0)
    model = PlateModel(
        with_restraints(*mesh, held, values),
        general_plate(),
        rules(3, shear, transposed_jacobian=transposed_jacobian),
    )
    assert model.mesh.number_of_equations > 0
    return model


def residual(
    mesh: tuple[Floats, Ints], field: Floats, *, transposed_jacobian: bool = False
) -> float:
    """Largest force left on an inner node by a field, over the largest that its parts exert."""
    model = patch(mesh, field, transposed_jacobian=transposed_jacobian)
    inside = model.mesh.equations > 0
    left = model.stiffness @ field[inside] + model.support @ field[~inside]
    parts = abs(model.stiffness) @ abs(field[inside]) + abs(model.support) @ abs(field[~inside])
    return float(np.abs(left).max() / parts.max())


def free_stiffness(mesh: tuple[Floats, Ints], bending: int = 3, shear: int = 3) -> Floats:
    """Stiffness of an unrestrained plate of the general laminate, unknowns node by node."""
    coordinates, elements = mesh
    model = PlateModel(
        with_restraints(coordinates, elements, nothing(coordinates)),
        general_plate(),
        rules(bending, shear),
    )
    return np.asarray(model.stiffness.toarray())


def reference_frequencies(ks: str) -> Floats:
    """Flexural frequencies of the simply supported square plate, h/a = 0.1, with multiplicity."""
    actual: list[float] = []
    for row in table("freq_ssss_mindlin.csv"):
        if f"h/a=0.1 ks={ks}" in row["case"]:
            actual += [float(row["omega_flex_rad/s_or_nondim"])] * (1 + (row["m"] != row["n"]))
    return np.sort(actual)


def reference_deflections(ratio: float, ks: str) -> tuple[float, float]:
    """Deflections in the centre and at the quarter point under a uniform unit load."""
    (row,) = (
        row
        for row in table("static_ssss_mindlin.csv")
        if f"h/a={ratio:g} ks={ks} " in row["case"] and row["load"].startswith("uni")
    )
    return float(row["w_centre"]), float(row["quarter_point w(a/4,b/4)"])


def deflections(
    mesh: tuple[Floats, Ints], loads: Floats, h: float, orders: tuple[int, int], ks: float = 1.0
) -> tuple[float, ...]:
    """Deflections in the centre and at the quarter point of the simply supported unit square."""
    coordinates, elements = mesh
    held = simple_support(coordinates)
    forces = np.zeros(held.shape)
    forces[:, 2] = loads
    model = PlateModel(
        with_restraints(coordinates, elements, held, np.where(held, 0.0, forces)),
        isotropic_plate(h, ks),
        rules(*orders),
    )
    w = equilibrium(model)[:, 2]
    places = [np.hypot(*(coordinates - place).T) for place in (0.5, 0.25)]
    return tuple(float(w[place.argmin()]) for place in places)


def summed(nodes: Indices, values: Floats, numnp: int) -> Floats:
    """Add up what elements give to their nodes."""
    sums = np.bincount(nodes.ravel(), weights=values.ravel(), minlength=numnp)
    return np.asarray(sums, dtype=np.float64)
