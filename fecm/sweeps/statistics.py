"""Statistics of random values: moments and quantiles, Sobol' indices, and probabilities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats

Counts = NDArray[np.int64]
QUANTILES = (0.01, 0.05, 0.5, 0.95, 0.99)
RESAMPLES = 1000  # of the bootstrap
COUNTS_AT_ONCE = 2_000_000  # of the resamples in memory
INTERVAL_ENDS = (0.025, 0.975)  # of a 95 % interval
Z = 1.959963984540054  # the standard normal distribution is 0.975 there
ROUNDING = 1e-12  # variation relative to the largest value below which a quantity is constant


class Statistics(NamedTuple):
    """Statistics of a quantity over the draws that have a value.

    Attributes
    ----------
    draws : ndarray of int
        Number of them.
    mean, standard_deviation : ndarray
        Of the quantity.
    quantiles : ndarray (5,)
        At the probabilities 1, 5, 50, 95 and 99 %.
    """

    draws: NDArray[np.int64]
    mean: Floats
    standard_deviation: Floats
    quantiles: Floats  # at `QUANTILES`


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
    return Statistics(*(a.reshape((*values.shape[:-1], *a.shape[1:])) for a in arrays))


def indices(values: Floats, seed: int) -> Indices:
    """Estimate the first-order and total Sobol' indices of quantities.

    `values` (m, d + 2, n) are those of the rows of A, B, and A with column i of B.  The indices are
    those of Saltelli et al., Computer Physics Communications 181 (2010) 259, table 2 (b) and (f);
    NaN of a quantity that is constant or lacks values.  The variance is that over A and B together.
    The values are taken relative to their mean there, which does not change the expected values.
    The intervals are percentiles of bootstraps over the rows of the matrices.
    """
    m, rows, n = values.shape
    d = rows - 2
    values = np.where(np.isfinite(values), values, np.nan)
    flat = values.reshape(m, -1)
    with np.errstate(invalid="ignore"):
        varies = np.ptp(flat[:, : 2 * n], axis=1) > ROUNDING * np.abs(flat).max(axis=1)
    centred = values - values[:, :2].mean(axis=(1, 2), keepdims=True)
    f_a, f_b, f_ab = centred[:, :1], centred[:, 1:2], centred[:, 2:]
    # Means of these columns make the indices: those of f, f^2, and the products, (m, 2 + 2 d, n).
    means = (f_a + f_b) / 2.0, (f_a**2 + f_b**2) / 2.0
    columns = np.concatenate([*means, f_b * (f_ab - f_a), (f_a - f_ab) ** 2 / 2.0], axis=1)
    columns[~varies] = np.nan

    def ratios(means: Floats) -> Floats:
        """First-order and total indices (..., m, 2 d) from means (..., m, 2 + 2 d)."""
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
    found = ratios(columns.mean(axis=2))
    ends = np.moveaxis(
        np.quantile(ratios(resampled.reshape(-1, m, rows + d)), INTERVAL_ENDS, axis=0), 0, 2
    )
    return Indices(found[:, :d], found[:, d:], ends[:, :d], ends[:, d:])


def bounds(hits: Counts, count: Counts, lacking: Counts) -> tuple[Floats, Floats, Floats]:
    """Probability of exceeding a limit, and the ends of an interval that holds for all draws.

    `hits` of `count` draws exceed the limit, and it is not known whether `lacking` more do.  The
    probability is NaN if there are any: the draws that are open are not a random choice.  The
    interval is Wilson's from its lower end, if none of them does, to its upper end, if all do.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(lacking > 0, np.nan, hits / count)
    lower, _ = wilson(hits, count + lacking)
    _, upper = wilson(hits + lacking, count + lacking)
    return share, lower, upper


def wilson(hits: Counts, count: Counts) -> tuple[Floats, Floats]:
    """Ends of Wilson's 95 % interval of a probability (E. B. Wilson, JASA 22, 1927, 209)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = hits / count
        middle = share + Z**2 / (2.0 * count)
        half = Z * np.sqrt(share * (1.0 - share) / count + (Z / (2.0 * count)) ** 2)
        scale = 1.0 + Z**2 / count
        lower, upper = (middle - half) / scale, (middle + half) / scale
    return np.where(hits == 0, 0.0, lower), np.where(hits == count, 1.0, upper)
