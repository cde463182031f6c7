"""Page about the result of a sweep: a grid, a list of cases, a search, or a random sweep."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from fecm._table import Cell, Row, ShownNumber
from fecm._text import DECK_DIGITS
from fecm.deck.units import quantity, short_name, unit_of
from fecm.judge.limits import Judgement, TrustLevel
from fecm.judge.validity import counted
from fecm.plot.kinds import PictureKind, Width
from fecm.report import figures
from fecm.report.content import (
    UNKNOWN,
    Answer,
    Judgements,
    PageBlock,
    ReportPage,
    listing,
    note_list,
    number_with_unit,
    page_table,
    sections,
    share,
    worst,
)
from fecm.report.measured_cases import test_pictures, test_tables
from fecm.report.sources import short_deck
from fecm.report.sweep_head import answers, headlines
from fecm.results.metrics import FACTOR, INTEGERS, RATIO, VERDICTS, described
from fecm.results.written import PageOptions
from fecm.sweeps.random import Design
from fecm.sweeps.result import SweepResult
from fecm.sweeps.statistics import QUANTILES, RandomResult
from fecm.sweeps.summary import MAIN, sweep_verdict, symmetry_text, threshold_text

FOUND = "found_velocity"
PEAK = "peak_force"
ON_FIRST_SHEET = 2  # pictures below the headline figures
MOST_NAMED = 4  # values that name a case
MOST_VALUES = 8  # different values of a name that are listed one by one
MOST_COMBINATIONS = 12  # of varied values, whose statistics are listed


def sweep_page(
    name: str, sweep: SweepResult, digests: Mapping[str, str], options: PageOptions
) -> ReportPage:
    """Return the page about the result of a sweep.

    `digests` has the SHA-256 of its file, by its name.
    """
    judged = list(_judgements(sweep))
    level = worst(judged)
    pictures = (*_pictures(name, sweep), *test_pictures(name, sweep))
    drawn = [] if sweep.random is None else _random(sweep, sweep.random)
    body = sections(
        [
            ("Trust", [Judgements(tuple(judged)), *note_list(sweep.notes, "Notes of the sweep")]),
            ("Varied values", _varied(sweep)),
            ("Results", [*_extremes(sweep), *_convergence(sweep), *_reduced(sweep), *drawn]),
            ("Tests", test_tables(sweep)),
            ("Pictures", pictures[ON_FIRST_SHEET:]),
            ("Deck", _deck(name, sweep, digests, full=options.full_deck)),
        ]
    )
    verdict: tuple[str | Answer, ...] = (*answers(sweep), *_remarks(sweep))
    return ReportPage(
        sweep.title or name,
        verdict,
        level,
        body,
        subject=_sentence(sweep),
        headlines=tuple(headlines(sweep)),
        first_sheet=pictures[:ON_FIRST_SHEET],
    )


def _sentence(sweep: SweepResult) -> str:
    """Say what was varied, how many cases there are, and how many are in doubt."""
    names = ", ".join(sweep.cases) or "nothing"
    symmetry = f"; {text}" if (text := symmetry_text(sweep)) else ""
    return f"A sweep over {names}; {sweep_verdict(sweep)}{symmetry}."


def _remarks(sweep: SweepResult) -> Iterator[str]:
    """Yield what the answers of a search do not say."""
    if text := threshold_text(sweep):
        yield f"Delamination: {text}."


def _fine(sweep: SweepResult, name: str) -> np.ndarray:
    """Return a quantity of the cases, NaN for cases that failed."""
    return np.where(sweep.completed, sweep[name], np.nan)


def _judgements(sweep: SweepResult) -> Iterator[Judgement]:
    """Yield the numbers of cases by status and validity."""
    count = len(sweep)
    failed = int((~sweep.completed).sum())
    valid = int((sweep.validity == "ok").sum())
    level = TrustLevel.WITHIN if valid == count else TrustLevel.DOUBTFUL
    words = "" if valid == count else f"{count - valid} doubtful or failed; the reasons follow"
    yield Judgement(
        level, "cases without a doubt", ShownNumber(valid, f"{valid} of {count}"), words
    )
    if failed:
        reasons = Counter(sweep["status"][~sweep.completed].tolist()).most_common(3)
        words = "; ".join(f"{times}: {reason}" for reason, times in reasons)
        yield Judgement(
            TrustLevel.OUTSIDE, "failed", ShownNumber(failed, f"{failed} of {count}"), words
        )
    for doubt, mask in counted(sweep.validity):
        size = ShownNumber(int(mask.sum()), f"{mask.sum()} of {count}")
        yield Judgement(doubt.level, doubt.reason, size, doubt.case)
    if still := int(sweep.still_in_contact.sum()):
        words = "what comes after the end is open"
        size = ShownNumber(still, f"{still} of {count}")
        yield Judgement(TrustLevel.DOUBTFUL, "still in contact at the end", size, words)


def _varied(sweep: SweepResult) -> list[PageBlock]:
    """Yield a table of the names, numbers and ranges of the varied values."""
    laws = {} if sweep.random is None else sweep.random.design.laws
    rows: list[Row] = []
    for name, values in sweep.cases.items():
        different = list(dict.fromkeys(values.tolist()))
        unit = sweep.unit(name)
        if name in laws:
            text: Cell = str(laws[name])
        elif len(different) <= MOST_VALUES or values.dtype.kind != "f":
            texts = [
                f"{value:.6g}" if isinstance(value, float) else str(value) for value in different
            ]
            text = ", ".join(texts[:MOST_VALUES]) + (", …" if len(texts) > MOST_VALUES else "")
        else:
            text = f"{values.min():.6g} to {values.max():.6g}"
        count = ShownNumber(len(different), str(len(different)))
        rows.append((name, count, text, short_name(unit) or UNKNOWN))
    return page_table(rows, ("name", "different values", "values", "unit"))


def _extremes(sweep: SweepResult) -> list[PageBlock]:
    """Yield a table of the cases with the smallest and the largest value of each quantity."""
    rows: list[Row] = []
    for name, column in sweep.summary.items():
        if name in VERDICTS or column.dtype.kind != "f" or column.ndim > 1:
            continue
        values = _fine(sweep, name)
        if not np.isfinite(values).any() or _is_usual(name, values):
            continue
        low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
        unit = sweep.unit(name)
        cells = [_case(sweep, low), number_with_unit(float(values[low]), unit)]
        if values[high] > values[low]:
            cells += [_case(sweep, high), number_with_unit(float(values[high]), unit)]
        else:
            cells += ["all cases", number_with_unit(float(values[high]), unit)]
            cells[0] = "all cases"
        rows.append((name.replace("_", " "), cells[1], cells[0], cells[3], cells[2]))
    header = ("quantity", "smallest", "case", "largest", "case")
    return page_table(rows, header, "Smallest and largest values of the cases that were run")


def _is_usual(name: str, values: np.ndarray) -> bool:
    """Return whether all cases have what nearly every impact has: one contact, or the value 0."""
    usual = 1.0 if name in INTEGERS or name == FACTOR else 0.0
    return bool((values[np.isfinite(values)] == usual).all())


def _convergence(sweep: SweepResult) -> list[PageBlock]:
    """Yield a table of order, limit and error band of the quantities of a refinement study."""
    rows: list[Row] = []
    for name, study in sweep.convergence.items():
        unit, finest = sweep.unit(name), float(sweep[name][-1])
        sizes = (
            number_with_unit(finest, unit),
            number_with_unit(study.limit, unit),
            number_with_unit(study.band, unit),
        )
        rows.append(
            (name.replace("_", " "), *sizes, number_with_unit(study.order, digits=3), study.remark)
        )
    header = ("quantity", "finest mesh", "limit", "band, ±", "observed order", "remark")
    return page_table(rows, header, "Convergence with the mesh and the time step")


def _reduced(sweep: SweepResult) -> list[PageBlock]:
    """Return a table of full runs beside the reduced model."""
    reduced = sweep.reduced
    if reduced is None:
        return []
    names = {"peak_force": "peak force", RATIO: "deflection"}
    names |= {name: name.replace("_", " ") for name in reduced.measured}
    differences = [reduced.difference(name) for name in names]
    rows = [
        (str(case), *(share(float(value)) for value in pair))
        for case, *pair in zip(reduced.columns["case"], *differences, strict=True)
    ]
    caption = f"Reduced model with {reduced.modes} modes: differences from full runs"
    return page_table(rows, ("case", *names.values()), caption)


def _case(sweep: SweepResult, case: int) -> str:
    """Format the number and the values of a case."""
    if len(sweep.cases) > MOST_NAMED:
        return f"{case}"
    values = {name: column[case].item() for name, column in sweep.cases.items()}
    texts = [
        f"{name} {quantity(value, sweep.unit(name), DECK_DIGITS)}"
        if isinstance(value, float)
        else f"{name} {value}"
        for name, value in values.items()
    ]
    return f"{case}: {', '.join(texts)}"


def _drawn(sweep: SweepResult, design: Design) -> Iterator[tuple[str, str]]:
    """Yield rows with the numbers of draws and cases, where they differ from the samples."""
    if design.sensitivity:
        yield "draws", f"{design.draws}, two per sample; statistics and probabilities use them"
    if len(sweep) != design.draws:
        yield "cases", f"{len(sweep)}, all runs, also for indices and combinations"


def _random(sweep: SweepResult, random: RandomResult) -> Iterator[PageBlock]:
    """Yield tables of design, statistics, probabilities and sensitivity indices."""
    design = random.design
    yield from page_table(
        [
            ("design", str(design.kind)),
            ("samples", ShownNumber(design.samples, str(design.samples))),
            *_drawn(sweep, design),
            ("seed", ShownNumber(design.seed, str(design.seed))),
        ],
        title="Random sweep",
    )
    count = len(next(iter(random.combinations.values()), [0]))
    for combination in range(min(count, MOST_COMBINATIONS)):
        place = (combination,) if random.combinations else ()
        label = f" with {random.label(combination)}" if random.combinations else ""
        yield from _statistics(sweep, random, place, f"Statistics{label}")
        yield from _exceedance(sweep, random, place, f"Probabilities{label}")
        yield from _indices(sweep, random, place, label)
    if count > MOST_COMBINATIONS:
        yield from note_list([f"{count - MOST_COMBINATIONS} more combinations are in the file"])


def _statistics(
    sweep: SweepResult, random: RandomResult, place: tuple[int, ...], caption: str
) -> list[PageBlock]:
    """Return a table of mean, standard deviation and quantiles of the main quantities."""
    rows: list[Row] = []
    for name in (name for name in MAIN if name in random.statistics):
        moments, unit = random.statistics[name], sweep.unit(name)
        values = [moments.mean[place], moments.standard_deviation[place], *moments.quantiles[place]]
        draws = int(moments.draws[place])
        cells = [number_with_unit(float(value), unit) for value in values]
        rows.append((name.replace("_", " "), *cells, ShownNumber(draws, str(draws))))
    quantiles = [f"{100 * q:g} %" for q in QUANTILES]
    return page_table(rows, ("quantity", "mean", "std. dev.", *quantiles, "draws"), caption)


def _exceedance(
    sweep: SweepResult, random: RandomResult, place: tuple[int, ...], caption: str
) -> list[PageBlock]:
    """Return a table of the probabilities of exceeding limits, with their intervals."""
    exceedance = random.exceedance
    rows: list[Row] = []
    for row, (name, limit) in enumerate(zip(exceedance.quantity, exceedance.limit, strict=True)):
        p, low, high, draws, is_open = (float(values[(*place, row)]) for values in exceedance[2:])
        level = (
            "its threshold"
            if np.isnan(limit)
            else number_with_unit(float(limit), sweep.unit(str(name)))
        )
        counts = [ShownNumber(value, f"{value:.0f}") for value in (draws, is_open)]
        chances = [share(value, 4) for value in (p, low, high)]
        rows.append((str(name).replace("_", " "), level, *chances, *counts))
    header = ("quantity", "exceeds", "probability", "from", "to (95 %)", "draws", "open")
    return page_table(rows, header, caption)


def _indices(
    sweep: SweepResult, random: RandomResult, place: tuple[int, ...], label: str
) -> Iterator[PageBlock]:
    """Return a table of Sobol' indices of the main quantity."""
    name = next((name for name in MAIN if name in random.sensitivity), None)
    if name is None:
        return
    columns = [np.asarray(values[place]).tolist() for values in random.sensitivity[name]]
    rows: list[Row] = []
    for law, first, total, *intervals in zip(random.design.laws, *columns, strict=True):
        cells: list[Cell] = []
        for value, (low, high) in zip((first, total), intervals, strict=True):
            cells += [number_with_unit(value, digits=4), f"{low:.4g} to {high:.4g}"]
        rows.append((law, *cells))
    header = ("value", "first-order index", "95 %", "total index", "95 %")
    yield from page_table(rows, header, f"Sensitivity of {name.replace('_', ' ')}{label}")


