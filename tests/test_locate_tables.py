"""Tables of strains, the command, and files of locations."""

from __future__ import annotations

import dataclasses
import json
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest

import fecm
from fecm._errors import ResultFileError, StudyError
from fecm.deck.units import unit_names
from fecm.location.table import strain_table
from fecm.results.groups import NotStoredError
from tests.calls import Done, call, record_of
from tests.decks import small
from tests.panels import OFF_AXIS, STRUCK, TIME, Floats, panel, scatter, struck, with_gages

NEAR = (40.0, 30.0, 80.0, 65.0)
# Few candidates, and the width of hats that a search for it ends with.
GRID, BASIS = 20.0, 9e-6
WIDTHS = ("--grid", GRID, "--basis", BASIS)
OPTIONS = ("--region", "40,30,80,65", *WIDTHS)


@cache
def deck() -> fecm.Deck:
    """The small panel."""
    return struck()[0]


@cache
def strains() -> Floats:
    """Strains with noise, (points, gages)."""
    return scatter(struck()[1], 0.02, seed=1)[0]


@cache
def run() -> fecm.Result:
    """The impact on the panel as a run."""
    return fecm.run_one(deck())


def located(table: object, **options: object) -> fecm.Location:
    """An impact near its place on the small panel."""
    near: dict[str, object] = {"region": NEAR, "grid": GRID, "basis": BASIS}
    return fecm.locate(deck(), table, **(near | options))  # type: ignore[arg-type]


@cache
def found() -> fecm.Location:
    """The impact of the small panel, by arrays."""
    return located((TIME, strains()), mass=2e-6)


def written(folder: Path, head: str, values: Floats, time: Floats = TIME) -> Path:
    """A CSV file of strains."""
    rows = [",".join(map(repr, row)) for row in np.column_stack([time, values]).tolist()]
    path = folder / "strains.csv"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


# Tables -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("head", "order"),
    [
        ("time,gage1,gage2,gage3", [0, 1, 2]),
        ("Time [s],3,2,1", [2, 1, 0]),
        ("time,left,right,top", [0, 1, 2]),  # in the order of the deck
    ],
)
def test_columns_of_a_file_are_matched_by_the_numbers_of_gages(
    tmp_path: Path, head: str, order: list[int]
) -> None:
    path = written(tmp_path, head, strains()[:, order])
    read = strain_table(path, unit_names(deck()), [1, 2, 3])
    assert read.gages.tolist() == [n + 1 for n in order]
    assert np.array_equal(read.strains, strains()[:, order].T)


@pytest.mark.long
def test_the_order_of_columns_leaves_the_place_where_it_is(tmp_path: Path) -> None:
    read = located(written(tmp_path, "time (s),gage 3,gage 1,gage 2", strains()[:, [2, 0, 1]]))
    assert read.gages.tolist() == [3, 1, 2]
    assert (read.x, read.y) == pytest.approx((found().x, found().y), abs=1e-6)


@pytest.mark.long
def test_some_of_the_gages_are_enough() -> None:
    table = {"time": TIME, "gage 3": strains()[:, 2], "gage 1": strains()[:, 0]}
    read = located(table, basis=None)  # the widths are searched for, too
    assert read.gages.tolist() == [3, 1]
    assert read.gage_places.tolist() == [[26.0, 64.0], [22.0, 18.0]]
    assert np.hypot(read.x - STRUCK[0], read.y - STRUCK[1]) < 1.0


