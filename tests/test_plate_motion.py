"""Mass, vibration and bending of plates, against Mindlin's and Navier's closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from fecm.mechanics import element_matrices, interpolation
from fecm.mechanics.elements import gauss
from fecm.mechanics.mesh import element_blocks
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.time_step import critical_time_step
from tests.builders import (
    GENERAL_LAYERS,
    GENERAL_PLY,
    SKEWED,
    SQUARE,
    Floats,
    Ints,
    distorted_square,
    general_plate,
    isotropic_plate,
    mixed,
    nothing,
    one_element,
    report_plate,
    rules,
    simple_support,
    square,
    table,
    with_restraints,
)
from tests.patches import (
    MeshMaker,
    deflections,
    reference_deflections,
    reference_frequencies,
    summed,
)

# Mass --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize(
    ("maker", "kind"), [(distorted_square, 4), (distorted_square, 8), (distorted_square, 9),
    (mixed, 9)]
)  # fmt: skip
def test_lumped_mass_is_positive_and_adds_up_to_the_plates_mass_and_inertia(
    maker: MeshMaker, kind: int, order: int
) -> None:
    coordinates, elements = mesh = maker(3, 4, kind)
    model = PlateModel(
        with_restraints(*mesh, nothing(coordinates)), general_plate(), rules(order, order)
    )
    used = np.isin(np.arange(1, len(coordinates) + 1), elements)
    mass = model.mass.reshape(-1, 5)[used]
    assert mass.min() > 0.0
    density, h = GENERAL_PLY.density, sum(GENERAL_LAYERS)
    np.testing.assert_allclose(mass[:, :3].sum(axis=0), density * h, rtol=1e-13)
    np.testing.assert_allclose(mass[:, 3:].sum(axis=0), density * h**3 / 12.0, rtol=1e-13)


# A node's share is the integral of its squared shape function.  Along a side of the 9-node element
# that is 4/15, 16/15, 4/15; the 8-node element's consistent mass has 6/180 at corners and 32/180 at
# mid-sides, of which 2 x 2 points make other shares.
@pytest.mark.parametrize(
    ("kind", "order", "shares"),
    [
        (4, 2, [1 / 4] * 4),
        (8, 2, [1 / 36] * 4 + [8 / 36] * 4),
        (8, 3, [3 / 76] * 4 + [16 / 76] * 4),
        (9, 3, [1 / 36] * 4 + [4 / 36] * 4 + [16 / 36]),
        (9, 4, [1 / 36] * 4 + [4 / 36] * 4 + [16 / 36]),
    ],
)
def test_a_squares_mass_is_shared_as_the_squares_of_its_shape_functions(
    kind: int, order: int, shares: list[float]
) -> None:
    coordinates, elements = one_element(SQUARE, kind)
    (family,) = element_blocks(elements, coordinates)
    lumped = element_matrices.lumped_mass(family, isotropic_plate(0.2), gauss(order))[0]
    inertia = np.array([0.2, 0.2, 0.2, 0.2**3 / 12.0, 0.2**3 / 12.0])
    np.testing.assert_allclose(lumped, np.outer(shares, inertia), rtol=1e-13)


# Vibration ---------------------------------------------------------------------------------------


def frequencies(n: int, kind: int, shear: int, count: int = 1, ks: float = 1.0) -> Floats:
    """Lowest frequencies of the same plate on n x n elements, omega a^2 sqrt(rho h/D)."""
    h = 0.1
    coordinates, elements = square(n, n, kind)
    model = PlateModel(
        with_restraints(coordinates, elements, simple_support(coordinates)),
        isotropic_plate(h, ks),
        rules(2 if kind == 4 else 3, shear),
    )
    scale = sparse.diags_array(1.0 / np.sqrt(model.mass))
    scaled = (scale @ model.stiffness @ scale).tocsc()
    start = np.random.default_rng(0).standard_normal(len(model.mass))
    squares = eigsh(scaled, k=count, sigma=0.0, v0=start, return_eigenvectors=False)
    D = h**3 / 12.0 / (1.0 - 0.3**2)
    return np.sort(np.sqrt(squares * h / D))


# Theory: the stiffness of elements complete to degree p makes a frequency's error O(n^-2p).  On
# rectangles the 9-node element's lumped mass is Simpson's rule (1:4:1 in each direction), which
# integrates cubics and so keeps the 4 of p = 2.  The 4-node element's is the trapezoidal rule,
# which keeps the 2 of p = 1.  Full shear quadrature stiffens coarse meshes, so that its rate shows
# later.
@pytest.mark.parametrize(
    ("kind", "shear", "meshes", "rate", "ceiling"),
    [
        (9, 2, (4, 8, 16), 4.0, 1e-6),
        (9, 3, (8, 16, 32), 4.0, 2e-6),
        (4, 1, (8, 16, 32), 2.0, 1e-3),
    ],
)
@pytest.mark.few(1)  # of 3, 0.2 s each
def test_the_fundamental_frequency_converges_to_mindlins_at_the_rate_of_theory(
    kind: int, shear: int, meshes: tuple[int, ...], rate: float, ceiling: float
) -> None:
    expected = reference_frequencies("1.000000")[0]
    errors = [abs(frequencies(n, kind, shear)[0] / expected - 1.0) for n in meshes]
    slope = -np.polyfit(np.log(meshes), np.log(errors), 1)[0]
    assert abs(slope - rate) < 0.3
    assert errors[-1] < ceiling


@pytest.mark.parametrize(("ks", "label"), [(1.0, "1.000000"), (5.0 / 6.0, "0.833333")])
@pytest.mark.parametrize(("kind", "shear", "error"), [(9, 2, 0.002), (9, 3, 0.005), (8, 2, 0.005)])
def test_the_lowest_six_frequencies_are_mindlins(
    kind: int, shear: int, error: float, ks: float, label: str
) -> None:
    expected = reference_frequencies(label)[:6]
    np.testing.assert_allclose(frequencies(8, kind, shear, 6, ks), expected, rtol=error)


def test_a_plate_sheared_uniformly_in_its_thickness_swings_at_the_cutoff_frequency() -> None:
    (omega,) = (
        float(row["value"])
        for row in table("laminate_report_ABD.csv")
        if row["quantity"] == "cutoff_omega"
    )
    coordinates, elements = square(3, 2)
    held = nothing(coordinates)
    held[:, :3] = True
    model = PlateModel(with_restraints(coordinates, elements, held), report_plate(), rules())
    for direction in ([1.0, 0.0], [0.0, 1.0]):
        theta = np.tile(direction, len(coordinates))
        np.testing.assert_allclose(
            model.stiffness @ theta,
            omega**2 * model.mass * theta,
            atol=1e-10 * omega**2 * model.mass.max(),
        )


def free_plate(n: int, kind: int) -> PlateModel:
    """A free distorted plate of the general laminate."""
    coordinates, elements = distorted_square(n, n, kind)
    return PlateModel(
        with_restraints(coordinates, elements, nothing(coordinates)), general_plate(), rules()
    )


def element_held_in_its_plane() -> PlateModel:
    """One 4-node element with u and v restrained: twelve equations."""
    coordinates, elements = one_element(SKEWED, 4)
    held = nothing(coordinates)
    held[:, :2] = True
    return PlateModel(with_restraints(coordinates, elements, held), general_plate(), rules())


@pytest.mark.parametrize(
    "model", [free_plate(4, 9), free_plate(5, 8), free_plate(6, 4), element_held_in_its_plane()]
)
def test_the_critical_time_step_is_2_over_the_highest_frequency(model: PlateModel) -> None:
    squares = eigh(model.stiffness.toarray(), np.diag(model.mass), eigvals_only=True)
    assert critical_time_step(model) == pytest.approx(2.0 / np.sqrt(squares[-1]), rel=1e-3)


def test_central_differences_stay_bounded_below_the_critical_step_and_grow_above_it() -> None:
    model = free_plate(4, 9)
    largest = []
    for factor in (0.995, 1.01):
        step = factor * critical_time_step(model)
        u = np.random.default_rng(1).standard_normal(len(model.mass))
        v = np.zeros_like(u)
        for _ in range(400):
            v -= step * (model.stiffness @ u) / model.mass
            u += step * v
        largest.append(float(np.abs(u).max()))
    assert largest[0] < 1e3
    assert largest[1] > 1e20


# Bending under load ------------------------------------------------------------------------------


def simpson_loads(elements: Ints, numnp: int, area: float) -> Floats:
    """Nodal loads of a unit pressure on equal 9-node rectangles."""
    shares = np.tile(np.array([1, 1, 1, 1, 4, 4, 4, 4, 16]) / 36.0 * area, len(elements))
    return summed(elements - 1, shares, numnp)


def errors_of_square(n: int, ratio: float, shear: int, ks: float, label: str) -> Floats:
    """Errors of both deflections under unit pressure on n x n 9-node elements, relative."""
    coordinates, elements = mesh = square(n, n)
    loads = simpson_loads(elements, len(coordinates), 1.0 / n**2)
    actual = deflections(mesh, loads, ratio, (3, shear), ks)
    return np.array(actual) / reference_deflections(ratio, label) - 1.0


@pytest.mark.parametrize(("ks", "label"), [(1.0, "1.000000"), (5.0 / 6.0, "0.833333")])
@pytest.mark.parametrize("ratio", [0.1, 0.01])
def test_a_uniformly_loaded_plate_bends_as_mindlins_however_thin(
    ratio: float, ks: float, label: str
) -> None:
    assert np.abs(errors_of_square(8, ratio, 2, ks, label)).max() < 2e-4


# With nine shear points the elements are conforming, so that the plate is too stiff: the thinner,
# the more.  Errors fall with n^-4 once elements are about as wide as the plate is thick, with n^-2
# before.
@pytest.mark.parametrize(("ks", "label"), [(1.0, "1.000000"), (5.0 / 6.0, "0.833333")])
@pytest.mark.parametrize(("ratio", "in_centre"), [(0.1, 5e-4), (0.01, 5e-3)])
@pytest.mark.few(2)  # of 4, 0.1 s each
def test_full_shear_quadrature_stiffens_a_plate_less_and_less_on_finer_meshes(
    ratio: float, in_centre: float, ks: float, label: str
) -> None:
    coarse, middle, fine = (errors_of_square(n, ratio, 3, ks, label) for n in (4, 8, 16))
    assert abs(middle[0]) < in_centre
    for errors in (coarse, middle, fine):
        assert errors.max() < 0.0
    assert (np.abs(middle) < np.abs(coarse) / 4.0).all()
    assert (np.abs(fine) < np.abs(middle) / 4.0).all()


@pytest.mark.parametrize(
    ("kind", "orders", "ceiling"), [(4, (2, 1), 1e-2), (8, (3, 2), 1e-3), (9, (3, 2), 1e-3)]
)
def test_bending_converges_on_ever_finer_distorted_meshes(
    kind: int, orders: tuple[int, int], ceiling: float
) -> None:
    expected = reference_deflections(0.1, "1.000000")[0]
    errors = []
    for n in (4, 8, 16):
        coordinates, elements = mesh = distorted_square(n, n, kind)
        (family,) = element_blocks(elements, coordinates)
        at = interpolation.interpolate(family, gauss(3))
        loads = summed(family.nodes, at.jxw @ at.N, len(coordinates))
        errors.append(abs(deflections(mesh, loads, 0.1, orders)[0] / expected - 1.0))
    assert errors[2] < errors[1] / 2.0 < errors[0] / 4.0
    assert errors[2] < ceiling
