"""Lines of the result of a random sweep."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from fecm._text import significant
from fecm.deck.units import column_name
from fecm.sweeps.copula import pairs_of
from fecm.sweeps.limits import THRESHOLD
from fecm.sweeps.random_result import RandomResult
from fecm.sweeps.statistics import QUANTILES

MOST_PRINTED = 4  # quantities of :data:`MAIN`, and combinations
TOUGHNESS = "giic"
MARGIN = ("threshold_margin",)  # the quantity that toughness affects
MAIN = (
    "found_velocity",
    "found_energy",
    "peak_force",
    "max_indentation",
    "contact_time",
    "energy_absorbed",
)


def tables(random: RandomResult, unit: Callable[[str], str]) -> list[str]:
    """Lines of the most important quantities: statistics, indices and probabilities."""
    design, found = random.design, random.exceedance
    lines = [f"design            {design.kind}, {design.samples} samples, seed {design.seed}"]
    lines += [
        f"random            {column_name(name, unit(name))} {law}"
        for name, law in design.laws.items()
    ]
    lines += [
        f"correlation       {a}, {b} {value:.6g}"
        for (a, b), value in pairs_of([*design.laws], design.correlation).items()
        if value
    ]
    chosen = [name for name in MAIN if name in random.statistics][:MOST_PRINTED]
    labels = ["mean", "std. dev.", *(f"{q:.0%}".replace("%", " %") for q in QUANTILES)]
    count = len(next(iter(random.combinations.values()), [0]))
    for number in range(min(count, MOST_PRINTED)):
        place = (number,) if random.combinations else ()
        lines += ["", *([random.label(number)] if place else [])]
        own = [random.statistics[name] for name in chosen]
        rows = [[s.mean[place], s.standard_deviation[place], *s.quantiles[place]] for s in own]
        columns = [chosen, [unit(name) for name in chosen]]
        columns += [[significant(value) for value in row] for row in zip(*rows, strict=True)]
        lacking = [design.draws - int(s.draws[place]) for s in own]
        columns.append([str(count) for count in lacking] if any(lacking) else [""] * len(own))
        lines += [
            f"{label:12}{''.join(f'{text:>16}' for text in row)}".rstrip()
            for label, row in zip(["", "", *labels, "no value"], columns, strict=True)
            if any(row)
        ]
        if random.sensitivity:
            for name in (chosen[0], *(MARGIN if TOUGHNESS in design.laws else ())):
                lines += ["", *_index_lines(random, name, place)]
        for row, (name, limit) in enumerate(zip(found.quantity, found.limit, strict=True)):
            p, low, high, n, lacking = (values[(*place, row)] for values in found[2:])
            value = THRESHOLD if np.isnan(limit) else f"{limit:.6g}"
            lines.append(f"P({name} > {value}) = {chance(p, low, high, lacking, design.draws - n)}")
    if count > MOST_PRINTED:
        lines += ["", f"{count - MOST_PRINTED} more combinations of varied values are in the file"]
    return lines


def chance(p: float, low: float, high: float, is_open: int, lacking: int) -> str:
    """A probability, its interval and the number of draws without a value, in words."""
    text = (
        f"{'open' if np.isnan(p) else significant(p)} ({significant(low)} to {significant(high)})"
    )
    if is_open:
        text += f"; {is_open} draws are open, counted as below and as above"
    if lacking > is_open:
        text += f"; {lacking - is_open} draws have no value"
    return text


def _index_lines(random: RandomResult, name: str, place: tuple[int, ...]) -> Iterator[str]:
    laws = random.design.laws
    width = max(12, *map(len, (name, *laws)))
    yield f"{name:{width}}{'first-order index (95 %)':>29}{'total index (95 %)':>29}"
    columns = [values[place].tolist() for values in random.sensitivity[name]]
    for law, first, total, *intervals in zip(laws, *columns, strict=True):
        texts = [
            f"{value:.4f} ({low:.4f} to {high:.4f})"
            for value, (low, high) in zip((first, total), intervals, strict=True)
        ]
        yield f"{law:{width}}{texts[0]:>29}{texts[1]:>29}"
