"""Waves against the report's formulas, an independent determinant, closed forms and invariances."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from fecm import Ply
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.studies.waves import FRONTS, MODES, Medium, WaveSurfaces, dispersion
from tests.builders import (
    GENERAL_PLY,
    REPORT_PLY,
    Floats,
    general_plate,
    isotropic_plate,
    report_plate,
    table,
)
from tests.calls import call
from tests.decks import DATA_CARDS, small

NU = 0.3  # of the isotropic plate


@pytest.fixture(scope="module")
def report() -> WaveSurfaces:
    """Fronts of the report's plate."""
    return WaveSurfaces(Medium(report_plate()))


@pytest.fixture(scope="module")
def general() -> WaveSurfaces:
    """Fronts of a plate in which everything is coupled."""
    return WaveSurfaces(Medium(general_plate()))


def column(rows: list[dict[str, str]], name: str) -> Floats:
    """A column of a reference file."""
    return np.array([float(row[name]) for row in rows])


# The report's laminate --------------------------------------------------------------------------


@pytest.mark.parametrize("angle", ["0", "45", "90"])
def test_flexural_waves_have_the_reference_files_velocities_and_frequencies(angle: str) -> None:
    rows = [row for row in table("waves_dispersion.csv") if row["alpha_deg"] == angle]
    assert len(rows) == 30
    actual = dispersion(Medium(report_plate()), float(angle), column(rows, "lambda_over_h"))
    for n, (velocity, frequency) in enumerate(
        [
            ("mode1_c_in/s", "mode1_omega_rad/s"),
            ("mode2_c_in/s", "mode2_omega"),
            ("mode3_c_in/s", "mode3_omega"),
        ]
    ):
        assert MODES[n] == f"flexural_{n + 1}"
        expected = column(rows, velocity)
        np.testing.assert_allclose(actual.phase_velocity[:, n], expected, rtol=1e-8)
        expected = column(rows, frequency)
        np.testing.assert_allclose(actual.angular_frequency[:, n], expected, rtol=1e-8)


def test_fronts_have_the_reference_files_normal_velocities(report: WaveSurfaces) -> None:
    rows = table("waves_normal_velocity.csv")
    names = ("c_ext", "c_inshear", "c_bend", "c_twist", "c_transverse_shear (in/s)")
    expected = np.stack([column(rows, name) for name in names], axis=1)
    velocity = report.fronts(column(rows, "theta_deg")).velocity
    np.testing.assert_allclose(velocity, expected, rtol=1e-9)


@pytest.mark.parametrize("mode", ["extension", "inplane_shear", "bending", "twisting"])
def test_fronts_have_the_reference_files_rays_and_positions(
    mode: str, report: WaveSurfaces
) -> None:
    rows = [row for row in table("waves_wavefront_rays.csv") if row["mode"] == mode]
    place = FRONTS.index(mode.replace("inplane", "in_plane"))
    fronts = report.fronts(column(rows, "normal_deg"))
    rays = np.stack([column(rows, f"ray_v{axis}_in/s") for axis in "xy"], axis=1)
    speed = column(rows, "c_n_in/s")
    np.testing.assert_allclose(fronts.velocity[:, place], speed, rtol=1e-9)
    np.testing.assert_allclose(
        fronts.ray[:, place] / speed[:, None], rays / speed[:, None], atol=1e-9
    )
    directions = column(rows, "ray_dir_deg")
    np.testing.assert_allclose(fronts.ray_angle[:, place], directions, atol=1e-6)
    for time in (2, 4, 5, 8, 10):
        expected = np.stack([column(rows, f"{axis}_t{time}us") for axis in "xy"], axis=1)
        actual = fronts.positions(time * 1e-6, 0.106)[:, place]
        np.testing.assert_allclose(actual, expected, rtol=1e-7, atol=1e-7 * 0.106)


