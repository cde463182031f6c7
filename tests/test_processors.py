"""Processors that are free, and what takes them by default."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from fecm import _machine
from fecm.sweeps import execute
from fecm.sweeps.methods import METHODS
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.task import Settings, Task
from tests.decks import model, small


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> pytest.MonkeyPatch:
    """A machine of 16 processors, of which the process may use 8, without ``/proc/loadavg``."""
    monkeypatch.setattr(os, "cpu_count", lambda: 16)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    monkeypatch.setattr(_machine, "LOADS", tmp_path / "loadavg")
    return monkeypatch


@pytest.mark.parametrize(
    ("load", "free"), [(0.0, 8), (8.0, 8), (11.2, 5), (15.9, 1), (16.0, 1), (90.0, 1)]
)
def test_processors_are_free_that_neither_the_load_nor_others_take(
    machine: pytest.MonkeyPatch, load: float, free: int
) -> None:
    machine.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0), raising=False)
    assert _machine.free_processors() == free


@pytest.mark.parametrize(("running", "free"), [(1, 8), (12, 5), (99, 2)])
def test_work_that_has_ended_is_no_load(
    machine: pytest.MonkeyPatch, running: int, free: int
) -> None:
    machine.setattr(os, "getloadavg", lambda: (14.0, 0.0, 0.0), raising=False)
    _machine.LOADS.write_text(f"14.00 9.00 5.00 {running}/700 12345\n")
    assert _machine.free_processors() == free


def test_a_system_without_a_load_has_all_its_processors(machine: pytest.MonkeyPatch) -> None:
    machine.delattr(os, "getloadavg", raising=False)
    assert _machine.free_processors() == 8


def sent(monkeypatch: pytest.MonkeyPatch, seconds: float, most: int) -> tuple[int, int, int]:
    """Ten tasks of so many seconds: those run here, those sent to workers, and their workers."""
    settings = Settings(model(small()))
    tasks = [Task(settings, METHODS[-1], n, (n,), ({"velocity": 1.0 + n},)) for n in range(10)]
    clock, workers = [0.0], [0]
    here: list[int] = []
    others: list[int] = []

    def attempt(task: Task) -> Outcome:
        clock[0] += seconds
        here.append(task.number)
        return Outcome.failed({})

    def on_workers(tasks: list[Task], count: int, *_: object) -> None:
        workers[0] = count
        others.extend(task.number for task in tasks)

    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(execute, "attempt", attempt)
    monkeypatch.setattr(execute, "on_workers", on_workers)
    execute.here_first(tasks, lambda: most, lambda *_: None, lambda: None)
    assert here + others == list(range(10))
    return len(here), len(others), workers[0]


@pytest.mark.parametrize(
    ("seconds", "most", "expected"),
    [
        (0.1, 8, (10, 0, 0)),  # soon done
        (2.0, 8, (1, 9, 8)),
        (2.0, 1, (10, 0, 0)),  # nothing is free
        (2.0, 99, (1, 9, 9)),
        (1.3, 4, (1, 9, 4)),
    ],
)
def test_tasks_go_to_workers_that_are_worth_their_start(
    seconds: float, most: int, expected: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert sent(monkeypatch, seconds, most) == expected


def test_tasks_that_cannot_be_sent_stay_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execute, "_can_be_sent", lambda _: False)
    assert sent(monkeypatch, 5.0, 8) == (10, 0, 0)
