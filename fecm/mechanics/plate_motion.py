"""Explicit motion of the plate: M a = P - f(u), report section 4.3.1.

The internal force f is K u; for a plate that stretches as it bends see membrane.py.

Central differences in increments: d = u - u_last is dt times the velocity in the middle of the last
step, and d + dt^2 M^-1 (P - f) is the next increment.  Vectors are over equations and are
processed in pieces that fit the cache.

With damping C = a M the velocity is the mean of the velocities in the middles of two steps.  The
mass then stays diagonal, and the order stays 2:

    (1 + b) d_next = (1 - b) d + dt^2 M^-1 (P - f),  b = a dt/2

The critical time step does not change.  A mode of frequency w has
(1 + b) z^2 - (2 - w^2 dt^2) z + (1 - b) = 0.  With b > 0 both roots are inside the unit circle if
|2 - w^2 dt^2| < (1 + b) + (1 - b) = 2 (Jury), that is for w dt < 2, as without damping.  A rigid
body slows down by (1 - b)/(1 + b) per step, so that the rate a is off by the factor
1 + (a dt)^2/12.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats, Indices
from fecm.mechanics.plate import PlateModel, pieces
from fecm.mechanics.stiffness_product import (
    AUTO,
    CSR,
    NonlinearProduct,
    Workers,
    internal_force_operator,
    resolved,
)
from fecm.mechanics.symmetry import SymmetryReduction, unreduced

# Largest length of a product that BLAS computes in one thread.
SERIAL = 8192
# A slice is faster than an index array if it has at most SHORT entries, or at most NEAR entries per
# equation.
SHORT = 2048
NEAR = 8
# Largest motion in a step of a plate in equilibrium, relative to its displacement. Rounding gives
# 1e-14; a plate whose load is taken away moves by (w dt)^2, which is 1e-6 in its slowest modes.
RESTING = 1.0e-9


class DivergenceError(FecmError, ArithmeticError):
    """The solution diverged.

    Attributes
    ----------
    step : int
        Step at which it diverged.
    reason : str
        Symptom.
    """

    exit_code = 1

    def __init__(self, step: int, reason: str) -> None:
        self.step: int = step
        self.reason: str = reason
        super().__init__(f"step {step}: {reason}")

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the error with its arguments and its notes."""
        return DivergenceError, (self.step, self.reason), self.__dict__


