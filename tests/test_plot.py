"""Pictures: their lines are the result's numbers, their axes have units, and a run draws none."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fecm
from fecm import Result
from fecm._errors import FecmWarning
from fecm._typing import Array
from fecm.plot.data import patches, strain_points
from fecm.plot.kinds import MISSING, Picture, PlotError
from fecm.plot.mesh import Support, support_masks
from fecm.plot.pictures import draw, draw_entitled, save_picture
from fecm.plot.plate import profile
from fecm.plot.style import COLOURS, scale
from tests.builders import distorted_square
from tests.decks import DATA_CARDS, DISC, MESH, small
from tests.pictures import LONG_PROGRAM, NAMED, OF_RUNS, legend_of, lines, plot, run, ticks

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def result() -> Result:
    """The small plate in in, lbf and s."""
    return run(NAMED)


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
    listing = fecm.run_one(NAMED, mode="listing")
    both = {"report": result, "listing": listing}
    figure = draw("force", both).figure
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "Contact force (lbf)",
        "Transducer (lbf)",
    ]
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


def test_only_a_rod_has_strain_energy_and_only_a_mass_shows_its_displacement(
    result: Result,
) -> None:
    mass = run(NAMED.replace("EXPE", "PROJ\n    0    0    2.0E-4\n\nEXPE"))
    assert "projectile, strain" in legend_of(plot(result, "energy"))
    figure = plot(mass, "energy")
    names = ["plate, kinetic", "plate, strain", "projectile", "indentation", "sum"]
    assert legend_of(figure) == names
    drawn = figure.axes[0].get_lines()
    total = np.asarray(drawn[-1].get_ydata())
    np.testing.assert_allclose(total, np.sum([one.get_ydata() for one in drawn[:-1]], axis=0))
    (axes,) = plot(mass, "loop").axes
    assert axes.get_xlabel() == "Displacement of the projectile (10⁻⁶ in)"
    assert plot(result, "loop").axes[0].get_xlabel() == "Indentation (10⁻⁶ in)"
    both = draw("loop", {"rod": result, "mass": mass}).figure
    assert both.axes[0].get_xlabel() == "Indentation (10⁻⁶ in)"


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
    deck = result.deck_text.replace("   13    3", f"{node:5d}    3")
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
    built = Result({"mesh/coordinates": coordinates, "mesh/elements": elements}, {}, {})
    cut = patches(built, 3)
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
        one = Result(arrays, {"deck": one.deck_text}, groups)
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
    with pytest.warns(FecmWarning, match="bending strains only"):
        (axes,) = plot(run(small(mesh=free)), "strain", at=((1.0, 1.0),)).axes
    assert axes.get_ylabel().startswith("Bending strain, far face")


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
    kinds = {name: np.flatnonzero(nodes) + 1 for name, nodes in support_masks(result).items()}
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
    kinds = support_masks(Result(arrays, {}, {}))
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


def test_the_legend_of_the_mesh_names_the_circle_of_the_patch() -> None:
    figure = plot(run(small(data=DISC + DATA_CARDS)), "mesh")
    assert legend_of(figure)[-2:] == ["impact", "contact patch"]


@pytest.mark.parametrize(("kind", "count"), [("line", 6), ("contour", 4)])
def test_times_are_chosen_before_the_contact_ends_and_at_equal_distances(
    result: Result, kind: str, count: int
) -> None:
    closed = run(small(program=LONG_PROGRAM.replace("330", "600")))
    touching = closed.time[closed.force > 0.0]
    assert touching[-1] < 0.9 * closed.time[-1]
    figure = plot(closed, kind)
    texts = legend_of(figure) if kind == "line" else [a.get_title("left") for a in figure.axes[:-1]]
    shown = 1e-6 * np.array([float(text.split()[1 if kind == "contour" else 0]) for text in texts])
    expected = touching[-1] * np.arange(1, count + 1) / (count + 1)
    np.testing.assert_allclose(shown, expected, atol=1.01 * 5 * 0.5e-6)  # a row every 5 steps
    texts = [a.get_title("left") for a in plot(result, "contour").axes[:-1]]
    assert texts == ["time 2.5 µs", "time 5 µs"]  # both rows, as the contact goes on


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


# Delamination threshold -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["force", "contour", "surface"])
def test_in_files_a_picture_of_one_result_has_the_title_of_its_deck_above_all_else(
    result: Result, kind: str
) -> None:
    figure = draw_entitled(kind, {"a": result}).figure
    figure.draw_without_rendering()
    (title,) = [text for text in figure.texts if text.get_text() == result.title]
    below = title.get_window_extent().y0
    others = [part.get_tightbbox() for part in (*figure.legends, *figure.axes)]
    assert title.get_window_extent().y1 <= figure.bbox.y1
    assert all(box is not None and box.y1 <= below for box in others)
    assert not draw_entitled("force", {"a": result, "b": result}).figure.texts


def test_force_draws_the_delamination_threshold_if_there_is_one(result: Result) -> None:
    tough, weak = (
        run(small(data=f"DELA\n{value}\n" + DATA_CARDS + "UNIT\nin lbf s\n"))
        for value in (4.0, 1.0)
    )
    figure = plot(tough, "force")
    assert (
        legend_of(figure)[-1]
        == f"delamination at the latest from {tough.threshold['force']:.4g} lbf"
    )
    line = figure.axes[0].get_lines()[-1]
    assert line.get_ydata() == pytest.approx([tough.threshold["force"]] * 2)
    figure = draw("force", {"none": result, "tough": tough, "weak": weak}).figure
    labels = [
        f"{name}: delamination at the latest from {one.threshold['force']:.4g} lbf"
        for name, one in (("tough", tough), ("weak", weak))
    ]
    assert legend_of(figure) == ["none", "tough", "weak", *labels]
    first, second = (lines(figure.axes[0])[label][1][0] for label in labels)
    assert first == pytest.approx(2.0 * second)  # the square root of G_IIc
    same = draw("force", {"none": result, "a": weak, "b": weak}).figure
    assert [text.partition(" at the")[0] for text in legend_of(same)] == [
        "none",
        "a",
        "b",
        "a, b: delamination",
    ]
    all_weak = draw("force", {"a": weak, "b": weak}).figure
    assert legend_of(all_weak)[2].startswith("delamination at the latest from")
    assert not any("delamination" in text for text in legend_of(plot(result, "force")))


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, "high", None])
def test_a_threshold_without_sense_is_refused(result: Result, value: Any) -> None:
    arrays = {path: result[path] for path in result}
    built = Result(arrays, {"deck": result.deck_text}, {"threshold": {"force": value}})
    with pytest.raises(PlotError, match="odd has a delamination threshold that can't be drawn"):
        draw("force", {"odd": built})


# What is missing --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", sorted(set(OF_RUNS) - {"mesh"}))
def test_a_picture_names_the_macro_that_stores_what_it_lacks(kind: str) -> None:
    result = run(small("LMAS\nDT        .5E-6\n"))
    stores = dict.fromkeys(("line", "contour", "surface", "animation"), "DISP")
    macro = {**stores, "thickness": "PLYS", "failure": "FAIL", "modes": "EIGE"}.get(kind, "RODP")
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
def test_the_same_picture_has_the_same_bytes(
    result: Result, tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = []
    for name, date in (("a", "0"), ("b", "x")):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", date)
        path = tmp_path / f"{name}.{suffix}"
        save_picture(draw("force", {"small": result}), path)
        written.append(path.read_bytes())
    assert written[0] == written[1]
    heads = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    assert written[0].startswith(heads[suffix])
    assert b"CreationDate" not in written[0]
    assert b"dc:date" not in written[0]


@pytest.mark.parametrize("kind", ["force", "loop", "energy"])
@pytest.mark.few(1)  # of 3, 0.1 s each
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
        save_picture(Picture(figure), file.with_name("x.svg"))  # parses every text
        assert [text for text in legend_of(figure) if text in names] == names
        assert not any(text.get_parse_math() for text in figure.legends[0].get_texts())
    (axes,) = draw("mesh", {"a": result}).figure.axes
    assert axes.get_xlabel() == r"$x$ (\$\sqrt{\$)"
