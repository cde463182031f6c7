"""Cost of a time step beside a plain sparse loop, both measured in one process and in turns.

    python benchmarks/run.py [--write] [--rounds N] [CASE ...]

The plain loop is the product with scipy's CSR matrix, the update of the plate and the same contact
code.  A step is everything that ``fecm run`` does in it: energies, history, a row of strains and of
displacements at every twentieth step, the file written.  Its cost is the difference of a long and a
short run over the difference of their steps.  `memory` takes steps without rows and without a file.
`before_and_after_ms` is what a run takes besides: `reading` the deck's text, `set_up` from there to
the first step, checks included, and the `summary`.  Of a deck with NONL `over_linear` is the ratio
of these steps to those without the word, where u and v rest if B is 0; its plain loop is linear.
All are processor times, the best of some rounds in turns; each case has a process of its own, and
one thread unless said otherwise.
`--write` keeps the figures in benchmarks/results, under the machine's name.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does

import argparse
import multiprocessing
import resource
import tempfile
import time
import tracemalloc
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
from figures import keep

import fecm
from fecm.deck.findings import Findings
from fecm.deck.grid import ElementGrid, GridSection
from fecm.deck.macros import compile_program
from fecm.deck.model import (
    Boundary,
    Control,
    Coordinates,
    Deck,
    Elements,
    Impact,
    Material,
    NodeValues,
    Nonlinear,
    Patch,
    Shear,
)
from fecm.deck.reader import Reader
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.stiffness_product import CSR, KERNELS, NUMPY
from fecm.problem.build import RunOptions, build_model
from fecm.problem.generate import generate
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.results import hdf5_writer
from fecm.results.summary import about_run
from fecm.simulation.run import run_program
from fecm.simulation.simulation import Simulation

HERE = Path(__file__).parent
BUDGET = 0.4  # seconds that one loop of a round may take, approximately
LONGER = 1.5  # seconds that the long run takes beyond the short one
FILE_SIZE = 1e9  # most bytes of the file of the long run
DT = 2.0e-7


def report() -> Deck:
    """Return the report's plate over 800 microseconds."""
    deck = fecm.read_deck(HERE.parent / "decks" / "impact-115.inp")
    if not isinstance(deck, Deck):
        raise TypeError("the deck holds several problems")
    return deck


def refined(times: int, aside: int = 0) -> Deck:
    """Return the report's plate with every element cut `times` times in each direction.

    The impact is `aside` nodes beside the middle.
    """
    columns = [
        GridSection(0.0, 1.5, 3 * times),
        GridSection(1.5, 4.5, 8 * times),
        GridSection(4.5, 6.0, 3 * times),
    ]
    rows = [
        GridSection(0.0, 0.5, times),
        GridSection(0.5, 3.5, 8 * times),
        GridSection(3.5, 4.0, times),
    ]
    return on_grid(ElementGrid(columns, rows), aside)


def even(count: int) -> Deck:
    """Return the report's plate of equal elements, `count` in each direction."""
    return on_grid(ElementGrid([GridSection(0.0, 6.0, count)], [GridSection(0.0, 4.0, count)]))


def on_grid(grid: ElementGrid, aside: int = 0) -> Deck:
    """Return the report's plate with another mesh, hit `aside` nodes beside the middle."""
    deck = report()
    boundary = grid.boundary((1, 1, 0, 0, 0), {})
    hit = Impact(grid.nearest(3.0, 2.0)[0] + aside, 3, 115.0)
    mesh = [part for part in (grid.coordinates(), grid.element_cards(), boundary) if part]
    kept = [
        s for s in deck.segments if not isinstance(s, Coordinates | Elements | Boundary | Impact)
    ]
    control = Control(grid.nodes, grid.elements, deck.control.layers, 2, 5, 9)
    return replace(deck, control=control, segments=(*mesh, *kept, hit), text="")


