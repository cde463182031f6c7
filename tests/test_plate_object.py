"""The plate as an object: matrices and loads of a deck, for computations of one's own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import diags_array
from scipy.sparse.linalg import eigsh, spsolve

import fecm
from fecm._typing import Floats
from tests import closed_forms
from tests.decks import small

SIDES = (100.0, 80.0)
PLY = fecm.Ply(1.6e-9, 0.3, 140e3, 9e3, 5e3, 5e3, 3e3)
LAMINATE = fecm.Laminate("[0/90]2s", PLY, 0.5)
RECTANGLE = fecm.Plate.rectangle(SIDES, (6, 4), support="simple")
STATIC = "TANG\nFORM\nSOLV\nDISP"
NEWTON = "LOOP,,20\nTANG\nFORM\nSOLV\nCONV\nNEXT\nDISP"


def plate_deck(program: str = STATIC, plate: fecm.Plate = RECTANGLE, **given: Any) -> fecm.Deck:
    """Build the deck of a plate under a force in the middle."""
    values: dict[str, Any] = {"force": 3.0, "units": "mm-N-s"} | given
    return fecm.plate_deck(plate, LAMINATE, program, **values)


def lowest(K: Any, M: Any) -> float:
    """Angular frequency of the lowest mode."""
    return math.sqrt(eigsh(K, 1, M, sigma=0.0, return_eigenvectors=False)[0])


@pytest.mark.parametrize(
    "kind",
    [{}, {"preload": (20.0, 5.0)}, {"radius_x": 400.0, "radius_y": 900.0}, {"patch": None}],
    ids=["flat", "preloaded", "curved", "force on a node"],
)
def test_the_static_solution_of_k_and_p_is_that_of_the_run(kind: dict[str, Any]) -> None:
    deck = plate_deck(**kind)
    plate = fecm.plate_model(deck)
    field = plate.field(spsolve(plate.stiffness.tocsc(), plate.nodal_loads))
    w = fecm.run_one(deck).tape3.w[-1]
    np.testing.assert_allclose(field[:, 2], w, rtol=0.0, atol=1e-11 * w.max())


def test_the_lowest_frequency_of_k_and_m_converges_to_naviers() -> None:
    D, S = closed_forms.bending_and_shear(PLY, LAMINATE.angles, LAMINATE.thickness)
    alpha, beta = (np.array(math.pi / side) for side in SIDES)
    K = closed_forms.stiffness(D, S * 5.0 / 6.0, alpha, beta)
    h = LAMINATE.thickness
    exact = math.sqrt(eigh(K, PLY.density * np.diag([h, h**3 / 12, h**3 / 12]))[0][0])
    errors = []
    for mesh in ((3, 2), (6, 4), (12, 8)):
        rectangle = fecm.Plate.rectangle(SIDES, mesh, support="simple")
        plate = fecm.plate_model(plate_deck(plate=rectangle, shear_factor=5.0 / 6.0, shear="mitc"))
        assert plate.total_mass() == pytest.approx(PLY.density * h * math.prod(SIDES))
        masses = (diags_array(plate.mass), plate.consistent_mass)
        errors.append([lowest(plate.stiffness, M) / exact - 1.0 for M in masses])
    assert np.abs(errors[-1]).max() < 1e-4
    assert (np.abs(np.array(errors[:-1]) / errors[1:]) > 10.0).all()  # order 4 in the side is 16


def test_central_differences_by_hand_are_those_of_the_run() -> None:
    deck = plate_deck("LMAS\nDT,2e-7\nLOOP,,60\nTIME\nEXCD\nDISP\nNEXT")
    plate = fecm.plate_model(deck)
    K, M, P, dt = plate.stiffness, plate.mass, plate.nodal_loads, 2e-7
    u, v, rows = np.zeros(plate.neq), np.zeros(plate.neq), []
    for step in range(60):
        v += (dt if step else 0.5 * dt) * (P - K @ u) / M
        u += dt * v
        rows.append(plate.field(u)[:, 2])
    w = fecm.run_one(deck).tape3.w
    np.testing.assert_allclose(rows, w, rtol=0.0, atol=1e-12 * np.abs(w).max())


def test_an_impact_is_the_convolution_of_its_force_with_the_impulse_response() -> None:
    dt = 2e-7
    deck = fecm.impact(
        RECTANGLE,
        LAMINATE,
        fecm.RigidMass(1e-6),
        fecm.Contact.estimate(radius=8.0),
        velocity=1000.0,
        duration=4e-5,
        dt=dt,
        units="mm-N-s",
    )
    with pytest.warns(fecm.FecmWarning):
        run = fecm.run_one(deck)
    plate = fecm.plate_model(plate_deck(force=1.0))
    K, M, P = plate.stiffness, plate.mass, plate.nodal_loads
    response, u, v = [], np.zeros(plate.neq), P / M
    for _ in run.time:
        u += dt * v
        v -= dt * (K @ u) / M
        response.append(P @ u)
    force = np.append(0.0, run.force[:-1])
    w: Floats = dt * np.convolve(response, force)[: len(force)]
    np.testing.assert_allclose(w, run.plate_w, rtol=0.0, atol=1e-12 * np.abs(w).max())


def test_k_contains_the_preload_so_that_two_plates_give_the_buckling_load() -> None:
    plain = fecm.plate_model(plate_deck(shear_factor=5.0 / 6.0, shear="mitc"))
    loaded = plate_deck(shear_factor=5.0 / 6.0, shear="mitc", preload=(-1.0, 0.0))
    geometric = (fecm.plate_model(loaded).stiffness - plain.stiffness).tocsr()
    (largest,) = eigsh(-geometric, 1, plain.stiffness, which="LA", return_eigenvectors=False)
    # Navier's stiffness of w with one and two half waves along x, over alpha^2 (Reddy 2004).
    D, S = closed_forms.bending_and_shear(PLY, LAMINATE.angles, LAMINATE.thickness)
    alpha, beta = np.array([1.0, 2.0]) * math.pi / SIDES[0], np.full(2, math.pi / SIDES[1])
    inverse = np.linalg.inv(closed_forms.stiffness(D, S * 5.0 / 6.0, alpha, beta))
    critical = (1.0 / (inverse[:, 0, 0] * alpha**2)).min()
    assert 1.0 / largest == pytest.approx(critical, rel=1e-2)


def test_k_of_a_plate_that_stretches_is_that_at_rest_and_a_warning_says_so() -> None:
    with pytest.warns(fecm.FecmWarning, match="stiffness at rest"):
        plate = fecm.plate_model(plate_deck(NEWTON, kinematics="von-karman"))
    assert plate.nonlinear
    linear = fecm.plate_model(plate_deck())
    moves = np.flatnonzero(plate.mesh.equations[:, 2] > 0)
    u = spsolve(plate.stiffness.tocsc(), plate.nodal_loads)
    at_rest = spsolve(linear.stiffness.tocsc(), linear.nodal_loads)
    assert plate.field(u)[moves, 2] == pytest.approx(linear.field(at_rest)[moves, 2], rel=1e-9)


def test_a_vector_has_the_free_dofs_in_the_order_of_the_equations() -> None:
    plate = fecm.plate_model(small())
    equations = plate.mesh.equations
    field = plate.field(np.arange(1.0, plate.neq + 1), 0.0)
    np.testing.assert_array_equal(field, equations)
    assert plate.stiffness.shape == (plate.neq, plate.neq) == plate.consistent_mass.shape
    assert abs(plate.stiffness - plate.stiffness.T).max() < 1e-12 * abs(plate.stiffness).max()


def test_a_deck_that_is_not_one_sound_problem_gives_no_plate() -> None:
    with pytest.raises(fecm.errors.OptionsError, match="2 problems, not one"):
        fecm.plate_model(small().replace("STOP", "") + small())
    with pytest.raises(fecm.DeckError):
        fecm.plate_model(small(mesh=""))
    with pytest.raises(FileNotFoundError):
        fecm.plate_model("missing.inp")
