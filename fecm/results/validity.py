"""The judge of results: what the end of a run has decided, and where the model ends to hold.

Runs, cases of sweeps, searches, estimates and pictures all ask this module.  Its functions take
many cases at once: arrays (cases,).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import StrEnum
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from fecm._frozen import frozen
from fecm._typing import Array, Bools, Floats

Texts = NDArray[np.str_]

# The peak of a contact has passed if the force is below this share of it, and the projectile
# leaves with more than this share of its impact velocity.  The force of a drop weight rings: it
# falls and rises again many times before the projectile turns.
FALLEN, LEAVING = 0.9, 0.1
STRAIN = 0.01  # largest strain for which plies are taken as linear
# Exposure, or force relative to the delamination threshold, from which on a case is beyond it.  A
# search for the velocity that reaches 1 ends a hair above.
CROSSED = 1.0001
INDENTATION = 0.25  # of the thickness, up to which the contact law of a half-space holds


class End(StrEnum):
    """State of the contact at the end of a run."""

    OVER = "contact over"
    PASSED = "in contact, peak passed"
    RISING = "in contact, peak not reached"
    BETWEEN = "between contacts"  # no contact, but the projectile still approaches the plate


def ends(last: Floats, peak: Floats, leaving: Floats, velocity: Floats) -> Texts:
    """State of every case at its end, of :class:`End`.

    Parameters
    ----------
    last, peak : ndarray (cases,)
        Last and largest contact force.
    leaving : ndarray (cases,)
        Velocity of the projectile away from the plate at the end, relative to the rigid motion of
        a plate that is not held; NaN if it is not known.
    velocity : ndarray (cases,)
        Impact velocity.

    Examples
    --------
    >>> ends(np.array([0.0, 5.0]), np.array([9.0, 9.0]), np.array([1.0, 1.0]), np.ones(2)).tolist()
    ['contact over', 'in contact, peak passed']
    """
    touching = last > 0.0
    passed = (last < FALLEN * peak) & (leaving > LEAVING * velocity)
    states = [touching & passed, touching, leaving < 0.0]
    return np.select(states, [End.PASSED, End.RISING, End.BETWEEN], End.OVER).astype(np.str_)


def over(end: Texts) -> Bools:
    """Cases whose contact is over, so that all their values are decided."""
    return np.asarray(end == End.OVER)


def peak_known(end: Texts) -> Bools:
    """Cases whose largest force so far is the peak force."""
    return np.isin(end, (End.OVER, End.PASSED))


def decided(largest: Floats, last: Floats, end: Texts) -> Floats:
    """Largest values of a quantity, NaN where the end has not decided them.

    While the projectile leaves, the largest value is the peak of a quantity that has fallen.
    """
    fallen = peak_known(end) & (last < largest)
    return np.where(over(end) | fallen, largest, np.nan)


class InPlane(StrEnum):
    """Support of the plate's edges in its plane."""

    HELD = "held"
    FREE = "free"
    UNKNOWN = "unknown"  # u and v are restrained at every node, as B = 0 allows for any support


# Deflection over the thickness up to which the plate is taken as linear.
LIMITS = {InPlane.HELD: 0.3, InPlane.FREE: 0.5, InPlane.UNKNOWN: 0.3}
# Least and largest error of the peak force, in percent, at deflections of the linear plate over the
# thickness.  They are those of nonlinear impacts of the same energy on isotropic, quasi-isotropic
# and cross-ply plates, clamped and simply supported.
DEFLECTIONS = (0.0, 0.25, 0.5, 1.0, 1.5, 2.5, 5.0)
ERRORS = {
    InPlane.FREE: ((0, 1, 2, 8, 14, 24, 41), (0, 1, 4, 11, 17, 30, 46)),
    InPlane.HELD: ((0, 2, 6, 15, 23, 38, 57), (0, 7, 19, 33, 43, 52, 66)),
}
ERRORS[InPlane.UNKNOWN] = ERRORS[InPlane.FREE][0], ERRORS[InPlane.HELD][1]


def in_plane_of(codes: Array) -> InPlane:
    """Support of the edges in the plane, from the restraint codes of all nodes, (numnp, 5).

    Nodes at which w is restrained are the supports; a plate without any is free.
    """
    held = codes != 0
    supports = held[held[:, 2]]
    if not len(supports):
        return InPlane.FREE
    if held[:, :2].all():
        return InPlane.UNKNOWN
    return InPlane.HELD if supports[:, :2].any(axis=1).mean() > 0.5 else InPlane.FREE


