"""The compiled kernels of FAIL: strains, exposures, and what they need not evaluate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from fecm._typing import Floats
from fecm.api import load_deck
from fecm.deck.model import Allowables, Ply
from fecm.mechanics import kernels
from fecm.mechanics.elements import gauss
from fecm.mechanics.exposures import OutsideLoad
from fecm.mechanics.failure import Strengths
from fecm.mechanics.failure_monitor import FailureEnvelope, FailureMonitor
from fecm.mechanics.kernels import failure as compiled_failure
from fecm.mechanics.kernels.failure import CompiledMonitor
from fecm.mechanics.kernels.midplane import CompiledMidplane
from fecm.mechanics.laminate import laminate
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.own_criterion import OwnCriterion
from fecm.mechanics.ply_stresses import PlyStresses
from fecm.results.sinks import MemorySink
from fecm.simulation.run import run
from fecm.simulation.simulation import Simulation
from tests.builders import distorted_square, nothing, square, with_restraints
from tests.test_failure_runs import failing

pytestmark = pytest.mark.skipif(kernels.LIBRARY is None, reason="the kernels are not compiled")

PLY = Ply(1.0, 0.28, 181e3, 10.3e3, 7.17e3, 7.17e3, 3.68e3)
STRENGTHS = Allowables(1500.0, 1500.0, 40.0, 246.0, 68.0, 90.0, 60.0)
ANGLES = (45.0, 0.0, -45.0, 90.0, 90.0, -45.0, 0.0, 45.0)
CURVED = (0.02, -0.01, 0.005)


def plate(kind: int = 9, *, regular: bool = False) -> Mesh:
    """A few elements, congruent or distorted."""
    coordinates, elements = (square if regular else distorted_square)(4, 3, kind)
    return with_restraints(coordinates, elements, nothing(coordinates))


def fields(mesh: Mesh, count: int, *, stretched: bool) -> Floats:
    """Displacements that rise, fall and change their sign; u and v are 0 where not `stretched`."""
    draw = np.random.default_rng(7)
    found = draw.normal(size=(count, *mesh.equations.shape))
    found *= 1e-3 * draw.choice([0.01, 0.3, 1.0, -1.0], size=(count, 1, 1))
    # Some multiples of fields before, of which no exposure rises.
    found[2::3] = 0.7 * found[: len(found[2::3])]
    if not stretched:
        found[..., :2] = 0.0
    return found


def history(monitor: FailureMonitor, given: Floats) -> FailureEnvelope:
    """Largest exposures of displacement fields at the times 1, 2, ..."""
    envelope = monitor.start()
    for time, field in enumerate(given, start=1):
        monitor.update(envelope, field, float(time))
    return envelope


def assert_equal(found: FailureEnvelope, wanted: FailureEnvelope, rtol: float) -> None:
    """The same exposures, modes and times."""
    for own, other in ((found.plies, wanted.plies), (found.interfaces, wanted.interfaces)):
        np.testing.assert_allclose(own.exposure, other.exposure, rtol=rtol, atol=0.0)
        np.testing.assert_array_equal(own.time, other.time)
        np.testing.assert_array_equal(own.mode, other.mode)


@pytest.mark.parametrize("kind", [3, 4, 8, 9, 12])
@pytest.mark.parametrize("regular", [True, False])
def test_strains_and_gradients_are_numpys_for_every_family(kind: int, regular: bool) -> None:
    mesh = plate(kind, regular=regular)
    (field,) = fields(mesh, 1, stretched=True)
    initial = np.array([1e-3, -2e-3, 5e-4])
    for curvature in ((0.0, 0.0, 0.0), CURVED):
        for nonlinear in (False, True) if kind == 9 else (False,):
            stresses = PlyStresses(
                mesh,
                laminate(PLY, ANGLES, [0.125] * 8),
                gauss(3 if kind != 3 else 2),
                initial=initial,
                curvature=curvature,
                nonlinear=nonlinear,
            )
            found = CompiledMidplane(stresses).evaluate(field)
            for own, wanted in zip(found, stresses.strains(field), strict=True):
                scale = np.abs(wanted).max(initial=0.0, where=~np.isnan(wanted))
                np.testing.assert_allclose(own, wanted, rtol=0.0, atol=1e-13 * scale)


def norris(ply: Strengths, s1: Floats, s2: Floats, tau: Floats) -> Floats:
    """Norris's criterion."""
    x = np.where(s1 > 0.0, ply.xt, ply.xc)
    y = np.where(s2 > 0.0, ply.yt, ply.yc)
    return np.asarray(np.sqrt((s1 / x) ** 2 + (s2 / y) ** 2 + (tau / ply.s12) ** 2))


