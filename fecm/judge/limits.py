"""Limits: one row for each quantity that bounds a result, with its words.

A run, a case of a sweep and a page that judge a quantity ask the same row for the limit, for its
level of trust, and for what they say. A row whose cases are judged is in :data:`LIMITS`.
"""

from __future__ import annotations

import math
from enum import Enum, StrEnum, auto
from typing import NamedTuple

from fecm._table import Cell


class TrustLevel(StrEnum):
    """Level of trust in a number."""

    WITHIN = "within range"
    DOUBTFUL = "doubtful"
    OUTSIDE = "outside the model"
    UNJUDGED = "not judged"


class Judgement(NamedTuple):
    """Quantity, its size, and its level of trust."""

    level: TrustLevel
    name: str
    size: Cell
    words: str = ""
    noted: bool = False  # whether a run beyond the limit has a note about it too


class Doubt(NamedTuple):
    """Reason to doubt a case."""

    reason: str  # in the column ``validity``
    case: str  # what such a case is, in the lines of a summary
    level: TrustLevel


class Scale(Enum):
    """What the value of a limit is multiplied by."""

    ONE = auto()
    LINEAR_PLATE = auto()  # thickness of a plate that is taken as linear
    INDENTED_PLATE = auto()  # thickness that the indentation is compared with
    THRESHOLD = auto()  # delamination threshold, force


class ModelLimit(NamedTuple):
    """Limit of a quantity, with what is said beyond it.

    Attributes
    ----------
    quantity : str
        What is bounded, as a page names it.
    value : float
        Largest value without a doubt, or the least for a number of evaluations or elements; NaN for
        what is doubtful at all.
    shown : str
        The value in words.
    note : str
        What a run beyond the limit notes: a template, see :meth:`say`.
    remedy : str
        What to do about it, at the end of the note.
    page : str
        What a page says beside the quantity.
    case : str
        What a case beyond the limit is, in the lines of a summary.
    symbol : str
        Quantity in the reason of a case, ``symbol > shown``.
    level : TrustLevel
        Trust in a result beyond the limit.
    scale : Scale
        What the value is multiplied by.
    """

    quantity: str
    value: float = math.nan
    shown: str = ""
    note: str = ""
    remedy: str = ""
    page: str = ""
    case: str = ""
    symbol: str = ""
    level: TrustLevel = TrustLevel.DOUBTFUL
    scale: Scale = Scale.ONE

    @property
    def reason(self) -> str:
        """Reason of a case beyond the limit."""
        return f"{self.symbol} > {self.shown}"

    @property
    def doubt(self) -> Doubt:
        """What is said of a case beyond the limit."""
        return Doubt(self.reason, f"{self.case} ({self.reason})", self.level)

    def say(self, *, remedy: bool = True, **sizes: object) -> str:
        """Return the note of a run, with sizes in the places that the template names.

        Examples
        --------
        >>> STRAIN.say(size="1.2 %", place="time 3e-4 s")
        'the strain reaches 1.2 % at time 3e-4 s: beyond 1 %, linear plies are doubtful'
        """
        text = self.note.format(**{"quantity": self.quantity, **self._asdict(), **sizes})
        return f"{text}; {self.remedy}" if remedy and self.remedy else text

    def judgement(
        self, size: Cell, *, beyond: bool, quantity: str = "", words: str | None = None
    ) -> Judgement:
        """Return what a page says of a size, by default in the words of the row."""
        level = self.level if beyond else TrustLevel.WITHIN
        text = self.page if words is None else words
        return Judgement(level, quantity or self.quantity, size, text, noted=bool(self.note))


# Limits of the model -----------------------------------------------------------------------------

REACHES = "the {quantity} reaches {size} at {place}: beyond {shown}, "
TOO_SOFT = "a linear plate, without membrane stiffening, is too soft"
STIFFENING = "NONL includes the stiffening (fecm new --nonlinear)"


def _deflection(ratio: float) -> ModelLimit:
    """Return the limit of the deflection of a linear plate over its thickness."""
    return ModelLimit(
        "deflection",
        ratio,
        f"{ratio} h",
        note=f"{REACHES}{TOO_SOFT}{{error}}",
        remedy=STIFFENING,
        page=f"a linear plate holds up to {ratio} h with these supports",
        case="beyond the linear plate",
        symbol="w",
        level=TrustLevel.OUTSIDE,
        scale=Scale.LINEAR_PLATE,
    )


