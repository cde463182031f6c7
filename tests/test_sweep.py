"""Sweeps: many impacts from one run of a plate, on any number of workers."""

from __future__ import annotations

import functools
import json
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm import ContactPoint, SweepResult
from fecm.authoring.case import Case, CasesError
from fecm.authoring.values import apply_case
from fecm.deck.model import Deck
from fecm.mechanics.contact_law import HystereticLaw, LinearPermanent, stack_parameters
from fecm.mechanics.plate_motion import AppliedForce
from fecm.problem.build import build_model
from fecm.problem.loading import load_deck, sole_problem
from fecm.problem.parts import build_law, build_projectile
from fecm.sweeps import execute
from fecm.sweeps.backends import shares_plate
from fecm.sweeps.case_tables import grid_cases, parse_vary, read_cases
from fecm.sweeps.execute import LOST, Means, carry_out_plan, on_workers
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.partial_results import OtherSweepError, PartialResults
from fecm.sweeps.plan import plan
from fecm.sweeps.responses import Convolution, plate_response
from fecm.sweeps.task import Task, tasks
from tests.calls import Done, call
from tests.decks import DATA_CARDS, LONG, MESH, PROGRAM, model, small
from tests.stopped_runs import StoppedError

Floats = NDArray[np.float64]

LAYUPS = [f"[{angle}/{angle - 90}]" for angle in range(0, 80, 5)]
STEPS = PROGRAM.replace("LOOP         10", "LOOP        400")
CLAMPED = MESH.replace("    1    1   -1   -1    0    0    0", "    1    1    1    1    1    1    1")


def full(deck: Deck) -> fecm.Result:
    """Full run of a deck of one problem."""
    return fecm.run_one(deck)


def assert_same(a: SweepResult, b: SweepResult) -> None:
    """Two sweeps are the same to the last bit."""
    for name in a.summary:
        np.testing.assert_array_equal(a[name], b[name])
    if a.force is not None or b.force is not None:
        assert a.force is not None
        assert b.force is not None
        np.testing.assert_array_equal(a.force, b.force)


# The identity ------------------------------------------------------------------------------------


def test_a_plates_displacement_is_the_sum_of_its_impulse_responses() -> None:
    # An unsymmetric laminate, clamped on one corner only, hit beside its middle.
    data = DATA_CARDS.replace("    2  90. ", "    2  30. ").replace("   13    3", "    8    3")
    corner = MESH[: MESH.index("BOUN")] + "BOUN\n    1    0    1    1    1    1    1\n\n"
    problem = load_deck(small(mesh=corner, data=data)).problems[0]
    motion, contact = build_model(problem).motion, problem.contact
    assert contact is not None
    load, dt, steps = motion.load(contact), 2e-7, 300
    force = np.random.default_rng(5).standard_normal(steps)
    state, direct = motion.start(), np.empty(steps)
    for step in range(steps):
        motion.advance(state, dt, 0.0, AppliedForce(load, float(force[step])))
        direct[step] = load.dot(state.displacement)
    response, _ = plate_response(motion, load, dt, steps)
    sums = np.convolve(response, force)[:steps]
    np.testing.assert_allclose(sums, direct, atol=1e-12 * np.abs(direct).max())
    blocks = Convolution(response, np.zeros(1, dtype=np.intp))
    actual = np.empty(steps)
    blocks.give(np.array([force[0]]))  # f_0 pushes in the first step
    for step in range(steps):
        actual[step] = blocks.next()[0, 0]
        blocks.give(np.array([force[step + 1] if step + 1 < steps else 0.0]))
    np.testing.assert_allclose(actual, direct, atol=1e-12 * np.abs(direct).max())


