"""Quick models of an impact without a mesh, and the static curve of a nonlinear plate.

The static curve is the force F of a nonlinear plate over its deflection W under the contact load.
An equilibrium has the least strain energy of all displacements u with the deflection W = P u, where
P are the nodal forces of a unit contact force.  There f(u) = F P, and with the tangent K_T

    du/dW = K_T^-1 P/(P K_T^-1 P),   dF/dW = 1/(P K_T^-1 P).

Quick models.  Small mass (Zener 1941, Olsson 1992): the plate under the contact is a dashpot,
a'' + 3/2 lambda sqrt(a) a' + a^1.5 = 0 in units of the contact.  Large mass: the plate, by its
static curve, and the indentation store the kinetic energy.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from itertools import chain, islice
from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats
from fecm.mechanics.membrane import MembraneForces
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.roots import root
from fecm.mechanics.solutions import (
    ConvergenceError,
    HeldTangent,
    SingularStiffnessError,
    Tangent,
)
from fecm.mechanics.symmetry import symmetry_reduction

# The iterations end at this change, relative to the displacement: force and work have its square.
CLOSE = 1.0e-7
MOST_ITERATIONS = 30
# The iterations fail beyond this relative change.  The first change is the whole displacement.
MOST_CHANGE = 2.0
# Conjugate gradients end at this residual, relative to the load: the compliance has its square.
# A tangent that needs more products is factorised anew.
CLOSE_DIRECTION = 1.0e-6
MOST_PRODUCTS = 15
DIFFERENCE = 1.0e-4  # of two displacements whose forces give a product, relative to them
MOST_STEPS = 200
# Steps relative to the deflection.  Steps near 0 are larger.
LARGEST_STEP = 0.25
SMALLEST_STEP = 1.0e-3


class StaticCurve(NamedTuple):
    """Force F and work of F over the deflection W, with a cubic between the points.

    Attributes
    ----------
    deflection, force, stiffness : ndarray (n,)
        W (length) starting at 0, F (force), and dF/dW.
    work : ndarray (n,)
        Integral of F dW, force*length.
    """

    deflection: Floats
    force: Floats
    stiffness: Floats
    work: Floats

    def at(self, deflection: Floats | float) -> tuple[Floats, Floats]:
        """Return force and work at deflections up to the last point."""
        W, F, slope = self.deflection, self.force, self.stiffness
        i = np.clip(np.searchsorted(W, deflection, side="right") - 1, 0, len(W) - 2)
        h = W[i + 1] - W[i]
        t = (deflection - W[i]) / h
        first_slope, last_slope = h * slope[i], h * slope[i + 1]
        rise = F[i + 1] - F[i]
        # F = F_i + c1 t + c2 t^2 + c3 t^3
        c2, c3 = 3.0 * rise - 2.0 * first_slope - last_slope, first_slope + last_slope - 2.0 * rise
        force = F[i] + t * (first_slope + t * (c2 + t * c3))
        work = self.work[i] + h * t * (
            F[i] + t * (first_slope / 2.0 + t * (c2 / 3.0 + t * c3 / 4.0))
        )
        return force, work


def static_curve(
    plate: PlateModel, contact: Floats, step: float, enough: Callable[[float, float, float], bool]
) -> StaticCurve:
    """Compute the equilibria of a plate under its contact load, starting at rest.

    Parameters
    ----------
    plate : PlateModel
        Plate without nodal forces and prescribed displacements.  Its rigid motion in the plane
        needs no supports.  One-sided supports have no gaps here.
    contact : ndarray (numnp, 5)
        Nodal forces of a unit contact force.
    step : float
        First step of the deflection, length.  Steps grow with the deflection.
    enough : callable
        Whether the curve may end at a point, given deflection, force and work.

    Returns
    -------
    StaticCurve
        Curve that ends at the first point for which `enough` is true.

    Raises
    ------
    SingularStiffnessError
        If the supports do not hold the plate.
    ConvergenceError
        If an equilibrium is not found, or `enough` is never true.
    """
    points: list[_Point] = []
    works = [0.0]
    for point, _ in islice(equilibria(plate, contact, step), MOST_STEPS + 1):
        points.append(point)
        if len(points) == 1:
            continue
        before = points[-2]
        h = point.deflection - before.deflection
        # Integral of the cubic between the two points.
        mean = (before.force + point.force) / 2.0
        bend = h * (before.stiffness - point.stiffness) / 12.0
        works.append(works[-1] + h * (mean + bend))
        if enough(point.deflection, point.force, works[-1]):
            W, F, slope = np.array(points).T.copy()
            return StaticCurve(W, F, slope, np.array(works))
    raise ConvergenceError(f"the static curve is not long enough after {MOST_STEPS} steps")


class _Point(NamedTuple):
    """Point of the static curve."""

    deflection: float
    force: float
    stiffness: float


def equilibria(
    plate: PlateModel, contact: Floats, step: float, growth: float = LARGEST_STEP
) -> Iterator[tuple[_Point, Floats]]:
    """Yield points of the static curve and their displacement fields without end, starting at rest.

    The other arguments are those of :func:`static_curve`.  Steps of the deflection are `step` and
    then `growth` times the deflection, unless the equilibrium is not found.
    """
    path = (_LiftingPath if plate.lifts else _Path)(plate, contact)
    load = path.load
    u, turn = np.zeros((2, len(load)))
    force, deflection, step_size = 0.0, 0.0, step
    compliant = path.compliant(u)
    compliance = float(load @ compliant)
    direction = compliant / compliance  # du/dW
    while True:
        yield _Point(deflection, force, 1.0 / compliance), path.field(u)
        step_size = max(step_size, growth * deflection)
        while (
            result := path.equilibrium(u + step_size * (direction + step_size / 2.0 * turn))
        ) is None:
            if path.renewed(u):
                continue
            step_size /= 2.0
            if step_size < SMALLEST_STEP * (step + deflection):
                raise ConvergenceError(f"no equilibrium beyond the deflection {deflection:.6g}")
        u, deflection = result, deflection + step_size
        compliant, before = path.compliant(u, compliant), direction
        compliance = float(load @ compliant)
        force = float(compliant @ path.internal(u)) / compliance
        direction = compliant / compliance
        turn = (direction - before) / step_size  # d2u/dW2


class _Update(NamedTuple):
    """Change of the displacement and of the internal forces, (n,), and their product."""

    change: Floats
    force: Floats
    work: float


class _Path:
    """Equilibria of a nonlinear plate; several of them share the factors of one tangent.

    Displacements, (n,), are those of the independent dofs of the plate: half of them if a half turn
    maps plate and load onto themselves.  They have the deflection W = P u under the contact load P.
    """

    def __init__(self, plate: PlateModel, contact: Floats) -> None:
        self._plate = plate
        self._reduction = reduction = symmetry_reduction(plate, contact)
        self.load = reduction.gather(contact)
        self._stiffness = reduction.reduced(plate.stiffness, plate.mesh.equations > 0)
        self._membrane = MembraneForces(plate, reduction.weights.astype(float))
        self._factorise(np.zeros(reduction.count))

    def field(self, u: Floats) -> Floats:
        """Return the displacement field, (numnp, 5), of a displacement."""
        return self._reduction.field(u)

    def _factorise(self, u: Floats) -> None:
        self._place = u  # displacement of the tangent
        self._tangent = Tangent(self._plate, self._reduction.field(u), self._reduction)
        self._response = self._tangent.solve(self.load)

    def renewed(self, u: Floats) -> bool:
        """Factorise the tangent about a displacement; return False if it is factorised."""
        if is_new := not np.array_equal(u, self._place):
            self._factorise(u)
        return is_new

    def internal(self, u: Floats) -> Floats:
        """Return the internal forces f(u), (n,)."""
        return self._of_plate(u)

    def _of_plate(self, u: Floats) -> Floats:
        """Return the internal forces without one-sided supports, (n,)."""
        forces, _ = self._membrane.forces(self._reduction.field(u))
        return np.asarray(self._stiffness @ u + self._reduction.gather(forces))

    def equilibrium(self, u: Floats) -> Floats | None:
        """Return the equilibrium of the deflection of a displacement; None without convergence.

        It has the least strain energy, which the BFGS method finds from the tangent (J. Nocedal and
        S. J. Wright, Numerical Optimization, algorithms 6.1 and 7.4).
        """
        updates: list[_Update] = []
        internal = self.internal(u)
        for _ in range(MOST_ITERATIONS):
            change = self._descent(internal, updates)
            u = u + change
            size = float(np.abs(change).max() / np.abs(u).max())
            if size <= CLOSE:
                return u
            if not size < MOST_CHANGE:
                return None
            before, internal = internal, self.internal(u)
            added = internal - before
            if (work := float(change @ added)) > 0.0:
                updates.append(_Update(change, added, work))
        return None

    def _descent(self, internal: Floats, updates: list[_Update]) -> Floats:
        """Return the change of the displacement, which leaves the deflection as it is."""
        # The contact force changes nothing here: -f keeps the right-hand side above its rounding
        # errors.
        residual, factors = -internal, []
        for update in reversed(updates):
            factors.append(float(update.change @ residual) / update.work)
            residual = residual - factors[-1] * update.force
        change = self._tangent.solve(residual)
        change -= float(self.load @ change) / float(self.load @ self._response) * self._response
        for update, factor in zip(updates, reversed(factors), strict=True):
            change += (factor - float(update.force @ change) / update.work) * update.change
        return change

    def compliant(self, u: Floats, start: Floats | None = None) -> Floats:
        """Return the displacement per force, K_T^-1 P, at a displacement, by conjugate gradients.

        The tangent is factorised anew if it is too old for them.
        """
        from scipy.sparse.linalg import LinearOperator, cg  # 0.2 s, which most runs don't need

        if np.array_equal(u, self._place):
            return self._response

        K = LinearOperator((len(u), len(u)), matvec=self._product(u), dtype=np.float64)
        M = LinearOperator(K.shape, matvec=self._approximation(u), dtype=np.float64)
        compliant, failed = cg(
            K, self.load, start, rtol=CLOSE_DIRECTION, maxiter=MOST_PRODUCTS, M=M
        )
        if failed:
            self._factorise(u)
            return self._response
        return np.asarray(compliant)

    def _product(self, u: Floats) -> Callable[[Floats], Floats]:
        """Return K_T times a direction: half the difference of the forces beside u."""

        def product(direction: Floats) -> Floats:
            change = DIFFERENCE * np.abs(u).max() / np.abs(direction).max()
            forward, backward = (self._of_plate(u + c * direction) for c in (change, -change))
            return np.asarray((forward - backward) / (2.0 * change))

        return product

    def _approximation(self, _: Floats) -> Callable[[Floats], Floats]:
        """Return the displacement of the factorised tangent under a load."""
        return self._tangent.approximate


class _LiftingPath(_Path):
    """Equilibria of a nonlinear plate on one-sided supports.

    Each iteration solves the plate that the tangent and the updates of BFGS describe, with the
    supports that are closed at its end: they are an active set, as in a static response.
    """

    _tangent: HeldTangent

    def _factorise(self, u: Floats) -> None:
        self._place = u
        self._tangent = HeldTangent(self._plate, self._reduction.field(u), self._reduction)
        self._held_response = self._tangent.solve(self.load)
        is_open = self._open(u) if u.any() else self._tangent.opened_by(self._held_response)
        self._response = self._tangent.released(self._held_response, is_open)

    def _open(self, u: Floats) -> Bools:
        """Return the supports that are open."""
        return ~self._tangent.supports.closed(u)

    def _springs(self, is_open: Bools) -> Floats:
        """Return the stiffness of the supports that are closed, (n,)."""
        return self._tangent.supports.springs(~is_open, len(self.load))

    def internal(self, u: Floats) -> Floats:
        """Return the internal forces f(u), (n,)."""
        return self._of_plate(u) + self._springs(self._open(u)) * u

    def equilibrium(self, u: Floats) -> Floats | None:
        """Return the equilibrium of the deflection of a displacement; None without convergence."""
        stiffness = _HeldStiffness(self._tangent)
        forces = self._of_plate(u)
        for _ in range(MOST_ITERATIONS):
            try:
                change = self._change(u, forces, stiffness)
            except (SingularStiffnessError, ConvergenceError):
                return None
            u = u + change
            size = float(np.abs(change).max() / np.abs(u).max())
            if size <= CLOSE:
                return u
            if not size < MOST_CHANGE:
                return None
            before, forces = forces, self._of_plate(u)
            stiffness.update(change, forces - before)
        return None

    def _change(self, u: Floats, forces: Floats, stiffness: _HeldStiffness) -> Floats:
        """Return the change of the displacement, which leaves the deflection as it is."""
        supports = self._tangent.supports
        response = stiffness.displacement(self.load)

        def bound(change: Floats) -> Floats:
            factor = float(self.load @ change) / float(self.load @ response)
            return np.asarray(change - factor * response)

        held = forces + supports.springs(np.ones(len(supports.dofs), dtype=bool), len(u)) * u
        change = bound(stiffness.displacement(-held))
        at_supports = response[supports.dofs]
        G = stiffness.G - np.outer(at_supports, at_supports) / float(self.load @ response)
        is_open, opened = supports.opened(G, (u + change)[supports.dofs])
        released = np.zeros_like(u)
        np.add.at(released, supports.dofs[is_open], opened)
        return change + bound(stiffness.displacement(released))

    def _product(self, u: Floats) -> Callable[[Floats], Floats]:
        springs, of_plate = self._springs(self._open(u)), super()._product(u)
        return lambda direction: of_plate(direction) + springs * direction

    def _approximation(self, u: Floats) -> Callable[[Floats], Floats]:
        is_open = self._open(u)
        return lambda load: self._tangent.released(self._tangent.approximate(load), is_open)


class _HeldStiffness:
    """Tangent of a plate with all supports closed; BFGS updates the part of the plate.

    Supports are left out of the updates: without the open ones the stiffness is positive definite.

    Attributes
    ----------
    G : ndarray
        Displacements of the supports by unit forces on them.
    """

    def __init__(self, tangent: HeldTangent) -> None:
        self._tangent = tangent
        # Updates are the sum of s c c^T over vectors c: these, 1/s, and the displacements by c.
        self._vectors: list[Floats] = []
        self._compliances: list[float] = []
        self._displacements: list[Floats] = []
        self.G = tangent.G

    def displacement(self, load: Floats) -> Floats:
        """Return the displacement under a load, (n,)."""
        u = self._tangent.approximate(load)
        if not self._vectors:
            return u
        X = np.array(self._displacements)
        return np.asarray(u - np.linalg.solve(self._inner, np.array(self._vectors) @ u) @ X)

    def update(self, change: Floats, force: Floats) -> None:
        """Take the change of the plate's internal forces with the displacement into account."""
        expected = self._tangent.plate_forces(change)
        for vector, compliance in zip(self._vectors, self._compliances, strict=True):
            expected += float(vector @ change) / compliance * vector
        work, expected_work = float(change @ force), float(change @ expected)
        if not min(work, expected_work) > 0.0:
            return
        self._vectors += [expected, force]
        self._compliances += [-expected_work, work]
        self._displacements += [self._tangent.approximate(c) for c in (expected, force)]
        X = np.array(self._displacements)
        self._inner = np.diag(self._compliances) + np.array(self._vectors) @ X.T
        at_supports = X[:, self._tangent.supports.dofs]
        self.G = self._tangent.G - at_supports.T @ np.linalg.solve(self._inner, at_supports)


