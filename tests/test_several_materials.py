"""Plates of several materials and laminates: MATS, LAMS, ZONE.

several_materials.csv: simply supported square plates under q = sin sin of amplitude 1: elasticity
(Pagano's state space, 1970; his sandwich with a core of 0.8 h) and Navier's solutions of
first-order theory.  stepped_strip.csv: Timoshenko beams of two halves under a line force.
thermal_several_materials.csv: residual stresses by the least energy.  bimetal.csv: Timoshenko 1925.
"""

from __future__ import annotations

import csv
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm import Ply, Result, Strengths
from fecm._errors import ResultFileError
from fecm.deck import model
from fecm.deck.catalogue import MATERIALS
from fecm.deck.grid import ElementGrid, grid_lines, uniform_section
from fecm.deck.model import (
    Integration,
    LaminateNumber,
    Laminates,
    Layer,
    Material,
    MaterialNumber,
    Materials,
    NumberedLaminate,
    NumberedPly,
    Shear,
    Zone,
    Zones,
)
from fecm.mechanics.failure import CRITERIA
from fecm.mechanics.failure_monitor import UNKNOWN, FailureMonitor
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.kernels.failure import CompiledMonitor
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.mechanics.mesh import equation_numbers
from fecm.mechanics.ply_stresses import PlyStresses, equilibrium_shear_stiffness, residual_stresses
from fecm.mechanics.symmetry import symmetry_reduction
from fecm.problem.loading import load_deck
from fecm.problem.parts import strengths_of_deck
from fecm.simulation.job import Solver
from fecm.verification import decks
from tests.builders import Floats, table
from tests.decks import DATA
from tests.stopped_runs import StoppedError
from tests.stopped_runs import run as run_to
from tests.test_kernels import compiled

SANDWICH = (
    Ply(1.0, 0.25, 25.0, 1.0, 0.5, 0.5, 0.2),
    Ply(0.2, 0.25, 0.04, 0.04, 0.016, 0.06, 0.06),
)
HYBRID = (
    Ply(1.55e-9, 0.3, 138e3, 9e3, 5200.0, 5200.0, 3200.0),
    Ply(1.95e-9, 0.28, 45e3, 12e3, 5000.0, 5000.0, 4200.0),
)
CORED = ((0.0, 0.1, 1), (0.0, 0.8, 2), (0.0, 0.1, 1))  # angle, thickness, material
PLATES = {  # materials, layers, side
    "Pagano sandwich S=10 (faces h/10)": (SANDWICH, CORED, 10.0),
    "Pagano sandwich S=100": (SANDWICH, CORED, 100.0),
    "carbon/glass hybrid [0C/90G/0G/90G/0C] 200x200, mm N": (
        HYBRID,
        ((0.0, 0.5, 1), (90.0, 0.5, 2), (0.0, 0.6, 2), (90.0, 0.5, 2), (0.0, 0.5, 1)),
        200.0,
    ),
}
THEORIES = {
    "FSDT K=1": Shear(assumed=True),
    "FSDT EQUI": Shear(assumed=True, equilibrium=True),
}


def layers_of(layup: tuple[tuple[float, float, int], ...]) -> tuple[Layer, ...]:
    """Layer cards."""
    return tuple(Layer(n, *layer) for n, layer in enumerate(layup, start=1))


def material(ply: Ply, layup: tuple[tuple[float, float, int], ...], points: int = 2) -> Material:
    """A MATE segment."""
    total = sum(thickness for _, thickness, _ in layup)
    return Material(Integration(3, 3, points, total), ply, layers_of(layup))


def materials(*plies: Ply) -> Materials:
    """A MATS segment of materials from number 2."""
    numbered = enumerate(plies, start=2)
    return Materials(tuple(NumberedPly(MaterialNumber(n), ply) for n, ply in numbered))


def bent(name: str, theory: str, words: str) -> Result:
    """Run a quarter of a plate of 16 x 16 elements under q = cos cos, its origin in the middle."""
    plies, layup, side = PLATES[name]
    along = np.cos(np.pi / side * np.array(grid_lines(uniform_section(side / 2.0, 8))))
    quarter = decks.quarter_plate(
        8,
        material(plies[0], layup),
        decks.program(words),
        np.outer(along, along),
        further=[THEORIES[theory], materials(*plies[1:])],
        side=side,
    )
    return decks.run_of_deck(quarter)


