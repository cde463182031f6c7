"""Maps of sweeps: what is drawn is the summary, in units, with gaps where cases failed."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm import SweepResult
from fecm._errors import FecmWarning
from fecm.plot.kinds import PlotError
from fecm.plot.pictures import draw
from fecm.sweeps.files import save_sweep
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, PROGRAM, small
from tests.pictures import OF_RUNS, footer_of

Floats = NDArray[np.float64]

pytest.importorskip("matplotlib")

STEPS = PROGRAM.replace("LOOP         10", "LOOP        800")
NAMED = small(STEPS, data=DATA_CARDS + "UNIT\nin lbf s\n")
VELOCITIES = [150.0, 50.0, 100.0]
STIFFNESSES = [1e6, 2e6, 4e6, 3e6]
# The contact at 50 in/s ends after 325 steps, those at 100 and 150 after 316 and 311.
LONG_ENOUGH_FOR_TWO = small(PROGRAM.replace("LOOP         10", "LOOP        320"))
LAYUPS = ["[0/90]", "[0/45]", "[30/-30]"]


@pytest.fixture(scope="module")
def plane() -> SweepResult:
    """Velocity by k, neither in rising order."""
    return fecm.sweep(NAMED, {"velocity": VELOCITIES, "k": STIFFNESSES})


@pytest.fixture(scope="module")
def layups() -> SweepResult:
    """Velocity by layup, of which one can't be read."""
    return fecm.sweep(NAMED, {"layup": [*LAYUPS, "[0/"], "velocity": VELOCITIES})


@pytest.fixture
def file(plane: SweepResult, tmp_path: Path) -> Path:
    """The plane's file."""
    save_sweep(plane, tmp_path / "plane.h5")
    return tmp_path / "plane.h5"


def some_failed(sweep: SweepResult, *cases: int) -> SweepResult:
    """The same sweep with failed cases."""
    summary = {name: values.copy() for name, values in sweep.summary.items()}
    summary["status"] = summary["status"].astype("U40")
    for case in cases:
        for name, values in summary.items():
            texts = {"status": "it went wrong", "validity": "failed"}
            values[case] = texts.get(name, np.nan)
    return SweepResult(sweep.cases, summary, sweep.dt, sweep.steps, units=sweep.units)


def plot(
    sweep: SweepResult,
    quantity: str = "peak_force",
    over: str | tuple[str, ...] = (),
    **options: Any,
) -> Any:
    """The command line's map of a sweep."""
    names = (over,) if isinstance(over, str) else over
    return draw("map", {"the sweep": sweep}, quantity=quantity, over=names, **options).figure


def mesh_of(figure: Any) -> Any:
    """The cells of a map."""
    return figure.axes[0].collections[0]


def data_of(line: Any) -> tuple[Floats, Floats]:
    """What a line goes through."""
    x, y = line.get_data()
    return np.asarray(x), np.asarray(y)


# Two values --------------------------------------------------------------------------------------


def test_a_full_grid_is_a_cell_a_case_in_rising_order(plane: SweepResult) -> None:
    figure = plot(plane)
    axes, bar = figure.axes
    assert axes.get_xlabel() == "Impact velocity (in/s)"
    assert axes.get_ylabel() == "Contact coefficient $k$ (10⁶ lbf/in$^{1.5}$)"
    assert bar.get_xlabel() == "Peak force (lbf)"
    drawn = mesh_of(figure).get_array()
    assert drawn.shape == (4, 3)
    for velocity, k, force in zip(plane["velocity"], plane["k"], plane["peak_force"], strict=True):
        row, column = sorted(STIFFNESSES).index(k), sorted(VELOCITIES).index(velocity)
        assert drawn[row, column] == force
    corners = mesh_of(figure).get_coordinates()
    np.testing.assert_allclose(corners[0, :, 0], [25.0, 75.0, 125.0, 175.0])
    np.testing.assert_allclose(corners[:, 0, 1], [0.5e6, 1.5e6, 2.5e6, 3.5e6, 4.5e6])