MIDPOINTS = 1000  # number of midpoints in quadratures over force and deflection
# Power series of the motion on an infinite plate.
ORDER = 20
ROUNDING = 1e-14  # size of the last terms relative to the first
LONGEST = 1e6  # longest contact time


class QuickImpact(NamedTuple):
    """Result of a quick model."""

    peak: float  # peak of the contact force
    time: float  # time of the peak
    duration: float  # duration of the contact


def inelasticity(
    mass: float, velocity: float, k: float, plate_mass: float, rigidity: float
) -> float:
    """Return Zener's parameter lambda = k^0.4 V^0.2 M^0.6/(8 sqrt(m D*)).

    M and V are mass and velocity of the projectile, m is the plate's mass per area, k the contact
    coefficient in force/length^1.5, and D* the effective bending stiffness in force*length.
    """
    return float(k**0.4 * velocity**0.2 * mass**0.6) / (8.0 * math.sqrt(plate_mass * rigidity))


def infinite_plate(mass: float, velocity: float, k: float, parameter: float) -> QuickImpact:
    """Compute the impact on an infinite plate with the parameter lambda.

    The force is F = a^1.5 M V/T with the time scale T = (M/(k sqrt(V)))^0.4.  The duration is
    infinite if the contact lasts longer than 10^6 T.
    """
    motions = _motion(parameter)
    turning = next(motion for motion in motions if motion.turns)
    last = next(
        motion for motion in chain([turning], motions) if motion.leaves or motion.time[0] > LONGEST
    )
    peak, time = turning.peak()
    duration = last.end() if last.leaves else math.inf
    scale = _time_scale(mass, velocity, k)
    return QuickImpact(peak * mass * velocity / scale, time * scale, duration * scale)