def test_no_case_depends_on_the_others_of_its_plate() -> None:
    deck, random = model(small(STEPS)), np.random.default_rng(2)
    cases: list[Case] = [
        {"velocity": v, "k": k, "mass": m}
        for v, k, m in zip(
            random.uniform(50, 150, 40),
            random.uniform(1e6, 3e6, 40),
            [1.8e-4, 3e-4] * 20,
            strict=True,
        )
    ]
    many = fecm.sweep(deck, cases=cases, history=True)
    some = [33, 2, 7]
    few = fecm.sweep(deck, cases=[cases[n] for n in some], history=True)
    assert many.force is not None
    np.testing.assert_array_equal(many.force[some], few.force)
    for name, values in few.summary.items():
        np.testing.assert_array_equal(many[name][some], values)


def test_the_law_of_many_cases_is_the_law_of_each() -> None:
    random = np.random.default_rng(11)
    measured = [
        LinearPermanent(k, a, s, q)
        for k, a, s, q in zip(
            random.uniform(1e6, 3e6, 15),
            random.uniform(0, 1e-3, 15),
            random.uniform(0, 0.2, 15),
            random.uniform(1.5, 2.5, 15),
            strict=True,
        )
    ]
    together = HystereticLaw(stack_parameters(measured))
    memory, last = together.start(), ContactPoint(np.zeros(15), np.zeros(15))
    alone = [(HystereticLaw(c), HystereticLaw(c).start(), ContactPoint(0.0, 0.0)) for c in measured]
    a = np.zeros(15)
    for _ in range(300):
        a = np.maximum(a + random.normal(0.0, 2e-4, 15), -1e-4)
        force, _ = together.trial(memory, last, a)
        memory, last = together.accept(memory, last, a), ContactPoint(a, force)
        for case, (law, own, point) in enumerate(alone):
            value = float(a[case])
            single, _ = law.trial(own, point, value)
            assert force[case] == pytest.approx(single, rel=1e-12, abs=1e-9)
            alone[case] = (law, law.accept(own, point, value), ContactPoint(value, single))
    assert len(set(memory.branch.tolist())) == 3


# Against full runs -------------------------------------------------------------------------------


def test_cases_on_the_reports_plate_equal_their_full_runs() -> None:
    cases: list[Case] = [
        {"velocity": 50.0, "k": 1.0e6, "rod_mass": 1.8e-4, "s_p": 0.094, "q": 2.0},
        {"velocity": 115.0, "k": 1.912e6, "rod_mass": 1.8e-4, "s_p": 0.05, "q": 2.5},
        {"velocity": 150.0, "k": 2.5e6, "rod_mass": 4.0e-4, "s_p": 0.2, "q": 1.5},
    ]
    deck = model(LONG).with_(duration=1.2e-3)  # until the plate can't reach the slowest one
    sweep_result = fecm.sweep(deck, cases=cases, history=True)
    assert sweep_result.force is not None
    assert sweep_result["status"].tolist() == ["ok"] * 3
    for number, case in enumerate(cases):
        result = full(apply_case(deck, case))
        peak = result.force.max()
        assert np.abs(sweep_result.force[number] - result.force).max() < 1e-9 * peak
        assert sweep_result["peak_force"][number] == pytest.approx(peak, rel=1e-9)
        assert sweep_result["time_of_peak"][number] == result.time[result.force.argmax()]
        assert sweep_result["max_indentation"][number] == pytest.approx(
            result.indentation.max(), rel=1e-9
        )
        permanent = result.history.attributes["permanent_indentation"]
        assert sweep_result["permanent_indentation"][number] == pytest.approx(permanent, rel=1e-7)


