"""A table and a picture of it: the options of both, their checks, their files.

Used by the commands whose result is a CSV (to standard output unless a file is named) and, if asked
for, a picture beside it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import click

from fecm._files import check_outputs
from fecm.cli.common import FILE_PATH, RefusedError, echo, writing
from fecm.plot.kinds import MISSING, SUFFIXES, Picture, PlotError
from fecm.plot.pictures import save

STANDARD_OUTPUT = Path("-")

OUTPUT = click.option("-o", "--output", type=click.Path(path_type=Path, allow_dash=True),
                      metavar="FILE", default=STANDARD_OUTPUT,
                      help="Where the CSV goes.  [default: standard output]")  # fmt: skip
PLOT = click.option("--plot", "picture", type=FILE_PATH, metavar="FILE",
                    help="Also draw it: .png, .svg or .pdf.")  # fmt: skip
OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace files that exist.")


@dataclass(frozen=True)
class OutputPaths:
    """Where a table and its picture go.

    Attributes
    ----------
    table : Path or None
        None is standard output.
    picture : Path or None
        None if there is none to draw.
    overwrite : bool
        Whether files that exist may be replaced.
    """

    table: Path | None
    picture: Path | None
    overwrite: bool

    @classmethod
    def checked(
        cls, table: Path, picture: Path | None, overwrite: bool, source: Path | None = None
    ) -> OutputPaths:
        """Check, before anything is computed, that both can be written.

        Parameters
        ----------
        table : Path
            ``-`` is standard output.
        picture : Path or None
        overwrite : bool
            Whether files that exist may be replaced.
        source : Path, optional
            What the table is made from; never replaced.

        Raises
        ------
        RefusedError
        OutputError
        """
        if picture is not None:
            _check_picture(picture)
        target = None if table == STANDARD_OUTPUT else table
        paths = [path for path in (target, picture) if path is not None]
        check_outputs(paths, overwrite, [] if source is None else [source])
        return cls(target, picture, overwrite)

    def draw(self, draw: Callable[[], Picture]) -> None:
        """Draw the picture, if one is asked for.

        Raises
        ------
        RefusedError
            If what is to be drawn does not fit a picture.
        OSError
            If it can't be written.
        """
        if self.picture is None:
            return

        try:
            save(draw(), self.picture, overwrite=self.overwrite)
        except PlotError as error:
            raise RefusedError(str(error)) from None
        echo(f"fecm: note: drew {self.picture}", err=True)

    def write(self, lines: Iterable[str]) -> None:
        """Write the table, of lines with their ends.

        Raises
        ------
        OSError
            If it can't be written.
        """
        if self.table is None:
            sys.stdout.writelines(lines)
            return
        with writing(self.table, overwrite=self.overwrite) as file:
            file.writelines(lines)
        echo(f"fecm: note: wrote {self.table}", err=True)


def _check_picture(path: Path) -> None:
    """Refuse a picture that can't be drawn."""
    if path.suffix.lower() not in SUFFIXES:
        raise RefusedError(f"{path}: pictures are written as {', '.join(SUFFIXES)}")
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise RefusedError(MISSING) from None
