"""Errors of ``fecm locate``: those of a wrong model, and those of the noise beside its error bars.

    python benchmarks/location.py models
    python benchmarks/location.py seeds [NUMBER]
    python benchmarks/location.py mesh [NUMBER]
    python benchmarks/location.py speed

The strains are those of a run of examples/panel-with-gages.inp struck at 112.5, 81 mm, every 2 us,
with a normal scatter of 2 % of the largest strain of each gage.  `models` locates the impact with
decks that are wrong by some per cent and prints the table of docs/locate.md.  `seeds` repeats the
scatter 100 times and prints how often the 95 % ellipse covers the place, for strains of the same
deck and for those of a series solution (examples/panel-strains.csv is one of them).  `mesh` does so
for a small panel of 10 x 8 elements and strains of 20 x 16 elements.  `speed` prints processor
times: of a location, of the bisection of its mesh, and of the shares of the nodes at a place, with
the blocks of the mesh kept and built anew, in turns.
"""

from __future__ import annotations

import statistics
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fecm
from fecm._typing import Floats
from fecm.deck.model import Patch
from fecm.location.model import Footprint
from fecm.mechanics.mesh import MeshArrays
from fecm.mechanics.points import patch_weights
from fecm.problem.loading import load_one
from fecm.problem.refine import refined_deck

ROOT = Path(__file__).parent.parent
SERIES = ROOT / "tests" / "data" / "locate_public.csv"
DECK = fecm.read_one(fecm.examples.path("panel-with-gages.inp"))
PLACE = np.array([112.5, 81.0])
SMALL_PLACE = (61.0, 47.0)
NEAR = (90.0, 60.0, 135.0, 100.0)  # where seeds are located: no other place is a rival
INTERVAL, LAST = 2e-6, 8e-4
NOISE = 0.02  # standard deviation over the largest strain
COVERED = -2.0 * np.log(1.0 - 0.95)  # square of the ellipse's size in standard deviations


class Strains(NamedTuple):
    """Strains of a known impact without noise."""

    time: Floats
    strains: Floats  # (points, gages)
    peak_force: float
    impulse: float

    def measured(self, seed: int) -> Floats:
        """Strains with noise, (points, gages)."""
        scatter = np.random.default_rng(seed).normal(size=self.strains.shape)
        return self.strains + self.noise * scatter

    @property
    def noise(self) -> float:
        """Standard deviation of the noise: of the largest strain of all gages."""
        return NOISE * float(np.abs(self.strains).max())


def of_a_run() -> Strains:
    """Strains of a run of the deck, struck at the place."""
    with warnings.catch_warnings(action="ignore", category=fecm.FecmWarning):
        run = fecm.run_one(DECK.with_(x0=PLACE[0], y0=PLACE[1]))
    time = np.asarray(INTERVAL * np.arange(1.0, round(LAST / INTERVAL) + 1.0))
    strains = [np.interp(time, run.time, one) for one in run.gages.strain.T]
    impulse = float(np.trapezoid(run.force, run.time))
    return Strains(time, np.column_stack(strains), float(run.force.max()), impulse)


def of_the_series() -> Strains:
    """Strains of the series solution of the same impact."""
    table = np.genfromtxt(SERIES, delimiter=",", names=True)
    strains = np.column_stack([table[f"gage{n}"] for n in range(1, 5)])
    impulse = float(np.trapezoid(table["force_N"], table["time_s"]))
    return Strains(table["time_s"], strains, float(table["force_N"].max()), impulse)


def models() -> None:
    """Print the table of wrong models."""
    true = of_a_run()
    measured = true.measured(seed=0)
    thickness = 2.0
    gain = measured * np.array([1.05, 1.0, 1.0, 1.0])
    late = true.time + 5e-6
    right = (true.time, measured)
    cases: list[tuple[str, fecm.Deck, tuple[Floats, Floats], dict[str, bool]]] = [
        ("none", DECK, right, {}),
        ("E1 5 % too high", DECK.with_(e1=1.05 * 171420), right, {}),
        ("E1 5 % too low", DECK.with_(e1=0.95 * 171420), right, {}),
        ("thickness 2 % too high", DECK.with_(thickness=1.02 * thickness), right, {}),
        ("thickness 2 % too low", DECK.with_(thickness=0.98 * thickness), right, {}),
        ("density 5 % too high", DECK.with_(density=1.05 * 1.57e-9), right, {}),
        ("strains recorded 5 µs late", DECK, (late, measured), {}),
        ("the same, with `--shift`", DECK, (late, measured), {"shift": True}),
        ("gage 1 reads 5 % too much", DECK, (true.time, gain), {}),
        ("the same, with `--gains`", DECK, (true.time, gain), {"gains": True}),
    ]
    print("| wrong in the deck or the strains | place moves | sd | peak force | impulse | misfit |")
    print("|---|---|---|---|---|---|")
    for name, deck, table, free in cases:
        found = located(deck, table, true.noise, **free)
        moved = np.hypot(found.x - PLACE[0], found.y - PLACE[1])
        sd = np.hypot(found.sd_x, found.sd_y)
        peak = found.peak_force / true.peak_force - 1.0
        impulse = found.impulse / true.impulse - 1.0
        print(
            f"| {name} | {moved:.2f} mm | {sd:.2f} mm | {100 * peak:+.1f} % "
            f"| {100 * impulse:+.1f} % | {found.misfit:.2f} |"
        )


