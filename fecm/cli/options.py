"""Types of options, options of several commands, and the layout of help pages."""

from __future__ import annotations

import functools
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import click

from fecm._errors import did_you_mean
from fecm._inputs import InputError, parsed_file
from fecm._options import Option, declared_options
from fecm.cli.common import DASH
from fecm.cli.terminal import OUTPUT_OPTIONS
from fecm.deck.units import NAMES, system_named
from fecm.listing.slips import MODES, REPORT

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


Decorated = Callable[..., None]


def stack_options(*options: Callable[[Decorated], Decorated]) -> Callable[[Decorated], Decorated]:
    """Add several options to a command, in this order on its help page."""

    def decorate(function: Decorated) -> Decorated:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


def collected(kind: type, name: str = "options") -> Callable[[Decorated], Decorated]:
    """Pass options of a command to its function as an instance of a dataclass.

    The fields of the dataclass have the names of the options and arguments. The object is the
    parameter `name`. Values that are not fields stay parameters.
    """
    names = [field.name for field in fields(kind)]

    def decorate(function: Decorated) -> Decorated:
        @functools.wraps(function)
        def command(**values: Any) -> None:
            values[name] = kind(**{key: values.pop(key) for key in names})
            function(**values)

        return command

    return decorate


def job_options(job: Any, **settings: Mapping[str, Any]) -> Callable[[Decorated], Decorated]:
    """Add the options of a job (see :mod:`fecm._options`) as one mapping, the parameter `options`.

    `settings` of click, such as the type, complete or replace those of some options.
    """
    declared = {n: field for n, field in declared_options(job).items() if field[0].group}

    def decorate(function: Decorated) -> Decorated:
        @functools.wraps(function)
        def command(**values: Any) -> None:
            options = {name: values.pop(name) for name in declared}
            function(options=options, **values)

        flags = {name: _flag(name, about) for name, (about, _) in declared.items()}
        for name, (about, default) in reversed(declared.items()):
            option = _click_option(name, about, default, settings.get(name, {}), flags)
            command = option(command)
        return command

    return decorate


def _flag(name: str, about: Option) -> str:
    """Return the flag of an option of a job."""
    return about.flag or f"--{name.replace('_', '-')}"


def _click_option(
    name: str,
    about: Option,
    default: Any,
    settings: Mapping[str, Any],
    flags: Mapping[str, str],
) -> Any:
    """Return the option of click for an option of a job.

    In its help, names of options in backquotes become their flags.
    """
    names = [flags[name], "--output"] if flags[name] == "-o" else [flags[name]]
    text = f"{about.help}  [default: {about.default_text}]" if about.default_text else about.help
    text = re.sub(r"`(\w+)`", lambda match: flags.get(match[1], match[0]), text)
    attributes: dict[str, Any] = {"help": text, "metavar": about.metavar}
    if default is False:
        attributes["is_flag"] = True
    elif default == ():
        attributes["multiple"] = True
    elif default is not None:
        attributes |= {"default": default, "show_default": "default" not in settings}
    if about.choices:
        is_long = len(about.choices) > MOST_CHOICES
        attributes["type"] = OneOf(about.choices) if is_long else click.Choice(about.choices)
    attributes |= settings
    if attributes.get("multiple"):
        attributes["help"] += "  May be repeated."
    return click.option(*names, name, **attributes)


def groups_of(
    job: Any,
    own_groups: Mapping[str, Sequence[str]],
    first: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> dict[str, list[str]]:
    """Return the options of a job by headings of the help page.

    In each group the command's own options follow those of the job; those of `first` come before.
    """
    groups: dict[str, list[str]] = {title: [*first.get(title, ())] for title in own_groups}
    for name, (about, _) in declared_options(job).items():
        if about.group:
            groups[about.group].append(name)
    return {title: [*names, *own_groups[title]] for title, names in groups.items()}


class NamedFile(click.Path):
    """Path of a file or folder; standard streams are refused."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse -, and convert any other path."""
        if os.fspath(value) == os.fspath(DASH):
            self.fail("- is a standard stream, and this needs a file; give its name", param, ctx)
        return super().convert(value, param, ctx)


DECK_PATH = NamedFile(exists=True, dir_okay=False, path_type=Path)
NAMED_PATH = NamedFile(path_type=Path)
FILE_PATH = click.Path(path_type=Path, allow_dash=True)  # - is standard input or output


MOST_CHOICES = 8  # that a help page lists in the place of the value
WITH_UNIT = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)([eE][+-]?\d+)?\s*[a-zA-Zµμ/]*[a-zA-Zµμ]")


GRAMS = ("g", "lb", "lbs")  # ends of units of mass, kg too


class Finite(click.FloatRange):
    """Finite float in a range."""

    name = "number"

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Parse a number."""
        if isinstance(value, str) and WITH_UNIT.fullmatch(value.strip()):  # 5.5kg
            message = f"{value!r} has a unit; give the number alone, in the deck's units"
            if value.strip().endswith(GRAMS):
                message += " (mm, N and s have the mass in t, 1 kg = 1e-3 t)"
            self.fail(message, param, ctx)
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number

    def _describe_range(self) -> str:
        """Format a range for help pages; empty without bounds."""
        return "" if self.min is None and self.max is None else super()._describe_range()


POSITIVE = Finite(min=0.0, min_open=True)
NOT_NEGATIVE = Finite(min=0.0)


class Parsed(click.ParamType):  # type: ignore[type-arg]
    """Result of a parser of the text. Its ValueError is the message of the option.

    The form, as in ``X,Y``, is for help pages. The values are for the shell's completion of the
    whole text, or of the part after the last comma of a list. A value ``NAME=`` is followed by one
    of the `forms`, of which there are two or more.
    """

    name = "text"

    def __init__(
        self,
        function: Callable[[Any], Any],
        form: str,
        values: Iterable[str] = (),
        forms: Sequence[str] = (),
    ) -> None:
        self._function, self._form, self._values, self._forms = function, form, values, forms

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Return the form of the value."""
        return self._form

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Parse the text."""
        try:
            return self._function(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete a value."""
        from click.shell_completion import CompletionItem  # only for a shell

        done, comma, begun = incomplete.rpartition(",")
        if "=" in done:
            return []
        texts = [f"{done}{comma}{value}" for value in self._values if value.startswith(begun)]
        if len(texts) == 1 and texts[0].endswith("="):
            # After a single proposal the shell adds a blank; after two, only what they share.
            texts = [f"{texts[0]}{form}" for form in self._forms]
        return [CompletionItem(text) for text in texts]


