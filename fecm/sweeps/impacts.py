"""Impacts of many cases on one plate, from its response to a unit force."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.mechanics import kernels
from fecm.mechanics.contact_law import (
    ContactPoint,
    HystereticLaw,
)
from fecm.mechanics.impact import ContactState, couple_step
from fecm.mechanics.impact_steps import CRITICAL, Modes
from fecm.mechanics.kernels import floats
from fecm.mechanics.projectile import Projectile
from fecm.mechanics.rod_integrators import WilsonStep
from fecm.results.metrics import Indentation
from fecm.sweeps.responses import BLOCK, Convolution, TipState, TipSteps

# Rows of the results of the kernel.
FOUND = (
    "deepest", "indentation", "permanent", "highest", "w", "largest_ddw", "lost", "initial",
    "unconverged",
)  # fmt: skip


class Hits(NamedTuple):
    """Projectiles, contact laws and velocities of cases."""

    rods: Sequence[Projectile]  # the kinds of projectiles
    kind: NDArray[np.intp]  # (cases,), ascending
    scale: Floats  # (cases,): factor of the mass and stiffness of the kind
    law: HystereticLaw  # with arrays of constants
    speed: Floats  # (cases,): approach velocity


@dataclass(frozen=True)
class Impacts:
    """Histories of many impacts on one plate."""

    force: Floats  # (steps, cases): contact force after every step
    indentation: Indentation
    unconverged_steps: NDArray[np.int64]  # (cases,): steps whose contact iteration did not converge
    deflection: tuple[Floats, Floats]  # (cases,): largest and last displacement of the plate
    error: Floats  # (cases,): error of the energy balance; see :func:`balance_errors`


class Work(NamedTuple):
    """Work of the contact forces of many cases (force*length)."""

    # (blocks, cases): on plate and indentation, after every block of steps and after the last step.
    done: Floats
    # (cases,): largest dt^2/8 m a^2 of the impact node: its share of the difference between the
    # plate's energy and the work done on it.
    excess: Floats


def impacts(response: Floats, dt: float, node_mass: float, hits: Hits) -> Impacts:
    """Compute many impacts on a plate from its response to a unit force, (steps,).

    `node_mass` is the mass that the contact force accelerates: the lumped mass of the impact node,
    or 1/(g M^-1 g) of a patch with the weights g.
    """
    if kernels.LIBRARY is not None and type(hits.law.constants) in CRITICAL:
        return _by_kernels(response, dt, node_mass, hits)
    rods = [WilsonStep(rod.stiffness(), rod.mass(), dt) for rod in hits.rods]
    tips = TipSteps(rods, hits.kind, len(response), hits.scale)
    return by_numpy(response, node_mass, hits, tips)[0]


def by_numpy(
    response: Floats, node_mass: float, hits: Hits, tips: TipSteps
) -> tuple[Impacts, Work]:
    """Compute impacts step by step, all cases together; see :func:`impacts`."""
    law, speed = hits.law, hits.speed
    steps, cases = len(response), len(speed)
    none = np.zeros(cases)
    of_plate = np.broadcast_to(response[:, None], tips.responses.shape)
    sums = Convolution(np.stack([of_plate, tips.responses]), tips.kinds)
    state = ContactState(
        TipState(none, -speed, none), law.start(), ContactPoint(none, none), none,
        unconverged_steps=np.zeros(cases, dtype=np.int64),
    )  # fmt: skip
    force, deepest = np.empty((steps, cases)), none
    plate_work, dw, largest_ddw, highest = none, none, none, none
    done: list[Floats] = []
    for step in range(steps):
        last, w = state.contact.force, state.plate_w
        moved, tips.sums = sums.next()
        couple_step(tips, law, state, moved)
        sums.give(state.contact.force)
        force[step] = state.contact.force
        deepest = np.maximum(deepest, state.contact.indentation)
        highest = np.maximum(highest, state.plate_w)
        # Central differences conserve the work 1/2 (F + F') (w' - w) on the plate.
        before, dw = dw, state.plate_w - w
        plate_work = plate_work + 0.5 * (last + state.contact.force) * dw
        largest_ddw = np.maximum(largest_ddw, np.abs(dw - before))
        if not (step + 1) % BLOCK or step + 1 == steps:
            done.append(state.contact_work + plate_work)
    permanent = law.permanent(state.memory, state.contact)
    work = Work(np.array(done), node_mass * largest_ddw**2 / (8.0 * tips.dt**2))
    found = Impacts(
        force,
        Indentation(deepest, state.contact.indentation, permanent),
        state.unconverged_steps,
        (highest, state.plate_w),
        balance_errors(force, work, hits, tips),
    )
    return found, work


def balance_errors(force: Floats, work: Work, hits: Hits, tips: TipSteps) -> Floats:
    """Estimate the error of the energy balance of cases relative to the initial energy, (cases,).

    The energy of the projectile and the work done on plate and indentation must add up to the
    initial energy, after every block of steps and after the last.  Central differences conserve
    1/2 v(-)' M v(+) + 1/2 u' K u, with velocities half a step before and after: the work done on
    the plate.  The energy that a run reports is larger by dt^2/8 a' M a, of which only the part of
    the impact node is known here.

    The error is 0 if the initial energy is 0, and not finite if the motion is not finite.
    """
    worst = np.zeros(len(hits.speed))
    for number, rod in enumerate(hits.rods):
        cases = np.flatnonzero(hits.kind == number)
        scale = hits.scale[cases]
        initial = 0.5 * rod.total_mass * scale * hits.speed[cases] ** 2
        lost = np.zeros(len(cases))
        for done, motion in zip(work.done, tips.motions(number, hits.speed, force), strict=True):
            deformation, velocity, _ = motion.reshape(3, -1, len(cases)).swapaxes(1, 2)
            deformation[:, 0] = 0.0
            held = rod.kinetic_energy(velocity) + rod.strain_energy(deformation)
            lost = np.maximum(lost, np.abs(scale * held + done[cases] - initial))
        worst[cases] = (lost + work.excess[cases]) / np.where(initial > 0.0, initial, 1.0)
    return worst


@lru_cache(maxsize=8)
def _modes(rod: Projectile) -> Modes:
    return Modes.of(rod.stiffness(), rod.mass())


def _by_kernels(response: Floats, dt: float, node_mass: float, hits: Hits) -> Impacts:
    """Compute impacts by the compiled kernels, and projectiles by their modes."""
    steps, cases, c = len(response), len(hits.speed), hits.law.constants
    given = np.empty((6, cases))
    given[0], given[1], given[4], given[5] = c.k, c.q, hits.speed, hits.scale
    given[2], given[3] = CRITICAL[type(c)](c)
    force, found = np.empty((cases, steps)), np.empty((len(FOUND), cases))
    starts = np.searchsorted(hits.kind, np.arange(len(hits.rods) + 1)).tolist()
    for rod, first, last in zip(hits.rods, starts[:-1], starts[1:], strict=True):
        step = WilsonStep(rod.stiffness(), rod.mass(), dt)
        modes = _modes(rod)
        (T, h), shape = modes.step(step), modes.shapes[0].copy()
        own = kernels.Sweep(
            last - first, cases, steps, len(shape), dt, step.theta, *step.weights,
            floats(T), floats(h), floats(modes.stiffness), floats(shape), floats(response),
            floats(given[:, first:]), floats(force[first:]), floats(found[:, first:]),
        )  # fmt: skip
        if not kernels.LIBRARY.fecm_sweep(ctypes.byref(own)):
            raise MemoryError
    at = dict(zip(FOUND, found, strict=True))
    lost = at["lost"] + node_mass * at["largest_ddw"] ** 2 / (8.0 * dt**2)
    return Impacts(
        force.T,
        Indentation(at["deepest"], at["indentation"], at["permanent"]),
        at["unconverged"].astype(np.int64),
        (at["highest"], at["w"]),
        lost / np.where(at["initial"] > 0.0, at["initial"], 1.0),
    )
