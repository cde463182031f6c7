"""Runs that are stopped, killed or starved of disk go on to the same bytes, or say why not."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fecm
from fecm.api import load_deck
from fecm.problem.options import RunOptions
from fecm.problem.problem import Problem
from fecm.problem.slips import active_slips
from fecm.results import hdf5_writer
from fecm.results.sinks import MemorySink, RowBuffer
from fecm.simulation.checkpoint import Checkpointer, CheckpointError, checkpoint_of, spool_of
from fecm.simulation.run import run as simulate_run
from fecm.simulation.run import simulate
from fecm.simulation.simulation import Simulation
from fecm.simulation.spool import Journal, SpoolError
from tests.calls import call
from tests.decks import DATA_CARDS, LONG, MESH, PROGRAM, small
from tests.kill_runs import SWEEP, SWEPT, sweep_trial, trial

# Two problems' worth of words in one: nested loops, loads, a change of the time step, gages.
WORDS = """\
LMAS
DT        .5E-6
PROP          1
LOOP          3
LOOP         50
TIME
RODP          7
DISP          5
NEXT
REAC
STRE
DT        .4E-6
NEXT
CHEC
LOOP         40
TIME
EXCD
NEXT
"""
TABLE = "    1    1       0.0       1.0     100.0\n"
LOADED = (
    "FORC\n    8    0       0.0       0.0       1.0\n\n"
    "GAGE\n1, 0.5, 0.5, 0.053, 45.\n\nPROJ\n3, 0, 1.0, 30.E6, .0006875\n1, 1, 0.2\n3, 0, 0.6\n\n"
)


class StoppedError(Exception):
    """The run is stopped for the test's sake."""


def deck(program: str = WORDS) -> str:
    """A small deck that uses many words."""
    text = small(program, data=LOADED + DATA_CARDS, stop=False)
    return f"{text}{TABLE}STOP\n" if "PROP" in program else f"{text}STOP\n"


def run(
    text: str,
    path: Path,
    stop: int = 0,
    *,
    resume: bool = False,
    slips: str = "",
    macros: bool = False,
) -> int:
    """Run a deck into a file; stop with a checkpoint at the n-th look, between steps or macros.

    Returns
    -------
    int
        Looks that there were.
    """
    looks = 0

    def look(simulation: Simulation) -> None:
        nonlocal looks
        looks += 1
        if looks == stop:
            checkpointer.write(simulation)
            raise StoppedError

    problem = load_deck(text).problems[0]
    names = frozenset(slips.split())
    with hdf5_writer.writing(path) as sink:
        journal = Journal(sink)
        checkpointer = Checkpointer(path, journal)
        simulation = Simulation(problem, journal, RunOptions(names))
        if macros:
            simulation.on_macro = look
        else:
            simulation.observers, simulation.interval = (look,), 1
        if resume:
            checkpointer.restore(simulation)
        simulate_run(simulation)
    checkpointer.clear()
    return looks


@pytest.mark.parametrize("slips", ["", "rod-dt tapes reload", "counter prop-contact rod-force"])
def test_a_run_stopped_anywhere_goes_on_to_the_same_bytes(tmp_path: Path, slips: str) -> None:
    whole = tmp_path / "whole.h5"
    looks = run(deck(), whole, slips=slips)
    assert looks == 3 * 50 + 40
    chance = random.Random(7)
    for stop in [1, 50, 51, 149, 150, 151, looks, *chance.sample(range(2, looks), 12)]:
        path = tmp_path / "stopped.h5"
        with pytest.raises(StoppedError):
            run(deck(), path, stop, slips=slips)
        assert not path.exists()
        # StoppedError once more on the way, and then not any more.
        if stop < looks - 3:
            with pytest.raises(StoppedError):
                run(deck(), path, 3, resume=True, slips=slips)
        run(deck(), path, resume=True, slips=slips)
        assert path.read_bytes() == whole.read_bytes(), f"stopped at {stop}"
        assert sorted(p.name for p in tmp_path.iterdir()) == ["stopped.h5", "whole.h5"]
        path.unlink()


