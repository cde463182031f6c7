"""Elastic edges and point masses of new decks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.deck import model
from fecm.deck.model import Deck, NodeValues, PointMasses, Springs
from fecm.mechanics.solutions import modes
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.problem.supports import spring_stiffness
from tests.builders import table
from tests.calls import assert_unusable, new, new_deck

DATA = Path(__file__).parent / "data"
PLY = fecm.Ply(1.57e-9, 0.32, 171420.0, 9080.0, 5290.0, 5290.0, 3242.86)
LAMINATE = fecm.Laminate("[0/90/0/90/0]s", PLY, 0.2)
OPTIONS = ("--size", "100x80", "--mesh", "4x4", "--units", "mm-N-s", "--layup", "[0/90]2s",
           "--material", "IM7/8552", "--ply-thickness", ".3", "--projectile", "mass:1e-4",
           "--law", "4e4,0,0,1.5", "--velocity", "100", "--duration", "1e-5", "--dt", "1e-7",
           "--kinematics", "linear")  # fmt: skip


def deck_of(plate: fecm.Plate, **options: Any) -> Deck:
    """A thin plate under a small mass."""
    given: dict[str, Any] = {"velocity": 1000.0, "duration": 1e-3, "patch": "disc:4"}
    return fecm.impact(
        plate,
        LAMINATE,
        fecm.RigidMass(1e-3),
        model.Indentation(5e4, 1e6, 0.1, 1.5),
        units="mm-N-s",
        kinematics="linear",
        shear_factor=1.0,
        **{**given, **options},
    )


def problem_of(deck: Deck) -> Problem:
    """The checked problem of a deck."""
    (problem,) = load_deck(deck).problems
    return problem


@pytest.mark.parametrize(
    "row",
    table("elastic_edges.csv"),
    ids=lambda row: f"{row['k_r_Nmm_per_rad_mm']}, {row['k_w_N_per_mm2']}",
)
@pytest.mark.few(3)  # of 8, 0.3 s each
def test_elastic_edges_have_the_frequencies_of_another_program(row: dict[str, str]) -> None:
    rotation, w = float(row["k_r_Nmm_per_rad_mm"]), float(row["k_w_N_per_mm2"])
    support = f"spring:{rotation / 1e3:g}kN" + ("" if w == np.inf else f",{w:g}N/mm^2")
    if rotation == np.inf:
        support = "clamped"
    problem = problem_of(deck_of(fecm.Plate.rectangle((300.0, 200.0), (24, 16), support=support)))
    frequencies = modes(problem.plate, 6, consistent=False).angular_frequency / (2.0 * np.pi)
    assert frequencies == pytest.approx([float(row[f"f{n}_Hz"]) for n in range(1, 7)], rel=1e-4)
    assert problem.static is not None
    expected = float(row["flexibility_mm_per_N"])
    assert problem.static.compliance == pytest.approx(expected, rel=3e-3)


def rectangle_as_mesh(counts: tuple[int, int]) -> tuple[Any, dict[str, Any]]:
    """Points, cells of nine nodes, and the groups of the edges of a plate of 90 x 60."""
    nx, ny = 2 * counts[0] + 1, 2 * counts[1] + 1
    x, y = np.meshgrid(np.linspace(0.0, 90.0, nx), np.linspace(0.0, 60.0, ny))
    numbers = np.arange(nx * ny).reshape(ny, nx)
    n = numbers[:-1:2, :-1:2].ravel()
    offsets = [0, 2, 2 + 2 * nx, 2 * nx, 1, 2 + nx, 1 + 2 * nx, nx, 1 + nx]
    edges = {"left": numbers[:, 0], "right": numbers[:, -1], "bottom": numbers[0]}
    points = np.column_stack([x.ravel(), y.ravel()])
    return (points, n[:, None] + offsets), {**edges, "top": numbers[-1]}


def test_an_imported_mesh_has_the_springs_of_a_rectangle_at_its_nodes() -> None:
    edges = {"left": "spring:1e3,20", "bottom": "spring:500,5", "top": "spring:0,7"}
    rectangle = deck_of(fecm.Plate.rectangle((90.0, 60.0), (3, 2), edges=edges))
    mesh, groups = rectangle_as_mesh((3, 2))
    imported = deck_of(fecm.Plate.from_mesh(mesh, edges, groups=groups))
    on_lines, at_nodes = (
        spring_stiffness(deck, problem_of(deck).mesh) for deck in (rectangle, imported)
    )
    assert imported.require(Springs).word == ""
    assert at_nodes == pytest.approx(on_lines, rel=1e-5)
    assert on_lines.sum(axis=0) == pytest.approx([0, 0, 60 * 20 + 90 * (5 + 7), 6e4, 4.5e4])


def test_a_curved_edge_has_springs_against_w_alone() -> None:
    mesh = DATA / "hole-quad8.msh"  # whose outer edges are clamped
    problem = problem_of(deck_of(fecm.Plate.from_mesh(mesh, {"hole": "spring:0,10"}), at=(5, 5)))
    area = problem.plate.total_mass() / (1.57e-9 * 2.0)
    radius = np.sqrt((60.0 * 40.0 - area) / np.pi)
    springs = spring_stiffness(problem.deck, problem.mesh).sum(axis=0)
    assert springs == pytest.approx([0, 0, 10.0 * 2.0 * np.pi * radius, 0, 0], rel=0.005)
    with pytest.raises(fecm.FecmError, match="not all along x or y: they can have springs"):
        deck_of(fecm.Plate.from_mesh(mesh, {"hole": "spring:1e3,10"}), at=(5, 5))


def test_without_a_spring_of_w_an_edge_holds_what_a_simple_support_does() -> None:
    simple, elastic = (
        deck_of(fecm.Plate.rectangle((90.0, 60.0), (3, 2), support=support))
        for support in ("simple", "spring:1e3")
    )
    assert simple.require(model.Boundary) == elastic.require(model.Boundary)
    free = deck_of(fecm.Plate.rectangle((90.0, 60.0), (3, 2), support="spring:1e3,5"))
    held = problem_of(free).mesh.codes != 0
    assert not held[:, 2:].any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--support", "springy"], "the supports are free, soft, simple, pinned, clamped, spring"),
        (["--support", "spring:"], "springs are spring:KR[,KW], as in spring:1e4"),
        (["--edge", "left=spring:1,2,3"], "springs are spring:KR[,KW], as in spring:1e4"),
        (["--edge", "left=spring:-1"], "the stiffness of a spring is 0 or more"),
        (["--edge", "left=spring:1kg"], "not a number or one with a unit, as in 6kN"),
        (["--edge", "lefft=spring:1"], "the edges are left, right, bottom, top"),
        (["--mass-at", "3,4"], "'3,4' is not X,Y:M[,J], as in 20,30:5g"),
        (["--mass-at", "3,4:0"], "--mass-at: the mass at 3, 4 is not positive"),
        (["--mass-at", "300,4:1"], "--mass-at: 300, 4 is outside the plate"),
        (["--mass-at", "3,4:5N"], "--mass-at is '5N', not a number or one with a unit, as in 5kg"),
    ],
)
def test_springs_and_masses_that_are_not_valid_are_refused(
    options: list[str], message: str
) -> None:
    answer = new(*OPTIONS, *options)
    assert_unusable(answer)
    assert message in answer.stderr


def test_masses_are_at_the_nearest_nodes_and_those_of_a_node_add_up() -> None:
    masses = ("--mass-at", "25,20:5g,2e-9", "--mass-at", "24,20:1g", "--mass-at", "50,40:2g")
    answer = new(*OPTIONS, *masses)
    (problem,) = load_deck(answer.stdout).problems
    cards = problem.deck.require(PointMasses).records
    values = {
        tuple(problem.mesh.coordinates[card.node - 1].tolist()): card.values for card in cards
    }
    assert values == {(25.0, 20.0): (6e-6, 2e-9), (50.0, 40.0): (2e-6, 0.0)}
    assert "note: the mass at 24, 20 is moved by 1 to the nearest node, 21 at 25, 20" in (
        answer.stderr
    )
    assert answer.stderr.count("is moved by") == 1
    plain = new_deck(*OPTIONS)
    added = problem.plate.total_mass() - problem_of(plain).plate.total_mass()
    assert added == pytest.approx(8e-6, rel=1e-9)


def test_a_line_of_springs_may_end_at_nodes_that_other_edges_hold() -> None:
    deck = new_deck(*OPTIONS, "--edge", "left=clamped", "--edge", "bottom=spring:1e3,10")
    assert "W575" not in {finding.code for finding in load_deck(deck).findings}
    held = new_deck(*OPTIONS, "--support", "clamped")
    line = Springs((NodeValues(1, 9, (0.0, 0.0, 5.0, 0.0, 0.0)),), word="LINE")
    fixed = model.Deck(held.title, held.control, (*held.segments, line), held.macros)
    assert "W575" in {finding.code for finding in load_deck(fixed).findings}
