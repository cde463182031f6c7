"""Random sweeps: designs of the samples, and correlations of the values.

The values of each name keep their law. Their normal scores are the values of the standard normal
law at the same probabilities. The scores have a joint normal distribution with the given
correlations. The scores of a normal law are its values, up to mean and scale.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from fecm._typing import Floats
from fecm.authoring.case import Case, CasesError, check_count, number_of_text
from fecm.authoring.values import OF_PLATE, PLATE_NAMES
from fecm.sweeps.distributions import (
    CustomDistribution,
    ValueDistribution,
    standard_normal,
    standard_normal_probability,
)

Correlation = tuple[tuple[float, ...], ...]  # (d, d): rows of the matrix
Pair = tuple[str, str]
ROUNDING = 1e-9  # rounding error of a symmetric matrix, and of a diagonal of 1


def parse_correlation(text: str) -> tuple[Pair, float]:
    """Parse ``NAME,NAME=RHO``.

    Raises CasesError if the text has another form.
    """
    names, equals, value = text.partition("=")
    pair = tuple(name.strip() for name in names.split(","))
    if not equals or len(pair) != 2:
        raise CasesError(f"`{text}`: write NAME,NAME=RHO, such as e1,e2=0.6")
    return (pair[0], pair[1]), number_of_text(f"RHO of {names.strip()}", value)


def correlation_of(names: Sequence[str], correlation: object) -> Correlation:
    """Return the correlation matrix in the order of `names`.

    Correlations are given by pairs of names, or as the whole matrix: in the order of the names, or
    with names as a DataFrame has them. Raises CasesError if the matrix is not a correlation matrix.
    """
    matrix = (
        _of_pairs(names, correlation)
        if isinstance(correlation, Mapping)
        else _of_table(names, correlation)
    )
    diagonal = matrix.diagonal()
    if np.abs(matrix - matrix.T).max() > ROUNDING or np.abs(diagonal - 1.0).max() > ROUNDING:
        raise CasesError("correlation: the matrix must be symmetric, with 1 on its diagonal")
    if (least := float(np.linalg.eigvalsh(matrix).min())) <= ROUNDING:
        raise CasesError(
            "correlation: the matrix is not positive definite, so no values have these "
            f"correlations: its least eigenvalue is {least:.3g}"
        )
    return tuple(map(tuple, matrix.tolist()))


def _of_pairs(names: Sequence[str], correlations: Mapping[Any, Any]) -> Floats:
    """Return the matrix of correlations by pairs of names; missing pairs are 0."""
    matrix = np.eye(len(names))
    seen: set[frozenset[str]] = set()
    for pair, value in correlations.items():
        if not (isinstance(pair, tuple) and len(pair) == 2 and {*pair} <= {*names}):
            known_names = ", ".join(names)
            raise CasesError(f"correlation: {pair!r} is not a pair of random names ({known_names})")
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


def _of_table(names: Sequence[str], table: Any) -> Floats:
    """Return the matrix from an array, or from a table whose rows and columns have names."""
    size = len(names)
    try:
        if hasattr(table, "columns"):
            table = [[table[column][row] for column in names] for row in names]
        matrix = np.array(table, dtype=float)
    except (KeyError, TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise CasesError(
            f"correlation must be a matrix of {size} x {size} numbers, one row for each of "
            f"{', '.join(names)}, or numbers by pairs of names"
        )
    return matrix


def pairs_of(names: Sequence[str], correlation: Correlation) -> dict[Pair, float]:
    """Return the correlations by pairs of names, each pair once."""
    places = itertools.combinations(range(len(correlation)), 2)
    return {(names[row], names[column]): correlation[row][column] for row, column in places}


def correlated(unit: Floats, correlation: Correlation, *, stratified: bool) -> Floats:
    """Correlate independent uniform values (n, d).

    A Latin hypercube (`stratified`) keeps the values of each column. They are put into the order of
    the correlated values, so that each of n intervals still has one (M. Stein, Technometrics 29,
    1987, 143).
    """
    factor = np.linalg.cholesky(np.array(correlation))
    # einsum, because the last digits of a product by BLAS may depend on its threads
    scores = np.einsum("nj,ij->ni", standard_normal(unit), factor)
    if not stratified:
        return standard_normal_probability(scores)
    ranks = scores.argsort(axis=0, kind="stable").argsort(axis=0, kind="stable")
    return np.take_along_axis(np.sort(unit, axis=0), ranks, axis=0)


DesignKind = Literal["lhs", "sobol", "mc"]
DESIGNS: tuple[DesignKind, ...] = get_args(DesignKind)
FEWEST_SAMPLES = 16
MARGIN = 2.0**-31  # from unit samples to 0 and 1: half the resolution of a Sobol' sequence
REMEDY = "truncnormal, lognormal, weibull, uniform and triangular can be kept to possible values"


class Design(NamedTuple):
    """Design of a random sweep."""

    laws: Mapping[str, ValueDistribution | CustomDistribution]  # by the names of the random values
    samples: int
    seed: int = 0
    kind: DesignKind = "lhs"
    sensitivity: bool = False  # whether all cases of the sensitivity indices are run
    correlation: Correlation = ()  # of the normal scores, in the order of laws; empty if none

    @property
    def draws(self) -> int:
        """Independent draws, which come before the others."""
        return self.samples * (2 if self.sensitivity else 1)

    @property
    def rows(self) -> int:
        """Cases of every combination of varied values."""
        return self.samples * (len(self.laws) + 2 if self.sensitivity else 1)


def design_of(
    laws: Mapping[str, ValueDistribution | CustomDistribution],
    samples: int | None,
    seed: int,
    kind: DesignKind,
    *,
    sensitivity: bool,
    correlation: Correlation = (),
) -> Design:
    """Check and create a design.  Raises CasesError if it is invalid."""
    for name, value in (("samples", samples), ("seed", seed)):
        if not isinstance(value, int | np.integer):
            raise CasesError(f"the {name} of random values must be an integer, not {value!r}")
    if samples is None or samples < FEWEST_SAMPLES:
        raise CasesError(f"{samples} samples are too few; take at least {FEWEST_SAMPLES}")
    if kind not in DESIGNS:
        raise CasesError(f"unknown design {kind}; the designs are {', '.join(DESIGNS)}")
    if seed < 0:
        raise CasesError(f"the seed must not be negative, not {seed}")
    if sensitivity and correlation:
        raise CasesError(
            "Sobol' indices need independent values; leave out sensitivity or correlation"
        )
    return Design(dict(laws), int(samples), int(seed), kind, sensitivity, correlation)


def doubt(design: Design) -> str:
    """Return a doubt about a design, or an empty text."""
    texts = [f"{name}: {text}" for name, law in design.laws.items() if (text := law.doubt())]
    if design.kind == "sobol" and design.samples & (design.samples - 1):
        why = "not a power of 2, which a balanced Sobol' design needs"
        nearest = 2 ** round(math.log2(design.samples))
        texts.append(f"{design.samples} samples are {why}; take {nearest}")
    return "; ".join(texts)


def unit_samples(kind: DesignKind, samples: int, columns: int, seed: int) -> Floats:
    """Draw a design in the unit cube, (samples, columns)."""
    generator = np.random.default_rng(seed)
    if kind == "sobol":
        from scipy.stats import qmc  # takes 0.3 s to import

        with warnings.catch_warnings(action="ignore"):  # of other numbers than powers of 2
            unit: Floats = qmc.Sobol(columns, seed=generator).random(samples)
    else:
        unit = generator.random((samples, columns))
    if kind == "lhs":  # one sample in each of N equal intervals
        cells = np.tile(np.arange(samples), (columns, 1))
        unit = (generator.permuted(cells, axis=1).T + unit) / samples
    return np.clip(unit, MARGIN, 1.0 - MARGIN)


def matrix(design: Design) -> Floats:
    """Return the random values of a design, (rows, names).

    With `sensitivity` the rows are the matrices A and B, the halves of the columns of one design,
    and for each name A with the column of B (Saltelli et al., 2010). Raises CasesError if a value
    overflows.
    """
    count, halves = len(design.laws), 2 if design.sensitivity else 1
    unit = unit_samples(design.kind, design.samples, count * halves, design.seed)
    if design.correlation:
        scores = correlated(unit, design.correlation, stratified=design.kind == "lhs")
        unit = np.clip(scores, MARGIN, 1.0 - MARGIN)
    values = np.empty_like(unit)
    for place, (name, law) in enumerate(design.laws.items()):
        try:
            values[:, place::count] = law.values(unit[:, place::count])
        except CasesError as error:
            raise CasesError(f"{name}: {error}") from error.__cause__
    if not design.sensitivity:
        return values
    a, b = np.hsplit(values, 2)
    return np.concatenate([a, b, *(np.where(chosen, b, a) for chosen in np.eye(count, dtype=bool))])


def random_cases(design: Design, varied: Sequence[Case]) -> list[Case]:
    """Return the cases of a design for each combination of varied values.

    Raises CasesError if there are too many.
    """
    for name in design.laws:
        if name in varied[0]:
            raise CasesError(f"{name} is both varied and random")
    check_count(len(varied) * design.rows)
    rows = [dict(zip(design.laws, row, strict=True)) for row in matrix(design).tolist()]
    return [{**case, **row} for case in varied for row in rows]


def cost_of_plates(cases: Sequence[Case], design: Design) -> str:
    """Say how many plates a random sweep needs, and which names cause them."""
    what = _draws(cases, design)
    of_plate = [name for name in cases[0] if name in OF_PLATE]
    plates = len({tuple(case[name] for name in of_plate) for case in cases})
    causes = [name for name in design.laws if name in PLATE_NAMES]
    if not causes:
        return f"{what} share {plates} plate{'s' * (plates > 1)}"
    why = f"because {' and '.join(causes)} {'is' if len(causes) == 1 else 'are'} random"
    sharing = "velocity, k, alpha_p, s_p, q and the projectile share one"
    return f"{what} need {plates} plates, {why}; {sharing}"


def cost_of_runs(cases: Sequence[Case], design: Design, shared: Collection[str]) -> str:
    """Say how a random sweep is run in full.

    Cases that differ only in values of the `shared` names have one run.
    """
    names = [name for name in cases[0] if name in shared]
    how = f"; those that differ only in {', '.join(names)}, together" if names else ", one by one"
    return f"{_draws(cases, design)} are run in full{how}"


def _draws(cases: Sequence[Case], design: Design) -> str:
    """Say how many draws a random sweep has, and how many cases."""
    draws = f"{design.draws} draws"
    return draws if len(cases) == design.draws else f"{len(cases)} cases of {draws}"
