"""Rules about the plate under the compression of PREL."""

from __future__ import annotations

from fecm.deck import model
from fecm.deck.rules import Report, Reports, Subject, rule
from fecm.mechanics.mesh import rigid_deflections
from fecm.problem.problem import Problem

STIFFLESS = "PREL is far beyond the buckling load, or the plate has motions without stiffness"
NEAR = 1.1  # buckling load over the preload below which the response is doubtful
# Elements along a half wave below which the buckling load of a curved panel is too high: by 3 %
# with 1.2 elements, 8 % with 0.9 and 50 % with 0.5, and by 0.2 % with 2.4.
FEWEST_ELEMENTS = 2.0


@rule(
    "E486",
    Subject.LAMINATE,
    "PREL compresses a plate that its supports let move along w.",
    cause="It has no buckling load, and its edge loads may or may not keep their direction.",
    remedy="Restrain w at the edges, or a preload in tension.",
)
def compressed_free_plate(problem: Problem) -> Reports:
    """Find compression of a plate with rigid deflections."""
    card = problem.deck.last(model.Preload)
    if card is None or not problem.plate.is_compressed:
        return
    if rigid_deflections(problem.mesh).size:
        message = "PREL compresses a plate that its supports let move along w."
        yield Report(message, card.place(), "restrain w at every node of a supported edge")


@rule(
    "E487",
    Subject.LAMINATE,
    "The preload is at or beyond the buckling load.",
    cause="The flat plate is not stable: its deflection would grow without bound.",
    remedy="A smaller compression; the units of PREL, force/length.",
)
def buckled(problem: Problem) -> Reports:
    """Compare the preload with the buckling load."""
    card, factor = problem.deck.last(model.Preload), problem.buckling_factor
    if card is None or not factor <= 1.0:
        return
    message = (
        f"The preload N0 is {1.0 / factor:.3g} times the buckling load" if factor else STIFFLESS
    )
    hint = "PREL is a force per length, tension positive"
    yield Report(f"{message}: the plate is not stable.", card.place(), hint)


@rule(
    "W488",
    Subject.LAMINATE,
    "The preload is above 1/1.1 of the buckling load.",
    cause="Stiffness and frequencies depend on a small difference.",
    remedy="A finer mesh and exact loads and supports, or a smaller compression.",
)
def nearly_buckled(problem: Problem) -> Reports:
    """Find a preload just below the buckling load."""
    card, factor = problem.deck.last(model.Preload), problem.buckling_factor
    if card is None or not 1.0 < factor < NEAR:
        return
    message = f"The preload N0 is {1.0 / factor:.3g} times the buckling load"
    why = "stiffness and frequencies depend on a small difference"
    yield Report(f"{message}: {why}.", card.place(), "imperfections of a real plate matter here")


@rule(
    "W561",
    Subject.LAMINATE,
    "The elements are too large for the buckles of a curved panel.",
    cause=(
        "A buckle is about 1.73 (R h)^(1/2) long. With less than two elements along it the "
        "buckling load is too high: by 3 % with 1.2 elements, 50 % with 0.5."
    ),
    remedy="A finer mesh. `fecm check` prints the buckling load, here with `at most`.",
)
def coarse_for_buckles(problem: Problem) -> Reports:
    """Find a curved panel under compression whose elements are longer than its buckles."""
    card, count = problem.deck.last(model.Preload), problem.elements_per_buckle
    if card is None or not problem.plate.is_compressed or count >= FEWEST_ELEMENTS:
        return
    message = (
        f"The panel has {count:.2g} elements along a buckle: its buckling load is at most "
        f"{problem.buckling_factor:.4g} times the preload, and may be much lower."
    )
    yield Report(
        message, card.place(), "use at least 2 elements of its largest side along a buckle"
    )


OF_PRELOAD = (compressed_free_plate, buckled, coarse_for_buckles, nearly_buckled)
