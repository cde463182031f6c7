"""Verdict on a location, and likely causes of strains that do not fit.

Every cause is tried at the candidate places and at the place of the unchanged strains, with the
hats of the search. The likeliest causes are tried at the place that they lead to. Each gage counts
by the share of its squares that remains, so that a gage with a wrong factor does not outweigh the
others. A cause is also named if its effect shows in the sum of the squares of all gages, but not in
the noise of the weak ones. A gain that stands out when the gains of all gages are fitted is always
tried: a gain of 1.3 may hide in the noise, as it changes the misfit little.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.deck.units import unit_of
from fecm.identification.misfit import COLOURED
from fecm.location.fit import CLEAR, LocationFit, PlaceTrial
from fecm.location.location import Location
from fecm.location.search import Region

BETTER = 1.5  # fall of the misfit by which a cause is named
SLIGHT = 1.1  # least fall of the misfit for a gain that is far from the other gains
DISTINCT = 1.15  # such a gain over the others, or its inverse
REFINED = 3  # causes, with the least shares at the candidates, for which a place is searched
PLACES = 6  # candidates, with the least squares of coefficients of any sign, for forces
RIDGE = 1e-10  # of the normal equations, over their largest diagonal
MOST = 12  # gages whose exchanges are tried: those with the largest shares left
PASSES = 4  # of place and gain, one after the other
LEAST = 1e-12  # share of the squares that is rounding
FEWEST = 3  # gages, for one of them to have a gain of its own
ROUND = (10.0, 100.0, 1e3, 1e6)  # factors of another unit
NEAR = 0.2  # relative distance from them


@dataclass(frozen=True)
class Cause:
    """Likely cause, and the factor by which the misfit is smaller without it."""

    text: str  # with a verb
    remedy: str
    ratio: float

    def __str__(self) -> str:
        return f"{self.text} the strains {self.ratio:.2g} times better; {self.remedy}"


class _Hypothesis(NamedTuple):
    """Hypothesis about the gages of the model."""

    text: str
    remedy: str
    columns: tuple[int, ...]  # of the table, by gage
    signs: tuple[float, ...]
    gain: int = -1  # gage whose gain is free
    zero: int = -1  # gage whose zero is free


class _Products(NamedTuple):
    """Inner products at a place."""

    place: tuple[float, float]
    hats: Floats  # (gages, hats, hats): of the design
    both: Floats  # (gages, columns, hats): of design and strains
    ones: Floats  # (gages, hats): of design and a constant
    level: Floats  # (columns,): of strains and a constant
    squares: Floats  # (columns,): of the strains
    norm: float  # square of the constant

    def without_zero(self, gage: int) -> tuple[Floats, Floats, float]:
        """Return the products of a gage without its mean: design, design and strains, strains."""
        ones, level = self.ones[gage], self.level[gage]
        hats = self.hats[gage] - np.outer(ones, ones) / self.norm
        both = self.both[gage, gage] - ones * level / self.norm
        return hats, both, float(self.squares[gage] - level**2 / self.norm)


class _Shares(NamedTuple):
    """Shares of the squares of every gage that a force at a place leaves, (gages,)."""

    left: Floats
    place: tuple[float, float]
    factor: float  # of the gage whose gain is free: measured over computed strains
    level: float  # of the gage whose zero is free


def likely_cause(
    fit: LocationFit, best: PlaceTrial, region: Region, pitch: float | None, names: list[int]
) -> Cause | None:
    """Return the cause without which the strains are explained best, or None if none is clear.

    `best` is the fit of the unchanged strains, `names` are the numbers of the gages in messages.
    """
    places = [*_products(fit, _candidates(region, pitch, best))]
    gages = len(names)
    plain = _Hypothesis("", "", tuple(range(gages)), (1.0,) * gages)
    worst = sorted(np.argsort(-_least(places, plain).left, kind="stable")[:MOST].tolist())
    hypotheses = _hypotheses(plain, worst, names)
    tried = [(hypothesis, _least(places, hypothesis)) for hypothesis in hypotheses]
    tried.sort(key=lambda pair: float(pair[1].left.sum()))
    before = _unexplained(fit, best)
    causes: list[Cause] = []
    likely = tried[:REFINED]
    if gages >= FEWEST:
        odd, shares = _odd_gain(fit, best, region)
        likely = [(h, shares) for h, _ in tried if h.gain == odd]
        likely += [pair for pair in tried if pair[0].gain != odd][:REFINED]
    for hypothesis, shares in likely:
        remains, factor, level = _refined(fit, region, hypothesis, shares)
        text = hypothesis.text
        if hypothesis.gain >= 0:
            text = f"gage {names[hypothesis.gain]}, divided by {_rounded(factor)}, explains"
        if hypothesis.zero >= 0:
            text = f"gage {names[hypothesis.zero]} less {level:.2g} explains"
        ratio = float(np.sqrt((before / np.maximum(remains, LEAST)).max()))
        distinct = hypothesis.gain >= 0 and max(factor, 1.0 / factor) > DISTINCT
        if ratio >= (SLIGHT if distinct else BETTER):
            causes.append(Cause(text, hypothesis.remedy, ratio))
    return max(causes, key=lambda one: one.ratio, default=None)


def _odd_gain(fit: LocationFit, best: PlaceTrial, region: Region) -> tuple[int, _Shares]:
    """Return the gage whose gain differs most from the others, and the start of its search."""
    free = replace(fit, gains=True)
    trial = free.refined(best, np.array([region.low, region.high]))
    apart = np.log(trial.gains) - np.median(np.log(trial.gains))
    odd = int(np.abs(apart).argmax())
    place, factor = (trial.x, trial.y), float(np.exp(apart[odd]))
    return odd, _Shares(np.zeros(len(apart)), place, factor, 0.0)


def _unexplained(fit: LocationFit, trial: PlaceTrial) -> Floats:
    """Return what a fit leaves: sum of the shares of every gage, and share of all squares."""
    seen = fit.model.observation
    squares = np.maximum((seen.values**2).sum(axis=1) + seen.left, np.finfo(float).tiny)
    rest = (trial.residual**2).sum(axis=1) + seen.left
    return np.array([(rest / squares).sum(), rest.sum() / squares.sum()])


def _refined(
    fit: LocationFit, region: Region, hypothesis: _Hypothesis, shares: _Shares
) -> tuple[Floats, float, float]:
    """Return the remains at the place of a hypothesis, with its factor and level.

    The remains are those of :func:`_unexplained`. Only the gage of the hypothesis has another
    factor: with free gains of all gages, every gage would explain the strains as well as the right
    one.
    """
    seen, factor, level = fit.model.observation, shares.factor, shares.level
    columns, signs = list(hypothesis.columns), np.array(hypothesis.signs)[:, None]
    constant = seen.of(np.ones(fit.model.responses.shape[2]))
    box = np.array([region.low, region.high])
    place, shift, gains = shares.place, 0.0, None
    passes = PASSES if hypothesis.gain >= 0 else 1
    while True:
        values, remainder = signs * seen.values[columns], seen.left[columns]
        if hypothesis.gain >= 0:
            values[hypothesis.gain] /= factor
            remainder[hypothesis.gain] /= factor**2
        if hypothesis.zero >= 0:
            values[hypothesis.zero] -= level * constant
        corrected = replace(seen, values=values, left=remainder)
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
        values[hypothesis.zero] = seen.values[hypothesis.zero] - level * constant
        trial = corrected_fit.at(trial.x, trial.y, trial.shift, trial.gains)
    return _unexplained(corrected_fit, trial), factor, level


def _hypotheses(plain: _Hypothesis, worst: list[int], names: list[int]) -> Iterator[_Hypothesis]:
    """Yield every hypothesis: signs, exchanges, gains and zeros."""
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
    """Return candidates of the search, after the place of the unchanged strains.

    A gain, a zero or a sign of one of several gages hardly moves the place. The other candidates
    are too far from it to tell which gage has it.
    """
    x, y = region.grid(pitch)
    return [(best.x, best.y), *((u, v) for u in x.tolist() for v in y.tolist())]


def _products(fit: LocationFit, candidates: list[tuple[float, float]]) -> Iterator[_Products]:
    """Return the inner products at the candidates."""
    seen = fit.model.observation
    values = seen.values
    constant = seen.of(np.ones(fit.model.responses.shape[2]))
    squares = np.maximum((values**2).sum(axis=1) + seen.left, np.finfo(float).tiny)
    level = values @ constant
    for place in candidates:
        try:
            design = fit.model.design(*place)
        except FecmError:  # a hole or a notch
            continue
        turned = np.ascontiguousarray(design.swapaxes(1, 2))  # (gages, hats, rows)
        both = (turned @ values.T).swapaxes(1, 2)
        yield _Products(
            place,
            turned @ design,
            both,
            turned @ constant,
            level,
            squares,
            float(constant @ constant),
        )


def _normal(products: _Products, hypothesis: _Hypothesis) -> tuple[Floats, Floats]:
    """Return the normal equations of the force, weighted by the squares of every gage's strains."""
    matrix, vector = np.zeros(products.hats.shape[1:]), np.zeros(products.hats.shape[1])
    for gage, (column, sign) in enumerate(zip(hypothesis.columns, hypothesis.signs, strict=True)):
        if gage == hypothesis.gain:
            continue
        hats, both, square = (
            products.hats[gage],
            products.both[gage, column],
            float(products.squares[column]),
        )
        if gage == hypothesis.zero:
            hats, both, square = products.without_zero(gage)
        matrix += hats / square
        vector += sign / square * both
    matrix[np.diag_indices(len(matrix))] += RIDGE * float(np.diagonal(matrix).max()) + LEAST
    return matrix, vector


