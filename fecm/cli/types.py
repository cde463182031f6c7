"""Numbers and lists among the options of commands."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

Decorated = Callable[..., None]


def stacked(*options: Callable[[Decorated], Decorated]) -> Callable[[Decorated], Decorated]:
    """Add several options to a command, in this order on its help page."""

    def decorate(function: Decorated) -> Decorated:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


class Finite(click.FloatRange):
    """A float in a range; never infinite, never NaN."""

    name = "number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Read a number."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number

    def _describe_range(self) -> str:
        """Range on help pages; empty without bounds."""
        return "" if self.min is None and self.max is None else super()._describe_range()


POSITIVE = Finite(min=0.0, min_open=True)
NOT_NEGATIVE = Finite(min=0.0)


class ListOf(click.ParamType):  # type: ignore[type-arg]
    """A tuple of values of a type, in any number but 0 or in one of the admissible `counts`.

    The form, as in ``X,Y``, is for messages; the separator is a regular expression.
    """

    name = "list"

    def __init__(
        self, form: str, item: Any, counts: Sequence[int] = (), separator: str = ","
    ) -> None:
        self._form = form
        self._item = item
        self._counts = counts
        self._separator = separator

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Any, ...]:
        """Read the values."""
        if isinstance(value, tuple):
            return value
        parts = [part.strip() for part in re.split(self._separator, value)]
        if not all(parts) or (self._counts and len(parts) not in self._counts):
            self.fail(f"{value!r} is not of the form {self._form}.", param, ctx)
        try:
            return tuple(self._item(part, param, ctx) for part in parts)
        except click.BadParameter as error:
            self.fail(f"{value!r} is not of the form {self._form}: {error.message}", param, ctx)


class Parsed(click.ParamType):  # type: ignore[type-arg]
    """Result of a function of the text, whose ValueError is the message of the option."""

    name = "text"

    def __init__(self, function: Callable[[str], Any]) -> None:
        self._function = function

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read the text."""
        try:
            return self._function(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)


MOST = 1_000_000  # bytes of a file whose contents are the value of an option


def file_of(parse: Callable[[str], Any]) -> Parsed:
    """Type of a file's path whose value is what a function makes of the text in the file."""

    def read(path: str) -> Any:
        try:
            with Path(path).open("rb") as file:
                return parse(file.read(MOST).decode("utf-8-sig"))
        except OSError as error:
            raise ValueError(f"{path} can't be read: {error.strerror}") from None
        except (ValueError, RecursionError) as error:
            raise ValueError(f"{path}: {error}") from None

    return Parsed(read)


def assignment(text: str) -> tuple[str, str]:
    """Read a name and a value with an equals sign between them."""
    name, _, value = (part.strip() for part in text.partition("="))
    if not name or not value:
        raise ValueError(f"{text!r} is not of the form NAME=VALUE")
    return name, value
