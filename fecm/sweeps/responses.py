"""Responses of the plate and of a rod to a unit force, and their convolution with forces.

The plate is linear and the projectile acts on one dof. The displacement of this dof is exactly the
sum of its impulse responses: w_n = sum over m < n of g_(n-m) F_m. A rod is linear too: the
acceleration of its tip is such a sum of the forces on the tip. The forces depend on the sums so
far.

The sums are evaluated in blocks. A matrix product adds the contributions of earlier blocks, and
contributions of steps within the block are added one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.fft import irfft, rfft
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.judge.end import LEAST_WORK, Deflection
from fecm.mechanics import kernels
from fecm.mechanics.contact_law import (
    ContactParameters,
    ContactPoint,
    HystereticLaw,
    Law,
    LinearPermanent,
)
from fecm.mechanics.impact import ContactState, ImpactConditions, ImpactSystem, couple_step
from fecm.mechanics.impact_steps import ImpactSteps, can_step, kernel_law, knows
from fecm.mechanics.impact_sweep import Given, ResultRow, Swept, sweep_linear
from fecm.mechanics.plate_motion import AppliedForce, DofSums, Load, PlateMotion
from fecm.mechanics.projectile import Projectile, RigidMass, RodIntegrator, RodState, WilsonStep
from fecm.mechanics.rod_modes import ProjectileModes
from fecm.results.metrics import IndentationMetrics

# Steps of the blocks.  A force acts at once on the rest of the smallest block, which acts on the
# rest of the next larger one by a matrix product, and so on; complete largest blocks act on later
# ones by Fourier transforms.
NEAR = 8
BLOCK = 64
FAR = 256
TILE = 16  # cases of every matrix product, so that no case depends on the others


class Convolution:
    """Sums x_n = sum over m < n of r_(n-m) f_m of many cases, where f_n may depend on x_n.

    `responses` are r_1, r_2, ... of each sum and kind of case, (steps,) or (sums, steps, kinds);
    `kinds` (cases,), in ascending order, is the kind of each case.
    """

    def __init__(self, responses: Floats, kinds: NDArray[np.intp]) -> None:
        r = responses[None, :, None] if responses.ndim == 1 else responses
        sums, self._steps, count = r.shape
        cases = np.bincount(kinds, minlength=count)
        tiles = -(-cases // TILE)  # of each kind; the last is filled up
        last, blocks = np.cumsum(tiles), -(-self._steps // FAR)
        self._cuts = [slice(end - n, end) for n, end in zip(tiles, last, strict=True)]
        shifts = TILE * (last - tiles) - np.cumsum(cases) + cases
        self._place = np.arange(len(kinds)) + shifts[kinds]
        sums_known = np.zeros((count, sums, FAR * (blocks + 1)))
        sums_known[:, :, : self._steps] = r.transpose(2, 0, 1)
        self._near = np.repeat(sums_known[:, :, :NEAR, None], tiles, axis=0)
        # Row t, column s: r_(t + size - s), the effect of a block of some size on later steps.
        windows = np.lib.stride_tricks.sliding_window_view
        self._tables = {
            size: windows(sums_known[:, :, 1:], size, axis=2)[:, :, : end - size, ::-1].copy()
            for size, end in ((NEAR, BLOCK), (BLOCK, FAR))
        }
        parts = [sums_known[:, :, FAR * n : FAR * (n + 2)] for n in range(blocks - 1)]
        self._filters = [rfft(np.roll(part, -FAR, axis=2))[..., None] for part in parts]
        self._spectra = np.empty((last[-1], len(parts), FAR + 1, TILE), dtype=complex)
        self._given = np.zeros((last[-1], FAR, TILE))  # of the last block
        self._block = np.zeros((last[-1], sums, FAR, TILE))
        self._values = np.zeros(last[-1] * TILE)
        self._step = 0

    def next(self) -> Floats:
        """Return x_n (sums, cases) of the next step n = 1, 2, ..."""
        rows = self._block[:, :, self._step % FAR].swapaxes(0, 1)
        sums = rows.reshape(len(rows), -1)[:, self._place]
        self._step += 1
        if not self._step % NEAR and self._step < self._steps:
            for kind, tiles in enumerate(self._cuts):
                self._add_block(self._step, kind, tiles)
        return sums

    def give(self, values: Floats) -> None:
        """Set f_n of the step last returned by :meth:`next`; f_0 before the first step."""
        self._values[self._place] = values
        block = self._values.reshape(-1, 1, 1, TILE)
        row, remaining = self._step % FAR, NEAR - self._step % NEAR
        self._given[:, row] = block[:, 0, 0]
        self._block[:, :, row : row + remaining] += self._near[:, :, :remaining] * block

    def _add_block(self, start: int, kind: int, tiles: slice) -> None:
        """Add the effect of the last block of forces, which is complete, on the later steps."""
        if start % FAR:
            size, end = (NEAR, BLOCK) if start % BLOCK else (BLOCK, FAR)
            row, rows = start % FAR, end - start % end
            factors = self._tables[size][kind, :, :rows]
            part = self._given[tiles, None, row - size : row]
            self._block[tiles, :, row : row + rows] += factors @ part
            return
        number = start // FAR
        for tile in range(tiles.start, tiles.stop):
            spectra = self._spectra[tile]
            spectra[number - 1] = rfft(self._given[tile], 2 * FAR, axis=0)
            total = self._filters[0][kind] * spectra[number - 1]
            for distance in range(1, number):
                total += self._filters[distance][kind] * spectra[number - 1 - distance]
            self._block[tile] = irfft(total, axis=1)[:, :FAR]


SMALL = BLOCK**3  # multiplications of a matrix product small enough for BLAS to use one thread
NO_FORCE = HystereticLaw(LinearPermanent(0.0, 0.0, 0.0, 1.0))


def plate_response(
    motion: PlateMotion, load: Load, dt: float, steps: int, gages: DofSums | None = None
) -> tuple[Floats, Floats]:
    """Return displacement under a load and strains of gages per force after 1 to `steps` steps.

    The first step is taken under a unit force. The plate has no nodal loads. Returns arrays
    (steps,) and (gages, steps).
    """
    # A projectile that never touches the plate.
    system = ImpactSystem(motion, RigidMass(1.0), NO_FORCE, ImpactConditions(load, 0.0))
    state = system.start()
    response = np.empty(steps)
    strains = np.empty((0 if gages is None else len(gages.weights), steps))
    burst = can_step(system)
    for step in range(1 if burst else steps):
        motion.advance(state.plate, dt, 0.0, AppliedForce(load, 1.0) if step == 0 else None)
        response[step] = load.dot(state.plate.padded)
        if gages is not None:
            strains[:, step] = gages.evaluate(state.plate, 0.0)
    if burst and steps > 1:
        rest = ImpactSteps(system, gages, 0, 1).take(state, dt, steps - 1, np.array([], np.intp))
        response[1:], strains[:, 1:] = rest.columns["plate_w"], rest.strains.T
    return response, strains


def tip_response(step: RodIntegrator, steps: int) -> Floats:
    """Return the acceleration per force of a tip after 1 to `steps` steps.

    The first step is taken under a unit force.
    """
    state, response = RodState(np.zeros((3, step.n))), np.empty(steps)
    for number in range(steps):
        state = step.advance(state, float(number == 0))
        response[number] = state.acceleration[0]
    return response


def largest_sums(response: Floats, force: Floats) -> tuple[Floats, Floats]:
    """Return the largest and the last absolute value (cases,) of the sums of a response and forces.

    `response` is (steps,), `force` (steps, cases).
    """
    sums = Convolution(response, np.zeros(force.shape[1], dtype=np.intp))
    largest = last = np.zeros(force.shape[1])
    for values in force:
        last = np.abs(sums.next()[0])
        largest = np.maximum(largest, last)
        sums.give(values)
    return largest, last


def _product(a: Floats, b: Floats) -> Floats:
    """Multiply matrices in pieces small enough for BLAS to use one thread."""
    columns = max(1, SMALL // a.size)
    return np.hstack([a @ b[:, i : i + columns] for i in range(0, b.shape[1], columns)])


class Hits(NamedTuple):
    """Projectiles, contact laws and velocities of cases."""

    rods: Sequence[Projectile]  # the kinds of projectiles
    kind: NDArray[np.intp]  # (cases,), ascending
    scale: Floats  # (cases,): factor of the mass and stiffness of the kind
    law: Law[Floats]  # of all cases
    speed: Floats  # (cases,): approach velocity


class TipState(NamedTuple):
    """Motion of the tips of projectiles, (cases,) each."""

    tip: Floats
    velocity: Floats
    acceleration: Floats


class TipSteps:
    """Time steps of the tips of projectiles.

    `dt` is the size of a step and `count` the number of steps. Each case multiplies the stiffness
    and the mass of its kind of projectile by its scale.
    """

    def __init__(self, hits: Hits, dt: float, count: int) -> None:
        self.hits, self.dt = hits, dt
        self._steps = [
            WilsonStep(rod.stiffness(), rod.mass(), dt, rigid=rod.rigid) for rod in hits.rods
        ]
        self.theta, self.weight = self._steps[0].theta, self._steps[0].weight
        self._begin = self._steps[0].weights[0]
        self.gain: Floats = np.array([step.gain for step in self._steps])[hits.kind] / hits.scale
        # `end` adds r_1 = gain; the sum over earlier forces starts with r_2.  The force of a step
        # is the force at t + theta dt.
        r = np.column_stack([tip_response(step, count + 1)[1:] for step in self._steps])
        before = np.vstack([np.zeros_like(r[:1]), r[:-1]])
        # Acceleration per contact force 1 to `count` steps earlier, (count, kinds).
        self.responses: Floats = self.theta * r + (1.0 - self.theta) * before
        self.sums: Floats = np.zeros(len(hits.kind))  # over the contact forces before the next step

    def motions(self, kind: int, force: Floats) -> Iterator[Floats]:
        """Yield the motion of complete projectiles of a kind, after blocks of steps and at the end.

        `force` (steps, cases) are the contact forces of all kinds; yields (3 n, cases of the kind)
        as in :class:`~fecm.mechanics.projectile.RodState`.
        """
        step, cases = self._steps[kind], np.flatnonzero(self.hits.kind == kind)
        before = np.zeros((1, len(cases)))
        motion = np.zeros((3 * step.n, len(cases)))
        motion[step.n : 2 * step.n][self.hits.rods[kind].rigid > 0.0] = -self.hits.speed[cases]
        # T^1, T^2, T^4, ...; column j of `reach` is the effect of a unit force after j steps.
        powers, reach = [step.T], step.h[:, None]
        while reach.shape[1] < BLOCK:
            reach = np.hstack([reach, _product(powers[-1], reach)])
            powers.append(_product(powers[-1], powers[-1]))
        for start in range(0, len(force), BLOCK):
            forces = force[start : start + BLOCK, cases]
            earlier = np.vstack([before, forces[:-1]])
            part = (self.theta * forces + (1.0 - self.theta) * earlier) / self.hits.scale[cases]
            before, count = forces[-1:], len(part)
            for bit, power in enumerate(powers):
                if count >> bit & 1:
                    motion = _product(power, motion)
            motion += _product(reach[:, :count][:, ::-1], part)
            yield motion

    def begin(self, state: TipState) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the free acceleration (twice), the drift and the previous acceleration."""
        base = self.sums / self.hits.scale
        drift = state.tip + self.dt * state.velocity + self._begin * state.acceleration
        return base, base, drift, state.acceleration

    def end(self, state: TipState, motion: Floats, force: Floats) -> TipState:
        """Return the state after a step under the forces at t + theta dt."""
        acceleration = motion + self.gain * force
        tip = state.tip + self.dt * state.velocity + self._begin * state.acceleration
        velocity = state.velocity + self.dt / 2.0 * (state.acceleration + acceleration)
        return TipState(tip + self.weight * acceleration, velocity, acceleration)


