"""Correlated random values: a Gaussian copula joins the laws of the values.

The values of each name keep their law.  Their normal scores, the values of the standard normal law
at the same probabilities, have a joint normal distribution with the given correlations; those of a
normal law are the values themselves, but for mean and scale.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.sweeps.case import CasesError, number
from fecm.sweeps.distributions import standard_normal, standard_normal_probability

Correlation = tuple[tuple[float, ...], ...]  # (d, d): rows of the matrix
Pair = tuple[str, str]
ROUNDING = 1e-9  # of a matrix that is symmetric, or has a diagonal of 1


def parse_correlation(text: str) -> tuple[Pair, float]:
    """Read ``NAME,NAME=RHO``; CasesError if the text has another form."""
    names, equals, value = text.partition("=")
    pair = tuple(name.strip() for name in names.split(","))
    if not equals or len(pair) != 2:
        raise CasesError(f"`{text}`: write NAME,NAME=RHO, such as e1,e2=0.6")
    return (pair[0], pair[1]), number(f"RHO of {names.strip()}", value)


def correlation_of(names: Sequence[str], given: object) -> Correlation:
    """Correlation matrix in the order of `names`; CasesError if it is none.

    Given are correlations by pairs of names, or the whole matrix: in the order of the names, or
    with names as a DataFrame has them.
    """
    matrix = _of_pairs(names, given) if isinstance(given, Mapping) else _of_table(names, given)
    diagonal = matrix.diagonal()
    if np.abs(matrix - matrix.T).max() > ROUNDING or np.abs(diagonal - 1.0).max() > ROUNDING:
        raise CasesError("correlation: the matrix must be symmetric, with 1 on its diagonal")
    if (least := float(np.linalg.eigvalsh(matrix).min())) <= ROUNDING:
        raise CasesError(
            "correlation: the matrix is not positive definite, so no values have these "
            f"correlations: its least eigenvalue is {least:.3g}"
        )
    return tuple(map(tuple, matrix.tolist()))


def _of_pairs(names: Sequence[str], given: Mapping[Any, Any]) -> Floats:
    """Matrix of correlations by pairs of names; others are 0."""
    matrix = np.eye(len(names))
    seen: set[frozenset[str]] = set()
    for pair, value in given.items():
        if not (isinstance(pair, tuple) and len(pair) == 2 and {*pair} <= {*names}):
            known = ", ".join(names)
            raise CasesError(f"correlation: {pair!r} is not a pair of random names ({known})")
        if len(both := frozenset(pair)) < 2 or both in seen:
            raise CasesError(f"correlation: {', '.join(pair)} is one name, or is given twice")
        rho = math.nan
        with suppress(TypeError, ValueError):
            rho = float(value)
        if not abs(rho) < 1.0:
            text = f"must be between -1 and 1, not {value}"
            raise CasesError(f"correlation of {', '.join(pair)} {text}")
        seen.add(both)
        row, column = map(names.index, pair)
        matrix[row, column] = matrix[column, row] = rho
    return matrix


def _of_table(names: Sequence[str], given: Any) -> Floats:
    """Matrix from an array, or from a table whose rows and columns have names."""
    size = len(names)
    try:
        if hasattr(given, "columns"):
            given = [[given[column][row] for column in names] for row in names]
        matrix = np.array(given, dtype=float)
    except (KeyError, TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise CasesError(
            f"correlation must be a matrix of {size} x {size} numbers, one row for each of "
            f"{', '.join(names)}, or numbers by pairs of names"
        )
    return matrix


def pairs_of(names: Sequence[str], correlation: Correlation) -> dict[Pair, float]:
    """Correlations by pairs of names, each pair once."""
    places = itertools.combinations(range(len(correlation)), 2)
    return {(names[row], names[column]): correlation[row][column] for row, column in places}


def correlated(unit: Floats, correlation: Correlation, *, stratified: bool) -> Floats:
    """Correlate independent uniform values (n, d).

    Of a Latin hypercube (`stratified`) the values of each column are kept and put into the order of
    the correlated ones, so that each of n intervals has one still (M. Stein, Technometrics 29,
    1987, 143).
    """
    factor = np.linalg.cholesky(np.array(correlation))
    # einsum, because the last digits of a product by BLAS may depend on its threads
    scores = np.einsum("nj,ij->ni", standard_normal(unit), factor)
    if not stratified:
        return standard_normal_probability(scores)
    ranks = scores.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable")
    return np.take_along_axis(np.sort(unit, axis=0), ranks, axis=0)
