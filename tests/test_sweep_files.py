"""Results of sweeps as files: what `fecm info` tells of them, and how `fecm diff` compares them."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

import fecm
from fecm import SweepResult
from fecm.authoring.case import CasesError
from fecm.sweeps.summary import summary_of_sweep
from tests.calls import assert_unusable, call, datasets_of
from tests.decks import DATA_CARDS, PROGRAM
from tests.decks import small as small_of

STEPS = PROGRAM.replace("LOOP         10", "LOOP        400")
VELOCITIES = (50.0, 100.0, 150.0)


def small() -> str:
    """A deck whose contact ends."""
    return small_of(STEPS)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep of velocities and two layups, one of which can't be read."""
    path = tmp_path_factory.mktemp("sweep") / "sweep.h5"
    fecm.sweep(
        small(),
        {"velocity": VELOCITIES, "layup": ["[0/90]", "nonsense"]},
        history=True,
        output=path,
    )
    return path


@pytest.fixture
def changed(swept: Path, tmp_path: Path) -> Callable[[str, object], Path]:
    """Make a copy of the sweep with another value at case 4 of a dataset."""

    def change(name: str, value: object) -> Path:
        path = tmp_path / "changed.h5"
        shutil.copy(swept, path)
        with h5py.File(path, "r+") as file:
            file[name][4] = value
        return path

    return change


def test_a_loaded_sweep_has_its_columns_in_the_order_of_the_sweep(tmp_path: Path) -> None:
    result = fecm.sweep(small(), {"velocity": VELOCITIES})
    result.save(tmp_path / "sweep.h5")
    assert fecm.load_sweep(tmp_path / "sweep.h5").keys() == result.keys()


def test_info_tells_the_cases_and_what_came_out(swept: Path) -> None:
    done = call("info", swept)
    assert (done.exit_code, done.stderr) == (0, "")
    text = "\n".join(" ".join(line.split()) for line in done.stdout.splitlines())
    forces = fecm.load_sweep(swept)["peak_force"]
    for line in (
        "cases 6, 3 failed",
        f"largest peak {np.nanmax(forces):.4g} (velocity 150, layup [0/90])",
        "velocity 6 float64 length/time 50 to 150",
        "layup 6 text 2 different",
        "peak_force 6 float64 force "
        f"{np.nanmin(forces):.6g} to {np.nanmax(forces):.6g}, 3 not finite",
        "cases: values of what varies",
    ):
        assert line in text


def test_values_in_the_summary_have_the_digits_that_tell_cases_apart() -> None:
    thirds = np.array([1e6, 8.5e6 / 3.0, 3e6])
    close = np.array([1e6, 1e6 + 0.125, 3e6])
    for k, velocity, shown in (
        (thirds, 50.0, "k 2.83333e+06"),
        (close, 50.0, "k 1000000.1"),
        (thirds, 1e-3, "velocity 0.001"),
    ):
        cases = {"k": k, "velocity": np.full(3, velocity)}
        columns = {"peak_force": np.array([1.0, 5.0, 2.0]), "status": np.full(3, "ok")}
        result = SweepResult(cases, columns, np.ones(3), np.ones(3))
        lines = [*summary_of_sweep(result).lines()]
        assert any(shown in line for line in lines), lines


def test_info_tells_programs_the_same(swept: Path) -> None:
    document = json.loads(call("info", swept, "--format", "json").stdout)
    assert (document["format"], document["cases"], document["failed"]) == ("fecm-sweep", 6, 3)
    assert "steps" not in document
    datasets = {d["name"]: d for group in document["groups"] for d in group["datasets"]}
    assert datasets["cases/layup"]["different"] == 2
    assert datasets["cases/velocity"]["max"] == 150.0


def test_a_sweep_is_the_same_as_itself_run_again(swept: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.h5"
    fecm.sweep(
        small(),
        {"velocity": VELOCITIES, "layup": ["[0/90]", "nonsense"]},
        history=True,
        output=again,
    )
    assert again.read_bytes() == swept.read_bytes()
    done = call("diff", swept, again)
    assert done.exit_code == 0
    count = len(datasets_of(again))
    assert done.stdout.endswith(f"same: {count} datasets within rtol 0, atol 0\n")


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("summary/peak_force", 1e9, "1e+09 at case 4"),
        ("history/force", 1e9, "at case 4, step 312"),
        ("history/steps", 3, "against 3 at case 4"),
        ("cases/layup", b"[90/0]", "`[0/90]` against `[90/0]` at case 4; 1 text differs"),
        ("summary/status", b"lost", "`ok` against `lost` at case 4; 1 text differs"),
    ],
)
@pytest.mark.few(2)  # of 5, 0.1 s each
def test_another_number_or_text_of_a_case_is_a_difference(
    swept: Path, changed: Callable[[str, object], Path], name: str, value: object, told: str
) -> None:
    done = call("diff", swept, changed(name, value))
    assert done.exit_code == 1
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("different  ")]
    assert name in line
    assert told in line
    assert call("diff", swept, changed(name, value), "--only", "history/dt").exit_code == 0


