"""Pictures in Python: figures of pyplot, given axes, the user's style, measured data."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import fecm
from fecm.plot.kinds import KINDS, PlotError, Shows
from fecm.plot.pictures import draw
from fecm.results.pictures import RunKind, SweepKind
from tests.calls import call
from tests.decks import APPENDIX, DATA_CARDS, PROGRAM, small
from tests.pictures import OF_RUNS

matplotlib = pytest.importorskip("matplotlib")
pyplot = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    """No figures of pyplot before and after a test."""
    pyplot.close("all")
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def result() -> fecm.Result:
    """The small plate in in, lbf and s."""
    return fecm.run_one(small(data=DATA_CARDS + "UNIT\nin lbf s\n"))


@pytest.fixture(scope="module")
def sweep() -> fecm.SweepResult:
    """Velocity by k."""
    program = PROGRAM.replace("LOOP         10", "LOOP        800")
    return fecm.sweep(small(program), {"velocity": [50.0, 100.0], "k": [1e6, 2e6]})


def test_a_picture_is_the_current_figure_of_pyplot_and_its_first_axes_are_returned(
    result: fecm.Result,
) -> None:
    axes = result.plot("force")
    assert pyplot.get_fignums() == [1]
    assert (pyplot.gcf(), pyplot.gca()) == (axes.figure, axes)
    several = result.plot("contour")
    assert several is pyplot.figure(2).axes[0]


def test_measured_numbers_drawn_on_the_axes_lie_on_the_curve(result: fecm.Result) -> None:
    axes = result.plot("force")
    line = axes.get_lines()[0]
    np.testing.assert_array_equal(line.get_xdata(), result.time)
    np.testing.assert_array_equal(line.get_ydata(), result.force)
    assert axes.get_xlabel() == "Time (µs)"


def test_pictures_are_drawn_on_given_axes_and_nowhere_else(
    result: fecm.Result, sweep: fecm.SweepResult
) -> None:
    figure, (left, right) = pyplot.subplots(1, 2)
    (measured,) = left.plot([0.0, 5e-6], [0.0, 1.0])
    assert result.plot("force", ax=left) is left
    drawn: Any = left.get_legend()
    assert [text.get_text() for text in drawn.get_texts()] == ["contact force", "transducer"]
    colours = [line.get_color() for line in left.get_lines()]
    assert len(set(colours)) == 3
    assert colours[0] == measured.get_color()
    assert sweep.plot(ax=right) is right
    assert not figure.legends
    assert pyplot.get_fignums() == [1]
    solid = pyplot.figure().add_subplot(projection="3d")
    assert result.plot("surface", ax=solid) is solid


@pytest.mark.parametrize(
    ("kind", "words"),
    [("contour", "has 4 axes and can't be drawn on one"), ("surface", "'projection': '3d'")],
)
def test_pictures_that_do_not_fit_the_axes_are_refused(
    result: fecm.Result, kind: RunKind, words: str
) -> None:
    with pytest.raises(PlotError, match=words):
        result.plot(
            kind,
            ax=pyplot.subplots()[1],
            times=(2.5e-6, 5e-6, 5e-6, 5e-6) if kind == "contour" else (),
        )
    with pytest.raises(PlotError, match="path or ax, not both"):
        result.plot("force", "x.png", ax=pyplot.gca())
    with pytest.raises(PlotError, match="three-dimensional"):
        result.plot("force", ax=pyplot.figure().add_subplot(projection="3d"))


def test_a_refused_picture_leaves_no_empty_figure(
    result: fecm.Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fecm.plot.style.lines_legend", lambda *_: 1 / 0)
    with pytest.raises(PlotError, match="can't be drawn: ZeroDivisionError"):
        result.plot("force")
    assert not pyplot.get_fignums()


def test_the_users_style_holds_where_it_differs_from_that_of_matplotlib(
    result: fecm.Result,
) -> None:
    by_name = {"lines.linewidth": 3.5, "axes.prop_cycle": matplotlib.cycler(color=["red", "lime"])}
    with matplotlib.rc_context(by_name):
        lines = result.plot("force").get_lines()
        assert [(line.get_linewidth(), line.get_color()) for line in lines] == [
            (3.5, "red"),
            (3.5, "lime"),
        ]
        picture = draw("force", {"a": result}).figure
        assert picture.axes[0].get_lines()[0].get_linewidth() == 0.9
    assert result.plot("force").get_lines()[0].get_linewidth() == 0.9
    given = result.plot("force", ax=pyplot.subplots()[1])
    assert given.get_lines()[0].get_linewidth() == matplotlib.rcParamsDefault["lines.linewidth"]
    assert given.spines["top"].get_visible()


def test_a_file_is_that_of_the_command_line_whatever_the_users_style(
    result: fecm.Result, tmp_path: Path
) -> None:
    fecm.run(small(data=DATA_CARDS + "UNIT\nin lbf s\n"), output=tmp_path / "a.h5")
    assert call("plot", tmp_path / "a.h5", "-o", tmp_path / "a.svg").exit_code == 0
    with matplotlib.rc_context({"lines.linewidth": 3.5}):
        result.plot("force", tmp_path / "b.svg")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert not pyplot.get_fignums()


def test_the_kinds_for_type_checkers_are_those_of_results() -> None:
    assert list(get_args(RunKind)) == OF_RUNS
    of_sweeps = [name for name, kind in KINDS.items() if kind.shows is Shows.SWEEP]
    assert list(get_args(SweepKind)) == of_sweeps


def test_a_warning_of_a_picture_is_one_of_the_users_line(sweep: fecm.SweepResult) -> None:
    with pytest.warns(fecm.FecmWarning, match="level 1e.09 is outside") as caught:
        sweep.plot(level=[1e9])
    assert {warning.filename for warning in caught} == {__file__}


def test_a_quantity_in_place_of_the_kind_is_answered_with_its_keyword(
    sweep: fecm.SweepResult,
) -> None:
    name: Any = "max_indentation"
    with pytest.raises(ValueError, match="give quantity='max_indentation'"):
        sweep.plot(name)
    axes = sweep.plot(quantity=name, over="velocity", where={"k": 1e6})
    assert axes.get_ylabel().startswith("Largest indentation")


def test_transducers_of_rigid_masses_are_not_drawn_again() -> None:
    rigid = fecm.run_one(small(data=DATA_CARDS + "PROJ\n0, 0, 2.E-4\n\n"))
    axes: Any = rigid.plot()
    assert [line.get_label() for line in axes.get_lines()] == ["contact force"]
    rod = fecm.run_one(small())
    for others, labels in (
        ({"other": rigid}, ["Contact force"]),
        ({"rod": rod}, ["Contact force", "Transducer"]),
    ):
        figure = draw("force", {"rigid": rigid, **others}).figure
        assert [axes.get_ylabel() for axes in figure.axes] == labels


def test_what_a_notebook_shows_of_an_object_is_short_and_escaped(
    result: fecm.Result, sweep: fecm.SweepResult
) -> None:
    deck = fecm.read_one(APPENDIX.read_text().replace("**LOW", "<b>LOW"))
    bare = fecm.run_one(small("LMAS\nDT        .5E-6\n"))
    checked, difference = fecm.check(deck), fecm.diff(result, result)
    shown: list[Any] = [result, result.tape3, sweep, deck, bare, checked, difference]
    for one in shown:
        assert len(repr(one)) < 200
        assert "\n" not in repr(one)
        assert repr(one).startswith("<")
        assert len(one._repr_html_()) < 4000
    assert "peak force" in shown[0]._repr_html_()
    assert "&lt;b&gt;LOW" in shown[3]._repr_html_()
    assert "<b>" not in shown[3]._repr_html_()
    assert repr(sweep) == "<fecm sweep 'small plate' over velocity, k: 4 cases: all ok>"


def test_a_notebook_shows_plates_laminates_and_estimates_as_tables() -> None:
    laminate = fecm.Laminate("[0/90]s", "AS4/8552", 0.13)._repr_html_()
    cell = "</th><td style='text-align:left'>"
    assert f">in-plane Ex, Ey, Gxy{cell}72699, 72699, 5300 N/mm^2<" in laminate
    assert f">B11, B22, B66, B12, B16, B26{cell}0, 0, 0, 0, 0, 0 N<" in laminate
    assert "`ply` is None" in fecm.Laminate("[0/90]s")._repr_html_()
    assert f">mesh{cell}(20, 12)<" in fecm.Plate.on_fixture("D7136")._repr_html_()
    path = fecm.examples.path("impact-patch")
    assert f">run{cell}85.01 lbf" in fecm.estimate(path)._repr_html_()
    assert f">nodes{cell}609<" in fecm.check(path)._repr_html_()
    slower = fecm.read_one(small()).with_(velocity=1.0)
    assert (
        ">history/force</th>"
        in fecm.diff(fecm.run_one(small()), fecm.run_one(slower))._repr_html_()
    )


NOTEBOOK = """
import fecm
r = fecm.run_one("small.inp")
---
r.plot()
---
r.plot("contour")
---
r
---
r.plot("nonsense")
"""


@pytest.mark.long
def test_a_cell_that_plots_shows_exactly_one_picture(tmp_path: Path) -> None:
    nbclient, nbformat = (pytest.importorskip(name) for name in ("nbclient", "nbformat"))
    (tmp_path / "small.inp").write_text(small())
    cells = [nbformat.v4.new_code_cell(text) for text in NOTEBOOK.split("---")]
    book = nbformat.v4.new_notebook(cells=cells)
    client = nbclient.NotebookClient(
        book, kernel_name="python3", allow_errors=True, resources={"metadata": {"path": tmp_path}}
    )
    client.execute()
    _, force, contour, shown, refused = (cell.outputs for cell in book.cells)
    for outputs in (force, contour):
        assert sum("image/png" in out.get("data", {}) for out in outputs) == 1
        texts = [out.data["text/plain"] for out in outputs if "data" in out]
        assert all(len(text) < 200 for text in texts)
    assert "<table>" in shown[0].data["text/html"]
    assert [out.output_type for out in refused] == ["error"]
