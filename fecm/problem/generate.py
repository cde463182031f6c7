"""Generate nodes, elements, restraints and loads of the mesh from a deck's cards."""

from __future__ import annotations

import bisect
import operator
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeVar

import numpy as np

from fecm._typing import Floats, Indices
from fecm.deck.findings import Findings, Place
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
)
from fecm.mechanics.mesh import Ints, Mesh, equation_numbers

# Nodes that cards may generate or reset.
GENERATED_PER_NODE = 10  # per node of the deck
GENERATED = 10_000  # and besides


class _Budget:
    """Limit of the generated nodes: the cost would grow with the product of cards and nodes."""

    def __init__(self, nodes: int, findings: Findings) -> None:
        self._limit = self._left = GENERATED_PER_NODE * nodes + GENERATED
        self._findings = findings

    def covers(self, count: int, place: Place | None) -> bool:
        """Take `count` nodes off the budget; report the first card that exceeds it."""
        exceeded = self._left < 0
        self._left -= count
        if self._left < 0 and not exceeded:
            nodes = f"more than {self._limit} nodes, counted with repetitions"
            message = f"The cards up to this one generate {nodes}."
            self._findings.add("E012", message, place, "generate each node once")
        return self._left >= 0


def generate(deck: Deck, findings: Findings | None = None, *, unit_force: bool = False) -> Mesh:
    """Generate nodes, elements, restraints and forces as the listing's GENVEC and PMESH do.

    The mesh is complete if there were no findings.  With `unit_force` the force of ROD's dof is set
    to 1 at ROD's place among the segments, so that it replaces an earlier FORC's value and a later
    FORC's replaces it (the slip ``rod-force``).
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
            if not budget.covers(control.numnp, segment.place()):
                break
            coordinates[:] = np.nan  # a second COOR replaces the first, as in the listing
            _interpolate(coordinates, segment.records, noted, budget)
        elif isinstance(segment, Forces):
            _interpolate(forces, segment.records, noted, budget)
        elif isinstance(segment, Impact) and unit_force:
            forces[segment.node - 1, segment.dof - 1] = 1.0
        elif isinstance(segment, Elements):
            _step(elements, segment.records, noted)
    return Mesh(coordinates, elements, codes, forces, equation_numbers(codes))


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
    """Diameters of a rod's elements, generated like coordinates; NaN for those without a card."""
    noted = Findings() if findings is None else findings
    values = np.full((segment.elements, 1), np.nan)
    known: list[NodeValues] = []
    for record in segment.diameters:
        if not 1 <= record.element <= segment.elements:
            what = f"Rod element {record.element} does not exist"
            message = f"{what}; PROJ defines the rod elements 1 to {segment.elements}."
            noted.add("E420", message, record.place("element"))
        elif known and record.element <= known[-1].node:
            what = f"Rod element {record.element} follows element {known[-1].node}"
            noted.add("E421", f"{what}; elements must ascend.", record.place("element"))
        else:
            known.append(NodeValues(record.element, record.increment, (record.diameter,)))
    _interpolate(values, known, noted, _Budget(segment.elements, noted))
    return values[:, 0]


_R = TypeVar("_R", NodeValues, NodeCodes, ElementNodes)


def _existing(
    records: Sequence[_R], what: str, count: int, code: str, findings: Findings
) -> Sequence[_R]:
    """Records whose node or element exists; the others are reported together."""
    numbers = list(map(operator.attrgetter(what), records))
    if not numbers or (min(numbers) >= 1 and max(numbers) <= count):
        return records
    pairs = list(zip(numbers, records, strict=True))
    outside = [pair for pair in pairs if not 1 <= pair[0] <= count]
    (number, record), more = outside[0], len(outside) - 1
    first = f"{what.capitalize()} {number}" + (f" (and {more} more)" if more else "")
    message = f"{first} does not exist; the control card defines the {what}s 1 to {count}."
    findings.add(code, message, record.place(what))
    return [record for number, record in pairs if 1 <= number <= count]


