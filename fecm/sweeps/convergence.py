"""Refinement studies: cases on finer meshes; order, limit and error band of every quantity.

P. J. Roache, Verification and Validation in Computational Science and Engineering, 1998, chapter 5.
The error band is his grid convergence index (J. Fluids Engineering 116, 1994, 405-413).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fecm._table import Row, ShownNumber, Table
from fecm._typing import Floats
from fecm.authoring.case import Case, CasesError
from fecm.authoring.time_values import stable_time_step
from fecm.authoring.values import REFINE, apply_case
from fecm.deck.macros import flat
from fecm.problem.problem import Problem
from fecm.results.metrics import INTEGERS, VERDICTS
from fecm.sweeps.outcome import Column

ASSUMED_ORDER = 2.0  # for two factors, from which no order can be observed
LOWEST_ORDER = 0.5  # least observed order that gives a limit
# Order of the scheme in time and space, and in space for elements with nine nodes.
SCHEME_ORDER = 2.0
NINE_NODE_ORDER = 4.0
NEAR = 0.5  # largest distance of an observed order from an order of the scheme
# Safety factors of the error band.
OBSERVED = 1.25
UNCONFIRMED = 3.0
ROUNDING = 1e-12  # relative change of equal values
UNKNOWN = math.nan


@dataclass(frozen=True)
class Convergence:
    """Limit of a quantity for fine meshes and small time steps."""

    order: float  # observed order; NaN if it can't be computed
    # Richardson extrapolation from the last values with the observed order, or with the highest
    # order of the scheme if that is lower; NaN without a limit.
    limit: float
    # The limit is expected within plus and minus this band of the finest value; NaN if there is no
    # limit, or the last values are equal.
    band: float
    remark: str  # empty, or what is doubtful about order and band


def convergence(
    cases: Mapping[str, Column],
    summary: Mapping[str, Column],
    nodes: int,
    patch_ratio: float = 0.0,
) -> dict[str, Convergence]:
    """Return order, limit and error band of every quantity of a refined sweep.

    Other sweeps have none.

    Parameters
    ----------
    cases, summary : mapping
        Columns of the sweep.
    nodes : int
        Nodes of an element, which decide the order of the scheme.
    patch_ratio : float
        Side of the elements at the patch over its radius, with the factor 1.  If the finest mesh
        does not resolve the patch, the values approach the values of another load: there is no
        limit.
    """
    if REFINE not in cases:
        return {}
    numbers = {n: values for n, values in summary.items() if n not in (*VERDICTS, *INTEGERS)}
    highest = NINE_NODE_ORDER if nodes == 9 else SCHEME_ORDER
    if patch_ratio > float(np.max(cases[REFINE])):
        unresolved = Convergence(
            UNKNOWN, UNKNOWN, UNKNOWN, "no limit: the elements are larger than the patch"
        )
        return dict.fromkeys(numbers, unresolved)
    return {name: _limit(values[-3:], highest) for name, values in numbers.items()}


def _limit(values: Floats, highest: float) -> Convergence:
    """Return order, limit and band of two or three values; each mesh halves the elements."""
    *earlier, before, last = values.tolist()
    change = last - before
    if not np.isfinite(values).all():
        return Convergence(UNKNOWN, UNKNOWN, UNKNOWN, "a value is missing")
    if abs(change) <= ROUNDING * abs(last):
        return Convergence(UNKNOWN, last, UNKNOWN, "the last two are equal")
    if not earlier:
        rest = change / (2.0**ASSUMED_ORDER - 1.0)
        remark = f"order {ASSUMED_ORDER:g} is assumed, not observed"
        return Convergence(UNKNOWN, last + rest, UNCONFIRMED * abs(rest), remark)
    ratio = (before - earlier[0]) / change
    if ratio <= 0.0:
        return Convergence(UNKNOWN, UNKNOWN, UNKNOWN, "not monotone: no order")
    order = math.log2(ratio)
    if order < LOWEST_ORDER:
        return Convergence(order, UNKNOWN, UNKNOWN, "does not converge at these sizes")
    rest = change / (2.0 ** min(order, highest) - 1.0)
    if SCHEME_ORDER - NEAR <= order <= highest + NEAR:
        return Convergence(order, last + rest, OBSERVED * abs(rest), "")
    scheme = f"{SCHEME_ORDER:g}"
    if highest != SCHEME_ORDER:
        scheme += f" to {highest:g}"
    remark = f"not yet asymptotic: the scheme has order {scheme}"
    return Convergence(order, last + rest, UNCONFIRMED * abs(rest), remark)


def convergence_table(
    cases: Mapping[str, Column], summary: Mapping[str, Column], studies: Mapping[str, Convergence]
) -> Table:
    """Return the values of every mesh, and order, limit and band of every quantity."""
    factors, *others = cases
    rows: list[Row] = [
        (name, *(ShownNumber(v, f"{v:.6g}") for v in cases[name].tolist()), *[""] * 4)
        for name in others
    ]
    for name, study in studies.items():
        values = (ShownNumber(value, f"{value:.6g}") for value in summary[name].tolist())
        numbers = (study.order, ".2f", ""), (study.limit, ".6g", ""), (study.band, ".2g", "±")
        limits = (
            ShownNumber(value, "" if math.isnan(value) else f"{sign}{value:{form}}")
            for value, form, sign in numbers
        )
        rows.append((name, *values, *limits, study.remark))
    header = (factors, *(f"{v:g}" for v in cases[factors].tolist()), "order", "limit", "band", "")
    return Table(tuple(rows), header, "Refinement")


FACTORS = "1,2,4,8"


def refined_cases(checked: Problem, factors: Sequence[int]) -> list[Case]:
    """Return the cases of a refinement study; the factors are 1, 2, 4, 8 or some of them.

    DT is the DT of the deck over the factor. If it is 0, DT is the largest step with which no case
    exceeds 0.9 of its critical time step. Raises CasesError if factors or deck are unsuitable.
    """
    factor_text = ",".join(map(str, factors))
    if len(factors) < 2 or factor_text not in FACTORS:
        raise CasesError(f"refine takes {FACTORS} or a part of it, at least two, not {factor_text}")
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if len(sizes) != 1:
        raise CasesError("refine needs one DT in the program of the deck")
    (dt,), numbers = sizes, list(map(int, factors))
    if not dt:
        dt = min(f * stable_time_step(apply_case(checked.deck, {REFINE: f})) for f in numbers)
    count = checked.deck.control.numel
    return [{REFINE: f, "elements": count * f * f, "dt": dt / f} for f in numbers]
