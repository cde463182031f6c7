"""Exports: what VTK and a spreadsheet read is what the result holds; the axes' names in HDF5."""

from __future__ import annotations

import csv
import io
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm import Result
from fecm.results.export import dataset_csv_lines, write_vtkhdf
from fecm.results.groups import ExportError
from tests.builders import SQUARE, one_element
from tests.calls import call
from tests.decks import DATA_CARDS, PROGRAM, ROOT, small

Array = NDArray[Any]
STRAINS = ("kappa_x", "kappa_y", "kappa_xy", "gamma_yz", "gamma_xz")


def run(deck: str = small()) -> Result:
    """Result of a deck of one problem."""
    return fecm.run_one(deck)


@pytest.fixture(scope="module")
def result() -> Result:
    """The small plate: ten steps, displacements and strains at steps 5 and 10."""
    return run()


@pytest.fixture
def file(runs: Path, tmp_path: Path) -> Path:
    """A copy of the small plate's result file."""
    return Path(shutil.copy(runs / "small.h5", tmp_path))


def made_up(elements: Array, coordinates: Array, **arrays: Array) -> Result:
    """A result put together from arrays."""
    mesh = {"mesh/elements": elements, "mesh/coordinates": coordinates}
    return Result({**mesh, **arrays}, {}, {"tape8": {"location": "nodes"}})


def rows(text: str) -> list[dict[str, str]]:
    """Rows of a table by its header."""
    return list(csv.DictReader(io.StringIO(text)))


def exported(result: Result, name: str) -> list[dict[str, str]]:
    """Rows of an exported dataset."""
    return rows("".join(dataset_csv_lines(result, name)))


# VTKHDF -----------------------------------------------------------------------------------------


@pytest.mark.long
def test_vtk_reads_every_time_step_as_the_result_holds_it(tmp_path: Path, result: Result) -> None:
    vtk = pytest.importorskip("vtk")
    numpy_support = pytest.importorskip("vtk.util.numpy_support")
    write_vtkhdf(result, tmp_path / "plate.vtkhdf")
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(tmp_path / "plate.vtkhdf"))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    np.testing.assert_array_equal(times, result["tape3/time"])
    np.testing.assert_allclose(times, [2.5e-6, 5e-6])
    for row, time in enumerate(times):
        reader.UpdateTimeStep(time)
        grid = reader.GetOutput()
        assert [grid.GetCellType(n) for n in range(grid.GetNumberOfCells())] == [28] * 4
        nodes = [grid.GetCell(0).GetPointId(n) + 1 for n in range(9)]
        assert nodes == [1, 3, 13, 11, 2, 8, 12, 6, 7]
        assert grid.GetPoint(12) == (1.0, 1.0, 0.0)
        data = grid.GetPointData()
        fields = {n: numpy_support.vtk_to_numpy(data.GetArray(n)) for n in ("displacement", "w")}
        np.testing.assert_array_equal(
            fields["displacement"], result["tape3/displacement"][row, :, :3]
        )
        np.testing.assert_array_equal(fields["w"], result["tape3/w"][row])
        for name in STRAINS:
            values = numpy_support.vtk_to_numpy(data.GetArray(name))
            stored = result[f"tape8/{name}"][row]
            # Node 13 is corner 3, 4, 2 and 1 of the four elements, node 7 the first one's centre.
            corners = stored[[0, 1, 2, 3], [2, 3, 1, 0]]
            assert values[12] == pytest.approx(corners.mean(), rel=1e-12)
            assert values[6] == stored[0, 8]
        contact = grid.GetFieldData().GetArray("force").GetComponent(0, 0)
        assert contact == result["history/force"][5 * row + 4]


def test_the_mesh_stands_once_in_the_file(tmp_path: Path, result: Result) -> None:
    write_vtkhdf(result, tmp_path / "plate.vtkhdf")
    with h5py.File(tmp_path / "plate.vtkhdf") as file:
        root = file["VTKHDF"]
        kind = root.attrs.get_id("Type").get_type()
        assert kind.get_size() == len("UnstructuredGrid")
        assert not kind.is_variable_str()
        assert kind.get_cset() == h5py.h5t.CSET_ASCII
        assert root.attrs["Version"].tolist() == [2, 2]
        assert root["Steps"].attrs["NSteps"] == 2
        assert root["Points"].shape == (25, 3)
        assert root["Steps/PointOffsets"][()].tolist() == [0, 0]
        assert root["Steps/PointDataOffsets/w"][()].tolist() == [0, 25]
        assert root["PointData/rotation"].shape == (50, 2)