def moved(deck: Deck, move: Callable[[np.ndarray], np.ndarray]) -> Deck:
    """Return the deck of a grid with moved corners, (rows, columns, 2), and straight sides."""
    flat = generate(deck).coordinates
    places = flat.reshape(-1, int(np.argmax(np.diff(flat[:, 1]) > 0.0)) + 1, 2).copy()
    places[::2, ::2] = move(places[::2, ::2])
    places[::2, 1::2] = (places[::2, :-1:2] + places[::2, 2::2]) / 2.0
    places[1::2] = (places[:-1:2] + places[2::2]) / 2.0
    found = places.reshape(-1, 2).tolist()
    records = [NodeValues(n, 0, (x, y)) for n, (x, y) in enumerate(found, start=1)]
    segments = [
        Coordinates(tuple(records)) if isinstance(s, Coordinates) else s for s in deck.segments
    ]
    return replace(deck, segments=tuple(segments), text="")


def distorted(deck: Deck, most: float) -> Deck:
    """Return the deck with its inner corners moved by up to a length."""

    def shift(corners: np.ndarray) -> np.ndarray:
        shifts = np.random.default_rng(0).uniform(-most, most, corners.shape)
        shifts[[0, -1]] = shifts[:, [0, -1]] = 0.0
        return corners + shifts

    return moved(deck, shift)


def graded(times: int) -> Deck:
    """Return the mesh with rows and columns that become narrower towards the middle."""
    middle = np.array([3.0, 2.0])
    return moved(
        refined(times), lambda at: at + 0.08 * np.sin(np.pi * (at - middle) / middle) * middle
    )


def coupled(deck: Deck) -> Deck:
    """Return the deck with half of the plies turned by 90 degrees: B is not 0, u and v move."""
    material = deck.require(Material)
    half = len(material.layers) // 2
    turned = [replace(layer, angle=90.0) for layer in material.layers[half:]]
    layers = (*material.layers[:half], *turned)
    segments = [
        replace(material, layers=layers) if s is material else s
        for s in deck.segments
        if not isinstance(s, Boundary)
    ]
    return replace(deck, segments=tuple(segments), text="")


def patched() -> Deck:
    """Return the report's deck with a contact patch."""
    deck = report()
    return replace(deck, segments=(*deck.segments, Patch()), text="")


def tied(deck: Deck) -> Deck:
    """Return the deck with assumed shear strains."""
    return replace(deck, segments=(*deck.segments, Shear(assumed=True)), text="")


def stretched(deck: Deck) -> Deck:
    """Return the deck with NONL and assumed shear strains, u and v free."""
    segments = [s for s in deck.segments if not isinstance(s, Boundary)]
    return tied(replace(deck, segments=(*segments, Nonlinear()), text=""))


def linear(deck: Deck) -> Deck:
    """Return the deck without NONL."""
    segments = tuple(s for s in deck.segments if not isinstance(s, Nonlinear))
    return replace(deck, segments=segments, text="")


CASES: dict[str, Callable[[], Deck]] = {
    "report": report,
    "patch": patched,
    "distorted": lambda: distorted(refined(1), 0.04),
    "MITC distorted": lambda: tied(distorted(refined(1), 0.04)),
    "x3": lambda: refined(3),
    "x10": lambda: refined(10),
    "x10 off-centre": lambda: refined(10, 20),
    "x10 graded": lambda: graded(10),
    "x10 distorted": lambda: distorted(refined(10), 0.004),
    "x10 distorted, B": lambda: coupled(distorted(refined(10), 0.004)),
    "x10 MITC distorted": lambda: tied(distorted(refined(10), 0.004)),
    "x10 MITC distorted, B": lambda: tied(coupled(distorted(refined(10), 0.004))),
    "x32": lambda: refined(32),
    "NONL": lambda: stretched(report()),
    "NONL distorted": lambda: stretched(distorted(refined(1), 0.04)),
    "NONL 32 x 32": lambda: stretched(even(32)),
    "NONL 32 x 32 distorted": lambda: stretched(distorted(even(32), 0.0125)),
}


def time_step(deck: Deck) -> float:
    """Return the report's time step, smaller on finer meshes, where u and v may move too."""
    elements = deck.control.numel
    return DT if elements == 140 else float(DT / 2.0 / np.sqrt(elements / 140))


