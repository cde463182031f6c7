"""Many impact steps in one call of the compiled kernels.

In: a state of :mod:`fecm.mechanics.impact` and a number of steps.  Out: the state after the steps,
and the records of each step, :class:`Burst`.  The projectile moves in its natural modes
(:mod:`~fecm.mechanics.rod_modes`); the first mode is the rigid motion.
"""

from __future__ import annotations

import ctypes
from ctypes import c_double, c_int64
from enum import IntEnum
from typing import Generic, NamedTuple, cast

import numpy as np

from fecm._typing import Floats, Indices
from fecm.mechanics.contact_law import (
    ContactParameters,
    ContactPoint,
    HystereticLaw,
    LinearPermanent,
    LoadingHistory,
    Number,
    YangSunPermanent,
)
from fecm.mechanics.impact import ImpactState, ImpactSystem
from fecm.mechanics.kernels import LIBRARY, Doubles, Longs, Structure
from fecm.mechanics.kernels.plate import CompiledProduct
from fecm.mechanics.plate_motion import DivergenceError, DofSums, PlateState, PointLoad, Sums
from fecm.mechanics.rod_modes import ProjectileModes

# Records of a step, in the order of structures.h.
COLUMNS = (
    "time",
    # Inner products of the plate's state, with the internal force f: d M d, d f, u f and f s.
    "inertia",
    "power",
    "strain",
    "internal",
    "quadratic",  # see :class:`~fecm.mechanics.plate_motion.Sums`
    # d and s under the load.
    "load_d",
    "load_s",
    "force",
    "indentation",
    "plate_w",
    "contact_work",
    # Motion of the projectile's tip.
    "displacement",
    "velocity",
    "acceleration",
    "projectile_kinetic",
    "projectile_strain",
    "station",  # deformation of the projectile at the dof of :class:`ImpactSteps`
)

FIELDS = 4_000_000  # numbers in the displacement fields that one call of the kernels stores


