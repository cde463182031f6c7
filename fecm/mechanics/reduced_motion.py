"""Motion of a reduced plate under the contact forces of many impacts, all cases together.

Each coordinate q of frequency omega moves by

    q_(n+1) - 2 q_n + q_(n-1) = dt^2 psi (g F - dU/dq - a v),   psi = (sin(x)/x)^2,  x = omega dt/2,

with the central difference v of the velocity.  Without psi these are the central differences of a
full run.  With it free vibrations and constant forces are exact (W. Gautschi, Numerische Mathematik
3, 1961, 381): only contact force and membrane limit the step.  Of a vibration the central
difference is sin(omega dt)/(omega dt) times the velocity.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Floats
from fecm.mechanics.contact_law import ContactPoint, Law
from fecm.mechanics.reduced_plate import ReducedPlate

# Cases of every matrix product: no case depends on the others, and the products fit the cache.
TILE = 32
# Evaluations of the law in a trial, at most, and the error of its indentation.
EVALUATIONS = 40
TOLERANCE = 1e-9


class ReducedMotion:
    """Motion of a reduced plate from rest in a number of cases, with one time step."""

    def __init__(self, plate: ReducedPlate, dt: float, cases: int) -> None:
        self.plate, self.dt, self._cases = plate, dt, cases
        shape = (-(-cases // TILE), len(plate.stiffness), TILE)
        self._q, self._increment, self._internal = np.zeros((3, *shape))
        self._force = np.zeros((shape[0], 1, TILE))
        phase = np.sqrt(plate.stiffness)[:, None] * dt
        self._inertia = dt * dt * np.sinc(phase / (2.0 * np.pi)) ** 2  # dt^2 psi
        self._of_velocity = 1.0 / np.sinc(phase / np.pi)
        self._damping = 0.5 * plate.damping * self._inertia / dt
        self._damped = np.zeros((shape[0], TILE))  # what it has taken, up to half a step

    def advance(self, force: Floats) -> Floats:
        """Take a step under the contact forces at its start, (cases,).

        Returns the displacement of the coordinates under the load, (cases,).
        """
        before, self._increment = self._increment, self._next_increment(force)
        if self.plate.damping:
            self._damped += self.plate.damping * self.dt * self._square_of_velocity(before)
        self._q += self._increment
        for q, internal in zip(self._q, self._internal, strict=True):
            internal[:] = self.plate.internal_forces(q)
        moved = (self.plate.deflection[:, None] * self._q).sum(axis=1)
        return np.asarray(moved.ravel()[: self._cases])

    def energy(self, force: Floats) -> Floats:
        """Energy after the last step, under the forces there, with what the damping has taken.

        Kinetic and strain energy, (cases,).
        """
        square = self._square_of_velocity(self._next_increment(force))
        strain = np.array([self.plate.strain_energy(q) for q in self._q])
        damped = self._damped + 0.5 * self.plate.damping * self.dt * square
        return np.asarray((0.5 * square + strain + damped).ravel()[: self._cases])

    def _square_of_velocity(self, other: Floats) -> Floats:
        """Sum of the squares of the velocities between the last increments and others."""
        velocity = self._of_velocity * (self._increment + other) / (2.0 * self.dt)
        return np.asarray((velocity * velocity).sum(axis=1))

    def _next_increment(self, force: Floats) -> Floats:
        """Increments of the coordinates in the next step."""
        self._force.reshape(-1)[: self._cases] = force
        pull = self.plate.deflection[:, None] * self._force - self._internal
        b = self._damping
        return ((1.0 - b) * self._increment + self._inertia * pull) / (1.0 + b)


@frozen
class SeriesLaw:
    """A contact law in series with a linear spring, for many cases: the approach is a + F(a)/k_r.

    The spring is what the modes left out of a reduced plate yield under the present force, so that
    the contact iteration takes the approach for the indentation.  As a part of the plate's
    displacement in that iteration it would not converge where the contact is stiffer than k_r.
    """

    law: Law[Floats]  # whose trials leave its memory as it is
    flexibility: float  # 1/k_r, length/force

    def start(self) -> Any:
        """Memory before the first contact."""
        return self.law.start()

    def of_law(self, point: ContactPoint[Floats]) -> ContactPoint[Floats]:
        """The law's own indentation at a point whose indentation is the approach."""
        return ContactPoint(point.indentation - self.flexibility * point.force, point.force)

    def trial(
        self, memory: Any, last: ContactPoint[Floats], indentation: Floats
    ) -> tuple[Floats, Any]:
        """Contact force at a trial approach."""
        return self._solved(memory, last, indentation).force, memory

    def accept(self, memory: Any, last: ContactPoint[Floats], indentation: Floats) -> Any:
        """Memory after a step that ends at an approach."""
        own = self._solved(memory, last, indentation).indentation
        return self.law.accept(memory, self.of_law(last), own)

    def permanent(self, memory: Any, last: ContactPoint[Floats]) -> Floats:
        """Permanent indentation after unloading from the last point (length)."""
        return self.law.permanent(memory, self.of_law(last))

    def _solved(
        self, memory: Any, last: ContactPoint[Floats], approach: Floats
    ) -> ContactPoint[Floats]:
        """The law's own indentation at an approach, and its force.

        The excess e = a + F(a)/k_r - approach grows with a.  Its zero lies between the last
        indentation and that moved as far as the approach, and there beyond a - e of each a:
        secants between ends on both sides of it, of which the one that stays is weighed less (N.
        Anderson and A. Bjorck, BIT 13, 1973, 253).
        """
        own = self.of_law(last)

        def tried(a: Floats) -> tuple[Floats, Floats]:
            force, _ = self.law.trial(memory, own, a)
            return a + self.flexibility * force - approach, force

        other = approach - self.flexibility * last.force
        beyond, _ = tried(other)
        low, high = np.minimum(own.indentation, other), np.maximum(own.indentation, other)
        a = np.clip(other - beyond, low, high)
        excess, force = tried(a)
        for _ in range(EVALUATIONS):
            solved = np.abs(excess) <= TOLERANCE * np.abs(approach)
            if solved.all():
                break
            width = np.where(solved, 1.0, excess - beyond)
            secant = np.where(solved, a, a - excess * (a - other) / width)
            before, at = excess, a
            a = secant
            excess, force = tried(a)
            between = excess * before <= 0.0
            rest = 1.0 - excess / np.where(solved, 1.0, before)
            beyond = np.where(between, before, beyond * np.where(rest > 0.0, rest, 0.5))
            other = np.where(between, at, other)
        return ContactPoint(a, force)
