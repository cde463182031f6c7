"""Ply stresses against the handbook, Pagano's plate and equilibrium."""

from __future__ import annotations

import tracemalloc
from itertools import pairwise

import numpy as np
import pytest

from fecm import Ply
from fecm.mechanics.elements import gauss
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.mechanics.mesh import MeshArrays, element_blocks
from fecm.mechanics.ply_stresses import (
    PlyStresses,
    equilibrium_shear_stiffness,
    in_plane_stresses,
    interlaminar_stresses,
    second_derivatives,
)
from fecm.mechanics.points import containing_elements
from tests.builders import (
    DATA,
    GENERAL_ANGLES,
    GENERAL_LAYERS,
    GENERAL_PLY,
    REPORT_PLY,
    SKEWED,
    Floats,
    distorted_square,
    general_plate,
    nothing,
    one_element,
    square,
    table,
    with_restraints,
)

PAGANO = Ply(density=1.0, nu12=0.25, e1=25.0, e2=1.0, g12=0.5, g13=0.5, g23=0.2)
SANDWICH = (0.0, 90.0, 0.0)


def pagano(angles: tuple[float, ...] = SANDWICH, h: float = 1.0) -> LaminateSection:
    return laminate(PAGANO, angles, [h / len(angles)] * len(angles))


# Through the thickness ---------------------------------------------------------------------------


def test_ply_stresses_are_those_of_the_handbook_to_its_printed_digits() -> None:
    # IASB 37103-01, issue D: [0/10/90/70], 0.125 mm each, N_x = 100 N/mm and M_x = 15 N.
    ply = Ply(density=1.0, nu12=0.28, e1=132700.0, e2=9300.0, g12=4600.0, g13=1.0, g23=1.0)
    plate = laminate(ply, (0.0, 10.0, 90.0, 70.0), [0.125] * 4)
    stiffness = np.block([[plate.A, plate.B], [plate.B, plate.D]])
    strains = np.linalg.solve(stiffness, [100.0, 0.0, 0.0, 15.0, 0.0, 0.0])
    lines = (DATA / "hsb_37103_01_issue_d.csv").read_text().splitlines()
    printed = np.array([line.split(",")[-3:] for line in lines[2:]], dtype=float)
    actual = (in_plane_stresses(plate) @ strains).reshape(8, 3)
    np.testing.assert_allclose(actual, printed, rtol=0.0, atol=6e-4)


@pytest.mark.parametrize(
    ("name", "plate"),
    [
        ("one ply (homogeneous)", laminate(REPORT_PLY, [0.0], [0.106])),
        ("[45] ply turned", pagano((45.0,))),
        ("[0/90/0] Pagano ply", pagano()),
        ("[0/90/90/0] Pagano ply", pagano((0.0, 90.0, 90.0, 0.0))),
    ],
)
def test_the_shear_stiffness_of_equilibrium_is_the_closed_form(
    name: str, plate: LaminateSection
) -> None:
    (row,) = (row for row in table("shear_stiffness.csv") if row["laminate"] == name)
    xx, xy, yy = (float(row[f"H {ij}"]) for ij in ("xz,xz", "xz,yz", "yz,yz"))
    actual = equilibrium_shear_stiffness(plate)
    np.testing.assert_allclose(actual, [[xx, xy], [xy, yy]], rtol=1e-8, atol=1e-9 * xx)


def test_a_quarter_turn_of_the_laminate_exchanges_the_shear_stiffnesses() -> None:
    H = equilibrium_shear_stiffness(general_plate())
    turned = equilibrium_shear_stiffness(general_plate(90.0))
    np.testing.assert_allclose(turned, [[H[1, 1], -H[0, 1]], [-H[0, 1], H[0, 0]]], rtol=1e-12)


def test_a_plate_of_equal_plies_has_the_parabola_of_a_beam_in_shear() -> None:
    plate = laminate(REPORT_PLY, [0.0] * 4, [0.25] * 4)
    stresses, residual = interlaminar_stresses(plate)
    gradient = np.zeros((2, 6))
    gradient[0, 3] = 1.0  # kappa_x,x: M_x,x = Q_x = D11
    tau = np.einsum("lptds,ds->lpt", stresses, gradient)
    z = np.array(
        [[-0.5, -0.375, -0.25], [-0.25, -0.125, 0.0], [0.0, 0.125, 0.25], [0.25, 0.375, 0.5]]
    )
    np.testing.assert_allclose(tau[:, :, 0], 1.5 * plate.D[0, 0] * (1.0 - 4.0 * z**2), atol=1e-8)
    np.testing.assert_allclose(np.einsum("tds,ds->t", residual, gradient), 0.0, atol=1e-9)


