"""Progress where no terminal shows a bar: a line a minute, in a batch job's log."""

from __future__ import annotations

import itertools
import logging
import re
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from queue import Queue
from types import SimpleNamespace

import pytest

import fecm
from fecm._watch import once_a_minute
from fecm.cli import common
from tests.calls import call
from tests.decks import small


class Minutes:
    """An event that is waited for minute by minute, as the test lets them pass."""

    def __init__(self) -> None:
        self.ends: Queue[bool] = Queue()
        self.lines: Queue[str] = Queue()

    def wait(self, seconds: float) -> bool:
        """Wait for the next minute, or for the end."""
        assert seconds == 60.0
        return self.ends.get()

    def set(self) -> None:
        """End the wait."""
        self.ends.put(True)

    def next_line(self) -> str:
        """Let a minute pass; return the line on standard error."""
        self.ends.put(False)
        return self.lines.get(timeout=60.0)


@pytest.fixture
def minutes(monkeypatch: pytest.MonkeyPatch) -> Minutes:
    """Minutes that the test lets pass, and the lines that they bring."""
    built = Minutes()
    # A module of its own, because threads use the events of the true one.
    own = SimpleNamespace(Event=lambda: built, Thread=threading.Thread)
    monkeypatch.setattr(common, "threading", own)
    monkeypatch.setattr(common, "echo", lambda text, *, err: built.lines.put(text))
    return built


def test_a_command_without_a_terminal_says_every_minute_how_far_it_is(minutes: Minutes) -> None:
    before = threading.active_count()
    with common.progress("fecm", 1000, lambda _: "5 cases a second") as advance:
        assert minutes.next_line() == "fecm: 0 of 1000 done after 1 min, 5 cases a second"
        advance(300)
        assert minutes.next_line() == "fecm: 300 of 1000 done after 2 min, 5 cases a second"
    assert threading.active_count() == before
    assert minutes.lines.empty()


def test_a_terminal_gets_no_lines_but_the_bar(
    minutes: Minutes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    before = threading.active_count()
    with common.progress("fecm", 1000) as advance, common.every_minute(str):
        advance(300)
        assert threading.active_count() == before
    assert minutes.lines.empty()


def test_a_command_goes_on_without_lines_if_it_gets_no_thread(
    minutes: Minutes, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    with common.progress("fecm", 1000) as advance:
        advance(300)
    assert minutes.lines.empty()


class OneMinute:
    """An event: one minute passes, then the wait ends."""

    is_over = False

    def wait(self, seconds: float) -> bool:
        """Return whether the wait has ended, in turns False and True."""
        assert seconds == 60.0
        self.is_over = not self.is_over
        return not self.is_over

    def set(self) -> None:
        """End the wait, which ends in any case."""


class AtBeginAndEnd:
    """A thread that does its work at once: when it starts, and again when it is joined."""

    ident = 1

    def __init__(self, target: Callable[[], None], *, daemon: bool) -> None:
        assert daemon
        self.start = self.join = target


@pytest.fixture
def _line_at_begin_and_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each block print its line when it begins and when it ends, and no thread run."""
    monkeypatch.setattr(common, "threading", SimpleNamespace(Event=OneMinute, Thread=AtBeginAndEnd))


@pytest.mark.usefixtures("_line_at_begin_and_end")
def test_a_sweep_a_search_and_a_run_in_full_say_how_far_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = itertools.count(1000.0, 4.0)  # at the begin, and at each of the two lines
    monkeypatch.setattr("fecm.cli.sweep.time", SimpleNamespace(monotonic=lambda: next(seconds)))
    (tmp_path / "d.inp").write_text(small())
    swept = call("sweep", "d.inp", "--vary", "k=1e6,2e6", "--full", 1, "-o", "s.h5", cwd=tmp_path)
    assert re.findall(r"^fecm: (\d) of 2 done after 1 min", swept.stderr, re.M) == ["0", "2"]
    assert "2 of 2 done after 1 min, 0.25 cases a second\n" in swept.stderr
    assert re.search(r"^fecm: case 1 is run in full, 1 min so far$", swept.stderr, re.M)
    find = ("--find", "velocity", "--until", "peak_force=1")
    answer = call("sweep", "d.inp", *find, "-o", "f.h5", cwd=tmp_path)
    assert re.findall(r"^fecm: (\d) of 1 done after 1 min", answer.stderr, re.M) == ["0", "1"]


@pytest.mark.usefixtures("_line_at_begin_and_end")
@pytest.mark.long
def test_a_fit_says_how_many_forces_it_has_computed(tmp_path: Path) -> None:
    for name in ("impact-patch.inp", "measured-force.csv"):
        call("example", name, cwd=tmp_path)
    done = call("identify", "impact-patch.inp", "measured-force.csv", "--free", "k", cwd=tmp_path)
    text = re.findall(r"^fecm: (\d+) trial forces after 1 min$", done.stderr, re.M)
    numbers = list(map(int, text))
    assert numbers == sorted(numbers)
    assert numbers[0] == 0
    assert numbers[-1] > 5


def test_a_minute_has_passed_once_a_minute() -> None:
    now = 0.0
    due = once_a_minute(lambda: now)
    values = []
    for second in range(0, 200, 25):
        now = float(second)
        if due():
            values.append(second)
    assert values == [75, 150]


def test_the_log_of_a_library_call_gets_the_progress(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fecm._watch.once_a_minute", lambda: lambda: True)
    with caplog.at_level(logging.INFO, "fecm"):
        result = fecm.run_one(small())
        fecm.sweep(small(), {"k": [1e6, 2e6]})
    steps = len(result.force)
    assert f"small plate: {steps} of {steps} done" in caplog.messages
    assert caplog.messages[-2:] == ["small plate: 2 cases", "small plate: 2 of 2 done"]