def peak_on_infinite_plate(mass: float, velocity: float, k: float, parameter: float) -> float:
    """Return the peak force of :func:`infinite_plate` without computing the motion after it."""
    peak, _ = next(motion for motion in _motion(parameter) if motion.turns).peak()
    return peak * mass * velocity / _time_scale(mass, velocity, k)


def _time_scale(mass: float, velocity: float, k: float) -> float:
    return float((mass / (k * velocity**0.5)) ** 0.4)


class _Expansion(NamedTuple):
    """Motion of the contact within a step: coefficients of the powers of s, from s^0.

    With z = sqrt(a) and dt = 2 z ds the equation has no square roots: dz/ds = w, the velocity of
    the indentation, and dw/ds = -3 lambda z^2 w - 2 z^4.
    """

    z: list[float]
    w: list[float]
    time: list[float]
    step: float

    @classmethod
    def of(cls, z: float, w: float, time: float, parameter: float) -> _Expansion:
        """Expand the motion about a state."""
        zs, ws, times = [z], [w], [time]
        squares: list[float] = []  # z^2
        for k in range(ORDER):
            squares.append(_product(zs, zs))
            slowing = 3.0 * parameter * _product(squares, ws) + 2.0 * _product(squares, squares)
            zs.append(ws[k] / (k + 1))
            times.append(2.0 * zs[k] / (k + 1))
            ws.append(-slowing / (k + 1))
        small = ROUNDING * (z or 1.0)
        last = range(ORDER - 4, ORDER + 1)  # without damping, some powers are missing
        step = min((small / abs(zs[k])) ** (1.0 / k) for k in last if zs[k])
        return cls(zs, ws, times, step)

    @property
    def turns(self) -> bool:
        """Whether the indentation has its peak within the step."""
        return self.w[0] > 0.0 >= _value(self.w, self.step)

    @property
    def leaves(self) -> bool:
        """Whether the contact ends within the step."""
        return _value(self.z, self.step) <= 0.0

    def peak(self) -> tuple[float, float]:
        """Return the largest a^1.5, and its time."""
        s_peak = root(lambda s: _value(self.w, s), 0.0, self.step, ROUNDING * self.step)
        return _value(self.z, s_peak) ** 3, _value(self.time, s_peak)

    def end(self) -> float:
        """Return the time at which the contact ends."""
        s_end = root(lambda s: _value(self.z, s), 0.0, self.step, ROUNDING * self.step)
        return _value(self.time, s_end)


