"""Kinematics of a new deck: a linear plate, or one that stretches as it bends (von Kármán)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal, NamedTuple

from fecm.api import load_deck
from fecm.authoring.parameters import ObjectError
from fecm.deck import model
from fecm.deck.macros import Macro
from fecm.problem.parts import has_assumed_shear
from fecm.problem.static_plate import static_deflection
from fecm.results.linear_plate import IN_PLANE_WORDS, LIMITS, InPlane

Kinematics = Literal["auto", "linear", "von-karman"]
AUTO: Kinematics = "auto"  # von Kármán where the static estimate of the deflection asks for it
LINEAR: Kinematics = "linear"
VON_KARMAN: Kinematics = "von-karman"

LIMIT = LIMITS[InPlane.UNKNOWN]  # deflection over the thickness from which `auto` is von Kármán
MOST_ELEMENTS = 20_000  # of a mesh whose static deflection is computed: seconds beyond
# A program of one short step, for checks before the time step is chosen.
BRIEF = (
    Macro("LMAS"),
    Macro("DT", value=1e-9),
    Macro("LOOP", value=1.0),
    Macro("TIME"),
    Macro("RODP", value=1.0),
    Macro("NEXT"),
)


class Formed(NamedTuple):
    """A deck with its supports, without a program."""

    deck: model.Deck
    comment: str  # comment lines about a window
    notes: list[str]


def kinematics_of(kinematics: Kinematics | None, nonlinear: bool | None) -> Kinematics:
    """Kinematics of both names; ObjectError if they contradict each other."""
    if nonlinear is None:
        return kinematics or AUTO
    named = VON_KARMAN if nonlinear else LINEAR
    if kinematics in (None, named):
        return named
    raise ObjectError(f"`kinematics` is {kinematics}, and `nonlinear` means {named}: give one")


def with_kinematics(asked: Kinematics, form: Callable[[bool], Formed]) -> Formed:
    """The deck of the kinematics that are asked for, or that the static deflection needs.

    `form` forms the deck of a nonlinear plate, or of a linear one.
    """
    if asked == VON_KARMAN:
        formed = form(True)
        if not has_assumed_shear(formed.deck):
            raise ObjectError(
                f"`kinematics` {VON_KARMAN} needs assumed shear strains: `shear` mitc"
            )
        return formed
    linear = form(False)
    if asked == LINEAR:
        return linear
    if linear.deck.control.numel > MOST_ELEMENTS:
        return _noted(
            linear,
            f"the plate is linear: its static deflection is computed up to {MOST_ELEMENTS} "
            "elements only; `kinematics` von-karman adds the stretching (NONL)",
        )
    ratio = _deflection(linear.deck)
    if not ratio > LIMIT:
        return linear
    estimate = f"the static estimate of the deflection is {ratio:.2g} h, beyond {LIMIT:g} h"
    nonlinear = form(True)
    loaded = load_deck(replace(nonlinear.deck, macros=BRIEF))
    if errors := loaded.errors():
        reason = errors[0].message.rstrip(".")
        return _noted(linear, f"{estimate}, but the plate stays linear, too soft there: {reason}")
    (problem,) = loaded.problems
    edges = IN_PLANE_WORDS.get(problem.judge.in_plane, "u and v held at every node")
    return _noted(
        nonlinear,
        f"{estimate}: the plate stretches as it bends (NONL), {edges}; `kinematics` linear leaves "
        "it out",
    )


def _noted(formed: Formed, note: str) -> Formed:
    return formed._replace(notes=[*formed.notes, note])


def _deflection(deck: model.Deck) -> float:
    """Static estimate of the largest deflection over the thickness; 0 of a deck with errors."""
    loaded = load_deck(replace(deck, macros=BRIEF))
    if loaded.errors():  # the deck is refused later
        return 0.0
    (problem,) = loaded.problems
    return static_deflection(problem) / problem.judge.thickness
