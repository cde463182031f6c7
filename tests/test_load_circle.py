"""Exposures on the circle around the load: strains, convergence, ties and corners."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.judge.exposure_bands import LoadMesh, is_bounded, mesh_band
from fecm.judge.exposures import FailureVerdict, LargestExposure, failure_verdict
from fecm.mechanics.exposures import CircleStresses
from fecm.mechanics.mesh import element_blocks, inner_corners
from fecm.problem.loading import load_deck
from fecm.results.exposures import largest_exposures
from tests.builders import report_plate, square, table

# A load at a corner of elements, on a plate that it bends over 30 R.
AT_CORNER = LoadMesh(1.0, True, True, 30.0, 1.0)


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
    (note,) = [note for note in coarse.notes if "exposures at the load" in note]
    assert (
        "have a wide band: the elements there have sides of 12.5 mm, and c + h/2 is 2.43 m" in note
    )


@pytest.mark.parametrize(
    ("exposure", "coarseness", "expected"),
    [
        (0.9, 1.0, FailureVerdict.NOT_REACHED),
        (0.995, 1.0, FailureVerdict.OPEN),
        (1.05, 1.0, FailureVerdict.OPEN),
        (1.1, 1.0, FailureVerdict.REACHED),
        (0.1, 7.5, FailureVerdict.OPEN),
        (3.0, 7.5, FailureVerdict.OPEN),
    ],
)
def test_the_verdict_is_open_where_the_band_of_the_mesh_has_1(
    exposure: float, coarseness: float, expected: FailureVerdict
) -> None:
    band = mesh_band(exposure, "puck", AT_CORNER._replace(coarseness=coarseness))
    one = LargestExposure("puck", exposure, "inter-fibre A", 1, 0.0, 0.0, 0.0, band=band)
    assert failure_verdict([one]) is expected


@pytest.mark.parametrize(
    "unlike_the_fit",
    [
        {"coarseness": 5.3},
        {"at_corner": False, "coarseness": 2.7},
        {"nine_nodes": False},
        {"bending_reach": 7.9},
        {"bending_reach": 10.0, "coarseness": 2.6},  # fewer than four elements over 10 R
    ],
)
def test_a_mesh_unlike_the_fitted_ones_bounds_nothing(unlike_the_fit: dict[str, Any]) -> None:
    assert is_bounded(mesh_band(1.0, "puck", AT_CORNER))
    mesh = AT_CORNER._replace(**unlike_the_fit)
    for criterion in ("puck", "interlaminar"):
        assert mesh_band(1.0, criterion, mesh) == (0.0, np.inf)


@pytest.mark.parametrize(
    "wider",
    [
        {"at_corner": False},
        {"bending_reach": 12.0},
        {"coarseness": 2.0},
        {"anisotropy": 3.0},
    ],
)
def test_the_band_is_wider_inside_an_element_and_on_thick_plates(wider: dict[str, Any]) -> None:
    (low, high), (lower, higher) = (
        mesh_band(1.0, "puck", mesh) for mesh in (AT_CORNER, AT_CORNER._replace(**wider))
    )
    assert lower <= low < 1.0 < high <= higher
    assert higher - lower > high - low


CRITERIA = ("max_stress", "tsai_wu", "hashin", "puck", "interlaminar")


def rows_of(kind: str) -> list[tuple[str, LoadMesh, dict[str, float], dict[str, float]]]:
    """Plate, mesh at the load, exposures, and exposures of the plate's finest mesh.

    benchmarks/exposure_bands.py computes the sets `fit` and `test`; docs/confidence.md has their
    plates. The set `reported` has two plates of users, a thick one and a curved one.
    """
    rows = [row for row in table("exposures_on_meshes.csv") if row["set"] == kind]
    exposures_on = [{name: float(row[name]) for name in CRITERIA} for row in rows]
    finest = {row["plate"]: on for row, on in zip(rows, exposures_on, strict=True)}  # the last one
    meshes = [
        LoadMesh(
            coarseness=float(row["coarseness"]),
            at_corner=row["at_corner"] == "1",
            nine_nodes=True,
            bending_reach=float(row["bending_reach"]),
            anisotropy=float(row["anisotropy"]),
        )
        for row in rows
    ]
    return [
        (row["plate"], mesh, on, finest[row["plate"]])
        for row, mesh, on in zip(rows, meshes, exposures_on, strict=True)
    ]


@pytest.mark.parametrize(("kind", "plates"), [("fit", 16), ("test", 11), ("reported", 2)])
def test_no_band_excludes_the_exposure_of_the_finest_mesh(kind: str, plates: int) -> None:
    rows = rows_of(kind)
    assert len({plate for plate, *_ in rows}) == plates
    bounded = 0
    for plate, mesh, exposures_here, finest in rows:
        for criterion, exposure in exposures_here.items():
            low, high = mesh_band(exposure, criterion, mesh)
            assert low <= finest[criterion] <= high, (plate, mesh, criterion)
            bounded += is_bounded((low, high))
    assert bounded > 0.3 * 5 * len(rows)


def test_no_mesh_says_reached_where_the_finest_is_below_1() -> None:
    for kind in ("fit", "test", "reported"):
        for plate, mesh, exposures_here, finest in rows_of(kind):
            # The load at which the finest mesh is at 0.999.
            scale = 0.999 / max(finest.values())
            largest = [
                LargestExposure(
                    criterion,
                    scale * exposure,
                    "",
                    1,
                    0.0,
                    0.0,
                    0.0,
                    band=mesh_band(scale * exposure, criterion, mesh),
                )
                for criterion, exposure in exposures_here.items()
            ]
            assert failure_verdict(largest) is not FailureVerdict.REACHED, (plate, mesh)


def test_a_thick_plate_and_a_coarse_curved_panel_are_open() -> None:
    # The finest meshes have 0.992 for the plate (a Navier series 0.99) and 1.04 for the panel.
    thick = fecm.impact(
        fecm.Plate.rectangle((80, 80), (8, 8), support="simple"),
        fecm.Laminate("[0/90]6s", "T300/5208", 0.2),
        fecm.RigidMass(5e-5),
        fecm.Contact.estimate(radius=6.35),
        velocity=7000,
        duration=2e-4,
        units="mm-N-s",
        damage=True,
        plies=False,
        kinematics="linear",
    )
    panel = fecm.impact(
        fecm.Plate.rectangle((120, 90), (12, 9), support="simple"),
        fecm.Laminate("[0/60/-60]2s", "IM7/8552", 0.18),
        fecm.RigidMass(3e-4),
        fecm.Contact.estimate(radius=8),
        velocity=1480,
        duration=7e-4,
        units="mm-N-s",
        damage=True,
        plies=False,
        kinematics="linear",
        radius_y=300.0,
    )
    of_plate, of_panel = (largest_exposures(fecm.run_one(deck)) for deck in (thick, panel))
    assert of_plate[0].exposure > 1.04
    assert of_plate[0].band is not None
    assert of_plate[0].band[0] < 0.99
    assert failure_verdict(of_plate) is FailureVerdict.OPEN
    assert of_panel[0].band == (0.0, np.inf)
    assert failure_verdict(of_panel) is FailureVerdict.OPEN


def test_the_exposure_at_a_centre_does_not_depend_on_the_points_of_stress() -> None:
    deck = impact_on(8).to_text()
    (card,) = [line for line in deck.splitlines() if line.split()[:3] == ["3", "3", "-3"]]
    values = []
    for points in (-3, 2, 4):
        changed = card.replace("-3", f"{points:2d}", 1)
        values.append(exposures(fecm.run_one(deck.replace(card, changed)))["interlaminar"])
    assert values == pytest.approx([values[0]] * 3, rel=1e-6)


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
