"""Plan of a sweep from its problem, cases and options."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from fecm.authoring.case import NO_THRESHOLD, Case, CasesError
from fecm.authoring.time_values import clock_of
from fecm.authoring.values import (
    FAILURE_NAMES,
    LAW_VALUES,
    Changes,
    apply_case,
    check_names,
    names_of,
)
from fecm.deck.model import Deck, Gages
from fecm.mechanics.contact_law import Law
from fecm.mechanics.own_law import law_name
from fecm.problem.problem import Problem
from fecm.results.metrics import COLUMNS, FOUND, GAGE, SUMMARY
from fecm.results.metrics import THRESHOLD as OF_THRESHOLD
from fecm.sweeps.limits import THRESHOLD, Limit, check_limits
from fecm.sweeps.methods import method_of
from fecm.sweeps.outcome import MeasuredColumn
from fecm.sweeps.random import Design
from fecm.sweeps.search import Search, Sought, Until, search_of
from fecm.sweeps.task import (
    MEASURES,
    MODES,
    NO_COLUMNS,
    BuildFunction,
    Measure,
    MeasureFunction,
    Plan,
    Settings,
)

# Names that keep the critical time step of the deck.
_KEEPING = {*names_of(Changes.FAILURE, Changes.STRIKE, Changes.PLACE), "duration"}


def plan(
    checked: Problem,
    cases: Sequence[Case],
    *,
    history: bool = False,
    until: Until | None = None,
    build: BuildFunction | None = None,
    measure: MeasureFunction | None = None,
    extra: Sequence[str] = (),
    design: Design | None = None,
    limits: Sequence[Limit] = (),
    model: str | None = None,
    modes: int = MODES,
    law: Law | None = None,
    measured: Mapping[str, MeasuredColumn] = NO_COLUMNS,
) -> Plan:
    """Create the plan of a sweep.

    `extra` has names of :class:`Measure`, `until` the searched quantity. `model` is one of
    :data:`~fecm.sweeps.task.MODELS`, or None for the one that suits a nonlinear plate; the reduced
    model has `modes` bending modes. `law` is a user's contact law that replaces the deck's law.
    `measured` has the measured columns of the table of cases.
    Raises CasesError if the deck has no impact, names exclude each other, the deck lacks what is
    searched or measured, or the method refuses the plan.
    """
    deck, search = checked.deck, search_of(until)
    if search is not None and search.quantity is Sought.EXPOSURE:
        extra = (*extra, Measure.FAILURE)
    if not any(macro.word == "RODP" for macro in deck.macros):
        raise CasesError("the deck has no impact step (RODP); there is nothing to sweep")
    if build is None:
        check_names(cases[0])
        # Values of segments that the deck lacks are invalid in every case.
        apply_case(deck, {name: cases[0][name] for name in FAILURE_NAMES if name in cases[0]})
    measures = _measures(extra, deck)
    if search is not None:
        search.check(deck, cases[0])
        if search.level == THRESHOLD and checked.threshold is None:
            raise CasesError(NO_THRESHOLD)
    if measure is None:
        has_threshold = checked.threshold is not None
        _check_limits(limits, search, measures, has_threshold=has_threshold)
    own_clock = build is None and "dt" not in cases[0] and not _KEEPING.issuperset(cases[0])
    settings = Settings(
        deck=deck,
        history=history,
        clock=clock_of(checked) if own_clock else None,
        search=search,
        build=build,
        measure=measure,
        measures=measures,
        model=model,
        modes=modes,
        law=law,
    )
    if law is not None and build is None:
        check_law(law, cases[0])
    method = method_of(checked, settings, cases)
    definition = Plan(settings, tuple(cases), method, design, tuple(limits), measured)
    if refusal := method.refusal(checked, definition):
        raise CasesError(refusal)
    return definition


def check_law(law: Law, names: Collection[str]) -> None:
    """Raise CasesError if a user's law takes the place of values that vary."""
    if constants := [name for name in names if name in LAW_VALUES]:
        raise CasesError(
            f"the contact law {law_name(law)} takes the place of EXPE, so that "
            f"{', '.join(constants)} would change nothing"
        )


def _measures(names: Sequence[str], deck: Deck) -> tuple[Measure, ...]:
    """Return what is measured.

    Raises CasesError if a name is unknown, or the deck lacks what it needs.
    """
    if unknown := sorted({*names} - {*MEASURES}):
        raise CasesError(f"measure has {unknown[0]!r}; the names are {', '.join(MEASURES)}")
    if Measure.GAGES in names and not deck.has(Gages):
        raise CasesError("measure gages: the deck has no strain gages; add a GAGE segment")
    if Measure.FAILURE in names and not any(macro.word == "FAIL" for macro in deck.macros):
        raise CasesError("measure failure: the program of the deck has no FAIL; add it to the loop")
    return tuple(measure for measure in Measure if measure in names)


def _check_limits(
    limits: Sequence[Limit],
    search: Search | None,
    measures: Sequence[Measure],
    *,
    has_threshold: bool,
) -> None:
    """Raise CasesError if the summary of the sweep will not have the quantity of a limit."""
    quantities = [*SUMMARY]
    if search is not None:
        quantities += FOUND
    if measures:
        names = (limit.quantity for limit in limits)
        quantities += [name for name in names if name in COLUMNS or name.startswith(GAGE)]
    if has_threshold:
        quantities += OF_THRESHOLD
    check_limits(limits, quantities, threshold=has_threshold)
