"""Results of cases beside measured columns of the same names: ratios, bias and rms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fecm._errors import StudyError
from fecm._typing import Bools, Floats
from fecm.deck.units import quantity
from fecm.sweeps.outcome import MEASURED
from fecm.sweeps.stored import StoredSweep

RATIOS = "computed over measured"
BAND = 0.1  # relative difference up to which a computed value counts as equal to the measured one


@dataclass(frozen=True, eq=False)
class CaseComparison:
    """Computed and measured values of one quantity of a sweep; ``str()`` is a summary in one line.

    Attributes
    ----------
    name : str
        Name of the computed column, such as ``"peak_force"``.
    unit : str
        Unit of both columns; empty for a pure number, or if the deck names no units.
    computed, measured : ndarray (n,)
        Values of every case; NaN where there is none. A computed value that the end of a case does
        not decide is NaN too.
    """

    name: str
    unit: str
    computed: Floats
    measured: Floats

    @property
    def pairs(self) -> Bools:
        """Mask of the cases that have both values, (n,)."""
        return np.isfinite(self.computed) & np.isfinite(self.measured)

    @property
    def ratio(self) -> Floats:
        """Computed over measured values, (n,); NaN without both, or where the measured one is 0."""
        divisors = np.where(self.pairs & (self.measured != 0.0), self.measured, np.nan)
        return np.asarray(self.computed / divisors)

    @property
    def ratio_statistics(self) -> tuple[float, float, float]:
        """Mean, smallest and largest ratio; NaN if no case has one."""
        known = self.ratio[np.isfinite(self.ratio)]
        if not len(known):
            return math.nan, math.nan, math.nan
        return float(known.mean()), float(known.min()), float(known.max())

    @property
    def differences(self) -> Floats:
        """Computed minus measured values of the pairs."""
        return self.computed[self.pairs] - self.measured[self.pairs]

    @property
    def bias(self) -> float:
        """Mean of computed minus measured values; positive if the computed ones are larger."""
        return float(self.differences.mean())

    @property
    def rms(self) -> float:
        """Root of the mean square of computed minus measured values."""
        return float(np.sqrt(np.mean(self.differences**2)))

    @property
    def within(self) -> int:
        """Number of cases whose ratio differs from 1 by at most 10 %."""
        return int(np.count_nonzero(np.abs(self.ratio - 1.0) <= BAND))

    def __str__(self) -> str:
        bias, rms = (quantity(value, self.unit) for value in (self.bias, self.rms))
        return f"{ratios_in_words(self)}; bias {bias}, rms of the difference {rms}"


def ratios_in_words(compared: CaseComparison) -> str:
    """Return mean and range of the ratios, and how many are near 1."""
    count, (mean, low, high) = int(compared.pairs.sum()), compared.ratio_statistics
    near = f"{compared.within} of {count} within {100.0 * BAND:g} %"
    return f"{RATIOS} {mean:.3g} ({low:.3g} to {high:.3g}), {near}"


def compared_columns(sweep: StoredSweep) -> dict[str, str]:
    """Return the measured columns that results of a sweep are compared with, by the results' names.

    A measured column is named after a result, as in ``measured_peak_force``; capitals do not
    matter. Its values are numbers in the unit of the result, or without a unit.
    """
    columns = {name.removeprefix(MEASURED).casefold(): name for name in sweep.measured}
    pairs = {name: columns[name.casefold()] for name in sweep.summary if name.casefold() in columns}
    return {name: column for name, column in pairs.items() if _is_comparable(sweep, name, column)}


def _is_comparable(sweep: StoredSweep, name: str, column: str) -> bool:
    """Return whether both columns have numbers in the same unit, and a case has both values."""
    if any(sweep[n].dtype.kind != "f" or sweep[n].ndim > 1 for n in (name, column)):
        return False
    is_pair = np.isfinite(_computed(sweep, name)) & np.isfinite(sweep[column])
    return sweep.unit(column) in ("", sweep.unit(name)) and bool(is_pair.any())


def _computed(sweep: StoredSweep, name: str) -> Floats:
    """Return a result of the cases; NaN for cases that failed."""
    return np.where(sweep.completed, sweep.summary[name], np.nan)


def compare_cases(sweep: StoredSweep, name: str = "") -> CaseComparison:
    """Compare a result of the cases with the measured column of its name.

    The default is the first result that has one. Raises StudyError if there is no such pair of
    columns.
    """
    columns = compared_columns(sweep)
    name = name or next(iter(columns), "peak_force")
    if name not in columns:
        others = f"; there are {', '.join(columns)}" if columns else ""
        raise StudyError(
            f"the sweep has no measured values of {name}{others}; a column of the table of cases "
            f"is compared if it is named after a result, as in `{MEASURED}{name}`, has numbers in "
            "its unit, and a case has both values"
        )
    return CaseComparison(
        name, sweep.unit(name), _computed(sweep, name), np.asarray(sweep.measured[columns[name]])
    )


def comparisons(sweep: StoredSweep) -> list[CaseComparison]:
    """Return the comparisons of all results that have measured columns."""
    return [compare_cases(sweep, name) for name in compared_columns(sweep)]
