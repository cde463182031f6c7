"""Options of jobs, declared once: fields of a dataclass, for Python and for a command.

A field made by :func:`option` has its help text. The command line derives its options from the
fields, and :func:`documented` adds them to the docstring of the class.
"""

from __future__ import annotations

import functools
import inspect
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import MISSING, field, fields
from typing import Any, NamedTuple, ParamSpec, TypeVar

P = ParamSpec("P")
J = TypeVar("J")
R = TypeVar("R")
T = TypeVar("T")

PLACE = "{parameters}"  # of the parameters in a docstring
# Parameters in the docstring of a job, and one of them.
SECTION = re.compile(r"Parameters\n +-+\n +(.*?)(?=\n\n|\s*\Z)", re.S)
ENTRY = r"^ *{}\b[^\n]* : .*\n(?:        .*\n?)+"
WIDTH = 92


class Option(NamedTuple):
    """Help and constraints of an option; the field has its name, type and default."""

    help: str  # for Python and for the help page of the command
    python: str  # what only Python offers
    form: str  # of the value in Python, where the help has the form of the command line
    default_text: str  # the default in words, if it is not the default of the field
    group: str  # heading on that page; empty if only Python has the option
    choices: Sequence[str]
    metavar: str | None
    flag: str | None  # on the command line, if it is not --NAME
    least: float | None  # smallest value


def option(
    default: Any,
    help: str,
    *,
    python: str = "",
    form: str = "",
    default_text: str = "",
    group: str = "",
    choices: Sequence[str] = (),
    metavar: str | None = None,
    flag: str | None = None,
    least: float | None = None,
) -> Any:
    """Return the field of an option; see :class:`Option`."""
    about = Option(help, python, form, default_text, group, choices, metavar, flag, least)
    return field(default=default, metadata={"option": about})


def declared_options(job: Any) -> dict[str, tuple[Option, Any]]:
    """Return the options of a job by name, in the order of its signature, with their defaults."""
    return {
        field.name: (field.metadata["option"], field.default)
        for field in sorted(fields(job), key=lambda field: field.kw_only is True)
        if "option" in field.metadata
    }


def documented(job: type[T]) -> type[T]:
    """Add the parameters of a job to its docstring."""
    if job.__doc__:  # Python without docstrings has none
        job.__doc__ = job.__doc__.replace(PLACE, _parameters(job))
    return job


def _parameters(job: Any) -> str:
    lines = []
    types = {field.name: field.type for field in fields(job)}
    for name, (about, value) in declared_options(job).items():
        default = f"By default {about.default_text}." if about.default_text else ""
        words = f"{about.form} {about.help} {default} {about.python}".split()
        text = textwrap.fill(" ".join(words), WIDTH - 8)
        of_type = ", optional" if value is None else f", default {value!r}"
        if value is MISSING:
            of_type = ""
        lines += [f"{name} : {types[name]}{of_type}", textwrap.indent(text, "    ")]
    return textwrap.indent("\n".join(lines), "    ").strip()


def described_by(job: Any) -> Callable[[T], T]:
    """Take the texts of parameters in the docstring of a function from its job.

    ``{parameters}`` is the place of all parameters, ``{name}`` that of a single one.
    """

    def text_of(place: re.Match[str]) -> str:
        section = SECTION.search(job.__doc__)
        assert section is not None
        if place[0] == PLACE:
            return textwrap.dedent(f"    {section[1].strip()}")
        entry = re.search(ENTRY.format(place[1]), section[1], re.M)
        assert entry is not None, place[1]
        return textwrap.dedent(f"    {entry[0].strip()}")

    def decorate(function: T) -> T:
        if function.__doc__ and job.__doc__:  # Python without docstrings has none
            unindented = inspect.cleandoc(function.__doc__)  # whatever class the function is in
            function.__doc__ = re.sub(r"\{(\w+)\}", text_of, unindented)
        return function

    return decorate


def with_parameters_of(job: Callable[P, J]) -> Callable[[Callable[[J], R]], Callable[P, R]]:
    """Give a function the signature and the documented parameters of a job."""

    def decorate(function: Callable[[J], R]) -> Callable[P, R]:
        @functools.wraps(function)
        def called(*arguments: P.args, **named: P.kwargs) -> R:
            return function(job(*arguments, **named))

        returns = inspect.signature(function).return_annotation
        signature = inspect.signature(job).replace(return_annotation=returns)
        called.__signature__ = signature  # type: ignore[attr-defined]
        types = {name: parameter.annotation for name, parameter in signature.parameters.items()}
        called.__annotations__ = types | {"return": returns}
        return described_by(job)(called)

    return decorate