class ComputedImpacts(NamedTuple):
    """Histories of many impacts on one plate."""

    force: Floats  # (steps, cases): contact force after every step
    indentation: IndentationMetrics
    unconverged_steps: NDArray[np.int64]  # (cases,): steps whose contact iteration did not converge
    plate: Deflection
    error: Floats  # (cases,): error of the energy balance; see :func:`balance_errors`
    coordinates: Floats | None = None  # (cases, rows, n): of a reduced plate at its stored times


class Work(NamedTuple):
    """Work of the contact forces of many cases on plate and indentation (force*length)."""

    done: Floats  # (blocks, cases): after every block of steps and after the last step
    excess: Floats  # (cases,): largest dt^2/8 m a^2 of the impact node; see :func:`balance_errors`


def impacts(
    response: Floats, dt: float, node_mass: float, hits: Hits, mobility: float = 0.0
) -> ComputedImpacts:
    """Compute many impacts on a plate from its response to a unit force, (steps,).

    `node_mass` is the mass that the contact force accelerates: the lumped mass of the impact node,
    or 1/(g M^-1 g) of a patch with the weights g. `mobility` (1/mass) is the mobility of the rigid
    motion of a plate that is not held.
    """
    rigid = mobility * dt**2
    if (constants := known_constants(hits.law)) is not None:
        kernel = partial(sweep_linear, response, rigid)
        return by_kernel(kernel, len(response), dt, hits, constants, node_mass)
    return by_numpy(response, node_mass, TipSteps(hits, dt, len(response)), rigid)[0]


