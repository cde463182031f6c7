"""``fecm example``."""

from __future__ import annotations

from pathlib import Path

import click

from fecm import examples
from fecm._files import check_outputs
from fecm.cli.common import DASH, echo, echo_path, write_text
from fecm.cli.options import FILE_PATH, Parsed, typical


@click.command(
    "example",
    short_help="List the example decks and tables, or write one.",
    epilog=typical(
        "fecm example",
        "fecm example impact-patch.inp",
    ),
)
@click.argument("name", type=Parsed(str, "NAME", examples.CONTENTS), required=False)
@click.option(
    "-o",
    "--output",
    type=FILE_PATH,
    metavar="FILE",
    help="File to write; - is standard output.  [default: NAME]",
)
@click.option("--overwrite", is_flag=True, help="Replace an existing FILE.")
def example_command(name: str | None, output: Path | None, overwrite: bool) -> None:
    """List the example decks and tables, or write the one with NAME."""
    if name is None:
        if output or overwrite:
            raise click.UsageError("give the NAME of an example")
        for example, content in examples.CONTENTS.items():
            echo(f"{example:<22}{content}")
        return
    try:
        source = examples.path(name)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    target = output or Path(source.name)
    if target != DASH:
        check_outputs([target], overwrite, [source])
    write_text(target, source.read_text(encoding="utf-8"), overwrite=overwrite)
    if target != DASH:
        echo_path(target)
