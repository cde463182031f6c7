"""The compiled kernels of FAIL: strains, exposures, and what they need not evaluate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import fecm
from fecm import Ply, Strengths
from fecm._typing import Floats
from fecm.mechanics import kernels
from fecm.mechanics.element_matrices import IntegrationRules
from fecm.mechanics.elements import gauss
from fecm.mechanics.exposures import Evaluations, FailureEnvelope, PlyPoints
from fecm.mechanics.failure import CRITERIA, OwnCriterion
from fecm.mechanics.failure_monitor import FailureMonitor
from fecm.mechanics.kernels import failure as compiled_failure
from fecm.mechanics.kernels.failure import CompiledMonitor
from fecm.mechanics.laminate import laminate
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.ply_stresses import PlyStresses
from fecm.mechanics.symmetry import symmetry_reduction
from fecm.problem.build import build_model
from fecm.problem.loading import load_deck
from fecm.results.sinks import MemorySink
from fecm.simulation.run import run_program
from fecm.simulation.simulation import Simulation
from tests.builders import distorted_square, nothing, square, with_restraints
from tests.test_failure_runs import failing

pytestmark = pytest.mark.skipif(kernels.LIBRARY is None, reason="the kernels are not compiled")

PLY = Ply(1.0, 0.28, 181e3, 10.3e3, 7.17e3, 7.17e3, 3.68e3)
MODULI = {"e1": PLY.e1, "e2": PLY.e2, "nu12": PLY.nu12, "g12": PLY.g12}
STRENGTHS = Strengths(1500.0, 1500.0, 40.0, 246.0, 68.0, 90.0, 60.0, **MODULI)
ANGLES = (45.0, 0.0, -45.0, 90.0, 90.0, -45.0, 0.0, 45.0)
CURVED = (0.02, -0.01, 0.005)


def plate(kind: int = 9, *, regular: bool = False) -> MeshArrays:
    """A few elements, congruent or distorted."""
    coordinates, elements = (square if regular else distorted_square)(4, 3, kind)
    return with_restraints(coordinates, elements, nothing(coordinates))


def fields(mesh: MeshArrays, count: int, *, stretched: bool) -> Floats:
    """Displacements that rise, fall and change their sign; u and v are 0 where not `stretched`."""
    draw = np.random.default_rng(7)
    actual = draw.normal(size=(count, *mesh.equations.shape))
    actual *= 1e-3 * draw.choice([0.01, 0.3, 1.0, -1.0], size=(count, 1, 1))
    # Some multiples of fields before, of which no exposure rises.
    actual[2::3] = 0.7 * actual[: len(actual[2::3])]
    if not stretched:
        actual[..., :2] = 0.0
    return actual


def history(monitor: FailureMonitor, given: Floats) -> FailureEnvelope:
    """Largest exposures of displacement fields at the times 1, 2, ..."""
    envelope = monitor.start()
    monitor.update(envelope, given, times_of(given))
    return envelope


def times_of(given: Floats) -> list[float]:
    """The times 1, 2, ..."""
    return np.arange(1.0, len(given) + 1.0).tolist()


def assert_equal(one: FailureMonitor, other: FailureMonitor, given: Floats, rtol: float) -> None:
    """The same exposures, modes and times in both."""
    actual, wanted = history(one, given), history(other, given)
    pairs = (
        (one.every_state(actual), other.every_state(wanted)),
        (actual.interfaces, wanted.interfaces),
    )
    for own, others in pairs:
        np.testing.assert_allclose(own.exposure, others.exposure, rtol=rtol, atol=0.0)
        np.testing.assert_array_equal(own.time, others.time)
        np.testing.assert_array_equal(own.mode, others.mode)


@pytest.mark.parametrize("kind", [3, 4, 8, 9, 12])
@pytest.mark.parametrize("regular", [True, False])
def test_strains_and_gradients_are_numpys_for_every_family(kind: int, regular: bool) -> None:
    mesh = plate(kind, regular=regular)
    initial = np.array([1e-3, -2e-3, 5e-4])
    flat_and_curved = ((0.0, 0.0, 0.0), CURVED)
    cases: list[dict[str, object]] = [{"stretches": False}]
    for nonlinear in (False, True) if kind == 9 else (False,):
        cases += [
            {"initial": initial, "curvature": curvature, "nonlinear": nonlinear}
            for curvature in flat_and_curved
        ]
    for options in cases:
        stretches = options.get("stretches", True)
        (field,) = fields(mesh, 1, stretched=bool(stretches))
        stack, rule = laminate(PLY, ANGLES, [0.125] * 8), gauss(3 if kind != 3 else 2)
        stresses = PlyStresses(mesh, stack, rule, **options)  # type: ignore[arg-type]
        envelope = history(CompiledMonitor(stresses, STRENGTHS), field[None])
        kept = envelope.kept
        assert isinstance(kept, compiled_failure._Kept)
        actual = kept.strain, kept.structure.held["gradient"]
        for own, wanted in zip(actual, stresses.strains(field), strict=True):
            all_of_it = wanted if stretches else wanted[..., 3:]
            scale = np.abs(all_of_it).max(initial=0.0, where=~np.isnan(all_of_it))
            np.testing.assert_allclose(own, all_of_it, rtol=0.0, atol=1e-13 * scale)


def norris(ply: Strengths, s1: Floats, s2: Floats, tau: Floats) -> Floats:
    """Norris's criterion."""
    x = np.where(s1 > 0.0, ply.xt, ply.xc)
    y = np.where(s2 > 0.0, ply.yt, ply.yc)
    return np.asarray(np.sqrt((s1 / x) ** 2 + (s2 / y) ** 2 + (tau / ply.s12) ** 2))