@pytest.mark.parametrize("angle", [0.0, 25.0, 45.0, 110.0])
@pytest.mark.parametrize("wavelength", [0.3, 2.0, 15.0])
def test_the_reports_two_groups_are_a_special_case_of_the_five_equations(
    angle: float, wavelength: float
) -> None:
    plate = report_plate()
    A, D, shear = plate.A, plate.D, plate.shear[1, 1]
    m, n = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    k = 2.0 * np.pi / (wavelength * plate.thickness)
    # Equation 2-31, and 2-32 with w a quarter of a period ahead, without their terms in c^2.
    off = (A[0, 1] + A[2, 2]) * m * n
    in_plane = [[A[0, 0] * m**2 + A[2, 2] * n**2, off], [off, A[2, 2] * m**2 + A[1, 1] * n**2]]
    b11 = D[0, 0] * m**2 + 2 * D[0, 2] * m * n + D[2, 2] * n**2 + shear / k**2
    b12 = D[0, 2] + (D[0, 1] + D[2, 2]) * m * n
    b22 = D[2, 2] * m**2 + 2 * D[0, 2] * m * n + D[1, 1] * n**2 + shear / k**2
    b13, b23 = shear * m / k, shear * n / k
    flexural = [[b11, b12, b13], [b12, b22, b23], [b13, b23, shear]]
    i, p = plate.rotary_inertia, plate.mass
    groups = (
        np.sort(np.linalg.eigvals(np.array(flexural) / np.array([[i], [i], [p]]))),
        np.sort(np.linalg.eigvals(np.array(in_plane) / p))[::-1],
    )
    actual = dispersion(Medium(plate), angle, [wavelength]).phase_velocity[0]
    np.testing.assert_allclose(actual**2, np.concatenate(groups), rtol=1e-9)


def test_the_transverse_shear_factor_puts_the_cut_off_frequency_right() -> None:
    plate = report_plate()
    for factor, expected in ((1.0, np.sqrt(12.0)), (np.pi**2 / 12.0, np.pi)):
        medium = Medium(replace(plate, shear=factor * plate.shear))
        actual = dispersion(medium, 30.0, [1e8]).angular_frequency[0, 1:3]
        exact = expected * np.sqrt(REPORT_PLY.g13 / REPORT_PLY.density) / plate.thickness
        np.testing.assert_allclose(actual, exact, rtol=1e-12)


# A laminate that is coupled in every way, against a determinant of its own -----------------------


def entries(plate: LaminateSection, angle: float, k: float | None) -> list[list[Polynomial]]:
    """Equations 2-22 and 2-23 for a plane wave as polynomials in c^2, scaled by 1/k^2.

    Unknowns u, v, phi_x h, phi_y h, w in the plate's axes, w a quarter of a period ahead.  Without
    k the wave is infinitely short.
    """
    x, y, h = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), plate.thickness

    def block(S: Floats) -> list[list[float]]:
        first = S[0, 0] * x * x + 2.0 * S[0, 2] * x * y + S[2, 2] * y * y
        mixed = S[0, 2] * x * x + (S[0, 1] + S[2, 2]) * x * y + S[1, 2] * y * y
        last = S[2, 2] * x * x + 2.0 * S[1, 2] * x * y + S[1, 1] * y * y
        return [[first, mixed], [mixed, last]]

    A, B, D = block(plate.A), block(plate.B), block(plate.D)
    slow = 0.0 if k is None else 1.0 / k
    matrix = [[Polynomial([0.0]) for _ in range(5)] for _ in range(5)]
    for i in range(2):
        for j in range(2):
            same = float(i == j)
            bending = (D[i][j] + slow**2 * plate.shear[i, j]) / h**2
            matrix[i][j] = Polynomial([A[i][j], -same * plate.mass])
            matrix[i][2 + j] = matrix[2 + j][i] = Polynomial([B[i][j] / h])
            matrix[2 + i][2 + j] = Polynomial([bending, -same * plate.rotary_inertia / h**2])
        across = slow * (plate.shear[i, 0] * x + plate.shear[i, 1] * y) / h
        matrix[2 + i][4] = matrix[4][2 + i] = Polynomial([across])
    (xx, xy), (_, yy) = plate.shear
    matrix[4][4] = Polynomial([xx * x * x + 2.0 * xy * x * y + yy * y * y, -plate.mass])
    return matrix


def determinant(matrix: list[list[Polynomial]]) -> Polynomial:
    """By the cofactors of the first row."""
    if not matrix:
        return Polynomial([1.0])
    minors = ([row[:n] + row[n + 1 :] for row in matrix[1:]] for n in range(len(matrix)))
    terms = [
        (-1.0) ** n * entry * determinant(minor)
        for n, (entry, minor) in enumerate(zip(matrix[0], minors, strict=True))
        if entry.coef.any()
    ]
    return sum(terms, Polynomial([0.0]))


def velocities(matrix: list[list[Polynomial]]) -> Floats:
    """Roots of the determinant, rising."""
    roots = determinant(matrix).roots()
    assert np.abs(np.imag(roots)).max() < 1e-9 * np.abs(roots).max()
    actual: Floats = np.sort(np.sqrt(np.real(roots)))
    return actual


