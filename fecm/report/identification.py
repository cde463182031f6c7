"""Page about parameters that were fitted to a measured force."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

from fecm.deck.units import readable, unit_names, unit_of
from fecm.identification.identify import CARDS, Identification
from fecm.plot.histories import force_fit_picture
from fecm.report.content import (
    Cell,
    Judgement,
    Judgements,
    PageBlock,
    PagePicture,
    ReportPage,
    ShownNumber,
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
    """Page about a fit; `name` is that of the measurement."""
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
    body = sections(
        [
            ("Trust", [Judgements(tuple(_judgements(found))), *note_list(found.notes, "Notes")]),
            ("Results", _results(found)),
            ("Pictures", [_picture(found)]),
            ("Provenance", _provenance(found)),
        ]
    )
    return ReportPage(
        found.deck.title or f"Identification from {name}", tuple(verdict), level, body
    )


def _said(found: Identification, name: str) -> str:
    """A parameter with its standard error."""
    value = found.values[name]
    power, unit = readable(value, found.unit(name), digits=5)
    best, error = value / 10.0**power, found.errors[name] / 10.0**power
    return f"{name} = {best:.5g} ± {error:.2g} {unit}".rstrip()


def _judgements(found: Identification) -> Iterator[Judgement]:
    """Convergence and residual."""
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


def _results(found: Identification) -> Iterator[PageBlock]:
    """Values with errors, their correlations, and what errors of the plate do to them."""
    rows: list[tuple[Cell, ...]] = []
    for name, value in found.values.items():
        unit = found.unit(name)
        cells = (value, found.errors[name], found.start[name])
        rows.append((name, *(number_with_unit(cell, unit) for cell in cells)))
    yield from page_table(rows, ("parameter", "value", "standard error", "start"), "Fitted values")
    if len(found.values) > 1:
        rows = [
            (name, *(number_with_unit(float(value), digits=3) for value in row))
            for name, row in zip(found.values, found.correlation, strict=True)
        ]
        yield from page_table(rows, ("", *found.values), "Correlations")
    rows = []
    for name, value in found.values.items():
        relative = name in CARDS and value
        changes = [changes[name] for changes in found.plate_errors.values()]
        rows.append(
            (name, *(share(c / value) if relative else number_with_unit(c) for c in changes))
        )
    if found.plate_errors:
        caption = "Change of the values with 1 % more of a property of the plate in the deck"
        yield from page_table(rows, ("parameter", *found.plate_errors), caption)


def _picture(found: Identification) -> PageBlock:
    """Measured and fitted force, and the residual."""
    picture = force_fit_picture(found, unit_names(found.deck))
    caption = "Measured and fitted contact force, and the residual."
    return PagePicture(inside(picture.figure), caption, caption)


def _provenance(found: Identification) -> Iterator[PageBlock]:
    """Cards with the fitted values, and the deck."""
    text = found.deck.to_text()
    checksum = hashlib.sha256(text.encode()).hexdigest()
    yield from page_table([("fitted deck, SHA-256", checksum)], caption="Checksum")
    yield listing("The fitted cards", found.cards())
    yield listing("The fitted deck", text)