@pytest.mark.parametrize(
    ("absent", "kind", "nodes"),
    [
        ((), 28, 9),
        ((9,), 23, 8),
        ((5, 6, 7, 8, 9), 9, 4),
        ((7,), 9, 4),
        ((5, 9), 9, 4),
        ((4, 5, 6, 7, 8, 9), 5, 3),
    ],
)
def test_an_element_becomes_the_cell_of_its_nodes_or_of_its_corners(
    tmp_path: Path, absent: tuple[int, ...], kind: int, nodes: int
) -> None:
    coordinates, elements = one_element(SQUARE)
    elements[0, [n - 1 for n in absent]] = 0
    arrays = {"tape3/step": np.array([1]), "tape3/time": np.ones(1)}
    displacement = np.zeros((1, 9, 5))
    write_vtkhdf(
        made_up(elements, coordinates, **arrays, **{"tape3/displacement": displacement}),
        tmp_path / "one.vtkhdf",
    )
    with h5py.File(tmp_path / "one.vtkhdf") as file:
        assert file["VTKHDF/Types"][()].tolist() == [kind]
        assert file["VTKHDF/Offsets"][()].tolist() == [0, nodes]
        assert file["VTKHDF/Connectivity"][()].tolist() == list(range(nodes))


def test_strains_at_gauss_points_become_means_of_the_cells(tmp_path: Path) -> None:
    deck = small().replace("    3    3   -3", "    3    3    2")
    result = run(deck)
    write_vtkhdf(result, tmp_path / "gauss.vtkhdf")
    with h5py.File(tmp_path / "gauss.vtkhdf") as file:
        assert "kappa_x" not in file["VTKHDF/PointData"]
        values = file["VTKHDF/CellData/kappa_x"][()].reshape(2, 4)
    np.testing.assert_allclose(values, result["tape8/kappa_x"].sum(axis=2) / 4.0, rtol=1e-12)


def test_strains_of_other_steps_are_not_taken_for_those_of_a_time_step(tmp_path: Path) -> None:
    notes: list[str] = []
    result = run(small(PROGRAM.replace("DISP          5", "DISP          2")))
    write_vtkhdf(result, tmp_path / "mixed.vtkhdf", notes.append)
    with h5py.File(tmp_path / "mixed.vtkhdf") as file:
        values = file["VTKHDF/PointData/kappa_x"][()].reshape(5, 25)
    assert np.isnan(values).all(axis=1).tolist() == [True, True, True, True, False]
    assert "1 of 5" in notes[0]
    result = run(small(PROGRAM.replace("RODP          5", "RODP         20")))
    write_vtkhdf(result, tmp_path / "none.vtkhdf", notes.append)
    with h5py.File(tmp_path / "none.vtkhdf") as file:
        assert set(file["VTKHDF/PointData"]) == {"displacement", "rotation", "w"}
    assert "tape8" in notes[1]


def test_a_state_stored_twice_is_one_time_step(tmp_path: Path) -> None:
    program = "LMAS\nDISP\n" + PROGRAM.replace("DISP          5\n", "DISP          5\nDISP\n")
    result = run(small(program))
    assert result["tape3/step"].tolist() == [0, 1, 2, 3, 4, 5, 5, 6, 7, 8, 9, 10, 10]
    write_vtkhdf(result, tmp_path / "twice.vtkhdf", lambda text: None)
    with h5py.File(tmp_path / "twice.vtkhdf") as file:
        np.testing.assert_allclose(file["VTKHDF/Steps/Values"], np.arange(11) * 0.5e-6)
        force = file["VTKHDF/FieldData/force"][()]
    np.testing.assert_array_equal(force, [0.0, *result["history/force"]])


def test_without_displacements_there_is_nothing_to_export(file: Path) -> None:
    deck = file.parent / "bare.inp"
    deck.write_text(small(PROGRAM.replace("DISP          5\n", "")))
    call("run", deck, cwd=file.parent)
    refused = call("export", "bare.h5", "--to", "vtkhdf", cwd=file.parent)
    assert refused.exit_code == 2
    assert "DISP" in refused.stderr
    assert not list(file.parent.glob("*vtkhdf*"))


