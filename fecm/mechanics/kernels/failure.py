"""Largest exposures of the plies by the compiled kernels.

In: midplane strains and curvatures of points, (points, 6), at a time.  Out: the exposures of all
states of stress (plies, faces) at the points, raised in place with their times and modes, as
:class:`~fecm.mechanics.ply_stresses.FailureMonitor` has them.
"""

from __future__ import annotations

import ctypes
from ctypes import c_double, c_int64

from fecm._typing import Floats
from fecm.mechanics.failure import CRITERIA, Strengths, puck_limits
from fecm.mechanics.kernels import LIBRARY, Codes, Doubles, Longs, Structure, floats
from fecm.mechanics.ply_stresses import FailureMonitor, Maxima, Run, ZoneCriteria


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

    `rows`, `stride` and `first` place them in the arrays of all points.

    The arrays:

    ===========  =============================  ============================================
    `row`        (points,)                      rows of the points; not set if these are all
    `in_plane`   (6, 3, width)                  stresses per midplane strain and curvature
    `residual`   (3, width)                     stresses without strain
    `exposure`   (criteria, rows, stride)       largest exposure so far
    `time`       (criteria, rows, stride)       when it was reached
    `mode`       (criteria, rows, stride)       its mode of failure
    ===========  =============================  ============================================
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
        ("exposure", Doubles),
        ("time", Doubles),
        ("mode", Codes),
    )


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


class CompiledMonitor(FailureMonitor):
    """The same exposures."""

    def _raise_run(
        self, zone: ZoneCriteria, run: Run, plies: Maxima, strains: Floats, time: float
    ) -> None:
        table, residual = zone.tables[run.states.start]
        rows = None if isinstance(zone.points, slice) else zone.points
        structure = Failure(
            points=len(strains) if rows is None else len(rows),
            states=run.states.stop - run.states.start,
            width=table.shape[2],
            rows=len(strains),
            stride=2 * self.stresses.shape[2],
            first=run.states.start,
            row=rows,
            in_plane=table,
            residual=residual,
            ply=_ply(run.strengths),
            exposure=plies.exposure,
            time=plies.time,
            mode=plies.mode,
        )
        LIBRARY.fecm_failure(ctypes.byref(structure), floats(strains), time)
        # Those of users come after the criteria that the kernel has.
        own = range(len(CRITERIA), len(self.criteria))
        if own:
            self._raise_by(own, zone, run, plies, strains, time)
