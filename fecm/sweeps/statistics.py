"""Results of a random sweep: statistics, sensitivity indices and probabilities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._arrays import compared_by_identity
from fecm._table import Row, Table, html_table
from fecm._text import significant
from fecm._typing import Bools, Floats
from fecm.judge.end import MAY_TOUCH, PEAK_NOT_REACHED
from fecm.results.metrics import THRESHOLD_FORCE, VALIDITY, VERDICTS
from fecm.sweeps.limits import PEAK_FORCE, THRESHOLD, Limit, check_limits
from fecm.sweeps.outcome import Column, Status, was_run
from fecm.sweeps.random import REMEDY, Design

Counts = NDArray[np.int64]
QUANTILES = (0.01, 0.05, 0.5, 0.95, 0.99)
RESAMPLES = 1000  # of the bootstrap
COUNTS_AT_ONCE = 2_000_000  # of the resamples in memory
INTERVAL_ENDS = (0.025, 0.975)  # of a 95 % interval
Z = 1.959963984540054  # the standard normal distribution is 0.975 there
ROUNDING = 1e-12  # variation relative to the largest value below which a quantity is constant


@compared_by_identity
class Statistics(NamedTuple):
    """Statistics of a quantity over the draws that have a value.

    Attributes
    ----------
    draws : int
        Number of these draws; with varied values, an array (combinations,), as the others.
    mean, standard_deviation : float
        Mean and standard deviation of the quantity.
    quantiles : ndarray (5,)
        Quantiles at the probabilities 1, 5, 50, 95 and 99 %.
    """

    draws: NDArray[np.int64]
    mean: Floats
    standard_deviation: Floats
    quantiles: Floats  # at `QUANTILES`


@compared_by_identity
class Indices(NamedTuple):
    """Sobol' indices of a quantity; with varied values, the combinations come first.

    Attributes
    ----------
    first, total : ndarray (d,)
        First-order and total index of each of the d random values.
    first_interval, total_interval : ndarray (d, 2)
        Their 95 % intervals.
    """

    first: Floats
    total: Floats
    first_interval: Floats
    total_interval: Floats


class QuantityStatistics(dict[str, Statistics]):
    """Statistics by quantity, which notebooks show as a table."""

    def _repr_html_(self) -> str:
        labels = ("mean", "std. dev.", *(f"{q:.0%}".replace("%", " %") for q in QUANTILES))
        rows: list[Row] = []
        for name, moments in self.items():
            if np.ndim(moments.mean) == 0:
                values = (moments.mean, moments.standard_deviation, *moments.quantiles)
                rows.append((name, *(significant(float(value)) for value in values)))
            else:  # with varied values
                rows.append((name, f"{len(moments.mean)} combinations", *[""] * len(labels[1:])))
        return html_table(Table(tuple(rows), ("", *labels), "Statistics"))


def statistics(values: Floats) -> Statistics:
    """Return the statistics of draws (..., n); NaN are left out."""
    kept = [row[np.isfinite(row)] for row in values.reshape(-1, values.shape[-1])]
    none = np.full(len(QUANTILES), np.nan)
    columns = (
        [len(row) for row in kept],
        [row.mean() if len(row) else np.nan for row in kept],
        [row.std(ddof=1) if len(row) > 1 else np.nan for row in kept],
        [np.quantile(row, QUANTILES) if len(row) else none for row in kept],
    )
    arrays = map(np.array, columns)
    # The index () makes a number of an array without axes.
    return Statistics(*(a.reshape((*values.shape[:-1], *a.shape[1:]))[()] for a in arrays))


def indices(values: Floats, seed: int) -> Indices:
    """Estimate the first-order and total Sobol' indices of quantities.

    `values` (m, d + 2, n) belong to the rows of A, B, and A with column i of B. The estimators are
    table 2 (b) and (f) of Saltelli et al., Computer Physics Communications 181 (2010) 259. Indices
    of a quantity that is constant or lacks values are NaN. The variance is taken over A and B
    together. The values are taken relative to their mean there, which does not change the expected
    values. The intervals are percentiles of bootstraps over the rows of the matrices.
    """
    m, rows, n = values.shape
    d = rows - 2
    values = np.where(np.isfinite(values), values, np.nan)
    flat = values.reshape(m, -1)
    with np.errstate(invalid="ignore"):
        varies = np.ptp(flat[:, : 2 * n], axis=1) > ROUNDING * np.abs(flat).max(axis=1)
    centred = values - values[:, :2].mean(axis=(1, 2), keepdims=True)
    f_a, f_b, f_ab = centred[:, :1], centred[:, 1:2], centred[:, 2:]
    # The indices follow from means of f, f^2, and the products, (m, 2 + 2 d, n).
    means = (f_a + f_b) / 2.0, (f_a**2 + f_b**2) / 2.0
    columns = np.concatenate([*means, f_b * (f_ab - f_a), (f_a - f_ab) ** 2 / 2.0], axis=1)
    columns[~varies] = np.nan

    def ratios(means: Floats) -> Floats:
        """Return first-order and total indices (..., m, 2 d) from means (..., m, 2 + 2 d)."""
        variance = means[..., 1] - means[..., 0] ** 2
        variance = np.where(variance > 0.0, variance, np.nan)  # else there are no indices
        return np.asarray(means[..., 2:] / variance[..., None])

    generator = np.random.default_rng([seed, 1])
    step = max(1, COUNTS_AT_ONCE // n)
    table = columns.reshape(-1, n).T
    resampled = np.concatenate([
        # einsum, because the last digits of a product by BLAS may depend on its threads
        np.einsum("rn,nm->rm", generator.multinomial(n, np.full(n, 1.0 / n), count) / n, table)
        for start in range(0, RESAMPLES, step)
        for count in [min(step, RESAMPLES - start)]
    ])  # fmt: skip
    estimates = ratios(columns.mean(axis=2))
    ends = np.moveaxis(
        np.quantile(ratios(resampled.reshape(-1, m, rows + d)), INTERVAL_ENDS, axis=0), 0, 2
    )
    return Indices(estimates[:, :d], estimates[:, d:], ends[:, :d], ends[:, d:])


def exceedance_bounds(
    hits: Counts, count: Counts, lacking: Counts
) -> tuple[Floats, Floats, Floats]:
    """Return the probability of exceeding a limit, and the ends of an interval for all draws.

    `hits` of `count` draws exceed the limit. It is not known whether `lacking` more do. If there
    are any, the probability is NaN, as the open draws are not a random choice. The interval extends
    from Wilson's lower end if none of them exceeds the limit to Wilson's upper end if all do.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(lacking > 0, np.nan, hits / count)
    lower, _ = wilson(hits, count + lacking)
    _, upper = wilson(hits + lacking, count + lacking)
    return share, lower, upper


