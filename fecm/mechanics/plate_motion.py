"""Explicit motion of the plate: M a = P - K u.

The central differences in increments: d = u - u_last, which is dt times the velocity in the middle
of the last step, and d + dt^2 M^-1 (P - K u) is the next one.  Vectors are over equations, and
are gone through piece by piece.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.stiffness_product import AUTO, CSR, Workers, pieces, stiffness_operator
from fecm.mechanics.symmetry import SymmetryReduction, whole

Indices = NDArray[np.intp]


class DivergenceError(ArithmeticError):
    """The motion has lost all sense.

    Attributes
    ----------
    step : int
        The step at which it did.
    reason : str
        How that shows.
    """

    def __init__(self, step: int, reason: str) -> None:
        self.step = step
        self.reason = reason
        super().__init__(f"step {step}: {reason}")

    def __reduce__(self) -> tuple[type[DivergenceError], tuple[int, str]]:
        """Make the error again in another process."""
        return DivergenceError, (self.step, self.reason)


@dataclass(slots=True)
class PlateState:
    """The plate's part of what one step hands to the next.

    Attributes
    ----------
    extended : ndarray (size,)
        The displacement, extended as the product needs it.
    increment : ndarray (n,)
        What the last step added to the displacement.
    pull : ndarray (n,)
        M^-1 K u times `area`.
    step : int
        Steps taken.
    time : float
        Sum of their time steps.
    dt : float
        The last time step.
    area : float
        Square of the time step that `pull` is made for.
    external_work : float
        Work done by nodal forces.
    sums : Sums
        Inner products of the vectors.
    """

    extended: Floats
    increment: Floats
    pull: Floats
    step: int = 0
    time: float = 0.0
    dt: float = 0.0
    area: float = 0.0
    external_work: float = 0.0
    sums: Sums = field(default_factory=lambda: Sums(*[0.0] * 6))

    @property
    def displacement(self) -> Floats:
        """The unknowns that move on their own, (n,); a view."""
        return self.extended[: len(self.increment)]

    @property
    def velocity(self) -> Floats:
        """Velocity in the middle of the last step, (n,)."""
        return self.increment / self.dt if self.dt else np.zeros_like(self.increment)

    @property
    def strain_energy(self) -> float:
        """Strain energy, half of the product of displacement and internal force (force*length)."""
        return 0.5 * self.sums.strain

    def to_arrays(self) -> dict[str, Floats]:
        """Store the state as plain arrays, from which :meth:`from_arrays` makes it again."""
        scalars = [self.step, self.time, self.dt, self.area, self.external_work]
        return {
            "plate": np.array(scalars, dtype=float),
            "sums": np.array(self.sums),
            "extended": self.extended.copy(),
            "increment": self.increment.copy(),
            "pull": self.pull.copy(),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Floats]) -> PlateState:
        """Make the state again that :meth:`to_arrays` stored."""
        step, time, dt, area, external_work = arrays["plate"].tolist()
        return cls(
            arrays["extended"].copy(),
            arrays["increment"].copy(),
            arrays["pull"].copy(),
            int(step),
            time,
            dt,
            area,
            external_work,
            Sums(*arrays["sums"].tolist()),
        )


class Sums(NamedTuple):
    """Inner products that the energies are made of: d increment, u displacement, P nodal loads."""

    inertia: float  # d M d
    power: float  # d K u
    strain: float  # u K u
    pull: float  # (K u) pull
    load: float  # P d
    load_pull: float  # P pull


class PointForce(NamedTuple):
    """A force on one equation, on top of the nodal forces."""

    row: int
    force: float


@dataclass(frozen=True)
class Watch:
    """Sums over unknowns: strains of gages, say.

    Attributes
    ----------
    slots : ndarray (n, m)
        Places in the extended displacement.
    weights : ndarray (n, m)
    prescribed : ndarray (n,)
        What the prescribed displacements add, for a load factor of 1.
    """

    slots: Indices
    weights: Floats
    prescribed: Floats

    def read(self, state: PlateState, factor: float) -> Floats:
        """Values of the sums, (n,), under a load factor."""
        values = np.einsum("gi,gi->g", state.extended.take(self.slots), self.weights)
        return np.asarray(values + factor * self.prescribed)


class PlateMotion:
    """Moves a plate through time.

    Parameters
    ----------
    plate : PlateModel
    solver : str
        How K u is had: see :func:`~fecm.mechanics.stiffness_product.stiffness_operator`.
    reduced : SymmetryReduction, optional
        What moves; every unknown without it, and with the sparse matrix.
    workers : Workers, optional
        Threads to share the work of a step.
    """

    def __init__(
        self,
        plate: PlateModel,
        solver: str = AUTO,
        reduced: SymmetryReduction | None = None,
        workers: Workers | None = None,
    ) -> None:
        kept = whole(plate) if reduced is None or solver == CSR else reduced
        self.plate = plate
        self.product = stiffness_operator(plate, solver, kept, workers)
        self.mass = kept.gather(kept.sign * plate.field(plate.mass, 0.0))
        self._slots = kept.slots
        self._inverse_mass = 1.0 / self.mass
        self._scale = np.zeros(kept.count)  # M^-1 times the state's area
        self._scaled_for = 0.0
        self._work = np.empty(kept.count)
        loads = kept.gather(plate.field(plate.nodal_loads, 0.0))
        self._loads = loads if loads.any() else None
        self._loads_square = float(loads @ (loads * self._inverse_mass))
        self._prescribed = np.where(kept.sign == 0.0, plate.mesh.forces, 0.0)
        self._prescribes = bool(self._prescribed.any())
        self._pieces = pieces(kept.count)
        self._viewed: PlateState | None = None
        self._views: list[tuple[Any, ...]] = []

    def start(self) -> PlateState:
        """State of the plate at rest."""
        count = len(self.mass)
        return PlateState(np.zeros(self.product.size), np.zeros(count), np.zeros(count))

    def row(self, node: int, unknown: int) -> int:
        """Place among the moving unknowns of an unknown of a node, both from 0.

        Raises
        ------
        ValueError
            If it does not move.
        """
        slot = int(self._slots[node, unknown])
        if slot >= len(self.mass):
            raise ValueError(f"unknown {unknown + 1} of node {node + 1} does not move on its own")
        return slot

    def field(self, state: PlateState, factor: float) -> Floats:
        """Every unknown of every node, (numnp, 5).

        Parameters
        ----------
        state : PlateState
        factor : float
            Load factor of the prescribed displacements.
        """
        full = state.extended.take(self._slots)
        full += factor * self._prescribed if self._prescribes else 0.0  # no negative zeros
        return full

    def watch(self, places: Indices, weights: Floats) -> Watch:
        """Sums over unknowns, ready to be taken at every step.

        Parameters
        ----------
        places : ndarray (n, m)
            Places of unknowns in a field laid out flat.
        weights : ndarray (n, m)
        """
        prescribed = (weights * self._prescribed.ravel()[places]).sum(axis=1)
        return Watch(self._slots.ravel()[places], weights, prescribed)

    def refresh(self, state: PlateState) -> None:
        """Make all that follows from the displacement agree with it."""
        self._prepare(state)
        sums = self.product.each(state.extended, self._account)
        state.sums = sums[0] if len(sums) == 1 else Sums(*map(sum, zip(*sums, strict=True)))

    def _prepare(self, state: PlateState) -> None:
        """Scale the masses for the state's time step, and cut all vectors into pieces."""
        if self._scaled_for != state.area:
            np.multiply(self._inverse_mass, state.area, out=self._scale)
            self._scaled_for = state.area
        if self._viewed is state:
            return
        own = (state.displacement, state.increment, state.pull)
        vectors = (*own, self._scale, self.mass, self._work)
        loads = self._loads
        self._views = [
            (*(v[piece] for v in vectors), None if loads is None else loads[piece])
            for piece in self._pieces
        ]
        self._viewed = state

    def _account(self, number: int, internal: Floats) -> Sums:
        """Pull and sums of one piece, from K u."""
        u, d, pull, scale, mass, work, loads = self._views[number]
        np.multiply(internal, scale, out=pull)
        np.multiply(mass, d, out=work)
        return Sums(
            float(np.dot(work, d)),
            float(np.dot(d, internal)),
            float(np.dot(u, internal)),
            float(np.dot(internal, pull)),
            0.0 if loads is None else float(np.dot(loads, d)),
            0.0 if loads is None else float(np.dot(loads, pull)),
        )

    def unbalanced(self, state: PlateState, factor: float) -> Floats:
        """Load less internal force of every equation.

        Parameters
        ----------
        state : PlateState
        factor : float
            Load factor of the nodal forces.
        """
        force = -self.product(state.displacement)
        if self._loads is not None:
            force += factor * self._loads
        return force

    def advance(
        self,
        state: PlateState,
        dt: float,
        factor: float,
        point: PointForce | None = None,
        *,
        kick: float | None = None,
    ) -> None:
        """Take one step: v += kick M^-1 (P - K u), u += dt v.

        Parameters
        ----------
        state : PlateState
            Changed in place.
        dt : float
            Time step.
        factor : float
            Load factor of the nodal forces.
        point : PointForce, optional
        kick : float, optional
            Time between the middles of the last step and of this one; `dt` without it.
        """
        area = dt * (dt if kick is None else kick)
        if state.area != area:
            state.area = area
            self.refresh(state)
        if state.dt != dt:
            state.increment *= dt / state.dt if state.dt else 1.0
            state.dt = dt
        self._prepare(state)
        if point is not None:
            row, force = point
            state.pull[row] -= force * self._scale[row]
        for u, d, pull, scale, _, _, loads in self._views:
            d -= pull
            if loads is not None:
                d += factor * scale * loads
            u += d
        self.refresh(state)
        state.external_work += factor * state.sums.load
        state.step += 1
        state.time += dt

    def kinetic_energy(
        self, state: PlateState, factor: float, point: PointForce | None = None
    ) -> float:
        """Kinetic energy at the displacement's instant (force*length).

        The stored velocity is half a step old, so that the energy is that of v + dt/2 a, with
        a = M^-1 (P - K u).  Its square is taken apart, which needs no vector that the step has not.

        Parameters
        ----------
        state : PlateState
        factor : float
            Load factor of the nodal forces.
        point : PointForce, optional
        """
        dt2 = state.dt**2
        if not dt2:
            return 0.0
        inertia, power, _, pull, load, load_pull = state.sums
        to_step = dt2 / state.area
        work = factor * load - power  # d (P - K u)
        force = factor * (factor * self._loads_square * dt2 - 2.0 * load_pull * to_step)
        force += pull * to_step  # dt^2 (P - K u) M^-1 (P - K u)
        if point is not None:
            row, F = point
            inverse, p = float(self._inverse_mass[row]) * dt2, float(state.pull[row]) * to_step
            work += F * float(state.increment[row])
            force += F * (F * inverse - 2.0 * p)
            if self._loads is not None:
                force += 2.0 * factor * F * float(self._loads[row]) * inverse
        return 0.5 * (inertia / dt2 + work + 0.25 * force)

    def central_difference(self, state: PlateState, dt: float, factor: float) -> None:
        """Take one step of the central differences, from rest or from the last step.

        The first step from rest has half a kick, so that the velocity belongs to its middle; a
        change of the time step is met in the same way.
        """
        self.advance(state, dt, factor, kick=0.5 * (state.dt + dt))