def by_numpy(
    response: Floats, node_mass: float, tips: TipSteps, rigid: float = 0.0
) -> tuple[ComputedImpacts, Work]:
    """Compute impacts step by step, all cases together; see :func:`impacts`.

    `rigid` is the displacement of the rigid motion of the plate per force and step since.
    """
    law, speed = tips.hits.law, tips.hits.speed
    steps, cases = len(response), len(speed)
    none = np.zeros(cases)
    of_plate = np.broadcast_to(response[:, None], tips.responses.shape)
    sums = Convolution(np.stack([of_plate, tips.responses]), tips.hits.kind)
    state = ContactState(
        rod=TipState(none, -speed, none),
        memory=law.start(),
        contact=ContactPoint(none, none),
        plate_w=none,
        contact_work=np.zeros(cases),  # summed in place
        unconverged_steps=np.zeros(cases, dtype=np.int64),
    )
    force, deepest = np.empty((steps, cases)), none
    plate_work, dw, largest_ddw = none, none, none
    pushes, rigid_w, bent, bent_work = none, none, none, none
    record = DeflectionRecord(tips)
    done: list[Floats] = []
    for step in range(steps):
        last, w = state.contact.force, state.plate_w
        moved, tips.sums = sums.next()
        couple_step(tips, law, state, moved)
        sums.give(state.contact.force)
        force[step] = state.contact.force
        deepest = np.maximum(deepest, state.contact.indentation)
        # Central differences conserve the work 1/2 (F + F') (w' - w) on the plate.
        before, dw = dw, state.plate_w - w
        plate_work = plate_work + 0.5 * (last + state.contact.force) * dw
        largest_ddw = np.maximum(largest_ddw, np.abs(dw - before))
        # A plate that is not held moves by n `rigid` per force n steps ago.
        pushes = pushes + last
        rigid_w = rigid_w + rigid * pushes
        bent_before, bent = bent, state.plate_w - rigid_w
        bent_work = bent_work + 0.5 * (last + state.contact.force) * (bent - bent_before)
        record.add(state.plate_w, bent_work, bent)
        if not (step + 1) % BLOCK or step + 1 == steps:
            done.append(state.contact_work + plate_work)
    permanent = law.permanent(state.memory, state.contact)
    indentation = IndentationMetrics(
        deepest, state.contact.indentation, permanent, state.contact_work
    )
    work = Work(np.array(done), node_mass * largest_ddw**2 / (8.0 * tips.dt**2))
    error = balance_errors(force, work, tips)
    return ComputedImpacts(
        force, indentation, state.unconverged_steps, record.deflection, error
    ), work