# The corners hold the plate, so that it has a static displacement.
LAST = "   25    0    1    1    0    0    0\n"
HELD = MESH.replace(
    LAST, LAST + "".join(f"{node:5d}    0    1    1    1    0    0\n" for node in (1, 5, 21, 25))
)

# Passes of loops that step, solve, leave early or do nothing.
STATIC = """\
TANG
LOOP          3
LOOP          4
FORM
SOLV
CONV
DISP
NEXT
LOOP          5
NEXT
REAC
NEXT
LMAS
DT        .5E-6
LOOP          4
TIME
RODP          2
NEXT
"""


def test_a_run_stopped_between_any_two_macros_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    text = small(STATIC, mesh=HELD, data=LOADED + DATA_CARDS)
    whole, path = tmp_path / "whole.h5", tmp_path / "stopped.h5"
    looks = run(text, whole, macros=True)
    # 3 passes of a static loop, left in its second pass by CONV, of 5 empty ones and of REAC; LMAS
    # and DT; 8 macros in steps; the loops themselves. CONV that leaves is the end of its loop, and
    # so is the last of the empty passes.
    first = 4 + 2
    assert looks == 1 + (first + 1 + 5 + 1) + 2 * (2 + 1 + 5 + 1) + 1 + 2 + 8 + 1
    for stop in range(1, looks + 1):
        with pytest.raises(StoppedError):
            run(text, path, stop, macros=True)
        run(text, path, resume=True, macros=True)
        assert path.read_bytes() == whole.read_bytes(), f"stopped at {stop}"
        path.unlink()


