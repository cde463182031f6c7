"""Many impact steps in one call of the compiled kernels.

The projectile moves in its natural modes, of which the first is the rigid motion.  State before and
after is that of :mod:`fecm.mechanics.impact`.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, cast

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics.contact_law import (
    ContactPoint,
    HystereticLaw,
    LinearPermanent,
    LoadingHistory,
    YangSunPermanent,
)
from fecm.mechanics.impact import ImpactState, ImpactSystem
from fecm.mechanics.kernels import COLUMNS, LIBRARY, Impact, Longs, floats
from fecm.mechanics.kernels.plate import CompiledProduct
from fecm.mechanics.plate_motion import DivergenceError, DofSums, PlateState, PointLoad, Sums
from fecm.mechanics.projectile import RodIntegrator, RodState

# Difference of squares of frequencies below which modes count as equal, relative to the largest.
EQUAL = 1e-10


class LawKind(IntEnum):
    """Permanent indentation of a contact law, as impact.h numbers it."""

    LINEAR = 0  # equation 3-8
    YANG_SUN = 1  # equation 3-7


# Kind, critical indentation and slope of the laws that the kernels know.
LAWS: dict[type, Any] = {
    LinearPermanent: lambda law: (LawKind.LINEAR, law.alpha_p, law.s_p),
    YangSunPermanent: lambda law: (LawKind.YANG_SUN, law.alpha_cr, 0.0),
}


@dataclass(frozen=True)
class Modes:
    """Natural modes of a projectile, of unit modal mass; the first is its rigid motion."""

    shapes: Floats  # (n, modes)
    stiffness: Floats  # (modes,): square of the angular frequency; 0 for the rigid motion
    weights: Floats  # (n, modes): the mass matrix times the shapes

    @classmethod
    def of(cls, K: Floats, m: Floats) -> Modes:
        """Modes of a free projectile with the dofs u and du/dx of its nodes."""
        M = np.diag(m) if m.ndim == 1 else m
        inverse = np.linalg.inv(np.linalg.cholesky(M))
        values, vectors = np.linalg.eigh(inverse @ K @ inverse.T)
        # One Newton step in extended precision: the errors of a low mode are relative to the
        # largest frequency (T. Ogita and K. Aishima, Iterative refinement for symmetric
        # eigenvalue decomposition, 2018).  Modes of equal frequency are only made orthogonal.
        V = (inverse.T @ vectors).astype(np.longdouble)
        overlap, S = np.eye(len(m)) - V.T @ M @ V, V.T @ K @ V
        exact = np.diagonal(S) / (1.0 - np.diagonal(overlap))
        gap = exact - exact[:, None]
        far = abs(gap) > EQUAL * values[-1]
        change = np.where(far, S + overlap * exact, overlap) / np.where(far, gap, 2.0)
        shapes, values = (V + V @ change).astype(float), exact.astype(float)
        rigid = np.zeros(len(m))
        rigid[::2] = 1.0
        shapes[:, 0] = rigid / np.sqrt(rigid @ M @ rigid)
        values[0] = 0.0
        return cls(shapes, values, M @ shapes)

    def motion(self, state: RodState) -> Floats:
        """Motion of the modes, (3, modes), without the rigid displacement."""
        y = np.stack([state.deformation, state.velocity, state.acceleration])
        rigid = y @ self.weights[:, 0]
        # Without it, its rounding does not reach the other modes.
        modal = (y - rigid[:, None] * self.shapes[:, 0]) @ self.weights
        modal[:, 0] = rigid
        modal[0, 0] = 0.0
        return np.ascontiguousarray(modal)

    def state(self, motion: Floats, tip: float, moved: float) -> RodState:
        """State with a motion of the modes and a displacement of the tip; `moved` in the step."""
        y = motion @ self.shapes.T
        y[0, ::2] -= y[0, 0]
        y[0, 0] = moved
        return RodState(y, tip)

    def step(self, integrator: RodIntegrator) -> tuple[Floats, Floats]:
        """Matrices (9, modes) and motion per tip force (3, modes) of a step, as an integrator's."""
        theta, r, dt = integrator.theta, integrator.inverse_beta, integrator.dt
        a0, a2 = r / (theta * dt) ** 2, r / (theta * dt)
        a4 = a0 / theta
        effective = 1.0 / (self.stiffness + a0)
        one, none = np.ones_like(effective), np.zeros_like(effective)
        acceleration = np.stack([
            -a4 * effective * self.stiffness,
            a4 * a2 * effective - a2 / theta,
            (r / 2.0 - 1.0) * a4 * effective + 1.0 - r / 2.0 / theta,
        ])  # fmt: skip
        gain = a4 * effective * self.shapes[0]
        before, after = integrator.weights
        velocity = np.stack([none, one, dt / 2.0 * one]) + dt / 2.0 * acceleration
        moved = np.stack([one, dt * one, before * one]) + after * acceleration
        T = np.concatenate([moved, velocity, acceleration])
        return T, np.stack([after * gain, dt / 2.0 * gain, gain])


