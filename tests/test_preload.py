"""The plate under a uniform initial membrane force: stiffness, frequencies, time step.

``preload_*.csv`` are of a simply supported cross-ply plate, 200 x 200 x 2.69 mm: Navier solutions
of first-order shear deformation theory, computed by another program.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import Deck, Ply, Result, _machine
from fecm.authoring.case import Case, check_deck
from fecm.authoring.values import apply_case
from fecm.deck.grid import ElementGrid, uniform_section
from fecm.deck.model import Impact, Material, Patch, Preload, Projectile
from fecm.mechanics import element_matrices
from fecm.mechanics.failure import largest_in_plies
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.mechanics.mesh import element_blocks
from fecm.mechanics.plate import UNLOADED, PlateModel
from fecm.mechanics.ply_stresses import uniform_stresses
from fecm.mechanics.solutions import buckling_factor, modes
from fecm.mechanics.stiffness_product import stiffness_operator
from fecm.mechanics.time_step import critical_time_step, safe_time_step
from fecm.problem.loading import load_deck
from fecm.problem.parts import strengths_of_deck
from fecm.problem.rules.time_step import clamped_frequency
from fecm.problem.summary import deck_summary
from fecm.results.summary import run_summary
from fecm.simulation.job import Solver
from fecm.studies.estimate import quick_estimate
from fecm.verification import decks
from tests import stopped_runs
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
from tests.calls import call
from tests.closed_forms import bending_and_shear, disc, stiffness
from tests.patches import MeshMaker, area_of
from tests.sound_plate import base, with_card

Force = tuple[float, float, float]

PRELOAD: Force = (3.0, -1.0, 0.7)
KINDS = (3, 4, 8, 9, 10, 11, 12)
SIDE = 200.0
PLY = Ply(density=1.58e-9, nu12=0.3, e1=120e3, e2=7900.0, g12=5500.0, g13=5500.0, g23=5500.0)
ANGLES = (0.0, 90.0, 0.0, 90.0, 0.0, 0.0, 90.0, 0.0, 90.0, 0.0)


def cross_ply() -> LaminateSection:
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


def scaled(preload: Force, factor: float) -> Force:
    """A multiple of a preload."""
    n_x, n_y, n_xy = preload
    return factor * n_x, factor * n_y, factor * n_xy


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
        product = stiffness_operator(model, solver)(u)
        np.testing.assert_allclose(product, expected, atol=1e-13 * scale)
    internal = model.internal_forces(model.field(u))[model.mesh.equations > 0]
    np.testing.assert_allclose(internal, expected, atol=1e-13 * scale)


# Frequencies and the time step -------------------------------------------------------------------


def reference_frequencies() -> dict[Force, list[tuple[int, int, float]]]:
    """Half-waves m and n and the frequency in Hz of the modes to 3 x 3, by preload."""
    actual: dict[Force, list[tuple[int, int, float]]] = {}
    for row in table("preload_frequencies.csv"):
        force = (float(row["N0x_N_per_mm"]), float(row["N0y_N_per_mm"]), 0.0)
        m, n = int(row["m"]), int(row["n"])
        if max(m, n) <= 3:
            actual.setdefault(force, []).append((m, n, float(row["frequency_Hz"])))
    return actual


@pytest.mark.parametrize("preload", reference_frequencies())
@pytest.mark.few(1)  # of 4, 0.2 s each
def test_frequencies_under_a_preload_are_naviers(preload: Force) -> None:
    plate = replace(reference_plate(16), preload=preload)
    eigenmodes = modes(plate, 24, consistent=False)
    shapes = np.array([plate.field(shape, 0.0)[:, 2] for shape in eigenmodes.shapes])
    shapes /= np.linalg.norm(shapes, axis=1)[:, None]
    x, y = np.pi * plate.mesh.coordinates.T / SIDE
    for m, n, frequency in reference_frequencies()[preload]:
        wave = np.sin(m * x) * np.sin(n * y)
        alike = np.abs(shapes @ wave) / np.linalg.norm(wave)
        assert alike.max() > 0.999
        hertz = eigenmodes.angular_frequency[alike.argmax()] / (2.0 * np.pi)
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


# Buckling ----------------------------------------------------------------------------------------

DIRECTIONS: dict[str, Force] = {
    "x": (-1.0, 0.0, 0.0),
    "y": (0.0, -1.0, 0.0),
    "biaxial": (-1.0, -1.0, 0.0),
}


@pytest.mark.parametrize("load", DIRECTIONS)
def test_the_buckling_load_is_naviers(load: str) -> None:
    expected = min(
        float(row["N_critical_N_per_mm"])
        for row in table("preload_buckling.csv")
        if row["load"] == load
    )
    plate = replace(reference_plate(16), preload=scaled(DIRECTIONS[load], expected / 2.0))
    assert buckling_factor(plate) == pytest.approx(2.0, rel=2e-4)


@pytest.mark.parametrize("n", [2, 4])  # a dense and a sparse solution
@pytest.mark.parametrize(
    "preload", [(-900.0, 1000.0, 0.0), (-20.0, 5.0, 30.0), (0.0, 0.0, -90.0), (-70.0, 0.0, 0.0)]
)
def test_at_the_buckling_load_the_lowest_eigenvalue_is_zero(n: int, preload: Force) -> None:
    plate = replace(reference_plate(n), preload=preload)
    factor = buckling_factor(plate)
    K, free = (one.stiffness.toarray() for one in (plate, replace(plate, preload=UNLOADED)))
    scale = np.sqrt(np.outer(plate.mass, plate.mass))

    def lowest(times: float) -> float:
        return float(np.linalg.eigvalsh((free + times * (K - free)) / scale)[0])

    unloaded = lowest(0.0)
    assert abs(lowest(factor)) < 1e-7 * unloaded
    # It is the first one: there is none below.
    assert all(lowest(share * factor) > 0.0 for share in (0.25, 0.5, 0.75, 0.99))


@pytest.mark.parametrize("n", [2, 8])
def test_the_buckling_factor_is_inverse_to_the_preload(n: int) -> None:
    plate = replace(reference_plate(n), preload=(-50.0, 10.0, 20.0))
    factor = buckling_factor(plate)
    for times in (0.1, 3.0, 1000.0):
        more = replace(plate, preload=scaled(plate.preload, times))
        assert buckling_factor(more) == pytest.approx(factor / times, rel=1e-7)


def test_the_buckling_factor_is_the_same_number_every_time() -> None:
    plate = replace(reference_plate(8), preload=(-50.0, 10.0, 20.0))
    assert buckling_factor(plate) == buckling_factor(replace(plate))


@pytest.mark.parametrize("preload", [UNLOADED, (10.0, 0.0, 0.0), (10.0, 5.0, 7.0), (0.0, 3.0, 0.0)])
def test_a_plate_in_tension_does_not_buckle(preload: Force) -> None:
    plate = replace(reference_plate(2), preload=preload)
    assert not plate.is_compressed
    assert buckling_factor(plate) == np.inf


@pytest.mark.parametrize("preload", [(-1e-3, 0.0, 0.0), (10.0, 5.0, 7.1), (0.0, -1.0, 0.0)])
def test_a_negative_principal_force_compresses(preload: Force) -> None:
    assert replace(reference_plate(2), preload=preload).is_compressed
    n_x, n_y, n_xy = preload
    assert np.linalg.eigvalsh([[n_x, n_xy], [n_xy, n_y]])[0] < 0.0


def test_a_compression_far_below_buckling_has_an_infinite_factor() -> None:
    plate = replace(reference_plate(8), preload=(-0.1, 0.0, 0.0))
    assert buckling_factor(plate) == np.inf


@pytest.mark.parametrize("n", [1, 8])
def test_a_plate_whose_deflection_is_held_does_not_buckle(n: int) -> None:
    coordinates, elements = square(n, n)
    held = simple_support(coordinates)
    held[:, 2] = True
    mesh = with_restraints(coordinates, elements, held)
    plate = PlateModel(mesh, cross_ply(), rules(), preload=(-1.0, 0.0, 0.0))
    assert buckling_factor(plate) == np.inf


@pytest.mark.parametrize("n", [1, 4])
def test_a_plate_that_moves_freely_has_the_buckling_factor_zero(n: int) -> None:
    coordinates, elements = square(n, n)
    mesh = with_restraints(coordinates, elements, nothing(coordinates))
    plate = PlateModel(mesh, cross_ply(), rules(), preload=(-1.0, 0.0, 0.0))
    assert buckling_factor(plate) == 0.0


def test_too_little_memory_for_the_buckling_load_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_machine, "UNNOTICED", 0)
    monkeypatch.setattr(_machine, "available_memory", lambda: 1000)
    plate = replace(reference_plate(4), preload=(-1.0, 0.0, 0.0))
    with pytest.raises(_machine.NotEnoughMemoryError, match="buckling"):
        buckling_factor(plate)


# Findings and the summary ------------------------------------------------------------------------


def preloaded(card: str) -> str:
    """The sound plate, 100 x 100 mm, under a preload in N/mm."""
    return with_card("PREL", card)(base())


def codes(text: str) -> set[str]:
    """Codes of the findings about the preload."""
    return {finding.code for finding in load_deck(text).findings} & {"E486", "E487", "W488", "W489"}


def test_findings_follow_the_ratio_to_the_buckling_load() -> None:
    # The plate of sound_plate buckles at about 602 N/mm along x.
    (problem,) = load_deck(preloaded("-300.0")).problems
    critical = 300.0 * problem.buckling_factor
    expected = {0.5: set(), 0.9: set(), 0.92: {"W488"}, 0.999: {"W488"}, 1.001: {"E487"}}
    for share, actual in expected.items():
        assert codes(preloaded(f"{-share * critical:.6g}")) == actual, share


def test_the_message_names_the_ratio_to_the_buckling_load() -> None:
    (problem,) = load_deck(preloaded("-300.0")).problems
    card = f"{-1.23 * 300.0 * problem.buckling_factor:.6g}"
    (error,) = load_deck(preloaded(card)).errors()
    assert "1.23 times the buckling load" in error.message


def test_compression_of_a_free_plate_is_an_error_and_tension_none() -> None:
    free = re.sub(r"(?m)^BOUN\n(.+\n)*", "", base())
    assert codes(with_card("PREL", "-1.0")(free)) == {"E486"}
    assert codes(with_card("PREL", "1.0")(free)) == set()


def test_a_preload_beyond_the_strength_of_a_ply_is_found() -> None:
    (finding,) = [f for f in load_deck(preloaded("2000.")).findings if f.code == "W489"]
    assert "ply 4" in finding.message
    # The 90-degree plies, by maximum stress: sigma_2/YT of Hooke's law.
    (problem,) = load_deck(preloaded("1.0")).problems
    laminate, ply = problem.laminate, problem.deck.require(Material).ply
    strain = np.linalg.solve(laminate.A, np.array([1.0, 0.0, 0.0]))
    q22 = ply.e2 / (1.0 - ply.nu12**2 * ply.e2 / ply.e1)
    sigma_2 = q22 * (strain[0] + ply.nu12 * strain[1])
    limit = 62.3 / sigma_2
    assert codes(preloaded(f"{1.001 * limit:.6g}")) >= {"W489"}
    (worst,) = [
        one
        for one in largest_in_plies(
            strengths_of_deck(problem.deck)[0],
            laminate.plies.constants,
            uniform_stresses(laminate, 100.0 * strain),
        )
        if one.criterion == "max_stress"
    ]
    assert worst.exposure == pytest.approx(100.0 / limit, rel=1e-12)
    assert (worst.mode, worst.ply) == ("matrix tension", 4)


@pytest.mark.parametrize(
    ("card", "line"),
    [
        ("-300.0", "buckling load       2.005 times the preload"),
        ("-1.0", "buckling load       more than 64 times the preload"),
    ],
)
def test_the_summary_has_the_buckling_load(card: str, line: str) -> None:
    (problem,) = load_deck(preloaded(card)).problems
    assert f"  {line}" in deck_summary(problem).lines()


def test_a_plate_without_compression_has_no_line_about_buckling() -> None:
    for text in (base(), preloaded("1.0")):
        (problem,) = load_deck(text).problems
        summary = deck_summary(problem)
        assert summary.buckling_factor is None
        assert not any("buckling" in line for line in summary.lines())


# Results -----------------------------------------------------------------------------------------

STORING = """LOOP         40
TIME
RODP         20
STRE         20
PLYS         20
FAIL         20
NEXT
"""


def short_run(text: str) -> Result:
    """Run forty steps of a deck, storing strains, ply stresses and exposures."""
    return fecm.run_one(re.sub(r"(?m)^LOOP(.*\n)*?NEXT\n", STORING, text), solver="numpy")


@cache
def runs() -> tuple[Result, Result]:
    """Short runs without and with a preload so small that it hardly changes the motion."""
    gage = with_card("GAGE", "1,30.,30.,1.472,20.", "")
    return short_run(gage(base())), short_run(gage(preloaded("2e-3,-1e-3,5e-4")))


def test_membrane_forces_include_the_preload_and_strains_do_not() -> None:
    without, preloaded_one = runs()
    for name, n in zip(("N_x", "N_y", "N_xy"), (2e-3, -1e-3, 5e-4), strict=True):
        assert np.abs(without[f"stresses/{name}"]).max() < 1e-12
        assert np.abs(preloaded_one[f"stresses/{name}"] - n).max() < 1e-12
    for name in ("eps_xx", "eps_yy", "gamma_xy"):
        assert not preloaded_one[f"stresses/{name}"].any()


def test_ply_stresses_are_those_of_bending_and_of_the_preload() -> None:
    without, preloaded_one = runs()
    # Force balance: the plies together carry N0, whatever their angles.
    z, angles = without["plies/z"], preloaded_one.plies().angles
    differences = [
        (preloaded_one[f"plies/{name}"] - without[f"plies/{name}"])[0].mean(axis=-1)
        for name in ("sigma_1", "sigma_2", "tau_12")
    ]
    one, two, shear = differences
    c, s = np.cos(np.deg2rad(angles)), np.sin(np.deg2rad(angles))
    thickness = z[:, 2] - z[:, 0]
    n_x = ((c**2 * one + s**2 * two - 2.0 * c * s * shear) * thickness).sum(axis=-1)
    n_y = ((s**2 * one + c**2 * two + 2.0 * c * s * shear) * thickness).sum(axis=-1)
    n_xy = ((c * s * (one - two) + (c**2 - s**2) * shear) * thickness).sum(axis=-1)
    for actual, expected in ((n_x, 2e-3), (n_y, -1e-3), (n_xy, 5e-4)):
        np.testing.assert_allclose(actual, expected, rtol=2e-4)
    for name in ("tau_xz", "tau_yz"):
        scale = np.abs(without[f"plies/{name}"]).max()
        change = preloaded_one[f"plies/{name}"] - without[f"plies/{name}"]
        assert np.abs(change).max() < 1e-5 * scale


def test_the_result_names_the_preload_and_gages_leave_it_out() -> None:
    without, preloaded_one = runs()
    named = preloaded_one.attributes_of("laminate")
    assert [named[f"N0_{axis}"] for axis in ("x", "y", "xy")] == [2e-3, -1e-3, 5e-4]
    assert preloaded_one.attributes_of("gages")["preload"] == "excluded"
    assert "preload" not in without.attributes_of("gages")
    assert "N0_x" not in without.attributes_of("laminate")
    scale = np.abs(without["gages/strain"]).max()
    change = preloaded_one["gages/strain"] - without["gages/strain"]
    assert np.abs(change).max() < 1e-5 * scale


def test_the_summary_of_a_run_names_the_preload() -> None:
    without, preloaded_one = runs()
    expected = "preload           N_x = 0.002 N/mm, N_y = -0.001 N/mm, N_xy = 0.0005 N/mm"
    assert expected in run_summary(preloaded_one)
    assert not any(line.startswith("preload") for line in run_summary(without))


@pytest.mark.parametrize("solver", ["numpy", "auto"])
def test_exposures_begin_with_those_of_the_preload(solver: Solver) -> None:
    text = re.sub(r"(?m)^LOOP(.*\n)*?NEXT\n", STORING, preloaded("500."))
    result = fecm.run_one(text, solver=solver)
    (problem,) = load_deck(text).problems
    (strengths,) = strengths_of_deck(problem.deck)
    stresses = uniform_stresses(problem.laminate, problem.plate.preload_strain)
    expected = largest_in_plies(strengths, problem.laminate.plies.constants, stresses)
    assert result["exposures/step"].tolist() == [0, 20, 40]
    assert result["exposures/time"][0] == 0.0
    first = [one.exposure for one in expected]
    assert result["exposures/exposure"][0, : len(first)] == pytest.approx(first, rel=1e-12)
    # Bending adds to them: linear exposures of stress states exactly so.
    assert np.all(result["exposures/exposure"][1, : len(first)] > first)
    assert result["failure/max_stress/exposure"].min() > 0.0


@pytest.mark.parametrize("solver", ["csr", "auto"])
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_every_solver_steps_the_preloaded_plate(solver: Solver) -> None:
    text = re.sub(r"(?m)^LOOP(.*\n)*?NEXT\n", STORING, preloaded("-300.,150.,60."))
    expected, actual = (fecm.run_one(text, solver=one) for one in ("numpy", solver))
    difference = np.abs(actual["history/plate_w"] - expected["history/plate_w"]).max()
    assert difference < 1e-9 * expected["history/plate_w"].max()
    plain = short_run(base())["history/plate_w"]
    assert np.abs(expected["history/plate_w"] - plain).max() > 1e-3 * plain.max()
    assert np.abs(expected["energy/balance_error"]).max() < 1e-5 * 3000.0


def test_a_resumed_run_has_the_exposures_at_rest_once(tmp_path: Path) -> None:
    text = re.sub(r"(?m)^LOOP(.*\n)*?NEXT\n", STORING, preloaded("500."))
    whole, resumed = tmp_path / "whole.h5", tmp_path / "resumed.h5"
    stopped_runs.run(text, whole)
    with pytest.raises(stopped_runs.StoppedError):
        stopped_runs.run(text, resumed, stop=25)
    stopped_runs.run(text, resumed, resume=True)
    assert resumed.read_bytes() == whole.read_bytes()


def test_damping_is_compared_with_a_frequency_under_the_preload() -> None:
    # A skin under strong tension: omega^2 = N (pi/a)^2 2/(rho h), of a clamped one 25 % more.
    (problem,) = load_deck(preloaded("1e6,1e6")).problems
    h, rho = 2.944, 1.57e-9
    skin = np.sqrt(2e6 * (np.pi / 100.0) ** 2 / (rho * h))
    assert 1.0 < clamped_frequency(problem) / skin < 1.15


def test_waves_say_that_they_leave_the_preload_out(tmp_path: Path) -> None:
    for text, said in ((preloaded("100."), True), (base(), False)):
        (tmp_path / "plate.inp").write_text(text)
        answer = call("waves", "dispersion", tmp_path / "plate.inp", "--wavelengths", "5:6:2")
        assert ("PREL is left out" in answer.stderr) == said


def test_a_ply_that_the_preload_fails_has_failed_at_time_zero() -> None:
    with pytest.warns(fecm.FecmWarning):
        result = short_run(preloaded("2000."))
    first = result.first_failures[0]
    assert (first.time, first.force, first.energy) == (0.0, 0.0, 0.0)
    assert first.ply == 4


def test_strains_are_judged_with_those_of_the_preload() -> None:
    with pytest.warns(fecm.FecmWarning, match="strain reaches 1"):
        result = short_run(preloaded("2000."))
    assert "strain > 1 %" in result.validity


# Impacts -----------------------------------------------------------------------------------------


# By the number of elements a side, below the critical ones.
TIME_STEPS = {4: 7e-7, 8: 6.8e-7, 16: 5.6e-7, 32: 3.1e-7}


def struck(n: int, case: dict[str, str], duration: float) -> Deck:
    """The plate of the reference data on n x n elements, struck by a rigid mass on a disc."""
    grid = ElementGrid(uniform_section(SIDE, n), uniform_section(SIDE, n))
    middle, _, _ = grid.nearest(SIDE / 2.0, SIDE / 2.0)
    segments = (
        decks.restraints(grid, decks.SUPPORTED),
        Projectile(0, 0, float(case["mass_t"])),
        Impact(middle, 3, float(case["velocity_mm_per_s"])),
        decks.elastic(float(case["k_N_per_mm15"])),
        Patch(case["patch"], float(case["c_mm"])),
        decks.MITC,
        Preload(float(case["N0x_N_per_mm"]), float(case["N0y_N_per_mm"])),
        decks.material(PLY, ANGLES, 0.269),
    )
    dt = TIME_STEPS[n]
    return decks.deck(grid, segments, decks.history_program(dt, int(duration / dt) + 2))


def summary_of(case: str) -> dict[str, str]:
    """Row of a case in the summary of the reference data."""
    (row,) = (row for row in table("preload_impact_summary.csv") if row["case"] == case)
    return row


@pytest.mark.long
@pytest.mark.parametrize("case", [row["case"] for row in table("preload_impact_summary.csv")])
def test_an_impact_under_preload_is_that_of_the_exact_modal_series(case: str) -> None:
    row = summary_of(case)
    ends = float(row["first_contact_end_s"])
    result = fecm.run_one(struck(32, row, 1.02 * max(ends, *map(float, extremes(row)))))
    w, touches = result["history/plate_w"], result.force > 0.0
    assert result.force.max() == pytest.approx(float(row["peak_N"]), rel=2e-3)
    assert w.max() == pytest.approx(float(row["W_max_mm"]), rel=1e-3)
    last = result.time[1:][touches[:-1] & ~touches[1:]]
    assert last[0] == pytest.approx(ends, abs=1e-6)


def extremes(row: dict[str, str]) -> tuple[str, str]:
    """Times of the largest force and deflection."""
    return row["t_peak_s"], row["t_Wmax_s"]


@pytest.mark.parametrize(
    ("case", "force"),
    [
        ("ball_biax_+5cr", 2e-3),
        pytest.param("100g_biax_-0.5cr", 6e-3, marks=pytest.mark.long),
    ],
)
def test_the_history_of_an_impact_under_preload_is_that_of_the_series(
    case: str, force: float
) -> None:
    row, exact = summary_of(case), table(f"preload_impact_{case}.csv")
    time, F, w = (np.array([float(one[name]) for one in exact]) for name in ("t_s", "F_N", "W_mm"))
    first = time < 1.1 * float(row["first_contact_end_s"])
    result = fecm.run_one(struck(32, row, float(time[first][-1])))
    F_found = np.interp(time[first], result.time, result.force)
    w_found = np.interp(time[first], result.time, result["history/plate_w"])
    assert np.abs(F_found - F[first]).max() < force * float(row["peak_N"])
    assert np.abs(w_found - w[first]).max() < 1e-3 * float(row["W_max_mm"])


def test_the_preload_changes_an_impact_on_few_elements_as_it_does_exactly() -> None:
    rows = [summary_of(case) for case in ("100g_0", "100g_x_+100")]
    w = [fecm.run_one(struck(8, row, 1.7e-3))["history/plate_w"].max() for row in rows]
    exact = [float(row["W_max_mm"]) for row in rows]
    assert w[1] / w[0] == pytest.approx(exact[1] / exact[0], rel=5e-3)


def test_errors_of_the_linear_plate_are_said_to_be_those_without_preload() -> None:
    said = "compressive preload increases this error"
    hard = {"velocity": [6000.0]}
    assert said in " ".join(fecm.sweep(preloaded("-300."), hard).notes)
    assert said not in " ".join(fecm.sweep(base(), hard).notes)


def test_an_estimate_says_which_models_neglect_the_preload(tmp_path: Path) -> None:
    (tmp_path / "plate.inp").write_text(preloaded("-300."))
    answer = call("estimate", tmp_path / "plate.inp")
    assert "preload     in the static plate and the run" in answer.stdout
    assert "compressive preload increases this error" in answer.stderr


def test_cases_under_a_preload_equal_their_full_runs() -> None:
    deck = struck(4, summary_of("100g_biax_-0.5cr"), 1.6e-3)
    cases: list[Case] = [
        {"velocity": 500.0, "rod_mass": 1e-4},
        {"velocity": 3000.0, "rod_mass": 2e-5},
        {"velocity": 2000.0, "rod_mass": 5e-5},
    ]
    swept = fecm.sweep(deck, cases=cases, history=True)
    assert swept.force is not None
    assert swept["status"].tolist() == ["ok"] * 3
    for force, case in zip(swept.force, cases, strict=True):
        result = fecm.run_one(apply_case(deck, case))
        assert np.abs(force[: len(result.force)] - result.force).max() < 1e-9 * result.force.max()


def test_a_case_whose_plate_buckles_under_the_preload_says_so() -> None:
    deck = struck(4, summary_of("100g_biax_-0.5cr"), 1e-5)
    swept = fecm.sweep(deck, {"thickness": [2.69, 2.0], "dt": ["auto"]})
    assert "buckling" not in swept["status"][0]
    assert "1.2" in swept["status"][1]
    assert "times the buckling load" in swept["status"][1]


def series_compliance(force: float) -> float:
    """Deflection per force on the disc in the middle, of the plate under N_x = N_y."""
    a, b = np.meshgrid(*[np.pi / SIDE * np.arange(1.0, 401.0, 2.0)] * 2, indexing="ij")
    K = stiffness(*bending_and_shear(PLY, ANGLES, 2.69), a, b)
    K[..., 0, 0] += force * (a**2 + b**2)
    shares = disc(10.0 * np.hypot(a, b))
    return float((4.0 / SIDE**2 * shares**2 * np.linalg.inv(K)[..., 0, 0]).sum())


@pytest.mark.parametrize("case", ["100g_biax_-0.5cr", "ball_biax_+5cr"])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_the_static_stiffness_of_an_estimate_is_that_of_the_preloaded_plate(case: str) -> None:
    row = summary_of(case)
    actual = quick_estimate(check_deck(struck(16, row, 1e-5))).stiffness
    assert actual == pytest.approx(1.0 / series_compliance(float(row["N0x_N_per_mm"])), rel=2e-3)
