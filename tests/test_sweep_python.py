"""Sweeps as Python code makes them: values, executors, own decks, own quantities, arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.sweeps.cases import CasesError
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