def _rows(first: NodeValues | NodeCodes, last: NodeValues | NodeCodes) -> Indices:
    """Rows of the nodes from one card up to the next, without that of the next."""
    step = abs(first.increment) if last.node >= first.node else -abs(first.increment)
    return np.arange(first.node - 1, last.node - 1, step)


def _interpolate(
    values: Floats, records: Sequence[NodeValues], findings: Findings, budget: _Budget
) -> None:
    """Fill rows between two cards linearly, adding one constant step at a time (GENVEC)."""
    known = _existing(records, "node", len(values), "E301", findings)
    if not known:
        return
    rows = [record.node - 1 for record in known]
    given = np.array([record.values for record in known])
    generating = [i for i, record in enumerate(known, start=1) if record.increment != 0]
    for begin, i in pairwise([0, *generating, len(known)]):
        values[rows[begin : i + 1]] = given[begin : i + 1]
        if i == len(known):
            return
        last, record = known[i - 1], known[i]
        if record.node == last.node:
            message = f"Node {record.node} follows itself, so nothing can be generated."
            hint = "the card before has a generation increment"
            findings.add("E302", message, record.place("node"), hint)
        run = _rows(last, record)
        if not budget.covers(len(run), record.place("node")):
            return
        if len(run) > 1:
            ends = values[record.node - 1] - values[last.node - 1]
            steps = np.tile(ends / len(run), (len(run), 1))
            steps[0] = values[last.node - 1]
            # Summed one by one, so that each node has the listing's rounding.
            values[run[1:]] = np.add.accumulate(steps, axis=0)[1:]


def _carry(codes: Ints, records: Sequence[NodeCodes], findings: Findings, budget: _Budget) -> None:
    """Set restraint codes; negative ones carry on through generated nodes (PMESH)."""
    last: NodeCodes | None = None
    for record in _existing(records, "node", len(codes), "E301", findings):
        row = codes[record.node - 1]
        row[:] = record.codes
        if last is not None:
            row[(row == 0) & (codes[last.node - 1] < 0)] = -1
            if last.increment != 0:
                run = _rows(last, record)
                if not budget.covers(len(run), record.place("node")):
                    return
                if len(run) > 1:
                    carried = np.logical_or.accumulate(codes[run] < 0, axis=0)[:-1]
                    codes[run[1:]] = np.where(carried, -1, codes[run[1:]])
        last = record


def _step(elements: Ints, records: Sequence[ElementNodes], findings: Findings) -> None:
    """Set elements; those between two cards add the earlier card's increment (PMESH)."""
    last: ElementNodes | None = None
    for record in _existing(records, "element", len(elements), "E303", findings):
        number, previous = record.element, 0 if last is None else last.element
        if number <= previous:
            message = f"Element {number} follows element {previous}; elements must ascend."
            findings.add("E304", message, record.place("element"))
            continue
        if last is None and number > 1:
            message = f"Element {number} is the first; the elements before it are missing."
            findings.add("E305", message, record.place("element"))
        if last is not None:
            _fill(elements, last, number)
        elements[number - 1] = record.nodes
        last = record
    if last is not None:
        _fill(elements, last, len(elements) + 1)


def _fill(elements: Ints, record: ElementNodes, end: int) -> None:
    """Generate the elements between a card's own and number `end`."""
    nodes = np.asarray(record.nodes, dtype=np.int64)
    steps = np.arange(1, end - record.element)[:, None] * (record.increment or 1)
    # Nodes that become 0 or exceed the integers are invalid; the checks report them.
    generated = np.where(nodes + steps == 0, -1, nodes + steps)
    limits = np.iinfo(np.int32)
    generated = np.where(nodes == 0, 0, np.clip(generated, limits.min, limits.max))
    elements[record.element : end - 1] = generated


def place_of_element(deck: Deck, number: int) -> Place | None:
    """Place of the card that defines or generates an element."""
    if (segment := deck.last(Elements)) is None:
        return None
    cards = bisect.bisect_right(segment.records, number, key=lambda record: record.element)
    return segment.records[cards - 1].place("element") if cards else None
