"""Assumed transverse shear strains: zero-energy modes, patch tests, bending and vibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import eigsh, spsolve

from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.elements import gauss, nodal
from fecm.mechanics.interpolation import interpolate
from fecm.mechanics.mesh import element_blocks
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.strains import StrainField, strain_matrix
from tests.builders import (
    SKEWED,
    Floats,
    Ints,
    boundary,
    distorted_square,
    general_plate,
    isotropic_plate,
    mesh_on,
    nothing,
    one_element,
    parallelograms,
    rules,
    simple_support,
    square,
    with_restraints,
)
from tests.patches import (
    CURVATURE,
    MeshMaker,
    bent,
    equilibrium,
    reference_frequencies,
)

ASSUMED = replace(rules(), assumes_shear=True)


def supported(mesh: tuple[Floats, Ints], h: float, rule: IntegrationRules = ASSUMED) -> PlateModel:
    """The simply supported unit square, isotropic, under a uniform unit load."""
    coordinates, elements = mesh
    forces = np.zeros((len(coordinates), 5))
    for family in element_blocks(elements, coordinates):
        at = interpolate(family, gauss(3))
        np.add.at(forces[:, 2], family.nodes, np.einsum("ep,pn->en", at.jxw, at.N))
    held = simple_support(coordinates)
    mesh_ = with_restraints(coordinates, elements, held, np.where(held, 0.0, forces))
    return PlateModel(mesh_, isotropic_plate(h), rule)


def centre(model: PlateModel) -> float:
    coordinates = model.mesh.coordinates
    return float(equilibrium(model)[np.hypot(*(coordinates - 0.5).T).argmin(), 2])


def energy(model: PlateModel) -> float:
    """Twice the strain energy under the loads."""
    return float(spsolve(model.stiffness.tocsc(), model.nodal_loads) @ model.nodal_loads)


# One element -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [4, 9])
def test_one_element_has_six_zero_energy_modes_and_a_supported_mesh_none(kind: int) -> None:
    coordinates, elements = one_element(SKEWED, kind)
    free = PlateModel(
        with_restraints(coordinates, elements, nothing(coordinates)), general_plate(), ASSUMED
    )
    values = np.linalg.eigvalsh(free.stiffness.toarray())
    assert (values < 1e-12 * values[-1]).sum() == 6
    values = np.linalg.eigvalsh(supported(square(3, 3, kind), 0.1).stiffness.toarray())
    assert values[0] > 1e-6 * values[-1]


@pytest.mark.parametrize("rule", [gauss(2), gauss(3), nodal(3)])
@pytest.mark.parametrize("kind", [4, 9])
def test_stored_strains_are_those_of_the_stiffness(kind: int, rule: object) -> None:
    assert isinstance(rule, type(gauss(2)))
    coordinates, elements = distorted_square(3, 2, kind)
    field = np.random.default_rng(3).normal(size=(2, len(coordinates), 5))
    actual = StrainField(elements, coordinates, rule, assumes_shear=True).evaluate(field)
    (family,) = element_blocks(elements, coordinates)
    q = field[:, family.nodes].reshape(2, len(elements), -1)
    expected = np.einsum("epij,fej->ifep", strain_matrix(family, rule), q)
    np.testing.assert_allclose(actual[[4, 3]], expected, atol=1e-12)


# Patch tests -------------------------------------------------------------------------------------


def patched(mesh: tuple[Floats, Ints], field: Floats) -> Floats:
    """Displacements of a patch with a field prescribed on its boundary."""
    held = boundary(*mesh)
    restrained = with_restraints(*mesh, held, np.where(held, field, 0.0))
    return equilibrium(PlateModel(restrained, general_plate(), ASSUMED))


def sheared(coordinates: Floats) -> Floats:
    """Field of constant transverse shear strains: a tilted midplane with upright normals."""
    field = np.zeros((len(coordinates), 5))
    field[:, 2] = 0.3 + 0.7 * coordinates[:, 0] - 0.4 * coordinates[:, 1]
    return field


@pytest.mark.parametrize("maker", [parallelograms, distorted_square])
@pytest.mark.parametrize("kind", [4, 9])
def test_constant_transverse_shear_strains_are_exact_on_every_straight_sided_mesh(
    kind: int, maker: MeshMaker
) -> None:
    mesh = maker(3, 4, kind)
    actual = StrainField(mesh[1], mesh[0], gauss(3), assumes_shear=True).evaluate(sheared(mesh[0]))
    np.testing.assert_allclose(actual[4], 0.7, atol=1e-13)
    np.testing.assert_allclose(actual[3], -0.4, atol=1e-13)


@pytest.mark.parametrize("maker", [parallelograms, distorted_square])
@pytest.mark.parametrize("kind", [4, 9])
def test_the_patch_test_of_constant_curvature_is_passed_on_every_straight_sided_mesh(
    kind: int, maker: MeshMaker
) -> None:
    mesh = maker(3, 4, kind)
    field = bent(mesh[0], CURVATURE)
    np.testing.assert_allclose(patched(mesh, field), field, atol=1e-12)


# Bending and vibration ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "errors"),
    [(9, {4: 1.7e-3, 8: 9.8e-5, 16: 6.1e-6}), (4, {8: 5.3e-3, 16: 1.3e-3})],
)
@pytest.mark.parametrize("h", [0.1, 0.01, 0.001])
@pytest.mark.few(2)  # of 6, 0.06 s each
def test_a_thin_plate_bends_as_accurately_as_a_thick_one(
    kind: int, errors: dict[int, float], h: float
) -> None:
    exact = navier(h)
    for n, error in errors.items():
        value = centre(supported(square(n, n, kind), h)) / exact - 1.0
        assert 0.8 * error < abs(value) < error


def navier(h: float) -> float:
    """Centre deflection of the same plate, by Mindlin's theory: a double sine series."""
    D, S = h**3 / (12.0 * 0.91), h / 2.6
    m = np.arange(1, 400, 2)
    k = np.pi**2 * (m[:, None] ** 2 + m**2)
    load = 16.0 / np.pi**2 / np.outer(m, m) * np.outer(*[np.where(m % 4 == 1, 1.0, -1.0)] * 2)
    return float((load * (1.0 / (D * k * k) + 1.0 / (S * k))).sum())


