"""Contact patches: weights, and static compliance against the exact series."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fecm
from fecm.deck.model import Patch
from fecm.mechanics.laminate import laminate
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.points import DISC, HERTZ, PatchError, patch_weights
from fecm.mechanics.solutions import Tangent
from tests.builders import (
    REPORT_PLY,
    Floats,
    distorted_square,
    mesh_on,
    nothing,
    rules,
    square,
    table,
    with_restraints,
)
from tests.decks import small

CROSS_PLY = laminate(REPORT_PLY, 5 * (0.0, 90.0) + 5 * (90.0, 0.0), [0.0053] * 20)


def rectangle(nx: int, ny: int, a: float = 6.0, b: float = 4.0) -> MeshArrays:
    """The simply supported rectangle of 9-node elements."""
    x, y = np.meshgrid(np.linspace(0.0, a, nx + 1), np.linspace(0.0, b, ny + 1))
    coordinates, elements = mesh_on(np.stack([x, y], axis=-1), 9)
    at_x_ends, at_y_ends = (np.isclose(coordinates, 0.0) | np.isclose(coordinates, [a, b])).T
    held = nothing(coordinates)
    held[:, :2] = True
    held[:, 2] = at_x_ends | at_y_ends
    held[:, 3], held[:, 4] = at_y_ends, at_x_ends
    return with_restraints(coordinates, elements, held)


def compliance(mesh: MeshArrays, weights: Floats) -> float:
    """W per unit force, W being the weighted mean of w."""
    plate = PlateModel(mesh, CROSS_PLY, replace(rules(), assumes_shear=True))
    load = np.zeros(mesh.equations.shape)
    load[:, 2] = weights
    free = load[mesh.equations > 0]
    return float(free @ Tangent(plate).solve(free))


def whole(mesh: tuple[Floats, object]) -> MeshArrays:
    coordinates, elements = mesh
    assert isinstance(elements, np.ndarray)
    return with_restraints(coordinates, elements, nothing(coordinates))


@pytest.mark.parametrize("shape", [DISC, HERTZ])
@pytest.mark.parametrize("c", [0.5, 0.25, 0.125])
@pytest.mark.few(2)  # of 6, 0.1 s each
def test_the_compliance_under_a_patch_is_that_of_the_series(shape: str, c: float) -> None:
    name = {DISC: "disc", HERTZ: "hertz"}[shape]
    (exact,) = (
        float(row["W/F conjugate mean"])
        for row in table("static_patch.csv")
        if (row["shape"], row["K"]) == (name, "1") and float(row["c (radius or half side)"]) == c
    )
    mesh = rectangle(round(6 / c), round(4 / c))  # the element's side is c
    actual = compliance(mesh, patch_weights(mesh, shape, c, 3.0, 2.0))
    assert actual == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(("count", "least"), [(12, 0.1), (36, 0.4)])
def test_the_centre_of_an_element_inside_a_large_patch_has_the_share_of_its_area(
    count: int, least: float
) -> None:
    mesh = rectangle(count, count, 6.0, 6.0)
    weights = patch_weights(mesh, DISC, 2.0, 3.0, 3.0)
    side = 6.0 / count
    centres = mesh.elements[:, 8] - 1
    inside = np.hypot(*(mesh.coordinates[centres] - 3.0).T) < 2.0 - side
    exact = 4.0 / 9.0 * side**2 / (np.pi * 2.0**2)
    assert np.abs(weights[centres][inside] / exact - 1.0).max() < least


def test_the_compliance_is_the_same_with_the_patch_on_a_node_or_inside_an_element() -> None:
    on_node, inside = (
        compliance(mesh, patch_weights(mesh, DISC, 0.25, 3.0, 2.0))
        for mesh in (rectangle(24, 16), rectangle(25, 17))
    )
    assert inside == pytest.approx(on_node, rel=1e-3)


def test_a_vanishing_patch_at_a_node_is_the_point_force() -> None:
    mesh = rectangle(12, 8)
    node = int(np.hypot(*(mesh.coordinates - [3.0, 2.0]).T).argmin())
    point = np.zeros(len(mesh.coordinates))
    point[node] = 1.0
    weights = patch_weights(mesh, DISC, 1e-7, 3.0, 2.0)
    np.testing.assert_allclose(weights, point, atol=1e-6)
    assert compliance(mesh, weights) == pytest.approx(compliance(mesh, point), rel=1e-6)


@pytest.mark.parametrize("shape", [DISC, HERTZ])
def test_weights_of_a_quadratic_field_are_its_mean_under_the_pressure(shape: str) -> None:
    # The mean of r^2 is c^2/2 under a uniform pressure and 2 c^2/5 under Hertz's.
    mesh = whole(square(6, 6))
    x, y, c = 0.43, 0.58, 0.31
    weights = patch_weights(mesh, shape, c, x, y)
    X, Y = mesh.coordinates.T
    mean = c**2 * (0.5 if shape == DISC else 0.4)
    assert weights.sum() == pytest.approx(1.0, rel=1e-14)
    assert weights @ X == pytest.approx(x, rel=1e-13)
    assert weights @ ((X - x) ** 2 + (Y - y) ** 2) == pytest.approx(mean, rel=1e-12)
    distorted = whole(distorted_square(6, 6))
    weights = patch_weights(distorted, shape, c, x, y)
    assert weights @ distorted.coordinates == pytest.approx([x, y], rel=1e-13)


def test_a_patch_must_be_on_the_plate() -> None:
    mesh = whole(square(4, 4))
    for x, y, c in ((0.1, 0.5, 0.11), (1.5, 0.5, 0.1), (0.5, 0.5, 0.51)):
        with pytest.raises(PatchError, match="not on the plate"):
            patch_weights(mesh, DISC, c, x, y)
    coordinates, elements = square(4, 4)
    hole = with_restraints(coordinates, np.delete(elements, 5, axis=0), nothing(coordinates))
    with pytest.raises(PatchError, match="not on the plate"):
        patch_weights(hole, DISC, 0.2, 0.5, 0.5)
    assert patch_weights(mesh, DISC, 0.5, 0.5, 0.5).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("centre", [(0.0, 0.0), (5.0, 0.0), (0.0, 5.0), (None, None)])
def test_a_centre_with_a_coordinate_of_0_is_written_and_read_again(
    centre: tuple[float | None, float | None],
) -> None:
    patch = Patch("HERT", None, *centre)
    deck = fecm.read_one(small())
    written = replace(deck, segments=(*deck.segments, patch)).to_text()
    assert fecm.read_one(written).last(Patch) == patch