def _least(places: list[_Products], hypothesis: _Hypothesis) -> _Shares:
    """Return the remaining shares at the best of the candidates."""
    from scipy.optimize import nnls  # takes 0.2 s to import

    normals = [_normal(products, hypothesis) for products in places]
    factors = np.linalg.cholesky(np.array([matrix for matrix, _ in normals]))
    vectors = np.array([vector for _, vector in normals])
    roots = np.linalg.solve(factors, vectors[:, :, None])[:, :, 0]
    described = (roots**2).sum(axis=1)  # squares, by coefficients of any sign
    shares_left = []
    for place in np.argsort(-described, kind="stable")[:PLACES].tolist():
        force = nnls(factors[place].T, roots[place], maxiter=30 * len(roots[place]))[0]
        shares_left.append(_shares(places[place], hypothesis, force))
    return min(shares_left, key=lambda shares: float(shares.left.sum()))


def _shares(products: _Products, hypothesis: _Hypothesis, force: Floats) -> _Shares:
    """Return the shares of the squares that a force leaves."""
    remains, factor, level = np.ones(len(hypothesis.columns)), 1.0, 0.0
    for gage, (column, sign) in enumerate(zip(hypothesis.columns, hypothesis.signs, strict=True)):
        hats, both, square = (
            products.hats[gage],
            products.both[gage, column],
            float(products.squares[column]),
        )
        if gage == hypothesis.zero:
            level = float(products.level[gage] - products.ones[gage] @ force) / products.norm
            hats, both, square = products.without_zero(gage)
        computed, product = float(force @ hats @ force), sign * float(both @ force)
        if gage == hypothesis.gain:
            if product > 0.0 and computed > 0.0:
                factor = product / computed
                remains[gage] = 1.0 - product**2 / (computed * square)
        else:
            remains[gage] = (computed - 2.0 * product + square) / square
    return _Shares(np.maximum(remains, 0.0), products.place, factor, level)


