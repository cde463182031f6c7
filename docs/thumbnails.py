"""Thumbnails of the gallery: one idea each, in strokes that are seen at 160 pixels.

They are drawn from what a script has computed, when the site is built.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import fecm

Names = dict[str, Any]  # variables of a script

SIZE = (4.0, 2.8)  # inches; 400 x 280 pixels, which the gallery shows at 160 x 112
STROKE = 6.0
COLOURS = ("#0a7d91", "#e4572e", "#777777")


def curves(ax: Any, *pairs: Any) -> None:
    """Lines through pairs of x and y."""
    for (x, y), colour in zip(pairs, COLOURS, strict=False):
        ax.plot(x, y, color=colour, lw=STROKE, solid_capstyle="round")


def as_drawn(ax: Any, own: Any) -> None:
    """Draw the lines and bars of a picture of the script, without its texts."""
    for line, colour in zip(own.lines, COLOURS, strict=False):
        style = {"lw": STROKE, "ls": line.get_linestyle()}
        if line.get_linestyle() == "None":
            style = {"ls": "", "marker": "o", "ms": STROKE}
        x, y = line.get_xdata(), line.get_ydata()
        if len(x) == 2 and len(set(y)) == 1:  # a level across the whole picture
            ax.axhline(y[0], color=colour, **style)
        else:
            ax.plot(x, y, color=colour, **style)
    for bar in own.patches:
        ax.add_patch(type(bar)(bar.get_xy(), bar.get_width(), bar.get_height(), fc=COLOURS[0]))
    ax.set(xscale=own.get_xscale(), yscale=own.get_yscale())
    ax.set(xlim=own.get_xlim(), ylim=own.get_ylim())


def deflected(ax: Any, result: Any, row: int) -> None:
    """Deflection of a plate in a stored row, from above; without a hole in its mesh."""
    x, y = result["mesh/coordinates"][:, :2].T
    corners = result["mesh/elements"][:, :4] - 1
    triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    w = result.tape3.w[row]
    size = np.abs(w).max()
    ax.tricontourf(x, y, triangles, w, 12, cmap="RdBu_r", vmin=-size, vmax=size)
    ax.set_aspect("equal")
    ax.set_axis_off()


def forces(ax: Any, results: Names) -> None:
    """Contact forces over time."""
    curves(ax, *((one.time, one.force) for one in results.values()))


def loops(ax: Any, *results: Any) -> None:
    """Contact forces over indentations, while they are pressed together."""
    curves(ax, *((one.indentation, one.force) for one in results))
    ax.set_xlim(left=0.0)


def overlay(ax: Any, names: Names) -> None:
    """Draw a measured force over a computed one."""
    result = names["result"]
    time, force = np.loadtxt(names["measured"], delimiter=",", skiprows=3, unpack=True)
    curves(ax, (result.time, result.force))
    ax.plot(time, force, color=COLOURS[1], lw=STROKE / 3)


def ringing(ax: Any, names: Names) -> None:
    """Force in the middle of two projectiles, at first."""
    time = names["result"].time[:500]
    curves(ax, *((time, force[:500]) for force in (names["rod"], names["solid"])))


def energy(ax: Any, names: Names) -> None:
    """Force over energy, and the energy at the threshold in figures."""
    result, onset = names["result"], names["onset"]
    curves(ax, (result["energy"], result["peak_force"]))
    ax.axvline(onset, color=COLOURS[1], lw=STROKE)
    text = f"{onset / 1000:.1f} J"
    ax.text(0.98, 0.08, text, size=44, color=COLOURS[1], ha="right", transform=ax.transAxes)


def probability(ax: Any, names: Names) -> None:
    """Share of the draws above a force, and the chance in figures."""
    peak = np.sort(names["result"]["peak_force"])
    curves(ax, (peak, 1.0 - (np.arange(len(peak)) + 0.5) / len(peak)))
    chance = names["chance"].probability.item()
    ax.text(peak[-1], 0.72, f"{chance:.0%}", size=44, color=COLOURS[1], ha="right")


def bars(ax: Any, *sizes: Any) -> None:
    """Bars beside each other."""
    for n, (size, colour) in enumerate(zip(sizes, COLOURS, strict=False)):
        ax.bar(np.arange(len(size)) + 0.4 * n, size, 0.4 if len(sizes) > 1 else 0.7, color=colour)


def map_of(ax: Any, names: Names) -> None:
    """Draw a cell for each case."""
    result = names["result"]
    rows = len(set(result["velocity"]))
    ax.imshow(result["peak_force"].reshape(rows, -1).T, aspect="auto", origin="lower")
    ax.set_axis_off()


def exposures(ax: Any, names: Names) -> None:
    """Largest exposure around the load, from above."""
    result = names["result"]
    x, y = (result[f"failure/{name}"].ravel() for name in ("x", "y"))
    largest = result["failure/puck/exposure"].max(axis=(2, 3)).ravel()
    away = result["failure/under_load"].ravel() == 0
    ax.tricontourf(x[away], y[away], largest[away], 12)
    ax.tricontour(x[away], y[away], largest[away], [1.0], colors=COLOURS[1], linewidths=STROKE)
    ax.set(xlim=(45, 105), ylim=(29, 71))
    ax.set_axis_off()


def points(ax: Any, names: Names) -> None:
    """Draw the layups that were tried, coloured by the deflection."""
    a, b, w = zip(*names["tried"], strict=True)
    ax.scatter(a, b, c=w, s=40 * STROKE)


def density(ax: Any, names: Names) -> None:
    """Where samples are dense."""
    ax.hexbin(names["velocity"], names["k"], gridsize=20, cmap="Blues")


def place(ax: Any, names: Names) -> None:
    """Draw the misfit at the candidates, and the located place."""
    location = names["location"]
    ax.tricontourf(*location.candidates.T, np.log(location.candidate_misfit), 12)
    ax.plot(*location.gage_places.T, "ko", ms=2 * STROKE)
    ax.plot(location.x, location.y, "x", color=COLOURS[1], ms=5 * STROKE, mew=STROKE)
    ax.set_aspect("equal")
    ax.set_axis_off()


OWN: dict[str, Callable[[Any, Names], None]] = {
    "animation": lambda ax, names: deflected(ax, names["result"], 6),
    "axisymmetric_projectile": ringing,
    "deck_without_text": lambda ax, names: loops(ax, names["result"], names["faster"]),
    "energy_of_delamination": energy,
    "first_failure": exposures,
    "layup_optimisation": points,
    "located_impact": place,
    "overlay_of_a_measurement": overlay,
    "own_contact_law": lambda ax, names: loops(ax, *names["results"].values()),
    "own_projectile": lambda ax, names: forces(ax, names["results"]),
    "parametric_study": map_of,
    "plate_with_a_hole": lambda ax, names: deflected(ax, names["result"], 12),
    "ply_stresses": lambda ax, names: as_drawn(ax, names["left"]),
    "posterior": density,
    "probability_of_delamination": probability,
    "reports": lambda ax, names: forces(ax, {key: names["pages"][key] for key in ("drop-weight",)}),
    "sobol_indices": lambda ax, names: bars(ax, names["of_salib"]["S1"], names["indices"].first),
    "table_of_cases": lambda ax, names: bars(ax, names["results"]["peak_force"]),
}


def tests(ax: Any, compared: Any) -> None:
    """Draw computed over measured values, and the line of equal values."""
    ax.plot(compared.measured, compared.computed, "o", ms=3 * STROKE)
    ax.axline((0.0, 0.0), slope=1.0, color=COLOURS[1], lw=STROKE / 2)


def fitted(ax: Any, fit: Any) -> None:
    """Draw a fitted force through the measured points."""
    ax.plot(fit.time, fit.force, "o", color=COLOURS[0], ms=STROKE)
    ax.plot(fit.time, fit.model, color=COLOURS[1], lw=STROKE / 2)


def impact(ax: Any, result: Any) -> None:
    """Draw the contact force, and the delamination threshold if there is one."""
    curves(ax, (result.time, result.force))
    if "threshold_force" in result.metrics:
        ax.axhline(result.metrics["threshold_force"], color=COLOURS[1], lw=STROKE)


def of_page(result: Any, path: Path) -> None:
    """Draw what a report is about."""
    match result:
        case fecm.Result():
            _save(path, lambda ax: impact(ax, result))
        case fecm.Identification():
            _save(path, lambda ax: fitted(ax, result))
        case fecm.Location():
            _save(path, lambda ax: place(ax, {"location": result}))
        case fecm.SweepResult(random=None) if result.measured:
            _save(path, lambda ax: tests(ax, result.compare()))
        case fecm.SweepResult(random=None):
            _save(path, lambda ax: map_of(ax, {"result": result}))
        case _:
            names = {"result": result, "chance": result.random.exceedance}
            _save(path, lambda ax: probability(ax, names))


def drawn(script: str, names: Names, path: Path) -> bool:
    """Draw the thumbnail of a script; False if it has nothing to draw it from."""
    draw = OWN.get(script)
    if draw is None and "ax" not in names:
        return False
    if draw is None:
        _save(path, lambda ax: as_drawn(ax, names["ax"]))
    else:
        _save(path, lambda ax: draw(ax, names))
    return True


def _save(path: Path, draw: Callable[[Any], None]) -> None:
    """Write a thumbnail."""
    from matplotlib.figure import Figure

    figure = Figure(SIZE, layout="constrained")
    ax = figure.add_subplot()
    draw(ax)
    ax.set(xticks=[], yticks=[])
    ax.minorticks_off()
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_linewidth(STROKE / 2)
    figure.savefig(path, dpi=100)
