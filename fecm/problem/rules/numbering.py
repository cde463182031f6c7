"""Names of nodes and elements in messages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fecm.deck.findings import Place
from fecm.deck.model import Deck
from fecm.deck.rules import Report, Reports
from fecm.problem.generate import place_of_element

SHOWN = 4  # number of cards up to which each has a finding of its own
MOST_ROWS = 100 * SHOWN  # number of elements up to which their cards are looked up
RUNS = 8  # largest number of runs of numbers in a message


def ranges(numbers: Sequence[int] | NDArray[np.int_]) -> str:
    """Write ascending numbers as runs: ``3, 7-9, 12``."""
    array = np.asarray(numbers)
    runs = np.split(array, np.flatnonzero(np.diff(array) != 1) + 1)
    parts = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs[:RUNS]]
    return ", ".join([*parts, "..."] if len(runs) > RUNS else parts)


def describe_nodes(rows: NDArray[np.intp]) -> str:
    """Beginning of a sentence about the nodes in some rows: ``Nodes 3, 7-9 are``."""
    return f"Node {rows[0] + 1} is" if len(rows) == 1 else f"Nodes {ranges(rows + 1)} are"


def describe_elements(rows: NDArray[np.intp]) -> str:
    """Number and list of the elements in some rows: ``3 elements (1, 4-5)``."""
    count = len(rows)
    return f"{count} element{'' if count == 1 else 's'} ({ranges(rows + 1)})"


def report_elements(deck: Deck, rows: NDArray[np.intp], what: str, hint: str = "") -> Reports:
    """Report a fault of the elements in some rows: one report a card, or one for many cards."""
    by_card: dict[Place | None, list[int]] = {}
    for row in rows[:MOST_ROWS].tolist():
        by_card.setdefault(place_of_element(deck, row + 1), []).append(row + 1)
    if len(by_card) > SHOWN or len(rows) > MOST_ROWS:
        place = place_of_element(deck, int(rows[0]) + 1)
        yield Report(f"{len(rows)} elements ({ranges(rows + 1)}): each {what}.", place, hint)
        return
    for place, numbers in by_card.items():
        one = len(numbers) == 1
        which = f"Element {numbers[0]}" if one else f"Elements {ranges(numbers)}: each"
        yield Report(f"{which} {what}.", place, hint)