VALID, FAILED = "ok", "failed"
OPEN = "peak not reached"
SOFT = "indentation > h/4"
BROKEN = "exposure > 1"
STRAINED = "strain > 1 %"
DELAMINATED = "peak force > threshold"
OTHER = "other"
BENT = {in_plane: f"w > {limit} h" for in_plane, limit in LIMITS.items()}
# What the reasons of a case mean, for the lines of a summary.
MEANING = {
    OPEN: "with an open peak",
    **{bent: f"beyond the linear plate ({bent})" for bent in BENT.values()},
    STRAINED: f"beyond linear plies ({STRAINED})",
    SOFT: f"beyond the contact law ({SOFT})",
    BROKEN: f"elastic beyond the first failure ({BROKEN})",
    DELAMINATED: f"elastic beyond delamination ({DELAMINATED})",
    OTHER: "doubtful for other reasons",
}
SEPARATOR = "; "


def reasons_of(validity: str) -> list[str]:
    """Reasons in the text of a case; empty for a valid or a failed one."""
    return [] if validity in ("", VALID, FAILED) else validity.split(SEPARATOR)


@frozen
class Extent:
    """What cases have reached: (cases,) each, lower bounds where the end has not decided them."""

    end: Texts
    peak: Floats
    indentation: Floats
    deflection: Floats  # under the load; NaN of a plate that its supports let move
    exposure: Floats | float = np.nan
    threshold: float = np.nan


@frozen
class Judge:
    """Judge of the impacts on a plate."""

    thickness: float
    in_plane: InPlane = InPlane.UNKNOWN
    # Velocity that an impulse under the load gives the rigid motion of the plate, 1/mass; 0 if its
    # supports hold the plate.
    mobility: float = 0.0

    @property
    def limit(self) -> float:
        """Deflection up to which the plate is taken as linear, over its thickness."""
        return LIMITS[self.in_plane]

    def validity(self, extent: Extent) -> Texts:
        """``"ok"``, or the reasons to doubt each case, in words."""
        h = self.thickness
        with np.errstate(invalid="ignore"):
            masks = {
                OPEN: ~peak_known(extent.end),
                BENT[self.in_plane]: extent.deflection > self.limit * h,
                SOFT: extent.indentation > INDENTATION * h,
                BROKEN: np.broadcast_to(extent.exposure > CROSSED, extent.peak.shape),
                DELAMINATED: extent.peak > CROSSED * extent.threshold,
            }
        names, rows = list(masks), np.column_stack(list(masks.values()))
        kinds, which = np.unique(rows, axis=0, return_inverse=True)
        texts = [joined(list(compress(names, kind))) for kind in kinds.tolist()]
        return np.array(texts, dtype=np.str_)[which.reshape(-1)]


def softness(ratio: float, in_plane: InPlane) -> str:
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
    if in_plane is InPlane.UNKNOWN:
        size, edges = f"{low} % (edges free in the plane) to {high} % (held)", ""
    else:
        size, edges = f"{low} to {high} %", f" (edges {in_plane} in the plane)"
    return f"the force is {more} {size} too low at the same energy{edges}"


TOO_SOFT = "a linear plate, without membrane stiffening, is too soft"
UNSAFE = "a threshold energy there is too high, which is unsafe"
AFTER = "the end of the contact, the permanent indentation and the energies after it"
# Notes of runs whose end leaves something open.
OPEN_ENDS = {
    End.PASSED: f"the run ends in contact, after the peak force: {AFTER} are open; take more steps",
    End.RISING: "the run ends in contact, before the projectile leaves: its largest force is a "
    f"lower bound of the peak force, and {AFTER} are open; take more steps",
    End.BETWEEN: "the run ends between two contacts, as the projectile still approaches: its "
    f"largest force is a lower bound of the peak force, and {AFTER} are open; take more steps",
}


def joined(reasons: Sequence[str]) -> str:
    """Text of a case with some reasons."""
    return SEPARATOR.join(reasons) or VALID


def counted(validity: Texts) -> Iterator[tuple[str, Bools]]:
    """Reasons among cases, in the order of :data:`MEANING`, with the cases that have them.

    Reasons of other versions, whose number is not bounded, count together.
    """
    own = [
        {name if name in MEANING else OTHER for name in reasons_of(text)}
        for text in validity.tolist()
    ]
    for reason in MEANING:
        some = np.array([reason in names for names in own], dtype=bool)
        if some.any():
            yield reason, some
