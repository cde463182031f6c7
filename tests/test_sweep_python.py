"""Sweeps as Python code makes them: values, executors, own decks, own quantities, arrays."""

from __future__ import annotations

import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.case import CasesError
from fecm.sweeps.execute import SchedulerError
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, PROGRAM, small


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"vary": {"layup": "[0/90]5s"}}, r"layup is one value; write a list: .*\['\[0/90\]5s'\]"),
        ({"vary": {"velocity": 5.0}}, r"velocity is one value; write a list: .* \[5.0\]"),
        ({"vary": {"velocity": np.array(5.0)}}, "velocity is one value"),
        ({"vary": {"velocity": []}}, "velocity has no values"),
        ({"vary": {"k": [None]}}, "k can't be None"),
        ({"vary": "velocity"}, "write velocity=FROM"),
        ({"cases": {"velocity": 5.0}}, "case 0 is 'velocity', not a mapping"),
        ({"cases": [{"k": 1e6}, 2e6]}, "case 1 is 2000000.0, not a mapping"),
        ({"cases": 5.0}, "write a list of mappings"),
    ],
)
def test_values_that_are_not_in_a_list_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(CasesError, match=message):
        fecm.sweep(small(), **given)


def test_a_data_frame_is_a_table_of_cases() -> None:
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(
        {"velocity": [50, 75.0, 115.0], "layup": ["[0/90]", "[90/0]", "[0]"], "impact_node": 13},
        index=[7, 7, 9],
    )
    swept = fecm.sweep(small(), cases=table, history=True)
    rows = fecm.sweep(small(), cases=table.to_dict("records"), history=True)
    assert list(swept.cases) == ["velocity", "layup", "impact_node"]
    for name in swept.cases:
        assert swept[name].tolist() == rows[name].tolist() == table[name].tolist()
    np.testing.assert_array_equal(swept.force, rows.force)
    again = fecm.sweep(small(), cases=swept.to_dataframe()[["velocity", "layup"]], history=True)
    np.testing.assert_array_equal(again.force, rows.force)


@pytest.mark.parametrize(
    ("columns", "rows", "message"),
    [
        (["velocity", "velocity"], [[1.0, 2.0]], "column velocity is repeated"),
        (["velocity"], [[1.0], [np.nan]], "case 1: velocity must be a finite number, not `nan`"),
        (["velosity"], [[1.0]], "`velosity` cannot be varied; did you mean velocity?"),
        ([0], [[1.0]], "`0` cannot be varied"),
        (["velocity"], [], "at least one case"),
    ],
)
def test_a_data_frame_that_is_no_table_of_cases_is_refused(
    columns: list[Any], rows: list[Any], message: str
) -> None:
    pandas = pytest.importorskip("pandas")
    with pytest.raises(CasesError, match=message):
        fecm.sweep(small(), cases=pandas.DataFrame(rows, columns=columns))


UNITS = "UNIT\nin lbf s\n"
GRID: dict[str, list[Any]] = {"velocity": [100.0, 50.0, 75.0], "layup": ["[90/0]", "[x]", "[0/90]"]}


