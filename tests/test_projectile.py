"""The rod: stiffness, mass and Wilson's integration, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from fecm import Rod
from fecm.mechanics.projectile import RodState, WilsonStep, report_rod, rigid_approach
from tests.builders import displacement


def test_the_reports_rod_weighs_what_page_81_says() -> None:
    assert report_rod().total_mass == pytest.approx(0.000181, rel=1e-3)
    assert report_rod().total_mass == pytest.approx(1.8096e-4, rel=1e-4)
    assert report_rod(0.0003225).total_mass == pytest.approx(8.49e-5, rel=1e-3)


def test_lumped_masses_of_the_displacements_add_up_to_the_whole() -> None:
    rod = report_rod()
    assert rod.mass()[::2].sum() == pytest.approx(rod.total_mass, rel=1e-14)


def test_a_rigid_displacement_costs_nothing_and_a_uniform_strain_costs_half_e_a_l() -> None:
    rod = Rod(length=2.0, diameters=(0.5,) * 7, modulus=3.0e7, density=7e-4)
    K = rod.stiffness()
    rigid = np.tile([1.0, 0.0], 8)
    x = np.linspace(0.0, 2.0, 8)
    uniform = np.column_stack([1e-3 * x, np.full(8, 1e-3)]).ravel()
    area = np.pi * 0.25**2
    assert np.abs(K @ rigid).max() < 1e-7 * np.abs(K).max()
    assert 0.5 * uniform @ K @ uniform == pytest.approx(0.5 * 3.0e7 * area * 1e-6 * 2.0, rel=1e-12)


def test_cubic_displacements_have_their_exact_strain_energy() -> None:
    rod = Rod(length=1.0, diameters=(0.5,) * 3, modulus=2.0, density=1.0)
    x = np.linspace(0.0, 1.0, 4)
    cubic = np.column_stack([x**3, 3 * x**2]).ravel()
    area = np.pi * 0.25**2
    # 1/2 E A integral of (3 x^2)^2.
    assert 0.5 * cubic @ rod.stiffness() @ cubic == pytest.approx(0.5 * 2.0 * area * 9 / 5)


def test_a_rigid_approach_stays_rigid_and_uniform() -> None:
    rod = report_rod()
    step = WilsonStep(rod.stiffness(), rod.mass(), 2e-7)
    state = rigid_approach(rod, 115.0)
    for _ in range(50):
        state = step.advance(state)
    np.testing.assert_allclose(displacement(state)[::2], -115.0 * 50 * 2e-7, rtol=1e-12)
    np.testing.assert_allclose(state.velocity[::2], -115.0, rtol=1e-12)
    assert np.abs(displacement(state)[1::2]).max() < 1e-12


def test_a_constant_push_gives_the_impulse_of_newtons_law() -> None:
    rod = report_rod()
    step = WilsonStep(rod.stiffness(), rod.mass(), 2e-7)
    state = rigid_approach(rod, 0.0)
    for _ in range(400):
        state = step.advance(state, 10.0)
    m = rod.mass()[::2]
    momentum = float(m @ state.velocity[::2])
    # Wilson's method takes the force a little late in the first step only.
    assert momentum == pytest.approx(10.0 * 400 * 2e-7, rel=5e-3)


def test_a_wave_runs_along_the_rod_at_the_bar_velocity() -> None:
    rod = Rod(length=10.0, diameters=(0.5,) * 200, modulus=3.0e7, density=7e-4)
    dt = 2e-8 * 5
    step = WilsonStep(rod.stiffness(), rod.mass(), dt)
    state = rigid_approach(rod, 0.0)
    steps = int(4.0 / np.sqrt(3.0e7 / 7e-4) / dt)  # until the front is at x = 4
    for _ in range(steps):
        state = step.advance(state, 100.0)
    x = np.linspace(0.0, 10.0, 201)
    velocity = state.velocity[::2]
    behind = 100.0 / (np.pi * 0.25**2 * np.sqrt(3.0e7 * 7e-4))  # F / (A sqrt(E rho))
    front = x[np.argmax(velocity < 0.5 * behind)]
    assert front == pytest.approx(4.0, abs=0.1)
    assert velocity[(x > 0.5) & (x < 3.0)].mean() == pytest.approx(behind, rel=0.02)


def test_wilson_damps_no_mode_below_a_hundredth_of_its_period_per_step() -> None:
    # Energy of the free rod after a push: lost only in the modes that the step can't resolve.
    rod = Rod(length=1.0, diameters=(0.5,) * 20, modulus=3.0e7, density=7e-4)
    K, m = rod.stiffness(), rod.mass()
    step = WilsonStep(K, m, 1e-7)
    x = np.linspace(0.0, 1.0, 21)
    u = np.column_stack([np.cos(np.pi * x), -np.pi * np.sin(np.pi * x)]).ravel() * 1e-4
    state = RodState.of(u, 0.0 * u, -(K @ u) / m)
    energy = [0.0, 0.0]
    for when in (0, 1):
        energy[when] = float(
            0.5 * m @ state.velocity**2 + 0.5 * displacement(state) @ K @ displacement(state)
        )
        for _ in range(98):  # a period of the first free mode, 2 L / c = 9.66e-6 s
            state = step.advance(state)
    assert energy[1] == pytest.approx(energy[0], rel=1e-3)