def test_texts_differ_at_any_tolerance(swept: Path, changed: Callable[[str, object], Path]) -> None:
    other = changed("summary/status", b"lost")
    assert call("diff", swept, other, "--rtol", 1e9, "--atol", 1e9).exit_code == 1
    (text,) = json.loads(call("diff", swept, other, "--format", "json", "--brief").stdout)[
        "datasets"
    ]
    assert (text["a"], text["b"], text["at"]["case"]) == ("ok", "lost", 4)


def test_numbers_in_the_place_of_texts_are_a_difference(swept: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.h5"
    shutil.copy(swept, other)
    with h5py.File(other, "r+") as file:
        del file["cases/layup"]
        file["cases/layup"] = np.arange(6.0)
    done = call("diff", swept, other)
    assert done.exit_code == 1
    assert "type text against float64" in done.stdout


def test_a_sweep_and_a_run_or_tapes_can_not_be_compared(
    swept: Path, runs: Path, tmp_path: Path
) -> None:
    run = runs / "small.h5"
    assert call("tapes", run, "-d", tmp_path / "tapes").exit_code == 0
    for other in (run, tmp_path / "tapes"):
        for pair in ((swept, other), (other, swept)):
            done = call("diff", *pair)
            assert_unusable(done)
            assert "the result of a sweep" in done.stderr


def test_cases_are_exported_a_row_each_with_their_texts(swept: Path, tmp_path: Path) -> None:
    target = tmp_path / "cases.csv"
    done = call("export", swept, "--to", "csv", "-o", target)
    assert (done.exit_code, done.stdout) == (0, f"{target}\n")
    with target.open(newline="") as file:
        rows = list(csv.DictReader(file))
    loaded = fecm.load_sweep(swept)
    assert [int(row["case"]) for row in rows] == list(range(6))
    assert list(rows[0])[:5] == ["case", "velocity", "layup", "peak_force", "time_of_peak"]
    assert list(rows[0])[-4:] == ["dt", "steps", "status", "validity"]
    assert [float(row["velocity"]) for row in rows] == loaded["velocity"].tolist()
    assert [row["layup"] for row in rows] == loaded["layup"].tolist()
    assert [row["status"] for row in rows] == loaded["status"].tolist()
    np.testing.assert_array_equal([float(row["impulse"]) for row in rows], loaded["impulse"])
    assert call("export", swept, "--to", "csv", "-o", "-").stdout == target.read_text()


def test_columns_of_cases_have_the_units_that_the_deck_names(tmp_path: Path) -> None:
    deck = small_of(data=DATA_CARDS + "UNIT\nmm N s\n")
    sweep = fecm.sweep(deck, {"rod_mass": [1e-3], "velocity": [50.0]}, history=True)
    sweep.export(tmp_path / "cases.csv")
    sweep.export(tmp_path / "history.csv", "history")
    names = (tmp_path / "cases.csv").read_text().splitlines()[0].split(",")
    assert names[:5] == ["case", "rod_mass (t)", "velocity (mm/s)", "peak_force (N)",
                         "time_of_peak (s)"]  # fmt: skip
    assert names[-4:] == ["dt (s)", "steps", "status", "validity"]
    assert "energy_absorbed (N*mm)" in names
    assert (tmp_path / "history.csv").read_text().startswith("case,step,time (s),force (N)\n")


def test_forces_of_the_cases_that_were_run_are_exported_a_row_a_step(swept: Path) -> None:
    done = call("export", swept, "--to", "csv", "--dataset", "history", "-o", "-")
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    loaded = fecm.load_sweep(swept)
    assert loaded.force is not None
    assert len(rows) == int(loaded.steps[loaded.completed].sum()) == 3 * loaded.force.shape[1]
    assert sorted({int(row["case"]) for row in rows}) == np.flatnonzero(loaded.completed).tolist()
    assert max(float(row["force"]) for row in rows) == np.nanmax(loaded["peak_force"])
    last = rows[-1]
    assert float(last["time"]) == pytest.approx(int(last["step"]) * loaded.dt[4], rel=1e-12)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--to", "vtkhdf"), "a sweep has no fields; --to csv writes its cases"),
        (
            ("--to", "csv", "--dataset", "tape3"),
            "unknown table tape3; a sweep has cases and history",
        ),
    ],
)
def test_what_a_sweep_has_not_is_not_exported(
    swept: Path, tmp_path: Path, options: tuple[str, ...], told: str
) -> None:
    done = call("export", swept, *options, "-o", tmp_path / "x")
    assert_unusable(done)
    assert told in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_forces_that_were_not_kept_are_not_exported(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    fecm.sweep(small(), {"velocity": [50.0]}, output=path)
    done = call("export", path, "--to", "csv", "--dataset", "history", "-o", "-")
    assert_unusable(done)
    assert "run it again with --history" in done.stderr


@pytest.mark.parametrize("steps", [-1, 10**6])
def test_steps_that_there_are_not_end_in_one_line(
    changed: Callable[[str, object], Path], steps: int
) -> None:
    bad = changed("history/steps", steps)
    for command in (("info",), ("export", "--to", "csv", "-o", "-")):
        done = call(*command, bad)
        assert_unusable(done)
        assert "history/steps does not match the stored steps" in done.stderr


def test_a_history_streamed_from_stored_tasks_is_the_one_in_memory(tmp_path: Path) -> None:
    # Tasks have cases that are not adjacent, other numbers of steps, or no case that can be run.
    deck = tmp_path / "plate.inp"
    deck.write_text(small())
    vary: dict[str, list[object]] = {
        "k": [1e6, 2e6], "layup": ["[0/90]", "nonsense", "[0]"], "dt": [5e-7, 1e-6],
    }  # fmt: skip
    fecm.sweep(deck, vary, history=True, output=tmp_path / "memory.h5")
    options = [part for n, v in vary.items() for part in ("--vary", f"{n}={','.join(map(str, v))}")]
    done = call(
        "sweep", deck, *options, "--history", "--allow-failed", "-o", tmp_path / "stream.h5"
    )
    assert done.exit_code == 0
    assert (tmp_path / "stream.h5").read_bytes() == (tmp_path / "memory.h5").read_bytes()


MEASURED_TESTS = (
    "Energy (J);Fmax/kN;specimen;dent [mm];n;Temp (°C)\n"
    "0,01;0,62;A1;0,1;3;20\n0,02;0,95;A2;;3;21,5\n"
)


def in_millimetres() -> str:
    return small().replace("COOR\n", "UNIT\nmm N s\nCOOR\n", 1)


def test_columns_that_are_not_varied_stand_beside_the_results_everywhere(tmp_path: Path) -> None:
    table, path = tmp_path / "tests.csv", tmp_path / "s.h5"
    table.write_text(MEASURED_TESTS, encoding="utf-8")
    result = fecm.sweep(in_millimetres(), cases=table, output=path)
    assert result.cases["energy"].tolist() == pytest.approx([10.0, 20.0])
    for read in (result, fecm.load_sweep(path)):
        assert read["measured_Fmax"].tolist() == [620.0, 950.0]  # in N
        assert read["measured_specimen"].tolist() == ["A1", "A2"]
        np.testing.assert_array_equal(read["measured_dent"], [0.1, np.nan])
        assert read["measured_Temp"].tolist() == [20.0, 21.5]
        assert [read.unit(f"measured_{name}") for name in ("Fmax", "dent", "n", "Temp")] == [
            "N",
            "mm",
            "",
            "°C",
        ]
    text = call("export", path, "--to", "csv", "-o", "-").stdout
    row = next(csv.DictReader(io.StringIO(text)))
    measured = {name: value for name, value in row.items() if name.startswith("measured_")}
    assert measured == {
        "measured_Fmax (N)": "620.0",
        "measured_specimen": "A1",
        "measured_dent (mm)": "0.1",
        "measured_n": "3.0",
        "measured_Temp (°C)": "20.0",
    }
    assert "measured_specimen, which are not varied" in call("info", path).stdout


def test_measured_columns_of_python_are_those_of_a_file(tmp_path: Path) -> None:
    table = tmp_path / "tests.csv"
    table.write_text(MEASURED_TESTS, encoding="utf-8")
    deck = in_millimetres()
    rows = [
        {"Energy (J)": 0.01, "Fmax/kN": 0.62, "specimen": "A1", "dent [mm]": 0.1},
        {"Energy (J)": 0.02, "Fmax/kN": 0.95, "specimen": "A2", "dent [mm]": None},
    ]
    of_file, of_python = fecm.sweep(deck, cases=table), fecm.sweep(deck, cases=rows)
    assert of_python["energy"].tolist() == of_file["energy"].tolist()
    for name, column in of_python.measured.items():
        np.testing.assert_array_equal(column, of_file[name])
        assert of_python.unit(name) == of_file.unit(name)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("velocity,energi", "`energi` cannot be varied; did you mean energy"),
        ("velocity,Energie", "did you mean energy[?] .*`measured Energie`"),
        ("velocity,ply thickness", "did you mean ply_thickness"),
        ("velocity,Velocity", "column velocity is repeated"),
        ("Fmax,n", "`Fmax` cannot be varied"),
    ],
)
def test_a_misspelt_value_is_not_taken_for_a_measured_column(
    tmp_path: Path, header: str, message: str
) -> None:
    table = tmp_path / "tests.csv"
    table.write_text(f"{header}\n1,2\n")
    with pytest.raises(CasesError, match=message):
        fecm.sweep(fecm.examples.path("impact-patch"), cases=table)
    names = header.split(",")
    with pytest.raises(CasesError, match=message):
        fecm.sweep(fecm.examples.path("impact-patch"), cases=[dict.fromkeys(names, 1.0)])