def test_exporting_twice_gives_the_same_bytes(tmp_path: Path, result: Result) -> None:
    for name in ("a.vtkhdf", "b.vtkhdf"):
        write_vtkhdf(result, tmp_path / name)
    assert (tmp_path / "a.vtkhdf").read_bytes() == (tmp_path / "b.vtkhdf").read_bytes()


# CSV --------------------------------------------------------------------------------------------


def test_the_history_can_be_read_back_to_the_last_bit(result: Result) -> None:
    got = exported(result, "history")
    assert list(got[0]) == [
        "step",
        "time",
        "force",
        "indentation",
        "transducer",
        "displacement",
        "velocity",
        "acceleration",
        "plate_w",
    ]
    for name in got[0]:
        column = [float(row[name]) for row in got]
        np.testing.assert_array_equal(column, result[f"history/{name}"])
    assert got[4]["step"] == "5"


def test_fields_are_written_in_long_form_with_numbers_from_one(result: Result) -> None:
    got = exported(result, "tape3/displacement")
    assert list(got[0]) == ["step", "time", "node", "u", "v", "w", "theta_x", "theta_y"]
    assert len(got) == 2 * 25
    assert (got[25 + 12]["step"], got[25 + 12]["node"]) == ("10", "13")
    assert float(got[25 + 12]["w"]) == result["tape3/w"][1, 12]
    assert exported(result, "tape3") == got
    got = exported(result, "tape8")
    assert list(got[0]) == ["step", "time", "element", "point", *STRAINS]
    last = got[-1]
    assert (last["step"], last["element"], last["point"]) == ("10", "4", "9")
    assert float(last["gamma_xz"]) == result["tape8/gamma_xz"][1, 3, 8]


@pytest.mark.parametrize(
    ("name", "header", "last"),
    [
        ("mesh/coordinates", "node,x,y", "25,2.0,2.0"),
        ("mesh/elements", "element," + ",".join(f"node_{n}" for n in range(1, 10)),
         "4,13,15,25,23,14,20,24,18,19"),
        ("mesh/equations", "node,u,v,w,theta_x,theta_y", "25,0,0,73,74,75"),
        ("history/time", "step,time", None),
        ("tape3/w", "step,time,node,w", None),
    ],
)  # fmt: skip
def test_any_dataset_has_its_columns_named(
    result: Result, name: str, header: str, last: str | None
) -> None:
    text = "".join(dataset_csv_lines(result, name)).splitlines()
    assert text[0] == header
    assert last is None or text[-1] == last


def test_what_is_the_same_at_every_row_is_written_once() -> None:
    result = fecm.run_one(ROOT / "decks" / "static-bending.inp")
    got = exported(result, "stresses/x")
    assert list(got[0]) == ["element", "stress_point", "x"]
    assert len(got) == result["stresses/x"].size
    got = exported(result, "stresses")
    assert list(got[0])[:5] == ["step", "time", "element", "stress_point", "eps_xx"]
    assert "x" not in got[0]
    assert float(got[-1]["M_x"]) == result["stresses/M_x"][0, -1, -1]


def test_modes_are_numbered() -> None:
    result = fecm.run_one(ROOT / "decks" / "natural-frequencies.inp")
    got = exported(result, "modes/angular_frequency")
    assert [row["number"] for row in got[:3]] == ["1", "2", "3"]
    assert float(got[2]["angular_frequency"]) == result["modes/angular_frequency"][2]
    assert list(exported(result, "modes/shape")[0])[:5] == ["step", "time", "number", "node", "u"]


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("tape3/ww", "tape3/w"),
        ("w", "tape3/w"),
        ("histry", "history"),
        ("laminate", "laminate/A, laminate/B, laminate/D or laminate/shear"),
        ("zzz", "there are energy, history, laminate, mesh, tape3, tape8, tape9"),
    ],
)
def test_an_unknown_name_is_answered_with_near_ones(result: Result, name: str, hint: str) -> None:
    with pytest.raises(ExportError) as refused:
        dataset_csv_lines(result, name)
    assert hint in str(refused.value)