def test_a_table_with_a_row_for_every_gage_and_time_is_read(tmp_path: Path) -> None:
    rows = [
        f"{step},{time!r},{gage},{value!r}"
        for step, (time, each) in enumerate(zip(TIME.tolist(), strains().tolist(), strict=True))
        for gage, value in enumerate(each, start=1)
    ]
    path = tmp_path / "long.csv"
    path.write_text("\n".join(["step,time (s),gage,strain", *rows]), encoding="utf-8")
    read = strain_table(path, unit_names(deck()), [1, 2, 3])
    assert read.gages.tolist() == [1, 2, 3]
    assert np.array_equal(read.strains, strains().T)
    assert np.array_equal(read.time, TIME)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ((TIME, 1e3 * np.ones((100, 3))), r"looks like microstrain \(0.001; divide by 1e\+06\)"),
        ((TIME, 0.3 * np.ones((100, 3))), "divide by 100.* or per mille .*divide by 1000"),
        ((TIME, 1e6 * np.ones((100, 3))), "strains are length over length"),
        ((TIME, np.full((100, 3), np.nan)), "finite numbers"),
        ((TIME[::-1], np.ones((100, 3))), "must increase"),
        ((TIME[:9], np.ones((9, 3))), "at least 10"),
        ((TIME, np.zeros((100, 3))), "all strains are 0"),
        ((TIME, np.ones((100, 2))), "3 gages of the deck need"),
        ((TIME + 1.0, 1e-4 * np.ones((100, 3))), "subtract the time"),
        (("a", "b"), "all numbers"),
        ({"time": TIME, "gage 1": TIME}, "two gages at least"),
        ({"time": TIME, "gage 1": TIME, "gage 7": TIME}, "gage 7 is not a gage of the deck"),
        ({"time": TIME, "gage 1": TIME, "1": TIME}, "a gage has two columns"),
        ({"gage 1": TIME, "gage 2": TIME}, "needs a column time"),
        ({"time": TIME, "left": TIME, "right": TIME}, "2 columns of strains"),
        ({"time": TIME, "gage 1": TIME, "gage 2": TIME[1:]}, "differ in length"),
        ({"time": TIME, "gage 1": TIME, "gage 2": ["a"] * 100}, "must be numbers"),
    ],
)
def test_tables_that_are_no_strains_are_refused(table: object, message: str) -> None:
    with pytest.raises(StudyError, match=message):
        located(table)


@pytest.mark.parametrize(
    ("scale", "message"),
    [
        (1e3, r"name the unit in the header, as in `time \(ms\)`"),
        (1e6, r"name the unit in the header, as in `time \(us\)`"),
        (1e-3, "no wave reaches a gage in it"),
    ],
)
def test_times_in_another_unit_are_refused_at_once_with_the_unit_that_fits(
    scale: float, message: str
) -> None:
    with pytest.raises(StudyError, match=message):
        fecm.locate(deck(), (scale * TIME, strains()))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"basis": 1e-6}, "take a larger basis"),
        ({"basis": 3e-7}, "take a larger basis"),
        ({"basis": -1.0}, "basis is -1; it must be positive"),
        ({"noise": np.nan}, "noise is nan"),
        ({"grid": 0.01}, "take a larger one"),
        ({"region": (80, 30, 40, 65)}, "has no area"),
        ({"region": (180, 130, 240, 165)}, "not on the plate"),
        ({"region": (1, 2, 3)}, "region has 3 numbers"),
    ],
)
def test_options_that_make_no_sense_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(StudyError, match=message):
        located((TIME, strains()), **options)


def test_decks_that_cant_be_located_on_are_refused() -> None:
    table = TIME, strains()
    stretching = fecm.impact(
        fecm.Plate.rectangle((100.0, 80.0), (10, 8)),
        fecm.Laminate("[0/90]s", "AS4/8552", 0.18),
        fecm.RigidMass(2e-6),
        fecm.Contact(2e4, 0.0, 0.0, 1.5),
        velocity=2000.0,
        duration=1e-4,
        units="mm-N-s",
        nonlinear=True,
        gages=OFF_AXIS,
    )
    for option in ("shift", "gains"):
        with pytest.raises(StudyError, match="shift and gains are for linear plates"):
            fecm.locate(stretching, table, **{option: True})  # type: ignore[arg-type]
    lifting = with_gages(fecm.read_one(small().replace("ROD\n", "UNIL\n13,0,1,0.,0.\n\nROD\n", 1)))
    with pytest.raises(StudyError, match=r"UNIL, from which the plate lifts off: .*--window held"):
        fecm.locate(lifting, table)
    one = with_gages(deck(), (22.0, 18.0, 0.72, 0.0))
    with pytest.raises(StudyError, match=r"1 gages \(GAGE\)"):
        fecm.locate(one, table)
    with pytest.raises(StudyError, match="three gages"):
        located({"time": TIME, "1": strains()[:, 0], "2": strains()[:, 1]}, gains=True)


