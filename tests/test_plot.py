"""Pictures: their lines are the result's numbers, their axes have units, and a run draws none."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm._errors import FecmWarning
from fecm.plot.data import patches, strain_points
from fecm.plot.failure import outline
from fecm.plot.kinds import KINDS, MISSING, Picture, PlotError, Shows
from fecm.plot.mesh import Support, supports
from fecm.plot.pictures import draw, save
from fecm.plot.plate import profile
from fecm.plot.style import COLOURS, scale
from fecm.results.result import Result
from fecm.results.summary import summary
from tests.builders import distorted_square
from tests.decks import DATA_CARDS, DISC, MESH, PLY_PROGRAM, PROGRAM, small

Array = NDArray[Any]

pytest.importorskip("matplotlib")

OF_RUNS = [name for name, kind in KINDS.items() if kind.shows is not Shows.SWEEP]

NAMED = small(data=DATA_CARDS + "UNIT\nin lbf s\n")


# As many steps as the contact lasts, and some more.
LONG_PROGRAM = PROGRAM.replace(" 10\n", "330\n")


def run(deck: str) -> Result:
    """Result of a deck of one problem."""
    result = fecm.run(deck)
    assert isinstance(result, Result)
    return result


@pytest.fixture(scope="module")
def result() -> Result:
    """The small plate in in, lbf and s."""
    return run(NAMED)


def plot(result: Result, kind: str, **options: Any) -> Any:
    """The command line's figure of one result."""
    return draw(kind, {"the result": result}, **options).figure


def lines(axes: Any) -> dict[str, tuple[Array, Array]]:
    """Data of an axes' lines by their labels."""
    return {line.get_label(): line.get_data() for line in axes.get_lines()}


def ticks(axis: Any) -> list[tuple[float, str]]:
    """Places and texts of the ticks of an axis."""
    texts = [text.get_text() for text in axis.get_ticklabels()]
    return list(zip(axis.get_ticklocs().tolist(), texts, strict=True))


