"""Judge of the impacts on a plate: the error of a linear plate, and reasons to doubt a case.

Functions of cases take many at once: arrays (cases,).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import compress
from typing import NamedTuple

import numpy as np

from fecm._typing import Array, Bools, Floats
from fecm.judge.end import ENDS, Texts
from fecm.judge.limits import (
    FREE_DEFLECTION,
    HELD_DEFLECTION,
    LIMITS,
    Doubt,
    ModelLimit,
    Scale,
    TrustLevel,
)

# The errors hold for plates without preload.
PRELOADED = "compressive preload increases this error, tensile preload reduces it"
UNSAFE = "threshold energies are therefore too high (unsafe)"
CURVED = (
    "these figures are for a flat plate: a curved panel that is struck on its convex side softens "
    "and may snap through"
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
# Limit of the deflection over the thickness up to which the plate is taken as linear.
DEFLECTION = {
    InPlane.HELD: HELD_DEFLECTION,
    InPlane.FREE: FREE_DEFLECTION,
    InPlane.WINDOW: HELD_DEFLECTION,
    InPlane.UNKNOWN: HELD_DEFLECTION,
}
BENT = tuple({limit.doubt for limit in DEFLECTION.values()})  # of cases beyond one of them
# Least and largest error of the peak force, in percent, at deflections of the linear plate over the
# thickness.  They come from nonlinear impacts of the same energy on isotropic, quasi-isotropic
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


def in_plane_of(
    codes: Array, coordinates: Array | None = None, cut: Bools | None = None
) -> InPlane:
    """Return the support of the edges in the plane, from the restraint codes of all nodes.

    The codes are (numnp, 5). Nodes at which w is restrained are the supports; a plate without
    supports is free. With the coordinates of the nodes, (numnp, 2), a plate whose supports are all
    inside its outline lies on a window. `cut` are the low and high sides in x and y, (2, 2), that
    are lines of symmetry and no outline.
    """
    held = codes != 0
    supports = held[held[:, 2]]
    if not len(supports):
        return InPlane.FREE
    all_held = bool(held[:, :2].all())
    slides = all_held or not supports[:, :2].any(axis=1).mean() > 0.5
    if coordinates is not None and slides:
        places = coordinates[held[:, 2]]
        low, high = coordinates.min(axis=0), coordinates.max(axis=0)
        is_cut = np.zeros((2, 2), dtype=bool) if cut is None else cut
        inside = np.array([places.min(axis=0) > low, places.max(axis=0) < high]) | is_cut
        if inside.all() and (np.ptp(places, axis=0) > 0.0).all():
            return InPlane.WINDOW
    if all_held:
        return InPlane.UNKNOWN
    return InPlane.HELD if supports[:, :2].any(axis=1).mean() > 0.5 else InPlane.FREE


def unsafe(*, curved: bool) -> str:
    """Explain how a too-soft plate affects thresholds. A curved panel may not be too soft."""
    return f"{UNSAFE}; {CURVED}" if curved else UNSAFE


def softness(ratio: float, in_plane: InPlane, *, preloaded: bool = False) -> str:
    """Format the error of a linear plate at a deflection over its thickness.

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


# Validity of a case without a reason to doubt it, and of one that was not computed.
VALID = "ok"
FAILED = "failed"
SEPARATOR = "; "  # between the reasons of a case
OTHER = Doubt("other", "doubtful for other reasons", TrustLevel.DOUBTFUL)  # of other versions
# All doubts by their reasons, in the order of a summary.
DOUBTS = {
    doubt.reason: doubt
    for doubt in (
        *(meaning.doubt for meaning in ENDS.values() if meaning.doubt is not None),
        *(limit.doubt for limit in LIMITS),
        OTHER,
    )
}


def joined(reasons: Sequence[str]) -> str:
    """Return the validity of a case with some reasons."""
    return SEPARATOR.join(reasons) or VALID


def reasons_of(validity: str) -> list[str]:
    """Return the reasons in the validity of a case; empty for a valid or a failed case."""
    return [] if validity in ("", VALID, FAILED) else validity.split(SEPARATOR)


