"""A sound plate for the tests of mistakes, and edits of its deck."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

import fecm
from fecm.deck.findings import Finding
from fecm.problem.loading import load_deck

# Codes of the rules on test; that of the mesh, W415, depends on the decks' few elements.
RULES = re.compile(
    "[NW](430|434|435|437|438|440|446|463|467|468|469|470|471|472|473|474|475|476|477|478|479|480|481|482"
    "|550|551|552|553|554|555|556|557|558|568|569|583|584|585|586|587|588)"
)
STRENGTHS = (2326.2, 1200.1, 62.3, 199.8, 92.3, 92.3, 92.3)
Edit = Callable[[str], str]


@cache
def base() -> str:
    """A sound plate of IM7/8552 under 3 J in mm, N and s, with strengths and toughness."""
    deck = fecm.impact(
        fecm.Plate.rectangle((100, 100), (4, 4), support="simple"),
        fecm.Laminate("[45/0/-45/90]2s", "IM7/8552", 0.184),
        fecm.RigidMass(2e-3),
        fecm.Contact.estimate(8.0),
        energy=3000.0,
        duration=8e-3,
        units="mm-N-s",
        damage=True,
        kinematics="linear",
        shear_factor=1.0,
    )
    return deck.to_text()


def with_card(keyword: str, *cards: str) -> Edit:
    """Replace the data cards of a segment, as many as are given; add it if there is none."""

    def edit(text: str) -> str:
        head = re.escape(keyword)
        new, count = re.subn(
            rf"(?m)^{head}( .*)?\n(.*\n){{{len(cards)}}}",
            lambda match: "\n".join([f"{keyword}{match[1] or ''}", *cards, ""]),
            text,
            count=1,
        )
        return new if count else text.replace("EXPE\n", "\n".join([keyword, *cards, "EXPE\n"]))

    return edit


PLY = ["1.57E-9", "0.32", "171420.0", "9080.0", "5290.0", "5290.0", "3242.86"]
CONSTANTS = ("density", "nu12", "e1", "e2", "g12", "g13", "g23")


def with_ply(**constants: float) -> Edit:
    """Other constants of the ply."""
    numbers = dict(zip(CONSTANTS, PLY, strict=True))
    assert constants.keys() <= numbers.keys()
    values = [repr(constants[name]) if name in constants else numbers[name] for name in CONSTANTS]
    return replaced(r"^ +1\.57E-9 .*", ",".join(values))


def strengths(*values: float) -> Edit:
    """Other strengths."""
    return with_card("ALLO", ",".join(map(repr, values)))


def replaced(pattern: str, new: str) -> Edit:
    """Replace a pattern, which the deck must have."""

    def edit(text: str) -> str:
        changed, count = re.subn(pattern, new, text, flags=re.MULTILINE)
        assert count, pattern
        return changed

    return edit


def found(text: str) -> list[Finding]:
    """Findings of the rules on test."""
    return [finding for finding in load_deck(text).findings if RULES.match(finding.code)]
