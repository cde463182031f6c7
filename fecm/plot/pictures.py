"""Drawing and saving of pictures of results: the report's figures.

A kind of picture is a row of :data:`~fecm.plot.kinds.KINDS`. Its function takes named results, and
the options of the kind as keywords. It returns a :class:`~fecm.plot.kinds.Picture`. matplotlib is
imported when something is drawn, as the import takes half a second and matplotlib may be absent.
"""

from __future__ import annotations

import contextlib
import inspect
import logging
import warnings
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from fecm._errors import FecmError, did_you_mean
from fecm._files import beside, check_outputs
from fecm.plot.kinds import (
    KINDS,
    MISSING,
    MatplotlibError,
    Picture,
    PictureKind,
    PictureOptions,
    PlotError,
    Shows,
)
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fecm.location.location import Location
    from fecm.sweeps.result import SweepResult

# Results that kinds show, in words.
SOURCES = {
    Shows.RUN: "the result of a run",
    Shows.RUNS: "the result of a run",
    Shows.SWEEP: "the result of a sweep",
    Shows.LOCATION: "a located impact",
}
ANIMATION = ".gif"
FRAMES_PER_SECOND = 15


def kind_named(name: str) -> PictureKind:
    """Return the kind with this name.

    Raises PlotError if there is no such kind.
    """
    try:
        return PictureKind(name)
    except ValueError:
        alternatives = (
            did_you_mean(name, list(PictureKind)) or f"; the kinds are {', '.join(PictureKind)}"
        )
        raise PlotError(f"unknown kind of picture {name!r}{alternatives}") from None


def require_matplotlib() -> None:
    """Raise MatplotlibError, with the remedy, if matplotlib can't be imported."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise MatplotlibError(MISSING) from None
    except ValueError as error:  # MPLBACKEND names a backend that is not installed
        raise MatplotlibError(f"matplotlib can't start: {error}; unset MPLBACKEND") from None


def imported(place: str) -> Callable[..., Picture]:
    """Import the function at ``module:name`` of this package."""
    module, _, name = place.partition(":")
    require_matplotlib()
    function: Callable[..., Picture] = getattr(import_module(f"fecm.plot.{module}"), name)
    return function


def drawing_of(kind: str) -> Callable[..., Picture]:
    """Import the function that draws a kind."""
    return imported(KINDS[kind_named(kind)].function)


def options_of(kind: str) -> list[str]:
    """Return the names of the options that a kind takes."""
    _, *options = inspect.signature(drawing_of(kind)).parameters  # the first are the results
    return options


def check_picture_options(kinds: Iterable[str], options: Iterable[str]) -> None:
    """Raise PlotError if none of these kinds of picture takes an option."""
    kinds = list(kinds)
    options_taken = {option for kind in kinds for option in options_of(kind)}
    for option in options:
        if option not in options_taken:
            takers = [kind for kind in KINDS if option in options_of(kind)]
            if not takers:
                raise PlotError(f"unknown option {option}")
            raise PlotError(
                f"the option {option} is for the kind {' or '.join(takers)}, not for "
                f"{' or '.join(kinds)}"
            )


@contextlib.contextmanager
def _errors_as_one(what: str) -> Iterator[None]:
    """Turn any error of matplotlib into a PlotError."""
    try:
        yield
    except (FecmError, ImportError, OSError, MemoryError):
        raise
    except Exception as error:  # matplotlib does not document what it may raise
        message = " ".join(str(error).split())
        raise PlotError(f"{what} can't be drawn: {type(error).__name__}: {message}") from error


def _source(result: Result | SweepResult | Location) -> str:
    """Return the kind of a result, in the words of :data:`SOURCES`."""
    if isinstance(result, Result):
        return SOURCES[Shows.RUN]
    from fecm.sweeps.result import SweepResult  # loaded already if there is such a result

    return SOURCES[Shows.SWEEP if isinstance(result, SweepResult) else Shows.LOCATION]


def _check_source(
    kind: PictureKind, results: Mapping[str, Result | SweepResult | Location]
) -> None:
    """Raise PlotError if the kind can't show a result, such as a sweep in a picture of runs."""
    for name, result in results.items():
        source = _source(result)
        if source != SOURCES[KINDS[kind].shows]:
            able_kinds = [
                kind_name
                for kind_name, drawing in KINDS.items()
                if SOURCES[drawing.shows] == source
            ]
            kinds = (
                f"kind {able_kinds[0]} does"
                if len(able_kinds) == 1
                else f"kinds {', '.join(able_kinds)} do"
            )
            raise PlotError(f"{name} is {source}, which the kind {kind} can't show; the {kinds}")


