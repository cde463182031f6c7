"""The picture of a located impact: what it shows, and what it does not."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.location.location import Candidate
from fecm.plot.kinds import PlotError
from fecm.plot.location import location_picture
from fecm.plot.pictures import draw
from tests.calls import call
from tests.decks import DATA_CARDS, model, small
from tests.pictures import legend_of_axes, lines, run

pytest.importorskip("matplotlib")

GAGES = "GAGE\n1, 0.5, 0.5, .053, 0.\n4, 1.5, 0.5, .053, 90.\n\n"


def located(**others: Any) -> fecm.Location:
    """A located impact on the small plate."""
    time = np.arange(1.0, 6.0)
    values: dict[str, Any] = {
        "deck": model(small(data="UNIT\nin lbf s\n" + DATA_CARDS + GAGES)),
        "x": 1.5,
        "y": 1.2,
        "covariance": np.array([[4e-4, 1e-4], [1e-4, 1e-4]]),
        "candidates": np.array([[0.5, 0.5], [1.5, 1.0], [1.0, 1.5]]),
        "candidate_misfit": np.array([4.0, 1.0, 2.0]),
        "second": None,
        "gages": np.array([1, 4], np.int32),
        "gage_places": np.array([[0.5, 0.5], [1.5, 0.5]]),
        "time": time,
        "force": np.array([1.0, 3.0, 2.0, 0.0, 3828.0]),
        "force_sd": np.array([0.1, 0.1, 0.2, 0.4, 4000.0]),
        "determined": np.array([True, True, True, True, False]),
        "determined_until": 4.0,
        "peak_force": 3.0,
        "time_of_peak": 2.0,
        "contact_end": 4.0,
        "impulse": 6.0,
        "mass": None,
        "noise": 1e-7,
        "noise_given": False,
        "misfit": 1.0,
        "strain_time": time,
        "strains": np.array([time, -time]) * 1e-6,
        "fitted": np.array([time, -time]) * 1.1e-6,
        "shift": 0.0,
        "sd_shift": 0.0,
        "gains": np.ones(2),
        "sd_gains": np.zeros(2),
        "notes": (),
        "accepted": True,
    }
    return fecm.Location(**values | others)


def axes_of(location: fecm.Location) -> dict[str, Any]:
    """Axes of the picture by names, in the order in which they are made."""
    figure = location_picture(location).figure
    names = ("map", "zoom", "gage 1", "gage 4", "bar", "force")
    return dict(zip(names, figure.axes, strict=True))


@cache
def usual() -> dict[str, Any]:
    """Axes of the usual location; left alone."""
    return axes_of(located())


def test_a_force_that_is_not_determined_is_no_line_but_an_area_with_words() -> None:
    axes = usual()["force"]
    time, force = lines(axes)["fitted force"]
    np.testing.assert_array_equal(time, np.arange(6.0))
    np.testing.assert_array_equal(force, [0.0, 1.0, 3.0, 2.0, 0.0, np.nan])
    assert axes.get_ylim()[1] < 10.0
    assert "not determined by these strains" in legend_of_axes(axes)
    known = located(determined=np.ones(5, bool), determined_until=5.0)
    assert "not determined by these strains" not in legend_of_axes(axes_of(known)["force"])


def test_the_band_of_the_force_is_two_standard_deviations_wide() -> None:
    (band,) = [
        one for one in usual()["force"].collections if one.get_label() == "± 2 standard deviations"
    ]
    corners = band.get_paths()[0].vertices
    at_three = corners[corners[:, 0] == 3.0][:, 1]
    np.testing.assert_allclose([at_three.min(), at_three.max()], [1.6, 2.4])


def test_gages_are_lines_in_their_directions_at_their_places_with_their_numbers() -> None:
    axes = usual()["map"]
    first, fourth = (np.array(line.get_data()) for line in axes.get_lines()[:2])
    np.testing.assert_allclose(first, [[0.45, 0.55], [0.5, 0.5]])
    np.testing.assert_allclose(fourth, [[1.5, 1.5], [0.45, 0.55]])
    assert [text.get_text() for text in axes.texts] == ["1", "4"]


def test_the_second_panel_shows_the_ellipse_from_the_place_found() -> None:
    location = located()
    axes = axes_of(location)["zoom"]
    drawn = np.array(axes.get_lines()[0].get_data()).T
    np.testing.assert_allclose(drawn, location.ellipse() - [1.5, 1.2])
    assert np.abs(drawn).max() < axes.get_xlim()[1]
    assert axes.get_xlabel() == "$x$ from the place found (in)"


def test_a_second_place_is_shown_with_its_misfit_if_there_is_one() -> None:
    assert legend_of_axes(usual()["map"]) == ["place found"]
    second = Candidate(0.5, 1.2, 1.07)
    axes = axes_of(located(second=second))["map"]
    text = "second place, misfit × 1.07"
    assert legend_of_axes(axes) == ["place found", text]
    np.testing.assert_array_equal(lines(axes)[text], [[0.5], [1.2]])


def test_each_gage_has_a_graph_of_its_own_and_all_have_the_same_range() -> None:
    actual = usual()
    for name, values in (("gage 1", 1e-6), ("gage 4", -1e-6)):
        axes = actual[name]
        assert axes.get_title(loc="left") == name
        np.testing.assert_allclose(lines(axes)["measured"][1], values * np.arange(1.0, 6.0))
        np.testing.assert_allclose(lines(axes)["fitted"][1], 1.1 * values * np.arange(1.0, 6.0))
    assert actual["gage 1"].get_ylim() == actual["gage 4"].get_ylim()
    assert actual["gage 1"].get_ylabel() == "Strain (10⁻⁶)"


def test_the_outline_has_the_sides_of_the_plate_and_none_inside() -> None:
    sides = usual()["map"].collections[0].get_segments()
    middles = {tuple(side.mean(axis=0)) for side in sides}
    assert middles == {(x, y) for x in (0.5, 1.5) for y in (0.0, 2.0)} | {
        (x, y) for x in (0.0, 2.0) for y in (0.5, 1.5)
    }


def test_of_many_gages_twelve_are_drawn_and_a_note_says_so() -> None:
    count = 14
    cards = "".join(f"{n}, {0.1 * n:.1f}, 0.5, .053, 0.\n" for n in range(1, count + 1))
    many = located(
        deck=model(small(data=f"{DATA_CARDS}GAGE\n{cards}\n")),
        gages=np.arange(1, count + 1, dtype=np.int32),
        gage_places=np.array([[0.1 * n, 0.5] for n in range(1, count + 1)]),
        strains=np.tile(np.arange(5.0), (count, 1)),
        fitted=np.tile(np.arange(5.0), (count, 1)),
    )
    picture = location_picture(many)
    assert list(picture.notes) == ["the strains of 12 of 14 gages are drawn"]
    titles = [axes.get_title(loc="left") for axes in picture.figure.axes]
    assert [title for title in titles if title.startswith("gage")] == [
        f"gage {n}" for n in range(1, 13)
    ]


def test_kinds_of_runs_and_of_locations_do_not_show_each_other() -> None:
    with pytest.raises(PlotError, match=r"a located impact, which .* force can't .* location does"):
        draw("force", {"it": located()})
    with pytest.raises(PlotError, match=r"result of a run, which the kind location can't .* loop"):
        draw("location", {"it": run(small())})


def test_the_command_draws_the_file_as_the_method_draws_the_location(tmp_path: Path) -> None:
    location = located()
    location.save(tmp_path / "located.h5")
    location.plot(tmp_path / "own.png")
    done = call("plot", "located.h5", cwd=tmp_path)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "located-location.png\n", "")
    drawn = tmp_path / "located-location.png"
    assert drawn.read_bytes() == (tmp_path / "own.png").read_bytes()
