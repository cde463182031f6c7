"""Pictures of waves in a laminate (the report's figures 2.4 to 2.12)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
from matplotlib.lines import Line2D

from fecm.plot.kinds import Picture
from fecm.plot.style import (
    COLOURS,
    DASHED,
    DOTTED,
    SOLID,
    Look,
    Multiple,
    limit_count,
    panels,
    scale_in,
    styled,
)
from fecm.studies.waves import FRONTS, MODES, Dispersion, Medium, WaveSurfaces

if TYPE_CHECKING:
    from matplotlib.projections.polar import PolarAxes
    from matplotlib.typing import LineStyleType

AROUND = np.arange(1441) / 4.0  # directions of the normals, degrees
RAYS = 45.0  # degrees between the normals of the rays
WORDS = {name: name.replace("_", " ").replace("in plane", "in-plane") for name in (*MODES, *FRONTS)}
# A style per mode.
DASHCUSPTED: LineStyleType = (0, (7, 1.5, 1, 1.5))
DASHCUSPCUSPTED: LineStyleType = (0, (7, 1.5, 1, 1.5, 1, 1.5))
DASHES = (SOLID, DASHED, DOTTED, DASHCUSPTED, DASHCUSPCUSPTED)
CUSP: Look = {"ls": "", "marker": "o", "ms": 3.0, "mfc": "white", "mec": "black", "mew": 0.6}


@styled
def dispersion_picture(medium: Medium, curves: Sequence[Dispersion]) -> Picture:
    """Phase velocities and frequencies of all modes against the wavelength.

    Velocities are divided by the transverse shear velocity, frequencies by that velocity over the
    thickness, as in figures 2.4 and 2.5.  The axes end just above the in-plane modes and the
    cut-off.
    """
    limit_count(len(curves), "directions")
    unit = medium.shear_velocity
    velocities = [curve.phase_velocity / unit for curve in curves]
    frequencies = [c.angular_frequency * medium.laminate.thickness / unit for c in curves]
    figure, axes = panels("full", 1, 2, ratio=0.66)
    for curve, colour, *both in zip(curves, COLOURS, velocities, frequencies, strict=False):
        for ax, values in zip(axes, both, strict=True):
            for column, dashes in zip(values.T, DASHES, strict=True):
                ax.plot(curve.wavelength, column, color=colour, ls=dashes)
    angles = [f"{curve.angle:g}°" for curve in curves]
    colours = [Line2D([], [], color=colour) for colour in COLOURS[: len(curves)]]
    figure.legend(colours, angles, loc="outside upper left", ncols=4)
    modes = [Line2D([], [], color="0.3", ls=dashes) for dashes in DASHES]
    words = [WORDS[mode] for mode in MODES]
    figure.legend(modes, words, loc="outside upper right", ncols=5, handlelength=2.6)
    longest = max(float(curve.wavelength[-1]) for curve in curves)
    for ax in axes:
        ax.set(xlim=(0.0, longest), xlabel="Wavelength $\\lambda/h$")
    top = 1.15 * max(float(values[:, 3:].max()) for values in velocities)
    axes[0].set(ylim=(0.0, top), ylabel="Phase velocity $c/c_s$")
    top = 2.6 * max(float(values[-1, 1:3].max()) for values in frequencies)
    axes[1].set(ylim=(0.0, top), ylabel="Frequency $\\omega h/c_s$")
    return Picture(figure)


@styled
def speeds_picture(surfaces: WaveSurfaces, units: Mapping[str, str]) -> Picture:
    """Polar graphs of the normal velocities of in-plane and flexural fronts."""
    fronts = surfaces.fronts(AROUND)
    speed = scale_in(units, "length/time", fronts.velocity)
    figure, axes = panels("full", 1, 2, ratio=1.16, projection="polar")
    figure.set_layout_engine("constrained")
    graphs = cast("list[PolarAxes]", axes)
    for place, (front, colour) in enumerate(zip(FRONTS, COLOURS, strict=False)):
        curve = np.deg2rad(fronts.normal), fronts.velocity[:, place]
        graphs[0 if place < 2 else 1].plot(*curve, color=colour, label=WORDS[front])
    for ax, title in zip(graphs, ("In-plane fronts", "Flexural fronts"), strict=True):
        ax.set_title(speed.label(f"{title}: normal velocity"))
        ax.set_rlim(0.0, 1.06 * float(fronts.velocity.max()))
        ax.yaxis.set_major_formatter(Multiple(speed.factor))
        ax.set_rlabel_position(112.5)
        ax.tick_params(labelsize=6.5, pad=1)
        ax.grid(lw=0.4, color="0.8")
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=3)
    return Picture(figure)


@styled
def fronts_picture(
    surfaces: WaveSurfaces, times: Sequence[float], radius: float, units: Mapping[str, str]
) -> Picture:
    """Fronts at several times with rays and cusps, one graph per mode."""
    limit_count(len(times), "times")
    fronts, some = surfaces.fronts(AROUND), surfaces.fronts(np.arange(0.0, 360.0, RAYS))
    places = [fronts.positions(time, radius) for time in times]
    ends = some.positions(0.0, radius), some.positions(max(times), radius)
    turns = [surfaces.cusps(time, radius) for time in times]
    length = scale_in(units, "length", *places)
    clock = scale_in(units, "time", np.array(times))
    around = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = radius * np.cos(around), radius * np.sin(around)
    figure, axes = panels("full", 2, 3, ratio=0.95)
    for mode, ax in enumerate(axes[:5]):
        ax.plot(*circle, color="0.4", ls=DOTTED)
        for start, end in zip(*(at[:, mode] for at in ends), strict=True):
            ax.plot(*zip(start, end, strict=True), color="0.6", lw=0.5)
        for at, colour in zip(places, COLOURS, strict=False):
            ax.plot(*at[:, mode].T, color=colour)
        dots = [(c.x, c.y) for found in turns for c in found if c.mode == FRONTS[mode]]
        ax.plot(*np.reshape(dots, (-1, 2)).T, **CUSP)
        ax.set_title(WORDS[FRONTS[mode]])
        ax.locator_params(nbins=5)
        ax.set_aspect("equal")
        length.name(ax.xaxis, "$x$")
        length.name(ax.yaxis, "$y$")
    axes[5].set_axis_off()
    handles = [Line2D([], [], color=colour) for _, colour in zip(times, COLOURS, strict=False)]
    labels = [clock.show(time) for time in times]
    handles += [Line2D([], [], color="0.4", ls=DOTTED), Line2D([], [], color="0.6", lw=0.5)]
    labels += ["time 0", f"rays, normals {RAYS:g}° apart"]
    if any(turns):
        handles.append(Line2D([], [], **CUSP))
        labels.append("cusps")
    axes[5].legend(handles, labels, loc="center")
    return Picture(figure)
