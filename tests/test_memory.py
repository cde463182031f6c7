"""What a run takes of memory is known before, and decks can't exhaust it."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import fecm
import fecm._machine
import fecm.deck.reader
import fecm.problem.memory
from fecm._machine import NotEnoughMemoryError, available_memory, format_bytes
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.loading import load_deck
from fecm.problem.memory import needed_bytes
from fecm.problem.parts import build_plate
from fecm.sweeps.checks import ADVANCED_BYTES, HISTORY_BYTES
from fecm.sweeps.task import MOST_TOGETHER
from tests.calls import assert_unusable, call
from tests.decks import small
from tests.test_nonlinear_decks import text
from tests.test_nonlinear_sweeps import BLOW, PROGRAM

MEGABYTE = 10**6

OWN = """
import fecm
from pathlib import Path
def peak():  # getrusage would tell that of the process before exec
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])
"""
PEAK = """
import os
def warm_up():
    fecm.run({small!r}, output=f"{{os.getpid()}}.h5")
    fecm.run({static!r}, output=f"{{os.getpid()}}-2.h5")
warm_up()
for number in range({count}):
    if not (child := os.fork()):
        warm_up()  # a child has no pages of libraries yet
        before = peak()
        fecm.run(f"{{number}}/plate.inp", output=f"{{number}}/x.h5")
        print(peak() - before, flush=True)
        os._exit(0)
    assert not os.waitpid(child, 0)[1]
