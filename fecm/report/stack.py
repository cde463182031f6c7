"""Picture of a laminate: its plies with their angles, the struck face on top."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fecm.deck.model import Layer
from fecm.plot.style import RC, panels

PERIOD = 180.0  # degrees after which a fibre direction repeats
MOST_NAMED = 40  # plies that are labelled one by one
PLY_HEIGHT = 0.13  # of a label (in)
WIDTH = 3.5  # of the figure (in)
HEIGHTS = (1.5, 5.5)  # smallest and largest height of the plies (in)


def stack(layers: Sequence[Layer], names: Mapping[int, str]) -> Figure:
    """Draw the plies from the struck face on, as high as they are thick.

    `names` are those of the materials, by number; they are left out if there is one.
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
