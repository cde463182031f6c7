"""Bisected meshes: the same plate with more elements."""

from __future__ import annotations

import numpy as np
import pytest

import fecm
from fecm.deck.model import Deck
from fecm.mechanics.plate import PlateModel
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck
from fecm.problem.refine import RefineError, refined_deck
from tests.decks import LONG, MESH, small


def plate(deck: Deck) -> PlateModel:
    (problem,) = load_deck(deck.to_text()).problems
    return problem.plate


def test_a_bisected_mesh_has_the_same_area_and_mass_and_four_times_the_elements() -> None:
    deck = fecm.read_one(LONG.read_text())
    fine = refined_deck(deck, generate(deck))
    coarse_plate, fine_plate = plate(deck), plate(fine)
    assert fine.control.numel == 4 * deck.control.numel
    assert fine.control.numnp == (2 * 28 + 1) * (2 * 20 + 1)
    assert fine_plate.area() == pytest.approx(coarse_plate.area(), rel=1e-12)
    numbers = generate(deck).coordinates
    np.testing.assert_array_equal(generate(fine).coordinates[: len(numbers)], numbers)
    assert not [f for f in load_deck(fine.to_text()).findings if f.code == "W314"]


def test_restraints_carry_over_to_the_new_nodes_of_a_supported_side() -> None:
    edge = MESH[: MESH.index("BOUN")] + (
        "BOUN\n    1    1   -1   -1   -1    0    0\n    5    1   -1   -1    1    0    0\n"
        "   25    0    1    1    0    0    0\n\n"
    )
    deck = fecm.read_one(small(mesh=edge))
    mesh = generate(refined_deck(deck, generate(deck)))
    held = mesh.codes[:, 2] != 0
    assert (held == (mesh.coordinates[:, 1] == 0.0)).all()
    assert (mesh.codes[:, :2] != 0).all()


def test_bisecting_one_element_cuts_its_strips_and_stays_conforming() -> None:
    deck = fecm.read_one(LONG.read_text())
    mesh = generate(deck)
    marked = np.zeros(140, dtype=bool)
    marked[37] = True
    fine = refined_deck(deck, mesh, marked)
    assert fine.control.numel == (14 + 1) * (10 + 1)
    new = generate(fine)
    assert len(np.unique(new.coordinates.round(9), axis=0)) == len(new.coordinates)
    assert plate(fine).area() == pytest.approx(plate(deck).area(), rel=1e-12)


def test_bisection_of_distorted_elements_keeps_their_sides() -> None:
    last = "   25    0       2.0       2.0\n"
    deck = fecm.read_one(small(mesh=MESH.replace(last, f"{last}   13    0       1.1       0.9\n")))
    fine = refined_deck(deck, generate(deck))
    assert plate(fine).area() == pytest.approx(plate(deck).area(), rel=1e-12)


def test_elements_without_a_centre_node_are_not_bisected() -> None:
    eight = MESH.replace("    7    2\n", "    0    2\n").replace("   17    2\n", "    0    2\n")
    deck = fecm.read_one(small(mesh=eight))
    with pytest.raises(RefineError, match="four or nine nodes"):
        refined_deck(deck, generate(deck))
