"""Errors of the largest exposures by the mesh: the fit set and the test set of the bands.

    python benchmarks/exposure_bands.py fit|test [PLATE ...] > meshes.csv

runs every plate on 8 to 26 meshes and on a finest one with elements of 0.4 R at the load, R being
the radius of the circle around the load. The rows are those of tests/data/exposures_on_meshes.csv,
the finest mesh last. docs/confidence.md has the plates. The constants that were fitted to the set
`fit` are in fecm/judge/exposure_bands.py. A set takes about an hour.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import fecm
from fecm.judge.exposure_bands import LoadMesh
from fecm.mechanics.exposures import CircleStresses
from fecm.problem.estimates import load_mesh
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.results.exposures import largest_exposures


class Case(NamedTuple):
    """Plate and impact, in mm, N and s."""

    size: tuple[float, float]
    layup: str
    ply: str
    ply_thickness: float
    support: str
    mass: float
    velocity: float
    ball: float  # radius
    core: float = 0.0  # thickness of the ply K of a sandwich
    options: dict[str, Any] = {}  # noqa: RUF012  # never changed


NONL = {"kinematics": "von-karman"}
PLIES = "AS4/8552", "IM7/8552", "AS4/3501-6", "AS/3501", "T300/5208"
A8, I8, A6, A1, T3 = PLIES
QUASI = "[45/0/-45/90]"
FIT = {
    "f01-1.0-thin": Case((50, 50), "[0/90]2s", A8, 0.125, "simple", 1e-5, 3000, 6),
    "f02-2.1-clamped": Case((100, 80), f"{QUASI}2s", I8, 0.131, "clamped", 1e-3, 800, 8),
    "f03-3.0-slow": Case((90, 90), "[0/45/-45/90]3s", A6, 0.125, "simple", 2e-3, 1000, 10),
    "f04-5.0-cross": Case((100, 70), "[0/90]5s", A1, 0.25, "simple", 8e-5, 6000, 8),
    "f05-8.0-quasi": Case((120, 120), f"{QUASI}4s", I8, 0.25, "clamped", 3e-4, 4000, 8),
    "f06-6.0-ud": Case((80, 100), "[0]24", T3, 0.25, "simple", 2e-4, 3000, 6),
    "f07-sandwich-12": Case(
        (100, 100), "[0/90/0/90/K/90/0/90/0]", I8, 0.25, "simple", 3e-4, 1500, 12, 10.0
    ),
    "f08-sandwich-6": Case((60, 60), "[0/90/K/90/0]", A8, 0.25, "clamped", 1e-4, 1500, 10, 5.0),
    "f09-1.6-curved200": Case(
        (80, 80), "[0/45/-45/90]s", A8, 0.2, "simple", 1e-4, 2000, 8, 0.0, {"radius_y": 200.0}
    ),
    "f10-4.0-curved400": Case(
        (100, 100), "[0/90]4s", T3, 0.25, "clamped", 5e-4, 2000, 8, 0.0, {"radius_x": -400.0}
    ),
    "f11-1.5-nonl": Case(
        (80, 60), "[45/-45/0/90]s", I8, 0.1875, "clamped", 2e-4, 3000, 8, 0.0, NONL
    ),
    "f12-2.0-nonl-curved": Case(
        (90, 90), "[0/60/-60]s", A6, 0.333, "simple", 3e-4, 2500, 8, 0.0, NONL | {"radius_y": 400.0}
    ),
    "f13-10-small": Case((100, 100), "[0/90]10s", A8, 0.25, "simple", 1e-4, 8000, 6),
    "f14-4.0-off": Case(
        (100, 100), "[30/-30/90]4s", I8, 0.1667, "clamped", 4e-4, 2500, 8, 0.0, {"at": (40.0, 60.0)}
    ),
    "f15-2.4-curved150": Case(
        (75, 60), "[45/-45]3s", A8, 0.2, "clamped", 2e-4, 2000, 8, 0.0, {"radius_x": 150.0}
    ),
    "f16-1.2-small": Case((70, 70), "[0/90/45/-45]s", T3, 0.15, "simple", 2e-6, 12000, 3),
}
TEST = {
    "t01-1.0": Case((60, 45), "[45/-45/0/90]s", A8, 0.125, "clamped", 2e-5, 2500, 5),
    "t02-2.9": Case((100, 100), "[0/45/-45/90]2s", I8, 0.184, "simple", 2e-4, 3500, 8),
    "t03-4.2": Case((125, 75), f"{QUASI}3s", I8, 0.175, "simple", 2e-3, 1200, 8),
    "t04-7.2": Case((90, 90), "[0/60/-60]6s", A6, 0.2, "simple", 1e-4, 8000, 8),
    "t05-10": Case((140, 110), "[0/90]20s", I8, 0.125, "clamped", 5e-4, 4000, 10),
    "t06-sandwich-9": Case(
        (80, 80), "[45/-45/0/K/0/-45/45]", A8, 0.2, "simple", 2e-4, 1200, 8, 8.0
    ),
    "t07-sandwich-21": Case(
        (150, 150), "[0/90/0/90/K/90/0/90/0]", A6, 0.15, "clamped", 5e-4, 1500, 15, 20.0
    ),
    "t08-1.8-curved": Case(
        (100, 75), "[0/90/0]s", A8, 0.3, "simple", 2e-4, 1800, 8, 0.0, {"radius_y": 250.0}
    ),
    "t09-3.6-curved": Case(
        (120, 100),
        f"{QUASI}s",
        T3,
        0.45,
        "clamped",
        6e-4,
        1800,
        10,
        0.0,
        {"radius_x": 600.0, "radius_y": 300.0},
    ),
    "t10-1.4-nonl": Case((70, 70), "[0/45/-45]s", I8, 0.2333, "simple", 3e-4, 2500, 8, 0.0, NONL),
    "t11-2.4-nonl-curved": Case(
        (100, 80), "[0/90]3s", A8, 0.2, "clamped", 4e-4, 2500, 8, 0.0, NONL | {"radius_x": -500.0}
    ),
}
SETS = {"fit": FIT, "test": TEST}
# Side of the elements at the load over R, and whether their numbers along x and y are odd.
MESHES = {
    "fit": [
        (0.8, 0, 0),
        *((side, odd, odd) for side in (1.1, 1.5, 2.0, 2.6, 3.3, 4.2, 5.6, 7.5, 10.0, 13.0)
          for odd in (0, 1)),
        (1.5, 0, 1),
        (2.3, 1, 0),
        (4.8, 0, 1),
        (8.0, 1, 0),
    ],
    "test": [
        (0.9, 1, 1),
        (1.3, 0, 0),
        (1.7, 1, 1),
        (2.4, 0, 0),
        (3.0, 1, 0),
        (4.5, 1, 1),
        (6.5, 0, 0),
        (9.0, 1, 1),
    ],
}  # fmt: skip
MOST = 24  # elements along a side of a uniform mesh
GRADED = 20  # elements of a graded mesh along a side
FINEST = 28
COLUMNS = ("set", "plate", "mesh", *LoadMesh._fields[:2], *LoadMesh._fields[3:])
CRITERIA = ("max_stress", "tsai_wu", "hashin", "puck", "interlaminar")


def deck(case: Case, mesh: tuple[int, int], grading: float, duration: float) -> fecm.Deck:
    """Return the deck of a case on a mesh."""
    laminate = fecm.Laminate(case.layup, case.ply, case.ply_thickness)
    if case.core:
        plies = case.layup.strip("[]").split("/")
        layup = "/".join(ply if ply == "K" else f"{ply}C" for ply in plies)
        laminate = fecm.Laminate(
            f"[{layup}]",
            {"C": case.ply, "K": "Divinycell-H60"},
            {"C": case.ply_thickness, "K": case.core},
        )
    options: dict[str, Any] = {"kinematics": "linear"} | case.options
    return fecm.impact(
        fecm.Plate.rectangle(case.size, mesh, support=case.support, grading=grading),
        laminate,
        fecm.RigidMass(case.mass),
        fecm.Contact.estimate(radius=case.ball),
        velocity=case.velocity,
        duration=duration,
        patch="disc",
        damage=True,
        plies=False,
        units="mm-N-s",
        **options,
    )


def problem_of(case: Case, mesh: tuple[int, int], grading: float = 1.0) -> Problem:
    """Return the checked problem of a case on a mesh."""
    (problem,) = load_deck(deck(case, mesh, grading, 1e-4)).problems
    return problem


def grading_of(length: float, count: int, smallest: float) -> float:
    """Return the grading of a row of elements whose smallest one, in the middle, is given."""
    if length / count <= 1.02 * smallest:
        return 1.0
    low, high = 1.0, 200.0
    for _ in range(60):
        middle = (low * high) ** 0.5
        ratio = middle ** (1.0 / max(count / 2 - 1.0, 1.0))
        is_large = length / 2.0 / sum(ratio**k for k in range(count // 2)) > smallest
        low, high = (middle, high) if is_large else (low, middle)
    return low


def meshes(case: Case, kind: str, reach: float) -> list[tuple[tuple[int, int], float]]:
    """Return elements along both sides, and grading, of all meshes of a case; the finest last."""
    chosen = []
    for side, *odd in MESHES[kind]:
        counts = []
        for length, parity in zip(case.size, odd, strict=True):
            count = max(round(length / (side * reach)), 1)
            if count % 2 != parity:
                count += 1 if length / count > side * reach else -1
            counts.append(max(count, 3 if parity else 4))
        mesh, grading = (counts[0], counts[1]), 1.0
        if max(mesh) > MOST:
            grading = grading_of(max(case.size), GRADED + odd[0], side * reach)
            mesh = GRADED + odd[0], GRADED + odd[1]
        if (mesh, grading) not in chosen:
            chosen.append((mesh, grading))
    for side in (0.75, 0.4):
        chosen.append(((FINEST, FINEST), grading_of(max(case.size), FINEST, side * reach)))
    return chosen


def duration_of(case: Case, reach: float) -> float:
    """Return 1.35 times the latest time of a largest exposure, from runs on a coarse mesh."""
    x, y = (min(14, max(6, 2 * round(length / (5.0 * reach)))) for length in case.size)
    duration = 2e-4
    while True:
        result = fecm.run_one(deck(case, (x, y), 1.0, duration))
        latest = max(row.time for row in largest_exposures(result))
        peak = float(result["history/time"][result["history/force"].argmax()])
        if max(latest, peak) < 0.6 * duration:
            return 1.35 * latest
        duration *= 1.8


def main(kind: str, *names: str) -> None:
    """Print a row of every mesh of the cases of a set."""
    print(",".join((*COLUMNS, *CRITERIA, "peak_force")))
    for name, case in SETS[kind].items():
        if names and name not in names:
            continue
        reach = problem_of(case, (4, 4)).reach_of_load
        duration = duration_of(case, reach)
        for mesh, grading in meshes(case, kind, reach):
            problem = problem_of(case, mesh, grading)
            place = problem.load_place
            assert place is not None
            families, rows = problem.mesh.families, problem.plate.rows_by_laminate
            circle = CircleStresses(families, place, reach, rows)
            at_load = load_mesh(problem, circle.elements)
            result = fecm.run_one(deck(case, mesh, grading, duration))
            largest = {row.criterion: row.exposure for row in largest_exposures(result)}
            text = f"{mesh[0]}x{mesh[1]}" + (f" graded {grading:.3g}" if grading > 1.0 else "")
            numbers = (
                at_load.coarseness,
                int(at_load.at_corner),
                at_load.bending_reach,
                at_load.anisotropy,
                *(largest[criterion] for criterion in CRITERIA),
                float(result["history/force"].max()),
            )
            print(",".join([kind, name, text, *(f"{x:.5g}" for x in numbers)]), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