def _energies(hits: Hits) -> Floats:
    """Return the energies of the projectiles, (cases,)."""
    masses = np.array([rod.total_mass for rod in hits.rods])[hits.kind] * hits.scale
    return np.asarray(0.5 * masses * hits.speed**2)


class DeflectionRecord:
    """Motion of the plate under the load in impacts that are computed step by step."""

    def __init__(self, tips: TipSteps) -> None:
        hits = tips.hits
        self._least = LEAST_WORK * _energies(hits)
        self._dt = tips.dt
        none = np.zeros(len(hits.kind))
        self.deflection = Deflection(none, none, none, none, none)
        self._bent = none

    def add(self, w: Floats, energy: Floats, bent: Floats) -> None:
        """Add a step, (cases,) each.

        `energy` of the plate and displacement `bent` are without the rigid motion of a plate that
        is not held.
        """
        before, last, self._bent = self.deflection, self._bent, bent
        with np.errstate(all="ignore"):
            compliance = bent * np.abs(bent) / (2.0 * np.maximum(energy, self._least))
        self.deflection = Deflection(
            np.maximum(before.largest, w),
            w,
            np.maximum(before.speed, np.abs(bent - last) / self._dt),
            energy,
            np.fmax(before.compliance, compliance),
        )


def balance_errors(force: Floats, work: Work, tips: TipSteps) -> Floats:
    """Estimate the relative error of the energy balance of cases, (cases,).

    The energy of the projectile and the work on plate and indentation must add up to the initial
    energy, after every block of steps and at the end. Central differences conserve 1/2 v(-)' M v(+)
    + 1/2 u' K u, with velocities half a step before and after: the work on the plate. The energy
    that a run reports is larger by dt^2/8 a' M a, of which only the part of the impact node is
    known here. The error is 0 if the initial energy is 0, and not finite if the motion is not
    finite.
    """
    hits, worst = tips.hits, np.zeros(force.shape[1])
    for number, rod in enumerate(hits.rods):
        cases = np.flatnonzero(hits.kind == number)
        scale = hits.scale[cases]
        initial = 0.5 * rod.total_mass * scale * hits.speed[cases] ** 2
        lost = np.zeros(len(cases))
        for done, motion in zip(work.done, tips.motions(number, force), strict=True):
            deformation, velocity, _ = motion.reshape(3, -1, len(cases)).swapaxes(1, 2)
            deformation[:, 0] = 0.0
            held = rod.kinetic_energy(velocity) + rod.strain_energy(deformation)
            lost = np.maximum(lost, np.abs(scale * held + done[cases] - initial))
        worst[cases] = (lost + work.excess[cases]) / np.where(initial > 0.0, initial, 1.0)
    return worst


