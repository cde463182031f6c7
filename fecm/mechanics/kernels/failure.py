"""Largest exposures of the plies by the compiled kernels.

In: displacement fields at their times; midplane.h computes their strains.  Out: exposures with
times and modes, raised in place, of the interfaces and of the states of stress that
:class:`~fecm.mechanics.failure_monitor.FailureMonitor` evaluates at the points; also the largest
exposures after each field.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from copy import copy
from ctypes import POINTER, c_double, c_int64
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.elements import Quadrature
from fecm.mechanics.exposures import Evaluations, FailureEnvelope
from fecm.mechanics.failure import MODES, Strengths, puck_limits, puck_slope
from fecm.mechanics.failure_monitor import FailureMonitor, PlyRun, ZoneCriteria
from fecm.mechanics.kernels import LIBRARY, Codes, Doubles, Longs, Structure, filled, floats
from fecm.mechanics.kernels.strains import MidplaneStruct, midplanes


class PlyStruct(Structure):
    """Strengths, force/area, and slopes of a ply; see :class:`~fecm.mechanics.failure.Strengths`.

    The last two fields are the results of :func:`~fecm.mechanics.failure.puck_limits`.
    """

    _fields_ = (
        ("xt", c_double),
        ("xc", c_double),
        ("yt", c_double),
        ("yc", c_double),
        ("s12", c_double),
        ("f12", c_double),
        ("p_plus", c_double),
        ("p_minus", c_double),
        ("resistance", c_double),  # fracture resistance R_A of the action plane, force/area
        ("critical", c_double),  # shear stress tau_c where modes B and C meet, force/area
    )


class PliesStruct(Structure):
    """Neighbouring states of stress of the same strengths, `states` at each of `points` points.

    The arrays:

    ==============  ======================  ====================================================
    `row`           (points,)               rows of the points; not set for all points
    `stress`        (strains, 3, width)     stresses per strain
    `residual`      (3, width)              stresses without strain
    ==============  ======================  ====================================================
    """

    _fields_ = (
        ("points", c_int64),
        ("states", c_int64),
        ("width", c_int64),  # number of states, padded to a multiple of four
        ("first", c_int64),  # number of the first of these states at a point
        ("row", Longs),
        ("stress", Doubles),
        ("residual", Doubles),
        ("ply", PlyStruct),
        ("prunes", c_int64),  # whether states that cannot rise are not evaluated
        ("pucks", c_int64),  # whether Puck's criterion is evaluated
        # Where only the largest exposures matter: bound of all exposures per absolute strain,
        # (strains,), and the bound without strain.
        ("bound", Doubles),
        ("rest", c_double),
    )


class InterfacesStruct(Structure):
    """Interlaminar stresses of `interfaces` interfaces of `elements` elements.

    The arrays:

    ===========  =======================  ======================================================
    `row`        (elements,)              rows of the elements; not set for all elements
    `shear`      (2, strains, 4, width)   tau_13 and tau_23 over their strengths, of the plies above
                                          and below, per derivative of the strains
    ===========  =======================  ======================================================
    """

    _fields_ = (
        ("elements", c_int64),
        ("interfaces", c_int64),
        ("width", c_int64),  # number of interfaces, padded to a multiple of four
        ("row", Longs),
        ("shear", Doubles),
        ("code", c_int64),  # code of the mode of failure
    )


class MaximaStruct(Structure):
    """:class:`~fecm.mechanics.exposures.Maxima`, by the same names."""

    _fields_ = (("exposure", Doubles), ("time", Doubles), ("mode", Codes))


class LargestStruct(Structure):
    """:class:`~fecm.mechanics.exposures.Largest`, by the same names."""

    _fields_ = (("exposure", Doubles), ("strain", Doubles), ("state", Longs), ("mode", Codes))


class ExposuresStruct(Structure):
    """Exposures of a plate, and the data that they are computed from.

    The arrays; the last two belong to the current displacement:

    ==============  ======================  ====================================================
    `family`        (families,)             elements with the same nodes present
    `run`           (runs,)                 plies of the same strengths
    `zone`          (zones,)                interfaces of the elements of a laminate
    `counts`        (points,)               whether the exposures of a point count
    `far`           (elements,)             whether exposures of an element's interfaces count
    `strain`        (points, strains)       midplane strains and curvatures
    `gradient`      (elements, 2, strains)  their derivatives
    ==============  ======================  ====================================================
    """

    _fields_ = (
        ("elements", c_int64),
        ("points", c_int64),  # points of all elements
        ("states", c_int64),  # states per point in the arrays of `plies`
        ("interfaces", c_int64),  # interfaces per element in the arrays of `between`
        ("strains", c_int64),  # per point: 3 midplane strains and 3 curvatures, or 3 curvatures
        ("criteria", c_int64),  # criteria in the arrays of `largest`; the interlaminar one is last
        ("families", c_int64),
        ("runs", c_int64),
        ("zones", c_int64),
        ("family", POINTER(MidplaneStruct)),
        ("run", POINTER(PliesStruct)),
        ("zone", POINTER(InterfacesStruct)),
        ("counts", Codes),
        ("far", Codes),
        ("plies", MaximaStruct),
        ("between", MaximaStruct),
        ("largest", LargestStruct),
        ("strain", Doubles),
        ("gradient", Doubles),
        ("half", Doubles),  # (points,): half thickness, 0 near the load; or not set
        ("face", Doubles),  # (1,): largest absolute principal strain of both faces so far
    )


# Criteria of the kernels, which are the first of CRITERIA. NumPy evaluates the others.
COMPILED = ("max_stress", "tsai_wu", "hashin", "puck")
# Pruning needs exposures whose rounding errors are below TIE.  Beyond this ratio of strengths in
# tension and compression, or beyond this F12*, the sum in Tsai and Wu's root cancels.
LARGEST_RATIO = 1e4
LARGEST_F12 = 0.999


def _ply(p: Strengths) -> PlyStruct:
    """Return the structure of a ply's strengths."""
    resistance, critical = puck_limits(p)
    return PlyStruct(
        xt=p.xt,
        xc=p.xc,
        yt=p.yt,
        yc=p.yc,
        s12=p.s12,
        f12=p.f12,
        p_plus=puck_slope(p),
        p_minus=p.p_minus,
        resistance=resistance,
        critical=critical,
    )