def test_a_checkpoint_of_another_run_is_refused_and_says_why(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5)
    for text, slips, why in (
        (deck(WORDS.replace(".5E-6", ".3E-6")), "", "another deck"),
        (deck(), "density", "another mode or other slips"),
    ):
        with pytest.raises(CheckpointError, match=why):
            run(text, path, resume=True, slips=slips)
    stored = checkpoint_of(path).read_bytes()
    checkpoint_of(path).write_bytes(stored[: len(stored) // 2])
    with pytest.raises(CheckpointError, match="damaged"):
        run(deck(), path, resume=True)
    checkpoint_of(path).write_bytes(stored)
    spool_of(path).write_bytes(spool_of(path).read_bytes()[:-9])
    with pytest.raises(SpoolError, match="damaged, or was written by another run"):
        run(deck(), path, resume=True)
    checkpoint_of(path).unlink()
    with pytest.raises(CheckpointError, match="there is no checkpoint"):
        run(deck(), path, resume=True)
    assert not path.exists()


@pytest.mark.parametrize("place", [0.02, 0.5, 0.999])
def test_a_spool_with_one_other_bit_is_refused(tmp_path: Path, place: float) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 60)
    spool = bytearray(spool_of(path).read_bytes())
    spool[int(place * len(spool))] ^= 1
    spool_of(path).write_bytes(spool)
    with pytest.raises(SpoolError, match="damaged, or was written by another run"):
        run(deck(), path, resume=True)
    assert not path.exists()


@pytest.mark.parametrize("lost", ["about", "identity", "values", "plate", "length", "recorder"])
def test_a_checkpoint_that_lacks_something_is_refused(tmp_path: Path, lost: str) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5)
    with np.load(checkpoint_of(path)) as stored:
        arrays = {name: stored[name] for name in stored.files}
    about = json.loads(arrays.pop("about").tobytes())
    about.pop(lost, None)
    about["spool"].pop(lost, None)
    kept = {name: array for name, array in arrays.items() if lost not in name}
    if lost != "about":
        kept["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    with checkpoint_of(path).open("wb") as file:
        np.savez(file, **kept)
    with pytest.raises(CheckpointError, match="damaged"):
        run(deck(), path, resume=True)


def altered(path: Path, change: str) -> None:
    """Write a checkpoint that fits its spool and its run, but for one value or array."""
    with np.load(checkpoint_of(path)) as stored:
        arrays = {name: stored[name] for name in stored.files}
    about = json.loads(arrays.pop("about").tobytes())
    text = ""
    match change:
        case "deep":
            text = "[" * 100_000
        case "stored":
            about["values"]["recorder/steps/stored"] = -1
        case "place":
            about["values"]["state/position"] = [[0, 1]]
        case "words":
            about["values"]["state/dt"] = "soon"
        case "shape":
            arrays["state/plate/padded"] = arrays["state/plate/padded"][:1]
        case "type":
            arrays["state/plate/padded"] = arrays["state/plate/padded"].astype("S8")
        case "spool":
            line = b'{"do": "write", "path": "tape3/w", "start": -1, "rows": 1, "dtype": "<f8", '
            line += b'"shape": [-1]}\n' + b"[" * 100_000 + b"\n"
            spool_of(path).write_bytes(line)
            about["spool"] = {"length": len(line), "checksum": zlib.crc32(line)}
    told = np.frombuffer((text or json.dumps(about)).encode(), np.uint8)
    pack = np.savez_compressed if change == "compressed" else np.savez
    with checkpoint_of(path).open("wb") as file:
        pack(file, about=told, **arrays)


@pytest.mark.parametrize(
    "change", ["deep", "stored", "place", "words", "shape", "type", "spool", "compressed"]
)
def test_a_checkpoint_that_was_made_up_is_refused_in_one_line(
    tmp_path: Path, change: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = deck()
    Path("d.inp").write_text(text)
    problem = load_deck(text).problems[0]
    with pytest.raises(StoppedError):
        stop_at_once(problem, Path("d.h5"))
    altered(Path("d.h5"), change)
    done = call("run", "d.inp", "--resume")
    assert done.exit_code == 2
    assert re.search(r"d\.h5\.(checkpoint|spool).*--overwrite without --resume", done.stderr)
    assert not Path("d.h5").exists()


@pytest.mark.parametrize(
    "name", ["run.h5.spool", "run.h5.checkpoint", ".run.h5.partial.checkpoint"]
)
def test_a_planted_link_leads_no_checkpoint_elsewhere(tmp_path: Path, name: str) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    (tmp_path / name).symlink_to(victim)
    with pytest.raises(StoppedError):
        run(deck(), tmp_path / "run.h5", 5)
    assert victim.read_text() == "precious"
    run(deck(), tmp_path / "run.h5", resume=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.h5", "victim"]


def test_a_spool_that_became_a_link_is_not_followed(tmp_path: Path) -> None:
    with pytest.raises(StoppedError):
        run(deck(), tmp_path / "run.h5", 5)
    spool = spool_of(tmp_path / "run.h5")
    spool.rename(tmp_path / "elsewhere")
    spool.symlink_to("elsewhere")
    with pytest.raises(OSError, match=r"run\.h5\.spool"):
        run(deck(), tmp_path / "run.h5", resume=True)


def test_a_checkpoint_that_can_not_be_written_leaves_the_one_before_in_force(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RowBuffer, "BYTES", 1)  # so that rows are stored all the time
    whole, path = tmp_path / "whole.h5", tmp_path / "run.h5"
    run(deck(), whole)
    looks: list[str] = []

    def savez(*arguments: object, **arrays: object) -> None:
        raise OSError(28, "No space left on device")

    def look(simulation: Simulation) -> None:
        looks.append("")
        if len(looks) in (20, 60):
            checkpointer.write(simulation)
        if len(looks) == 40:  # the spool is written, the checkpoint is not
            with monkeypatch.context() as patch:
                patch.setattr(np, "savez", savez)
                with pytest.raises(OSError, match="No space"):
                    checkpointer.write(simulation)
        if len(looks) == 70:
            raise StoppedError

    with contextlib.suppress(StoppedError), hdf5_writer.writing(path) as sink:
        journal = Journal(sink)
        checkpointer = Checkpointer(path, journal)
        simulation = Simulation(load_deck(deck()).problems[0], journal, observers=(look,))
        simulation.interval = 1
        simulate_run(simulation)
    assert len(looks) == 70
    run(deck(), path, resume=True)
    assert path.read_bytes() == whole.read_bytes()


def test_a_checkpoint_of_another_version_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(StoppedError):
        run(deck(), path, 5)
    monkeypatch.setattr("fecm.simulation.checkpoint.__version__", "99.0")
    with pytest.raises(CheckpointError, match="another version"):
        run(deck(), path, resume=True)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the long deck and the result of a run that nothing disturbed."""
    folder = tmp_path_factory.mktemp("whole")
    shutil.copy(LONG, folder / "deck.inp")
    assert fecm_in(folder, "run", "deck.inp", "-o", "whole.h5").returncode == 0
    return folder


def fecm_in(folder: Path, *arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder."""
    command = [sys.executable, "-m", "fecm", *arguments]
    how: dict[str, Any] = {"cwd": folder, "capture_output": True, "text": True, **options}
    done: subprocess.CompletedProcess[str] = subprocess.run(command, check=False, **how)
    return done


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.long) for n in (1, 2, 3))])
def test_a_killed_run_resumes_to_the_same_bytes(whole: Path, seed: int) -> None:
    assert trial(whole, whole / "whole.h5", 1.2, seed).startswith("same")