def checked(deck: Deck, steps: int) -> Problem:
    """Return a problem of `steps` steps, which stores a row of each kind at every twentieth."""
    values = {"LOOP": float(steps), "DT": time_step(deck)}
    macros = tuple(replace(m, value=values.get(m.word, m.value)) for m in deck.macros)
    cut = replace(deck, macros=macros)
    return Problem(cut, generate(cut), compile_program(macros, Findings()))


class Plain:
    """The plain loop."""

    def __init__(self, problem: Problem) -> None:
        setup = build_model(problem, RunOptions(solver=CSR))
        if setup.impact is None:
            raise ValueError("nothing hits in this deck")
        self.impact, plate = setup.impact, setup.motion.plate
        self.K, self.m, self.dt = plate.stiffness, plate.mass, time_step(problem.deck)
        self.state, self.velocity = setup.impact.start(), np.zeros(plate.neq)

    def take(self, steps: int) -> None:
        """Take steps."""
        state, load, dt = self.state, self.impact.contact.load, self.dt
        displacement = state.plate.displacement
        for _ in range(steps):
            force = -(self.K @ displacement)
            self.velocity += dt * (force / self.m)
            load.subtract(-state.contact.force, dt, self.velocity)
            displacement += dt * self.velocity
            self.impact.move_projectile(state, dt)


class Memory:
    """Steps of the kernels, with their records in memory."""

    def __init__(self, problem: Problem, threads: int = 1) -> None:
        setup = build_model(problem, RunOptions(solver=KERNELS, threads=threads))
        if setup.impact is None or setup.steps is None:
            raise ValueError("the kernels don't take these steps")
        self.steps, self.state, self.dt = setup.steps, setup.impact.start(), time_step(problem.deck)
        setup.impact.advance(self.state, self.dt)

    def take(self, steps: int) -> None:
        """Take steps."""
        self.steps.take(self.state, self.dt, steps, np.array([], dtype=np.intp))


class Run:
    """Runs of ``fecm run`` without its process, to a closed file."""

    def __init__(self, deck: Deck, folder: str, solver: str) -> None:
        self.deck, self.path = deck, Path(folder) / "run.h5"
        self.options = RunOptions(solver=solver)

    def take(self, steps: int) -> None:
        """Run a deck of so many steps."""
        with hdf5_writer.result_writing(self.path) as sink:
            run_program(Simulation(checked(self.deck, steps), sink, self.options))


class Loop(Protocol):
    """Something that takes steps."""

    def take(self, steps: int) -> None:
        """Take steps."""


def seconds(loop: Loop, steps: int) -> float:
    """Processor time of some steps; the last run's file is deleted before."""
    if isinstance(loop, Run):
        loop.path.unlink(missing_ok=True)
    begin = time.process_time()
    loop.take(steps)
    return time.process_time() - begin


def wall(loop: Loop, steps: int) -> float:
    """Time on the clock of some steps."""
    begin = time.perf_counter()
    loop.take(steps)
    return time.perf_counter() - begin


def memory_per_equation(problem: Problem, solver: str) -> float:
    """Bytes that the model of a solver keeps for each equation."""
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    setup = build_model(problem, RunOptions(solver=solver))
    after = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    return (after - before) / setup.motion.plate.neq


def before_and_after(deck: Deck) -> dict[str, float]:
    """Milliseconds of reading, of the set-up and of the summary of a run."""
    values = {"LOOP": 20.0, "DT": time_step(deck)}
    macros = tuple(replace(m, value=values.get(m.word, m.value)) for m in deck.macros)
    text = replace(deck, macros=macros, text="").to_text()
    result = fecm.run_one(text)

    def least(work: Callable[[], object]) -> float:
        times = []
        for _ in range(3):
            begin = time.process_time()
            work()
            times.append(time.process_time() - begin)
        return 1e3 * min(times)

    reading = least(lambda: Reader(text).problems())
    ready = least(lambda: build_model(load_deck(text).problems[0], RunOptions()))
    summary = least(lambda: about_run(result))
    return {
        "reading": round(reading, 1),
        "set_up": round(ready - reading, 1),
        "summary": round(summary, 1),
    }