def located(
    deck: fecm.Deck, strains: tuple[Floats, Floats], noise: float, **others: Any
) -> fecm.Location:
    """Locate the impact from the strains, without notes."""
    with warnings.catch_warnings(action="ignore", category=fecm.FecmWarning):
        return fecm.locate(deck, strains, noise=noise, **others)


def seeds(number: int) -> None:
    """Print how often the ellipse covers the place, and the errors over their deviations."""
    for name, true in (("the same deck", of_a_run()), ("the series", of_the_series())):
        found = [
            located(DECK, (true.time, true.measured(seed)), true.noise, region=NEAR, grid=20.0)
            for seed in range(number)
        ]
        off = np.array([[one.x, one.y] for one in found]) - PLACE
        inverse = np.linalg.inv([one.covariance for one in found])
        inside = np.einsum("ni,nij,nj->n", off, inverse, off) <= COVERED
        sd = np.array([[one.sd_x, one.sd_y] for one in found])
        size = np.linalg.norm(off, axis=1).mean() / np.sqrt((sd**2).sum(axis=1)).mean()
        print(f"strains of {name}, {number} seeds")
        print(f"  the 95 % ellipse covers the place   {100 * inside.mean():.0f} %")
        print(f"  mean error of the place             {np.linalg.norm(off, axis=1).mean():.3f} mm")
        print(f"  over its standard deviation         {size:.2f}")
        print(f"  bias of x, y                        {off.mean(axis=0).round(3)} mm")
        peak = np.array([one.peak_force for one in found]) / true.peak_force - 1.0
        print(f"  peak force                          {peak.mean():+.1%} ± {peak.std():.1%}")


def small_panel(nx: int, ny: int) -> fecm.Deck:
    """Return a panel of 100 x 80 mm that a ball of 2 g hits at 2 m/s."""
    gages = [(22.0, 18.0, 0.72, 0.0), (80.0, 24.0, 0.72, 45.0), (26.0, 64.0, 0.72, 90.0)]
    deck = fecm.impact(
        fecm.Plate.rectangle((100.0, 80.0), (nx, ny), support="simple"),
        fecm.Laminate("[45/0/-45/90]s", "AS4/8552", 0.18),
        fecm.RigidMass(2e-6),
        fecm.Contact(2e4, 0.0, 0.0, 1.5),
        velocity=2000.0,
        duration=3e-4,
        units="mm-N-s",
        patch=None,
        gages=gages,
    )
    disc = Patch("DISC", 5.0, *SMALL_PLACE)  # on the mesh that the deck has
    return replace(deck, segments=(*deck.segments, disc), text="")


def mesh(number: int) -> None:
    """Print how often the ellipse covers the place if the strains are those of a finer mesh."""
    with warnings.catch_warnings(action="ignore", category=fecm.FecmWarning):
        run = fecm.run_one(small_panel(20, 16))
    time = np.asarray(3e-6 * np.arange(1.0, 101.0))
    strains = np.column_stack([np.interp(time, run.time, one) for one in run.gages.strain.T])
    impulse = float(np.trapezoid(run.force, run.time))
    true, deck = Strains(time, strains, float(run.force.max()), impulse), small_panel(10, 8)
    x, y = SMALL_PLACE
    near = (x - 15.0, y - 12.0, x + 15.0, y + 12.0)
    inside = 0
    for seed in range(number):
        found = located(deck, (time, true.measured(seed)), true.noise, region=near, grid=10.0)
        off = np.array([found.x, found.y]) - SMALL_PLACE
        inside += bool(off @ np.linalg.solve(found.covariance, off) <= COVERED)
    print(f"strains of elements half as long: {inside} of {number} inside the 95 % ellipse")


def seconds(compute: Callable[[], object]) -> float:
    """Processor time of a call."""
    begin = time.process_time()
    compute()
    return time.process_time() - begin


def speed(rounds: int = 5) -> None:
    """Print processor times of a location and of its parts."""
    strains = fecm.examples.path("panel-strains.csv")
    problem = load_one(DECK)
    mesh: MeshArrays = problem.mesh
    circle, held = ("DISC", 4.0), np.zeros(len(mesh.coordinates), dtype=bool)
    footprint, (x, y) = Footprint(mesh, *circle, held), PLACE
    parts: dict[str, Callable[[], object]] = {
        "location of the example": lambda: fecm.locate(DECK, strains),
        "bisected mesh": lambda: refined_deck(DECK, mesh),
        "300 places, blocks kept": lambda: [footprint.weights(x, y) for _ in range(300)],
        "300 places, blocks anew": lambda: [
            patch_weights(replace(mesh), *circle, x, y) for _ in range(300)
        ],
    }
    with warnings.catch_warnings(action="ignore", category=fecm.FecmWarning):
        table = [[seconds(compute) for compute in parts.values()] for _ in range(rounds)]
    for name, column in zip(parts, zip(*table, strict=True), strict=True):
        print(
            f"{name:26}{statistics.median(column):7.2f} s, {min(column):.2f} to {max(column):.2f}"
        )


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["models"]:
            models()
        case ["seeds"]:
            seeds(100)
        case ["seeds", text]:
            seeds(int(text))
        case ["speed"]:
            speed()
        case ["mesh"]:
            mesh(100)
        case ["mesh", text]:
            mesh(int(text))
        case _:
            sys.exit(__doc__)
