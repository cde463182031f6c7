"""Help pages: options in groups, typical calls at their end, whole sentences about subcommands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import click


def typical(*calls: str) -> str:
    """End of a help page: typical calls of a command, most of them with the example files."""
    return "\n".join(["\b", "Typical calls:", *(f"  {call}" for call in calls)])


class Group(click.Group):
    """A group that lists the whole first sentence of each of its commands."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands."""
        rows = [(name, one.get_short_help_str(limit=1000)) for name, one in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl(sorted(rows))


class GroupedCommand(click.Command):
    """A command whose help page has its options in groups.

    Groups are titles with the names of parameters, in the order of the page; what is in no group
    comes last.
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
            title: [shown.pop(name) for name in names] for title, names in self._groups.items()
        }
        sections["Other options"] = list(shown.values())
        for title, records in sections.items():
            with formatter.section(title):
                formatter.write_dl([record for record in records if record is not None])
