"""Pictures: the report's figures, drawn from one or more results.

Nothing here is imported by a run, and matplotlib only when something is drawn.  A kind of picture
is a row of `KINDS`; its function takes named results and options and gives a :class:`Picture`.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from fecm.plot.kinds import KINDS, MISSING, Picture, PlotError
from fecm.results.schema import ResultFileError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fecm.results.result import Result
    from fecm.sweeps.result import SweepResult


# Kinds that an option is for; the others are for all of them.
KINDS_OF_OPTION = {
    "at": ("strain", "mesh"),
    "gages": ("strain",),
    "face": ("strain",),
    "times": ("line", "contour", "surface", "animation"),
    "along": ("line",),
    **dict.fromkeys(("quantity", "over", "where", "level"), ("map",)),
}


@dataclass(frozen=True)
class Options:
    """What can be chosen about a picture.

    Attributes
    ----------
    at : tuple of (float, float)
        Points of the plate (length); the impact point if empty.
    gages : tuple of float
        Directions of strain in degrees from the x-axis.
    face : str
        ``"far"`` (z = h/2), ``"struck"`` (z = -h/2), or ``"curvature"`` for curvature instead.
    times : tuple of float
        Times (the deck's unit) whose nearest stored rows are drawn; some of them all if empty.
    along : str
        Direction of the line, ``"x"`` or ``"y"``.
    width : str
        ``"column"`` (3.5 in) or ``"full"`` (7.2 in).
    quantity : str
        What a map shows: a name of a sweep's summary.
    over : tuple of str
        One or two names of what varies; all that does if empty.
    where : mapping of str to float or str
        A map's cases alone whose values, by name, are these; of numbers the nearest ones.
    level : tuple of float
        Values of the quantity to mark in a map (the deck's unit).
    """

    at: tuple[tuple[float, float], ...] = ()
    gages: tuple[float, ...] = (0.0, 90.0)
    face: str = "far"
    times: tuple[float, ...] = ()
    along: str = "x"
    width: str = "column"
    quantity: str = "peak_force"
    over: tuple[str, ...] = ()
    where: Mapping[str, float | str] = field(default_factory=dict)
    level: tuple[float, ...] = ()


def check_kind(kind: str, name: str, *, sweep: bool) -> None:
    """Refuse a kind that does not show such a result.

    Raises
    ------
    PlotError
    """
    if KINDS[kind].sweep != sweep:
        what, fits = ("sweep", "the kind map does") if sweep else ("run", "the other kinds do")
        raise PlotError(
            f"{name} is the result of a {what}, which the kind {kind} can't show; {fits}"
        )


def check_options(kinds: Iterable[str], options: Options) -> None:
    """Refuse an option that none of the kinds of picture shows.

    Raises
    ------
    PlotError
    """
    usual = Options()
    for option in fields(Options):
        fit = KINDS_OF_OPTION.get(option.name, tuple(KINDS))
        given = getattr(options, option.name) != getattr(usual, option.name)
        if given and not set(fit) & set(kinds):
            raise PlotError(
                f"the option {option.name} is for the kind {' or '.join(fit)}, not for "
                f"{' or '.join(kinds)}"
            )


@contextlib.contextmanager
def _errors_as_one(what: str) -> Iterator[None]:
    """Turn whatever numbers without sense raise inside of matplotlib into one PlotError."""
    try:
        yield
    except (PlotError, ResultFileError, ImportError, OSError, MemoryError):
        raise
    except Exception as error:  # matplotlib says nowhere what it may raise
        told = " ".join(str(error).split())
        raise PlotError(f"{what} can't be drawn: {type(error).__name__}: {told}") from error


def draw(
    kind: str, results: Mapping[str, Result | SweepResult], options: Options | None = None
) -> Picture:
    """Draw a picture.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    results : mapping of str to Result or SweepResult
        Results by the name they have in the legend.
    options : Options, optional

    Raises
    ------
    PlotError
        If the kind is unknown, a result lacks what it shows, or the options don't fit.
    ImportError
        If matplotlib is not installed.
    """
    if kind not in KINDS:
        raise PlotError(f"there is no kind {kind!r} of picture; there is {', '.join(KINDS)}")
    if len(results) > 1 and not KINDS[kind].several:
        raise PlotError(f"the kind {kind} shows one result; {len(results)} were given")
    try:
        import matplotlib
    except ImportError:
        raise ImportError(MISSING) from None
    from fecm.plot.style import RC
    from fecm.results.result import Result

    for name, result in results.items():
        check_kind(kind, name, sweep=not isinstance(result, Result))
    module, _, function = KINDS[kind].function.partition(":")
    drawn = getattr(import_module(f"fecm.plot.{module}"), function)
    with matplotlib.rc_context(RC), _errors_as_one(f"{kind} of {' and '.join(results)}"):
        picture: Picture = drawn(results, options or Options())
    return picture


def figure(
    kind: str,
    results: Mapping[str, Result | SweepResult],
    options: Options,
    path: str | Path | None,
) -> Figure:
    """Draw a picture, and write it if there is a path; see :func:`draw` and :func:`save`."""
    check_options([kind], options)
    if path is not None:
        check_suffix(kind, Path(path))
    picture = draw(kind, results, options)
    if path is not None:
        save(picture, Path(path))
    return picture.figure


def check_suffix(kind: str, path: Path) -> None:
    """Refuse a name whose suffix is no format of the kind.

    Raises
    ------
    PlotError
    """
    suffixes = KINDS[kind].suffixes
    if path.suffix.lower() not in suffixes:
        raise PlotError(f"{path}: the kind {kind} is written as {' or '.join(suffixes)}")


def save(
    picture: Picture,
    path: Path,
    *,
    overwrite: bool = True,
    advance: Callable[[int], object] = lambda frames: None,
) -> None:
    """Write a picture in the format that its name's suffix says; the same picture, the same bytes.

    Parameters
    ----------
    picture : Picture
    path : Path
    overwrite : bool
        Replace a file that exists.
    advance : callable
        Told of each frame that is written.

    Raises
    ------
    PlotError
        If matplotlib can't draw it.
    OSError
        If the file can't be written; what was there is then untouched.
    """
    import matplotlib

    from fecm._files import beside
    from fecm.plot.style import RC, RESOLUTION, SCREEN, UNDATED

    suffix = path.suffix.lower()
    with (
        _errors_as_one(str(path)),
        warnings.catch_warnings(action="ignore"),
        matplotlib.rc_context(RC),
        beside(path, overwrite=overwrite) as partial,
    ):
        if suffix != ".gif":
            picture.figure.savefig(
                partial, format=suffix[1:], dpi=RESOLUTION, metadata=UNDATED[suffix]
            )
            return
        from matplotlib.animation import PillowWriter

        writer = PillowWriter(fps=15)
        with writer.saving(picture.figure, str(partial), dpi=SCREEN):
            for frame in picture.frames:
                frame()
                writer.grab_frame()
                advance(1)
