"""Runs that are killed, interrupted or starved of disk: what they leave, and how they go on."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fecm
from fecm.listing.slips import active_slips
from fecm.problem.build import RunOptions
from fecm.problem.loading import load_deck
from fecm.results.sinks import MemorySink
from fecm.simulation.checkpoint import Checkpointer, checkpoint_of
from fecm.simulation.interpreter import Interpreter
from fecm.simulation.run import simulate
from fecm.simulation.simulation import Simulation
from tests.calls import Done, call, program
from tests.decks import DATA_CARDS, LONG, LONGER, PROGRAM, small
from tests.kill_runs import FECM, SWEEP, SWEPT, sweep_trial, trial, verdict
from tests.stopped_runs import StoppedError, stop_at_once


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the long deck and the result of a run that nothing disturbed."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "deck.inp").write_text(LONGER)
    assert call("run", "deck.inp", "-o", "whole.h5", cwd=folder).exit_code == 0
    return folder


def begun(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start a command and wait until it has written a checkpoint of ``i.h5``."""
    command = [*FECM, *arguments, "-o", "i.h5", "--checkpoint", "0"]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60.0
    while not (folder / "i.h5.checkpoint").exists() and time.monotonic() < until:
        time.sleep(0.01)
    return process


@pytest.mark.posix
def test_a_killed_run_resumes_to_the_same_bytes(whole: Path) -> None:
    with begun(whole, "run", "deck.inp") as process:
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert not (whole / "i.h5").exists()
    assert call("run", "deck.inp", "-o", "i.h5", "--resume", cwd=whole).exit_code == 0
    assert verdict(whole, "i.h5", whole / "whole.h5") == "same"


@pytest.mark.posix
@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_a_run_killed_at_any_moment_resumes_to_the_same_bytes(whole: Path, seed: int) -> None:
    assert trial(whole, whole / "whole.h5", 1.2, seed).startswith("same")


@pytest.mark.posix
@pytest.mark.long
def test_killed_sweeps_with_damaged_parts_end_in_the_same_bytes(tmp_path: Path) -> None:
    (tmp_path / "sweep.inp").write_text(SWEPT)
    subprocess.run([*SWEEP, "whole.h5"], cwd=tmp_path, check=True, capture_output=True)
    trials = (sweep_trial(tmp_path, tmp_path / "whole.h5", 2.0, seed) for seed in range(4))
    counts: Counter[str] = sum(trials, Counter())
    assert counts["kills"] > 0
    assert counts["same"] == 4


@pytest.mark.posix
@pytest.mark.parametrize(
    "number", [pytest.param(signal.SIGINT, marks=pytest.mark.long), signal.SIGTERM]
)
@pytest.mark.long
def test_an_interrupted_command_says_how_to_go_on_and_does(
    whole: Path, number: signal.Signals
) -> None:
    command = ("run", "deck.inp", "-o", "i.h5", "--print", "i.txt")
    with begun(whole, "run", "deck.inp", "--print", "i.txt") as process:
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert said.endswith("; the same command with --resume continues i.h5\n")
    assert "interrupted" not in said
    assert not (whole / "i.h5").exists()
    other = call("run", "deck.inp", "-o", "i.h5", "--resume", cwd=whole)
    assert other.exit_code == 2
    assert "another choice of --print" in other.stderr
    assert call(*command, "--resume", cwd=whole).exit_code == 0
    assert (whole / "i.h5").read_bytes() == (whole / "whole.h5").read_bytes()
    printed = (whole / "i.txt").read_text()
    call(*command, "--overwrite", cwd=whole)
    assert (whole / "i.txt").read_text() == printed
    (whole / "i.h5").unlink()
    (whole / "i.txt").unlink()