@pytest.mark.parametrize("angle", [0.0, 17.0, 45.0, 90.0, 140.0])
@pytest.mark.parametrize("wavelength", [0.5, 3.0, 10.0, 40.0])
@pytest.mark.few(6)  # of 20, 0.02 s each
def test_waves_of_an_unsymmetric_laminate_are_the_roots_of_its_determinant(
    angle: float, wavelength: float
) -> None:
    plate = general_plate()
    assert np.abs(plate.B).min() > 1e-3 * np.abs(plate.B).max()
    k = 2.0 * np.pi / (wavelength * plate.thickness)
    actual = dispersion(Medium(plate), angle, [wavelength])
    expected = velocities(entries(plate, angle, k))
    np.testing.assert_allclose(np.sort(actual.phase_velocity[0]), expected, rtol=1e-8)
    np.testing.assert_allclose(actual.angular_frequency, k * actual.phase_velocity, rtol=1e-14)


@pytest.mark.parametrize("angles", [(0.0, 30.0, 70.0), (10.0, 80.0, 80.0), (40.0, 40.0, -50.0)])
@pytest.mark.few(1)  # of 3, 0.4 s each
def test_fronts_of_an_unsymmetric_laminate_are_the_roots_of_its_determinant(
    angles: tuple[float, float, float],
) -> None:
    plate = laminate(GENERAL_PLY, angles, (0.1, 0.05, 0.15))
    normals = np.arange(0.0, 361.0, 15.0)
    velocity = WaveSurfaces(Medium(plate)).fronts(normals).velocity
    for normal, row in zip(normals, velocity, strict=True):
        expected = velocities(entries(plate, float(normal), None))
        np.testing.assert_allclose(np.sort(row), expected, rtol=1e-7)


def test_the_shortest_waves_move_as_the_fronts(general: WaveSurfaces) -> None:
    for angle in (0.0, 33.0, 120.0):
        waves = dispersion(general.medium, angle, [1e-6]).phase_velocity
        fronts = general.fronts(angle).velocity
        np.testing.assert_allclose(np.sort(waves), np.sort(fronts), rtol=1e-10)


def test_the_longest_flexural_wave_bends_the_plate_without_shear_or_membrane_force() -> None:
    plate = general_plate()
    for angle in (0.0, 33.0, 120.0):
        x, y = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        strain = np.array([[x, 0.0], [0.0, y], [y, x]])
        curvature = np.array([x * x, y * y, 2.0 * x * y])
        coupling = strain.T @ plate.B @ curvature
        relief = np.linalg.solve(strain.T @ plate.A @ strain, coupling)
        rigidity = curvature @ plate.D @ curvature - coupling @ relief
        ratio = np.array([1e6, 1e7, 1e8])
        k = 2.0 * np.pi / (ratio * plate.thickness)
        actual = dispersion(Medium(plate), angle, ratio).phase_velocity[:, 0]
        np.testing.assert_allclose(actual, k * np.sqrt(rigidity / plate.mass), rtol=1e-9)


# Invariances ------------------------------------------------------------------------------------


def seen_from(plate: LaminateSection, shift: float) -> Medium:
    """The same plate with its displacements taken at the distance `shift` from the midplane."""
    moved = replace(
        plate,
        B=plate.B + shift * plate.A,
        D=plate.D + 2.0 * shift * plate.B + shift**2 * plate.A,
        rotary_inertia=plate.rotary_inertia + shift**2 * plate.mass,
        coupling_inertia=shift * plate.mass,
    )
    return Medium(moved)


def test_waves_do_not_depend_on_the_plane_that_they_are_described_in() -> None:
    plate = general_plate()
    there, here = seen_from(plate, 0.3 * plate.thickness), Medium(plate)
    assert there.laminate.coupling_inertia > 0.0
    for angle in (0.0, 50.0):
        a, b = (dispersion(medium, angle, [0.2, 2.0, 20.0, 1e4]) for medium in (there, here))
        np.testing.assert_allclose(np.sort(a.phase_velocity), np.sort(b.phase_velocity), rtol=1e-10)
    a_fronts, b_fronts = (WaveSurfaces(m).fronts([0.0, 50.0, 130.0]) for m in (there, here))
    order = np.argsort(a_fronts.velocity), np.argsort(b_fronts.velocity)
    for name in ("velocity", "slope", "curvature"):
        ours = np.take_along_axis(getattr(a_fronts, name), order[0], axis=1)
        theirs = np.take_along_axis(getattr(b_fronts, name), order[1], axis=1)
        np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-8)


