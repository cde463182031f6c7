"""Differences of two results, as objects, as text and as values for JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple, TypedDict

from fecm._table import Row, html_summary
from fecm._text import printable, shown_apart

MAX = "max"  # the usual scale of differences, in words
TEXT = "text"  # the type of a dataset of texts


class PositionJson(TypedDict):
    """Position in JSON; its other indices follow under the names of their axes."""

    index: list[int]
    step: int | None
    time: float | None


class DatasetDifferenceJson(TypedDict):
    """Dataset of both results in JSON."""

    name: str
    same: bool
    shape_a: list[int]
    shape_b: list[int]
    dtype_a: str
    dtype_b: str
    largest_difference: float | None
    relative: float | None
    maximum: float | None
    scale: float | None
    tolerance: float | None
    differing: int | None
    at: PositionJson | None
    a: float | str | None
    b: float | str | None
    first: PositionJson | None


class DifferenceJson(TypedDict):
    """Output of `fecm diff --format json`."""

    verdict: Literal["same", "different"]
    a: str
    b: str
    rtol: float
    atol: float
    last_digit: Annotated[
        bool, "Whether numbers of tapes are compared to their last digit, not by rtol and atol."
    ]
    tol: Annotated[dict[str, list[float]], "Own tolerances: a relative, and an absolute one."]
    datasets: list[DatasetDifferenceJson]
    only_in_a: list[str]
    only_in_b: list[str]
    excluded: list[str]
    listed: list[ListedJson]


class ListedJson(TypedDict):
    """Attribute or text that differs, in JSON."""

    name: str
    a: object
    b: object
    line: int | None


@dataclass(frozen=True)
class Position:
    """Position of a number in a dataset.

    Attributes
    ----------
    index : tuple of int
        Its indices, from 0.
    step : int or None
        Its time step; None without a clock.
    time : float or None
        Its time; None without a clock.
    axes : dict
        Its other indices by the names of the axes, such as ``node``, from 1; ``unknown`` by name.
    """

    index: tuple[int, ...]
    step: int | None = None
    time: float | None = None
    axes: dict[str, int | str] = field(default_factory=dict)

    def __str__(self) -> str:
        words: list[str] = []
        if self.time is not None:
            words.append(f"step {self.step} (time {self.time:.6g})")
        words += [f"{name} {value}" for name, value in self.axes.items()]
        if self.step is not None and self.time is None:  # an index of a sweep's histories
            words.append(f"step {self.step}")
        if not words and self.index:
            words.append(f"index {', '.join(map(str, self.index))}")
        return ", ".join(words)

    def to_dict(self) -> PositionJson:
        """Return plain values, for JSON."""
        return {"index": list(self.index), "step": self.step, "time": self.time, **self.axes}  # type: ignore[typeddict-item]


@dataclass
class DatasetDifference:
    """Dataset that both results have, and how it differs.

    Attributes
    ----------
    name : str
        Its name, such as ``history/force``.
    shapes : tuple
        Shapes in A and B.
    types : tuple of str
        Names of its types in A and B; ``text`` for texts.
    maximum : float
        Largest finite absolute value in both.
    scale : float
        Scale of the differences: `maximum`, or what `scale_name` says.
    scale_name : str
        ``"max"``, or the scale of a dataset that may hold nothing but rounding errors.
    tolerance : float
        Largest difference of equal numbers.
    largest_difference : float
        Largest difference; infinite if only one of two numbers is finite.
    at : Position or None
        Place of the largest difference; None if all is equal.
    values : tuple or None
        Numbers, or texts, of A and B at that place.
    differing : int
        Number of differences beyond the tolerance.
    first : Position or None
        First row with a difference; None if the rows are not instants.
    """

    name: str
    shapes: tuple[tuple[int, ...], tuple[int, ...]]
    types: tuple[str, str]
    maximum: float = 0.0
    scale: float = 0.0
    scale_name: str = MAX
    tolerance: float = 0.0
    largest_difference: float = 0.0
    at: Position | None = None
    values: tuple[float, float] | tuple[str, str] | None = None
    differing: int = 0
    first: Position | None = None

    @property
    def holds_texts(self) -> bool:
        """Whether A or B holds texts."""
        return TEXT in self.types

    @property
    def comparable(self) -> bool:
        """Whether the shapes are equal, and both hold numbers or both texts."""
        return len(set(self.shapes)) == 1 and self.types.count(TEXT) != 1

    @property
    def same(self) -> bool:
        """Whether shape, type and all values are equal."""
        return self.comparable and len(set(self.types)) == 1 and not self.differing

    @property
    def relative(self) -> float:
        """Largest difference over the scale."""
        if self.scale:
            return self.largest_difference / self.scale
        return math.inf if self.largest_difference else 0.0

    def __str__(self) -> str:
        """Return unlike shapes and types, the largest difference, and the number of differences."""
        parts: list[str] = []
        if self.shapes[0] != self.shapes[1]:
            text_a, text_b = ("x".join(map(str, shape)) or "single" for shape in self.shapes)
            parts.append(f"shape {text_a} against {text_b}")
        if self.types[0] != self.types[1]:
            parts.append(f"type {self.types[0]} against {self.types[1]}")
        if self.at and self.values:
            parts.append(self._largest_in_words(self.at, self.values))
        if self.differing:
            noun = "text" if self.holds_texts else "number"
            plural = "s differ" if self.differing > 1 else " differs"
            parts.append(f"{self.differing} {noun}{plural}")
        if self.first:
            parts.append(f"first{_at(self.first)}")
        return "; ".join(parts)

    def _largest_in_words(self, position: Position, values: tuple[object, object]) -> str:
        """Format the largest difference and its place."""
        quote = "`" if self.holds_texts else ""
        text_a, text_b = (f"{quote}{value}{quote}" for value in shown_apart(*values))
        text = f"{text_a} against {text_b}{_at(position)}"
        if not math.isfinite(self.largest_difference):
            return text
        share = f"{self.relative:.2g} of {self.scale_name} {self.scale:.6g}"
        return f"largest {self.largest_difference:.3g} ({share}), {text}"

    def to_dict(self) -> DatasetDifferenceJson:
        """Return plain values, for JSON."""
        numbers = self.comparable and not self.holds_texts
        finite = numbers and math.isfinite(self.largest_difference)
        values = self.values or (None, None)
        return {
            "name": self.name,
            "same": self.same,
            "shape_a": list(self.shapes[0]),
            "shape_b": list(self.shapes[1]),
            "dtype_a": self.types[0],
            "dtype_b": self.types[1],
            "largest_difference": self.largest_difference if finite else None,
            "relative": self.relative if finite else None,
            "maximum": self.maximum if numbers else None,
            "scale": self.scale if numbers else None,
            "tolerance": self.tolerance if numbers else None,
            "differing": self.differing if self.comparable else None,
            "at": self.at.to_dict() if self.at else None,
            "a": values[0],
            "b": values[1],
            "first": self.first.to_dict() if self.first else None,
        }


def _at(place: Position) -> str:
    """Format a place, with a leading blank."""
    words = str(place)
    return f" at {words}" if words else ""


class Listed(NamedTuple):
    """Attribute or text that differs. It is listed, not judged.

    Attributes
    ----------
    name : str
        Its name: ``title``, ``energy:initial``, ``tape3/w:unit``, ``deck``.
    a, b : object
        Values in A and B, the first different lines of texts; None without a difference.
    line : int or None
        Number of the first different line of a text.
    """

    name: str
    a: object
    b: object
    line: int | None = None

    def __str__(self) -> str:
        text_a, text_b = (
            "nothing" if value is None else f"`{text}`"
            for value, text in zip((self.a, self.b), shown_apart(self.a, self.b), strict=True)
        )
        line = f" line {self.line}" if self.line else ""
        return f"{printable(self.name)}{line}: {text_a} against {text_b}"


@dataclass(frozen=True, eq=False)
class Difference:
    """Outcome of :func:`fecm.diff`; ``str()`` is what ``fecm diff`` prints.

    Attributes
    ----------
    a, b : str
        Names of the results.
    rtol, atol : float
        General tolerances.
    tol : dict
        Own tolerances of datasets, groups or patterns: ``(rtol,)`` or ``(rtol, atol)``.
    last_digit : bool
        Whether numbers of tapes are compared to their last digit instead.
    datasets : list of DatasetDifference
        Datasets that both results have, by name.
    only_in_a, only_in_b : list of str
        Datasets that only one of them has.
    listed : list of Listed
        Attributes and texts that differ; they are not judged.
    excluded : list of str
        Datasets that were not compared.
    """

    a: str
    b: str
    rtol: float
    atol: float
    tol: dict[str, tuple[float, ...]]
    last_digit: bool
    datasets: list[DatasetDifference]
    only_in_a: list[str]
    only_in_b: list[str]
    listed: list[Listed]
    excluded: list[str]

    @property
    def same(self) -> bool:
        """Whether all datasets are equal."""
        return not self.different

    @property
    def different(self) -> list[str]:
        """Names of the datasets that differ, sorted."""
        unequal = [dataset.name for dataset in self.datasets if not dataset.same]
        return sorted([*unequal, *self.only_in_a, *self.only_in_b])

    @property
    def verdict(self) -> str:
        """The last line: same or different, of how many datasets, at which tolerances."""
        count = len(self.datasets) + len(self.only_in_a) + len(self.only_in_b)
        compared = f"{count} dataset{'s' * (count != 1)}"
        within = f"rtol {self.rtol:g}, atol {self.atol:g}"
        if self.last_digit:
            within = "the last digit of the tapes"
        if self.tol:
            within += f"; own tolerances: {printable(', '.join(self.tol))}"
        if self.excluded:
            within += f"; {len(self.excluded)} excluded"
        if self.same:
            return f"same: {compared} within {within}"
        return f"different: {len(self.different)} of {compared} at {within}"

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        return f"<fecm difference of {self.a} and {self.b}: {self.verdict}>"

    def _repr_html_(self) -> str:
        """Return a table of the datasets that differ and the listed items, for notebooks."""
        rows: list[Row] = [
            (dataset.name, str(dataset)) for dataset in self.datasets if not dataset.same
        ]
        rows += ((name, "only in A") for name in self.only_in_a)
        rows += ((name, "only in B") for name in self.only_in_b)
        rows += (("listed", str(item)) for item in self.listed)
        return html_summary(self, rows)

    def lines(self, *, same: bool = True) -> list[str]:
        """Return one line per dataset, the listed items, and the verdict.

        Parameters
        ----------
        same : bool
            Whether datasets that are equal have a line too.
        """
        rows = {
            dataset.name: ("same" if dataset.same else "different", str(dataset))
            for dataset in self.datasets
            if same or not dataset.same
        }
        rows |= dict.fromkeys(self.only_in_a, ("only in A", ""))
        rows |= dict.fromkeys(self.only_in_b, ("only in B", ""))
        width = max((len(printable(name)) for name in rows), default=0)
        lines = [
            f"{word:10} {printable(name):{width}}  {text}".rstrip()
            for name, (word, text) in sorted(rows.items())
        ]
        return [*lines, *(f"listed     {item}" for item in self.listed), self.verdict]

    def to_dict(self, *, same: bool = True) -> DifferenceJson:
        """Return plain values, as ``fecm diff --format json`` prints them.

        Parameters
        ----------
        same : bool
            Whether datasets that are equal are included.
        """
        return {
            "verdict": "same" if self.same else "different",
            "a": printable(self.a),
            "b": printable(self.b),
            "rtol": self.rtol,
            "atol": self.atol,
            "last_digit": self.last_digit,
            "tol": {pattern: list(values) for pattern, values in self.tol.items()},
            "datasets": [
                dataset.to_dict() for dataset in self.datasets if same or not dataset.same
            ],
            "only_in_a": self.only_in_a,
            "only_in_b": self.only_in_b,
            "excluded": self.excluded,
            "listed": [
                {"name": item.name, "a": item.a, "b": item.b, "line": item.line}
                for item in self.listed
            ],
        }