@pytest.mark.posix
def test_a_second_signal_stops_at_once(tmp_path: Path) -> None:
    program = "LMAS\nDT        .1E-6\nLOOP      99999\nTIME\nRODP       9999\nNEXT\n"
    (tmp_path / "d.inp").write_text(small(program))
    command = [*FECM, "run", "d.inp"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        until = time.monotonic() + 60.0
        while not list(tmp_path.glob(".d.partial.h5")) and time.monotonic() < until:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    assert not (tmp_path / "d.h5").exists()


def test_what_an_interrupted_run_has_left_is_not_thrown_away_unasked(tmp_path: Path) -> None:
    text = small(PROGRAM.replace("     10", "     90"))
    (tmp_path / "d.inp").write_text(text)
    with pytest.raises(StoppedError):
        stop_at_once(load_deck(text).problems[0], tmp_path / "d.h5")
    left = checkpoint_of(tmp_path / "d.h5").read_bytes()
    done = call("run", "d.inp", "--solver", "numpy", cwd=tmp_path)
    assert done.exit_code == 2
    assert "--resume continues it, --overwrite starts over" in done.stderr
    assert checkpoint_of(tmp_path / "d.h5").read_bytes() == left
    assert call("run", "d.inp", "--solver", "numpy", "--overwrite", cwd=tmp_path).exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d.h5", "d.inp"]


def test_resuming_without_a_checkpoint_is_refused(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small())
    done = call("run", "d.inp", "--resume", cwd=tmp_path)
    assert done.exit_code == 2
    assert "there is no checkpoint d.h5.checkpoint" in done.stderr


SECOND = PROGRAM.replace("     10", "     90")
TWO = small(stop=False) + small(SECOND)
RUN_TWO = ("run", "d.inp", "--solver", "numpy", "--checkpoint", "0")


@pytest.fixture
def interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a run that was interrupted in the second of two problems."""
    (tmp_path / "d.inp").write_text(TWO)
    plain = Checkpointer.write

    def write(self: Checkpointer, simulation: Simulation) -> None:
        plain(self, simulation)
        if (tmp_path / "d-2.h5.checkpoint").exists():
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Checkpointer, "write", write)
        assert call(*RUN_TWO, "--print", "p.txt", cwd=tmp_path).exit_code == 130
    return tmp_path


def resumed(folder: Path, *options: str) -> Done:
    """Resume the run of two problems."""
    return call(*RUN_TWO, "--print", "p.txt", "--resume", *options, cwd=folder)


def results(folder: Path) -> dict[str, bytes]:
    """Contents of the outputs of two problems, by name."""
    names = ("d.h5", "d-2.h5", "p.txt", "p-2.txt")
    return {name: (folder / name).read_bytes() for name in names}


def results_of(text: str, folder: Path) -> dict[str, bytes]:
    """Outputs of a run of this deck that nothing interrupts."""
    folder.mkdir()
    (folder / "d.inp").write_text(text)
    assert call(*RUN_TWO, "--print", "p.txt", cwd=folder).exit_code == 0
    return results(folder)


def test_of_two_problems_the_finished_one_is_left_alone(interrupted: Path) -> None:
    times = [(interrupted / name).stat().st_mtime_ns for name in ("d.h5", "p.txt")]
    done = resumed(interrupted)
    assert done.exit_code == 0
    assert "d.h5 is complete" in done.stderr
    assert times == [(interrupted / name).stat().st_mtime_ns for name in ("d.h5", "p.txt")]
    assert results(interrupted) == results_of(TWO, interrupted / "whole")


def test_a_finished_problem_whose_result_was_deleted_is_run_again(interrupted: Path) -> None:
    (interrupted / "d.h5").unlink()
    (interrupted / "p.txt").unlink()
    done = resumed(interrupted)
    assert done.exit_code == 0
    assert "is complete" not in done.stderr
    assert results(interrupted) == results_of(TWO, interrupted / "whole")


def test_a_finished_problem_that_was_edited_is_not_complete(interrupted: Path) -> None:
    edited = small(data=DATA_CARDS.replace("115.0", " 90.0"), stop=False) + small(SECOND)
    (interrupted / "d.inp").write_text(edited)
    before = (interrupted / "d.h5").read_bytes()
    refused = resumed(interrupted)
    assert refused.exit_code == 2
    assert "Traceback" not in refused.stderr
    assert "d.h5 is not what the interrupted run has written for problem 1" in refused.stderr
    assert (interrupted / "d.h5").read_bytes() == before
    done = resumed(interrupted, "--overwrite")
    assert done.exit_code == 0
    assert "d-2.h5 resumes after step" in done.stderr
    assert results(interrupted) == results_of(edited, interrupted / "whole")


@pytest.mark.parametrize("name", ["d.h5", "p.txt"])
@pytest.mark.parametrize("data", [b"", b"of last week"])
@pytest.mark.few(1)  # of 4, 0.4 s each
def test_an_empty_or_foreign_file_is_not_a_complete_result(
    name: str, data: bytes, interrupted: Path
) -> None:
    (interrupted / name).write_bytes(data)
    refused = resumed(interrupted)
    assert refused.exit_code == 2
    assert "Traceback" not in refused.stderr
    assert "--overwrite runs the problem again" in refused.stderr
    assert (interrupted / name).read_bytes() == data
    assert resumed(interrupted, "--overwrite").exit_code == 0
    assert results(interrupted) == results_of(TWO, interrupted / "whole")


@pytest.mark.parametrize("change", ["damaged", "of the version before", "without fingerprints"])
@pytest.mark.few(1)  # of 3, 0.1 s each
def test_a_checkpoint_that_does_not_know_what_is_finished_is_refused(
    change: str, interrupted: Path
) -> None:
    path = checkpoint_of(interrupted / "d-2.h5")
    with np.load(path) as stored:
        arrays = dict(stored)
    about = json.loads(arrays["about"].tobytes())
    if change == "of the version before":
        about["identity"]["another kind of checkpoint"] -= 1
    about.pop("finished")
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    with path.open("wb") as file:
        np.savez(file, **arrays)
    if change == "damaged":
        path.write_bytes(path.read_bytes()[:1000])
    refused = resumed(interrupted)
    assert refused.exit_code == 2
    assert "Traceback" not in refused.stderr
    kind = "another kind of checkpoint" if change == "of the version before" else "is damaged"
    assert kind in refused.stderr
    assert "--overwrite without --resume discards the checkpoint" in refused.stderr


def test_what_stands_beyond_the_interrupted_problem_is_not_taken_for_done(tmp_path: Path) -> None:
    longer = PROGRAM.replace("     10", "     90")
    (tmp_path / "d.inp").write_text(small(longer, stop=False) + small(longer))
    problem = load_deck((tmp_path / "d.inp").read_text()).problems[0]
    with pytest.raises(StoppedError):
        stop_at_once(problem, tmp_path / "d.h5")
    (tmp_path / "d-2.h5").write_text("of last week")
    refused = call("run", "d.inp", "--solver", "numpy", "--resume", cwd=tmp_path)
    assert refused.exit_code == 2
    assert "d-2.h5 exists already; --overwrite replaces it" in refused.stderr
    assert (tmp_path / "d-2.h5").read_text() == "of last week"
    done = call("run", "d.inp", "--solver", "numpy", "--resume", "--overwrite", cwd=tmp_path)
    assert done.exit_code == 0
    assert "d.h5 resumes after step" in done.stderr
    assert (tmp_path / "d-2.h5").read_bytes() == (tmp_path / "d.h5").read_bytes()


@pytest.mark.parametrize("name", ["d.h5.checkpoint", "d.h5.spool", ".d.h5.partial.checkpoint"])
def test_a_folder_with_the_name_of_a_checkpoint_is_refused_before_the_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "d.inp").write_text(small())
    (tmp_path / name).mkdir()
    (tmp_path / name / "file").write_text("precious")
    monkeypatch.setattr(Interpreter, "run", None)  # a run would fail
    for options in ((), ("--overwrite",), ("--resume",)):
        done = call("run", "d.inp", *options, cwd=tmp_path)
        assert done.exit_code == 2
        assert done.stderr.splitlines()[-1] == (
            f"fecm: error: {name} is a folder; remove it, or give the output another name"
        )
    assert (tmp_path / name / "file").read_text() == "precious"


@pytest.mark.posix
@pytest.mark.parametrize("letter", ["x", "ü"])
def test_an_output_whose_checkpoint_would_have_too_long_a_name_is_refused_before_the_run(
    letter: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    most = os.pathconf(tmp_path, "PC_NAME_MAX")
    (tmp_path / "d.inp").write_text(small(SECOND))
    name = (most - 20) // len(letter.encode()) * letter
    with monkeypatch.context() as patch:
        patch.setattr(Interpreter, "run", None)
        done = call("run", "d.inp", "-o", f"{name}.h5", cwd=tmp_path)
    assert done.exit_code == 2
    assert "checkpoint is too long; give the output a shorter one" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["d.inp"]
    shorter = f"{name[:-3]}.h5"  # with room for .NAME.partial.checkpoint
    with pytest.raises(StoppedError):
        stop_at_once(load_deck(tmp_path / "d.inp").problems[0], tmp_path / shorter)
    assert call("run", "d.inp", "-o", shorter, "--overwrite", cwd=tmp_path).exit_code == 0


# Faults ------------------------------------------------------------------------------------------


def small_files(limit: int) -> None:
    """Let no file grow beyond a size, as a full disk does."""
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))


# The kernels write their first checkpoint when the disk is full already.
NUMPY = ("--solver", "numpy")


@pytest.mark.posix
def test_a_disk_that_fills_leaves_the_last_checkpoint_usable(whole: Path) -> None:
    short = LONG.read_text().replace("LOOP       4000", "LOOP       1000")
    (whole / "short.inp").write_text(short)
    (whole / "f.h5").write_text("precious")
    done = program(
        "run",
        "short.inp",
        "-o",
        "f.h5",
        "--overwrite",
        "--checkpoint",
        "0",
        *NUMPY,
        cwd=whole,
        preexec_fn=lambda: small_files(500_000),
    )
    assert done.exit_code == 2
    assert "Traceback" not in done.stderr
    assert "File too large" in done.stderr
    assert (whole / "f.h5").read_text() == "precious"
    again = call("run", "short.inp", "-o", "f.h5", "--resume", *NUMPY, cwd=whole)
    assert again.exit_code == 0
    assert "resumes after step" in again.stderr
    assert call("run", "short.inp", "-o", "n.h5", *NUMPY, cwd=whole).exit_code == 0
    assert (whole / "f.h5").read_bytes() == (whole / "n.h5").read_bytes()


@contextlib.contextmanager
def mounted(folder: Path, size: str) -> Iterator[None]:
    """Mount a small disk in memory over a folder, where this user may do so."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    if subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("nothing can be mounted here")
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.mark.posix
def test_a_read_only_folder_is_told_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small())
    folder = tmp_path / "out"
    with contextlib.ExitStack() as stack:
        if os.geteuid() == 0:  # who may write into any folder, but not onto a read-only disk
            stack.enter_context(mounted(folder, "1m"))
            subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
        else:
            folder.mkdir(mode=0o555)
        done = call("run", "d.inp", "-o", "out/d.h5", cwd=tmp_path)
        assert not list(folder.iterdir())
    assert done.exit_code == 2
    assert re.search("out/.*(Read-only file system|Permission denied)", done.stderr)
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


