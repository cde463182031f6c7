"""Mass matrices and integrators of the rod, against closed forms and the equations themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigh

import fecm
from fecm import Result, Rod
from fecm.mechanics.projectile import (
    AVERAGE,
    CONSISTENT,
    INTEGRATORS,
    LUMPED,
    MASSES,
    STEPS,
    WILSON,
    Integrator,
    RodIntegrator,
    RodState,
    report_rod,
)
from tests.builders import displacement
from tests.calls import call
from tests.decks import DATA_CARDS, small

Floats = NDArray[np.float64]

BOTH = [(mass, integrator) for mass in MASSES for integrator in INTEGRATORS]


def uniform(elements: int, mass: str = LUMPED) -> Rod:
    """A rod in which waves need the time 1 from end to end."""
    return Rod(1.0, (0.5,) * elements, 3.0, 3.0).with_mass(mass)


def matrix(rod: Rod) -> Floats:
    """The rod's mass as a matrix."""
    m = rod.mass()
    return np.diag(m) if m.ndim == 1 else m


def frequencies(rod: Rod, count: int) -> Floats:
    """Lowest angular frequencies above the rigid motion's zero."""
    squares = eigh(rod.stiffness(), matrix(rod), eigvals_only=True)
    return np.asarray(np.sqrt(squares[1 : count + 1]))


# Mass --------------------------------------------------------------------------------------------


def test_the_consistent_mass_moves_rigidly_with_the_whole_mass() -> None:
    rod = report_rod().with_mass(CONSISTENT)
    rigid = np.tile([1.0, 0.0], 21)
    assert rigid @ rod.mass() @ rigid == pytest.approx(rod.total_mass, rel=1e-13)


def test_the_consistent_mass_holds_the_kinetic_energy_of_cubic_velocities() -> None:
    rod = Rod(1.0, (0.5,) * 3, 2.0, 1.7).with_mass(CONSISTENT)
    x = np.linspace(0.0, 1.0, 4)
    v = np.column_stack([x**3 - x, 3 * x**2 - 1]).ravel()
    area = np.pi * 0.25**2
    # 1/2 rho A times the integral of (x^3 - x)^2, which is 8/105.
    assert rod.kinetic_energy(v[None])[0] == pytest.approx(0.5 * 1.7 * area * 8 / 105, rel=1e-12)


def test_consistent_frequencies_come_down_to_the_exact_ones_with_the_sixth_power() -> None:
    exact = np.pi * np.arange(1, 4)
    errors = np.array([frequencies(uniform(n, CONSISTENT), 3) / exact - 1.0 for n in (4, 16, 32)])
    assert (errors > 0.0).all()
    assert np.log2(errors[1] / errors[2]) == pytest.approx(6.0, abs=0.25)
    assert errors[2].max() < 1e-8


def test_lumped_frequencies_come_up_to_the_exact_ones_with_the_square() -> None:
    # Two masses rho A L^3/420 a node add k^2 L^2/210 to the mass of a wave, so that its frequency
    # misses k^2 L^2/420; the ends miss a term in L^3, which two meshes together leave out.
    k = np.pi * np.arange(1, 4)
    coarse, fine = (1.0 - frequencies(uniform(n), 3) / k for n in (64, 128))
    assert (fine > 0.0).all()
    assert 8.0 * fine - coarse == pytest.approx((k / 64) ** 2 / 420.0, rel=0.05)
    assert np.log2(coarse / fine) == pytest.approx(2.4, abs=0.1)


