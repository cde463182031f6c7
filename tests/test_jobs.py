"""Runs, sweeps, fits and locations as objects: price, progress, stop, resume, options."""

from __future__ import annotations

import inspect
import os
import re
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm._options import declared_options
from fecm._watch import show_progress
from fecm.errors import (
    CasesError,
    CheckpointError,
    OptionsError,
    OtherSweepError,
    StoppedError,
    StudyError,
)
from fecm.simulation.job import Solver
from fecm.sweeps.exclusions import exclusions_table
from tests.calls import call
from tests.decks import small
from tests.panels import TIME, struck_on_a_point

ROOT = Path(__file__).resolve().parents[1]
IMPACT = ROOT / "decks/impact-115.inp"
LAYUPS = ["[0/90]", "[90/0]", "[0/45]", "[45/0]"]

pytestmark = pytest.mark.filterwarnings("ignore::fecm.FecmWarning")


class StopAfter(fecm.Watch):
    """Stops a job when so many cases are done, or when it asks for the nth time."""

    def __init__(self, most: int = 10**9, *, asked: int = 10**9) -> None:
        self.most, self.done, self.totals, self.notes = most, 0, set[int](), list[str]()
        self.asked = asked

    def advance(self, done: int, total: int) -> None:
        """Count."""
        self.done = done
        self.totals.add(total)

    def note(self, *texts: str) -> None:
        """Keep notes."""
        self.notes += texts

    def stops(self) -> bool:
        """Whether enough is done."""
        self.asked -= 1
        return self.done >= self.most or self.asked <= 0


@pytest.mark.parametrize("solver", ["numpy", "auto"])
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_a_run_that_was_stopped_resumes_to_the_same_bytes(tmp_path: Path, solver: Solver) -> None:
    whole, stopped = tmp_path / "whole.h5", tmp_path / "stopped.h5"
    fecm.run(small(), output=whole, solver=solver)
    (job,) = fecm.Run(small(), output=stopped, solver=solver).problems
    watch = StopAfter(asked=4)
    with pytest.raises(StoppedError, match=r"stopped after step \d+; .* resume=True continues"):
        job.execute(watch)
    assert not stopped.exists()
    with pytest.raises(CheckpointError, match="resume=True continues it, overwrite=True starts"):
        fecm.run(small(), output=stopped, solver=solver)
    result = fecm.run(small(), output=stopped, solver=solver, resume=True)
    assert stopped.read_bytes() == whole.read_bytes()
    assert isinstance(result, fecm.Result)
    assert list(tmp_path.glob("*.checkpoint")) == []


