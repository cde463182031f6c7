"""What a sweep has finished: damage is found, and what was lost with a worker is not finished."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm._files import OutputError, beside
from fecm.authoring.time_values import with_time_step
from fecm.problem.loading import sole_problem
from fecm.sweeps import execute
from fecm.sweeps.case_tables import grid_cases
from fecm.sweeps.execute import LOST, carry_out_plan
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.partial_results import DamagedPartError, OtherSweepError, PartialResults
from fecm.sweeps.plan import plan
from fecm.sweeps.task import Plan, Task, run_task, tasks
from tests.calls import Done, assert_unusable, call
from tests.decks import DATA_CARDS, model, small
from tests.kill_runs import SWEEP, SWEPT


@pytest.fixture
def made() -> Plan:
    """Two plates."""
    return plan(
        sole_problem(model(small())), grid_cases([("layup", ["[0/90]", "[90/0]"])]), history=True
    )


def test_a_part_with_any_byte_changed_or_cut_off_is_damaged(made: Plan, tmp_path: Path) -> None:
    parts = PartialResults(tmp_path / "s.h5", made.fingerprint())
    task = tasks(made)[0]
    parts.put(task, run_task(task))
    (path,) = parts.folder.glob("task-*.npz")
    data = path.read_bytes()
    actual = parts.get(task)
    assert actual is not None
    assert actual.force is not None
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
        return run_task(task) if task.number else Outcome.failed(dict.fromkeys(task.numbers, LOST))

    monkeypatch.setattr(execute, "attempt", attempt)
    parts = PartialResults(tmp_path / "s.h5", made.fingerprint())
    problem = sole_problem(made.settings.deck)
    outcome = carry_out_plan(problem, made, parts=parts)
    assert outcome.completed.tolist() == [False, True]
    assert [parts.get(task) is None for task in tasks(made)] == [True, False]


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
    (task, *_) = tasks(made)
    parts.put(task, run_task(task))
    (parts.folder / "sweep.json").unlink()
    with pytest.raises(OtherSweepError, match="another sweep"):
        PartialResults(tmp_path / "s.h5", made.fingerprint())
    again = PartialResults(tmp_path / "s.h5", made.fingerprint(), restart=True)
    assert again.get(task) is None


def forged(
    path: Path, change: Callable[[dict[str, Any]], object], *, compressed: bool = False
) -> None:
    """Change the arrays of a part, and give it the right checksum."""
    with np.load(io.BytesIO(path.read_bytes()[:-32])) as stored:
        arrays = dict(stored)
    change(arrays)
    buffer = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(buffer, **arrays)
    sealed(path, buffer.getvalue())


def sealed(path: Path, data: bytes) -> None:
    """Write data with their checksum."""
    path.write_bytes(data + hashlib.sha256(data).digest())


# Changes of a part of one case that leave it a right archive with a right checksum.
FORGERIES: dict[str, Callable[[dict[str, Any]], object]] = {
    "of no sweep": lambda a: a.pop("sweep"),  # as the version before wrote it
    "without numbers": lambda a: a.pop("numbers"),
    "without status": lambda a: a.pop("status"),
    "without a peak": lambda a: a.pop("peak_force"),
    "without columns": lambda a: [a.pop(name) for name in [*a] if name not in ("sweep", "numbers")],
    "of two rows": lambda a: a.update(peak_force=np.zeros(2)),
    "of no row": lambda a: a.update(peak_force=np.float64(1.0)),
    "of texts": lambda a: a.update(peak_force=np.array(["much"])),
    "of complex numbers": lambda a: a.update(peak_force=np.array([1j])),
    "with a status of numbers": lambda a: a.update(status=np.zeros(1)),
    "of negative steps": lambda a: a.update(steps=np.array([-1])),
    "with an unknown column": lambda a: a.update({"../deck": np.zeros(1)}),
    "of flat forces": lambda a: a.update(force=np.zeros(10)),
    "of more forces than steps": lambda a: a.update(force=np.zeros((1, 11))),
    "of forces of other cases": lambda a: a.update(force=np.zeros((2, 10))),
}  # fmt: skip


@pytest.fixture
def stored(tmp_path: Path) -> tuple[Path, Path, bytes]:
    """A sweep of two plates whose first one is finished: its folder, part and right result."""
    (tmp_path / "s.inp").write_text(small())
    problem = sole_problem(tmp_path / "s.inp")
    made = plan(problem, grid_cases([("layup", ["[0/90]", "[90/0]"])]), history=True)
    assert call(*SWEEP_OF_TWO, "right.h5", cwd=tmp_path).exit_code == 0
    parts = PartialResults(tmp_path / "s.h5", made.fingerprint())
    task = tasks(made)[0]
    parts.put(task, run_task(task))
    return tmp_path, parts.folder / "task-000000.npz", (tmp_path / "right.h5").read_bytes()


SWEEP_OF_TWO = ("sweep", "s.inp", "--history", "--vary", "layup=[0/90],[90/0]", "-o")


def assert_run_again(stored: tuple[Path, Path, bytes]) -> str:
    """Resume the sweep; what it says about its part, whose cases it runs again."""
    folder, _, right = stored
    done = call(*SWEEP_OF_TWO, "s.h5", cwd=folder)
    assert done.exit_code == 0, done.stderr
    (said,) = [line for line in done.stderr.splitlines() if "its cases are run again" in line]
    assert (folder / "s.h5").read_bytes() == right
    assert not (folder / ".s.h5.parts").exists()
    return said


def test_a_sound_part_is_taken_without_a_word(stored: tuple[Path, Path, bytes]) -> None:
    folder, _, right = stored
    done = call(*SWEEP_OF_TWO, "s.h5", cwd=folder)
    assert "run again" not in done.stderr
    assert (folder / "s.h5").read_bytes() == right


@pytest.mark.parametrize("what", FORGERIES)
@pytest.mark.few(3)  # of 15, 0.1 s each
def test_a_part_with_a_right_checksum_and_wrong_content_is_run_again(
    what: str, stored: tuple[Path, Path, bytes]
) -> None:
    forged(stored[1], FORGERIES[what])
    assert "task-000000.npz" in assert_run_again(stored)


@pytest.mark.parametrize("data", [b"", b"PK", b"\x93NUMPY", b"PK\x05\x06" + 18 * b"\0"])
@pytest.mark.few(2)  # of 4, 0.1 s each
def test_a_part_that_is_no_archive_is_run_again_despite_its_checksum(
    data: bytes, stored: tuple[Path, Path, bytes]
) -> None:
    sealed(stored[1], data)
    assert_run_again(stored)


def test_a_compressed_part_is_run_again(stored: tuple[Path, Path, bytes]) -> None:
    forged(stored[1], lambda arrays: None, compressed=True)
    assert "damaged" in assert_run_again(stored)


def test_a_part_of_another_sweep_with_the_same_case_numbers_is_run_again(
    stored: tuple[Path, Path, bytes],
) -> None:
    folder, part, _ = stored
    (folder / "other.inp").write_text(small(data=DATA_CARDS.replace("115.0", " 90.0")))
    problem = sole_problem(folder / "other.inp")
    made = plan(problem, grid_cases([("layup", ["[0/90]", "[90/0]"])]), history=True)
    others = PartialResults(folder / "other.h5", made.fingerprint())
    task = tasks(made)[0]
    others.put(task, run_task(task))
    shutil.copy(others.folder / part.name, part)
    assert "belongs to another sweep" in assert_run_again(stored)


@pytest.mark.posix
@pytest.mark.links
@pytest.mark.parametrize("kind", ["folder", "FIFO", "link", "device"])
@pytest.mark.few(2)  # of 4, 0.1 s each
def test_a_part_that_is_no_ordinary_file_is_run_again(
    kind: str, stored: tuple[Path, Path, bytes]
) -> None:
    folder, part, _ = stored
    kept = part.rename(folder / "kept")
    before = kept.read_bytes()
    if kind == "folder":
        part.mkdir()
        (part / "file").touch()
    elif kind == "FIFO":
        os.mkfifo(part)
    else:
        part.symlink_to(kept if kind == "link" else "/dev/zero")
    said = assert_run_again(stored)
    assert ("is a link" if kind in ("link", "device") else "is not a regular file") in said
    assert kept.read_bytes() == before


@pytest.mark.posix
@pytest.mark.links
@pytest.mark.parametrize("kind", ["folder", "FIFO", "link", "device", "long", "deep"])
@pytest.mark.few(2)  # of 6, 0.2 s each
def test_a_mark_that_is_no_ordinary_file_is_not_believed(
    kind: str, stored: tuple[Path, Path, bytes]
) -> None:
    folder, part, right = stored
    mark = part.with_name("sweep.json")
    kept = mark.rename(folder / "kept")
    before = kept.read_bytes()
    if kind == "folder":
        mark.mkdir()
    elif kind == "FIFO":
        os.mkfifo(mark)
    elif kind in ("long", "deep"):
        mark.write_bytes(2000 * b" " + before if kind == "long" else 900 * b"[")
    else:
        mark.symlink_to(kept if kind == "link" else "/dev/zero")
    refused = call(*SWEEP_OF_TWO, "s.h5", cwd=folder)
    assert_unusable(refused)
    assert "holds the outcomes of another sweep" in refused.stderr
    done = call(*SWEEP_OF_TWO, "s.h5", "--overwrite", cwd=folder)
    assert done.exit_code == 0, done.stderr
    assert (folder / "s.h5").read_bytes() == right
    assert kept.read_bytes() == before


@pytest.mark.links
@pytest.mark.parametrize("overwrite", [(), ("--overwrite",)])
def test_nothing_is_read_or_deleted_through_a_folder_of_parts_that_is_a_link(
    overwrite: tuple[str, ...], stored: tuple[Path, Path, bytes]
) -> None:
    folder, part, _ = stored
    part.parent.rename(folder / "elsewhere")
    part.parent.symlink_to(folder / "elsewhere", target_is_directory=True)
    before = sorted((path.name, path.read_bytes()) for path in (folder / "elsewhere").iterdir())
    refused = call(*SWEEP_OF_TWO, "s.h5", *overwrite, cwd=folder)
    assert_unusable(refused)
    assert ".s.h5.parts is a link; remove it" in refused.stderr
    after = sorted((path.name, path.read_bytes()) for path in (folder / "elsewhere").iterdir())
    assert after == before


def test_a_file_with_the_name_of_the_folder_of_parts_is_refused(made: Plan, tmp_path: Path) -> None:
    (tmp_path / ".s.h5.parts").write_text("precious")
    with pytest.raises(OutputError, match="is not a folder; remove it"):
        PartialResults(tmp_path / "s.h5", made.fingerprint())
    assert (tmp_path / ".s.h5.parts").read_text() == "precious"


def test_a_sweep_does_not_begin_while_another_process_writes_its_output(tmp_path: Path) -> None:
    deck, result = tmp_path / "s.inp", tmp_path / "s.h5"
    deck.write_text(small())
    command = ("sweep", deck, "--vary", "k=1e6", "-o", result, "--overwrite")
    with beside(result):
        refused = call(*command)
        assert_unusable(refused)
        assert "s.h5 is being written by another process" in refused.stderr
    assert call(*command).exit_code == 0


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_no_other_command_writes_the_output_of_a_sweep_that_is_running(
    command: str, tmp_path: Path
) -> None:
    deck, result = tmp_path / "s.inp", tmp_path / "s.h5"
    deck.write_text(small())
    others: list[Done] = []

    def write_meanwhile(_: fecm.Result) -> dict[str, float]:
        vary = ["--vary", "k=1e6"] if command == "sweep" else []
        others.append(call(command, deck, *vary, "-o", result, "--overwrite"))
        return {"a": 1.0}

    swept = fecm.sweep(deck, {"k": [1e6]}, measure=write_meanwhile, output=result, overwrite=True)
    (refused,) = others
    assert_unusable(refused)
    assert "s.h5 is being written by another process" in refused.stderr
    assert fecm.load_sweep(result)["a"].tolist() == swept["a"].tolist() == [1.0]


def workers_of(pid: int) -> list[int]:
    """Worker processes that a process has started."""
    try:
        actual = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [int(child) for child in actual if b"spawn_main" in arguments_of(int(child))]


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