@pytest.mark.parametrize(
    ("name", "header"),
    [
        (
            "history",
            "step,time (s),force (N),indentation (mm),transducer (N),displacement (mm),"
            "velocity (mm/s),acceleration (mm/s^2),plate_w (mm)",
        ),
        ("tape3", "step,time (s),node,u (mm),v (mm),w (mm),theta_x,theta_y"),
        ("tape8/kappa_x", "step,time (s),element,point,kappa_x (1/mm)"),
        ("laminate/D", "row,xx (N*mm),yy (N*mm),xy (N*mm)"),
        ("mesh/coordinates", "node,x (mm),y (mm)"),
    ],
)
def test_headers_have_the_units_that_the_deck_names(name: str, header: str) -> None:
    assert (
        next(dataset_csv_lines(run(small(data=DATA_CARDS + "UNIT\nmm N s\n")), name))
        == header + "\n"
    )


def test_an_exported_force_is_a_measurement_in_the_units_of_the_deck(tmp_path: Path) -> None:
    result = run(small(data=DATA_CARDS + "UNIT\nmm N s\n"))
    result.export(tmp_path / "history.csv")
    compared = result.compare(tmp_path / "history.csv")
    assert compared.rms == 0.0
    assert compared.correlation == pytest.approx(1.0)
    other = run(small(data=DATA_CARDS + "UNIT\nin lbf s\n"))
    converted = other.compare(tmp_path / "history.csv")  # from N; 1 lbf is 4.4482216152605 N
    assert converted.measured_peak * 4.4482216152605 == pytest.approx(compared.peak, rel=1e-12)


def test_a_unit_with_a_comma_stays_in_its_column(result: Result) -> None:
    arrays = {path: result[path] for path in result}
    units = {"unit_length": "m,m", "unit_force": "N", "unit_time": 's"'}
    header, first = list(dataset_csv_lines(Result(arrays, {}, {"": units}), "energy"))[:2]
    names, numbers = csv.reader([header, first])
    assert names[:2] == ["step", 'time (s")']
    assert names[2] == "plate_kinetic (N*m,m)"
    assert len(names) == len(numbers)


def test_exposures_of_a_run_that_ends_in_contact_are_noted_as_lower_bounds(file: Path) -> None:
    strengths = "ALLO\n1500.,1500.,50.,200.,100.,50.\n\n" + DATA_CARDS
    failing = run(small(PROGRAM.replace("NEXT", "FAIL          1\nNEXT"), data=strengths))
    assert failing.still_in_contact
    failing.save(file, overwrite=True)
    text = "fecm: note: the run ends in contact: exposures are lower bounds\n"
    for dataset, note in (("exposures", text), ("failure/puck/exposure", text), ("tape3", "")):
        done = call("export", file, "--to", "csv", "--dataset", dataset, "-o", "-")
        assert (done.exit_code, done.stderr) == (0, note)


def test_a_group_that_was_never_stored_names_its_macro() -> None:
    idle = PROGRAM.replace("RODP          5\n", "")
    result = run(small(idle, data=DATA_CARDS[DATA_CARDS.index("MATE") :]))
    with pytest.raises(ExportError, match="add RODP"):
        dataset_csv_lines(result, "history")


def test_the_command_writes_beside_the_user_and_keeps_what_is_there(file: Path) -> None:
    folder = file.parent
    done = call("export", file, "--to", "csv", cwd=folder)
    assert (done.exit_code, done.stdout) == (0, "small-history.csv\n")
    assert len((folder / "small-history.csv").read_text().splitlines()) == 11
    done = call("export", file, "--to", "vtkhdf", cwd=folder)
    assert (done.exit_code, done.stdout, done.stderr) == (0, "small.vtkhdf\n", "")
    (folder / "small-history.csv").write_text("precious")
    refused = call("export", file, "--to", "csv", cwd=folder)
    assert refused.exit_code == 2
    assert "--overwrite" in refused.stderr
    assert (folder / "small-history.csv").read_text() == "precious"
    shown = call("export", file, "--to", "csv", "--dataset", "tape3/w", "-o", "-", cwd=folder)
    assert len(rows(shown.stdout)) == 50
    assert sorted(p.name for p in folder.iterdir()) == [
        "small-history.csv",
        "small.h5",
        "small.vtkhdf",
    ]


