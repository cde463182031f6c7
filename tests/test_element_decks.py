"""Decks of triangles and cubic elements: an impact on them, and what is said of wrong ones."""

from __future__ import annotations

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.mechanics.mesh import element_blocks
from fecm.problem.loading import load_deck
from tests.builders import (
    Floats,
    Ints,
    simple_support,
    square,
)
from tests.decks import OWN_FINDINGS

Mesh = tuple[Floats, Ints]


def deck(mesh: Mesh, orders: tuple[int, int, int], *, side: float = 2.0, steps: int = 800) -> str:
    """A simply supported square plate hit in the middle, in free format."""
    coordinates, elements = mesh
    codes = simple_support(coordinates).astype(int).tolist()
    struck = int(np.hypot(*(coordinates - 0.5).T).argmin()) + 1
    places = enumerate((side * coordinates).tolist(), 1)

    def card(*values: object) -> str:
        return ",".join(str(value) for value in values)

    cards = [
        "FECM simply supported plate",
        card(len(coordinates), len(elements), 2, 2, 5, elements.shape[1]),
        "COOR", *(card(n, 0, x, y) for n, (x, y) in places), "",
        "ELEM", *(card(n, *row) for n, row in enumerate(elements.tolist(), 1)), "",
        "BOUN", *(card(n, 0, *row) for n, row in enumerate(codes, 1) if any(row)), "",
        "ROD", card(struck, 3, 115.0), "EXPE", "1912000.,.0006564,.094,2.", "MATE",
        card(*orders, 0.106), ".000148,.3,17500000.,1150000.,800000.,800000.,800000.",
        "1,0.,.053", "2,90.,.053", "END", "MACR", "LMAS", "DT,,2.0E-7", card("LOOP", "", steps),
        "TIME", "RODP,,400", "NEXT", "END", "STOP",
    ]  # fmt: skip
    return "\n".join(cards) + "\n"


def run(mesh: Mesh, orders: tuple[int, int, int]) -> Result:
    return fecm.run_one(deck(mesh, orders))


@pytest.fixture(scope="module")
def nine_node_result() -> Result:
    """An impact on 4 x 4 elements with 9 nodes."""
    return run(square(4, 4, 9), (3, 2, 3))


# Triangles are stiffer than quadrilaterals, so that they take a finer mesh.
@pytest.mark.parametrize(
    ("n", "kind", "orders", "points", "tolerance"),
    [(4, 12, (4, 3, 4), 16, 0.03), (4, 12, (4, 4, -4), 16, 0.03), (16, 3, (2, 1, 2), 4, 0.06)],
)
def test_an_impact_on_other_elements_has_the_force_of_the_9_node_mesh(
    n: int,
    kind: int,
    orders: tuple[int, int, int],
    points: int,
    tolerance: float,
    nine_node_result: Result,
) -> None:
    mesh = square(n, n, kind)
    result = run(mesh, orders)
    expected = nine_node_result
    assert result.force.max() == pytest.approx(expected.force.max(), rel=tolerance)
    assert result.plate_w.max() == pytest.approx(expected.plate_w.max(), rel=tolerance)
    at_peak = [r.time[r.force.argmax()] for r in (result, expected)]
    assert at_peak[0] == pytest.approx(at_peak[1], rel=0.15)
    assert result["tape8/kappa_x"].shape == (2, len(mesh[1]), points)
    assert np.isfinite(result["tape8/kappa_x"]).all()
    assert result["mesh/elements"].shape == (len(mesh[1]), kind)


def findings(text: str) -> list[tuple[str, str, str]]:
    """Code, message and hint of a deck's findings, without those of the small plate."""
    return [
        (actual.code, actual.message, actual.hint)
        for actual in load_deck(text).findings
        if actual.code not in OWN_FINDINGS
    ]


@pytest.mark.parametrize("order", [-2, -3, -4])
def test_strains_at_nodal_points_of_triangles_are_refused_with_a_hint(order: int) -> None:
    ((code, message, hint),) = findings(deck(square(2, 2, 3), (2, 1, order)))
    assert code == "E317"
    assert f"K = {order}" in message
    assert "8 elements (1-8)" in message
    assert hint == f"take Gauss points: K = {-order}"