def _rounded(factor: float) -> str:
    """Return a factor, or the factor of a unit that it is near to."""
    for size in (*ROUND, *(1.0 / number for number in ROUND)):
        if abs(factor / size - 1.0) < NEAR:
            return f"{size:g}"
    return f"{factor:.3g}"


RIVAL = 1.1  # misfit ratio of a place that can hardly be told from the first
NOT_DESCRIBED = 1.5  # misfit over the noise
UNLIKELY = 3.0  # standard deviations of a misfit that noise explains
LARGE = 0.01  # strain: plies fail at one to two per cent
LEFT = 0.5  # share of the squares of a gage that is not described
OF_MESH = 0.8  # share of the mesh in the standard deviation of the place
VAGUE = 0.25  # standard deviation of a place over the side of the region


def is_doubtful(location: Location) -> bool:
    """Return whether the model does not describe the strains down to their noise."""
    bad = location.misfit > NOT_DESCRIBED or residual_correlation(location) > COLOURED
    return bad or location.misfit > likely_misfit(location) or bool(undescribed_gages(location))


def likely_misfit(location: Location) -> float:
    """Return the largest misfit that noise explains.

    Its standard deviation is 1/sqrt(2 n) for n values.
    """
    parameters = 2 + int((location.force > 0.0).sum())
    return 1.0 + UNLIKELY / math.sqrt(2.0 * max(1, location.strains.size - parameters))


