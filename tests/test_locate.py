"""Impacts located from strain gages: reciprocity, known impacts, error bars, doubts."""

from __future__ import annotations

import dataclasses
import re
import warnings
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import fecm
from fecm.deck import model
from fecm.location.model import Footprint, Sampling, moving_plate, responses, rows_of
from fecm.location.prepare import shared_symmetry
from fecm.mechanics import mesh as meshes
from fecm.mechanics.mesh import ElementBlock, Ints, element_blocks
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.points import gages, patch_weights
from fecm.problem.generate import generate
from fecm.problem.loading import load_one, sole_problem
from fecm.problem.parts import build_plate
from fecm.sweeps.responses import plate_response
from tests.panels import (
    OFF_AXIS,
    PUBLIC,
    PUBLIC_IMPULSE,
    PUBLIC_PEAK,
    PUBLIC_PLACE,
    SMALL,
    STRUCK,
    TIME,
    Floats,
    at_times,
    panel,
    public_panel,
    run_of,
    scatter,
    struck,
    struck_on_a_point,
    with_gages,
    without,
)

NEAR = (40.0, 30.0, 80.0, 65.0)  # a region that makes a search short
NEARER = (48.0, 36.0, 76.0, 60.0)  # of few candidates
CLOSE = (52.0, 38.0, 72.0, 58.0)  # of one candidate, where the search is not what is tested
NOISE = 0.02  # of the largest strain


def located(strains: Floats, **options: object) -> fecm.Location:
    """An impact on the small panel near the place where it is struck."""
    close: dict[str, object] = {"region": CLOSE, "grid": 20.0}
    deck = struck_on_a_point()[0]
    return fecm.locate(deck, (TIME, strains), **(close | options))  # type: ignore[arg-type]


@cache
def noisy() -> fecm.Location:
    """The place of the small panel's impact, from strains with noise."""
    strains, noise = scatter(struck_on_a_point()[1], NOISE, seed=1)
    return located(strains, noise=noise)


def distance(location: fecm.Location, place: tuple[float, float]) -> float:
    """Distance of the place found from another."""
    return float(np.hypot(location.x - place[0], location.y - place[1]))


def deviations(location: fecm.Location, place: tuple[float, float]) -> float:
    """The same in standard deviations, by the covariance."""
    off = np.array([location.x, location.y]) - place
    return float(np.sqrt(off @ np.linalg.solve(location.covariance, off)))


# The responses ------------------------------------------------------------------------------------


def flat(deck: fecm.Deck) -> fecm.Deck:
    """The panel itself."""
    return deck


def curved(deck: fecm.Deck) -> fecm.Deck:
    """A panel with the radius of 600 mm along x and twist; u and v must be free."""
    bent = model.Curvature(radius_x=600.0, radius_xy=2000.0)
    return dataclasses.replace(deck, segments=(*deck.segments, bent), text="")


@pytest.mark.parametrize(
    ("layup", "shape"),
    [("[45/0/-45/90]s", flat), ("[0/90/45/45]", flat), ("[0/90/45/45]", curved)],
    ids=["flat", "coupled", "curved"],
)
@pytest.mark.few(1)  # of 3, 0.1 s each
def test_the_run_of_a_gage_gives_the_strains_of_an_impulse(
    layup: str, shape: Callable[[fecm.Deck], fecm.Deck]
) -> None:
    problem = sole_problem(shape(panel(layup)))
    motion = PlateMotion(moving_plate(problem.plate))
    records = problem.deck.require(model.Gages).records
    read = gages(problem.mesh, records, curvature=problem.plate.curvature)
    nodes = np.arange(len(problem.mesh.coordinates))
    # A hat of one step is an impulse in the second step.
    impulse = Sampling(dt=2e-7, every=1, count=300, width=1)
    actual = responses(motion, rows_of(read, len(nodes)), nodes, impulse, float)
    weights = patch_weights(problem.mesh, "DISC", 5.0, *STRUCK)
    load = np.zeros((len(nodes), 5))
    load[:, 2] = weights
    sums = motion.dof_sums(read.dof_indices, read.weights)
    _, direct = plate_response(motion, motion.load(load), impulse.dt, 298, sums)
    by_gages = np.einsum("n,gns->gs", weights, actual)[:, 2:]
    assert np.abs(by_gages - direct).max() < 1e-10 * np.abs(direct).max()


