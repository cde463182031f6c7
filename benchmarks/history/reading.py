"""Time and memory of reading and writing a large deck: ``asv run``, ``asv publish``."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from reading import model, texts

import fecm


class Reading:
    """A deck of 14,000 distorted elements, in both forms of its cards."""

    params = ("commas", "columns")
    param_names = ("form",)
    timeout = 300

    def setup(self, form: str) -> None:
        """Write the deck."""
        warnings.simplefilter("ignore")
        self.text = texts(10)[form]
        self.deck = fecm.read_one(self.text)

    def time_read(self, form: str) -> None:
        """Time from the text to the deck."""
        fecm.read_one(self.text)

    def peakmem_read(self, form: str) -> None:
        """Peak memory of reading."""
        fecm.read_one(self.text)

    def time_model(self, form: str) -> None:
        """Time from the text to the model."""
        model(self.text)

    def time_write(self, form: str) -> None:
        """Time of the deck's text."""
        self.deck.to_text()
