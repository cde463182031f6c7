"""Kinds of pictures.

Imports no matplotlib: the command line lists the kinds without it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from fecm._errors import FecmError
from fecm._frozen import frozen

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
MISSING = "pictures need matplotlib: pip install 'fecm[plot]'"


class PlotError(FecmError, ValueError):
    """A result lacks what a picture needs, or the options do not fit it."""


class LackingError(PlotError):
    """A result lacks the data of one kind of picture; other kinds may be drawn."""


class MatplotlibError(FecmError, ImportError):
    """matplotlib is not installed."""


@frozen
class Picture:
    """A figure; `frames` draw its frames if it is animated; `notes` say what it shows in words."""

    figure: Figure
    frames: Sequence[Callable[[], Any]] = ()
    notes: Sequence[str] = ()


@frozen
class Kind:
    """A kind of picture."""

    function: str  # module of this package, and the function in it
    summary: str  # what it shows
    several: bool = False  # whether several results go into one picture
    suffixes: tuple[str, ...] = SUFFIXES  # formats it can be written in, the usual one first
    sweep: bool = False  # whether it shows the result of a sweep, not of a run


KINDS = {
    "force": Kind("histories:force", "contact force and transducer against time", True),
    "loop": Kind("histories:loop", "contact force against indentation or displacement", True),
    "energy": Kind("histories:energy", "energies of plate and projectile against time", True),
    "strain": Kind("histories:strain", "surface strain at points against time", True),
    "thickness": Kind("plies:thickness", "ply stresses through the thickness of an element"),
    "failure": Kind("plies:failure", "largest exposures over the plate and of every ply"),
    "line": Kind("plate:line", "deflection along a line through the impact point", True),
    "contour": Kind("plate:contour", "deflection of the plate, seen from above"),
    "surface": Kind("plate:surface", "the deflected plate"),
    "mesh": Kind("plate:mesh", "mesh, supports, impact point and contact patch"),
    "animation": Kind("plate:animation", "the moving plate", suffixes=(".gif",)),
    "map": Kind("maps:parameter_map", "a quantity of a sweep over its parameters", sweep=True),
    "exceedance": Kind("random_sweep:exceedance", "probabilities of a random sweep", sweep=True),
    "sensitivity": Kind("random_sweep:sensitivity", "indices of a random sweep", sweep=True),
    "scatter": Kind("random_sweep:scatter", "a quantity over the random values", sweep=True),
}