@dataclass(frozen=True)
class Burst:
    """Records of consecutive steps."""

    columns: dict[str, Floats]  # (steps,) each
    strains: Floats  # (steps, gages)
    fields: Floats  # (rows, numnp, 5): displacement fields of the stored steps


def supports(system: ImpactSystem) -> bool:
    """Whether the kernels can take the steps of a system."""
    motion, contact, law = system.motion, system.contact, system.law
    return (
        isinstance(motion.product, CompiledProduct)
        and isinstance(law, HystereticLaw)
        and type(law.constants) in LAWS
        and contact.plate_moves
        and not contact.keeps_first_step
        and contact.share == 1.0
        and not motion.loaded
    )


class ImpactSteps:
    """Bursts of steps of a system that :func:`supports` accepts.

    `station` is the dof of the projectile whose deformation is recorded.
    """

    def __init__(
        self, system: ImpactSystem, gages: DofSums | None, station: int, threads: int
    ) -> None:
        self._system, self._threads = system, threads
        self._product = product = cast(CompiledProduct, system.motion.product)
        self._plate = product.plate
        self._modes = Modes.of(system.rod_stiffness, system.rod_mass)
        self._tip_shape = np.ascontiguousarray(self._modes.shapes[0])
        self._station = self._modes.shapes[station].copy()
        self._station[0] = 0.0
        load, position = system.contact.load, self._plate.position
        if isinstance(load, PointLoad):
            entry, weights = position[[load.equation]], np.ones(1)
            mobility = np.array([load.inverse_mass])
        else:
            entry, weights, mobility = position[load.equations], load.weights, load.mobility
        self._entry = np.ascontiguousarray(entry, dtype=np.int64)
        self._weights, self._mobility = map(np.ascontiguousarray, (weights, mobility))
        self._last = np.empty(len(entry))
        self._gage_entry = np.zeros((0, 0), dtype=np.int64)
        self._gage_weights = np.zeros((0, 0))
        if gages is not None:
            self._gage_entry, self._gage_weights = product.entries(gages.dof_indices, gages.weights)

    def take(self, state: ImpactState, dt: float, steps: int, stored: Indices) -> Burst:
        """Take steps of size dt, like the last one; store the displacements after some, from 0.

        Raises DivergenceError if the motion is no longer finite.
        """
        system, plate, kernel = self._system, state.plate, self._plate
        integrator = system._rod_step(dt)
        T, h = self._modes.step(integrator)
        motion = self._modes.motion(state.rod)
        law: Any = system.law
        c = law.constants
        kind, critical, slope = LAWS[type(c)](c)
        rows = np.ascontiguousarray(stored, dtype=np.int64)
        records = np.empty((steps, len(COLUMNS)))
        strains = np.empty((steps, len(self._gage_entry)))
        fields = np.empty((len(rows), len(kernel.u)))
        m: LoadingHistory = state.memory
        impact = Impact(
            c.k, c.q, critical, slope, kind, *m,
            *state.contact, state.plate_w, state.contact_work, plate.time,
            int(state.unconverged_steps), integrator.dt, integrator.theta, *integrator.weights,
            integrator.gain, len(self._tip_shape), floats(T), floats(h),
            floats(self._modes.stiffness), floats(self._tip_shape), floats(self._station),
            floats(motion), state.rod.tip, plate.dt2,
            len(self._entry), self._entry.ctypes.data_as(Longs), floats(self._weights),
            floats(self._mobility), floats(self._last),
            *self._gage_entry.shape, self._gage_entry.ctypes.data_as(Longs),
            floats(self._gage_weights),
            len(rows), rows.ctypes.data_as(Longs), floats(records), floats(strains), floats(fields),
        )  # fmt: skip
        self._enter(plate, dt)
        taken = LIBRARY.fecm_impact_steps(
            ctypes.byref(kernel.structure), ctypes.byref(impact), ctypes.c_int64(steps),
            ctypes.c_int64(self._threads),
        )  # fmt: skip
        if taken < 0:
            raise MemoryError
        if taken < steps:
            raise DivergenceError(plate.step + taken + 1, "the motion is no longer finite")
        self._leave(plate)
        columns = dict(zip(COLUMNS, records.T, strict=True))
        names = ("inertia", "power", "strain", "internal")
        inertia, power, strain, internal = (columns[name][-1].item() for name in names)
        plate.sums = Sums(inertia, power, strain, internal, 0.0, 0.0)
        plate.step, plate.time = plate.step + steps, impact.time
        tips = columns["displacement"]
        moved = tips[-1] - (tips[-2] if steps > 1 else state.rod.tip)
        state.rod = self._modes.state(motion, impact.tip, float(moved))
        memory = (getattr(impact, name) for name in LoadingHistory._fields[1:])
        state.memory = LoadingHistory(int(impact.branch), *memory)
        state.contact = ContactPoint(impact.indentation, impact.force)
        state.plate_w, state.contact_work = impact.plate_w, impact.work
        state.unconverged_steps = impact.unconverged
        columns["step"] = np.arange(plate.step - steps + 1, plate.step + 1, dtype=float)
        columns["plate_kinetic"] = self._kinetic(columns, plate.dt2)
        columns["plate_strain"] = 0.5 * columns["strain"]
        return Burst(columns, strains, self._product.fields(fields))

    def _enter(self, state: PlateState, dt: float) -> None:
        """Copy a state into the vectors of the kernels."""
        plate = self._plate
        plate.u[plate.position] = state.displacement
        plate.d[plate.position] = state.increment
        plate.s[plate.position] = state.scaled_internal_force
        plate.set_scale(state.dt2)
        plate.structure.damping = 0.5 * self._system.motion.damping * dt

    def _leave(self, state: PlateState) -> None:
        """Copy the vectors of the kernels into a state."""
        plate, count = self._plate, len(state.increment)
        state.displacement[...] = plate.u[plate.position]
        state.increment[...] = plate.d[plate.position]
        state.scaled_internal_force[...] = plate.s[plate.position]
        if len(state.padded) > count + 1:
            np.negative(state.displacement, out=state.padded[count:-1])

    def _kinetic(self, at: dict[str, Floats], dt2: float) -> Floats:
        """Kinetic energy of the plate; see :meth:`PlateMotion.kinetic_energy`."""
        inverse = self._system.contact.load.inverse_mass * dt2
        F = at["force"]
        work = F * at["load_d"] - at["power"]
        force = at["internal"] + F * (F * inverse - 2.0 * at["load_s"])
        damped = 1.0 + 0.5 * self._system.motion.damping * np.sqrt(dt2)
        return np.asarray(0.5 * (at["inertia"] / dt2 + work + 0.25 * force) / damped**2)