@pytest.mark.long
def test_killed_sweeps_with_damaged_parts_end_in_the_same_bytes(tmp_path: Path) -> None:
    (tmp_path / "sweep.inp").write_text(SWEPT)
    subprocess.run([*SWEEP, "whole.h5"], cwd=tmp_path, check=True, capture_output=True)
    trials = (sweep_trial(tmp_path, tmp_path / "whole.h5", 2.0, seed) for seed in range(4))
    counts: Counter[str] = sum(trials, Counter())
    assert counts["kills"] > 0
    assert counts["same"] == 4


def test_an_interrupted_command_says_how_to_go_on_and_does(whole: Path) -> None:
    for number, status in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        command = [
            sys.executable,
            "-m",
            "fecm",
            "run",
            "deck.inp",
            "-o",
            "i.h5",
            "--print",
            "i.txt",
        ]
        with subprocess.Popen(command, cwd=whole, stderr=subprocess.PIPE, text=True) as process:
            until = time.monotonic() + 20.0
            while not list(whole.glob(".i.partial.h5")) and time.monotonic() < until:
                time.sleep(0.01)
            time.sleep(0.1)
            process.send_signal(number)
            _, said = process.communicate(timeout=20)
        assert process.returncode == status
        assert said.endswith("; the same command with --resume continues i.h5\n")
        assert "interrupted" not in said
        assert not (whole / "i.h5").exists()
        other = fecm_in(whole, "run", "deck.inp", "-o", "i.h5", "--resume")
        assert other.returncode == 2
        assert "another choice of --print" in other.stderr
        done = fecm_in(whole, "run", "deck.inp", "-o", "i.h5", "--print", "i.txt", "--resume")
        assert done.returncode == 0
        assert (whole / "i.h5").read_bytes() == (whole / "whole.h5").read_bytes()
        printed = (whole / "i.txt").read_text()
        fecm_in(whole, "run", "deck.inp", "-o", "i.h5", "--print", "i.txt", "--overwrite")
        assert (whole / "i.txt").read_text() == printed
        (whole / "i.h5").unlink()
        (whole / "i.txt").unlink()


