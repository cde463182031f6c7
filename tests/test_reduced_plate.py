"""Nonlinear plates in a few modes: energy, motion, contact in series, and impacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.special import ellipk

from fecm import ContactPoint
from fecm.mechanics import reduced_plate as reduction
from fecm.mechanics.contact_law import HystereticLaw, LinearPermanent
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.membrane import MembraneForces
from fecm.mechanics.mesh import equation_numbers
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.points import DISC, patch_weights
from fecm.mechanics.quick_models import static_curve
from fecm.mechanics.reduced_plate import (
    ReducedMotion,
    ReducedPlate,
    ReductionError,
    SeriesLaw,
    _bending_mass,
    bending_vectors,
    reduced_plate,
    ritz_vectors,
)
from fecm.mechanics.solutions import Tangent, modes, static_stiffness
from fecm.mechanics.strains import FLAT, Curvature
from fecm.mechanics.symmetry import SymmetryReduction, unreduced
from tests.builders import (
    Floats,
    boundary,
    distorted_square,
    general_plate,
    isotropic_plate,
    nothing,
    square,
    with_restraints,
)
from tests.nonlinear_plates import RULES

THICKNESS = 0.02  # of the isotropic plates, on the unit square


def on_square(
    lam: LaminateSection, *, held: bool, n: int = 4, distorted: bool = False
) -> PlateModel:
    """Simply supported unit square, its edges held in the plane or free there."""
    coordinates, elements = (distorted_square if distorted else square)(n, n)
    edge = boundary(coordinates, elements)[:, 0]
    restrained = nothing(coordinates)
    restrained[edge, 2] = True
    restrained[edge, :2] = held
    mesh = with_restraints(coordinates, elements, restrained)
    return PlateModel(mesh, lam, RULES, nonlinear=True)


def patch_on(plate: PlateModel, x: float = 0.5, y: float = 0.5) -> Floats:
    """A unit force on a disc, (numnp, 5)."""
    contact = np.zeros(plate.mesh.equations.shape)
    contact[:, 2] = patch_weights(plate.mesh, DISC, 0.1, x, y)
    return contact


def relaxed_energy(plate: PlateModel, field: Floats) -> float:
    """Strain energy of the elements with w and rotations given, u and v in equilibrium."""
    codes = plate.mesh.codes.copy()
    codes[:, 2:] = 1
    inner = replace(plate.mesh, codes=codes, equations=equation_numbers(codes))
    membrane, free = MembraneForces(plate), plate.mesh.equations > 0

    def forces(field: Floats) -> tuple[Floats, float]:
        quadratic, work = membrane.forces(field)
        total = np.zeros_like(field)
        total[free] = plate.stiffness @ field[free]
        return total + quadratic, work

    actual = field.copy()
    in_plane = inner.equations > 0
    actual[in_plane] -= Tangent(replace(plate, mesh=inner)).solve(forces(field)[0][in_plane])
    total, work = forces(actual)
    return 0.5 * float((actual * total).sum() - work)


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("curvature", [FLAT, (0.05, -0.1, 0.02)])
@pytest.mark.parametrize("lam", [isotropic_plate(THICKNESS), general_plate()])
@pytest.mark.few(3)  # of 8, 0.08 s each
def test_the_energy_is_that_of_the_elements_with_the_membrane_in_equilibrium(
    lam: LaminateSection, curvature: Curvature, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reduction, "SPRING", -1.0)  # all vectors are coordinates
    plate = replace(on_square(lam, held=held, distorted=True), curvature=curvature)
    plate = plate if lam.is_coupled else replace(plate, preload=(1e-5, -2e-6, 3e-6))
    reduced = reduced_plate(plate, patch_on(plate, 0.6, 0.45), 5, error=0.0, has_fields=True)
    assert reduced.fields is not None
    bending, count = reduced.bending, reduced.shapes
    static = reduced.deflection[:bending] / reduced.stiffness[:bending]
    z = reduced.part @ (static * (1.0 + 0.5 * np.cos(np.arange(bending) + 1.0)))
    bent = reduced.part.T @ z / reduced.stiffness[:bending]
    largest = np.abs(reduced.fields.moving[:bending, :, 2].T @ bent).max()
    z, bent = (1.5 * lam.thickness / largest * values for values in (z, bent))
    first, second = np.triu_indices(count)
    membrane = -(reduced.cubic[count:] @ (z[first] * z[second])) / reduced.stiffness[bending:]
    q = np.append(bent, membrane)
    field = reduced.fields.fields(reduced.fields.amplitudes(q[None], np.zeros(1)))[0]
    energy = reduced.strain_energy(q[:, None])
    assert energy[0] == pytest.approx(relaxed_energy(plate, field), rel=1e-8)
    linear = 0.5 * float((reduced.stiffness[:bending] * bent * bent).sum())
    assert energy[0] > 1.04 * linear  # the plate does stretch


def test_internal_forces_are_the_gradient_of_the_energy() -> None:
    plate = on_square(general_plate(), held=False)
    reduced = reduced_plate(plate, patch_on(plate), 4)
    n = len(reduced.stiffness)
    assert n > reduced.bending  # membrane modes too
    q = 0.1 * np.cos(np.arange(n) + 1.0)[:, None]
    step = 1e-5
    moved = q + step * np.hstack([np.eye(n), -np.eye(n)])
    energy = reduced.strain_energy(moved)
    slope = (energy[:n] - energy[n:]) / (2.0 * step)
    exact = reduced.internal_forces(q)[:, 0]
    assert np.abs(slope - exact).max() < 1e-7 * np.abs(exact).max()


def test_ritz_vectors_that_the_load_moves_most_are_modes_of_the_plate() -> None:
    plate = on_square(isotropic_plate(THICKNESS), held=True, n=3)
    oblong = plate.mesh.coordinates * (1.0, 0.73)  # no two modes of equal frequency
    plate = replace(plate, mesh=replace(plate.mesh, coordinates=oblong))
    contact = patch_on(plate, 0.4, 0.38)
    load = contact[plate.mesh.equations > 0]
    static, *krylov = bending_vectors(plate, contact, 60)
    vectors = ritz_vectors(plate.stiffness, _bending_mass(plate), load, krylov)
    every = modes(plate, plate.neq, consistent=False)
    shares = (every.shapes @ load / every.angular_frequency) ** 2
    largest, found = np.argsort(-shares)[:6], np.argsort(-vectors.shares)[:6]
    assert vectors.stiffness[found] == pytest.approx(
        every.angular_frequency[largest] ** 2, rel=1e-9
    )
    assert vectors.shares[found] == pytest.approx(shares[largest], rel=1e-6)
    assert 1.0 / (load @ static) == pytest.approx(static_stiffness(plate, contact), rel=1e-10)


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("lam", [isotropic_plate(THICKNESS), general_plate()])
def test_half_of_a_plate_that_a_half_turn_maps_onto_itself_gives_the_modes_of_the_whole(
    lam: LaminateSection, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    plate = on_square(lam, held=held)
    oblong = plate.mesh.coordinates * (1.0, 0.73)  # no two modes of equal frequency
    plate = replace(plate, mesh=replace(plate.mesh, coordinates=oblong))
    contact = patch_on(plate, 0.5, 0.365)
    half = reduced_plate(plate, contact, 4, error=0.0)
    seen: list[PlateModel] = []

    def whole_plate(model: PlateModel, _: Floats | None) -> SymmetryReduction:
        seen.append(model)
        return unreduced(model)

    monkeypatch.setattr(reduction, "symmetry_reduction", whole_plate)
    whole = reduced_plate(plate, contact, 4, error=0.0)
    assert seen
    assert half.shapes == whole.shapes >= 4
    # Vectors beyond the modes depend on rounding.
    assert half.stiffness[0] == pytest.approx(whole.stiffness[0], rel=1e-9)
    bent = [plate.deflection[:, None] / plate.stiffness[:, None] for plate in (half, whole)]
    actual, wanted = (
        plate.strain_energy(q * THICKNESS / (plate.deflection @ q))
        for plate, q in zip((half, whole), bent, strict=True)
    )
    assert actual == pytest.approx(wanted, rel=2e-4)


def test_few_modes_and_the_spring_have_the_static_stiffness_of_the_plate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(reduction, "SPRING", 0.03)
    plate = on_square(isotropic_plate(THICKNESS), held=True)
    reduced = reduced_plate(plate, patch_on(plate), 3)
    compliance = (reduced.deflection**2 / reduced.stiffness).sum() + reduced.flexibility
    assert 0.001 * compliance < reduced.flexibility < 0.03 * compliance
    assert 1.0 / compliance == pytest.approx(static_stiffness(plate, patch_on(plate)), rel=1e-10)


@pytest.mark.parametrize("curvature", [FLAT, (0.05, -0.1, 0.02)])
def test_the_static_curve_is_that_of_the_elements_up_to_two_thicknesses(
    curvature: Curvature,
) -> None:
    plate = replace(on_square(isotropic_plate(THICKNESS), held=True), curvature=curvature)
    contact, h = patch_on(plate, 0.6, 0.45), THICKNESS
    curve = static_curve(plate, contact, 0.25 * h, lambda w, force, work: w > 2.0 * h)
    reduced = reduced_plate(plate, contact, 6)

    def balance(values: Floats, w: float) -> Floats:
        q, force = values[:-1] / scale, values[-1]
        forces = reduced.internal_forces(q[:, None])[:, 0] - force * reduced.deflection
        moved = float(reduced.deflection @ q) + reduced.flexibility * force
        return np.append(forces / scale, (moved - w) / w)

    scale = np.sqrt(reduced.stiffness)
    start = np.zeros(len(scale) + 1)
    for w in (0.5 * h, h, 1.5 * h, 2.0 * h):
        start = fsolve(balance, start, args=(w,), xtol=1e-10)
        assert start[-1] == pytest.approx(float(curve.at(w)[0]), rel=5e-3)
    assert start[-1] > 1.5 * 2.0 * h * static_stiffness(plate, contact)


def test_a_plate_that_is_not_held_has_no_reduced_model() -> None:
    coordinates, elements = square(2, 2)
    mesh = with_restraints(coordinates, elements, nothing(coordinates))
    plate = PlateModel(mesh, isotropic_plate(THICKNESS), RULES, nonlinear=True)
    with pytest.raises(ReductionError, match="a plate that is held"):
        reduced_plate(plate, patch_on(plate), 3)


# Motion ------------------------------------------------------------------------------------------


def one_mode(quartic: float = 0.0, damping: float = 0.0) -> ReducedPlate:
    """An oscillator of frequency 1 with the energy q^2/2 + quartic q^4/2."""
    return ReducedPlate(
        part=np.ones((1, 1)),
        stiffness=np.array([1.0]),
        deflection=np.array([1.0]),
        flexibility=0.0,
        cubic=np.zeros((1, 1)),
        factor=np.array([[quartic**0.5]]),
        damping=damping,
    )


def test_a_linear_mode_under_a_constant_force_is_exact_at_any_step() -> None:
    dt = 1.3
    motion = ReducedMotion(one_mode(), dt, 1)
    # Central differences from rest: half of the force in the first step.
    values = [motion.advance(np.array([0.5 if step == 0 else 1.0]))[0] for step in range(20)]
    exact = 1.0 - np.cos(dt * np.arange(1, 21))
    assert np.abs(values - exact).max() < 1e-12


def test_the_period_of_a_duffing_oscillator_is_that_of_jacobi() -> None:
    quartic, dt = 0.4, 0.02
    motion = ReducedMotion(one_mode(quartic), dt, 1)
    pushed = [motion.advance(np.array([1.0 if step < 60 else 0.0]))[0] for step in range(3000)]
    w = np.array(pushed[100:])
    amplitude = np.abs(w).max()
    # q'' + q + 2 c q^3 = 0: T = 4 K(m)/sqrt(1 + e), e = 2 c A^2, m = e/(2 (1 + e)).
    e = 2.0 * quartic * amplitude**2
    period = 4.0 * ellipk(e / (2.0 * (1.0 + e))) / np.sqrt(1.0 + e)
    rising = np.flatnonzero((w[:-1] < 0.0) & (w[1:] >= 0.0))
    at = rising - w[rising] / (w[rising + 1] - w[rising])
    measured = dt * (at[-1] - at[0]) / (len(at) - 1)
    assert e > 0.3
    assert measured == pytest.approx(period, rel=1e-4)


@pytest.mark.parametrize("damping", [0.0, 0.03])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_free_vibration_keeps_its_energy_with_that_of_the_damping(damping: float) -> None:
    dt, none = 0.05, np.zeros(1)
    motion = ReducedMotion(one_mode(0.2, damping), dt, 1)
    for _ in range(20):
        motion.advance(np.ones(1))
    motion.advance(none)
    before = motion.energy(none)[0]
    w = np.array([motion.advance(none)[0] for _ in range(4000)])
    assert motion.energy(none)[0] == pytest.approx(before, rel=3e-4)
    # By 1/2 a of the velocity, where the amplitude is small and the frequency 1.
    late, end = np.abs(w[3400:3600]).max(), np.abs(w[3800:]).max()
    assert end / late == pytest.approx(np.exp(-0.5 * damping * 400 * dt), rel=0.01)


def test_no_case_depends_on_the_others() -> None:
    plate = on_square(isotropic_plate(THICKNESS), held=True, n=2)
    reduced = reduced_plate(plate, patch_on(plate), 4)
    forces = np.linspace(1e-6, 1e-4, 70)
    dt = 0.2 / reduced.fastest
    together, alone = ReducedMotion(reduced, dt, 70), ReducedMotion(reduced, dt, 1)
    w = [together.advance(forces)[41] for _ in range(30)]
    values = [alone.advance(forces[41:42])[0] for _ in range(30)]
    assert w == values


# Contact in series -------------------------------------------------------------------------------


def test_a_law_in_series_with_a_spring_has_the_sum_of_their_displacements() -> None:
    k, flexibility = 2.0, 0.6
    cases = np.ones(3)
    inner = HystereticLaw(LinearPermanent(k * cases, 0.1 * cases, 0.3 * cases, 2.5 * cases))
    law = SeriesLaw(inner, flexibility)
    memory, last = law.start(), ContactPoint(0.0 * cases, 0.0 * cases)
    depths = np.concatenate([np.linspace(0.05, 1.0, 20), np.linspace(0.95, 0.3, 14), [0.8, 1.4]])
    for depth in depths:
        value = depth * np.array([1.0, 0.5, -1.0])
        force, memory = law.trial(memory, last, value)
        point = ContactPoint(value, force)
        memory_of_law = memory
        memory = law.accept(memory, last, value)
        again, _ = inner.trial(memory_of_law, law.of_law(last), law.of_law(point).indentation)
        assert force == pytest.approx(again, rel=1e-6, abs=1e-12)
        last = point
    assert last.force[2] == 0.0
    # On the first loading curve again: a + k a^1.5/k_r = 1.4.
    a = law.of_law(last).indentation[0]
    assert a + flexibility * k * a**1.5 == pytest.approx(1.4, rel=1e-8)
    assert law.permanent(memory, last)[0] == pytest.approx(0.3 * (a - 0.1), rel=1e-8)


def test_no_trial_depends_on_the_other_cases() -> None:
    def force(k: Floats) -> Floats:
        one = np.ones(len(k))
        law = SeriesLaw(HystereticLaw(LinearPermanent(k, 1e9 * one, 0.0 * one, 1.5 * one)), 0.1)
        actual, _ = law.trial(law.start(), ContactPoint(0.0 * one, 0.0 * one), one)
        return actual

    rigidities = np.array([0.1, 2.0, 1e5])
    together = force(rigidities)
    assert together.tolist() == [float(force(k)[0]) for k in rigidities[:, None]]


def test_a_spring_softer_than_the_contact_converges() -> None:
    cases = np.ones(1)
    inner = HystereticLaw(LinearPermanent(1e6 * cases, 1e9 * cases, 0.0 * cases, 1.5 * cases))
    law = SeriesLaw(inner, 1.0)
    force, _ = law.trial(law.start(), ContactPoint(0.0 * cases, 0.0 * cases), cases)
    assert (force / 1e6) ** (2.0 / 3.0) + force == pytest.approx(cases, rel=1e-8)
