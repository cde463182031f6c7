"""Pictures inside a page: pictures of results, and of the laminate."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fecm.deck.model import Layer
from fecm.deck.units import quantity
from fecm.plot.kinds import PictureKind, PlotError
from fecm.plot.pictures import draw
from fecm.plot.style import RC, panels
from fecm.report.content import PageBlock, PagePicture, data_address
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


LARGEST = 150_000  # bytes of a drawing in lines, above which it becomes pixels
DOTS = 200  # of pixels, per inch


def inside(figure: Figure) -> str:
    """Return a figure as a ``data:`` address: SVG, or PNG where SVG would be large."""
    data = _bytes(figure, "svg")
    kind = "image/svg+xml"
    if len(data) > LARGEST:
        data, kind = _bytes(figure, "png"), "image/png"
    return data_address(data, kind)


def _bytes(figure: Figure, form: str) -> bytes:
    """Return a figure in a format. Equal figures give equal bytes."""
    import matplotlib

    from fecm.plot.style import RC, save

    file = io.BytesIO()
    with matplotlib.rc_context(RC), warnings.catch_warnings(action="ignore"):
        save(figure, file, f".{form}", DOTS)
    return file.getvalue()


def drawn(
    kind: PictureKind,
    results: Mapping[str, Any],
    caption: str,
    alternative: str = "",
    *,
    wide: bool = False,
    **options: Any,
) -> Iterator[PageBlock]:
    """Yield a picture of a kind, unless the results lack what it shows."""
    with warnings.catch_warnings(action="ignore"):
        try:
            picture = draw(kind, results, **options)
        except PlotError:
            return
    yield PagePicture(inside(picture.figure), alternative or caption, caption, wide)


def of_runs(results: Mapping[str, Result]) -> Iterator[PageBlock]:
    """Yield the histories of one or more runs in the same pictures."""
    histories: tuple[tuple[PictureKind, str, dict[str, Any]], ...] = (
        (PictureKind.FORCE, "Contact force against time.", {}),
        (PictureKind.LOOP, "Contact force against indentation.", {"against": "indentation"}),
        (
            PictureKind.LOOP,
            "Contact force against the displacement of the projectile.",
            {"against": "displacement"},
        ),
        (PictureKind.ENERGY, "Energies of plate and projectile against time.", {}),
        (PictureKind.STRAIN, "Surface strain against time.", {}),
    )
    for kind, caption, options in histories:
        yield from drawn(kind, results, _with_peaks(kind, caption, results), **options)


def _with_peaks(kind: PictureKind, caption: str, results: Mapping[str, Result]) -> str:
    """Return a caption with the peak forces of the results."""
    if kind != PictureKind.FORCE:
        return caption
    peaks = []
    for name, result in results.items():
        if "history/force" in result and len(force := result.whole("history/force")):
            size = quantity(float(force.max()), result.unit("force"))
            peaks.append(f"{name}: {size}" if len(results) > 1 else size)
    return f"{caption[:-1]}; largest force {', '.join(peaks)}." if peaks else caption


def of_run(name: str, result: Result) -> Iterator[PageBlock]:
    """Yield pictures of the plate of one run."""
    results = {name: result}
    if "history/plate_w" in result and "tape3/time" in result and len(result["tape3/time"]):
        time = float(result["history/time"][result["history/plate_w"].argmax()])
        stored = result["tape3/time"]
        near = float(stored[np.abs(stored - time).argmin()])
        when = quantity(near, result.unit("time"))
        caption = f"Deflection at the stored time nearest to its peak, {when}"
        yield from drawn(PictureKind.CONTOUR, results, f"{caption}.", times=[near])
    yield from drawn(
        PictureKind.FAILURE,
        results,
        "Largest exposures over time: of the worst ply on the plate, and of every ply. "
        "Hatched points under the load are left out.",
        wide=True,
        width="full",
    )
    yield from drawn(PictureKind.THICKNESS, results, "Ply stresses through the thickness.")
    yield from drawn(PictureKind.MESH, results, "Mesh, supports, impact point and contact patch.")


PERIOD = 180.0  # degrees after which a fibre direction repeats
MOST_NAMED = 40  # plies that are labelled one by one
PLY_HEIGHT = 0.13  # of a label (in)
WIDTH = 3.5  # of the figure (in)
HEIGHTS = (1.5, 5.5)  # smallest and largest height of the plies (in)


def stack(layers: Sequence[Layer], names: Mapping[int, str]) -> Figure:
    """Draw the plies from the struck face down, to scale.

    `names` has the names of the materials by number. They are left out if there is one material.
    """
    edges = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
    several = len({layer.material for layer in layers}) > 1
    height = float(np.clip(len(layers) * PLY_HEIGHT, *HEIGHTS)) + 0.3
    colours = colormaps["twilight"]
    with rc_context(RC):
        figure, (axes,) = panels("column", ratio=height / WIDTH)
        for layer, top, bottom in zip(layers, edges[:-1], edges[1:], strict=True):
            colour = colours(0.15 + 0.7 * (layer.angle % PERIOD) / PERIOD)
            axes.add_patch(
                Rectangle((0.0, top), 1.0, bottom - top, fc=colour, ec="white", lw=0.5, alpha=0.6)
            )
            if len(layers) <= MOST_NAMED:
                label = f"{layer.angle:g}°"
                if several:
                    label = f"{label}  {names.get(layer.material, layer.material)}"
                middle = 0.5 * (top + bottom)
                axes.text(0.5, middle, label, va="center", ha="center", fontsize=6.5)
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(edges[-1], 0.0)
        axes.set_xticks([])
        axes.spines["bottom"].set_visible(False)
        axes.set_ylabel("depth from the struck face")
    return figure
