"""Cost of a time step on one-sided supports, over the step of the same plate on a held window.

    python benchmarks/supports.py [--rounds N]

The plate is that of ASTM D7136, on two meshes and with both kinematics. Its window is held, only
pushes, or pushes with four clamps that hold or give way. All take steps without rows and without a
file in one process and one thread, in turns; a figure is the least processor time of the rounds.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does

import argparse
import time
from typing import Any, Literal

import numpy as np

import fecm
from fecm.deck.model import Deck
from fecm.mechanics.stiffness_product import KERNELS
from fecm.problem.build import RunOptions, build_model
from fecm.problem.loading import load_deck

MESHES: dict[str, dict[str, Any]] = {
    "default mesh": {},
    "60 x 40": {"mesh": (50, 30), "grading": 1.0},
}
WINDOWS: dict[str, dict[str, Any]] = {
    "held": {},
    "pushes": {"window": "push"},
    "pushes, clamps held": {"window": "push", "clamps": "held"},
    "pushes, clamps of 2 kN/mm": {"window": "push", "clamps": 2000.0},
}
Kinematics = Literal["linear", "von-karman"]
KINEMATICS: tuple[Kinematics, ...] = ("linear", "von-karman")
NO_ROWS = np.array([], dtype=np.intp)


def deck(mesh: dict[str, Any], window: dict[str, Any], kinematics: Kinematics) -> Deck:
    """Return an impact of 12 J on a plate of 24 plies."""
    return fecm.impact(
        fecm.Plate.on_fixture("D7136", **mesh, **window),
        fecm.Laminate("[45/0/-45/90]3s", "IM7/8552", 0.1833),
        units="mm-N-s",
        energy=12e3,
        kinematics=kinematics,
    )


class Steps:
    """Steps of an impact on a plate."""

    def __init__(self, problem_deck: Deck) -> None:
        (problem,) = load_deck(problem_deck).problems
        setup = build_model(problem, RunOptions(solver=KERNELS, threads=1))
        if setup.impact is None or setup.steps is None:
            raise ValueError("the kernels don't take these steps")
        (self.dt,) = (macro.value for macro in problem_deck.macros if macro.word == "DT")
        self.steps, self.state = setup.steps, setup.impact.start()
        setup.impact.advance(self.state, self.dt)
        self.least = np.inf

    def take(self, count: int) -> None:
        """Take steps, and keep the least time of one."""
        begin = time.process_time()
        self.steps.take(self.state, self.dt, count, NO_ROWS)
        self.least = min(self.least, (time.process_time() - begin) / count)


def main() -> None:
    """Measure and print a row for each plate and window."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5, help="of measurements in turns")
    rounds = parser.parse_args().rounds
    for kinematics in KINEMATICS:
        for name, mesh in MESHES.items():
            plates = {key: Steps(deck(mesh, how, kinematics)) for key, how in WINDOWS.items()}
            for _ in range(rounds):
                for plate in plates.values():
                    plate.take(1000)
            held = plates["held"].least
            for key, plate in plates.items():
                figures = f"{1e6 * plate.least:8.1f} us  {plate.least / held:.3f} of held"
                print(f"{kinematics:11} {name:13} {key:26} {figures}", flush=True)


if __name__ == "__main__":
    main()
