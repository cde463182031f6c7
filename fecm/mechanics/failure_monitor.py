"""Failure criteria of plies over time: the largest exposures of all states of stress (FAIL).

A state of stress is a ply at one of its faces, at a point of the plate.  Exposures are evaluated of
all states, modes only where an exposure rises.

Where a plate without residual stresses only bends, stresses are proportional to z, and so are
exposures: of plies of the same stiffness and strengths, on one side of the midplane, the state
farthest from it has the largest, and represents the others.  A monitor may evaluate these
:class:`Representatives` alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy, deepcopy
from itertools import groupby
from typing import ClassVar, NamedTuple, Self

import numpy as np

from fecm._typing import Array, Bools, Floats, Indices
from fecm.mechanics import failure
from fecm.mechanics.exposures import (
    NOWHERE,
    TIE,
    CircleStresses,
    Evaluations,
    FailureEnvelope,
    Largest,
    Maxima,
    PlyPoints,
    first_of_largest,
)
from fecm.mechanics.failure import OwnCriterion, with_own
from fecm.mechanics.laminate import PlyConstants, is_fabric
from fecm.mechanics.ply_stresses import ElementZone, PlyStresses
from fecm.mechanics.strains import Rows

# Points per matrix product: so few that BLAS uses one thread.
BLOCK = 512

UNKNOWN = -1.0  # exposure that no criterion can find
# Strengths of all plies, or of the plies of each laminate, None where they are not given.
AllStrengths = failure.Strengths | Sequence[Sequence[failure.Strengths | None]]


class PlyRun(NamedTuple):
    """Neighbouring plies of the same strengths: states from the lower face of one to another's."""

    strengths: failure.Strengths
    states: slice
    fabric: bool

    def is_evaluated(self, criterion: str) -> bool:
        """Whether a criterion is evaluated for the plies."""
        return failure.is_evaluated(criterion, fabric=self.fabric)


def _runs(
    strengths: Sequence[failure.Strengths | None], plies: Sequence[PlyConstants]
) -> list[PlyRun]:
    """Runs of plies with strengths; fabrics are apart."""
    found: list[PlyRun] = []
    first = 0
    for (own, fabric), group in groupby(zip(strengths, map(is_fabric, plies), strict=True)):
        end = first + len(list(group))
        if own is not None:
            found.append(PlyRun(own, slice(2 * first, 2 * end), fabric))
        first = end
    return found


class Representatives(NamedTuple):
    """States of a point that are evaluated, and the exposures of all by theirs."""

    states: Indices  # (evaluated,): their numbers among all states of a point, ascending
    of: Indices  # (states,): which of these represents each state
    share: Floats  # (states,): its exposure over that of this one

    @classmethod
    def every(cls, count: int) -> Self:
        """Every state represents itself."""
        return cls(np.arange(count), np.arange(count), np.ones(count))

    @classmethod
    def outermost(cls, z: Floats, stiffness: Floats, runs: Sequence[PlyRun]) -> Self:
        """Those farthest from the midplane, of states at z, (states,).

        The stiffness is their stresses per midplane strain, (components, states).  States without
        strengths represent themselves.
        """
        group = np.arange(len(z))
        for run in runs:
            # 0.0 is added as zeros may have signs.
            own = [0.0 + stiffness[:, run.states], z[None, run.states] < 0.0]
            _, first, same = np.unique(
                np.concatenate(own), axis=1, return_index=True, return_inverse=True
            )
            group[run.states] = run.states.start + first[same.ravel()]
        order = np.lexsort((-np.abs(z), group))
        farthest = order[np.unique(group[order], return_index=True)[1]]
        states = np.sort(farthest)
        of = np.searchsorted(states, farthest)[np.unique(group, return_inverse=True)[1].ravel()]
        most = np.abs(z)[states][of]
        share = np.divide(np.abs(z), most, out=np.ones_like(z), where=most > 0.0)
        return cls(states, of, share)

    def placed(self, run: PlyRun) -> PlyRun:
        """A run of all states as one of those that are evaluated."""
        ends = np.searchsorted(self.states, [run.states.start, run.states.stop]).tolist()
        return PlyRun(run.strengths, slice(*ends), run.fabric)


