"""Colours of the terminal, and how much a command prints: `--color` and `--quiet`."""

from __future__ import annotations

import contextlib
import os
import re
from typing import Any, TextIO

import click

WHENS = ("auto", "always", "never")
OUTPUT_OPTIONS = ("quiet", "color")  # names of :func:`output_options`
KINDS: dict[str, dict[str, Any]] = {
    "error": {"fg": "red", "bold": True},
    "warning": {"fg": "yellow", "bold": True},
    "note": {"fg": "yellow"},
}
# Kind of a message, with its code, after the name of the program or the place in a file.
HEAD = re.compile(rf"^(fecm: |.+?:\d+:\d+: )((?:{'|'.join(KINDS)})(?:\[\w+\])?:)")


class Terminal:
    """Choices of the user for all that the program prints."""

    when = "auto"  # colours are used
    is_quiet = False

    def reset(self) -> None:
        """Return to the defaults."""
        self.when, self.is_quiet = "auto", False

    def uses_color(self, stream: TextIO) -> bool:
        """Return whether lines to a stream have colours.

        Without `--color`, NO_COLOR switches colours off, and FORCE_COLOR on; https://no-color.org.
        """
        if self.when != "auto":
            return self.when == "always"
        if os.environ.get("NO_COLOR"):
            return False
        if os.environ.get("FORCE_COLOR", "0") not in ("", "0"):
            return True
        return stream.isatty() and os.environ.get("TERM") != "dumb"

    def columns(self, stream: TextIO) -> int | None:
        """Return the width of a terminal, or COLUMNS; None if the stream is not a terminal."""
        if not stream.isatty():
            return None
        with contextlib.suppress(OSError, ValueError):
            given = int(os.environ.get("COLUMNS") or 0)
            return given or os.get_terminal_size(stream.fileno()).columns or None
        return None


terminal = Terminal()


def with_colored_head(line: str) -> str:
    """Color the kind of a message, such as ``error:``."""
    if (match := HEAD.match(line)) is None:
        return line
    kind = re.split(r"\W", match[2], maxsplit=1)[0]
    return f"{match[1]}{click.style(match[2], **KINDS[kind])}{line[match.end() :]}"


def _choose(context: click.Context, option: click.Parameter, value: Any) -> None:
    """Remember the value of an option; the value of the command counts before that of `fecm`."""
    if value:
        setattr(terminal, "when" if option.name == "color" else "is_quiet", value)


def add_output_options(command: click.Command) -> click.Command:
    """Add `--color` and `--quiet` to a command, or to each command of a group."""
    if isinstance(command, click.Group):
        for name in command.list_commands(click.Context(command)):
            add_output_options(command.commands[name])
        return command
    command.params += output_options()
    return command


def output_options() -> list[click.Parameter]:
    """Return the options `--color` and `--quiet`."""
    return [
        click.Option(
            ["-q", "--quiet"],
            is_flag=True,
            expose_value=False,
            callback=_choose,
            help="Print no summary, no progress, and only notes that are warnings.",
        ),
        click.Option(
            ["--color"],
            type=click.Choice(WHENS),
            expose_value=False,
            callback=_choose,
            help="Use colours.  [default: on a terminal, unless NO_COLOR is set]",
        ),
    ]
