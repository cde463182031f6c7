"""What is left out of a step changes no figure: reductions, products, threads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.deck.model import Deck, Forces, Impact, NodeValues
from fecm.mechanics import stiffness_product
from fecm.mechanics.solutions import Tangent, tangent_stiffness
from fecm.mechanics.stiffness_product import ElementProduct, Workers, stiffness_operator
from fecm.mechanics.symmetry import SymmetryReduction, symmetry_reduction
from fecm.problem.parts import build_plate
from tests.builders import Floats
from tests.decks import DATA_CARDS, LONG, MESH, PROGRAM, small

# The middle node of the small plate, hit in w.
MIDDLE = (12, 2)
# The lower edge alone is held.
ONE_EDGE = MESH[: MESH.index("BOUN")] + (
    "BOUN\n    1    1   -1   -1   -1    0    0\n    5    1   -1   -1    1    0    0\n"
    "   25    0    1    1    0    0    0\n\n"
)
UNSYMMETRIC = DATA_CARDS.replace("    2  90. ", "    2  30. ")
CLAMPED = MESH.replace("    1    1   -1   -1    0    0    0", "    1    1   -1   -1    1    1    1")
# The membrane is free: only w is held along the lower and the upper edge.
FREE_IN_PLANE = MESH[: MESH.index("BOUN")] + (
    "BOUN\n    1    1    0    0   -1    0    0\n    5    0    0    0    1    0    0\n"
    "   21    1    0    0   -1    0    0\n   25    0    0    0    1    0    0\n\n"
)
SYMMETRIC = DATA_CARDS.replace("    2  90. ", "    2   0. ")


def found(text: str, hit: tuple[int, int] = MIDDLE) -> SymmetryReduction:
    """Reduction of a small deck."""
    deck = fecm.read_one(text)
    return symmetry_reduction(
        build_plate(deck, fecm.problem.generate.generate(deck)), unit(hit, deck.control.numnp)
    )


def unit(hit: tuple[int, int], count: int = 25) -> Floats:
    """Unit force on one dof of a node of the small plate."""
    contact = np.zeros((count, 5))
    contact[hit] = 1.0
    return contact


def worst(a: Result, b: Result) -> float:
    """Largest difference of two results, each dataset by its own maximum."""
    errors = []
    for path in set(a).union(b):
        balance = path == "energy/balance_error"  # what is left of the energy that there was
        scale = b.energy.attributes["initial"] if balance else np.abs(b[path]).max() or 1.0
        errors.append(float(np.abs(a[path] - b[path]).max() / scale))
    return max(errors)


def both(deck: str | Deck) -> tuple[Result, Result]:
    """Results of the reduced plate and of the sparse matrix of all unknowns."""
    fast, plain = fecm.run(deck, solver="numpy"), fecm.run(deck, solver="csr")
    assert isinstance(fast, Result)
    assert isinstance(plain, Result)
    return fast, plain


def test_a_plate_struck_in_its_middle_moves_by_half_of_its_elements() -> None:
    half = found(small())
    assert half.weights.tolist() == [2, 2, 0, 0]
    assert half.signed
    # 25 nodes with w and two rotations each; the middle's rotations rest.
    assert half.count == 12 * 3 + 1


def test_an_element_in_the_very_middle_stands_for_itself() -> None:
    control = "    9    1    2    2    5    9\n"
    mesh = (
        "COOR\n    1    1       0.0       0.0\n    3    0       1.0       0.0\n"
        "    4    1       0.0       0.5\n    6    0       1.0       0.5\n"
        "    7    1       0.0       1.0\n    9    0       1.0       1.0\n\n"
        "ELEM\n    1    1    3    9    7    2    6    8    4    5    0\n\n"
        "BOUN\n    1    1   -1   -1    0    0    0\n    9    0    1    1    0    0    0\n\n"
    )
    data = DATA_CARDS.replace("   13    3", "    5    3")
    text = f"FECM one\n{control}{mesh}{data}END\nMACR\n{PROGRAM}END\nSTOP\n"
    assert found(text, (4, 2)).weights.tolist() == [1]
    fast, plain = both(text)
    assert worst(fast, plain) < 1e-12


@pytest.mark.parametrize(
    ("text", "hit"),
    [
        (small(), (11, 2)),  # beside the middle
        (small(), (12, 3)),  # a couple in the middle
        (small(mesh=ONE_EDGE), MIDDLE),
        (small(mesh=MESH.replace("       0.0       0.5\n", "       0.0       0.4\n")), MIDDLE),
    ],
)  # fmt: skip
def test_what_half_a_turn_does_not_carry_into_itself_is_stepped_whole(
    text: str, hit: tuple[int, int]
) -> None:
    assert found(text, hit).weights.tolist() == [1, 1, 1, 1]


def test_a_load_on_one_side_needs_the_whole_plate() -> None:
    deck = fecm.read_one(small())
    segments = list(deck.segments)
    where = next(i for i, s in enumerate(segments) if isinstance(s, Impact))
    aside = Forces((NodeValues(8, 0, (0.0, 0.0, 1.0, 0.0, 0.0)),))
    loaded = replace(deck, segments=(*segments[:where], aside, *segments[where:]), text="")
    plate = build_plate(loaded, fecm.problem.generate.generate(loaded))
    assert symmetry_reduction(plate, unit(MIDDLE)).weights.tolist() == [1, 1, 1, 1]
    assert worst(*both(loaded)) < 1e-11


def test_in_plane_unknowns_rest_only_where_nothing_couples_them_to_bending() -> None:
    # 37 as above; with the membrane free and coupled there are u and v of 12 nodes more.
    held = 2 * 5  # w along two edges, of which half counts
    assert found(small(mesh=FREE_IN_PLANE, data=SYMMETRIC)).count == 37 - held // 2
    assert found(small(mesh=FREE_IN_PLANE)).count == 37 - held // 2 + 24


@pytest.mark.parametrize("data", [SYMMETRIC, DATA_CARDS, UNSYMMETRIC])
@pytest.mark.parametrize("mesh", [MESH, CLAMPED, FREE_IN_PLANE])
@pytest.mark.few(3)  # of 9, 0.1 s each
def test_a_reduced_plate_gives_what_the_whole_one_does(mesh: str, data: str) -> None:
    program = PROGRAM.replace("LOOP         10", "LOOP        300")
    fast, plain = both(small(program, mesh=mesh, data=data))
    assert worst(fast, plain) < 1e-10
    # A laminate that couples does move in its plane, so that the comparison means something.
    if mesh == FREE_IN_PLANE and data != SYMMETRIC:
        assert np.abs(fast.tape3.displacement[:, :, :2]).max() > 1e-9


def test_the_long_deck_agrees_with_the_sparse_matrix_in_every_dataset() -> None:
    deck = LONG.read_text().replace("LOOP       4000", "LOOP       1000")
    assert worst(*both(deck)) < 1e-10


def test_rounding_of_a_symmetric_layup_counts_as_no_coupling() -> None:
    deck = fecm.read_one(LONG)
    plate = build_plate(deck, fecm.problem.generate.generate(deck))
    assert np.abs(plate.laminate.B).max() > 0.0
    assert not plate.laminate.is_coupled
    tilted = replace(plate.laminate, B=plate.laminate.B + 1e-9 * plate.laminate.A)
    assert tilted.is_coupled


@pytest.mark.parametrize("threads", [2, 3, 5])
def test_any_number_of_threads_gives_the_same_forces_to_the_last_bit(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    deck = fecm.read_one(LONG)
    plate = build_plate(deck, fecm.problem.generate.generate(deck))
    monkeypatch.setattr(stiffness_product, "BATCH", 500)
    monkeypatch.setattr("fecm.mechanics.plate.PIECE", 100)
    u = np.random.default_rng(3).standard_normal(plate.neq)
    alone = stiffness_operator(plate, "numpy")
    shared = stiffness_operator(plate, "numpy", workers=Workers(threads))
    assert isinstance(alone, ElementProduct)
    assert len(alone._domains) == 8
    np.testing.assert_array_equal(shared(u), alone(u))
    np.testing.assert_allclose(alone(u), plate.stiffness @ u, atol=1e-9)


@pytest.mark.parametrize(
    ("data", "pins"), [(SYMMETRIC, 0), (UNSYMMETRIC, 1)], ids=["bending", "coupled"]
)
def test_the_static_displacement_of_half_a_plate_is_the_one_of_the_whole_plate(
    data: str, pins: int
) -> None:
    deck = fecm.read_one(small(mesh=FREE_IN_PLANE, data=data))
    plate, contact = build_plate(deck, fecm.problem.generate.generate(deck)), unit(MIDDLE)
    half = symmetry_reduction(plate, contact)
    tangent = Tangent(plate, reduction=half)
    # The half turn prevents the translations in the plane, but not the rotation.
    assert len(tangent.pins) == pins
    actual = half.field(tangent.solve(half.gather(contact)))
    free = plate.mesh.equations > 0
    expected = np.zeros(free.shape)
    expected[free] = Tangent(plate).solve(contact[free])
    # Rigid motions in the plane are arbitrary, those of w and of the rotations are not.
    assert np.abs(actual - expected)[:, 2:].max() < 1e-12 * np.abs(expected).max()
    residual = plate.internal_forces(actual)[free] - contact[free]
    assert np.abs(residual).max() < 1e-12


def test_the_tangent_of_half_a_stretched_plate_has_the_forces_of_the_whole_one() -> None:
    text = small(mesh=FREE_IN_PLANE, data=UNSYMMETRIC)
    deck = fecm.read_one(text)
    plate = replace(build_plate(deck, fecm.problem.generate.generate(deck)), nonlinear=True)
    half = symmetry_reduction(plate, unit(MIDDLE))
    free = plate.mesh.equations > 0
    generator = np.random.default_rng(5)
    u, v = (0.1 * generator.standard_normal(half.count) for _ in range(2))
    field, change = half.field(u), half.field(v)[free]
    whole = tangent_stiffness(plate, field) @ change
    of_all = np.zeros(free.shape)
    of_all[free] = whole
    reduced = tangent_stiffness(plate, field, half) @ v
    assert np.abs(reduced - half.gather(of_all)).max() < 1e-12 * np.abs(reduced).max()
