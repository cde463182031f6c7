"""Page about parameters fitted to a measured force."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping

from fecm._table import ShownNumber
from fecm._text import FITTED_DIGITS
from fecm.deck.units import readable, unit_names, unit_of
from fecm.identification.result import Identification, identification_tables
from fecm.judge.fits import NOT_CONVERGED, VERDICTS
from fecm.judge.limits import Judgement, TrustLevel
from fecm.plot.histories import force_fit_picture
from fecm.report.content import (
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


def identification_page(name: str, fit: Identification, _digests: Mapping[str, str]) -> ReportPage:
    """Return the page about a fit, which has no file. `name` is the name of the measurement."""
    values = ", ".join(_format_parameter(fit, key) for key in fit.values)
    verdict = [f"Fitted to {name}: {values}."]
    level, sentence = VERDICTS[fit.verdict]
    verdict.append(sentence)
    _, *results = identification_tables(fit)  # the first is judged under Trust
    body = sections(
        [
            ("Trust", [Judgements(tuple(_judgements(fit))), *note_list(fit.notes, "Notes")]),
            ("Results", results),
            ("Pictures", [_picture(fit)]),
            ("Provenance", _provenance(fit)),
        ]
    )
    return ReportPage(fit.deck.title or f"Identification from {name}", tuple(verdict), level, body)


def _format_parameter(fit: Identification, name: str) -> str:
    """Format a parameter with its standard error."""
    value = fit.values[name]
    power, unit = readable(value, fit.unit(name), FITTED_DIGITS)
    best, error = value / 10.0**power, fit.errors[name] / 10.0**power
    return f"{name} = {best:.5g} ± {error:.2g} {unit}".rstrip()


def _judgements(fit: Identification) -> Iterator[Judgement]:
    """Judge convergence and residual."""
    yield NOT_CONVERGED.judgement("yes" if fit.converged else "no", beyond=not fit.converged)
    yield Judgement(VERDICTS[fit.verdict].level, "accepted", fit.verdict)
    force = unit_of("force", unit_names(fit.deck))
    yield Judgement(
        TrustLevel.UNJUDGED, "residual, rms", number_with_unit(fit.rms, force), "noise and model"
    )
    yield Judgement(TrustLevel.UNJUDGED, "residual of the peak", share(fit.share))
    count = len(fit.time)
    words = f"{fit.dof} degrees of freedom"
    yield Judgement(TrustLevel.UNJUDGED, "points", ShownNumber(count, str(count)), words)


def _picture(fit: Identification) -> PageBlock:
    """Draw the measured force, the fitted force, and the residual."""
    picture = force_fit_picture(fit, unit_names(fit.deck))
    caption = "Measured and fitted contact force, and the residual."
    return PagePicture(inside(picture.figure), caption, caption)


def _provenance(fit: Identification) -> Iterator[PageBlock]:
    """Yield the cards with the fitted values, and the deck."""
    text = fit.deck.to_text()
    checksum = hashlib.sha256(text.encode()).hexdigest()
    yield from page_table([("fitted deck, SHA-256", checksum)], title="Checksum")
    yield listing("The fitted cards", fit.cards())
    yield listing("The fitted deck", text)