def test_a_second_signal_stops_at_once(tmp_path: Path) -> None:
    program = "LMAS\nDT        .1E-6\nLOOP      99999\nTIME\nRODP       9999\nNEXT\n"
    (tmp_path / "d.inp").write_text(small(program))
    command = [sys.executable, "-m", "fecm", "run", "d.inp"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        until = time.monotonic() + 20.0
        while not list(tmp_path.glob(".d.partial.h5")) and time.monotonic() < until:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 130
    assert not (tmp_path / "d.h5").exists()


def test_what_an_interrupted_run_has_left_is_not_thrown_away_unasked(whole: Path) -> None:
    problem = load_deck(LONG).problems[0]
    with pytest.raises(StoppedError):
        stop_at_once(problem, whole / "l.h5")
    left = checkpoint_of(whole / "l.h5").read_bytes()
    done = fecm_in(whole, "run", "deck.inp", "-o", "l.h5")
    assert done.returncode == 2
    assert "--resume continues it, --overwrite starts over" in done.stderr
    assert checkpoint_of(whole / "l.h5").read_bytes() == left
    assert fecm_in(whole, "run", "deck.inp", "-o", "l.h5", "--overwrite").returncode == 0
    assert sorted(path.name for path in whole.glob("l.h5*")) == ["l.h5"]
    (whole / "l.h5").unlink()


def test_resuming_without_a_checkpoint_is_refused(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small())
    done = fecm_in(tmp_path, "run", "d.inp", "--resume")
    assert done.returncode == 2
    assert "there is no checkpoint d.h5.checkpoint" in done.stderr


def stop_at_once(problem: Problem, path: Path) -> None:
    """Stop a run with a checkpoint, as soon as it looks up."""
    with hdf5_writer.writing(path) as sink:
        journal = Journal(sink)
        checkpointer = Checkpointer(path, journal)

        def look(simulation: Simulation) -> None:
            checkpointer.write(simulation)
            raise StoppedError

        simulate_run(Simulation(problem, journal, observers=(look,)))


def test_of_two_problems_the_finished_one_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(
        small(stop=False) + small(PROGRAM.replace("     10", "     90"))
    )
    assert fecm_in(tmp_path, "run", "d.inp").returncode == 0
    first, second = (tmp_path / "d.h5").read_bytes(), (tmp_path / "d-2.h5").read_bytes()
    (tmp_path / "d-2.h5").unlink()
    problem = load_deck((tmp_path / "d.inp").read_text()).problems[1]
    with pytest.raises(StoppedError):
        stop_at_once(problem, tmp_path / "d-2.h5")
    done = fecm_in(tmp_path, "run", "d.inp", "--resume")
    assert done.returncode == 0
    assert "d.h5 is complete" in done.stderr
    assert (tmp_path / "d.h5").read_bytes() == first
    assert (tmp_path / "d-2.h5").read_bytes() == second


def test_what_stands_beyond_the_interrupted_problem_is_not_taken_for_done(tmp_path: Path) -> None:
    longer = PROGRAM.replace("     10", "     90")
    (tmp_path / "d.inp").write_text(small(longer, stop=False) + small(longer))
    problem = load_deck((tmp_path / "d.inp").read_text()).problems[0]
    with pytest.raises(StoppedError):
        stop_at_once(problem, tmp_path / "d.h5")
    (tmp_path / "d-2.h5").write_text("of last week")
    refused = fecm_in(tmp_path, "run", "d.inp", "--resume")
    assert refused.returncode == 2
    assert "d-2.h5 exists already; --overwrite replaces it" in refused.stderr
    assert (tmp_path / "d-2.h5").read_text() == "of last week"
    done = fecm_in(tmp_path, "run", "d.inp", "--resume", "--overwrite")
    assert done.returncode == 0
    assert "d.h5 resumes after step" in done.stderr
    assert (tmp_path / "d-2.h5").read_bytes() == (tmp_path / "d.h5").read_bytes()


# Faults ------------------------------------------------------------------------------------------


def small_files(limit: int) -> None:
    """Let no file grow beyond a size, as a full disk does."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))


def test_a_disk_that_fills_leaves_the_last_checkpoint_usable(whole: Path) -> None:
    (whole / "f.h5").write_text("precious")
    done = fecm_in(whole, "run", "deck.inp", "-o", "f.h5", "--overwrite", "--checkpoint", "0",
                   preexec_fn=lambda: small_files(2_000_000))  # fmt: skip
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "File too large" in done.stderr
    assert (whole / "f.h5").read_text() == "precious"
    again = fecm_in(whole, "run", "deck.inp", "-o", "f.h5", "--resume")
    assert again.returncode == 0
    assert "resumes after step" in again.stderr
    assert (whole / "f.h5").read_bytes() == (whole / "whole.h5").read_bytes()


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


def test_a_read_only_folder_is_told_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small())
    folder = tmp_path / "out"
    with contextlib.ExitStack() as stack:
        if os.geteuid() == 0:  # who may write into any folder, but not onto a read-only disk
            stack.enter_context(mounted(folder, "1m"))
            subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
        else:
            folder.mkdir(mode=0o555)
        done = fecm_in(tmp_path, "run", "d.inp", "-o", "out/d.h5")
        assert not list(folder.iterdir())
    assert done.returncode == 2
    assert re.search("out/.*(Read-only file system|Permission denied)", done.stderr)
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_a_small_disk_that_fills_is_told_and_what_was_there_stays(tmp_path: Path) -> None:
    shutil.copy(LONG, tmp_path / "deck.inp")
    with mounted(tmp_path / "out", "20m"):  # enough to begin with, not for checkpoints as well
        (tmp_path / "out" / "d.h5").write_text("precious")
        options = ("-o", "out/d.h5", "--overwrite", "--checkpoint", "0")
        done = fecm_in(tmp_path, "run", "deck.inp", *options)
        assert done.returncode == 2
        assert "No space left on device" in done.stderr
        assert "Traceback" not in done.stderr
        assert (tmp_path / "out" / "d.h5").read_text() == "precious"
        left = {path.name for path in (tmp_path / "out").iterdir()}
        assert left <= {"d.h5", "d.h5.checkpoint", "d.h5.spool"}


def test_a_folder_that_goes_away_during_the_run_ends_in_one_line(tmp_path: Path) -> None:
    program = "LMAS\nDT        .1E-6\nLOOP      30000\nTIME\nRODP       9999\nNEXT\n"
    (tmp_path / "d.inp").write_text(small(program))
    (tmp_path / "out").mkdir()
    command = [sys.executable, "-m", "fecm", "run", "d.inp", "-o", "out/d.h5"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        until = time.monotonic() + 20.0
        while not list((tmp_path / "out").iterdir()) and time.monotonic() < until:
            time.sleep(0.01)
        shutil.rmtree(tmp_path / "out")
        _, said = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "Traceback" not in said
    assert "out" in said.splitlines()[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["d.inp"]


def test_a_result_that_a_reader_has_open_is_replaced_without_disturbing_it(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small())
    assert fecm_in(tmp_path, "run", "d.inp").returncode == 0
    with h5py.File(tmp_path / "d.h5") as reader:
        before = reader["history/force"][:]
        (tmp_path / "d.inp").write_text(small(data=DATA_CARDS.replace("115.0", " 90.0")))
        assert fecm_in(tmp_path, "run", "d.inp", "--overwrite").returncode == 0
        np.testing.assert_array_equal(reader["history/force"][:], before)
    found = fecm.load(tmp_path / "d.h5")
    assert found.force.max() < before.max()


# Energy ------------------------------------------------------------------------------------------


def test_a_run_that_passes_its_energy_limit_exits_1_and_leaves_no_file(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small(PROGRAM.replace("     10", "    400")))
    done = fecm_in(tmp_path, "run", "d.inp", "--energy-limit", "1e-9")
    assert done.returncode == 1
    assert "the energy balance is off by" in done.stderr
    assert "more than the limit of 1e-09" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["d.inp"]
    assert fecm_in(tmp_path, "run", "d.inp").returncode == 0
    with pytest.raises(fecm.DivergenceError, match="limit"):
        fecm.run(tmp_path / "d.inp", energy_limit=1e-9)


def test_the_listings_rigid_target_is_warned_of_and_not_judged() -> None:
    problem = load_deck(LONG, "listing").problems[0]
    simulation = simulate(problem, MemorySink(), RunOptions(active_slips("listing")))
    assert (
        len([note for note in simulation.state.notes if "slips are on: it is not judged" in note])
        == 1
    )
    sound = simulate(load_deck(LONG).problems[0], MemorySink())
    assert sound.state.notes == []
