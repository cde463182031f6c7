"""Curved panels that stretch as they bend: snap-through, energy, interplay with NONL."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from fecm import Result
from fecm.deck import model
from fecm.mechanics.laminate import laminate
from fecm.mechanics.plate import PlateModel
from fecm.problem.loading import load_deck
from fecm.studies.estimate import QuickEstimate, quick_estimate
from fecm.verification import decks
from tests import curved_panels
from tests.builders import nothing, with_restraints
from tests.curved_panels import mesh, panel, struck
from tests.nonlinear_plates import RULES, equilibrium, pressure, quarter_mesh

NONL = model.Nonlinear()

# A shallow arch ----------------------------------------------------------------------------------

E, THICKNESS, SPAN, RADIUS = 70e3, 2.0, 200.0, -2000.0
ODD = np.arange(1, 400, 2)


def arch(deflection: float) -> float:
    """Pressure on a pinned shallow arch of circular curvature that deflects in its middle.

    Exact for Donnell's arch with shear: the axial force N is uniform, and with w = sum of w_n
    sin(n pi x/L) equilibrium is (D_n q^4 + N q^2) w_n = p P_n - N K_n, q = n pi/L, with P_n and K_n
    of the pressure 1 and of the curvature.  N = E h times the mean of w/R + w,x^2/2 closes it.
    """
    D, stretch = E * THICKNESS**3 / 12.0, E * THICKNESS
    q = ODD * np.pi / SPAN
    P, K = 4.0 / (ODD * np.pi), 4.0 / (ODD * np.pi) / RADIUS
    middle = np.sin(ODD * np.pi / 2.0)
    bending = D * q**4 / (1.0 + D * q**2 / (E / 2.0 * THICKNESS))

    def state(N: float) -> tuple[float, float]:
        """Pressure, and what is missing in N."""
        c = bending + N * q**2
        p = (deflection + N * (K / c * middle).sum()) / (P / c * middle).sum()
        w = (p * P - N * K) / c
        mean = (w * P / 2.0).sum() / RADIUS + (q**2 * w**2).sum() / 4.0
        return float(p), float(stretch * mean - N)

    critical = D * (np.pi / SPAN) ** 2
    # From above the second symmetric buckling load on; the first root is that of this arch.
    forces = np.linspace(-8.0, 12.0, 201) * critical
    missing = [state(N)[1] for N in forces]
    (at,) = np.flatnonzero(np.diff(np.sign(missing)))
    N = brentq(lambda N: state(N)[1], forces[at], forces[at + 1], xtol=1e-12)
    return state(N)[0]


def strip(n: int) -> PlateModel:
    """Half of the arch, one element wide, without Poisson's effect."""
    coordinates, elements = quarter_mesh(SPAN, 10.0, n, 1)
    restrained = nothing(coordinates)
    restrained[:, [1, 4]] = True
    restrained[np.isclose(coordinates[:, 0], 0.0)] |= np.array([1, 0, 0, 1, 0], dtype=bool)
    restrained[np.isclose(coordinates[:, 0], SPAN / 2.0)] |= np.array([1, 1, 1, 0, 0], dtype=bool)
    ply = model.Ply(1e-9, 0.0, E, E, E / 2.0, E / 2.0, E / 2.0)
    return PlateModel(
        with_restraints(coordinates, elements, restrained),
        laminate(ply, [0.0], [THICKNESS]),
        RULES,
        nonlinear=True,
        curvature=(1.0 / RADIUS, 0.0, 0.0),
    )


def test_an_arch_snaps_through_along_the_exact_curve() -> None:
    plate = strip(12)
    load, weights = pressure(plate), np.zeros(len(plate.mesh.coordinates))
    weights[np.hypot(*plate.mesh.coordinates.T).argmin()] = 1.0
    field, actual = None, []
    deflections = np.arange(1.0, 6.1)
    for deflection in deflections:
        state = equilibrium(plate, load, weights, deflection, field)
        field = state.field
        actual.append(state.load)
    wanted = [arch(deflection) for deflection in deflections]
    largest = max(wanted[:3])
    assert min(wanted) < -0.1 * largest  # it does snap through
    np.testing.assert_allclose(actual, wanted, rtol=0.0, atol=1e-5 * largest)


