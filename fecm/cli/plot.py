"""``fecm plot``."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click import option

from fecm._errors import FecmWarning
from fecm._files import check_outputs
from fecm._text import printable
from fecm.cli.common import CheckFailedError, RefusedError, echo_path, note, progress
from fecm.cli.isolation import reads
from fecm.cli.options import (
    COLUMNS_OPTION,
    DECK_PATH,
    NAMED_PATH,
    UNITS_OPTION,
    Finite,
    OneOf,
    Parsed,
    assignment,
    collected,
    list_of,
    typical,
)
from fecm.mechanics.failure import CRITERIA
from fecm.plot.kinds import KINDS, LackingError, Picture, PictureKind
from fecm.plot.pictures import (
    check_picture_options,
    check_suffix,
    draw_entitled,
    options_of,
    save_picture,
)
from fecm.results.hdf5_reader import FileContents, read
from fecm.results.metrics import COLUMNS
from fecm.results.result import Result, result_of
from fecm.results.schema import Form

if TYPE_CHECKING:
    from fecm.location.location import Location
    from fecm.sweeps.result import SweepResult

_KIND_HELP = "; ".join(f"{name}: {kind.summary}" for name, kind in KINDS.items())


def _by_name(_: Any, __: Any, pairs: tuple[tuple[str, str], ...]) -> dict[str, str]:
    """Return values by name."""
    values = dict(pairs)
    if len(values) < len(pairs):
        raise click.BadParameter("a name is given twice")
    return values


@dataclass(frozen=True)
class PlotOptions:
    """Options of kinds of pictures, under the names of their functions."""

    at: tuple[tuple[float, float], ...]
    projectile: bool
    gages: tuple[float, ...] | None
    face: str | None
    times: tuple[float, ...] | None
    against: str | None
    overlay: Path | None
    columns: tuple[str, ...] | None
    units: tuple[str, ...] | None
    delay: float | None
    offset: float | None
    along: str | None
    width: str | None
    quantity: str | None
    over: tuple[str, ...] | None
    where: dict[str, str]
    level: tuple[float, ...] | None

    def given(self) -> dict[str, Any]:
        """Return the options that are given, by name."""
        return {name: value for name, value in vars(self).items() if value}


@click.command(
    "plot",
    short_help="Draw the report's figures, or the map of a sweep.",
    epilog=typical(
        "fecm plot impact-patch.h5 --kind force --kind loop",
        "fecm plot impact-patch-sweep.h5 --quantity peak_force --over velocity",
    ),
)
@click.argument("results", type=DECK_PATH, nargs=-1, required=True, metavar="RESULT...")
@option(
    "--kind",
    "kinds",
    type=OneOf([*map(str, KINDS)]),
    multiple=True,
    metavar="KIND",
    help=f"Picture to draw; may be repeated.  {_KIND_HELP}.  [default: force; modes of a "
    "result of `fecm modes`; map of a sweep, exceedance of a random one, measured of a table with "
    "measured results; location of a located impact]",
)
@option(
    "-o",
    "--output",
    type=NAMED_PATH,
    metavar="PATH",
    help="Picture (.png, .svg, .pdf; .gif for animation), or folder for several.  [default: "
    "RESULT-KIND.png in this folder]",
)
@option(
    "--at",
    type=list_of("X,Y", Finite(), [2]),
    multiple=True,
    help="Point of strain (may be repeated), thickness or mesh.  [default of strain: the point "
    "with the largest bending strain outside the load; of thickness: where |sigma_1| is largest]",
)
@option("--projectile", is_flag=True, help="Draw the elements of the rod below the mesh.")
@option(
    "--gage",
    "gages",
    type=list_of("DEGREES,...", Finite()),
    help="Directions of strain, from the x-axis.  [default: 0,90]",
)
@option(
    "--face",
    type=click.Choice(["far", "struck", "curvature"]),
    help="Face of the strain, or curvature instead.  [default: far]",
)
@option(
    "--times",
    "--time",
    "times",
    type=list_of("T,T,...", Finite()),
    help="Times, in the deck's unit; the nearest stored rows are drawn.  [default: some during "
    "the contact; of surface the largest deflection]",
)
@option(
    "--against",
    type=click.Choice(["indentation", "deflection", "displacement"]),
    help="Horizontal axis of loop: indentation, displacement of the plate under the load, or "
    "of the projectile (the sum).  [default: displacement of a rigid mass, indentation of others]",
)
@option(
    "--overlay",
    type=DECK_PATH,
    metavar="FILE.csv",
    help="Measured force to draw over the kind force: columns time and force (or "
    "transducer), converted to the deck's units.  Notes compare both.",
)
@COLUMNS_OPTION
@UNITS_OPTION
@option(
    "--delay",
    type=Finite(),
    metavar="TIME",
    help="Measured time of the first contact in --overlay, subtracted.  [default: 0]",
)
@option(
    "--offset",
    type=Finite(),
    metavar="FORCE",
    help="Measured force without a contact in --overlay, subtracted.  [default: 0]",
)
@option("--along", type=click.Choice(["x", "y"]), help="Direction of line.  [default: x]")
@option(
    "--width",
    type=click.Choice(["column", "full"]),
    help="3.5 in, or 7.2 in.  [default: column; of failure full]",
)
@option(
    "--quantity",
    type=Parsed(str, "NAME", (*COLUMNS, *CRITERIA)),
    help="Quantity of a sweep: a name of its summary; of failure: a criterion.  [default: "
    "peak_force, found_velocity; the largest of all]",
)
@option(
    "--over",
    type=list_of("NAME or NAME,NAME", click.STRING, [1, 2]),
    metavar="NAME[,NAME]",
    help="Parameters on the axes of map.  [default: those that vary]",
)
@option(
    "--where",
    type=Parsed(assignment, "NAME=VALUE"),
    callback=_by_name,
    multiple=True,
    help="Show only the cases of a sweep that are nearest to this value; may be repeated.",
)
@option(
    "--level",
    type=list_of("VALUE,...", Finite()),
    help="Values of the quantity to mark, in the deck's unit.",
)
@option("--overwrite", is_flag=True, help="Replace existing pictures.")
@reads("results")
@collected(PlotOptions, "asked")
def plot_command(
    results: tuple[Path, ...],
    kinds: tuple[str, ...],
    output: Path | None,
    overwrite: bool,
    asked: PlotOptions,
) -> None:
    """Draw the report's figures from one or more RESULTs, or the map of a sweep.

    A kind whose data were not stored is left out, and the exit status is then 1; 2 if no kind can
    be drawn.
    """
    options = asked.given()
    drawn = {name: loaded_result(read(path, *Form)) for name, path in named(results).items()}
    first = next(iter(drawn.values()))
    chosen = list(dict.fromkeys(kinds)) or [_usual(first)]
    check_picture_options(chosen, options)
    paths = _paths(results[0], chosen, output)
    folder = output if output is not None and output not in paths.values() else None
    if folder is None or folder.is_dir():
        check_outputs(list(paths.values()), overwrite, results)
    pictures, lacking = _draw(drawn, chosen, options)
    if not pictures:
        raise next(iter(lacking.values()))
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    for kind, picture in pictures.items():
        with progress(kind, len(picture.frames)) as advance:
            save_picture(picture, paths[kind], overwrite=overwrite, advance=advance)
        echo_path(paths[kind])
    if lacking:
        raise CheckFailedError(
            "; ".join(f"{kind} is not drawn: {error}" for kind, error in lacking.items())
        )


def _usual(first: Result | SweepResult | Location) -> PictureKind:
    """Return the kind of picture that is drawn by default."""
    if isinstance(first, Result):
        has_modes_only = "history/force" not in first and "modes/shape" in first
        return PictureKind.MODES if has_modes_only else PictureKind.FORCE
    # 46 ms, which results of runs do not need.
    from fecm.sweeps.measured import compared_columns
    from fecm.sweeps.result import SweepResult

    if isinstance(first, SweepResult):
        if first.random:
            return PictureKind.EXCEEDANCE
        return PictureKind.MEASURED if compared_columns(first) else PictureKind.MAP
    return PictureKind.LOCATION


def _paths(first: Path, kinds: list[str], output: Path | None) -> dict[str, Path]:
    """Return the path of each picture, by kind."""
    is_folder = output is None or output.is_dir() or not (output.exists() or output.suffix)
    if output is not None and not is_folder:
        if len(kinds) > 1:
            raise RefusedError(f"{output} is not a folder, and {len(kinds)} pictures are requested")
        check_suffix(kinds[0], output)
        return {kinds[0]: output}
    folder = output or Path()
    return {kind: folder / f"{first.stem}-{kind}{KINDS[kind].suffixes[0]}" for kind in kinds}


def named(paths: tuple[Path, ...]) -> dict[str, Path]:
    """Return paths of results by their shortest distinct names."""
    names = [printable(path.stem) for path in paths]
    if len(set(names)) < len(names):
        names = [printable(str(path)) for path in paths]
    if len(set(names)) < len(names):
        raise RefusedError("a result is given twice")
    return dict(zip(names, paths, strict=True))


def loaded_result(contents: FileContents) -> Result | SweepResult | Location:
    """Return the result of a run, a sweep without its forces, or a location."""
    if contents.form == Form.RUN:
        return result_of(contents)
    # 46 and 12 ms, which results of runs do not need.
    if contents.form == Form.SWEEP:
        from fecm.sweeps.result import sweep_of

        return sweep_of(contents, history=False)
    from fecm.location.location import location_of

    return location_of(contents)


def _draw(
    results: dict[str, Result | SweepResult | Location],
    kinds: list[str],
    options: Mapping[str, Any],
) -> tuple[dict[str, Picture], dict[str, LackingError]]:
    """Draw all pictures before writing any.

    Returns the pictures, and by kind the reasons why others are not drawn.
    """
    pictures, lacking = {}, {}
    with progress("fecm", len(kinds)) as advance, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for kind in kinds:
            options_of_kind = {name: options[name] for name in options_of(kind) if name in options}
            try:
                pictures[kind] = draw_entitled(kind, results, **options_of_kind)
            except LackingError as error:
                lacking[kind] = error
            advance(1)
    notes = [
        str(warning.message) for warning in caught if issubclass(warning.category, FecmWarning)
    ]
    notes += [text for picture in pictures.values() for text in picture.notes]
    note(*dict.fromkeys(notes))
    return pictures, lacking
