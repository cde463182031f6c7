"""Cylindrical bending of a strip that stretches, in closed form but for one scalar root.

A strip along x of unit width, x = 0 in its middle and both ends x = l held in the plane: the
membrane force N is uniform.  With the bending stiffness D* = D - B^2/A at a given N

    M = (B/A) N + D* (-w'' + M''/S),   M = M0 - N w - q x^2/2,   eps = u' + w'^2/2 = (N - B kappa)/A

give D* (1 + N/S) w'' - N w = (B/A) N - M0 + q x^2/2 - D* q/S, which hyperbolic functions solve, or
trigonometric ones where N < 0.  N is such that the strip fits between its ends.
"""

from __future__ import annotations

import cmath
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

# Points and weights of an integral from 0 to 1.
AT, WEIGHTS = np.polynomial.legendre.leggauss(40)
AT, WEIGHTS = (1.0 + AT) / 2.0, WEIGHTS / 2.0


def stiffnesses(
    modulus: Sequence[float], shear: Sequence[float], layer: float
) -> tuple[float, float, float, float]:
    """A, B, D and S of layers of equal thickness, the first at the least z, by their moduli."""
    z = layer * (np.arange(len(modulus) + 1) - len(modulus) / 2.0)
    A, B, D = (float(np.diff(z**n) @ modulus) / n for n in (1, 2, 3))
    return A, B, D, layer * sum(shear)


def deflection(
    stiffness: Sequence[float], half: float, q: float, forces: tuple[float, float], *, clamped: bool
) -> float:
    """Deflection in the middle of a strip of length 2 half under the pressure q.

    `forces` are membrane forces between which there is one equilibrium.
    """
    A, B, D, S = stiffness
    reduced, x = D - B * B / A, half * AT

    def state(N: float) -> tuple[float, float]:
        """How much too long the strip is, and w in the middle."""
        D_N = reduced * (1.0 + N / S)
        root = cmath.sqrt(N / D_N)
        # w = C cosh(root x) + c x^2 + a with w(l) = 0, and M(l) = 0 or theta(l) = 0.
        c = -q / (2.0 * N)

        def field(M0: float) -> tuple[float, complex]:
            a = (2.0 * D_N * c - B / A * N + M0 + reduced * q / S) / N
            return a, -(a + c * half**2) / cmath.cosh(root * half)

        def rotation(M0: float) -> float:
            # theta = w' - M'/S, and M' = -N w' - q x.
            slope = (field(M0)[1] * root * cmath.sinh(root * half)).real + 2.0 * c * half
            return slope * (1.0 + N / S) + q * half / S

        M0 = q * half**2 / 2.0
        if clamped:  # the rotation is linear in M0
            at_0, at_1 = rotation(0.0), rotation(1.0)
            M0 = -at_0 / (at_1 - at_0)
        a, C = field(M0)
        w = (C * np.cosh(root * x)).real + c * x**2 + a
        slope = (C * root * np.sinh(root * x)).real + 2.0 * c * x
        moment = M0 - N * w - q * x**2 / 2.0
        stretch = (N - B * (moment - B / A * N) / reduced) / A
        return half * float(WEIGHTS @ (stretch - slope**2 / 2.0)), C.real + a

    N = brentq(lambda N: state(N)[0], *forces, xtol=1e-14, rtol=1e-14)
    return state(N)[1]


def strips() -> tuple[float, float, float]:
    """Deflections of [0_4/90_4], 8 layers of 0.25 mm and 100 mm between the ends."""
    e1, e2, nu, g13, g23 = 141e3, 9700.0, 0.3, 5500.0, 3700.0
    full = 1.0 - nu**2 * e2 / e1
    layers = stiffnesses(
        4 * (e1 / full,) + 4 * (e2 / full,),
        4 * (5.0 / 6.0 * g13,) + 4 * (5.0 / 6.0 * g23,),
        0.25,
    )
    return (
        deflection(layers, 50.0, 0.01, (-9.5, -8.5), clamped=False),
        deflection(layers, 50.0, -0.01, (5.0, 20.0), clamped=False),
        deflection(layers, 50.0, 0.03, (1.0, 20.0), clamped=True),
    )