def measure(name: str, rounds: int) -> dict[str, object]:
    """Figures of one case."""
    warnings.simplefilter("ignore", fecm.FecmWarning)
    deck = CASES[name]()
    problem = checked(deck, 10)
    neq = problem.mesh.number_of_equations
    solvers = [NUMPY] if LIBRARY is None else [KERNELS, NUMPY]
    if deck.control.numel > 50_000:
        del solvers[1:]  # NumPy would take minutes
    figures: dict[str, object] = {"case": name, "elements": deck.control.numel, "unknowns": neq}
    figures["before_and_after_ms"] = before_and_after(deck)
    kept = memory_per_equation(checked(deck, 10), solvers[0])
    with tempfile.TemporaryDirectory() as folder:
        loops = {s: Run(deck, folder, s) for s in solvers}
        short, counts = 20, {}
        largest = (
            20.0 * FILE_SIZE / (8.0 * (5.0 * 9.0 * deck.control.numel + 6.0 * deck.control.numnp))
        )
        for solver, loop in loops.items():
            few, more = (min(seconds(loop, n) for _ in range(3)) for n in (short, 3 * short))
            wanted = LONGER * 2 * short / max(more - few, 1e-3)
            counts[solver] = short + max(2 * short, int(min(8000, largest, wanted)))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        plain = Plain(checked(linear(deck), 10))
        plain_steps = max(3, int(BUDGET / max(seconds(plain, 3) / 3, 1e-9)))
        memory = Memory(problem) if LIBRARY is not None else None
        rests = None
        if memory is not None and deck.has(Nonlinear):
            rests = Memory(checked(linear(deck), 10))
        own = 0 if memory is None else max(20, int(BUDGET * 20 / max(seconds(memory, 20), 1e-6)))
        best: dict[tuple[str, int], float] = {}

        def take(key: str, loop: Loop, steps: int, clock: Callable[..., float] = seconds) -> None:
            best[key, steps] = min(clock(loop, steps), best.get((key, steps), np.inf))

        pair = []
        if memory is not None and multiprocessing.cpu_count() > 1:
            pair = [(f"{n}", Memory(problem, n)) for n in (1, 2)]
        for _ in range(rounds):
            take("plain", plain, plain_steps)
            for solver, loop in loops.items():
                take(solver, loop, short)
                take(solver, loop, counts[solver])
            if memory is not None:
                take("memory", memory, own)
            if rests is not None:
                take("linear", rests, own)
            for key, both in pair:
                take(key, both, own, wall)
    cost = {"plain": best["plain", plain_steps] / plain_steps}
    for solver in solvers:
        long = counts[solver]
        cost[solver] = (best[solver, long] - best[solver, short]) / (long - short)
    if memory is not None:
        cost["memory"] = best["memory", own] / own
    if pair:
        figures["two_threads"] = round(best["1", own] / best["2", own], 2)
    if rests is not None:
        figures["over_linear"] = round(best["memory", own] / best["linear", own], 2)
    figures["us_a_step"] = {key: round(value * 1e6, 2) for key, value in cost.items()}
    figures["plain_over"] = {
        key: round(cost["plain"] / value, 1) for key, value in cost.items() if key != "plain"
    }
    least = cost.get("memory", cost[solvers[0]])
    return figures | {
        "ns_an_element": round(least * 1e9 / deck.control.numel, 1),
        "bytes_an_equation": round(kept),
        "peak_memory_mb": round(peak),
    }


def main() -> None:
    """Measure the cases, print a table, and keep it if asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", help="; ".join(CASES))
    parser.add_argument("--rounds", type=int, default=5, help="of measurements in turns")
    parser.add_argument("--write", action="store_true", help="keep the figures as JSON")
    options = parser.parse_args()
    if unknown := [name for name in options.cases if name not in CASES]:
        parser.error(f"no case {unknown[0]}; there are {', '.join(CASES)}")
    figures = []
    for name in options.cases or CASES:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            row = pool.apply(measure, (name, options.rounds))
        figures.append(row)
        print(" ".join(f"{key}={value}" for key, value in row.items()), flush=True)
    if options.write:
        print(keep({"cases": figures}))


if __name__ == "__main__":
    main()
