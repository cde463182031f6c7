"""Failure criteria of plies over time: the largest exposures of all states of stress (FAIL).

A state of stress is a ply at one of its faces, at a point of the plate.  Exposures are evaluated of
all states, modes only where an exposure rises.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from itertools import groupby
from typing import Self

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Floats, Indices
from fecm.mechanics import failure
from fecm.mechanics.own_criterion import OwnCriterion, with_own
from fecm.mechanics.ply_stresses import PlyStresses, Zone
from fecm.mechanics.strains import Rows

# Points per matrix product: so few that BLAS uses one thread.
BLOCK = 512


@dataclass
class Maxima:
    """Largest exposure of every state so far, its time and mode."""

    exposure: Floats
    time: Floats
    mode: failure.Codes  # index into :data:`~fecm.mechanics.failure.MODES`

    @classmethod
    def none(cls, *shape: int) -> Maxima:
        """No exposure yet."""
        return cls(np.zeros(shape), np.zeros(shape), np.zeros(shape, np.int8))


@dataclass
class WorstStates:
    """The state of stress with the largest exposure of each criterion of the plies so far."""

    exposure: Floats  # (criteria,)
    state: Indices  # (criteria,): its number among those of the plate
    added: Floats  # (criteria, 3): its stresses less those at rest

    @classmethod
    def none(cls, count: int = len(failure.CRITERIA)) -> WorstStates:
        """No exposure yet, of so many criteria."""
        return cls(np.zeros(count), np.zeros(count, dtype=np.intp), np.zeros((count, 3)))


@dataclass
class Kept:
    """What follows from the exposures so far, and is kept up to date with them."""

    peaks: Floats  # (criteria, points): largest exposure of every point


@dataclass
class FailureEnvelope:
    """Largest exposures over time."""

    # (criteria, states): states are elements, points, plies and faces; :data:`UNKNOWN` of plies
    # without strengths, or that an element lacks.
    plies: Maxima
    interfaces: Maxima  # (elements, plies - 1); NaN where there is none
    worst: WorstStates = field(default_factory=WorstStates.none)  # only with residual stresses
    # Of the kernels; None where the exposures have changed without them.  No checkpoint has it.
    kept: Kept | None = field(default=None, init=False, repr=False, compare=False)

    def peaks(self, points: int) -> Floats:
        """Largest exposure of each criterion at every point, (criteria, points)."""
        if self.kept is not None:
            return self.kept.peaks
        exposure = self.plies.exposure
        return np.asarray(exposure.reshape(len(exposure), points, -1).max(axis=2))


UNKNOWN = -1.0  # exposure that no criterion can find
# Strengths of all plies, or of the plies of each laminate, None where they are not given.
AllStrengths = failure.Strengths | Sequence[Sequence[failure.Strengths | None]]


@frozen
class Run:
    """Neighbouring plies of the same strengths: states from the lower face of one to another's."""

    strengths: failure.Strengths
    states: slice


def _runs(strengths: Sequence[failure.Strengths | None]) -> list[Run]:
    """Runs of plies with strengths."""
    found: list[Run] = []
    first = 0
    for own, group in groupby(strengths):
        end = first + len(list(group))
        if own is not None:
            found.append(Run(own, slice(2 * first, 2 * end)))
        first = end
    return found


