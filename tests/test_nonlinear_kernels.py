"""The compiled kernels of plates that stretch as they bend, and of those under a preload.

What they give is compared with NumPy's product and with
:class:`~fecm.mechanics.membrane.MembraneForces`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm._typing import Bools
from fecm.mechanics import kernels
from fecm.mechanics.elements import gauss
from fecm.mechanics.kernels import membrane
from fecm.mechanics.kernels.plate import CompiledProduct
from fecm.mechanics.kernels.stretching import CompiledStretching
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.plate import UNLOADED, PlateModel
from fecm.mechanics.stiffness_product import (
    ElementProduct,
    NonlinearProduct,
    internal_force_operator,
    stiffness_operator,
)
from fecm.mechanics.strains import FLAT, Curvature
from fecm.mechanics.stretching import Stretching
from fecm.mechanics.symmetry import SymmetryReduction, symmetry_reduction, unreduced
from tests.builders import (
    Floats,
    Ints,
    boundary,
    distorted_square,
    general_plate,
    isotropic_plate,
    parallelograms,
    rules,
    square,
    with_restraints,
)
from tests.nonlinear_plates import RULES
from tests.stopped_runs import StoppedError
from tests.stopped_runs import run as run_to
from tests.test_element_decks import deck as element_deck
from tests.test_kernels import assert_close

compiled = pytest.mark.skipif(kernels.LIBRARY is None, reason="the kernels are not compiled")

PRELOAD = (3.0, -2.0, 0.7)
LAMINATES = {"coupled": general_plate(), "isotropic": isotropic_plate(0.1)}
Mesh = tuple[Floats, Ints]


def curved(nx: int, ny: int, kind: int = 9) -> Mesh:
    """Elements with curved sides, which half a turn maps onto one another."""
    coordinates, elements = square(nx, ny, kind)
    wave = np.sin(2.0 * np.pi * coordinates[:, ::-1]) * np.sin(np.pi * coordinates)
    return coordinates + 0.05 * wave, elements


def shifted_centres(nx: int, ny: int, kind: int = 9) -> Mesh:
    """Congruent elements that are no parallelograms: their centre nodes lie beside the middle."""
    coordinates, elements = square(nx, ny, kind)
    coordinates[elements[:, 8] - 1] += np.array([0.1, -0.05]) / [nx, ny]
    return coordinates, elements


def graded(nx: int, ny: int, kind: int = 9) -> Mesh:
    """Rectangles, each of another size."""
    coordinates, elements = square(nx, ny, kind)
    ends = np.linspace(0.0, 1.0, 2 * nx + 1)
    corners = np.interp(ends, ends[::2], ends[::2] ** 1.3)
    return np.interp(coordinates, ends, corners), elements


MESHES: dict[str, Callable[[int, int, int], Mesh]] = {
    "square": square,
    "parallelograms": parallelograms,
    "graded": graded,
    "distorted": distorted_square,
    "curved": curved,
    "shifted centres": shifted_centres,
}


def plate_of(
    mesh: Mesh, laminate: LaminateSection, *, preload: tuple[float, float, float]
) -> PlateModel:
    """A nonlinear plate whose boundary holds u, v and w."""
    coordinates, elements = mesh
    restrained = boundary(coordinates, elements) & (np.arange(5) < 3)
    model = with_restraints(coordinates, elements, restrained)
    return PlateModel(model, laminate, RULES, preload=preload, nonlinear=True)


def products(plate: PlateModel, kept: SymmetryReduction) -> tuple[CompiledProduct, ElementProduct]:
    """The nonlinear product of the kernels, and the linear one of NumPy."""
    linear = stiffness_operator(plate, "numpy", kept)
    assert isinstance(linear, ElementProduct)
    return CompiledProduct(plate, kept, nonlinear=True), linear


@compiled
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("laminate", LAMINATES)
@pytest.mark.parametrize(
    ("preload", "curvature"), [(UNLOADED, FLAT), (PRELOAD, FLAT), (PRELOAD, (0.7, -0.4, 0.3))]
)
@pytest.mark.few(8)  # of 36, 0.03 s each
def test_the_forces_of_a_stretched_plate_are_numpys(
    name: str, laminate: str, preload: tuple[float, float, float], curvature: Curvature
) -> None:
    """To rounding, with and without symmetry, at slopes of about one."""
    plate = plate_of(MESHES[name](5, 4, 9), LAMINATES[laminate], preload=preload)
    plate = replace(plate, curvature=curvature)
    for kept in unreduced(plate), symmetry_reduction(plate, None):
        actual, linear = products(plate, kept)
        wanted = NonlinearProduct(plate, kept, linear)
        u = 0.1 * np.random.default_rng(0).standard_normal(kept.count)
        forces = wanted(u)
        size = np.abs(forces).max()
        assert np.abs(forces - linear(u)).max() > 0.1 * size
        close = (5e-15 if curvature == FLAT else 1e-14) * size
        np.testing.assert_allclose(actual(u), forces, rtol=0.0, atol=close)
        assert actual.quadratic_work == pytest.approx(wanted.quadratic_work, rel=1e-13)


@compiled
def test_a_preload_acts_on_the_slopes_of_elements_of_every_kind() -> None:
    """Of congruent and of other elements, with u and v at rest and moving, without NONL."""
    kinds = (3, 4, 8, 9, 12)
    laminates = (general_plate(), isotropic_plate(0.1))
    cases = itertools.product(kinds, (square, distorted_square), (False, True), laminates)
    for kind, maker, assumes_shear, laminate in cases:
        if assumes_shear and kind not in (4, 9):
            continue
        coordinates, elements = maker(4, 4, kind)
        mesh = with_restraints(coordinates, elements, boundary(coordinates, elements))
        chosen = replace(rules(), assumes_shear=assumes_shear)
        plate = PlateModel(mesh, laminate, chosen, preload=PRELOAD)
        kept = symmetry_reduction(plate, None)
        u = np.random.default_rng(0).standard_normal(kept.count)
        wanted = stiffness_operator(plate, "numpy", kept)(u)
        without = stiffness_operator(replace(plate, preload=UNLOADED), "numpy", kept)(u)
        size = np.abs(wanted).max()
        assert np.abs(wanted - without).max() > 0.01 * size
        np.testing.assert_allclose(
            CompiledProduct(plate, kept)(u), wanted, rtol=0.0, atol=5e-15 * size
        )


@pytest.mark.parametrize(
    ("name", "expected"), [("square", 1), ("parallelograms", 1), ("graded", 1), ("curved", 0)]
)
def test_only_parallelograms_with_their_nodes_in_the_middle_count_as_such(
    name: str, expected: int
) -> None:
    plate = plate_of(MESHES[name](4, 4, 9), isotropic_plate(0.1), preload=UNLOADED)
    (family,) = plate.families
    assert (membrane.are_parallelograms(family) == expected).all()
    for node in range(9):
        moved = family.coordinates.copy()
        moved[:, node] += 1e-7
        off = replace(family, coordinates=moved)
        assert not membrane.are_parallelograms(off).any()


@compiled
def test_a_membrane_with_another_rule_is_numpys() -> None:
    mesh = distorted_square(3, 3)
    plate = plate_of(mesh, general_plate(), preload=UNLOADED)
    fine = replace(plate, rules=replace(rules(4, 3), assumes_shear=True))
    for one, kind in ((plate, CompiledProduct), (fine, NonlinearProduct)):
        kept = unreduced(one)
        product = internal_force_operator(one, "kernels", kept)
        assert type(product) is kind
        u = 0.1 * np.random.default_rng(0).standard_normal(kept.count)
        wanted = internal_force_operator(one, "numpy", kept)(u)
        np.testing.assert_allclose(product(u), wanted, rtol=0.0, atol=1e-14 * abs(wanted).max())


@compiled
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize(
    ("preload", "curvature"), [(UNLOADED, FLAT), ((-3.0, -2.0, 0.7), (0.7, -0.4, 0.3))]
)
@pytest.mark.few(4)  # of 12, 0.02 s each
def test_energies_and_largest_values_of_the_midplane_are_numpys(
    name: str, preload: tuple[float, float, float], curvature: Curvature
) -> None:
    plate = plate_of(MESHES[name](5, 4, 9), LAMINATES["coupled"], preload=preload)
    rules = replace(RULES, bending=gauss(3))
    numbers = np.arange(20) % 2
    plate = replace(
        plate,
        curvature=curvature,
        rules=rules,
        others=(LAMINATES["isotropic"],),
        laminate_numbers=numbers,
    )
    fields = np.random.default_rng(3).normal(size=(3, *plate.mesh.equations.shape))

    def near(x: Floats, y: Floats) -> Bools:
        return np.asarray(np.hypot(x - 0.4, y - 0.5) < 0.3)

    wanted, actual = (
        kind(plate, near, (0.4, 0.5)).evaluate(fields) for kind in (Stretching, CompiledStretching)
    )
    for quantity, values in wanted._asdict().items():
        np.testing.assert_allclose(
            getattr(actual, quantity), values, rtol=1e-12, atol=0.0, err_msg=quantity
        )


@compiled
def test_stretched_plates_do_not_depend_on_the_number_of_threads() -> None:
    plate = plate_of(distorted_square(48, 48), general_plate(), preload=PRELOAD)
    kept = unreduced(plate)
    u = 0.01 * np.random.default_rng(1).standard_normal(kept.count)
    products = [CompiledProduct(plate, kept, threads, nonlinear=True) for threads in (1, 2, 3)]
    assert products[0].plate.structure.chunks == 4
    one, *others = (product(u) for product in products)
    for product, forces in zip(products[1:], others, strict=True):
        np.testing.assert_array_equal(forces, one)
        assert product.quadratic_work == products[0].quadratic_work


# Impacts ------------------------------------------------------------------------------------------


def impact(mesh: Mesh, *, words: str = "NONL\n", coupled: bool = False, steps: int = 600) -> str:
    """A deck of a thin plate with held edges, whose w exceeds its thickness."""
    text = element_deck(mesh, (3, 3, 3), steps=steps)
    for old, new in (
        (",1,1,0,0,0", ",0,0,0,0,0"),  # u and v inside
        ("\nEXPE\n", f"\nSHEA MITC\n{words}EXPE\n"),
        (",.053", ",.0265"),
        (",0.106", ",0.053"),
        (",115.0", ",900.0"),
        ("2,90.,", "2,90.," if coupled else "2,0.,"),
        (",,400", ",,50"),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


IMPACTS = {
    "rectangles": impact(square(4, 4)),
    "distorted, coupled": impact(distorted_square(4, 4), coupled=True),
    "preload": impact(square(4, 4), words="NONL\nPREL\n400., -50., 30.\n\nDAMP\n3000.\n\n"),
    "preload, linear": impact(distorted_square(4, 4), words="PREL\n400., -50., 30.\n\n"),
}


@compiled
@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
@pytest.mark.parametrize("name", IMPACTS)
@pytest.mark.few(1)  # of 4, 0.3 s each
def test_an_impact_on_a_stretched_plate_is_that_of_numpy(name: str) -> None:
    actual, wanted = (fecm.run_one(IMPACTS[name], solver=s) for s in ("kernels", "numpy"))
    assert_close(actual, wanted)
    assert actual.plate_w.max() > 0.053
    if "linear" not in name:
        linear = fecm.run_one(IMPACTS[name].replace("NONL\n", ""), solver="kernels")
        assert np.abs(actual.force - linear.force).max() > 0.1 * actual.force.max()
    initial = actual.attributes_of("energy")["initial"]
    assert np.abs(actual["energy/balance_error"]).max() < 1e-4 * initial


@compiled
@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_a_run_resumed_between_bursts_of_a_stretched_plate_gives_the_same_bytes(
    tmp_path: Path,
) -> None:
    deck = impact(distorted_square(4, 4), steps=200)
    whole, cut = tmp_path / "whole.h5", tmp_path / "cut.h5"
    run_to(deck, whole, interval=50)
    with pytest.raises(StoppedError):
        run_to(deck, cut, 2, interval=50)
    run_to(deck, cut, resume=True, interval=50)
    assert cut.read_bytes() == whole.read_bytes()