# A roof ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("thickness", "limit"), [(12.7, 2200.0), (6.35, 590.0)])
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_a_hinged_roof_carries_the_published_load(thickness: float, limit: float) -> None:
    """A. B. Sabir and A. C. Lock (1972): a force on 508 x 508 mm, R = 2540 mm; about 1 %."""
    modulus, nu = 3102.75, 0.3
    shear = modulus / 2.0 / (1.0 + nu)
    ply = model.Ply(1e-9, nu, modulus, modulus, shear, 5 / 6 * shear, 5 / 6 * shear)
    coordinates, elements = quarter_mesh(508.0, 508.0, 4)
    restrained = nothing(coordinates)
    for axis in (0, 1):
        restrained[np.isclose(coordinates[:, axis], 0.0)] |= np.arange(5) % 3 == axis
    restrained[np.isclose(coordinates[:, 1], 254.0)] |= np.arange(5) < 4
    plate = PlateModel(
        with_restraints(coordinates, elements, restrained),
        laminate(ply, [0.0], [thickness]),
        RULES,
        nonlinear=True,
        curvature=(0.0, -1.0 / 2540.0, 0.0),
    )
    weights = np.zeros(len(coordinates))
    weights[np.hypot(*coordinates.T).argmin()] = 1.0
    field, loads = None, []
    for deflection in (4.0, 8.0, 11.0, 13.0, 14.0):
        state = equilibrium(plate, weights / 4.0, weights, deflection, field)
        field = state.field
        loads.append(state.load)
    assert max(loads) == pytest.approx(limit, rel=0.015)
    assert loads[-1] < max(loads)


@pytest.mark.long
def test_an_estimate_of_a_panel_that_snaps_through_ends_at_the_load_that_it_carries() -> None:
    def estimate(radius: float, velocity: float) -> QuickEstimate:
        deck = struck((0.0, radius), mesh(5), 5e-7, 10, others=(NONL,), velocity=velocity)
        return quick_estimate(load_deck(deck).problems[0])

    snapped = estimate(-500.0, 15000.0)
    assert [one.name for one in snapped.models] == ["infinite plate", "static plate"]
    (limit,) = re.findall(r"the panel snaps through at the force ([\d.]+)", snapped.remark)
    slower = [estimate(-500.0, velocity).models[-1].impact.peak for velocity in (3000.0, 9000.0)]
    assert slower[0] < slower[1] < 1.001 * float(limit)
    assert estimate(500.0, 15000.0).models[-1].name == "nonlinear static plate"


# Stresses ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("radii", [(500.0,), (0.0, -500.0), (0.0, 0.0, 400.0)])
@pytest.mark.few(1)  # of 3, 0.3 s each
def test_stresses_at_a_small_load_are_those_of_the_linear_panel(radii: tuple[float, ...]) -> None:
    """Deflections below 2e-6 mm: the squares of slopes are nothing beside w/R."""
    solved = "LOOP=5 TANG FORM SOLV CONV NEXT STRE"
    bent, linear = (
        decks.run_of_deck(panel(radii, solved, load=1e-4, others=others)) for others in ([NONL], [])
    )
    for name in ("eps_xx", "eps_yy", "gamma_xy", "N_x", "N_y", "N_xy", "M_x", "M_y", "M_xy"):
        expected = linear[f"stresses/{name}"][-1]
        close = 1e-5 * np.abs(expected).max()
        np.testing.assert_allclose(bent[f"stresses/{name}"][-1], expected, 0.0, close, err_msg=name)


# Impact ------------------------------------------------------------------------------------------


@cache
def stretched(radius: float, velocity: float, steps: int = 300) -> Result:
    """A panel struck so hard that it stretches, or so softly that it does not."""
    struck_plate = struck(
        (0.0, radius), mesh(12), 5e-7, steps, others=(NONL,), velocity=velocity, every=50
    )
    return decks.run_of_deck(struck_plate)


def test_small_deflections_are_those_of_the_linear_panel() -> None:
    one = stretched(-500.0, 0.1)
    linear = decks.run_of_deck(struck((0.0, -500.0), mesh(12), 5e-7, 300, velocity=0.1, every=50))
    close = 1e-5 * linear.history.force.max()
    np.testing.assert_allclose(one.history.force, linear.history.force, rtol=0.0, atol=close)


def test_a_panel_struck_hard_keeps_its_energy_and_softens_or_stiffens_by_its_side() -> None:
    outside, inside = (stretched(radius, 60000.0) for radius in (-500.0, 500.0))
    energy = 0.5 * 2e-5 * 60000.0**2
    for actual in (outside, inside):
        assert np.abs(actual.energy.balance_error).max() < 1e-4 * energy
        rows = np.searchsorted(actual.energy.step, actual.membrane.step)
        np.testing.assert_allclose(
            actual.membrane.strain_energy, actual.energy.plate_strain[rows], rtol=1e-9
        )
    assert outside.history.plate_w.max() > 1.02 * inside.history.plate_w.max()
    assert inside.history.plate_w.max() > curved_panels.THICKNESS