def _motion(parameter: float) -> Iterator[_Expansion]:
    """Yield the motion step by step from the first contact, without end."""
    z, w, time = 0.0, 1.0, 0.0
    while True:
        motion = _Expansion.of(z, w, time, parameter)
        yield motion
        z, w, time = (_value(powers, motion.step) for powers in motion[:3])


def _product(first: list[float], second: list[float]) -> float:
    """Return the last coefficient of the product of two series of the same length."""
    total: float = sum(map(operator.mul, first, reversed(second)))
    return total


def _value(powers: list[float], s: float) -> float:
    """Evaluate a power series."""
    value = 0.0
    for coefficient in reversed(powers):
        value = value * s + coefficient
    return value


def static_energy(force: float, k: float, stiffness: float) -> float:
    """Return the energy that a static plate and its contact store under a force."""
    return force**2 / (2.0 * stiffness) + 0.4 * math.cbrt(force**5 / k**2)


def static_peak(mass: float, velocity: float, k: float, stiffness: float) -> float:
    """Return the peak force of :func:`static_plate`."""
    energy = 0.5 * mass * velocity**2
    limit = velocity * math.sqrt(stiffness * mass)  # peak without indentation

    def missing(force: float) -> float:
        return static_energy(force, k, stiffness) - energy

    return root(missing, 0.0, limit, 1e-12 * limit)