# Known impacts ------------------------------------------------------------------------------------


def test_the_place_and_the_force_of_a_run_are_found() -> None:
    deck, strains, peak = struck()
    location = fecm.locate(deck, (TIME, strains), region=NEAR, grid=12.0)
    assert distance(location, STRUCK) < 0.1  # of elements of 10
    assert location.peak_force == pytest.approx(peak, rel=0.05)
    assert location.impulse == pytest.approx(2e-6 * 2000.0, rel=0.05)  # hardly a rebound
    assert location.accepted


def test_an_impact_on_a_curved_panel_is_found() -> None:
    deck = curved(panel("[0/90/45/45]"))
    run = fecm.run_one(deck)
    location = fecm.locate(deck, (TIME, at_times(run)), region=CLOSE, grid=10.0)
    assert distance(location, STRUCK) < 0.2
    assert location.peak_force == pytest.approx(float(run.force.max()), rel=0.05)


@pytest.mark.long
def test_an_impact_beside_the_edge_is_found() -> None:
    place = (60.0, 6.0)
    deck, strains, peak = struck(at=place)
    location = fecm.locate(deck, (TIME, strains), region=(48.0, 0.0, 76.0, 30.0), grid=14.0)
    assert distance(location, place) < 0.5
    assert location.peak_force == pytest.approx(peak, rel=0.05)
    at_edge = fecm.locate(deck, (TIME, strains), region=(40.0, 0.0, 80.0, 5.01), grid=12.0)
    assert 0.0 < at_edge.sd_y < np.inf
    assert not at_edge.accepted


def of_the_series(deck: fecm.Deck, strains: Floats, **options: object) -> fecm.Location:
    """The impact of the public series near its place."""
    near: dict[str, object] = {"region": (98.0, 68.0, 124.0, 92.0), "grid": 26.0}
    return fecm.locate(deck, (PUBLIC[:, 0], strains), **(near | options))  # type: ignore[arg-type]


@pytest.mark.parametrize("mesh", [(30, 20), pytest.param((60, 40), marks=pytest.mark.long)])
def test_the_public_case_is_located_within_four_standard_deviations(mesh: tuple[int, int]) -> None:
    series = of_the_series(public_panel(*mesh), PUBLIC[:, 6:10])
    assert distance(series, PUBLIC_PLACE) < 0.5
    assert deviations(series, PUBLIC_PLACE) < 4.0
    early = series.time < 6e-4
    assert series.force[early].max() == pytest.approx(PUBLIC_PEAK, rel=0.05)
    assert series.impulse == pytest.approx(PUBLIC_IMPULSE, rel=0.05)
    # Unregularised, the last force would be 1000 times the largest one.
    assert series.peak_force == series.force[early].max()
    assert 6e-4 < series.determined_until < 7.8e-4
    assert not series.determined[-1]
    assert series.force[~series.determined].max() == 0.0
    assert series.force_sd[~series.determined].min() > 4.0 * np.median(series.force_sd)
    assert series.accepted


@pytest.mark.long
def test_the_public_case_is_located_on_the_whole_plate() -> None:
    location = fecm.locate(public_panel(60, 40), (PUBLIC[:, 0], PUBLIC[:, 6:10]))
    assert len(location.candidates) == 126
    assert distance(location, PUBLIC_PLACE) < 0.5
    assert location.second is not None
    assert location.second.ratio > 5.0


@pytest.mark.long
@pytest.mark.parametrize(("mesh", "strain", "force"), [((96, 64), 7e-3, 1.2e-3)])
def test_strains_and_force_of_a_run_are_those_of_the_series(
    mesh: tuple[int, int], strain: float, force: float
) -> None:
    run = fecm.run_one(public_panel(*mesh, at=PUBLIC_PLACE))
    time = PUBLIC[:, 0]
    off = np.interp(time, run.time, run.force) - PUBLIC[:, 1]
    assert np.abs(off).max() < force * PUBLIC_PEAK
    for own, series in zip(run.gages.strain.T, PUBLIC[:, 2:6].T, strict=True):
        assert np.abs(np.interp(time, run.time, own) - series).max() < strain * np.abs(series).max()


