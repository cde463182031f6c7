"""Help pages: typical calls at their end, whole sentences in the list of a group's commands."""

from __future__ import annotations

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
