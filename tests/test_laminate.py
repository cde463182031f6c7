"""Laminate stiffness and inertia against the report's plate and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import fecm
from fecm import Deck, Ply
from fecm.deck.model import Control, Integration, Layer, Material
from fecm.listing.variant import PlateVariant
from fecm.mechanics.laminate import (
    LaminateSection,
    laminate,
    reduced_stiffness,
    transformed_shear,
    transformed_stiffness,
)
from fecm.problem.parts import laminates_of_deck
from tests.builders import (
    GENERAL_PLY,
    REPORT_ANGLES,
    REPORT_LAYER,
    REPORT_PLY,
    Floats,
    general_plate,
    isotropic_ply,
    report_plate,
    table,
    turned_stiffness,
)

REFERENCE = {
    row["quantity"]: float(row["value"]) for row in table("laminate_report_ABD.csv") if row["value"]
}


def reference_matrix(name: str, suffix: str = "") -> Floats:
    """The symmetric matrix whose entries the reference file calls name11, name12, and so on."""
    entries = {ij: REFERENCE[f"{name}{ij}{suffix}"] for ij in ("11", "12", "22", "16", "26", "66")}
    return np.array([[entries["".join(sorted(a + b))] for b in "126"] for a in "126"])


def assert_same(actual: Floats, expected: Floats, scale: float | None = None) -> None:
    """Compare to 1e-10: entry by entry, but with the scale where zero is meant.

    The scale is the matrix' largest entry, unless all of it is meant to be zero.
    """
    size = float(np.abs(expected).max()) if scale is None else scale
    meant_zero = np.abs(expected) < 1e-12 * size
    allowed = 1e-10 * np.where(meant_zero, size, np.abs(expected))
    np.testing.assert_array_less(np.abs(actual - expected), allowed + 1e-300)


# Plies -------------------------------------------------------------------------------------------


def test_a_ply_has_the_reference_files_plane_stress_stiffness() -> None:
    q = reduced_stiffness(REPORT_PLY)
    values = np.array([q[0, 0], q[1, 1], q[0, 1], q[2, 2]])
    assert_same(values, np.array([REFERENCE[name] for name in ("Q11", "Q22", "Q12", "Q66")]))
    assert np.array_equal(q, q.T)
    assert q[0, 2] == q[1, 2] == 0.0


@pytest.mark.parametrize("angle", [0, 45, -45])
def test_a_turned_ply_has_the_reference_files_stiffness(angle: int) -> None:
    actual = transformed_stiffness(reduced_stiffness(REPORT_PLY), angle)
    assert_same(actual, reference_matrix("Qbar", f"({angle})"))


@pytest.mark.parametrize("angle", [0.0, 20.0, 45.0, -45.0, 70.0, 90.0, 115.0, -160.0])
def test_stiffness_turns_as_a_tensor_of_fourth_order(angle: float) -> None:
    actual = transformed_stiffness(reduced_stiffness(GENERAL_PLY), angle)
    assert_same(actual, turned_stiffness(GENERAL_PLY, angle))


@pytest.mark.parametrize("angle", [0.0, 20.0, 45.0, -45.0, 70.0, 90.0, 115.0, -160.0])
def test_transverse_shear_stiffness_turns_as_a_tensor_of_second_order(angle: float) -> None:
    ply = GENERAL_PLY
    along = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    across = np.array([-along[1], along[0]])
    expected = ply.g13 * np.outer(along, along) + ply.g23 * np.outer(across, across)
    assert_same(transformed_shear(ply.g13, ply.g23, angle), expected)


@pytest.mark.parametrize(("angle", "sign"), [(45.0, 1.0), (-45.0, -1.0)])
def test_a_ply_at_plus_45_degrees_is_told_from_one_at_minus_45(angle: float, sign: float) -> None:
    ply, h = GENERAL_PLY, 0.2
    layer = laminate(ply, [angle], [h])
    q = np.linalg.inv([[1 / ply.e1, -ply.nu12 / ply.e1], [-ply.nu12 / ply.e1, 1 / ply.e2]])
    shear_coupling = sign * (q[0, 0] - q[1, 1]) / 4.0
    for matrix, moment in ((layer.A, h), (layer.D, h**3 / 12.0)):
        assert matrix[0, 2] == pytest.approx(shear_coupling * moment, rel=1e-12)
        assert matrix[1, 2] == pytest.approx(shear_coupling * moment, rel=1e-12)
    assert layer.shear[0, 1] == pytest.approx(sign * (ply.g13 - ply.g23) / 2.0 * h, rel=1e-12)


def test_pulling_a_45_degree_ply_along_x_shears_it_towards_its_fibres() -> None:
    ply, h = REPORT_PLY, 0.1
    strain = np.linalg.solve(laminate(ply, [45.0], [h]).A, [1.0, 0.0, 0.0])
    # The right angle between x and y opens: fibres hold back their own direction.
    assert strain[2] < 0.0
    assert strain[2] == pytest.approx((1.0 / ply.e1 - 1.0 / ply.e2) / 2.0 / h, rel=1e-12)
    strain = np.linalg.solve(laminate(ply, [-45.0], [h]).A, [1.0, 0.0, 0.0])
    assert strain[2] == pytest.approx((1.0 / ply.e2 - 1.0 / ply.e1) / 2.0 / h, rel=1e-12)


# Stacks ------------------------------------------------------------------------------------------


def test_the_reports_plate_has_the_reference_files_stiffness_and_inertia() -> None:
    plate = report_plate()
    assert_same(plate.A, reference_matrix("A"))
    assert_same(plate.D, reference_matrix("D"))
    # Every entry of B is rounding; it is measured by the stiffness that cancels in it.
    assert_same(plate.B, reference_matrix("B"), float(np.abs(plate.A).max()) * REFERENCE["h"])
    assert_same(
        plate.shear,
        np.array([[REFERENCE["A55*"], REFERENCE["A45*"]], [REFERENCE["A45*"], REFERENCE["A44*"]]]),
    )
    assert plate.mass == pytest.approx(REFERENCE["P"], rel=1e-10)
    assert plate.rotary_inertia == pytest.approx(REFERENCE["I"], rel=1e-10)
    assert plate.thickness == pytest.approx(REFERENCE["h"], rel=1e-10)


def test_stretching_and_bending_are_coupled_in_unsymmetric_stacks_only() -> None:
    assert not report_plate().is_coupled
    assert general_plate().is_coupled


def test_the_struck_face_of_a_cross_ply_bears_the_first_layer() -> None:
    h = 0.3
    first_along_x = laminate(GENERAL_PLY, [0.0, 90.0], [h / 2.0, h / 2.0])
    q = turned_stiffness(GENERAL_PLY, 0.0)
    b11 = (q[1, 1] - q[0, 0]) * h**2 / 8.0
    assert b11 < 0.0
    expected = np.diag([b11, -b11, 0.0])
    assert_same(first_along_x.B, expected)
    assert_same(laminate(GENERAL_PLY, [90.0, 0.0], [h / 2.0, h / 2.0]).B, -expected)


def test_a_pair_of_plus_and_minus_45_degrees_couples_pull_with_twist() -> None:
    h = 0.3
    q = turned_stiffness(GENERAL_PLY, 45.0)
    b16 = -q[0, 2] * h**2 / 4.0  # the +45 degree layer lies at negative z
    B = laminate(GENERAL_PLY, [45.0, -45.0], [h / 2.0, h / 2.0]).B
    assert b16 < 0.0
    assert_same(B, np.array([[0.0, 0.0, b16], [0.0, 0.0, b16], [b16, b16, 0.0]]))


def test_an_isotropic_layer_has_the_plate_stiffness_of_textbooks() -> None:
    h, nu, E = 0.2, 0.3, 1.0
    layer = laminate(isotropic_ply(), [37.0], [h])
    pattern = np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1.0 - nu) / 2.0]])
    assert_same(layer.A, E * h / (1.0 - nu**2) * pattern)
    assert_same(layer.D, E * h**3 / 12.0 / (1.0 - nu**2) * pattern)
    assert_same(layer.shear, E / (2.0 * (1.0 + nu)) * h * np.eye(2))
    assert layer.mass == pytest.approx(h, rel=1e-12)
    assert layer.rotary_inertia == pytest.approx(h**3 / 12.0, rel=1e-12)


def test_cutting_a_layer_into_thinner_ones_changes_nothing() -> None:
    whole = laminate(GENERAL_PLY, [20.0, -50.0], [0.3, 0.5])
    cut = laminate(GENERAL_PLY, [20.0] * 3 + [-50.0] * 2, [0.1, 0.15, 0.05, 0.1, 0.4])
    for name in ("A", "B", "D", "shear"):
        assert_same(getattr(cut, name), getattr(whole, name))


# Decks -------------------------------------------------------------------------------------------


def material(ply: Ply, total: float) -> Material:
    """The report's stack of another ply, its card naming another thickness."""
    layers = tuple(Layer(n, angle, REPORT_LAYER) for n, angle in enumerate(REPORT_ANGLES, 1))
    return Material(Integration(3, 3, 3, total), ply, layers)


