"""Time of a run with FAIL: ``asv run``, ``asv publish``."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from failure import CASES, with_fail

import fecm


class Failures:
    """A run in memory with FAIL,,20."""

    params = tuple(CASES)
    param_names = ("case",)
    timeout = 300

    def setup(self, case: str) -> None:
        """Write the deck of a case."""
        warnings.simplefilter("ignore")
        self.deck = with_fail(CASES[case]())

    def time_run(self, case: str) -> None:
        """Time of the run."""
        fecm.run(self.deck)