class ZoneCriteria:
    """Stresses and strengths of the plies of some elements.

    `residual` are residual stresses, (plies, 2, 3).  `outermost` asks for the representatives of
    proportional states.
    """

    def __init__(
        self,
        zone: ElementZone,
        points: Rows,
        strengths: Sequence[failure.Strengths | None],
        initial: Floats | None,
        residual: Floats | None = None,
        *,
        outermost: bool = False,
    ) -> None:
        self._zone, self._initial = zone, initial
        self.elements, self.points = zone.rows, points  # rows of its elements and their points
        self.strengths = strengths
        # Stresses by components, plies and faces.
        in_plane = zone.in_plane.transpose(3, 2, 0, 1).reshape(6, 3, -1)
        runs = _runs(strengths, zone.laminate.plies.constants)
        self.represent = Representatives.every(in_plane.shape[2])
        if outermost:
            faces = zone.laminate.plies.faces
            z = np.stack([faces[:-1], faces[1:]], axis=1).ravel()
            stiffness = in_plane[:3].reshape(9, -1)
            self.represent = Representatives.outermost(z, stiffness, runs)
        self.runs = [self.represent.placed(run) for run in runs]
        self.in_plane = in_plane[:, :, self.represent.states].copy()
        # Components by states; at rest with those of the initial strain.
        self.has_residual = residual is not None and bool(residual.any())
        self.residual = np.zeros(self.in_plane.shape[1:])
        if residual is not None:
            self.residual = residual.reshape(-1, 3).T[:, self.represent.states].copy()
        self.at_rest = self.residual
        if initial is not None:
            self.at_rest = self.residual + np.tensordot(initial, self.in_plane[:3], 1)
        # Stresses by interfaces, plies beside, and tau_13, tau_23.
        self.interfaces = zone.plies - 1
        tau = zone.interlaminar[:-1, 2].reshape(self.interfaces, 2, 12)
        angles = np.deg2rad(zone.laminate.plies.angles)
        c, s = np.cos(angles), np.sin(angles)
        turn = np.array([[c, s], [-s, c]]).transpose(2, 0, 1)
        beside = np.stack([turn[:-1], turn[1:]], axis=1)
        self.shear = np.einsum("ibct,itg->gibc", beside, tau)
        # (interfaces, 2): the weaker s13 and s23 of both plies; NaN where one is not known.
        own = np.array(
            [(np.nan, np.nan) if one is None else (one.s13, one.s23) for one in strengths]
        )
        self.weaker = np.minimum(own[:-1], own[1:])

    def with_residual(
        self, residual: Floats | None, strengths: Sequence[failure.Strengths | None] | None = None
    ) -> ZoneCriteria:
        """Return criteria with other residual stresses and strengths, at every state.

        `residual` is (plies, 2, 3).  The strengths stay if none are passed.
        """
        own = self.strengths if strengths is None else strengths
        return ZoneCriteria(self._zone, self.points, own, self._initial, residual)

    def between_plies(self, gradients: Floats) -> Floats:
        """Exposures of the interfaces, (elements, interfaces), of derivatives of the strains."""
        shear = gradients.reshape(-1, 12) @ self.shear.reshape(12, -1)
        shear = shear.reshape(len(gradients), self.interfaces, 2, 2)
        s13, s23 = self.weaker.T[:, :, None]
        exposures = failure.interlaminar(s13, s23, shear[..., 0], shear[..., 1])
        return np.asarray(exposures.max(axis=2))


class Around(NamedTuple):
    """The circle around the load on which exposures are evaluated too."""

    circle: CircleStresses
    centre: tuple[float, float]
    # (elements,): r / R of the elements next to the circle, by which interlaminar stresses, which
    # fall as 1 / r, are larger on the circle than at the centre of the element; 0 of the others.
    factor: Floats
    coarseness: float  # longest side of the elements on the circle over R