Monitors = tuple[CompiledMonitor, FailureMonitor]


def one_laminate(angles: Sequence[float] = ANGLES, **options: object) -> Monitors:
    """Compiled criteria and NumPy's of a plate of one laminate."""
    stack = laminate(PLY, tuple(angles), [0.125] * len(angles))
    stresses = PlyStresses(plate(), stack, gauss(3), **options)  # type: ignore[arg-type]
    return CompiledMonitor(stresses, STRENGTHS), FailureMonitor(stresses, STRENGTHS)


def cured() -> Monitors:
    """With residual stresses."""
    residual = np.random.default_rng(3).normal(scale=10.0, size=(8, 2, 3))
    one, other = one_laminate()
    return one.with_residual([residual]), other.with_residual([residual])


def zones() -> Monitors:
    """Of two laminates, of which a ply has no strengths and others have their own."""
    mesh = plate()
    rows = np.array([0, 2, 3, 7, 9]), np.array([1, 4, 5, 6, 8, 10, 11])
    stacks = [laminate(PLY, angles, [0.125] * len(angles)) for angles in (ANGLES, ANGLES[:3])]
    weak = replace(STRENGTHS, xt=300.0, yt=20.0, s13=10.0)
    strengths: list[list[Allowables | None]] = [
        [*[STRENGTHS] * 3, None, *[weak] * 4],
        [weak, STRENGTHS, STRENGTHS],
    ]
    stresses = PlyStresses(mesh, list(zip(stacks, rows, strict=True)), gauss(3))
    return CompiledMonitor(stresses, strengths), FailureMonitor(stresses, strengths)


def with_own() -> Monitors:
    """With a user's criterion."""
    one, _ = one_laminate()
    own = [OwnCriterion("norris", norris).with_modes(STRENGTHS)]
    stresses = one.stresses
    return (
        CompiledMonitor(stresses, STRENGTHS, own),
        FailureMonitor(stresses, STRENGTHS, own),
    )


CASES = {
    "one laminate": one_laminate,
    "an odd number of states": lambda: one_laminate(ANGLES[:5]),
    "as many stiffnesses as plies": lambda: one_laminate(range(0, 90, 10)),
    "preloaded": lambda: one_laminate(initial=np.array([1e-4, 0.0, -1e-4])),
    "curved": lambda: one_laminate(curvature=CURVED),
    "nonlinear": lambda: one_laminate(nonlinear=True),
    "cured": cured,
    "zones": zones,
    "own criterion": with_own,
}


