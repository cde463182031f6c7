"""Failure exposures, delamination thresholds and quick impact models against closed forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from fecm.api import load_deck
from fecm.deck.catalogue import MATERIALS
from fecm.deck.grid import Grid, refined
from fecm.deck.model import Deck, Impact, Indentation, Patch, Projectile
from fecm.mechanics.delamination import effective_rigidity, threshold_force
from fecm.mechanics.laminate import laminate
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.build import build_plate
from fecm.problem.generate import generate
from fecm.studies.estimate import static_stiffness
from fecm.studies.quick_models import infinite_plate, static_plate
from fecm.verification.case import Check, case
from fecm.verification.decks import deck, impact_program, isotropic, material, result_of
from fecm.verification.patches import MITC
from fecm.verification.plies import bent

# Simply supported square of 0.256 kg under an elastic law (m, N, s).
SIDE, H, E, NU, RHO, K = 0.2, 0.004, 240e9, 0.3, 1600.0, 8.2641942e9
# Radius of the patch, elements along a side before refinement, largest over smallest element.
RADIUS, ALONG, GRADING = 0.002, 12, 4.0


def struck_square(mass: float, end: float) -> Deck:
    """Build the square, hit in the middle by a rigid mass at 1 m/s, until a time."""
    sections = refined(SIDE, ALONG, SIDE / 2.0, GRADING, RADIUS)
    grid = Grid(sections, sections)
    ends, sides = (1, 1, 1, 0, 1), (1, 1, 1, 1, 0)
    edges = {"left": ends, "right": ends, "bottom": sides, "top": sides}
    middle = grid.nearest(SIDE / 2.0, SIDE / 2.0)[0]
    segments = (
        grid.coordinates(), grid.boundary((1, 1, 0, 0, 0), edges), Projectile(0, 0, mass),
        Impact(middle, 3, 1.0), Patch("DISC", RADIUS), Indentation(K, 1.0, 0.0, 1.5), MITC,
        material(isotropic(E, NU, RHO), [0.0], H),
    )  # fmt: skip
    made = deck("simply supported square", grid, segments, ())
    dt = rounded_time_step(critical_time_step(build_plate(made, generate(made))))
    return replace(made, macros=impact_program(dt, round(end / dt)))


NAVIER = "Navier's solution, first-order theory, and the criterion"
POINTS = "16 × 16 elements; the point nearest to the middle of the plate"


@case(
    "failure",
    "load at the first failure of [0/90/90/0] of T300/5208, a/h = 100, sinusoidal load",
    Check("maximum stress (Pa)", 112476.37, NAVIER, 3e-3, POINTS),
    Check("Tsai and Wu (Pa)", 113643.23, NAVIER, 3e-3, POINTS),
)
def failure() -> Sequence[float]:
    """Reciprocals of the largest exposures under a load of 1 Pa."""
    named = MATERIALS["T300/5208"]
    strengths = named.allowables("m-N-s")
    assert strengths is not None
    found = bent(named.ply, (0.0, 90.0, 90.0, 0.0), 0.01, "FAIL", strengths)
    return [1.0 / found[f"failure/{name}/exposure"].max() for name in ("max_stress", "tsai_wu")]


DAVIES = math.sqrt(8.0 * math.pi**2 * 60e3 * 2.0**3 * 0.8 / (9.0 * (1.0 - 0.3**2)))
HALF = tuple((0.0, 45.0, 0.0, -45.0, 0.0) * 2)


@case(
    "threshold",
    "delamination threshold",
    Check("isotropic plate (N)", DAVIES, "Davies and Robinson 1992", 1e-9, "rounding"),
    Check("the report's laminate, 2.9 lb/in (lb)", 432.47767, "Olsson 1992", 1e-7, "digits"),
)
def threshold() -> Sequence[float]:
    """Threshold forces of one delamination."""
    plates = (
        laminate(isotropic(60e3, NU, 1.0), [0.0], [2.0]),
        laminate(MATERIALS["report"].ply, [*HALF, *HALF[::-1]], [0.0053] * 20),
    )
    toughnesses = (0.8, 2.9)
    return [
        threshold_force(effective_rigidity(plate), toughness)
        for plate, toughness in zip(plates, toughnesses, strict=True)
    ]


@case(
    "small-mass",
    "rigid mass on an infinite plate, and on a square of 20 times its mass before waves return",
    Check("F T/(M V), λ = 1", 0.556160867, "Zener 1941", 1e-7, "digits"),
    Check("t_peak/T, λ = 1", 1.32127704, "Zener 1941", 1e-7, "digits"),
    Check("largest force of the run (N)", 401.0963, "modal series, thin plate under a point force",
          2e-2, "disc of h/2 and shear"),
)  # fmt: skip
def small_mass() -> Sequence[float]:
    """Peak and time of the dashpot model, peak of a run."""
    model = infinite_plate(1.0, 1.0, 1.0, 1.0)
    return [model.peak, model.time, result_of(struck_square(0.0128, 3e-5)).force.max()]


# Timoshenko and Woinowsky-Krieger, equation 147: w D/(F a²) of a simply supported square.
STIFFNESS = E * H**3 / (12.0 * (1.0 - NU**2)) / (0.0116008395 * SIDE**2)


@case(
    "large-mass",
    "rigid mass on the static stiffness of the same square, elastic contact",
    Check("stiffness (N/m)", STIFFNESS, "Levy's series, thin plate under a point force", 2e-2,
          "disc of h/2 and shear"),
    Check("largest force (N)", 7057.35, "equation of motion of a mass on two springs", 1e-4,
          "the plate's spring has no mass"),
)  # fmt: skip
def large_mass() -> Sequence[float]:
    """Static stiffness of the struck square, and peak of the energy balance."""
    (problem,) = load_deck(struck_square(1.0, 1e-6).to_text()).problems
    assert problem.contact is not None
    stiffness = static_stiffness(problem.moving_plate, problem.contact)
    return [stiffness, static_plate(5.5, 2.0, 1e9, 2.5e6).peak]


CASES = (failure, threshold, small_mass, large_mass)