# Steps -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mass", "integrator"), BOTH)
def test_a_step_meets_the_equation_of_motion_at_its_own_instant(
    mass: str, integrator: Integrator
) -> None:
    rod = uniform(3, mass)
    K, M, n = rod.stiffness(), matrix(rod), 8
    dt, force = 0.07, 0.9
    u, v, a = np.random.default_rng(4).normal(size=(3, n))
    theta, beta = {WILSON: (1.4, 1.0 / 6.0), AVERAGE: (1.0, 0.25)}[integrator]
    s = theta * dt
    # (M + beta s^2 K) a_theta = f - K (u + s v + (1/2 - beta) s^2 a)
    push = np.eye(n)[0] * force
    known = u + s * v + (0.5 - beta) * s**2 * a
    there = np.linalg.solve(M + beta * s**2 * K, push - K @ known)
    new = a + (there - a) / theta
    step = STEPS[integrator](K, rod.mass(), dt)
    state = RodState.of(u, v, a)
    after = step.advance(state, force)
    np.testing.assert_allclose(after.acceleration, new, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(after.velocity, v + dt * (a + new) / 2, rtol=1e-9, atol=1e-11)
    moved = u + dt * v + dt**2 * ((0.5 - beta) * a + beta * new)
    np.testing.assert_allclose(displacement(after), moved, rtol=1e-9, atol=1e-11)
    begin, end = step.weights
    assert after.tip == pytest.approx(u[0] + dt * v[0] + begin * a[0] + end * new[0], rel=1e-12)


@pytest.mark.parametrize(("mass", "integrator"), BOTH)
def test_a_constant_push_gives_exactly_its_impulse(mass: str, integrator: str) -> None:
    rod = report_rod().with_mass(mass)
    M = matrix(rod)
    step = STEPS[integrator](rod.stiffness(), rod.mass(), 2e-7)
    push = np.eye(42)[0] * 10.0
    start: Floats = np.asarray(np.linalg.solve(M, push), dtype=np.float64)
    state = RodState.of(0 * push, 0 * push, start)
    for _ in range(400):
        state = step.advance(state, 10.0)
    rigid = np.tile([1.0, 0.0], 21)
    assert rigid @ M @ state.velocity == pytest.approx(10.0 * 400 * 2e-7, rel=1e-9)


def energies(step: RodIntegrator, rod: Rod, steps: int) -> Floats:
    """Energy of a rod that was let go out of a jagged shape, after every step."""
    u = np.random.default_rng(9).normal(size=step.n)
    start: Floats = np.asarray(np.linalg.solve(matrix(rod), -rod.stiffness() @ u), dtype=np.float64)
    state = RodState.of(u, 0 * u, start)
    values = []
    for _ in range(steps + 1):
        kinetic = rod.kinetic_energy(state.velocity[None])[0]
        values.append(float(kinetic + rod.strain_energy(state.deformation[None])[0]))
        state = step.advance(state)
    return np.array(values)


@pytest.mark.parametrize("mass", MASSES)
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_average_acceleration_keeps_the_energy_of_every_mode_at_any_step(mass: str) -> None:
    rod = uniform(10, mass)
    for dt in (0.01, 0.3):
        step = STEPS[AVERAGE](rod.stiffness(), rod.mass(), dt)
        held = energies(step, rod, 300)
        np.testing.assert_allclose(held, held[0], rtol=1e-10)


def test_wilson_loses_the_energy_of_modes_that_its_step_can_not_follow() -> None:
    rod = uniform(10)
    held = energies(STEPS[WILSON](rod.stiffness(), rod.mass(), 0.05), rod, 1000)
    assert held[-1] < 0.1 * held[0]


# Runs --------------------------------------------------------------------------------------------


def result(**options: Any) -> Result:
    """Result of the small plate."""
    return fecm.run_one(small(), **options)


@pytest.mark.parametrize(("mass", "integrator"), BOTH)
def test_every_choice_meets_the_law_and_keeps_the_energy(mass: str, integrator: str) -> None:
    actual = result(rod_mass=mass, rod_integrator=integrator)
    # Were the iteration's weights not the step's own, force and accepted indentation would differ.
    assert actual.force == pytest.approx(1912000.0 * actual.indentation**1.5, rel=2e-6)
    assert actual.history.attributes["unsettled_steps"] == 0
    initial = actual.energy.attributes["initial"]
    assert initial == pytest.approx(0.5 * 1.8096e-4 * 115.0**2, rel=1e-4)
    assert np.abs(actual.energy.balance_error).max() < 1e-4 * initial


def test_a_result_tells_its_choices_and_nothing_of_the_default() -> None:
    chosen = result(rod_mass=CONSISTENT, rod_integrator=AVERAGE)
    assert chosen.attributes["rod_mass"] == "consistent"
    assert chosen.attributes["rod_integrator"] == "average-acceleration"
    default = result()
    assert not {"rod_mass", "rod_integrator"} & set(default.attributes)
    assert (default.acceleration != chosen.acceleration).all()
    same = result(rod_mass=LUMPED, rod_integrator=WILSON)
    np.testing.assert_array_equal(same.acceleration, default.acceleration)


def test_an_unknown_choice_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"rod mass 'heavy'; known are lumped, consistent"):
        fecm.run(small(), rod_mass="heavy")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"rod integrator 'euler'; known are wilson, average"):
        fecm.run(small(), rod_integrator="euler")  # type: ignore[arg-type]


def test_the_first_steps_constants_stay_under_their_slip_with_any_integrator() -> None:
    program = "LMAS\nDT        .5E-6\nRODP\nDT        .2E-6\nLOOP          4\nRODP\nNEXT\n"
    deck = small(program, data=DATA_CARDS)
    for integrator in INTEGRATORS:
        kept, follows = (
            fecm.run(deck, slips=slips, rod_integrator=integrator) for slips in (["rod-dt"], [])
        )
        assert isinstance(kept, Result)
        assert isinstance(follows, Result)
        assert kept.acceleration[0] == follows.acceleration[0]
        assert abs(kept.acceleration[-1] / follows.acceleration[-1] - 1.0) > 1e-3


def test_run_takes_the_choices(tmp_path: Any) -> None:
    deck, out = tmp_path / "small.inp", tmp_path / "out.h5"
    deck.write_text(small())
    options = ("--rod-mass", CONSISTENT, "--rod-integrator", AVERAGE)
    assert call("run", deck, "-o", out, *options).exit_code == 0
    expected = result(rod_mass=CONSISTENT, rod_integrator=AVERAGE)
    np.testing.assert_array_equal(fecm.load(out).force, expected.force)
    assert call("run", deck, "-o", out, "--overwrite", "--rod-mass", "heavy").exit_code == 2