@pytest.fixture
def _interruptible() -> Iterator[None]:
    """Let SIGINT interrupt, also in a shell that ignores SIGINT in background jobs."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.posix
@pytest.mark.usefixtures("_interruptible")
def test_an_interrupt_of_a_run_with_a_file_leaves_a_checkpoint(tmp_path: Path) -> None:
    def interrupt(done: int, total: int) -> None:
        if 0 < done < total:
            os.kill(os.getpid(), signal.SIGINT)

    path = tmp_path / "r.h5"
    with pytest.raises(KeyboardInterrupt, match="resume=True continues"):
        fecm.run(IMPACT, output=path, solver="numpy", progress=interrupt)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    resumed = fecm.run_one(IMPACT, output=path, solver="numpy", resume=True)
    np.testing.assert_array_equal(resumed.force, fecm.run_one(IMPACT, solver="numpy").force)


def test_a_sweep_that_was_stopped_resumes_to_the_same_bytes(tmp_path: Path) -> None:
    whole, stopped = tmp_path / "whole.h5", tmp_path / "stopped.h5"
    vary: dict[str, list[Any]] = {"layup": LAYUPS, "k": [1e6, 2e6]}
    fecm.sweep(small(), vary, output=whole, history=True)
    watch = StopAfter(4)
    with pytest.raises(StoppedError, match=r"after 4 of 8 cases; the same call resumes"):
        fecm.Sweep(small(), vary, output=stopped, history=True).execute(watch)
    with pytest.raises(OtherSweepError, match="overwrite=True deletes them"):
        fecm.sweep(small(), {"k": [1e6]}, output=stopped)
    computed: list[int] = []
    result = fecm.sweep(
        small(), vary, output=stopped, history=True, progress=lambda done, _: computed.append(done)
    )
    assert stopped.read_bytes() == whole.read_bytes()
    assert computed == [2, 4, 6, 8]
    assert result.force is not None
    np.testing.assert_array_equal(result.force, fecm.load_sweep(whole).force)
    assert {path.name for path in tmp_path.iterdir()} == {"whole.h5", "stopped.h5"}


@pytest.mark.posix
@pytest.mark.usefixtures("_interruptible")
@pytest.mark.parametrize(
    ("after", "text"),
    [(2, r"after \d of 8 cases; the same call resumes"), (8, "the result of .* is complete")],
)
@pytest.mark.few(1)  # of 2, 0.3 s each
def test_an_interrupt_of_a_sweep_says_what_is_left(tmp_path: Path, after: int, text: str) -> None:
    def interrupt(done: int, total: int) -> None:
        if done == after:
            os.kill(os.getpid(), signal.SIGINT)

    whole, path = tmp_path / "whole.h5", tmp_path / "s.h5"
    vary: dict[str, list[Any]] = {"layup": LAYUPS, "k": [1e6, 2e6]}
    with pytest.raises(KeyboardInterrupt, match=text):
        fecm.sweep(small(), vary, output=path, progress=interrupt)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert path.exists() == (after == 8)
    fecm.sweep(small(), vary, output=path, overwrite=True)
    fecm.sweep(small(), vary, output=whole)
    assert path.read_bytes() == whole.read_bytes()


def test_a_sweep_of_the_command_is_resumed_from_python(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(small())
    done = call("sweep", "d.inp", "--vary", f"layup={','.join(LAYUPS)}", "-o", "a.h5", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    fecm.sweep(tmp_path / "d.inp", f"layup={','.join(LAYUPS)}", output=tmp_path / "b.h5")
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_without_resume_all_cases_are_computed_again(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with pytest.raises(StoppedError):
        fecm.Sweep(small(), {"layup": LAYUPS}, output=path).execute(StopAfter(2))
    job = fecm.Sweep(small(), {"layup": LAYUPS}, output=path, resume=False)
    with pytest.raises(StoppedError, match="same call with resume=True resumes this sweep"):
        job.execute(StopAfter(2))
    watch = StopAfter(100)
    job.execute(watch)
    assert watch.done == 4
    assert path.exists()


def test_cases_are_run_in_full_from_python_too(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    swept = fecm.sweep(IMPACT, {"k": [1e6, 2e6]}, output=path, full=[1])
    full = fecm.load(tmp_path / "s-1.h5")
    assert full.force.max() == pytest.approx(swept["peak_force"][1], rel=1e-9)


def test_the_price_of_a_run_and_a_sweep_is_known_before_they_start(tmp_path: Path) -> None:
    run = fecm.Run(IMPACT, output=tmp_path / "r.h5")
    result = run.execute()
    assert isinstance(result, fecm.Result)
    price = run.price
    assert price.steps == len(result.force)
    assert 0.9 < (tmp_path / "r.h5").stat().st_size / price.output_bytes < 1.1
    assert price.seconds > 0.0
    assert f"{price.steps} steps" in str(price)
    shared = fecm.Sweep(IMPACT, {"k": [1e6, 2e6, 3e6]}).price
    apart = fecm.Sweep(IMPACT, {"layup": LAYUPS}).price
    assert (shared.steps, apart.steps) == (price.steps, 4 * price.steps)
    assert apart.seconds > 0.0


def test_a_fit_is_a_job_with_a_price_that_a_watch_may_stop() -> None:
    deck, table = fecm.examples.path("impact-patch"), fecm.examples.path("measured-force.csv")
    job = fecm.IdentificationJob(deck, table, "k", filter="first-order:5e-6")
    assert job.price.steps == fecm.Run(deck).price.steps
    assert job.price.seconds > 0.0
    assert job.price.memory_bytes > 0
    assert str(job.price) in job._repr_html_()
    with pytest.raises(StoppedError, match=r"stopped after \d+ trial forces"):
        job.execute(StopAfter(8))
    watch = StopAfter()
    fit = job.execute(watch)
    assert fit.values["k"] == pytest.approx(1.912e6, rel=0.02)  # of the deck that was measured
    assert watch.done >= 8
    with pytest.raises(StudyError, match="can't fit mess; fit different ones of"):
        fecm.IdentificationJob(deck, table, "mess")


def test_a_location_is_a_job_with_a_price_that_a_watch_may_stop() -> None:
    deck, strains, _ = struck_on_a_point()
    close: dict[str, Any] = {"region": (52.0, 38.0, 72.0, 58.0), "grid": 20.0, "mesh_error": False}
    job = fecm.LocationJob(deck, (TIME, strains), **close)
    # One run of the plate per gage, which has at least a step for every point of the record.
    assert job.price.steps % strains.shape[1] == 0
    assert job.price.steps >= strains.size - strains.shape[1]
    assert job.price.seconds > 0.0
    assert f"{len(strains.T)} gages" in job._repr_html_()
    with pytest.raises(StoppedError, match="no place is known yet"):
        job.execute(StopAfter(2))
    location = job.execute()
    same = fecm.locate(deck, (TIME, strains), **close)
    assert (location.x, location.y, location.peak_force) == (same.x, same.y, same.peak_force)
    with pytest.raises(StudyError, match="region has 3 numbers"):
        fecm.LocationJob(deck, (TIME, strains), region=(1.0, 2.0, 3.0))


def test_the_progress_has_the_seconds_that_are_left(capsys: pytest.CaptureFixture[str]) -> None:
    now = 0.0
    show = show_progress(lambda: now)
    show(0, 100)
    now = 5.0
    show(25, 100)
    show(100, 100)
    shown = capsys.readouterr().err.split("\r")
    assert [line.strip() for line in shown[1:]] == [
        "fecm: 0 of 100",
        "fecm: 25 of 100, 15 s left",
        "fecm: 100 of 100",
    ]


def test_what_needs_an_output_file_is_refused_without_one() -> None:
    for more in ({"resume": True}, {"checkpoint": 1.0}, {"printed": "p.txt"}):
        with pytest.raises(OptionsError, match="need an output file"):
            fecm.run(small(), **more)
    with pytest.raises(CasesError, match="`full` needs an output file"):
        fecm.sweep(small(), {"k": [1e6]}, full=[0])


@pytest.mark.parametrize(
    ("command", "job"),
    [
        ("run", fecm.Run),
        ("sweep", fecm.Sweep),
        ("identify", fecm.IdentificationJob),
        ("locate", fecm.LocationJob),
    ],
)
def test_the_command_has_the_options_of_the_job_with_their_help(command: str, job: type) -> None:
    page = " ".join(call(command, "--help").stdout.split())
    for name, (about, _) in declared_options(job).items():
        if about.group and name not in ("output", "workers"):
            flag = about.flag or f"--{name.replace('_', '-')}"
            assert flag.replace("/", " / ") in page
            assert about.help.split(".")[0].split("-")[0] in page
        assert f"{name} : " in (job.__doc__ or "")


@pytest.mark.parametrize(
    ("function", "job"),
    [
        (fecm.run, fecm.Run),
        (fecm.sweep, fecm.Sweep),
        (fecm.identify, fecm.IdentificationJob),
        (fecm.locate, fecm.LocationJob),
    ],
)
def test_a_function_says_of_its_parameters_what_its_job_says(
    function: Callable[..., object], job: type
) -> None:
    texts = str(inspect.getdoc(job))
    shared = inspect.signature(function).parameters.keys() & inspect.signature(job).parameters
    assert len(shared) >= 4
    for name in shared:
        entry = re.search(rf"^[\w, ]*\b{name}\b.* : .*\n(?: {{4}}.*\n)+", texts, re.M)
        assert entry is not None, name
        assert entry[0] in str(inspect.getdoc(function))


def test_the_page_has_the_table_of_what_excludes_what() -> None:
    page = (ROOT / "docs/sweeps.md").read_text("utf-8")
    assert "\n".join(exclusions_table()) in page
