"""Options and files of commands that write a CSV table and draw it."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import click

from fecm._files import check_outputs, open_for_writing
from fecm._text import DECIMALS, Decimal, csv_lines
from fecm.cli.common import DASH, RefusedError, inform
from fecm.cli.options import FILE_PATH, NAMED_PATH, Decorated, stack_options
from fecm.deck.units import column_name, unit_of
from fecm.plot.kinds import SUFFIXES
from fecm.plot.pictures import imported, require_matplotlib, save_picture

_OUTPUT = click.option(
    "-o",
    "--output",
    type=FILE_PATH,
    metavar="FILE",
    default=DASH,
    help="CSV file to write.  [default: standard output]",
)
_PLOT = click.option(
    "--plot",
    "picture",
    type=NAMED_PATH,
    metavar="FILE",
    help="Also draw a picture: .png, .svg or .pdf.",
)
_OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace existing files.")
DECIMAL_OPTION = click.option(
    "--decimal",
    type=click.Choice(DECIMALS),
    default="point",
    show_default=True,
    help="Decimal mark of the CSV table; comma separates its values by semicolons.",
)


def outputs(source: str = "", *, table: bool = True) -> Callable[[Decorated], Decorated]:
    """Add ``--output`` for a table, ``--plot`` and ``--overwrite``; their files are `targets`.

    `source` is the parameter with the file that the command reads, which is never replaced.
    """

    def decorate(function: Decorated) -> Decorated:
        @functools.wraps(function)
        def command(
            picture: Path | None,
            overwrite: bool,
            output: Path = DASH,
            decimal: Decimal = "point",
            **values: Any,
        ) -> None:
            targets = OutputPaths(output, picture, overwrite, values.get(source), decimal=decimal)
            function(**values, targets=targets)

        of_table = [_OUTPUT, DECIMAL_OPTION] if table else []
        return stack_options(*of_table, _PLOT, _OVERWRITE)(command)

    return decorate


class OutputPaths:
    """Files of a table, ``-`` for standard output, and its picture, checked first."""

    def __init__(
        self,
        table: Path,
        picture: Path | None,
        overwrite: bool,
        *sources: Path | None,
        decimal: Decimal = "point",
    ) -> None:
        if picture is not None:
            if picture.suffix.lower() not in SUFFIXES:
                raise RefusedError(f"{picture}: pictures are written as {', '.join(SUFFIXES)}")
            require_matplotlib()
        self.table, self.picture, self._overwrite = table, picture, overwrite
        self._decimal = decimal
        files = [path for path in (table, picture) if path and path != DASH]
        check_outputs(files, overwrite, [source for source in sources if source])

    def draw(self, place: str, *data: Any) -> None:
        """Write the picture that a function of :mod:`fecm.plot` draws from data.

        The function is named ``module:name``.
        """
        if self.picture is not None:
            save_picture(imported(place)(*data), self.picture, overwrite=self._overwrite)
            inform(f"drew {self.picture}")

    def write(
        self, columns: Mapping[str, str], units: dict[str, str], rows: Iterable[Iterable[object]]
    ) -> None:
        """Write the table as CSV, with units after the names in the header.

        `columns` has the dimension of each column, empty for pure numbers and texts. `units` has
        the names of the units of length, force and time, and is empty if they are not known.
        """
        header = [
            column_name(name, unit_of(dimension, units)) for name, dimension in columns.items()
        ]
        lines = csv_lines(chain([header], rows), self._decimal)
        write_lines(lines, self.table, overwrite=self._overwrite)
        if self.table != DASH:
            inform(f"wrote {self.table}")


def write_lines(lines: Iterable[str], path: Path, *, overwrite: bool) -> None:
    """Write lines with line ends to a file, or to standard output."""
    if path == DASH:
        sys.stdout.writelines(lines)
        return
    with open_for_writing(path, overwrite=overwrite) as file:
        file.writelines(lines)