def test_a_sweeps_file_opens_with_named_dimensions_and_units(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = tmp_path / "s.h5"
    deck = small(data=UNITS + DATA_CARDS)
    swept = fecm.sweep(deck, GRID, history=True, output=path)
    dims = {"cases": {"case": 9}, "summary": {"case": 9}, "history": {"case": 9, "step": 10}}
    for group, sizes in dims.items():
        with xarray.open_dataset(path, group=group, engine="h5netcdf") as opened:
            assert dict(opened.sizes) == sizes
            if group == "summary":
                assert opened.peak_force.attrs["units"] == "lbf"
                assert opened.status.values.tolist() == swept["status"].tolist()
    with xarray.open_dataset(path, engine="h5netcdf") as root:
        assert (root.case.values.tolist(), root.step.values[[0, -1]].tolist()) == (
            [*range(9)],
            [1, 10],
        )


def test_a_full_grid_has_a_dimension_per_name_and_other_cases_have_one(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    path = tmp_path / "s.h5"
    swept = fecm.sweep(small(data=UNITS + DATA_CARDS), GRID, history=True, output=path)
    assert swept.force is not None
    arrays = swept.to_xarray()
    assert arrays.identical(fecm.load_sweep(path).to_xarray())
    assert arrays.force.dims == ("velocity", "layup", "step")
    assert arrays.velocity.values.tolist() == [50.0, 75.0, 100.0]
    assert arrays.layup.values.tolist() == GRID["layup"]
    assert (arrays.velocity.attrs, arrays.force.attrs) == ({"units": "in/s"}, {"units": "lbf"})
    for case, force in enumerate(swept.force):
        at = {name: values[case] for name, values in swept.cases.items()}
        np.testing.assert_array_equal(arrays.force.sel(at), force)
    some = fecm.sweep(small(), cases=[{"velocity": 50.0, "k": 1e6}, {"velocity": 75.0, "k": 2e6}])
    assert some.to_xarray().peak_force.dims == ("case",)
    assert some.to_xarray().k.values.tolist() == [1e6, 2e6]


def test_threads_and_processes_give_what_one_process_does() -> None:
    serial = fecm.sweep(small(), GRID, history=True)
    spawn = multiprocessing.get_context("spawn")
    for executor in (ThreadPoolExecutor(3), ProcessPoolExecutor(1, spawn)):
        with executor:
            swept = fecm.sweep(small(), GRID, history=True, executor=executor)
        assert swept.completed.sum() == 6
        np.testing.assert_array_equal(swept.force, serial.force)
        for name, values in serial.summary.items():
            np.testing.assert_array_equal(swept[name], values)
        with pytest.raises(SchedulerError, match="after shutdown"):
            fecm.sweep(small(), GRID, executor=executor)


def test_the_callers_dask_client_stays_open_and_the_default() -> None:
    distributed = pytest.importorskip("distributed")
    where = {"n_workers": 1, "threads_per_worker": 1, "processes": False}
    serial = fecm.sweep(small(), GRID, history=True)
    with distributed.LocalCluster(**where, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            for scheduler in (cluster, client, cluster):
                swept = fecm.sweep(small(), GRID, history=True, scheduler=scheduler)
                np.testing.assert_array_equal(swept.force, serial.force)
                assert client.status == "running"
                assert distributed.default_client() is client
            assert client.submit(sum, [2, 3]).result() == 5
        assert fecm.sweep(small(), GRID, scheduler=cluster).completed.sum() == 6


@pytest.mark.parametrize(
    "options",
    [{"workers": 2, "scheduler": "tcp://h:1"}, {"executor": 5}, {"scheduler": 5},
     {"workers": 2, "executor": ThreadPoolExecutor(1)}],
)  # fmt: skip
def test_places_to_run_that_conflict_or_are_none_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(fecm.FecmError, match=r"excludes several workers|is 5, not a"):
        fecm.sweep(small(), {"k": [1e6]}, **options)


def plate(case: dict[str, Any]) -> fecm.Deck:
    """The small plate hit at a speed for some time; one kind of plate has other units."""
    if case["kind"] == "lost":
        raise KeyError("no such plate")
    units = UNITS.replace("in lbf", "mm N") if case["kind"] == "metric" else UNITS
    data = (units + DATA_CARDS).replace("115.0", f"{case['speed']:5.1f}")
    return fecm.read_one(
        small(PROGRAM.replace("10", "80" if case["kind"] == "long" else "10"), data=data)
    )


def readings(result: fecm.Result) -> dict[str, float]:
    """Largest displacement under the load, and stored instants."""
    return {"w": result.plate_w.max(), "instants": len(result.tape3.time)}


OWN: dict[str, list[Any]] = {"speed": [50, 100], "kind": ["", "long", "lost", "metric"]}


@pytest.mark.long
def test_built_decks_give_the_results_of_runs_and_keep_names_and_measured_columns(
    tmp_path: Path,
) -> None:
    path, seen = tmp_path / "s.h5", list[tuple[int, int]]()
    swept = fecm.sweep(
        vary=OWN,
        build=plate,
        measure=readings,
        history=True,
        output=path,
        progress=lambda *counts: seen.append(counts),
    )
    assert seen == [(done, 8) for done in range(1, 9)]
    assert swept.completed.tolist() == 2 * [True, True, False, False]
    assert swept["status"].tolist()[2:4] == [
        "build: KeyError: 'no such plate'",
        "build: the units of the deck differ from the other cases",
    ]
    assert swept.force is not None
    for case in np.flatnonzero(swept.completed):
        one = fecm.run_one(plate({name: swept[name][case].item() for name in OWN}))
        np.testing.assert_array_equal(swept.force[case][: len(one.force)], one.force)
        assert swept["w"][case] == one.plate_w.max()
        assert swept["instants"][case] == len(one.tape3.time)
    assert np.isnan(swept["w"][~swept.completed]).all()
    loaded = fecm.load_sweep(path)
    for name in ("speed", "kind", "w", "status"):
        np.testing.assert_array_equal(loaded[name], swept[name])
    assert loaded["speed"].dtype.kind == "i"
    assert loaded.unit("w") == ""
    assert "measured by the caller" in call("info", path, "--format", "json").stdout
    assert swept.to_xarray()["w"].dims == ("speed", "kind")
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as executor:
        again = fecm.sweep(vary=OWN, build=plate, measure=readings, executor=executor)
    np.testing.assert_array_equal(again["w"], swept["w"])


def test_measured_columns_are_drawn_and_tabulated() -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib")
    swept = fecm.sweep(small(), {"velocity": [50.0, 100.0]}, measure=readings)
    assert swept.to_dataframe()["w"].tolist() == swept["w"].tolist()
    drawn = [
        np.asarray(line.get_ydata(), dtype=float).tolist()
        for line in swept.plot(quantity="w").lines
    ]
    assert swept["w"].tolist() in drawn


def test_readings_with_other_names_in_some_case_name_the_case() -> None:
    def uneven(result: fecm.Result) -> dict[str, float]:
        return {"w" if result.velocity[0] < -60.0 else "v": 1.0}

    with pytest.raises(CasesError, match="returns w for case 1, and v for case 0"):
        fecm.sweep(small(), {"velocity": [50.0, 100.0]}, measure=uneven)


@pytest.mark.parametrize(
    ("readings", "reason"),
    [
        (lambda result: {"peak_force": 1.0}, "`peak_force` is a name of the results"),
        (lambda result: {"k": 1.0}, "`k` is a name of the case"),
        (lambda result: {"a b": 1.0}, "`a b` is not a name"),
        (lambda result: {"a": result.force}, "a is not a number"),
        (lambda result: 5.0, "TypeError: returned float, not numbers by name"),
        (lambda result: {"a": 1 / 0}, "ZeroDivisionError: division by zero"),
    ],
)
def test_readings_that_can_not_be_stored_are_the_status(readings: Any, reason: str) -> None:
    (status,) = fecm.sweep(small(), {"k": [1e6]}, measure=readings)["status"]
    assert status.startswith(f"measure: {reason}")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"build": plate, "deck": small()}, "`deck` excludes `build`"),
        ({"build": lambda case: None, "vary": {"a": [1]}}, "case 0: .*NoneType, not a Deck"),
        ({"build": lambda case: None, "workers": 2}, "build can't be sent to worker processes"),
        ({"measure": readings, "deck": small(), "until": 9.0}, "`until` excludes a function"),
        ({"measure": 5, "deck": small()}, "measure is 5, not a function"),
        ({"build": plate, "vary": {"peak_force": [1.0]}}, "is a name of the results"),
        ({"build": plate, "vary": {"a": [1, "b"]}}, "a has numbers and texts"),
        ({"build": plate, "vary": {"a": [float("nan")]}}, "a is nan, not a finite number"),
    ],
)
def test_functions_that_can_not_be_meant_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(CasesError, match=message):
        fecm.sweep(**{"vary": {"k": [1e6]}, **options})