@pytest.mark.long
def test_strains_on_the_mesh_of_fecm_new_are_those_of_the_series_within_a_hundredth() -> None:
    # The elements are as short as the radius of the patch.
    plain = public_panel(60, 40)
    material = plain.require(model.Material)
    deck = fecm.impact(
        fecm.Plate.rectangle((300.0, 200.0), (68, 46), support="simple", grading=1.25),
        fecm.Laminate("[0/90/0/90/0]s", material.ply, 0.2),
        fecm.RigidMass(2e-5),
        fecm.Contact(2e4, 0.0, 0.0, 1.5),
        velocity=2000.0,
        at=PUBLIC_PLACE,
        duration=8.02e-4,
        units="mm-N-s",
        patch="disc:4",
        kinematics="linear",
        shear_factor=1.0,
        gages=[(g.x, g.y, g.z, g.direction) for g in plain.require(model.Gages).records],
    )
    run = fecm.run_one(deck)
    for own, series in zip(run.gages.strain.T, PUBLIC[:, 2:6].T, strict=True):
        off = np.interp(PUBLIC[:, 0], run.time, own) - series
        assert np.abs(off).max() < 1e-2 * np.abs(series).max()


@pytest.mark.long
def test_a_modulus_5_percent_too_high_moves_the_place_by_less_than_a_millimetre() -> None:
    series = of_the_series(public_panel(60, 40, e1=1.05 * 171420.0), PUBLIC[:, 6:10])
    assert 0.1 < distance(series, PUBLIC_PLACE) < 1.0
    assert 1.0 < series.peak_force / PUBLIC_PEAK < 1.07


@pytest.mark.long
def test_the_reports_impact_with_a_rod_is_located_within_one_element() -> None:
    report = fecm.read_one(fecm.examples.path("impact-patch"))
    face = 0.5 * sum(layer.thickness for layer in report.require(model.Material).layers)
    deck = with_gages(report, (1.8, 1.4, face, 0.0), (4.3, 2.6, face, 90.0), (2.2, 2.9, face, 0.0))
    run = fecm.run_one(fecm.read_one(deck.to_text()))
    time = 4e-6 * np.arange(1.0, 201.0)
    strains = np.column_stack([np.interp(time, run.time, one) for one in run.gages.strain.T])
    location = fecm.locate(deck, (time, scatter(strains, NOISE, seed=0)[0]))
    node = run["mesh/coordinates"][report.require(model.Impact).node - 1]
    assert distance(location, tuple(node)) < 0.02  # elements of .25 in
    assert location.peak_force == pytest.approx(float(run.force.max()), rel=0.05)


# Error bars ---------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_errors_of_several_seeds_are_those_of_the_covariance() -> None:
    deck, strains, _ = struck()
    seeds, squares = 10, 0.0
    for seed in range(seeds):
        measured, noise = scatter(strains, 2.0 * NOISE, seed)
        location = fecm.locate(
            deck, (TIME, measured), noise=noise, basis=7.5e-6, region=CLOSE, grid=20.0
        )
        assert location.misfit == pytest.approx(1.0, abs=0.15)
        squares += deviations(location, STRUCK) ** 2
    # Chi-square of 2 values a seed: within its 1 % and 99 % quantiles, 8.3 and 37.6 of 20.
    assert 8.3 < squares < 37.6


