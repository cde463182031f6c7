"""What the commands do, from Python: checks, comparisons, verification and exports."""

from __future__ import annotations

import contextlib
import csv
import doctest
import json
import os
import pickle
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

import fecm
from fecm._text import jsonable
from tests.calls import call, datasets_of, program
from tests.decks import APPENDIX, DATA_CARDS, LONG, PROGRAM, small
from tests.test_check import WRONG


@pytest.mark.parametrize(
    "documented",
    [
        fecm.check,
        fecm.mesh_error,
        fecm.diff,
        fecm.assert_same,
        fecm.verify,
        fecm.Result.export,
        fecm.SweepResult.export,
    ],
    ids=lambda documented: str(documented.__qualname__),
)
@pytest.mark.few(2)  # of 7, 0.7 s each
def test_the_examples_in_the_docstrings_give_what_they_show(
    documented: object, tmp_path: Path
) -> None:
    runner = doctest.DocTestRunner(verbose=False)
    tests = doctest.DocTestFinder(recurse=False).find(documented, "example", globs={})
    with contextlib.chdir(tmp_path):
        for one in tests:
            runner.run(one)
    assert sum(len(one.examples) for one in tests) > 2
    assert runner.failures == 0


# Checks ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("deck", [WRONG[0], APPENDIX], ids=["wrong", "sound"])
def test_a_check_in_python_says_what_the_command_prints(deck: Path) -> None:
    actual = fecm.check(deck)
    printed = call("check", deck)
    assert f"{actual}\n" == printed.stdout
    assert actual.ok == (printed.exit_code == 0)
    lines = call("check", deck, "--format", "json").stdout.splitlines()
    assert [json.loads(line) for line in lines] == jsonable(actual.to_dicts())


def test_a_deck_with_errors_is_an_answer_and_no_exception() -> None:
    actual = fecm.check(small(data=DATA_CARDS.replace("  1150000.", "       0.0")))
    assert not actual.ok
    assert [finding.code for finding in actual.errors] == ["E403"]
    assert actual.problems == ()
    with pytest.raises(fecm.DeckError):
        fecm.run_one(small(data=DATA_CARDS.replace("  1150000.", "       0.0")))


def test_each_problem_of_a_deck_has_its_summary() -> None:
    (problem,) = fecm.check(LONG).problems
    # The report's critical time step.
    assert problem.critical_time_step == pytest.approx(0.4748e-6, rel=1e-2)
    assert (problem.nodes, problem.equations, problem.steps) == (609, 1827, 4000)
    two = small().removesuffix("STOP\n") + small()
    assert [one.nodes for one in fecm.check(two).problems] == [25, 25]


def test_listing_mode_refuses_what_the_printed_program_lacks_and_other_modes_are_unknown() -> None:
    deck = fecm.examples.path("impact-patch")
    assert fecm.check(deck).ok
    assert not fecm.check(deck, "listing").ok
    with pytest.raises(ValueError, match="unknown mode 'raport'"):
        fecm.check(deck, "raport")  # type: ignore[arg-type]


def test_a_check_goes_to_another_process_and_back() -> None:
    actual = pickle.loads(pickle.dumps(fecm.check(APPENDIX)))
    assert str(actual) == str(fecm.check(APPENDIX))
    assert actual.problems[0].D[0, 0] == pytest.approx(1287.414844365, rel=1e-10)


# Comparisons -------------------------------------------------------------------------------------


def test_a_comparison_in_python_says_what_the_command_prints(runs: Path) -> None:
    a, b = runs / "report.h5", runs / "listing.h5"
    difference = fecm.diff(a, b)
    assert f"{difference}\n" == call("diff", a, b).stdout
    document = json.loads(call("diff", a, b, "--format", "json").stdout)
    assert document == jsonable(difference.to_dict())
    assert not difference.same
    (force,) = (one for one in difference.datasets if one.name == "history/force")
    # Peaks of the original program: 6.190 lb and 6.642 lb, both in step 10.
    assert force.values == pytest.approx((6.190, 6.642), abs=5e-4)
    assert force.at is not None
    assert (force.at.step, force.at.index) == (10, (9,))


@pytest.mark.long
def test_results_in_memory_compare_as_their_files(tmp_path: Path, runs: Path) -> None:
    result = fecm.run_one(small())
    for other in (runs / "small.h5", fecm.load(runs / "small.h5"), fecm.run_one(small())):
        difference = fecm.diff(result, other)
        assert difference.same
        assert (difference.listed, difference.only_in_a, difference.only_in_b) == ([], [], [])
    faster = fecm.run_one(small(data=DATA_CARDS.replace("     115.0", "     116.0")))
    faster.save(tmp_path / "faster.h5")
    in_memory = fecm.diff(result, faster)
    of_files = fecm.diff(runs / "small.h5", tmp_path / "faster.h5")
    assert in_memory.lines() == of_files.lines()
    assert in_memory.datasets == of_files.datasets