class Pace(NamedTuple):
    """Number of steps between two calls of a run's observers."""

    most: int  # steps
    work: int  # steps times equations

    def interval(self, neq: int) -> int:
        """Return the number of steps between two calls for a plate with `neq` equations."""
        return max(1, min(self.most, self.work // neq))


SINGLY = Pace(most=64, work=100_000)  # for steps in Python
TOGETHER = Pace(most=4096, work=20_000_000)  # for the kernels, which take many steps in a call


class LawKind(IntEnum):
    """Kind of permanent indentation of a contact law."""

    LINEAR = 0  # equation 3-8
    YANG_SUN = 1  # equation 3-7


class KernelLaw(NamedTuple, Generic[Number]):
    """Permanent indentation of a law that the kernels know."""

    kind: LawKind
    critical: Number  # alpha_p or alpha_cr, length
    slope: float | Number  # s_p of equation 3-8


class LawStruct(Structure):
    """Constants of the contact law."""

    _fields_ = (
        ("k", c_double),  # force/length^1.5
        ("q", c_double),
        ("critical", c_double),  # length
        ("slope", c_double),
        ("kind", c_int64),  # a LawKind
    )


class HistoryStruct(Structure):
    """:class:`~fecm.mechanics.contact_law.LoadingHistory`, by the same names."""

    _fields_ = tuple((name, c_double) for name in LoadingHistory._fields)


class PointStruct(Structure):
    """:class:`~fecm.mechanics.contact_law.ContactPoint`, by the same names."""

    _fields_ = tuple((name, c_double) for name in ContactPoint._fields)


class RodStruct(Structure):
    """Projectile and its step, as in :class:`~fecm.mechanics.projectile.RodIntegrator`.

    The arrays:

    ============  ============  ===============================================================
    `T`           (9, modes)    new displacement, velocity and acceleration per old ones
    `h`           (3, modes)    new displacement, velocity and acceleration per force on the tip
    `stiffness`   (modes,)      squares of the angular frequencies
    `tip_shape`   (modes,)      displacement of the tip
    `station`     (modes,)      deformation at the station
    `motion`      (3, modes)    displacement, velocity and acceleration; changed
    ============  ============  ===============================================================
    """

    _fields_ = (
        ("dt", c_double),
        ("theta", c_double),  # time of equilibrium, as a fraction of the step
        # Tip displacement per acceleration at the start and at the end of the step.
        ("weight_before", c_double),
        ("weight", c_double),
        ("gain", c_double),  # tip acceleration per force
        ("modes", c_int64),
        ("T", Doubles),
        ("h", Doubles),
        ("stiffness", Doubles),
        ("tip_shape", Doubles),
        ("station", Doubles),
        ("motion", Doubles),
        ("tip", c_double),  # displacement of the tip; changed
    )


class ImpactStruct(Structure):
    """Contact, projectile, load, gages, and records of the steps.

    The arrays; the kernel writes the last four:

    ==============  ====================  =====================================================
    `entry`         (loaded,)             entries of the plate's vectors under the force
    `weight`        (loaded,)             their shares of the force
    `mobility`      (loaded,)             acceleration per force
    `gage_entry`    (gages, gage_dofs)    entries of the plate's vectors that a gage sums
    `gage_weight`   (gages, gage_dofs)    strain per displacement
    `stored`        (rows,)               steps, from 0, after which u is stored
    `last`          (loaded,)             increment of the step under the force
    `records`       (steps, columns)      see :data:`COLUMNS`
    `strains`       (steps, gages)        strains of the gages
    `fields`        (rows, entries)       u of the stored steps
    ==============  ====================  =====================================================
    """

    _fields_ = (
        ("law", LawStruct),
        # State before and after the steps.
        ("memory", HistoryStruct),
        ("contact", PointStruct),
        ("plate_w", c_double),  # the plate's displacement in the contact law
        ("work", c_double),  # work of the contact force on the indentation
        ("time", c_double),
        ("unconverged", c_int64),  # steps whose contact iteration did not converge
        ("rod", RodStruct),
        ("dt2", c_double),  # square of the plate's time step
        ("loaded", c_int64),
        ("entry", Longs),
        ("weight", Doubles),
        ("mobility", Doubles),
        ("last", Doubles),
        ("gages", c_int64),
        ("gage_dofs", c_int64),
        ("gage_entry", Longs),
        ("gage_weight", Doubles),
        ("rows", c_int64),
        ("stored", Longs),
        ("records", Doubles),
        ("strains", Doubles),
        ("fields", Doubles),
    )


class Written(NamedTuple):
    """Arrays that the kernel writes; see :class:`RodStruct` and :class:`ImpactStruct`."""

    motion: Floats
    records: Floats
    strains: Floats
    fields: Floats


def knows(constants: ContactParameters[Number]) -> bool:
    """Return whether the kernels have a law with these constants.

    Constants of a subclass belong to another law.
    """
    return type(constants) in (LinearPermanent, YangSunPermanent)


def kernel_law(constants: ContactParameters[Number]) -> KernelLaw[Number]:
    """Return the permanent indentation of a law that the kernels have; see :func:`knows`."""
    match constants:
        case LinearPermanent():
            return KernelLaw(LawKind.LINEAR, constants.alpha_p, constants.s_p)
        case YangSunPermanent():
            return KernelLaw(LawKind.YANG_SUN, constants.alpha_cr, 0.0)
    raise TypeError(f"the kernels have no law of {type(constants).__name__}")


class Burst(NamedTuple):
    """Records of consecutive steps."""

    columns: dict[str, Floats]  # (steps,) each
    strains: Floats  # (steps, gages): weighted sums of dofs, see `GageArray`
    fields: Floats  # (rows, numnp, 5): displacement fields of the stored steps


def can_step(system: ImpactSystem) -> bool:
    """Return whether the kernels can take the steps of a system."""
    motion, contact, law = system.motion, system.contact, system.law
    return (
        isinstance(motion.product, CompiledProduct)
        and isinstance(law, HystereticLaw)
        and knows(law.constants)
        and contact.plate_moves
        and not contact.keeps_first_step
        and contact.share == 1.0
        and not motion.loaded
    )


class ImpactSteps:
    """Stepper of a system that :func:`can_step` accepts.  It takes many steps at a time.

    `station` is the dof of the projectile whose deformation is recorded.
    """

    def __init__(
        self, system: ImpactSystem, gages: DofSums | None, station: int, threads: int
    ) -> None:
        self._system, self._threads = system, threads
        self._product = product = cast(CompiledProduct, system.motion.product)
        self._plate = product.plate
        self._modes = ProjectileModes.of(system.rod_stiffness, system.rod_mass, system.rod.rigid)
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
        self._gage_entry = np.zeros((0, 0), dtype=np.int64)
        self._gage_weights = np.zeros((0, 0))
        if gages is not None:
            self._gage_entry, self._gage_weights = product.entries(gages.dof_indices, gages.weights)

    def take(self, state: ImpactState, dt: float, steps: int, stored: Indices) -> Burst:
        """Take steps of size dt, which is also the size of the last step.

        The displacements are stored after the steps `stored`, counted from 0.  Raises
        DivergenceError if the motion is no longer finite.
        """
        plate = state.plate
        written = Written(
            motion=self._modes.motion(state.rod),
            records=np.empty((steps, len(COLUMNS))),
            strains=np.empty((steps, len(self._gage_entry))),
            fields=np.empty((len(stored), len(self._plate.u))),
        )
        impact = self._impact_structure(state, dt, stored, written)
        self._load_plate(plate, dt)
        steps_taken = LIBRARY.fecm_impact_steps(
            ctypes.byref(self._plate.structure), ctypes.byref(impact), steps, self._threads
        )
        if steps_taken < 0:
            raise MemoryError
        if steps_taken < steps:
            raise DivergenceError(plate.step + steps_taken + 1, "the motion is no longer finite")
        columns = dict(zip(COLUMNS, written.records.T, strict=True))
        tips = columns["displacement"]
        moved = float(tips[-1] - (tips[-2] if steps > 1 else state.rod.tip))
        state.rod = self._modes.state(written.motion, impact.rod.tip, moved)
        self._store_state(state, impact)
        names = ("inertia", "power", "strain", "internal", "quadratic")
        inertia, power, strain, internal, quadratic = (columns[name][-1].item() for name in names)
        plate.sums = Sums(inertia, power, strain, internal, 0.0, 0.0, quadratic)
        plate.step += steps
        columns["step"] = np.arange(plate.step - steps + 1, plate.step + 1, dtype=float)
        columns["plate_kinetic"] = self._kinetic_energy(columns, plate.dt2)
        columns["plate_strain"] = 0.5 * (columns["strain"] - columns["quadratic"])
        return Burst(columns, written.strains, self._product.fields(written.fields))

    def _impact_structure(
        self, state: ImpactState, dt: float, stored: Indices, written: Written
    ) -> ImpactStruct:
        """Return the kernel's input besides the plate, and the arrays that it writes."""
        law = self._system.law
        assert isinstance(law, HystereticLaw)  # `can_step` has checked this
        integrator = self._system.rod_step(dt)
        T, h = self._modes.step(integrator)
        rod = RodStruct(
            dt=integrator.dt,
            theta=integrator.theta,
            weight_before=integrator.weights[0],
            weight=integrator.weights[1],
            gain=integrator.gain,
            modes=len(self._tip_shape),
            T=T,
            h=h,
            stiffness=self._modes.stiffness,
            tip_shape=self._tip_shape,
            station=self._station,
            motion=written.motion,
            tip=state.rod.tip,
        )
        gages, gage_dofs = self._gage_entry.shape
        return ImpactStruct(
            law=LawStruct(
                k=law.constants.k, q=law.constants.q, **kernel_law(law.constants)._asdict()
            ),
            memory=HistoryStruct(**state.memory._asdict()),
            contact=PointStruct(**state.contact._asdict()),
            plate_w=state.plate_w,
            work=state.contact_work,
            time=state.plate.time,
            unconverged=int(state.unconverged_steps),
            rod=rod,
            dt2=state.plate.dt2,
            loaded=len(self._entry),
            entry=self._entry,
            weight=self._weights,
            mobility=self._mobility,
            last=np.empty(len(self._entry)),
            gages=gages,
            gage_dofs=gage_dofs,
            gage_entry=self._gage_entry,
            gage_weight=self._gage_weights,
            rows=len(stored),
            stored=np.ascontiguousarray(stored, dtype=np.int64),
            records=written.records,
            strains=written.strains,
            fields=written.fields,
        )

    def _load_plate(self, state: PlateState, dt: float) -> None:
        """Copy a plate's state into the vectors of the kernels."""
        plate = self._plate
        plate.u[plate.position] = state.displacement
        plate.d[plate.position] = state.increment
        plate.s[plate.position] = state.scaled_internal_force
        plate.set_scale(state.dt2)
        plate.structure.damping = 0.5 * self._system.motion.damping * dt

    def _store_state(self, state: ImpactState, impact: ImpactStruct) -> None:
        """Copy the contact and the vectors of the kernels into a state."""
        memory = impact.memory
        state.memory = LoadingHistory(
            branch=int(memory.branch),
            f=memory.f,
            b=memory.b,
            w=memory.w,
            p=memory.p,
            peak=memory.peak,
            peak_force=memory.peak_force,
            permanent=memory.permanent,
        )
        state.contact = ContactPoint(impact.contact.indentation, impact.contact.force)
        state.plate_w = impact.plate_w
        state.contact_work = impact.work
        state.unconverged_steps = impact.unconverged
        state.plate.time = impact.time
        self._store_plate(state.plate)

    def _store_plate(self, state: PlateState) -> None:
        """Copy the vectors of the kernels into a plate's state."""
        plate, count = self._plate, len(state.increment)
        state.displacement[...] = plate.u[plate.position]
        state.increment[...] = plate.d[plate.position]
        state.scaled_internal_force[...] = plate.s[plate.position]
        if len(state.padded) > count + 1:
            np.negative(state.displacement, out=state.padded[count:-1])

    def _kinetic_energy(self, columns: dict[str, Floats], dt2: float) -> Floats:
        """Return the kinetic energy of the plate; see :meth:`PlateMotion.kinetic_energy`."""
        inverse = self._system.contact.load.inverse_mass * dt2
        F = columns["force"]
        work = F * columns["load_d"] - columns["power"]
        force = columns["internal"] + F * (F * inverse - 2.0 * columns["load_s"])
        damped = 1.0 + 0.5 * self._system.motion.damping * np.sqrt(dt2)
        return np.asarray(0.5 * (columns["inertia"] / dt2 + work + 0.25 * force) / damped**2)
