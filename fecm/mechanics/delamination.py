"""Delamination threshold of an impacted laminate."""

from __future__ import annotations

import math

import numpy as np

from fecm.mechanics.laminate import Laminate

# Threshold of a small-mass impact over the static one (Olsson, Donadon and Falzon 2006).
SMALL_MASS = 1.213


def effective_rigidity(laminate: Laminate) -> float:
    """Bending stiffness D* of the isotropic plate of equal threshold (force*length).

    sqrt(D11 D22 (eta + 1)/2) with eta = (D12 + 2 D66)/sqrt(D11 D22), Olsson 1992; an unsymmetric
    laminate has D - B A^-1 B for D.
    """
    D = laminate.D
    if laminate.is_coupled:
        D = D - laminate.B @ np.linalg.solve(laminate.A, laminate.B)
    mean = math.sqrt(D[0, 0] * D[1, 1])
    return mean * math.sqrt(((D[0, 1] + 2.0 * D[2, 2]) / mean + 1.0) / 2.0)


def threshold_force(rigidity: float, toughness: float, delaminations: int = 1) -> float:
    """Force at which n circular delaminations grow, pi sqrt(32 D* G_IIc/(n + 2)).

    The rigidity D* is force*length, the toughness G_IIc force/length.  One delamination: Davies and
    Robinson 1992; n of them: Suemasu and Majima 1996, Olsson 2001.
    """
    return math.pi * math.sqrt(32.0 * rigidity * toughness / (delaminations + 2.0))