def test_memory_of_the_interlaminar_stresses_is_linear_in_the_number_of_plies() -> None:
    def peak(plies: int) -> int:
        plate = laminate(PAGANO, [0.0, 90.0] * (plies // 2), [0.1] * plies)
        tracemalloc.start()
        interlaminar_stresses(plate)
        equilibrium_shear_stiffness(plate)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    assert peak(1000) < 5 * peak(250)


def test_interlaminar_stresses_vanish_at_both_faces_and_are_continuous_in_between() -> None:
    stresses, _ = interlaminar_stresses(general_plate())
    scale = np.abs(stresses).max()
    np.testing.assert_allclose(stresses[0, 0], 0.0, atol=1e-15 * scale)
    np.testing.assert_allclose(stresses[-1, 2], 0.0, atol=1e-14 * scale)
    np.testing.assert_allclose(stresses[:-1, 2], stresses[1:, 0], atol=1e-14 * scale)


def test_the_resultants_of_the_ply_stresses_are_those_of_the_laminate() -> None:
    plate = general_plate()
    strains = np.random.default_rng(4).normal(size=6)
    ends = in_plane_stresses(plate) @ strains
    faces = plate.plies.faces
    N, M = np.zeros(3), np.zeros(3)
    for angle, (low, high), (a, b) in zip(GENERAL_ANGLES, ends, pairwise(faces), strict=True):
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        back = np.array(
            [[c * c, s * s, -2 * c * s], [s * s, c * c, 2 * c * s], [c * s, -c * s, c * c - s * s]]
        )
        low, high = back @ low, back @ high
        N += (b - a) * (low + high) / 2.0
        M += (b - a) * (a * (2 * low + high) + b * (low + 2 * high)) / 6.0
    expected = np.block([[plate.A, plate.B], [plate.B, plate.D]]) @ strains
    np.testing.assert_allclose(np.concatenate([N, M]), expected, rtol=1e-12)
    assert GENERAL_LAYERS[0] == pytest.approx(faces[1] - faces[0])
    assert GENERAL_PLY.e1 != GENERAL_PLY.e2


# Over the plate ----------------------------------------------------------------------------------


def sine_field(coordinates: Floats, h: float) -> tuple[Floats, dict[str, float]]:
    """Navier's solution of Pagano's plate, FSDT with K = 1, and its largest stresses (p. 37)."""
    plate = pagano(h=h)
    p = np.pi
    D, S = plate.D, plate.shear
    # Equilibrium of w sin sin, theta_x cos sin, theta_y sin cos under a unit load sin sin.
    matrix = np.array(
        [
            [p * p * (S[0, 0] + S[1, 1]), -p * S[0, 0], -p * S[1, 1]],
            [-p * S[0, 0], p * p * (D[0, 0] + D[2, 2]) + S[0, 0], p * p * (D[0, 1] + D[2, 2])],
            [-p * S[1, 1], p * p * (D[0, 1] + D[2, 2]), p * p * (D[1, 1] + D[2, 2]) + S[1, 1]],
        ]
    )
    w, tx, ty = np.linalg.solve(matrix, [1.0, 0.0, 0.0])
    (row,) = (
        row
        for row in table("pagano_sinusoidal.csv")
        if (row["b/a"], row["S=a/h"], row["theory"]) == ("1", "10", "FSDT K=1")
        and row["laminate"].startswith("[0/90/0]")
    )
    assert w * h**3 / 1.0 * 100.0 == pytest.approx(float(row["w*100*ET/(q0*h*S^4)"]), rel=1e-8)
    sx, cx = np.sin(p * coordinates[:, 0]), np.cos(p * coordinates[:, 0])
    sy, cy = np.sin(p * coordinates[:, 1]), np.cos(p * coordinates[:, 1])
    field = np.zeros((len(coordinates), 5))
    field[:, 2], field[:, 3], field[:, 4] = w * sx * sy, tx * cx * sy, ty * sx * cy
    return field, {name: float(value) for name, value in row.items() if "/(q0" in name}


@pytest.mark.parametrize("n", [16])
def test_stresses_of_paganos_plate_converge_to_first_order_theory(n: int) -> None:
    def errors(n: int) -> tuple[float, float, float]:
        coordinates, elements = square(n, n)
        mesh = with_restraints(coordinates, elements, nothing(coordinates))
        field, largest = sine_field(coordinates, 0.1)
        actual = PlyStresses(mesh, pagano(h=0.1), gauss(2)).evaluate(field)
        (family,) = element_blocks(elements, coordinates)
        values = family.shape.shape_functions(gauss(2).xi, gauss(2).eta, family.present)[0]
        x, y = np.einsum("pn,eni->iep", values, family.coordinates)
        exact = largest["sx(a/2,b/2,+h/2)/(q0 S^2)"] * 100 * np.sin(np.pi * x) * np.sin(np.pi * y)
        in_plane = np.abs(actual["sigma_1"][:, :, 2, 1] - exact).max() / np.abs(exact).max()
        x, y = coordinates[elements[:, 8] - 1].T
        exact_xz = largest["txz(0,b/2,0)/(q0 S)"] * 10 * np.cos(np.pi * x) * np.sin(np.pi * y)
        exact_yz = largest["tyz(a/2,0,0)/(q0 S)"] * 10 * np.sin(np.pi * x) * np.cos(np.pi * y)
        xz = np.abs(actual["tau_xz"][:, 1, 1] - exact_xz).max() / np.abs(exact_xz).max()
        yz = np.abs(actual["tau_yz"][:, 1, 1] - exact_yz).max() / np.abs(exact_yz).max()
        return in_plane, xz, yz

    coarse, fine = errors(n // 2), errors(n)
    assert fine[0] < 1e-3
    assert fine[1] < 3e-3
    slopes = np.log2(np.array(coarse) / fine)
    np.testing.assert_allclose(slopes[1:], 2.0, atol=0.1)


@pytest.mark.parametrize("distort", [False, True])
def test_second_derivatives_of_a_quadratic_are_exact_on_any_straight_sided_element(
    distort: bool,
) -> None:
    coordinates, elements = distorted_square(3, 3) if distort else one_element(SKEWED)
    (family,) = element_blocks(elements, coordinates)
    x, y = family.coordinates.swapaxes(0, 2).swapaxes(1, 2)
    u = 0.3 + x - 2 * y + 1.5 * x * x - 0.7 * y * y + 0.4 * x * y
    actual = np.einsum("ein,en->ei", second_derivatives(family), u)
    np.testing.assert_allclose(actual, np.tile([3.0, -1.4, 0.4], (len(elements), 1)), atol=1e-10)


def test_interlaminar_stresses_of_elements_without_nine_nodes_are_nan() -> None:
    coordinates, elements = square(2, 2, 8)
    mesh: MeshArrays = with_restraints(coordinates, elements, nothing(coordinates))
    actual = PlyStresses(mesh, pagano(), gauss(2)).evaluate(np.ones((len(coordinates), 5)))
    assert np.isnan(actual["tau_xz"]).all()
    assert np.isfinite(actual["sigma_1"]).all()


# Location of points ------------------------------------------------------------------------------


def test_points_are_located_in_every_element_that_contains_them() -> None:
    coordinates, elements = distorted_square(4, 4)
    (family,) = element_blocks(elements, coordinates)
    points = np.random.default_rng(7).uniform(-0.1, 1.1, (200, 2))
    members, which, xi = containing_elements(family, points)
    inside = ((points >= 0.0) & (points <= 1.0)).all(axis=1)
    assert set(which) == set(np.flatnonzero(inside))
    values = family.shape.shape_functions(xi[:, 0], xi[:, 1], family.present)[0]
    actual = np.einsum("kn,kni->ki", values, family.coordinates[members])
    np.testing.assert_allclose(actual, points[which], atol=1e-12)
    node = coordinates[elements[5, 2] - 1]
    assert len(containing_elements(family, node[None])[0]) == 4