def test_lines_of_equal_value_are_labelled_and_lie_where_the_values_are(
    plane: SweepResult,
) -> None:
    level = 0.5 * float(plane["peak_force"].min() + plane["peak_force"].max())
    figure = plot(plane, level=(level,))
    marked: Any = figure.axes[0].collections[-1]
    np.testing.assert_allclose(marked.levels, [level])
    (path,) = [p for p in marked.get_paths() if len(p.vertices)]
    # On the grid's own line of k = 2e6, between the velocities, the value is linear.
    at = float(np.interp(2e6, *path.vertices[np.argsort(path.vertices[:, 1])].T[::-1]))
    fixed = plane["k"] == 2e6
    order = np.argsort(plane["velocity"][fixed])
    expected = np.interp(level, plane["peak_force"][fixed][order], plane["velocity"][fixed][order])
    assert at == pytest.approx(float(expected), rel=1e-6)
    assert figure.axes[0].texts  # numbers on the lines


TOUGH = NAMED.replace("EXPE", "DELA\n.2,\nEXPE")


def test_a_threshold_of_all_cases_is_a_level_of_peak_forces_only() -> None:
    sweep = fecm.sweep(TOUGH, {"velocity": [20.0, 200.0], "k": [1e6, 3e6]})
    (force,) = set(sweep["threshold_force"])
    assert sweep["peak_force"].min() < force < sweep["peak_force"].max()
    marked: Any = plot(sweep).axes[0].collections[-1]
    np.testing.assert_allclose(marked.levels, [force])
    impulse = plot(sweep, "impulse")
    assert len(impulse.axes[0].collections) == 2  # cells and lines
    assert not impulse.legends


