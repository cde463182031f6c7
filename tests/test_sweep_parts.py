"""What a sweep has finished: damage is found, and what was lost with a worker is not finished."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from fecm.sweeps import schedule
from fecm.sweeps.api import carry_out, problem_of
from fecm.sweeps.batch import run
from fecm.sweeps.grid import grid
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.parts import DamagedPartError, OtherSweepError, PartialResults, alone
from fecm.sweeps.plan import Plan, Task, plan, tasks
from fecm.sweeps.schedule import LOST
from fecm.sweeps.timing import with_time_step
from tests.calls import assert_unusable, call
from tests.decks import model, small
from tests.kill_runs import SWEEP, SWEPT


@pytest.fixture
def made() -> Plan:
    """Two plates."""
    return plan(problem_of(model(small())), grid([("layup", ["[0/90]", "[90/0]"])]), history=True)


def test_a_part_with_any_byte_changed_or_cut_off_is_damaged(made: Plan, tmp_path: Path) -> None:
    parts = PartialResults(tmp_path / "s.h5", made.fingerprint())
    task = tasks(problem_of(made.settings.deck), made)[0]
    parts.put(task, run(task))
    (path,) = parts.folder.glob("task-*.npz")
    data = path.read_bytes()
    found = parts.get(task)
    assert found is not None
    assert found.force is not None
    random = np.random.default_rng(3)
    for at in random.integers(len(data), size=100).tolist():
        path.write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
        with pytest.raises(DamagedPartError):
            parts.get(task)
        path.write_bytes(data[:at])
        with pytest.raises(DamagedPartError):
            parts.get(task)


def test_cases_lost_with_their_workers_are_not_stored_as_finished(
    made: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def attempt(task: Task) -> Outcome:
        return run(task) if task.number else Outcome.failed(dict.fromkeys(task.numbers, LOST))

    monkeypatch.setattr(schedule, "attempt", attempt)
    parts = PartialResults(tmp_path / "s.h5", made.fingerprint())
    problem = problem_of(made.settings.deck)
    found = carry_out(problem, made, parts=parts)
    assert found.completed.tolist() == [False, True]
    assert [parts.get(task) is None for task in tasks(problem, made)] == [True, False]


def test_a_sweep_that_was_killed_before_its_first_plate_was_done_begins_again(
    tmp_path: Path,
) -> None:
    deck, result = tmp_path / "s.inp", tmp_path / "s.h5"
    deck.write_text(small())
    left = tmp_path / ".s.h5.parts"
    left.mkdir()
    (left / ".sweep.partial.json").write_text("")
    done = call("sweep", deck, "--vary", "k=1e6", "-o", result)
    assert done.exit_code == 0, done.stderr
    assert result.exists()
    assert not left.exists()


def test_an_outcome_without_the_mark_of_its_sweep_is_not_taken(made: Plan, tmp_path: Path) -> None:
    parts = PartialResults(tmp_path / "s.h5", made.fingerprint())
    (task, *_) = tasks(problem_of(made.settings.deck), made)
    parts.put(task, run(task))
    (parts.folder / "sweep.json").unlink()
    with pytest.raises(OtherSweepError, match="another sweep"):
        PartialResults(tmp_path / "s.h5", made.fingerprint())
    again = PartialResults(tmp_path / "s.h5", made.fingerprint(), restart=True)
    assert again.get(task) is None


def test_two_sweeps_begun_at_once_do_not_write_the_same_parts(tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    deck, result = tmp_path / "s.inp", tmp_path / "s.h5"
    deck.write_text(small())
    command = ("sweep", deck, "--vary", "k=1e6", "-o", result)
    with alone(result):
        refused = call(*command)
        assert_unusable(refused)
        assert "s.h5 is being computed by another process" in refused.stderr
        assert not result.exists()
    assert call(*command).exit_code == 0


def workers_of(pid: int) -> list[int]:
    """Worker processes that a process has started."""
    try:
        found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [int(child) for child in found if b"spawn_main" in arguments_of(int(child))]


def arguments_of(pid: int) -> bytes:
    """Command line of a process; empty where the process has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def parts_in(folder: Path) -> list[str]:
    """Names of the parts of the sweep into ``s.h5``."""
    return sorted(path.name for path in (folder / ".s.h5.parts").glob("task-*.npz"))


def begun(folder: Path) -> subprocess.Popen[str]:
    """Start a sweep with two workers and wait until one of its eight plates is finished."""
    (folder / "sweep.inp").write_text(SWEPT.replace("LOOP        500", "LOOP       4000"))
    command = [*SWEEP, "s.h5", "--workers", "2"]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60.0
    while not parts_in(folder) and time.monotonic() < until:
        time.sleep(0.02)
    return process


@pytest.mark.long
@pytest.mark.linux
def test_the_workers_of_a_killed_sweep_end_too(tmp_path: Path) -> None:
    process = begun(tmp_path)
    workers = workers_of(process.pid)
    assert len(workers) == 2
    process.kill()
    process.wait()
    until = time.monotonic() + 30.0
    while (left := list(filter(arguments_of, workers))) and time.monotonic() < until:
        time.sleep(0.1)
    for worker in left:
        os.kill(worker, signal.SIGKILL)
    process.communicate()
    assert not left
    assert 1 <= len(parts_in(tmp_path)) < 8


@pytest.mark.long
@pytest.mark.linux
def test_a_sweep_whose_workers_are_all_killed_keeps_its_parts_for_the_next(tmp_path: Path) -> None:
    process = begun(tmp_path)
    while process.poll() is None:
        for worker in workers_of(process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)
        time.sleep(0.02)
    _, said = process.communicate()
    assert process.returncode == 1
    assert "cases were lost with their workers; --overwrite runs them again" in said
    assert "Traceback" not in said
    assert 1 <= len(parts_in(tmp_path)) < 8
    subprocess.run([*SWEEP, "s.h5", "--overwrite"], cwd=tmp_path, check=True, capture_output=True)
    assert not parts_in(tmp_path)
    subprocess.run([*SWEEP, "whole.h5"], cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / "s.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()


@pytest.mark.parametrize("address", ["blah", "tcp://blah", "tcp://127.0.0.1:0", "tcp://[::1:1"])
def test_an_address_that_is_none_is_refused_in_one_line(address: str, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    deck = tmp_path / "plate.inp"
    deck.write_text(small())
    done = call("sweep", deck, "--vary", "k=1e6", "--scheduler", address, "-o", tmp_path / "s.h5")
    assert done.exit_code == 2
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("fecm: error")]
    assert address in line
    assert "Traceback" not in done.stderr


def test_another_time_step_keeps_duration_and_rows() -> None:
    deck = model(small())  # 10 steps of 5e-7, stored every 5
    made = with_time_step(deck, 1e-7)
    values = {macro.word: macro.value for macro in made.macros}
    assert (values["DT"], values["LOOP"], values["RODP"], values["DISP"]) == (1e-7, 50, 25, 25)
    longer = with_time_step(deck, 3e-7)
    values = {macro.word: macro.value for macro in longer.macros}
    assert values["LOOP"] == 17  # 5e-6 / 3e-7 = 16.7, rounded up
