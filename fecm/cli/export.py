"""``fecm export``."""

from __future__ import annotations

from pathlib import Path

import click

from fecm._files import check_outputs
from fecm._text import Decimal
from fecm.cli.common import DASH, RefusedError, echo_path, note
from fecm.cli.isolation import reads
from fecm.cli.options import DECK_PATH, FILE_PATH, NAMED_PATH, typical
from fecm.cli.outputs import DECIMAL_OPTION, write_lines
from fecm.listing.tapes import tape_texts, write_tapes
from fecm.results import export as csv
from fecm.results.export import ExportFormat
from fecm.results.export import export_result as write
from fecm.results.groups import ExportError
from fecm.results.hdf5_reader import FileContents, read
from fecm.results.result import load, result_of
from fecm.results.schema import Form


@click.command(
    "tapes",
    epilog=typical(
        "fecm tapes impact-patch.h5",
        "fecm tapes impact-patch.h5 -d tapes",
    ),
)
@click.argument("result", type=DECK_PATH)
@click.option(
    "-d",
    "--directory",
    type=NAMED_PATH,
    default=Path(),
    metavar="DIR",
    help="Folder for the tapes.  [default: this folder]",
)
@click.option("--overwrite", is_flag=True, help="Replace existing tapes.")
@reads("result")
def tapes_command(result: Path, directory: Path, overwrite: bool) -> None:
    """Write tape3, tape8 and tape9 of RESULT as text, in the original program's formats."""
    loaded = load(result)
    if directory.is_dir():
        check_outputs([directory / name for name in tape_texts(loaded)], overwrite, [result])
    elif directory.exists():
        raise RefusedError(f"{directory} is not a folder")
    for path in write_tapes(loaded, directory, overwrite=overwrite):
        echo_path(path)


@click.command(
    "export",
    epilog=typical(
        "fecm export impact-patch.h5 --to vtkhdf",
        "fecm export impact-patch.h5 --to csv --dataset energy",
    ),
)
@click.argument("result", type=DECK_PATH)
@click.option(
    "--to",
    "target",
    type=click.Choice([form.value for form in ExportFormat]),
    required=True,
    help="vtkhdf for ParaView and VTK, csv for spreadsheets.",
)
@click.option(
    "-o",
    "--output",
    type=FILE_PATH,
    metavar="PATH",
    help="File to write; - is standard output, of csv only.  [default: RESULT's name "
    "with .vtkhdf or -DATASET.csv, in this folder]",
)
@click.option(
    "--dataset",
    metavar="NAME",
    help="Content of csv: a dataset such as tape3/w, or a group.  [default: history; "
    "cases of a sweep]",
)
@DECIMAL_OPTION
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
@reads("result")
def export_command(
    result: Path,
    target: str,
    output: Path | None,
    dataset: str | None,
    decimal: Decimal,
    overwrite: bool,
) -> None:
    """Write RESULT, of a run or of a sweep, in the format of another program.

    vtkhdf is one file with one time step per row that DISP stored. csv is a table with a header
    line. A sweep has the table cases, with one row per case, and the table history if its forces
    are stored.
    """
    if target == "vtkhdf" and dataset is not None:
        raise click.UsageError("--dataset is for --to csv; vtkhdf holds all fields")
    if target == "vtkhdf" and output == DASH:
        raise click.UsageError("vtkhdf can't go to standard output")

    contents = read(result, Form.RUN, Form.SWEEP)
    is_sweep = contents.form == Form.SWEEP
    name = (dataset or ("cases" if is_sweep else "history")).strip("/")
    ending = ".vtkhdf" if target == "vtkhdf" else f"-{name.replace('/', '-')}.csv"
    path = output or Path(f"{result.stem}{ending}")
    if path != DASH:
        check_outputs([path], overwrite, [result])
    try:
        if is_sweep:
            _write_sweep(contents, target, name, path, decimal, overwrite=overwrite)
        elif path == DASH:
            lines = csv.dataset_csv_lines(result_of(contents), name, note, decimal)
            write_lines(lines, path, overwrite=overwrite)
        else:
            form = ExportFormat(target)
            asked = name if form is ExportFormat.CSV else ""
            run = result_of(contents)
            write(run, path, form, asked, note, overwrite=overwrite, decimal=decimal)
    except ExportError as error:
        raise RefusedError(f"{result}: {error}") from None
    if path != DASH:
        echo_path(path)


def _write_sweep(
    contents: FileContents,
    target: str,
    name: str,
    path: Path,
    decimal: Decimal,
    *,
    overwrite: bool,
) -> None:
    """Write a table of a sweep."""
    if target != ExportFormat.CSV:
        raise ExportError("a sweep has no fields; --to csv writes its cases")
    # 50 ms, which the result of a run does not need.
    from fecm.sweeps.files import sweep_csv_lines
    from fecm.sweeps.result import sweep_of

    cases = sweep_of(contents, history=name == "history")
    write_lines(sweep_csv_lines(cases, name, decimal), path, overwrite=overwrite)
