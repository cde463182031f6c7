"""Natural frequencies and modes: K x = omega^2 M x."""

from __future__ import annotations

import numpy as np

from fecm._frozen import frozen
from fecm._typing import Floats
from fecm.mechanics.plate import PlateModel

# Fewer equations are solved as a dense problem.
DENSE = 60
# Shift of the spectrum relative to the largest eigenvalue, about half the digits of a double, which
# makes the matrix of a plate without supports regular.
SHIFT = 1.0e-9


@frozen
class Modes:
    """The lowest modes of a plate."""

    angular_frequency: Floats  # (n,): ascending; rigid motions are 0 (1/time)
    shapes: Floats  # (n, neq): unit modal mass; the largest entry is positive


def modes(plate: PlateModel, count: int, *, consistent: bool) -> Modes:
    """Compute the lowest modes, at most as many as equations, with the chosen mass matrix."""
    from scipy import linalg, sparse  # slow to import
    from scipy.sparse.linalg import eigsh

    K = plate.stiffness
    M = plate.consistent_mass if consistent else sparse.diags_array(plate.mass, format="csr")
    count = min(count, plate.neq)
    if plate.neq < DENSE or count >= plate.neq // 2:
        values, vectors = linalg.eigh(K.toarray(), M.toarray(), subset_by_index=[0, count - 1])
    else:
        shift = -SHIFT * float((K.diagonal() / M.diagonal()).max())
        start = np.random.default_rng(0).standard_normal(plate.neq)
        values, vectors = eigsh(K, count, M, sigma=shift, which="LM", v0=start)
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
    largest = vectors[np.abs(vectors).argmax(axis=0), np.arange(count)]
    return Modes(np.sqrt(np.maximum(values, 0.0)), (vectors * np.sign(largest)).T)
