"""What xarray and pint read in result files."""

from pathlib import Path

import h5py
import numpy as np
import pytest

import fecm
from tests.decks import DATA_CARDS, PROGRAM, small


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a result with displacements and reactions, whose columns have several units."""
    path = tmp_path_factory.mktemp("readers") / "run.h5"
    fecm.run(small(PROGRAM + "REAC\n", data="UNIT\nmm N s\n" + DATA_CARDS), output=path)
    return path


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("tape3/displacement", ["mm", "mm", "mm", "1", "1"]),
        ("reactions/force", ["N", "N", "N", "N*mm", "N*mm"]),
    ],
)
def test_columns_of_several_units_have_a_unit_each_and_no_common_one(
    run: Path, name: str, units: list[str]
) -> None:
    with h5py.File(run) as file:
        attributes = file[name].attrs
        assert list(attributes["column_units"]) == units
        assert "units" not in attributes
        assert "(u, v, w)" in attributes["unit"]
        assert "(u, v, w)" in attributes["dimension"]


def test_every_stored_unit_is_one_that_pint_reads(run: Path) -> None:
    pint = pytest.importorskip("pint")
    registry = pint.UnitRegistry()
    texts: list[str] = []

    def collect(name: str, item: h5py.HLObject) -> None:
        texts.extend(item.attrs.get("column_units", []))
        if "units" in item.attrs:
            texts.append(item.attrs["units"])

    with h5py.File(run) as file:
        file.visititems(collect)
    assert len(texts) > 20
    for text in texts:
        registry.Unit(text)


def test_a_tree_of_arrays_has_the_units_of_the_columns(run: Path) -> None:
    pytest.importorskip("xarray")
    displacement = fecm.load(run).to_xarray()["tape3"]["displacement"]
    assert displacement.attrs["column_units"] == ["mm", "mm", "mm", "1", "1"]
    assert "units" not in displacement.attrs


def test_xarray_opens_a_random_sweep_as_one_tree(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = tmp_path / "random.h5"
    fecm.sweep(
        small(),
        random={"mass": "uniform:1e-5,2e-5"},
        samples=16,
        exceed={"peak_force": [1.0, 2.0]},
        output=path,
    )
    with xarray.open_datatree(path, engine="h5netcdf", phony_dims="sort") as tree:
        np.testing.assert_array_equal(tree["exceedance"]["limit"], [1.0, 2.0])
        assert tree["exceedance"]["probability"].dims == ("limit_number",)
