"""Ply stresses of a result: in Python, as tables, in VTKHDF and in xarray."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import fecm
from fecm import Result
from fecm._errors import ResultFileError
from fecm.judge.criteria import ALL_CRITERIA
from fecm.results.export import dataset_csv_lines, write_vtkhdf
from fecm.results.exposures import largest_exposures
from fecm.results.groups import ExportError, NotStoredError
from tests.builders import REPORT_PLY, turned_stiffness
from tests.calls import call
from tests.decks import DATA_CARDS, DISC, PLY_PROGRAM, PROGRAM, small

STRENGTHS = "ALLO\n   200000.   200000.     7000.    28000.    13000.\n\n"
DECK = small(PLY_PROGRAM, data=DISC + DATA_CARDS)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small plate under a patch: stresses of two elements at steps 5 and 10."""
    path = tmp_path_factory.mktemp("plies") / "small.h5"
    fecm.run(DECK, output=path)
    return path


@pytest.fixture(scope="module")
def result(file: Path) -> Result:
    return fecm.load(file)


@pytest.fixture(scope="module")
def failing() -> Result:
    """The same plate with exposures."""
    program = PLY_PROGRAM.replace("PLYS", "FAIL          1\nPLYS")
    return fecm.run_one(small(program, data=DISC + STRENGTHS + DATA_CARDS))


def test_strains_of_plies_times_the_stiffness_of_the_ply_are_their_stresses(result: Result) -> None:
    plies = result.plies()
    strains = np.stack([plies.eps_1, plies.eps_2, plies.gamma_12], axis=-1)
    stresses = np.stack([plies.sigma_1, plies.sigma_2, plies.tau_12], axis=-1)
    assert stresses.shape == (2, 2, 9, 2, 2, 3)
    value = strains @ turned_stiffness(REPORT_PLY, 0.0)
    np.testing.assert_allclose(value, stresses, rtol=1e-9, atol=1e-12 * np.abs(stresses).max())
    np.testing.assert_array_equal(plies.sigma_1, result["plies/sigma_1"])
    np.testing.assert_array_equal(plies.angles, [0.0, 90.0])


def test_strains_on_the_far_face_are_those_of_the_curvatures(result: Result) -> None:
    # u and v are restrained: the strain along the fibres of the 90 degree ply is z kappa_y.
    plies, z = result.plies(), 0.053
    kappa_y = result["tape8/kappa_y"][:, plies.element - 1]
    np.testing.assert_allclose(plies.eps_1[:, :, :, 1, 1], z * kappa_y, rtol=1e-9, atol=1e-15)


def test_points_of_plies_are_the_nodes_where_the_deck_stores_strains_at_nodes(
    result: Result,
) -> None:
    plies = result.plies()
    nodes = result["mesh/coordinates"][result["mesh/elements"][plies.element - 1] - 1]
    np.testing.assert_allclose(np.stack([plies.x, plies.y], -1), nodes, atol=1e-14)


def test_times_and_elements_select_the_nearest_row_and_the_element_of_the_number(
    result: Result,
) -> None:
    number = int(result["plies/element"][1])
    plies = result.plies(time=4.4e-6, elements=number)
    assert (plies.step.tolist(), plies.element.tolist()) == ([10], [number])
    np.testing.assert_array_equal(plies.sigma_2[0, 0], result["plies/sigma_2"][1, 1])
    np.testing.assert_array_equal(plies.tau_xz[0, 0], result["plies/tau_xz"][1, 1])


def test_what_is_not_stored_is_answered_with_the_remedy_or_the_range(result: Result) -> None:
    with pytest.raises(NotStoredError, match="no ply stresses at time 1: the rows cover 2"):
        result.plies(time=1.0)
    with pytest.raises(NotStoredError, match="no ply stresses of element 9"):
        result.plies(elements=[9])
    without = fecm.run_one(small())
    with pytest.raises(NotStoredError, match="add PLYS to the deck's program"):
        without.plies()
    single = small().replace("    2  90.     0.053\n", "")
    other = Result({path: result[path] for path in result}, {"deck": single}, {})
    with pytest.raises(ResultFileError, match="2 plies"):
        other.plies()


