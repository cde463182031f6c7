"""Groups of a result, their datasets as attributes, and errors about missing datasets."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from fecm._errors import FecmError, ResultFileError
from fecm._table import Table, html_table
from fecm._typing import Array


class NotStoredError(AttributeError, KeyError, ResultFileError):
    """A result lacks a requested dataset."""

    def __str__(self) -> str:
        return str(self.args[0])


class ResultWriteError(FecmError, OSError):
    """A result can't be written."""


class ExportError(FecmError, ValueError):
    """A result lacks the data for an export, or the request is invalid."""


class GroupInfo(NamedTuple):
    """What is known of a group before any run."""

    kind: type[ResultGroup]
    description: str
    macro: str  # that stores it; empty if every run does, or a segment asks for it
    by_pass: bool  # whether the rows are those that the macro counts, and nothing else adds rows


# Groups of a run by name. The classes of schema.py enter themselves.
GROUPS: dict[str, GroupInfo] = {}


def stored_by(group: str) -> str:
    """Return the macro that stores a group; empty if no macro does."""
    return GROUPS[group].macro if group in GROUPS else ""


def check_name(name: object, explanation: str) -> str:
    """Return the name of a dataset or column; raise TypeError with an explanation if it is no text.

    Examples
    --------
    >>> check_name(0, "a result has datasets by name")
    Traceback (most recent call last):
    TypeError: [0]: a result has datasets by name
    """
    if not isinstance(name, str):
        raise TypeError(f"[{name!r}]: {explanation}")
    return name


def not_stored(asked: str, paths: Collection[str], others: Iterable[str] = ()) -> str:
    """Return the message about a missing dataset: similar names, or the macro that stores it.

    `others` are names that are not datasets, such as metrics.
    """
    if members := sorted(path for path in paths if path.startswith(f"{asked}/")):
        return f"{asked} is a group, not a dataset; its datasets are {', '.join(members)}"
    group = asked.partition("/")[0]
    group_exists = any(path.startswith(f"{group}/") for path in paths)
    alike = suggestion(asked, paths, others)
    more = alike if group_exists else remedy(asked) or alike
    return f"there is no {asked} in this result{more}"


def suggestion(asked: str, paths: Iterable[str], others: Iterable[str] = ()) -> str:
    """Return the end of a message about a missing name: similar names, or the groups."""
    import difflib  # 1 ms, only after a mistake

    of_paths = {name for path in paths for name in (path, path.rpartition("/")[0])} - {""}
    known_names = sorted({*of_paths, *others})
    last_parts = [name.rpartition("/")[2] for name in known_names]
    close = difflib.get_close_matches(asked, last_parts, n=3) if "/" not in asked else []
    words = set(asked.split("_"))
    with_words = [last for last in last_parts if words <= set(last.split("_"))]
    # The most similar name comes first.
    alike = [
        name
        for part in dict.fromkeys([asked, *(close or with_words)])
        for name, last in zip(known_names, last_parts, strict=True)
        if last == part
    ]
    if alike := alike or difflib.get_close_matches(asked, known_names, n=3):
        return f"; did you mean {' or '.join(alike)}?"
    groups = sorted({name.partition("/")[0] for name in of_paths})
    return f"; there are {', '.join(groups)}" if groups else ""


def remedy(path: str) -> str:
    """Return the end of a message about a missing dataset: the macro that stores it, if any."""
    macro = stored_by(path.partition("/")[0])
    return f"; add {macro} to the deck's program and run it again" if macro else ""


Attributes = Mapping[str, Any]  # of a group: what HDF5 may hold


class GroupSource(Protocol):
    """Result that a group belongs to."""

    @property
    def units(self) -> dict[str, str]:
        """Names of the units."""

    def unit(self, name: str) -> str:
        """Return the unit of a dataset."""

    def attributes_of(self, group: str) -> dict[str, Any]:
        """Return the attributes of a group."""

    def __iter__(self) -> Iterator[str]:
        """Iterate over the paths of all datasets."""

    def __contains__(self, name: str) -> bool:
        """Return whether there is a dataset of this path."""

    def __getitem__(self, name: str) -> Array:
        """Return a dataset by its path."""


class ResultGroup:
    """Datasets of one group: ``result.tape3.w`` is ``result.tape3["w"]``.

    Parameters
    ----------
    name : str
        Path of the group.
    source : Source
        The result.
    """

    def __init_subclass__(
        cls, *, group: str = "", about: str = "", macro: str = "", by_pass: bool = False
    ) -> None:
        """Enter the class in :data:`GROUPS` under the name of its group, if it has one."""
        super().__init_subclass__()
        if group:
            GROUPS[group] = GroupInfo(cls, about, macro, by_pass)

    def __init__(self, name: str, source: GroupSource) -> None:
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
        """Return the unit of a dataset; empty for a pure number, or if the deck names no units.

        Raises
        ------
        NotStoredError
            If there is no such dataset; a KeyError.
        """
        return self._source.unit(f"{self._name}/{name}")

    def __getitem__(self, name: str) -> Array:
        """Return a dataset by its name in the group."""
        return self._source[f"{self._name}/{name}"]

    def __contains__(self, name: str) -> bool:
        return f"{self._name}/{name}" in self._source

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the datasets in the group, and in groups inside it."""
        return iter(self.keys())

    def keys(self) -> list[str]:
        """Return the names of the datasets in the group, and in groups inside it."""
        head = f"{self._name}/"
        return [p.removeprefix(head) for p in self._source if p.startswith(head)]

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            if name.startswith("_"):
                raise AttributeError(name)
            if name in self:
                return self[name]
            if any(other.startswith(f"{name}/") for other in self):
                return ResultGroup(f"{self._name}/{name}", self._source)
            raise NotStoredError(not_stored(f"{self._name}/{name}", list(self._source)))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *{name.partition("/")[0] for name in self}]

    def _shapes(self) -> dict[str, str]:
        """Return the shapes of the datasets by name."""
        return {name: str(self[name].shape) for name in self}

    def __repr__(self) -> str:
        shapes = ", ".join(f"{name} {shape}" for name, shape in self._shapes().items())
        return f"<{self._name}: {shapes}>"

    def _repr_html_(self) -> str:
        """Return a table of the datasets, for notebooks."""
        return html_table(Table(tuple(self._shapes().items()), title=self._name))
