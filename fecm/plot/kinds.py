"""Kinds of pictures, their options and their errors.

This module does not import matplotlib, so that the command line lists the kinds without it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum, StrEnum, auto
from typing import TYPE_CHECKING, Literal, NamedTuple, TypedDict

from fecm._errors import FecmError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fecm.results.comparison import Source

SUFFIXES = (".png", ".svg", ".pdf")
MISSING = "pictures need matplotlib: pip install 'fecm[plot]'"


class PlotError(FecmError, ValueError):
    """A result lacks what a picture needs, or the options do not fit it."""


class LackingError(PlotError):
    """A result lacks the data of one kind of picture; other kinds may be drawn."""


class MatplotlibError(FecmError, ImportError):
    """matplotlib is not installed."""


class Picture(NamedTuple):
    """Figure, with functions that draw its frames if it is animated, and notes about it."""

    figure: Figure
    frames: Sequence[Callable[[], None]] = ()
    notes: Sequence[str] = ()


class PictureKind(StrEnum):
    """Names of the kinds of pictures."""

    FORCE = auto()
    LOOP = auto()
    ENERGY = auto()
    STRAIN = auto()
    THICKNESS = auto()
    FAILURE = auto()
    LINE = auto()
    CONTOUR = auto()
    SURFACE = auto()
    MESH = auto()
    MODES = auto()
    ANIMATION = auto()
    MAP = auto()
    EXCEEDANCE = auto()
    SENSITIVITY = auto()
    SCATTER = auto()
    MEASURED = auto()
    LOCATION = auto()


class Shows(Enum):
    """Results that a kind of picture shows."""

    RUN = auto()  # the result of one run
    RUNS = auto()  # the results of one or more runs
    SWEEP = auto()  # the result of one sweep
    LOCATION = auto()  # one impact that gages located


class Drawing(NamedTuple):
    """Function and options of a kind of picture."""

    function: str  # ``module:name`` in this package, imported when the picture is drawn
    shows: Shows
    summary: str
    suffixes: tuple[str, ...] = SUFFIXES  # suffixes of its formats, the usual one first


KINDS: dict[str, Drawing] = {
    PictureKind.FORCE: Drawing(
        "histories:force", Shows.RUNS, "contact force and transducer against time"
    ),
    PictureKind.LOOP: Drawing(
        "histories:loop", Shows.RUNS, "contact force against indentation or displacement"
    ),
    PictureKind.ENERGY: Drawing(
        "histories:energy", Shows.RUNS, "energies of plate and projectile against time"
    ),
    PictureKind.STRAIN: Drawing(
        "histories:strain_picture", Shows.RUNS, "surface strain at points against time"
    ),
    PictureKind.THICKNESS: Drawing(
        "thickness:thickness", Shows.RUN, "ply stresses through the thickness of an element"
    ),
    PictureKind.FAILURE: Drawing(
        "failure:failure", Shows.RUN, "largest exposures over the plate and of every ply"
    ),
    PictureKind.LINE: Drawing(
        "plate:line_picture", Shows.RUNS, "deflection along a line through the impact point"
    ),
    PictureKind.CONTOUR: Drawing(
        "plate:contour", Shows.RUN, "deflection of the plate, seen from above"
    ),
    PictureKind.SURFACE: Drawing("plate:surface_picture", Shows.RUN, "the deflected plate"),
    PictureKind.MESH: Drawing(
        "mesh:mesh_picture", Shows.RUN, "mesh, supports, impact point and contact patch"
    ),
    PictureKind.MODES: Drawing("modes:modes_picture", Shows.RUN, "natural modes of the plate"),
    PictureKind.ANIMATION: Drawing("plate:animation", Shows.RUN, "the moving plate", (".gif",)),
    PictureKind.MAP: Drawing(
        "maps:parameter_map", Shows.SWEEP, "a quantity of a sweep over its parameters"
    ),
    PictureKind.EXCEEDANCE: Drawing(
        "random_sweep:exceedance", Shows.SWEEP, "probabilities of a random sweep"
    ),
    PictureKind.SENSITIVITY: Drawing(
        "random_sweep:sensitivity", Shows.SWEEP, "indices of a random sweep"
    ),
    PictureKind.SCATTER: Drawing(
        "random_sweep:scatter", Shows.SWEEP, "a quantity over the random values"
    ),
    PictureKind.MEASURED: Drawing(
        "measured:measured", Shows.SWEEP, "computed over measured values of a table of tests"
    ),
    PictureKind.LOCATION: Drawing(
        "location:location", Shows.LOCATION, "place, force and strains that locate found"
    ),
}

Width = Literal["column", "full"]  # width of a journal's column or page
Against = Literal["indentation", "deflection", "displacement"]
Face = Literal["far", "struck", "curvature"]
Direction = Literal["x", "y"]


class PictureOptions(TypedDict, total=False):
    """Options of pictures; the docstring of a kind's function says which of them it takes."""

    width: Width
    at: Sequence[tuple[float, float]]
    projectile: bool
    times: Sequence[float]
    gages: Sequence[float]
    face: Face
    against: Against
    along: Direction
    overlay: Source | None
    columns: Sequence[str]
    units: Sequence[str]
    delay: float
    offset: float
    quantity: str
    over: Sequence[str]
    where: Mapping[str, float | str] | None
    level: Sequence[float]
