"""Delaminated areas of measured specimens beside the delamination threshold.

    python benchmarks/measured_areas.py [PICTURE]

The measurements are means of groups of three specimens of T800S/3900-2B under a hemispherical
impactor (tests/data/measured_areas.csv): S. Hasebe, R. Higuchi, T. Yokozeki and S. Takeda, Data in
Brief 42 (2022) 108462 and 60 (2025) 111509.  The threshold is that of the ply T800S/M21, which has
the same fibre, in the fixture D7136, with plates that slide on the window as they stretch.  Prints
the tables of docs/measured.md and draws its picture, docs/measured-areas.png.  Takes some minutes.
"""

from __future__ import annotations

import csv
import sys
import warnings
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

import fecm
from fecm.plot import style
from fecm.plot.kinds import Picture
from fecm.plot.pictures import save_picture

ROOT = Path(__file__).parent.parent
DATA = ROOT / "tests" / "data" / "measured_areas.csv"
PLY = fecm.materials()["T800S/M21"]
TEST = "D7136"


class Group(NamedTuple):
    """Specimens of a layup under an energy (J): their mean area and its deviation (mm2)."""

    layup: str
    plies: int
    thickness: float
    energy: float
    area: float
    deviation: float

    @classmethod
    def of(cls, row: dict[str, str]) -> Self:
        """Read a row of the data."""
        numbers = (float(row[key]) for key in ("thickness mm", "energy J", "area mm2", "sd mm2"))
        return cls(row["layup"], int(row["plies"]), *numbers)


def groups() -> list[Group]:
    with DATA.open(newline="") as file:
        return [Group.of(row) for row in csv.DictReader(file)]


def deck_of(group: Group) -> fecm.Deck:
    """Return the group's impact, on a plate of its mean thickness."""
    return fecm.impact(
        fecm.Plate.on_fixture(TEST),
        fecm.Laminate(group.layup, PLY, group.thickness / group.plies),
        contact=fecm.Contact.estimate(radius=8),
        energy=f"{group.energy}J",
        damage=True,
        nonlinear=True,
        units="mm-N-s",
    )


def thresholds(measured: list[Group]) -> dict[str, float]:
    """Print the force of the threshold, and the energies at which models of the plate reach it.

    Returns those of the runs (J) by layup.
    """
    print(f"{'layup':18}{'h mm':>6}{'F_d N':>8}{'static J':>9}{'run J':>8}{'tested J':>14}")
    found = {}
    for layup, same in by_layup(measured).items():
        with warnings.catch_warnings(action="ignore", category=fecm.FecmWarning):
            models = fecm.estimate(deck_of(same[0])).models
        run, static = models["run"], models["nonlinear static plate"]
        found[layup] = run.energy / 1e3
        print(
            f"{layup:18}{same[0].thickness:6.2f}{run.threshold:8.0f}{static.energy / 1e3:9.2f}"
            f"{found[layup]:8.2f}{', '.join(f'{group.energy:g}' for group in same):>14}",
            flush=True,
        )
    return found


def by_layup(measured: list[Group]) -> dict[str, list[Group]]:
    """Return the groups of each layup, the lowest energy first."""
    names = dict.fromkeys(group.layup for group in measured)
    return {name: [group for group in measured if group.layup == name] for name in names}


def zero(low: Group, high: Group) -> tuple[float, float]:
    """Energy at which the straight line through two means has no area, and its standard error."""
    reach = high.energy - low.energy
    rise = (high.area - low.area) / reach
    energy = low.energy - low.area / rise
    by_low = (high.energy - energy) / reach * low.deviation
    by_high = (low.energy - energy) / reach * high.deviation
    return energy, float(np.hypot(by_low, by_high)) / rise / 3**0.5


def areas(measured: list[Group], energies: dict[str, float]) -> None:
    """Print the areas by energy, and how many delaminations would share what is above E_d."""
    toughness = PLY.constants("mm-N-s")["GIIc"]
    print(f"\n{'layup':18}{'energy J':>9}{'area mm2':>13}{'mm2/J':>7}{'delaminations':>15}")
    for group in measured:
        above = group.energy - energies[group.layup]
        print(
            f"{group.layup:18}{group.energy:9.2f}{group.area:7.0f} +- {group.deviation:3.0f}"
            f"{group.area / group.energy:6.1f}{above * 1e3 / (2.0 * toughness * group.area):15.1f}"
        )
    print(f"\n{'layup':18}{'no area at J':>16}{'run J':>8}")
    for layup, same in by_layup(measured).items():
        if len(same) == 2:
            energy, error = zero(*same)
            print(f"{layup:18}{energy:9.1f} +- {error:3.1f}{energies[layup]:8.2f}")


@style.styled
def picture(measured: list[Group], energies: dict[str, float]) -> Picture:
    """Draw the areas over the energies, a colour a layup; crosses are the thresholds."""
    figure, (ax,) = style.panels("full", ratio=0.5)
    per_joule = [group.area / group.energy for group in measured]
    ends = np.array([0.0, 17.0])
    ax.fill_between(ends, min(per_joule) * ends, max(per_joule) * ends, color="0.92", label="_")
    looks = zip(style.COLOURS, "os^Dv", strict=False)
    for (layup, same), (colour, marker) in zip(by_layup(measured).items(), looks, strict=True):
        x, y = [group.energy for group in same], [group.area for group in same]
        ax.errorbar(x, y, [group.deviation for group in same], fmt="none", capsize=3, color=colour)
        label = f"{layup}, {same[0].thickness:.1f} mm"
        ax.plot(x, y, marker, markersize=4, color=colour, label=label)
        ax.plot(energies[layup], 0.0, "x", markersize=6, color=colour, label="_", clip_on=False)
    ax.set(
        xlabel="impact energy (J)",
        ylabel="projected delaminated area (mm²)",
        xlim=(0.0, 17.0),
        ylim=(0.0, 700.0),
    )
    style.lines_legend(figure, ax)
    return Picture(figure)


if __name__ == "__main__":
    found = groups()
    reached = thresholds(found)
    areas(found, reached)
    place = ROOT / "docs" / "measured-areas.png"
    save_picture(picture(found, reached), Path(sys.argv[1]) if len(sys.argv) > 1 else place)
