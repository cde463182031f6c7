"""Rules about SPRI, UNIL and MASS: springs, one-sided supports and point masses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, declare, rule
from fecm.mechanics.interpolation import W
from fecm.mechanics.solutions import (
    ConvergenceError,
    SingularStiffnessError,
    StaticResponse,
    static_response,
)
from fecm.mechanics.time_step import safe_time_step
from fecm.problem.estimates import MOST_SOLVED
from fecm.problem.generate import node_values
from fecm.problem.problem import Problem
from fecm.problem.support_summary import flexibility_gain
from fecm.problem.supports import (
    NoLineError,
    default_stiffness,
    line_weights,
    one_sided_rows,
)

LARGEST_GAP = 0.5  # of the thickness, beyond which a gap is doubted
LARGEST_GAIN = 0.005  # of flexibility by the stiffness of the supports
STEP_BEYOND = 1.02  # factor on the stiffness that would leave it if the reactions stayed the same
MOST_STIFFENED = 5  # static solutions for that stiffness; one or two are usual
LARGEST_SHARE = 1.0  # of the stiffness 4 m/dt^2 that the time step allows the plate alone

declare(
    "E570",
    Subject.MESH,
    "The second word after SPRI or UNIL is not LINE.",
    remedy="LINE, or no second word.",
)


def _segments(deck: model.Deck) -> Iterator[model.Springs | model.OneSidedSupports]:
    yield from deck.all(model.Springs)
    yield from deck.all(model.OneSidedSupports)


@rule("E571", Subject.MESH)
def negative_support(deck: model.Deck) -> Reports:
    """A stiffness, gap, mass or rotary inertia is negative.

    Remedy: Stiffnesses, gaps and masses of 0 or more.
    """
    for springs in deck.all(model.Springs):
        for card in springs.records:
            if not min(card.values) >= 0.0:
                yield Report(f"A stiffness of node {card.node} is negative.", card.place())
    for supports in deck.all(model.OneSidedSupports):
        for support in supports.records:
            for name, value in (("stiffness", support.stiffness), ("gap", support.gap)):
                if not value >= 0.0:
                    message = f"The {name} of node {support.node} is negative."
                    yield Report(message, support.place(name))
    for masses in deck.all(model.PointMasses):
        for card in masses.records:
            if not min(card.values) >= 0.0:
                yield Report(f"A mass of node {card.node} is negative.", card.place())


@rule("E572", Subject.MESH)
def unknown_side(deck: model.Deck) -> Reports:
    """The side of a one-sided support is not 1 or -1.

    1 is a support under the plate, on the face away from the projectile; -1 holds the struck face.

    Remedy: 1, -1, or a blank, which is 1.
    """
    for segment in deck.all(model.OneSidedSupports):
        for card in segment.records:
            if card.side not in (-1, 0, 1):
                message = f"The side of node {card.node} is {card.side}; it is 1 or -1."
                hint = "1 is under the plate, -1 on the struck face; a blank is 1"
                yield Report(message, card.place("side"), hint)


@rule("E573", Subject.MESH)
def line_off_sides(problem: Problem) -> Reports:
    """Element sides do not cover a line of SPRI LINE or UNIL LINE.

    Remedy: Nodes at the ends of a straight chain of element sides; single nodes for a curved edge.
    """
    numnp = problem.deck.control.numnp
    for segment in _segments(problem.deck):
        for card in segment.records if segment.is_of_lines else ():
            outside = [n for n in (card.node, card.increment) if not 1 <= n <= numnp]
            if outside:
                message = f"Node {outside[0]} does not exist; the nodes are 1 to {numnp}."
                yield Report(message, card.place())
                continue
            try:
                line_weights(problem.mesh, card.node, card.increment)
            except NoLineError as error:
                text = str(error)
                hint = "a line is a straight chain of element sides; give a curved edge by nodes"
                yield Report(f"{text[0].upper()}{text[1:]}.", card.place(), hint)


@rule("E574", Subject.MESH)
def support_of_restrained_w(problem: Problem) -> Reports:
    """A one-sided support is at a node whose w is restrained.

    Remedy: Remove the restraint of w from BOUN: it pulls as well.
    """
    held = problem.mesh.codes[:, W] != 0
    rows = [row.node for row in one_sided_rows(problem.deck, problem.mesh) if held[row.node]]
    if rows:
        more = f" (and {len(rows) - 1} more)" if len(rows) > 1 else ""
        message = f"w of node {rows[0] + 1}{more} is restrained, and has a one-sided support."
        segment = problem.deck.require(model.OneSidedSupports)
        hint = "remove the restraint of w: it holds the plate in both directions"
        yield Report(message, segment.place(), hint)


@rule("W575", Subject.MESH)
def spring_of_restrained_dof(problem: Problem) -> Reports:
    """A spring is at a restrained unknown, where it is without effect.

    A line may have restrained nodes, as at the corner of two edges, but not only such nodes.

    Remedy: Remove the restraint from BOUN, or the spring.
    """
    held = problem.mesh.codes != 0
    for segment in problem.deck.all(model.Springs):
        if segment.is_of_lines:
            for card in segment.records:
                nodes, _ = line_weights(problem.mesh, card.node, card.increment)
                if (held[nodes].all(axis=0) & (np.array(card.values) > 0.0)).any():
                    ends = f"from node {card.node} to {card.increment}"
                    message = f"A spring {ends} is at a restrained unknown: no effect."
                    yield Report(message, card.place())
            continue
        springs = node_values(segment.records, held.shape)
        rows = np.flatnonzero(((springs > 0.0) & held).any(axis=1))
        if len(rows):
            more = f" (and {len(rows) - 1} more)" if len(rows) > 1 else ""
            message = f"A spring of node {rows[0] + 1}{more} is at a restrained unknown: no effect."
            yield Report(message, segment.place())


@rule("W576", Subject.MESH)
def large_gap(problem: Problem) -> Reports:
    """The gap of a one-sided support is more than half the thickness.

    Remedy: The unit of length; a plate that lies on its support has no gap.
    """
    for segment in problem.deck.all(model.OneSidedSupports):
        for card in segment.records:
            if card.gap > LARGEST_GAP * problem.laminate.thickness:
                share = card.gap / problem.laminate.thickness
                message = f"The gap {card.gap:g} of node {card.node} is {share:.3g} h."
                hint = "the gap is a length in the deck's unit; a blank is 0"
                yield Report(message, card.place("gap"), hint)


@rule("W577", Subject.MESH)
def supports_decide_step(problem: Problem) -> Reports:
    """The stiffness of a support shortens the time step by more than a quarter.

    Remedy: A smaller stiffness. A blank stiffness of UNIL is chosen so that it shortens the step by
    at most 2.4 %.
    """
    plate = problem.moving_plate
    if plate.supports is None:
        return
    alone = safe_time_step(replace(plate, supports=None))
    share = (alone / problem.safe_time_step) ** 2 - 1.0
    if share > LARGEST_SHARE:
        message = f"The supports are {share:.3g} times as stiff as the time step allows the plate."
        hint = "a blank stiffness of UNIL is rigid enough, and takes 0.05 of it"
        yield Report(message, next(_segments(problem.deck)).place(), hint)


def _settled(problem: Problem) -> StaticResponse | None:
    """Return the static response of a plate on one-sided supports; None if it finds no rest."""
    try:
        return problem.static
    except ConvergenceError:
        return None


def _is_solved(problem: Problem) -> bool:
    """Return whether the checks solve a plate on one-sided supports."""
    few = problem.deck.control.numel <= MOST_SOLVED
    return few and problem.contact is not None and problem.moving_plate.lifts


@rule("W578", Subject.MESH)
def soft_supports(problem: Problem) -> Reports:
    """The stiffness of the one-sided supports softens the plate by more than 0.5 %.

    Remedy: A larger stiffness, or none: the default is rigid enough except on coarse meshes.
    """
    gain = flexibility_gain(problem)
    if gain is not None and gain > LARGEST_GAIN:
        message = f"The supports are soft: they make the plate {gain:.2%} more flexible."
        segment = problem.deck.require(model.OneSidedSupports)
        per_length = " per length" if segment.is_of_lines else ""
        hint = "give them a larger stiffness"
        if (factor := _stiffer(problem, gain)) is not None:
            enough = factor * _card_stiffness(problem, segment)
            hint = f"a stiffness of {enough:.3g}{per_length} leaves {LARGEST_GAIN:.1%}"
        yield Report(message, segment.place(), hint)


def _stiffer(problem: Problem, gain: float) -> float | None:
    """Return the factor on the stiffness of one-sided supports that leaves LARGEST_GAIN.

    Returns None where none does: under a load on a support, which bends the plate little.
    """
    plate, contact, factor = problem.moving_plate, problem.contact, 1.0
    assert plate.supports is not None
    assert contact is not None
    supports = plate.supports
    for _ in range(MOST_STIFFENED):
        if gain >= 1.0:
            break
        factor *= STEP_BEYOND * gain / (1.0 - gain) / LARGEST_GAIN
        stiffness = np.where(supports.is_one_sided, factor, 1.0) * supports.stiffness
        stiffer = replace(plate, supports=replace(supports, stiffness=stiffness))
        try:
            gain = static_response(stiffer, contact).gain
        except (ConvergenceError, SingularStiffnessError):
            break
        if gain <= LARGEST_GAIN:
            return factor
    return None


def _card_stiffness(problem: Problem, segment: model.OneSidedSupports) -> float:
    """Return the stiffness of the first card of UNIL; the default one of a blank."""
    card = segment.records[0]
    if card.stiffness:
        return card.stiffness
    plate = replace(problem.moving_plate, supports=None)
    default = default_stiffness(plate, safe_time_step(plate))
    if not segment.is_of_lines:
        return float(default[card.node - 1])
    nodes, weights = line_weights(problem.mesh, card.node, card.increment)
    return float(np.median(default[nodes] / weights))


@rule("E579", Subject.MESH)
def tips_off(problem: Problem) -> Reports:
    """A static load at the impact point tips the plate off its one-sided supports.

    The supports that it closes do not hold the plate.

    Remedy: Supports around the impact point, or clamps (`SPRI`, or `UNIL` with the side -1).
    """
    if _is_solved(problem) and _settled(problem) is None:
        message = "A static load at the impact point tips the plate off its one-sided supports."
        hint = "support the plate around the impact point, or clamp it (SPRI)"
        yield Report(message, problem.deck.require(model.OneSidedSupports).place(), hint)


KINDS: tuple[type[model.Segment], ...] = (
    model.Springs,
    model.OneSidedSupports,
    model.PointMasses,
)
OF_CARDS = (negative_support, unknown_side)
OF_LINES = (line_off_sides,)
OF_NODES = (support_of_restrained_w, spring_of_restrained_dof)
OF_STEP = (supports_decide_step,)
VALUES = (large_gap, soft_supports, tips_off)
