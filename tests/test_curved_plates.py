"""The element of curved panels: exact fields, kernels, gages, stresses, buckling."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from fecm.deck import model
from fecm.mechanics import kernels
from fecm.mechanics.elements import gauss
from fecm.mechanics.kernels.plate import CompiledProduct
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.membrane import strains_of_deflection
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.ply_stresses import PlyStresses
from fecm.mechanics.points import gages
from fecm.mechanics.solutions import buckling_factor
from fecm.mechanics.stiffness_product import stiffness_operator
from fecm.mechanics.strains import FLAT, Curvature, strain_of_deflection, strains_and_resultants
from fecm.mechanics.symmetry import symmetry_reduction, unreduced
from fecm.mechanics.time_step import critical_time_step, safe_time_step
from tests.builders import (
    Floats,
    boundary,
    distorted_square,
    general_plate,
    isotropic_plate,
    nothing,
    rules,
    simple_support,
    square,
    with_restraints,
)

BENT = (0.3, -0.2, 0.15)
PRELOAD = (3.0, -1.0, 0.7)
STRAIN = np.array([2e-3, -1e-3, 3e-3])


def free_panel(laminate: LaminateSection | None = None, curvature: Curvature = BENT) -> PlateModel:
    """A distorted mesh without supports."""
    coordinates, elements = distorted_square(3, 3)
    mesh = with_restraints(coordinates, elements, nothing(coordinates))
    return PlateModel(mesh, laminate or general_plate(), rules(), curvature=curvature)


def lifted(plate: PlateModel, w: float = 0.4) -> Floats:
    """Lift by w, with u and v that strain the midplane by STRAIN in addition: (numnp, 5)."""
    x, y = plate.mesh.coordinates.T
    field = np.zeros((len(x), 5))
    field[:, 0] = STRAIN[0] * x + STRAIN[2] * y
    field[:, 1] = STRAIN[1] * y
    field[:, 2] = w
    return field


# Exact fields -------------------------------------------------------------------------------------


def test_a_lifted_panel_has_the_forces_of_the_strains_of_its_radii() -> None:
    """Forces of the whole panel: N/R across it, and in its plane those of N at the boundary."""
    plate = free_panel()
    strain = STRAIN + 0.4 * strain_of_deflection(BENT)
    N = plate.laminate.A @ strain
    field = lifted(plate)
    forces = plate.internal_forces(field)
    pull = strain_of_deflection(BENT) @ N
    assert forces[:, 2].sum() == pytest.approx(pull * plate.area(), rel=1e-11)
    x, y = plate.mesh.coordinates.T
    virial = [
        (forces[:, 0] * x).sum(),
        (forces[:, 1] * y).sum(),
        (forces[:, 0] * y).sum(),
    ]
    np.testing.assert_allclose(virial, N * plate.area(), rtol=1e-11)
    inside = ~boundary(plate.mesh.coordinates, plate.mesh.elements)[:, 0]
    assert np.abs(forces[inside][:, :2]).max() < 1e-13 * np.abs(forces[:, :2]).max()


def test_a_translation_of_the_shell_has_no_energy() -> None:
    """Lifting by 1 strains nothing if u = -x/Rx - y/Rxy and v = -y/Ry - x/Rxy go with it."""
    plate = free_panel()
    x, y = plate.mesh.coordinates.T
    field = np.zeros((len(x), 5))
    field[:, 2] = 1.0
    field[:, 0] = -BENT[0] * x - BENT[2] * y
    field[:, 1] = -BENT[1] * y - BENT[2] * x
    alone = np.abs(plate.internal_forces(lifted(plate, 1.0))).max()
    assert np.abs(plate.internal_forces(field)).max() < 1e-13 * alone


def test_strains_and_resultants_contain_the_strains_of_the_radii() -> None:
    plate = free_panel()
    points = plate.strain_field(gauss(2))
    field = lifted(plate)
    of_w = strains_of_deflection(plate, points, field)
    actual = strains_and_resultants(points, plate.rows_by_laminate, field, (0.0, 0.0, 0.0), of_w)
    strain = STRAIN + 0.4 * strain_of_deflection(BENT)
    N, M = plate.laminate.A @ strain, plate.laminate.B @ strain
    names = ("eps_xx", "eps_yy", "gamma_xy", "N_x", "N_y", "N_xy", "M_x", "M_y", "M_xy")
    for name, value in zip(names, [*strain, *N, *M], strict=True):
        np.testing.assert_allclose(actual[name], value, rtol=1e-10, err_msg=name)
    flat = replace(plate, curvature=FLAT)
    assert strains_of_deflection(flat, points, field) is None


@pytest.mark.parametrize("direction", [0.0, 90.0, 30.0])
def test_a_gage_reads_the_strain_of_the_radii_in_its_direction(direction: float) -> None:
    plate = free_panel()
    field = lifted(plate)
    gage = model.Gage(1, 0.41, 0.37, 0.1, direction)
    gage_cards = gages(plate.mesh, [gage], curvature=plate.curvature)
    c, s = np.cos(np.deg2rad(direction)), np.sin(np.deg2rad(direction))
    strain = STRAIN + 0.4 * strain_of_deflection(BENT)
    actual = gage_cards.strains(
        (field.ravel()[gage_cards.dof_indices] * gage_cards.weights).sum(axis=1)
    )
    assert actual[0] == pytest.approx(np.array([c * c, s * s, c * s]) @ strain, rel=1e-10)


def test_ply_stresses_have_the_strains_of_the_radii_and_their_derivatives() -> None:
    coordinates, elements = square(2, 2)
    mesh = with_restraints(coordinates, elements, nothing(coordinates))
    x, y = coordinates.T
    field = np.zeros((len(x), 5))
    field[:, 2] = 0.2 + 0.3 * x - 0.1 * y + 0.5 * x * y
    plies = PlyStresses(mesh, general_plate(), gauss(2), curvature=BENT)
    strains, gradients = plies.strains(field)
    points = PlateModel(mesh, general_plate(), rules()).strain_field(gauss(2))
    at_x, at_y = points.places(coordinates)
    w = 0.2 + 0.3 * at_x - 0.1 * at_y + 0.5 * at_x * at_y
    per_w = strain_of_deflection(BENT)
    np.testing.assert_allclose(strains[..., :3], w[..., None] * per_w, rtol=1e-11)
    assert not strains[..., 3:].any()
    centres = coordinates[elements[:, 8] - 1]
    slopes = np.stack([0.3 + 0.5 * centres[:, 1], -0.1 + 0.5 * centres[:, 0]], axis=1)
    np.testing.assert_allclose(gradients[:, :, :3], slopes[:, :, None] * per_w, rtol=1e-11)


# Product, symmetry, time step ---------------------------------------------------------------------


@pytest.mark.skipif(kernels.LIBRARY is None, reason="needs the compiled kernels")
@pytest.mark.parametrize("odd", [False, pytest.param(True, marks=pytest.mark.long)])
def test_the_kernels_have_the_forces_of_numpy(odd: bool) -> None:
    """On congruent and other elements, by every rule, with u and v free or all restrained.

    In the short run half of the cases, with every combination of any four choices.
    """
    laminates = (general_plate(), isotropic_plate(0.1))
    orders = ((3, 2), (4, 4))
    cases = itertools.product(
        (square, distorted_square), laminates, orders, (False, True), ((0.0, 0.0, 0.0), PRELOAD)
    )
    half = [case for number, case in enumerate(cases) if number.bit_count() % 2 == odd]
    for maker, laminate, order, assumes_shear, preload in half:
        coordinates, elements = maker(4, 4)
        used = replace(rules(*order), assumes_shear=assumes_shear)
        for clamped in (False, True):
            restrained = simple_support(coordinates)
            restrained[:, :2] = clamped
            mesh = with_restraints(coordinates, elements, restrained)
            plate = PlateModel(mesh, laminate, used, preload=preload, curvature=BENT)
            for kept in (unreduced(plate), symmetry_reduction(plate, None)):
                u = np.random.default_rng(0).standard_normal(kept.count)
                wanted = stiffness_operator(plate, "numpy", kept)(u)
                size = np.abs(wanted).max()
                flat = stiffness_operator(replace(plate, curvature=FLAT), "numpy", kept)(u)
                assert np.abs(flat - wanted).max() > 1e-6 * size
                actual = CompiledProduct(plate, kept)(u)
                np.testing.assert_allclose(actual, wanted, rtol=0.0, atol=5e-15 * size)


def test_u_and_v_of_a_curved_panel_are_not_at_rest() -> None:
    coordinates, elements = square(4, 4)
    mesh = with_restraints(coordinates, elements, simple_support(coordinates))
    mesh.codes[:, :2] = 0
    restrained = simple_support(coordinates)
    restrained[:, :2] = False
    mesh = with_restraints(coordinates, elements, restrained)
    flat = PlateModel(mesh, isotropic_plate(0.1), rules())
    panel = replace(flat, curvature=(0.1, 0.0, 0.0))
    in_plane = (symmetry_reduction(one, None).sign[:, :2].any() for one in (flat, panel))
    assert list(in_plane) == [False, True]
    half = symmetry_reduction(replace(flat, curvature=BENT), None)
    assert sorted(set(half.weights.tolist())) == [0, 2]


def test_the_critical_time_step_contains_the_curvature() -> None:
    """A deep curvature stiffens w so much that it limits the step, which has a dense solution."""
    plate = free_panel(isotropic_plate(0.05), curvature=(40.0, 0.0, 0.0))
    critical = critical_time_step(plate)
    scaled = plate.stiffness.toarray() / np.sqrt(np.outer(plate.mass, plate.mass))
    assert critical == pytest.approx(2.0 / np.sqrt(np.linalg.eigvalsh(scaled)[-1]), rel=1e-4)
    assert critical < 0.96 * critical_time_step(replace(plate, curvature=FLAT))
    assert 0.8 * critical < safe_time_step(plate) <= critical


# Buckling -----------------------------------------------------------------------------------------


def test_a_compressed_cylinder_buckles_under_the_classical_load() -> None:
    """A long panel compressed along its straight lines: E h^2/(R sqrt(3 (1 - nu^2))).

    SS3 edges whose sides are multiples of the half waves of the square pattern.
    """
    h, radius, nu = 0.01, 2.0, 0.3
    # Half waves of equal length along and across the panel, of one of the many critical patterns.
    wave = np.pi * np.sqrt(radius * h) / (12.0 * (1.0 - nu**2)) ** 0.25 * 2.0
    coordinates, elements = square(12, 12)
    coordinates = coordinates * 3.0 * wave
    restrained = nothing(coordinates)
    for axis in (0, 1):
        edge = np.isclose(coordinates[:, axis], 0.0) | np.isclose(coordinates[:, axis], 3.0 * wave)
        restrained[edge, 2] = restrained[edge, 1 - axis] = restrained[edge, 4 - axis] = True
    mesh = with_restraints(coordinates, elements, restrained)
    load = h**2 / (radius * np.sqrt(3.0 * (1.0 - nu**2)))
    used = replace(rules(), assumes_shear=True)
    plate = PlateModel(mesh, isotropic_plate(h), used, preload=(-load, 0.0, 0.0))
    panel = replace(plate, curvature=(0.0, 1.0 / radius, 0.0))
    assert buckling_factor(panel) == pytest.approx(1.0, abs=0.02)
    assert buckling_factor(plate) < 0.6


def test_a_panel_that_slides_in_its_plane_buckles_as_one_that_is_pinned_there() -> None:
    coordinates, elements = square(4, 4)
    restrained = simple_support(coordinates)
    restrained[:, :2] = False
    mesh = with_restraints(coordinates, elements, restrained)
    plate = PlateModel(
        mesh, isotropic_plate(0.05), rules(), preload=(-1e-3, 0.0, 0.0), curvature=(0.0, 0.2, 0.0)
    )
    free = buckling_factor(plate)
    restrained[0, :2] = True
    restrained[1, 1] = True
    held = buckling_factor(replace(plate, mesh=with_restraints(coordinates, elements, restrained)))
    assert np.isfinite(free)
    assert free == pytest.approx(held, rel=1e-7)
