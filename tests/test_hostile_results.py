"""Damaged result files end in one line, whatever HDF5 makes of them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import pytest

import fecm
from fecm.cli.apart import GB, limits_for
from tests.calls import assert_unusable, call
from tests.decks import small

PROGRAM = """
import collections, itertools, os, signal, sys, time
from pathlib import Path
import click
from fecm.cli import apart, cli, main
from fecm.files import partial_of

def spin(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass

@cli.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("what")
@apart.reads("file")
def act(file, what):
    if what == "crash":
        partial_of(Path("out.h5")).write_text("half")
        os.write(2, b"malloc(): corrupted top size\\n")
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "hang":  # in C, where no signal handler is carried out
        print("hanging", file=sys.stderr, flush=True)
        collections.deque(itertools.repeat(0), maxlen=0)
    if what == "swallow":
        bytearray(10**12)
    if what == "work":
        spin(1.5)
    if what == "no":
        raise SystemExit(1)
    click.echo("done")

main()
"""


def start(folder: Path, what: str, patience: str = "0.4") -> subprocess.Popen[str]:
    """Start a command that does something to itself while it reads a file."""
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "act", "x.h5", what],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder,
        env={**os.environ, "FECM_PATIENCE": patience, "PYTHONPATH": str(Path.cwd())},
    )  # fmt: skip


def ended(folder: Path, what: str) -> tuple[int, str, str]:
    """How such a command ends."""
    program = start(folder, what)
    out, err = program.communicate(timeout=60)
    return program.returncode, out, err


def test_death_by_a_signal_is_one_line_and_leaves_no_partial_file(tmp_path: Path) -> None:
    status, out, err = ended(tmp_path, "crash")
    assert (status, out) == (2, "")
    assert err == (
        "fecm: error: x.h5 can't be read: the HDF5 library broke off (SIGSEGV), as happens with "
        "damaged files\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_call_that_never_comes_back_is_one_line(tmp_path: Path) -> None:
    status, out, err = ended(tmp_path, "hang")
    assert (status, out) == (2, "")
    told = err.removeprefix("hanging\n")
    assert told.startswith("fecm: error: x.h5 can't be read: the HDF5 library did not come back")
    assert told.count("\n") == 1


def test_more_memory_than_is_free_is_one_line(tmp_path: Path) -> None:
    status, out, err = ended(tmp_path, "swallow")
    assert (status, out) == (2, "")
    assert err.startswith("fecm: error: x.h5: this takes more memory than the ")
    assert err.count("\n") == 1


def test_honest_work_may_take_longer_than_one_call(tmp_path: Path) -> None:
    assert ended(tmp_path, "work") == (0, "done\n", "")


def test_the_exit_status_of_the_child_is_the_programs(tmp_path: Path) -> None:
    assert ended(tmp_path, "no") == (1, "", "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_command_whose_child_hangs(tmp_path: Path, number: signal.Signals) -> None:
    program = start(tmp_path, "hang", patience="50")
    assert program.stderr is not None
    assert program.stderr.readline() == "hanging\n"
    begin = time.monotonic()
    program.send_signal(number)
    assert program.wait(timeout=20) == 128 + number
    assert time.monotonic() - begin < 10.0
    program.communicate()


def test_limits_grow_with_the_files() -> None:
    few, many = limits_for(10**5, None), limits_for(10 * GB, None)
    assert (few.memory, round(few.call), round(few.whole)) == (4 * GB + 5 * 10**6, 10, 601)
    assert (many.memory, round(many.call), round(many.whole)) == (504 * GB, 510, 100_600)
    assert limits_for(10 * GB, 8 * GB).memory == 6 * GB


def test_patience_that_is_no_number_is_one_line(tmp_path: Path) -> None:
    program = start(tmp_path, "work", patience="-3")
    out, err = program.communicate(timeout=60)
    assert (program.returncode, out) == (2, "")
    assert err == "fecm: error: FECM_PATIENCE is `-3`; it must be a number of seconds\n"


@pytest.fixture
def result(tmp_path: Path) -> Path:
    path = tmp_path / "sound.h5"
    fecm.run(small(), output=path)
    return path


@pytest.mark.parametrize(
    "command",
    [["export", "--to", "vtkhdf", "-o", "x.vtkhdf"], ["plot", "--kind", "line"], ["tapes"]],
)
def test_a_result_without_its_mesh_is_one_line(
    result: Path, command: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(result.parent)
    with h5py.File(result, "r+") as file:
        del file["mesh"], file["tape3/w"]
    done = call(command[0], result, *command[1:])
    if command != ["tapes"]:
        assert_unusable(done)
    assert "Traceback" not in done.stderr


def test_a_missing_dataset_is_a_missing_key_and_a_missing_attribute(result: Path) -> None:
    with h5py.File(result, "r+") as file:
        del file["mesh/elements"]
    loaded = fecm.load(result)
    with pytest.raises(KeyError, match="there is no mesh/elements"):
        loaded["mesh/elements"]
    with pytest.raises(AttributeError, match="there is no mesh/elements"):
        _ = loaded.mesh.elements
    assert not hasattr(loaded.mesh, "elements")


def test_what_a_file_says_of_itself_does_not_reach_the_terminal_raw(result: Path) -> None:
    with h5py.File(result, "r+") as file:
        file.attrs["format_version"] = "\n\x1b[31m"
    done = call("info", result)
    assert_unusable(done)
    assert "format version \\n\\x1b[31m is not 1" in done.stderr


def fuzz(*arguments: object, patience: str) -> str:
    """Put mutated files through `info` and `diff`; fails where one of them ends badly."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz_results", *map(str, arguments)],
        capture_output=True, text=True, check=False, env={**os.environ, "FECM_PATIENCE": patience},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_mutated_results_end_in_one_line() -> None:
    told = fuzz("--count", 120, "--seed", 1, patience="0.25")
    assert "broken 0" in told
    assert "'info 2'" in told
    assert "'diff 1'" in told


@pytest.mark.long
def test_ten_thousand_mutated_results_end_in_one_line() -> None:
    assert "broken 0" in fuzz("--count", 10_000, "--seed", 100_000, patience="1")


def test_mutated_results_of_sweeps_end_in_one_line() -> None:
    told = fuzz("--count", 16, "--seed", 70, "--sweep", patience="0.25")
    assert "broken 0" in told
    assert "'plot map 0'" in told


def test_a_sweep_whose_cases_are_single_numbers_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "sweep.h5"
    fecm.sweep(small(), {"velocity": [50.0, 100.0]}, output=path)
    with h5py.File(path, "r+") as file:
        del file["cases/velocity"]
        file["cases/velocity"] = 1.0
    done = call("plot", path, "-o", tmp_path / "x.png")
    assert_unusable(done)
    assert "the cases of this result of a sweep are not all there" in done.stderr


def test_elements_of_nodes_that_the_mesh_has_not_are_one_line(result: Path) -> None:
    with h5py.File(result, "r+") as file:
        file["mesh/elements"][0, 0] = 188
    for command, output in (
        (["export", "--to", "vtkhdf"], "x.vtkhdf"),
        (["plot", "--kind", "line"], "x.png"),
    ):
        done = call(command[0], result, *command[1:], "-o", result.with_name(output))
        assert_unusable(done)
        assert "mesh/elements names nodes outside 1 to 25" in done.stderr
    assert [path.name for path in result.parent.iterdir()] == [result.name]
