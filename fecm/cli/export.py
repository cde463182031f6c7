"""``fecm export``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from fecm.cli.apart import reads
from fecm.cli.common import DECK_PATH, Refused, check_outputs

STANDARD_OUTPUT = "-"


@click.command()
@click.argument("result", type=DECK_PATH)
@click.option("--to", "target", type=click.Choice(["vtkhdf", "csv"]), required=True,
              help="vtkhdf for ParaView and VTK, csv for spreadsheets.")  # fmt: skip
@click.option("-o", "--output", type=click.Path(path_type=Path, allow_dash=True), metavar="PATH",
              help="Where to write; - is standard output, for csv.  [default: RESULT's name with "
                   ".vtkhdf, or with -DATASET.csv, in this folder]")  # fmt: skip
@click.option("--dataset", metavar="NAME",
              help="What csv holds: a dataset as tape3/w, or a group.  [default: history]",
              )  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace a file that exists.")
@reads("result")
def export(
    result: Path, target: str, output: Path | None, dataset: str | None, overwrite: bool
) -> None:
    """Write RESULT in another program's format.

    vtkhdf is one file with a time step for each row that DISP stored; csv is a table with a header
    line.
    """
    name = (dataset or "history").strip("/")
    if target == "vtkhdf":
        if dataset is not None:
            raise click.UsageError("--dataset is for --to csv; vtkhdf holds all fields")
        if str(output) == STANDARD_OUTPUT:
            raise click.UsageError("vtkhdf can't go to standard output")
        path = output or Path(f"{result.stem}.vtkhdf")
    else:
        path = output or Path(f"{result.stem}-{name.replace('/', '-')}.csv")
    if str(path) != STANDARD_OUTPUT:
        check_outputs([path], overwrite)
        if path.exists() and path.samefile(result):
            raise Refused(f"{path} is the result itself")
    from fecm.export import ExportError

    try:
        _write(result, target, path, name)
    except ExportError as error:
        raise Refused(f"{result}: {error}") from None
    if str(path) != STANDARD_OUTPUT:
        click.echo(path)


def _write(source: Path, target: str, path: Path, name: str) -> None:
    """Write one export."""
    from fecm.results.result import load

    result = load(source)
    if target == "vtkhdf":
        from fecm.export.vtkhdf import write_vtkhdf

        write_vtkhdf(result, path, lambda text: click.echo(f"fecm: note: {text}", err=True))
        return
    from fecm.export.csv import table
    from fecm.files import beside

    lines = table(result, name).lines()
    if str(path) == STANDARD_OUTPUT:
        sys.stdout.writelines(lines)
        return
    with beside(path) as partial, partial.open("w", encoding="ascii", newline="\n") as file:
        file.writelines(lines)