@pytest.mark.posix
def test_a_small_disk_that_fills_is_told_and_what_was_there_stays(tmp_path: Path) -> None:
    (tmp_path / "deck.inp").write_text(LONGER)
    with mounted(tmp_path / "out", "20m"):  # enough to begin with, not for checkpoints as well
        (tmp_path / "out" / "d.h5").write_text("precious")
        options = ("-o", "out/d.h5", "--overwrite", "--checkpoint", "0")
        done = call("run", "deck.inp", *options, cwd=tmp_path)
        assert done.exit_code == 2
        assert "No space left on device" in done.stderr
        assert "Traceback" not in done.stderr
        assert (tmp_path / "out" / "d.h5").read_text() == "precious"
        left = {path.name for path in (tmp_path / "out").iterdir()}
        assert left <= {"d.h5", "d.h5.checkpoint", "d.h5.spool"}


@pytest.mark.posix
def test_a_folder_that_goes_away_during_the_run_ends_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "d.inp").write_text(small())
    (tmp_path / "out").mkdir()
    plain = Interpreter.run

    def run(self: Interpreter, *arguments: Any) -> None:
        plain(self, *arguments)
        shutil.rmtree(tmp_path / "out")

    monkeypatch.setattr(Interpreter, "run", run)
    done = call("run", "d.inp", "-o", "out/d.h5", cwd=tmp_path)
    assert done.exit_code == 2
    assert "Traceback" not in done.stderr
    assert "out" in done.stderr.splitlines()[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["d.inp"]


@pytest.mark.posix
def test_a_result_that_a_reader_has_open_is_replaced_without_disturbing_it(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small())
    assert call("run", "d.inp", cwd=tmp_path).exit_code == 0
    with h5py.File(tmp_path / "d.h5") as reader:
        before = reader["history/force"][:]
        (tmp_path / "d.inp").write_text(small(data=DATA_CARDS.replace("115.0", " 90.0")))
        assert call("run", "d.inp", "--overwrite", cwd=tmp_path).exit_code == 0
        np.testing.assert_array_equal(reader["history/force"][:], before)
    result = fecm.load(tmp_path / "d.h5")
    assert result.force.max() < before.max()


# Energy ------------------------------------------------------------------------------------------


def test_a_run_that_passes_its_energy_limit_exits_1_and_leaves_no_file(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small(PROGRAM.replace("     10", "    400")))
    done = call("run", "d.inp", "--energy-limit", "1e-9", cwd=tmp_path)
    assert done.exit_code == 1
    assert "the energy balance is off by" in done.stderr
    assert "more than the limit of 1e-09" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["d.inp"]
    assert call("run", "d.inp", cwd=tmp_path).exit_code == 0
    with pytest.raises(fecm.DivergenceError, match="limit"):
        fecm.run(tmp_path / "d.inp", energy_limit=1e-9)


def test_the_listings_rigid_target_is_warned_of_and_not_judged() -> None:
    short = LONG.read_text().replace("LOOP       4000", "LOOP        500")
    problem = load_deck(short, "listing").problems[0]
    sink, sound = MemorySink(), MemorySink()
    simulate(problem, sink, RunOptions(active_slips("listing")))
    assert len([note for note in sink.groups[""]["notes"] if "as slips are active" in note]) == 1
    simulate(load_deck(LONG).problems[0], sound)
    assert "notes" not in sound.groups[""]
