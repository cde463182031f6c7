"""``fecm help`` and ``fecm completion``."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from fecm.cli.options import typical

SHELLS = ("bash", "zsh", "fish")


@click.command("help", epilog=typical("fecm help", "fecm help run", "fecm help indent fit"))
@click.argument("names", nargs=-1, metavar="[COMMAND]...")
@click.pass_context
def help_command(context: click.Context, names: tuple[str, ...]) -> None:
    """Show the help page of a command."""
    page = context.find_root()
    for name in names:
        group = page.command
        if not isinstance(group, click.Group):
            raise click.UsageError(f"{page.command_path} has no command {name!r}", context)
        _, command, _ = group.resolve_command(page, [name])
        if command is not None:
            page = click.Context(command, page, name, **command.context_settings)
    click.echo(page.get_help())


@click.command(
    "completion",
    epilog=typical("fecm completion bash", "fecm completion fish"),
)
@click.argument("shell", type=click.Choice(SHELLS))
@click.pass_context
def completion_command(context: click.Context, shell: str) -> None:
    """Print the script that completes commands, options and values in a shell.

    Bash and zsh: eval "$(fecm completion bash)" in ~/.bashrc, or zsh in ~/.zshrc.
    """
    if (kind := get_completion_class(shell)) is not None:
        completion = kind(context.find_root().command, {}, "fecm", "_FECM_COMPLETE")
        click.echo(completion.source(), nl=False)
