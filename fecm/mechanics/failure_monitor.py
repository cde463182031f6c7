"""Failure criteria of plies over time: the largest exposures of all states of stress (FAIL).

A state of stress is a face of a ply at a point of the plate.  Exposures are evaluated for all
states, modes only where an exposure rises.

In a plate that only bends, without residual stresses, stresses and exposures are proportional to z.
Among plies of the same stiffness and strengths on one side of the midplane, the state farthest from
the midplane has the largest exposure and represents the other states.  A monitor may evaluate only
these :class:`Representatives`.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
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

# Points per matrix product, few enough for BLAS to use one thread.
BLOCK = 512

UNKNOWN = -1.0  # exposure that no criterion returns
# Strengths of all plies, or of the plies of each laminate; None for a ply without strengths.
AllStrengths = failure.Strengths | Sequence[Sequence[failure.Strengths | None]]


class PlyRun(NamedTuple):
    """Neighbouring plies of the same strengths, as a slice of the states of a point."""

    strengths: failure.Strengths
    states: slice
    fabric: bool

    def is_evaluated(self, criterion: str) -> bool:
        """Return whether a criterion is evaluated for the plies."""
        return failure.is_evaluated(criterion, fabric=self.fabric)


def _find_runs(
    strengths: Sequence[failure.Strengths | None], plies: Sequence[PlyConstants]
) -> list[PlyRun]:
    """Split the plies with strengths into runs; fabrics get runs of their own."""
    runs: list[PlyRun] = []
    first = 0
    for (run_strengths, fabric), group in groupby(
        zip(strengths, map(is_fabric, plies), strict=True)
    ):
        end = first + len(list(group))
        if run_strengths is not None:
            runs.append(PlyRun(run_strengths, slice(2 * first, 2 * end), fabric))
        first = end
    return runs


class Representatives(NamedTuple):
    """States of a point that are evaluated, and how they represent all states."""

    states: Indices  # (evaluated,): numbers among all states of a point, ascending
    of: Indices  # (states,): position in `states` of the representative of each state
    share: Floats  # (states,): exposure of each state over the exposure of its representative

    @classmethod
    def every(cls, count: int) -> Self:
        """Let every state represent itself."""
        return cls(np.arange(count), np.arange(count), np.ones(count))

    @classmethod
    def outermost(cls, z: Floats, stiffness: Floats, runs: Sequence[PlyRun]) -> Self:
        """Choose the states farthest from the midplane among states at z, (states,).

        `stiffness` (components, states) are the stresses per midplane strain.  States without
        strengths represent themselves.
        """
        group = np.arange(len(z))
        for run in runs:
            # Adding 0.0 removes the signs of zeros.
            keys = [0.0 + stiffness[:, run.states], z[None, run.states] < 0.0]
            _, first, inverse = np.unique(
                np.concatenate(keys), axis=1, return_index=True, return_inverse=True
            )
            group[run.states] = run.states.start + first[inverse.ravel()]
        order = np.lexsort((-np.abs(z), group))
        farthest = order[np.unique(group[order], return_index=True)[1]]
        states = np.sort(farthest)
        of = np.searchsorted(states, farthest)[np.unique(group, return_inverse=True)[1].ravel()]
        largest = np.abs(z)[states][of]
        share = np.divide(np.abs(z), largest, out=np.ones_like(z), where=largest > 0.0)
        return cls(states, of, share)

    def evaluated_run(self, run: PlyRun) -> PlyRun:
        """Renumber a run from all states to the evaluated states."""
        ends = np.searchsorted(self.states, [run.states.start, run.states.stop]).tolist()
        return PlyRun(run.strengths, slice(*ends), run.fabric)


class ZoneCriteria:
    """Stresses and strengths in the plies of a zone of elements.

    `residual` are residual stresses, (plies, 2, 3).  With `outermost` only the outermost states
    represent proportional states.
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
        self.elements, self.points = zone.rows, points  # rows of the elements and of their points
        self.strengths = strengths
        # Stresses per strain: (strains, components, plies and faces).
        in_plane = zone.in_plane.transpose(3, 2, 0, 1).reshape(6, 3, -1)
        runs = _find_runs(strengths, zone.laminate.plies.constants)
        self.represent = Representatives.every(in_plane.shape[2])
        if outermost:
            faces = zone.laminate.plies.faces
            z = np.stack([faces[:-1], faces[1:]], axis=1).ravel()
            stiffness = in_plane[:3].reshape(9, -1)
            self.represent = Representatives.outermost(z, stiffness, runs)
        self.runs = [self.represent.evaluated_run(run) for run in runs]
        self.in_plane = in_plane[:, :, self.represent.states].copy()
        # (components, states): residual stresses; `at_rest` adds the stresses of the initial
        # strain.
        self.has_residual = residual is not None and bool(residual.any())
        self.residual = np.zeros(self.in_plane.shape[1:])
        if residual is not None:
            self.residual = residual.reshape(-1, 3).T[:, self.represent.states].copy()
        self.at_rest = self.residual
        if initial is not None:
            self.at_rest = self.residual + np.tensordot(initial, self.in_plane[:3], 1)
        # (gradients, interfaces, adjacent plies, tau): tau_13 and tau_23 per derivative of the
        # strains.
        self.interfaces = zone.plies - 1
        tau = zone.interlaminar[:-1, 2].reshape(self.interfaces, 2, 12)
        angles = np.deg2rad(zone.laminate.plies.angles)
        c, s = np.cos(angles), np.sin(angles)
        turn = np.array([[c, s], [-s, c]]).transpose(2, 0, 1)
        beside = np.stack([turn[:-1], turn[1:]], axis=1)
        self.shear = np.einsum("ibct,itg->gibc", beside, tau)
        # (interfaces, 2): the smaller s13 and s23 of the adjacent plies; NaN if one is unknown.
        shear_strengths = np.array(
            [(np.nan, np.nan) if ply is None else (ply.s13, ply.s23) for ply in strengths]
        )
        self.weaker = np.minimum(shear_strengths[:-1], shear_strengths[1:])

    def with_residual(
        self, residual: Floats | None, strengths: Sequence[failure.Strengths | None] | None = None
    ) -> ZoneCriteria:
        """Return criteria for every state with other residual stresses and strengths.

        `residual` is (plies, 2, 3).  The strengths stay if `strengths` is None.
        """
        new_strengths = self.strengths if strengths is None else strengths
        return ZoneCriteria(self._zone, self.points, new_strengths, self._initial, residual)

    def between_plies(self, gradients: Floats) -> Floats:
        """Return the exposures of interfaces, (elements, interfaces), under strain gradients."""
        shear = gradients.reshape(-1, 12) @ self.shear.reshape(12, -1)
        shear = shear.reshape(len(gradients), self.interfaces, 2, 2)
        s13, s23 = self.weaker.T[:, :, None]
        exposures = failure.interlaminar(s13, s23, shear[..., 0], shear[..., 1])
        return np.asarray(exposures.max(axis=2))


