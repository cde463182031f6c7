"""Rules about the time step and the damping of the program."""

from __future__ import annotations

import math
import sys

import numpy as np

from fecm.deck import model
from fecm.deck.macros import STEPS
from fecm.deck.model import Macro
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.strains import strain_of_deflection
from fecm.problem.problem import Problem

# Fraction of the critical time step below which rounding loses the change of a step.  The change is
# proportional to the square of the step.
LEAST_STEP = math.sqrt(sys.float_info.epsilon)
WASTEFUL = 0.01  # time step over the stable one
UNSTABLE = "E508"


def deck_time_steps(problem: Problem) -> list[Macro]:
    """Return the DT cards of a program."""
    return [macro for macro in problem.deck.macros if macro.word == "DT"]


def takes_steps(problem: Problem) -> bool:
    """Return whether a program takes time steps of a given length."""
    words = {macro.word for macro in problem.deck.macros}
    return "DT" in words and not STEPS.isdisjoint(words)


def known_safe_step(problem: Problem) -> float | None:
    """Return a lower bound of the critical time step; None where E417 reports its absence."""
    try:
        return problem.safe_time_step
    except UnsoundPlateError:
        return None


def _needs_critical_step(problem: Problem) -> bool:
    """Return whether the bound does not show that every DT is stable."""
    safe, values = problem.safe_time_step, [macro.value for macro in deck_time_steps(problem)]
    return min(values) == 0.0 or max(values) >= safe


@rule("E417", Subject.IMPACT)
def no_critical_step(problem: Problem) -> Reports:
    """The plate has no critical time step.

    Numbers are out of range.

    Remedy: Check the units of constants, thickness and coordinates.
    """
    try:
        if _needs_critical_step(problem):
            _ = problem.critical_time_step
    except UnsoundPlateError as error:
        message = f"The plate has no critical time step: {error}."
        hint = "check the units of the ply's constants, the thickness and the coordinates"
        yield Report(message, problem.deck.require(model.Material).place(), hint)


@rule("E515", Subject.PROGRAM)
def step_lost_by_rounding(problem: Problem) -> Reports:
    """DT is so small that rounding loses the motion.

    Remedy: The unit of time; `DT 0` takes 0.9 of the critical step.
    """
    if (safe := known_safe_step(problem)) is None:
        return
    for macro in deck_time_steps(problem):
        if 0.0 < macro.value < LEAST_STEP * safe:
            what = f"DT = {macro.value:.4g} is so far below the plate's critical time step"
            message = f"{what} (about {safe:.4g}) that the motion is lost by rounding."
            hint = "check the unit of time; DT without a number takes 0.9 of the critical step"
            yield Report(message, macro.place("value"), hint)


@rule(UNSTABLE, Subject.PROGRAM)
def unstable_step(problem: Problem) -> Reports:
    """DT is not below the critical time step.

    The motion would grow without bound.

    Remedy: A smaller DT, or `DT 0`. `--force` runs it.
    """
    if not _needs_critical_step(problem):
        return
    critical = problem.critical_time_step
    for macro in deck_time_steps(problem):
        if macro.value >= critical:
            what = f"DT = {macro.value:.4g} is not below the plate's critical time step"
            message = f"{what} {critical:.4g}: the motion would grow without bound."
            hint = f"take {0.95 * critical:.2g} or less; --force runs the deck nevertheless"
            yield Report(message, macro.place("value"), hint)


@rule("W517", Subject.PROGRAM)
def unstable_contact(problem: Problem) -> Reports:
    """DT is not below the stable step with the contact's stiffness.

    The plate moves explicitly under the contact force of the last step, so that the contact acts on
    it as a spring. The contact may diverge.

    Remedy: Check k and the masses, or a smaller DT.
    """
    contact = problem.contact_step
    if contact is None:
        return
    for macro in deck_time_steps(problem):
        dt = macro.value or SAFE * problem.safe_time_step
        if dt >= contact.limit:
            message = (
                f"DT = {dt:.3g} is not below {contact.limit:.3g}, the stable "
                f"step with the contact's stiffness of about {contact.stiffness:.3g} on a mass "
                f"of {contact.mass:.3g}: the contact may diverge."
            )
            hint = f"check k and the masses, or take a DT of {0.9 * contact.limit:.2g}"
            yield Report(message, macro.place("value"), hint)


@rule("W516", Subject.PROGRAM)
def wasteful_step(problem: Problem) -> Reports:
    """DT is below 1/100 of the stable step.

    Remedy: The unit of time.
    """
    contact, bound = problem.contact_step, problem.safe_time_step
    stable = bound if contact is None else min(bound, contact.limit)
    for macro in deck_time_steps(problem):
        dt = macro.value
        if 0.0 < dt < WASTEFUL * stable:
            message = f"DT = {dt:.3g} is only {dt / stable:.2g} of the stable step {stable:.3g}."
            yield Report(message, macro.place("value"), "DT is in the deck's unit of time")


