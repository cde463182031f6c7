"""Time and memory of the cases of run.py and of a sweep: ``asv run``, ``asv publish``."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from run import CASES, time_step

import fecm

# Steps that take about a second on the larger meshes.
STEPS = {
    "report": 4000,
    "distorted": 4000,
    "MITC distorted": 4000,
    "patch": 4000,
    "x3": 1000,
    "x10": 100,
    "x10 off-centre": 100,
}


class Runs:
    """A run in memory, with everything that the deck stores."""

    params = tuple(STEPS)
    param_names = ("case",)
    timeout = 300

    def setup(self, case: str) -> None:
        """Write the deck of a case as text, which every version reads."""
        warnings.simplefilter("ignore")
        deck = CASES[case]()
        macros = deck.to_text().partition("MACR\n")[0]
        self.deck = (
            f"{macros}MACR\nLMAS\nDT,,{time_step(deck):.6E}\nLOOP,,{STEPS[case]}\nTIME\nRODP,,20\n"
            "DISP,,20\nNEXT\nEND\nSTOP\n"
        )

    def time_run(self, case: str) -> None:
        """Time of the run."""
        fecm.run(self.deck)

    def peakmem_run(self, case: str) -> None:
        """Peak memory of the run."""
        fecm.run(self.deck)


class Sweeps:
    """A thousand impacts on the report's plate."""

    timeout = 300

    def time_thousand_cases(self) -> None:
        """Time of the sweep."""
        warnings.simplefilter("ignore")
        velocity = [50.0 + n * 250.0 / 39.0 for n in range(40)]
        k = [1e6 + n * 2e6 / 24.0 for n in range(25)]
        fecm.sweep(CASES["report"](), {"velocity": velocity, "k": k})
