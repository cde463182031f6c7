"""Range of the linear plate: the deflection up to which it holds, and its error beyond."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from fecm._typing import Array

TOO_SOFT = "a linear plate, without membrane stiffening, is too soft"
# The errors are those of plates without preload.
PRELOADED = "that is without PREL, whose compression makes it more and whose tension less"
REMEDY = "NONL includes the stiffening (fecm new --nonlinear)"
UNSAFE = "threshold energies are therefore too high (unsafe)"
CURVED = (
    "all this is of a flat plate: a curved panel that is struck on its convex side softens and may "
    "snap through"
)


class InPlane(StrEnum):
    """Support of the plate's edges in its plane."""

    HELD = "held"
    FREE = "free"
    WINDOW = "window"  # on supports inside the plate, on which it slides
    UNKNOWN = "unknown"  # u and v are restrained at every node, as B = 0 allows for any support


IN_PLANE_WORDS = {
    InPlane.HELD: "edges held in the plane",
    InPlane.FREE: "edges free in the plane",
    InPlane.WINDOW: "on a window on which the plate slides",
}
# Deflection over the thickness up to which the plate is taken as linear.
LIMITS = {
    InPlane.HELD: 0.3,
    InPlane.FREE: 0.5,
    InPlane.WINDOW: 0.3,
    InPlane.UNKNOWN: 0.3,
}
# Least and largest error of the peak force, in percent, at deflections of the linear plate over the
# thickness.  They are those of nonlinear impacts of the same energy on isotropic, quasi-isotropic
# and cross-ply plates, clamped and simply supported.
DEFLECTIONS = (0.0, 0.25, 0.5, 1.0, 1.5, 2.5, 5.0)
FREE_LEAST = (0, 1, 2, 8, 14, 24, 41)
FREE_MOST = (0, 1, 4, 11, 17, 30, 46)
HELD_LEAST = (0, 2, 6, 15, 23, 38, 57)
HELD_MOST = (0, 7, 19, 33, 43, 52, 66)
# The error on the window of D7136, whose rim outside the supports stiffens the plate: linear
# against nonlinear impacts of 2.1 and 4.4 mm [45/0/-45/90]ns IM7/8552 of the same energy.
WINDOW = (0, 1, 3, 10, 18, 31, 49)
ERRORS = {
    InPlane.FREE: (FREE_LEAST, FREE_MOST),
    InPlane.HELD: (HELD_LEAST, HELD_MOST),
    InPlane.UNKNOWN: (FREE_LEAST, HELD_MOST),
    InPlane.WINDOW: (WINDOW, WINDOW),
}


def in_plane_of(codes: Array, coordinates: Array | None = None) -> InPlane:
    """Support of the edges in the plane, from the restraint codes of all nodes, (numnp, 5).

    Nodes at which w is restrained are the supports; a plate without any is free.  With the
    coordinates of the nodes, (numnp, 2), a plate whose supports are all inside its outline lies on
    a window.
    """
    held = codes != 0
    supports = held[held[:, 2]]
    if not len(supports):
        return InPlane.FREE
    all_held = bool(held[:, :2].all())
    slides = all_held or not supports[:, :2].any(axis=1).mean() > 0.5
    if coordinates is not None and slides:
        at = coordinates[held[:, 2]]
        low, high = coordinates.min(axis=0), coordinates.max(axis=0)
        inside = (at.min(axis=0) > low).all() and (at.max(axis=0) < high).all()
        if inside and (np.ptp(at, axis=0) > 0.0).all():
            return InPlane.WINDOW
    if all_held:
        return InPlane.UNKNOWN
    return InPlane.HELD if supports[:, :2].any(axis=1).mean() > 0.5 else InPlane.FREE


def unsafe(*, curved: bool) -> str:
    """What a plate that is too soft means for thresholds; of a curved panel, that it may not be."""
    return f"{UNSAFE}; {CURVED}" if curved else UNSAFE


def softness(ratio: float, in_plane: InPlane, *, preloaded: bool = False) -> str:
    """Error of a linear plate at a deflection over its thickness, in words.

    Examples
    --------
    >>> softness(0.5, InPlane.HELD)
    'the force is about 6 to 19 % too low at the same energy (edges held in the plane)'
    >>> softness(0.5, InPlane.UNKNOWN)
    'the force is about 2 % (edges free in the plane) to 19 % (held) too low at the same energy'
    """
    low, high = (round(np.interp(ratio, DEFLECTIONS, error)) for error in ERRORS[in_plane])
    more = "at least" if ratio > DEFLECTIONS[-1] else "about"
    if in_plane is InPlane.WINDOW:
        size = f"{low} %"
    elif in_plane is InPlane.UNKNOWN:
        size = f"{low} % (edges free in the plane) to {high} % (held)"
    else:
        size = f"{low} to {high} %"
    edges = f" ({IN_PLANE_WORDS[in_plane]})" if in_plane in IN_PLANE_WORDS else ""
    preload = f"; {PRELOADED}" if preloaded else ""
    return f"the force is {more} {size} too low at the same energy{edges}{preload}"