def static_plate(mass: float, velocity: float, k: float, stiffness: float) -> QuickImpact:
    """Compute the impact on a plate without inertia.

    The energy M V^2/2 is stored as F^2/(2 k_b) in bending and as (2/5) F^(5/3)/k^(2/3) in the
    contact.  k_b is the static stiffness of the plate under its patch, force/length.  Plate and
    contact are springs in series.  The displacement of the mass at the force F is
    x = F/k_b + (F/k)^(2/3).  The duration is 2 times the integral of dx/v up to the peak F_m; the
    substitution F = F_m (1 - s^2)^3 removes the singularity.
    """
    peak = static_peak(mass, velocity, k, stiffness)
    s = (np.arange(MIDPOINTS) + 0.5) / MIDPOINTS
    rest = 1.0 - s * s
    force = peak * rest**3
    stored = force**2 / (2.0 * stiffness) + 0.4 * np.cbrt(force**5 / k**2)
    speed = np.sqrt(velocity**2 - 2.0 * stored / mass)
    slope = 1.0 / stiffness + 2.0 / 3.0 / np.cbrt(force * k**2)
    duration = 2.0 * float(np.mean(slope * 6.0 * peak * rest**2 * s / speed))
    return QuickImpact(peak, duration / 2.0, duration)


def curved_plate(mass: float, velocity: float, k: float, curve: StaticCurve) -> QuickImpact:
    """Compute the impact of :func:`static_plate` on a nonlinear plate.

    The energy M V^2/2 is stored as the integral of F dW in the plate and as (2/5) F^(5/3)/k^(2/3)
    in the contact.  The curve must reach this energy.
    """
    energy = 0.5 * mass * velocity**2
    limit = curve.deflection[-1]
    deflection = root(lambda w: stored_at(curve, k, w)[1] - energy, 0.0, limit, 1e-12 * limit)
    duration = contact_time_on_curve(mass, velocity, k, curve)
    return QuickImpact(stored_at(curve, k, deflection)[0], duration / 2.0, duration)


