"""Commands about results: ``fecm tapes``."""

from __future__ import annotations

from pathlib import Path

import click

from fecm.cli.apart import reads
from fecm.cli.common import DECK_PATH, FILE_PATH


@click.command()
@click.argument("result", type=DECK_PATH)
@click.option("-d", "--directory", type=FILE_PATH, default=Path(), metavar="DIR",
              help="Folder for the tapes.  [default: this folder]")  # fmt: skip
@reads("result")
def tapes(result: Path, directory: Path) -> None:
    """Write tape3, tape8 and tape9 of RESULT as text, in the original program's formats."""
    from fecm.results.result import load
    from fecm.results.tapes import write_tapes

    for path in write_tapes(load(result), directory):
        click.echo(path)
