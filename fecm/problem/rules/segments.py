"""Rules about segments that are missing or given twice."""

from __future__ import annotations

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule

Kinds = tuple[type[model.Segment], ...]
ALWAYS: Kinds = (model.Coordinates, model.Elements, model.Material)
IN_AN_IMPACT: Kinds = (model.Impact, model.Indentation)
# Segments of which only the last is effective.
SINGLE: Kinds = (
    *ALWAYS,
    *IN_AN_IMPACT,
    model.Projectile,
    model.Shear,
    model.Patch,
    model.Gages,
    model.Units,
    model.Allowables,
    model.Delamination,
    model.Damping,
    model.Nonlinear,
    model.Preload,
    model.Curvature,
    model.Cure,
    model.Materials,
    model.Laminates,
    model.Zones,
)


@rule(
    "E203",
    Subject.SEGMENTS,
    "A segment is missing.",
    remedy="COOR, ELEM and MATE are needed always, ROD and EXPE with RODP, ALLO with FAIL.",
)
def missing_segment(deck: model.Deck, unsound: set[str]) -> Reports:
    """Find what the program needs; a segment with unreadable cards is not missing."""
    words = {macro.word for macro in deck.macros}
    impact = IN_AN_IMPACT if "RODP" in words else ()
    failure: Kinds = (model.Allowables,) if "FAIL" in words else ()
    for kind in (*ALWAYS, *impact, *failure):
        if not deck.has(kind) and kind.keyword not in unsound:
            yield Report(
                f"The deck has no {kind.keyword} segment.", deck.place(), "it belongs before END"
            )


@rule(
    "W204",
    Subject.SEGMENTS,
    "A segment is given twice.",
    cause="The last is effective. BOUN segments add up.",
    remedy="Remove one of them.",
)
def repeated_segment(deck: model.Deck, unsound: set[str]) -> Reports:
    """Find segments that a later one of the same keyword replaces."""
    for kind in SINGLE:
        for segment in deck.all(kind)[1:]:
            message = f"A second {kind.keyword} segment replaces the first."
            yield Report(message, segment.place(), "remove one of them")
    if len(boundaries := deck.all(model.Boundary)) > 1:
        message = "A second BOUN segment adds to the first and replaces the codes of its nodes."
        yield Report(message, boundaries[1].place())


OF_SEGMENTS = (missing_segment, repeated_segment)