class ZoneCriteria:
    """Stresses and strengths of the plies of some elements."""

    def __init__(
        self,
        zone: Zone,
        points: Rows,
        strengths: Sequence[failure.Strengths | None],
        initial: Floats | None,
    ) -> None:
        self.elements, self.points = zone.rows, points  # rows of its elements and their points
        faces = zone.laminate.plies.faces
        self.z = np.stack([faces[:-1], faces[1:]], axis=1).ravel()  # of the states of a point
        self.strengths, self.runs = strengths, _runs(strengths)
        self._initial = initial
        plies = zone.laminate.plies
        # Stresses by components, plies and faces.
        self.in_plane = zone.in_plane.transpose(3, 2, 0, 1).reshape(6, 3, -1).copy()
        self.add(np.zeros((zone.plies, 2, 3)))
        # Stresses by interfaces, plies beside, and tau_13, tau_23.
        self.interfaces = zone.plies - 1
        tau = zone.interlaminar[:-1, 2].reshape(self.interfaces, 2, 12)
        angles = np.deg2rad(plies.angles)
        c, s = np.cos(angles), np.sin(angles)
        turn = np.array([[c, s], [-s, c]]).transpose(2, 0, 1)
        beside = np.stack([turn[:-1], turn[1:]], axis=1)
        self.shear = np.einsum("ibct,itg->gibc", beside, tau)
        # (interfaces, 2): the weaker s13 and s23 of both plies; NaN where one is not known.
        own = np.array(
            [(np.nan, np.nan) if one is None else (one.s13, one.s23) for one in strengths]
        )
        self.weaker = np.minimum(own[:-1], own[1:])

    def add(self, residual: Floats) -> None:
        """Add residual stresses, (plies, 2, 3), to those of every strain."""
        self.has_residual = bool(residual.any())
        # Components by plies and faces; at rest with those of the initial strain.
        self.residual = residual.reshape(-1, 3).T.copy()
        self.at_rest = self.residual
        if self._initial is not None:
            self.at_rest = self.residual + np.tensordot(self._initial, self.in_plane[:3], 1)

    def with_residual(self, residual: Floats) -> Self:
        """The same with residual stresses, (plies, 2, 3)."""
        made = copy(self)
        made.add(residual)
        return made

    def between_plies(self, gradients: Floats) -> Floats:
        """Exposures of the interfaces, (elements, interfaces), of derivatives of the strains."""
        shear = gradients.reshape(-1, 12) @ self.shear.reshape(12, -1)
        shear = shear.reshape(len(gradients), self.interfaces, 2, 2)
        s13, s23 = self.weaker.T[:, :, None]
        exposures = failure.interlaminar(s13, s23, shear[..., 0], shear[..., 1])
        return np.asarray(exposures.max(axis=2))


