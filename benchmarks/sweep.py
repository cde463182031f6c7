"""A thousand impacts as a whole process, against their full runs and a plain sparse loop.

    python benchmarks/sweep.py [--many] [--write]
    python benchmarks/sweep.py --one

The report's plate over 800 µs (4000 steps) is hit at 40 velocities with 25 contact coefficients:
``fecm sweep`` in a process of its own, from its start to its end, and the same with ``--history``.
Every 50th case is run in full by ``fecm.run``; what is compared is the contact force of every step,
over the peak force.  The plain loop is that of run.py, once, times 1000.
`--many` also runs 10^5 cases of a grid, 10^5 random ones, and 100 layups at 100 velocities; their
processor times are compared with those of a full run by NumPy and of a sweep by NumPy, measured in
turns.
`--one` measures one case of a D7136 coupon, hit again and again: with the deck that was checked
before, and checked anew, in turns.
`--write` keeps the figures in benchmarks/results, under the machine's name.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from figures import keep
from run import HERE, Plain, checked, report
from run import seconds as processor_time

import fecm
from fecm.authoring.case import Case, Value
from fecm.authoring.values import apply_case
from fecm.mechanics import kernels
from fecm.problem import loading
from fecm.sweeps.case_tables import parse_vary
from fecm.sweeps.methods import _plate

DECK = HERE.parent / "decks" / "impact-115.inp"
VARY = ("--vary", "velocity=50:300:40", "--vary", "k=1e6:3e6:25")
ROUNDS = 5
CASES = 1000
STEPS = 4000
EVERY = 50
MANY = ("--vary", "velocity=50:300:400", "--vary", "k=1e6:3e6:250")
MANY_CASES = 100_000
RANDOM = (
    *("--random", "velocity=normal:115,10", "--random", "k=lognormal:1.9e6,0.15"),
    *("--samples", str(MANY_CASES), "--workers", "1"),
)
LAYUPS = ",".join(f"[{angle}/{angle + 45}]5s" for angle in range(100))
LAYERS = ("--vary", f"layup={LAYUPS}", "--vary", "velocity=50:300:100")


def process(output: Path, *options: str, vary: tuple[str, ...] = VARY) -> float:
    """Seconds of a sweep as a process."""
    command = [
        sys.executable,
        "-m",
        "fecm",
        "sweep",
        str(DECK),
        *vary,
        "-o",
        str(output),
        "--overwrite",
        *options,
    ]
    begin = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


def full(case: Case) -> tuple[fecm.Result, float]:
    """Run a case in full, and return its seconds."""
    begin = time.perf_counter()
    result = fecm.run(apply_case(report(), case))
    if not isinstance(result, fecm.Result):
        raise TypeError("the deck holds several problems")
    return result, time.perf_counter() - begin


def compare(sweep: fecm.SweepResult) -> tuple[float, list[float]]:
    """Largest difference of every 50th case over its peak force, and seconds of the full runs."""
    if sweep.force is None or sweep.force.shape != (CASES, STEPS) or not sweep.completed.all():
        raise ValueError("the sweep is not whole")
    worst, seconds = 0.0, []
    for number in range(0, CASES, EVERY):
        result, took = full({name: values[number] for name, values in sweep.cases.items()})
        seconds.append(took)
        difference = np.abs(sweep.force[number] - result.force).max() / result.force.max()
        worst = max(worst, float(difference))
    return worst, seconds


def measure() -> dict[str, float | int]:
    """All figures."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sweep.h5"
        alone = [process(path) for _ in range(ROUNDS)]
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        stored = [process(path, "--history") for _ in range(ROUNDS)]
        worst, seconds = compare(fecm.load_sweep(path))
    problem = checked(report(), STEPS)
    csr = statistics.median(processor_time(Plain(problem), STEPS) for _ in range(ROUNDS))
    return {
        "cases": CASES,
        "steps": STEPS,
        "seconds": round(statistics.median(alone), 2),
        "slowest_seconds": round(max(alone), 2),
        "seconds_with_history": round(statistics.median(stored), 2),
        "peak_memory_mb": round(peak, 1),
        "compared": len(seconds),
        "largest_difference": float(f"{worst:.2g}"),
        "full_run_seconds": round(statistics.median(seconds), 3),
        "csr_run_seconds": round(csr, 3),
        "full_runs_seconds": round(CASES * statistics.median(seconds)),
        "csr_runs_seconds": round(CASES * csr),
    }


def processor(path: Path, vary: tuple[str, ...]) -> float:
    """Processor seconds of a sweep as a process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    process(path, vary=vary)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def here(compute: Callable[[], object]) -> float:
    """Processor seconds of a call."""
    begin = time.process_time()
    compute()
    return time.process_time() - begin


def by_numpy() -> None:
    """Run a thousand cases without the kernels."""
    library, kernels.LIBRARY = kernels.LIBRARY, None
    try:
        _plate.cache_clear()
        fecm.sweep(report(), vary_of(VARY))
    finally:
        kernels.LIBRARY = library


def vary_of(options: tuple[str, ...]) -> dict[str, list[Value]]:
    """Values by name of the options --vary."""
    return dict(parse_vary(text) for text in options[1::2])


def throughput() -> dict[str, float | int]:
    """Processor time and memory of many cases, beside those of NumPy."""
    runs: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sweep.h5"
        runs += [here(lambda: fecm.run(report(), solver="numpy")) for _ in range(ROUNDS)]
        many = processor(path, MANY)
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        drawn = processor(path, RANDOM)
        runs += [here(lambda: fecm.run(report(), solver="numpy")) for _ in range(ROUNDS)]
        layers = processor(path, LAYERS)
        runs += [here(lambda: fecm.run(report(), solver="numpy")) for _ in range(ROUNDS)]
    alone = statistics.median(runs)
    return {
        "many_cases": MANY_CASES,
        "many_cases_a_cpu_second": round(MANY_CASES / many),
        "random_cases_a_cpu_second": round(MANY_CASES / drawn),
        "many_peak_memory_mb": round(peak, 1),
        "layups_cpu_seconds": round(layers, 2),
        "numpy_run_cpu_seconds": round(alone, 3),
        "cases_for_a_numpy_run": round(alone * MANY_CASES / many),
        "numpy_runs_for_layups": round(layers / alone, 1),
        "numpy_cases_a_cpu_second": round(CASES / here(by_numpy)),
    }


def one_case() -> dict[str, float]:
    """Processor time of one case on a plate whose response is known, in ms."""
    deck = fecm.read_one(fecm.examples.path("drop-weight-held"))
    known, anew = [], []
    for velocity in range(900, 900 + 4 * ROUNDS):
        known.append(here(partial(fecm.sweep, deck, {"velocity": [velocity]})))
        loading._last.cache_clear()
        anew.append(here(partial(fecm.sweep, deck, {"velocity": [velocity + 0.5]})))
    return {
        "one_case_ms": round(1e3 * statistics.median(known[1:]), 1),
        "one_case_checked_anew_ms": round(1e3 * statistics.median(anew[1:]), 1),
    }


def main() -> None:
    """Measure, print a table, and keep it if asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="keep the figures as JSON")
    parser.add_argument("--many", action="store_true", help="also run 10^5 cases")
    parser.add_argument("--one", action="store_true", help="only one case on a known plate")
    options = parser.parse_args()
    figures = one_case() if options.one else measure()
    if options.many:
        figures |= throughput()
    for name, value in figures.items():
        print(f"{name.replace('_', ' '):24}{value:>10}")
    if options.write:
        print(keep({"sweep": figures}, "-sweep"))


if __name__ == "__main__":
    main()
