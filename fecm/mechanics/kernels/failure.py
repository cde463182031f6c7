"""Largest exposures of the plies by the compiled kernels.

In: a displacement field at a time, whose strains :mod:`~fecm.mechanics.kernels.midplane` computes.
Out: the exposures of all states of stress (plies, faces) at the points, and of the interfaces,
raised in place with their times and modes, as
:class:`~fecm.mechanics.failure_monitor.FailureMonitor` has them.
"""

from __future__ import annotations

import ctypes
from ctypes import c_double, c_int64
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats, Indices
from fecm.mechanics.failure import CRITERIA, MODES, Strengths, puck_limits
from fecm.mechanics.failure_monitor import (
    FailureEnvelope,
    FailureMonitor,
    Kept,
    Maxima,
    Run,
    ZoneCriteria,
)
from fecm.mechanics.kernels import LIBRARY, Codes, Doubles, Longs, Structure, filled, floats
from fecm.mechanics.kernels.midplane import CompiledMidplane


class Ply(Structure):
    """Strengths, force/area, and slopes of a ply; see :class:`~fecm.mechanics.failure.Strengths`.

    The last two are Puck's, of :func:`~fecm.mechanics.failure.puck_limits`.
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


class Failure(Structure):
    """Largest exposures of `states` neighbouring states of stress at `points` points.

    `rows`, `stride` and `first` place them in the arrays of all points.  failure.h says which
    states the kernel does not evaluate.

    The arrays:

    ==============  ==================================  ========================================
    `row`           (points,)                           rows of the points; not set if these are all
    `in_plane`      (6, 3, width)                       stresses per midplane strain and curvature
    `residual`      (3, width)                          stresses without strain
    `outer`         (outermost,)                        outermost states
    `stands`        (width / 4,)                        of four states, the bits of the outermost
                                                        states that represent them
    `outer_stress`  (3, 3, outer_width)                 their stresses per curvature
    `reached`       (points, criteria, outer_width)     their largest exposures
    `exposure`      (criteria, rows, stride)            largest exposure so far
    `time`          (criteria, rows, stride)            when it was reached
    `mode`          (criteria, rows, stride)            its mode of failure
    `peak`          (criteria, rows)                    largest exposure of a point
    ==============  ==================================  ========================================
    """

    _fields_ = (
        ("points", c_int64),
        ("states", c_int64),
        ("width", c_int64),  # number of states, filled up to fours
        ("rows", c_int64),  # points of the arrays
        ("stride", c_int64),  # states of a point in the arrays
        ("first", c_int64),  # of these states among them
        ("row", Longs),
        ("in_plane", Doubles),
        ("residual", Doubles),
        ("ply", Ply),
        ("keep", c_double),  # factor on stored exposures that others must exceed to be evaluated
        ("proportional", c_int64),  # whether exposures have always been proportional to z
        ("outermost", c_int64),
        ("outer_width", c_int64),  # their number, filled up to fours; 0 without any
        ("outer", Longs),
        ("stands", Longs),
        ("outer_stress", Doubles),
        ("reached", Doubles),
        ("exposure", Doubles),
        ("time", Doubles),
        ("mode", Codes),
        ("peak", Doubles),
    )


class Interfaces(Structure):
    """Largest interlaminar exposures of `interfaces` interfaces of `elements` elements.

    The arrays:

    ===========  ======================  =======================================================
    `row`        (elements,)             rows of the elements; not set if these are all
    `shear`      (12, 4, width)          tau_13 and tau_23 over their strengths, of the plies above
                                         and below, per derivative of the strains
    `exposure`   (rows, stride)          largest exposure so far
    `time`       (rows, stride)          when it was reached
    `mode`       (rows, stride)          its mode of failure
    ===========  ======================  =======================================================
    """

    _fields_ = (
        ("elements", c_int64),
        ("interfaces", c_int64),
        ("width", c_int64),  # number of interfaces, filled up to fours
        ("stride", c_int64),  # interfaces of an element in the arrays
        ("row", Longs),
        ("shear", Doubles),
        ("code", c_int64),  # of the mode of failure
        ("exposure", Doubles),
        ("time", Doubles),
        ("mode", Codes),
    )


# Exposures below this share of those stored are not evaluated: far more than rounding.
KEEP = 1.0 - 1e-9
# Largest ratio of strengths in tension and compression, and largest F12*, for which rounding
# changes an exposure by less than this: the sum in Tsai and Wu's root cancels beyond.
LARGEST_RATIO = 1e4
LARGEST_F12 = 0.999
# Error of the proportion of exposures by rounding, much smaller than that of KEEP.
PROPORTION = 1.0 - 1e-11
BITS = 63  # largest number of outermost states that the kernel can tell apart


def _ply(p: Strengths) -> Ply:
    """Strengths for the kernels."""
    resistance, critical = puck_limits(p)
    return Ply(
        xt=p.xt,
        xc=p.xc,
        yt=p.yt,
        yc=p.yc,
        s12=p.s12,
        f12=p.f12,
        p_plus=p.p_plus,
        p_minus=p.p_minus,
        resistance=resistance,
        critical=critical,
    )


def _share_kept(p: Strengths) -> float:
    """Share of a stored exposure that others must exceed to be evaluated; 0 to evaluate all."""
    ratio = max(p.xt / p.xc, p.xc / p.xt, p.yt / p.yc, p.yc / p.yt)
    return KEEP if ratio <= LARGEST_RATIO and abs(p.f12) <= LARGEST_F12 else 0.0


class _Outermost(NamedTuple):
    """Of plies with the same stiffness on one side of the midplane, the states farthest from it."""

    states: Indices  # (outermost,): numbers among the states of a run
    of: Indices  # (states,): which of these represents each state
    share: Floats  # (states,): |z| over that of this one

    @classmethod
    def of_run(cls, zone: ZoneCriteria, run: Run) -> Self:
        """Those of a run."""
        z = zone.z[run.states]
        # Stresses per midplane strain; 0.0 is added as zeros may have signs.
        stiffness = 0.0 + zone.in_plane[:3, :, run.states].reshape(9, -1)
        sides = np.concatenate([stiffness, z[None] < 0.0])
        _, of = np.unique(sides, axis=1, return_inverse=True)
        of = of.ravel()
        order = np.lexsort((-np.abs(z), of))
        states = order[np.unique(of[order], return_index=True)[1]]
        farthest = np.abs(z)[states][of]
        share = np.divide(np.abs(z), farthest, out=np.zeros_like(z), where=farthest > 0.0)
        return cls(states, of, share)

    def stands(self) -> NDArray[np.int64]:
        """Of every four states, the bits of those that represent them, (width / 4,)."""
        bits = np.zeros(-(-len(self.of) // 4) * 4, dtype=np.int64)
        bits[: len(self.of)] = np.left_shift(1, self.of % BITS)
        return np.asarray(np.bitwise_or.reduce(bits.reshape(-1, 4), axis=1))


@dataclass
class _Work(Kept):
    """What the kernels need for an envelope."""

    monitor: CompiledMonitor
    runs: list[Failure]
    interfaces: list[Interfaces]


class CompiledMonitor(FailureMonitor):
    """The same exposures."""

    def update(self, envelope: FailureEnvelope, field: Floats, time: float) -> Floats:
        """Raise the exposures; see :meth:`FailureMonitor.update`."""
        work = envelope.kept
        if not isinstance(work, _Work) or work.monitor is not self:
            envelope.kept = work = self._work(envelope)
        strains, gradients = self._midplane.evaluate(field)
        for run in work.runs:
            LIBRARY.fecm_failure(ctypes.byref(run), floats(strains), time)
        for interfaces in work.interfaces:
            LIBRARY.fecm_interfaces(ctypes.byref(interfaces), floats(gradients), time)
        # Those of users come after the criteria that the kernel has.
        if own := range(len(CRITERIA), len(self.criteria)):
            for zone in self.zones:
                for one in zone.runs:
                    self._raise_by(own, zone, one, envelope.plies, strains.reshape(-1, 6), time)
            exposure = envelope.plies.exposure[own.start :]
            work.peaks[own.start :] = exposure.reshape(len(own), self._points, -1).max(axis=2)
        return strains

    @cached_property
    def _midplane(self) -> CompiledMidplane:
        return CompiledMidplane(self.stresses)

    @property
    def _points(self) -> int:
        elements, points, _ = self.stresses.shape
        return elements * points

    def _work(self, envelope: FailureEnvelope) -> _Work:
        """What the kernels need for an envelope, whatever its exposures are."""
        envelope.kept = None
        peaks = envelope.peaks(self._points)
        return _Work(
            peaks=peaks,
            monitor=self,
            runs=[
                self._run(zone, run, envelope.plies, peaks)
                for zone in self.zones
                for run in zone.runs
            ],
            interfaces=[
                self._interfaces(zone, envelope.interfaces)
                for zone in self.zones
                if zone.interfaces
            ],
        )

    def _run(self, zone: ZoneCriteria, run: Run, plies: Maxima, peaks: Floats) -> Failure:
        """The structure of plies of the same strengths."""
        table = filled(zone.in_plane[:, :, run.states])
        keep = _share_kept(run.strengths)
        rows = None if isinstance(zone.points, slice) else zone.points
        states = run.states.stop - run.states.start
        outermost = _Outermost.of_run(zone, run)
        exposure = plies.exposure.reshape(len(plies.exposure), self._points, -1)
        found = exposure[: len(CRITERIA), zone.points, run.states]
        count = len(outermost.states)
        prunes = keep > 0.0 and 2 * count <= states and count < BITS and not zone.has_residual
        if prunes:  # the exposures may be those of a checkpoint
            least, of = PROPORTION * outermost.share, outermost.states[outermost.of]
            prunes = all((own >= least * own[:, of]).all() for own in found)
        outer = outermost.states if prunes else outermost.states[:0]
        reached = filled(found[:, :, outer].swapaxes(0, 1))
        return Failure(
            points=found.shape[1],
            states=states,
            width=table.shape[2],
            rows=self._points,
            stride=exposure.shape[2],
            first=run.states.start,
            row=rows,
            in_plane=table,
            residual=filled(zone.residual[:, run.states]),
            ply=_ply(run.strengths),
            keep=keep,
            proportional=int(prunes),
            outermost=len(outer),
            outer_width=reached.shape[2],
            outer=np.ascontiguousarray(outer, dtype=np.int64),
            stands=outermost.stands(),
            outer_stress=filled(zone.in_plane[3:, :, run.states][:, :, outer]),
            reached=reached,
            exposure=plies.exposure,
            time=plies.time,
            mode=plies.mode,
            peak=peaks,
        )

    def _interfaces(self, zone: ZoneCriteria, interfaces: Maxima) -> Interfaces:
        """The structure of the interfaces of a zone."""
        rows = None if isinstance(zone.elements, slice) else zone.elements
        shear = zone.shear / zone.weaker[:, None]  # (12, interfaces, plies, tau)
        table = filled(shear.transpose(0, 2, 3, 1).reshape(12, 4, -1))
        count, stride = interfaces.exposure.shape
        return Interfaces(
            elements=count if rows is None else len(rows),
            interfaces=zone.interfaces,
            width=table.shape[2],
            stride=stride,
            row=rows,
            shear=table,
            code=MODES.index("interlaminar shear"),
            exposure=interfaces.exposure,
            time=interfaces.time,
            mode=interfaces.mode,
        )