def test_findings_and_doubtful_cases_are_warnings_with_counts(tmp_path: Path) -> None:
    layups = {"layup": ["[0/90]", "[x]", "[y]", "[90/0]"]}
    with pytest.warns(fecm.FecmWarning) as caught:
        swept = fecm.sweep(small(), layups, output=tmp_path / "s.h5")
    texts = [str(warning.message) for warning in caught]
    assert {warning.filename for warning in caught} == {__file__}
    assert len(texts) > 1
    assert all("warning[W" in text for text in texts[:-1])
    notes = list(swept.notes)
    assert texts[-1].splitlines() == notes == list(fecm.load_sweep(tmp_path / "s.h5").notes)
    assert notes[0] == "2 of 4 cases still in contact at the end"
    assert notes[1] == "2 of 4 cases with an open peak"
    assert notes[2].startswith("2 of 4 cases failed: layup: the layup `[x]`")
    assert notes[2].endswith(", and 1 other reason")
    assert "2 of 4 cases end before their contact does" in notes[3]
    assert notes[3].endswith("--vary duration=1e-05")


def test_a_scheduler_file_names_the_address(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    deck, file = tmp_path / "plate.inp", tmp_path / "scheduler.json"
    deck.write_text(small())
    command = ("sweep", deck, "--vary", "k=1e6", "-o", tmp_path / "s.h5")
    file.write_text(json.dumps({"type": "Scheduler", "address": "tcp://127.0.0.1:9"}))
    done = call(*command, "--scheduler-file", file)
    assert_unusable(done)
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in done.stderr
    done = call(*command, "--scheduler-file", deck)
    assert_unusable(done)
    assert "plate.inp has no address" in done.stderr
    done = call(*command, "--scheduler-file", file, "--scheduler", "tcp://127.0.0.1:9")
    assert done.exit_code == 2
    assert not (tmp_path / "s.h5").exists()