def test_sweeps_compare_in_memory_too(tmp_path: Path) -> None:
    sweep = fecm.sweep(small(), {"velocity": [50.0, 60.0]})
    sweep.save(tmp_path / "sweep.h5")
    fecm.assert_same(sweep, tmp_path / "sweep.h5", rtol=None)
    other = fecm.sweep(small(), {"velocity": [50.0, 61.0]})
    difference = fecm.diff(sweep, other, only="cases")
    assert difference.different == ["cases/velocity"]
    at = difference.datasets[0].at
    assert at is not None
    assert at.axes == {"case": 1}
    with pytest.raises(ValueError, match="a Deck is not a result"):
        fecm.diff(sweep, fecm.read_one(small()))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="A is the result of a run and B the result of a sweep"):
        fecm.diff(fecm.run_one(small()), sweep)


def test_tolerances_of_their_own_hold_in_the_order_of_the_mapping(runs: Path) -> None:
    a, b = runs / "report.h5", runs / "listing.h5"
    names = ["history/force", "history/velocity"]
    wide: dict[str, float | tuple[float, ...]] = {
        "history": 1.0,
        "history/force": (0.0, 0.5),
    }  # 0.452 lb apart
    assert fecm.diff(a, b, only=names, tol=wide).same
    narrow: dict[str, float | tuple[float, ...]] = {"history/force": (0.0, 0.5), "history": 1e-9}
    assert fecm.diff(a, b, only=names, tol=narrow).different == names
    values = ["--tol", "history=1", "--tol", "history/force=0,.5"]
    assert call("diff", a, b, "--only", "history/force", *values).exit_code == 0
    again = ["--tol", "history=1e-9"]  # given last
    assert call("diff", a, b, "--only", "history/force", *values, *again).exit_code == 1


@pytest.mark.parametrize("wrong", [-1.0, float("nan"), float("inf"), "1e-6", (1e-6, 0.0, 0.0), ()])
def test_a_tolerance_that_is_no_number_from_0_is_refused(wrong: object, runs: Path) -> None:
    a = runs / "small.h5"
    with pytest.raises(ValueError, match="a tolerance is a finite number from 0"):
        fecm.diff(a, a, tol={"history": wrong})  # type: ignore[dict-item]
    if not isinstance(wrong, tuple):
        with pytest.raises(ValueError, match="rtol is"):
            fecm.diff(a, a, rtol=wrong)  # type: ignore[arg-type]


def test_a_result_that_is_not_the_trusted_one_fails_with_the_lines_about_the_difference(
    runs: Path, tmp_path: Path
) -> None:
    changed = Path(shutil.copy(runs / "small.h5", tmp_path))
    with h5py.File(changed, "r+") as file:
        file["history/force"][4] *= 1.0 + 1e-5
    fecm.assert_same(changed, runs / "small.h5", rtol=1e-4)
    fecm.assert_same(changed, runs / "small.h5", exclude="history/force")
    with pytest.raises(AssertionError) as failed:
        fecm.assert_same(fecm.load(changed), runs / "small.h5")
    head, *lines = str(failed.value).splitlines()
    assert str(changed) in head
    assert str(runs / "small.h5") in head
    assert [line.split()[:2] for line in lines[:-1]] == [["different", "history/force"]]
    assert "at step 5 (time 2.5e-06)" in lines[0]
    count = len(datasets_of(changed))
    assert lines[-1] == f"different: 1 of {count} datasets at rtol 1e-06, atol 0"


# Verification ------------------------------------------------------------------------------------


def test_verification_in_python_has_the_rows_of_the_command() -> None:
    rows = fecm.verify("isotropic-ply", "wave-fronts")
    document = json.loads(call("verify", "isotropic-ply", "wave-fronts", "--format", "json").stdout)
    assert [row.to_dict() for row in rows] == document["rows"]
    assert all(row.within for row in rows)
    # E h / (1 - nu^2) of the ply of the case.
    assert rows[0].got == pytest.approx(1e6 * 1.0 / (1.0 - 0.3**2), rel=1e-12)
    with pytest.raises(ValueError, match="unknown case wavefronts"):
        fecm.verify("wavefronts")


# Exports -----------------------------------------------------------------------------------------


