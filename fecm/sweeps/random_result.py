"""Results of a random sweep: statistics, sensitivity indices and probabilities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.results.metrics import THRESHOLD_FORCE, VALIDITY, VERDICTS
from fecm.results.validity import Reason
from fecm.sweeps.limits import THRESHOLD, Limit, check_limits
from fecm.sweeps.outcome import Column, Status, was_run
from fecm.sweeps.random import REMEDY, Design
from fecm.sweeps.statistics import Counts, Indices, Statistics, bounds, indices, statistics

Columns = Mapping[str, Column]
MANY_FAILED = 0.01  # share of failed draws above which the results are doubtful


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
    lower: Floats  # of :func:`bounds`, as `upper`
    upper: Floats
    draws: NDArray[np.int64]
    open: NDArray[np.int64]


@dataclass(frozen=True)
class RandomResult:
    """Results of a random sweep.

    With varied values, arrays have one more axis, the first: the combinations of these values.

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
        Empty unless asked for; NaN of a quantity that is constant or lacks values.
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
    statistics: dict[str, Statistics]
    sensitivity: dict[str, Indices]
    exceedance: Exceedance
    combinations: dict[str, Column] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        tables = *self.statistics.values(), *self.sensitivity.values(), self.exceedance
        for values in (*self.combinations.values(), *(one for table in tables for one in table)):
            if isinstance(values, np.ndarray):
                values.flags.writeable = False

    def label(self, combination: int) -> str:
        """Varied values of a combination, in words."""
        return ", ".join(f"{n} {values[combination]}" for n, values in self.combinations.items())


def evaluate(
    design: Design, cases: Columns, summary: Columns, limits: Sequence[Limit]
) -> RandomResult:
    """Evaluate the cases of a random sweep, (combinations * rows,) each."""
    fine, is_open = was_run(summary["status"]), open_ends(summary)
    combinations = {n: v[:: design.rows] for n, v in cases.items() if n not in design.laws}
    shape = (-1, design.rows) if combinations else (design.rows,)
    columns = {
        name: np.where(fine, values, np.nan).reshape(shape)
        for name, values in summary.items()
        if name not in VERDICTS
    }
    draws = {name: values[..., : design.draws] for name, values in columns.items()}
    check_limits(limits, list(columns), threshold=THRESHOLD_FORCE in columns)
    return RandomResult(
        design=design,
        statistics={name: statistics(values) for name, values in draws.items()},
        sensitivity=_sensitivity(design, columns) if design.sensitivity else {},
        exceedance=exceedances(draws, is_open.reshape(shape)[..., : design.draws], limits),
        combinations=combinations,
        notes=tuple(_notes(design, columns, fine)),
    )


def _sensitivity(design: Design, columns: Columns) -> dict[str, Indices]:
    """Indices of all quantities."""
    table = np.array(list(columns.values()))
    flat = table.reshape(-1, len(design.laws) + 2, design.samples)
    parts = [
        part.reshape(*table.shape[:-1], *part.shape[1:]) for part in indices(flat, design.seed)
    ]
    return {name: Indices(*(part[row] for part in parts)) for row, name in enumerate(columns)}


def _notes(design: Design, columns: Columns, fine: Bools) -> Iterator[str]:
    """What is doubtful about the results."""
    failed = int((~fine).sum())
    if failed > MANY_FAILED * len(fine):
        text = "of the draws failed, and the statistics are those of the others"
        yield f"{failed / len(fine):.3%} {text}; {REMEDY}"
    if design.sensitivity:
        missing = {name: int(np.isnan(values).sum()) for name, values in columns.items()}
        if names := [name for name, count in missing.items() if 0 < count < len(fine)]:
            text = f"{', '.join(names)} ({max(missing.values())} of {len(fine)} cases)"
            yield f"no indices where a case has no value: {text}"


def open_ends(summary: Columns) -> Bools:
    """Cases that were run and ended before their contact was over, so that values are open."""
    validity = summary.get(VALIDITY, summary["status"])
    open_peaks = [np.char.find(validity, reason) >= 0 for reason in (Reason.OPEN, Reason.AGAIN)]
    return np.asarray((summary["status"] == Status.STILL) | np.any(open_peaks, axis=0))


def exceedances(draws: Columns, is_open: Bools, limits: Sequence[Limit]) -> Exceedance:
    """Probabilities that quantities (..., draws) exceed limits."""
    thresholds = draws.get(THRESHOLD_FORCE, np.full(1, np.nan))
    known = thresholds[np.isfinite(thresholds)]
    common = known[0] if len(known) and not np.ptp(known) else np.nan
    over = [
        draws[limit.quantity] - (thresholds if limit.value == THRESHOLD else limit.value)
        for limit in limits
    ]
    combinations = next(iter(draws.values())).shape[:-1]

    def counted(which: Sequence[Bools]) -> Counts:
        """Draws of every combination and limit."""
        sums = np.array([one.sum(axis=-1) for one in which], dtype=np.int64)
        return sums.reshape(len(limits), *combinations).T

    count = counted([np.isfinite(one) for one in over])
    hits = counted([one > 0.0 for one in over])
    lacking = counted([np.isnan(one) & is_open for one in over])
    probability, lower, upper = bounds(hits, count, lacking)
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
