"""Cost of a time step against a plain sparse loop, measured in one process.

Both loops take the same steps of the same deck with the same contact code.  The plain loop is the
product with scipy's CSR matrix and the update of the plate, nothing else; the run does everything
that ``fecm run`` does, results written to a file included.

    python benchmarks/steps.py decks/impact-115.inp
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

from fecm.api import prepare
from fecm.check import Checked
from fecm.parts import set_up
from fecm.results import hdf5
from fecm.simulation import Simulation

ROUNDS = 7


def plain(checked: Checked, steps: int, dt: float) -> float:
    """Seconds of the plain loop."""
    setup = set_up(checked.deck, checked.mesh, frozenset())
    impact, K, m = setup.impact, setup.plate.stiffness, setup.plate.mass
    if impact is None:
        raise ValueError("nothing hits in this deck")
    state = impact.start()
    plate = state.plate
    row = impact.contact.equation
    begin = time.perf_counter()
    for _ in range(steps):
        force = -(K @ plate.displacement)
        force[row] += state.contact.force
        plate.velocity += dt * (force / m)
        plate.displacement += dt * plate.velocity
        impact.move_projectile(state, dt)
    return time.perf_counter() - begin


def full(checked: Checked, folder: str) -> float:
    """Seconds of a run's own loop, from its first macro to its closed file."""
    begin = 0.0
    with hdf5.writing(Path(folder) / "run.h5") as sink:
        simulation = Simulation(checked, frozenset(), sink)
        begin = time.perf_counter()
        simulation.run()
    return time.perf_counter() - begin


def main(deck: str) -> None:
    """Print the medians and the ratio of the two loops, run in turn."""
    checked = prepare(Path(deck)).problems[0]
    with tempfile.TemporaryDirectory() as folder:
        simulation_steps = 4000
        pairs = [
            (plain(checked, simulation_steps, 2e-7), full(checked, folder)) for _ in range(ROUNDS)
        ]
    for name, seconds in zip(("plain CSR loop", "fecm run"), zip(*pairs, strict=True), strict=True):
        median = statistics.median(seconds)
        print(f"{name:15} {median / simulation_steps * 1e6:7.1f} us a step")
    print(f"{'ratio':15} {statistics.median(b / a for a, b in pairs):7.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