class Around(NamedTuple):
    """Circle around the load on which exposures are evaluated in addition."""

    circle: CircleStresses
    centre: tuple[float, float]
    # (elements,): r / R of elements next to the circle, 0 for other elements.  Interlaminar
    # stresses fall as 1 / r, so that they are larger on the circle than at the element's centre by
    # r / R.
    factor: Floats


class FailureMonitor:
    """Evaluator of the failure criteria of all plies.

    Parameters
    ----------
    stresses : PlyStresses
        Stresses of the plies per displacement.
    strengths : AllStrengths
        Strengths of the plies.
    criteria : sequence of OwnCriterion
        User-defined criteria, which follow the built-in criteria.
    counts : ndarray of bool (elements, points), optional
        Points whose exposures count among the largest; by default all.
    far : ndarray of bool (elements,), optional
        Elements whose interlaminar exposures count; by default those whose points all do.
    around : Around, optional
        Exposures on the circle around the load.
    """

    represents: ClassVar[bool] = False  # whether the class evaluates representatives if possible

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
        # Criteria by name, user-defined ones last, and the modes of failure by code.
        self.criteria, self.modes = with_own(criteria)
        elements, points, _ = stresses.shape
        self.counts = np.ones((elements, points), dtype=bool) if counts is None else counts
        self.far = np.asarray(self.counts.all(axis=1)) if far is None else far
        self.has_interfaces = not isinstance(stresses, CircleStresses)
        self.around = around
        self.circle: FailureMonitor | None = None
        if around is not None:
            self.circle = type(self)(around.circle, strengths, criteria)
        # User-defined criteria may not be proportional to the stresses.
        outermost = self.represents and not stresses.stretches and not criteria
        self.zones: list[ZoneCriteria] = []
        for number, zone in enumerate(stresses.zones):
            rows = zone.rows
            zone_strengths = (
                strengths[number] if isinstance(strengths, Sequence) else [strengths] * zone.plies
            )
            if not isinstance(rows, slice):
                rows = (rows[:, None] * points + np.arange(points)).ravel()
            zone_criteria = ZoneCriteria(
                zone, rows, zone_strengths, stresses.initial, outermost=outermost
            )
            self.zones.append(zone_criteria)
        self._zone_of = np.zeros(elements, dtype=np.intp)
        for number, zone in enumerate(stresses.zones):
            self._zone_of[zone.rows] = number

    @property
    def has_residual(self) -> bool:
        """Whether the plies have residual stresses."""
        return any(zone.has_residual for zone in self.zones)

    @property
    def states(self) -> int:
        """Number of evaluated states per point, in the zone with the most states."""
        return max(len(zone.represent.states) for zone in self.zones)

    def with_residual(
        self,
        residual: Sequence[Floats] | None,
        strengths: Sequence[Sequence[failure.Strengths | None]] | None = None,
    ) -> Self:
        """Return the same criteria with other residual stresses and strengths of the plies.

        The residual stresses of each laminate are (plies, 2, 3), in the axes of the plies; None
        means no residual stresses.  The interlaminar criterion does not depend on them.  The
        strengths stay if `strengths` is None.
        """
        monitor, count = copy(self), len(self.zones)
        monitor.zones = [
            zone.with_residual(stresses, zone_strengths)
            for zone, stresses, zone_strengths in zip(
                self.zones,
                [None] * count if residual is None else residual,
                [None] * count if strengths is None else strengths,
                strict=True,
            )
        ]
        if self.circle is not None:
            monitor.circle = self.circle.with_residual(residual, strengths)
        return monitor

    def start(self) -> FailureEnvelope:
        """Return the envelope without any exposure yet."""
        elements, points, plies = self.stresses.shape
        states = Maxima.none(len(self.criteria), elements * points * self.states)
        interfaces = Maxima.none(elements, max(plies - 1, 0))
        is_known = np.zeros((len(self.criteria), elements * points, self.states), dtype=bool)
        for zone in self.zones:
            for run in zone.runs:
                for number, name in enumerate(self.criteria):
                    is_known[number, zone.points, run.states] = run.is_evaluated(name)
            is_unknown = np.ones(interfaces.exposure.shape[1], dtype=bool)
            is_unknown[: zone.interfaces] = np.isnan(zone.weaker).any(axis=1)
            interfaces.exposure[zone.elements] = np.where(is_unknown, np.nan, 0.0)
        for family, complete in self.stresses.families:
            if not complete:
                interfaces.exposure[family.rows] = np.nan
        states.exposure[~is_known.reshape(len(self.criteria), -1)] = UNKNOWN
        envelope = FailureEnvelope(states, interfaces, Largest.none(len(self.criteria) + 1))
        envelope.find_largest(self.counts, self.far)
        if self.circle is not None:
            envelope.circle = self.circle.start()
        return envelope

    def update(
        self, envelope: FailureEnvelope, fields: Floats, times: Sequence[float]
    ) -> Evaluations:
        """Raise the exposures to the exposures of fields, (fields, numnp, 5), at their times.

        Returns the largest exposures that count after each field.
        """
        rows = []
        for displacement, time in zip(fields, times, strict=True):
            self._evaluate(envelope, displacement, time)
            if self.circle is not None and envelope.circle is not None:
                self.circle._evaluate(envelope.circle, displacement, time)
            rows.append(self.largest(envelope))
        return Evaluations.of(rows)

    def for_largest(self, chosen: Bools | None = None) -> Self:
        """Return a monitor for :meth:`raise_largest`; it may leave out all but some elements.

        `chosen` (elements,) has at least one of the elements with each largest exposure.
        """
        return self

    def for_half(self, represented_by: Indices) -> Self:
        """Return a monitor of fields that repeat under a half turn; it may evaluate half of them.

        `represented_by` is that of a :class:`~fecm.mechanics.symmetry.SymmetryReduction`.
        """
        return self

    def complete(self, envelope: FailureEnvelope) -> None:
        """Add the exposures of the elements that a monitor of half the elements leaves out."""

    def raise_largest(
        self, envelope: FailureEnvelope, fields: Floats, times: Sequence[float]
    ) -> None:
        """Raise the exposures as :meth:`update` does; :meth:`largest` has the largest ones."""
        self.update(envelope, fields, times)

    def largest(self, envelope: FailureEnvelope) -> Largest:
        """Return the largest exposures so far, including the exposures on the circle.

        States on the circle are numbered after the states of the elements.  A ply on the circle
        has its number on the circle, an interface the number of the element next to the circle.
        """
        largest = envelope.largest.copy()
        on_circle = self._on_circle(envelope)
        if on_circle is None:
            return largest
        before = np.nan_to_num(largest.exposure, nan=-1.0)
        higher = np.nan_to_num(on_circle.exposure, nan=-1.0) > before * (1.0 + TIE)
        for name, values in vars(on_circle).items():
            getattr(largest, name)[higher] = values[higher]
        return largest

    def _on_circle(self, envelope: FailureEnvelope) -> Largest | None:
        """Return the largest exposures on the circle, numbered as in :meth:`largest`, if any."""
        if envelope.circle is None or self.around is None:
            return None
        on_circle = envelope.circle.largest.copy()
        of_interfaces = envelope.interfaces.exposure
        on_circle.state[:-1] += np.where(on_circle.state[:-1] == NOWHERE, 0, self._all_states)
        scaled = (
            np.where(np.isfinite(of_interfaces), of_interfaces, -1.0) * self.around.factor[:, None]
        )
        number = int(first_of_largest(scaled.ravel())) if scaled.size else NOWHERE
        on_circle.exposure[-1], on_circle.state[-1] = np.nan, NOWHERE
        if number != NOWHERE and scaled.flat[number] > 0.0:
            on_circle.exposure[-1] = scaled.flat[number]
            on_circle.state[-1] = of_interfaces.size + number
            on_circle.mode[-1] = envelope.interfaces.mode.flat[number]
        return on_circle

    def circle_columns(self, envelope: FailureEnvelope, places: PlyPoints) -> dict[str, Array]:
        """Return columns of the largest exposures on the circle, (criteria,) each.

        The columns include the times, and the number of points of the circle that reach the largest
        exposure.  The dictionary is empty without a circle.
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
            threshold = on_circle.exposure[number] * (1.0 - TIE)
            if number == count - 1:
                times[-1] = interfaces.time.flat[state - interfaces.exposure.size]
                factor = self._factors[:, None]
                points[-1] = np.count_nonzero(
                    (interfaces.exposure * factor >= threshold).any(axis=1)
                )
            else:
                times[number] = plies.time[number, state - self._all_states]
                by_point = plies.exposure[number].reshape(-1, self.circle.states)
                points[number] = np.count_nonzero((by_point >= threshold).any(axis=1))
        order = self.order
        return columns | {"time": times[order], "points": points[order]}

    @property
    def _factors(self) -> Floats:
        """Factors of the elements next to the circle, (elements,); 0 without a circle."""
        return np.zeros(len(self.far)) if self.around is None else self.around.factor

    @property
    def order(self) -> list[int]:
        """Order of the criteria in columns: the interlaminar one precedes user-defined ones."""
        built_in, count = len(failure.CRITERIA), len(self.criteria) + 1
        return [*range(built_in), count - 1, *range(built_in, count - 1)]

    @property
    def _all_states(self) -> int:
        """Number of states of a criterion in the arrays of an envelope."""
        return self.counts.size * self.states

    def _evaluate(self, envelope: FailureEnvelope, displacement: Floats, time: float) -> None:
        """Raise the exposures to the exposures of a displacement field."""
        strains, gradients = self.stresses.strains(displacement)
        every = range(len(self.criteria))
        self._raise_plies(every, envelope.plies, strains, time)
        for zone in self.zones if self.has_interfaces else ():
            self._raise_interfaces(zone, envelope.interfaces, gradients, time)
        envelope.find_largest(self.counts, self.far, strains)

    def every_state(self, envelope: FailureEnvelope) -> Maxima:
        """Return the largest exposures of all states, (criteria, states).

        States are ordered by element, point, ply and face.  They are UNKNOWN for plies without
        strengths, for plies that an element lacks, and for plies that a criterion is not evaluated
        for.
        """
        elements, points, plies = self.stresses.shape
        evaluated, count = envelope.plies, len(self.criteria)
        if all(len(zone.represent.states) == len(zone.represent.of) for zone in self.zones):
            return evaluated
        expanded = Maxima.none(count, elements * points * plies * 2)
        expanded.exposure[...] = UNKNOWN
        targets, sources = (
            [values.reshape(count, elements * points, -1) for values in vars(maxima).values()]
            for maxima in (expanded, evaluated)
        )
        for zone in self.zones:
            _, of, share = zone.represent
            factors = share, share > 0.0, share > 0.0  # no time and mode at the midplane
            is_known = sources[0][:, zone.points][:, :, of] >= 0.0
            for target, source, factor in zip(targets, sources, factors, strict=True):
                of_states = source[:, zone.points][:, :, of]
                scaled = np.where(is_known, of_states * factor, of_states)
                target[:, zone.points, : len(of)] = scaled
        return expanded

    @staticmethod
    def _raise_interfaces(
        zone: ZoneCriteria, interfaces: Maxima, gradients: Floats, time: float
    ) -> None:
        """Raise the exposures of the interfaces of a zone."""
        zone_entries = (zone.elements, slice(zone.interfaces))
        exposure = zone.between_plies(gradients[zone.elements])
        # Elements without nine nodes have no interlaminar stresses.
        before = np.where(np.isnan(exposure), np.nan, interfaces.exposure[zone_entries])
        higher = exposure > before * (1.0 + TIE)
        interfaces.exposure[zone_entries] = np.where(higher, exposure, before)
        interfaces.time[zone_entries] = np.where(higher, time, interfaces.time[zone_entries])
        mode = failure.MODES.index("interlaminar shear")
        interfaces.mode[zone_entries] = np.where(higher, mode, interfaces.mode[zone_entries])

    def located(self, evaluations: Evaluations, places: PlyPoints) -> dict[str, Array]:
        """Return columns of evaluations with the plies and places of the largest exposures.

        The ply of an interface is the ply above it.  The place of an interface is the centre of its
        element, or the point of the circle towards this centre.  The interlaminar criterion
        precedes user-defined criteria.
        """
        state = evaluations.state
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
            for values, coordinates in zip((x, y), self.around.circle.points.T, strict=True):
                values[:, :-1] = np.where(on_circle, coordinates[points], values[:, :-1])
            is_next_to_circle = state[:, -1] >= len(self.far) * interfaces
            factor = np.where(is_next_to_circle, self.around.factor[element], 1.0)
            for values, origin in zip((x, y), self.around.centre, strict=True):
                towards = origin + (values[:, -1] - origin) / factor
                values[:, -1] = np.where(is_next_to_circle, towards, values[:, -1])
        nowhere = state == NOWHERE
        columns = {
            "mode": np.where(nowhere, 0, evaluations.mode),
            "ply": np.where(nowhere, 0, ply).astype(np.int64),
            **{
                name: np.where(nowhere, np.nan, values)
                for name, values in {"exposure": evaluations.exposure, "x": x, "y": y}.items()
            },
        }
        return {name: values[:, self.order] for name, values in columns.items()}

    def _plies_of(self, state: Array) -> tuple[Array, Indices]:
        """Return the plies, from 1, and the rows of the points of states."""
        points, number = np.divmod(np.maximum(state, 0), self.states)
        plies = np.zeros((len(self.zones), self.states), dtype=np.intp)
        for row, zone in zip(plies, self.zones, strict=True):
            row[: len(zone.represent.states)] = zone.represent.states // 2 + 1
        return plies[self._zone_of[points // self.stresses.shape[1]], number], points

    def load_factors(self, envelope: FailureEnvelope) -> dict[str, float]:
        """Return the factors on the added stresses at which the largest exposures are 1.

        The added stresses are the stresses minus the stresses at rest.  A factor is NaN if no
        exposure was found.
        """
        factors = dict.fromkeys(self.criteria, np.nan)
        largest = self.largest(envelope)
        for (name, criterion), state, strain in zip(
            self.criteria.items(), largest.state[:-1].tolist(), largest.strain, strict=False
        ):
            if state == NOWHERE:
                continue
            monitor = self if state < self._all_states else self.circle
            assert monitor is not None  # only a monitor with a circle has such a state
            zone, number = monitor._state(state % self._all_states)
            strengths = zone.strengths[zone.represent.states[number] // 2]
            added = strain @ zone.in_plane[:, :, number]
            added -= zone.at_rest[:, number] - zone.residual[:, number]
            if strengths is not None:
                at_rest = zone.at_rest[:, number]
                factors[name] = failure.failure_load_factor(strengths, criterion, at_rest, added)
        return factors

    def _state(self, state: int) -> tuple[ZoneCriteria, int]:
        """Return the zone of a state, and the number of the state at its point."""
        point, number = divmod(state, self.states)
        return self.zones[self._zone_of[point // self.stresses.shape[1]]], number

    def _raise_plies(
        self, numbers: Sequence[int], plies: Maxima, strains: Floats, time: float
    ) -> None:
        """Raise the exposures of the criteria `numbers` under strains, (elements, points, 6)."""
        for zone in self.zones:
            for run in zone.runs:
                self._raise_run(numbers, zone, run, plies, strains.reshape(-1, 6), time)

    def _raise_run(
        self,
        numbers: Sequence[int],
        zone: ZoneCriteria,
        run: PlyRun,
        plies: Maxima,
        strains: Floats,
        time: float,
    ) -> None:
        """Raise the exposures of a run of plies under strains, (elements * points, 6)."""
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
                entries = (number, block[point], run.states.start + state)
                exposures[entries], times[entries] = exposure[larger], time
                modes[entries] = failure.largest_modes(
                    candidates, np.flatnonzero(larger), self.modes
                )
