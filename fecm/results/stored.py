"""What a run has stored: datasets by path, attributes of groups, and the deck.

:class:`~fecm.results.result.Result` adds to it what can be computed from them.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from fecm._typing import Array
from fecm.deck.model import Deck
from fecm.deck.reader import Reader
from fecm.deck.units import unit_of
from fecm.results.errors import NotStoredError, ResultFileError
from fecm.results.group import Attributes
from fecm.results.metrics import VALIDITY
from fecm.results.missing import not_stored
from fecm.results.schema import KINEMATICS, Kinematics, declared_units


class Stored:
    """Datasets, attributes and deck of a run."""

    def __init__(
        self,
        arrays: Mapping[str, Array],
        texts: Mapping[str, str],
        groups: Mapping[str, Attributes],
        model: Deck | None = None,
    ) -> None:
        self._arrays = arrays
        self._groups = groups
        self._model = model
        self.attributes: dict[str, Any] = dict(groups.get("", {}))
        self.deck: str = texts.get("deck", "")

    @property
    def title(self) -> str:
        """The deck's title."""
        return str(self.attributes.get("title", ""))

    @property
    def mode(self) -> str:
        """``"report"`` or ``"listing"``."""
        return str(self.attributes.get("mode", ""))

    @property
    def kinematics(self) -> str:
        """Strains of the plate: ``"linear"``, or ``"von Karman"`` with NONL."""
        return str(self.attributes.get(KINEMATICS, Kinematics.LINEAR))

    @property
    def slips(self) -> tuple[str, ...]:
        """Names of the active slips, sorted."""
        return self._texts("slips")

    @property
    def notes(self) -> tuple[str, ...]:
        """Reasons to doubt the result."""
        return self._texts("notes")

    def _texts(self, name: str) -> tuple[str, ...]:
        """An attribute that is a list of texts; empty if it is not there."""
        texts = self.attributes.get(name)
        return tuple(map(str, texts)) if isinstance(texts, list | tuple) else ()

    @property
    def validity(self) -> str:
        """``"ok"``, or the reasons to doubt the result, in the words that sweeps have.

        Empty in files of earlier versions and without impact steps.
        """
        return str(self.attributes.get(VALIDITY, ""))

    @property
    def has_listing_tapes(self) -> bool:
        """Whether tape8 and tape9 are those of the printed program: the slip ``tapes``."""
        return "tapes" in self.slips

    @property
    def still_in_contact(self) -> bool:
        """Whether the run ended in contact, so that its final values are not known."""
        return "history/force" in self and bool((self["history/force"][-1:] > 0.0).any())

    @property
    def threshold(self) -> Mapping[str, Any]:
        """Delamination threshold of DELA; empty without it.

        `force` of `number` delaminations, `d_star`, `time` of the first crossing, `margin` of the
        peak, and `band`: forces of one in each of the `interfaces` of unlike plies, and of one.
        """
        return self._groups.get("threshold", {})

    def unit(self, dimension: str) -> str:
        """Unit of a dimension such as ``"force/length"``; empty if the deck names none."""
        return unit_of(dimension, declared_units(self.attributes))

    def attributes_of(self, group: str) -> dict[str, Any]:
        """Attributes of a group; empty without the group."""
        return dict(self._groups.get(group, {}))

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Rows of a dataset; those of a file are not kept in memory."""
        read = getattr(self._arrays, "rows", None)
        if read is None:
            return np.asarray(self._arrays[path.strip("/")][start:stop])
        return np.asarray(read(path, start, stop))

    def __getitem__(self, path: str) -> Array:
        name = path.strip("/")
        if name not in self._arrays:
            raise NotStoredError(not_stored(name, self._arrays))
        return np.asarray(self._arrays[name])

    def __contains__(self, path: str) -> bool:
        return path.strip("/") in self._arrays

    def __iter__(self) -> Iterator[str]:
        """Iterate over the paths of all datasets."""
        return iter(self._arrays)


def model_of(stored: Stored) -> Deck:
    """Model of a result's deck.  Raises ResultFileError if the result holds no readable deck."""
    deck = stored._model or _parsed(stored.deck, stored.mode == "listing")
    if deck is None:
        raise ResultFileError("the result holds no deck that can be read")
    return deck


@functools.lru_cache(maxsize=8)
def _parsed(text: str, blanks_are_zeros: bool) -> Deck | None:
    """Parse a deck's text once, however often it is needed."""
    problems = Reader(text, blanks_are_zeros=blanks_are_zeros).problems()
    return next((problem.deck for problem in problems if problem.deck is not None), None)
