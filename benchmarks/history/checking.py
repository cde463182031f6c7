"""Time of the steps that ``fecm check`` computes, on the meshes of checking.py: ``asv run``."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from checking import CASES, written

from fecm.mechanics.time_step import critical_time_step, safe_time_step
from fecm.problem.loading import load_deck


class TimeSteps:
    """The critical time step and its lower bound."""

    params = ("14,000 equal", "14,000 distorted")
    param_names = ("elements",)
    timeout = 300

    def setup(self, case: str) -> None:
        """Build the plate."""
        warnings.simplefilter("ignore")
        self.plate = load_deck(written(CASES[case]())).problems[0].moving_plate

    def time_critical(self, case: str) -> None:
        """Time of the Lanczos iteration."""
        critical_time_step(self.plate)

    def time_bound(self, case: str) -> None:
        """Time of the bound from the elements."""
        safe_time_step(self.plate)
