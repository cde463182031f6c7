"""Summary of the springs, one-sided supports and point masses of a deck."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Annotated, TypedDict

import numpy as np

from fecm._table import Row
from fecm._text import significant
from fecm._typing import FiniteFloat, Floats
from fecm.deck.mesh_cards import DOF_NAMES
from fecm.deck.units import MASS, quantity, unit_of
from fecm.mechanics.interpolation import W
from fecm.mechanics.solutions import ConvergenceError
from fecm.problem.estimates import MOST_SOLVED
from fecm.problem.problem import Problem

Ends = Annotated[tuple[FiniteFloat, FiniteFloat], "Least and largest."]


class SpringsSummary(TypedDict):
    """Springs of an unknown."""

    dof: Annotated[str, "u, v, w, theta_x or theta_y."]
    number: int
    stiffness: Ends


class OneSidedSummary(TypedDict):
    """One-sided supports."""

    number: int
    stiffness: Ends
    gap: Annotated[FiniteFloat, "The largest."]
    flexibility_gain: Annotated[
        FiniteFloat | None,
        "Relative gain of the static flexibility under the load by their stiffness; null where it "
        "is not computed.",
    ]


class SupportsSummary(TypedDict):
    """Springs, one-sided supports and point masses of a deck."""

    springs: list[SpringsSummary]
    one_sided: OneSidedSummary | None
    masses: Annotated[int, "Number of point masses."]
    added_mass: Annotated[FiniteFloat, "Sum of the point masses."]
    step_ratio: Annotated[
        float, "Critical time step over the one without springs and one-sided supports."
    ]


def supports_summary(problem: Problem) -> SupportsSummary | None:
    """Summarise what a deck has beside restraints; None if that is nothing."""
    plate = problem.moving_plate
    masses = np.zeros(0) if plate.added_mass is None else plate.added_mass[:, W]
    if plate.supports is None and not masses.any():
        return None
    springs: list[SpringsSummary] = []
    one_sided: OneSidedSummary | None = None
    step_ratio = 1.0
    if (supports := plate.supports) is not None:
        for dof, name in enumerate(DOF_NAMES):
            stiffness = supports.stiffness[(supports.dof == dof) & ~supports.is_one_sided]
            if len(stiffness):
                ends = _ends(stiffness)
                springs.append({"dof": name, "number": len(stiffness), "stiffness": ends})
        lifting = supports.select(supports.is_one_sided)
        if len(lifting.node):
            one_sided = {
                "number": len(lifting.node),
                "stiffness": _ends(lifting.stiffness),
                "gap": float(lifting.gap.max()),
                "flexibility_gain": flexibility_gain(problem),
            }
        step_ratio = problem.share_of_step
    return {
        "springs": springs,
        "one_sided": one_sided,
        "masses": int((masses > 0.0).sum()),
        "added_mass": float(masses.sum()),
        "step_ratio": step_ratio,
    }


def flexibility_gain(problem: Problem) -> float | None:
    """Return how much more flexible one-sided supports are than rigid ones, relative.

    Returns None without impact, for more than MOST_SOLVED elements, with gaps, which leave open
    what the load closes, and for a plate that its supports do not hold.
    """
    plate = problem.moving_plate
    if problem.contact is None or problem.deck.control.numel > MOST_SOLVED:
        return None
    if plate.supports is None or not plate.lifts or plate.supports.gap.any():
        return None
    with suppress(ConvergenceError):
        if (response := problem.static) is not None:
            return response.gain
    return None


def support_rows(summary: SupportsSummary, units: dict[str, str]) -> Iterator[Row]:
    """Yield a row for the springs, the one-sided supports and the point masses."""
    if summary["springs"]:
        yield ("springs", "; ".join(_springs(row, units) for row in summary["springs"]))
    if (one_sided := summary["one_sided"]) is not None:
        points = _stiffness(one_sided["number"], "points", one_sided["stiffness"], "w", units)
        texts = [points]
        if gap := one_sided["gap"]:
            width = quantity(gap, unit_of("length", units))
            texts.append(f"gap up to {width}, which static estimates leave out")
        if (gain := one_sided["flexibility_gain"]) is not None:
            texts.append(f"they make the plate {gain:.2%} more flexible")
        yield ("one-sided", ", ".join(texts))
    if count := summary["masses"]:
        total = quantity(summary["added_mass"], unit_of(MASS, units))
        yield ("point masses", f"{count}, {total} in total" if count > 1 else total)


def _springs(row: SpringsSummary, units: dict[str, str]) -> str:
    return _stiffness(row["number"], f"of {row['dof']}", row["stiffness"], row["dof"], units)


def _stiffness(number: int, what: str, ends: Ends, dof: str, units: dict[str, str]) -> str:
    """Say how many springs of an unknown there are, and how stiff they are."""
    dimension = "force*length" if dof.startswith("theta") else "force/length"
    unit, sizes = unit_of(dimension, units), dict.fromkeys(map(significant, ends))
    return f"{number} {what} of {' to '.join(sizes)} {unit}".rstrip()


def _ends(values: Floats) -> Ends:
    return float(values.min()), float(values.max())