def strains_per_place_and_force(deck: fecm.Deck, location: fecm.Location) -> Floats:
    """Change of the fitted strains with x, y and the forces that are not held at 0, by runs."""
    problem, step, dt = sole_problem(deck), 0.3, 2e-7
    mesh, motion = problem.mesh, PlateMotion(moving_plate(problem.plate))
    read = gages(mesh, deck.require(model.Gages).records)
    sums = motion.dof_sums(read.dof_indices, read.weights)
    time = dt * np.arange(1.0, round(TIME[-1] / dt) + 1.0)

    def strains(x: float, y: float, *forces: Floats) -> list[Floats]:
        load = np.zeros((len(mesh.coordinates), 5))
        load[:, 2] = patch_weights(mesh, "DISC", 5.0, x, y)
        _, impulse = plate_response(motion, motion.load(load), dt, len(time), sums)
        moved = []
        for force in forces:
            acting = np.interp(time - dt, np.append(0.0, location.time), np.append(0.0, force))
            each = [np.interp(TIME, time, np.convolve(one, acting)[: len(time)]) for one in impulse]
            moved.append(np.concatenate(each))
        return moved

    x, y, force = location.x, location.y, location.force
    (right,), (left,) = strains(x + step, y, force), strains(x - step, y, force)
    (above,), (below,) = strains(x, y + step, force), strains(x, y - step, force)
    hats = np.eye(len(force))[(force > 0.0) | ~location.determined]
    slopes = [(right - left) / (2.0 * step), (above - below) / (2.0 * step)]
    return np.stack([*slopes, *strains(x, y, *hats)], axis=1)


def test_the_covariance_of_the_place_is_that_of_least_squares() -> None:
    """noise**2 (J' J)^-1 for two gages, with J computed without reciprocity."""
    deck = with_gages(panel(), *OFF_AXIS[:2])
    strains, noise = scatter(struck()[1][:, :2], NOISE, seed=1)
    location = fecm.locate(
        deck, (TIME, strains), region=CLOSE, grid=20.0, basis=9e-6, noise=noise, mesh_error=False
    )
    J = strains_per_place_and_force(deck, location)
    expected = (noise * max(1.0, location.misfit)) ** 2 * np.linalg.inv(J.T @ J)[:2, :2]
    np.testing.assert_allclose(location.covariance, expected, rtol=0.06)
    assert location.sd_x == pytest.approx(np.sqrt(expected[0, 0]), rel=0.03)
    assert location.sd_y == pytest.approx(np.sqrt(expected[1, 1]), rel=0.03)


def of_a_run() -> Floats:
    """Strains of a run of the public panel, (points, gages)."""
    run = fecm.run_one(public_panel(60, 40, at=PUBLIC_PLACE))
    return np.column_stack([np.interp(PUBLIC[:, 0], run.time, one) for one in run.gages.strain.T])


@pytest.mark.long
@pytest.mark.parametrize("first", [0, 25, 50, 75])
@pytest.mark.parametrize("strains_of", [of_a_run, lambda: PUBLIC[:, 2:6]], ids=["run", "series"])
def test_the_95_percent_ellipse_covers_the_place_in_95_of_100(
    strains_of: Callable[[], Floats], first: int
) -> None:
    deck, clean = public_panel(60, 40), strains_of()
    covered, off, errors = 0, [], []
    with warnings.catch_warnings(action="ignore"):
        for seed in range(first, first + 25):
            strains, _ = scatter(clean, NOISE, seed)
            series = of_the_series(deck, strains)
            covered += deviations(series, PUBLIC_PLACE) ** 2 < -2.0 * np.log(0.05)
            off.append((series.x - PUBLIC_PLACE[0], series.y - PUBLIC_PLACE[1]))
            errors.append((series.sd_x, series.sd_y))
    assert covered >= 21  # of 25: 99 % of binomial samples
    ratio = np.sqrt(np.mean(np.square(off), axis=0)) / np.mean(errors, axis=0)
    assert (ratio < 1.3).all()


def test_the_ellipse_encloses_its_share_of_a_normal_distribution() -> None:
    actual = noisy()
    edge = actual.ellipse(0.5) - [actual.x, actual.y]
    squares = np.einsum("ni,ij,nj->n", edge, np.linalg.inv(actual.covariance), edge)
    assert squares == pytest.approx(2.0 * np.log(2.0))
    assert np.array_equal(edge[0], edge[-1]) or np.abs(edge[0] - edge[-1]).max() < 1e-12
    with pytest.raises(ValueError, match="between 0 and 1"):
        actual.ellipse(1.0)


