"""Page about parameters fitted to a measured force."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping

from fecm._table import Row, ShownNumber
from fecm._text import FITTED_DIGITS
from fecm.deck.units import prefixed, uncertain, unit_names, unit_of
from fecm.identification.result import Identification, identification_tables
from fecm.judge.fits import NOT_CONVERGED, UNCONFIRMED, VERDICTS
from fecm.judge.limits import Judgement, TrustLevel
from fecm.plot.histories import force_fit_picture
from fecm.report.content import (
    Answer,
    Headline,
    Judgements,
    PageBlock,
    PagePicture,
    ReportPage,
    listing,
    note_list,
    number_with_unit,
    page_table,
    sections,
    share,
)
from fecm.report.figures import inside
from fecm.report.sources import short_deck
from fecm.results.written import PageOptions


def identification_page(
    name: str, fit: Identification, _digests: Mapping[str, str], options: PageOptions
) -> ReportPage:
    """Return the page about a fit, which has no file. `name` is the name of the measurement."""
    _, *results = identification_tables(fit)  # the first is judged under Trust
    body = sections(
        [
            ("Trust", [Judgements(tuple(_judgements(fit))), *note_list(fit.notes, "Notes")]),
            ("Results", results),
            ("Deck", _deck(fit, full=options.full_deck)),
        ]
    )
    names = ", ".join(fit.values)
    return ReportPage(
        fit.deck.title or f"Identification from {name}",
        tuple(_answers(fit)),
        VERDICTS[fit.verdict],
        body,
        subject=f"A fit of {names} to the measured force {name}.",
        headlines=tuple(_headlines(fit)),
        first_sheet=(_picture(fit),),
    )


def _answers(fit: Identification) -> Iterator[Answer]:
    """Say whether the fit is accepted, and the first reason to doubt it."""
    doubts = fit.doubts or (() if fit.accepted else fit.notes)
    rest = f": {doubts[0]}" if doubts else ", it describes the measurement"
    yield Answer("Accepted", fit.verdict, rest)


def _headlines(fit: Identification) -> Iterator[Headline]:
    """Yield the fitted values with their standard errors, and the residual."""
    for name, value in fit.values.items():
        unit = fit.unit(name)
        text = uncertain(value, fit.errors[name], unit)
        start = f"start {prefixed(fit.start[name], unit, FITTED_DIGITS)}"
        yield Headline(name, ShownNumber(value, text), (start,))
    rms = number_with_unit(fit.rms, unit_of("force", fit.units), 3)
    yield Headline("residual, rms", rms, (f"{100.0 * fit.share:.2g} % of the peak",))


def _judgements(fit: Identification) -> Iterator[Judgement]:
    """Judge convergence and residual."""
    yield NOT_CONVERGED.judgement("yes" if fit.converged else "no", beyond=not fit.converged)
    yield Judgement(VERDICTS[fit.verdict], "accepted", fit.verdict)
    force = unit_of("force", unit_names(fit.deck))
    yield Judgement(
        TrustLevel.UNJUDGED, "residual, rms", number_with_unit(fit.rms, force), "noise and model"
    )
    yield Judgement(TrustLevel.UNJUDGED, "residual of the peak", share(fit.share))
    if (run := fit.full_run) is not None:
        words = f"rms {run.misfit:.2%}; {run.modes} modes of bending beside full runs"
        yield UNCONFIRMED.judgement(share(run.largest), beyond=run.rejects, words=words)
    count = len(fit.time)
    words = f"{fit.dof} degrees of freedom"
    yield Judgement(TrustLevel.UNJUDGED, "points", ShownNumber(count, str(count)), words)


def _picture(fit: Identification) -> PageBlock:
    """Draw the measured force, the fitted force, and the residual."""
    picture = force_fit_picture(fit, unit_names(fit.deck))
    caption = "Measured and fitted contact force, and the residual."
    return PagePicture(inside(picture.figure), caption, caption)


def _deck(fit: Identification, *, full: bool) -> Iterator[PageBlock]:
    """Yield the checksums of record and deck, the cards with the fitted values, and the deck."""
    text = fit.deck.to_text()
    rows: list[Row] = []
    if fit.record.file:
        rows += [("record", fit.record.file), ("record, SHA-256", fit.record.sha256)]
    rows.append(("fitted deck, SHA-256", hashlib.sha256(text.encode()).hexdigest()))
    yield from page_table(rows, title="Checksums")
    yield listing("The fitted cards", fit.cards())
    yield listing("The fitted deck", text if full else short_deck(text))
