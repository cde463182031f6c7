"""PROJ, SHEA and GAGE: the projectile, the shear correction and strain gages of the deck."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import fecm
from fecm import Ply, Result, RigidMass, Rod
from fecm.deck.grid import ElementGrid, GridSection
from fecm.deck.model import (
    Control,
    Deck,
    Impact,
    Indentation,
    Integration,
    Layer,
    Macro,
    Material,
    Projectile,
)
from fecm.mechanics.points import gages
from fecm.mechanics.projectile import report_rod
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck
from fecm.problem.parts import build_plate, build_projectile
from fecm.results.export import dataset_csv_lines
from tests.decks import DATA_CARDS, LONG, MESH, OWN_FINDINGS, small

Floats = NDArray[np.float64]

# The report's rod as a PROJ segment.
REPORT_ROD = """\
PROJ
   20    0       1.0     30.E6 .0006875
    1    0      0.22
    2    0      0.36
    3    0      0.43
    4    0      0.48
    5    0      0.50
    6    1     0.625
   20    0     0.625

"""


def with_segment(segment: str, mesh: str = MESH) -> str:
    """The small deck with another segment before its ROD."""
    return small(mesh=mesh, data=segment + DATA_CARDS)


def codes(text: str) -> list[str]:
    """Codes of a deck's findings; of the small plate's own ones only that of the projectile."""
    return [
        f.code for f in load_deck(text).findings if f.code == "N414" or f.code not in OWN_FINDINGS
    ]


def result_of(text: str | Deck) -> Result:
    """Result of a deck of one problem."""
    return fecm.run_one(text)


def model(text: str) -> Deck:
    """Model of a deck of one problem."""
    return fecm.read_one(text)


def test_the_reports_rod_on_cards_gives_the_reports_history_and_no_warning() -> None:
    assert codes(with_segment(REPORT_ROD)) == []
    plain, given = result_of(small()), result_of(with_segment(REPORT_ROD))
    assert build_projectile(model(with_segment(REPORT_ROD))) == report_rod()
    for path in ("history/force", "history/transducer", "energy/projectile_strain"):
        np.testing.assert_array_equal(given[path], plain[path])


def test_diameters_between_two_cards_are_interpolated() -> None:
    cone = "PROJ\n5, 2, 2.0, 30.E6, .0006875\n1, 1, 0.1\n5, 0, 0.5\n\n"
    rod = build_projectile(model(with_segment(cone)))
    assert isinstance(rod, Rod)
    np.testing.assert_allclose(rod.diameters, [0.1, 0.2, 0.3, 0.4, 0.5], rtol=1e-14)
    mass = 0.0006875 * 0.4 * math.pi / 4.0 * sum(d * d for d in (0.1, 0.2, 0.3, 0.4, 0.5))
    assert rod.total_mass == pytest.approx(mass, rel=1e-12)


def test_cards_of_a_projectile_read_what_they_write() -> None:
    text = with_segment(REPORT_ROD + "SHEA\n  0.822467\n\nGAGE\n1, 0.5, 0.5, 0.053, 30.\n\n")
    deck = model(text)
    assert fecm.read_deck(deck.to_text()) == deck
    rigid = model(with_segment("PROJ\n    0    0     2.E-4\n"))
    assert fecm.read_deck(rigid.to_text()) == rigid
    assert build_projectile(rigid) == RigidMass(2e-4)


@pytest.mark.parametrize(
    ("segment", "code"),
    [
        ("PROJ\n   -1    0       1.0     30.E6 .0006875\n\n", "E418"),
        ("PROJ\n  501    0       1.0     30.E6 .0006875\n\n", "E418"),
        ("PROJ\n    0    0       0.0\n", "E419"),
        ("PROJ\n    1    0       1.0       0.0 .0006875\n    1    0       0.1\n\n", "E419"),
        ("PROJ\n    1    0       1.0     30.E6       0.\n    1    0       0.1\n\n", "E419"),
        ("PROJ\n    1    3       1.0     30.E6 .0006875\n    1    0       0.1\n\n", "E423"),
        ("PROJ\n    2    0       1.0     30.E6 .0006875\n    1    0       0.1\n\n", "E422"),
        ("PROJ\n    1    0       1.0     30.E6 .0006875\n    1    0       0.0\n\n", "E422"),
        ("PROJ\n    1    0       1.0     30.E6 .0006875\n    2    0       0.1\n\n", "E420"),
        (
            "PROJ\n2, 0, 1.0, 30.E6, .0006875\n2, 0, 0.1\n1, 0, 0.1\n\n",
            "E421",
        ),
        ("SHEA\n       0.0\n", "E427"),
        ("GAGE\n1, 2.5, 0.5, 0., 0.\n\n", "E424"),
        (
            "GAGE\n1, 0.5, 0.5, 0., 0.\n1, 0.6, 0.5, 0., 0.\n\n",
            "E425",
        ),
    ],
)
def test_a_segment_that_can_not_be_meant_is_refused(segment: str, code: str) -> None:
    assert code in codes(with_segment(segment))


def test_odd_but_possible_values_are_warned_of() -> None:
    assert "W428" in codes(with_segment("SHEA\n       1.2\n"))
    assert "W426" in codes(with_segment("GAGE\n1, 0.5, 0.5, 0.1, 0.\n\n"))


@pytest.mark.parametrize(
    ("x", "patch", "warned"),
    [(1.0, "", True), (1.105, "", True), (1.106, "", False), (1.0, "PATC\n\n", False)],
)
def test_a_gage_within_the_thickness_of_a_point_force_is_warned_of(
    x: float, patch: str, warned: bool
) -> None:
    actual = codes(with_segment(f"{patch}GAGE\n1, {x}, 1.0, 0.05, 0.\n\n"))
    assert ("W452" in actual) == warned


def test_a_shear_correction_scales_the_transverse_shear_stiffness_alone() -> None:
    deck = model(with_segment("SHEA\n  0.822467\n"))
    plain = model(small())
    a, b = build_plate(deck, generate(deck)).laminate, build_plate(plain, generate(plain)).laminate
    np.testing.assert_allclose(a.shear, 0.822467 * b.shear, rtol=1e-14)
    np.testing.assert_array_equal(a.D, b.D)


# Rigid mass --------------------------------------------------------------------------------------


def rigid_target(mass: str, velocity: str, program: str) -> str:
    """A rigid mass on a plate so stiff and heavy that it stands still."""
    data = (
        f"ROD\n13, 3, {velocity}\nEXPE\n1.E6, 1.0, 0.094, 1.5\nMATE\n3, 3, -3, .106\n"
        "1.48E6, 0.3, 1.75E16, 1.75E16, 5.E15, 5.E15, 5.E15\n1, 0., 0.053\n2, 90., 0.053\n"
    )
    return small(program, data=f"PROJ\n0, 0, {mass}\n" + data)


def test_a_rigid_mass_on_a_rigid_target_is_the_hertz_impact() -> None:
    m, v, k = 2.0e-4, 100.0, 1.0e6
    program = "LMAS\nDT        2.E-8\nLOOP       9000\nTIME\nRODP       9000\nNEXT\n"
    result = result_of(rigid_target("2.E-4", "100.", program))
    # 1/2 m v^2 = 2/5 k a^(5/2); the contact lasts 2.9432 a/v.
    deepest = (5.0 * m * v**2 / (4.0 * k)) ** 0.4
    assert result.indentation.max() == pytest.approx(deepest, rel=1e-3)
    assert result.force.max() == pytest.approx(k * deepest**1.5, rel=1e-3)
    touching = result.time[result.force > 0.0]
    assert touching[-1] == pytest.approx(2.9432 * deepest / v, rel=1e-3)
    assert result.velocity[-1] == pytest.approx(v, rel=1e-3)
    np.testing.assert_array_equal(result.transducer, result.force)


def infinite_plate(m: float, v: float, k: float, slope: float, times: Floats) -> Floats:
    """Force of a mass on an infinite thin plate, whose point of impact moves at slope F.

    C. Zener, Phys. Rev. 59 (1941) 669, with w' = F/(8 sqrt(D rho h)).
    """

    def rate(_: float, y: Floats) -> list[float]:
        force = k * max(y[0], 0.0) ** 1.5
        return [y[1] - slope * force, -force / m]  # approach; velocity of the mass

    solution = solve_ivp(rate, (0.0, times[-1]), [0.0, v], t_eval=times, rtol=1e-10, atol=1e-14)
    return np.asarray(k * np.maximum(solution.y[0], 0.0) ** 1.5)


def test_a_rigid_mass_on_a_large_thin_plate_is_the_impact_on_an_infinite_one() -> None:
    m, v, k = 2.0e-4, 100.0, 5.0e4
    E, nu, rho, h, shear = 1.0e7, 0.3, 2.5e-4, 0.1, 5.0e7
    side, count = 12.0, 48
    grid = ElementGrid([GridSection(0.0, side, count)], [GridSection(0.0, side, count)])
    boundary = grid.boundary((1, 1, 0, 0, 0), {})
    assert boundary is not None
    ply = Ply(rho, nu, E, E, E / (2.0 * (1.0 + nu)), shear, shear)
    material = Material(Integration(3, 3, 3, h), ply, (Layer(1, 0.0, h),))
    middle = grid.nearest(side / 2.0, side / 2.0)[0]
    dt, steps = 5.0e-8, 4000.0
    program = (
        Macro("LMAS"), Macro("DT", value=dt), Macro("LOOP", value=steps), Macro("TIME"),
        Macro("RODP", value=steps), Macro("NEXT"),
    )  # fmt: skip
    deck = Deck(
        "large thin plate",
        Control(grid.nodes, grid.elements, 1, 2, 5, 9),
        (
            grid.coordinates(),
            grid.element_cards(),
            boundary,
            material,
            Projectile(0, 0, m),
            Impact(middle, 3, v),
            Indentation(k, 1.0, 0.0, 1.5),
        ),
        program,
    )
    result = result_of(deck)
    D = E * h**3 / (12.0 * (1.0 - nu**2))
    expected = infinite_plate(m, v, k, 1.0 / (8.0 * math.sqrt(D * rho * h)), result.time)
    error = np.abs(result.force - expected).max() / expected.max()
    assert error < 0.01
    assert expected.max() < 0.5 * k * (5.0 * m * v**2 / (4.0 * k)) ** 0.6  # a rigid target's


# Gages -------------------------------------------------------------------------------------------


def bent(coordinates: Floats) -> Floats:
    """A field of constant strains: eps = (1, 2, 3)e-3 and curvatures (4, 5, 6)e-2."""
    x, y = coordinates.T
    ex, ey, exy, kx, ky, kxy = 1e-3, 2e-3, 3e-3, 4e-2, 5e-2, 6e-2
    field = np.zeros((len(x), 5))
    field[:, 0], field[:, 1] = ex * x + exy / 2 * y, ey * y + exy / 2 * x
    field[:, 3], field[:, 4] = -kx * x - kxy / 2 * y, -ky * y - kxy / 2 * x
    return field


@pytest.mark.parametrize(
    ("direction", "expected"),
    [
        ("0.", 1e-3 + 0.05 * 4e-2),
        ("90.", 2e-3 + 0.05 * 5e-2),
        # Mohr's circle: (ex + ey + exy)/2 at 45 degrees.
        ("45.", (1e-3 + 2e-3 + 3e-3) / 2 + 0.05 * (4e-2 + 5e-2 + 6e-2) / 2),
    ],
)
@pytest.mark.parametrize("point", [("0.3", "0.7"), ("1.0", "1.0"), ("1.0", "0.2"), ("2.0", "2.0")])
def test_a_gage_reads_a_constant_strain_in_its_direction_and_depth(
    point: tuple[str, str], direction: str, expected: float
) -> None:
    x, y = point
    deck = model(with_segment(f"GAGE\n7, {x}, {y}, 0.05, {direction}\n\n"))
    mesh = generate(deck)
    gage_cards = gages(mesh, deck.require(fecm.deck.model.Gages).records)
    strain = (gage_cards.weights * bent(mesh.coordinates).ravel()[gage_cards.dof_indices]).sum(
        axis=1
    )
    assert strain == pytest.approx([expected], rel=1e-12)


def test_gages_are_read_at_every_step_and_agree_with_the_stored_strains() -> None:
    # Element 1's own corner node 5 of its nine, at (0.5, 0.5), where tape8 has nodal strains.
    text = with_segment("GAGE\n3, 0.5, 0.5, 0.04, 0.\n1, 0.5, 0.5, -0.04, 90.\n\n")
    result = result_of(text)
    assert result.gages.number.tolist() == [3, 1]
    assert result.gages.strain.shape == (10, 2)
    np.testing.assert_array_equal(result.gages.time, result.time)
    for row, step in enumerate(result.tape8.step):
        curvatures = (result.tape8.kappa_x[row, 0, 8], result.tape8.kappa_y[row, 0, 8])
        actual = result.gages.strain[step - 1]
        np.testing.assert_allclose(actual, [0.04 * curvatures[0], -0.04 * curvatures[1]], rtol=1e-9)
    assert np.abs(result.gages.strain).max() > 1e-8


def test_gages_of_a_triangle_and_of_a_turned_quadrilateral_are_found() -> None:
    mesh = MESH.replace(
        "    3   11   13   23   21   12   18   22   16   17    2\n",
        "    3   11   13   21    0    0    0    0    0    0    0\n"
        "    4   13   15   25   23   14   20   24   18   19    0\n",
    )
    assert mesh != MESH
    text = with_segment("GAGE\n1, 0.2, 1.3, 0., 0.\n\n", mesh=mesh)
    findings = [f.code for f in load_deck(text).findings]
    assert "E424" not in findings


def test_the_long_decks_gage_sees_the_wave_pass() -> None:
    text = LONG.read_text().replace("EXPE\n", "GAGE\n1, 4.0, 2.0, 0.053, 0.\n\nEXPE\n")
    text = text.replace("LOOP       4000", "LOOP        200")
    result = result_of(text)
    strain = result.gages.strain[:, 0]
    # One inch from the impact: nothing until the fastest front could be there (296,305 in/s).
    arrival = 1.0 / 296305.0
    before = result.gages.time < 0.9 * arrival
    assert np.abs(strain[before]).max() < 1e-3 * np.abs(strain).max()
    assert np.abs(strain).max() > 1e-5


def test_exported_gages_are_named_by_their_cards() -> None:
    result = result_of(with_segment("GAGE\n3, 0.5, 0.5, 0.04, 0.\n1, 1., 1., 0., 90.\n\n"))
    header, *rows = (line.rstrip().split(",") for line in dataset_csv_lines(result, "gages"))
    assert header == ["step", "time", "gage", "strain"]
    assert [int(row[2]) for row in rows[:4]] == [3, 1, 3, 1]
    assert [float(row[3]) for row in rows] == result.gages.strain.ravel().tolist()
