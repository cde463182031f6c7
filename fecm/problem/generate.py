"""Generation of nodes, elements, restraints and loads of the mesh from a deck's cards."""

from __future__ import annotations

import bisect
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from fecm._typing import Floats, Indices
from fecm.deck.findings import CardPlace, Findings
from fecm.deck.model import (
    Boundary,
    Coordinates,
    Deck,
    ElementNodes,
    Elements,
    Forces,
    Impact,
    NodeCodes,
    NodeValues,
    Projectile,
    Record,
)
from fecm.deck.table import CardTable
from fecm.mechanics.mesh import Ints, MeshArrays, equation_numbers

# Nodes that cards may generate or reset.
GENERATED_PER_NODE = 10  # per node of the deck
GENERATED = 10_000  # in addition


class _Budget:
    """Limit of the generated nodes, as the cost grows with the product of cards and nodes."""

    def __init__(self, nodes: int, findings: Findings) -> None:
        self._limit = self._left = GENERATED_PER_NODE * nodes + GENERATED
        self._findings = findings

    def covers(self, count: int, place: Callable[[], CardPlace | None]) -> bool:
        """Take `count` nodes off the budget; report the first card that exceeds it."""
        exceeded = self._left < 0
        self._left -= count
        if self._left < 0 and not exceeded:
            nodes = f"more than {self._limit} nodes, counted with repetitions"
            message = f"The cards up to this one generate {nodes}."
            self._findings.add("E012", message, place(), "generate each node once")
        return self._left >= 0


def generate(
    deck: Deck, findings: Findings | None = None, *, unit_force: bool = False
) -> MeshArrays:
    """Generate nodes, elements, restraints and forces as the listing's GENVEC and PMESH do.

    The mesh is complete if there were no findings. With `unit_force` the force of ROD's dof is set
    to 1 at ROD's place among the segments. It replaces the value of an earlier FORC, and a later
    FORC replaces it.
    """
    noted = Findings() if findings is None else findings
    control = deck.control
    coordinates = np.full((control.numnp, control.ndm), np.nan)
    elements = np.zeros((control.numel, control.nen), dtype=np.int32)
    codes = restraint_codes(deck.all(Boundary), control.numnp, control.ndf, noted)
    forces = np.zeros((control.numnp, control.ndf))
    budget = _Budget(control.numnp, noted)
    for segment in deck.segments:
        if isinstance(segment, Coordinates):
            if not budget.covers(control.numnp, segment.place):
                break
            coordinates[:] = np.nan  # a second COOR replaces the first, as in the listing
            _interpolate(coordinates, segment.records, noted, budget)
        elif isinstance(segment, Forces):
            _interpolate(forces, segment.records, noted, budget)
        elif isinstance(segment, Impact) and unit_force:
            forces[segment.node - 1, segment.dof - 1] = 1.0
        elif isinstance(segment, Elements):
            _step(elements, segment.records, noted)
    return MeshArrays(coordinates, elements, codes, forces, equation_numbers(codes))


def node_values(
    records: Sequence[NodeValues],
    shape: tuple[int, int],
    findings: Findings | None = None,
    blank: float = 0.0,
) -> Floats:
    """Return values of all nodes, generated between cards as coordinates are; `blank` elsewhere."""
    noted = Findings() if findings is None else findings
    values = np.full(shape, blank)
    _interpolate(values, records, noted, _Budget(len(values), noted))
    return values


def restraint_codes(
    boundaries: Sequence[Boundary], nodes: int, dofs: int, findings: Findings | None = None
) -> Ints:
    """Generate the restraint codes of BOUN segments, (nodes, dofs)."""
    codes = np.zeros((nodes, dofs), dtype=np.int32)
    noted = Findings() if findings is None else findings
    budget = _Budget(nodes, noted)
    for segment in boundaries:
        _carry(codes, segment.records, noted, budget)
    return codes


def rod_diameters(segment: Projectile, findings: Findings | None = None) -> Floats:
    """Return the diameters of a rod's elements, generated like coordinates.

    Elements without a card have NaN.
    """
    noted = Findings() if findings is None else findings
    values = np.full((segment.elements, 1), np.nan)
    cards: list[NodeValues] = []
    for record in segment.diameters:
        if not 1 <= record.element <= segment.elements:
            what = f"Rod element {record.element} does not exist"
            message = f"{what}; PROJ defines the rod elements 1 to {segment.elements}."
            noted.add("E420", message, record.place("element"))
        elif cards and record.element <= cards[-1].node:
            what = f"Rod element {record.element} follows element {cards[-1].node}"
            noted.add("E421", f"{what}; elements must ascend.", record.place("element"))
        else:
            cards.append(NodeValues(record.element, record.increment, (record.diameter,)))
    _interpolate(values, cards, noted, _Budget(segment.elements, noted))
    return values[:, 0]


_R = TypeVar("_R", NodeValues, NodeCodes, ElementNodes)


class _Cards(NamedTuple):
    """Cards of nodes or elements as arrays, and their records, which know their positions."""

    numbers: Indices  # of the nodes or elements
    increments: Indices
    values: Floats | Ints  # (cards, values)
    records: Sequence[Record]

    def place(self, card: int, field: str) -> CardPlace | None:
        """Return the position of a field of a card."""
        return self.records[card].place(field)


def _cards(records: Sequence[_R], number: str, values: str) -> _Cards:
    """Return arrays of records; `number` and `values` are the names of their attributes."""
    kind = "f8" if values == "values" else "i4"
    if isinstance(records, CardTable):
        table = np.frombuffer(records.values).reshape(-1, records.width)
        packed = records.kind.packed
        numbers, increments = np.delete(table, packed, axis=1).astype(np.intp).T
        return _Cards(numbers, increments, table[:, packed].astype(kind), records)
    numbers, increments = (
        np.array([getattr(record, name) for record in records], dtype=np.intp)
        for name in (number, "increment")
    )
    rows = np.array([getattr(record, values) for record in records], dtype=kind)
    return _Cards(numbers, increments, rows, records)