def laminate_of(material: Material, *, isotropic_g12: bool = False) -> LaminateSection:
    """Laminate of a deck with this MATE segment."""
    deck = Deck("", Control(4, 1, len(material.layers), 2, 5, 4), (material,), ())
    return laminates_of_deck(deck, PlateVariant(isotropic_g12=isotropic_g12))[0]


def test_a_decks_stiffness_is_the_layers_and_its_inertia_the_cards() -> None:
    actual = laminate_of(material(REPORT_PLY, 0.2))
    assert_same(actual.A, reference_matrix("A"))
    assert_same(actual.D, reference_matrix("D"))
    assert actual.mass == pytest.approx(0.000148 * 0.2, rel=1e-12)
    assert actual.rotary_inertia == pytest.approx(0.000148 * 0.2**3 / 12.0, rel=1e-12)


def test_a_woven_ply_keeps_its_shear_modulus_unless_it_is_asked_to_be_isotropic() -> None:
    woven = Ply(density=1.0, nu12=0.1, e1=7.0, e2=7.0, g12=0.5, g13=0.4, g23=0.4)
    deck = Material(Integration(3, 3, 3, 0.2), woven, (Layer(1, 0.0, 0.1), Layer(2, 0.0, 0.1)))
    assert laminate_of(deck).A[2, 2] == pytest.approx(0.5 * 0.2, rel=1e-12)
    isotropic = laminate_of(deck, isotropic_g12=True)
    assert isotropic.A[2, 2] == pytest.approx(7.0 / 2.2 * 0.2, rel=1e-12)


