"""A group of a result: its datasets as attributes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Protocol

from fecm._tables import html_table
from fecm._typing import Array
from fecm.results.errors import NotStoredError
from fecm.results.missing import not_stored

Attributes = Mapping[str, Any]  # of a group: what HDF5 may hold


class Source(Protocol):
    """The result that a group belongs to."""

    @property
    def units(self) -> dict[str, str]:
        """Names of the units."""

    def unit(self, name: str) -> str:
        """Unit of a dataset."""

    def attributes_of(self, group: str) -> dict[str, Any]:
        """Attributes of a group."""

    def __iter__(self) -> Iterator[str]:
        """Paths of all datasets."""

    def __contains__(self, name: str) -> bool:
        """Whether there is a dataset of this path."""

    def __getitem__(self, name: str) -> Array:
        """A dataset by its path."""


class Group:
    """The datasets of one group: ``result.tape3.w`` is ``result.tape3["w"]``.

    Parameters
    ----------
    name : str
        Path of the group.
    source : Source
        The result.
    """

    def __init__(self, name: str, source: Source) -> None:
        self._name = name
        self._source = source

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the group."""
        return self._source.attributes_of(self._name)

    @property
    def units(self) -> dict[str, str]:
        """Names of the units of length, force and time; empty if the deck names none."""
        return self._source.units

    def unit(self, name: str) -> str:
        """Unit of a dataset; empty for a pure number, or if the deck names no units.

        Raises
        ------
        NotStoredError
            If there is no such dataset; a KeyError.
        """
        return self._source.unit(f"{self._name}/{name}")

    def __getitem__(self, name: str) -> Array:
        """A dataset by its name in the group."""
        return self._source[f"{self._name}/{name}"]

    def __contains__(self, name: str) -> bool:
        return f"{self._name}/{name}" in self._source

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the datasets in the group, and in groups inside it."""
        return iter(self.keys())

    def keys(self) -> list[str]:
        """Names of the datasets in the group, and in groups inside it."""
        head = f"{self._name}/"
        return [p.removeprefix(head) for p in self._source if p.startswith(head)]

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            if name.startswith("_"):
                raise AttributeError(name)
            if name in self:
                return self[name]
            if any(other.startswith(f"{name}/") for other in self):
                return Group(f"{self._name}/{name}", self._source)
            raise NotStoredError(not_stored(f"{self._name}/{name}", list(self._source)))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *{name.partition("/")[0] for name in self}]

    def _shapes(self) -> dict[str, str]:
        """Shapes of the datasets by their names."""
        return {name: str(self[name].shape) for name in self}

    def __repr__(self) -> str:
        shapes = ", ".join(f"{name} {shape}" for name, shape in self._shapes().items())
        return f"<{self._name}: {shapes}>"

    def _repr_html_(self) -> str:
        """Table of the datasets, for notebooks."""
        return html_table(self._name, self._shapes().items())