class FailureMonitor:
    """Evaluates the failure criteria of all plies."""

    def __init__(
        self,
        stresses: PlyStresses,
        strengths: AllStrengths,
        criteria: Sequence[OwnCriterion] = (),
    ) -> None:
        self.stresses = stresses
        # By name, those of users last, and the modes that their codes mean.
        self.criteria, self.modes = with_own(criteria)
        elements, points, _ = stresses.shape
        self.zones: list[ZoneCriteria] = []
        for number, zone in enumerate(stresses.zones):
            rows = zone.rows
            own = strengths[number] if isinstance(strengths, Sequence) else [strengths] * zone.plies
            if not isinstance(rows, slice):
                rows = (rows[:, None] * points + np.arange(points)).ravel()
            self.zones.append(ZoneCriteria(zone, rows, own, stresses.initial))
        self._zone_of = np.zeros(elements, dtype=np.intp)
        for number, zone in enumerate(stresses.zones):
            self._zone_of[zone.rows] = number

    @property
    def has_residual(self) -> bool:
        """Whether the plies have residual stresses."""
        return any(zone.has_residual for zone in self.zones)

    def with_residual(self, residual: Sequence[Floats]) -> Self:
        """The same criteria for plies with residual stresses in their axes.

        Those of each laminate are (plies, 2, 3).  The interlaminar criterion does not depend on
        them.
        """
        made = copy(self)
        made.zones = [
            zone.with_residual(own) for zone, own in zip(self.zones, residual, strict=True)
        ]
        return made

    def start(self) -> FailureEnvelope:
        """No exposure yet."""
        elements, points, plies = self.stresses.shape
        states = Maxima.none(len(self.criteria), elements * points * plies * 2)
        interfaces = Maxima.none(elements, max(plies - 1, 0))
        known = np.zeros((elements * points, plies * 2), dtype=bool)
        for zone in self.zones:
            for run in zone.runs:
                known[zone.points, run.states] = True
            interfaces.exposure[zone.elements, zone.interfaces :] = np.nan
        states.exposure[:, ~known.ravel()] = UNKNOWN
        return FailureEnvelope(states, interfaces, WorstStates.none(len(self.criteria)))

    def update(self, envelope: FailureEnvelope, field: Floats, time: float) -> Floats:
        """Raise the exposures to those of a displacement field, (numnp, 5).

        Returns its strains and curvatures, (elements, points, 6).
        """
        envelope.kept = None
        strains, gradients = self.stresses.strains(field)
        for zone in self.zones:
            for run in zone.runs:
                every = range(len(self.criteria))
                self._raise_by(every, zone, run, envelope.plies, strains.reshape(-1, 6), time)
        for zone in self.zones:
            self._raise_interfaces(zone, envelope.interfaces, gradients, time)
        return strains

    @staticmethod
    def _raise_interfaces(
        zone: ZoneCriteria, interfaces: Maxima, gradients: Floats, time: float
    ) -> None:
        """Raise the exposures of interfaces."""
        place = (zone.elements, slice(zone.interfaces))
        worst = zone.between_plies(gradients[zone.elements])
        # Elements without nine nodes have no interlaminar stresses.
        before = np.where(np.isnan(worst), np.nan, interfaces.exposure[place])
        higher = worst > before
        interfaces.exposure[place] = np.where(higher, worst, before)
        interfaces.time[place] = np.where(higher, time, interfaces.time[place])
        mode = failure.MODES.index("interlaminar shear")
        interfaces.mode[place] = np.where(higher, mode, interfaces.mode[place])

    def _place(self, state: int) -> tuple[int, ZoneCriteria, int]:
        """Point, zone, and number among the ply's faces of a state of the plate."""
        _, points, plies = self.stresses.shape
        point, own = divmod(state, 2 * plies)
        return point, self.zones[self._zone_of[point // points]], own

    def follow(self, envelope: FailureEnvelope, worst: Indices, strains: Floats) -> None:
        """Keep the stresses at the worst states, (criteria,), where their exposure has risen."""
        kept = envelope.worst
        for number, (exposure, state) in enumerate(
            zip(envelope.plies.exposure, worst.tolist(), strict=True)
        ):
            if exposure[state] > kept.exposure[number]:
                point, zone, own = self._place(state)
                kept.exposure[number], kept.state[number] = exposure[state], state
                kept.added[number] = strains.reshape(-1, 6)[point] @ zone.in_plane[:, :, own]
                kept.added[number] -= zone.at_rest[:, own] - zone.residual[:, own]

    def load_factors(self, worst: WorstStates) -> dict[str, float]:
        """Factors on the stresses less those at rest at which the exposures are 1.

        NaN where no exposure was found.
        """
        factors = {}
        for (name, criterion), state, added in zip(
            self.criteria.items(), worst.state.tolist(), worst.added, strict=True
        ):
            _, zone, own = self._place(state)
            strengths = zone.strengths[own // 2]
            factors[name] = (
                np.nan
                if strengths is None
                else failure.load_factor(strengths, criterion, zone.at_rest[:, own], added)
            )
        return factors

    def _raise_by(
        self,
        numbers: Sequence[int],
        zone: ZoneCriteria,
        run: Run,
        plies: Maxima,
        strains: Floats,
        time: float,
    ) -> None:
        """Raise exposures of some criteria to those of strains, (elements * points, 6)."""
        criteria = list(self.criteria.values())
        shape = (len(criteria), len(strains), -1)
        exposures, times, modes = (
            values.reshape(shape) for values in (plies.exposure, plies.time, plies.mode)
        )
        per_strain = zone.in_plane[:, :, run.states].reshape(6, -1)
        residual = zone.residual[:, run.states].ravel()
        rows = np.arange(len(strains))[zone.points]
        for start in range(0, len(rows), BLOCK):
            block = rows[start : start + BLOCK]
            total = strains[block] @ per_strain
            if zone.has_residual:
                total += residual
            s1, s2, tau = (np.ascontiguousarray(part) for part in np.split(total, 3, axis=1))
            for number in numbers:
                candidates = criteria[number](run.strengths, s1, s2, tau)
                exposure = failure.exposure_of(candidates)
                larger = exposure > exposures[number, block, run.states]
                if not larger.any():
                    continue
                point, state = np.nonzero(larger)
                at = (number, block[point], run.states.start + state)
                exposures[at], times[at] = exposure[larger], time
                modes[at] = failure.modes_of(candidates, np.flatnonzero(larger), self.modes)
