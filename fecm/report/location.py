"""Page about an impact that strain gages located."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping

import numpy as np

from fecm._errors import FecmError
from fecm._table import Cell, Row, ShownNumber
from fecm._text import DECK_DIGITS
from fecm.deck.layup import layup_text
from fecm.deck.model import Gages, Material
from fecm.deck.units import prefixed, quantity, uncertain, unit_names, unit_of
from fecm.judge.limits import Judgement, ModelLimit, TrustLevel
from fecm.judge.locations import (
    FAINT_FORCE,
    LARGE_MESH_ERROR,
    LARGE_STRAIN,
    MISFIT,
    OPEN_FORCE,
    RIVAL,
    SHAPED_SIGNALS,
)
from fecm.location.location import Location, summary_of_location
from fecm.location.verdict import residual_correlation
from fecm.plot.kinds import PictureKind
from fecm.problem.loading import sole_problem
from fecm.report import figures
from fecm.report.content import (
    Answer,
    Headline,
    Judgements,
    PageBlock,
    ReportPage,
    listing,
    note_list,
    number_with_unit,
    page_table,
    sections,
    share,
)
from fecm.report.sources import short_deck
from fecm.report.subject import plate_extent
from fecm.results.written import PageOptions

CONFIDENCE = 0.95  # of the region of the place


def location_page(
    name: str, location: Location, digests: Mapping[str, str], options: PageOptions
) -> ReportPage:
    """Return the page about a located impact.

    `digests` has the SHA-256 of its file, by its name.
    """
    judged = tuple(judgements(location))
    notes = note_list(location.notes, "Notes of the location")
    body = sections(
        [
            ("Trust", [Judgements(judged), *notes]),
            ("Results", [*summary_of_location(location).groups, *_gages(location)]),
            ("Model", page_table(_model(location), title="Plate")),
            ("Deck", _deck(name, location, digests, full=options.full_deck)),
        ]
    )
    caption = (
        "Misfit of the candidates on the plate, with gages and places; the 95 % region of the "
        "place; the fitted force; measured and fitted strains."
    )
    shown = figures.drawn(PictureKind.LOCATION, {name: location}, caption, wide=True)
    return ReportPage(
        location.deck.title or f"Impact located by {name}",
        tuple(_answers(location)),
        _level(location),
        body,
        subject=_subject(location),
        headlines=tuple(_headlines(location)),
        first_sheet=tuple(shown),
    )


def _level(location: Location) -> TrustLevel:
    if not location.accepted:
        return TrustLevel.OUTSIDE
    return TrustLevel.DOUBTFUL if location.notes else TrustLevel.WITHIN


def _subject(location: Location) -> str:
    """Say which strains located the impact."""
    gages = ", ".join(map(str, location.gages.tolist()))
    record = f" in {location.record.file}" if location.record.file else ""
    return f"An impact located from the strains of gages {gages}{record}."


def _answers(location: Location) -> Iterator[Answer]:
    """Say where the impact was, whether the strains determine it, and what may be wrong."""
    unit = location.unit("x")
    x, y = (uncertain(value, error, unit) for value, error in
            ((location.x, location.sd_x), (location.y, location.sd_y)))  # fmt: skip
    yield Answer("Impact at", f"x = {x}, y = {y}")
    if location.accepted:
        doubts = f", with {len(location.notes)} remarks: see Trust" if location.notes else ""
        yield Answer("Accepted", "yes", doubts)
    else:
        yield Answer("Accepted", "no", f": {location.notes[0] if location.notes else 'see Trust'}")


def _headlines(location: Location) -> Iterator[Headline]:
    """Yield the figures of a location."""
    unit = location.unit("x")
    for axis in ("x", "y"):
        value, error = getattr(location, axis), getattr(location, f"sd_{axis}")
        remark = "standard deviation in brackets"
        yield Headline(axis, ShownNumber(value, uncertain(value, error, unit)), (remark,))
    reach = location.ellipse(CONFIDENCE) - (location.x, location.y)
    size = float(np.hypot(*reach.T).max())
    region = f"± {quantity(size, unit, 2)}"
    yield Headline("95 % region", region, (f"correlation {location.correlation:.2f}",))
    for name, remark in (
        ("peak_force", f"at {prefixed(location.time_of_peak, location.unit('time'))}"),
        ("impulse", "" if location.contact_end is not None else "at least"),
    ):
        value, error = getattr(location, name), getattr(location, f"sd_{name}")
        text = uncertain(value, error or 0.0, location.unit(name))
        cell = ShownNumber(value, text)
        yield Headline(name.replace("_", " "), cell, (remark,) if remark else ())
    if location.energy_bound is not None:
        bound = location.energy_bound
        text = prefixed(bound, location.unit("energy_bound"), 3)
        yield Headline("energy", ShownNumber(bound, f"at most {text}"), ("of a rebound",))
    elif location.contact_end is not None:
        end = location.contact_end
        cell = ShownNumber(end, prefixed(end, location.unit("contact_end")))
        yield Headline("contact", cell, ("until, at least",))


def judgements(location: Location) -> Iterator[Judgement]:
    """Judge residual, strains, other places, force and mesh by the limits of a location."""
    if location.noise_given:
        size = number_with_unit(location.misfit, digits=3)
        yield _row(MISFIT, size, beyond=location.misfit > MISFIT.value, most="at most")
    correlation = residual_correlation(location)
    size = ShownNumber(correlation, f"{correlation:.2f}")
    beyond = correlation > SHAPED_SIGNALS.value
    yield _row(SHAPED_SIGNALS, size, beyond=beyond, most="at most")
    largest = float(np.abs(location.strains).max())
    cell = share(largest, 2)
    yield _row(LARGE_STRAIN, cell, beyond=largest > LARGE_STRAIN.value, words=LARGE_STRAIN.page)
    if location.second is None:
        yield _row(RIVAL, "none", beyond=False, words="the misfit has one minimum")
    else:
        ratio = location.second.ratio
        size = number_with_unit(ratio, digits=3)
        yield _row(RIVAL, size, beyond=ratio < RIVAL.value, most="at least")
    peak = int(np.abs(location.time - location.time_of_peak).argmin())
    clear = location.peak_force / float(location.force_sd[peak] or math.nan)
    size = number_with_unit(clear, digits=3)
    yield _row(FAINT_FORCE, size, beyond=clear < FAINT_FORCE.value, most="at least")
    if location.mesh_error is None:
        yield _row(LARGE_MESH_ERROR, "unknown", beyond=True, words="not in the standard deviations")
    else:
        part = location.mesh_error / math.hypot(location.sd_x, location.sd_y)
        size = number_with_unit(part, digits=2)
        yield _row(LARGE_MESH_ERROR, size, beyond=part > LARGE_MESH_ERROR.value, most="at most")
    is_open = location.contact_end is None
    words = "the impulse is a lower bound" if is_open else ""
    yield _row(OPEN_FORCE, "open" if is_open else "in the record", beyond=is_open, words=words)


def _row(
    limit: ModelLimit, size: Cell, *, beyond: bool, words: str = "", most: str = ""
) -> Judgement:
    """Return the judgement of a size; `most` is the sense of the limit in words."""
    about = f"{most} {limit.value:g} is accepted" if most else words
    return limit.judgement(size, beyond=beyond, words=about)


def _gages(location: Location) -> Iterator[PageBlock]:
    """Yield a table of the gages: place, direction, strain, and what the force leaves of it."""
    length = location.unit("x")
    directions = {card.number: card.direction for card in location.deck.require(Gages).records}
    has_gains = bool(location.sd_gains.any())
    rows: list[Row] = []
    residual = location.strains - location.fitted
    for row, number in enumerate(location.gages.tolist()):
        x, y = location.gage_places[row].tolist()
        measured = location.strains[row]
        rms = float(np.sqrt(np.mean(residual[row] ** 2)))
        left = float((residual[row] ** 2).sum() / ((measured**2).sum() or math.nan))
        cells = [
            number_with_unit(x, length),
            number_with_unit(y, length),
            number_with_unit(directions[number], "°"),
            _micro(float(np.abs(measured).max())),
            _micro(rms),
            share(left, 2),
        ]
        gain = float(location.gains[row])
        rows.append((str(number), *cells, *([number_with_unit(gain)] if has_gains else [])))
    header = ["gage", "x", "y", "direction", "largest strain", "residual, rms", "squares left"]
    yield from page_table(rows, [*header, *(["gain"] if has_gains else [])], "Gages")


def _micro(strain: float) -> Cell:
    return ShownNumber(strain, f"{1e6 * strain:.3g} µm/m")


def _model(location: Location) -> Iterator[Row]:
    """Yield rows about the plate."""
    deck, units = location.deck, unit_names(location.deck)
    try:
        problem = sole_problem(deck, warns=False)
    except (FecmError, ValueError):  # of a damaged file
        return
    yield "extent", plate_extent(problem)
    thickness, unit = problem.laminate.thickness, unit_of("length", units)
    yield "thickness", number_with_unit(thickness, unit, DECK_DIGITS)
    yield "laminate", layup_text([layer.angle for layer in deck.require(Material).layers])
    control = deck.control
    yield "mesh", f"{control.numel} elements of up to {control.nen} nodes, {control.numnp} nodes"
    if problem.patch is not None:
        yield "radius of the load", number_with_unit(problem.patch.radius, unit)


def _deck(
    name: str, location: Location, digests: Mapping[str, str], *, full: bool
) -> Iterator[PageBlock]:
    """Yield the checksums of record, deck and result, and the deck."""
    text = location.deck.to_text()
    rows: list[Row] = []
    if location.record.file:
        rows += [("record", location.record.file), ("record, SHA-256", location.record.sha256)]
    rows.append(("deck, SHA-256", hashlib.sha256(text.encode()).hexdigest()))
    if name in digests:
        rows.append(("result, SHA-256", digests[name]))
    yield from page_table(rows, title="Checksums")
    yield listing("The deck", text if full else short_deck(text))
