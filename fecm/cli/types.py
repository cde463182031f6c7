"""Numbers among the options of commands: their bounds, and several in one option."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import click

from fecm.cli.common import RefusedError


class Finite(click.FloatRange):
    """A float in a range; never infinite, never NaN."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Read a number."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number


POSITIVE = Finite(min=0.0, min_open=True)


def finite(name: str, text: str, low: float = -math.inf, *, above: bool = False) -> float:
    """Read a finite number of at least `low`, or above it.

    Parameters
    ----------
    name : str
        The option's name, for the message.
    text : str
    low : float
    above : bool
        Whether `low` itself is refused.

    Raises
    ------
    RefusedError
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isfinite(value) and (value > low if above else value >= low):
        return value
    bound = "" if low == -math.inf else f" {'above' if above else 'of at least'} {low:g}"
    raise RefusedError(f"{name} takes a number{bound}, not `{text}`")


def number(low: float = -math.inf, *, above: bool = False) -> Callable[..., Any]:
    """A callback of an option that reads its number, or of a repeated option all its numbers.

    Parameters
    ----------
    low, above
        As :func:`finite` takes them.
    """

    def callback(context: click.Context, parameter: click.Parameter, value: Any) -> Any:
        name = parameter.opts[0]
        if isinstance(value, tuple):
            parts = [part for text in value for part in text.split(",")]
            return tuple(dict.fromkeys(finite(name, part, low, above=above) for part in parts))
        return None if value is None else finite(name, value, low, above=above)

    return callback


class ListCommand(click.Command):
    """A command whose repeated options also take several values: ``--time 2e-6 4e-6``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the options before click reads them."""
        options = [param for param in self.params if isinstance(param, click.Option)]
        names = {name for option in options if option.multiple for name in option.opts}
        return super().parse_args(ctx, _spread(args, names))


def _spread(args: Sequence[str], names: set[str]) -> list[str]:
    """Arguments with an option before every number that follows one of the named options."""
    spread: list[str] = []
    option, waits = "", False
    for place, argument in enumerate(args):
        if argument == "--":
            return [*spread, *args[place:]]
        if option and not waits and _is_number(argument):
            spread += [option, argument]
        elif waits:
            spread.append(argument)
            waits = False
        else:
            name = argument.partition("=")[0]
            option, waits = (name, argument == name) if name in names else ("", False)
            spread.append(argument)
    return spread


def _is_number(text: str) -> bool:
    """Whether a text is a number, or several with commas between them."""
    try:
        list(map(float, text.split(",")))
    except ValueError:
        return False
    return True
