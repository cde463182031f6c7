"""A picture beside a command's table: its option, its checks, its file."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fecm.cli.common import FILE_PATH, Refused, check_outputs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fecm.plot import Picture

OVERWRITE = click.option("--overwrite", is_flag=True, help="Replace files that exist.")
PLOT = click.option("--plot", "picture", type=FILE_PATH, metavar="FILE",
                    help="Draw a picture, too (.png, .svg, .pdf).")  # fmt: skip


def outputs(overwrite: bool, *paths: Path | None) -> None:
    """Refuse outputs that can't be written, before anything is done."""
    named = [path for path in paths if path is not None]
    if len(set(named)) < len(named):
        raise Refused(f"{named[0]} can't be both table and picture")
    check_outputs(named, overwrite)


def check_picture(path: Path | None) -> None:
    """Refuse a picture whose suffix is no format."""
    from fecm.plot import SUFFIXES

    if path is not None and path.suffix.lower() not in SUFFIXES:
        raise click.BadParameter(f"{path}: pictures are written as {', '.join(SUFFIXES)}",
                                 param_hint="--plot")  # fmt: skip


@contextmanager
def drawing() -> Iterator[None]:
    """Draw as all pictures are drawn."""
    try:
        import matplotlib
    except ImportError:
        from fecm.plot import MISSING

        raise Refused(MISSING) from None
    from fecm.plot.style import RC

    with matplotlib.rc_context(RC):
        yield


def save_picture(picture: Picture, path: Path) -> None:
    """Write a picture, and say so."""
    from fecm.plot import save

    save(picture, path)
    click.echo(f"fecm: note: drew {path}", err=True)
