"""A group of a result: its datasets as attributes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from fecm._tables import html_table
from fecm._typing import Array
from fecm.results.errors import NotStoredError
from fecm.results.missing import not_stored

Attributes = Mapping[str, Any]  # of a group: what HDF5 may hold


class Group:
    """The datasets of one group as attributes: ``result.tape3.w``."""

    def __init__(
        self, name: str, arrays: Mapping[str, Array], attributes: Mapping[str, Attributes]
    ) -> None:
        self._name = name
        self._arrays = arrays
        self._attributes = attributes

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the group."""
        return dict(self._attributes.get(self._name, {}))

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            path = f"{self._name}/{name}"
            if not name.startswith("_"):
                if path in self._arrays:
                    return self._arrays[path]
                if any(other.startswith(f"{path}/") for other in self._arrays):
                    return Group(path, self._arrays, self._attributes)
            raise NotStoredError(not_stored(path, self._arrays))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *{name.partition("/")[0] for name in self._shapes()}]

    def _shapes(self) -> dict[str, str]:
        """Shapes of the datasets by their names."""
        head = f"{self._name}/"
        own = [path for path in self._arrays if path.startswith(head)]
        return {path.removeprefix(head): str(self._arrays[path].shape) for path in own}

    def __repr__(self) -> str:
        shapes = ", ".join(f"{name} {shape}" for name, shape in self._shapes().items())
        return f"<{self._name}: {shapes}>"

    def _repr_html_(self) -> str:
        """Table of the datasets, for notebooks."""
        return html_table(self._name, self._shapes().items())