def wilson(hits: Counts, count: Counts) -> tuple[Floats, Floats]:
    """Return the ends of Wilson's 95 % interval of a probability.

    E. B. Wilson, JASA 22, 1927, 209.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = hits / count
        middle = share + Z**2 / (2.0 * count)
        half = Z * np.sqrt(share * (1.0 - share) / count + (Z / (2.0 * count)) ** 2)
        scale = 1.0 + Z**2 / count
        lower, upper = (middle - half) / scale, (middle + half) / scale
    return np.where(hits == 0, 0.0, lower), np.where(hits == count, 1.0, upper)


Columns = Mapping[str, Column]
MANY_FAILED = 0.01  # share of failed draws above which the results are doubtful


@compared_by_identity
class Exceedance(NamedTuple):
    """Probabilities that quantities exceed limits; with varied values, the combinations first.

    Attributes
    ----------
    quantity : ndarray of str (e,)
        Names of the quantities.
    limit : ndarray (e,)
        In the unit of the quantity; NaN: the threshold of each case.
    probability : ndarray (e,)
        Share of the draws above the limit.
    lower, upper : ndarray (e,)
        Ends of its 95 % interval, which holds for the open draws too.
    draws : ndarray of int (e,)
        Number of draws that have a value.
    open : ndarray of int (e,)
        Number of draws that ended before they had one.
    """

    quantity: NDArray[np.str_]
    limit: Floats
    probability: Floats
    lower: Floats  # of :func:`exceedance_bounds`, as `upper`
    upper: Floats
    draws: NDArray[np.int64]
    open: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class RandomResult:
    """Results of a random sweep.

    With varied values, the first axis of the arrays is the combination of these values.

    Attributes
    ----------
    design : Design
        Laws by name, samples, seed, kind, and whether sensitivity indices were asked for.
    statistics : dict of Statistics
        ``draws``, ``mean``, ``standard_deviation`` and ``quantiles`` (1, 5, 50, 95 and 99 %) of
        every quantity over the draws that have a value.
    sensitivity : dict of Indices
        Sobol' indices ``first`` and ``total`` (d,) of every quantity, in the order of
        ``design.laws``, and their 95 % intervals ``first_interval`` and ``total_interval`` (d, 2).
        Empty unless asked for; NaN for a quantity that is constant or lacks values.
    exceedance : Exceedance
        ``quantity``, ``limit``, ``probability``, its 95 % interval from ``lower`` to ``upper``,
        ``draws``, those that have a value, and ``open``, those that ended before they had one, for
        every limit asked for.
    combinations : dict of ndarray
        Varied values of every combination.
    notes : tuple of str
        What is doubtful.
    """

    design: Design
    statistics: QuantityStatistics
    sensitivity: dict[str, Indices]
    exceedance: Exceedance
    combinations: dict[str, Column] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        tables = *self.statistics.values(), *self.sensitivity.values(), self.exceedance
        for values in (
            *self.combinations.values(),
            *(values_of for table in tables for values_of in table),
        ):
            if isinstance(values, np.ndarray):
                values.flags.writeable = False

    def label(self, combination: int) -> str:
        """Format the varied values of a combination."""
        return ", ".join(f"{n} {values[combination]}" for n, values in self.combinations.items())


def evaluate(
    design: Design, cases: Columns, summary: Columns, limits: Sequence[Limit]
) -> RandomResult:
    """Evaluate the cases of a random sweep, (combinations * rows,) each."""
    combinations = {n: v[:: design.rows] for n, v in cases.items() if n not in design.laws}
    shape = (-1, design.rows) if combinations else (design.rows,)
    columns, is_open = _by_draw(summary, shape)
    draws = {name: values[..., : design.draws] for name, values in columns.items()}
    check_limits(limits, list(columns), threshold=THRESHOLD_FORCE in columns)
    return RandomResult(
        design=design,
        statistics=QuantityStatistics((n, statistics(values)) for n, values in draws.items()),
        sensitivity=_sensitivity(design, columns) if design.sensitivity else {},
        exceedance=exceedances(draws, is_open[..., : design.draws], limits),
        combinations=combinations,
        notes=tuple(_notes(design, columns, was_run(summary["status"]))),
    )


def _by_draw(summary: Columns, shape: tuple[int, ...]) -> tuple[dict[str, Floats], Bools]:
    """Return the results of the cases by draw, NaN for those that failed, and which are open."""
    fine = was_run(summary["status"])
    columns = {
        name: np.where(fine, values, np.nan).reshape(shape)
        for name, values in summary.items()
        if name not in VERDICTS
    }
    return columns, open_cases(summary).reshape(shape)


def with_threshold(random: RandomResult, summary: Columns) -> Exceedance:
    """Return the probabilities of a sweep, first that the peak reaches the delamination threshold.

    They are those of the sweep if it has this one, has no thresholds, or is a search.
    """
    stored, design = random.exceedance, random.design
    if THRESHOLD_FORCE not in summary or "found_velocity" in summary:
        return stored
    shape = (-1, design.rows) if random.combinations else (design.rows,)
    columns, is_open = _by_draw(summary, shape)
    draws = {name: columns[name][..., : design.draws] for name in (PEAK_FORCE, THRESHOLD_FORCE)}
    added = exceedances(draws, is_open[..., : design.draws], [Limit(PEAK_FORCE, THRESHOLD)])
    is_there = (stored.quantity == PEAK_FORCE) & np.isclose(
        stored.limit, added.limit, rtol=ROUNDING, equal_nan=True
    )
    if is_there.any():
        return stored
    return Exceedance(*(np.concatenate(pair, axis=-1) for pair in zip(added, stored, strict=True)))


def _sensitivity(design: Design, columns: Columns) -> dict[str, Indices]:
    """Return the indices of all quantities."""
    table = np.array(list(columns.values()))
    flat = table.reshape(-1, len(design.laws) + 2, design.samples)
    parts = [
        part.reshape(*table.shape[:-1], *part.shape[1:]) for part in indices(flat, design.seed)
    ]
    return {name: Indices(*(part[row] for part in parts)) for row, name in enumerate(columns)}


def _notes(design: Design, columns: Columns, fine: Bools) -> Iterator[str]:
    """Return doubts about the results."""
    failed = int((~fine).sum())
    if failed > MANY_FAILED * len(fine):
        text = "of the draws failed; the statistics are computed from the other draws"
        yield f"{failed / len(fine):.3%} {text}; {REMEDY}"
    if design.sensitivity:
        missing = {name: int(np.isnan(values).sum()) for name, values in columns.items()}
        if names := [name for name, count in missing.items() if 0 < count < len(fine)]:
            text = f"{', '.join(names)} ({max(missing.values())} of {len(fine)} cases)"
            yield f"no indices where a case has no value: {text}"


def open_cases(summary: Columns) -> Bools:
    """Return a mask of the cases that ended before their contact was over, with open values."""
    validity = summary.get(VALIDITY, summary["status"])
    open_peaks = [
        np.char.find(validity, doubt.reason) >= 0 for doubt in (PEAK_NOT_REACHED, MAY_TOUCH)
    ]
    return np.asarray((summary["status"] == Status.STILL) | np.any(open_peaks, axis=0))


def exceedances(draws: Columns, is_open: Bools, limits: Sequence[Limit]) -> Exceedance:
    """Return the probabilities that quantities (..., draws) exceed limits."""
    thresholds = draws.get(THRESHOLD_FORCE, np.full(1, np.nan))
    finite = thresholds[np.isfinite(thresholds)]
    common = finite[0] if len(finite) and not np.ptp(finite) else np.nan
    over = [
        draws[limit.quantity] - (thresholds if limit.value == THRESHOLD else limit.value)
        for limit in limits
    ]
    combinations = next(iter(draws.values())).shape[:-1]

    def counted(which: Sequence[Bools]) -> Counts:
        """Return the numbers of draws of every combination and limit."""
        sums = np.array([mask.sum(axis=-1) for mask in which], dtype=np.int64)
        return sums.reshape(len(limits), *combinations).T

    count = counted([np.isfinite(mask) for mask in over])
    hits = counted([mask > 0.0 for mask in over])
    lacking = counted([np.isnan(mask) & is_open for mask in over])
    probability, lower, upper = exceedance_bounds(hits, count, lacking)
    values = [common if limit.value == THRESHOLD else limit.value for limit in limits]
    return Exceedance(
        quantity=np.array([limit.quantity for limit in limits], dtype=np.str_),
        limit=np.array(values, dtype=float),
        probability=probability,
        lower=lower,
        upper=upper,
        draws=count,
        open=lacking,
    )
