"""Peak forces of quick models, sweep kernel and run over the mass of the projectile.

    python benchmarks/mass_ratio_study.py [PICTURE]

A simply supported square plate is hit by a rigid mass under an elastic law; the reference is a
modal series of the thin plate (tests/data/response_classes.csv).  Prints the table of
docs/damage.md and draws its picture, docs/damage-models.png.  Takes some ten minutes.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

from fecm.plot import style
from fecm.plot.kinds import Picture
from fecm.plot.pictures import save_picture
from fecm.problem.loading import load_deck
from fecm.studies.estimate import LARGE, SMALL, quick_estimate
from fecm.sweeps.execute import carry_out_plan
from fecm.sweeps.plan import plan
from fecm.verification.decks import run_of_deck
from fecm.verification.impacts import struck_square

ROOT = Path(__file__).parent.parent
NAMES = ("infinite plate", "static plate", "sweep kernel", "run")
# Simulated time of the sweep, beyond the peak of the largest mass.
END = 5.5e-3


def study() -> dict[str, list[float]]:
    """Mass ratios, exact peaks, and peaks of each model."""
    with (ROOT / "tests" / "data" / "response_classes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    masses = [float(row["M kg"]) for row in rows]
    found: dict[str, list[float]] = {name: [] for name in NAMES}
    found["ratio"] = [float(row["M/Mp"]) for row in rows]
    found["series"] = [float(row["peak exact series N"]) for row in rows]
    (problem,) = load_deck(struck_square(masses[0], END).to_text()).problems
    swept = carry_out_plan(problem, plan(problem, [{"rod_mass": m} for m in masses], history=False))
    found["sweep kernel"] = [float(peak) for peak in swept["peak_force"]]
    for mass, ratio, peak, time in zip(
        masses, found["ratio"], found["series"], swept["time_of_peak"], strict=True
    ):
        deck = struck_square(mass, 1.05 * float(time))
        (problem,) = load_deck(deck.to_text()).problems
        for model in quick_estimate(problem).models:
            found[model.name].append(model.impact.peak)
        found["run"].append(float(run_of_deck(deck).force.max()))
        line = [f"{found[name][-1] / peak - 1.0:+8.1%}" for name in NAMES[:2]]
        kernel = found["sweep kernel"][len(found["run"]) - 1]
        line += [f"{value / peak - 1.0:+8.1%}" for value in (kernel, found["run"][-1])]
        print(f"{ratio:7g}{peak:9.1f}", *line, flush=True)
    return found


@style.styled
def picture(found: dict[str, list[float]]) -> Picture:
    """Draw the peaks over those of the series."""
    figure, (ax,) = style.panels("full", ratio=0.5)
    exact = np.array(found["series"])
    for low, high in ((0.01, SMALL), (LARGE, 100.0)):
        ax.axvspan(low, high, color="0.93", label="_")
    ax.axhline(1.0, color="0.6", label="_")
    for name, colour, line in zip(NAMES[:3], style.COLOURS, style.STYLES, strict=False):
        label = "sweep kernel and run" if name == "sweep kernel" else name
        ax.plot(
            found["ratio"],
            np.array(found[name]) / exact,
            "o",
            markersize=3,
            color=colour,
            linestyle=line,
            label=label,
        )
    ax.set(
        xscale="log",
        xlabel="mass of the projectile over the plate's",
        ylabel="peak force over that of the series",
        ylim=(0.0, 1.2),
    )
    style.lines_legend(figure, ax)
    return Picture(figure)


if __name__ == "__main__":
    place = ROOT / "docs" / "damage-models.png"
    save_picture(picture(study()), Path(sys.argv[1]) if len(sys.argv) > 1 else place)
