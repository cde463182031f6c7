"""Impacts on linear plates and on plates that stretch as they bend, at the same energy.

    python benchmarks/stretching_study.py [PICTURE]

1 kg hits plates of 2 mm under an elastic law: an isotropic square of 100 mm, and [0/90/0/90]s of
125 x 75 mm.  The energies are those at which the stretched plate deflects by h/4 to 3 h.  Prints
the table of docs/assumptions.md, with the largest difference from the spectral solutions of
tests/data/linear_error.csv, and draws its picture, docs/assumptions-stretching.png.  Takes some
minutes.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

import fecm
from fecm.authoring.mesh import InPlane
from fecm.authoring.plate import Support
from fecm.plot import style
from fecm.plot.kinds import Picture
from fecm.plot.pictures import save_picture

ROOT = Path(__file__).parent.parent
THICKNESS = 2.0
# Deflections over the thickness, and how near to them an impact's must be.
RATIOS = (0.25, 0.5, 1.0, 2.0, 3.0)
NEAR = 0.003
ALUMINIUM = fecm.Ply(2.7e-9, 0.3, 70e3, 70e3, 70e3 / 2.6, 70e3 / 2.6, 70e3 / 2.6)
FIBRES = fecm.Ply(1.53e-9, 0.3, 141e3, 9700.0, 5500.0, 5500.0, 3700.0)
PLATES = {
    "iso": ((100, 100), fecm.Laminate([0.0], ALUMINIUM, THICKNESS), 1e5),
    "cross": ((125, 75), fecm.Laminate("[0/90/0/90]s", FIBRES, THICKNESS / 8.0), 5e4),
}
Case = tuple[str, Support, InPlane]
# Plate, support, and u and v on the edges; the names of the table, and those of the file.
CASES: dict[Case, tuple[str, str]] = {
    ("iso", "clamped", "free"): ("clamped, edges free in the plane", ""),
    ("iso", "simple", "free"): ("simply supported, free in the plane", "iso_ss_movable"),
    ("iso", "clamped", "held"): ("clamped, immovable", "iso_clamped_immovable"),
    ("iso", "simple", "held"): ("simply supported, immovable", ""),
    ("cross", "clamped", "held"): ("cross-ply, clamped, immovable", ""),
    ("cross", "simple", "held"): ("cross-ply, simply supported, immovable", "cross_ss_immovable"),
}


class Struck(NamedTuple):
    """Largest force (N) and deflection over the thickness."""

    force: float
    ratio: float


def struck(case: Case, energy: float, *, nonlinear: bool) -> Struck:
    """Return an impact of an energy in mJ."""
    plate, support, in_plane = case
    size, laminate, k = PLATES[plate]
    deck = fecm.impact(
        fecm.Plate.rectangle(size, (24, 24), support=support),
        laminate,
        fecm.RigidMass(1e-3),
        fecm.Contact(k, 1.0, 0.0, 1.5),
        energy=energy,
        duration=4e-3,
        every=100000,
        units="mm-N-s",
        patch="hertz:8",
        shear_factor=5.0 / 6.0,
        nonlinear=nonlinear,
        in_plane=in_plane if nonlinear else None,
    )
    found = fecm.run_one(deck)
    return Struck(float(found.force.max()), float(found.plate_w.max()) / THICKNESS)


def at_ratio(case: Case, ratio: float, energy: float) -> tuple[float, Struck]:
    """Energy in mJ at which the stretched plate deflects by a ratio of its thickness, and impact.

    The secant method in logarithms, from an energy.
    """
    before, power = None, 0.4
    for _ in range(12):
        found = struck(case, energy, nonlinear=True)
        off = np.log(ratio / found.ratio)
        if abs(off) < NEAR:
            return energy, found
        if before is not None:
            power = (np.log(found.ratio) - before[1]) / (np.log(energy) - before[0])
        before = np.log(energy), np.log(found.ratio)
        energy *= float(np.exp(off / power))
    raise ArithmeticError(f"no energy of {case} gives {ratio} h")


def references() -> dict[str, list[tuple[float, float, float]]]:
    """Energy and both forces of the spectral solutions, by case."""
    found: dict[str, list[tuple[float, float, float]]] = {}
    with (ROOT / "tests" / "data" / "linear_error.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            forces = float(row["nonlinear_peak_N"]), float(row["linear_peak_N"])
            found.setdefault(row["case"], []).append((float(row["energy_mJ"]), *forces))
    return found


def study() -> dict[str, list[tuple[float, float, float]]]:
    """Deflection over the thickness and both forces of every case."""
    given = references()
    table: dict[str, list[tuple[float, float, float]]] = {}
    for case, (name, reference) in CASES.items():
        energy, rows, differences = 100.0, [], []
        for number, ratio in enumerate(RATIOS):
            if reference:
                energy, force, of_linear = given[reference][number]
                found = struck(case, energy, nonlinear=True)
                linear = struck(case, energy, nonlinear=False)
                differences += [found.force / force - 1.0, linear.force / of_linear - 1.0]
            else:
                energy, found = at_ratio(case, ratio, energy)
                linear = struck(case, energy, nonlinear=False)
            rows.append((found.ratio, found.force, linear.force))
        cells = [
            f"{linear:.0f} / {force:.0f} ({linear / force - 1.0:.0%})".replace("-", "−")
            for _, force, linear in rows
        ]
        print("|", name, "|", " | ".join(cells).replace("%", " %"), "|")
        if differences:
            print(f"    within {max(map(abs, differences)):.1%} of {reference}", flush=True)
        table[name] = rows
    return table


@style.styled
def picture(table: dict[str, list[tuple[float, float, float]]]) -> Picture:
    """Draw the linear over the nonlinear force."""
    figure, (ax,) = style.panels("full", ratio=0.5)
    for (name, rows), colour in zip(table.items(), style.COLOURS, strict=False):
        ratio, force, linear = np.array(rows).T
        dashed = "free" in name
        ax.plot(
            ratio,
            linear / force,
            "o-" if not dashed else "o--",
            markersize=3,
            color=colour,
            label=name,
        )
    ax.axhline(1.0, color="0.6", label="_")
    ax.set(
        xlabel="deflection of the stretched plate over its thickness",
        ylabel="force of the linear plate\nover that of the stretched one",
        xlim=(0.0, 3.1),
        ylim=(0.0, 1.05),
    )
    style.lines_legend(figure, ax)
    return Picture(figure)


if __name__ == "__main__":
    place = ROOT / "docs" / "assumptions-stretching.png"
    save_picture(picture(study()), Path(sys.argv[1]) if len(sys.argv) > 1 else place)