@pytest.mark.parametrize(
    ("head", "clock", "sizes"),
    [
        ("Time (ms),gage 1 (µm/m),gage 2 (%),gage 3 (‰)", 1e3, (1e6, 1e2, 1e3)),
        ("Rig 7\nRate: 1 MHz\ntime,1,2,3\nus,ue,-,mm/m", 1e6, (1e6, 1.0, 1e3)),
    ],
)
def test_columns_in_other_units_are_converted(
    tmp_path: Path, head: str, clock: float, sizes: tuple[float, ...]
) -> None:
    path = written(tmp_path, head, strains() * sizes, clock * TIME)
    read = strain_table(path, unit_names(deck()), [1, 2, 3])
    assert read.time == pytest.approx(TIME, rel=1e-12)
    assert read.strains == pytest.approx(strains().T, rel=1e-12)


def test_columns_in_units_of_something_else_are_refused(tmp_path: Path) -> None:
    for head, message in (
        ("time (mm),gage1,gage2,gage3", "unknown unit of time `mm`"),
        ("time,gage1 (N),gage2,gage3", "unknown unit of strain `N`"),
    ):
        with pytest.raises(StudyError, match=message):
            located(written(tmp_path, head, strains()))


# Files --------------------------------------------------------------------------------------------


def test_a_location_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "located.h5"
    found().save(path)
    read = fecm.load_location(path)
    for field in dataclasses.fields(fecm.Location):
        if field.name != "deck":
            own, other = getattr(found(), field.name), getattr(read, field.name)
            assert np.array_equal(own, other), field.name
            assert type(own) is type(other), field.name
    assert read.deck.to_text() == found().deck.to_text()
    assert (read.unit("x"), read.unit("impulse"), read.unit("misfit")) == ("mm", "N*s", "")
    with pytest.raises(NotStoredError):
        read.unit("colour")
    first = path.read_bytes()
    with pytest.raises(FileExistsError):
        found().save(path)
    read.save(path, overwrite=True)
    assert path.read_bytes() == first


def test_a_file_names_units_and_axes(tmp_path: Path) -> None:
    found().save(tmp_path / "located.h5")
    with h5py.File(tmp_path / "located.h5") as file:
        assert file["locate"].attrs["x"] == found().x
        force = file["locate/force"]
        assert force.attrs["determined_until"] == found().determined_until
        assert force["value"].attrs["unit"] == "N"
        assert force["value"].dims[0][0] == force["time"]
        every: list[h5py.Dataset] = []
        file["locate"].visititems(lambda _, item: every.append(item))
        for item in every:
            assert item.attrs["description"]
            if isinstance(item, h5py.Dataset):
                assert np.isfinite(item[()]).all()


@pytest.mark.parametrize(
    "path", ["locate/force/sd", "locate/strains/fitted", "locate/misfit", "locate/place", "deck"]
)
def test_a_file_that_lacks_a_dataset_is_refused(tmp_path: Path, path: str) -> None:
    file = tmp_path / "located.h5"
    found().save(file)
    with h5py.File(file, "a") as opened:
        del opened[path]
    with pytest.raises(ResultFileError):
        fecm.load_location(file)


