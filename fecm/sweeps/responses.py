"""Responses to a unit force in the first step, and their convolution with force histories.

The plate is linear and the projectile acts on one dof, so that the displacement of this dof is
exactly the sum of its impulse responses: w_n = sum over m < n of g_(n-m) F_m.  A rod is linear too:
the acceleration of its tip is such a sum of the forces on the tip.  The sums are evaluated in
blocks: a matrix product adds the contributions of earlier blocks, and those of steps within the
block are added one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.mechanics.plate_motion import AppliedForce, Load, PlateMotion, PlateState
from fecm.mechanics.rod_integrators import RodIntegrator, RodState

# Steps of a block, and steps and cases of a matrix product with earlier blocks: small enough for
# BLAS to use one thread.
BLOCK = 64
# Multiplications of a matrix product small enough for BLAS to use one thread.
SMALL = BLOCK**3


def plate_response(
    motion: PlateMotion,
    load: Load,
    dt: float,
    steps: int,
    read: Callable[[int, PlateState], None] = lambda step, state: None,
) -> Floats:
    """Displacement per force under a load after 1 to `steps` steps, the first with a unit force.

    The plate has no nodal loads.  `read` is called with each step, from 0, and its state.
    """
    state = motion.start()
    response = np.empty(steps)
    for step in range(steps):
        motion.advance(state, dt, 0.0, AppliedForce(load, 1.0) if step == 0 else None)
        response[step] = load.dot(state.padded)
        read(step, state)
    return response


def tip_response(step: RodIntegrator, steps: int) -> Floats:
    """Acceleration per force of a tip after 1 to `steps` steps, the first under a unit force."""
    state = step.advance(RodState(np.zeros((3, step.n))), 1.0)
    response = np.empty(steps)
    response[0] = state.acceleration[0]
    for number in range(1, steps):
        state = step.advance(state)
        response[number] = state.acceleration[0]
    return response


def largest_sums(response: Floats, force: Floats) -> tuple[Floats, Floats]:
    """Largest and last absolute value (cases,) of the sums of a response and forces.

    `response` is (steps,), `force` (steps, cases).
    """
    sums = Convolution(response, np.zeros(force.shape[1], dtype=np.intp))
    largest = last = np.zeros(force.shape[1])
    for values in force:
        last = np.abs(sums.next())
        largest = np.maximum(largest, last)
        sums.give(values)
    return largest, last


def _product(a: Floats, b: Floats) -> Floats:
    """Matrix product in pieces small enough for BLAS to use one thread."""
    columns = max(1, SMALL // a.size)
    pieces = [a @ b[:, i : i + columns] for i in range(0, b.shape[1], columns)]
    return np.hstack(pieces)


class Convolution:
    """Sums x_n = sum over m < n of r_(n-m) f_m of many cases, where f_n may depend on x_n.

    `responses` are r_1, r_2, ... of each kind, (steps,) or (steps, kinds); `kinds` (cases,) is the
    kind of each case; cases of a kind are adjacent.
    """

    def __init__(self, responses: Floats, kinds: NDArray[np.intp]) -> None:
        self._responses = responses.reshape(len(responses), -1)
        self._kinds = kinds
        self._cuts = [
            (kind, slice(int(rows[0]), int(rows[-1]) + 1))
            for kind in np.unique(kinds)
            for rows in [np.flatnonzero(kinds == kind)]
        ]
        steps, cases = len(responses), len(kinds)
        self._given = np.zeros((steps + 1, cases))
        self._block = np.zeros((BLOCK, cases))
        # r_1 to r_BLOCK of each case, for the steps within a block.
        self._near = np.zeros((BLOCK, cases))
        self._near[:steps] = self._responses[:BLOCK, kinds]
        self._step = 0

    def next(self) -> Floats:
        """Return x_n (cases,) of the next step n = 1, 2, ..."""
        row = self._step % BLOCK
        self._step += 1
        if row == 0:
            self._begin_block()
        return np.asarray(self._block[row])

    def give(self, values: Floats) -> None:
        """Set f_n of the step last returned by :meth:`next`; f_0 before the first step."""
        self._given[self._step] = values
        row = self._step % BLOCK  # of the next step's x in its block
        left = BLOCK - row
        if row:
            self._block[row:] += self._near[:left] * values

    @property
    def given(self) -> Floats:
        """f_1, f_2, ... up to the last one set, (steps, cases)."""
        return self._given[1 : self._step + 1]

    def _begin_block(self) -> None:
        """Compute the contribution of all earlier steps to each step of the block."""
        known = self._step  # f_0 to f_(known - 1)
        rows = min(BLOCK, len(self._responses) - self._step + 1)
        for kind, cases in self._cuts:
            # Entry (i, m): r_(known + i - m), with r_1 first in memory.
            windows = np.lib.stride_tricks.sliding_window_view(self._responses[:, kind], known)
            table = windows[:rows, ::-1]
            self._block[:rows, cases] = 0.0
            for start in range(0, known, BLOCK):
                part = slice(start, min(start + BLOCK, known))
                factors = np.ascontiguousarray(table[:, part])
                for first in range(cases.start, cases.stop, BLOCK):
                    some = slice(first, min(first + BLOCK, cases.stop))
                    self._block[:rows, some] += factors @ self._given[part, some]


@dataclass(slots=True)
class TipState:
    """Motion of the tips of projectiles, (cases,) each."""

    tip: Floats
    velocity: Floats
    acceleration: Floats


class TipSteps:
    """Time steps of many projectiles that compute only the motion of the tips.

    `steps` has one integrator per kind of projectile, all with the same time step and method;
    `kinds` (cases,) is the kind of each case, with cases of a kind adjacent; `count` is the number
    of steps.  The stiffness and mass of a case are those of its kind times `scale` (cases,).
    """

    def __init__(
        self,
        steps: Sequence[RodIntegrator],
        kinds: NDArray[np.intp],
        count: int,
        scale: Floats | float = 1.0,
    ) -> None:
        first = steps[0]
        self._steps, self._kinds = steps, kinds
        self.theta, self.weight, self.dt = first.theta, first.weight, first.dt
        self._begin = first.weights[0]
        self.scale = np.broadcast_to(scale, kinds.shape)
        self.gain: Floats = np.array([step.gain for step in steps])[kinds] / self.scale
        # `end` adds r_1 = gain; the sum over earlier forces starts with r_2.
        responses = np.column_stack([tip_response(step, count + 1)[1:] for step in steps])
        self._carried = Convolution(responses, kinds)

    def motions(self, kind: int, speed: Floats) -> Iterator[Floats]:
        """Motion of complete projectiles of a kind after every block of steps and after the last.

        `speed` (cases,) are the impact velocities of the cases of all kinds; yields arrays (3 n,
        cases of the kind) as in :class:`~fecm.mechanics.rod_integrators.RodState`.
        """
        step, cases = self._steps[kind], np.flatnonzero(self._kinds == kind)
        forces = self._carried.given[:, cases]
        motion = np.zeros((3 * step.n, len(cases)))
        motion[step.n : 2 * step.n : 2] = -speed[cases]
        # T^1, T^2, T^4, ...; column j of `reach` is the effect of a unit force after j steps.
        powers, reach = [step.T], step.h[:, None]
        while reach.shape[1] < BLOCK:
            reach = np.hstack([reach, _product(powers[-1], reach)])
            powers.append(_product(powers[-1], powers[-1]))
        for start in range(0, len(forces), BLOCK):
            part = forces[start : start + BLOCK]
            count = len(part)
            for bit, power in enumerate(powers):
                if count >> bit & 1:
                    motion = _product(power, motion)
            motion += _product(reach[:, :count][:, ::-1], part)
            yield motion

    def begin(self, state: TipState) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the free acceleration (twice), the drift and the previous acceleration."""
        base = self._carried.next()
        drift = state.tip + self.dt * state.velocity + self._begin * state.acceleration
        return base, base, drift, state.acceleration

    def end(self, state: TipState, motion: Floats, force: Any) -> TipState:
        """Return the state after a step under the forces at t + theta dt."""
        acceleration = motion + self.gain * force
        self._carried.give(force / self.scale)
        tip = state.tip + self.dt * state.velocity + self._begin * state.acceleration
        return TipState(
            tip + self.weight * acceleration,
            state.velocity + self.dt / 2.0 * (state.acceleration + acceleration),
            acceleration,
        )
