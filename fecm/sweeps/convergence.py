"""Convergence of meshes: orders and limits of a refined sweep, and the mesh error of a peak force.

P. J. Roache, Verification and Validation in Computational Science and Engineering, 1998, chapter 5;
the error band is his grid convergence index (J. Fluids Engineering 116, 1994, 405-413).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._tables import aligned
from fecm._typing import Floats
from fecm.deck.macros import flat
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.build import RunOptions
from fecm.problem.memory import check_memory
from fecm.problem.problem import Problem
from fecm.problem.refine import RefineError, refined
from fecm.problem.resolution import resolution
from fecm.results.metrics import VERDICTS
from fecm.sweeps.cases import REFINE, Case, CasesError
from fecm.sweeps.plan import without_output
from fecm.sweeps.vary import apply_case, check_deck, stable_time_step, with_time_step

FACTORS = "1,2,4,8"
ASSUMED, LOWEST = 2.0, 0.5  # order that two factors assume, and the lowest that gives a limit
# Order of the scheme in time, and in space of all elements but those of nine nodes; theirs; and how
# far an observed order may be from them.
ORDER, NINE_NODE_ORDER, NEAR = 2.0, 4.0, 0.5
OBSERVED, UNCONFIRMED = 1.25, 3.0  # safety factors of the error band
SAME = 1e-12  # relative change that is rounding
COUNTS = ("contacts",)  # counts, which have no order


@dataclass(frozen=True)
class Convergence:
    """Limit of a quantity for fine meshes and small time steps."""

    order: float  # observed order; NaN if there is none
    # Richardson extrapolation from the last values with the observed order, or with the highest of
    # the scheme if that is lower; NaN if there is none.
    limit: float
    # The limit is expected within plus and minus this band of the finest value; NaN if there is no
    # limit, or the last values are equal.
    band: float
    remark: str  # empty, or what is doubtful about order and band


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


def convergence(
    cases: Mapping[str, NDArray[Any]], summary: Mapping[str, NDArray[Any]], nodes: int
) -> dict[str, Convergence]:
    """Order, limit and error band of every quantity of a refined sweep; empty for other sweeps.

    `nodes` are those of an element, which decide the order of the scheme.
    """
    if REFINE not in cases:
        return {}
    numbers = {n: values for n, values in summary.items() if n not in (*VERDICTS, *COUNTS)}
    highest = NINE_NODE_ORDER if nodes == 9 else ORDER
    return {name: _limit(values[-3:], highest) for name, values in numbers.items()}


def _limit(values: Floats, highest: float) -> Convergence:
    """Order, limit and band of two or three values, of meshes twice as fine as the last."""
    none, (*earlier, before, last) = math.nan, values.tolist()
    change = last - before
    if not np.isfinite(values).all():
        return Convergence(none, none, none, "a value is missing")
    if abs(change) <= SAME * abs(last):
        return Convergence(none, last, none, "the last two are equal")
    if not earlier:
        rest = change / (2.0**ASSUMED - 1.0)
        remark = f"order {ASSUMED:g} is assumed, not observed"
        return Convergence(none, last + rest, UNCONFIRMED * abs(rest), remark)
    ratio = (before - earlier[0]) / change
    if ratio <= 0.0:
        return Convergence(none, none, none, "not monotone: no order")
    order = math.log2(ratio)
    if order < LOWEST:
        return Convergence(order, none, none, "does not converge at these sizes")
    rest = change / (2.0 ** min(order, highest) - 1.0)
    if ORDER - NEAR <= order <= highest + NEAR:
        return Convergence(order, last + rest, OBSERVED * abs(rest), "")
    scheme = f"{ORDER:g}" if highest == ORDER else f"{ORDER:g} to {highest:g}"
    remark = f"not yet asymptotic: the scheme has order {scheme}"
    return Convergence(order, last + rest, UNCONFIRMED * abs(rest), remark)


def table(
    cases: Mapping[str, NDArray[Any]], summary: Mapping[str, NDArray[Any]],
    found: Mapping[str, Convergence],
) -> list[str]:  # fmt: skip
    """Lines with the values of every case, and order, limit and band of every quantity."""
    if not found:
        return []
    rows = [[n, *(f"{v:.6g}" for v in cases[n].tolist()), "", "", "", ""] for n in cases]
    rows[0][-4:-1] = "order", "limit", "band"
    for name, one in found.items():
        order = "" if math.isnan(one.order) else f"{one.order:.2f}"
        limit = "" if math.isnan(one.limit) else f"{one.limit:.6g}"
        band = "" if math.isnan(one.band) else f"±{one.band:.2g}"
        values = (f"{value:.6g}" for value in summary[name].tolist())
        rows.append([name, *values, order, limit, band, one.remark])
    names, *numbers, remarks = zip(*rows, strict=True)
    justified = ([text.rjust(max(map(len, column))) for text in column] for column in numbers)
    return aligned(list(zip(names, *justified, remarks, strict=True)))


@dataclass(frozen=True)
class MeshError:
    """Peak force on a mesh and on one with bisected elements around the load."""

    peak_force: float
    refined_peak_force: float
    elements: int
    refined_elements: int
    distance: float  # elements up to here are bisected: a bending wave of the contact

    @property
    def change(self) -> float:
        """Change of the peak force."""
        return self.refined_peak_force - self.peak_force

    @property
    def relative_change(self) -> float | None:
        """Change over the peak force; None without a contact."""
        return self.change / self.peak_force if self.peak_force else None


def bisected(problem: Problem) -> Problem:
    """Bisect the elements around the load of a problem.

    Its DT is kept, or shortened to that which DT 0 takes on the new mesh.  Raises RefineError if
    nothing hits the plate, or its elements cannot be bisected.
    """
    near = problem.distances <= max(_distance(problem), problem.distances.min())
    deck = refined(problem.deck, problem.mesh, near)
    taken = taken_time_step(problem.critical_time_step)
    sizes = [macro.value or taken for macro in flat(problem.program) if macro.word == "DT"]
    try:
        return check_deck(with_time_step(deck, min(*sizes, stable_time_step(deck)), taken))
    except CasesError as error:
        raise RefineError(f"the mesh with bisected elements cannot be run: {error}") from None


def _distance(problem: Problem) -> float:
    """Distance from the load within which elements are bisected: a bending wave."""
    found = resolution(problem) if problem.has_impact else None
    if found is None:
        raise RefineError("nothing hits the plate: there is no peak force whose mesh error to find")
    return found.wave


def mesh_error(
    problem: Problem, fine: Problem, options: RunOptions, advance: Callable[[int], object]
) -> MeshError:
    """Run a problem and its :func:`bisected` one, and compare their peak forces.

    `advance` is called with numbers of steps that were taken.  Raises DivergenceError if a motion
    grows without bound.  Raises NotEnoughMemoryError if a run needs more memory than is free.
    """
    peak, refined_peak = (_peak_force(one, options, advance) for one in (problem, fine))
    count, refined_count = problem.deck.control.numel, fine.deck.control.numel
    return MeshError(peak, refined_peak, count, refined_count, _distance(problem))


def _peak_force(problem: Problem, options: RunOptions, advance: Callable[[int], object]) -> float:
    """Peak force of a run without stored fields."""
    from fecm.results.sinks import MemorySink
    from fecm.simulation.run import run
    from fecm.simulation.simulation import Simulation

    plain = without_output(problem)
    check_memory(plain, solver=options.solver, in_memory=True)
    sink = MemorySink()
    observers = (lambda simulation: advance(simulation.interval),)
    run(Simulation(plain, sink, options, observers=observers))
    return float(np.max(sink.arrays["history/force"]))
