"""Sets of nodes and elements in an input of Abaqus.

meshio reads the nodes and the elements. The sets are read here: meshio loses members of a set that
is given before further elements, does not know sets of sets of nodes, and may give the set of an
`*ELEMENT` card to the elements of another card.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int_]


class AbaqusCard(NamedTuple):
    """Keyword line with its data lines."""

    line: int
    keyword: str  # in capitals, without the asterisk
    parameters: Mapping[str, str]  # names in capitals; an empty text for one without a value
    head: str  # keyword line
    data: list[str]

    @property
    def numbers(self) -> list[int]:
        """All numbers of the data lines."""
        return [int(word) for line in self.data for word in line.replace(",", " ").split()]


class AbaqusSetError(ValueError):
    """A set can't be read."""


def abaqus_cards(text: str) -> Iterator[AbaqusCard]:
    """Yield the cards of an input. A keyword line that ends with a comma continues in the next."""
    card: AbaqusCard | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.startswith("**"):
            continue
        if card is not None and not card.data and card.head.rstrip().endswith(","):
            card = _card(card.line, f"{card.head} {line.strip()}")
        elif line.startswith("*"):
            if card is not None:
                yield card
            card = _card(number, line)
        elif card is not None:
            card.data.append(line)
    if card is not None:
        yield card


def _card(line: int, head: str) -> AbaqusCard:
    keyword, *parameters = (part.strip() for part in head[1:].split(","))
    pairs = (part.partition("=") for part in parameters)
    named = {name.strip().upper(): value.strip() for name, _, value in pairs}
    return AbaqusCard(line, keyword.upper(), named, head, [])


def nodes_and_elements(cards: Sequence[AbaqusCard]) -> str:
    """Return the text of the nodes and elements, with keywords and types in capitals."""
    kept = (card for card in cards if card.keyword in ("NODE", "ELEMENT"))
    return "\n".join("\n".join((card.head.upper(), *card.data)) for card in kept) + "\n"


def node_sets(cards: Sequence[AbaqusCard]) -> dict[str, Integers]:
    """Return the rows of the nodes of each set.

    Raises AbaqusSetError if a set has a node or a set that is not there.
    """
    lines = [line for card in cards if card.keyword == "NODE" for line in card.data]
    numbers = np.array([int(line.split(",")[0]) for line in lines], int)
    sets = _sets(cards, "NSET", numbers, {})
    order = np.argsort(numbers)
    return {name: order[np.searchsorted(numbers[order], members)] for name, members in sets.items()}


def element_sets(
    cards: Sequence[AbaqusCard], nodes_of_blocks: Sequence[int]
) -> dict[str, list[Integers]]:
    """Return the rows of the elements of each set in each block of elements.

    A block is an `*ELEMENT` card; `nodes_of_blocks` has the nodes of its elements. Raises
    AbaqusSetError if a set has an element or a set that is not there.
    """
    cards_of_elements = [card for card in cards if card.keyword == "ELEMENT"]
    blocks = [
        np.array(card.numbers, int)[:: nodes + 1]
        for card, nodes in zip(cards_of_elements, nodes_of_blocks, strict=True)
    ]
    sets: dict[str, Integers] = {}
    for card, numbers in zip(cards_of_elements, blocks, strict=True):
        if name := card.parameters.get("ELSET"):
            name = _key(sets, name)
            sets[name] = np.union1d(sets.get(name, numbers[:0]), numbers)
    every = np.concatenate([*blocks, np.empty(0, int)])
    sets = _sets(cards, "ELSET", every, sets)
    return {
        name: [np.flatnonzero(np.isin(numbers, members)) for numbers in blocks]
        for name, members in sets.items()
    }


def _sets(
    cards: Sequence[AbaqusCard], keyword: str, every: Integers, sets: dict[str, Integers]
) -> dict[str, Integers]:
    """Add the sets of a keyword to `sets`, by their members' numbers, of which `every` has all.

    A name that is given again adds members; a set of an instance replaces the part's of its name.
    """
    of_instances: set[str] = set()
    for card in cards:
        if card.keyword != keyword or not card.parameters.get(keyword):
            continue
        name = _key(sets, card.parameters[keyword])
        members = _members(card, every, sets)
        is_of_instance = "INSTANCE" in card.parameters
        if is_of_instance and name not in of_instances:
            sets.pop(name, None)
            of_instances.add(name)
        sets[name] = np.union1d(sets.get(name, members[:0]), members)
    return sets


def _members(card: AbaqusCard, every: Integers, sets: Mapping[str, Integers]) -> Integers:
    """Return the numbers of the members of a set."""
    if "GENERATE" in card.parameters:
        in_set = np.zeros(len(every), bool)
        for line in card.data:
            first, last, *step = (int(word) for word in line.replace(",", " ").split())
            step = step or [1]
            in_set |= (every >= first) & (every <= last) & ((every - first) % step[0] == 0)
        return every[in_set]
    kind = "node" if card.keyword == "NSET" else "element"
    words = [word.strip() for line in card.data for word in line.split(",") if word.strip()]
    numbers = np.array([int(word) for word in words if re.fullmatch("[0-9]+", word)], int)
    if (absent := numbers[~np.isin(numbers, every)]).size:
        raise AbaqusSetError(
            f"{card.line}: *{card.keyword} has the {kind} {absent[0]}, which is not in the file; "
            "delete it from the set"
        )
    parts = [numbers]
    for word in words:
        if re.fullmatch("[0-9]+", word):
            continue
        if (key := _key(sets, word.rpartition(".")[2].strip('"'))) not in sets:
            raise AbaqusSetError(
                f"{card.line}: *{card.keyword} has the set {word}, which no card before it "
                "gives; move it behind that set, or delete it"
            )
        parts.append(sets[key])
    return np.unique(np.concatenate(parts))


def _key(sets: Mapping[str, Integers], name: str) -> str:
    """Return the name under which a set was given first; capitals do not matter."""
    name = name.strip('"')
    return next((known for known in sets if known.casefold() == name.casefold()), name)
