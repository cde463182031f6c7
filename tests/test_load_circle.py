"""Exposures on the circle around the load: strains, convergence, ties and corners."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.mechanics import CircleStresses, element_blocks, inner_corners
from fecm.problem import load_deck
from fecm.results import (
    FailureVerdict,
    LargestExposure,
    failure_verdict,
    largest_exposures,
    mesh_band,
)
from tests.builders import report_plate, square


def impact_on(elements: int, **options: Any) -> fecm.Deck:
    """A ball of 0.2 kg on a plate of 100 x 100 x 2.9 mm."""
    return fecm.impact(
        fecm.Plate.rectangle((100, 100), (elements, elements), support="simple"),
        fecm.Laminate("[0/45/-45/90]2s", "IM7/8552", 0.184),
        fecm.RigidMass(2e-4),
        fecm.Contact.estimate(radius=8),
        velocity=3500,
        duration=7e-4,
        units="mm-N-s",
        damage=True,
        plies=False,
        shear_factor=1.0,
        kinematics="linear",
        **options,
    )


@pytest.fixture(scope="module")
def coarse() -> Result:
    return fecm.run_one(impact_on(8))


def exposures(result: Result) -> dict[str, float]:
    return {one.criterion: one.exposure for one in largest_exposures(result)}


def test_strains_on_the_circle_are_exact_for_a_field_of_second_order() -> None:
    coordinates, elements = square(4, 4)
    x, y = coordinates.T
    field = np.zeros((len(x), 5))
    field[:, 0] = 0.3 * x + 0.1 * x * y
    field[:, 1] = -0.2 * y
    field[:, 3] = 0.5 * x**2 - 0.2 * y
    field[:, 4] = 0.4 * x * y
    blocks = element_blocks(elements, coordinates)
    centre, radius = (float(x.mean()), float(y.mean())), 0.4 * float(np.ptp(x)) / 2.0
    circle = CircleStresses(blocks, centre, radius, [(report_plate(), slice(None))])
    strains, _ = circle.strains(field)
    px, py = circle.points.T
    np.testing.assert_allclose(np.hypot(px - centre[0], py - centre[1]), radius, rtol=1e-12)
    expected = [0.3 + 0.1 * py, np.full_like(px, -0.2), 0.1 * px, -px, -0.4 * px, 0.2 - 0.4 * py]
    np.testing.assert_allclose(strains[:, 0], np.transpose(expected), atol=1e-12)


def test_the_largest_exposures_are_those_of_the_finest_mesh_within_the_band(coarse: Result) -> None:
    # Own shape functions, strains and criteria on the circle of the finest graded mesh: max. stress
    # 1.119, interlaminar 0.795; at the points beyond the circle this mesh has 0.83 and 0.10.
    known = {"max_stress": 1.119, "interlaminar": 0.795}
    largest = [one for one in largest_exposures(coarse) if one.criterion in known]
    for one, finest in zip(largest, known.values(), strict=True):
        assert one.band is not None
        assert one.band[0] < finest < one.band[1]
        assert one.exposure == pytest.approx(finest, rel=0.12)
    assert failure_verdict(largest) is FailureVerdict.OPEN


def test_a_coarse_mesh_is_noted(coarse: Result) -> None:
    (note,) = [note for note in coarse.notes if "lower bounds" in note]
    assert "sides of 12.5 mm, and c + h/2 is 2.43 mm" in note


@pytest.mark.parametrize(
    ("exposure", "coarseness", "expected"),
    [
        (0.9, 1.0, FailureVerdict.NOT_REACHED),
        (0.99, 1.0, FailureVerdict.OPEN),
        (1.03, 1.0, FailureVerdict.OPEN),
        (1.05, 1.0, FailureVerdict.REACHED),
        (0.8, 7.5, FailureVerdict.OPEN),
        (0.1, 20.0, FailureVerdict.OPEN),
    ],
)
def test_the_verdict_is_open_where_the_band_of_the_mesh_has_1(
    exposure: float, coarseness: float, expected: FailureVerdict
) -> None:
    band = mesh_band(exposure, "puck", coarseness)
    one = LargestExposure("puck", exposure, "inter-fibre A", 1, 0.0, 0.0, 0.0, band=band)
    assert failure_verdict([one]) is expected


def test_the_exposure_at_a_centre_does_not_depend_on_the_points_of_stress() -> None:
    deck = impact_on(8).to_text()
    (card,) = [line for line in deck.splitlines() if line.split()[:3] == ["3", "3", "-3"]]
    found = []
    for points in (-3, 2, 4):
        changed = card.replace("-3", f"{points:2d}", 1)
        found.append(exposures(fecm.run_one(deck.replace(card, changed)))["interlaminar"])
    assert found == pytest.approx([found[0]] * 3, rel=1e-6)


@pytest.mark.long
def test_a_tie_names_the_first_place_and_counts_the_others() -> None:
    deck = impact_on(4)
    runs = [fecm.run_one(deck, solver=solver) for solver in ("kernels", "csr", "numpy")]
    for one, other, third in zip(*map(largest_exposures, runs), strict=True):
        assert (one.ply, one.mode, one.mirrors) == (other.ply, other.mode, other.mirrors)
        assert (one.x, one.y) == pytest.approx((other.x, other.y), rel=1e-9)
        assert one.time == other.time == third.time
        assert (third.ply, third.mode, third.mirrors) == (one.ply, one.mode, one.mirrors)
        assert one.mirrors == 1  # half a turn maps the plate onto itself


def test_corners_of_a_window_inside_the_plate_are_found() -> None:
    deck = fecm.impact(
        fecm.Plate.on_fixture("D7136"),
        fecm.Laminate("[45/0/-45/90]2s", "IM7/8552", 0.184),
        fecm.RigidMass(5.5e-3),
        fecm.Contact.estimate(radius=8),
        energy="5J",
        duration=1e-4,
        units="mm-N-s",
    )
    (problem,) = load_deck(deck).problems
    corners = sorted(map(tuple, problem.inner_corners.round(3).tolist()))
    assert corners == [(12.5, 12.5), (12.5, 87.5), (137.5, 12.5), (137.5, 87.5)]


def test_a_plate_supported_at_its_edges_has_no_corner_inside() -> None:
    coordinates, elements = square(4, 4)
    held = np.isin(coordinates, [coordinates.min(), coordinates.max()]).any(axis=1)
    blocks = element_blocks(elements, coordinates)
    assert len(inner_corners(blocks, coordinates, np.asarray(held))) == 0
