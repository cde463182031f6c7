"""Judge of results: limits of the model, and reasons to doubt a case.

Runs, cases of sweeps, searches, estimates and pictures all ask this module. Its functions take many
cases at once: arrays (cases,).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import compress
from typing import NamedTuple

import numpy as np

from fecm._typing import Array, Bools, Floats
from fecm.results.end import End, Texts

TOO_SOFT = "a linear plate, without membrane stiffening, is too soft"
# The errors hold for plates without preload.
PRELOADED = "compressive preload increases this error, tensile preload reduces it"
REMEDY = "NONL includes the stiffening (fecm new --nonlinear)"
# Start of a threshold of one delamination: more delaminations, and bending cracks, come before.
AT_THE_LATEST = "at the latest from"
UNSAFE = "threshold energies are therefore too high (unsafe)"
CURVED = (
    "these figures are for a flat plate: a curved panel that is struck on its convex side softens "
    "and may snap through"
)


def from_threshold(delaminations: object) -> str:
    """Return the words before the threshold force, or energy, of a number of delaminations.

    The number comes from a file and may be damaged.
    """
    return AT_THE_LATEST if np.array_equal(np.asarray(delaminations), 1) else "from"


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


STRAIN = 0.01  # largest strain for which plies are taken as linear
# Exposure, or force over the delamination threshold, above which a case is beyond it.  A
# search for the velocity that reaches 1 ends a hair above.
CROSSED = 1.0001
SLOPE = 0.25  # largest slope of a nonlinear plate for which its rotations are moderate
INDENTATION = 0.25  # largest share of the thickness for which the law of a half-space holds

# Validity of a case without a reason to doubt it, and of one that was not computed.
VALID = "ok"
FAILED = "failed"
SEPARATOR = "; "  # between the reasons of a case


class Reason(StrEnum):
    """Reason to doubt a case."""

    OPEN = "peak not reached"
    AGAIN = "may touch again"
    BENT_HELD = f"w > {LIMITS[InPlane.HELD]} h"
    BENT_FREE = f"w > {LIMITS[InPlane.FREE]} h"
    STEEP = f"slope > {SLOPE}"
    STRAINED = "strain > 1 %"
    SOFT = "indentation > h/4"
    BROKEN = "exposure > 1"
    DELAMINATED = "peak force > threshold"
    OTHER = "other"  # in files of other versions


# Reasons by the supports of the edges; unknown supports have the limit of held edges.
BENT = {
    InPlane.HELD: Reason.BENT_HELD,
    InPlane.FREE: Reason.BENT_FREE,
    InPlane.UNKNOWN: Reason.BENT_HELD,
    InPlane.WINDOW: Reason.BENT_HELD,
}
# What the reasons of a case mean, for the lines of a summary.
MEANING: dict[str, str] = {
    Reason.OPEN: "with an open peak",
    Reason.AGAIN: "in which the plate may touch again (open peak)",
    Reason.BENT_HELD: f"beyond the linear plate ({Reason.BENT_HELD})",
    Reason.BENT_FREE: f"beyond the linear plate ({Reason.BENT_FREE})",
    Reason.STEEP: f"beyond moderate rotations ({Reason.STEEP})",
    Reason.STRAINED: f"beyond linear plies ({Reason.STRAINED})",
    Reason.SOFT: f"beyond the contact law ({Reason.SOFT})",
    Reason.BROKEN: f"elastic predictions ({Reason.BROKEN})",
    Reason.DELAMINATED: (f"elastic predictions ({Reason.DELAMINATED})"),
    Reason.OTHER: "doubtful for other reasons",
}


def joined(reasons: Sequence[str]) -> str:
    """Return the validity of a case with some reasons."""
    return SEPARATOR.join(reasons) or VALID


def reasons_of(validity: str) -> list[str]:
    """Return the reasons in the validity of a case; empty for a valid or a failed case."""
    return [] if validity in ("", VALID, FAILED) else validity.split(SEPARATOR)


def counted(validity: Texts) -> Iterator[tuple[Reason, Bools]]:
    """Count the cases with each reason, in the order of :class:`Reason`.

    Reasons of other versions, whose number is not bounded, are counted together.
    """
    reasons = set(Reason)
    texts = validity.tolist()
    cases_of = {
        text: {name if name in reasons else Reason.OTHER for name in reasons_of(text)}
        for text in set(texts)
    }
    for reason in Reason:
        if any(reason in names for names in cases_of.values()):
            yield reason, np.array([reason in cases_of[text] for text in texts], dtype=bool)


@dataclass(frozen=True)
class Extent:
    """Largest values of cases, (cases,) each. They are lower bounds where the end is undecided."""

    end: Texts
    peak: Floats
    indentation: Floats
    deflection: Floats  # under the load; NaN of a plate that its supports let move
    exposure: Floats | float = np.nan
    threshold: Floats | float = np.nan
    # Reasons that the stored rows of a run gave: slope and strain.
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
    def limit(self) -> float:
        """Deflection over the thickness up to which the plate is taken as linear.

        It is infinite if the plate is not taken as linear.
        """
        return math.inf if self.nonlinear else LIMITS[self.in_plane]

    def validity(self, extent: Extent) -> Texts:
        """Return ``"ok"``, or the reasons to doubt each case."""
        h = self.thickness
        with np.errstate(invalid="ignore"):
            masks = {
                Reason.OPEN: np.isin(extent.end, (End.RISING, End.BETWEEN)),
                Reason.AGAIN: extent.end == End.AGAIN,
                BENT[self.in_plane]: extent.deflection > self.limit * h,
                Reason.STEEP: np.full(extent.peak.shape, Reason.STEEP in extent.of_rows),
                Reason.STRAINED: np.full(extent.peak.shape, Reason.STRAINED in extent.of_rows),
                Reason.SOFT: extent.indentation > INDENTATION * self.indented,
                Reason.BROKEN: np.broadcast_to(extent.exposure > CROSSED, extent.peak.shape),
                Reason.DELAMINATED: extent.peak > CROSSED * extent.threshold,
            }
        names = list(masks)
        rows = np.column_stack(list(masks.values()))
        kinds, which = np.unique(rows, axis=0, return_inverse=True)
        texts = [joined(list(compress(names, kind))) for kind in kinds.tolist()]
        return np.array(texts, dtype=np.str_)[which.reshape(-1)]
