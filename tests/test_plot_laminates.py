"""Pictures and exports of plates of several laminates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

import fecm
from fecm import Result
from fecm.deck import model
from fecm.plot.failure import NAMES
from fecm.plot.kinds import PlotError
from fecm.problem.loading import load_deck
from fecm.problem.summary import deck_summary
from fecm.results.export import write_vtkhdf
from tests.pictures import legend_of, plot
from tests.test_failure_runs import of_fabric
from tests.test_several_materials import HYBRID, impact, materials, unlike

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def plate() -> Result:
    """Laminates 1 and 3 below (elements 1 to 8, 3 in 3 and 4), laminate 2 above.

    Only the middle ply of laminate 2 and those of laminate 1 have strengths.
    """
    alpha = (2e-8, 2.25e-5)
    cure = model.Cure(-100.0, 0.0, tuple(model.Expansion(n, *alpha) for n in (1, 2, 3)))
    return fecm.run_one(unlike(cure, words="PLYS=10 FAIL=5 DISP=10"))


def test_the_mesh_shows_each_laminate_in_a_colour_with_its_elements(plate: Result) -> None:
    figure: Any = plot(plate, "mesh")
    assert {"laminate 1", "laminate 2", "laminate 3"} <= {*legend_of(figure)}
    (axes,) = figure.axes
    filled = [one for one in axes.collections if isinstance(one, PolyCollection)]
    assert [len(one.get_paths()) for one in filled] == [6, 8, 2]
    colours = np.concatenate([np.asarray(one.get_facecolor()) for one in filled])
    assert len(np.unique(colours, axis=0)) == 3
    third = [path.vertices for path in filled[2].get_paths()]
    low, high = np.min(np.concatenate(third), axis=0), np.max(np.concatenate(third), axis=0)
    assert (*low, *high) == (30.0, 0.0, 60.0, 15.0)


@pytest.mark.parametrize(("at", "count", "half"), [((5.0, 5.0), 3, 0.75), ((55.0, 5.0), 2, 0.3)])
def test_thickness_shows_the_plies_of_the_elements_own_laminate(
    plate: Result, at: tuple[float, float], count: int, half: float
) -> None:
    figure: Any = plot(plate, "thickness", at=(at,))
    sigma = figure.axes[0]
    stress, residual = (line for line in sigma.lines if len(line.get_xdata()) > 2)
    assert len(stress.get_xdata()) == len(residual.get_xdata()) == 2 * count
    assert sigma.get_ylim() == pytest.approx((half, -half))
    (position,) = {2: [2], 3: [0]}[count]
    cured = plate["plies/cure_stress"][position, :count, :, 0].ravel()
    scale = residual.get_xdata()[0] / cured[0]
    np.testing.assert_allclose(residual.get_xdata(), scale * cured, rtol=1e-12)


@pytest.mark.parametrize("quantity", ["", *NAMES[:1]])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_failure_leaves_plies_without_strengths_blank(plate: Result, quantity: str) -> None:
    figure: Any = plot(plate, "failure", quantity=quantity)
    (cells,) = [c for c in figure.axes[0].collections if c.get_array() is not None]
    drawn = np.ma.filled(cells.get_array(), np.nan)
    # The largest at each point of the criteria that are shown, of the plies with strengths.
    shown = (quantity,) if quantity else NAMES[:4]
    with np.errstate(invalid="ignore"):
        values = [np.fmax.reduce(plate[f"failure/{n}/exposure"], axis=(2, 3)) for n in shown]
    wanted = np.max(values, axis=0)[plate["failure/under_load"] == 0]
    np.testing.assert_array_equal(drawn, wanted)
    assert np.isnan(drawn).any()  # laminate 3
    assert np.isfinite(drawn).any()


def test_vtkhdf_has_the_laminate_and_the_largest_stress_of_own_plies(
    plate: Result, tmp_path: Path
) -> None:
    path = tmp_path / "plate.vtkhdf"
    write_vtkhdf(plate, path)
    with h5py.File(path) as file:
        cells = file["VTKHDF/CellData"]
        steps = int(file["VTKHDF/Steps"].attrs["NSteps"])
        np.testing.assert_array_equal(cells["laminate"], plate["mesh/laminate"])  # of all steps
        assert not file["VTKHDF/Steps/CellDataOffsets/laminate"][:].any()
        actual = cells["sigma_1"][:].reshape(steps, 16)[-1]
        ply = cells["sigma_1_ply"][:].reshape(steps, 16)[-1]
    stored = plate["plies/sigma_1"][-1]
    np.testing.assert_array_equal(np.abs(actual), np.nanmax(np.abs(stored), axis=(1, 2, 3)))
    assert ply[[2, 3]].max() == 2


def test_the_summary_of_a_deck_names_the_laminate_under_the_load() -> None:
    (problem,) = load_deck(unlike()).problems
    summary = deck_summary(problem)
    assert "  laminate            1, under the load" in summary.lines()
    assert summary.layers == 3


def without_strengths(*layers: int) -> Result:
    """A short impact on three plies, of which some are of the material without strengths."""
    layup = tuple(
        (angle, 0.5, 2 if n in layers else 1) for n, angle in enumerate((0.0, 90.0, 30.0))
    )
    return fecm.run_one(impact(materials(HYBRID[0]), layup=layup, words="FAIL=5", steps=10))


def test_failure_without_any_interface_of_known_strength_shows_the_plies() -> None:
    figure: Any = plot(without_strengths(1), "failure")
    assert "interlaminar" not in legend_of(figure)


def test_failure_of_fabrics_shows_the_criteria_that_are_evaluated() -> None:
    result = fecm.run_one(of_fabric())
    assert {"max stress", "puck"} & {*legend_of(plot(result, "failure"))} == {"max stress"}
    with pytest.raises(PlotError, match="puck is not evaluated for the plies of the result"):
        plot(result, "failure", quantity="puck")


@pytest.mark.parametrize(
    ("layers", "quantity", "message"),
    [
        ((0, 1, 2), "", "no ply of the result has strengths"),
        ((1,), "interlaminar", "no pair of neighbouring plies of the result has strengths"),
    ],
)
def test_failure_without_any_known_exposure_is_refused(
    layers: tuple[int, ...], quantity: str, message: str
) -> None:
    with pytest.raises(PlotError, match=message):
        plot(without_strengths(*layers), "failure", quantity=quantity)
