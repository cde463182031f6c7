"""Writes a result in the format of another program."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path

from fecm._files import ARGUMENT, check_outputs, writing
from fecm.results import csv
from fecm.results.errors import ExportError
from fecm.results.stored import Stored
from fecm.results.vtkhdf import write_vtkhdf


class ExportFormat(StrEnum):
    """A format of other programs."""

    VTKHDF = "vtkhdf"
    CSV = "csv"


def format_of(path: Path, to: str | None) -> ExportFormat:
    """Format of this name, or of the file's suffix; raises ExportError if there is none."""
    name = path.suffix.lower().removeprefix(".") if to is None else to
    try:
        return ExportFormat(name)
    except ValueError:
        known = " and ".join(ExportFormat)
        raise ExportError(
            f"{path}: {name!r} is not a format of exports; known are {known}"
        ) from None


def export(
    result: Stored,
    path: Path,
    form: ExportFormat,
    dataset: str,
    note: Callable[[str], None],
    *,
    overwrite: bool,
) -> None:
    """Write a result, of csv one dataset or group; see :meth:`fecm.Result.export`.

    `note` receives a sentence about what is exported incompletely, or is not final.
    """
    check_outputs([path], overwrite, allowed_by=ARGUMENT)
    if form is ExportFormat.VTKHDF:
        if dataset:
            raise ExportError("a dataset is chosen for csv; vtkhdf holds all fields")
        write_vtkhdf(result, path, note, overwrite=overwrite)
        return
    lines = csv.lines(result, dataset or csv.HISTORY, note)
    with writing(path, overwrite=overwrite) as file:
        file.writelines(lines)