CASES = [(name, theory) for name in PLATES for theory in THEORIES]


def rows_of(name: str, theory: str) -> list[dict[str, str]]:
    """Rows of a case, those at the middle of a layer left out."""
    rows = table("several_materials.csv")
    return [r for r in rows if (r["case"], r["theory"]) == (name, theory) and float(r["z/h"])]


@pytest.mark.parametrize(("name", "theory"), CASES)
def test_a_plate_of_several_materials_bends_as_naviers_solution(name: str, theory: str) -> None:
    rows = rows_of(name, theory)
    side = PLATES[name][2]
    bent_plate = bent(name, theory, "TANG FORM SOLV DISP PLYS")
    assert bent_plate.tape3.w[0, 0] == pytest.approx(float(rows[0]["w"]), rel=5e-4)
    plies = bent_plate.plies()
    x, y = np.pi / side * plies.x, np.pi / side * plies.y
    even, odd = np.cos(x) * np.cos(y), np.sin(x) * np.sin(y)
    largest = max(abs(float(row[key])) for row in rows for key in ("sx", "sy", "txy"))
    for ply, angle in enumerate(plies.angles):
        listed = [row for row in rows if int(row["layer"]) == ply + 1]
        names = ("sx", "sy") if angle == 0.0 else ("sy", "sx")
        stresses = ((plies.sigma_1, names[0], even), (plies.sigma_2, names[1], even),
                    (plies.tau_12, "txy", odd if angle == 0.0 else -odd))  # fmt: skip
        for values, key, shape in stresses:
            for row in listed:
                face = int(float(row["z/h"]) > plies.z[ply, 1] / (2.0 * -plies.z[0, 0]))
                error = values[0, :, :, ply, face] - float(row[key]) * shape
                assert np.abs(error).max() < 2e-3 * largest
    x, y = x.mean(axis=1), y.mean(axis=1)
    shapes = {"txz": -np.sin(x) * np.cos(y), "tyz": -np.cos(x) * np.sin(y)}
    for key, values in (("txz", plies.tau_xz), ("tyz", plies.tau_yz)):
        expected = {int(r["layer"]): float(r[key]) for r in rows if float(r["z/h"]) < 0.0}
        size = max(map(abs, expected.values()))
        for layer, value in expected.items():
            # The last row of a layer below the middle: its upper face, or its lower one if the
            # middle is in it.
            listed = [r for r in rows if int(r["layer"]) == layer and float(r["z/h"]) < 0.0]
            level = 2 if len(listed) == 2 else 0
            error = values[0, :, layer - 1, level] - value * shapes[key]
            assert np.abs(error).max() < 5e-3 * size


@pytest.mark.parametrize(("name", "theory"), CASES)
def test_a_plate_of_several_materials_vibrates_as_naviers_solution(name: str, theory: str) -> None:
    bent_plate = bent(name, theory, "CMAS EIGE=1")
    expected = float(rows_of(name, theory)[0]["lowest omega_11"])
    assert bent_plate.modes.angular_frequency[0] == pytest.approx(expected, rel=1e-4)


def laminate_of(name: str) -> LaminateSection:
    """Laminate of a case."""
    plies, layup, _ = PLATES[name]
    chosen = [plies[number - 1] for _, _, number in layup]
    return laminate(chosen, [angle for angle, _, _ in layup], [h for _, h, _ in layup])


@pytest.mark.parametrize("name", PLATES)
def test_the_shear_stiffness_of_several_materials_is_that_of_equal_energy(name: str) -> None:
    built = laminate_of(name)
    shears = {"FSDT K=1": built.shear, "FSDT EQUI": equilibrium_shear_stiffness(built)}
    for theory, shear in shears.items():
        row = rows_of(name, theory)[0]
        expected = [float(row[f"shear stiffness {axis}"]) for axis in ("xz", "yz")]
        np.testing.assert_allclose(shear.diagonal(), expected, rtol=1e-9)


def test_inertia_is_the_integral_of_the_density_by_layer() -> None:
    plies = (replace(HYBRID[0], density=1.0), replace(HYBRID[1], density=3.0))
    layup = laminate(plies, [0.0, 90.0], [1.0, 2.0])  # from -1.5 to -0.5 and to 1.5
    assert layup.mass == pytest.approx(1.0 * 1.0 + 3.0 * 2.0, rel=1e-14)
    first = 1.0 * (0.25 - 2.25) / 2.0 + 3.0 * (2.25 - 0.25) / 2.0
    assert layup.coupling_inertia == pytest.approx(first, rel=1e-14)
    second = 1.0 * (3.375 - 0.125) / 3.0 + 3.0 * (3.375 + 0.125) / 3.0
    assert layup.rotary_inertia == pytest.approx(second, rel=1e-14)