def test_momentum_and_energy_of_the_summary_are_those_of_the_rods_centre() -> None:
    sweep_result = fecm.sweep(LONG, {"velocity": [115.0]})
    result = full(model(LONG))
    mass = build_projectile(model(LONG)).total_mass
    # Momentum after the last contact: the rod's kinetic energy is that of its centre and of its
    # ringing, which is the smaller part.
    rebound = float(sweep_result["rebound_velocity"][0])
    centre = 0.5 * mass * rebound**2
    kinetic = float(result["energy/projectile_kinetic"][-1])
    assert centre < kinetic < 1.02 * centre + 1e-3 * 1.1966
    assert sweep_result["energy_absorbed"][0] == pytest.approx(
        0.5 * mass * 115.0**2 - centre, rel=1e-12
    )
    assert sweep_result["impulse"][0] == pytest.approx(mass * (115.0 + rebound), rel=1e-12)
    assert sweep_result["contacts"][0] == 2
    assert sweep_result["contact_time"][0] == pytest.approx(
        (result.force > 0.0).sum() * 2e-7, rel=1e-12
    )


@pytest.mark.parametrize(
    "case",
    [
        {"thickness": 0.08}, {"e1": 2.0e7}, {"layup": "[0/45/-45/90]"}, {"dt": 3e-7},
        {"impact_node": 8}, {"rod_length": 2.0}, {"rod_modulus": 1.0e7}, {"rod_density": 1e-3},
        {"nu12": 0.2}, {"density": 2e-4}, {"alpha_p": 1e-5}, {"patch": 0.2},
        {"x0": 0.7, "y0": 1.2}, {"patch": 0.4, "impact_node": 7},
    ],
)  # fmt: skip
@pytest.mark.few(7)  # of 14, 0.09 s each
def test_whatever_varies_the_case_is_the_changed_decks_run(case: Case) -> None:
    deck = model(small(STEPS))
    sweep_result = fecm.sweep(deck, cases=[case], history=True)
    assert sweep_result["status"].tolist() == ["ok"]
    assert sweep_result.force is not None
    result, plain = full(apply_case(deck, case)), full(deck)
    difference = np.abs(sweep_result.force[0] - result.force).max()
    assert difference < 1e-9 * result.force.max()
    assert abs(result.force.max() / plain.force.max() - 1.0) > 1e-5


def test_cases_of_velocity_and_patch_equal_their_full_runs() -> None:
    shear = "SHEA MITC\nPATC\nHERT\n"
    deck = model(small(STEPS, data=shear + DATA_CARDS))
    vary = {"velocity": [60.0, 115.0], "patch": [0.1, 0.5]}
    sweep_result = fecm.sweep(deck, vary, history=True)
    assert sweep_result.force is not None
    for force, case in zip(sweep_result.force, grid_cases(list(vary.items())), strict=True):
        patch = f"HERT,{case['patch']}\n"
        cards = DATA_CARDS.replace("     115.0", f"{case['velocity']:10.1f}")
        result = full(model(small(STEPS, data=shear.replace("HERT\n", patch) + cards)))
        assert np.abs(force - result.force).max() < 1e-9 * result.force.max()


def test_values_of_the_patch_that_cannot_be_are_cases_with_a_reason() -> None:
    patches = [(0.0, 1.0, 1.0), (0.1, 2.0, 1.0), (0.1, 1.0, 1.0)]
    cases = [dict(zip(("patch", "x0", "y0"), values, strict=True)) for values in patches]
    sweep_result = fecm.sweep(model(small(STEPS)), cases=cases)
    assert "must be positive" in sweep_result["status"][0]
    assert "not on the plate" in sweep_result["status"][1]
    assert sweep_result["status"][2] == "ok"
    alone = fecm.sweep(model(small(STEPS)), {"x0": [1.0]})
    assert alone["status"].tolist() == ["The centre of the patch has x0, but no y0."]


def test_a_layup_keeps_the_plys_thickness_and_a_thickness_scales_all() -> None:
    deck = model(small())
    changed = apply_case(deck, {"thickness": 0.3, "layup": "[0/45/90]"})
    material = changed.require(fecm.deck.model.Material)
    assert [layer.thickness for layer in material.layers] == pytest.approx([0.1] * 3)
    assert changed.control.layers == 3
    thin = apply_case(deck, {"layup": "[0/45/90]"}).require(fecm.deck.model.Material)
    assert thin.integration.thickness == pytest.approx(3 * 0.053)