def test_only_a_ply_of_equal_moduli_is_taken_for_isotropic() -> None:
    deck = material(REPORT_PLY, 0.106)
    assert_same(laminate_of(deck, isotropic_g12=True).A, reference_matrix("A"))


# The laminate as users give it --------------------------------------------------------------------

GRAPHITE = fecm.Ply(1600.0, 0.28, 181e9, 10.3e9, 7.17e9, 7.17e9, 7.17e9)


def test_a_published_laminate_has_its_published_stiffness() -> None:
    """[0/30/-45] of graphite/epoxy, 5 mm plies: Kaw, Mechanics of Composite Materials, example 4.3.

    His z, too, is negative in the first ply, and his angles are counter-clockwise from x.
    """
    laminate = fecm.Laminate("[0/30/-45]", GRAPHITE, 5e-3)
    A = [[1.739e9, 3.884e8, 5.663e7], [3.884e8, 4.533e8, -1.141e8], [5.663e7, -1.141e8, 4.525e8]]
    B = [[-3.129e6, 9.855e5, -1.072e6], [9.855e5, 1.158e6, -1.072e6], [-1.072e6, -1.072e6, 9.855e5]]
    D = [[3.343e4, 6.461e3, -5.240e3], [6.461e3, 9.320e3, -5.596e3], [-5.240e3, -5.596e3, 7.663e3]]
    np.testing.assert_allclose(laminate.A, A, rtol=4e-4)
    np.testing.assert_allclose(laminate.B, B, rtol=4e-4)
    np.testing.assert_allclose(laminate.D, D, rtol=4e-4)