def undescribed_gages(location: Location) -> list[int]:
    """Return the gages whose residual has a shape, and is a large share of their strains."""
    rest = location.strains - location.fitted
    energies = (rest**2).sum(axis=1)
    follow = (rest[:, 1:] * rest[:, :-1]).sum(axis=1)
    large = energies > LEFT * (location.strains**2).sum(axis=1)
    return [int(n) for n in location.gages[large & (follow > COLOURED * energies)]]


def judged(location: Location, region: Region, wide: bool, cause: Cause | None) -> Location:
    """Return the location with its notes, and whether it is accepted.

    `wide` says whether narrower hats of the force describe the strains better, `cause` what may be
    wrong with the strains.
    """
    serious = [*_serious(location, region)]
    if cause is not None:
        serious.append(str(cause))
    return replace(location, notes=(*serious, *_remarks(location, wide)), accepted=not serious)


def _serious(location: Location, region: Region) -> Iterator[str]:
    """Yield reasons not to accept a location."""
    near = residual_correlation(location)
    compare = "compare supports, laminate, patch, mesh and gages with the test"
    share = float(((location.strains - location.fitted) ** 2).sum() / (location.strains**2).sum())
    if location.misfit > NOT_DESCRIBED:
        yield (
            "the model does not describe these signals: the residual is "
            f"{location.misfit:.2g} times the noise; {compare}"
        )
    elif not location.noise_given and near > COLOURED:
        yield (
            f"the model does not describe these signals: neighbouring residuals have the "
            f"correlation {near:.2f}, and {100.0 * share:.2g} % of the squares of the strains are "
            f"left; {compare}"
        )
    elif gages := undescribed_gages(location):
        which = ", ".join(map(str, gages))
        yield (
            f"the model does not describe gage {which}: more than half of the squares of its "
            f"strains are left; {compare}"
        )
    largest = float(np.abs(location.strains).max())
    if largest > LARGE:
        yield (
            f"the largest strain is {100.0 * largest:.2g} %, at which plies fail: the peak force "
            "is doubtful; are the strains in per cent?"
        )
    if location.second is not None and location.second.ratio < RIVAL:
        x, y, ratio = location.second
        yield (
            f"({x:.4g}, {y:.4g}) explains the strains almost as well: its misfit is {ratio:.3f} "
            "times the misfit of the located place"
        )
    if region.at_edge(location.x, location.y):
        yield "the place is on the edge of the region; the impact may be outside"
    for name, error, side in zip("xy", (location.sd_x, location.sd_y), region.size, strict=True):
        if not error < VAGUE * side:
            yield (
                f"{name} is not determined: its standard deviation is {error:.3g}, and the region "
                f"is {side:.3g} wide"
            )
    top = int(np.abs(location.time - location.time_of_peak).argmin())
    if location.peak_force < CLEAR * float(location.force_sd[top]):
        yield "the force is not above its noise"


def _remarks(location: Location, wide: bool) -> Iterator[str]:
    """Yield other notes."""
    clock = unit_of("time", location.units)
    if wide:
        half = f"{0.5 * (location.time[1] - location.time[0]):.3g} {clock}".rstrip()
        yield (
            f"a force every {half} describes the strains better: its error is not in the standard "
            "deviations; take a smaller basis"
        )
    near = residual_correlation(location)
    if likely_misfit(location) < location.misfit <= NOT_DESCRIBED:
        yield (
            f"the residual is {location.misfit:.3g} times the noise, which chance does not "
            "explain: the model has errors, and the standard deviations are multiplied by it"
        )
    if location.noise_given and near > COLOURED:
        yield (
            f"neighbouring residuals have the correlation {near:.2f}: the model does not describe "
            "the strains down to their noise, and the standard deviations are too small"
        )
    if location.mesh_error is None:
        yield "the standard deviations do not include the error of the mesh, which is unknown"
    elif location.mesh_error > OF_MESH * math.hypot(location.sd_x, location.sd_y):
        length = f"{location.mesh_error:.2g} {unit_of('length', location.units)}".rstrip()
        yield (
            f"elements half as long move the place by {length}, which is in the standard "
            "deviations; take a finer mesh"
        )
    if location.contact_end is None:
        until = f"{location.determined_until:.4g} {clock}".rstrip()
        yield f"the force has not ended at {until}: the impulse is a lower bound"


def residual_correlation(location: Location) -> float:
    """Return the correlation of consecutive residuals."""
    rest = location.strains - location.fitted
    size = float((rest**2).sum())
    return float((rest[:, 1:] * rest[:, :-1]).sum()) / size if size else 0.0