class OneOf(click.Choice):  # type: ignore[type-arg]
    """One of many names. The message about another name suggests a similar one."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Look up the name."""
        if hint := value not in self.choices and did_you_mean(value, map(str, self.choices)):
            self.fail(f"there is no {value!r}{hint}", param, ctx)
        return super().convert(value, param, ctx)


class Member(click.Choice):  # type: ignore[type-arg]
    """Member of an enumeration of texts, given by its value."""

    def __init__(self, members: Sequence[StrEnum]) -> None:
        super().__init__([member.value for member in members])
        self._members = members

    def convert(self, value: Any, param: Any, ctx: Any) -> StrEnum:
        """Look up the value."""
        return self._members[self.choices.index(super().convert(value, param, ctx))]


def list_of(form: str, item: Any, counts: Sequence[int] = (), separator: str = ",") -> Parsed:
    """Return the type of a non-empty tuple of values, with one of the `counts` if given.

    The separator is a regular expression.
    """

    def read(text: Any) -> tuple[Any, ...]:
        if isinstance(text, tuple):
            return text
        parts = [part.strip() for part in re.split(separator, text)]
        if not all(parts) or (counts and len(parts) not in counts):
            raise ValueError(f"{text!r} is not of the form {form}.")
        try:
            return tuple(map(item, parts))
        except click.BadParameter as error:
            raise ValueError(f"{text!r} is not of the form {form}: {error.message}") from None

    return Parsed(read, form, getattr(item, "choices", ()))


def file_of(parse: Callable[[str], Any]) -> Parsed:
    """Return the type of a file's path whose value is the parsed text of the file."""

    def read(path: str) -> Any:
        try:
            return parsed_file(Path(path), parse)
        except InputError as error:
            raise ValueError(str(error)) from None
        except OSError as error:
            raise ValueError(f"{path} can't be read: {error.strerror}") from None

    return Parsed(read, "FILE.toml")


SYSTEM = Parsed(system_named, "SYSTEM", NAMES)


def assignment(text: str) -> tuple[str, str]:
    """Parse a name and a value with an equals sign between them."""
    name, _, value = (part.strip() for part in text.partition("="))
    if not name or not value:
        raise ValueError(f"{text!r} is not of the form NAME=VALUE")
    return name, value


class Format(StrEnum):
    """Output format of a command."""

    TEXT = "text"
    JSON = "json"
    SARIF = "sarif"
    CSV = "csv"


MODE_OPTION = click.option(
    "--mode",
    type=click.Choice(MODES),
    default=REPORT,
    show_default=True,
    help="Follow the report's text, or its printed program slip by slip.",
)


def format_option(*formats: Format, about: str) -> Callable[[Decorated], Decorated]:
    """Return the option ``--format``, whose value is the parameter `form`."""
    return click.option(
        "--format",
        "form",
        type=Member(formats),
        default=Format.TEXT.value,
        show_default=True,
        help=about,
    )


FORMAT_OPTION = format_option(
    Format.TEXT, Format.JSON, about="Text for people, or JSON for programs."
)


# Of measured forces.
COLUMNS_OPTION = click.option(
    "--columns",
    type=list_of("TIME,FORCE", click.STRING, [2]),
    help="Names or numbers (from 1) of the columns of the measurement; a minus before one "
    "changes its sign.  [default: time; force, load or another usual name]",
)
UNITS_OPTION = click.option(
    "--units",
    type=list_of("TIME,FORCE", click.STRING, [2]),
    help="Units of a measurement that names none, such as ms,kN.  [default: the deck's]",
)


def typical(*calls: str) -> str:
    """Return the end of a help page: typical calls, most of them with the example files."""
    return "\n".join(["\b", "Typical calls:", *(f"  {call}" for call in calls)])


class HelpGroup(click.Group):
    """Group that lists the whole first sentence of each of its commands."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands."""
        rows = [
            (name, command.get_short_help_str(limit=1000))
            for name, command in self.commands.items()
        ]
        with formatter.section("Commands"):
            formatter.write_dl(sorted(rows))


class GroupedCommand(click.Command):
    """Command whose help page has its options in groups.

    Groups are titles with the names of parameters, in the order of the page. Options without a
    group come last.
    """

    def __init__(
        self, *arguments: Any, groups: Mapping[str, Sequence[str]], **settings: Any
    ) -> None:
        super().__init__(*arguments, **settings)
        self._groups = groups

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section for each group."""
        options = [param for param in self.get_params(ctx) if isinstance(param, click.Option)]
        shown = {option.name: option.get_help_record(ctx) for option in options}
        sections = {
            title: [shown.pop(name) for name in names]
            for title, names in {**self._groups, "Terminal": OUTPUT_OPTIONS}.items()
        }
        others = [*sections.pop("Other options", ()), *shown.values()]
        sections["Other options"] = others  # the last section
        for title, records in sections.items():
            with formatter.section(title):
                formatter.write_dl([record for record in records if record is not None])
