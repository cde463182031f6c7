"""Time of many random cases on one plate: ``asv run``, ``asv publish``."""

from __future__ import annotations

import warnings
from pathlib import Path

import fecm

DECK = Path(__file__).parents[2] / "decks" / "impact-115.inp"
LAWS = {"velocity": "normal:115,10", "k": "lognormal:1.9e6,0.15"}


class RandomSweeps:
    """Draws of velocity and contact coefficient on the report's plate."""

    timeout = 300

    def setup(self) -> None:
        """Run the plate, whose response later sweeps share."""
        warnings.simplefilter("ignore")
        fecm.sweep(DECK, random=LAWS, samples=16)

    def time_four_thousand_draws(self) -> None:
        """Time of the sweep."""
        warnings.simplefilter("ignore")
        fecm.sweep(DECK, random=LAWS, samples=4096)