def test_residual_stresses_of_a_fibre_metal_laminate_are_those_of_the_least_energy() -> None:
    rows = table("thermal_several_materials.csv")
    shear = 72.4e9 / 2.66
    metal, glass = (
        Ply(2.7e3, 0.33, 72.4e9, 72.4e9, shear, shear, shear),
        MATERIALS["Scotchply-1002"].ply,
    )
    of_glass = MATERIALS["Scotchply-1002"].expansion
    assert of_glass is not None
    z = [float(row["z_m"]) for row in rows]
    angles = [float(row["angle"]) for row in rows[::2]]
    layup = laminate([metal, glass, glass, metal], angles, np.subtract(z[1::2], z[::2]).tolist())
    change = float(rows[0]["dT_K"])
    along = change * np.array([22.4e-6, of_glass.alpha1, of_glass.alpha1, 22.4e-6])
    across = change * np.array([22.4e-6, of_glass.alpha2, of_glass.alpha2, 22.4e-6])
    residual = residual_stresses(layup, along, across)
    expected = np.array([[float(row[f"{s}_Pa"]) for s in ("s1", "s2", "t12")] for row in rows])
    atol = 1e-9 * np.abs(expected).max()
    np.testing.assert_allclose(residual.stresses.reshape(-1, 3), expected, rtol=0.0, atol=atol)
    strain = [float(rows[0][key]) for key in ("eps0_x", "eps0_y", "gamma0_xy")]
    np.testing.assert_allclose(residual.strain, strain, rtol=1e-9, atol=1e-14)
    curvature = [float(rows[0][key]) for key in ("kx_1/m", "ky_1/m", "kxy_1/m")]
    np.testing.assert_allclose(residual.curvature, curvature, rtol=1e-9, atol=1e-12)


def strips() -> list[list[float]]:
    """Rows of bimetal.csv, whose header repeats names."""
    with (DATA / "bimetal.csv").open(newline="") as file:
        return [list(map(float, row)) for row in list(csv.reader(file))[1:]]


@pytest.mark.parametrize("row", strips(), ids=["aluminium on steel", "equal moduli"])
def test_a_bimetal_bends_as_timoshenkos(row: list[float]) -> None:
    e1, nu1, alpha1, h1, e2, nu2, alpha2, h2, change, expected = row
    plies = [decks.isotropic(e1, nu1, 1.0), decks.isotropic(e2, nu2, 1.0)]
    free = change * np.array([alpha1, alpha2])
    residual = residual_stresses(laminate(plies, [0.0, 0.0], [h1, h2]), free, free)
    np.testing.assert_allclose(residual.curvature, [expected, expected, 0.0], rtol=1e-9, atol=1e-12)


# Several laminates -------------------------------------------------------------------------------


def laminates(*layups: tuple[tuple[float, float, int], ...]) -> Laminates:
    """A LAMS segment of laminates from number 2."""
    numbered = enumerate(layups, start=2)
    return Laminates(
        tuple(
            NumberedLaminate(LaminateNumber(n, len(layup)), layers_of(layup))
            for n, layup in numbered
        )
    )