def test_a_plate_with_other_loads_is_run_whole() -> None:
    load = "FORC\n    8    0       0.0       0.0       1.0\n\n"
    deck = model(small(STEPS, data=load + DATA_CARDS))
    problem = sole_problem(deck)
    assert not shares_plate(problem)
    sweep_result = fecm.sweep(deck, {"velocity": [50.0, 100.0]}, history=True)
    assert sweep_result.force is not None
    result = full(apply_case(deck, {"velocity": 100.0}))
    np.testing.assert_array_equal(sweep_result.force[1], result.force)


def test_a_case_that_fails_is_a_row_with_its_reason() -> None:
    sweep_result = fecm.sweep(
        model(small(STEPS)),
        cases=[
            {"thickness": 0.1, "k": -1e6},
            {"thickness": -1.0, "k": 1e6},
            {"thickness": 0.1, "k": 1e6},
        ],
    )
    assert sweep_result.completed.tolist() == [False, False, True]
    assert "contact coefficient" in sweep_result["status"][0]
    assert "thick" in sweep_result["status"][1]
    assert np.isnan(sweep_result["peak_force"][:2]).all()
    assert sweep_result["peak_force"][2] > 0.0


# What varies -------------------------------------------------------------------------------------


def test_ranges_and_lists_of_values_are_read() -> None:
    assert parse_vary("velocity=10:20:3") == ("velocity", [10.0, 15.0, 20.0])
    assert parse_vary("k = 1e6, 2e6") == ("k", [1e6, 2e6])
    assert parse_vary("layup=[0/90]s,[45,-45]") == ("layup", ["[0/90]s", "[45,-45]"])
    assert parse_vary("impact_node=3:5:3") == ("impact_node", [3, 4, 5])


@pytest.mark.parametrize(
    "text",
    ["velocity", "velocity=", "speed=1", "velocity=1:2", "velocity=1:2:0", "velocity=1:2:x",
     "velocity=a", "velocity=nan", "velocity=1e999", "impact_node=1.5", "k=1:2:1000000000"],
)  # fmt: skip
def test_what_is_no_variation_is_refused(text: str) -> None:
    with pytest.raises(CasesError):
        parse_vary(text)


def test_a_grid_has_every_combination_once_and_a_table_its_rows(tmp_path: Path) -> None:
    cases = grid_cases([("velocity", [1.0, 2.0]), ("k", [3.0, 4.0, 5.0])])
    assert [(c["velocity"], c["k"]) for c in cases] == [
        (v, k) for v in (1.0, 2.0) for k in (3.0, 4.0, 5.0)
    ]
    table = tmp_path / "cases.csv"
    table.write_text("velocity, layup\n1, [0/90]s\n\n2, [45]\n")
    assert read_cases(table) == [
        {"velocity": 1.0, "layup": "[0/90]s"},
        {"velocity": 2.0, "layup": "[45]"},
    ]


@pytest.mark.parametrize(
    ("text", "where"),
    [("", "header"), ("velocity\n", "header"), ("velocity\n1,2\n", ":2"), ("speed\n1\n", ":1"),
     ("velocity\nfast\n", ":2"), ("velocity,velocity\n1,2\n", ":1")],
)  # fmt: skip
def test_a_table_of_cases_that_can_not_be_read_says_where(
    text: str, where: str, tmp_path: Path
) -> None:
    table = tmp_path / "cases.csv"
    table.write_text(text)
    with pytest.raises(CasesError, match=where):
        read_cases(table)


# Workers -----------------------------------------------------------------------------------------


@functools.cache
def serial() -> SweepResult:
    """Sixteen layups in this process."""
    return fecm.sweep(model(small(STEPS)), {"layup": LAYUPS}, history=True)