class FailureMonitor:
    """Evaluates the failure criteria of all plies.

    Parameters
    ----------
    stresses : PlyStresses
        Stresses of the plies per displacement.
    strengths : AllStrengths
        Strengths of the plies.
    criteria : sequence of OwnCriterion
        Criteria of users, after the known ones.
    counts : ndarray of bool (elements, points), optional
        Points whose exposures count among the largest; by default all.
    far : ndarray of bool (elements,), optional
        Elements whose interlaminar exposures count; by default those whose points all do.
    around : Around, optional
        Exposures on the circle around the load.
    """

    represents: ClassVar[bool] = False  # whether it evaluates representatives where it can

    def __init__(
        self,
        stresses: PlyStresses,
        strengths: AllStrengths,
        criteria: Sequence[OwnCriterion] = (),
        counts: Bools | None = None,
        far: Bools | None = None,
        around: Around | None = None,
    ) -> None:
        self.stresses = stresses
        # By name, those of users last, and the modes that their codes mean.
        self.criteria, self.modes = with_own(criteria)
        elements, points, _ = stresses.shape
        self.counts = np.ones((elements, points), dtype=bool) if counts is None else counts
        self.far = np.asarray(self.counts.all(axis=1)) if far is None else far
        self.has_interfaces = not isinstance(stresses, CircleStresses)
        self.around = around
        self.circle: FailureMonitor | None = None
        if around is not None:
            self.circle = type(self)(around.circle, strengths, criteria)
        # Users' criteria may not be proportional to the stresses.
        outermost = self.represents and not stresses.stretches and not criteria
        self.zones: list[ZoneCriteria] = []
        for number, zone in enumerate(stresses.zones):
            rows = zone.rows
            own = strengths[number] if isinstance(strengths, Sequence) else [strengths] * zone.plies
            if not isinstance(rows, slice):
                rows = (rows[:, None] * points + np.arange(points)).ravel()
            made = ZoneCriteria(zone, rows, own, stresses.initial, outermost=outermost)
            self.zones.append(made)
        self._zone_of = np.zeros(elements, dtype=np.intp)
        for number, zone in enumerate(stresses.zones):
            self._zone_of[zone.rows] = number

    @property
    def has_residual(self) -> bool:
        """Whether the plies have residual stresses."""
        return any(zone.has_residual for zone in self.zones)

    @property
    def states(self) -> int:
        """Number of evaluated states of a point, of the zone with the most of them."""
        return max(len(zone.represent.states) for zone in self.zones)

    def with_residual(
        self,
        residual: Sequence[Floats] | None,
        strengths: Sequence[Sequence[failure.Strengths | None]] | None = None,
    ) -> Self:
        """Return the same criteria with other residual stresses and strengths of the plies.

        The residual stresses of each laminate are (plies, 2, 3), in the axes of the plies; None if
        there are none.  The interlaminar criterion does not depend on them.  The strengths stay if
        none are passed.
        """
        made, count = copy(self), len(self.zones)
        made.zones = [
            zone.with_residual(stresses, own)
            for zone, stresses, own in zip(
                self.zones,
                [None] * count if residual is None else residual,
                [None] * count if strengths is None else strengths,
                strict=True,
            )
        ]
        if self.circle is not None:
            made.circle = self.circle.with_residual(residual, strengths)
        return made

    def start(self) -> FailureEnvelope:
        """No exposure yet."""
        elements, points, plies = self.stresses.shape
        states = Maxima.none(len(self.criteria), elements * points * self.states)
        interfaces = Maxima.none(elements, max(plies - 1, 0))
        known = np.zeros((len(self.criteria), elements * points, self.states), dtype=bool)
        for zone in self.zones:
            for run in zone.runs:
                for number, name in enumerate(self.criteria):
                    known[number, zone.points, run.states] = run.is_evaluated(name)
            unknown = np.ones(interfaces.exposure.shape[1], dtype=bool)
            unknown[: zone.interfaces] = np.isnan(zone.weaker).any(axis=1)
            interfaces.exposure[zone.elements] = np.where(unknown, np.nan, 0.0)
        for family, complete in self.stresses.families:
            if not complete:
                interfaces.exposure[family.rows] = np.nan
        states.exposure[~known.reshape(len(self.criteria), -1)] = UNKNOWN
        envelope = FailureEnvelope(states, interfaces, Largest.none(len(self.criteria) + 1))
        envelope.find_largest(self.counts, self.far)
        if self.circle is not None:
            envelope.circle = self.circle.start()
        return envelope

    def update(
        self, envelope: FailureEnvelope, fields: Floats, times: Sequence[float]
    ) -> Evaluations:
        """Raise the exposures to those of displacement fields, (fields, numnp, 5), at their times.

        Returns the largest ones that count after each.
        """
        rows = []
        for displacement, time in zip(fields, times, strict=True):
            self._evaluate(envelope, displacement, time)
            if self.circle is not None and envelope.circle is not None:
                self.circle._evaluate(envelope.circle, displacement, time)
            rows.append(self.largest(envelope))
        return Evaluations.of(rows)

    def largest(self, envelope: FailureEnvelope) -> Largest:
        """Largest exposures so far, those on the circle included.

        Numbers of states on the circle follow the others: of plies by their numbers on the circle,
        of interfaces by those of the elements next to it.
        """
        largest = deepcopy(envelope.largest)
        on_circle = self._on_circle(envelope)
        if on_circle is None:
            return largest
        before = np.nan_to_num(largest.exposure, nan=-1.0)
        higher = np.nan_to_num(on_circle.exposure, nan=-1.0) > before * (1.0 + TIE)
        for name, values in vars(on_circle).items():
            getattr(largest, name)[higher] = values[higher]
        return largest

    def _on_circle(self, envelope: FailureEnvelope) -> Largest | None:
        """Largest exposures on the circle, numbered as by :meth:`largest`; None without one."""
        if envelope.circle is None or self.around is None:
            return None
        on_circle = deepcopy(envelope.circle.largest)
        between = envelope.interfaces.exposure
        on_circle.state[:-1] += np.where(on_circle.state[:-1] == NOWHERE, 0, self._all_states)
        scaled = np.where(np.isfinite(between), between, -1.0) * self.around.factor[:, None]
        number = int(first_of_largest(scaled.ravel())) if scaled.size else NOWHERE
        on_circle.exposure[-1], on_circle.state[-1] = np.nan, NOWHERE
        if number != NOWHERE and scaled.flat[number] > 0.0:
            on_circle.exposure[-1] = scaled.flat[number]
            on_circle.state[-1] = between.size + number
            on_circle.mode[-1] = envelope.interfaces.mode.flat[number]
        return on_circle

    def circle_columns(self, envelope: FailureEnvelope, places: PlyPoints) -> dict[str, Array]:
        """Largest exposures on the circle, (criteria,) each; empty without a circle.

        With their times, and the number of points of the circle that have them.
        """
        on_circle = self._on_circle(envelope)
        if on_circle is None or envelope.circle is None or self.circle is None:
            return {}
        located = self.located(Evaluations.of([on_circle]), places)
        columns = {name: values[0] for name, values in located.items()}
        plies, interfaces = envelope.circle.plies, envelope.interfaces
        count = len(on_circle.state)
        times, points = np.full(count, np.nan), np.zeros(count, dtype=np.int64)
        for number, state in enumerate(on_circle.state.tolist()):
            if state == NOWHERE:
                continue
            tied = on_circle.exposure[number] * (1.0 - TIE)
            if number == count - 1:
                times[-1] = interfaces.time.flat[state - interfaces.exposure.size]
                factor = self._factors[:, None]
                points[-1] = np.count_nonzero((interfaces.exposure * factor >= tied).any(axis=1))
            else:
                times[number] = plies.time[number, state - self._all_states]
                of_points = plies.exposure[number].reshape(-1, self.circle.states)
                points[number] = np.count_nonzero((of_points >= tied).any(axis=1))
        order = self._order
        return columns | {"time": times[order], "points": points[order]}

    @property
    def _factors(self) -> Floats:
        """Factors of elements next to the circle, (elements,); 0 without one."""
        return np.zeros(len(self.far)) if self.around is None else self.around.factor

    @property
    def _order(self) -> list[int]:
        """Criteria as columns have them: the interlaminar one before those of users."""
        known, count = len(failure.CRITERIA), len(self.criteria) + 1
        return [*range(known), count - 1, *range(known, count - 1)]

    @property
    def _all_states(self) -> int:
        """Number of states of a criterion in the arrays of an envelope."""
        return self.counts.size * self.states

    def _evaluate(self, envelope: FailureEnvelope, displacement: Floats, time: float) -> None:
        """Raise the exposures to those of a displacement field."""
        strains, gradients = self.stresses.strains(displacement)
        every = range(len(self.criteria))
        self._raise_plies(every, envelope.plies, strains, time)
        for zone in self.zones if self.has_interfaces else ():
            self._raise_interfaces(zone, envelope.interfaces, gradients, time)
        envelope.find_largest(self.counts, self.far, strains)

    def every_state(self, envelope: FailureEnvelope) -> Maxima:
        """Largest exposures of all states, (criteria, states).

        States are elements, points, plies and faces; UNKNOWN of plies without strengths or that an
        element lacks, and of plies that a criterion is not evaluated for.
        """
        elements, points, plies = self.stresses.shape
        evaluated, count = envelope.plies, len(self.criteria)
        if all(len(zone.represent.states) == len(zone.represent.of) for zone in self.zones):
            return evaluated
        found = Maxima.none(count, elements * points * plies * 2)
        found.exposure[...] = UNKNOWN
        every, own = (
            [values.reshape(count, elements * points, -1) for values in vars(one).values()]
            for one in (found, evaluated)
        )
        for zone in self.zones:
            _, of, share = zone.represent
            factors = share, share > 0.0, share > 0.0  # no time and mode at the midplane
            known = own[0][:, zone.points][:, :, of] >= 0.0
            for values, given, factor in zip(every, own, factors, strict=True):
                of_states = given[:, zone.points][:, :, of]
                values[:, zone.points, : len(of)] = np.where(known, of_states * factor, of_states)
        return found

    @staticmethod
    def _raise_interfaces(
        zone: ZoneCriteria, interfaces: Maxima, gradients: Floats, time: float
    ) -> None:
        """Raise the exposures of interfaces."""
        place = (zone.elements, slice(zone.interfaces))
        worst = zone.between_plies(gradients[zone.elements])
        # Elements without nine nodes have no interlaminar stresses.
        before = np.where(np.isnan(worst), np.nan, interfaces.exposure[place])
        higher = worst > before * (1.0 + TIE)
        interfaces.exposure[place] = np.where(higher, worst, before)
        interfaces.time[place] = np.where(higher, time, interfaces.time[place])
        mode = failure.MODES.index("interlaminar shear")
        interfaces.mode[place] = np.where(higher, mode, interfaces.mode[place])

    def located(self, found: Evaluations, places: PlyPoints) -> dict[str, Array]:
        """Columns of evaluations with the plies and places of the largest exposures.

        The ply of an interface is the one above it, its place the centre of its element, or the
        point of the circle towards that centre.  The interlaminar criterion comes before those of
        users.
        """
        state = found.state
        ply, x, y = (np.zeros(state.shape) for _ in range(3))
        ply[:, :-1], points = self._plies_of(state[:, :-1] % self._all_states)
        x[:, :-1], y[:, :-1] = places.x.ravel()[points], places.y.ravel()[points]
        interfaces = max(self.stresses.shape[2] - 1, 1)
        element, interface = np.divmod(state[:, -1] % (len(self.far) * interfaces), interfaces)
        x_centre, y_centre = places.centres
        ply[:, -1], x[:, -1], y[:, -1] = interface + 1, x_centre[element], y_centre[element]
        if self.circle is not None and self.around is not None:
            on_circle = state[:, :-1] >= self._all_states
            number = np.where(on_circle, state[:, :-1] - self._all_states, 0)
            plies, points = self.circle._plies_of(number)
            ply[:, :-1] = np.where(on_circle, plies, ply[:, :-1])
            for values, at in zip((x, y), self.around.circle.points.T, strict=True):
                values[:, :-1] = np.where(on_circle, at[points], values[:, :-1])
            near = state[:, -1] >= len(self.far) * interfaces
            factor = np.where(near, self.around.factor[element], 1.0)
            for values, origin in zip((x, y), self.around.centre, strict=True):
                towards = origin + (values[:, -1] - origin) / factor
                values[:, -1] = np.where(near, towards, values[:, -1])
        nowhere = state == NOWHERE
        columns = {
            "mode": np.where(nowhere, 0, found.mode),
            "ply": np.where(nowhere, 0, ply).astype(np.int64),
            **{
                name: np.where(nowhere, np.nan, values)
                for name, values in {"exposure": found.exposure, "x": x, "y": y}.items()
            },
        }
        return {name: values[:, self._order] for name, values in columns.items()}

    def _plies_of(self, state: Array) -> tuple[Array, Indices]:
        """Plies, from 1, and rows of the points of states."""
        points, number = np.divmod(np.maximum(state, 0), self.states)
        plies = np.zeros((len(self.zones), self.states), dtype=np.intp)
        for row, zone in zip(plies, self.zones, strict=True):
            row[: len(zone.represent.states)] = zone.represent.states // 2 + 1
        return plies[self._zone_of[points // self.stresses.shape[1]], number], points

    def load_factors(self, envelope: FailureEnvelope) -> dict[str, float]:
        """Factors on the stresses less those at rest at which the largest exposures are 1.

        NaN where no exposure was found.
        """
        factors = dict.fromkeys(self.criteria, np.nan)
        largest = self.largest(envelope)
        for (name, criterion), state, strain in zip(
            self.criteria.items(), largest.state[:-1].tolist(), largest.strain, strict=False
        ):
            if state == NOWHERE:
                continue
            monitor = self if state < self._all_states else self.circle
            assert monitor is not None  # only a monitor with a circle has states beyond its own
            zone, number = monitor._state(state % self._all_states)
            strengths = zone.strengths[zone.represent.states[number] // 2]
            added = strain @ zone.in_plane[:, :, number]
            added -= zone.at_rest[:, number] - zone.residual[:, number]
            if strengths is not None:
                at_rest = zone.at_rest[:, number]
                factors[name] = failure.failure_load_factor(strengths, criterion, at_rest, added)
        return factors

    def _state(self, state: int) -> tuple[ZoneCriteria, int]:
        """The zone of a state, and its number among the states of its point."""
        point, number = divmod(state, self.states)
        return self.zones[self._zone_of[point // self.stresses.shape[1]]], number

    def _raise_plies(
        self, numbers: Sequence[int], plies: Maxima, strains: Floats, time: float
    ) -> None:
        """Raise exposures of some criteria to those of strains, (elements, points, 6)."""
        for zone in self.zones:
            for run in zone.runs:
                self._raise_by(numbers, zone, run, plies, strains.reshape(-1, 6), time)

    def _raise_by(
        self,
        numbers: Sequence[int],
        zone: ZoneCriteria,
        run: PlyRun,
        plies: Maxima,
        strains: Floats,
        time: float,
    ) -> None:
        """Raise exposures of some criteria to those of strains, (elements * points, 6)."""
        criteria = list(self.criteria.values())
        names = list(self.criteria)
        evaluated = [number for number in numbers if run.is_evaluated(names[number])]
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
            for number in evaluated:
                candidates = criteria[number](run.strengths, s1, s2, tau)
                exposure = failure.exposure_of(candidates)
                before = exposures[number, block, run.states]
                larger = exposure > before * (1.0 + TIE)
                if not larger.any():
                    continue
                point, state = np.nonzero(larger)
                at = (number, block[point], run.states.start + state)
                exposures[at], times[at] = exposure[larger], time
                modes[at] = failure.largest_modes(candidates, np.flatnonzero(larger), self.modes)
