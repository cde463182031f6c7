"""Indentation tests that are made from the report's equations, not by the law's own code."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# The report's 0.5 in indenter.
K, ALPHA_P, S_P, Q = 1.330e6, 6.564e-4, 0.094, 2.5
PEAKS = (1.5e-3, 2.5e-3, 3.5e-3, 4e-3)


def stretch(begin: float, end: float, points: int, force: Callable[[Floats], Floats]) -> Floats:
    """Indentations and forces (2, points) after `begin` up to `end`."""
    a = np.linspace(begin, end, points + 1)[1:]
    return np.array([a, force(a)])


def make_test(
    peaks: tuple[float, ...] = PEAKS, q: float = Q, points: int = 100, s_p: float = S_P
) -> tuple[Floats, Floats]:
    """Load to each peak and unload to zero: equations 3-1, 3-3 with 3-8, and 3-11 with 3-12."""

    def loading(a: Floats) -> Floats:
        return np.asarray(K * a**1.5)

    parts = [np.zeros((2, 1))]
    last = left = 0.0
    for peak in peaks:
        if last:
            k_1 = K * (last / (last - left)) ** 1.5

            def back(a: Floats, k_1: float = k_1, left: float = left) -> Floats:
                return np.asarray(k_1 * np.maximum(a - left, 0.0) ** 1.5)

            parts.append(stretch(0.0, last, points, back))
        parts.append(stretch(last, peak, points, loading))
        left, last = max(0.0, s_p * (peak - ALPHA_P)), peak

        def fall(a: Floats, peak: float = peak, left: float = left) -> Floats:
            ratio = np.maximum(a - left, 0.0) / (peak - left)
            return np.asarray(K * peak**1.5 * ratio**q)

        parts.append(stretch(peak, 0.0, points, fall))
    a, f = np.concatenate(parts, axis=1)
    return a, f


def noisy(values: Floats, seed: int, part: float = 0.01) -> Floats:
    """Values with a scatter of a part of the largest one."""
    scatter = np.random.default_rng(seed).standard_normal(len(values))
    return np.asarray(values + part * values.max() * scatter)


def written(path: Path, indentation: Floats, force: Floats) -> Path:
    """A test as a file."""
    lines = [f"{a!r},{f!r}" for a, f in zip(indentation.tolist(), force.tolist(), strict=True)]
    path.write_text("\n".join(["indentation,force", *lines, ""]))
    return path