def legend_of(figure: Any) -> list[str]:
    """Texts of a figure's legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


# What is drawn ----------------------------------------------------------------------------------


def test_force_shows_both_forces_in_microseconds_and_pounds(result: Result) -> None:
    figure = plot(result, "force")
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Time (µs)", "Force (lbf)")
    drawn = lines(axes)
    assert list(drawn) == legend_of(figure) == ["contact force", "transducer"]
    time, force = drawn["contact force"]
    np.testing.assert_array_equal(time, result.time)
    np.testing.assert_array_equal(force, result.force)
    places, texts = zip(*ticks(axes.xaxis), strict=True)
    assert texts == ("0", "1", "2", "3", "4", "5")
    np.testing.assert_allclose(places, np.arange(6) * 1e-6, atol=1e-20)
    np.testing.assert_array_equal(drawn["transducer"][1], result.transducer)


def test_a_deck_without_units_has_none_on_its_axes() -> None:
    (axes,) = plot(run(small()), "force").axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Time (10⁻⁶)", "Force")


def test_several_results_share_the_axes_each_in_its_colour(result: Result) -> None:
    listing = fecm.run(NAMED, mode="listing")
    assert isinstance(listing, Result)
    both = {"report": result, "listing": listing}
    figure = draw("force", both).figure
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "Contact force (lbf)", "Transducer (lbf)",
    ]  # fmt: skip
    assert legend_of(figure) == ["report", "listing"]
    np.testing.assert_array_equal(lines(figure.axes[0])["listing"][1], listing.force)
    np.testing.assert_array_equal(lines(figure.axes[1])["report"][1], result.transducer)
    assert [line.get_color() for line in figure.axes[0].get_lines()] == list(COLOURS[:2])
    figure = draw("loop", both).figure
    indentation, force = lines(figure.axes[0])["listing"]
    np.testing.assert_array_equal(indentation, np.append(0.0, listing.indentation))
    np.testing.assert_array_equal(force, np.append(0.0, listing.force))
    assert figure.axes[0].get_xlabel() == "Indentation (10⁻⁶ in)"
    figure = draw("energy", both).figure
    assert legend_of(figure)[-2:] == ["report", "listing"]
    assert len(figure.axes[0].get_lines()) == 2 * 6
    assert len({line.get_linestyle() for line in figure.axes[0].get_lines()}) == 2


def test_the_sum_of_the_energies_is_what_there_was_at_first(result: Result) -> None:
    (axes,) = plot(result, "energy").axes
    total = np.asarray(axes.get_lines()[-1].get_ydata())
    initial = 0.5 * 1.8096e-4 * 115.0**2
    np.testing.assert_allclose(total, initial, rtol=1e-3)
    assert axes.get_ylabel() == "Energy (lbf·in)"


def test_results_in_different_units_share_no_axes(result: Result) -> None:
    metric = run(small(data=DATA_CARDS + "UNIT\nm N s\n"))
    with pytest.raises(PlotError, match="lbf in first and N in second"):
        draw("force", {"first": result, "second": metric})


def test_line_follows_the_nodes_through_the_impact_point(result: Result) -> None:
    figure = plot(result, "line", times=(2.5e-6, 5e-6), along="y")
    (axes,) = figure.axes
    assert figure.legends[0].get_title().get_text() == "Time (µs)"
    for row, label in enumerate(("2.5", "5")):
        place, w = lines(axes)[label]
        np.testing.assert_array_equal(place, [0.0, 0.5, 1.0, 1.5, 2.0])
        shown = w / result["tape3/w"][row, [2, 7, 12, 17, 22]]
        np.testing.assert_allclose(shown, shown[0], rtol=1e-9)
    assert axes.get_xlabel() == "$y$ (in)"


def test_on_a_distorted_mesh_the_line_is_interpolated_in_its_elements(result: Result) -> None:
    coordinates, elements = distorted_square(4, 4)
    node = int(np.hypot(*(coordinates - 0.5).T).argmin()) + 1
    deck = result.deck.replace("   13    3", f"{node:5d}    3")
    w = 3.0 * coordinates[:, 0] + 2.0 * coordinates[:, 1] - 1.0
    arrays: dict[str, Array] = {
        "mesh/coordinates": coordinates,
        "mesh/elements": elements,
        "tape3/w": w[None],
    }
    skewed = Result(arrays, {"deck": deck}, {})
    place, shown = profile(skewed, "skewed", "x", np.array([0]))
    assert (place[0], place[-1]) == (0.0, 1.0)
    inner = slice(1, -1)  # rounding may put the ends beside the plate
    np.testing.assert_allclose(shown[0, inner], 3.0 * place[inner], rtol=1e-9)


@pytest.mark.parametrize("kind", [3, 4, 8, 9, 10, 12])
def test_elements_of_every_family_cover_the_plate_and_carry_linear_fields(kind: int) -> None:
    coordinates, elements = distorted_square(3, 3, kind)
    made = Result({"mesh/coordinates": coordinates, "mesh/elements": elements}, {}, {})
    cut = patches(made, 3)
    first, second = (
        cut.points[cut.triangles[:, n]] - cut.points[cut.triangles[:, 0]] for n in (1, 2)
    )
    areas = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2.0
    assert (areas > 0.0).all()
    assert areas.sum() == pytest.approx(1.0, rel=1e-12)
    shown = cut.values(coordinates @ [3.0, -2.0])
    np.testing.assert_allclose(shown, cut.points @ [3.0, -2.0], atol=1e-12)


def test_places_of_strains_may_be_an_array(result: Result) -> None:
    places = np.array([[1.1, 0.9], [0.1, 0.2]])
    shown = legend_of(plot(result, "strain", gages=(0.0,), at=places))
    assert shown == legend_of(plot(result, "strain", gages=(0.0,), at=places.tolist()))


def test_strain_is_curvature_times_the_distance_of_the_face(result: Result) -> None:
    far = plot(result, "strain", gages=(0.0, 90.0, 45.0), at=((1.1, 0.9),))
    assert legend_of(far) == ["εx at 1, 1", "εy at 1, 1", "ε 45° at 1, 1"]
    corners = np.array([2, 3, 1, 0])
    means = {
        name: result[f"tape8/{name}"][:, [0, 1, 2, 3], corners].mean(axis=1)
        for name in ("kappa_x", "kappa_y", "kappa_xy")
    }
    expected = 0.053 * (means["kappa_x"] + means["kappa_y"] + means["kappa_xy"]) / 2.0
    assert far.axes[0].get_ylabel() == "Strain, far face (10⁻⁶)"
    shown = lines(far.axes[0])
    np.testing.assert_allclose(shown["εx at 1, 1"][1], 0.053 * means["kappa_x"], rtol=1e-12)
    np.testing.assert_allclose(shown["ε 45° at 1, 1"][1], expected, rtol=1e-12)
    middle: dict[str, Any] = {"at": ((1.0, 1.0),)}
    struck = lines(plot(result, "strain", face="struck", gages=(0.0,), **middle).axes[0])
    np.testing.assert_allclose(struck["εx at 1, 1"][1], -shown["εx at 1, 1"][1], rtol=1e-12)
    curvature = plot(result, "strain", face="curvature", gages=(90.0,), **middle).axes[0]
    np.testing.assert_allclose(lines(curvature)["κy at 1, 1"][1], means["kappa_y"], rtol=1e-12)
    assert curvature.get_ylabel() == "Curvature (10⁻⁶ in⁻¹)"


def test_strain_by_default_is_the_largest_outside_the_load(result: Result) -> None:
    for one, place, reach in (
        (result, (1.0, 1.0), 0.053),
        (run(small(data=DISC + DATA_CARDS)), (1.5, 1.5), 0.2 + 0.053),
    ):
        points = strain_points(one, "small")
        outside = np.hypot(*np.moveaxis(points - place, -1, 0)) >= reach
        arrays = {path: one[path] for path in one}
        for name in ("x", "y", "xy"):
            larger = np.where(outside, 1.0, 100.0)
            arrays[f"tape8/kappa_{name}"] = larger * arrays[f"tape8/kappa_{name}"]
        x, y, xy = (arrays[f"tape8/kappa_{name}"] for name in ("x", "y", "xy"))
        middle, radius = (x + y) / 2.0, np.sqrt(((x - y) / 2.0) ** 2 + (xy / 2.0) ** 2)
        largest = np.maximum(np.abs(middle + radius), np.abs(middle - radius)).max(axis=0)
        assert largest[~outside].max() > largest[outside].max()
        groups = {name: one.attributes_of(name) for name in ("patch", "tape8")}
        one = Result(arrays, {"deck": one.deck}, groups)
        equal = points[outside & (largest > (1.0 - 1e-9) * largest[outside].max())]
        (line,) = plot(one, "strain", gages=(0.0,)).axes[0].get_lines()
        assert line.get_label() in [f"εx at {x:.4g}, {y:.4g}" for x, y in equal]


def test_strain_points_are_nodes_or_gauss_points(result: Result) -> None:
    points = strain_points(result, "small")
    nodes = result["mesh/coordinates"][result["mesh/elements"] - 1]
    np.testing.assert_allclose(points, nodes, atol=1e-15)
    gauss = strain_points(run(small().replace("    3    3   -3", "    3    3    2")), "small")
    np.testing.assert_allclose(gauss[0, 0], 0.5 - 0.5 / np.sqrt(3.0), rtol=1e-12)


def test_a_plate_that_stretches_is_said_to_show_bending_alone() -> None:
    free = MESH[: MESH.index("BOUN")] + "BOUN\n    1    0    1    1    1    1    1\n\n"
    with pytest.warns(FecmWarning, match="bending alone"):
        plot(run(small(mesh=free)), "strain", at=((1.0, 1.0),))


def test_contours_share_colours_about_zero_and_a_bar_of_those_that_occur(result: Result) -> None:
    figure = plot(result, "contour", times=(2.5e-6, 5e-6))
    first, second, bar = figure.axes
    assert [a.get_title(loc="left") for a in (first, second)] == ["time 2.5 µs", "time 5 µs"]
    assert bar.get_xlabel().startswith("Deflection (10⁻⁶ in)")
    fills: list[Any] = [axes.collections[0] for axes in (first, second)]
    (norm,) = {(fill.norm.vmin, fill.norm.vmax) for fill in fills}
    assert norm[0] == -norm[1]
    w = result["tape3/w"]
    assert norm[1] >= np.abs(w).max()
    low, high = bar.get_xlim()
    step = np.diff(fills[0].levels).max()
    assert low <= w.min() < low + 2.5 * step
    assert high - 2.5 * step < w.max() <= high
    assert low > -0.5 * high


def test_the_last_tick_of_x_and_the_first_of_y_do_not_collide(result: Result) -> None:
    axes = plot(result, "surface").axes[0]
    (x, _), (y, _) = ticks(axes.xaxis)[-1], ticks(axes.yaxis)[0]
    assert x == pytest.approx(2.0)  # at the corner where y begins
    assert y > 0.2


def test_the_surface_has_the_heights_of_the_nodes(result: Result) -> None:
    axes: Any
    axes, bar = plot(result, "surface").axes
    w = result["tape3/w"][-1]
    assert (bar.get_xlabel(), bar.get_xlim()) == (axes.get_zlabel(), (w.min(), w.max()))
    assert axes.get_zlabel() == "Deflection (10⁻⁶ in)"
    assert [text.get_text() for text in axes.texts] == ["time 5 µs"]
    heights = axes.collections[0].get_array()
    assert len(heights) == 4 * 4
    # The first element's last quarter has its centre, two mid-sides and the plate's middle.
    quarter = result["tape3/w"][-1, [6, 7, 12, 11]]
    assert heights[3] == pytest.approx(quarter.mean(), rel=1e-12)


def test_mesh_marks_supports_and_the_impact_point() -> None:
    held = "    1    1   -1   -1   -1   -1   -1\n    5    0    1    1    1    1    1\n"
    simple = "   21    1   -1   -1   -1    0    0\n   25    0    1    1    1    0    0\n"
    inner = "    6    1   -1   -1    0    0    0\n   20    0    1    1    0    0    0\n"
    mesh = MESH[: MESH.index("BOUN")] + f"BOUN\n{held}{inner}{simple}\n"
    result = run(small(mesh=mesh))
    kinds = {name: np.flatnonzero(nodes) + 1 for name, nodes in supports(result).items()}
    assert kinds[Support.CLAMPED].tolist() == [1, 2, 3, 4, 5]
    assert kinds[Support.W_HELD].tolist() == [21, 22, 23, 24, 25]
    assert not len(kinds[Support.ROTATION_HELD])
    figure = plot(result, "mesh", at=((0.3, 0.4),))
    axes: Any = figure.axes[0]
    assert legend_of(figure) == ["clamped", "w held", "impact", "points"]
    assert len(axes.collections[0].get_segments()) == 4
    impact = axes.get_lines()[2].get_data()
    assert [float(value[0]) for value in impact] == [1.0, 1.0]
    assert axes.get_aspect() == 1.0


@pytest.mark.parametrize("nodes", [4, 9])
@pytest.mark.parametrize("support", [Support.W_HELD, Support.CLAMPED])
def test_corners_of_a_simply_supported_plate_are_not_clamped(nodes: int, support: Support) -> None:
    coordinates, elements = distorted_square(4, 4, nodes)
    x, y = np.isin(coordinates, (0.0, 1.0)).T
    equations = np.ones((len(coordinates), 5))
    equations[x | y, 2] = 0
    for edge, rotation in ((x, 4), (y, 3)):
        equations[edge, rotation] = 0
    if support is Support.CLAMPED:
        equations[x | y, 3:] = 0
    arrays: dict[str, Array] = {"mesh/elements": elements, "mesh/equations": equations}
    kinds = supports(Result(arrays, {}, {}))
    np.testing.assert_array_equal(kinds.pop(support), x | y)
    assert not any(nodes_of_kind.any() for nodes_of_kind in kinds.values())


@pytest.mark.parametrize("kind", ["mesh", "contour"])
def test_plans_of_the_plate_draw_the_circle_of_the_patch(kind: str) -> None:
    axes: Any = plot(run(small(data=DISC + DATA_CARDS)), kind).axes[0]
    x, y = axes.get_lines()[-1].get_data()
    np.testing.assert_allclose(np.hypot(x - 1.5, y - 1.5), 0.2, rtol=1e-12)
    assert np.ptp(x) == pytest.approx(0.4) == np.ptp(y)
    cross = axes.get_lines()[-2].get_data()
    assert [float(value[0]) for value in cross] == [1.5, 1.5]


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
        r"$\sigma_1$", r"$\sigma_2$", r"$\tau_{12}$", r"$\tau_{xz}$", r"$\tau_{yz}$",
        r"$(\tau_{xz}^2 + \tau_{yz}^2)^{1/2}$",
    ]  # fmt: skip
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
def test_thickness_without_a_place_is_that_of_the_largest_stress_outside_the_load(
    plies: Result,
) -> None:
    stress, under = np.abs(plies["plies/sigma_1"]), plies["plies/under_load"] != 0
    largest = stress[:, ~under].max()
    assert stress[:, under].max() > largest
    axes: Any = plot(plies, "thickness").axes[0]
    assert np.abs(axes.get_lines()[-1].get_xdata()).max() == largest
    arrays = {path: plies[path] for path in plies} | {"plies/under_load": np.ones_like(under)}
    everywhere = Result(arrays, {"deck": plies.deck}, {"patch": plies.patch.attributes})
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
    made = Result(arrays, {"deck": plies.deck}, {"patch": plies.patch.attributes})
    with pytest.warns(FecmWarning, match="does not have nine nodes"):
        figure = plot(made, "thickness")
    assert sum(axes.axison for axes in figure.axes) == 3


def test_the_animation_has_a_frame_for_each_stored_row(result: Result, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    result.plot("animation", tmp_path / "plate.gif")
    with image.open(tmp_path / "plate.gif") as opened:
        assert opened.format == "GIF"
        assert opened.n_frames == 2


@pytest.mark.parametrize(
    ("peak", "unit", "factor", "label"),
    [
        (8e-4, "s", 1e6, "µs"), (0.8, "s", 1e3, "ms"), (3.0, "s", 1.0, "s"), (0.8, "ms", 1e3, "µs"),
        (8e-4, "", 1e6, "10⁻⁶"), (86.2, "", 1.0, ""), (0.0013, "in", 1e3, "10⁻³ in"),
        (0.15, "m", 1e3, "mm"), (2e-5, "m", 1e6, "µm"), (0.02, "mm", 1e3, "µm"),
        (25000.0, "N", 1e-3, "kN"), (25000.0, "lbf", 1e-3, "10³ lbf"),
        (0.7, "N*m", 1e3, "mJ"), (7.0, "N*mm", 1.0, "mJ"), (1.2, "lbf*in", 1.0, "lbf·in"),
        (0.0, "s", 1.0, "s"),
    ],
)  # fmt: skip
def test_axes_are_scaled_by_thousands(peak: float, unit: str, factor: float, label: str) -> None:
    got = scale(peak, unit)
    assert got.factor == pytest.approx(factor, rel=1e-12)
    assert got.unit == label


def test_widths_are_those_of_a_column_and_of_a_page(result: Result) -> None:
    assert plot(result, "force").get_figwidth() == 3.5
    assert plot(result, "force", width="full").get_figwidth() == 7.2


# Exposures --------------------------------------------------------------------------------------

STRENGTHS = "ALLO\n200000,200000,7000,28000,13000\n\n"
CRITERIA = ("max_stress", "tsai_wu", "hashin", "puck")


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
    return Result(arrays, {"deck": result.deck}, groups)


def area(polygon: Array) -> float:
    """Area of a polygon, (n, 2), by the shoelace formula."""
    x, y = polygon.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0)


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
@pytest.mark.parametrize("points", [-3, -2, 2, 3])
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
    x, y = (np.concatenate([result[f"failure/{n}"][~under], result[f"failure/{n}"][under]])
            for n in "xy")  # fmt: skip
    for cell, place in zip(cells, np.stack([x, y], axis=1), strict=True):
        assert (cell.min(axis=0) <= place + 1e-12).all()
        assert (cell.max(axis=0) >= place - 1e-12).all()


def test_an_open_contact_is_told_above_the_exposures(failing: Result) -> None:
    assert failing.still_in_contact
    with pytest.warns(FecmWarning, match="are left out"):
        plate = plot(failing, "failure").axes[0]
    assert "still in contact at the end" in plate.get_title(loc="left")


def test_a_bar_per_ply_leaves_out_what_is_under_the_load(failing: Result) -> None:
    raised = scaled(failing, 1.0)
    raised["failure/puck/exposure"][3, 8] = 9.0  # the point under the load
    with pytest.warns(FecmWarning, match="are left out: 1 point of element 4$"):
        figure: Any = draw("failure", {"small": raised}, quantity="puck").figure
    plate, bars, _ = figure.axes
    under = failing["failure/under_load"] != 0
    exposure = failing["failure/puck/exposure"]
    expected = [exposure[:, :, ply][~under].max() for ply in (0, 1)]
    assert [bar.get_width() for bar in bars.patches] == expected
    assert plate.collections[0].norm.vmax == max(expected)
    assert bars.get_ylim()[0] > bars.get_ylim()[1]  # the struck face at the top
    assert list(bars.get_lines()[-1].get_xdata()) == [1.0, 1.0]
    (line,) = (line for line in summary(failing) if line.startswith("puck"))
    value, mode = plate.get_title(loc="left").split(" (puck): ")
    assert line.split(":")[0].split()[-1] == value
    assert mode.split(",")[0] in line
    assert legend_of(figure) == ["puck", "exposure 1", "largest", "under the load"]


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
    np.testing.assert_array_equal([line.get_xdata() for line in bars.get_lines()[:4]], values)
    between = failing["failure/interlaminar/exposure"]
    assert widths[2:] == [between[:3].max()]  # the fourth element is under the load
    assert bars.patches[2].get_y() + bars.patches[2].get_height() / 2.0 == pytest.approx(1.5)
    alone: Any = plot(failing, "failure", quantity="interlaminar")
    shown, hatched, _ = alone.axes[0].collections
    np.testing.assert_array_equal(shown.get_array(), np.repeat(between[:3, 0], 9))
    assert len(hatched.get_paths()) == 9
    assert "plies 1 and 2" in alone.axes[0].get_title(loc="left")


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
    words = "no criterion 'strain'; there are max_stress, tsai_wu, hashin, puck, interlaminar"
    with pytest.raises(PlotError, match=words):
        plot(failing, "failure", quantity="strain")
    arrays = {path: failing[path] for path in failing}
    arrays["failure/under_load"] = np.ones_like(arrays["failure/under_load"])
    groups = {"failure": failing.failure.attributes, "patch": failing.patch.attributes}
    with pytest.raises(PlotError, match="load is over all elements of covered: no exposure"):
        draw("failure", {"covered": Result(arrays, {"deck": failing.deck}, groups)})


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
def test_a_single_ply_has_one_bar() -> None:
    data = DATA_CARDS.replace("    2  90.     0.053\n", "").replace("0.     0.053", "0.     0.106")
    deck = small(PROGRAM.replace("NEXT", "FAIL          1\nNEXT"), data=STRENGTHS + data)
    figure: Any = plot(run(deck.replace("   25    4    2", "   25    4    1")), "failure")
    assert len(figure.axes[1].patches) == 1


# Delamination threshold -------------------------------------------------------------------------


def test_force_draws_the_delamination_threshold_if_there_is_one(result: Result) -> None:
    tough, weak = (
        run(small(data=f"DELA\n{value}\n" + DATA_CARDS + "UNIT\nin lbf s\n"))
        for value in (4.0, 1.0)
    )
    figure = plot(tough, "force")
    assert legend_of(figure)[-1] == f"delamination threshold {tough.threshold['force']:.4g} lbf"
    line = figure.axes[0].get_lines()[-1]
    assert line.get_ydata() == pytest.approx([tough.threshold["force"]] * 2)
    figure = draw("force", {"none": result, "tough": tough, "weak": weak}).figure
    labels = [
        f"{name}: delamination threshold {one.threshold['force']:.4g} lbf"
        for name, one in (("tough", tough), ("weak", weak))
    ]
    assert legend_of(figure) == ["none", "tough", "weak", *labels]
    first, second = (lines(figure.axes[0])[label][1][0] for label in labels)
    assert first == pytest.approx(2.0 * second)  # the square root of G_IIc
    same = draw("force", {"none": result, "a": weak, "b": weak}).figure
    assert [text.partition(" thre")[0] for text in legend_of(same)] == [
        "none", "a", "b", "a, b: delamination"
    ]  # fmt: skip
    all_weak = draw("force", {"a": weak, "b": weak}).figure
    assert legend_of(all_weak)[2].startswith("delamination threshold")
    assert "delamination threshold" not in legend_of(plot(result, "force"))


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, "high", None])
def test_a_threshold_without_sense_is_refused(result: Result, value: Any) -> None:
    arrays = {path: result[path] for path in result}
    made = Result(arrays, {"deck": result.deck}, {"threshold": {"force": value}})
    with pytest.raises(PlotError, match="odd has a delamination threshold that can't be drawn"):
        draw("force", {"odd": made})


# What is missing --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", sorted(set(OF_RUNS) - {"mesh"}))
def test_a_picture_names_the_macro_that_stores_what_it_lacks(kind: str) -> None:
    result = run(small("LMAS\nDT        .5E-6\n"))
    stores = dict.fromkeys(("line", "contour", "surface", "animation"), "DISP")
    macro = {**stores, "thickness": "PLYS", "failure": "FAIL"}.get(kind, "RODP")
    with pytest.raises(PlotError, match=f"bare has no .*; add {macro} to"):
        draw(kind, {"bare": result})


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("line", {"times": (1.0,)}, "no displacements at time 1"),
        ("strain", {"at": ((9.0, 9.0),)}, "9,9 is not on the plate"),
        ("strain", {"gages": tuple(range(8)), "at": ((1.0, 1.0),)}, "fewer points"),
        ("picture", {}, "unknown kind of picture 'picture'"),
        ("force", {"colour": "red"}, "unknown option colour"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    result: Result, kind: str, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(PlotError, match=words):
        draw(kind, {"small": result}, **options)


def test_without_matplotlib_one_line_says_what_to_install(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError) as refused:
        result.plot()
    assert str(refused.value) == MISSING == "pictures need matplotlib: pip install 'fecm[plot]'"


# Files, open ends, names -------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_the_same_picture_has_the_same_bytes(result: Result, tmp_path: Path, suffix: str) -> None:
    written = []
    for name in ("a", "b"):
        path = tmp_path / f"{name}.{suffix}"
        save(draw("force", {"small": result}), path)
        written.append(path.read_bytes())
    assert written[0] == written[1]
    heads = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    assert written[0].startswith(heads[suffix])
    assert b"CreationDate" not in written[0]
    assert b"dc:date" not in written[0]


@pytest.mark.parametrize("kind", ["force", "loop", "energy"])
def test_pictures_of_a_contact_without_an_end_say_so(result: Result, kind: str) -> None:
    closed = run(small(data=DATA_CARDS + "UNIT\nin lbf s\n", program=LONG_PROGRAM))

    def marks(**results: Result) -> str:
        return draw(kind, results).figure.axes[0].get_title(loc="right")

    assert marks(a=result) == marks(a=result, b=result) == "still in contact at the end"
    assert marks(a=closed) == marks(a=closed, b=closed) == ""
    assert marks(a=closed, b=result) == "still in contact at the end (b)"


def test_units_and_names_are_shown_as_they_are(tmp_path: Path) -> None:
    names, file = [r"_a$x$", r"$\sqrt{$"], tmp_path / "small.h5"
    fecm.run(NAMED, output=file)
    with h5py.File(file, "r+") as stored:
        stored.attrs["unit_length"] = r"$\sqrt{$"
    result = fecm.load(file)
    for kind in ("loop", "energy", "line"):
        figure = draw(kind, dict.fromkeys(names, result)).figure
        save(Picture(figure), file.with_name("x.svg"))  # parses every text
        assert [text for text in legend_of(figure) if text in names] == names
        assert not any(text.get_parse_math() for text in figure.legends[0].get_texts())
    (axes,) = draw("mesh", {"a": result}).figure.axes
    assert axes.get_xlabel() == r"$x$ (\$\sqrt{\$)"
