"""Static force over the deflection of a nonlinear plate under its contact load.

Newton's method with a given deflection W of the plate under the load.  The force F is unknown; at a
displacement u with the tangent K_T and the residual r = F P - f(u) a step (du, dF) solves

    K_T du = r + dF P,   P du = W - P u,

where P are the nodal forces of a unit contact force, which also weigh the deflection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Floats
from fecm.mechanics.membrane import Membrane
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.solutions import ConvergenceError, Tangent

# Change relative to the displacement that ends the iterations.
CLOSE = 1.0e-8
MOST_ITERATIONS = 30
# Change beyond which iterations do not converge; the first is the whole displacement.
MOST_CHANGE = 2.0
# Change over the one before from which on a new tangent is worth its factors.
SLOW = 0.3
MOST_STEPS = 200
# Steps relative to the deflection; those near 0 are larger.
LARGEST_STEP = 0.1
SMALLEST_STEP = 1.0e-3


@frozen
class StaticCurve:
    """Force F and work of the force over the deflection W; cubic between the points.

    Attributes
    ----------
    deflection, force, stiffness : ndarray (n,)
        W (length) from 0 on, F (force), and dF/dW.
    work : ndarray (n,)
        Integral of F dW, force*length.
    """

    deflection: Floats
    force: Floats
    stiffness: Floats
    work: Floats

    def at(self, deflection: Floats | float) -> tuple[Floats, Floats]:
        """Force and work at deflections up to the last."""
        W, F, slope = self.deflection, self.force, self.stiffness
        i = np.clip(np.searchsorted(W, deflection, side="right") - 1, 0, len(W) - 2)
        h = W[i + 1] - W[i]
        t = (deflection - W[i]) / h
        begin, end = h * slope[i], h * slope[i + 1]
        rise = F[i + 1] - F[i]
        # F = F_i + c1 t + c2 t^2 + c3 t^3
        c2, c3 = 3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise
        force = F[i] + t * (begin + t * (c2 + t * c3))
        work = self.work[i] + h * t * (F[i] + t * (begin / 2.0 + t * (c2 / 3.0 + t * c3 / 4.0)))
        return force, work


def static_curve(
    plate: PlateModel, contact: Floats, step: float, enough: Callable[[float, float, float], bool]
) -> StaticCurve:
    """Follow the equilibria of a plate without other loads from rest.

    Parameters
    ----------
    plate : PlateModel
        Plate without nodal forces and prescribed displacements.  Its rigid motion in the plane
        needs no supports.
    contact : ndarray (numnp, 5)
        Nodal forces of a unit contact force.
    step : float
        First step of the deflection, length.  Steps grow with the deflection.
    enough : callable
        Whether the curve may end at a deflection, its force and its work.

    Returns
    -------
    StaticCurve
        Its last point is the first that is enough.

    Raises
    ------
    SingularStiffnessError
        If the supports do not hold the plate.
    ConvergenceError
        If an equilibrium is not found, or none is enough.
    """
    points: list[_Point] = []
    works = [0.0]
    load = contact[plate.mesh.equations > 0]
    for point in islice(_equilibria(plate, load, step), MOST_STEPS + 1):
        points.append(point)
        if len(points) == 1:
            continue
        before = points[-2]
        h = point.deflection - before.deflection
        # The integral of the cubic between both.
        mean = (before.force + point.force) / 2.0
        bend = h * (before.stiffness - point.stiffness) / 12.0
        works.append(works[-1] + h * (mean + bend))
        if enough(point.deflection, point.force, works[-1]):
            W, F, slope = np.array(points).T.copy()
            return StaticCurve(W, F, slope, np.array(works))
    raise ConvergenceError(f"the static curve is not long enough after {MOST_STEPS} steps")


class _Point(NamedTuple):
    """An equilibrium: a point of the curve."""

    deflection: float
    force: float
    stiffness: float


def _equilibria(plate: PlateModel, load: Floats, step: float) -> Iterator[_Point]:
    """Equilibria from rest on; they have no end."""
    membrane = Membrane(plate)
    state = _State(np.zeros(plate.mesh.equations.shape), 0.0)
    deflection, most = 0.0, step
    while True:
        tangent = Tangent(plate, state.field)
        compliant = tangent.solve(load)
        stiffness = 1.0 / float(load @ compliant)
        yield _Point(deflection, state.force, stiffness)
        most = max(most, LARGEST_STEP * deflection)
        while (found := _moved(plate, membrane, load, state, tangent, deflection + most)) is None:
            most /= 2.0
            if most < SMALLEST_STEP * (step + deflection):
                raise ConvergenceError(f"no equilibrium beyond the deflection {deflection:.6g}")
        state, deflection = found, deflection + most


class _State(NamedTuple):
    """Displacements, (numnp, 5), and contact force."""

    field: Floats
    force: float


def _moved(
    plate: PlateModel,
    membrane: Membrane,
    load: Floats,
    state: _State,
    tangent: Tangent,
    deflection: float,
) -> _State | None:
    """Find the equilibrium at a deflection from a state and its tangent; None if that fails."""
    free = plate.mesh.equations > 0
    field, force = state.field.copy(), state.force
    compliant = tangent.solve(load)
    last = math.inf
    for _ in range(MOST_ITERATIONS):
        u = field[free]
        internal = plate.stiffness @ u + membrane.forces(field)[0][free]
        # K_T^-1 (r + F P): with the load the right-hand side is larger than its rounding.
        change = tangent.solve(2.0 * force * load - internal)
        added = (deflection - float(load @ (u + change))) / float(load @ compliant)
        change += added * compliant
        force += force + added
        field[free] += change
        size = float(np.abs(change).max() / np.abs(field[free]).max())
        if size <= CLOSE:
            return _State(field, force)
        if not size < MOST_CHANGE:
            return None
        if size > SLOW * last:  # the tangent is too old
            tangent = Tangent(plate, field)
            compliant = tangent.solve(load)
        last = size
    return None