HELD_DEFLECTION, FREE_DEFLECTION = _deflection(0.3), _deflection(0.5)
SLOPE = ModelLimit(
    "slope",
    0.25,
    "0.25",
    note=REACHES
    + "von Kármán strains, which are for moderate rotations, have an error of about slope²/2 = "
    "{error:.1%}",
    page="the theory holds up to 0.25",
    case="beyond moderate rotations",
    symbol="slope",
    level=TrustLevel.OUTSIDE,
)
STRAIN = ModelLimit(
    "strain",
    0.01,
    "1 %",
    note=f"{REACHES}linear plies are doubtful",
    page="linear plies hold up to 1 %",
    case="beyond linear plies",
    symbol="strain",
    level=TrustLevel.OUTSIDE,
)
INDENTATION = ModelLimit(
    "indentation",
    0.25,
    "h/4",
    note="the {quantity} reaches {size} at {place}: beyond {shown}{of_face}, the contact law of a "
    "half-space is doubtful",
    page="the contact law of a half-space holds up to h/4",
    case="beyond the contact law",
    symbol="indentation",
    level=TrustLevel.OUTSIDE,
    scale=Scale.INDENTED_PLATE,
)
# A search for the velocity that reaches 1 ends a hair above.
CROSSED = 1.0001
EXPOSURE = ModelLimit(
    "largest exposure",
    CROSSED,
    "1",
    note="exposure above 1 ({criteria}): the run continues elastically; softening after the first "
    "failure is not modelled",
    page="1 is failure; the run is elastic beyond it",
    case="elastic predictions",
    symbol="exposure",
)
THRESHOLD = ModelLimit(
    "largest force over the threshold",
    CROSSED,
    "threshold",
    page="the run is elastic above the threshold",
    case="elastic predictions",
    symbol="peak force",
    scale=Scale.THRESHOLD,
)
LIMITS = (
    HELD_DEFLECTION,
    FREE_DEFLECTION,
    SLOPE,
    STRAIN,
    INDENTATION,
    EXPOSURE,
    THRESHOLD,
)

# Limits of a run's numbers -----------------------------------------------------------------------

BALANCED = 1e-3  # error of the energy balance, over the energy put in, without a doubt on a page
ENERGY_BALANCE = ModelLimit(
    "energy balance",
    0.01,
    note="the energy balance is off by {error:.2%} of the supplied energy, at step {step}",
    page="largest error, of the energy put in",
)
ITERATION = ModelLimit(
    "steps",
    note="the contact iteration did not converge in {steps} steps",
    remedy="a smaller DT helps",
    page="the contact iteration did not converge; a smaller DT helps",
)
FAIL_EVALUATIONS = ModelLimit(
    "evaluations of FAIL during contact",
    20,
    "20",
    note="FAIL was evaluated {count} times during contact, less than {shown}: larger exposures and "
    "the first failure may be missed",
    remedy="evaluate more often, in the loop of the steps",
    page="below 20 larger exposures and the first failure may be missed",
)
TIME_STEP = ModelLimit(
    "time step",
    1.0,
    page="of the critical one",
    level=TrustLevel.OUTSIDE,
)
# Share of the largest frequency that the time step allows.
STRETCHED_FREQUENCY = ModelLimit(
    "frequency of a stretched plate",
    0.95,
    note="the membrane force reaches {force} at time {time}: it may raise the plate's largest "
    "frequency from {linear:.1%} of 2/DT to {share:.1%}",
    remedy="a smaller DT is safer",
)
ELEMENTS_PER_WAVE = ModelLimit(
    "elements per bending wave",
    8,
    page="8 are enough for a peak",
)
POINT_FORCE = ModelLimit(
    "contact force",
    page="the peak depends on the element under a point force; PATC gives it a size",
)
# Change of the static deflection by the shear stiffness from equilibrium.
SHEAR_FACTOR = ModelLimit(
    "transverse shear factor 1",
    0.02,
    page="change of the static deflection by the shear stiffness from equilibrium (SHEA EQUI), "
    "which the deck leaves out",
)

# What a run leaves out ---------------------------------------------------------------------------

# Bending stress at the load of which the membrane stress is a share.
STRETCHED_THRESHOLD = ModelLimit(
    "membrane stress under the load",
    0.2,
    note="at time {time} the membrane force under the load is {force}, {share:.0%} of 6 M/h: the "
    "threshold of DELA is for a plate in bending",
)
LATER_CONTACT = ModelLimit(
    "peak force over the peak of the first contact",
    1.1,
    note="the peak force is reached in contact {contact}, after reflections in the plate: it "
    "depends on damping; the peak of the first contact is {first}",
)
# Share of the run after which a largest value may still grow.
LATE_VALUE = ModelLimit(
    "time of a largest value",
    0.8,
    note="the largest {quantities} came in the last fifth of the run, after the contact: the plate "
    "vibrates on and may exceed it",
    remedy="take more steps",
)
PULL = ModelLimit(
    "pull of the supports over a static load",
    0.1,
    note="the supports pull the plate down with {pull:.0%} of a static load at the impact; a "
    "window or a ring can only push: {band}",
    remedy="fecm new --window push models it, with --clamps the clamps of a standard",
    page="a window or a ring can only push: fecm new --window push",
)
CLAMPS_PULL = ModelLimit(
    "pull of the supports over the peak force",
    0.1,
    page="clamps hold it up to their preload, which is left out",
)
GRAVITY = ModelLimit(
    "rise of the force by gravity",
    0.02,
    note="gravity is left out: the weight of a projectile that falls adds {share:.1%} to the "
    "impact energy until it turns (M g w); the force and the deflection are then about {rise:.0%} "
    "larger",
)
SPRING_BACK = ModelLimit(
    "deflection before the impact",
    note="the impact starts at w = {w} under the load, but the nodal forces do not hold the plate "
    "there during the impact: it moves without the projectile too",
    remedy="a static solution at the load factor of the impact, to the default tolerance, would be "
    "held",
)
# At 3 times the yield stress a metal flows under a sphere.
YIELDING = ModelLimit(
    "mean contact pressure over the yield stress",
    3.0,
    note="the mean contact pressure reaches about {ratio:.2g} times the yield stress {stress} of "
    "the struck face: beyond {value:g} a metal flows, and an elastic law has too large a force and "
    "rebound and no permanent indentation",
    remedy="measure the law (fecm indent fit)",
)
