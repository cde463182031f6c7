"""Convergence of a refined sweep: observed orders and Richardson limits.

P. J. Roache, Verification and Validation in Computational Science and Engineering, 1998, chapter 5.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._tables import aligned
from fecm._typing import Floats
from fecm.deck.macros import flat
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.problem import Problem
from fecm.sweeps.cases import REFINE, Case, CasesError
from fecm.sweeps.vary import apply_case, check_deck, with_time_step

FACTORS = "1,2,4,8"
# Order that two factors assume, and the lowest that gives a limit.
ASSUMED, LOWEST = 2.0, 0.5
# Relative change that is rounding.
SAME = 1e-12
# Counts, which have no order.
COUNTS = ("contacts",)


@dataclass(frozen=True)
class Convergence:
    """Limit of a quantity for fine meshes and small time steps."""

    order: float  # observed order; NaN if there is none
    limit: float  # Richardson extrapolation from the last values; NaN if there is none
    remark: str  # empty, or why there is no order


def refined_cases(checked: Problem, factors: Sequence[int]) -> list[Case]:
    """Return the cases of a refinement study; the factors are 1, 2, 4, 8 or a part of it.

    DT is that of the deck over the factor.  If it is 0, it is the largest with which no case
    exceeds 0.9 of its critical time step.  Raises CasesError if factors or deck are unsuitable.
    """
    given = ",".join(map(str, factors))
    if len(factors) < 2 or given not in FACTORS:
        raise CasesError(f"refine takes {FACTORS} or a part of it, at least two, not {given}")
    numbers = [int(factor) for factor in factors]
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if len(sizes) != 1:
        raise CasesError("refine needs one DT in the program of the deck")
    (dt,) = sizes
    if not dt:
        decks = [with_time_step(apply_case(checked.deck, {REFINE: f}), 0.0) for f in numbers]
        critical = [check_deck(deck).critical_time_step for deck in decks]
        dt = min(f * taken_time_step(c) for f, c in zip(numbers, critical, strict=True))
    count = checked.deck.control.numel
    return [{REFINE: f, "elements": count * f * f, "dt": dt / f} for f in numbers]


def convergence(
    cases: Mapping[str, NDArray[Any]], summary: Mapping[str, NDArray[Any]]
) -> dict[str, Convergence]:
    """Order and limit of every quantity of a refined sweep; empty for other sweeps."""
    if REFINE not in cases:
        return {}
    numbers = {n: values for n, values in summary.items() if n not in ("status", *COUNTS)}
    return {name: _limit(values[-3:]) for name, values in numbers.items()}


def _limit(values: Floats) -> Convergence:
    """Order and limit of the values of two or three meshes, each twice as fine as the last."""
    none, (*_, before, last) = math.nan, values.tolist()
    change = last - before
    if not np.isfinite(values).all():
        return Convergence(none, none, "a value is missing")
    if abs(change) <= SAME * abs(last):
        return Convergence(none, last, "the last two are equal")
    if len(values) < 3:
        return Convergence(none, last + change / (2.0**ASSUMED - 1.0), "order 2 is assumed")
    ratio = (before - float(values[0])) / change
    if ratio <= 0.0:
        return Convergence(none, none, "not monotone: no order")
    order = math.log2(ratio)
    if order < LOWEST:
        return Convergence(order, none, "does not converge at these sizes")
    return Convergence(order, last + change / (ratio - 1.0), "")


def table(cases: Mapping[str, NDArray[Any]], summary: Mapping[str, NDArray[Any]]) -> list[str]:
    """Lines with the values of every case, and order and limit of every quantity."""
    found = convergence(cases, summary)
    if not found:
        return []
    rows = [[n, *(f"{v:.6g}" for v in cases[n].tolist()), "", "", ""] for n in cases]
    rows[0][-3:-1] = "order", "limit"
    for name, one in found.items():
        order = "" if math.isnan(one.order) else f"{one.order:.2f}"
        limit = "" if math.isnan(one.limit) else f"{one.limit:.6g}"
        values = (f"{value:.6g}" for value in summary[name].tolist())
        rows.append([name, *values, order, limit, one.remark])
    names, *numbers, remarks = zip(*rows, strict=True)
    justified = ([text.rjust(max(map(len, column))) for text in column] for column in numbers)
    return aligned(list(zip(names, *justified, remarks, strict=True)))