def test_engineering_constants_are_those_of_the_inverse_of_the_whole_stiffness() -> None:
    laminate = fecm.Laminate("[0/30/-45]", GRAPHITE, 5e-3)
    whole = np.block([[laminate.A, laminate.B], [laminate.B, laminate.D]])
    inverse, h = np.linalg.inv(whole), 15e-3
    a, d = inverse[:3, :3], inverse[3:, 3:]
    membrane = [1 / (h * a[0, 0]), 1 / (h * a[1, 1]), 1 / (h * a[2, 2]), -a[0, 1] / a[0, 0]]
    bending = [12 / (h**3 * d[n, n]) for n in range(3)] + [-d[0, 1] / d[0, 0]]
    np.testing.assert_allclose(laminate.in_plane_constants, membrane, rtol=1e-10)
    np.testing.assert_allclose(laminate.flexural_constants, bending, rtol=1e-10)


def test_a_cross_ply_has_the_engineering_constants_of_the_closed_form() -> None:
    """[0/90]s: means of Q11 and Q22, in bending with the weights 7/8 and 1/8."""
    ply = fecm.Ply(1.6e-9, 0.3, 140e3, 9e3, 5e3, 5e3, 3e3)
    laminate = fecm.Laminate("[0/90]s", ply, 0.125)
    full = 1.0 - 0.3**2 * 9e3 / 140e3
    q11, q22, q12 = 140e3 / full, 9e3 / full, 0.3 * 9e3 / full
    mean = (q11 + q22) / 2.0
    of_membrane = mean - q12**2 / mean, mean - q12**2 / mean, 5e3, q12 / mean
    along, across = (7.0 * q11 + q22) / 8.0, (q11 + 7.0 * q22) / 8.0
    of_bending = along - q12**2 / across, across - q12**2 / along, 5e3, q12 / across
    np.testing.assert_allclose(laminate.in_plane_constants, of_membrane, rtol=1e-12)
    np.testing.assert_allclose(laminate.flexural_constants, of_bending, rtol=1e-12)
    np.testing.assert_allclose(laminate.B, 0.0, atol=1e-9)


def test_an_isotropic_laminate_has_the_constants_of_its_material() -> None:
    steel = fecm.Ply(7.8e-9, 0.3, 210e3, 210e3, 210e3 / 2.6, 210e3 / 2.6, 210e3 / 2.6)
    laminate = fecm.Laminate([30.0, -70.0, 5.0], steel, 0.4)
    wanted = 210e3, 210e3, 210e3 / 2.6, 0.3
    np.testing.assert_allclose(laminate.in_plane_constants, wanted, rtol=1e-12)
    np.testing.assert_allclose(laminate.flexural_constants, wanted, rtol=1e-12)


def test_a_laminate_without_a_material_or_with_an_impossible_one_has_no_stiffness() -> None:
    with pytest.raises(ValueError, match="`ply` is None"):
        fecm.Laminate("[0/90]s").A  # noqa: B018
    bad = fecm.Ply(1600.0, 0.28, -1.0, 10.3e9, 7.17e9, 7.17e9, 7.17e9)
    with pytest.raises(ValueError, match="Young's modulus E1 is -1; it must be positive"):
        fecm.Laminate("[0]", bad, 1e-3).D  # noqa: B018
