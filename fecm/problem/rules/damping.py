"""Rules about the DAMP segment."""

from __future__ import annotations

import math

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.curvature import strain_of_deflection
from fecm.problem.problem import Problem
from fecm.problem.rules.time_step import deck_time_steps, known_safe_step, takes_steps

WITHOUT_EFFECT = 0.01  # damping times the duration
WORST_RATE = 0.01  # relative error of the rate of damping


@rule(
    "E459",
    Subject.DAMAGE,
    "The damping a of DAMP is negative.",
    remedy="0 is none.",
)
def negative_damping(card: model.Damping) -> Reports:
    """Find a damping that feeds energy."""
    if not card.coefficient >= 0.0:
        message = f"The damping a is {card.coefficient:g}; it must not be negative."
        hint = "the amplitude of a free plate decays as exp(-a t/2)"
        yield Report(message, card.place("a"), hint)


@rule(
    "W460",
    Subject.DAMAGE,
    "The rate of damping is off by more than 1 %.",
    cause="Its error is (a DT)²/12.",
    remedy="The unit of time, or a smaller DT.",
)
def badly_resolved_damping(problem: Problem) -> Reports:
    """Find a damping that decays within a few steps."""
    card, safe = problem.deck.last(model.Damping), known_safe_step(problem)
    if card is None or safe is None or not takes_steps(problem):
        return
    dt = max(macro.value or safe for macro in deck_time_steps(problem))
    if (error := (card.coefficient * dt) ** 2 / 12.0) > WORST_RATE:
        why = f"its rate is off by (a DT)^2/12 = {error:.2g}"
        what = f"The damping a = {card.coefficient:g} is resolved badly by DT = {dt:.4g}"
        hint = "check the unit of time, or take a smaller DT"
        yield Report(f"{what}: {why}.", card.place("a"), hint)


def _loss_within_program(problem: Problem) -> tuple[float, float]:
    """Damping times duration, and the duration of the program."""
    dt = max((macro.value for macro in deck_time_steps(problem)), default=0.0)
    duration = problem.work.steps * (dt or problem.safe_time_step)
    return problem.damping * duration, duration


def _damping_hint(problem: Problem) -> str:
    one = f"a = 2 zeta omega, about {0.02 * clamped_frequency(problem):.2g} for zeta = 1 %"
    return f"a is in 1/time: {one} of the lowest mode"


@rule(
    "W479",
    Subject.DAMAGE,
    "DAMP is without effect.",
    cause="a times the simulated time is below 0.01.",
    remedy="a in 1/time, 2 ζ ω for the damping ratio ζ of a mode.",
)
def damping_without_effect(problem: Problem) -> Reports:
    """Find a damping that takes nothing off the amplitudes."""
    if (card := problem.deck.last(model.Damping)) is None:
        return
    a = card.coefficient
    loss, duration = _loss_within_program(problem)
    if 0.0 < loss < WITHOUT_EFFECT:
        message = (
            f"The damping a = {a:g} takes only {-100.0 * math.expm1(-loss / 2.0):.2g} "
            f"% off the amplitudes within the program's {duration:.3g}"
        )
        likeness = ": it looks like a damping ratio" if a < 1.0 else ""
        yield Report(f"{message}{likeness}.", card.place("a"), _damping_hint(problem))


@rule(
    "W480",
    Subject.DAMAGE,
    "DAMP is so large that no low mode oscillates.",
    cause="a/2 is above the lowest natural frequency with clamped edges.",
    remedy="a in 1/time, 2 ζ ω.",
)
def overdamped(problem: Problem) -> Reports:
    """Find a damping that lets nothing oscillate."""
    if (card := problem.deck.last(model.Damping)) is None:
        return
    lowest = clamped_frequency(problem)
    if card.coefficient / 2.0 > lowest:
        message = (
            f"The damping a = {card.coefficient:g} lets no low mode oscillate: a/2 is above "
            f"{lowest:.3g}, the lowest natural frequency with clamped edges (radians over time)."
        )
        yield Report(message, card.place("a"), _damping_hint(problem))


def clamped_frequency(problem: Problem) -> float:
    """Lowest natural frequency of a clamped rectangle of the plate's size, radians over time.

    Rayleigh's quotient of products of the modes of clamped beams, whose integrals are 22.373^2
    and 12.303^2; thin plate theory, without the coupling D16, D26.  With the preload, and with the
    curvature, where u and v are held.
    """
    D = problem.laminate.D
    stretch = strain_of_deflection(problem.plate.curvature)
    curved = float(stretch @ problem.laminate.A @ stretch)
    a, b = np.ptp(problem.mesh.coordinates[problem.mesh.used], axis=0).tolist()
    along, across = 22.373**2 * D[0, 0] / a**4, 22.373**2 * D[1, 1] / b**4
    twist = 2.0 * 12.303**2 * (D[0, 1] + 2.0 * D[2, 2]) / (a * b) ** 2
    n_x, n_y, _ = problem.plate.preload
    preload = 12.303 * (n_x / a**2 + n_y / b**2)
    return math.sqrt(max(0.0, along + across + twist + preload + curved) / problem.laminate.mass)


OF_DAMPING = (negative_damping,)
OF_TIME_STEP = (badly_resolved_damping,)
# One of these is enough.
VALUES = (damping_without_effect, overdamped)