@pytest.mark.parametrize(
    "arguments",
    [
        ("--to", "csv", "--dataset", "histry"),
        ("--to", "vtkhdf", "-o", "-"),
        ("--to", "vtkhdf", "--dataset", "tape3"),
        ("--to", "vtkhdf", "-o", "small.h5", "--overwrite"),
        ("--to", "csv", "-o", "/dev/null", "--overwrite"),
        ("--to", "xlsx"),
        (),
    ],
)
def test_what_cannot_be_exported_is_refused_in_words(
    file: Path, arguments: tuple[str, ...]
) -> None:
    refused = call("export", file, *arguments, cwd=file.parent)
    assert refused.exit_code == 2
    assert "rror: " in refused.stderr
    assert "Traceback" not in refused.stderr
    assert [p.name for p in file.parent.iterdir()] == ["small.h5"]
    assert h5py.is_hdf5(file)


# Data frames and the names of axes --------------------------------------------------------------


def test_every_axis_of_what_is_stored_in_rows_has_a_scale(file: Path) -> None:
    expected: Mapping[str, list[str]] = {
        "history/force": ["history/time"],
        "history/step": ["history/time"],
        "tape3/displacement": ["tape3/time", "node", "unknown"],
        "tape8/kappa_xy": ["tape8/time", "element", "point"],
        "energy/plate_strain": ["energy/time"],
    }
    with h5py.File(file) as opened:
        for path, scales in expected.items():
            values = [dimension[0].name.strip("/") for dimension in opened[path].dims]
            assert values == scales
        assert opened["node"][()].tolist() == list(range(1, 26))
        assert opened["unknown"].asstr()[()].tolist() == ["u", "v", "w", "theta_x", "theta_y"]
        attributes = opened["history/force"].attrs
        assert attributes["long_name"] == attributes["description"]
    assert "node" not in fecm.load(file)


def test_xarray_opens_a_group_with_its_times(file: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    result = fecm.load(file)
    with xarray.open_dataset(file, group="history", engine="h5netcdf") as history:
        assert history.force.dims == ("time",)
        np.testing.assert_array_equal(history.time, result.time)
        at = float(history.force.sel(time=2.5e-6, method="nearest"))
        assert at == result.force[4]
    with xarray.open_dataset(file, group="tape3", engine="h5netcdf") as tape:
        assert tape.displacement.dims == ("time", "node", "unknown")
        np.testing.assert_array_equal(tape.w, result.tape3.w)


def test_the_history_is_a_data_frame_by_time(result: Result) -> None:
    pytest.importorskip("pandas")
    frame = result.to_dataframe()
    assert frame.index.name == "time"
    assert list(frame.columns[:3]) == ["step", "force", "indentation"]
    np.testing.assert_array_equal(frame.index, result.time)
    np.testing.assert_array_equal(frame["plate_w"], result["history/plate_w"])
    units = {name: result.unit(f"history/{name}") for name in ("time", *frame.columns)}
    assert frame.attrs["units"] == {name: unit for name, unit in units.items() if unit}


def test_without_pandas_the_message_says_what_to_install(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        result.to_dataframe()


def test_a_table_with_decimal_commas_has_the_numbers_of_one_with_points(
    file: Path, tmp_path: Path
) -> None:
    pointed = call("export", file, "--to", "csv", "-o", "-").stdout
    comma = call("export", file, "--to", "csv", "-o", "-", "--decimal", "comma").stdout
    assert comma != pointed
    assert "." not in "".join(comma.splitlines()[1:])
    again = "\n".join(
        row.replace(",", ".").replace(";", ",") if number else row.replace(";", ",")
        for number, row in enumerate(comma.splitlines())
    )
    assert again == pointed.rstrip("\n")
    fecm.load(file).export(tmp_path / "h.csv", decimal="comma")
    assert (tmp_path / "h.csv").read_text() == comma
    sweep = fecm.sweep(small(), {"velocity": [50.5, 60.0]})
    sweep.export(tmp_path / "s.csv", decimal="comma")
    assert (tmp_path / "s.csv").read_text().splitlines()[1].startswith("0;50,5;")
    waves = ("waves", "speeds", "--layup", "[0/90]s", "--material", "AS4/8552", "--step", "90")
    assert call(*waves, "--decimal", "comma").stdout.splitlines()[1].startswith("0,0;")