OF_ROUNDING = (step_lost_by_rounding,)
# Without a critical step, none can be compared with it.
OF_PLATE = (no_critical_step, unstable_step)
OF_CONTACT = (unstable_contact, wasteful_step)


WITHOUT_EFFECT = 0.01  # damping times the duration
# Damping ratio of the lowest mode below which a looks like a ratio; plates of metal have 5e-4.
LEAST_DAMPING_RATIO = 2e-4
PER_CENT = 10.0  # largest damping ratio in per cent
WORST_RATE = 0.01  # relative error of the rate of damping


@rule("E459", Subject.DAMAGE)
def negative_damping(card: model.Damping) -> Reports:
    """The damping a of DAMP is negative.

    Remedy: 0 means no damping.
    """
    if not card.coefficient >= 0.0:
        message = f"The damping a is {card.coefficient:g}; it must not be negative."
        hint = "the amplitude of a free plate decays as exp(-a t/2)"
        yield Report(message, card.place("a"), hint)


@rule("W460", Subject.DAMAGE)
def badly_resolved_damping(problem: Problem, card: model.Damping) -> Reports:
    """The rate of damping is off by more than 1 %.

    Its error is (a DT)²/12.

    Remedy: The unit of time, or a smaller DT.
    """
    if (safe := known_safe_step(problem)) is None:
        return
    dt = max(macro.value or safe for macro in deck_time_steps(problem))
    if (error := (card.coefficient * dt) ** 2 / 12.0) > WORST_RATE:
        why = f"its rate is off by (a DT)^2/12 = {error:.2g}"
        what = f"The damping a = {card.coefficient:g} is resolved badly by DT = {dt:.4g}"
        hint = "check the unit of time, or take a smaller DT"
        yield Report(f"{what}: {why}.", card.place("a"), hint)


def _loss_within_program(problem: Problem) -> tuple[float, float]:
    """Return damping times duration, and the duration of the program."""
    dt = max((macro.value for macro in deck_time_steps(problem)), default=0.0)
    duration = problem.work.steps * (dt or problem.safe_time_step)
    return problem.damping * duration, duration


def _damping_hint(problem: Problem) -> str:
    example = f"a = 2 zeta omega, about {0.02 * clamped_frequency(problem):.2g} for zeta = 1 %"
    return f"a is in 1/time: {example} of the lowest mode"


@rule("W479", Subject.DAMAGE)
def damping_without_effect(problem: Problem, card: model.Damping) -> Reports:
    """DAMP is without effect.

    a times the simulated time is below 0.01, or a of at most 10 is below 2·10⁻⁴ of critical
    damping in the lowest mode.

    Remedy: a in 1/time, 2 ζ ω for the damping ratio ζ of a mode.
    """
    a = card.coefficient
    loss, duration = _loss_within_program(problem)
    if 0.0 < loss < WITHOUT_EFFECT:
        message = (
            f"The damping a = {a:g} takes only {-100.0 * math.expm1(-loss / 2.0):.2g} "
            f"% off the amplitudes within the program's {duration:.3g}"
        )
        likeness = ": it looks like a damping ratio" if a < 1.0 else ""
        yield Report(f"{message}{likeness}.", card.place("a"), _damping_hint(problem))
        return
    ratio = a / (2.0 * clamped_frequency(problem))
    if a <= PER_CENT and 0.0 < ratio < LEAST_DAMPING_RATIO:
        message = (
            f"The damping a = {a:g} is a damping ratio of {ratio:.2g} in the lowest mode: it looks "
            "like a damping ratio in per cent."
        )
        yield Report(message, card.place("a"), _damping_hint(problem))


@rule("W480", Subject.DAMAGE)
def overdamped(problem: Problem, card: model.Damping) -> Reports:
    """DAMP is so large that no low mode oscillates.

    a/2 is above the lowest natural frequency with clamped edges.

    Remedy: a in 1/time, 2 ζ ω.
    """
    lowest = clamped_frequency(problem)
    if card.coefficient / 2.0 > lowest:
        message = (
            f"The damping a = {card.coefficient:g} lets no low mode oscillate: a/2 is above "
            f"{lowest:.3g}, the lowest natural frequency with clamped edges (radians over time)."
        )
        yield Report(message, card.place("a"), _damping_hint(problem))


def clamped_frequency(problem: Problem) -> float:
    """Return the lowest natural frequency of a clamped plate of the same size, radians over time.

    It is Rayleigh's quotient of products of the modes of clamped beams, whose integrals are
    22.373^2 and 12.303^2, in thin plate theory without the coupling D16, D26.  The preload counts,
    and so does the curvature, where u and v are held.
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
OF_RESOLUTION = (badly_resolved_damping,)
# One of these is enough.
VALUES_OF_DAMPING = (damping_without_effect, overdamped)