def contact_time_on_curve(mass: float, velocity: float, k: float, curve: StaticCurve) -> float:
    """Return the duration of the contact of :func:`curved_plate`.

    The duration is 2 times the integral of dx/v over the displacement x = W + (F/k)^(2/3) of the
    mass.  The quadrature takes midpoints of s, with W = W_m (1 - s^2)^3.  An infinite `k` leaves
    out the indentation.
    """
    energy = 0.5 * mass * velocity**2

    def stored(force: Floats, work: Floats) -> Floats:
        return np.asarray(work + 0.4 * np.cbrt(force**5 / k**2))

    limit = curve.deflection[-1]
    turn = root(lambda w: float(stored(*curve.at(w))) - energy, 0.0, limit, 1e-12 * limit)
    s = np.arange(2 * MIDPOINTS + 1) / (2 * MIDPOINTS)
    deflection = turn * (1.0 - s * s) ** 3
    force, work = curve.at(deflection)
    force = np.maximum(force, 0.0)  # rounding may make it negative at rest
    x = deflection + np.cbrt((force / k) ** 2)
    kinetic = (energy - stored(force, work))[1::2]
    return 2.0 * float((-np.diff(x[::2]) / np.sqrt(2.0 * kinetic / mass)).sum())


def stored_at(curve: StaticCurve, k: float, deflection: float) -> tuple[float, float]:
    """Return the force at a deflection, and the energy of plate and contact together."""
    force, work = curve.at(np.array(deflection))
    return float(force), float(work + 0.4 * np.cbrt(force**5 / k**2))