"""

IMPACT = "LMAS\nDT        1.E-8\nLOOP         20\nTIME\nRODP         10\nNEXT\n"
STATIC = "TANG\nFORM\nSOLV\nDISP\n"
MODES = "LMAS\nEIGE          5\n"


def plate(folder: Path, elements: int, macros: str, *options: str) -> Path:
    """Write a deck of a square plate with a macro program."""
    path = folder / "plate.inp"
    done = call(
        "new",
        path,
        "--size",
        "6x6",
        "--mesh",
        f"{elements}x{elements}",
        "--layup",
        "[0/90]s",
        "--ply-thickness",
        "0.0053",
        "--ply",
        "0.000148,0.3,1.75e7,1.15e6,8e5,8e5,8e5",
        "--support",
        "clamped",
        "--velocity",
        "100",
        "--law",
        "1912000,0.0006564,0.094,2",
        "--duration",
        "2e-7",
        "--dt",
        "1e-8",
        "--every",
        "10",
        *options,
    )
    assert done.exit_code == 0, done.stderr
    head = path.read_text().partition("MACR")[0]
    path.write_text(f"{head}MACR\n{macros}END\nSTOP\n")
    return path


@pytest.mark.linux
@pytest.mark.long
def test_the_estimate_bounds_what_is_measured(tmp_path: Path) -> None:
    plates: list[tuple[str, int, tuple[str, ...]]] = [
        (IMPACT, 40, ()), (IMPACT, 20, ("--grading", "3", "--at", "2.1,1.3")), (STATIC, 20, ()),
        (MODES, 16, ()),
    ]  # fmt: skip
    estimated = []
    for number, (macros, elements, options) in enumerate(plates):
        (folder := tmp_path / str(number)).mkdir()
        deck = plate(folder, elements, macros, *options)
        estimated.append(needed_bytes(load_deck(deck).problems[0]))
    static = f"{small().partition('MACR')[0]}MACR\nLMAS\nEIGE\nEND\nSTOP\n"
    program = OWN + PEAK.format(small=small(), static=static, count=len(plates))
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    for measured, estimate in zip(map(int, done.stdout.split()), estimated, strict=True):
        assert measured <= estimate <= 4 * measured + 60 * MEGABYTE


ALONE = """
from fecm.problem.loading import load_deck
from fecm.problem.memory import needed_bytes
fecm.run({small!r}, output="small.h5")
fecm.run({static!r}, output="static.h5")
before = peak()
fecm.run("plate.inp", output="x.h5", solver={solver!r})
print(peak() - before, needed_bytes(load_deck("plate.inp").problems[0], solver={solver!r}))
"""
HIT = [
    "--size", "100x100", "--layup", "[0/45/-45/90]s", "--material", "IM7/8552", "--velocity",
    "3", "--projectile", "mass:1e-3", "--contact", "estimate:6", "--support", "clamped",
    "--duration", "4e-6", "--dt", "1e-8",
]  # fmt: skip


@pytest.mark.linux
@pytest.mark.long
@pytest.mark.parametrize(
    ("mesh", "options", "gages", "solver"),
    [
        ("10x10", "", 0, "auto"),
        ("30x30", "", 0, "auto"),
        ("60x60", "", 0, "auto"),
        ("100x100", "", 0, "auto"),
        ("60x60", "", 0, "csr"),
        ("60x60", "", 0, "numpy"),
        ("60x60", "--grading 4 --at 40,30", 0, "auto"),
        ("30x30", "--nonlinear", 0, "auto"),
        ("60x60", "--nonlinear", 0, "auto"),
        ("20x20", "--preload -1,0", 0, "auto"),
        ("40x40", "--preload -1,0", 0, "auto"),
        ("60x60", "--preload -1,0", 0, "auto"),
        ("60x60", "--preload 1,1", 0, "auto"),
        ("60x60", "--damage", 0, "auto"),
        ("30x30", "", 1000, "auto"),
    ],
)
def test_the_estimate_is_near_what_is_measured(
    tmp_path: Path, mesh: str, options: str, gages: int, solver: str
) -> None:
    deck = tmp_path / "plate.inp"
    linear = () if "--nonlinear" in options else ("--kinematics", "linear")
    done = call("new", deck, "--mesh", mesh, *HIT, *linear, *options.split())
    assert done.exit_code == 0, done.stderr
    if gages:
        cards = "".join(
            f"{n},{10 + n * 0.08},{10 + n * 0.07},.01,0.\n" for n in range(1, gages + 1)
        )
        deck.write_text(deck.read_text().replace("\nEXPE", f"\nGAGE\n{cards}\nEXPE"))
    static = f"{small().partition('MACR')[0]}MACR\nLMAS\nEIGE\nEND\nSTOP\n"
    program = OWN + ALONE.format(small=small(), static=static, solver=solver)
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    measured, estimate = map(int, ran.stdout.split())
    assert 0.7 * measured <= estimate <= 2.0 * measured


def test_a_run_that_needs_more_than_is_free_is_refused_with_both_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fecm._machine, "available_memory", lambda: 2 * MEGABYTE)
    deck, output = tmp_path / "small.inp", tmp_path / "small.h5"
    deck.write_text(small().replace("DISP          5", "DISP"))
    done = call("run", deck, "-o", output)
    assert (done.exit_code, done.stdout) == (2, "")
    message = done.stderr.splitlines()[-1]
    assert message.startswith("fecm: error: the run takes about ")
    assert "MB of memory, and 2 MB are free" in message
    assert not output.exists()


@pytest.mark.long
def test_gages_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # 4000 gages on 1008 elements took 119 MB more than none, 1000 gages 40 MB.
    monkeypatch.setattr(fecm._machine, "available_memory", lambda: 30 * MEGABYTE)
    deck = tmp_path / "d.inp"
    deck.write_text(small())
    assert call("run", deck, "-o", tmp_path / "d.h5").exit_code == 0
    cards = "".join(f"{n},1.,1.,.01,0.\n" for n in range(1, 2001))
    deck.write_text(small().replace("EXPE\n", f"GAGE\n{cards}\nEXPE\n"))
    many = call("run", deck, "-o", tmp_path / "many.h5")
    assert many.exit_code == 2
    assert "and 30 MB are free" in many.stderr


def test_a_result_in_memory_counts_with_all_its_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fecm._machine, "available_memory", lambda: 100 * MEGABYTE)
    many = small().replace("LOOP         10", "LOOP      99999").replace("DISP          5", "DISP")
    problem = load_deck(many).problems[0]
    # w and five unknowns of 25 nodes in each of the rows.
    assert needed_bytes(problem, in_memory=True) > 99999 * 25 * 6 * 8
    with pytest.raises(NotEnoughMemoryError, match=r"takes about 1\d\d MB .* store fewer rows"):
        fecm.run(many)


SWEPT = """
deck = {deck!r}
fecm.sweep(deck, {{"velocity": [9.0, 99.0]}})
base = peak()
fecm.sweep(deck, {{"velocity": [50.0 + 0.1 * n for n in range({cases})]}}, history={history})
print(peak() - base)
"""


@pytest.mark.linux
@pytest.mark.parametrize(
    ("steps", "cases", "history"),
    [pytest.param(3000, 700, False, marks=pytest.mark.long), (1500, 1100, True)],
)
@pytest.mark.long
def test_the_estimate_of_a_sweep_bounds_what_is_measured(
    steps: int, cases: int, history: bool
) -> None:
    deck = small(f"LMAS\nDT        .5E-6\nLOOP       {steps}\nTIME\nRODP\nNEXT\n")
    program = OWN + SWEPT.format(deck=deck, cases=cases, history=history)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    measured = int(done.stdout)
    estimated = steps * (
        ADVANCED_BYTES * min(cases, MOST_TOGETHER) + (HISTORY_BYTES * cases if history else 0)
    )
    assert measured <= estimated <= 2 * measured


SOFT = text(PROGRAM, data=BLOW)
SWEEP_ALONE = """
from fecm.sweeps.checks import sweep_memory
fecm.run({small!r}, output="small.h5")
fecm.run({static!r}, output="static.h5")
fecm.sweep({small!r}, random={{"velocity": "normal:50,1"}}, samples=16)
fecm.sweep({nonlinear!r}, {{"velocity": [300.0, 400.0]}}, model="reduced", modes=4)
before = peak()
sweep = fecm.Sweep("plate.inp", workers=1, **{given})
memory = sweep_memory(sweep.problem, sweep.plan, 1)
sweep.execute()
print(peak() - before, memory.needed())
"""
SPEEDS = np.linspace(1000.0, 3000.0, 1000).tolist()


@pytest.mark.linux
@pytest.mark.long
@pytest.mark.parametrize(
    ("mesh", "duration", "options", "given"),
    [
        ("40x40", "2e-4", "--kinematics linear", {"vary": {"velocity": SPEEDS[::20]}}),
        ("40x40", "4e-4", "--kinematics linear", {"vary": {"velocity": SPEEDS}}),
        (
            "20x20",
            "4e-4",
            "--kinematics linear",
            {"vary": {"velocity": SPEEDS[::2]}, "history": True},
        ),
        ("40x40", "1e-4", "--kinematics linear", {"vary": {"thickness": [1.0, 1.2, 1.4]}}),
        (
            "60x60",
            "1e-4",
            "--kinematics linear",
            {"random": {"velocity": "normal:2000,100"}, "samples": 256},
        ),
        (
            "40x40",
            "2e-4",
            "--kinematics linear",
            {"vary": {"k": [1e5, 2e5]}, "until": {"peak_force": 200.0}},
        ),
        (
            "10x10",
            "1e-3",
            "--nonlinear",
            {"vary": {"velocity": SPEEDS[:500:25]}, "model": "reduced"},
        ),
        (
            "20x20",
            "1e-4",
            "--nonlinear",
            {"vary": {"velocity": SPEEDS[:500:25]}, "model": "reduced"},
        ),
        ("10x10", "4e-4", "--nonlinear", {"vary": {"velocity": SPEEDS[::400]}}),
        ("30x30", "3e-5", "--nonlinear", {"vary": {"velocity": SPEEDS[::400]}}),
        (
            "20x20",
            "1e-4",
            "--kinematics linear --damage",
            {"vary": {"velocity": SPEEDS[::400]}, "measure": "failure"},
        ),
    ],
)
def test_the_estimate_of_a_sweep_is_near_what_is_measured(
    tmp_path: Path, mesh: str, duration: str, options: str, given: dict[str, object]
) -> None:
    of_plate = ["--velocity", "3000mm/s", "--projectile", "mass:2e-4", "--units", "mm-N-s"]
    kept = [*HIT[: HIT.index("--velocity")], "--contact", "estimate:6", "--support", "clamped"]
    layup = ["--duration", duration, "--mesh", mesh, *options.split()]
    done = call("new", tmp_path / "plate.inp", *kept, *of_plate, *layup)
    assert done.exit_code == 0, done.stderr
    static = f"{small().partition('MACR')[0]}MACR\nLMAS\nEIGE\nEND\nSTOP\n"
    program = OWN + SWEEP_ALONE.format(small=small(), static=static, nonlinear=SOFT, given=given)
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    measured, estimate = map(int, ran.stdout.split())
    assert 0.7 * measured <= estimate <= 2.0 * measured


def test_the_steps_of_a_sweep_are_those_of_its_longest_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fecm._machine, "available_memory", lambda: 50 * MEGABYTE)
    monkeypatch.setattr("fecm.sweeps.checks.ADVANCED_BYTES", 30)
    deck = tmp_path / "small.inp"
    deck.write_text(small().replace("LOOP         10", "LOOP        100"))
    options = ("--vary", "velocity=50:100:1000", "--history", "-o", tmp_path / "s.h5")
    assert call("sweep", deck, *options, "--vary", "duration=5e-5").exit_code == 0
    # 10,000 steps of 0.5 us, 1000 cases: (24 + 30) bytes a step and case are 540 MB.
    long = call("sweep", deck, *options, "--overwrite", "--vary", "duration=5e-3")
    assert long.exit_code == 2
    assert re.search(r"the sweep takes about 5[45]\d MB", long.stderr), long.stderr


@pytest.mark.parametrize(
    ("options", "free", "remedy"),
    [((), 50, "fewer steps"), (("--workers", "3"), 100, "fewer workers"),
     (("--history",), 400, "none of their histories")],
)  # fmt: skip
def test_a_sweep_that_needs_more_than_is_free_is_refused_with_both_numbers(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[str, ...],
    free: int,
    remedy: str,
) -> None:
    monkeypatch.setattr(fecm._machine, "available_memory", lambda: free * MEGABYTE)
    monkeypatch.setattr("fecm.sweeps.checks.ADVANCED_BYTES", 30)  # with kernels or without
    deck = tmp_path / "small.inp"
    deck.write_text(small().replace("LOOP         10", "LOOP       4500"))
    vary = ("--vary", "velocity=50:100:3000", "-o", tmp_path / "s.h5")
    done = call("sweep", deck, *vary, *options)
    assert (done.exit_code, done.stdout) == (2, "")
    message = done.stderr.splitlines()[-1]
    assert message.startswith("fecm: error: the sweep takes about ")
    assert f"MB of memory, and {free} MB are free; take " in message
    assert remedy in message
    assert [path.name for path in tmp_path.iterdir()] == ["small.inp"]


@pytest.mark.long
def test_matrices_that_do_not_fit_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = load_deck(plate(tmp_path, 46, IMPACT)).problems[0]
    model = build_plate(problem.deck, problem.mesh)
    monkeypatch.setattr(fecm._machine, "available_memory", lambda: 101 * MEGABYTE)
    # 24 bytes for each of the 45 x 45 entries of 2116 matrices.
    message = "assemble the plate's matrices takes about 103 MB of memory, and 101 MB are free"
    with pytest.raises(NotEnoughMemoryError, match=message):
        _ = model.stiffness
    assert critical_time_step(model) > 0.0  # for which no matrix is assembled


def test_many_small_problems_with_large_counts_are_refused() -> None:
    one = "FECM x\n999999999,1,1,2,5,4\nEND\nMACR\nEND\n".replace("999999999", "900000")
    prepared = load_deck(one * 50 + "STOP\n")
    assert len(prepared.problems) == 1
    values = [f.message for f in prepared.findings if "together" in f.message]
    assert len(values) == 49
    assert values[0] == (
        "The file's problems have together NUMNP 1800000; at most 1000000 is allowed."
    )


def _write_on(pipe: int) -> None:
    """Write cards until nobody reads them any more."""
    with contextlib.suppress(BrokenPipeError):
        while True:
            os.write(pipe, b"    1    0\n" * 1000)
    os.close(pipe)


@pytest.mark.posix
def test_a_deck_that_never_ends_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fecm.deck.reader, "available_memory", lambda: 12 * MEGABYTE)
    endless, begin = os.pipe()
    writer = threading.Thread(target=_write_on, args=(begin,))
    writer.start()
    done = call("check", f"/dev/fd/{endless}")
    os.close(endless)
    writer.join()
    assert_unusable(done)
    assert "a deck of more than 1 MB is not read" in done.stderr


@pytest.mark.linux
def test_free_memory_is_the_least_of_machine_and_control_groups(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = tmp_path / "groups" / "batch" / "job"
    job.mkdir(parents=True)
    for name, group in (("MEMINFO", "meminfo"), ("CGROUP", "cgroup"), ("CGROUPS", "groups")):
        monkeypatch.setattr(fecm._machine, name, tmp_path / group)
    (tmp_path / "meminfo").write_text("MemTotal: 9000 kB\nMemAvailable: 4000 kB\n")
    (tmp_path / "cgroup").write_text("0::/batch/job\n")
    assert available_memory() == 4000 * 1024
    (job / "memory.max").write_text("max\n")
    (job / "memory.current").write_text("1000000\n")
    assert available_memory() == 4000 * 1024
    (job.parent / "memory.max").write_text("3000000\n")
    (job.parent / "memory.current").write_text("1000000\n")
    assert available_memory() == 2_000_000


def test_the_system_reports_its_free_memory() -> None:
    free = available_memory()
    assert free is not None
    assert 10 * MEGABYTE < free < 2**46


def test_free_memory_is_that_of_psutil_where_the_system_has_no_file_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fecm._machine, "MEMINFO", tmp_path / "missing")
    monkeypatch.setattr(fecm._machine, "_of_groups", list)
    message = SimpleNamespace(virtual_memory=lambda: SimpleNamespace(available=5 * MEGABYTE))
    monkeypatch.setitem(sys.modules, "psutil", message)
    assert available_memory() == 5 * MEGABYTE
    monkeypatch.setitem(sys.modules, "psutil", None)
    assert available_memory() is None
    fecm._machine.require_memory(10**18, "a matrix")  # unknown memory is no reason to refuse


def test_rows_of_a_file_are_read_without_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: object) -> None:
        raise AssertionError("the whole dataset is read")

    monkeypatch.setattr(h5py.Dataset, "read_direct", refuse)  # which numpy.asarray calls
    with h5py.File(tmp_path / "rows.h5", "w") as file:
        stored = {"tape3/w": file.create_dataset("w", data=np.arange(12.0).reshape(6, 2))}
        rows = fecm.Result(stored, {}, {}).rows("tape3/w", 2, 4)
    assert rows.tolist() == [[4.0, 5.0], [6.0, 7.0]]


@pytest.mark.parametrize(
    ("count", "text"),
    [(999, "999 bytes"), (999_600, "1 MB"), (123_456, "123 kB"), (999_900_000_000, "1 TB"),
     (10**12, "1 TB"), (4 * 10**15, "4,000 TB")],
)  # fmt: skip
def test_bytes_have_the_unit_that_needs_no_exponent(count: int, text: str) -> None:
    assert format_bytes(count) == text
