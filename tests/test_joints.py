"""Where elements of a mesh meet: common nodes, nodes in the same place, groups and boundary."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm.deck.units import unit_names
from fecm.problem.generate import restraint_codes
from tests.builders import square
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, MESH, small

DATA = Path(__file__).parent / "data"
# Two squares side by side; the right one is two elements, whose common node is at (1, 0.5).
POINTS = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 0.5), (2, 1), (1, 0.5)]
LEFT, LOWER, UPPER = [0, 1, 2, 3], [1, 4, 5, 7], [7, 5, 6, 2]

FEAP = """\
FECM
    9    4    1    2    5    4
COOR
    1    1       0.0       0.0
    3    0      20.0       0.0
    4    1       0.0      10.0
    6    0      20.0      10.0
    7    1       0.0      20.0
    9    0      20.0      20.0

ELEM
    1    1    1    2    5    4    1
    3    1    4    5    8    7    1

MATE
    2    1    1       2.0
   1.57E-9       0.3   70000.0   70000.0   26923.0   26923.0   26923.0
    1  0.0       2.0
END
MACR
LMAS
END
STOP
"""


def imported(points: object, cells: object, **others: object) -> fecm.Plate:
    return fecm.Plate.from_mesh((points, cells), **others)  # type: ignore[arg-type]


def codes(mesh: str) -> list[str]:
    return [finding.code for finding in fecm.check(small(mesh=mesh)).findings]


def test_a_node_inside_a_side_of_its_neighbour_is_an_error_that_names_both() -> None:
    with pytest.raises(fecm.MeshError, match=r"point 8 at 1, 0\.5 lies inside a side of number 1 "):
        imported(POINTS, [LEFT, LOWER, UPPER])


def test_a_hanging_node_across_a_seam_of_separate_nodes_is_found() -> None:
    apart = [*POINTS, (1.0, 0.0), (1.0, 1.0)]
    with pytest.raises(fecm.MeshError, match="point 8 at"):
        imported(apart, [[0, 8, 9, 3], LOWER, UPPER])


@pytest.mark.parametrize("bulge", [0.0, 0.1])
def test_a_hanging_node_is_found_on_straight_and_on_curved_sides(bulge: float) -> None:
    """The side of the first element is the parabola through its mid-side node."""
    corners = [(0, 0), (2, 0), (2, 2), (0, 2), (4, 0), (4, 2)]
    middles = [(1, 0), (2 + bulge, 1), (1, 2), (0, 1)]  # of the left element
    quarter = (2 + 0.75 * bulge, 0.5)  # on the same parabola
    points = [*corners, *middles, quarter, (4, 1), (3, 0), (4, 0.5), (3, 1)]
    left, right = [0, 1, 2, 3, 6, 7, 8, 9], [1, 4, 11, 7, 12, 13, 14, 10]
    with pytest.raises(fecm.MeshError, match="point 11 at"):
        imported(points, [left, right])


def test_elements_that_share_their_nodes_are_no_hanging_nodes_in_any_family() -> None:
    for kind in (4, 8, 9):
        points, nodes = square(3, 2, 9 if kind == 8 else kind)
        plate = imported(points, nodes[:, :kind] - 1)
        assert plate.imported is not None
        assert plate.imported.elements == 6


def test_nodes_one_rounding_apart_are_in_the_same_place() -> None:
    assert "W314" not in codes(MESH)
    points, nodes = square(2, 2, 4)
    cells = nodes - 1
    apart = np.vstack([points, points[[4]] * (1.0 + 2e-16)])
    cells[3][cells[3] == 4] = len(points)
    deck = fecm.impact(
        imported(apart, cells),
        fecm.Laminate([0, 90, 90, 0], "report", 0.0053),
        fecm.RigidMass(1e-3),
        fecm.Contact(1e5),
        at=(1.0, 1.0),
        velocity=10.0,
        duration=1e-5,
        dt=1e-7,
        patch=None,
    )
    assert "W314" in [finding.code for finding in fecm.check(deck).findings]


def test_a_seam_of_separate_nodes_is_no_boundary() -> None:
    three = [(x, y) for y in range(3) for x in (0, 1)] + [(x, y) for y in range(3) for x in (1, 2)]
    quads = [[0, 1, 3, 2], [2, 3, 5, 4], [6, 7, 9, 8], [8, 9, 11, 10]]
    seam = imported(three, quads).imported
    assert seam is not None
    held = seam.supported((0, 0, 0, 0, 0), {"boundary": "clamped"})
    assert held is not None
    rows = np.flatnonzero(restraint_codes([held], 12, 5)[:, 2])
    assert set(rows + 1) == set(range(1, 13)) - {4, 9}


def test_a_group_of_corners_of_second_order_sides_has_their_middles_too() -> None:
    points, nodes = square(2, 1, 9)
    low = [row for row, (x, y) in enumerate(points) if y == 0.0]
    corners = sorted(set(low) & set((nodes[:, :4] - 1).ravel().tolist()))
    assert len(corners) == 3
    built = imported(points, nodes - 1, groups={"low": corners}).imported
    assert built is not None
    on = built.points[built.groups["low"]]
    assert len(on) == 5
    assert (on[:, 1] == 0.0).all()


def test_a_line_in_two_physical_groups_of_gmsh_counts_for_both() -> None:
    pytest.importorskip("meshio", reason="meshes are read by meshio")
    built = fecm.Plate.from_mesh(DATA / "two-groups-gmsh41.msh").imported
    assert built is not None
    left, rim = (built.points[built.groups[name]] for name in ("left", "rim"))
    assert (left[:, 0] == built.extent[0][0]).all()
    assert (left.shape[0], rim.shape[0]) == (9, 32)  # 8 x 8 elements
    assert built.surfaces["plate"].tolist() == list(range(64))


def test_cells_whose_nodes_are_in_another_order_are_named_as_such() -> None:
    """Nodes of a quadratic cell in turn: corner, middle, corner and so on."""
    nine = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1), (1, 1)]
    with pytest.raises(ValueError, match="Jacobian"):
        fecm.impact(
            imported(nine, [list(range(9))]),
            fecm.Laminate([0, 90, 90, 0], "report", 0.0053),
            fecm.RigidMass(1e-3),
            fecm.Contact(1e5),
            at=(1.0, 1.0),
            velocity=10.0,
            duration=1e-5,
        )


def test_an_elem_card_with_feaps_material_number_is_recognized(tmp_path: Path) -> None:
    deck = tmp_path / "feap.inp"
    deck.write_text(FEAP)
    assert "FEAP's has one before the nodes: leave it out" in call("check", deck).stdout


def test_units_in_capitals_are_the_usual_ones() -> None:
    deck = small(data=f"UNIT\nIN LBF S\n{DATA_CARDS}")
    assert unit_names(fecm.read_one(deck)) == {"length": "in", "force": "lbf", "time": "s"}


def test_a_poissons_ratio_that_no_ply_has_is_refused_in_a_file_of_plies(tmp_path: Path) -> None:
    file = tmp_path / "plies.toml"
    file.write_text('["A"]\ndensity = 1.58e-9\nnu12 = 4.2\nE1 = 125000\nE2 = 8600\nG12 = 4200\n')
    assert_unusable(call("materials", file))


@pytest.mark.parametrize(("card", "found"), [("-12,5", True), ("-12,5,0", False), ("-12,0", False)])
def test_a_decimal_comma_on_prel_is_an_error(card: str, found: bool) -> None:
    deck = small(data=f"PREL\n{card}\n{DATA_CARDS}")
    assert ("E535" in [one.code for one in fecm.check(deck).findings]) is found


def test_a_last_node_in_no_element_at_the_place_of_another_is_an_error_of_its_own() -> None:
    mesh = MESH.replace("\n\nELEM", "\n   26    0       0.0       0.0\n\nELEM", 1)
    deck = small(mesh=mesh).replace("   25    4    2", "   26    4    2", 1)
    assert "Node 26 is in no element." in [f.message for f in fecm.check(deck).findings]
