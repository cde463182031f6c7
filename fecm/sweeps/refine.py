"""Refinement studies: one deck on meshes of which each is twice as fine as the one before."""

from __future__ import annotations

from collections.abc import Sequence

from fecm.deck.macros import flat
from fecm.problem.problem import Problem
from fecm.sweeps.case import Case, CasesError
from fecm.sweeps.timing import stable_time_step
from fecm.sweeps.values import REFINE
from fecm.sweeps.vary import apply_case

FACTORS = "1,2,4,8"


def refined_cases(checked: Problem, factors: Sequence[int]) -> list[Case]:
    """Return the cases of a refinement study; the factors are 1, 2, 4, 8 or a part of it.

    DT is that of the deck over the factor.  If it is 0, it is the largest with which no case
    exceeds 0.9 of its critical time step.  Raises CasesError if factors or deck are unsuitable.
    """
    given = ",".join(map(str, factors))
    if len(factors) < 2 or given not in FACTORS:
        raise CasesError(f"refine takes {FACTORS} or a part of it, at least two, not {given}")
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if len(sizes) != 1:
        raise CasesError("refine needs one DT in the program of the deck")
    (dt,), numbers = sizes, list(map(int, factors))
    if not dt:
        dt = min(f * stable_time_step(apply_case(checked.deck, {REFINE: f})) for f in numbers)
    count = checked.deck.control.numel
    return [{REFINE: f, "elements": count * f * f, "dt": dt / f} for f in numbers]