Monitors = tuple[CompiledMonitor, FailureMonitor]


def one_laminate(
    angles: Sequence[float] = ANGLES, *, stretches: bool, **options: object
) -> Monitors:
    """Compiled criteria and NumPy's of a plate of one laminate."""
    stack = laminate(PLY, tuple(angles), [0.125] * len(angles))
    options["stretches"] = stretches or bool(options)
    stresses = PlyStresses(plate(), stack, gauss(3), **options)  # type: ignore[arg-type]
    return CompiledMonitor(stresses, STRENGTHS), FailureMonitor(stresses, STRENGTHS)


def cured(*, stretches: bool) -> Monitors:
    """With residual stresses."""
    residual = np.random.default_rng(3).normal(scale=10.0, size=(8, 2, 3))
    one, other = one_laminate(stretches=stretches)
    return one.with_residual([residual]), other.with_residual([residual])


def zones(*, stretches: bool) -> Monitors:
    """Of two laminates, of which a ply has no strengths and others have their own."""
    mesh = plate()
    rows = np.array([0, 2, 3, 7, 9]), np.array([1, 4, 5, 6, 8, 10, 11])
    stacks = [laminate(PLY, angles, [0.125] * len(angles)) for angles in (ANGLES, ANGLES[:3])]
    weak = replace(STRENGTHS, xt=300.0, yt=20.0, s13=10.0)
    strengths: list[list[Strengths | None]] = [
        [*[STRENGTHS] * 3, None, *[weak] * 4],
        [weak, STRENGTHS, STRENGTHS],
    ]
    both = list(zip(stacks, rows, strict=True))
    stresses = PlyStresses(mesh, both, gauss(3), stretches=stretches)
    return CompiledMonitor(stresses, strengths), FailureMonitor(stresses, strengths)


def fabrics(*, stretches: bool) -> Monitors:
    """With plies that Puck's criterion does not hold for, and with a slope that is too steep."""
    fabric = replace(PLY, e1=10.5e3, g12=1e3)
    stack = laminate([PLY, fabric, fabric, fabric, PLY, fabric], ANGLES[:6], [0.125] * 6)
    weak, steep = replace(STRENGTHS, xt=300.0), replace(STRENGTHS, yt=600.0)
    strengths = [[STRENGTHS, STRENGTHS, weak, weak, steep, STRENGTHS]]
    stresses = PlyStresses(plate(), stack, gauss(3), stretches=stretches)
    return CompiledMonitor(stresses, strengths), FailureMonitor(stresses, strengths)


