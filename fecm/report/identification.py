"""Page about parameters fitted to a measured force."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

from fecm._table import ShownNumber
from fecm.deck.units import readable, unit_names, unit_of
from fecm.identification.result import Identification, identification_tables
from fecm.plot.histories import force_fit_picture
from fecm.report.content import (
    Judgement,
    Judgements,
    PageBlock,
    PagePicture,
    ReportPage,
    TrustLevel,
    listing,
    note_list,
    number_with_unit,
    page_table,
    sections,
    share,
)
from fecm.report.figures import inside


def identification_page(name: str, found: Identification) -> ReportPage:
    """Return the page about a fit. `name` is the name of the measurement."""
    values = ", ".join(_said(found, key) for key in found.values)
    verdict = [f"Fitted to {name}: {values}."]
    level = TrustLevel.WITHIN
    if not found.accepted:
        level = TrustLevel.OUTSIDE
        verdict.append("The fit is not accepted: see Trust.")
    elif found.notes:
        level = TrustLevel.DOUBTFUL
        verdict.append("The fit has converged, with doubts: see Trust.")
    else:
        verdict.append("The fit has converged and describes the measurement.")
    _, *results = identification_tables(found)  # the first is judged under Trust
    body = sections(
        [
            ("Trust", [Judgements(tuple(_judgements(found))), *note_list(found.notes, "Notes")]),
            ("Results", results),
            ("Pictures", [_picture(found)]),
            ("Provenance", _provenance(found)),
        ]
    )
    return ReportPage(
        found.deck.title or f"Identification from {name}", tuple(verdict), level, body
    )


def _said(found: Identification, name: str) -> str:
    """Format a parameter with its standard error."""
    value = found.values[name]
    power, unit = readable(value, found.unit(name), digits=5)
    best, error = value / 10.0**power, found.errors[name] / 10.0**power
    return f"{name} = {best:.5g} ± {error:.2g} {unit}".rstrip()


def _judgements(found: Identification) -> Iterator[Judgement]:
    """Judge convergence and residual."""
    for name, fine in (("converged", found.converged), ("accepted", found.accepted)):
        yield Judgement(
            TrustLevel.WITHIN if fine else TrustLevel.OUTSIDE, name, "yes" if fine else "no"
        )
    force = unit_of("force", unit_names(found.deck))
    yield Judgement(
        TrustLevel.UNJUDGED, "residual, rms", number_with_unit(found.rms, force), "noise and model"
    )
    yield Judgement(TrustLevel.UNJUDGED, "residual of the peak", share(found.share))
    count = len(found.time)
    words = f"{found.dof} degrees of freedom"
    yield Judgement(TrustLevel.UNJUDGED, "points", ShownNumber(count, str(count)), words)


def _picture(found: Identification) -> PageBlock:
    """Draw the measured force, the fitted force, and the residual."""
    picture = force_fit_picture(found, unit_names(found.deck))
    caption = "Measured and fitted contact force, and the residual."
    return PagePicture(inside(picture.figure), caption, caption)


def _provenance(found: Identification) -> Iterator[PageBlock]:
    """Yield the cards with the fitted values, and the deck."""
    text = found.deck.to_text()
    checksum = hashlib.sha256(text.encode()).hexdigest()
    yield from page_table([("fitted deck, SHA-256", checksum)], title="Checksum")
    yield listing("The fitted cards", found.cards())
    yield listing("The fitted deck", text)