def test_waves_turn_with_the_laminate(general: WaveSurfaces) -> None:
    turned = Medium(general_plate(turned=25.0))
    a = dispersion(turned, 65.0, [1.0, 10.0]).phase_velocity
    b = dispersion(general.medium, 40.0, [1.0, 10.0]).phase_velocity
    np.testing.assert_allclose(a, b, rtol=1e-11)
    normals = np.array([0.0, 40.0, 200.0])
    fronts = WaveSurfaces(turned).fronts(normals + 25.0)
    np.testing.assert_allclose(fronts.velocity, general.fronts(normals).velocity, rtol=1e-11)
    np.testing.assert_allclose(fronts.slope, general.fronts(normals).slope, rtol=1e-9)


def test_a_ply_at_45_sends_its_rays_towards_its_fibres() -> None:
    for fibre in (45.0, -45.0):
        surfaces = WaveSurfaces(Medium(laminate(REPORT_PLY, [fibre], [0.1])))
        extension = surfaces.fronts(0.0).ray_angle[0, 0]
        assert 30.0 < extension * np.sign(fibre) < 45.0


# Fronts, rays and cusps -------------------------------------------------------------------------


def test_an_isotropic_plate_has_round_fronts_without_cusps() -> None:
    medium = Medium(isotropic_plate(0.2))  # E = 1, density 1
    surfaces = WaveSurfaces(medium)
    fronts = surfaces.fronts([0.0, 10.0, 77.0, 300.0])
    plate, shear = (1.0 - NU**2) ** -0.5, (2.0 + 2.0 * NU) ** -0.5
    expected = [plate, shear, plate, shear, shear]
    np.testing.assert_allclose(fronts.velocity, np.tile(expected, (4, 1)), rtol=1e-12)
    np.testing.assert_allclose(fronts.slope, 0.0, atol=1e-12)
    np.testing.assert_allclose(fronts.curvature, 0.0, atol=1e-11)
    assert surfaces.cusps(5.0, 0.2) == []
    assert surfaces.misnamed() == {}


def test_derivatives_are_those_of_the_velocities(general: WaveSurfaces) -> None:
    normals, step = np.arange(0.25, 360.0, 7.0), 2e-4
    before, here, after = (general.fronts(normals + d) for d in (-step, 0.0, step))
    width = 2.0 * np.deg2rad(step)
    size = here.velocity
    slope = (after.velocity - before.velocity) / width
    curvature = (after.slope - before.slope) / width
    np.testing.assert_allclose(here.slope / size, slope / size, atol=1e-6)
    np.testing.assert_allclose(here.curvature / size, curvature / size, rtol=1e-5, atol=1e-5)


def test_where_sheets_cross_or_touch_the_names_stay_on_smooth_curves() -> None:
    cross_ply = laminate(REPORT_PLY, [0.0, 90.0], [0.05, 0.05])
    one_ply = laminate(REPORT_PLY, [0.0], [0.1])
    plates = (cross_ply, 0.1), (one_ply, 0.1), (report_plate(), 0.1), (general_plate(), 0.02)
    for plate, degrees in plates:
        fronts = WaveSurfaces(Medium(plate)).fronts(np.arange(0.0, 180.01, degrees))
        step = np.deg2rad(degrees)
        expected = fronts.velocity[:-1] + step * (fronts.slope[:-1] + fronts.slope[1:]) / 2.0
        # Where two of the general plate's fronts pass one another closely they bend sharply.
        np.testing.assert_allclose(fronts.velocity[1:], expected, rtol=1e-4)


def test_fronts_that_pass_one_another_closely_are_not_taken_to_cross() -> None:
    ply = Ply(
        density=1e-4,
        nu12=0.3,
        e1=50184626.6,
        e2=1775970.6,
        g12=589298.9,
        g13=1182032.1,
        g23=187260.5,
    )
    surfaces = WaveSurfaces(Medium(laminate(ply, [0.0, 17.3, 45.0], [0.005] * 3)))
    normals = np.arange(0.0, 180.0, 0.5)
    one, other = surfaces.fronts(normals), surfaces.fronts(normals + 180.0)
    np.testing.assert_allclose(one.velocity, other.velocity, rtol=1e-9)
    coupled = np.sort(surfaces.fronts(np.arange(99.0, 99.4, 0.002)).velocity[:, :4], axis=1)
    assert 0.0 < np.diff(coupled, axis=1).min() < 2e-3 * coupled.max()