def with_own(*, stretches: bool) -> Monitors:
    """With a user's criterion, which is not proportional to the stresses."""
    one, _ = one_laminate(stretches=stretches)
    values = [OwnCriterion("norris", norris).with_modes(STRENGTHS)]
    stresses = one.stresses
    return (
        CompiledMonitor(stresses, STRENGTHS, values),
        FailureMonitor(stresses, STRENGTHS, values),
    )


CASES: dict[str, Callable[..., Monitors]] = {
    "one laminate": one_laminate,
    "an odd number of states": partial(one_laminate, ANGLES[:5]),
    "as many stiffnesses as plies": partial(one_laminate, range(0, 90, 10)),
    "preloaded": partial(one_laminate, initial=np.array([1e-4, 0.0, -1e-4])),
    "curved": partial(one_laminate, curvature=CURVED),
    "nonlinear": partial(one_laminate, nonlinear=True),
    "cured": cured,
    "zones": zones,
    "fabrics": fabrics,
    "own criterion": with_own,
}
# What the midplane does, and whether that is known beforehand.
MOTIONS = {"only bends": (False, False), "bends": (False, True), "stretches": (True, True)}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.few(6)  # of 30, 0.05 s each
def test_exposures_times_and_modes_of_all_states_are_numpys(case: str, motion: str) -> None:
    stretched, known = MOTIONS[motion]
    compiled, numpy = CASES[case](stretches=known)
    assert_equal(compiled, numpy, fields(plate(), 24, stretched=stretched), 1e-10)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.few(9)  # of 30, 0.01 s each
