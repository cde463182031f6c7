"""Pictures inside a page: pictures of results, and of the laminate."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context

from fecm.deck.model import Layer
from fecm.deck.units import prefixed
from fecm.plot.kinds import PictureKind, PlotError
from fecm.plot.pictures import draw
from fecm.plot.style import RC, Look, panels, save
from fecm.problem.problem import Problem
from fecm.report.arrangement import arrangement, draw_stack
from fecm.report.content import PageBlock, PagePicture, data_address
from fecm.report.subject import impactor
from fecm.results.exposures import first_failures
from fecm.results.result import Result
from fecm.results.summary import keeps_work

if TYPE_CHECKING:
    from matplotlib.figure import Figure


LARGEST = 150_000  # bytes of a drawing in lines, above which it becomes pixels
BYTES_A_POINT = 30  # of a collection of paths in SVG
# Ticks are numbers without mathematics, which takes 4 ms each to set.
STYLE: Any = {**RC, "axes.formatter.use_mathtext": False}
FIRST: Look = {"marker": "o", "ms": 4.0, "mfc": "none", "color": "#C00000"}  # first failure
DOTS = 200  # of pixels, per inch


def inside(figure: Figure) -> str:
    """Return a figure as a ``data:`` address: SVG, or PNG where SVG would be large."""
    form, kind = ("png", "image/png") if _is_large(figure) else ("svg", "image/svg+xml")
    return data_address(_bytes(figure, form), kind)


def _is_large(figure: Figure) -> bool:
    """Estimate whether a figure takes more than :data:`LARGEST` bytes as SVG.

    Drawing it to know would take as long as the picture itself.
    """
    drawn = [part for axes in figure.axes for part in axes.collections]
    points = sum(
        np.shape(path.vertices)[0]
        for part in drawn
        if not part.get_rasterized()
        for path in part.get_paths()
    )
    return bool(BYTES_A_POINT * points > LARGEST)


def _bytes(figure: Figure, form: str) -> bytes:
    """Return a figure in a format. Equal figures give equal bytes."""
    file = io.BytesIO()
    with rc_context(STYLE), warnings.catch_warnings(action="ignore"):
        if (engine := figure.get_layout_engine()) is not None:
            engine.execute(figure)  # once; saving a figure with a layout engine draws it twice
            figure.set_layout_engine(None)
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
            picture = draw(kind, results, STYLE, **options)
        except PlotError:
            return
    yield PagePicture(inside(picture.figure), alternative or caption, caption, wide)


def arranged(name: str, result: Result, problem: Problem) -> Iterator[PageBlock]:
    """Yield the drawing of the test, unless the result lacks what it shows."""
    hits = impactor(result, problem.deck)
    if hits is None:
        return
    try:
        figure = arrangement(name, result, problem, hits)
    except PlotError:
        return
    caption = "The test to scale: plate, supports and load from above, a section, and the plies."
    yield PagePicture(inside(figure), caption, caption)


def forces(results: Mapping[str, Result], **overlay: Any) -> Iterator[PageBlock]:
    """Yield the contact forces of one or more runs in one picture, with a measured force."""
    caption = _with_peaks("Contact force against time.", results)
    yield from drawn(PictureKind.FORCE, results, caption, **overlay)


def force(name: str, result: Result, **overlay: Any) -> Iterator[PageBlock]:
    """Yield the contact force of one run, with its first failure and a measured force."""
    with rc_context(STYLE), warnings.catch_warnings(action="ignore"):
        try:
            picture = draw(PictureKind.FORCE, {name: result}, STYLE, **overlay)
        except PlotError:
            return
        (axes, *_) = picture.figure.axes
        for first in first_failures(result)[:1]:
            axes.plot(first.time, first.force, **FIRST)
            axes.annotate(
                "first failure",
                (first.time, first.force),
                (6.0, -2.0),
                textcoords="offset points",
                va="top",
            )
    caption = _with_peaks("Contact force against time.", {name: result})
    yield PagePicture(inside(picture.figure), caption, caption)


def of_runs(results: Mapping[str, Result]) -> Iterator[PageBlock]:
    """Yield other histories of one or more runs in the same pictures."""
    histories: tuple[tuple[PictureKind, str, dict[str, Any]], ...] = (
        (
            PictureKind.LOOP,
            "Contact force against the displacement of the projectile.",
            {"against": "displacement"},
        ),
        (PictureKind.ENERGY, "Energies of plate and projectile against time.", {}),
        (PictureKind.STRAIN, "Surface strain against time.", {}),
    )
    for kind, caption, options in histories:
        yield from drawn(kind, results, caption, **options)
    if any(keeps_work(result) for result in results.values()):
        caption = "Contact force against indentation."
        yield from drawn(PictureKind.LOOP, results, caption, against="indentation")


def _with_peaks(caption: str, results: Mapping[str, Result]) -> str:
    """Return a caption with the peak forces of the results."""
    peaks = []
    for name, result in results.items():
        if "history/force" in result and len(force := result.whole("history/force")):
            size = prefixed(float(force.max()), result.unit("force"))
            peaks.append(f"{name}: {size}" if len(results) > 1 else size)
    return f"{caption[:-1]}; largest force {', '.join(peaks)}." if peaks else caption


def of_run(name: str, result: Result) -> Iterator[PageBlock]:
    """Yield pictures of the plate of one run."""
    results = {name: result}
    if "history/plate_w" in result and "tape3/time" in result and len(result["tape3/time"]):
        time = float(result["history/time"][result["history/plate_w"].argmax()])
        stored = result["tape3/time"]
        near = float(stored[np.abs(stored - time).argmin()])
        when = prefixed(near, result.unit("time"))
        caption = f"Deflection at the stored time nearest to its peak, {when}"
        yield from drawn(PictureKind.CONTOUR, results, f"{caption}.", times=[near])
    yield from drawn(
        PictureKind.FAILURE,
        results,
        "Largest exposures over time: of the worst ply on the plate, and of every ply. "
        f"Hatched points under the load are left out.{_first_ply(result)}",
        wide=True,
        width="full",
    )
    yield from drawn(PictureKind.THICKNESS, results, "Ply stresses through the thickness.")


def _first_ply(result: Result) -> str:
    """Say where the first failure is, which may be in another ply than the largest exposure."""
    if not (first := first_failures(result)[:1]):
        return ""
    return f" The first failure, before these values are reached, is in {first[0].where}."


PLY_HEIGHT = 0.13  # of a label (in)
WIDTH = 3.5  # of the figure (in)
HEIGHTS = (1.5, 5.5)  # smallest and largest height of the plies (in)


def stack(layers: Sequence[Layer], names: Mapping[int, str]) -> Figure:
    """Draw the plies of a laminate; see :func:`~fecm.report.arrangement.draw_stack`."""
    height = float(np.clip(len(layers) * PLY_HEIGHT, *HEIGHTS)) + 0.3
    with rc_context(STYLE):
        figure, (axes,) = panels("column", ratio=height / WIDTH)
        draw_stack(axes, layers, names, height)
        axes.set_ylabel("depth from the struck face")
    return figure
