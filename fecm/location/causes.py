"""Likely causes of strains that do not fit: mistakes of the table or the gages.

Every cause is tried at the candidate places and at the place of the unchanged strains, with the
hats of the search. The likeliest causes are then fitted: each gets its own place. Each gage counts
by the share of its squares that remains, so that a gage with a wrong factor does not outweigh the
others. A cause is also named if its effect shows in the sum of the squares of all gages, but not in
the noise of the weak ones. A gain that stands out when the gains of all gages are fitted is always
tried: a gain of 1.3 changes the misfit little and may hide in the noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.judge.locations import LIKELY_CAUSE
from fecm.location.fit import LocationFit, PlaceTrial
from fecm.location.search import Region

BETTER = 1.5  # least factor by which the misfit falls if a cause is named
SLIGHT = 1.1  # the same for a gain that differs much from the other gains
DISTINCT = 1.15  # smallest ratio of such a gain to the others, or the inverse
REFINED = 3  # causes that are fitted: those with the least shares at the candidates
PLACES = 6  # candidates that get a non-negative force: the best with forces of any sign
RIDGE = 1e-10  # added to the diagonal of the normal equations, over its largest entry
MOST = 12  # gages whose exchanges are tried: those with the largest remaining shares
PASSES = 4  # fits of the place and the gain in turn
LEAST = 1e-12  # share of the squares that is rounding
FEWEST = 3  # gages that are needed to find a wrong gain
ROUND = (10.0, 100.0, 1e3, 1e6)  # factors of another unit
NEAR = 0.2  # relative distance within which a factor is taken for one of these


@dataclass(frozen=True)
class Cause:
    """Likely cause of a misfit, and the factor by which the misfit falls without it."""

    text: str  # with a verb
    remedy: str
    ratio: float

    def __str__(self) -> str:
        return LIKELY_CAUSE._replace(remedy=self.remedy).say(cause=self.text, ratio=self.ratio)


class _Hypothesis(NamedTuple):
    """Hypothesis about a mistake in the table or the gages."""

    text: str
    remedy: str
    columns: tuple[int, ...]  # column of the table for each gage
    signs: tuple[float, ...]
    gain: int = -1  # gage whose gain is fitted
    zero: int = -1  # gage whose zero is fitted


class _Products(NamedTuple):
    """Inner products at a place."""

    place: tuple[float, float]
    hats: Floats  # (gages, hats, hats): of the design
    mixed: Floats  # (gages, columns, hats): of design and strains
    ones: Floats  # (gages, hats): of design and a constant
    level: Floats  # (columns,): of strains and a constant
    squares: Floats  # (columns,): of the strains
    norm: float  # square of the constant

    def without_zero(self, gage: int) -> tuple[Floats, Floats, float]:
        """Return the products of a gage without its mean: hats, mixed, squares."""
        ones, level = self.ones[gage], self.level[gage]
        hats = self.hats[gage] - np.outer(ones, ones) / self.norm
        mixed = self.mixed[gage, gage] - ones * level / self.norm
        return hats, mixed, float(self.squares[gage] - level**2 / self.norm)


class _Shares(NamedTuple):
    """Shares of the squared strains that a force at a place does not explain."""

    remains: Floats  # (gages,)
    place: tuple[float, float]
    factor: float  # measured over computed strains of the gage whose gain is fitted
    level: float  # zero of the gage whose zero is fitted


def likely_cause(
    fit: LocationFit, best: PlaceTrial, region: Region, pitch: float | None, names: list[int]
) -> Cause | None:
    """Return the likeliest cause of a misfit; None if no cause is clear.

    `best` is the fit of the unchanged strains. `names` has the numbers of the gages in messages.
    """
    places = [*_products(fit, _candidates(region, pitch, best))]
    gages = len(names)
    plain = _Hypothesis("", "", tuple(range(gages)), (1.0,) * gages)
    worst = sorted(np.argsort(-_best_shares(places, plain).remains, kind="stable")[:MOST].tolist())
    hypotheses = _hypotheses(plain, worst, names)
    trials = [(hypothesis, _best_shares(places, hypothesis)) for hypothesis in hypotheses]
    trials.sort(key=lambda pair: float(pair[1].remains.sum()))
    shares_before = _unexplained_shares(fit, best)
    causes: list[Cause] = []
    likely = trials[:REFINED]
    if gages >= FEWEST:
        odd, shares = _find_odd_gain(fit, best, region)
        likely = [(h, shares) for h, _ in trials if h.gain == odd]
        likely += [pair for pair in trials if pair[0].gain != odd][:REFINED]
    for hypothesis, shares in likely:
        remains, factor, level = _fit_hypothesis(fit, region, hypothesis, shares)
        text = hypothesis.text
        if hypothesis.gain >= 0:
            text = f"gage {names[hypothesis.gain]}, divided by {_format_factor(factor)}, explains"
        if hypothesis.zero >= 0:
            text = f"gage {names[hypothesis.zero]} less {level:.2g} explains"
        ratio = float(np.sqrt((shares_before / np.maximum(remains, LEAST)).max()))
        distinct = hypothesis.gain >= 0 and max(factor, 1.0 / factor) > DISTINCT
        if ratio >= (SLIGHT if distinct else BETTER):
            causes.append(Cause(text, hypothesis.remedy, ratio))
    return max(causes, key=lambda cause: cause.ratio, default=None)


def _find_odd_gain(fit: LocationFit, best: PlaceTrial, region: Region) -> tuple[int, _Shares]:
    """Return the gage whose gain differs most from the others, and where its fit starts."""
    free = replace(fit, gains=True)
    trial = free.refined(best, np.array([region.low, region.high]))
    apart = np.log(trial.gains) - np.median(np.log(trial.gains))
    odd = int(np.abs(apart).argmax())
    place, factor = (trial.x, trial.y), float(np.exp(apart[odd]))
    return odd, _Shares(np.zeros(len(apart)), place, factor, 0.0)


def _unexplained_shares(fit: LocationFit, trial: PlaceTrial) -> Floats:
    """Return the unexplained squares of a fit, (2,): sum of the gages' shares, and share in all."""
    observation = fit.model.observation
    squares = np.maximum(
        (observation.values**2).sum(axis=1) + observation.remainder, np.finfo(float).tiny
    )
    rest = (trial.residual**2).sum(axis=1) + observation.remainder
    return np.array([(rest / squares).sum(), rest.sum() / squares.sum()])


