"""Measured strains as observations of functions that are known at equally spaced samples."""

from __future__ import annotations

import numpy as np

from fecm._dataclasses import frozen
from fecm._typing import Floats, Indices

BLOCK = 128  # rows that are reduced together: small enough for BLAS to use one thread
ON_SAMPLE = 1e-3  # distance of a time from a sample, over their interval, that is rounding
MANY = 1.5  # observations per sample from which on they are reduced
# Samples around a time in cubic interpolation.
STENCIL = np.array([-1, 0, 1, 2])


@frozen
class Observation:
    """Measured strains and the functions' values that they observe.

    Many points are replaced by as many rows as there are samples, by an orthogonal transformation:
    the sum of the squares of a residual is that of the rows plus `left`.
    """

    values: Floats  # (gages, rows)
    left: Floats  # (gages,): squares that no function can describe
    points: int  # measured times
    step: float  # usual time between two of them
    interval: float  # between two samples
    # Samples of the rows, (rows,), or values of the rows per sample, (rows, samples).
    rows: Indices | Floats

    @property
    def count(self) -> int:
        """Number of measured strains."""
        return len(self.values) * self.points

    def of(self, samples: Floats) -> Floats:
        """Rows of functions with samples, (..., samples): (..., rows)."""
        return samples[..., self.rows] if self.rows.ndim == 1 else samples @ self.rows.T


def observe(time: Floats, strains: Floats, interval: float, count: int) -> Observation:
    """Observe functions with `count` samples from time 0 on by strains, (gages, points)."""
    places, step = time / interval, float(np.median(np.diff(time)))
    near = np.round(places)
    if (np.abs(places - near) < ON_SAMPLE).all() and near[0] >= 0.0:
        rows: Indices | Floats = near.astype(np.intp)
        return Observation(strains, np.zeros(len(strains)), len(time), step, interval, rows)
    matrix = interpolation(places, count)
    left = np.zeros(len(strains))
    if len(time) > MANY * count:
        factor = triangular(np.column_stack([matrix, strains.T]))
        matrix, values = factor[:count, :count], factor[:count, count:].T
        left = (factor[count:, count:] ** 2).sum(axis=0)
        return Observation(values, left, len(time), step, interval, matrix)
    return Observation(strains, left, len(time), step, interval, matrix)


def interpolation(places: Floats, count: int) -> Floats:
    """Cubic interpolation between samples at places, counted in samples, (places, samples).

    The functions are 0 before their first sample.
    """
    before = np.floor(places)
    part = places - before
    weights = np.stack(
        [
            -part * (part - 1.0) * (part - 2.0) / 6.0,
            (part + 1.0) * (part - 1.0) * (part - 2.0) / 2.0,
            -(part + 1.0) * part * (part - 2.0) / 2.0,
            (part + 1.0) * part * (part - 1.0) / 6.0,
        ]
    )
    matrix = np.zeros((len(places), count))
    for offset, weight in zip(STENCIL, weights, strict=True):
        at = before.astype(np.intp) + offset
        inside = np.flatnonzero((at >= 0) & (at < count))
        matrix[inside, at[inside]] += weight[inside]
    return matrix


def triangular(matrix: Floats) -> Floats:
    """Triangular factor of a matrix with the same inner products of columns."""
    factor = np.zeros((0, matrix.shape[1]))
    step = max(BLOCK, matrix.shape[1])
    for start in range(0, len(matrix), step):
        part = np.vstack([factor, matrix[start : start + step]])
        factor = np.asarray(np.linalg.qr(part, mode="r"))
    return factor
