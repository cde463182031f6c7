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
from fecm.sweeps.cases import CasesError
from fecm.sweeps.schedule import SchedulerError
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, small


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"vary": {"layup": "[0/90]5s"}}, r"layup is one value; write a list: .*\['\[0/90\]5s'\]"),
        ({"vary": {"velocity": 5.0}}, r"velocity is one value; write a list: .* \[5.0\]"),
        ({"vary": {"velocity": np.array(5.0)}}, "velocity is one value"),
        ({"vary": {"velocity": []}}, "velocity has no values"),
        ({"vary": {"k": [None]}}, "k can't be None"),
        ({"vary": "velocity"}, "write a mapping"),
        ({"cases": {"velocity": 5.0}}, "case 0 is 'velocity', not a mapping"),
        ({"cases": [{"k": 1e6}, 2e6]}, "case 1 is 2000000.0, not a mapping"),
        ({"cases": 5.0}, "write a list of mappings"),
    ],
)
def test_values_that_are_not_in_a_list_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(CasesError, match=message):
        fecm.sweep(small(), **given)


UNITS = "UNIT\nin lbf s\n"
GRID: dict[str, list[Any]] = {"velocity": [100.0, 50.0, 75.0], "layup": ["[90/0]", "[x]", "[0/90]"]}


def test_a_sweeps_file_opens_with_named_dimensions_and_units(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = tmp_path / "s.h5"
    deck = small(data=UNITS + DATA_CARDS)
    found = fecm.sweep(deck, GRID, history=True, output=path)
    dims = {"cases": {"case": 9}, "summary": {"case": 9}, "history": {"case": 9, "step": 10}}
    for group, sizes in dims.items():
        with xarray.open_dataset(path, group=group, engine="h5netcdf") as opened:
            assert dict(opened.sizes) == sizes
            if group == "summary":
                assert opened.peak_force.attrs["units"] == "lbf"
                assert opened.status.values.tolist() == found["status"].tolist()
    with xarray.open_dataset(path, engine="h5netcdf") as root:
        assert (root.case.values.tolist(), root.step.values[[0, -1]].tolist()) == (
            [*range(9)],
            [1, 10],
        )


def test_a_full_grid_has_a_dimension_per_name_and_other_cases_have_one(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    path = tmp_path / "s.h5"
    found = fecm.sweep(small(data=UNITS + DATA_CARDS), GRID, history=True, output=path)
    assert found.force is not None
    arrays = found.to_xarray()
    assert arrays.identical(fecm.load_sweep(path).to_xarray())
    assert arrays.force.dims == ("velocity", "layup", "step")
    assert arrays.velocity.values.tolist() == [50.0, 75.0, 100.0]
    assert arrays.layup.values.tolist() == GRID["layup"]
    assert (arrays.velocity.attrs, arrays.force.attrs) == ({"units": "in/s"}, {"units": "lbf"})
    for case, force in enumerate(found.force):
        at = {name: values[case] for name, values in found.cases.items()}
        np.testing.assert_array_equal(arrays.force.sel(at), force)
    some = fecm.sweep(small(), cases=[{"velocity": 50.0, "k": 1e6}, {"velocity": 75.0, "k": 2e6}])
    assert some.to_xarray().peak_force.dims == ("case",)
    assert some.to_xarray().k.values.tolist() == [1e6, 2e6]


def test_threads_and_processes_give_what_one_process_does() -> None:
    serial = fecm.sweep(small(), GRID, history=True)
    spawn = multiprocessing.get_context("spawn")
    for executor in (ThreadPoolExecutor(3), ProcessPoolExecutor(1, spawn)):
        with executor:
            found = fecm.sweep(small(), GRID, history=True, executor=executor)
        assert found.fine.sum() == 6
        np.testing.assert_array_equal(found.force, serial.force)
        for name, values in serial.summary.items():
            np.testing.assert_array_equal(found[name], values)
        with pytest.raises(SchedulerError, match="after shutdown"):
            fecm.sweep(small(), GRID, executor=executor)


@pytest.mark.parametrize(
    "options",
    [{"workers": 2, "scheduler": "tcp://h:1"}, {"executor": 5}, {"scheduler": 5},
     {"workers": 2, "executor": ThreadPoolExecutor(1)}],
)  # fmt: skip
def test_places_to_run_that_conflict_or_are_none_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(fecm.FecmError, match=r"give only one of workers|is 5, not a"):
        fecm.sweep(small(), {"k": [1e6]}, **options)


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