@dataclass
class PlateState:
    """State of the plate after a step."""

    padded: Floats  # (size,): displacement, padded as the stiffness operator requires
    increment: Floats  # (n,): displacement increment of the last step
    scaled_internal_force: Floats  # (n,): M^-1 f times `dt2`
    step: int = 0  # number of steps
    time: float = 0.0  # sum of the time steps
    dt: float = 0.0  # last time step
    dt2: float = 0.0  # factor of `scaled_internal_force`, the square of the time step
    external_work: float = 0.0  # work done by nodal forces
    prescribed: float = 0.0  # load factor of the prescribed displacements in the internal force
    sums: Sums = field(default_factory=lambda: Sums(*[0.0] * 7))  # inner products of the vectors
    # Displacement, increment and scaled internal force of each piece.
    views: list[tuple[Floats, Floats, Floats]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        u, d, force = self.displacement, self.increment, self.scaled_internal_force
        self.views = [(u[piece], d[piece], force[piece]) for piece in pieces(len(d))]

    @property
    def displacement(self) -> Floats:
        """Displacement of the independent dofs, (n,); a view."""
        return self.padded[: len(self.increment)]

    @property
    def strain_energy(self) -> float:
        """Strain energy (force*length).

        It is half the product of displacement and internal force minus the part of the quadratic
        strains, which grows with the fourth power of the deflection.
        """
        return 0.5 * (self.sums.strain - self.sums.quadratic)


class Sums(NamedTuple):
    """Inner products that give the energies."""

    # Products of increment d, displacement u, nodal loads P and scaled internal force s.
    inertia: float  # d M d
    power: float  # d f
    strain: float  # u f
    force: float  # f s
    load: float  # P d
    load_force: float  # P s
    quadratic: float = 0.0  # integral of (N - N0) eps_q of a nonlinear plate


class PointLoad(NamedTuple):
    """A unit force on one equation."""

    equation: int
    inverse_mass: float
    nodal_load: float  # nodal load of the equation at a load factor of 1

    def dot(self, vector: Floats) -> float:
        """Return the product with a vector over equations, which may be padded."""
        return vector.item(self.equation)

    def subtract(self, force: float, dt2: float, internal: Floats) -> None:
        """Subtract a force from an internal force scaled by M^-1 dt2."""
        internal[self.equation] -= force * (self.inverse_mass * dt2)


class DistributedLoad(NamedTuple):
    """A unit force distributed over equations."""

    equations: Indices | slice  # (m,)
    weights: Floats  # (m,): shares g of the equations
    mobility: Floats  # (m,): M^-1 g
    inverse_mass: float  # g M^-1 g
    nodal_load: float  # g M^-1 P over g M^-1 g, with the nodal loads P at a load factor of 1

    def dot(self, vector: Floats) -> float:
        """Return the product with a vector over equations, which may be padded."""
        if len(self.weights) > SERIAL:
            return float((self.weights * vector[self.equations]).sum())
        return float(self.weights.dot(vector[self.equations]))

    def subtract(self, force: float, dt2: float, internal: Floats) -> None:
        """Subtract a force from an internal force scaled by M^-1 dt2."""
        if not force:
            return
        part = internal[self.equations]
        part -= self.mobility * (force * dt2)
        if not isinstance(self.equations, slice):
            internal[self.equations] = part


Load = PointLoad | DistributedLoad


class AppliedForce(NamedTuple):
    """A force in addition to the nodal forces, and its distribution."""

    load: Load
    force: float


class DofSums(NamedTuple):
    """Weighted sums of dofs, such as the strains of gages."""

    dof_indices: Indices  # (n, m): indices into the padded displacement
    weights: Floats  # (n, m)
    prescribed: Floats  # (n,): contribution of the prescribed displacements at a load factor of 1

    def evaluate(self, state: PlateState, factor: float) -> Floats:
        """Return the values of the sums, (n,), under a load factor."""
        values = np.einsum("gi,gi->g", state.padded.take(self.dof_indices), self.weights)
        return np.asarray(values + factor * self.prescribed)


class PlateMotion:
    """Time integration of a plate with the damping matrix C = a M.

    Solver and workers are passed to :func:`~fecm.mechanics.stiffness_product.stiffness_operator`.
    All dofs are independent by default, and always with the sparse matrix.
    """

    def __init__(
        self,
        plate: PlateModel,
        solver: str = AUTO,
        reduced: SymmetryReduction | None = None,
        workers: Workers | None = None,
        damping: float = 0.0,
    ) -> None:
        self.plate, self.damping, self.solver = plate, damping, resolved(solver)
        self.reduction = reduction = (
            unreduced(plate) if reduced is None or solver == CSR else reduced
        )
        self.product = internal_force_operator(plate, solver, reduction, workers)
        self.mass = reduction.gather(reduction.sign * plate.field(plate.mass, 0.0))
        self._dof_indices = reduction.dof_indices
        self._inverse_mass = 1.0 / self.mass
        self._scale, self._scaled_for = np.zeros(reduction.count), 0.0  # M^-1 times the state's dt2
        work = np.empty(reduction.count)
        loads = reduction.gather(plate.field(plate.nodal_loads, 0.0))
        self._loads = loads if loads.any() else None
        self._loads_square = float(loads @ (loads * self._inverse_mass))
        self._prescribed = np.where(reduction.sign == 0.0, plate.mesh.forces, 0.0)
        self._prescribes = bool(self._prescribed.any())
        self._views = [
            (self._scale[p], self.mass[p], work[p], None if self._loads is None else loads[p])
            for p in pieces(reduction.count)
        ]

    @property
    def loaded(self) -> bool:
        """Whether nodal forces act or dofs are prescribed."""
        return self._loads is not None or self._prescribes

    @property
    def moves_in_plane(self) -> bool:
        """Whether u or v may be nonzero somewhere."""
        return bool(self.reduction.sign[:, :2].any() or self._prescribed[:, :2].any())

    def start(self) -> PlateState:
        """Return the state of the plate at rest."""
        count = len(self.mass)
        return PlateState(np.zeros(self.product.size), np.zeros(count), np.zeros(count))

    def load(self, distribution: Floats) -> Load:
        """Prepare a unit force with shares of all dofs, (numnp, 5).

        Raises ValueError if all dofs with a share are restrained.
        """
        shares = self.reduction.gather(distribution)
        (equations,) = np.nonzero(shares)
        if not len(equations):
            raise ValueError("the force acts on restrained dofs only")
        first, stop = int(equations[0]), int(equations[-1]) + 1
        is_compact = stop - first <= max(SHORT, NEAR * len(equations))
        selection = slice(first, stop) if is_compact else equations
        weights, inverse = shares[selection], self._inverse_mass[selection]
        loads = np.zeros_like(weights) if self._loads is None else self._loads[selection]
        if len(equations) == 1:
            return PointLoad(first, float(inverse[0]), float(loads[0]))
        mobility = weights * inverse
        square = float((mobility * weights).sum())
        nodal = float((mobility * loads).sum()) / square
        return DistributedLoad(selection, weights, mobility, square, nodal)

    def field(self, state: PlateState, factor: float) -> Floats:
        """Return all dofs of all nodes, (numnp, 5); `factor` scales the prescribed dofs."""
        full = state.padded.take(self._dof_indices)
        full += factor * self._prescribed if self._prescribes else 0.0  # no negative zeros
        return full

    def dof_sums(self, dof_indices: Indices, weights: Floats) -> DofSums:
        """Prepare sums over dofs of a flattened field, with indices and weights (n, m)."""
        prescribed = (weights * self._prescribed.ravel()[dof_indices]).sum(axis=1)
        return DofSums(self._dof_indices.ravel()[dof_indices], weights, prescribed)

    def displace(self, state: PlateState, change: Floats) -> None:
        """Add a change, (n,), to the displacement of a state without a time step.

        The prescribed displacements stay as the last :meth:`unbalanced` or step has set them.
        """
        state.padded[: len(change)] += change
        self.prescribe(state, state.prescribed)  # a resumed run may start here
        self._update_forces(state)

    def _update_forces(self, state: PlateState) -> None:
        """Compute the internal force and the inner products from the displacement."""
        self._scale_for(state.dt2)
        sums = self.product.each(state.padded, partial(self._piece_sums, state))
        state.sums = sums[0] if len(sums) == 1 else Sums(*map(sum, zip(*sums, strict=True)))
        if not self.plate.is_linear:
            state.sums = state.sums._replace(quadratic=self.product.quadratic_work)

    def prescribe(self, state: PlateState, factor: float) -> bool:
        """Prescribe displacements with a load factor; return whether the internal force changes.

        The internal force of a linear plate does not change: there the prescribed displacements are
        loads.
        """
        if not (self._prescribes and isinstance(self.product, NonlinearProduct)):
            return False
        if self.product.prescribed is None or state.prescribed != factor:
            self.product.prescribed = factor * self._prescribed
            state.prescribed = factor
            return True
        return False

    def _scale_for(self, dt2: float) -> None:
        if self._scaled_for != dt2:
            np.multiply(self._inverse_mass, dt2, out=self._scale)
            self._scaled_for = dt2

    def _piece_sums(self, state: PlateState, number: int, internal: Floats) -> Sums:
        """Scale the internal force of one piece, and return its inner products."""
        u, d, force = state.views[number]
        scale, mass, work, loads = self._views[number]
        np.multiply(internal, scale, out=force)
        np.multiply(mass, d, out=work)
        return Sums(
            float(np.dot(work, d)),
            float(np.dot(d, internal)),
            float(np.dot(u, internal)),
            float(np.dot(internal, force)),
            0.0 if loads is None else float(np.dot(loads, d)),
            0.0 if loads is None else float(np.dot(loads, force)),
        )

    def unbalanced(self, state: PlateState, factor: float) -> Floats:
        """Return load minus internal force of every equation; `factor` scales the nodal forces."""
        self.prescribe(state, factor)
        force = -self.product(state.displacement)
        if self._loads is not None:
            force += factor * self._loads
        return force

    def rests_under_load(self, state: PlateState, dt: float, factor: float) -> bool:
        """Return whether the nodal forces, times `factor`, hold a deflected plate in equilibrium.

        The plate moves in a step dt by less than :data:`RESTING` of its displacement, both in the
        norm of the mass.
        """
        u = state.displacement
        if not u.any():
            return False
        residual = self.unbalanced(state, factor)
        moved = dt**4 * float(residual @ (residual * self._inverse_mass))
        return moved <= RESTING**2 * float(u @ (u * self.mass))

    def advance(
        self,
        state: PlateState,
        dt: float,
        factor: float,
        applied: AppliedForce | None = None,
        *,
        velocity_dt: float | None = None,
    ) -> None:
        """Take one step: v += velocity_dt (M^-1 (P - f) - a v), u += dt v; changes the state.

        `factor` scales the nodal forces.  `velocity_dt` is the time from the middle of the last
        step to the middle of this step, `dt` by default.
        """
        dt_v = dt if velocity_dt is None else velocity_dt
        dt2, b = dt * dt_v, 0.5 * self.damping * dt_v
        if self.prescribe(state, factor) or state.dt2 != dt2:
            state.dt2 = dt2
            self._update_forces(state)
        self._scale_for(dt2)
        if state.dt != dt:
            state.increment *= dt / state.dt if state.dt else 1.0
            state.dt = dt
        if applied is not None:
            applied.load.subtract(applied.force, dt2, state.scaled_internal_force)
        for (u, d, internal), (scale, _, _, loads) in zip(state.views, self._views, strict=True):
            if b:
                d *= 1.0 - b
            d -= internal
            if loads is not None:
                d += factor * scale * loads
            if b:
                d /= 1.0 + b
            u += d
        self._update_forces(state)
        state.external_work += factor * state.sums.load
        state.step += 1
        state.time += dt

    def kinetic_energy(
        self, state: PlateState, factor: float, applied: AppliedForce | None = None
    ) -> float:
        """Return the kinetic energy at the time of the displacement (force*length).

        The stored velocity v is half a step old.  The energy is computed with v + dt/2 a, where
        a = M^-1 (P - f); `factor` scales the nodal forces.  The square of v + dt/2 a is expanded
        into the inner products of :class:`Sums`.  With damping, the mean velocity of two steps is
        v + dt/2 a divided by 1 + b.
        """
        dt2 = state.dt**2
        if not dt2:
            return 0.0
        inertia, power, _, internal, nodal, nodal_force, _ = state.sums
        to_step = dt2 / state.dt2
        work = factor * nodal - power  # d (P - f)
        force = factor * (factor * self._loads_square * dt2 - 2.0 * nodal_force * to_step)
        force += internal * to_step  # dt^2 (P - f) M^-1 (P - f)
        if applied is not None and applied.force:
            load, F = applied
            inverse = load.inverse_mass * dt2
            p = load.dot(state.scaled_internal_force) * to_step
            work += F * load.dot(state.increment)
            force += F * (F * inverse - 2.0 * p)
            if self._loads is not None:
                force += 2.0 * factor * F * load.nodal_load * inverse
        damped = 1.0 + 0.5 * self.damping * state.dt
        return 0.5 * (inertia / dt2 + work + 0.25 * force) / damped**2

    def central_difference(self, state: PlateState, dt: float, factor: float) -> None:
        """Take one step of the central differences, from rest or from the last step."""
        # The velocity belongs to the middle of a step.  The first step from rest therefore
        # accelerates for half a step, and a changed time step for the mean of both steps.
        self.advance(state, dt, factor, velocity_dt=0.5 * (state.dt + dt))
