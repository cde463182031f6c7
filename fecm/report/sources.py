"""What the model of a run assumes, in words, and where its constants come from."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from operator import attrgetter

from fecm._table import Row
from fecm.deck import model
from fecm.deck.catalogue import CONTACTS, NamedPly, named_ply, system_of
from fecm.deck.units import prefixed, unit_names, unit_of
from fecm.mechanics.points import RADIUS_PER_THICKNESS
from fecm.problem.parts import build_projectile
from fecm.problem.problem import Problem
from fecm.results.result import Result
from fecm.results.schema import COMMENTS

COMMAND = "! fecm new "  # begins the comment of a deck with the command that wrote it
MESH = tuple(kind.keyword for kind in (model.Coordinates, model.Elements, model.Boundary))
SENTENCE_END = r"(?<=\.)\s+(?=[A-Z]|k of)"
CONTINUED = "!   "
DECK = "numbers of the deck, which names no source"
STRENGTHS = attrgetter("xt", "xc", "yt", "yc", "s12", "s13", "s23")
TOUGHNESS = attrgetter("toughness")
PRESSURES = {"DISC": "uniform pressure", "HERT": "Hertz's pressure"}


def _written(result: Result) -> tuple[str, list[str]]:
    """Return the command in the comments of a deck, and the other comments; both may be empty."""
    command: list[str] = []
    others: list[str] = []
    for line in str(result.attributes.get(COMMENTS, "")).split("\n"):
        is_command = line.startswith(COMMAND)
        if is_command or (command and not others and line.startswith(CONTINUED)):
            command.append(line.removeprefix("!").strip())
        else:
            others.append(line.removeprefix("!").strip())
    return "\n  ".join(command), others


def command_of(result: Result) -> str:
    """Return the command that wrote the deck of a result; empty if the deck does not have it."""
    return _written(result)[0]


def comments(result: Result) -> list[str]:
    """Return the sentences of the comments above the title of a deck, without its command."""
    text = " ".join(_written(result)[1])
    return [sentence for sentence in re.split(SENTENCE_END, text) if sentence]


def short_deck(deck_text: str) -> str:
    """Return a deck without the cards of nodes, elements and restraints.

    Comments say how many are left out.
    """
    kept: list[str] = []
    left_out = 0
    is_long = False
    for line in deck_text.split("\n"):
        if is_long and line.strip() and not line.startswith("!"):
            left_out += 1
            continue
        if left_out:
            kept.append(f"! {left_out} cards, which --full-deck shows")
            left_out = 0
        is_long = line[:4] in MESH or (is_long and line.startswith("!"))
        kept.append(line)
    return "\n".join(kept)


def assumptions(result: Result, problem: Problem) -> Iterator[str]:
    """Yield what the model assumes: the comments of the deck, and what its cards imply."""
    deck = problem.deck
    yield from comments(result)
    if problem.plate.nonlinear:
        yield "The plate stretches as it bends: von Kármán's strains, for moderate rotations."
    else:
        yield "The plate is linear: it does not stretch as it bends."
    yield "Plies are linear elastic and do not depend on the rate; nothing softens after a failure."
    if deck.last(model.Cure) is None:
        yield "Plies are free of stress before the impact."
    if deck.has(model.Impact):
        yield from _impact(result, problem)


def _impact(result: Result, problem: Problem) -> Iterator[str]:
    """Yield what the model assumes of projectile and contact."""
    deck = problem.deck
    projectile = result.attributes.get("projectile") or build_projectile(deck).kind
    lossless = "without gravity, friction and damping"
    if deck.has(model.Damping):
        lossless = "without gravity and friction"
    yield f"The projectile is a {projectile}; it hits at a right angle, {lossless}."
    if (patch := deck.last(model.Patch)) is None:
        yield "The contact force acts at a point."
        return
    h = problem.laminate.thickness
    radius = patch.radius or RADIUS_PER_THICKNESS[patch.shape] * h
    shown = prefixed(radius, unit_of("length", unit_names(deck)))
    yield f"The contact force acts as {PRESSURES[patch.shape]} on a fixed radius of {shown}."


def sources(result: Result, problem: Problem) -> Iterator[Row]:
    """Yield each group of constants with its source."""
    deck = problem.deck
    system = system_of(deck)
    plies = {number: named_ply(ply, system) for number, ply in sorted(deck.plies.items())}
    for number, named in plies.items():
        yield _numbered("ply constants (MATE)", number, plies), _publication(named)
    if (allowables := deck.last(model.Allowables)) is not None:
        for card in (allowables, *allowables.others):
            ply = plies.get(card.material)
            named = _equal(
                {} if ply is None else {ply: ply.allowables(str(system))}, card, STRENGTHS
            )
            yield _numbered("ply strengths (ALLO)", card.material, plies), _publication(named)
    if (tough := deck.last(model.Delamination)) is not None:
        toughnesses = {ply: ply.delamination(str(system)) for ply in filter(None, plies.values())}
        yield "toughness (DELA)", _publication(_equal(toughnesses, tough, TOUGHNESS))
    if (law := deck.last(model.Indentation)) is not None:
        yield "contact law (EXPE)", _of_law(result, law, system)


def _numbered(name: str, number: int, plies: Mapping[int, object]) -> str:
    """Return a name, with the number of the material if there are several."""
    return f"{name} of material {number}" if len(plies) > 1 else name


def _equal(
    listed: Mapping[NamedPly, object], card: object, numbers: Callable[[object], object]
) -> NamedPly | None:
    """Return the named ply that lists the numbers of a card, if there is one."""
    return next(
        (ply for ply, of_ply in listed.items() if of_ply and numbers(of_ply) == numbers(card)), None
    )


def _publication(named: NamedPly | None) -> str:
    """Return the source of a named ply; else the deck."""
    if named is None:
        return DECK
    return "; ".join(filter(None, [f"{named.name}: {named.source}", named.assumed]))


def _of_law(result: Result, law: model.Indentation, system: str | None) -> str:
    """Return the source of a contact law."""
    if user_law := result.attributes.get("law"):
        return f"the law {user_law} of the caller"
    for contact in CONTACTS.values() if system else ():
        if contact.converted(str(system)).values() == law.values():
            return f"{contact.name}: {contact.source}"
    if any("EXPE is estimated" in sentence for sentence in comments(result)):
        return "estimated from the constants of the ply, as assumed above"
    return DECK
