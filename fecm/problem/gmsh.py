"""Physical groups of the curves and surfaces in a file of Gmsh 4.1.

meshio knows all groups of an entity that have names, and of those without a name the first alone.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator
from itertools import islice

_HEAD = re.compile(rb"\s*\$MeshFormat\s+4\.1 ([01]) 8\r?\n(....)?", re.DOTALL)
_SECTION = re.compile(rb"^\$Entities *\r?\n", re.MULTILINE)
_DOUBLES = {0: 3, 1: 6, 2: 6}  # coordinates of an entity by its dimension

Take = Callable[[str, int], list[int]]  # numbers of a kind, `i` or `N` or `d`


def physical_groups(text: bytes) -> dict[tuple[int, int], list[int]]:
    """Numbers of the physical groups of an entity, by its dimension and number.

    Empty for a file that is not of Gmsh 4.1 or is damaged.
    """
    head, section = _HEAD.match(text), _SECTION.search(text)
    if head is None or section is None:
        return {}
    body = text[section.end() :]
    order = "<" if head[2] == b"\1\0\0\0" else ">"
    take = _binary(body, order) if head[1] == b"1" else _ascii(body)
    try:
        return dict(_entities(take))
    except (ValueError, struct.error):
        return {}


def _entities(take: Take) -> Iterator[tuple[tuple[int, int], list[int]]]:
    """Dimension and number of points, curves and surfaces, and their groups."""
    counts = take("N", 4)
    for dimension, doubles in _DOUBLES.items():
        for _ in range(counts[dimension]):
            (number,) = take("i", 1)
            take("d", doubles)
            groups = take("i", *take("N", 1))
            if dimension:
                take("i", *take("N", 1))  # entities around it
            yield (dimension, number), [abs(group) for group in groups]


def _ascii(body: bytes) -> Take:
    words = iter(body.partition(b"$End")[0].split())

    def take(kind: str, count: int) -> list[int]:
        found = list(islice(words, count))
        if len(found) < count:
            raise ValueError(f"{count} numbers, of which {len(found)} are there")
        return [] if kind == "d" else [int(word) for word in found]

    return take


def _binary(body: bytes, order: str) -> Take:
    position = 0
    letters = {"i": "i", "N": "Q", "d": "d"}

    def take(kind: str, count: int) -> list[int]:
        nonlocal position
        form = f"{order}{count}{letters[kind]}"
        found = struct.unpack_from(form, body, position)
        position += struct.calcsize(form)
        return [] if kind == "d" else list(found)

    return take