@pytest.mark.parametrize("order", [-1, 1, 2, 3, 4])
def test_strains_inside_triangles_are_stored(order: int) -> None:
    assert findings(deck(square(2, 2, 3), (2, 1, order))) == []


@pytest.mark.parametrize(
    ("kind", "orders", "swap", "hint"),
    [
        (3, (2, 1, 2), (1, 2), ""),
        (9, (3, 3, 3), (4, 6), ", mid-side 5 lies between corners 1 and 2"),
        (12, (4, 4, 4), (4, 9), ", nodes 5 and 10 divide the side from corner 1 to 2 in thirds"),
    ],
)  # fmt: skip
def test_a_folded_elements_hint_tells_its_familys_numbering(
    kind: int, orders: tuple[int, int, int], swap: tuple[int, int], hint: str
) -> None:
    coordinates, elements = square(2, 2, kind)
    row = elements[1]
    row[list(swap)] = row[list(swap[::-1])]
    assert findings(deck((coordinates, elements), orders)) == [
        (
            "E313",
            "Element 2 has a Jacobian that is zero or negative.",
            "corners run counter-clockwise" + hint,
        )
    ]


@pytest.mark.parametrize(
    ("kind", "absent", "corners"),
    [(3, 1, "three"), (4, 2, "four"), (9, 3, "four"), (12, 0, "four")],
)
def test_an_element_without_one_of_its_corners_is_refused(
    kind: int, absent: int, corners: str
) -> None:
    coordinates, elements = square(2, 2, kind)
    elements[2, absent] = 0
    codes = findings(deck((coordinates, elements), (3, 3, 3)))
    assert [(code, message) for code, message, _ in codes] == [
        ("E310", f"Element 3 lacks one of its {corners} corners.")
    ]


def test_a_4_node_element_without_its_fourth_node_is_a_triangle() -> None:
    coordinates, elements = square(2, 2, 4)
    elements[3, 3] = 0
    problem = load_deck(deck((coordinates, elements), (2, 2, 2))).problems[0]
    actual = element_blocks(problem.mesh.elements, problem.mesh.coordinates)
    names = {tuple(family.rows.tolist()): family.shape.name for family in actual}
    assert names == {(0, 1, 2): "quadrilateral", (3,): "triangle"}


@pytest.mark.parametrize(
    ("kind", "shear", "supported", "codes"),
    [
        (12, 2, True, ["W316"]), (12, 3, True, []), (12, 3, False, []), (9, 2, True, ["W322"]),
        (9, 2, False, ["E321"]), (9, 3, False, []), (8, 2, False, []), (8, 1, True, ["W316"]),
        (4, 1, True, []), (4, 1, False, ["W316"]), (4, 2, False, ["W320"]), (3, 1, False, []),
    ],
)  # fmt: skip
def test_a_shear_order_that_leaves_motions_without_energy_is_warned_of(
    kind: int, shear: int, supported: bool, codes: list[str]
) -> None:
    text = deck(square(2, 2, kind), (3, shear, 2))
    if not supported:
        start, end = text.index("BOUN"), text.index("ROD")
        text = f"{text[:start]}{text[end:]}"
    assert [code for code, _, _ in findings(text)] == codes


def test_a_triangles_missing_corner_is_no_side_of_it() -> None:
    coordinates, elements = square(8, 8, 4)
    a, b, c, d = elements[36]  # its first corner is struck
    elements[36] = a, b, c, 0
    elements = np.vstack([elements, [[c, d, a, 0]]]).astype(np.int32)
    assert findings(deck((coordinates, elements), (2, 1, 2))) == []


@pytest.mark.parametrize(("nodes", "right"), [(2, False), (3, True), (12, True), (13, False)])
def test_elements_have_3_to_12_nodes(nodes: int, right: bool) -> None:
    lines = deck(square(1, 1, 4), (2, 2, 2)).splitlines()
    lines[1] = f"4,1,2,2,5,{nodes}"
    messages = [actual.message for actual in load_deck("\n".join(lines) + "\n").findings]
    assert (f"NEN is {nodes}; it must be 3 to 12." in messages) is not right
