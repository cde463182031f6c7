"""Statistics of a random sweep: Sobol' indices with their intervals, quantiles, probabilities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats

QUANTILES = (0.01, 0.05, 0.5, 0.95, 0.99)
# Resamples of the bootstrap, and counts of them in memory at once.
RESAMPLES = 1000
COUNTS = 2_000_000
# Ends of a 95 % interval.
ENDS = (0.025, 0.975)
Z = 1.959963984540054  # the standard normal distribution is 0.975 there
# Variation relative to the largest value below which a quantity is constant.
ROUNDING = 1e-12


class Indices(NamedTuple):
    """Sobol' indices of a quantity; with varied values, the combinations come first."""

    first: Floats  # (d,): first-order index of each random value
    total: Floats  # (d,): total index
    first_interval: Floats  # (d, 2): 95 % interval
    total_interval: Floats  # (d, 2)


class Statistics(NamedTuple):
    """Statistics of a quantity over the draws that have a value."""

    draws: NDArray[np.int64]  # number of them
    mean: Floats
    standard_deviation: Floats
    quantiles: Floats  # (5,): at the probabilities `QUANTILES`


def indices(values: Floats, seed: int) -> Indices:
    """Estimate the first-order and total Sobol' indices of quantities.

    The variance is that over A and B together, the values are taken relative to their mean there,
    which does not change the expected values.  The intervals are percentiles of bootstraps
    over the rows of the matrices.

    Parameters
    ----------
    values : ndarray (m, d + 2, n)
        Quantities of the rows of A, B, and A with column i of B.
    seed : int
        Of the bootstraps.

    Returns
    -------
    Indices
        (m, d) and (m, d, 2); NaN of a quantity that is constant or lacks values.

    References
    ----------
    .. [1] A. Saltelli et al., Computer Physics Communications 181 (2010) 259, table 2 (b), (f).

    Examples
    --------
    >>> generator = np.random.default_rng(0)
    >>> a, b = generator.normal(size=(2, 4096, 2))
    >>> ab, ba = np.column_stack([b[:, 0], a[:, 1]]), np.column_stack([a[:, 0], b[:, 1]])
    >>> values = np.array([[x @ [3.0, 4.0] for x in (a, b, ab, ba)]])
    >>> indices(values, 0).total.round(1)
    array([[0.4, 0.6]])
    """
    m, rows, n = values.shape
    d = rows - 2
    flat = values.reshape(m, -1)
    with np.errstate(invalid="ignore"):
        size = np.abs(flat).max(axis=1)
        varies = np.ptp(flat[:, : 2 * n], axis=1) > ROUNDING * size
    centred = values - values[:, :2].mean(axis=(1, 2), keepdims=True)
    f_a, f_b, f_ab = centred[:, :1], centred[:, 1:2], centred[:, 2:]
    # Means of these columns make the indices: those of f, f^2, and the products, (m, 2 + 2 d, n).
    columns = np.concatenate(
        [(f_a + f_b) / 2.0, (f_a**2 + f_b**2) / 2.0, f_b * (f_ab - f_a), (f_a - f_ab) ** 2 / 2.0],
        axis=1,
    )
    columns[~varies] = np.nan

    def ratios(means: Floats) -> Floats:
        """First-order and total indices (..., m, 2 d) from means (..., m, 2 + 2 d)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(means[..., 2:] / (means[..., 1] - means[..., 0] ** 2)[..., None])

    generator = np.random.default_rng([seed, 1])
    step = max(1, COUNTS // n)
    table = columns.reshape(-1, n).T
    resampled = np.concatenate([
        # einsum, because the last digits of a product by BLAS may depend on its threads
        np.einsum("rn,nm->rm", generator.multinomial(n, np.full(n, 1.0 / n), count) / n, table)
        for start in range(0, RESAMPLES, step)
        for count in [min(step, RESAMPLES - start)]
    ])  # fmt: skip
    found = ratios(columns.mean(axis=2))
    ends = np.moveaxis(np.quantile(ratios(resampled.reshape(-1, m, rows + d)), ENDS, axis=0), 0, 2)
    return Indices(found[:, :d], found[:, d:], ends[:, :d], ends[:, d:])


def statistics(values: Floats) -> Statistics:
    """Return the statistics of draws (..., n); NaN are left out."""
    kept = [row[np.isfinite(row)] for row in values.reshape(-1, values.shape[-1])]
    shape = values.shape[:-1]
    none = np.full(len(QUANTILES), np.nan)
    return Statistics(
        np.array([len(row) for row in kept]).reshape(shape),
        np.array([row.mean() if len(row) else np.nan for row in kept]).reshape(shape),
        np.array([row.std(ddof=1) if len(row) > 1 else np.nan for row in kept]).reshape(shape),
        np.array([np.quantile(row, QUANTILES) if len(row) else none for row in kept]).reshape(
            *shape, len(QUANTILES)
        ),
    )


def wilson(hits: NDArray[np.int64], count: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Ends of Wilson's 95 % interval of a probability (E. B. Wilson, JASA 22, 1927, 209).

    Examples
    --------
    >>> low, high = wilson(np.array([0]), np.array([96]))
    >>> low.round(3), high.round(3)
    (array([0.]), array([0.038]))
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = hits / count
        middle = share + Z**2 / (2.0 * count)
        half = Z * np.sqrt(share * (1.0 - share) / count + (Z / (2.0 * count)) ** 2)
        scale = 1.0 + Z**2 / count
        return np.maximum(0.0, (middle - half) / scale), np.minimum(1.0, (middle + half) / scale)