def _fit_hypothesis(
    fit: LocationFit, region: Region, hypothesis: _Hypothesis, shares: _Shares
) -> tuple[Floats, float, float]:
    """Fit a hypothesis; return its :func:`_unexplained_shares`, its factor and its level.

    Only the gage of the hypothesis has another factor. If the gains of all gages were free, every
    gage would explain the strains as well as the right one.
    """
    observation, factor, level = fit.model.observation, shares.factor, shares.level
    columns, signs = list(hypothesis.columns), np.array(hypothesis.signs)[:, None]
    constant = observation.of(np.ones(fit.model.responses.shape[2]))
    box = np.array([region.low, region.high])
    place, shift, gains = shares.place, 0.0, None
    passes = PASSES if hypothesis.gain >= 0 else 1
    while True:
        values, remainder = signs * observation.values[columns], observation.remainder[columns]
        if hypothesis.gain >= 0:
            values[hypothesis.gain] /= factor
            remainder[hypothesis.gain] /= factor**2
        if hypothesis.zero >= 0:
            values[hypothesis.zero] -= level * constant
        corrected = replace(observation, values=values, remainder=remainder)
        corrected_fit = replace(fit, model=replace(fit.model, observation=corrected))
        trial = corrected_fit.refined(corrected_fit.at(*place, shift, gains), box)
        place, shift, gains = (trial.x, trial.y), trial.shift, trial.gains
        passes -= 1
        if not passes:
            break
        measured = values[hypothesis.gain]
        computed = measured - trial.residual[hypothesis.gain]
        factor *= max(float(measured @ computed), LEAST) / max(float(computed @ computed), LEAST)
    if hypothesis.zero >= 0:
        level += float(trial.residual[hypothesis.zero] @ constant) / float(constant @ constant)
        values[hypothesis.zero] = observation.values[hypothesis.zero] - level * constant
        trial = corrected_fit.at(trial.x, trial.y, trial.shift, trial.gains)
    return _unexplained_shares(corrected_fit, trial), factor, level


def _hypotheses(plain: _Hypothesis, worst: list[int], names: list[int]) -> Iterator[_Hypothesis]:
    """Yield all hypotheses: signs, zeros, gains and exchanges."""
    gages = len(names)
    opposite = tuple(-sign for sign in plain.signs)
    check = "check the signs of the gages"
    yield plain._replace(text="the other sign of all gages explains", remedy=check, signs=opposite)
    for gage, name in enumerate(names):
        signs = tuple(-1.0 if n == gage else 1.0 for n in range(gages))
        text = f"gage {name} with the other sign explains"
        yield plain._replace(text=text, remedy="check its sign and direction", signs=signs)
        yield plain._replace(remedy="subtract its reading at rest", zero=gage)
        if gages >= FEWEST:
            remedy = "compare its unit and its gain with the other gages"
            yield plain._replace(remedy=remedy, gain=gage)
    for first, second in combinations(worst, 2):
        columns = list(plain.columns)
        columns[first], columns[second] = second, first
        text = f"gages {names[first]} and {names[second]} exchanged explain"
        remedy = "compare the order of the columns with the order of the gages"
        yield plain._replace(text=text, remedy=remedy, columns=tuple(columns))


