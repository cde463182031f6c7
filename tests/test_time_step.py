"""The critical time step, its lower bound from the elements, and the step that DT 0 takes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from fecm.mechanics import element_matrices, kernels, time_step
from fecm.mechanics.mesh import ElementBlock
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.time_step import (
    critical_time_step,
    eigenvalue_bounds,
    safe_time_step,
    taken_time_step,
)
from fecm.problem.loading import load_deck

from .builders import (
    distorted_square,
    general_plate,
    isotropic_plate,
    nothing,
    report_plate,
    rules,
    square,
    with_restraints,
)

Floats = NDArray[np.float64]

ROOT = Path(__file__).parents[1]


def free_plate(mesh: tuple[Floats, NDArray[np.int32]], thickness: float = 0.0) -> PlateModel:
    """A free plate of the general laminate, or an isotropic one of a thickness."""
    coordinates, elements = mesh
    laminate = isotropic_plate(thickness) if thickness else general_plate()
    return PlateModel(
        with_restraints(coordinates, elements, nothing(coordinates)), laminate, rules()
    )


def largest_eigenvalues(model: PlateModel, family: ElementBlock) -> Floats:
    """Largest eigenvalue of M^-1 K of every element."""
    mass = element_matrices.lumped_mass(family, model.laminate_of(family), model.rules.bending)
    stiffness = model.stiffness_of(family)
    pairs = zip(stiffness, mass.reshape(len(mass), -1), strict=True)
    return np.array([eigh(K, np.diag(M), eigvals_only=True)[-1] for K, M in pairs])


# More distinct elements than are computed without bounds.
MANY = 12
# The transverse shear of w is faster than bending and stretching.
STIFF = replace(
    free_plate(distorted_square(MANY, MANY, 9)),
    laminate=replace(isotropic_plate(0.1), shear=8.0 * isotropic_plate(0.1).shear),
    rules=replace(rules(), assumes_shear=True),
)
MODELS = {
    "4 nodes": free_plate(distorted_square(MANY, MANY, 4)),
    "8 nodes": free_plate(distorted_square(MANY, MANY, 8)),
    "triangles": free_plate(distorted_square(MANY, MANY, 3)),
    "12 nodes": free_plate(distorted_square(MANY, MANY, 12)),
    "thin": free_plate(distorted_square(MANY, MANY, 9), 0.001),
    "thick": free_plate(distorted_square(MANY, MANY, 9), 10.0),
    "report": replace(free_plate(distorted_square(MANY, MANY, 9)), laminate=report_plate()),
    "assumed shear": replace(
        free_plate(distorted_square(MANY, MANY, 9)), rules=replace(rules(), assumes_shear=True)
    ),
    "assumed shear, thin": replace(
        free_plate(distorted_square(MANY, MANY, 9), 0.02),
        rules=replace(rules(), assumes_shear=True),
    ),
    "assumed shear, stiff": STIFF,
    "assumed shear, tension": replace(STIFF, preload=(0.3, -0.2, 0.1)),
    "assumed shear, tension alone": replace(STIFF, preload=(50.0, -20.0, 30.0)),
    "other order of shear": replace(
        free_plate(distorted_square(MANY, MANY, 8)), rules=rules(3, 2, transposed_jacobian=True)
    ),
    "tension": replace(free_plate(distorted_square(MANY, MANY, 4)), preload=(50.0, -20.0, 30.0)),
    "compression": replace(free_plate(distorted_square(MANY, MANY, 4)), preload=(-5.0, -5.0, 0.0)),
    "curved": replace(free_plate(distorted_square(MANY, MANY, 4)), curvature=(20.0, -7.0, 9.0)),
}


@pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
@pytest.mark.few(4)  # of 16, 0.07 s each
def test_bounds_of_elements_are_above_their_largest_eigenvalues(model: PlateModel) -> None:
    for family in model.families:
        exact = largest_eigenvalues(model, family)
        bounds = eigenvalue_bounds(model, family)
        assert (bounds >= exact).all()
        assert np.median(bounds / exact) < 2.0


@pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
@pytest.mark.few(4)  # of 16, 0.07 s each
def test_the_safe_step_is_that_of_the_fastest_element(model: PlateModel) -> None:
    fastest = max(largest_eigenvalues(model, family).max() for family in model.families)
    assert safe_time_step(model) == pytest.approx(2.0 / np.sqrt(fastest), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "most"), [("thin", 1.2), ("report", 1.2), ("assumed shear, thin", 1.45)]
)
def test_bounds_are_close_whatever_the_thickness(name: str, most: float) -> None:
    (family,) = MODELS[name].families
    exact = largest_eigenvalues(MODELS[name], family)
    assert np.median(eigenvalue_bounds(MODELS[name], family) / exact) < most


def test_the_bound_of_a_folded_element_is_infinite() -> None:
    coordinates, elements = distorted_square(MANY, MANY, 4)
    elements[7] = elements[7][[0, 2, 1, 3]]
    near, far = coordinates[elements[0, [0, 2]] - 1]
    coordinates[elements[0, 2] - 1] = 0.6 * near + 0.4 * far  # folded at one point only
    model = free_plate((coordinates, elements))
    (family,) = model.families
    assert np.isinf(eigenvalue_bounds(model, family)).nonzero()[0].tolist() == [0, 7]


@pytest.mark.parametrize("nodes", [4, 9])
def test_the_safe_step_computes_the_stiffness_of_few_of_many_elements(
    monkeypatch: pytest.MonkeyPatch, nodes: int
) -> None:
    computed: list[int] = []
    stiffness = element_matrices.stiffness

    def counted(family: ElementBlock, *others: object) -> Floats:
        computed.append(len(family.rows))
        return stiffness(family, *others)  # type: ignore[arg-type]

    monkeypatch.setattr(element_matrices, "stiffness", counted)
    model = replace(free_plate(distorted_square(20, 20, nodes)), laminate=report_plate())
    assert safe_time_step(model) > 0.0
    assert sum(computed) <= 40


def slender(count: int) -> PlateModel:
    """A row of equal squares, whose highest frequencies are close together."""
    coordinates, elements = square(count, 1, 4)
    return free_plate((coordinates * [0.05 * count, 0.05], elements), thickness=0.01)


def test_the_steps_to_the_critical_one_do_not_grow_with_the_plate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    products = 0
    accelerations = time_step._accelerations

    def counted(model: PlateModel) -> object:
        product, *others = accelerations(model)

        def count(u: Floats) -> Floats:
            nonlocal products
            products += 1
            return product(u)

        return count, *others

    monkeypatch.setattr(time_step, "_accelerations", counted)
    model = slender(600)
    critical = critical_time_step(model)
    assert products <= 101
    scale = sparse.diags_array(1.0 / np.sqrt(model.mass))
    above = (2.0 / safe_time_step(model)) ** 2
    matrix = (scale @ model.stiffness @ scale).tocsc()
    (largest,) = eigsh(matrix, 1, sigma=above, return_eigenvectors=False)
    assert 0.0 <= critical * np.sqrt(largest) / 2.0 - 1.0 < 5e-4


@pytest.mark.skipif(kernels.LIBRARY is None, reason="the kernels are not compiled")
def test_kernels_and_numpy_have_the_same_critical_step(monkeypatch: pytest.MonkeyPatch) -> None:
    for model in (MODELS["4 nodes"], MODELS["tension"], MODELS["curved"]):
        compiled = critical_time_step(model)
        with monkeypatch.context() as without:
            without.setattr(kernels, "LIBRARY", None)
            assert critical_time_step(model) == pytest.approx(compiled, rel=1e-9)


def test_a_spring_on_one_node_is_part_of_the_critical_step() -> None:
    model = free_plate(distorted_square(4, 4, 4))
    weights = np.zeros(model.neq)
    weights[[7, 32]] = 0.25, 0.75
    spring = 40.0 * float(model.stiffness.diagonal().max())
    K = model.stiffness.toarray() + spring * np.outer(weights, weights)
    squares = eigh(K, np.diag(model.mass), eigvals_only=True)
    critical = critical_time_step(model, (weights, spring))
    assert critical == pytest.approx(2.0 / np.sqrt(squares[-1]), rel=5e-5)


# Of a Lanczos iteration with a residual of 1e-4, in the deck's unit of time.
TAKEN = {
    "decks/appendix.inp": 4.27e-07,
    "decks/impact-115.inp": 4.27e-07,
    "decks/natural-frequencies.inp": 0.0644,
    "decks/pulse-load.inp": 0.0662,
    "decks/static-bending.inp": 0.0661,
    "fecm/examples/drop-weight-held.inp": 2.96e-07,
    "fecm/examples/drop-weight.inp": 2.97e-07,
    "fecm/examples/impact-patch.inp": 4.57e-07,
    "fecm/examples/panel-with-gages.inp": 1.71e-07,
    "fecm/examples/plate-with-gages.inp": 3.07e-07,
}


@pytest.mark.parametrize("deck", TAKEN)
@pytest.mark.few(3)  # of 10, 0.05 s each
def test_dt_0_takes_the_known_step_on_every_deck(deck: str) -> None:
    (problem,) = load_deck(ROOT / deck).problems
    assert taken_time_step(problem.critical_time_step) == TAKEN[deck]


def test_no_deck_is_left_out() -> None:
    decks = {*ROOT.glob("decks/*.inp"), *ROOT.glob("fecm/examples/*.inp")}
    assert decks == {ROOT / name for name in TAKEN}
