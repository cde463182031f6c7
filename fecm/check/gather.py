"""Saying the same of many nodes or elements in one finding."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fecm.deck.findings import Findings, Place
from fecm.deck.model import Deck
from fecm.mesh import place_of_element

# Findings of one kind about elements are gathered beyond this number of cards.
SHOWN = 4
# Runs of numbers that are written out.
RUNS = 8


def ranges(numbers: Sequence[int] | NDArray[np.int_]) -> str:
    """Write ascending numbers shortly: ``3, 7-9, 12``."""
    array = np.asarray(numbers)
    runs = np.split(array, np.flatnonzero(np.diff(array) != 1) + 1)
    parts = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs[:RUNS]]
    return ", ".join([*parts, "..."] if len(runs) > RUNS else parts)


def nodes(rows: NDArray[np.intp]) -> str:
    """Begin a sentence about nodes, given by their rows: ``Nodes 3, 7-9 are``."""
    return f"Node {rows[0] + 1} is" if len(rows) == 1 else f"Nodes {ranges(rows + 1)} are"


def listed(rows: NDArray[np.intp]) -> str:
    """Name elements by their rows, how many and which: ``3 elements (1, 4-5)``."""
    count = len(rows)
    return f"{count} element{'' if count == 1 else 's'} ({ranges(rows + 1)})"


def elements(
    findings: Findings, code: str, rows: NDArray[np.intp], deck: Deck, what: str, hint: str = ""
) -> None:
    """Report what is wrong with elements, given by their rows: one finding a card that gives them.

    Beyond :data:`SHOWN` cards a single finding tells of all.
    """
    by_card: dict[Place | None, list[int]] = {}
    for row in rows[: 100 * SHOWN].tolist():
        by_card.setdefault(place_of_element(deck, row + 1), []).append(row + 1)
    if len(by_card) > SHOWN or len(rows) > 100 * SHOWN:
        place = place_of_element(deck, int(rows[0]) + 1)
        findings.add(code, f"{len(rows)} elements ({ranges(rows + 1)}): each {what}.", place, hint)
        return
    for place, numbers in by_card.items():
        if len(numbers) == 1:
            findings.add(code, f"Element {numbers[0]} {what}.", place, hint)
        else:
            findings.add(code, f"Elements {ranges(numbers)}: each {what}.", place, hint)