def _candidates(region: Region, pitch: float | None, best: PlaceTrial) -> list[tuple[float, float]]:
    """Return the place of the unchanged strains and the candidates of the search.

    A wrong gain, zero or sign of one of several gages hardly moves the place. The candidates are
    too far apart to tell which gage has it.
    """
    x, y = region.grid(pitch)
    return [(best.x, best.y), *((u, v) for u in x.tolist() for v in y.tolist())]


def _products(fit: LocationFit, candidates: list[tuple[float, float]]) -> Iterator[_Products]:
    """Yield the inner products at the candidates."""
    observation = fit.model.observation
    values = observation.values
    constant = observation.of(np.ones(fit.model.responses.shape[2]))
    squares = np.maximum((values**2).sum(axis=1) + observation.remainder, np.finfo(float).tiny)
    level = values @ constant
    for place in candidates:
        try:
            design = fit.model.design(*place)
        except FecmError:  # a hole or a notch
            continue
        by_hat = np.ascontiguousarray(design.swapaxes(1, 2))  # (gages, hats, rows)
        mixed = (by_hat @ values.T).swapaxes(1, 2)
        yield _Products(
            place,
            by_hat @ design,
            mixed,
            by_hat @ constant,
            level,
            squares,
            float(constant @ constant),
        )


def _normal(products: _Products, hypothesis: _Hypothesis) -> tuple[Floats, Floats]:
    """Return the normal equations of the force; each gage is weighted by its squared strains."""
    matrix, vector = np.zeros(products.hats.shape[1:]), np.zeros(products.hats.shape[1])
    for gage, (column, sign) in enumerate(zip(hypothesis.columns, hypothesis.signs, strict=True)):
        if gage == hypothesis.gain:
            continue
        hats, mixed, square = (
            products.hats[gage],
            products.mixed[gage, column],
            float(products.squares[column]),
        )
        if gage == hypothesis.zero:
            hats, mixed, square = products.without_zero(gage)
        matrix += hats / square
        vector += sign / square * mixed
    matrix[np.diag_indices(len(matrix))] += RIDGE * float(np.diagonal(matrix).max()) + LEAST
    return matrix, vector


def _best_shares(places: list[_Products], hypothesis: _Hypothesis) -> _Shares:
    """Return the shares at the best candidate."""
    from scipy.optimize import nnls  # takes 0.2 s to import

    normals = [_normal(products, hypothesis) for products in places]
    factors = np.linalg.cholesky(np.array([matrix for matrix, _ in normals]))
    vectors = np.array([vector for _, vector in normals])
    roots = np.linalg.solve(factors, vectors[:, :, None])[:, :, 0]
    described = (roots**2).sum(axis=1)  # squares that forces of any sign explain
    shares_of_places = []
    for place in np.argsort(-described, kind="stable")[:PLACES].tolist():
        force = nnls(factors[place].T, roots[place], maxiter=30 * len(roots[place]))[0]
        shares_of_places.append(_shares_of_force(places[place], hypothesis, force))
    return min(shares_of_places, key=lambda shares: float(shares.remains.sum()))


def _shares_of_force(products: _Products, hypothesis: _Hypothesis, force: Floats) -> _Shares:
    """Return the shares of the squares that a force does not explain."""
    remains, factor, level = np.ones(len(hypothesis.columns)), 1.0, 0.0
    for gage, (column, sign) in enumerate(zip(hypothesis.columns, hypothesis.signs, strict=True)):
        hats, mixed, square = (
            products.hats[gage],
            products.mixed[gage, column],
            float(products.squares[column]),
        )
        if gage == hypothesis.zero:
            level = float(products.level[gage] - products.ones[gage] @ force) / products.norm
            hats, mixed, square = products.without_zero(gage)
        computed, product = float(force @ hats @ force), sign * float(mixed @ force)
        if gage == hypothesis.gain:
            if product > 0.0 and computed > 0.0:
                factor = product / computed
                remains[gage] = 1.0 - product**2 / (computed * square)
        else:
            remains[gage] = (computed - 2.0 * product + square) / square
    return _Shares(np.maximum(remains, 0.0), products.place, factor, level)


def _format_factor(factor: float) -> str:
    """Format a factor; a factor near the ratio of two units becomes this ratio."""
    for size in (*ROUND, *(1.0 / number for number in ROUND)):
        if abs(factor / size - 1.0) < NEAR:
            return f"{size:g}"
    return f"{factor:.3g}"