@pytest.mark.parametrize(("h", "loss"), [(0.01, 1e-3), (0.001, 0.012)])
def test_moved_corners_cost_little_energy(h: float, loss: float) -> None:
    # Corners move at random by up to 0.2 of a side.
    x, y = np.meshgrid(*[np.linspace(0.0, 1.0, 9)] * 2)
    corners = np.stack([x, y], axis=-1)
    shifts = np.random.default_rng(1).uniform(-0.2, 0.2, corners.shape) / 8.0
    shifts[[0, -1]] = shifts[:, [0, -1]] = 0.0
    distorted, regular = (energy(supported(mesh_on(c, 9), h)) for c in (corners + shifts, corners))
    assert abs(distorted / regular - 1.0) < loss


@pytest.mark.parametrize("kind", [9, 4])
def test_frequencies_are_as_accurate_as_those_of_reduced_quadrature(kind: int) -> None:
    n, shear = (8, 2) if kind == 9 else (16, 1)
    exact = reference_frequencies("1.000000")[:6]
    assumed, reduced = (
        frequencies(square(n, n, kind), rule, 6)
        for rule in (ASSUMED, rules(3 if kind == 9 else 2, shear))
    )
    errors = np.abs(np.array([assumed, reduced]) / exact - 1.0)
    # Some a little better, some a little worse: 9.6e-4 and 9.4e-4 at most with 9 nodes.
    assert errors[0].max() < 1.03 * errors[1].max()


def frequencies(mesh: tuple[Floats, Ints], rule: IntegrationRules, count: int) -> Floats:
    """Lowest frequencies with the lumped mass, h/a = 0.1, omega a^2 sqrt(rho h/D)."""
    model = supported(mesh, 0.1, rule)
    scale = sparse.diags_array(1.0 / np.sqrt(model.mass))
    scaled = (scale @ model.stiffness @ scale).tocsc()
    start = np.random.default_rng(0).standard_normal(len(model.mass))
    squares = eigsh(scaled, k=count, sigma=0.0, v0=start, return_eigenvectors=False)
    return np.sort(np.sqrt(squares * 0.1 * 12.0 * 0.91 / 0.1**3))