def draw(
    kind: str,
    results: Mapping[str, Result | SweepResult | Location],
    style: Mapping[str, Any] | None = None,
    **options: Unpack[PictureOptions],
) -> Picture:
    """Draw a picture of a kind, from results by their names in the legend.

    `style` has settings of matplotlib, by default the settings of the command line. Raises
    PlotError if the kind is unknown, a result lacks the data, or the options do not fit. Raises
    ImportError if matplotlib is not installed.
    """
    chosen = kind_named(kind)
    if len(results) > 1 and KINDS[chosen].shows is not Shows.RUNS:
        raise PlotError(f"the kind {kind} shows one result; {len(results)} were given")
    check_picture_options([chosen], options)
    _check_source(chosen, results)
    # The import takes 0.3 s, and matplotlib may be absent; so in the functions below.
    import matplotlib

    from fecm.plot.style import RC

    settings = dict(RC if style is None else style)
    with matplotlib.rc_context(settings), _errors_as_one(f"{kind} of {' and '.join(results)}"):
        return drawing_of(kind)(results, **options)


def draw_entitled(
    kind: str,
    results: Mapping[str, Result | SweepResult | Location],
    **options: Unpack[PictureOptions],
) -> Picture:
    """Draw a picture for a file; a picture of one result has the title of its deck."""
    picture = draw(kind, results, **options)
    if len(results) == 1:
        import matplotlib  # as in `draw`

        from fecm.plot.style import RC, entitle

        with matplotlib.rc_context(RC):
            entitle(picture.figure, next(iter(results.values())).title)
    return picture


def draw_results(
    kind: str,
    results: Mapping[str, Result | SweepResult | Location],
    path: str | Path | None = None,
    ax: Axes | None = None,
    *,
    overwrite: bool = False,
    **options: Unpack[PictureOptions],
) -> Axes:
    """Draw one or more results: in a file, on given axes, or on a new figure of pyplot.

    The user's settings of matplotlib apply to axes and figures of pyplot; files have the settings
    of the command line.

    Parameters
    ----------
    kind : str
        Kind of picture, such as ``"force"`` or ``"loop"``.
    results : mapping
        Results, or one sweep, by the names in the legend.
    path : str or Path, optional
        File to write.  The suffix selects the format.
    ax : matplotlib.axes.Axes, optional
        Axes to draw on.
    overwrite : bool
        Replace an existing file.
    **options
        Options of the kind.

    Returns
    -------
    matplotlib.axes.Axes
        The picture's first axes.

    Raises
    ------
    PlotError
        If results lack the data, options are invalid, both `path` and `ax` are given, or `ax` is
        given and the picture has several axes.
    FileExistsError
        If the file exists and may not be replaced.

    Examples
    --------
    >>> plot("loop", {"lumped": lumped, "consistent": consistent}, "rods.pdf")  # doctest: +SKIP
    """
    if kind not in list(PictureKind) and any(
        isinstance(result, Container) and kind in result for result in results.values()
    ):
        raise PlotError(f"{kind} is a quantity, not a kind of picture: give quantity={kind!r}")
    if path is not None:
        if ax is not None:
            raise PlotError("give path or ax, not both: ax.figure.savefig writes your own figure")
        check_suffix(kind, Path(path))
        check_outputs([Path(path)], overwrite)
        picture = draw_entitled(kind, results, **options)
        save_picture(picture, Path(path), overwrite=overwrite)
        return picture.figure.axes[0]
    drawing_of(kind)  # without matplotlib, this says what to install
    from matplotlib import pyplot

    from fecm.plot.style import TARGET, style_on

    # This loads the backend. The backend of a notebook changes settings, which are kept.
    pyplot.draw_if_interactive()  # type: ignore[no-untyped-call]
    before = set(pyplot.get_fignums())
    token = TARGET.set("pyplot" if ax is None else ax)
    try:
        picture = draw(kind, results, style_on(ax), **options)
    except BaseException:
        for number in set(pyplot.get_fignums()) - before:
            pyplot.close(number)
        raise
    finally:
        TARGET.reset(token)
    for note in picture.notes:
        logging.getLogger("fecm").info(note)
    return picture.figure.axes[0] if ax is None else ax


def check_suffix(kind: str, path: Path) -> None:
    """Raise PlotError if the suffix of a file is not a format of the kind."""
    suffixes = KINDS[kind_named(kind)].suffixes
    if path.suffix.lower() not in suffixes:
        raise PlotError(f"{path}: the kind {kind} is written as {' or '.join(suffixes)}")


def save_picture(
    picture: Picture,
    path: Path,
    *,
    overwrite: bool = True,
    advance: Callable[[int], object] = lambda frames: None,
) -> None:
    """Write a picture in the format of the path's suffix; equal pictures give equal bytes.

    `advance` is called with 1 after each frame. Raises PlotError if matplotlib can't draw it.
    Raises OSError if the file can't be written; an existing file then stays unchanged.
    """
    import matplotlib

    from fecm.plot.style import RC, RESOLUTION, SCREEN, save

    suffix = path.suffix.lower()
    with (
        _errors_as_one(str(path)),
        warnings.catch_warnings(action="ignore"),
        matplotlib.rc_context(RC),
        beside(path, overwrite=overwrite) as partial,
    ):
        if suffix != ANIMATION:
            save(picture.figure, partial, suffix, RESOLUTION)
            return
        from matplotlib.animation import PillowWriter

        writer = PillowWriter(fps=FRAMES_PER_SECOND)
        with writer.saving(picture.figure, str(partial), dpi=SCREEN):
            for frame in picture.frames:
                frame()
                writer.grab_frame()
                advance(1)
