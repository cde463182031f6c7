"""Largest exposures of the plies over time.

Exposures are computed of all states, modes only where an exposure rises.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.failure import (
    CRITERIA,
    MODES,
    Codes,
    Strengths,
    exposure_of,
    interlaminar,
    modes_of,
)
from fecm.mechanics.laminate import Laminate
from fecm.mechanics.ply_stresses import PlyStresses, in_plane_stresses, interlaminar_stresses

# Points per matrix product: so few that BLAS uses one thread.
BLOCK = 512


@dataclass
class Maxima:
    """Largest exposure of every state so far, its time and mode."""

    exposure: Floats
    time: Floats
    mode: Codes  # index into :data:`~fecm.mechanics.failure.MODES`


def _none(*shape: int) -> Maxima:
    return Maxima(np.zeros(shape), np.zeros(shape), np.zeros(shape, np.int8))


@dataclass
class FailureEnvelope:
    """Largest exposures over time."""

    # (criteria, states): by :data:`~fecm.mechanics.failure.CRITERIA`, then elements, points, plies
    # and faces.
    plies: Maxima
    interfaces: Maxima  # (elements, plies - 1)


class FailureMonitor:
    """Evaluates the failure criteria of all plies."""

    def __init__(self, stresses: PlyStresses, laminate: Laminate, strengths: Strengths) -> None:
        self.stresses, self._strengths = stresses, strengths
        plies = len(laminate.plies.angles)
        # Stresses (components, plies * 2) and (interfaces, plies beside, tau_13 tau_23).
        self._in_plane = in_plane_stresses(laminate).transpose(3, 2, 0, 1).reshape(6, -1).copy()
        tau = interlaminar_stresses(laminate)[0][:-1, 2].reshape(plies - 1, 2, 12)
        angles = np.deg2rad(laminate.plies.angles)
        c, s = np.cos(angles), np.sin(angles)
        turn = np.array([[c, s], [-s, c]]).transpose(2, 0, 1)
        beside = np.stack([turn[:-1], turn[1:]], axis=1)
        self._shear = np.einsum("ibct,itg->gibc", beside, tau).reshape(12, -1)

    def start(self) -> FailureEnvelope:
        """No exposure yet."""
        elements, points, plies = self.stresses.shape
        states = elements * points * plies * 2
        return FailureEnvelope(_none(len(CRITERIA), states), _none(elements, max(plies - 1, 0)))

    def update(self, envelope: FailureEnvelope, field: Floats, time: float) -> None:
        """Raise the exposures to those of a displacement field, (numnp, 5)."""
        strains, gradients = self.stresses.strains(field)
        self._raise_plies(envelope.plies, strains.reshape(-1, 6), time)
        shear = (gradients.reshape(-1, 12) @ self._shear).reshape(
            len(gradients), self.stresses.shape[2] - 1, 2, 2
        )
        worst = interlaminar(self._strengths, shear[..., 0], shear[..., 1]).max(axis=2)
        # Elements without nine nodes have no interlaminar stresses.
        envelope.interfaces.exposure[np.isnan(worst)] = np.nan
        higher = worst > envelope.interfaces.exposure
        envelope.interfaces.exposure[higher] = worst[higher]
        envelope.interfaces.time[higher] = time
        envelope.interfaces.mode[higher] = MODES.index("interlaminar shear")

    def _raise_plies(self, plies: Maxima, strains: Floats, time: float) -> None:
        """Raise the exposures of all plies to those of strains, (elements * points, 6)."""
        for start in range(0, len(strains), BLOCK):
            stresses = np.split(strains[start : start + BLOCK] @ self._in_plane, 3, axis=1)
            s1, s2, tau = (np.ascontiguousarray(part).ravel() for part in stresses)
            first = start * self._in_plane.shape[1] // 3
            for number, criterion in enumerate(CRITERIA.values()):
                candidates = criterion(self._strengths, s1, s2, tau)
                exposure = exposure_of(candidates)
                own = plies.exposure[number, first : first + len(s1)]
                (larger,) = np.nonzero(exposure > own)
                own[larger] = exposure[larger]
                plies.mode[number, first + larger] = modes_of(candidates, larger)
                plies.time[number, first + larger] = time
