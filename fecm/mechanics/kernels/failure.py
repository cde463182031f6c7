"""Largest exposures of the plies by the compiled kernels.

In: displacement fields at their times; midplane.h computes their strains.  Out: exposures with
times and modes, raised in place, of the interfaces and of the states of stress that
:class:`~fecm.mechanics.failure_monitor.FailureMonitor` evaluates at the points; also the largest
exposures after each field.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, c_double, c_int64
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fecm._typing import Floats
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


def _prunes(p: Strengths) -> bool:
    """Return whether rounding of exposures is far below the kernels' tolerance of ties."""
    ratio = max(p.xt / p.xc, p.xc / p.xt, p.yt / p.yc, p.yc / p.yt)
    return ratio <= LARGEST_RATIO and abs(p.f12) <= LARGEST_F12


@dataclass
class _Kept:
    """Arrays and structures with which the kernels raise an envelope."""

    monitor: CompiledMonitor
    structure: ExposuresStruct
    strain: Floats  # (elements, points, strains): strains of the last displacement
    held: list[Structure]  # structures in the arrays of structures, which must live as long


class CompiledMonitor(FailureMonitor):
    """Monitor whose exposures the compiled kernels evaluate."""

    represents: ClassVar[bool] = True

    def update(
        self, envelope: FailureEnvelope, fields: Floats, times: Sequence[float]
    ) -> Evaluations:
        """Raise the exposures; see :meth:`FailureMonitor.update`."""
        if len(self.criteria) > len(COMPILED) or self.circle is not None:
            return super().update(envelope, fields, times)
        return self._update_built_in(envelope, fields, times)

    def _evaluate(self, envelope: FailureEnvelope, displacement: Floats, time: float) -> None:
        """Raise the exposures, first with the kernel's criteria, then with the others."""
        if not self.has_interfaces:  # the kernel can't compute the strains on the circle
            strains, _ = self.stresses.strains(displacement)
            kept = self._kept(envelope).strain
            kept[...] = strains[..., 6 - kept.shape[2] :]
        self._update_built_in(envelope, displacement[None], [time])
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
        """Raise the exposures of the kernel's criteria."""
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
        count = 6 if self.stresses.stretches else 3
        families = midplanes(self.stresses)
        runs = [self._run(zone, run, count) for zone in self.zones for run in zone.runs]
        zones = [
            self._interfaces(zone, count)
            for zone in self.zones
            if zone.interfaces and self.has_interfaces
        ]
        strain = np.empty((elements, points, count))
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
        )
        return _Kept(self, structure, strain, [*families, *runs, *zones])

    def _run(self, zone: ZoneCriteria, run: PlyRun, strains: int) -> PliesStruct:
        """Return the structure of a run of plies."""
        stress = filled(zone.in_plane[6 - strains :, :, run.states])
        rows = None if isinstance(zone.points, slice) else zone.points
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
        )

    def _interfaces(self, zone: ZoneCriteria, strains: int) -> InterfacesStruct:
        """Return the structure of the interfaces of a zone."""
        rows = None if isinstance(zone.elements, slice) else zone.elements
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