def test_an_export_in_python_is_the_file_of_the_command(runs: Path, tmp_path: Path) -> None:
    result = fecm.load(runs / "small.h5")
    for name, arguments in {
        "a.csv": (),
        "b.csv": ("tape3/w",),
        "c.vtkhdf": (),
    }.items():
        result.export(tmp_path / name, *arguments)
        asked = [word for one in arguments for word in ("--dataset", one)]
        to = name.partition(".")[2]
        value = tmp_path / f"command-{name}"
        assert call("export", runs / "small.h5", "--to", to, *asked, "-o", value).exit_code == 0
        assert value.read_bytes() == (tmp_path / name).read_bytes()


def test_exports_that_can_not_be_meant_are_refused_and_files_are_kept(
    runs: Path, tmp_path: Path
) -> None:
    result = fecm.load(runs / "small.h5")
    with pytest.raises(fecm.FecmError, match="'txt' is not a format of exports; known are vtkhdf"):
        result.export(tmp_path / "a.txt")
    result.export(tmp_path / "a.txt", to="csv")
    with pytest.raises(OSError, match="exists already"):
        result.export(tmp_path / "a.txt", to="csv")
    result.export(tmp_path / "a.txt", "energy", to="csv", overwrite=True)
    assert (tmp_path / "a.txt").read_text().startswith("step,time,plate_kinetic")
    with pytest.raises(fecm.FecmError, match="vtkhdf holds all fields"):
        result.export(tmp_path / "a.vtkhdf", "energy")
    with pytest.raises(fecm.FecmError, match="no dataset tape4"):
        result.export(tmp_path / "b.csv", "tape4")
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_fields_that_are_exported_incompletely_are_a_warning(tmp_path: Path) -> None:
    result = fecm.run_one(small(PROGRAM.replace("RODP          5", "RODP         10")))
    with pytest.warns(fecm.FecmWarning, match=r"strains \(tape8\) were stored at 1 of 2"):
        result.export(tmp_path / "plate.vtkhdf")


def test_the_cases_of_a_sweep_are_exported_with_all_their_bits(tmp_path: Path) -> None:
    sweep = fecm.sweep(small(), {"velocity": [50.0, 60.0]})
    sweep.export(tmp_path / "cases.csv")
    with (tmp_path / "cases.csv").open() as file:
        rows = list(csv.DictReader(file))
    np.testing.assert_array_equal([float(r["peak_force"]) for r in rows], sweep["peak_force"])
    with pytest.raises(OSError, match="exists already"):
        sweep.export(tmp_path / "cases.csv")
    with pytest.raises(fecm.FecmError, match="no stored forces"):
        sweep.export(tmp_path / "history.csv", "history")


# Summaries ---------------------------------------------------------------------------------------


def test_a_printed_result_is_the_summary_of_the_run_with_its_doubts(tmp_path: Path) -> None:
    with warnings.catch_warnings(action="ignore"):
        result = fecm.run_one(small())
    (tmp_path / "small.inp").write_text(small())
    printed = call("run", "small.inp", cwd=tmp_path)
    lines = str(result).splitlines()
    notes = [f"note: {text}" for text in result.notes]
    shown = [line for line in printed.stdout.splitlines() if not line.startswith("  result ")]
    assert lines == [*shown, "", *notes]
    assert printed.stderr.splitlines()[-len(notes) :] == [f"fecm: {note}" for note in notes]
    assert str(fecm.load(tmp_path / "small.h5")) == str(result)


UNGUARDED = """
import fecm
deck = fecm.read_one({deck!r})
fecm.sweep(deck, {{"layup": ["[0]", "[90]"]}}, workers=2, output="sweep.h5")
"""


def test_a_script_without_the_main_guard_is_told_so_and_leaves_no_result(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED.format(deck=small()))
    done = subprocess.run(
        [sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    message = done.stderr.splitlines()[-1]
    assert "no worker process could start" in message
    assert '`if __name__ == "__main__":`' in message
    assert [file.name for file in tmp_path.iterdir()] == ["script.py"]


@pytest.mark.long
def test_commands_run_without_docstrings_and_under_a_notebooks_backend(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small())
    surroundings = {
        **os.environ,
        "PYTHONOPTIMIZE": "2",
        "MPLBACKEND": "module://not_installed.backend",
    }
    run = program("run", "d.inp", cwd=tmp_path, env=surroundings)
    assert run.exit_code == 0, run.stderr
    assert "Traceback" not in run.stderr
    plot = program("plot", "d.h5", "--kind", "force", "-o", "f.png", cwd=tmp_path, env=surroundings)
    assert plot.exit_code == 0, plot.stderr
    assert (tmp_path / "f.png").stat().st_size > 1000