def test_extension_and_bending_cross_and_keep_their_names(report: WaveSurfaces) -> None:
    fronts = report.fronts([0.0, 135.0])
    extension, bending = fronts.velocity[:, 0], fronts.velocity[:, 2]
    assert extension[0] < bending[0]
    assert extension[1] > bending[1]
    np.testing.assert_allclose(fronts.share[:, 0, :2].sum(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(fronts.share[:, 2, 2:4].sum(axis=1), 1.0, rtol=1e-12)
    assert report.misnamed() == {}


def test_a_fronts_name_tells_where_it_moves_in_another_way() -> None:
    runs = WaveSurfaces(Medium(laminate(REPORT_PLY, [0.0], [0.1]))).misnamed()
    first, last = runs["extension"][0]
    # Where the faster wave's displacement is 45 degrees from its normal, from Q of one ply.
    q11, q22, q12, q66 = 1.760411577041e7, 1.156841893484e6, 3.470525680453e5, 8e5

    def excess(normal: float) -> float:
        x, y = np.cos(np.deg2rad(normal)), np.sin(np.deg2rad(normal))
        off = (q12 + q66) * x * y
        _, modes = np.linalg.eigh(
            [[q11 * x * x + q66 * y * y, off], [off, q66 * x * x + q22 * y * y]]
        )
        return float((modes[:, 1] @ [x, y]) ** 2) - 0.5

    assert excess(first - 0.1) > 0.0 > excess(first)
    assert excess(last) < 0.0 < excess(last + 0.1)


def turns(path: Floats) -> Floats:
    """Cosine of the angle between one piece of a path and the next."""
    pieces = np.diff(path, axis=0)
    lengths = np.linalg.norm(pieces, axis=1)
    actual: Floats = (pieces[1:] * pieces[:-1]).sum(axis=1) / (lengths[1:] * lengths[:-1])
    return actual


@pytest.mark.parametrize(("time", "radius"), [(2e-6, 0.106), (1e-5, 0.106), (3e-6, 0.0)])
@pytest.mark.few(1)  # of 3, 0.1 s each
def test_fronts_turn_back_at_their_cusps_and_nowhere_else(
    report: WaveSurfaces, time: float, radius: float
) -> None:
    cusps = report.cusps(time, radius)
    # Once around, from a normal of 30 degrees on, where the report's plate has no cusps.
    normals = 30.0 + np.arange(-1, 3602) / 10.0 + 0.037
    paths = report.fronts(normals).positions(time, radius)
    for place, mode in enumerate(FRONTS):
        ones = [cusp for cusp in cusps if cusp.mode == mode]
        assert len(ones) == (4 if mode in ("in_plane_shear", "twisting") else 0)
        back = normals[1:-1][turns(paths[:, place]) < 0.0] % 360.0
        np.testing.assert_allclose(sorted(back), [cusp.normal for cusp in ones], atol=0.1)
        for cusp in ones:
            x, y = report.fronts(cusp.normal).positions(time, radius)[0, place]
            assert (cusp.x, cusp.y) == pytest.approx((x, y), rel=1e-12)


def test_cusps_of_a_circle_come_only_after_a_while(report: WaveSurfaces) -> None:
    around = report.fronts(np.arange(0.0, 180.0, 0.1))
    fastest = -(around.velocity + around.curvature).min(axis=0)
    first = 0.106 / fastest[FRONTS.index("in_plane_shear")]
    for time, there in ((0.999 * first, False), (1.001 * first, True)):
        values = [cusp.mode for cusp in report.cusps(time, 0.106)]
        assert ("in_plane_shear" in values) == there


# Wrong input ------------------------------------------------------------------------------------


def test_a_laminate_that_can_carry_no_waves_is_refused() -> None:
    plate = report_plate()
    with pytest.raises(ValueError, match="stiffness is not positive definite"):
        Medium(replace(plate, D=-plate.D))
    with pytest.raises(ValueError, match="stiffness is not positive definite"):
        Medium(replace(plate, shear=np.zeros((2, 2))))
    with pytest.raises(ValueError, match="inertia is not positive definite"):
        Medium(replace(plate, coupling_inertia=2.0 * plate.mass * plate.thickness))
    with pytest.raises(ValueError, match="between 1e-9 and 1e9"):
        dispersion(Medium(plate), 0.0, [0.0])


def test_a_decks_own_shear_correction_counts(tmp_path: Path) -> None:
    deck = tmp_path / "corrected.inp"
    deck.write_text(small(data="SHEA\n0.8\n" + DATA_CARDS))
    answer = call("waves", "speeds", str(deck), "--step", "45")
    deck.write_text(small())
    given = ["waves", "speeds", str(deck), "--step", "45", "--shear-factor", "0.8"]
    assert answer.exit_code == 0
    assert answer.stdout == call(*given).stdout