def counted(validity: Texts) -> Iterator[tuple[Doubt, Bools]]:
    """Yield the doubts about cases, with a mask of the cases, in the order of :data:`DOUBTS`.

    Reasons of other versions, whose number is not bounded, are counted together.
    """
    texts = validity.tolist()
    cases_of = {
        text: {DOUBTS.get(reason, OTHER) for reason in reasons_of(text)} for text in set(texts)
    }
    for doubt in DOUBTS.values():
        if any(doubt in doubts for doubts in cases_of.values()):
            yield doubt, np.array([doubt in cases_of[text] for text in texts], dtype=bool)


@dataclass(frozen=True)
class Extent:
    """Largest values of cases, lower bounds where the end is undecided.

    Attributes
    ----------
    end : ndarray (cases,)
        States of the contact at their ends.
    largest : mapping of ModelLimit to ndarray (cases,) or float
        Values by the limits of the quantities; NaN where they are not known.
    of_rows : collection of str
        Reasons that the stored rows of a run gave, for the limits that are not in `largest`.
    threshold : ndarray (cases,) or float
        Delamination threshold, force.
    """

    end: Texts
    largest: Mapping[ModelLimit, Floats | float]
    threshold: Floats | float = np.nan
    of_rows: Collection[str] = ()


class Judge(NamedTuple):
    """Judge of the impacts on a plate."""

    thickness: float
    in_plane: InPlane = InPlane.UNKNOWN
    # Velocity that an impulse under the load gives the rigid motion of the plate, 1/mass; 0 if its
    # supports hold the plate.
    mobility: float = 0.0
    plate_mass: float = np.nan
    preloaded: bool = False  # whether an initial membrane force acts
    curved: bool = False  # whether the plate at rest is curved
    nonlinear: bool = False  # whether stretching follows from bending
    struck: float | None = None  # thickness of the struck face of a sandwich, if there is one

    @property
    def indented(self) -> float:
        """Thickness that the indentation is compared with: the struck face or the plate.

        A core under the first ply leaves no face to compare with.
        """
        return self.struck or self.thickness

    def softness(self, ratio: float) -> str:
        """Format the error of the linear plate at a deflection over its thickness."""
        return softness(ratio, self.in_plane, preloaded=self.preloaded)

    @property
    def deflection(self) -> ModelLimit:
        """Limit of the deflection of a linear plate over its thickness."""
        return DEFLECTION[self.in_plane]

    def largest(self, limit: ModelLimit, threshold: Floats | float = np.nan) -> Floats | float:
        """Return the largest value within a limit, in the deck's units.

        A plate that is not taken as linear has no limit of its deflection. `threshold` is the
        delamination threshold, force.
        """
        scales = {
            Scale.ONE: 1.0,
            Scale.LINEAR_PLATE: math.inf if self.nonlinear else self.thickness,
            Scale.INDENTED_PLATE: self.indented,
            Scale.THRESHOLD: threshold,
        }
        return limit.value * scales[limit.scale]

    def validity(self, extent: Extent) -> Texts:
        """Return ``"ok"``, or the reasons to doubt each case."""
        masks: dict[str, Bools] = {}
        for end, meaning in ENDS.items():
            if meaning.doubt is not None:
                reason = meaning.doubt.reason
                masks[reason] = masks.get(reason, np.zeros(len(extent.end), bool)) | (
                    extent.end == end
                )
        for limit in LIMITS:
            if limit in extent.largest:
                most = self.largest(limit, extent.threshold)
                with np.errstate(invalid="ignore"):
                    beyond = np.asarray(extent.largest[limit] > most)
            else:
                beyond = np.asarray(limit.reason in extent.of_rows)
            masks[limit.reason] = np.broadcast_to(beyond, extent.end.shape)
        names = list(masks)
        rows = np.column_stack(list(masks.values()))
        kinds, which = np.unique(rows, axis=0, return_inverse=True)
        texts = [joined(list(compress(names, kind))) for kind in kinds.tolist()]
        return np.array(texts, dtype=np.str_)[which.reshape(-1)]


def of_face(judge: Judge) -> str:
    """Say which thickness the limit of the indentation has, where it is not the plate's."""
    return ", where h is the struck face's thickness" if judge.struck else ""