def _bounds(p: Strengths) -> Floats:
    """Return numbers (3,) whose sum with absolute stresses bounds the exposures of all criteria.

    The exposures are sublinear, but for Puck's.  His mode C holds up to the shear stress
    critical/resistance |s2|, so that its quotient has a bound too.
    """
    resistance, critical = puck_limits(p)
    pull = puck_slope(p) / p.s12
    shear = p.yc / (2.0 * (p.s12 + p.p_minus * resistance)) ** 2
    return np.array(
        [
            1.0 / min(p.xt, p.xc),
            max(1.0 / min(p.yt, p.yc), abs(1.0 / p.yt - pull) + abs(pull)),
            max(1.0 / p.s12, shear * critical / resistance),
        ]
    )


def _prunes(p: Strengths) -> bool:
    """Return whether rounding of exposures is far below the kernels' tolerance of ties."""
    ratio = max(p.xt / p.xc, p.xc / p.xt, p.yt / p.yc, p.yc / p.yt)
    return ratio <= LARGEST_RATIO and abs(p.f12) <= LARGEST_F12


def _opposite(rule: Quadrature) -> Indices:
    """Return the point opposite to each point of a rule, (points,)."""
    distance = np.hypot(rule.xi + rule.xi[:, None], rule.eta + rule.eta[:, None])
    return np.asarray(distance.argmin(axis=1))


@dataclass
class _Kept:
    """Arrays and structures with which the kernels raise an envelope."""

    monitor: CompiledMonitor
    structure: ExposuresStruct
    strain: Floats  # (elements, points, strains): strains of the last displacement
    face: Floats  # (1,)
    held: list[Structure]  # structures in the arrays of structures, which must live as long


