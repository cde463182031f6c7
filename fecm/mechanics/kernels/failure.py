"""Largest exposures of the plies by the compiled kernels.

In: midplane strains and curvatures of points, (points, 6), at a time.  Out: the exposures of all
states of stress (plies, faces) at the points, raised in place with their times and modes, as
:class:`~fecm.mechanics.ply_stresses.FailureMonitor` has them.
"""

from __future__ import annotations

import ctypes
from ctypes import c_double, c_int64
from functools import cached_property

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.failure import puck_limits
from fecm.mechanics.kernels import LIBRARY, Codes, Doubles, Structure, floats
from fecm.mechanics.ply_stresses import FailureMonitor, Maxima


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
    """Largest exposures of `states` states of stress at `points` points.

    The arrays:

    ===========  =============================  ============================================
    `in_plane`   (6, 3, width)                  stresses per midplane strain and curvature
    `residual`   (3, width)                     stresses without strain
    `exposure`   (criteria, points, states)     largest exposure so far
    `time`       (criteria, points, states)     when it was reached
    `mode`       (criteria, points, states)     its mode of failure
    ===========  =============================  ============================================
    """

    _fields_ = (
        ("points", c_int64),
        ("states", c_int64),
        ("width", c_int64),  # number of states, filled up to fours
        ("in_plane", Doubles),
        ("residual", Doubles),
        ("ply", Ply),
        ("exposure", Doubles),
        ("time", Doubles),
        ("mode", Codes),
    )


class CompiledMonitor(FailureMonitor):
    """The same exposures."""

    @cached_property
    def _table(self) -> Floats:
        """Stresses per strain, (6, 3, states); states are filled up to fours."""
        stresses = self._in_plane.reshape(6, 3, -1)
        return np.pad(stresses, ((0, 0), (0, 0), (0, -stresses.shape[2] % 4)))

    def _add(self, residual: Floats) -> None:
        super()._add(residual)
        # States are filled up to fours.
        self._without_strain = np.pad(self._residual, ((0, 0), (0, -self._residual.shape[1] % 4)))

    @cached_property
    def _ply(self) -> Ply:
        p = self._strengths
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

    def _raise_plies(self, plies: Maxima, strains: Floats, time: float) -> None:
        structure = Failure(
            points=len(strains),
            states=self._in_plane.shape[1] // 3,
            width=self._table.shape[2],
            in_plane=self._table,
            residual=self._without_strain,
            ply=self._ply,
            exposure=plies.exposure,
            time=plies.time,
            mode=plies.mode,
        )
        LIBRARY.fecm_failure(ctypes.byref(structure), floats(strains), time)