@pytest.mark.long
def test_two_workers_give_what_one_process_does() -> None:
    shared = fecm.sweep(model(small(STEPS)), {"layup": LAYUPS}, history=True, workers=2)
    assert_same(shared, serial())
    assert shared.completed.all()


def children() -> list[int]:
    """Processes that this one has started."""
    actual = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    return [int(pid) for pid in actual]


@pytest.mark.long
@pytest.mark.linux
def test_a_worker_that_dies_costs_time_only() -> None:
    problem = sole_problem(model(small(STEPS)))
    planned = plan(problem, grid_cases([("layup", list(LAYUPS))]), history=True)
    killed: list[int] = []

    def kill(task: Task, outcome: object) -> None:
        if task.number == 3 and not killed:
            killed.append(children()[-1])
            os.kill(killed[0], signal.SIGKILL)

    shared = carry_out_plan(problem, planned, Means(workers=2), done=kill)
    assert killed
    assert_same(shared, serial())


def die(task: Task) -> Outcome:
    """End the process that runs a task."""
    os._exit(1)


@pytest.mark.long
def test_tasks_whose_workers_always_die_end_as_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = sole_problem(model(small()))
    planned = plan(problem, grid_cases([("layup", ["[0]", "[90]"])]))
    monkeypatch.setattr(execute, "attempt", die)
    monkeypatch.setattr(execute, "DEATHS", 1)
    lost: dict[int, str] = {}

    def note(task: Task, outcome: Outcome) -> None:
        lost[task.number] = outcome.status[0]

    on_workers(tasks(planned), 2, note, lambda: None)
    assert lost == {0: LOST, 1: LOST}


