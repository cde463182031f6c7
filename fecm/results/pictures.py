"""Pictures of results, drawn by an upper room."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from fecm._methods import function_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Kinds of pictures of a run.
RunKind = Literal[
    "force",
    "loop",
    "energy",
    "strain",
    "thickness",
    "failure",
    "line",
    "contour",
    "surface",
    "mesh",
    "modes",
    "animation",
]
# Kinds of pictures of a sweep; exceedance, sensitivity and scatter are for random sweeps.
SweepKind = Literal["map", "exceedance", "sensitivity", "scatter", "measured"]


def plot_results(
    kind: str,
    results: Mapping[str, Any],
    path: str | Path | None,
    ax: Axes | None,
    *,
    overwrite: bool,
    **options: Any,
) -> Axes:
    """Draw results by their names in the legend; see :func:`fecm.plot.pictures.draw_results`."""
    axes: Axes = function_of("Result.plot")(kind, results, path, ax, overwrite=overwrite, **options)
    return axes
