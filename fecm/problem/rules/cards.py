"""Rules about segments that are missing or given twice, and names of nodes in messages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fecm.deck import model
from fecm.deck.findings import CardPlace
from fecm.deck.model import Deck
from fecm.deck.rules import Report, Reports, Subject, rule
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
    """Return the start of a sentence about the nodes in some rows: ``Nodes 3, 7-9 are``."""
    return f"Node {rows[0] + 1} is" if len(rows) == 1 else f"Nodes {ranges(rows + 1)} are"


def describe_elements(rows: NDArray[np.intp]) -> str:
    """Return number and list of the elements in some rows: ``3 elements (1, 4-5)``."""
    count = len(rows)
    return f"{count} element{'' if count == 1 else 's'} ({ranges(rows + 1)})"


def report_elements(deck: Deck, rows: NDArray[np.intp], what: str, hint: str = "") -> Reports:
    """Report a fault of the elements in some rows: one report a card, or one for many cards."""
    by_card: dict[CardPlace | None, list[int]] = {}
    for row in rows[:MOST_ROWS].tolist():
        by_card.setdefault(place_of_element(deck, row + 1), []).append(row + 1)
    if len(by_card) > SHOWN or len(rows) > MOST_ROWS:
        place = place_of_element(deck, int(rows[0]) + 1)
        yield Report(f"{len(rows)} elements ({ranges(rows + 1)}): each {what}.", place, hint)
        return
    for place, numbers in by_card.items():
        is_single = len(numbers) == 1
        which = f"Element {numbers[0]}" if is_single else f"Elements {ranges(numbers)}: each"
        yield Report(f"{which} {what}.", place, hint)


Kinds = tuple[type[model.Segment], ...]
ALWAYS: Kinds = (model.Coordinates, model.Elements, model.Material)
IN_AN_IMPACT: Kinds = (model.Impact, model.Indentation)
# Segments that replace earlier ones of the same kind.
SINGLE: Kinds = (
    *ALWAYS,
    *IN_AN_IMPACT,
    model.Projectile,
    model.Shear,
    model.Patch,
    model.Gages,
    model.Units,
    model.Compact,
    model.Allowables,
    model.Delamination,
    model.Damping,
    model.Nonlinear,
    model.Preload,
    model.Curvature,
    model.Cure,
    model.Materials,
    model.Laminates,
    model.Zones,
)


@rule("E203", Subject.SEGMENTS)
def missing_segment(deck: model.Deck, unsound: set[str]) -> Reports:
    """A segment is missing.

    Remedy: COOR, ELEM and MATE are needed always, ROD and EXPE with RODP, ALLO with FAIL.
    """
    words = {macro.word for macro in deck.macros}
    impact = IN_AN_IMPACT if "RODP" in words else ()
    failure: Kinds = (model.Allowables,) if "FAIL" in words else ()
    for kind in (*ALWAYS, *impact, *failure):
        if not deck.has(kind) and kind.keyword not in unsound:
            yield Report(
                f"The deck has no {kind.keyword} segment.", deck.place(), "it belongs before END"
            )


@rule("W204", Subject.SEGMENTS)
def repeated_segment(deck: model.Deck, unsound: set[str]) -> Reports:
    """A segment is given twice.

    The last is effective. BOUN segments add up.

    Remedy: Remove one of them.
    """
    for kind in SINGLE:
        for segment in deck.all(kind)[1:]:
            message = f"A second {kind.keyword} segment replaces the first."
            yield Report(message, segment.place(), "remove one of them")
    if len(boundaries := deck.all(model.Boundary)) > 1:
        message = "A second BOUN segment adds to the first and replaces the codes of its nodes."
        yield Report(message, boundaries[1].place())


OF_SEGMENTS = (missing_segment, repeated_segment)