@lru_cache(maxsize=8)
def _modes(rod: Projectile) -> ProjectileModes:
    return ProjectileModes.of(rod.stiffness(), rod.mass(), rod.rigid)


def known_constants(law: Law[Floats]) -> ContactParameters[Floats] | None:
    """Return the constants of a law that the compiled kernels have; None without kernels."""
    if kernels.LIBRARY is None or not isinstance(law, HystereticLaw) or not knows(law.constants):
        return None
    return law.constants


def by_kernel(
    kernel: Callable[[Swept], None],
    steps: int,
    dt: float,
    hits: Hits,
    constants: ContactParameters[Floats],
    node_mass: float = 0.0,
    stored: tuple[int, int] | None = None,
) -> ComputedImpacts:
    """Compute impacts by a compiled kernel, and projectiles by their modes.

    `node_mass` is that of :func:`impacts`; it is 0 where the kernel knows the energy of the plate.
    `stored` are the rows and the number of coordinates that the kernel stores.
    """
    law = kernel_law(constants)
    rows: dict[Given, float | Floats] = {
        Given.K: constants.k,
        Given.Q: constants.q,
        Given.CRITICAL: law.critical,
        Given.SLOPE: law.slope,
        Given.VELOCITY: hits.speed,
        Given.FACTOR: hits.scale,
    }
    inputs = np.stack(np.broadcast_arrays(*(rows[row] for row in Given)))
    cases = len(hits.speed)
    force, results = np.empty((cases, steps)), np.empty((len(ResultRow), cases))
    coordinates = None if stored is None else np.empty((cases, *stored))
    starts = np.searchsorted(hits.kind, np.arange(len(hits.rods) + 1)).tolist()
    for rod, first, last in zip(hits.rods, starts[:-1], starts[1:], strict=True):
        step = WilsonStep(rod.stiffness(), rod.mass(), dt, rigid=rod.rigid)
        chosen = slice(first, last)
        kernel(
            Swept(
                _modes(rod),
                step,
                law.kind,
                inputs[:, chosen],
                force[chosen],
                results[:, chosen],
                None if coordinates is None else coordinates[chosen],
            )
        )
    lost = results[ResultRow.LOST] + node_mass * results[ResultRow.LARGEST_DDW] ** 2 / (8.0 * dt**2)
    initial = results[ResultRow.INITIAL]
    return ComputedImpacts(
        force=force.T,
        indentation=IndentationMetrics(
            largest=results[ResultRow.DEEPEST],
            last=results[ResultRow.INDENTATION],
            permanent=results[ResultRow.PERMANENT],
            work=results[ResultRow.CONTACT_WORK],
        ),
        unconverged_steps=results[ResultRow.UNCONVERGED].astype(np.int64),
        plate=Deflection(
            largest=results[ResultRow.HIGHEST],
            last=results[ResultRow.W],
            speed=results[ResultRow.LARGEST_DW] / dt,
            energy=results[ResultRow.BENT_WORK],
            compliance=results[ResultRow.COMPLIANCE],
        ),
        error=lost / np.where(initial > 0.0, initial, 1.0),
        coordinates=coordinates,
    )
