"""The plate under a uniform initial membrane force: stiffness, frequencies, time step.

``preload_*.csv`` are of a simply supported cross-ply plate, 200 x 200 x 2.69 mm: Navier solutions
of first-order shear deformation theory, computed by another program.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fecm.deck.model import Ply
from fecm.mechanics import element_matrices
from fecm.mechanics.laminate import Laminate, laminate
from fecm.mechanics.mesh import element_blocks
from fecm.mechanics.plate import UNLOADED, PlateModel
from fecm.mechanics.solutions import modes
from fecm.mechanics.stiffness_product import stiffness_operator
from fecm.mechanics.time_step import critical_time_step, safe_time_step
from tests.builders import (
    SKEWED,
    Floats,
    boundary,
    distorted_square,
    general_plate,
    mixed,
    nothing,
    one_element,
    rules,
    simple_support,
    square,
    table,
    with_restraints,
)
from tests.patches import MeshMaker, area_of

Force = tuple[float, float, float]

PRELOAD: Force = (3.0, -1.0, 0.7)
KINDS = (3, 4, 8, 9, 10, 11, 12)
SIDE = 200.0
PLY = Ply(density=1.58e-9, nu12=0.3, e1=120e3, e2=7900.0, g12=5500.0, g13=5500.0, g23=5500.0)
ANGLES = (0.0, 90.0, 0.0, 90.0, 0.0, 0.0, 90.0, 0.0, 90.0, 0.0)


def cross_ply() -> Laminate:
    """The laminate of the reference data."""
    return laminate(PLY, ANGLES, [0.269] * len(ANGLES))


@cache
def reference_plate(n: int) -> PlateModel:
    """The plate of the reference data on n x n elements, without preload."""
    coordinates, elements = square(n, n)
    mesh = with_restraints(SIDE * coordinates, elements, simple_support(coordinates))
    return PlateModel(mesh, cross_ply(), replace(rules(), assumes_shear=True))


def free_plate(maker: MeshMaker, kind: int, preload: Force = PRELOAD) -> PlateModel:
    """A plate without supports, 3 x 4 elements."""
    coordinates, elements = maker(3, 4, kind)
    mesh = with_restraints(coordinates, elements, nothing(coordinates))
    return PlateModel(mesh, general_plate(), rules(), preload=preload)


def tilted(coordinates: Floats) -> Floats:
    """Field w = 0.3 + 2 x - 0.5 y with the rotations of its slopes."""
    field = np.zeros((len(coordinates), 5))
    field[:, 2] = 0.3 + coordinates @ [2.0, -0.5]
    field[:, 3:] = 2.0, -0.5
    return field


# The geometric stiffness -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_the_preload_works_on_the_slopes_of_a_tilted_plate(kind: int) -> None:
    model = free_plate(distorted_square, kind)
    field = tilted(model.mesh.coordinates)
    energy = 0.5 * float((field * model.internal_forces(field)).sum())
    n_x, n_y, n_xy = PRELOAD
    # The unit square has an area of 1.
    work = 0.5 * (n_x * 2.0**2 + n_y * 0.5**2 + 2.0 * n_xy * 2.0 * -0.5)
    assert energy == pytest.approx(work, rel=1e-11)


def test_the_preload_pulls_at_the_edges_of_a_tilted_plate_alone() -> None:
    model = free_plate(distorted_square, 9)
    forces = model.internal_forces(tilted(model.mesh.coordinates))
    scale = np.abs(forces).max()
    assert np.abs(forces[:, [0, 1, 3, 4]]).max() < 1e-12 * scale
    inside = ~boundary(model.mesh.coordinates, model.mesh.elements)[:, 2]
    assert np.abs(forces[inside, 2]).max() < 1e-12 * scale
    # N0 times the outward normal: the edge x = 1 of length 1 carries N_x w,x + N_xy w,y.
    n_x, _, n_xy = PRELOAD
    x = model.mesh.coordinates[:, 0]
    moment = float(forces[:, 2] @ x)
    assert moment == pytest.approx(n_x * 2.0 + n_xy * -0.5, rel=1e-12)


def test_the_slip_of_the_jacobian_is_that_of_the_other_strains() -> None:
    coordinates, elements = one_element(SKEWED)
    (family,) = element_blocks(elements, coordinates)
    field = tilted(coordinates).ravel()
    area = area_of(SKEWED)

    def energy(*, transposed_jacobian: bool) -> float:
        chosen = rules(transposed_jacobian=transposed_jacobian)
        (K,) = element_matrices.geometric_stiffness(family, (1.0, 0.0, 0.0), chosen)
        return float(field @ K @ field)

    assert energy(transposed_jacobian=False) == pytest.approx(area * 2.0**2, rel=1e-12)
    assert abs(energy(transposed_jacobian=True) / (area * 2.0**2) - 1.0) > 0.01


@pytest.mark.parametrize(("maker", "kind"), [(square, 4), (square, 9), (mixed, 9)])
def test_every_product_with_the_stiffness_sees_the_preload(maker: MeshMaker, kind: int) -> None:
    model = free_plate(maker, kind)
    without = replace(model, preload=UNLOADED)
    u = np.random.default_rng(5).standard_normal(model.neq)
    expected = model.stiffness.toarray() @ u
    scale = np.abs(expected).max()
    assert np.abs(without.stiffness @ u - expected).max() > 0.01 * scale
    for solver in ("numpy", "csr"):
        found = stiffness_operator(model, solver)(u)
        np.testing.assert_allclose(found, expected, atol=1e-13 * scale)
    internal = model.internal_forces(model.field(u))[model.mesh.equations > 0]
    np.testing.assert_allclose(internal, expected, atol=1e-13 * scale)


# Frequencies and the time step -------------------------------------------------------------------


def reference_frequencies() -> dict[Force, list[tuple[int, int, float]]]:
    """Half-waves m and n and the frequency in Hz of the modes to 3 x 3, by preload."""
    found: dict[Force, list[tuple[int, int, float]]] = {}
    for row in table("preload_frequencies.csv"):
        force = (float(row["N0x_N_per_mm"]), float(row["N0y_N_per_mm"]), 0.0)
        m, n = int(row["m"]), int(row["n"])
        if max(m, n) <= 3:
            found.setdefault(force, []).append((m, n, float(row["frequency_Hz"])))
    return found


@pytest.mark.parametrize("preload", reference_frequencies())
def test_frequencies_under_a_preload_are_naviers(preload: Force) -> None:
    plate = replace(reference_plate(16), preload=preload)
    found = modes(plate, 24, consistent=False)
    shapes = np.array([plate.field(shape, 0.0)[:, 2] for shape in found.shapes])
    shapes /= np.linalg.norm(shapes, axis=1)[:, None]
    x, y = np.pi * plate.mesh.coordinates.T / SIDE
    for m, n, frequency in reference_frequencies()[preload]:
        wave = np.sin(m * x) * np.sin(n * y)
        alike = np.abs(shapes @ wave) / np.linalg.norm(wave)
        assert alike.max() > 0.999
        hertz = found.angular_frequency[alike.argmax()] / (2.0 * np.pi)
        assert hertz == pytest.approx(frequency, rel=2e-4), (m, n)


def test_a_strong_tension_shortens_both_time_steps() -> None:
    model = reference_plate(4)
    # So strong that a wave of the stretched skin limits the step.
    model = replace(model, preload=(4e7, 4e7, 0.0))
    K, M = model.stiffness.toarray(), model.mass
    exact = 2.0 / np.sqrt(np.linalg.eigvalsh(K / np.sqrt(np.outer(M, M)))[-1])
    assert critical_time_step(model) == pytest.approx(exact, rel=5e-5)
    assert 0.8 * exact < safe_time_step(model) <= exact
    assert exact < 0.5 * critical_time_step(replace(model, preload=UNLOADED))