class CompiledMonitor(FailureMonitor):
    """Monitor whose exposures the compiled kernels evaluate."""

    represents: ClassVar[bool] = True
    only_largest: bool = False  # whether nothing but the largest exposures that count is asked for
    half: Floats | None = None  # (points,): see :meth:`for_strains`
    represented_by: Indices | None = None  # (elements,): see :meth:`for_half`

    def for_largest(self, chosen: Bools | None = None) -> Self:
        """Return a monitor that leaves out states which can't have a largest exposure.

        With `chosen` (elements,) it also leaves out the other elements.
        """
        monitor = copy(self)
        monitor.only_largest = True
        if chosen is not None:
            monitor.counts, monitor.far = self.counts & chosen[:, None], self.far & chosen
            if self.around is not None:
                factor = np.where(chosen, self.around.factor, 0.0)
                monitor.around = self.around._replace(factor=factor)
        if monitor.circle is not None:
            monitor.circle = monitor.circle.for_largest()
        return monitor

    def for_half(self, represented_by: Indices) -> Self:
        """Return a monitor that leaves out elements which others represent."""
        if len(self.criteria) > len(COMPILED):
            return self
        monitor = copy(self)
        monitor.represented_by = represented_by
        return monitor

    def complete(self, envelope: FailureEnvelope) -> None:
        """Copy the exposures of elements to the elements that they represent."""
        if self.represented_by is None:
            return
        elements, points, _ = self.stresses.shape
        images = np.flatnonzero(self.represented_by != np.arange(elements))
        sources, opposite = self.represented_by[images], _opposite(self.stresses.rule)
        for values in vars(envelope.interfaces).values():
            values[images] = values[sources]
        for values in vars(envelope.plies).values():
            by_point = values.reshape(len(self.criteria), elements, points, -1)
            by_point[:, images] = by_point[:, sources][:, :, opposite]

    def for_strains(self, half: Floats) -> Self:
        """Return a monitor of strains alone, :meth:`largest_strain`.

        `half` (points,) is the half thickness at the points, 0 where strains do not count.
        """
        monitor = copy(self)
        monitor.half, monitor.has_interfaces = half, False
        return monitor

    def largest_strain(self, envelope: FailureEnvelope, fields: Floats) -> float:
        """Return the largest absolute principal strain of both faces in fields, (n, numnp, 5)."""
        face = self._kept(envelope).face
        face[:] = 0.0
        self._update_built_in(envelope, fields, [0.0] * len(fields))
        return float(face[0])

    def raise_largest(
        self, envelope: FailureEnvelope, fields: Floats, times: Sequence[float]
    ) -> None:
        """Raise the exposures to the exposures of fields, (fields, numnp, 5), at their times."""
        if len(self.criteria) > len(COMPILED):
            super().raise_largest(envelope, fields, times)
            return
        self._update_built_in(envelope, fields, times)
        circle, around = self.circle, self.around
        if isinstance(circle, CompiledMonitor) and envelope.circle is not None and around:
            strains = around.circle.strains_of_fields(fields)[..., 6 - circle.strains :]
            circle._update_built_in(envelope.circle, strains.reshape(len(fields), -1), times)

    @property
    def _evaluated(self) -> Bools:
        """Mask of the elements that are evaluated, (elements,)."""
        elements, points, _ = self.stresses.shape
        if self.represented_by is not None and not self.only_largest:
            return np.asarray(self.represented_by == np.arange(elements))
        if self.half is not None:
            return np.asarray((self.half.reshape(elements, points) > 0.0).any(axis=1))
        if self.only_largest and len(self.criteria) == len(COMPILED):
            return np.asarray(self.counts.any(axis=1) | self.far | (self._factors > 0.0))
        return np.ones(elements, dtype=bool)

    @property
    def strains(self) -> int:
        """Number of strains at a point."""
        return 6 if self.stresses.stretches else 3

    def update(
        self, envelope: FailureEnvelope, fields: Floats, times: Sequence[float]
    ) -> Evaluations:
        """Raise the exposures; see :meth:`FailureMonitor.update`."""
        if len(self.criteria) > len(COMPILED) or self.circle is not None:
            return super().update(envelope, fields, times)
        return self._update_built_in(envelope, fields, times)

    def _evaluate(self, envelope: FailureEnvelope, displacement: Floats, time: float) -> None:
        """Raise the exposures, first with the kernel's criteria, then with the others."""
        given = displacement[None]
        if not self.has_interfaces:  # the kernel can't compute the strains on the circle
            strains, _ = self.stresses.strains(displacement)
            given = strains[None, ..., 6 - self.strains :]
        self._update_built_in(envelope, given, [time])
        if len(self.criteria) == len(COMPILED):
            return
        strains = self._kept(envelope).strain
        if not self.stresses.stretches:
            strains = np.concatenate([np.zeros(strains.shape), strains], axis=2)
        self._raise_plies(range(len(COMPILED), len(self.criteria)), envelope.plies, strains, time)
        envelope.find_largest(self.counts, self.far, strains)

    def _update_built_in(
        self, envelope: FailureEnvelope, fields: Floats, times: Sequence[float]
    ) -> Evaluations:
        """Raise the exposures of the kernel's criteria.

        On a circle the fields are strains, as its points have no elements.
        """
        u, field_times = np.ascontiguousarray(fields), np.array(times, dtype=np.float64)
        shape = len(u), len(envelope.largest.exposure)
        largest = Evaluations(np.empty(shape), np.empty(shape, np.int64), np.empty(shape, np.int8))
        LIBRARY.fecm_failure(
            ctypes.byref(self._kept(envelope).structure),
            *(len(u), u[0].size),
            floats(u),
            floats(field_times),
            floats(largest.exposure),
            largest.state.ctypes.data_as(Longs),
            largest.mode.ctypes.data_as(Codes),
        )
        return largest

    def _kept(self, envelope: FailureEnvelope) -> _Kept:
        """Return the arrays and structures of an envelope; create them on first use."""
        kept = envelope.kept
        if not isinstance(kept, _Kept) or kept.monitor is not self:
            envelope.kept = kept = self._create_structures(envelope)
        return kept

    def _create_structures(self, envelope: FailureEnvelope) -> _Kept:
        elements, points, _ = self.stresses.shape
        count = self.strains
        families = midplanes(self.stresses, self._evaluated)
        runs = [self._run(zone, run, count) for zone in self.zones for run in zone.runs]
        zones = [
            self._interfaces(zone, count)
            for zone in self.zones
            if zone.interfaces and self.has_interfaces
        ]
        strain, face = np.empty((elements, points, count)), np.zeros(1)
        structure = ExposuresStruct(
            elements=elements,
            points=elements * points,
            states=self.states,
            interfaces=envelope.interfaces.exposure.shape[1],
            strains=count,
            criteria=len(envelope.largest.exposure),
            families=len(families),
            runs=len(runs),
            zones=len(zones),
            family=(MidplaneStruct * len(families))(*families),
            run=(PliesStruct * len(runs))(*runs),
            zone=(InterfacesStruct * len(zones))(*zones),
            counts=self.counts.astype(np.int8),
            far=self.far.astype(np.int8),
            plies=MaximaStruct(**vars(envelope.plies)),
            between=MaximaStruct(**vars(envelope.interfaces)),
            largest=LargestStruct(**vars(envelope.largest)),
            strain=strain,
            gradient=np.empty((elements, 2, count)),
            half=self.half if count == 6 else None,
            face=face,
        )
        return _Kept(self, structure, strain, face, [*families, *runs, *zones])

    def _run(self, zone: ZoneCriteria, run: PlyRun, strains: int) -> PliesStruct:
        """Return the structure of a run of plies."""
        per_strain, residual = zone.in_plane[6 - strains :, :, run.states], zone.residual
        stress = filled(per_strain)
        bound = None
        share = _bounds(run.strengths)
        if self.only_largest and _prunes(run.strengths):
            bound = (share @ np.abs(per_strain)).max(axis=1)
        rows = None if isinstance(zone.points, slice) else zone.points
        if not self._evaluated.all():
            of_zone = np.arange(self.counts.size)[zone.points]
            rows = of_zone[self._evaluated[of_zone // self.counts.shape[1]]]
        return PliesStruct(
            points=self.counts.size if rows is None else len(rows),
            states=run.states.stop - run.states.start,
            width=stress.shape[2],
            first=run.states.start,
            row=rows,
            stress=stress,
            residual=filled(zone.residual[:, run.states]),
            ply=_ply(run.strengths),
            prunes=int(_prunes(run.strengths)),
            pucks=int(run.is_evaluated("puck")),
            bound=bound,
            rest=float((share @ np.abs(residual[:, run.states])).max()),
        )

    def _interfaces(self, zone: ZoneCriteria, strains: int) -> InterfacesStruct:
        """Return the structure of the interfaces of a zone."""
        rows = None if isinstance(zone.elements, slice) else zone.elements
        if not self._evaluated.all():
            of_zone = np.arange(len(self.counts))[zone.elements]
            rows = of_zone[self._evaluated[of_zone]]
        shear = zone.shear / zone.weaker[:, None]  # (12, interfaces, plies, tau)
        shear = shear.reshape(2, 6, zone.interfaces, 4)[:, 6 - strains :].swapaxes(2, 3)
        table = filled(shear)
        return InterfacesStruct(
            elements=len(self.counts) if rows is None else len(rows),
            interfaces=zone.interfaces,
            width=table.shape[3],
            row=rows,
            shear=table,
            code=MODES.index("interlaminar shear"),
        )
