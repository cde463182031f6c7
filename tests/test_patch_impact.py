"""Impacts with a contact patch against the exact series, and what a patch must not change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fecm
from fecm import Ply, Result, RigidMass
from fecm.mechanics.contact_law import HystereticLaw, LinearPermanent
from fecm.mechanics.impact import ImpactConditions, ImpactSystem
from fecm.mechanics.laminate import LaminateSection, laminate
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.points import DISC, HERTZ, patch_weights
from fecm.mechanics.symmetry import symmetry_reduction
from fecm.mechanics.time_step import critical_time_step
from tests.builders import (
    Floats,
    mesh_on,
    nothing,
    report_plate,
    rules,
    table,
    with_restraints,
)
from tests.decks import LONG, MESH, PROGRAM, small
from tests.test_patch import CROSS_PLY, rectangle

STEEL = laminate(
    Ply(7850.0, 0.3, 206e9, 206e9, 206e9 / 2.6, 206e9 / 2.6, 206e9 / 2.6), [0.0], [0.008]
)
ELASTIC = LinearPermanent(1912000.0, 1.0, 0.0, 1.5)
TAN_SUN = LinearPermanent(1912000.0, 0.0006564, 0.094, 2.0)
BALL = LinearPermanent(1.5091575e10, 1.0, 0.0, 1.5)


def strike(
    mesh: MeshArrays,
    plate: LaminateSection,
    weights: Floats,
    law: LinearPermanent,
    ball: tuple[float, float],
    times: Floats,
    *,
    half: bool = True,
) -> tuple[Floats, float]:
    """Contact force at some times, and its peak, of a rigid mass with a velocity."""
    model = PlateModel(mesh, plate, replace(rules(), assumes_shear=True))
    contact = np.zeros(mesh.equations.shape)
    contact[:, 2] = weights
    motion = PlateMotion(model, reduced=symmetry_reduction(model, contact) if half else None)
    mass, velocity = ball
    conditions = ImpactConditions(load=motion.load(contact), velocity=velocity)
    system = ImpactSystem(motion, RigidMass(mass), HystereticLaw(law), conditions)
    dt = min(0.5 * critical_time_step(model), times[1] / 4.0)
    state = system.start()
    forces = [0.0]
    while state.plate.time < times[-1]:
        system.advance(state, dt)
        forces.append(state.contact.force)
    history = np.array(forces)
    actual = np.interp(times, dt * np.arange(len(history)), history)
    return np.asarray(actual), float(history.max())


def series(name: str, columns: tuple[str, str], until: float) -> Floats:
    """Times and forces of a reference file."""
    rows = [[float(row[c]) for c in columns] for row in table(name)]
    return np.array([row for row in rows if row[0] <= until]).T


# The report's laminate, simply supported, hit by a rigid mass -------------------------------------


@pytest.mark.parametrize(
    ("c", "law", "name", "peak"),
    [
        (0.125, ELASTIC, "patch_impact_disc_c0.125_K1.000.csv", 87.275116),
        (0.125, TAN_SUN, "patch_impact_disc_c0.125_K1.000_tan-sun.csv", 88.460948),
    ],
)
@pytest.mark.few(1)  # of 2, 0.5 s each
def test_the_force_history_is_that_of_the_series(
    c: float, law: LinearPermanent, name: str, peak: float
) -> None:
    mesh = rectangle(48, 32)  # side c
    times, exact = series(name, ("time", "force"), 1.6e-4)
    weights = patch_weights(mesh, DISC, c, 3.0, 2.0)
    force, largest = strike(mesh, CROSS_PLY, weights, law, (0.000181, 115.0), times)
    assert largest == pytest.approx(peak, rel=1e-3)
    np.testing.assert_allclose(force, exact, atol=2e-3 * peak)


def test_the_peak_converges_at_a_rate_of_at_least_three_and_a_half() -> None:
    times = np.linspace(0.0, 4e-5, 9)

    def error(n: int) -> float:
        mesh = rectangle(6 * n, 4 * n)
        weights = patch_weights(mesh, DISC, 0.25, 3.0, 2.0)
        actual = strike(mesh, CROSS_PLY, weights, ELASTIC, (0.000181, 115.0), times)[1]
        return abs(actual / 95.927344 - 1.0)

    coarse, fine = error(2), error(4)  # side 2 c and c
    assert fine < 2e-3
    assert np.log2(coarse / fine) > 3.5


# A steel plate hit by a ball ---------------------------------------------------------------------


def steel(n: int, shape: str, c: float) -> float:
    """Peak force on n x n elements."""
    mesh = rectangle(n, n, 0.2, 0.2)
    weights = patch_weights(mesh, shape, c, 0.1, 0.1)
    return float(strike(mesh, STEEL, weights, BALL, (0.032882, 1.0), np.linspace(0, 5e-5, 11))[1])


def test_the_limit_of_fine_meshes_is_that_of_the_series_and_is_near_on_coarse_ones() -> None:
    disc, hertz = 1.353635297e3, 1.354312800e3
    assert hertz == pytest.approx(disc, rel=1e-3)
    assert steel(16, DISC, 0.327 * 0.008) == pytest.approx(disc, rel=1e-2)
    assert steel(32, DISC, 0.327 * 0.008) == pytest.approx(disc, rel=5e-3)
    assert steel(32, HERTZ, 0.377 * 0.008) == pytest.approx(hertz, rel=5e-3)


@pytest.mark.long
def test_a_fine_mesh_has_the_peak_and_the_history_of_the_series() -> None:
    coarse, fine = steel(16, DISC, 0.327 * 0.008), steel(64, DISC, 0.327 * 0.008)
    assert fine == pytest.approx(1.353635297e3, rel=1e-3)
    assert coarse / fine == pytest.approx(1.0, abs=8e-3)
    mesh = rectangle(64, 64, 0.2, 0.2)
    times, exact = series("patch_impact_steel_disc_c0.327h.csv", ("t", "F"), 1e-4)
    weights = patch_weights(mesh, DISC, 0.327 * 0.008, 0.1, 0.1)
    force, peak = strike(mesh, STEEL, weights, BALL, (0.032882, 1.0), times)
    np.testing.assert_allclose(force, exact, atol=2e-3 * peak)


# What a patch must not change --------------------------------------------------------------------


def test_a_patch_in_the_middle_keeps_the_half_plate_and_its_response() -> None:
    mesh = rectangle(12, 8)
    weights = patch_weights(mesh, DISC, 0.4, 3.0, 2.0)
    contact = np.zeros(mesh.equations.shape)
    contact[:, 2] = weights
    model = PlateModel(mesh, CROSS_PLY, rules())
    assert set(symmetry_reduction(model, contact).weights.tolist()) == {0, 2}
    times = np.linspace(0.0, 1e-4, 201)
    half, full = (
        strike(mesh, CROSS_PLY, weights, ELASTIC, (0.000181, 115.0), times, half=half)[0]
        for half in (True, False)
    )
    np.testing.assert_allclose(half, full, atol=1e-10 * full.max())
    beside = patch_weights(mesh, DISC, 0.4, 3.1, 2.0)
    contact[:, 2] = beside
    assert set(symmetry_reduction(model, contact).weights.tolist()) == {1}


def with_patch(card: str, program: str = PROGRAM) -> Result:
    text = small(program).replace("EXPE", f"PATC\n{card}\nEXPE")
    return fecm.run_one(text)


def test_a_vanishing_patch_on_the_impact_node_is_the_point_force() -> None:
    point = fecm.run_one(small())
    patch = with_patch("DISC,1e-7")
    np.testing.assert_allclose(patch.force, point.force, rtol=1e-6, atol=1e-6 * point.force.max())


def test_the_patch_is_stored_with_its_weights() -> None:
    actual = with_patch("HERT           0.3       0.9       1.0")
    weights = actual["patch/weight"]
    attributes = actual.patch.attributes
    assert weights.sum() == pytest.approx(1.0, rel=1e-12)
    assert (attributes["shape"], attributes["radius"]) == ("HERT", 0.3)
    assert (attributes["x"], attributes["y"]) == (0.9, 1.0)
    places = actual["mesh/coordinates"][actual["patch/node"] - 1]
    assert weights @ places == pytest.approx([0.9, 1.0])


def test_plate_w_is_the_weighted_mean_of_w() -> None:
    actual = with_patch("DISC,.4,1.1,.95", PROGRAM.replace("DISP          5", "DISP          1"))
    w = actual["tape3/w"][:, actual["patch/node"] - 1]
    np.testing.assert_allclose(actual.plate_w, w @ actual["patch/weight"], rtol=1e-12)


def test_the_energy_balance_holds_with_a_patch_over_4000_steps() -> None:
    text = LONG.read_text().replace("EXPE", "PATC\nDISC        0.0347\nSHEA MITC\nEXPE")
    result = fecm.run_one(text)
    initial = result.energy.attributes["initial"]
    assert np.abs(result["energy/balance_error"]).max() < 1e-5 * initial


@pytest.mark.parametrize("steps", ["EXCD", "static"])
def test_the_static_load_of_a_patch_is_that_of_the_same_nodal_forces(steps: str) -> None:
    programs = {
        "EXCD": "LMAS\nDT        .5E-6\nLOOP,20\nTIME\nEXCD\nDISP,5\nNEXT\n",
        "static": "TANG\nFORM\nSOLV\nDISP\n",
    }
    from_patch = with_load(programs[steps], "PATC\nDISC,.4,1.,1.,7.5\n")
    nodes, weights = from_patch["patch/node"], 7.5 * from_patch["patch/weight"]
    pairs = zip(nodes, weights.tolist(), strict=True)
    cards = "".join(f"{node},0,0.,0.,{force!r},0.,0.\n" for node, force in pairs)
    from_nodes = with_load(programs[steps], f"FORC\n{cards}\n")
    w = from_nodes["tape3/w"]
    assert np.abs(w).max() > 0.0
    np.testing.assert_allclose(from_patch["tape3/w"], w, atol=1e-12 * np.abs(w).max())


def with_load(program: str, segment: str) -> Result:
    clamped = MESH.replace(
        "    1    1   -1   -1    0    0    0", "    1    1   -1   -1    1    1    1"
    )
    return fecm.run_one(small(program, mesh=clamped).replace("MATE", f"{segment}MATE"))


def test_assumed_shear_strains_take_the_half_plate_of_four_elements() -> None:
    # Half a turn leaves blocks without elements.
    shear = small().replace("EXPE", "SHEA MITC\nEXPE")
    half, whole = fecm.run(shear), fecm.run(shear, solver="csr")
    assert isinstance(half, Result)
    assert isinstance(whole, Result)
    np.testing.assert_allclose(half.force, whole.force, rtol=1e-9)


def test_the_peak_on_the_reports_free_plate_does_not_depend_on_the_mesh() -> None:
    x, y = np.meshgrid(np.linspace(0.0, 6.0, 49), np.linspace(0.0, 4.0, 33))
    times, peaks = np.linspace(0.0, 6e-5, 13), {}
    for every, radius in ((4, 0.0347), (2, 0.125), (2, 0.0347), (1, 0.125)):
        mesh = mesh_on(np.stack([x[::every, ::every], y[::every, ::every]], axis=-1), 9)
        held = nothing(mesh[0])
        held[:, :2] = True
        plate = with_restraints(*mesh, held)
        weights = patch_weights(plate, DISC, radius, 3.0, 2.0)
        actual = strike(plate, report_plate(), weights, ELASTIC, (0.000181, 115.0), times)
        peaks[every, radius] = actual[1]
    # Limits of finer meshes: 80.07 and 77.18 lb.
    assert peaks[2, 0.125] == pytest.approx(80.07, rel=1e-2)
    assert peaks[1, 0.125] == pytest.approx(80.07, rel=5e-4)
    assert peaks[4, 0.0347] == pytest.approx(77.18, rel=3e-2)
    assert peaks[2, 0.0347] == pytest.approx(77.18, rel=5e-3)


def test_assumed_shear_strains_neither_lock_nor_hourglass_on_a_thin_cross_ply_plate() -> None:
    # Sun and Chen's plate, [0/90/0/90/0]s, 200 x 200 x 2.69 mm; SI units.
    ply = Ply(1580.0, 0.3, 120e9, 7.9e9, 5.5e9, 5.5e9, 5.5e9)
    half = (0.0, 90.0, 0.0, 90.0, 0.0)
    plate = laminate(ply, half + half[::-1], [0.000269] * 10)
    law, peaks = LinearPermanent(8.116e8, 1.0, 0.0, 1.5), []
    for n in (10, 20):
        mesh = rectangle(n, n, 0.2, 0.2)
        weights = patch_weights(mesh, DISC, 0.327 * 0.00269, 0.1, 0.1)
        times = np.linspace(0.0, 6e-4, 61)
        peaks.append(strike(mesh, plate, weights, law, (0.008537, 3.0), times)[1])
    assert peaks == pytest.approx([306.4, 293.5], rel=2e-3)
