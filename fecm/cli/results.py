"""Commands about results: ``fecm tapes``."""

from __future__ import annotations

from pathlib import Path

import click

from fecm.cli.apart import reads
from fecm.cli.common import DECK_PATH, FILE_PATH, Refused, echo
from fecm.files import check_outputs


@click.command(short_help="Write tape3, tape8 and tape9 as text.")
@click.argument("result", type=DECK_PATH)
@click.option("-d", "--directory", type=FILE_PATH, default=Path(), metavar="DIR",
              help="Folder for the tapes.  [default: this folder]")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace tapes that exist.")
@reads("result")
def tapes(result: Path, directory: Path, overwrite: bool) -> None:
    """Write tape3, tape8 and tape9 of RESULT as text, in the original program's formats."""
    from fecm.results.result import load
    from fecm.results.tapes import tape_texts, write_tapes

    loaded = load(result)
    if directory.is_dir():
        check_outputs([directory / name for name in tape_texts(loaded)], overwrite, [result])
    elif directory.exists():
        raise Refused(f"{directory} is not a folder")
    for path in write_tapes(loaded, directory, overwrite=overwrite):
        echo(path)
