"""Largest exposures of the plies by the compiled kernels."""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.failure import puck_limits
from fecm.mechanics.kernels import LIBRARY, Codes, Failure, floats
from fecm.mechanics.ply_stresses import FailureMonitor, Maxima


class CompiledMonitor(FailureMonitor):
    """The same exposures."""

    @cached_property
    def _table(self) -> Floats:
        """Stresses per strain, (6, 3, states); states are filled up to fours."""
        stresses = self._in_plane.reshape(6, 3, -1)
        return np.pad(stresses, ((0, 0), (0, 0), (0, -stresses.shape[2] % 4)))

    def _raise_plies(self, plies: Maxima, strains: Floats, time: float) -> None:
        p, table = self._strengths, self._table
        ply = p.xt, p.xc, p.yt, p.yc, p.s12, p.f12, p.p_plus, p.p_minus, *puck_limits(p)
        structure = Failure(
            len(strains), self._in_plane.shape[1] // 3, table.shape[2], floats(table), *ply,
            floats(plies.exposure), floats(plies.time), plies.mode.ctypes.data_as(Codes),
        )  # fmt: skip
        LIBRARY.fecm_failure(ctypes.byref(structure), floats(strains), ctypes.c_double(time))