def _pictures(name: str, sweep: SweepResult) -> Iterator[PageBlock]:
    """Yield the map of a sweep; probabilities, indices and scatter of a random sweep."""
    named = {name: sweep}
    what = described(FOUND if FOUND in sweep.summary else PEAK).capitalize()
    if sweep.random is not None:
        yield from figures.drawn(
            PictureKind.EXCEEDANCE, named, f"{what}: probability of exceedance."
        )
        yield from figures.drawn(PictureKind.SENSITIVITY, named, f"{what}: sensitivity indices.")
        scattered = f"{what} over the random values."
        several = len(sweep.random.design.laws) > 1
        width: Width = "full" if several else "column"
        yield from figures.drawn(PictureKind.SCATTER, named, scattered, wide=several, width=width)
        return
    yield from figures.drawn(PictureKind.MAP, named, f"{what} over the varied values.")


def _deck(
    name: str, sweep: SweepResult, digests: Mapping[str, str], *, full: bool
) -> Iterator[PageBlock]:
    """Yield checksums, time steps, and the deck."""
    text = sweep.deck_text
    unit = unit_of("time", sweep.units)
    steps = [quantity(dt, unit, DECK_DIGITS) for dt in np.unique(sweep.dt).tolist()]
    rows: list[Row] = [
        ("cases", ShownNumber(len(sweep), str(len(sweep)))),
        ("size of the time step", ", ".join(steps[:4]) + (", …" if len(steps) > 4 else "")),
        ("deck, SHA-256", hashlib.sha256(text.encode()).hexdigest()),
    ]
    if name in digests:
        rows.append(("result, SHA-256", digests[name]))
    yield from page_table(rows, title="Checksums")
    yield listing("The deck", text if full else short_deck(text))