def strip(row: dict[str, str], *others: model.Segment) -> tuple[Floats, Floats]:
    """Deflections and rotations of a simply supported strip under a line force in the middle."""
    e, g, left, _, length, width, force, *_ = map(float, row.values())
    ply = Ply(1.0, 0.0, e, e, e / 2.0, g, g)
    grid = ElementGrid(uniform_section(length, 16), uniform_section(width, 1))
    loads = np.zeros((grid.up, grid.across, 5))
    share = np.array([1.0, 4.0, 1.0]) / 6.0  # of the line in its nodes
    loads[:, grid.across // 2, 2] = force * share
    plate = material(ply, ((0.0, left, 1),))
    text = decks.deck(
        grid,
        (
            decks.restraints(grid, "11001 11101 11001 11101 11001"),
            decks.forces(loads),
            Shear(assumed=True),
            plate,
            *others,
        ),
        decks.DEFLECTION,
    )
    field = decks.run_of_deck(text).tape3.displacement[0].reshape(grid.up, grid.across, 5)
    return field[:, :, 2], field[:, :, 3]


@pytest.mark.parametrize("row", table("stepped_strip.csv"), ids=["one laminate", "two laminates"])
def test_a_strip_of_two_laminates_bends_as_timoshenkos_beam(row: dict[str, str]) -> None:
    right = float(row["h right"])
    zones = Zones((Zone(9, 16, 1, 2),))
    w, theta = strip(row, laminates(((0.0, right, 1),)), zones)
    _, g, left, _, _, width, force, expected, at_left, at_right = map(float, row.values())
    middle = w.shape[1] // 2
    np.testing.assert_allclose(w[:, middle], expected, rtol=1e-6)
    # The file has the rotations of bending alone.  The shear strains of the halves have opposite
    # signs and differ in size; half their sum turns the strip as a whole.
    turned = force / (4.0 * g * width) * (1.0 / left - 1.0 / right)
    np.testing.assert_allclose(theta[:, 0], at_left - turned, rtol=1e-6)
    np.testing.assert_allclose(theta[:, -1], -at_right - turned, rtol=1e-6)


def test_two_equal_laminates_are_one() -> None:
    row = table("stepped_strip.csv")[0]
    one, _ = strip(row)
    two, _ = strip(row, laminates(((0.0, 2.0, 1),)), Zones((Zone(9, 16, 1, 2),)))
    np.testing.assert_allclose(two, one, rtol=0.0, atol=1e-6 * np.abs(one).max())


TWICE = ((0.0, 0.25, 2), (90.0, 0.5, 1), (0.0, 0.25, 3))  # a pad, thinner than the plate


def impact(
    *others: model.Segment,
    layup: tuple[tuple[float, float, int], ...] = ((0.0, 0.5, 1), (90.0, 0.5, 1), (30.0, 0.5, 1)),
    words: str = "PLYS=10 FAIL=5 DISP=10",
    steps: int = 40,
) -> model.Deck:
    """A simply supported plate of 4 x 4 elements under a rigid mass, in mm, N and s."""
    grid = ElementGrid(uniform_section(60.0, 4), uniform_section(60.0, 4))
    middle = grid.nearest(30.0, 30.0)[0]
    named = MATERIALS["IM7/8552"]
    strengths = named.allowables("mm-N-s")
    program = decks.program(f"LMAS DT=2e-7 LOOP={steps} TIME RODP=10 {words} NEXT")
    given = {type(one) for one in others}
    segments = (
        decks.restraints(grid, "00000 11101 11110 11101 11110"),
        Shear(assumed=True),
        model.Projectile(0, 0, 2e-3),
        model.Impact(middle, 3, 2000.0),
        model.Indentation(1e5, 0.017, 0.094, 2.0),
        model.Patch("DISC", 5.0, 30.0, 30.0),
        *([] if model.Allowables in given else [strengths]),
        material(named.ply, layup),
        *others,
    )
    return decks.deck(grid, segments, program)


SOLVERS = [
    pytest.param("kernels", marks=compiled),
    "numpy",
]


def assert_same(
    result: Result, wanted: Result, tolerance: float, less: Collection[str] = ()
) -> None:
    """Datasets agree, relative to the largest of their values."""
    for path in wanted:
        if path in less or path.startswith("exposures/") or path.endswith("/mode"):
            continue
        values = wanted[path]
        scale = np.abs(values[np.isfinite(values)]).max(initial=0.0)
        if path == "energy/balance_error":
            scale = wanted.attributes_of("energy")["initial"]
        np.testing.assert_allclose(
            result[path], values, rtol=0.0, atol=tolerance * scale, err_msg=path
        )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_a_material_of_mats_that_repeats_that_of_mate_changes_nothing(solver: Solver) -> None:
    named = MATERIALS["IM7/8552"]
    strengths = named.allowables("mm-N-s")
    assert strengths is not None
    one = fecm.run_one(impact(), solver=solver)
    twice = impact(
        materials(named.ply),
        replace(strengths, others=(replace(strengths, material=2),)),
        layup=((0.0, 0.5, 2), (90.0, 0.5, 1), (30.0, 0.5, 2)),
    )
    two = fecm.run_one(twice, solver=solver)
    assert_same(two, one, 1e-13)
    assert two["plies/material"].tolist() == [2, 1, 2]
    assert {*two} - {*one} == {"plies/material"}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_interleaved_zones_of_the_same_laminate_change_nothing(solver: Solver) -> None:
    layup = ((0.0, 0.5, 1), (90.0, 0.5, 1), (30.0, 0.5, 1))
    one = fecm.run_one(impact(), solver=solver)
    zones = Zones((Zone(1, 16, 2, 2), Zone(2, 14, 3, 3)))
    two = fecm.run_one(impact(laminates(layup, layup), zones), solver=solver)
    of_laminate = {path for path in one if path.startswith("laminate/")} | {"plies/z"}
    assert_same(two, one, 1e-13, of_laminate)
    assert {*one} - {*two} == of_laminate - {"plies/z"}
    for number in (1, 2, 3):
        for name in ("A", "B", "D", "shear"):
            path = f"laminate/{name}"
            np.testing.assert_array_equal(two[f"laminate/{number}/{name}"], one[path])
    assert two["plies/z"].shape == (3, 3, 3)
    expected = [2, 3, 2, 1] * 4
    expected = [3 if n in range(2, 15, 3) else 2 if n % 2 else 1 for n in range(1, 17)]
    assert two["mesh/laminate"].tolist() == expected


def unlike(*others: model.Segment, **options: Any) -> model.Deck:
    """The plate with a softer laminate of three materials in its upper half."""
    pad = laminates(TWICE, ((45.0, 0.3, 3), (-45.0, 0.3, 3)))
    zones = Zones((Zone(9, 16, 1, 2), Zone(3, 4, 0, 3)))
    return impact(materials(*HYBRID), pad, zones, *others, **options)


def test_stresses_and_exposures_are_those_of_each_elements_own_laminate() -> None:
    (problem,) = load_deck(unlike()).problems
    plate, rule = problem.plate, problem.rules[2]
    field = np.random.default_rng(1).normal(size=(len(problem.mesh.coordinates), 5))
    known = strengths_of_deck(problem.deck)[0][0]
    assert known is not None
    strengths = [replace(known, xt=1000.0 * n, s13=40.0 * n) for n in (1, 2, 3)]
    of_plies: list[list[Strengths | None]] = [
        [strengths[one.material - 1] for one in own] for own in problem.deck.layers.values()
    ]
    of_plies[1][1] = None
    several = PlyStresses(problem.mesh, plate.rows_by_laminate, rule)
    actual = several.evaluate(field)
    kinds = [FailureMonitor, *([CompiledMonitor] if LIBRARY is not None else [])]
    for kind in kinds:
        monitor = kind(several, of_plies)
        envelope = monitor.start()
        monitor.update(envelope, field[None], [1.0])
        exposures = envelope.plies.exposure.reshape(len(CRITERIA), 16, -1, 3, 2)
        for (zone, rows), own in zip(plate.rows_by_laminate, of_plies, strict=True):
            assert not isinstance(rows, slice)
            alone = PlyStresses(problem.mesh, zone, rule, rows)
            count = len(own)
            for name, values in alone.evaluate(field).items():
                plies = actual[name][rows]
                if name != "residual":
                    axis = 2 if values.ndim == 4 else 1
                    assert np.isnan(np.delete(plies, np.s_[:count], axis)).all()
                    plies = np.take(plies, range(count), axis)
                np.testing.assert_allclose(plies, values, rtol=1e-12)
            single = kind(alone, [own])
            wanted = single.start()
            single.update(wanted, field[None], [1.0])
            expected = wanted.plies.exposure.reshape(len(CRITERIA), len(rows), -1, count, 2)
            np.testing.assert_allclose(exposures[:, rows, :, :count], expected, rtol=1e-12)
            assert (exposures[:, rows, :, count:] == UNKNOWN).all()
            between = envelope.interfaces.exposure[rows]
            np.testing.assert_allclose(between[:, : count - 1], wanted.interfaces.exposure)
            assert np.isnan(between[:, count - 1 :]).all()
        assert (exposures[:, 8:, :, 1] == UNKNOWN).all()  # the ply without strengths
        assert np.isnan(envelope.interfaces.exposure[8:]).all()  # both are beside it


def test_an_interface_of_unlike_materials_takes_the_weaker_strength() -> None:
    (problem,) = load_deck(impact(layup=((0.0, 0.5, 1), (0.0, 0.5, 1)))).problems
    known = strengths_of_deck(problem.deck)[0][0]
    assert known is not None
    strong = replace(known, s13=80.0, s23=30.0)
    weak = replace(strong, s13=20.0, s23=60.0)
    field = np.random.default_rng(2).normal(size=(len(problem.mesh.coordinates), 5))
    stresses = PlyStresses(problem.mesh, problem.laminate, problem.rules[2])

    def exposures(*strengths: Strengths) -> Floats:
        monitor = FailureMonitor(stresses, [strengths])
        envelope = monitor.start()
        monitor.update(envelope, field[None], [1.0])
        return envelope.interfaces.exposure

    both = exposures(replace(strong, s13=20.0), replace(strong, s13=20.0))
    np.testing.assert_allclose(exposures(strong, weak), both, rtol=1e-13)
    assert (both > exposures(strong, strong)).all()


def test_plies_have_the_z_and_strains_of_each_elements_own_laminate() -> None:
    actual = fecm.run_one(unlike()).plies()
    assert actual.z.shape == (16, 3, 3)
    np.testing.assert_allclose(actual.z[8, :, 1], [-0.375, 0.0, 0.375])
    assert np.isnan(actual.z[2, 2]).all()
    assert actual.angles[2, :2].tolist() == [45.0, -45.0]
    one, two, eps = (
        values[-1, 8, :, 0] for values in (actual.sigma_1, actual.sigma_2, actual.eps_1)
    )
    ply = HYBRID[0]  # material 2
    np.testing.assert_allclose(eps, (one - ply.nu12 * two) / ply.e1, rtol=1e-12)


def test_a_result_whose_elements_have_a_laminate_that_its_deck_lacks_is_refused() -> None:
    result = fecm.run_one(unlike())
    arrays = {path: result[path] for path in result}
    arrays["mesh/laminate"] = np.where(np.arange(16) == 2, 7, result["mesh/laminate"])
    with pytest.raises(ResultFileError, match="does not have the laminates of its elements"):
        Result(arrays, {"deck": result.deck_text}, {}).plies()


@pytest.mark.parametrize(
    ("zone", "weights"),
    [(Zone(6, 11, 1, 2), {0, 2}), (Zone(1, 1, 1, 2), {1}), (Zone(1, 16, 15, 2), {0, 2})],
    ids=["symmetric", "one corner", "opposite corners"],
)
def test_half_of_the_plate_is_computed_only_where_zones_are_symmetric(
    zone: Zone, weights: set[int]
) -> None:
    (problem,) = load_deck(
        impact(materials(HYBRID[1]), laminates(((0.0, 1.0, 2),)), Zones((zone,)))
    ).problems
    reduced = symmetry_reduction(problem.moving_plate, problem.contact)
    assert {*reduced.weights.tolist()} == weights


@compiled
def test_kernels_and_numpy_agree_on_a_nonlinear_plate_of_several_laminates() -> None:
    deck = unlike(model.Nonlinear(), words="DISP=10", steps=200)
    actual, wanted = (fecm.run_one(deck, solver=s) for s in ("kernels", "numpy"))
    assert np.abs(wanted["membrane/largest_force"]).max() > 1.0
    assert_same(actual, wanted, 1e-10)


def test_the_load_is_on_the_laminate_under_it() -> None:
    pad = laminates(((0.0, 1.0, 1), (90.0, 1.0, 1)))
    (problem,) = load_deck(impact(pad, Zones((Zone(6, 11, 1, 2),)))).problems
    assert problem.laminate.thickness == pytest.approx(2.0)
    assert problem.used_laminates == [0, 1]
    area = 60.0**2
    density = MATERIALS["IM7/8552"].ply.density
    thick = 6.0 / 16.0  # zone 6 to 11
    mass = density * area * (1.5 * (1.0 - thick) + 2.0 * thick)
    assert problem.plate.total_mass() == pytest.approx(mass, rel=1e-12)


def test_k_of_a_sphere_is_that_of_the_materials_under_the_load() -> None:
    soft = replace(MATERIALS["IM7/8552"].ply, e1=9080.0, g12=3243.0, g13=3243.0)
    units = model.Units("mm", "N", "s")

    def k(*others: model.Segment, **options: Any) -> float:
        deck = impact(units, *others, **options).with_(radius=8.0)
        return deck.require(model.Indentation).k

    layup = ((0.0, 0.5, 1), (90.0, 0.5, 2))
    at_load = Zones((Zone(6, 11, 1, 2),))
    alone = k(materials(soft), layup=layup)
    assert k(materials(soft), laminates(layup), at_load) == pytest.approx(alone, rel=1e-12)
    away = Zones((Zone(1, 4, 1, 2),))
    assert k(materials(soft), laminates(layup), away) == pytest.approx(k(), rel=1e-12)
    assert alone < 0.99 * k()


def test_lumped_and_consistent_masses_are_those_of_each_elements_own_laminate() -> None:
    (problem,) = load_deck(unlike()).problems
    free = replace(problem.mesh, codes=0 * problem.mesh.codes)
    plate = replace(problem.plate, mesh=replace(free, equations=equation_numbers(free.codes)))
    numbers = plate.laminate_numbers
    assert numbers is not None
    masses = np.array([one.mass for one in plate.laminates])[numbers]
    inertias = np.array([one.rotary_inertia for one in plate.laminates])[numbers]
    area = 60.0**2 / 16.0
    expected = np.repeat([area * masses.sum(), area * inertias.sum()], (3, 2))
    lumped = plate.mass.reshape(-1, 5).sum(axis=0)
    np.testing.assert_allclose(lumped, expected, rtol=1e-12)
    one_by_one = np.ones(plate.neq) @ plate.consistent_mass
    np.testing.assert_allclose(one_by_one.reshape(-1, 5).sum(axis=0), expected, rtol=1e-12)


def test_resultants_are_those_of_each_elements_own_laminate() -> None:
    result = fecm.run_one(unlike(words="STRE=20"))
    (problem,) = load_deck(unlike()).problems
    names = ("eps_xx", "eps_yy", "gamma_xy", "kappa_x", "kappa_y", "kappa_xy")
    strains = np.stack([result[f"stresses/{name}"][-1] for name in names])
    for own, rows in problem.plate.rows_by_laminate:
        ABD = np.block([[own.A, own.B], [own.B, own.D]])
        expected = np.tensordot(ABD, strains[:, rows], 1)
        for name, values in zip(
            ("N_x", "N_y", "N_xy", "M_x", "M_y", "M_xy"), expected, strict=True
        ):
            atol = 1e-12 * np.abs(values).max()
            stored = result[f"stresses/{name}"][-1, rows]
            np.testing.assert_allclose(stored, values, rtol=1e-9, atol=atol)


def test_cure_takes_the_expansion_of_each_layers_material() -> None:
    expansions = tuple(model.Expansion(n, 1e-6 * n, 2e-5 * n) for n in (1, 2, 3))
    (problem,) = load_deck(unlike(model.Cure(-100.0, expansions=expansions))).problems
    assert problem.residuals is not None
    layups = problem.deck.layers.values()
    for actual, own, layers in zip(problem.residuals, problem.plate.laminates, layups, strict=True):
        number = np.array([layer.material for layer in layers])
        expected = residual_stresses(own, -1e-4 * number, -2e-3 * number)
        atol = 1e-12 * np.abs(expected.stresses).max()
        np.testing.assert_allclose(actual.stresses, expected.stresses, rtol=1e-12, atol=atol)


def test_an_interface_of_unlike_materials_can_delaminate() -> None:
    plies = (HYBRID[0], HYBRID[1], HYBRID[1], HYBRID[1])
    assert laminate(plies, [0.0, 0.0, 0.0, 90.0], [1.0] * 4).unlike_interfaces == 2
    assert laminate(HYBRID[0], [0.0, 0.0, 180.0, 90.0], [1.0] * 4).unlike_interfaces == 1


def test_a_run_of_several_laminates_that_is_stopped_goes_on_to_the_same_bytes(
    tmp_path: Path,
) -> None:
    deck = unlike().to_text()
    whole, path = tmp_path / "whole.h5", tmp_path / "stopped.h5"
    looks = run_to(deck, whole)
    for stop in (2, looks - 1):
        with pytest.raises(StoppedError):
            run_to(deck, path, stop)
        run_to(deck, path, resume=True)
        assert path.read_bytes() == whole.read_bytes(), f"stopped at {stop}"
        path.unlink()


def test_a_soft_contact_is_doubtful_on_one_material_only() -> None:
    soft = model.Indentation(500.0, 0.017, 0.094, 2.0)
    names = model.Units("mm", "N", "s")
    one, several = (
        [finding.code for finding in load_deck(impact(soft, names, *others)).findings]
        for others in ((), (materials(*HYBRID),))
    )
    assert "W476" in one
    assert "W476" not in several