def test_the_table_of_plies_has_a_line_for_each_face_with_the_shear_of_the_element(
    result: Result,
) -> None:
    header, *rows = "".join(dataset_csv_lines(result, "plies")).splitlines()
    assert header == ("step,time,element,point,ply,face,sigma_1,sigma_2,tau_12,tau_xz,tau_yz")
    assert len(rows) == 2 * 2 * 9 * 2 * 2
    step, _, element, point, ply, face, *values = rows[-3].split(",")
    assert (step, point, ply, face) == ("10", "9", "1", "2")
    assert int(element) == result["plies/element"][1]
    stored = [result[f"plies/{name}"] for name in ("sigma_1", "sigma_2", "tau_12")]
    shear = [result[f"plies/{name}"][1, 1, 0, 2] for name in ("tau_xz", "tau_yz")]
    assert [*map(float, values)] == [*(array[1, 1, 8, 0, 1] for array in stored), *shear]


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("plies/sigma_1", "step,time,element,point,ply,lower,upper"),
        ("plies/tau_xz", "step,time,element,ply,lower,middle,upper"),
        ("plies/residual", "step,time,element,xz,yz"),
        ("plies/z", "ply,lower,middle,upper"),
        ("patch", "node,weight"),
    ],
)
def test_axes_of_plies_and_patch_have_their_names(result: Result, name: str, header: str) -> None:
    assert next(dataset_csv_lines(result, name)) == header + "\n"


def test_cells_have_the_stress_of_largest_magnitude_and_its_ply(
    result: Result, tmp_path: Path
) -> None:
    notes: list[str] = []
    write_vtkhdf(result, tmp_path / "plate.vtkhdf", notes.append)
    assert not notes
    members = result["plies/element"] - 1
    with h5py.File(tmp_path / "plate.vtkhdf") as file:
        cells = file["VTKHDF/CellData"]
        under_load = cells["under_load"][()]
        data = {name: cells[name][()].reshape(2, 4) for name in cells if name != "under_load"}
    np.testing.assert_array_equal(under_load[members], result["plies/under_load"])
    for name, axes in (("sigma_2", (1, 3)), ("tau_xz", (2,))):
        stored = result[f"plies/{name}"]
        by_ply = np.abs(stored).max(axis=tuple(axis + 1 for axis in axes))
        np.testing.assert_array_equal(np.abs(data[name][:, members]), by_ply.max(axis=2))
        np.testing.assert_array_equal(data[f"{name}_ply"][:, members], by_ply.argmax(axis=2) + 1)
        others = np.setdiff1d(np.arange(4), members)
        assert np.isnan(data[name][:, others]).all()
        assert np.isnan(data[f"{name}_ply"][:, others]).all()
    # With its sign: sigma_2 is as large at both faces of the plate, but not in every element.
    assert np.isin(data["sigma_2"][:, members], result["plies/sigma_2"]).all()


@pytest.mark.parametrize("every", [1, 3, 10])
@pytest.mark.few(1)  # of 3, 0.1 s each
def test_every_time_step_has_the_largest_exposures_so_far(tmp_path: Path, every: int) -> None:
    program = PROGRAM.replace("NEXT", f"FAIL{every:11}\nNEXT")
    result = fecm.run_one(small(program, data=STRENGTHS + DATA_CARDS))
    write_vtkhdf(result, tmp_path / "plate.vtkhdf")
    evaluations = result["exposures/step"]
    with h5py.File(tmp_path / "plate.vtkhdf") as file:
        for number, criterion in enumerate(ALL_CRITERIA):
            stored = file[f"VTKHDF/FieldData/largest_{criterion}"][()]
            for step, value in zip(result["tape3/step"], stored, strict=True):
                known = result["exposures/exposure"][evaluations <= step, number]
                assert value == (known[-1] if len(known) else 0.0)


def test_cells_have_the_largest_exposure_outside_the_load_and_its_ply(
    failing: Result, tmp_path: Path
) -> None:
    notes: list[str] = []
    write_vtkhdf(failing, tmp_path / "plate.vtkhdf", notes.append)
    assert failing.still_in_contact
    assert notes == ["the run ends in contact: exposures are lower bounds"]
    with h5py.File(tmp_path / "plate.vtkhdf") as file:
        data = {name: field[()] for name, field in file["VTKHDF/CellData"].items()}
        for name in data:
            if name.startswith("exposure"):  # of the entire run: once, at every time step
                assert file[f"VTKHDF/Steps/CellDataOffsets/{name}"][()].tolist() == [0, 0]
    largest = {one.criterion: one for one in largest_exposures(failing)}
    assert set(largest) == set(ALL_CRITERIA)
    for criterion, one in largest.items():
        cell = int(np.nanargmax(data[f"exposure_{criterion}"]))
        # On the circle around the load they are larger.
        outside = failing[f"failure/{criterion}/exposure"][cell]
        assert np.nanmax(outside) >= data[f"exposure_{criterion}"][cell] > 0.0
        assert data[f"exposure_{criterion}"][cell] <= one.exposure
    under = failing["failure/under_load"] != 0
    assert under.any()
    assert not under.all()
    np.testing.assert_array_equal(data["under_load"], under.any(axis=1))
    outside = np.where(under[:, :, None, None], -1.0, failing["failure/hashin/exposure"])
    np.testing.assert_array_equal(data["exposure_hashin"], outside.max(axis=(1, 2, 3)))
    assert np.isnan(data["exposure_interlaminar"][under.any(axis=1)]).all()


