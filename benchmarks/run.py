"""Cost of a time step against a plain sparse loop, both measured in one process.

    python benchmarks/run.py [--write] [CASE ...]

Cases are the report's deck (`report`), its mesh refined 3, 10 and 20 times in each direction (`x3`,
`x10`, `x20`), the mesh refined 10 times and hit beside its middle (`off-centre`), so that all of it
has to be stepped, the report's mesh with its inner nodes moved at random (`distorted`), and the
report's deck with a contact patch (`patch`), compared with the deck without, run in turns.  The
plain loop is the product with scipy's CSR matrix, the update of the plate and the same contact
code; the other one is what ``fecm run`` does: energies, history and stored rows included, written
to a file, on one thread and on every core.
Each case has a process of its own, and its peak memory is read before the plain loop needs more.
`--write` keeps the figures in benchmarks/results, under the machine's name.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from figures import keep

import fecm
from fecm.deck import Deck
from fecm.deck.grid import Grid, Section
from fecm.deck.macros import compile_program
from fecm.deck.model import Boundary, Coordinates, Elements, Impact, Patch
from fecm.deck.records import Control, NodeValues
from fecm.mechanics.stiffness_product import CSR, available
from fecm.problem.build import build_model
from fecm.problem.generate import generate
from fecm.problem.options import RunOptions
from fecm.problem.problem import Problem
from fecm.results import hdf5_writer
from fecm.simulation.run import run
from fecm.simulation.simulation import Simulation

HERE = Path(__file__).parent
ROUNDS = 5
# Seconds that one loop of a round may take about.
BUDGET = 1.0
DT = 2.0e-7


def report() -> Deck:
    """The report's plate over 800 microseconds."""
    deck = fecm.read_deck(HERE.parent / "decks" / "impact-115.inp")
    if not isinstance(deck, Deck):
        raise TypeError("the deck holds several problems")
    return deck


def refined(times: int) -> Deck:
    """The report's plate with every element cut `times` times in each direction."""
    deck = report()
    columns = [
        Section(0.0, 1.5, 3 * times), Section(1.5, 4.5, 8 * times), Section(4.5, 6.0, 3 * times)
    ]  # fmt: skip
    rows = [Section(0.0, 0.5, times), Section(0.5, 3.5, 8 * times), Section(3.5, 4.0, times)]
    grid = Grid(columns, rows)
    boundary = grid.boundary((1, 1, 0, 0, 0), {})
    kept = [
        s for s in deck.segments if not isinstance(s, Coordinates | Elements | Boundary | Impact)
    ]
    hit = Impact(grid.nearest(3.0, 2.0)[0], 3, 115.0)
    mesh = [grid.coordinates(), grid.element_cards(), *([boundary] if boundary else [])]
    control = Control(grid.nodes, grid.elements, deck.control.layers, 2, 5, 9)
    return replace(deck, control=control, segments=(*mesh, *kept, hit), text="")


def off_centre() -> Deck:
    """The mesh refined 10 times, hit where no symmetry halves it."""
    deck = refined(10)
    hit = deck.require(Impact)
    aside = replace(hit, node=hit.node + 20)
    segments = tuple(aside if segment is hit else segment for segment in deck.segments)
    return replace(deck, segments=segments, text="")


def distorted() -> Deck:
    """The report's mesh with the nodes inside moved by up to a tenth of an element."""
    deck = report()
    places = generate(deck).coordinates.copy()
    inside = ((places > 0.0) & (places < [6.0, 4.0])).all(axis=1)
    places[inside] += np.random.default_rng(0).uniform(-0.02, 0.02, (inside.sum(), 2))
    records = [NodeValues(n, 0, (x, y)) for n, (x, y) in enumerate(places.tolist(), start=1)]
    segments = [Coordinates(tuple(records)) if isinstance(s, Coordinates) else s
                for s in deck.segments]  # fmt: skip
    return replace(deck, segments=tuple(segments), text="")


def patched() -> Deck:
    """The report's deck with a contact patch."""
    deck = report()
    return replace(deck, segments=(*deck.segments, Patch()), text="")


CASES: dict[str, Callable[[], Deck]] = {
    "report": report,
    "x3": lambda: refined(3),
    "x10": lambda: refined(10),
    "x20": lambda: refined(20),
    "off-centre": off_centre,
    "distorted": distorted,
    "patch": patched,
}


def time_step(deck: Deck) -> float:
    """The report's time step, finer on finer meshes."""
    return float(DT / np.sqrt(deck.control.numel / 140))


def checked(deck: Deck, steps: int) -> Problem:
    """A problem of so many steps, which stores a row of each kind at every twentieth."""
    values = {"LOOP": float(steps), "DT": time_step(deck)}
    macros = tuple(replace(m, value=values.get(m.word, m.value)) for m in deck.macros)
    cut = replace(deck, macros=macros)
    return Problem(cut, generate(cut), compile_program(macros, fecm.deck.Findings()))