def test_a_file_with_wrong_shapes_or_numbers_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "located.h5"
    for path, values in (
        ("locate/force/sd", np.ones(3)),
        ("locate/covariance", np.full((2, 2), np.nan)),
        ("locate/gages/number", np.ones(3)),
    ):
        found().save(file, overwrite=True)
        with h5py.File(file, "a") as opened:
            del opened[path]
            opened[path] = values
        with pytest.raises(ResultFileError, match="incomplete"):
            fecm.load_location(file)
    run().save(file, overwrite=True)
    with pytest.raises(ResultFileError, match="the result of a run, not of a location"):
        fecm.load_location(file)


def test_two_locations_are_compared_and_one_with_a_run_is_not(tmp_path: Path) -> None:
    moved = dataclasses.replace(found(), x=found().x + 1.0)
    assert fecm.diff(found(), found()).same
    assert fecm.diff(found(), moved).different == ["locate/place"]
    with pytest.raises(ValueError, match="can't be compared"):
        fecm.diff(found(), run())


# The command --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("locate")
    (built / "panel.inp").write_text(deck().to_text(), encoding="utf-8")
    written(built, "time,gage 1,gage 2,gage 3", strains())
    return built


def locate(folder: Path, *options: object, table: str = "strains.csv") -> Done:
    return call("locate", "panel.inp", table, *OPTIONS, *options, cwd=folder)


def test_the_command_prints_what_python_finds(folder: Path) -> None:
    done = locate(folder, "--mass", "2e-6", "-o", "located.h5")
    assert done.exit_code == 0
    assert f"{found().x:.5g} ± {found().sd_x:.2g} mm" in done.stdout
    assert "energy bound" in done.stdout
    again = json.loads(locate(folder, "--mass", "2e-6", "--format", "json").stdout)
    assert again["x"] == found().x
    assert again["force"]["value"] == found().force.tolist()
    about = call("info", "located.h5", cwd=folder).stdout
    assert done.stdout.splitlines()[0] in about
    assert "locate/force: fitted force" in about
    assert json.loads(call("info", "located.h5", "--format", "json", cwd=folder).stdout)["units"]
    stored = fecm.load_location(folder / "located.h5")
    assert stored.mass == 2e-6
    assert stored.record._asdict() == again["record"] == record_of(folder / "strains.csv")


@pytest.mark.long
def test_the_exit_status_is_1_if_the_place_is_in_doubt(folder: Path) -> None:
    done = call(
        "locate", "panel.inp", "strains.csv", "--region", "20,30,50,60", *WIDTHS, cwd=folder
    )
    assert done.exit_code == 1
    assert "note: the place is on the edge of the region" in done.stderr
    assert "accepted          no" in done.stdout


def test_the_exit_status_is_1_if_places_cant_be_told_apart(folder: Path) -> None:
    on_axis = with_gages(panel("[0/90]2s"), *[(x, 40.0, 0.72, 0.0) for x in (20.0, 45.0, 75.0)])
    (folder / "axis.inp").write_text(on_axis.to_text(), encoding="utf-8")
    done = call("locate", "axis.inp", "strains.csv", cwd=folder)
    assert done.exit_code == 1
    assert "mirror places can't be told apart" in done.stderr


def test_unusable_input_of_the_command_is_refused(folder: Path) -> None:
    (folder / "micro.csv").write_text(
        "time,gage 1,gage 2,gage 3\n" + "".join(f"{n}e-6,100,200,{n}\n" for n in range(20)),
        encoding="utf-8",
    )
    for done in (
        locate(folder, table="micro.csv"),
        locate(folder, "-o", "strains.csv", "--overwrite"),
        locate(folder, "--noise", "-1"),
        call("locate", "panel.inp", "panel.inp", cwd=folder),
    ):
        assert done.exit_code == 2
        assert "fecm: error: " in done.stderr or "Error: " in done.stderr
        assert "Traceback" not in done.stderr