@pytest.mark.long
@pytest.mark.posix
def test_a_signal_to_workers_that_are_starting_costs_time_only(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """An interrupt of the terminal goes to all processes."""
    problem = sole_problem(model(small()))
    planned = plan(problem, grid_cases([("layup", ["[0]", "[90]"])]))
    numbers: list[int] = []
    signals = [signal.SIGINT]

    def interrupt() -> None:
        while signals:
            number = signals.pop()
            for worker in multiprocessing.active_children():
                os.kill(worker.pid or 0, number)

    on_workers(tasks(planned), 2, lambda task, outcome: numbers.append(task.number), interrupt)
    assert sorted(numbers) == [0, 1]
    assert capfd.readouterr().err == ""


@pytest.mark.long
@pytest.mark.posix
def test_workers_of_a_sweep_that_stops_while_they_start_end_without_a_word(
    capfd: pytest.CaptureFixture[str],
) -> None:
    problem = sole_problem(model(small()))
    planned = plan(problem, grid_cases([("layup", ["[0]", "[90]"])]))

    def stop() -> None:
        raise StoppedError("stopped")

    with pytest.raises(StoppedError):
        on_workers(tasks(planned), 2, lambda task, outcome: None, stop)
    for worker in multiprocessing.active_children():
        worker.join()
    assert capfd.readouterr().err == ""


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Address of a Dask scheduler on loopback, and its two workers."""
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with ExitStack() as stack:

        def start(module: str, *options: str) -> subprocess.Popen[bytes]:
            command = [
                sys.executable,
                "-m",
                f"distributed.cli.{module}",
                *options,
                "--no-dashboard",
            ]
            process = subprocess.Popen(command, cwd=tmp_path, **quiet)  # type: ignore[call-overload]
            stack.callback(process.wait)
            stack.callback(process.kill)
            assert isinstance(process, subprocess.Popen)
            return process

        start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
        until = time.monotonic() + 30.0
        while not file.exists() and time.monotonic() < until:
            time.sleep(0.05)
        address = str(json.loads(file.read_text())["address"])
        options = ("--nworkers", "1", "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1")
        workers = [start("dask_worker", address, *options) for _ in range(2)]
        yield address, workers


@pytest.mark.long
def test_a_dask_cluster_that_loses_a_worker_gives_the_same_rows(
    cluster: tuple[str, list[subprocess.Popen[bytes]]],
) -> None:
    address, workers = cluster
    problem = sole_problem(model(small(STEPS)))
    planned = plan(problem, grid_cases([("layup", list(LAYUPS))]), history=True)
    finished: list[int] = []

    def kill(task: Task, outcome: object) -> None:
        finished.append(task.number)
        if len(finished) == 5:
            workers[0].kill()

    actual = carry_out_plan(problem, planned, Means(scheduler=address), done=kill)
    assert workers[0].poll() is not None or workers[0].wait(10) is not None
    assert sorted(finished) == list(range(16))
    assert_same(actual, serial())


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(execute, "PATIENCE", 0.5)
    with pytest.raises(execute.SchedulerError, match="127"):
        fecm.sweep(model(small()), {"k": [1e6]}, scheduler="tcp://127.0.0.1:9")


# Interruption ------------------------------------------------------------------------------------


class Notes(fecm.Watch):
    """Keeps the notes of a job."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, *texts: str) -> None:
        """Keep notes."""
        self.notes += texts


def test_an_interrupted_sweep_goes_on_where_it_was(tmp_path: Path) -> None:
    deck, layups = model(small()), LAYUPS[:8]
    problem = sole_problem(deck)
    planned = plan(problem, grid_cases([("layup", list(layups))]), history=True)
    path = tmp_path / "sweep.h5"
    begun: list[int] = []

    def stop(task: Task, outcome: object) -> None:
        begun.append(task.number)
        if len(begun) == 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        carry_out_plan(
            problem, planned, parts=PartialResults(path, planned.fingerprint()), done=stop
        )
    again = PartialResults(path, planned.fingerprint())
    before = [task.number for task in tasks(planned) if again.get(task) is not None]
    assert before == begun
    # A part that is not whole is run again.
    (again.folder / "task-000002.npz").write_bytes(b"PK\x03\x04 and no more")
    watch = Notes()
    actual = carry_out_plan(problem, planned, parts=again, watch=watch, keeps_forces=False)
    forces = [force for _, force in again.forces() if force is not None]
    at_once = fecm.sweep(deck, {"layup": layups}, history=True)
    assert_same(replace(actual, force=np.vstack(forces)), at_once)
    assert len(watch.notes) == 1
    assert "task-000002.npz is damaged; its cases are run again" in watch.notes[0]
    with pytest.raises(OtherSweepError):
        PartialResults(path, "another one")


# The program, which gets a signal from itself when the second plate is finished.
SIGNALLED = """
import os, signal
from fecm.__main__ import main
from fecm.sweeps.execute import PartialResults

plain, stored = PartialResults.put, []

def put(self, task, outcome):
    plain(self, task, outcome)
    stored.append(task)
    if len(stored) == 2:
        os.kill(os.getpid(), signal.SIGINT)

PartialResults.put = put
main()
"""


@pytest.mark.posix
def test_a_sweep_that_is_interrupted_from_outside_ends_in_the_same_file(tmp_path: Path) -> None:
    (tmp_path / "plate.inp").write_text(small())
    varied = ("--vary", "k=1e6,2e6", "--vary", "layup=" + ",".join(LAYUPS[:3]))
    command = ["sweep", "plate.inp", "--history", *varied, "-o"]
    done = subprocess.run(
        [sys.executable, "-c", SIGNALLED, *command, "s.h5"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    folder = tmp_path / ".s.h5.parts"
    assert done.returncode == 130
    assert "resumes this sweep" in done.stderr
    assert not (tmp_path / "s.h5").exists()
    assert len(list(folder.glob("task-*.npz"))) == 2
    assert call(*command, "s.h5", cwd=tmp_path).exit_code == 0
    assert not folder.exists()
    assert call(*command, "t.h5", cwd=tmp_path).exit_code == 0
    assert (tmp_path / "s.h5").read_bytes() == (tmp_path / "t.h5").read_bytes()


# The command -------------------------------------------------------------------------------------


def swept(*arguments: object) -> Done:
    """Call ``fecm sweep``."""
    return call("sweep", *arguments)


def test_a_result_keeps_cases_numbers_and_forces(tmp_path: Path) -> None:
    deck, path = tmp_path / "plate.inp", tmp_path / "s.h5"
    deck.write_text(small(STEPS, data="UNIT\nin lbf s\n" + DATA_CARDS))
    done = swept(
        deck,
        "--vary",
        "velocity=50,100",
        "--vary",
        "layup=[0/90],[x]",
        "-o",
        path,
        "--history",
        "--full",
        "2",
    )
    assert done.exit_code == 1
    assert "failed            2: layup" in done.stdout
    assert done.stdout.splitlines()[-1] == "4 cases: 2 failed"
    stored = fecm.load_sweep(path)
    assert stored.cases["velocity"].tolist() == [50.0, 50.0, 100.0, 100.0]
    assert stored.cases["layup"].tolist() == ["[0/90]", "[x]", "[0/90]", "[x]"]
    assert stored.completed.tolist() == [True, False, True, False]
    assert stored.unit("peak_force") == "lbf"
    assert stored.force is not None
    assert stored.force.shape == (4, 400)
    again = fecm.load(tmp_path / "s-2.h5")
    difference = np.abs(stored.force[2] - again.force).max()
    assert difference < 1e-9 * again.force.max()
    assert swept(deck, "--vary", "velocity=50,100", "-o", path).exit_code == 2
    assert fecm.load_sweep(path).cases["velocity"].tolist() == [50.0, 50.0, 100.0, 100.0]


@pytest.mark.parametrize(
    "options",
    [[], ["--vary", "speed=1"], ["--vary", "k=1", "--vary", "k=2"], ["--cases", "none.csv"],
     ["--vary", "k=1", "--full", "1"], ["--vary", "k=1", "--full", "x"],
     ["--vary", "k=1", "-o", "no/folder.h5"], ["--vary", "k=1", "--workers", "0"]],
)  # fmt: skip
def test_a_call_that_can_not_be_meant_leaves_nothing_behind(
    options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("plate.inp").write_text(small())
    refused = swept("plate.inp", *options)
    assert refused.exit_code == 2
    assert refused.stdout == ""
    assert [path.name for path in tmp_path.iterdir()] == ["plate.inp"]


def test_a_run_and_a_sweep_are_not_taken_for_one_another(tmp_path: Path) -> None:
    deck = tmp_path / "plate.inp"
    deck.write_text(small())
    swept(deck, "--vary", "k=1e6", "-o", tmp_path / "s.h5")
    with pytest.raises(ValueError, match="sweep"):
        fecm.load(tmp_path / "s.h5")
    fecm.run(deck, output=tmp_path / "r.h5")
    with pytest.raises(ValueError, match="run"):
        fecm.load_sweep(tmp_path / "r.h5")
    assert build_law(model(deck)).constants.k == 1912000.0


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads /proc")
@pytest.mark.long
def test_a_closing_terminal_does_not_end_the_resource_tracker() -> None:
    """Without its first tracker, multiprocessing prints tracebacks about semaphores."""
    script = (
        "from multiprocessing import resource_tracker\n"
        "from fecm.sweeps.execute import start_resource_tracker\n"
        "start_resource_tracker()\n"
        "pid = resource_tracker._resource_tracker._pid\n"
        "print(open(f'/proc/{pid}/status').read())\n"
        "print(open('/proc/self/status').read())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    tracker, own = (int(mask, 16) for mask in re.findall(r"SigBlk:\s*(\w+)", done.stdout))
    hangup = 1 << signal.SIGHUP - 1
    assert tracker & hangup
    assert not own & hangup
