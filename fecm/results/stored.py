"""Stored data of a run: datasets by path, attributes of groups, and the deck.

:class:`~fecm.results.result.Result` adds what can be computed from these data.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar, cast

import numpy as np

from fecm._arrays import read_only
from fecm._errors import ResultFileError
from fecm._typing import Array, Floats
from fecm.deck.model import Deck
from fecm.deck.quantities import in_units
from fecm.deck.reader import Reader
from fecm.deck.units import declared_units, unit_of
from fecm.results.groups import Attributes, NotStoredError, check_name, not_stored
from fecm.results.metrics import FACTOR, METRICS, SHARED, VALIDITY
from fecm.results.schema import KINEMATICS, Kinematics, dataset_of

BLOCK = 4_000_000  # bytes
ONE_RESULT = (
    "a result has datasets by name, as in result['force']; fecm.run_one returns one result, and "
    "fecm.run a list only for a deck with several problems"
)
# Groups whose forces and energies belong to the part. Elsewhere a force is one per length.
OF_PART = ("history", "tape9", "energy", "supports")
MEMBRANE_ENERGIES = tuple(
    f"membrane/{name}" for name in ("energy", "strain_energy", "preload_energy")
)


PARTS = {2: "half", 4: "quarter"}  # names of symmetric parts by their number


def whole_plate(factor: int) -> str:
    """Say what a symmetric part and its numbers are; empty for a whole plate.

    Examples
    --------
    >>> whole_plate(2)
    "half model: forces, energies and masses are those of the whole plate, 2 times the model's"
    """
    if factor == 1:
        return ""
    return (
        f"{PARTS[factor]} model: forces, energies and masses are those of the whole plate, "
        f"{factor} times the model's"
    )


def row_blocks(shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """Yield the first and the last + 1 row of the blocks in which a dataset is read.

    A single number is one row.
    """
    rows = shape[0] if shape else 1
    step = max(1, BLOCK // (8 * max(1, math.prod(shape[1:]))))
    for start in range(0, rows, step):
        yield start, min(start + step, rows)


_Value = TypeVar("_Value")


def computed_once(function: Callable[[Stored], _Value]) -> Callable[[Stored], _Value]:
    """Compute a value of a result when it is first asked for; datasets do not change."""

    @functools.wraps(function)
    def value_of(stored: Stored) -> _Value:
        values = stored._computed
        if function.__qualname__ not in values:
            values[function.__qualname__] = function(stored)
        return cast("_Value", values[function.__qualname__])

    return value_of


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
        self._computed: dict[str, object] = {}  # see `computed_once`
        self.attributes: dict[str, Any] = dict(groups.get("", {}))
        self.deck_text: str = texts.get("deck", "")

    @property
    def deck(self) -> Deck:
        """Deck of the run.

        Raises
        ------
        ResultFileError
            If the result holds no deck that can be read.

        Examples
        --------
        >>> import fecm
        >>> result = fecm.run_one("decks/impact-115.inp")
        >>> slower = fecm.run_one(result.deck.with_(velocity=60.0))
        >>> print(f"{slower.force.max():.2f} lb")
        43.79 lb
        """
        if self._model is not None:
            return self._model
        return deck_in(self.deck_text, blanks_are_zeros=self.mode == "listing")

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
    def symmetry_factor(self) -> int:
        """Number of equal parts of the plate of which the deck has one: 1, 2 or 4.

        Datasets are those of the deck's part. Metrics, threshold and summary are those of the whole
        plate, whose forces and energies are this factor times those of the part.
        """
        factor = self.attributes.get(FACTOR)
        return int(factor) if factor in (2, 4) else 1

    @property
    def notes(self) -> tuple[str, ...]:
        """Reasons to doubt the result."""
        return self._texts("notes")

    def _texts(self, name: str) -> tuple[str, ...]:
        """Return an attribute that is a list of texts, or an empty tuple."""
        texts = self.attributes.get(name)
        return tuple(map(str, texts)) if isinstance(texts, list | tuple) else ()

    @property
    def validity(self) -> str:
        """``"ok"``, or the reasons to doubt the result, in the words of sweeps.

        Empty in files of earlier versions and without impact steps.
        """
        return str(self.attributes.get(VALIDITY, ""))

    @property
    def still_in_contact(self) -> bool:
        """Whether the run ended in contact, so that its final values are not known."""
        return "history/force" in self and bool((self["history/force"][-1:] > 0.0).any())

    @property
    def threshold(self) -> Mapping[str, Any]:
        """Delamination threshold of DELA; empty without it.

        `force` of `number` delaminations, `d_star`, `time` of the first crossing, `margin` of the
        peak, and `band`: the force of one delamination in each of the `interfaces` of unlike plies,
        and of one.
        """
        return self._groups.get("threshold", {})

    @property
    def units(self) -> dict[str, str]:
        """Names of the units of length, force and time; empty if the deck names none."""
        return declared_units(self.attributes)

    def unit(self, name: str) -> str:
        """Return the unit of a dataset or a metric.

        It is empty for a pure number, or if the deck names no units.

        Parameters
        ----------
        name : str
            Name of a dataset, such as ``"tape3/w"`` or ``"force"``, or of :attr:`Result.metrics`,
            such as ``"peak_force"``.

        Raises
        ------
        NotStoredError
            If there is neither; a KeyError.

        Examples
        --------
        >>> import fecm
        >>> result = fecm.run_one(fecm.examples.path("impact-patch"))
        >>> result.unit("velocity"), result.unit("energy_absorbed")
        ('in/s', 'lbf*in')
        """
        if name in METRICS:
            return unit_of(METRICS[name].dimension, self.units)
        dataset = dataset_of(self._stored(name), rank=0)
        return "" if dataset is None else unit_of(dataset.dimension, self.units)

    def whole(self, name: str) -> Array:
        """Return a dataset of the whole plate: forces and energies times the symmetry factor.

        Parameters
        ----------
        name : str
            Path of the dataset; a column of the history also by its name alone.

        Raises
        ------
        NotStoredError
            If it is not stored; a KeyError.
        """
        path = self._stored(name)
        dataset = dataset_of(path, rank=0)
        is_of_part = path.partition("/")[0] in OF_PART or path in MEMBRANE_ENERGIES
        is_shared = is_of_part and dataset is not None and dataset.dimension in SHARED
        if self.symmetry_factor == 1 or not is_shared:
            return self[name]
        return read_only(self.symmetry_factor * self[name])

    def times_of(self, time: object) -> Floats:
        """Return one or several times as numbers; texts with a unit are converted to the deck's.

        Raises UnitsError if a time is not a number or its unit does not fit.
        """
        system = "-".join(self.units.values()) or None
        asked = np.atleast_1d(np.asarray(time, dtype=object)).tolist()
        return np.array([in_units("time", one, "time", system) for one in asked], float)

    def attributes_of(self, group: str) -> dict[str, Any]:
        """Return the attributes of a group; empty without the group."""
        return dict(self._groups.get(group, {}))

    def rows(self, path: str, start: int, stop: int) -> Array:
        """Read rows of a dataset. Rows of a file are not kept in memory."""
        read = getattr(self._arrays, "rows", None)
        if read is None:
            return read_only(self._arrays[path.strip("/")][start:stop])
        return read_only(read(path, start, stop))

    def _path(self, name: str) -> str:
        """Return the path of a dataset, or of a column of the history by its name alone."""
        path = check_name(name, ONE_RESULT).strip("/")
        column = f"history/{path}"
        return column if path not in self._arrays and column in self._arrays else path

    def _stored(self, name: str) -> str:
        """Return the path of a stored dataset.

        Raises NotStoredError if it is not stored.
        """
        path = self._path(name)
        if name in METRICS and path not in self._arrays:
            raise NotStoredError(f"{name} is a metric, not a dataset: write result.{name}")
        if path not in self._arrays:
            raise NotStoredError(not_stored(path, self._arrays))
        return path

    def __getitem__(self, name: str) -> Array:
        """Return a dataset by its path; a column of the history also by its name alone.

        The array is read-only, as changing it would change the result.
        """
        return read_only(self._arrays[self._stored(name)])

    def __contains__(self, name: str) -> bool:
        return self._path(name) in self._arrays

    def __iter__(self) -> Iterator[str]:
        """Iterate over the paths of all datasets."""
        return iter(self._arrays)

    def keys(self) -> list[str]:
        """Return the paths of all datasets."""
        return list(self)


@functools.lru_cache(maxsize=8)
def deck_in(text: str, *, blanks_are_zeros: bool = False) -> Deck:
    """Return the deck in the text of a result, parsed once.

    Raises ResultFileError if it can't be read.
    """
    problems = Reader(text, blanks_are_zeros=blanks_are_zeros).problems()
    deck = next((problem.deck for problem in problems if problem.deck is not None), None)
    if deck is None:
        raise ResultFileError("the result holds no deck that can be read")
    return deck