def test_what_can_not_rise_is_left_out_without_a_change_of_a_bit(
    case: str, motion: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stretched, known = MOTIONS[motion]
    compiled, _ = CASES[case](stretches=known)
    given = fields(plate(), 24, stretched=stretched)
    histories = history(compiled, given)
    monkeypatch.setattr(compiled_failure, "_prunes", lambda _: False)
    every = history(compiled, given)
    for part in ("exposure", "time", "mode"):
        np.testing.assert_array_equal(getattr(histories.plies, part), getattr(every.plies, part))
        np.testing.assert_array_equal(histories.largest.state, every.largest.state)


@pytest.mark.parametrize("monitor", one_laminate(stretches=True), ids=["compiled", "numpy"])
def test_an_exposure_that_is_reached_again_keeps_the_time_of_the_first(
    monitor: FailureMonitor,
) -> None:
    (field,) = fields(plate(), 1, stretched=True)
    envelope = history(monitor, np.stack([0.0 * field, field, (1.0 + 1e-12) * field]))
    for part in (envelope.plies, envelope.interfaces):
        np.testing.assert_array_equal(part.time, 2.0)
    at_rest = history(monitor, 0.0 * field[None])
    for part in (at_rest.plies, at_rest.interfaces):
        np.testing.assert_array_equal(part.time, 0.0)


def test_a_state_that_can_not_rise_is_not_evaluated() -> None:
    compiled, _ = one_laminate(stretches=True)
    (field,) = fields(plate(), 1, stretched=True)
    envelope = history(compiled, field[None])
    before = envelope.plies.mode.copy()
    envelope.plies.mode[...] = 0  # would be found again
    compiled.update(envelope, 0.999 * field[None], [2.0])
    assert not envelope.plies.mode.any()
    compiled.update(envelope, 1.001 * field[None], [3.0])
    np.testing.assert_array_equal(envelope.plies.mode, before)


@pytest.mark.parametrize(
    ("case", "states"),
    [
        ("one laminate", 8),  # four angles, two sides
        ("an odd number of states", 5),  # [45/0/-45/90/90]: -45 is on both sides
        ("cured", 16),
        ("own criterion", 16),
        ("preloaded", 16),
    ],
)
def test_one_state_stands_for_all_that_are_proportional_to_it(case: str, states: int) -> None:
    compiled, numpy = CASES[case](stretches=False)
    points = compiled.counts.size
    assert compiled.start().plies.exposure.shape[1] == points * states
    assert numpy.start().plies.exposure.shape[1] == points * 2 * compiled.stresses.shape[2]


def test_with_extreme_strengths_every_state_is_evaluated() -> None:
    assert compiled_failure._prunes(STRENGTHS)
    for extreme in (
        replace(STRENGTHS, xt=0.01),
        replace(STRENGTHS, yc=1e6),
        replace(STRENGTHS, f12=0.9999),
    ):
        assert not compiled_failure._prunes(extreme)


def test_smallest_exposures_are_found_though_their_squares_are_zero() -> None:
    compiled, _ = one_laminate(stretches=True)
    (field,) = fields(plate(), 1, stretched=False)
    envelope = history(compiled, 1e-170 * field[None])
    assert (envelope.plies.exposure.reshape(len(CRITERIA), -1, 16)[0, :, 0] > 0.0).all()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_motion_that_is_no_longer_finite_leaves_what_numpy_leaves(value: float) -> None:
    compiled, numpy = one_laminate(stretches=False)
    given = fields(plate(), 2, stretched=False)
    given[1, 0] = value
    with np.errstate(all="ignore"):
        wanted = history(numpy, given)
    histories = history(compiled, given)
    np.testing.assert_array_equal(
        np.isnan(histories.interfaces.exposure), np.isnan(wanted.interfaces.exposure)
    )
    assert not np.isnan(histories.plies.exposure).any()


def with_counts(monitor: CompiledMonitor, share: float) -> CompiledMonitor:
    """The same criteria, of which about this share of the points count."""
    counts = np.random.default_rng(5).random(monitor.counts.shape) < share
    built = copy(monitor)
    built.counts, built.far = counts, np.asarray(counts.all(axis=1))
    return built


@pytest.mark.parametrize("share", [0.9, 0.0])
@pytest.mark.parametrize("stretches", [True, False])
@pytest.mark.parametrize("case", CASES)
@pytest.mark.few(12)  # of 40, 0.01 s each
def test_the_largest_exposures_that_count_are_those_of_all_states(
    case: str, stretches: bool, share: float
) -> None:
    compiled, _ = CASES[case](stretches=stretches)
    monitor = with_counts(compiled, share)
    envelope, known = monitor.start(), len(monitor.criteria)
    strains = []
    for time, field in enumerate(fields(plate(), 12, stretched=stretches), start=1):
        exposures = monitor.update(envelope, field[None], [float(time)])
        strains.append(monitor.stresses.strains(field)[0].reshape(-1, 6))
        exposure = envelope.plies.exposure.reshape(known, monitor.counts.size, -1)
        away = exposure[:, monitor.counts.ravel()]
        far = envelope.interfaces.exposure[monitor.counts.all(axis=1)]
        if share == 0.0:
            assert (exposures.state == -1).all()
            assert np.isnan(exposures.exposure).all()
            continue
        np.testing.assert_array_equal(exposures.exposure[0, :-1], away.max(axis=(1, 2)))
        assert exposures.exposure[0, -1] == np.nanmax(far)
        at = (range(known), exposures.state[0, :-1])
        np.testing.assert_array_equal(envelope.plies.exposure[at], exposures.exposure[0, :-1])
        np.testing.assert_array_equal(envelope.plies.mode[at], exposures.mode[0, :-1])
        for number, state in enumerate(exposures.state[0, :-1]):
            reached = int(envelope.plies.time[number, state])
            wanted = strains[reached - 1][state // monitor.states]
            np.testing.assert_allclose(envelope.largest.strain[number], wanted, rtol=1e-11)


@pytest.mark.parametrize("stretches", [True, False])
@pytest.mark.parametrize("case", CASES)
@pytest.mark.few(9)  # of 20, 0.01 s each
def test_states_that_can_not_be_the_largest_are_left_out_without_a_change_of_a_bit(
    case: str, stretches: bool
) -> None:
    compiled, _ = CASES[case](stretches=stretches)
    monitor, given = with_counts(compiled, 0.9), fields(plate(), 12, stretched=stretches)
    whole, few = history(monitor, given), monitor.start()
    monitor.for_largest().raise_largest(few, given, times_of(given))
    for name, values in vars(whole.largest).items():
        np.testing.assert_array_equal(getattr(few.largest, name), values, err_msg=name)
    left_out = few.plies.exposure < whole.plies.exposure
    assert left_out.any()


@pytest.mark.parametrize("points", [2, 3])
def test_half_of_a_plate_stands_for_the_whole_where_half_a_turn_repeats_the_fields(
    points: int,
) -> None:
    mesh, stack = plate(regular=True), laminate(PLY, ANGLES[:5], [0.125] * 5)
    rules = IntegrationRules(gauss(3), gauss(3), gauss(3), assumes_shear=True)
    kept = symmetry_reduction(PlateModel(mesh, stack, rules, nonlinear=True), None)
    draw = np.random.default_rng(5)
    given = np.array([1e-3 * kept.field(draw.normal(size=kept.count)) for _ in range(4)])
    stresses = PlyStresses(mesh, stack, gauss(points), nonlinear=True)
    whole = CompiledMonitor(stresses, STRENGTHS)
    half = whole.for_half(kept.represented_by)
    envelopes = [history(monitor, given) for monitor in (half, whole)]
    evaluated = envelopes[0].plies.exposure.reshape(len(half.criteria), 12, -1).any(axis=(0, 2))
    assert evaluated.sum() == 6
    half.complete(envelopes[0])
    for part in ("plies", "interfaces"):
        actual, wanted = (getattr(envelope, part) for envelope in envelopes)
        np.testing.assert_allclose(actual.exposure, wanted.exposure, rtol=1e-10)
        np.testing.assert_array_equal(actual.time, wanted.time)
        np.testing.assert_array_equal(actual.mode, wanted.mode)
    rows = [monitor.update(monitor.start(), given, times_of(given)) for monitor in (half, whole)]
    np.testing.assert_allclose(rows[0].exposure, rows[1].exposure, rtol=1e-10)
    np.testing.assert_array_equal(rows[0].state, rows[1].state)


def test_the_largest_strain_of_the_faces_is_that_of_their_circles_of_mohr() -> None:
    compiled, _ = one_laminate(stretches=True)
    given = fields(plate(), 3, stretched=True)
    half = np.random.default_rng(1).uniform(0.0, 0.5, compiled.counts.size)
    half[::3] = 0.0
    monitor = compiled.for_strains(half)
    strains = np.stack([compiled.stresses.strains(field)[0].reshape(-1, 6) for field in given])
    z = np.stack([half, -half])[..., None]
    xx, yy, xy = np.moveaxis(strains[:, None, :, :3] + z * strains[:, None, :, 3:], -1, 0)
    tensors = np.stack([np.stack([xx, xy / 2.0], -1), np.stack([xy / 2.0, yy], -1)], -2)
    wanted = np.abs(np.linalg.eigvalsh(tensors))[:, :, half > 0.0].max()
    assert monitor.largest_strain(monitor.start(), given) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("kind", [CompiledMonitor, FailureMonitor])
@pytest.mark.parametrize("incomplete", [3, 12])
def test_interfaces_of_elements_without_nine_nodes_are_never_the_largest(
    kind: type[FailureMonitor], incomplete: int
) -> None:
    mesh = plate()
    mesh.elements[:incomplete, 8] = 0
    monitor = kind(PlyStresses(mesh, laminate(PLY, ANGLES, [0.125] * 8), gauss(3)), STRENGTHS)
    envelope, given = monitor.start(), fields(mesh, 2, stretched=True)
    for actual in (envelope.largest, monitor.update(envelope, given, times_of(given))):
        state = np.atleast_2d(actual.state)[-1, -1]
        exposure = np.atleast_2d(actual.exposure)[-1, -1]
        assert state == -1 if incomplete == 12 else state >= 3 * 7
        assert np.isnan(exposure) == (incomplete == 12)


@pytest.mark.parametrize("stretches", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_ply_and_place_are_those_of_the_largest_of_all_states(case: str, stretches: bool) -> None:
    compiled, _ = CASES[case](stretches=stretches)
    monitor = with_counts(compiled, 0.7)
    elements, points, plies = monitor.stresses.shape
    x, y = np.random.default_rng(11).random((2, elements, points))
    envelope, given = monitor.start(), fields(plate(), 3, stretched=stretches)
    actual = monitor.located(monitor.update(envelope, given, times_of(given)), PlyPoints(x, y))
    exposure = monitor.every_state(envelope).exposure.reshape(-1, elements, points, plies, 2)
    away = np.where(monitor.counts[:, :, None, None], exposure, -1.0)
    count = len(CRITERIA)  # the column of the interfaces
    columns = [*range(count), *range(count + 1, 1 + len(exposure))]
    for column, values in zip(columns, away, strict=True):
        element, point, ply, _ = np.unravel_index(int(values.argmax()), values.shape)
        assert actual["exposure"][-1, column] == values.max()
        assert actual["ply"][-1, column] == ply + 1
        assert actual["x"][-1, column] == x[element, point]
        assert actual["y"][-1, column] == y[element, point]


@pytest.mark.parametrize("case", CASES)
def test_fields_together_leave_what_they_leave_one_by_one(case: str) -> None:
    monitor, _ = CASES[case](stretches=False)
    given = fields(plate(), 12, stretched=False)
    one, other = monitor.start(), monitor.start()
    exposures = monitor.update(one, given, times_of(given))
    rows = [
        monitor.update(other, field[None], [time])
        for field, time in zip(given, times_of(given), strict=True)
    ]
    for values, single in zip(exposures, zip(*rows, strict=True), strict=True):
        np.testing.assert_array_equal(values, np.concatenate(single))
    for part in ("exposure", "time", "mode"):
        np.testing.assert_array_equal(getattr(one.plies, part), getattr(other.plies, part))


@pytest.mark.parametrize("stretches", [True, False])
def test_of_places_with_equal_exposures_that_with_the_lowest_number_is_told(
    stretches: bool,
) -> None:
    """Elements whose nodes move alike, and so have the same exposures to the last bit."""
    mesh = plate(regular=True)
    columns, rows = (np.unique(c, return_inverse=True)[1].ravel() for c in mesh.coordinates.T)
    pattern = np.random.default_rng(9).normal(size=(2, 2, 5)) * 1e-3
    field = pattern[columns % 2, rows % 2]
    if not stretches:
        field[:, :2] = 0.0
    stack = laminate(PLY, ANGLES, [0.125] * 8)
    counts = np.ones((12, 9), dtype=bool)
    counts[:5, 2] = False
    monitor = CompiledMonitor(
        PlyStresses(mesh, stack, gauss(3), stretches=stretches), STRENGTHS, counts=counts
    )
    # First the nodes of the last element alone, all of which move.
    alone = np.zeros_like(field)
    last = mesh.elements[11] - 1
    alone[last] = field[last]

    def places(*given: Floats) -> Evaluations:
        return monitor.update(monitor.start(), np.array(given), times_of(np.array(given)))

    each = history(monitor, field[None])
    exposure = each.plies.exposure.reshape(len(CRITERIA), 12, 9, -1)
    np.testing.assert_array_equal(exposure, np.broadcast_to(exposure[:, :1], exposure.shape))
    actual = places(field, 0.5 * field)
    elements = actual.state[0, :-1] // (9 * monitor.states)
    points = actual.state[0, :-1] // monitor.states % 9
    np.testing.assert_array_equal(elements, np.where(points == 2, 5, 0))
    assert actual.state[0, -1] // 7 == 5  # of the interfaces
    later = places(alone, field)
    np.testing.assert_array_equal(later.state[1], actual.state[0])
    assert (later.state[0, :-1] // (9 * monitor.states) == 11).all()


def test_the_outermost_states_are_those_farthest_from_the_midplane() -> None:
    """Of [45/0/-45/90]s, two faces of each ply: the outer faces of the outer plies of an angle."""
    compiled, _ = one_laminate(stretches=False)
    (zone,) = compiled.zones
    represent = zone.represent
    assert represent.states.tolist() == [0, 2, 4, 6, 9, 11, 13, 15]
    np.testing.assert_array_equal(represent.states[represent.of[[0, 1, 6, 7, 8]]], [0, 0, 6, 9, 9])
    np.testing.assert_allclose(represent.share[[1, 3, 7, 15]], [0.75, 2.0 / 3.0, 0.0, 1.0])


def test_a_restored_run_keeps_nothing_of_the_exposures_after_it() -> None:
    (problem,) = load_deck(failing()).problems
    simulation = Simulation(problem, MemorySink())
    before = simulation.save()
    run_program(simulation)
    first = simulation.save()
    assert np.nanmax(first["state/failure/largest/exposure"]) > 0.0
    simulation.restore(before)
    run_program(simulation)
    again = simulation.save()
    names = [name for name in first if name.startswith("state/failure/")]
    assert {"plies/exposure", "circle/plies/exposure"} <= {
        name.removeprefix("state/failure/") for name in names
    }
    for name in names:
        np.testing.assert_array_equal(again[name], first[name])


def moving(kind: str) -> str:
    """A small impact with FAIL, of an unsymmetric plate held in its plane unless it is said."""
    held = failing()
    coupled = held.replace("-1   -1", " 0    0").replace("25    0    1    1", "25    0    0    0")
    symmetric = coupled.replace("    4    2    2", "    4    3    2")
    layers = "    2  90.     0.053\n"
    symmetric = symmetric.replace(layers, f"{layers}    3   0.     0.053\n").replace(".106", ".159")
    return {
        "held": held,
        "coupled": coupled,
        "symmetric": symmetric,
        "displaced": held.replace("ALLO", "FORC\n   11    0      1E-3\n\nALLO"),
        "preloaded": symmetric.replace("ALLO", "PREL\n       2.0\nALLO"),
        "curved": held.replace("ALLO", "CURV\n      20.0\nALLO"),
        "nonlinear": symmetric.replace("ALLO", "NONL\nSHEA MITC\n\nALLO"),
    }[kind]


@pytest.mark.parametrize(
    ("kind", "stretches"),
    [
        ("held", False),
        ("symmetric", False),  # free in its plane, where nothing moves it
        ("coupled", True),
        ("displaced", True),
        ("preloaded", True),
        ("curved", True),
        ("nonlinear", True),
    ],
)
@pytest.mark.few(1)  # of 7, 0.2 s each
def test_a_run_knows_beforehand_whether_its_midplane_stretches(kind: str, stretches: bool) -> None:
    (problem,) = load_deck(moving(kind)).problems
    monitor = build_model(problem).failure
    assert monitor is not None
    assert monitor.stresses.stretches == stretches
    result = fecm.run_one(moving(kind))
    strains = [monitor.stresses.strains(u)[0][..., :3] for u in result["tape3/displacement"]]
    assert np.array(strains).any() == stretches
    wanted = fecm.run_one(moving(kind), solver="numpy")
    for name in ("max_stress", "tsai_wu", "hashin", "puck", "interlaminar"):
        for part in ("exposure", "time", "mode"):
            path = f"failure/{name}/{part}"
            np.testing.assert_allclose(result[path], wanted[path], rtol=1e-10, atol=1e-20)
    np.testing.assert_allclose(result["exposures/exposure"], wanted["exposures/exposure"], 1e-10)