def full(problem: Problem, folder: str, threads: int = 1) -> float:
    """Seconds of a run's own loop, from its first macro to its closed file."""
    begin = 0.0
    path = Path(folder) / "run.h5"
    path.unlink(missing_ok=True)
    with hdf5_writer.writing(path) as sink:
        simulation = Simulation(problem, sink, RunOptions(threads=threads))
        begin = time.perf_counter()
        run(simulation)
    return time.perf_counter() - begin


def plain(problem: Problem, steps: int) -> float:
    """Seconds of the plain loop."""
    setup = build_model(problem, RunOptions(solver=CSR))
    impact, plate = setup.impact, setup.motion.plate
    K, m = plate.stiffness, plate.mass
    if impact is None:
        raise ValueError("nothing hits in this deck")
    state, load = impact.start(), impact.contact.load
    displacement, velocity = state.plate.displacement, np.zeros(plate.neq)
    dt = time_step(problem.deck)
    begin = time.perf_counter()
    for _ in range(steps):
        force = -(K @ displacement)
        velocity += dt * (force / m)
        load.subtract(-state.contact.force, dt, velocity)
        displacement += dt * velocity
        impact.move_projectile(state, dt)
    return time.perf_counter() - begin


def patch_over_point(folder: str) -> float:
    """Cost of a step with a patch over one without; the best of many short runs in turns."""
    problems = [checked(deck, 1000) for deck in (patched(), report())]
    times = [[full(problem, folder) for problem in problems] for _ in range(12 * ROUNDS)]
    patch, point = np.min(times, axis=0)
    return float(patch / point)


def measure(name: str) -> dict[str, float | str | int]:
    """Figures of one case."""
    deck = CASES[name]()
    with tempfile.TemporaryDirectory() as folder:
        few, more = (full(checked(deck, steps), folder) for steps in (20, 60))
        steps = max(60, min(4000, int(BUDGET * 40 / max(more - few, 1e-6))))
        problem = checked(deck, steps)
        first = full(problem, folder)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        pairs = [(plain(problem, steps), first)]
        pairs += [(plain(problem, steps), full(problem, folder)) for _ in range(ROUNDS - 1)]
        shared = [full(problem, folder, available()) for _ in range(ROUNDS)]
        over_point = patch_over_point(folder) if name == "patch" else None
    neq = problem.mesh.number_of_equations
    ours = statistics.median(b for _, b in pairs) / steps
    together = statistics.median(shared) / steps
    return {
        "case": name,
        "elements": deck.control.numel,
        "unknowns": neq,
        "steps": steps,
        "us_a_step": round(ours * 1e6, 1),
        "us_a_step_on_every_core": round(together * 1e6, 1),
        "csr_us_a_step": round(statistics.median(a for a, _ in pairs) / steps * 1e6, 1),
        "ratio": round(statistics.median(b / a for a, b in pairs), 3),
        "million_unknown_steps_a_second": round(neq / ours / 1e6, 1),
        "million_unknown_steps_a_second_on_every_core": round(neq / together / 1e6, 1),
        "us_an_element": round(ours * 1e6 / deck.control.numel, 4),
        "peak_memory_mb": round(peak, 1),
        **({} if over_point is None else {"over_point_force": round(over_point, 3)}),
    }


def main() -> None:
    """Measure the cases, print a table, and keep it if asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--write", action="store_true", help="keep the figures as JSON")
    options = parser.parse_args()
    if unknown := [name for name in options.cases if name not in CASES]:
        parser.error(f"no case {unknown[0]}; there are {', '.join(CASES)}")
    figures = []
    print(
        f"{'case':12}{'elements':>9}{'us/step':>10}{'all cores':>10}{'CSR':>10}{'ratio':>8}"
        f"{'M u-s/s':>9}{'all cores':>10}{'MB':>8}"
    )
    for name in options.cases or CASES:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            row = pool.apply(measure, (name,))
        figures.append(row)
        print(
            f"{name:12}{row['elements']:9}{row['us_a_step']:10}{row['us_a_step_on_every_core']:10}"
            f"{row['csr_us_a_step']:10}{row['ratio']:8}{row['million_unknown_steps_a_second']:9}"
            f"{row['million_unknown_steps_a_second_on_every_core']:10}{row['peak_memory_mb']:8}",
            flush=True,
        )
        if "over_point_force" in row:
            print(f"{'':12}a step with a patch costs {row['over_point_force']} of one without")
    if options.write:
        print(keep({"cases": figures}))


if __name__ == "__main__":
    main()
