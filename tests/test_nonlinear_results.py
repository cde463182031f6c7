"""What a run of a nonlinear plate stores and says: strains, gages, plies, energies and notes."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.deck import model
from fecm.deck.grid import ElementGrid, uniform_section
from fecm.judge.end import End
from fecm.judge.limits import HELD_DEFLECTION
from fecm.judge.validity import Extent, Judge
from fecm.mechanics import kernels
from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.elements import gauss
from fecm.mechanics.membrane import quadratic_strains_at
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.ply_stresses import PlyStresses
from fecm.mechanics.points import gages
from fecm.mechanics.strains import strains_and_resultants
from fecm.mechanics.stretching import Stretching
from fecm.plot.pictures import draw
from fecm.problem.loading import load_deck
from fecm.results.sinks import MemorySink
from fecm.results.summary import run_summary
from fecm.simulation import notes as run_notes
from fecm.simulation.run import simulate
from fecm.simulation.simulation import Simulation
from fecm.verification import decks
from tests.builders import (
    GENERAL_ANGLES,
    GENERAL_LAYERS,
    GENERAL_PLY,
    SKEWED,
    Floats,
    Ints,
    distorted_square,
    general_plate,
    nothing,
    one_element,
    square,
    table,
    turned_stiffness,
    with_restraints,
)

pytestmark = pytest.mark.filterwarnings("ignore::fecm.FecmWarning")

RULES = IntegrationRules(gauss(3), gauss(3), gauss(3), assumes_shear=True)
NONL = model.Nonlinear()


# Fields ------------------------------------------------------------------------------------------

STRAIN, CURVATURE, SLOPE = (0.01, -0.02, 0.015), (0.3, -0.2, 0.4), (0.2, -0.1)
SQUARES = np.array([SLOPE[0] ** 2 / 2.0, SLOPE[1] ** 2 / 2.0, SLOPE[0] * SLOPE[1]])
STRETCHED = STRAIN + SQUARES


def general(mesh: tuple[Floats, Ints], **changed: Any) -> PlateModel:
    """A nonlinear plate of a laminate whose A, B and D have no zero."""
    restrained = with_restraints(*mesh, nothing(mesh[0]))
    return PlateModel(restrained, general_plate(), RULES, nonlinear=True, **changed)


def inclined(plate: PlateModel) -> Floats:
    """A field of constant strain, curvature and slope, (numnp, 5)."""
    x, y = plate.mesh.coordinates.T
    field = decks.constant_strains(x, y, CURVATURE, strain=STRAIN)
    field[:, 2] = SLOPE[0] * x + SLOPE[1] * y
    return field


def tensor(values: Sequence[float] | Floats) -> Floats:
    """Matrix of xx, yy, xy."""
    xx, yy, xy = values
    return np.array([[xx, xy], [xy, yy]])


def principal(values: Sequence[float] | Floats) -> Floats:
    """Principal values of xx, yy, xy, ascending."""
    return np.asarray(np.linalg.eigvalsh(tensor(values)))


def test_resultants_are_those_of_the_strains_with_the_slopes() -> None:
    plate = general(distorted_square(2, 2))
    points = plate.strain_field(gauss(2))
    field = inclined(plate)
    quadratic = quadratic_strains_at(points, field)
    actual = strains_and_resultants(points, plate.rows_by_laminate, field, plate.preload, quadratic)
    A, B, D = plate.laminate.A, plate.laminate.B, plate.laminate.D
    N, M = A @ STRETCHED + B @ CURVATURE, B @ STRETCHED + D @ CURVATURE
    names = ["eps_xx", "eps_yy", "gamma_xy", "N_x", "N_y", "N_xy", "M_x", "M_y", "M_xy"]
    for name, value in zip(names, [*STRETCHED, *N, *M], strict=True):
        np.testing.assert_allclose(actual[name], value, rtol=1e-10, err_msg=name)


def test_stresses_of_plies_are_those_of_the_strains_with_the_slopes() -> None:
    plate = general(distorted_square(2, 2))
    stresses = PlyStresses(plate.mesh, plate.laminate, gauss(2), nonlinear=True)
    actual = stresses.evaluate(inclined(plate))
    faces = np.cumsum([0.0, *GENERAL_LAYERS]) - sum(GENERAL_LAYERS) / 2.0
    for ply, angle in enumerate(GENERAL_ANGLES):
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        turn = np.array([[c, s], [-s, c]])
        for face in (0, 1):
            strain = STRETCHED + faces[ply + face] * np.array(CURVATURE)
            stress = turn @ tensor(turned_stiffness(GENERAL_PLY, angle) @ strain) @ turn.T
            for name, at in (("sigma_1", (0, 0)), ("sigma_2", (1, 1)), ("tau_12", (0, 1))):
                np.testing.assert_allclose(actual[name][:, :, ply, face], stress[at], rtol=1e-10)


def test_interlaminar_stresses_follow_from_the_derivatives_of_the_squares() -> None:
    plate = general(one_element(SKEWED))
    x, y = plate.mesh.coordinates.T
    field = np.zeros((9, 5))
    field[:, 0] = 0.7 * x * y
    field[:, 2] = 0.3 * x + 0.1 * y + 0.2 * x**2 - 0.4 * x * y + 0.5 * y**2
    stresses = PlyStresses(plate.mesh, plate.laminate, gauss(2), nonlinear=True)
    _, (actual,) = stresses.strains(field)
    x, y = x[8], y[8]
    w_x, w_y = 0.3 + 0.4 * x - 0.4 * y, 0.1 - 0.4 * x + y
    w_xx, w_yy, w_xy = 0.4, 1.0, -0.4
    # eps_xx = 0.7 y + w_x^2/2, eps_yy = w_y^2/2, gamma_xy = 0.7 x + w_x w_y
    by_x = [w_x * w_xx, w_y * w_xy, 0.7 + w_xx * w_y + w_x * w_xy]
    by_y = [0.7 + w_x * w_xy, w_y * w_yy, w_xy * w_y + w_x * w_yy]
    np.testing.assert_allclose(actual[:, :3], [by_x, by_y], atol=1e-12)


@pytest.mark.parametrize("preload", [(0.0, 0.0, 0.0), (3.0, -1.0, 0.5)])
def test_energies_and_largest_values_are_those_of_a_constant_field(
    preload: tuple[float, float, float],
) -> None:
    plate = general(square(2, 3), preload=preload)
    A, B, D, S = (getattr(plate.laminate, name) for name in ("A", "B", "D", "shear"))
    actual = Stretching(plate, load=(0.5, 0.3)).evaluate(inclined(plate)[None])
    curvature, slope = np.array(CURVATURE), np.array(SLOPE)
    n = A @ STRETCHED + B @ curvature
    assert actual.energy == pytest.approx(0.5 * n @ np.linalg.solve(A, n), rel=1e-10)
    # gamma = grad w - theta, which is linear: exact by four points.
    t = np.array([0.5 - 12**-0.5, 0.5 + 12**-0.5])
    gammas = [slope + tensor(curvature * [1, 1, 0.5]) @ (x, y) for x in t for y in t]
    shear = np.mean([0.5 * gamma @ S @ gamma for gamma in gammas])
    elastic = 0.5 * (STRETCHED @ n + curvature @ (B @ STRETCHED + D @ curvature)) + shear
    of_preload = 0.5 * slope @ tensor(preload) @ slope
    assert actual.preload_energy == pytest.approx(of_preload, rel=1e-10)
    assert actual.strain_energy == pytest.approx(elastic + of_preload, rel=1e-10)
    assert actual.largest_slope == pytest.approx(np.hypot(*SLOPE), rel=1e-10)
    N, M = preload + n, B @ STRETCHED + D @ curvature
    assert actual.largest_force == pytest.approx(principal(N)[1], rel=1e-10)
    assert actual.force_at_load == pytest.approx(np.abs(principal(N)).max(), rel=1e-10)
    assert actual.moment_at_load == pytest.approx(np.abs(principal(M)).max(), rel=1e-10)
    half = sum(GENERAL_LAYERS) / 2.0
    middle = STRETCHED + np.linalg.solve(A, preload)
    faces = [(middle + z * curvature) * [1.0, 1.0, 0.5] for z in (-half, half)]
    largest = max(np.abs(principal(face)).max() for face in faces)
    assert actual.largest_strain == pytest.approx(largest, rel=1e-10)


def test_strains_under_the_load_do_not_count() -> None:
    plate = general(square(2, 2))
    x = plate.mesh.coordinates[:, 0]
    field = np.zeros((len(x), 5))
    field[:, 0] = 0.01 * x**2  # eps_xx = 0.02 x
    right = Stretching(plate, lambda x, y: x > 0.5).evaluate(field[None])
    assert 0.02 * 0.4 < right.largest_strain < 0.02 * 0.5
    assert Stretching(plate).evaluate(field[None]).largest_strain > 0.02 * 0.9


@pytest.mark.parametrize("place", [(0.3, 0.4), (0.5, 0.5)])  # within an element, and on a node
def test_a_gage_reads_the_linear_strain_and_half_the_square_of_the_slope(
    place: tuple[float, float],
) -> None:
    plate = general(square(2, 2))
    x, y = plate.mesh.coordinates.T
    field = np.stack(
        [0.1 * x * y, 0.2 * x**2, 0.3 * x**2 - 0.2 * x * y + y, 0.4 * x * y, 0.5 * y], axis=1
    )
    (x, y), z, direction = place, 0.05, 30.0
    gage_cards = gages(plate.mesh, [model.Gage(1, x, y, z, direction)], nonlinear=True)
    sums = (field.ravel()[gage_cards.dof_indices] * gage_cards.weights).sum(axis=1)
    s = np.array([np.cos(np.deg2rad(direction)), np.sin(np.deg2rad(direction))])
    in_plane = np.array([[0.1 * y, 0.1 * x], [0.4 * x, 0.0]])
    rotations = np.array([[0.4 * y, 0.4 * x], [0.0, 0.5]])
    slope = s @ [0.6 * x - 0.2 * y, -0.2 * x + 1.0]
    right = s @ (in_plane - z * rotations) @ s + slope**2 / 2.0
    assert slope**2 > 0.3
    np.testing.assert_allclose(gage_cards.strains(sums), right, rtol=1e-12)


# Runs --------------------------------------------------------------------------------------------

# Quarters with lines of symmetry x = 0 and y = 0.
EDGES = {
    "iso_100x100x2_clamped_immovable": "00000 10010 01001 11111 11111",
    "iso_100x100x2_ss_immovable": "00000 10010 01001 11101 11110",
}
NEWTON = "LOOP=20 TANG FORM SOLV CONV NEXT DISP STRE"
SCALE = 100.0  # side in the file; the quarter plates have a side of 1


@functools.cache
def static(case: str, deflection: str) -> tuple[dict[str, str], Result]:
    """Row of an independent Ritz solution, and the same plate by 16 x 16 elements.

    tests/data/rect_static.csv: Legendre-Ritz with Newton's method, first-order shear deformation
    and von Karman strains; units are N and mm.
    """
    (row,) = (
        row
        for row in table("rect_static.csv")
        if (row["case"], row["load"], row["control_over_h"]) == (case, "uniform", deflection)
    )
    ply = decks.isotropic(70000.0, 0.3, 2.7e-9, 5.0 / 6.0)
    plate = decks.material(ply, (0.0,), 2.0 / SCALE)
    load, macros = float(row["load_value"]), decks.program(NEWTON)
    quarter = decks.quarter_plate(8, plate, macros, load, EDGES[case], (decks.MITC, NONL))
    return row, decks.run_of_deck(quarter)


@pytest.mark.parametrize(
    ("case", "deflection"),
    [("iso_100x100x2_clamped_immovable", "1.0"), ("iso_100x100x2_ss_immovable", "2.0")],
)
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_resultants_and_energy_are_those_of_an_independent_solution(
    case: str, deflection: str
) -> None:
    row, actual = static(case, deflection)
    assert actual.tape3.w[0, 0] * SCALE == pytest.approx(float(row["w_centre_mm"]), rel=1e-4)
    # Node 1 of element 1 is the centre; strains are less accurate there than within elements.
    N, M = actual.stresses.N_x[0, 0, 0] * SCALE, actual.stresses.M_x[0, 0, 0] * SCALE**2
    assert float(row["N_x_centre"]) == pytest.approx(N, rel=3e-3)
    assert float(row["M_x_centre"]) == pytest.approx(M, rel=6e-3)
    energy = 4.0 * actual.membrane.strain_energy[0] * SCALE**3
    assert float(row["strain_energy_mJ"]) == pytest.approx(energy, rel=1e-4)


def test_the_summary_of_statics_has_the_share_of_the_membrane() -> None:
    _, actual = static("iso_100x100x2_ss_immovable", "2.0")
    share = actual.membrane.energy[0] / actual.membrane.strain_energy[0]
    assert 0.7 < share < 0.8
    line = f"membrane          {100.0 * share:.0f} % of the strain energy where it is largest"
    assert line in run_summary(actual)


GAGES = model.Gages((model.Gage(1, 30.0, 40.0, 1.0, 20.0), model.Gage(2, 50.0, 50.0, -1.0, 0.0)))
STRENGTHS = model.Allowables(2500.0, 1500.0, 60.0, 200.0, 90.0, 90.0, 60.0)
HELD, SLIDING = "00000 11101 11110 11101 11110", "00000 00101 00110 00101 00110"


def struck(
    *segments: model.Segment,
    steps: int = 60,
    velocity: float = 9000.0,
    every: int = 5,
    dt: float = 0.0,
    more: str = "",
    thickness: float = 2.0,
) -> model.Deck:
    """Build a square plate (mm, N, s) of 4 x 4 elements, which a mass hits."""
    grid = ElementGrid(uniform_section(100.0, 4), uniform_section(100.0, 4))
    ply = model.Ply(1.53e-9, 0.3, 141e3, 9700.0, 5500.0, 5500.0, 3700.0)
    plate = decks.material(ply, (0.0, 90.0, 90.0, 0.0), thickness / 4.0)
    middle = grid.nearest(50.0, 50.0)[0]
    hit = (model.Projectile(0, 0, 1e-3), model.Impact(middle, 3, velocity), decks.elastic(5e4))
    loop = f"TIME RODP={every} DISP={every} {more}"
    macros = decks.program(f"LMAS DT={dt} LOOP={steps} {loop} NEXT")
    held, patch = decks.restraints(grid, HELD), model.Patch("HERT", 8.0)
    return decks.deck(grid, (held, patch, *hit, plate, decks.MITC, *segments), macros)


@functools.cache
def stretched() -> Result:
    """A run with gages, plies and exposures, far beyond the linear plate."""
    return fecm.run_one(struck(NONL, GAGES, STRENGTHS, steps=400, every=20, more="PLYS=20 FAIL=20"))


def test_the_stored_strain_energy_is_that_of_the_internal_forces() -> None:
    stretched_plate = stretched()
    rows = np.searchsorted(stretched_plate.energy.step, stretched_plate.membrane.step)
    assert stretched_plate.membrane.step.tolist() == stretched_plate.tape8.step.tolist()
    np.testing.assert_allclose(
        stretched_plate.membrane.strain_energy, stretched_plate.energy.plate_strain[rows], 1e-9
    )


def test_only_nonlinear_plates_say_so_and_store_their_membrane() -> None:
    assert stretched().kinematics == stretched().attributes["kinematics"] == "von Karman"
    linear = fecm.run_one(struck(steps=5))
    assert linear.kinematics == "linear"
    assert "kinematics" not in linear.attributes
    assert not any(path.startswith("membrane") for path in linear)


def test_exposures_are_those_of_the_stored_stresses() -> None:
    stretched_plate = stretched()
    sigma_1, sigma_2, tau = (
        stretched_plate.plies.sigma_1,
        stretched_plate.plies.sigma_2,
        np.abs(stretched_plate.plies.tau_12),
    )
    s = STRENGTHS
    ratios = [sigma_1 / s.xt, -sigma_1 / s.xc, sigma_2 / s.yt, -sigma_2 / s.yc, tau / s.s12]
    right = np.max(ratios, axis=(0, 1))
    np.testing.assert_allclose(
        stretched_plate.failure.max_stress.exposure, right, rtol=1e-9, atol=1e-12
    )
    # In bending alone the stresses of both faces of the plate are opposite.
    faces = stretched_plate.plies.sigma_1[..., [0, 3], [0, 1]].sum(axis=-1)
    assert faces.max() > 0.1 * sigma_1.max()


def test_gages_of_a_run_read_what_the_stored_displacements_say() -> None:
    stretched_plate = stretched()
    (problem,) = load_deck(struck(NONL, GAGES)).problems
    gage_cards = gages(problem.mesh, GAGES.records, nonlinear=True)
    rows = np.searchsorted(stretched_plate.gages.step, stretched_plate.tape3.step)
    fields = stretched_plate.tape3.displacement.reshape(len(rows), -1)
    strains = gage_cards.strains(
        (fields[:, gage_cards.dof_indices] * gage_cards.weights).sum(axis=2)
    )
    np.testing.assert_allclose(stretched_plate.gages.strain[rows], strains, rtol=1e-9, atol=1e-13)
    linear = gages(problem.mesh, GAGES.records)
    without = linear.strains((fields[:, linear.dof_indices] * linear.weights).sum(axis=2))
    assert (strains - without)[-1, 0] > 0.1 * strains[-1, 0]


@pytest.mark.skipif(kernels.LIBRARY is None, reason="needs the compiled kernels")
def test_kernels_store_what_numpy_does() -> None:
    deck = struck(NONL, GAGES, STRENGTHS, more="PLYS=5 FAIL=5")
    one, other = (fecm.run_one(deck, solver=solver) for solver in ("kernels", "numpy"))
    for path in one:
        if path in ("exposures/x", "exposures/y"):
            continue  # exposures of places that are mirror images differ by rounding
        values = one[path]
        # The error of the balance is a difference of energies, and has their rounding errors.
        scale = one.energy.attributes["initial"] if "balance" in path else np.abs(values).max()
        np.testing.assert_allclose(other[path], values, rtol=1e-9, atol=1e-11 * scale, err_msg=path)


def test_a_preloaded_plate_stores_the_energy_of_its_preload() -> None:
    result = fecm.run_one(struck(NONL, model.Preload(20.0, 10.0), steps=60))
    rows = np.searchsorted(result.energy.step, result.membrane.step)
    assert result.membrane.preload_energy[-1] > 0.0
    np.testing.assert_allclose(
        result.membrane.strain_energy, result.energy.plate_strain[rows], 1e-9
    )
    assert "membrane/preload_energy" not in stretched()


def test_the_membrane_force_of_a_preloaded_plate_contains_the_preload() -> None:
    # At the Gauss points both are stored at the same places.
    deck = struck(NONL, model.Preload(20.0, 10.0, 5.0), every=60, more="STRE=60")
    plate = deck.require(model.Material)
    gauss_points = replace(plate, integration=replace(plate.integration, points=3))
    segments = tuple(gauss_points if one is plate else one for one in deck.segments)
    result = fecm.run_one(replace(deck, segments=segments))
    N = np.stack([result[f"stresses/{name}"][0] for name in ("N_x", "N_y", "N_xy")], axis=-1)
    largest = max(principal(force)[1] for force in N.reshape(-1, 3))
    assert result.membrane.largest_force[0] == pytest.approx(largest, rel=1e-9)
    # Far from the load the plate is still at rest.
    np.testing.assert_allclose(N[0, 0], (20.0, 10.0, 5.0), atol=3.0)


# What is said ------------------------------------------------------------------------------------


def test_the_summary_has_the_share_of_the_membrane_at_the_peak() -> None:
    stretched_plate = stretched()
    (line,) = (line for line in run_summary(stretched_plate) if line.startswith("membrane"))
    peak = stretched_plate.time[stretched_plate.force.argmax()]
    row = np.abs(stretched_plate.membrane.time - peak).argmin()
    share = (
        100.0 * stretched_plate.membrane.energy[row] / stretched_plate.membrane.strain_energy[row]
    )
    assert line.startswith(f"membrane          {share:.{int(share < 9.5)}f} % of the strain energy")
    assert line.endswith("at the peak")
    rare = fecm.run_one(struck(NONL, steps=60, every=50))
    (line,) = (line for line in run_summary(rare) if line.startswith("membrane"))
    assert line.endswith(f"at time {rare.membrane.time[0]:.6g}, the row nearest to the peak")
    assert not [line for line in run_summary(fecm.run_one(struck(steps=5))) if "membrane" in line]


def test_a_deflection_is_a_doubt_of_linear_plates_alone() -> None:
    linear = fecm.run_one(struck(steps=250, every=50))
    (note,) = (note for note in linear.notes if "deflection" in note)
    assert "NONL" in note
    assert "fecm new --nonlinear" in note
    assert "w > 0.3 h" in linear.validity
    nonlinear = fecm.run_one(struck(NONL, steps=250, every=50))
    assert nonlinear.plate_w.max() > 0.5 * 2.0  # h/2
    assert not [note for note in nonlinear.notes if "deflection" in note or "NONL" in note]
    assert "w >" not in nonlinear.validity


def test_a_nonlinear_case_is_not_beyond_the_linear_plate() -> None:
    extent = Extent(np.array([End.OVER]), {HELD_DEFLECTION: np.array([20.0])})
    assert Judge(2.0, nonlinear=True).validity(extent).tolist() == ["ok"]
    assert Judge(2.0).validity(extent).tolist() == ["w > 0.3 h"]


def test_a_steep_slope_is_a_doubt_with_its_error() -> None:
    result = fecm.run_one(struck(NONL, velocity=150000.0, steps=150, every=10, thickness=1.0))
    slope = result.membrane.largest_slope.max()
    assert slope > 0.25
    (note,) = (note for note in result.notes if "slope" in note)
    assert f"the slope reaches {slope:.3g} at time" in note
    assert f"{slope**2 / 2.0:.1%}" in note
    assert "slope > 0.25" in result.validity
    assert stretched().membrane.largest_slope.max() < 0.25
    assert not [note for note in stretched().notes if "slope" in note]


@functools.cache
def finished(dt: float = 0.0) -> tuple[Simulation, MemorySink]:
    """A finished run with a threshold of delamination."""
    (problem,) = load_deck(struck(NONL, model.Delamination(0.8), dt=dt)).problems
    sink = MemorySink()
    return simulate(problem, sink), sink


def changed(sink: MemorySink, **constants: float) -> Result:
    """The result of a run of which columns of the membrane are constants."""
    rows = np.ones_like(sink.arrays["membrane/time"])
    by_name = {f"membrane/{name}": rows * value for name, value in constants.items()}
    return Result({**sink.arrays, **by_name}, {}, {})


def doubts(dt: float = 0.0, **constants: float) -> list[str]:
    """Notes about the membrane of such a run."""
    simulation, sink = finished(dt)
    return list(run_notes.doubts(simulation, changed(sink, **constants)))


def test_strains_of_the_membrane_count_among_the_strains() -> None:
    simulation, sink = finished()
    assert run_notes.largest_strain(simulation, changed(sink, largest_strain=0.0)).value < 0.04
    assert run_notes.largest_strain(simulation, changed(sink, largest_strain=0.04)).value == 0.04


def test_a_membrane_force_that_brings_the_frequency_near_to_the_limit_is_noted() -> None:
    (problem,) = load_deck(struck(NONL)).problems
    critical = problem.critical_time_step
    wave = (2.0 * np.pi / 25.0) ** 2 / (1.53e-9 * 2.0)
    # (2/critical)^2 + N wave = (0.95 * 2/DT)^2
    for fraction in (0.8, 0.9):
        dt = fraction * critical
        limit = ((0.95 * 2.0 / dt) ** 2 - (2.0 / critical) ** 2) / wave
        assert doubts(dt, largest_force=0.99 * limit) == []
        (note,) = doubts(dt, largest_force=1.01 * limit)
        assert f"from {fraction:.1%} of 2/DT to 95." in note
    # A step as near as that to the linear limit is a choice, up to 2/DT itself.
    dt = 0.97 * critical
    limit = ((2.0 / dt) ** 2 - (2.0 / critical) ** 2) / wave
    assert doubts(dt, largest_force=0.99 * limit) == []
    assert len(doubts(dt, largest_force=1.01 * limit)) == 1


def test_a_stretched_plate_under_the_load_is_a_doubt_of_the_threshold() -> None:
    bending = 6.0 * 100.0 / 2.0
    assert doubts(force_at_load=0.19 * bending, moment_at_load=100.0) == []
    (note,) = doubts(force_at_load=0.21 * bending, moment_at_load=100.0)
    assert "63, 21% of 6 M/h" in note
    assert "DELA" in note


def test_the_picture_of_energies_has_the_membrane_at_its_rows(tmp_path: Path) -> None:
    ax = stretched().plot("energy")
    last = ax.lines[-1]
    np.testing.assert_array_equal(last.get_ydata(), stretched().membrane.energy)
    assert last.get_color() not in [line.get_color() for line in ax.lines[:-1]]
    picture = draw("energy", {"a": stretched(), "b": fecm.run_one(struck(steps=5))})
    assert len(picture.figure.axes[0].lines) == 10


def test_a_result_without_rows_of_the_membrane_has_no_line_about_it() -> None:
    arrays = {path: stretched()[path] for path in stretched()}
    groups = {
        name: stretched().attributes_of(name) for name in ("", "history", "energy", "failure")
    }
    for name in ("time", "strain_energy"):
        lacking = {path: v for path, v in arrays.items() if path != f"membrane/{name}"}
        assert not [line for line in run_summary(Result(lacking, {}, groups)) if "membrane" in line]
    empty = arrays | {path: v[:0] for path, v in arrays.items() if path.startswith("membrane/")}
    assert not [line for line in run_summary(Result(empty, {}, groups)) if "membrane" in line]
