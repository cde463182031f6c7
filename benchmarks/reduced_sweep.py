"""Impacts on a plate that stretches, by the reduced model: processor times.

    python benchmarks/reduced_sweep.py

A drop-weight test of 20 J on a coupon of D7136 is reduced to 21 bending modes.  256 impacts of
random velocities and contact coefficients are computed five times.  The figures are medians in
processor seconds, with the range.  The forces of 16 of the cases are compared with those of NumPy.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fecm.authoring.strike_values import strike_of
from fecm.mechanics.contact_law import HystereticLaw, LinearPermanent
from fecm.problem.loading import load_deck
from fecm.sweeps.reduced import reduced
from fecm.sweeps.responses import Hits
from fecm.sweeps.task import MODES

CASES, COMPARED, ROUNDS = 256, 16, 5
COUPON = (
    *("--fixture", "D7136", "--layup", "[45/0/-45/90]4s", "--material", "IM7/8552"),
    *("--energy", "20J", "--kinematics", "von-karman"),
)


def timed(name: str, compute: Callable[[], object], count: int = 1) -> None:
    """Print the processor seconds of a call, and the cases per second of `count` cases."""
    seconds = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        compute()
        seconds.append(time.process_time() - begin)
    median = statistics.median(seconds)
    print(f"{name}: {median:.3f} s ({min(seconds):.3f} to {max(seconds):.3f})", end="")
    print(f", {count / median:.1f} cases/s" if count > 1 else "")


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drop.inp"
        command = [sys.executable, "-m", "fecm", "new", str(path), *COUPON, "--quiet"]
        subprocess.run(command, check=True)
        (problem,) = load_deck(path.read_text()).problems
    timed("reduction", lambda: reduced(problem, MODES))
    model, random = reduced(problem, MODES), np.random.default_rng(1)
    speed, k = random.uniform(300.0, 2700.0, CASES), random.uniform(3e4, 6e4, CASES)
    strike = strike_of(problem.deck)

    def hits(count: int) -> Hits:
        one = np.ones(count)
        law = HystereticLaw(LinearPermanent(k[:count], 1e9 * one, 0.0 * one, 1.5 * one))
        return Hits([strike.projectile], np.zeros(count, np.intp), one, law, speed[:count])

    timed(f"{model.steps} steps", lambda: model.impacts(hits(CASES)), CASES)
    actual, wanted = model.impacts(hits(COMPARED)).force, model.by_numpy(hits(COMPARED)).force
    difference = (np.abs(actual - wanted) / wanted.max(axis=0)).max()
    print(f"largest difference from NumPy, over the peak: {difference:.1e}")


if __name__ == "__main__":
    main()
