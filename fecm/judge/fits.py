"""Limits of the parameters that are fitted to a measured force, and the verdicts on a fit.

Each reason to reject or to doubt a fit is a row with its limit and its words.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal, TypeAlias

from fecm.judge.limits import ModelLimit, TrustLevel

COMPARE = "compare supports, laminate, patch, mesh and {what} with the test"
# Correlation of neighbouring residuals above which a residual has a shape.
COLOURED = 0.5

# Share of the force's variance in a residual with a shape.
UNDESCRIBED = ModelLimit(
    "residual with a shape, of the force's variance",
    0.05,
    note="the model does not describe the data: {why}",
    remedy=COMPARE.format(what="filter"),
)
MISSING_PARAMETER = ModelLimit(
    "parameters of the record",
    note="fit {names} too: {effect}; the values given here are biased",
)
FORCE_WITHOUT_CONTACT = ModelLimit(
    "force without contact",
    note="fit {name} too: without contact the measured force is {force}, beyond its noise",
)
_FILTERED = "the measurement seems to be filtered: with --filter {filter} {effect}"
FILTERED = ModelLimit(
    "filter of the measurement",
    note=f"{_FILTERED}; the values given here are biased",
)
PERHAPS_FILTERED = ModelLimit(
    "filter of the measurement",
    note=f"{_FILTERED}, which is more than chance; the values may be biased",
)
NOT_CONVERGED = ModelLimit(
    "converged",
    note="the fit has not converged",
    remedy="start from better values in the deck",
    level=TrustLevel.OUTSIDE,
)
AT_BOUND = ModelLimit(
    "bound of a value", note="{name} is at its bound {value:.6g}; its standard error is void"
)
CORRELATED = ModelLimit(
    "correlation of two values",
    0.99,
    note="{first} and {second} have the correlation {correlation:.4f}: their values can hardly be "
    "told apart",
)
SHAPED = ModelLimit(
    "correlation of neighbouring residuals",
    COLOURED,
    note="neighbouring residuals have the correlation {correlation:.2f}: the model does not "
    "describe the measurement down to its noise, and the standard errors are too small",
)
# Number of sign runs below its mean, in standard deviations.
FEW_RUNS = ModelLimit(
    "rarity of changes of sign",
    4.0,
    note="the residual changes its sign too rarely for independent errors ({rarity:.1f} standard "
    "deviations of a runs test): the model does not describe the measurement down to its noise; "
    "does the measurement have a filter that --filter does not name?",
)
# Share of the contact's points; fewer are a remark.
LEFT_OUT = ModelLimit(
    "points outside the run",
    0.05,
    note="{outside} of {count} points are outside the run of the deck and left out",
)
FAILED_RUN = ModelLimit("run of the fitted deck", note="the run of the fitted deck fails: {why}")
# Largest difference of the fitted force from the full run of the fitted deck, over the peak.
UNCONFIRMED = ModelLimit(
    "difference from the full run",
    0.02,
    note="the fitted force differs by up to {largest} of the peak from the full run of the fitted "
    "deck",
    remedy="start from better values in the deck, or fit fewer parameters",
    level=TrustLevel.OUTSIDE,
)
UNSETTLED = ModelLimit(
    "effect of the full run",
    note="after {fits} fits beside full runs, another would change the values by up to {effect} "
    "standard errors",
)
DOUBTFUL_RUN = ModelLimit(
    "run of the fitted deck",
    note="the run of the fitted deck is {doubts}: the parameters make up for what it lacks",
)

Verdict: TypeAlias = Literal["yes", "with doubts", "no"]
# Trust in the values of a fit.
VERDICTS: dict[Verdict, TrustLevel] = {
    "yes": TrustLevel.WITHIN,
    "with doubts": TrustLevel.DOUBTFUL,
    "no": TrustLevel.OUTSIDE,
}


def verdict_of(doubts: Collection[str], *, accepted: bool) -> Verdict:
    """Return whether the values of a fit are accepted."""
    if not accepted:
        return "no"
    return "with doubts" if doubts else "yes"