def test_the_noise_is_that_of_the_residual_unless_it_is_given() -> None:
    strains, noise = scatter(struck_on_a_point()[1], NOISE, seed=1)
    location = located(strains)
    assert location.noise == pytest.approx(noise, rel=0.15)
    assert location.misfit == 1.0
    assert not location.noise_given
    # The mesh is in both.
    assert location.sd_x == pytest.approx(noisy().sd_x, rel=0.15)


# The force ----------------------------------------------------------------------------------------


def test_the_impulse_ends_with_the_contact() -> None:
    actual = noisy()
    run = run_of(radius=SMALL)
    assert actual.contact_end is not None
    before = run.time <= actual.contact_end  # the projectile touches the panel once more
    assert run.force[before][-1] < 0.1 * run.force.max()  # hats are coarse beside it
    contact = float(np.trapezoid(run.force[before], run.time[before]))
    assert actual.impulse == pytest.approx(contact, rel=0.03)


def test_the_energy_bound_follows_from_impulse_and_mass() -> None:
    actual = dataclasses.replace(noisy(), mass=2e-6)
    assert actual.energy_bound == pytest.approx(actual.impulse**2 / 4e-6)
    assert noisy().energy_bound is None


def test_a_force_that_has_not_ended_is_said_to_be_open() -> None:
    early = TIME < 1.2e-4
    deck, strains, _ = struck_on_a_point()
    location = fecm.locate(deck, (TIME[early], strains[early]), region=CLOSE, grid=20.0)
    assert location.contact_end is None
    assert any("has not ended" in note for note in location.notes)


@pytest.mark.long
def test_hats_are_narrowed_where_the_strains_show_it_and_a_given_width_is_kept() -> None:
    # A thin plate has a force with a narrow peak.
    deck, strains, peak = struck("[0/90/45/45]")
    near: dict[str, object] = {"region": CLOSE, "grid": 20.0}
    location = fecm.locate(deck, (TIME, strains), **near)  # type: ignore[arg-type]
    assert np.diff(location.time)[0] < TIME[-1] / 60.0
    assert location.peak_force == pytest.approx(peak, rel=0.05)
    wide = fecm.locate(deck, (TIME, strains), basis=9e-6, **near)  # type: ignore[arg-type]
    assert np.diff(wide.time) == pytest.approx(9e-6)
    assert wide.peak_force < 0.95 * peak
    assert any(
        "a value of the force every 4.5e-06 s describes the strains better" in n for n in wide.notes
    )
    # Noise hides what narrow hats could show, and few strains are not spread over many values.
    rough = fecm.locate(deck, (TIME, scatter(strains, 0.1, 0)[0]), **near)  # type: ignore[arg-type]
    assert np.diff(rough.time)[0] > TIME[-1] / 60.0


# What may be fitted besides -----------------------------------------------------------------------


@pytest.mark.long
def test_a_record_that_begins_after_the_impact_is_located_with_a_shift() -> None:
    late = 10  # points
    deck, clean, _ = struck_on_a_point()
    strains, noise = scatter(clean, NOISE, seed=2)
    table = TIME[late:] - TIME[late - 1], strains[late:]
    location = fecm.locate(deck, table, region=CLOSE, grid=20.0, noise=noise, shift=True)
    assert distance(location, STRUCK) < 0.3
    assert location.misfit < 1.2
    first = location.time[np.argmax(location.force > 0.1 * location.peak_force)]
    assert first == pytest.approx(-TIME[late - 1], abs=1e-5)
    assert location.sd_shift > 0.0
    plain = fecm.locate(deck, table, region=CLOSE, grid=20.0, noise=noise)
    assert not plain.accepted
    assert any("does not describe these signals" in note for note in plain.notes)


def test_a_record_that_begins_before_the_impact_is_located() -> None:
    before = 3e-6 * np.arange(-20.0, 1.0)
    time = np.concatenate([before, TIME])
    deck, clean, _ = struck_on_a_point()
    strains = np.vstack([np.zeros((len(before), 3)), clean])
    location = fecm.locate(deck, (time, strains), region=NEAR, grid=12.0)
    assert distance(location, STRUCK) < 0.1
    assert location.force[location.time <= 0.0].max() < 0.05 * location.peak_force