@pytest.mark.parametrize("stretched", [False, True], ids=["bent", "stretched"])
@pytest.mark.parametrize("case", CASES)
def test_what_can_not_rise_is_left_out_without_a_change_of_a_bit(
    case: str, stretched: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled, numpy = CASES[case]()
    given = fields(plate(), 24, stretched=stretched)
    found = history(compiled, given)
    assert_equal(found, history(numpy, given), 1e-10)
    monkeypatch.setattr(compiled_failure, "_share_kept", lambda _: 0.0)
    assert_equal(found, history(compiled, given), 0.0)


@pytest.mark.parametrize("case", CASES)
def test_stretching_after_bending_is_evaluated(case: str) -> None:
    compiled, numpy = CASES[case]()
    given = fields(plate(), 18, stretched=True)
    given[:6, :, :2] = 0.0
    given[12:, :, :2] = 0.0
    assert_equal(history(compiled, given), history(numpy, given), 1e-10)


def test_a_bent_point_whose_outermost_states_stay_below_is_not_evaluated() -> None:
    compiled, _ = one_laminate()
    (field,) = fields(plate(), 1, stretched=False)
    envelope = history(compiled, field[None])
    inner = envelope.plies.exposure.reshape(4, -1, 16)[:, :, 1]
    assert (inner > 0.0).all()
    inner[...] = 0.0  # would rise if it were looked at
    compiled.update(envelope, 0.999 * field, 2.0)
    assert not inner.any()
    compiled.update(envelope, 1.001 * field, 3.0)
    assert (inner > 0.0).all()


def test_exposures_that_are_not_proportional_to_z_are_all_evaluated() -> None:
    """As those of a checkpoint of a plate that was stretched before."""
    compiled, _ = one_laminate()
    (field,) = fields(plate(), 1, stretched=False)
    envelope = history(compiled, field[None])
    inner = envelope.plies.exposure.reshape(4, -1, 16)[:, :, 1]
    inner[...] = 0.0
    envelope.kept = None
    compiled.update(envelope, 0.999 * field, 2.0)
    assert (inner > 0.0).all()


def test_with_extreme_strengths_every_state_is_evaluated() -> None:
    assert compiled_failure._share_kept(STRENGTHS) > 0.0
    for extreme in (
        replace(STRENGTHS, xt=0.01),
        replace(STRENGTHS, yc=1e6),
        replace(STRENGTHS, f12=0.9999),
    ):
        assert compiled_failure._share_kept(extreme) == 0.0


def test_smallest_exposures_are_found_though_their_squares_are_zero() -> None:
    compiled, _ = one_laminate()
    (field,) = fields(plate(), 1, stretched=False)
    envelope = history(compiled, 1e-170 * field[None])
    assert (envelope.plies.exposure.reshape(4, -1, 16)[0, :, 0] > 0.0).all()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_motion_that_is_no_longer_finite_leaves_what_numpy_leaves(value: float) -> None:
    compiled, numpy = one_laminate()
    given = fields(plate(), 2, stretched=False)
    given[1, 0] = value
    with np.errstate(all="ignore"):
        wanted = history(numpy, given)
    found = history(compiled, given)
    np.testing.assert_array_equal(
        np.isnan(found.interfaces.exposure), np.isnan(wanted.interfaces.exposure)
    )
    assert not np.isnan(found.plies.exposure).any()


@pytest.mark.parametrize("case", ["one laminate", "zones", "own criterion"])
def test_the_largest_exposures_outside_the_load_are_those_of_all_states(case: str) -> None:
    compiled, _ = CASES[case]()
    elements, points, _ = compiled.stresses.shape
    draw = np.random.default_rng(5)
    near = draw.random((elements, points)) < 0.1
    x, y = draw.random((2, elements, points))
    outside, envelope = OutsideLoad(near, x, y), compiled.start()
    for time, field in enumerate(fields(plate(), 12, stretched=True)):
        compiled.update(envelope, field, float(time))
        found = outside.largest(envelope)
        exposure = envelope.plies.exposure.reshape(len(envelope.plies.exposure), near.size, -1)
        away = exposure[:, ~near.ravel()]
        known = [0, 1, 2, 3, *range(5, 1 + len(exposure))]  # 4 is that of the interfaces
        np.testing.assert_array_equal(found["exposure"][known], away.max(axis=(1, 2)))
        far = envelope.interfaces.exposure[~near.any(axis=1)]
        assert found["exposure"][4] == (np.nanmax(far) if far.size else np.nan)


def test_the_outermost_states_are_those_farthest_from_the_midplane() -> None:
    """Of [45/0/-45/90]s, two faces of each ply: the outer faces of the outer plies of an angle."""
    compiled, _ = one_laminate()
    (zone,) = compiled.zones
    found = compiled_failure._Outermost.of_run(zone, zone.runs[0])
    assert sorted(found.states.tolist())[:4] == [0, 2, 4, 6]
    assert sorted(found.states.tolist())[-4:] == [9, 11, 13, 15]
    np.testing.assert_allclose(found.share[[1, 3, 15]], [0.75, 2.0 / 3.0, 1.0])


def test_a_restored_run_keeps_nothing_of_the_exposures_after_it() -> None:
    (problem,) = load_deck(failing()).problems
    simulation = Simulation(problem, MemorySink())
    before = simulation.save()
    run(simulation)
    envelope, monitor = simulation.state.failure, simulation.model.failure
    assert envelope is not None
    assert monitor is not None
    points = int(np.prod(monitor.stresses.shape[:2]))
    assert envelope.peaks(points).max() > 0.0
    simulation.restore(before)
    assert envelope.peaks(points).max() == 0.0