def legend_of(figure: Any) -> list[str]:
    """Texts of a figure's legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_legend_names_thresholds_and_levels_with_their_values() -> None:
    sweep = fecm.sweep(TOUGH, {"velocity": [20.0, 200.0], "k": [1e6, 3e6]})
    force = sweep["threshold_force"][0]
    named = f"delamination at the latest from {force:.4g} lbf"
    assert legend_of(plot(sweep)) == [named]
    row = plot(sweep, over="velocity", where={"k": 1e6}, level=(50.0,))
    assert legend_of(row) == ["level 50 lbf", named]


def test_a_threshold_that_no_case_reaches_is_told_as_such() -> None:
    sweep = fecm.sweep(TOUGH, {"velocity": [20.0, 25.0], "k": [1e6, 3e6]})
    force = sweep["threshold_force"][0]
    assert sweep["peak_force"].max() < force
    with warnings.catch_warnings(action="error"):  # nobody has asked for this level
        picture = draw("map", {"the sweep": sweep})
    below = f"all values of peak_force are below the delamination threshold {force:.4g} lbf"
    assert picture.notes == [below]
    row: Any = draw("map", {"the sweep": sweep}, over=("velocity",), where={"k": 1e6}).figure
    assert row.axes[0].get_ylim()[1] > force


def test_markers_of_the_largest_values_are_not_cut(plane: SweepResult) -> None:
    values = {"peak_force": np.array([10.0, 9.9, 9.8])}
    summary = {name: column[:3] for name, column in plane.summary.items()} | values
    cases = {"velocity": np.array([50.0, 100.0, 150.0])}
    sweep = SweepResult(cases, summary, plane.dt[:3], plane.steps[:3], units=plane.units)
    assert plot(sweep).axes[0].get_ylim() == (0.0, pytest.approx(10.5))


def test_thresholds_of_different_plates_are_drawn_case_by_case() -> None:
    layups = ["[0/90]", "[0/0]"]
    sweep = fecm.sweep(TOUGH, {"layup": layups, "velocity": [20.0, 200.0]})
    lines = plot(sweep).axes[0].get_lines()
    limits = sweep["threshold_force"].reshape(2, 2)
    assert limits[0, 0] != limits[1, 0]
    drawn = [line for line in lines if str(line.get_label()).startswith("_child")]
    for line, forces in zip(drawn, limits, strict=True):
        np.testing.assert_allclose(data_of(line)[1], forces)
    assert "delamination threshold" in [line.get_label() for line in lines]
    lower = sweep.summary | {"peak_force": 0.01 * sweep["peak_force"]}
    below = SweepResult(sweep.cases, lower, sweep.dt, sweep.steps, units=sweep.units)
    assert below["peak_force"].max() < limits.max() < plot(below).axes[0].get_ylim()[1]
    sweep = fecm.sweep(TOUGH, {"thickness": [0.1, 0.12], "velocity": [20.0, 200.0]})
    axes = plot(sweep).axes[0]
    low, high = (sweep["peak_force"] - sweep["threshold_force"]).reshape(2, 2).T
    share = low / (low - high)
    contour: Any = axes.collections[-1]
    (path,) = contour.get_paths()
    expected = [[0.1, 20.0 + 180.0 * share[0]], [0.12, 20.0 + 180.0 * share[1]]]
    actual = path.vertices[np.argsort(path.vertices[:, 0])][[0, -1]]
    np.testing.assert_allclose(actual, expected, rtol=1e-6)


def test_over_says_which_value_lies_across(plane: SweepResult) -> None:
    figure = plot(plane, over=("k", "velocity"))
    assert figure.axes[0].get_ylabel() == "Impact velocity (in/s)"
    np.testing.assert_array_equal(mesh_of(figure).get_array(), mesh_of(plot(plane)).get_array().T)


def test_failed_cases_are_gaps_and_told(plane: SweepResult) -> None:
    holed = some_failed(plane, 1, 6)
    with pytest.warns(FecmWarning, match=r"2 of 12 cases of .* failed \(it went wrong\)"):
        drawn = mesh_of(plot(holed)).get_array()
    at = {
        (sorted(STIFFNESSES).index(plane["k"][n]), sorted(VELOCITIES).index(plane["velocity"][n]))
        for n in (1, 6)
    }
    assert {tuple(map(int, place)) for place in np.argwhere(drawn.mask)} == at


def test_counts_have_a_colour_each_and_no_lines(plane: SweepResult) -> None:
    figure = plot(plane, "contacts")
    assert len(figure.axes[0].collections) == 1
    drawn = mesh_of(figure).get_array()
    assert sorted(drawn.ravel()) == sorted(plane["contacts"])
    assert figure.axes[1].get_xlabel() == "Contacts"


def test_cases_that_are_no_grid_are_coloured_points() -> None:
    cases = [{"velocity": v, "k": 1e6 + 1e4 * v} for v in (50.0, 80.0, 120.0)]
    sweep = fecm.sweep(NAMED, cases=cases)
    figure = plot(sweep, "max_indentation", level=(float(sweep["max_indentation"][1]),))
    points = mesh_of(figure)
    np.testing.assert_allclose(
        points.get_offsets(), np.column_stack([sweep["velocity"], sweep["k"]])
    )
    shown = points.get_array() / sweep["max_indentation"]
    np.testing.assert_allclose(shown, shown[0], rtol=1e-12)
    assert list(points.get_linewidths()) == [0.0, 0.9, 0.9]


def test_each_layup_is_a_curve(layups: SweepResult) -> None:
    with pytest.warns(FecmWarning, match="3 of 12 cases"):
        figure = plot(layups, level=(100.0,))
    (axes,) = figure.axes
    lines = {line.get_label(): line for line in axes.get_lines()}
    for layup in LAYUPS:
        here = layups["layup"] == layup
        x, y = data_of(lines[layup])
        assert x.tolist() == sorted(VELOCITIES)
        order = np.argsort(layups["velocity"][here])
        np.testing.assert_array_equal(y, layups["peak_force"][here][order])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [*LAYUPS, "level 100 lbf"]
    assert data_of(axes.get_lines()[-1])[1].tolist() == [100.0, 100.0]
    assert axes.get_ylabel() == "Peak force (lbf)"


def test_more_layups_than_colours_are_rows_that_show_where_they_pass_a_level() -> None:
    angles = [f"[{angle}/0]" for angle in range(0, 80, 10)]
    sweep = fecm.sweep(NAMED, {"layup": angles, "velocity": [50.0, 100.0]})
    first = sweep["peak_force"][:2]
    level = float(first.mean())
    figure = plot(sweep, level=(level,))
    axes = figure.axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == angles
    assert axes.yaxis.get_inverted()
    drawn = mesh_of(figure).get_array()
    np.testing.assert_array_equal(drawn, sweep["peak_force"].reshape(8, 2))
    mark: Any = axes.collections[1]
    ((ends),) = mark.get_segments()
    np.testing.assert_allclose(ends, [[75.0, -0.5], [75.0, 0.5]])


# One value ---------------------------------------------------------------------------------------


def test_one_value_is_a_line_with_a_gap_at_a_failed_case() -> None:
    sweep = some_failed(fecm.sweep(NAMED, {"velocity": [100.0, 50.0, 150.0]}), 0)
    with pytest.warns(FecmWarning, match="1 of 3 cases"):
        (axes,) = plot(sweep, "time_of_peak").axes
    (line,) = axes.get_lines()
    x, y = data_of(line)
    assert x.tolist() == [50.0, 100.0, 150.0]
    np.testing.assert_allclose(y, sweep["time_of_peak"][[1, 0, 2]], rtol=1e-12)
    assert np.isnan(y[1])
    assert (line.get_linestyle(), line.get_marker()) == ("-", "o")
    assert axes.get_ylabel() == "Time of peak (µs)"


def test_one_layup_a_row_with_a_point(layups: SweepResult) -> None:
    with pytest.warns(FecmWarning, match="1 of 4 cases"):
        (axes,) = plot(layups, "impulse", where={"velocity": 101.0}).axes
    assert [text.get_text() for text in axes.get_yticklabels()] == [*LAYUPS, "[0/"]
    assert axes.get_title(loc="left") == "velocity 100 in/s"
    x, y = data_of(axes.get_lines()[0])
    assert y.tolist() == [0, 1, 2, 3]
    here = layups["velocity"] == 100.0
    shown = x[:3] / layups["impulse"][here][:3]
    np.testing.assert_allclose(shown, shown[0], rtol=1e-12)
    assert "lbf·s" in axes.get_xlabel()


def test_points_have_colours_where_one_other_value_varies_too(plane: SweepResult) -> None:
    axes, bar = plot(plane, over="velocity").axes
    assert not axes.get_lines()
    points: Any = axes.collections[0]
    assert bar.get_xlabel() == "Contact coefficient $k$ (10⁶ lbf/in$^{1.5}$)"
    drawn = sorted(zip(*np.asarray(points.get_offsets()).T, points.get_array(), strict=True))
    cases = zip(plane["velocity"], plane["peak_force"], plane["k"], strict=True)
    np.testing.assert_allclose(drawn, sorted(cases))


def test_one_value_of_three_is_not_drawn_without_the_others() -> None:
    sweep = fecm.sweep(NAMED, {"velocity": [50.0, 60.0], "k": [1e6, 2e6], "q": [2.0, 2.5]})
    with pytest.raises(PlotError, match="k and q vary too"):
        plot(sweep, over="velocity")


@pytest.mark.parametrize(
    "vary", [{"velocity": VELOCITIES}, {"velocity": VELOCITIES, "k": [1.7e6, 2e6]}]
)
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_cases_still_in_contact_are_crossed_and_counted(vary: dict[str, list[float]]) -> None:
    sweep = fecm.sweep(LONG_ENOUGH_FOR_TWO, vary)
    count = int(sweep.still_in_contact.sum())
    assert 0 < count < len(sweep)
    with pytest.warns(FecmWarning, match=f"{count} of {len(sweep)} cases of .* still in contact"):
        figure = plot(sweep)
    cross = figure.axes[0].get_lines()[-1]
    assert cross.get_marker() == "x"
    assert data_of(cross)[0].tolist() == sweep["velocity"][sweep.still_in_contact].tolist()
    text = f"still in contact at the end: {count} of {len(sweep)} cases"
    assert footer_of(figure) == f"\N{MULTIPLICATION SIGN} {text}"
    with pytest.warns(FecmWarning, match="they have no value in the picture"):
        plot(sweep, "impulse")


WORDS = "beyond the linear plate and a few other limits of the model (w > 0.3 h)"


@pytest.fixture
def doubtful(plane: SweepResult, monkeypatch: pytest.MonkeyPatch) -> NDArray[np.bool_]:
    """Cases of the plane that a picture takes as beyond the range of the model."""
    fast = plane["velocity"] > 60.0
    monkeypatch.setattr("fecm.plot.maps.beyond", lambda _, rows: {WORDS: fast[rows]})
    return np.asarray(fast)


@pytest.mark.usefixtures("doubtful")
def test_the_line_of_doubtful_cases_begins_with_their_mark_and_is_not_cut(
    plane: SweepResult,
) -> None:
    figure = plot(plane, over="velocity", where={"k": 1e6})
    *_, marks = (line for line in figure.axes[0].get_lines() if line.get_marker() == "o")
    assert len(data_of(marks)[0]) == 2
    line = " ".join(footer_of(figure).split())
    assert line == f"\N{WHITE CIRCLE} {WORDS}: 2 of 3 cases"


def test_doubtful_cells_are_hatched_as_one_area_that_covers_them(
    plane: SweepResult, doubtful: NDArray[np.bool_]
) -> None:
    figure = plot(plane, over=("velocity", "k"))
    (area,) = figure.axes[0].patches
    assert area.get_hatch()
    cells = zip(plane["velocity"], plane["k"], strict=True)
    inside = [area.get_path().contains_point(cell) for cell in cells]
    assert inside == doubtful.tolist()
    # Four rows of k, 4e6 high with their halves at both ends, from 75 to 175 in/s.
    corners = np.asarray(area.get_path().vertices)
    assert (corners.min(axis=0).tolist(), corners.max(axis=0).tolist()) == (
        [75.0, 0.5e6],
        [175.0, 4.5e6],
    )
    assert " ".join(footer_of(figure).split()) == f"hatched: {WORDS}: 8 of 12 cases"


def test_a_map_over_mass_and_velocity_has_lines_of_equal_energy() -> None:
    sweep = fecm.sweep(NAMED, {"mass": [1e-4, 2e-4, 3e-4], "velocity": VELOCITIES})
    (axes, _) = plot(sweep).axes
    lines = next(c for c in axes.collections if getattr(c, "levels", None) is not None
                 and c.get_edgecolor()[0][:3].tolist() == [0.0, 0.0, 0.0])  # fmt: skip
    for level, path in zip(lines.levels, lines.get_paths(), strict=True):
        mass, velocity = np.asarray(path.vertices).T
        np.testing.assert_allclose(0.5 * mass * velocity**2, level, rtol=5e-3)
    assert "equal energy" in [line.get_label() for line in axes.get_lines()]


def test_lines_of_equal_energy_are_labelled_in_joules() -> None:
    deck = NAMED.replace("UNIT\nin lbf s", "UNIT\nmm N s")
    sweep = fecm.sweep(deck, {"mass": [1e-4, 2e-4, 3e-4], "velocity": [2e3, 4e3, 6e3]})
    (axes, _) = plot(sweep, "max_indentation").axes
    energies = [text.get_text() for text in axes.texts if text.get_text().endswith("J")]
    # 1/2 m v^2 in N*mm, up to 3.5e-4 and 7000 at the corner of the map: 8.575 J.
    assert energies == [f"{level:g} J" for level in (1.5, 3.0, 4.5, 6.0, 7.5)]


def test_a_quantity_that_no_case_has_yet_is_refused() -> None:
    sweep = fecm.sweep(small(), {"velocity": VELOCITIES})
    with pytest.raises(PlotError, match=r"3 of 3 cases .* still in contact at the end"):
        plot(sweep, "impulse")


def test_a_sweep_without_units_has_none_on_its_axes() -> None:
    (axes,) = plot(fecm.sweep(small(STEPS), {"velocity": [50.0, 100.0]})).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Impact velocity", "Peak force")


# What is refused ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"quantity": "zzz"}, "unknown quantity zzz; the sweep has peak_force, "),
        ({"quantity": "force"}, "unknown quantity force; did you mean peak_force"),
        ({"over": "q"}, "no parameter q; it has velocity and k"),
        ({"over": "velocity", "where": {"velocity": 50.0}}, "velocity does not vary"),
        ({"where": {"velocity": 50.0, "k": 1e6}}, "nothing varies"),
        ({"where": {"velocity": 500.0}}, "no velocity 500.0; its values range from 50 to 150"),
        ({"where": {"velocity": "fast"}}, "no velocity fast"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    plane: SweepResult, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(PlotError, match=words):
        plot(plane, **options)


def test_more_than_two_values_need_a_choice() -> None:
    sweep = fecm.sweep(NAMED, {"velocity": [50.0, 60.0], "k": [1e6, 2e6], "s_p": [0.1, 0.2]})
    with pytest.raises(
        PlotError, match="two axes, and velocity, k and s_p vary; choose with --over"
    ):
        plot(sweep)
    with pytest.raises(PlotError, match=r"s_p varies too, .*; --where s_p=VALUE selects"):
        plot(sweep, over=("velocity", "k"))
    figure = plot(sweep, over=("velocity", "k"), where={"s_p": 0.2})
    kept = sweep["s_p"] == 0.2
    drawn = mesh_of(figure).get_array()
    np.testing.assert_array_equal(drawn.T.ravel(), sweep["peak_force"][kept])
    assert figure.axes[0].get_title(loc="left") == "s_p 0.2"


def test_a_sweep_that_failed_whole_says_why(plane: SweepResult) -> None:
    with pytest.raises(PlotError, match=r"12 of 12 cases .* failed \(it went wrong\)"):
        plot(some_failed(plane, *range(12)))


def test_a_level_beyond_all_values_is_told(plane: SweepResult) -> None:
    with pytest.warns(FecmWarning, match="level 1e.06 is outside"):
        plot(plane, level=(1e6,))


@pytest.mark.parametrize("kind", OF_RUNS)
def test_kinds_of_runs_do_not_show_a_sweep(plane: SweepResult, kind: str) -> None:
    with pytest.raises(PlotError, match=f"plane is the result of a sweep, .* {kind} can't show"):
        draw(kind, {"plane": plane})


# The command -------------------------------------------------------------------------------------


def test_the_command_draws_a_map_without_being_asked_for_its_kind(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent)
    done = call("plot", "plane.h5")
    assert (done.exit_code, done.stdout, done.stderr) == (0, "plane-map.png\n", "")
    assert Path("plane-map.png").read_bytes().startswith(b"\x89PNG")
    done = call(
        "plot",
        "plane.h5",
        "--over",
        "velocity",
        "--where",
        "k=2e6",
        "--quantity",
        "impulse",
        "--level",
        "1e9",
        "-o",
        "line.svg",
    )
    assert (done.exit_code, done.stdout) == (0, "line.svg\n")
    assert done.stderr.startswith("fecm: note: the level 1e+09 is outside")
    assert done.stderr.count("\n") == 1


def test_a_command_notes_failed_cases(plane: SweepResult, tmp_path: Path) -> None:
    save_sweep(some_failed(plane, 3), tmp_path / "holed.h5")
    done = call("plot", tmp_path / "holed.h5", "-o", tmp_path / "map.png")
    assert done.exit_code == 0
    assert done.stderr == (
        "fecm: note: 1 of 12 cases of holed failed (it went wrong); they are gaps in the picture\n"
    )


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("plane.h5", ("--kind", "force"), "result of a sweep, which the kind force can't show"),
        ("run.h5", ("--kind", "map"), "result of a run, which the kind map can't show"),
        ("run.h5", ("--kind", "force", "--kind", "map"), "the kind map can't show"),
        ("plane.h5", ("copy/plane.h5",), "one result; 2 were given"),
        ("plane.h5", ("--over", "q"), "plane has no parameter q"),
        ("plane.h5", ("--quantity", "status"), "unknown quantity status"),
        ("deck.inp", ("--kind", "map"), "is a deck, not a result; `fecm run "),
    ],
)
@pytest.mark.few(3)  # of 7, 0.04 s each
def test_a_call_that_makes_no_map_is_refused_in_one_line(
    file: Path,
    runs: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    arguments: tuple[str, ...],
    words: str,
) -> None:
    monkeypatch.chdir(file.parent)
    shutil.copy(runs / "small.h5", "run.h5")
    Path("deck.inp").write_text(NAMED)
    Path("copy").mkdir()
    shutil.copy(file, "copy")
    done = call("plot", name, *arguments)
    assert_unusable(done)
    assert words in done.stderr
    assert not list(file.parent.glob("*.png"))


@pytest.mark.parametrize(
    "arguments",
    [("--over", "a,b,c"), ("--over", "a,"), ("--where", "k"), ("--where", "k=1", "--where", "k=2"),
     ("--level", "high"), ("--level", "nan")],
)  # fmt: skip
def test_an_option_of_the_wrong_form_is_refused(file: Path, arguments: tuple[str, ...]) -> None:
    done = call("plot", file, *arguments)
    assert done.exit_code == 2
    assert arguments[0] in done.stderr
    assert "Traceback" not in done.stderr