def test_a_gage_with_another_gain_is_found_out() -> None:
    strains, noise = scatter(struck_on_a_point()[1], NOISE / 4.0, seed=3)
    location = located(strains * [1.1, 1.0, 1.0], noise=noise, gains=True)
    assert location.gains / location.gains[1] == pytest.approx([1.1, 1.0, 1.0], abs=0.01)
    assert np.prod(location.gains) == pytest.approx(1.0)
    assert distance(location, STRUCK) < 0.1
    assert (location.sd_gains > 0.0).all()


@pytest.mark.long
def test_fine_samples_give_the_place_of_coarse_ones() -> None:
    deck, run = struck_on_a_point()[0], run_of(radius=SMALL)
    location = fecm.locate(deck, (run.time, np.asarray(run.gages.strain)), region=CLOSE, grid=20.0)
    assert len(run.time) > 500
    assert distance(location, STRUCK) < 0.1
    assert location.fitted.shape == (3, len(run.time))
    rest = location.fitted - run.gages.strain.T
    assert np.abs(rest).max() < 0.02 * np.abs(location.fitted).max()
    strains, noise = scatter(np.asarray(run.gages.strain), NOISE, seed=5)
    rough = fecm.locate(deck, (run.time, strains), region=CLOSE, grid=20.0)
    assert rough.noise == pytest.approx(noise, rel=0.05)
    assert deviations(rough, STRUCK) < 4.0


@pytest.mark.long
def test_unequal_times_give_the_place_of_equal_ones() -> None:
    deck, run = struck_on_a_point()[0], run_of(radius=SMALL)
    time = np.sort(np.random.default_rng(4).uniform(2e-6, TIME[-1], 150))
    strains = np.column_stack([np.interp(time, run.time, one) for one in run.gages.strain.T])
    location = fecm.locate(deck, (time, strains), region=CLOSE, grid=20.0)
    assert distance(location, STRUCK) < 0.1


@pytest.mark.long
def test_a_plate_without_patch_projectile_and_program_is_enough() -> None:
    deck = struck()[0]
    unused = (model.Impact, model.Indentation, model.Projectile, model.Patch)
    bare = dataclasses.replace(without(deck, *unused), macros=())
    location = fecm.locate(bare, (TIME, struck()[1]), region=NEAR, grid=12.0)
    assert distance(location, STRUCK) < 1.0  # a point for the disc of 5
    assert location.peak_force == pytest.approx(struck()[2], rel=0.1)


# Doubts -------------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_wrong_plate_does_not_describe_the_strains() -> None:
    plate, clean, _ = struck_on_a_point()
    deck = plate.with_(e1=2.0 * 135000.0)
    strains, noise = scatter(clean, NOISE, seed=1)
    location = fecm.locate(deck, (TIME, strains), region=CLOSE, grid=20.0, noise=noise)
    assert location.misfit > 3.0
    assert not location.accepted
    assert "does not describe these signals" in location.notes[0]


def wrong(strains: Floats, name: str) -> Floats:
    """Strains of three gages with a mistake of the measurement."""
    match name:
        case "exchanged":
            return strains[:, [1, 0, 2]]
        case "one sign":
            return strains * [1.0, -1.0, 1.0]
        case "all signs":
            return -strains
        case "scaled":
            return strains * [1.0, 1.0, 1e-2]
        case _:
            return np.add(strains, [0.0, 0.0, 2.0 * np.abs(strains).max()])


@pytest.mark.parametrize(
    "given", [True, pytest.param(False, marks=pytest.mark.long)], ids=["noise", "no noise"]
)
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("exchanged", "gages 1 and 2 exchanged explain the strains"),
        ("one sign", "gage 2 with the other sign explains the strains"),
        ("all signs", "the other sign of all gages explains the strains"),
        ("scaled", "gage 3, divided by 0.01, explains the strains"),
        ("zero", "gage 3 less"),
    ],
)
def test_a_mistake_of_the_measurement_is_named(name: str, words: str, given: bool) -> None:
    strains, noise = scatter(struck_on_a_point()[1], NOISE, seed=1)
    options: dict[str, object] = {"noise": noise} if given else {}
    location = located(wrong(strains, name), region=NEARER, grid=12.0, mesh_error=False, **options)
    assert not location.accepted
    (cause,) = [note for note in location.notes if "times better" in note]
    assert words in cause


