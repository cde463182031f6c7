"""Pictures of results inside a page."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm.plot.kinds import Kind, PlotError
from fecm.plot.pictures import draw
from fecm.report.content import Block, Picture, shown
from fecm.results.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LARGEST = 150_000  # bytes of a drawing in lines, above which it becomes pixels
DOTS = 200  # of pixels, per inch


def inside(figure: Figure) -> str:
    """A figure as a ``data:`` address: SVG, or PNG where that would be large, as of fine meshes."""
    found = _bytes(figure, "svg")
    kind = "image/svg+xml"
    if len(found) > LARGEST:
        found, kind = _bytes(figure, "png"), "image/png"
    return f"data:{kind};base64,{base64.b64encode(found).decode('ascii')}"


def _bytes(figure: Figure, form: str) -> bytes:
    """A figure in a format; equal figures give equal bytes."""
    import matplotlib

    from fecm.plot.style import RC, UNDATED

    file = io.BytesIO()
    with matplotlib.rc_context(RC), warnings.catch_warnings(action="ignore"):
        figure.savefig(file, format=form, dpi=DOTS, metadata=UNDATED[f".{form}"])
    return file.getvalue()


def drawn(
    kind: Kind,
    results: Mapping[str, Any],
    caption: str,
    alternative: str = "",
    *,
    wide: bool = False,
    **options: Any,
) -> Iterator[Block]:
    """A picture of a kind; nothing if the results lack what it shows."""
    with warnings.catch_warnings(action="ignore"):
        try:
            picture = draw(kind, results, **options)
        except PlotError:
            return
    yield Picture(inside(picture.figure), alternative or caption, caption, wide)


def of_runs(results: Mapping[str, Result]) -> Iterator[Block]:
    """Histories of one or more runs in the same pictures."""
    histories: tuple[tuple[Kind, str, dict[str, Any]], ...] = (
        (Kind.FORCE, "Contact force against time.", {}),
        (Kind.LOOP, "Contact force against indentation.", {"against": "indentation"}),
        (
            Kind.LOOP,
            "Contact force against the displacement of the projectile.",
            {"against": "displacement"},
        ),
        (Kind.ENERGY, "Energies of plate and projectile against time.", {}),
        (Kind.STRAIN, "Surface strain against time.", {}),
    )
    for kind, caption, options in histories:
        yield from drawn(kind, results, _with_peaks(kind, caption, results), **options)


def _with_peaks(kind: Kind, caption: str, results: Mapping[str, Result]) -> str:
    """A caption with the peak forces of the results."""
    if kind != Kind.FORCE:
        return caption
    peaks = []
    for name, result in results.items():
        if "history/force" in result and len(force := result["history/force"]):
            size = shown(float(force.max()), result.unit("force"))
            peaks.append(f"{name}: {size}" if len(results) > 1 else size)
    return f"{caption[:-1]}; largest force {', '.join(peaks)}." if peaks else caption


def of_run(name: str, result: Result) -> Iterator[Block]:
    """Pictures of the plate of one run."""
    results = {name: result}
    if "history/plate_w" in result and "tape3/time" in result and len(result["tape3/time"]):
        time = float(result["history/time"][result["history/plate_w"].argmax()])
        stored = result["tape3/time"]
        near = float(stored[np.abs(stored - time).argmin()])
        said = shown(near, result.unit("time"), 4)
        caption = f"Deflection at the stored time nearest to its peak, {said}"
        yield from drawn(Kind.CONTOUR, results, f"{caption}.", times=[near])
    yield from drawn(
        Kind.FAILURE,
        results,
        "Largest exposures over time: of the worst ply on the plate, and of every ply. "
        "Hatched points under the load are left out.",
        wide=True,
        width="full",
    )
    yield from drawn(Kind.THICKNESS, results, "Ply stresses through the thickness.")
    yield from drawn(Kind.MESH, results, "Mesh, supports, impact point and contact patch.")