def test_a_cell_whose_points_are_all_under_the_load_has_no_exposure(
    failing: Result, tmp_path: Path
) -> None:
    arrays = {path: failing[path].copy() for path in failing}
    arrays["failure/under_load"][2] = 1
    write_vtkhdf(Result(arrays, {}, {}), tmp_path / "plate.vtkhdf")
    with h5py.File(tmp_path / "plate.vtkhdf") as file:
        assert np.isnan(file["VTKHDF/CellData/exposure_puck"][()]).tolist() == [0, 0, 1, 0]


def test_the_grid_of_pyvista_has_the_fields_of_vtkhdf(failing: Result, tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    write_vtkhdf(failing, tmp_path / "plate.vtkhdf")
    with h5py.File(tmp_path / "plate.vtkhdf") as file:
        root = file["VTKHDF"]
        for row, time in enumerate(failing.tape3.time.tolist()):
            grid = failing.to_pyvista(time)
            for at, data in (("Point", grid.point_data), ("Cell", grid.cell_data)):
                assert set(data) == set(root[f"{at}Data"])
                for name in root[f"{at}Data"]:
                    start = root[f"Steps/{at}DataOffsets/{name}"][row]
                    wanted = root[f"{at}Data/{name}"][start : start + len(data[name])]
                    np.testing.assert_array_equal(data[name], wanted)
            notes = grid.field_data["notes"].tolist()
            assert notes[:-1] == list(failing.notes)
            assert "exposures are lower bounds" in notes[-1]


def test_cells_without_nine_nodes_have_no_interlaminar_stress(
    result: Result, tmp_path: Path
) -> None:
    arrays = {path: result[path] for path in result}
    arrays["plies/tau_xz"] = np.full_like(arrays["plies/tau_xz"], np.nan)
    write_vtkhdf(Result(arrays, {}, {}), tmp_path / "plate.vtkhdf")
    with h5py.File(tmp_path / "plate.vtkhdf") as file:
        assert np.isnan(file["VTKHDF/CellData/tau_xz_ply"][()]).all()
        assert np.isfinite(file["VTKHDF/CellData/sigma_1_ply"][()]).any()


def test_a_damaged_result_is_refused_in_words(result: Result, tmp_path: Path) -> None:
    arrays = {path: result[path] for path in result}
    arrays["plies/element"] = np.array([2, 9])
    damaged = Result(arrays, {"deck": result.deck_text}, {})
    with pytest.raises(ExportError, match="outside 1 to 4"):
        write_vtkhdf(damaged, tmp_path / "plate.vtkhdf")
    with pytest.raises(ResultFileError, match="outside 1 to 4"):
        damaged.plies()


@pytest.mark.long
def test_xarray_opens_plies_and_patch_beside_the_other_groups(file: Path, result: Result) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_datatree(file, engine="h5netcdf", phony_dims="sort") as tree:
        assert tree["plies"].sigma_1.dims == ("time", "member", "ply_point", "ply", "face")
        assert tree["plies"].tau_xz.dims == ("time", "member", "ply", "level")
    for path in ("plies/element", "patch/node"):
        group, _, name = path.partition("/")
        with xarray.open_dataset(file, group=group, engine="h5netcdf") as opened:
            np.testing.assert_array_equal(opened[name], result[path])


def test_info_and_diff_show_patch_and_plies(file: Path, tmp_path: Path) -> None:
    shown = call("info", file).stdout
    assert "plies: stresses ply by ply" in shown
    assert "radius = 0.2" in shown
    fecm.run(DECK.replace("115.0", "116.0"), output=tmp_path / "faster.h5")
    answer = call("diff", file, tmp_path / "faster.h5", "--rtol", ".05")
    assert answer.exit_code == 0, answer.stdout


def test_the_residual_is_compared_on_the_scale_of_the_stresses(file: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.h5"
    copy.write_bytes(file.read_bytes())
    with h5py.File(copy, "r+") as opened:
        opened["plies/residual"][...] += 1e-9 * np.abs(opened["plies/tau_xz"][()]).max()
    assert call("diff", file, copy, "--rtol", "1e-8").exit_code == 0
    assert call("diff", file, copy, "--rtol", "1e-10").exit_code == 1