def _existing(
    records: Sequence[_R], number: str, values: str, count: int, code: str, findings: Findings
) -> _Cards:
    """Return the cards whose node or element exists; report the others together."""
    cards = _cards(records, number, values)
    inside = (cards.numbers >= 1) & (cards.numbers <= count)
    if inside.all():
        return cards
    outside = np.flatnonzero(~inside).tolist()
    first, more = outside[0], len(outside) - 1
    which = f"{number.capitalize()} {cards.numbers[first]}" + (f" (and {more} more)" * (more > 0))
    message = f"{which} does not exist; the control card defines the {number}s 1 to {count}."
    findings.add(code, message, records[first].place(number))
    kept = [records[card] for card in np.flatnonzero(inside).tolist()]
    return _Cards(cards.numbers[inside], cards.increments[inside], cards.values[inside], kept)


def _rows(first: int, last: int, increment: int) -> Indices:
    """Return the rows of the nodes from one card up to the next card, which is excluded."""
    step = abs(increment) if last >= first else -abs(increment)
    return np.arange(first - 1, last - 1, step)


def _interpolate(
    values: Floats, records: Sequence[NodeValues], findings: Findings, budget: _Budget
) -> None:
    """Fill rows between two cards linearly, adding one constant step at a time (GENVEC)."""
    if not records:
        return
    cards = _existing(records, "node", "values", len(values), "E301", findings)
    count = len(cards.numbers)
    generating = np.flatnonzero(cards.increments) + 1
    for begin, i in pairwise([0, *generating.tolist(), count]):
        values[cards.numbers[begin : i + 1] - 1] = cards.values[begin : i + 1]
        if i == count:
            return
        last, node = cards.numbers[i - 1 : i + 1].tolist()
        if node == last:
            message = f"Node {node} follows itself, so nothing can be generated."
            hint = "the card before has a generation increment"
            findings.add("E302", message, cards.place(i, "node"), hint)
        run = _rows(last, node, int(cards.increments[i - 1]))
        if not budget.covers(len(run), partial(cards.place, i, "node")):
            return
        if len(run) > 1:
            ends = values[node - 1] - values[last - 1]
            steps = np.tile(ends / len(run), (len(run), 1))
            steps[0] = values[last - 1]
            # Summed one by one, so that each node has the listing's rounding.
            values[run[1:]] = np.add.accumulate(steps, axis=0)[1:]


def _carry(codes: Ints, records: Sequence[NodeCodes], findings: Findings, budget: _Budget) -> None:
    """Set restraint codes; negative ones carry on through generated nodes (PMESH)."""
    if not records:
        return
    cards = _existing(records, "node", "codes", len(codes), "E301", findings)
    if not (cards.increments.any() or (cards.values < 0).any()):
        codes[cards.numbers - 1] = cards.values
        return
    last, increment = 0, 0
    for i, node in enumerate(cards.numbers.tolist()):
        row = codes[node - 1]
        row[:] = cards.values[i]
        if last:
            row[(row == 0) & (codes[last - 1] < 0)] = -1
        if increment:
            run = _rows(last, node, increment)
            if not budget.covers(len(run), partial(cards.place, i, "node")):
                return
            if len(run) > 1:
                carried = np.logical_or.accumulate(codes[run] < 0, axis=0)[:-1]
                codes[run[1:]] = np.where(carried, -1, codes[run[1:]])
        last, increment = node, int(cards.increments[i])


def _step(elements: Ints, records: Sequence[ElementNodes], findings: Findings) -> None:
    """Set elements; elements between two cards add the earlier card's increment (PMESH)."""
    if not records:
        return
    cards = _existing(records, "element", "nodes", len(elements), "E303", findings)
    numbers = cards.numbers
    if len(numbers) and numbers[0] > 1:
        message = f"Element {numbers[0]} is the first; the elements before it are missing."
        findings.add("E305", message, cards.place(0, "element"))
    previous = np.maximum.accumulate(np.append(0, numbers))[:-1]
    for i in np.flatnonzero(numbers <= previous).tolist():
        message = f"Element {numbers[i]} follows element {previous[i]}; elements must ascend."
        findings.add("E304", message, cards.place(i, "element"))

    ascending = np.flatnonzero(numbers > previous)
    elements[numbers[ascending] - 1] = cards.values[ascending]
    ends = np.append(numbers[ascending], len(elements) + 1)[1:]
    for i, end in zip(ascending.tolist(), ends.tolist(), strict=True):
        if end > numbers[i] + 1:
            _fill(elements, cards, i, end)


def _fill(elements: Ints, cards: _Cards, card: int, end: int) -> None:
    """Generate the elements from a card's number up to `end`."""
    number, increment = int(cards.numbers[card]), int(cards.increments[card])
    nodes = cards.values[card].astype(np.int64)
    steps = np.arange(1, end - number)[:, None] * (increment or 1)
    # Nodes that become 0 or exceed the integers are invalid; the checks report them.
    generated = np.where(nodes + steps == 0, -1, nodes + steps)
    limits = np.iinfo(np.int32)
    generated = np.where(nodes == 0, 0, np.clip(generated, limits.min, limits.max))
    elements[number : end - 1] = generated


def place_of_element(deck: Deck, number: int) -> CardPlace | None:
    """Return the position of the card that defines or generates an element."""
    if (segment := deck.last(Elements)) is None:
        return None
    cards = bisect.bisect_right(segment.records, number, key=lambda record: record.element)
    return segment.records[cards - 1].place("element") if cards else None
