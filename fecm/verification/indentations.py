"""The indentation law along paths, against the report's equations and their integrals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from fecm.mechanics.contact_law import (
    ContactPoint,
    HystereticLaw,
    LinearPermanent,
    YangSunPermanent,
    follow,
)
from fecm.verification.case import AGAINST_CHANGE, Check, case

# The report's laminate with the 0.5 in indenter, and with the 0.75 in one (lb, in).
HALF_INCH = LinearPermanent(k=1.330e6, alpha_p=6.564e-4, s_p=0.094, q=2.5)
K, ALPHA_P, S_P, Q = 1.912e6, 6.564e-4, 0.094, 2.0
LAW = HystereticLaw(LinearPermanent(K, ALPHA_P, S_P, Q))

PEAK = 2e-3
FORCE = K * PEAK**1.5
REMAINS = S_P * (PEAK - ALPHA_P)
HALFWAY = (PEAK + REMAINS) / 2.0
LOST = 2.0 / 5.0 * K * PEAK**2.5 - FORCE * (PEAK - REMAINS) / (Q + 1.0)
ROUNDING = "rounding"
POINTS = 2000


# The law with one unloading rigidity, and its critical indentation.
ALPHA_CR = 1.2e-3
ACR_REMAINS = PEAK - ALPHA_CR**0.4 * PEAK**0.6


def _forces(
    corners: Sequence[float], points: int = 1, law: HystereticLaw = LAW
) -> list[ContactPoint]:
    return [point for point, _ in follow(law, corners, points)]


@case(
    "indentation",
    "loading, unloading and reloading of the report's laminate",
    Check("F(α_p), 0.5 in indenter (lb)", 22.4, "this program; the report: about 20 lb",
          2e-3, "stated to three digits", AGAINST_CHANGE),
    Check("F at the peak (lb)", FORCE, "k α^1.5, equation 3-1", 1e-12, ROUNDING),
    Check("F halfway down to α₀ (lb)", FORCE / 2.0**Q, "equations 3-3 and 3-8", 1e-12, ROUNDING),
    Check("F at α₀ (lb)", 0.0, "equation 3-3", 1e-12, ROUNDING, scale=FORCE),
    Check("jump of F where unloading begins (lb)", 0.0, "continuity", 1e-8,
          "a step of 10⁻⁹ of the peak", scale=FORCE),
    Check("jump of F where reloading begins (lb)", 0.0, "continuity", 1e-8,
          "a step of 10⁻⁹ of the peak", scale=FORCE),
    Check("F back at the peak (lb)", FORCE, "reloading returns to where unloading began", 1e-12,
          ROUNDING),
    Check("F halfway up from α₀ (lb)", FORCE / 2.0**1.5, "equation 3-11", 1e-12, ROUNDING),
    Check("work lost in a cycle (lb in)", LOST, "integrals of 3-1 and 3-3", 1e-6,
          "trapezoidal rule, 2000 points"),
    Check("ACR: F at the peak (lb)", FORCE, "k α^1.5, equation 3-1", 1e-12, ROUNDING),
    Check("ACR: F halfway down to α₀ (lb)", K / ALPHA_CR * ((PEAK - ACR_REMAINS) / 2.0) ** 2.5,
          "equations 3-3, 3-6 and 3-7", 1e-12, ROUNDING),
    Check("ACR: F at α₀ (lb)", 0.0, "equation 3-7", 1e-12, ROUNDING, scale=FORCE),
)  # fmt: skip
def indentation() -> Sequence[float]:
    """Forces at places of several paths, and the area of a loop."""
    step = 1e-9 * PEAK
    down = _forces((PEAK, HALFWAY, REMAINS))
    top = _forces((PEAK, PEAK - step))
    turn = _forces((PEAK, HALFWAY, HALFWAY + step))
    up = _forces((PEAK, -PEAK, HALFWAY, PEAK))
    loop = _forces((PEAK, 0.0), POINTS)
    law = HystereticLaw(YangSunPermanent(K, ALPHA_CR))
    acr = _forces((PEAK, (PEAK + ACR_REMAINS) / 2.0, ACR_REMAINS), law=law)
    work = sum((b.indentation - a.indentation) * (a.force + b.force) / 2.0
               for a, b in pairwise(loop))  # fmt: skip
    return [
        HALF_INCH.loading(ALPHA_P), down[1].force, down[2].force, down[3].force,
        top[2].force - top[1].force, turn[3].force - turn[2].force, up[4].force, up[3].force, work,
        *(point.force for point in acr[1:]),
    ]  # fmt: skip


CASES = (indentation,)
