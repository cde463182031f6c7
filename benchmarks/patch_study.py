"""Peak forces of the report's plate under a point force and a patch, over the mesh.

    python benchmarks/patch_study.py [PICTURE]

The plate is hit by a rigid mass under an elastic law.  Each mesh is bisected by
``fecm.problem.generate``; with a patch (disc of 0.327 h) it has assumed shear strains, with a point
force L2 = 3.  Prints the table of docs/patch.md and draws its picture, docs/patch-mesh.png.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from fecm.deck.grid import ElementGrid, GridSection, uniform_section
from fecm.deck.model import Deck, Indentation, Patch, Ply, Projectile, Shear
from fecm.plot import style
from fecm.plot.kinds import Picture
from fecm.plot.pictures import save_picture
from fecm.problem.generate import generate
from fecm.problem.refine import refined_deck
from fecm.verification.decks import history_program, material, run_of_deck, struck_plate

END = 8.0e-4
RIGHT = (77.2, 85.4)
KINDS = {"point force": (), "patch, 0.327 h": (Patch(), Shear(assumed=True))}
GRIDS = {
    "equal": ElementGrid(uniform_section(6.0, 12), uniform_section(4.0, 8)),
    "report's": ElementGrid(
        [GridSection(0.0, 1.5, 3), GridSection(1.5, 4.5, 8), GridSection(4.5, 6.0, 3)],
        [GridSection(0.0, 0.5, 1), GridSection(0.5, 3.5, 8), GridSection(3.5, 4.0, 1)],
    ),
}
HALVINGS = {"equal": 3, "report's": 2}


def plate(grid: ElementGrid) -> Deck:
    """Build the report's plate, hit by a rigid mass."""
    half = (0.0, 45.0, 0.0, -45.0, 0.0) * 2
    ply = Ply(0.000148, 0.3, 17.5e6, 1.15e6, 0.8e6, 0.8e6, 0.8e6)
    law = Indentation(1.912e6, 1.0, 0.0, 1.5)
    laminate = material(ply, half + half[::-1], 0.0053)
    return struck_plate(grid, laminate, Projectile(0, 0, 0.000181), 115.0, law, 2e-7, 1)


def peaks(deck: Deck, dt: float) -> tuple[float, float]:
    """Peak forces of the first and of the second contact (lb)."""
    found = run_of_deck(replace(deck, macros=history_program(dt, round(END / dt)), text=""))
    first = found.time < 5e-4
    return float(found.force[first].max()), float(found.force[~first].max())


def study() -> dict[tuple[str, str], list[tuple[int, float, float]]]:
    """Return the number of elements and the peaks of each mesh and kind of load."""
    rows: dict[tuple[str, str], list[tuple[int, float, float]]] = {}
    for mesh, grid in GRIDS.items():
        deck, dt = plate(grid), 2e-7
        for level in range(HALVINGS[mesh] + 1):
            for kind, segments in KINDS.items():
                loaded = replace(deck, segments=(*deck.segments, *segments))
                found = (deck.control.numel, *peaks(loaded, dt))
                rows.setdefault((mesh, kind), []).append(found)
                print(f"{mesh:10}{kind:16}{found[0]:6}{found[1]:8.2f}{found[2]:8.2f}", flush=True)
            if level < HALVINGS[mesh]:
                deck, dt = refined_deck(deck, generate(deck)), dt / 2.0
    return rows


@style.styled
def picture(rows: dict[tuple[str, str], list[tuple[int, float, float]]]) -> Picture:
    """Draw the peaks over the mean side of the elements."""
    figure, axes = style.panels("full", columns=2, ratio=0.75)
    for column, (ax, right) in enumerate(zip(axes, RIGHT, strict=True), start=1):
        ax.axhline(right, color="0.6", label="_")
        for kind, colour in zip(KINDS, style.COLOURS, strict=False):
            for mesh, line in zip(GRIDS, style.STYLES, strict=False):
                values = np.array(rows[mesh, kind])
                ax.plot(
                    np.sqrt(24.0 / values[:, 0]),
                    values[:, column],
                    "o",
                    markersize=3,
                    color=colour,
                    linestyle=line,
                    label=f"{kind}, {mesh} mesh",
                )
        ax.set(
            xscale="log",
            xticks=[0.0625, 0.125, 0.25, 0.5],
            xticklabels=["1/16", "1/8", "1/4", "1/2"],
            xlabel="mean side of the elements (in)",
            ylabel=f"peak of contact {column} (lb)",
        )
        ax.minorticks_off()
    style.lines_legend(figure, axes[0])
    return Picture(figure)


if __name__ == "__main__":
    place = Path(__file__).parent.parent / "docs" / "patch-mesh.png"
    save_picture(picture(study()), Path(sys.argv[1]) if len(sys.argv) > 1 else place)
