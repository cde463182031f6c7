"""Shallow curved panels against series of Donnell's theory, see tests/curved_panels.py."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest

import fecm
from fecm import Result
from fecm.deck import model
from fecm.deck.grid import ElementGrid, uniform_section
from fecm.mechanics import kernels
from fecm.mechanics.points import gages
from fecm.problem.loading import load_deck
from fecm.studies.estimate import quick_estimate
from fecm.verification import decks
from tests import curved_panels
from tests.builders import DATA, Floats, table
from tests.curved_panels import (
    ANGLES,
    DURATION,
    PANELS,
    PEAK,
    SIDES,
    fine_middle,
    mesh,
    panel,
    shortly,
    struck,
)

STATIC = "TANG FORM SOLV DISP"
ROWS = dict(zip(PANELS, table("curved_panels.csv"), strict=True))


def by_panel(*at_once: tuple[float, float]) -> pytest.MarkDecorator:
    """Every panel of the files; only some in the short run."""
    long = (pytest.param(panel, marks=pytest.mark.long) for panel in PANELS if panel not in at_once)
    return pytest.mark.parametrize("radii", [*at_once, *long])


def mean_deflection(result: Result) -> float:
    """Deflection under the patch."""
    return float(result.tape3.w[0, result["patch/node"] - 1] @ result["patch/weight"])


# Statics and frequencies --------------------------------------------------------------------------


@by_panel(PANELS[0], PANELS[3])
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_the_static_deflection_is_that_of_the_series(radii: tuple[float, float]) -> None:
    result = decks.run_of_deck(panel(radii, STATIC, fine_middle(8), load=1.0))
    assert mean_deflection(result) == pytest.approx(float(ROWS[radii][curved_panels.W]), rel=1.5e-3)
    assert result.tape3.w.max() == pytest.approx(float(ROWS[radii]["w"]), rel=1e-3)


@by_panel(PANELS[3])
def test_membrane_forces_and_moments_are_those_of_the_series(radii: tuple[float, float]) -> None:
    deck = panel(radii, f"{STATIC} STRE", fine_middle(16), load=1.0, points=2)
    result = decks.run_of_deck(deck)
    away = np.hypot(result.stresses.x - SIDES[0] / 2.0, result.stresses.y - SIDES[1] / 2.0)
    nearest = away < 1.0
    assert np.count_nonzero(nearest) == 4
    for name in ("N_x", "N_y", "M_x", "M_y"):
        value = result[f"stresses/{name}"][0][nearest].mean()
        assert value == pytest.approx(float(ROWS[radii][name.replace("_", "")]), rel=0.015), name


@by_panel(PANELS[2])
def test_frequencies_are_those_of_the_series(radii: tuple[float, float]) -> None:
    result = decks.run_of_deck(panel(radii, "CMAS EIGE=10", mesh(24)))
    frequencies = result.modes.angular_frequency
    names = ("omega_11", "omega_12", "omega_21", "omega_13")
    wanted = [float(ROWS[radii][name]) for name in names]
    off = [np.abs(frequencies / omega - 1.0).min() for omega in wanted if omega < frequencies[-1]]
    assert len(off) >= 3
    assert max(off) < 5e-4


# Impact -------------------------------------------------------------------------------------------


def history(radii: tuple[float, float]) -> dict[str, Floats]:
    """Force, deflection and indentation of the series, by time."""
    x, y = (int(radius) for radius in radii)
    with (DATA / f"curved_impact_Rx{x}_Ry{y}.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@by_panel(PANELS[2])
@pytest.mark.long
def test_an_impact_is_that_of_the_series(radii: tuple[float, float]) -> None:
    dt = 2.13e-7
    result = decks.run_of_deck(struck(radii, mesh(60), dt, int(DURATION / dt) + 1))
    assert result.history.force.max() == pytest.approx(float(ROWS[radii][PEAK]), rel=2e-3)
    wanted = history(radii)
    for name, own in (("force", "force"), ("plate_W", "plate_w")):
        values = np.interp(wanted["time"], result.history.time, result[f"history/{own}"])
        size = np.abs(wanted[name]).max()
        assert np.abs(values - wanted[name]).max() < 0.01 * size, name
    supplied = 0.5 * 2e-5 * 3000.0**2
    assert np.abs(result.energy.balance_error).max() < 1e-5 * supplied


# Symmetries ---------------------------------------------------------------------------------------


def every_result(deck: model.Deck) -> dict[str, Floats]:
    result = decks.run_of_deck(deck)
    return {path: result[path] for path in result}


def test_infinite_radii_give_the_bits_of_the_flat_plate() -> None:
    macros = f"{STATIC} STRE PLYS LMAS DT=0 LOOP=40 TIME RODP=10 NEXT"
    hit = (*curved_panels.IMPACT, model.Impact(mesh(6).nearest(150.0, 100.0)[0], 3, 3000.0))
    flat = panel((), macros, mesh(6), others=hit, load=1.0)
    card = replace(flat, segments=(*flat.segments, model.Curvature()))
    one, other = every_result(flat), every_result(card)
    assert one.keys() == other.keys()
    for path, values in one.items():
        np.testing.assert_array_equal(values, other[path], err_msg=path)


def test_the_opposite_curvature_gives_the_same_deflection_and_reversed_membrane_forces() -> None:
    one, other = (
        decks.run_of_deck(
            panel((sign * 500.0, sign * 700.0, sign * 900.0), f"{STATIC} STRE", load=1.0)
        )
        for sign in (1.0, -1.0)
    )
    np.testing.assert_allclose(one.tape3.w, other.tape3.w, rtol=0.0, atol=1e-12 * one.tape3.w.max())
    for name, sign in (("N_x", -1.0), ("N_y", -1.0), ("N_xy", -1.0), ("M_x", 1.0), ("M_xy", 1.0)):
        values = one[f"stresses/{name}"]
        close = 1e-10 * np.abs(values).max()
        np.testing.assert_allclose(sign * other[f"stresses/{name}"], values, rtol=0.0, atol=close)


def test_a_panel_turned_by_90_degrees_with_its_plies_is_the_same() -> None:
    upright = ElementGrid(uniform_section(SIDES[1], 8), uniform_section(SIDES[0], 12))
    turned = tuple(90.0 - angle for angle in ANGLES)
    one = decks.run_of_deck(panel((500.0, 800.0, 0.0), STATIC, load=1.0))
    other = decks.run_of_deck(panel((800.0, 500.0, 0.0), STATIC, upright, load=1.0, angles=turned))
    assert mean_deflection(other) == pytest.approx(mean_deflection(one), rel=1e-10)


def test_a_twisted_panel_is_a_saddle_turned_by_45_degrees() -> None:
    """1/Rxy along x and y is 1/R and -1/R along the diagonals, of an isotropic square."""
    ply = decks.isotropic(70e3, 0.3, 2.7e-9)
    corner = 50.0 * np.sqrt(2.0)
    straight = ElementGrid(uniform_section(100.0, 8), uniform_section(100.0, 8))

    def deflection(points: Floats, radii: tuple[float, ...]) -> float:
        cards = tuple(model.NodeValues(n, 0, tuple(p)) for n, p in enumerate(points.tolist(), 1))
        segments = (
            decks.restraints(straight, "00000 11100 11100 11100 11100"),
            decks.material(ply, (0.0,), 2.0),
            decks.MITC,
            model.Patch("DISC", 10.0, 0.0, 0.0, 1.0),
            model.Curvature(*radii),
        )
        deck = decks.deck(straight, segments, decks.program(STATIC), model.Coordinates(cards))
        return mean_deflection(decks.run_of_deck(deck))

    s, t = np.meshgrid(np.linspace(-1.0, 1.0, 17), np.linspace(-1.0, 1.0, 17))
    square = 50.0 * np.stack([s.ravel(), t.ravel()], axis=1)
    diamond = corner / 2.0 * np.stack([(s - t).ravel(), (s + t).ravel()], axis=1)
    twisted, saddle = (
        deflection(square, (0.0, 0.0, 400.0)),
        deflection(diamond, (400.0, -400.0, 0.0)),
    )
    assert twisted == pytest.approx(saddle, rel=1e-4)
    assert twisted < 0.9 * deflection(square, ())


# Interplay ----------------------------------------------------------------------------------------


GAGES = model.Gages((model.Gage(1, 130.0, 90.0, 1.0, 30.0), model.Gage(2, 200.0, 60.0, -1.0, 0.0)))


@pytest.mark.skipif(kernels.LIBRARY is None, reason="needs the compiled kernels")
def test_every_solver_gives_the_same_impact() -> None:
    """The kernels and NumPy with half of the elements, the sparse matrix with all."""
    struck_plate = struck((-400.0, 900.0, 1500.0), mesh(6), 5e-7, 200, others=(GAGES,), every=50)
    one, *others = (fecm.run_one(struck_plate, solver=name) for name in ("kernels", "numpy", "csr"))
    for other in others:
        for path in ("history/force", "gages/strain", "tape8/kappa_x", "energy/plate_strain"):
            size = 1e-10 * np.abs(one[path]).max()
            np.testing.assert_allclose(other[path], one[path], rtol=0.0, atol=size, err_msg=path)


def test_a_run_stores_stresses_exposures_and_gages_with_the_strains_of_the_radii() -> None:
    strengths = model.Allowables(2500.0, 1500.0, 60.0, 200.0, 90.0, 90.0, 60.0)
    struck_plate = struck(
        (0.0, 500.0),
        mesh(6),
        5e-7,
        200,
        others=(GAGES, strengths),
        every=40,
        more="DISP=40 STRE=40 PLYS=40 FAIL=40",
    )
    result = fecm.run_one(struck_plate)
    (problem,) = load_deck(struck_plate).problems
    # The mean over the thickness of a symmetric laminate leaves the stress of the midplane strain.
    first = result.plies.sigma_1[..., 0, 0] + result.plies.sigma_1[..., -1, -1]
    q = problem.laminate.plies.stiffness[0]
    strains = result.stresses
    along = 2.0 * (q[0, 0] * strains.eps_xx + q[0, 1] * strains.eps_yy)
    np.testing.assert_allclose(first, along, rtol=0.0, atol=1e-9 * np.abs(first).max())
    assert np.abs(first).max() > 0.01 * result.plies.sigma_1.max()
    # Exposures are those of the stored stresses.
    s, tau = strengths, np.abs(result.plies.tau_12)
    sigma_1, sigma_2 = result.plies.sigma_1, result.plies.sigma_2
    ratios = [sigma_1 / s.xt, -sigma_1 / s.xc, sigma_2 / s.yt, -sigma_2 / s.yc, tau / s.s12]
    right = np.max(ratios, axis=(0, 1))
    np.testing.assert_allclose(result.failure.max_stress.exposure, right, rtol=1e-9, atol=1e-12)
    # Gages are those of the stored displacements.
    read = gages(problem.mesh, GAGES.records, curvature=problem.plate.curvature)
    rows = np.searchsorted(result.gages.step, result.tape3.step)
    fields = result.tape3.displacement.reshape(len(rows), -1)
    strain = read.strains((fields[:, read.dof_indices] * read.weights).sum(axis=2))
    np.testing.assert_allclose(result.gages.strain[rows], strain, rtol=1e-9, atol=1e-15)


def swept_forces(deck: model.Deck, vary: dict[str, list[float] | list[str]]) -> Floats:
    """Force histories of the cases of a sweep."""
    force = fecm.sweep(deck, vary, history=True).force
    assert force is not None
    return force


def test_a_sweep_has_the_forces_of_its_runs() -> None:
    radii, velocities = (0.0, -500.0), [1000.0, 3000.0]
    swept = swept_forces(shortly(radii), {"velocity": velocities})
    for force, velocity in zip(swept, velocities, strict=True):
        run = fecm.run_one(shortly(radii, velocity))
        close = 1e-11 * run.history.force.max()
        np.testing.assert_allclose(force, run.history.force, rtol=0.0, atol=close)
    flat = fecm.run_one(shortly(()))
    assert np.abs(flat.history.force - swept[1]).max() > 1e-3 * swept[1].max()


def test_a_layup_sweep_keeps_the_curvature() -> None:
    built = shortly((0.0, -500.0))
    swept = swept_forces(built, {"layup": ["[0/90/0/90/0]s", "[90/0/90/0/90]s"]})
    turned = tuple(90.0 - angle for angle in ANGLES)
    material = decks.material(curved_panels.PLY, turned, 0.2)
    segments = tuple(material if isinstance(s, model.Material) else s for s in built.segments)
    for force, one in zip(swept, (built, replace(built, segments=segments)), strict=True):
        run = fecm.run_one(one)
        close = 1e-11 * run.history.force.max()
        np.testing.assert_allclose(force, run.history.force, rtol=0.0, atol=close)


def test_the_stiffness_of_an_estimate_is_that_of_the_panel() -> None:
    (problem,) = load_deck(struck((0.0, 500.0), fine_middle(8), 2.5e-7, 10)).problems
    stiffness = quick_estimate(problem).stiffness
    wanted = float(ROWS[0.0, 500.0][curved_panels.W])
    assert 1.0 / stiffness == pytest.approx(wanted, rel=1.5e-3)
