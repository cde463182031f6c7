"""Pictures of plies: stresses through the thickness, exposures over the plate and by ply."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fecm import Result
from fecm._errors import FecmWarning
from fecm._typing import Array
from fecm.judge.criteria import ALL_CRITERIA
from fecm.mechanics.failure import CRITERIA
from fecm.plot.failure import outline
from fecm.plot.kinds import PlotError
from fecm.plot.pictures import draw
from fecm.results.exposures import largest_exposures
from fecm.results.summary import run_summary
from tests.decks import DATA_CARDS, DISC, PLY_PROGRAM, PROGRAM, small
from tests.pictures import legend_of, plot, run

pytest.importorskip("matplotlib")

# Through the thickness --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def plies() -> Result:
    """The small plate under a disc in its fourth element, symmetric and with four plies."""
    layers = "".join(f"{n}, {angle}., .0265\n" for n, angle in enumerate((0, 90, 90, 0), 1))
    data = DISC + DATA_CARDS[: DATA_CARDS.index("    1   0.")] + layers + "UNIT\nin lbf s\n"
    return run(small(PLY_PROGRAM, data=data).replace("   25    4    2", "   25    4    4"))


def test_thickness_shows_six_components_with_jumps_at_the_faces_of_plies(plies: Result) -> None:
    with pytest.warns(FecmWarning, match="element 4 of .* is within 0.253 of the load"):
        figure: Any = plot(plies, "thickness", at=((1.45, 1.05),), times=(2.5e-6,))
    labels = [axes.get_xlabel().partition(" (") for axes in figure.axes]
    assert [label for label, _, _ in labels] == [
        r"$\sigma_1$",
        r"$\sigma_2$",
        r"$\tau_{12}$",
        r"$\tau_{xz}$",
        r"$\tau_{yz}$",
        r"$(\tau_{xz}^2 + \tau_{yz}^2)^{1/2}$",
    ]
    assert figure.get_suptitle() == "element 4 at 1.5, 1 in, time 2.5 µs"
    member = plies["plies/element"].tolist().index(4)
    curves = [axes.get_lines()[-1].get_data() for axes in figure.axes]
    for (values, z), name in zip(curves, ("sigma_1", "sigma_2", "tau_12"), strict=False):
        stored = plies[f"plies/{name}"][0, member, 4].ravel()
        np.testing.assert_allclose(values, stored, rtol=1e-12)
        faces = [-0.053, -0.0265, -0.0265, 0.0, 0.0, 0.0265, 0.0265, 0.053]
        np.testing.assert_allclose(z, faces, atol=1e-15)
    values, z = curves[3]
    stored = plies["plies/tau_xz"][0, member]
    np.testing.assert_allclose(np.reshape(values, (4, 9))[:, [0, 4, 8]], stored, rtol=1e-12)
    # Between three values of a ply: the parabola, which in a ply is exact.
    parabola = np.polyfit(plies["plies/z"][0], stored[0], 2)
    np.testing.assert_allclose(values[:9], np.polyval(parabola, z[:9]), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(curves[5][0], np.hypot(values, curves[4][0]), rtol=1e-12)
    dotted = [
        line.get_ydata()[0] for line in figure.axes[0].get_lines() if line.get_linestyle() == ":"
    ]
    np.testing.assert_allclose(dotted, [-0.053, -0.0265, 0.0, 0.0265, 0.053], atol=1e-15)
    assert figure.axes[0].get_ylim() == (0.053, -0.053)


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_a_thin_line_has_the_residual_stresses_of_the_cure(plies: Result) -> None:
    text = plies.deck_text.replace("UNIT", "CURE\n-100.,\n,1.E-6,2.E-5\n\nUNIT")
    cured = run(text)
    figure: Any = plot(cured, "thickness")
    assert figure.get_suptitle().endswith("\nthin: residual stress (CURE)")
    for number, axes in enumerate(figure.axes[:3]):
        load, thin = axes.get_lines()[-2:]
        assert thin.get_linewidth() < load.get_linewidth()
        residual = cured["plies/cure_stress"][..., number].ravel()
        np.testing.assert_allclose(thin.get_xdata(), residual, rtol=1e-12)
        np.testing.assert_array_equal(thin.get_ydata(), load.get_ydata())
    stored = plies["plies/sigma_1"]
    np.testing.assert_array_equal(cured["plies/sigma_1"], stored)  # those of the load alone


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_thickness_without_a_place_is_that_of_the_largest_stress_outside_the_load(
    plies: Result,
) -> None:
    stress, under = np.abs(plies["plies/sigma_1"]), plies["plies/under_load"] != 0
    largest = stress[:, ~under].max()
    assert stress[:, under].max() > largest
    axes: Any = plot(plies, "thickness").axes[0]
    assert np.abs(axes.get_lines()[-1].get_xdata()).max() == largest
    arrays = {path: plies[path] for path in plies} | {"plies/under_load": np.ones_like(under)}
    everywhere = Result(arrays, {"deck": plies.deck_text}, {"patch": plies.patch.attributes})
    with pytest.warns(FecmWarning, match="of the load, where plate theory does not hold"):
        axes = plot(everywhere, "thickness").axes[0]
    assert np.abs(axes.get_lines()[-1].get_xdata()).max() == stress.max()


def test_thickness_beside_the_stored_elements_names_the_nearest(plies: Result) -> None:
    others = set(range(1, 5)) - set(plies["plies/element"].tolist())
    (x, y) = {1: (0.4, 0.4), 2: (1.6, 0.4), 3: (0.4, 1.6)}[others.pop()]
    with pytest.warns(FecmWarning, match=f"no ply stresses at {x},{y}; the nearest element"):
        plot(plies, "thickness", at=((x, y),))
    with pytest.raises(PlotError, match="9,9 is not on the plate"):
        plot(plies, "thickness", at=((9.0, 9.0),))
    with pytest.raises(PlotError, match="no ply stresses at time 1"):
        plot(plies, "thickness", times=(1.0,))
    with pytest.raises(PlotError, match="one point at one time"):
        plot(plies, "thickness", times=(2e-6, 5e-6))


@pytest.mark.filterwarnings("ignore:.*of the load")
def test_thickness_of_elements_without_nine_nodes_shows_in_plane_stresses(plies: Result) -> None:
    arrays = {path: plies[path] for path in plies}
    for name in ("tau_xz", "tau_yz", "residual"):
        arrays[f"plies/{name}"] = np.full_like(arrays[f"plies/{name}"], np.nan)
    result = Result(arrays, {"deck": plies.deck_text}, {"patch": plies.patch.attributes})
    with pytest.warns(FecmWarning, match="does not have nine nodes"):
        figure = plot(result, "thickness")
    assert sum(axes.axison for axes in figure.axes) == 3


# Exposures --------------------------------------------------------------------------------------

STRENGTHS = "ALLO\n200000,200000,7000,28000,13000\n\n"


@pytest.fixture(scope="module")
def failing() -> Result:
    """The small plate under a disc in its fourth element, whose middle is left out."""
    program = PROGRAM.replace("NEXT", "FAIL          1\nNEXT")
    return run(small(program, data=STRENGTHS + DISC + DATA_CARDS + "UNIT\nin lbf s\n"))


def scaled(result: Result, factor: float) -> Result:
    """The result with exposures times a factor."""
    arrays = {path: result[path] for path in result}
    for path in arrays:
        if path.endswith("/exposure"):
            arrays[path] = factor * arrays[path]
    groups = {"": result.attributes, **{name: getattr(result, name).attributes for name in
              ("failure", "patch")}}  # fmt: skip
    return Result(arrays, {"deck": result.deck_text}, groups)


def area(polygon: Array) -> float:
    """Area of a polygon, (n, 2), by the shoelace formula."""
    x, y = polygon.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0)


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
@pytest.mark.parametrize("points", [-3, -2, 2, 3])
@pytest.mark.few(2)  # of 4, 0.1 s each
def test_the_map_of_exposures_has_a_cell_around_every_point(points: int) -> None:
    data = (STRENGTHS + DATA_CARDS).replace("    3    3   -3", f"    3    3{points:5}")
    result = run(small(PROGRAM.replace("NEXT", "FAIL          1\nNEXT"), data=data))
    plate: Any = plot(result, "failure").axes[0]
    shown, hatched, _ = plate.collections
    under = result["failure/under_load"] != 0
    stored = np.max([result[f"failure/{name}/exposure"] for name in CRITERIA], axis=0)
    np.testing.assert_array_equal(shown.get_array(), stored.max(axis=(2, 3))[~under])
    assert len(hatched.get_paths()) == np.count_nonzero(under)
    cells = [path.vertices[:4] for path in (*shown.get_paths(), *hatched.get_paths())]
    assert sum(map(area, cells)) == pytest.approx(4.0, rel=1e-12)
    x, y = (
        np.concatenate([result[f"failure/{n}"][~under], result[f"failure/{n}"][under]])
        for n in "xy"
    )
    for cell, place in zip(cells, np.stack([x, y], axis=1), strict=True):
        assert (cell.min(axis=0) <= place + 1e-12).all()
        assert (cell.max(axis=0) >= place - 1e-12).all()


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
@pytest.mark.long
def test_map_and_bars_stand_beside_each_other_below_a_lower_legend(failing: Result) -> None:
    figure: Any = plot(failing, "failure")
    figure.canvas.draw()
    plate, bars, _ = figure.axes
    left, right = plate.get_position(), bars.get_position()
    assert left.x1 < right.x0
    assert left.y0 < right.y1
    assert right.y0 < left.y1
    (legend,) = figure.legends
    assert legend.get_window_extent().height < plate.get_window_extent().height
    assert figure.get_figwidth() > figure.get_figheight()


def test_an_open_contact_is_told_above_the_exposures(failing: Result) -> None:
    assert failing.still_in_contact
    with pytest.warns(FecmWarning, match="are left out"):
        plate = plot(failing, "failure").axes[0]
    assert "still in contact at the end" in plate.get_title(loc="left")


def test_a_bar_per_ply_leaves_out_what_is_under_the_load(failing: Result) -> None:
    raised = scaled(failing, 1.0)
    arrays = {path: raised[path] for path in raised}
    arrays["failure/puck/exposure"] = arrays["failure/puck/exposure"].copy()
    arrays["failure/puck/exposure"][3, 8] = 9.0  # the point under the load
    groups = {name: getattr(raised, name).attributes for name in ("failure", "patch")}
    raised = Result(arrays, {"deck": raised.deck_text}, {"": raised.attributes, **groups})
    with pytest.warns(FecmWarning, match="are left out: 1 point of element 4$"):
        figure: Any = draw("failure", {"small": raised}, quantity="puck").figure
    plate, bars, _ = figure.axes
    under = failing["failure/under_load"] != 0
    exposure = failing["failure/puck/exposure"]
    expected = [exposure[:, :, ply][~under].max() for ply in (0, 1)]
    assert [bar.get_width() for bar in bars.patches] == expected
    assert plate.collections[0].norm.vmax == max(expected)
    assert bars.get_ylim()[0] > bars.get_ylim()[1]  # the struck face at the top
    assert [1.0, 1.0] in [list(line.get_xdata()) for line in bars.get_lines()]
    (line,) = (line for line in run_summary(failing) if line.startswith("puck"))
    value, mode = plate.get_title(loc="left").split(" (puck)")[0].split(": ")
    assert line.split(":")[0].split()[-1] == value
    assert mode in line
    names = ["puck", "exposure 1", "largest", "under the load", "circle around the load"]
    assert legend_of(figure) == names


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_all_criteria_mark_their_values_and_interfaces_have_their_own_bars(
    failing: Result,
) -> None:
    figure: Any = plot(failing, "failure", width="full")
    _, bars, _ = figure.axes
    under = failing["failure/under_load"] != 0
    values = [failing[f"failure/{name}/exposure"][~under].max(axis=(0, 2)) for name in CRITERIA]
    widths = [bar.get_width() for bar in bars.patches]
    np.testing.assert_array_equal(widths[:2], np.max(values, axis=0))
    marks = bars.get_lines()[: len(CRITERIA)]
    np.testing.assert_array_equal([line.get_xdata() for line in marks], values)
    heights = np.array([line.get_ydata() for line in marks])
    assert np.diff(heights, axis=0).min() > 0.1  # values may coincide, their marks do not
    between = failing["failure/interlaminar/exposure"]
    assert widths[2:] == [between[:3].max()]  # the fourth element is under the load
    assert bars.patches[2].get_y() + bars.patches[2].get_height() / 2.0 == pytest.approx(1.5)
    alone: Any = plot(failing, "failure", quantity="interlaminar")
    shown, hatched, _ = alone.axes[0].collections
    np.testing.assert_array_equal(shown.get_array(), np.repeat(between[:3, 0], 9))
    assert len(hatched.get_paths()) == 9
    assert "plies 1 and 2" in alone.axes[0].get_title(loc="left")


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
@pytest.mark.parametrize("between", [0.0, 100.0])
def test_rings_in_the_bars_are_the_printed_exposures_and_the_map_shows_the_largest(
    failing: Result, between: float
) -> None:
    arrays = {path: failing[path] for path in failing}
    circle = arrays["failure/circle/exposure"].copy()
    circle[ALL_CRITERIA.index("puck")] = 50.0
    circle[-1] = between
    arrays["failure/circle/exposure"] = circle
    groups = {name: getattr(failing, name).attributes for name in ("failure", "patch")}
    raised = Result(arrays, {"deck": failing.deck_text}, {"": failing.attributes, **groups})
    figure: Any = draw("failure", {"a": raised}).figure
    plate, bars, bar = figure.axes
    rings = [line for line in bars.get_lines() if line.get_markerfacecolor() == "none"]
    shown = [float(line.get_xdata()[0]) for line in rings]
    assert sorted(shown) == sorted(one.exposure for one in largest_exposures(raised))
    assert shown[-1] == max(between, 50.0)  # above the others
    kinds = ["puck", "interlaminar"]
    if between:
        kinds.reverse()
        assert bar.get_xlabel() == "Largest exposure of the interfaces"
        places = failing["failure/interlaminar/exposure"][:3, 0]
        np.testing.assert_array_equal(plate.collections[0].get_array(), np.repeat(places, 9))
    lines = plate.get_title(loc="left").splitlines()
    assert [line.split(" (")[1].split(")")[0] for line in lines[:2]] == kinds
    (drawn,) = plate.patches
    radius = float(drawn.radius)
    assert radius == pytest.approx(0.2 + 0.106 / 2.0)  # the disc and half of the thickness
    assert drawn.center == (1.5, 1.5)
    largest = next(line for line in plate.get_lines() if line.get_color() == "#C00000")
    x, y = (float(values[0]) for values in largest.get_data())
    assert np.hypot(x - 1.5, y - 1.5) == pytest.approx(radius)


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_the_plate_is_outlined_where_the_exposure_is_above_1(failing: Result) -> None:
    plate: Any = draw("failure", {"a": failing}).figure.axes[0]
    largest = plate.collections[0].get_array().max()
    for factor, above in ((0.999 / largest, False), (1.001 / largest, True)):
        figure: Any = draw("failure", {"a": scaled(failing, factor)}).figure
        assert bool(figure.axes[0].collections[2].get_segments()) is above
        assert bool(figure.axes[2].lines) is above


def test_an_outline_leaves_out_the_sides_between_cells() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) / 128.0
    cells = np.stack([square + np.array([x, 0.0]) for x in (0.0, 1.0 / 128.0, 4.0)])
    assert outline(cells).shape == (6 + 4, 2, 2)
    assert outline(cells[:0]).shape == (0, 2, 2)


def test_exposures_that_can_not_be_shown_are_refused(failing: Result) -> None:
    words = f"no criterion 'strain'; there are {', '.join(ALL_CRITERIA)}"
    with pytest.raises(PlotError, match=words):
        plot(failing, "failure", quantity="strain")
    arrays = {path: failing[path] for path in failing}
    for name in ("under_load", "centre_under_load"):
        arrays[f"failure/{name}"] = np.ones_like(arrays[f"failure/{name}"])
    groups = {"failure": failing.failure.attributes, "patch": failing.patch.attributes}
    with pytest.raises(PlotError, match="load is over all elements of covered: no exposure"):
        draw("failure", {"covered": Result(arrays, {"deck": failing.deck_text}, groups)})


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_a_single_ply_has_one_bar() -> None:
    data = DATA_CARDS.replace("    2  90.     0.053\n", "").replace("0.     0.053", "0.     0.106")
    deck = small(PROGRAM.replace("NEXT", "FAIL          1\nNEXT"), data=STRENGTHS + data)
    figure: Any = plot(run(deck.replace("   25    4    2", "   25    4    1")), "failure")
    assert len(figure.axes[1].patches) == 1