@pytest.mark.parametrize("gage", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.long
def test_a_gain_of_1_3_that_the_noise_nearly_hides_is_named_with_its_gage(gage: int) -> None:
    # A gain of one gage explains a part of what the gain of another one does.
    early = slice(0, 200)
    gains = np.where(np.arange(1, 5) == gage, 1.3, 1.0)
    location = fecm.locate(
        public_panel(30, 20),
        (PUBLIC[early, 0], PUBLIC[early, 6:10] * gains),
        noise=3.7e-6,
        region=(90.0, 60.0, 140.0, 100.0),
        grid=25.0,
        mesh_error=False,
    )
    assert not location.accepted
    (cause,) = [note for note in location.notes if "times better" in note]
    words = rf"gage {gage}, divided by 1\.(29|3|30|31), explains the strains 1\.[3-6] times better"
    assert re.match(words, cause), cause


def test_right_strains_have_no_likely_mistake_and_are_accepted() -> None:
    strains, noise = scatter(struck_on_a_point()[1], NOISE, seed=1)
    location = located(strains, noise=noise, region=NEAR, grid=12.0)
    assert location.accepted
    assert not any("times better" in note for note in location.notes)
    assert location.misfit < 1.0 + 3.0 / np.sqrt(2.0 * strains.size) + 0.05


@pytest.mark.long
def test_strains_of_a_late_trigger_are_named_as_late() -> None:
    late = 10  # points
    strains, _ = scatter(struck_on_a_point()[1], NOISE, seed=2)
    table = TIME[late:] - TIME[late - 1], strains[late:]
    location = fecm.locate(struck_on_a_point()[0], table, region=CLOSE, grid=20.0)
    assert not location.accepted
    (cause,) = [note for note in location.notes if "times better" in note]
    assert "before the record explains the strains" in cause
    assert "--shift" in cause


@pytest.mark.long
def test_a_misfit_that_noise_does_not_explain_is_said_and_widens_the_errors() -> None:
    # The noise is a quarter above what was said of it.
    strains, noise = scatter(struck_on_a_point()[1], NOISE, seed=1)
    whole, small = located(strains, noise=noise), located(strains, noise=noise / 1.25)
    assert small.misfit == pytest.approx(1.25 * whole.misfit)
    assert small.accepted
    assert any("which chance does not explain" in note for note in small.notes)
    assert not any("which chance does not explain" in note for note in whole.notes)
    # Errors are those of the residual, not of the noise that was given.
    assert small.force_sd[small.determined] == pytest.approx(
        whole.force_sd[whole.determined] * max(1.0, small.misfit / 1.25) / max(1.0, whole.misfit),
        rel=0.2,
    )
    large = located(strains, noise=noise / 2.0)
    assert not large.accepted


def test_strains_at_which_plies_fail_are_not_accepted() -> None:
    strains = struck_on_a_point()[1]
    with pytest.warns(fecm.FecmWarning, match="the largest strain is 2 %"):
        location = located(strains * (0.02 / np.abs(strains).max()))
    assert not location.accepted
    assert any("the largest strain is 2 %, at which plies fail" in note for note in location.notes)


@pytest.mark.long
def test_a_place_outside_the_region_is_doubted() -> None:
    location = located(struck_on_a_point()[1], region=(20.0, 30.0, 50.0, 60.0), grid=15.0)
    assert not location.accepted
    assert any("edge of the region" in note for note in location.notes)


def test_a_second_place_that_fits_almost_as_well_is_named() -> None:
    # Gages just beside the axis hardly tell the sides of the plate.
    beside = [(x, 40.3, 0.72, 0.0) for x in (20.0, 45.0, 75.0)]
    deck = with_gages(panel("[0/90]2s", (61.0, 58.0), SMALL), *beside)
    measured, noise = scatter(at_times(fecm.run_one(deck)), 5.0 * NOISE, seed=0)
    bare = without(deck, model.Patch)
    location = fecm.locate(bare, (TIME, measured), region=(45, 10, 75, 70), grid=9.0, noise=noise)
    assert location.second is not None
    assert 1.0 <= location.second.ratio < 1.1
    assert abs(location.second.y + location.y - 80.0) < 5.0  # a mirror place
    assert not location.accepted
    assert any("almost as well" in note for note in location.notes)


def test_gages_on_an_axis_of_symmetry_are_refused_with_both_places() -> None:
    deck = with_gages(panel("[0/90]2s"), *[(x, 40.0, 0.72, 90.0) for x in (20.0, 45.0, 75.0)])
    with pytest.raises(fecm.LocateError, match="mirror places can't be told apart") as caught:
        fecm.locate(deck, (TIME, struck()[1]))
    places = "(27.5, 22.5) and one at (27.5, 57.5)"
    assert places in str(caught.value)


@pytest.mark.parametrize(
    ("layup", "places"),
    [
        # Plies off the axes, or a gage that reads shear, tell the sides apart.
        ("[45/0/-45/90]s", [(20.0, 40.0, 0.72, 0.0), (75.0, 40.0, 0.72, 0.0)]),
        ("[0/90]2s", [(20.0, 40.0, 0.72, 30.0), (75.0, 40.0, 0.72, 0.0)]),
        ("[0/90]2s", [(20.0, 41.0, 0.72, 0.0), (75.0, 40.0, 0.72, 0.0)]),
    ],
)
@pytest.mark.few(1)  # of 3, 1 s each
def test_gages_that_tell_the_sides_apart_are_accepted(
    layup: str, places: list[tuple[float, float, float, float]]
) -> None:
    deck = with_gages(without(panel(layup), model.Patch), *places)
    location = fecm.locate(deck, (TIME, struck()[1][:, :2]), region=CLOSE, grid=20.0)
    assert len(location.gages) == 2


def test_a_twisted_panel_or_a_shear_preload_tells_the_sides_apart() -> None:
    plain = with_gages(panel("[0/90]2s"), *[(x, 40.0, 0.72, 0.0) for x in (20.0, 45.0, 75.0)])
    twist = model.Curvature(radius_xy=2000.0)
    for extra, actual in (
        (model.Curvature(radius_x=600.0), True),
        (twist, False),
        (model.Preload(1.0, 1.0, 0.0), True),
        (model.Preload(1.0, 1.0, 0.1), False),
    ):
        deck = dataclasses.replace(plain, segments=(*plain.segments, extra), text="")
        plate = build_plate(deck, generate(deck))
        read = gages(plate.mesh, deck.require(model.Gages).records, curvature=plate.curvature)
        rows = rows_of(read, len(plate.mesh.coordinates))
        assert (shared_symmetry(plate, rows) is not None) == actual


def test_gages_at_the_centre_cant_tell_a_half_turn() -> None:
    deck = with_gages(panel(), *[(50.0, 40.0, 0.72, angle) for angle in (0.0, 45.0, 90.0)])
    with pytest.raises(fecm.LocateError, match="half turn"):
        fecm.locate(deck, (TIME, struck()[1]))


def test_places_of_a_location_share_the_blocks_of_its_mesh(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    built: list[int] = []

    def counted(elements: Ints, coordinates: Floats) -> list[ElementBlock]:
        built.append(len(elements))
        return element_blocks(elements, coordinates)

    mesh = load_one(fecm.examples.path("panel-with-gages")).mesh
    places = (112.5, 81.0), (60.0, 47.0)
    expected = [patch_weights(mesh, "DISC", 4.0, *place) for place in places]
    monkeypatch.setattr(meshes, "element_blocks", counted)
    held = np.zeros(len(mesh.coordinates), dtype=bool)
    footprint = Footprint(dataclasses.replace(mesh), "DISC", 4.0, held)  # a copy without blocks
    np.testing.assert_array_equal([footprint.weights(*place) for place in places], expected)
    assert built == [len(mesh.elements)]
