"""Failure criteria of plies, built-in and user-defined: exposure and mode.

The exposure f = 1/R is the reciprocal of the factor on all stresses that reaches failure.  Without
residual stresses it is linear in the load.  Stresses are in the axes of the ply; a ply fails at
f = 1.  The criteria are maximum stress, Tsai and Wu 1971, Hashin 1980 (with S_T = YC/2, for which
the compressive matrix criterion is a sum of squares), Puck's plane criterion (Puck and Schürmann
1998) of unidirectional plies, and a quadratic criterion of the interlaminar shear stresses.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._extensions import EntryPoints, installed
from fecm._typing import Bools, Floats, Indices
from fecm.mechanics.laminate import PlyConstants, is_fabric

MODES = (
    "none",
    "fibre tension",
    "fibre compression",
    "matrix tension",
    "matrix compression",
    "shear",
    "interactive",
    "inter-fibre A",
    "inter-fibre B",
    "inter-fibre C",
    "interlaminar shear",
)

LARGEST_FACTOR = 1e9  # stresses that reach failure only at a larger factor don't lead to failure
FACTOR_ERROR = 1e-12  # relative error of a factor

Codes = NDArray[np.int8]
# Values of a criterion by mode.  The largest value is the exposure.
Candidates = tuple[tuple[str, Floats], ...]


@dataclass(frozen=True)
class Strengths:
    """Strengths of a ply, all positive (force/area), with what else a criterion may need.

    Attributes
    ----------
    xt, xc, yt, yc : float
        Strengths along and across the fibres, in tension and compression (force/area).
    s12, s13, s23 : float
        Strengths in shear (force/area).
    f12, p_plus, p_minus : float
        Tsai and Wu's F12*, and Puck's slopes.
    e1, e2, g12 : float
        Moduli of the ply (force/area); NaN where they are unknown.
    nu12 : float
        Poisson's ratio of the ply; NaN where it is unknown.
    """

    xt: float
    xc: float
    yt: float
    yc: float
    s12: float
    s13: float
    s23: float
    f12: float = -0.5
    p_plus: float = 0.35
    p_minus: float = 0.3
    e1: float = math.nan
    e2: float = math.nan
    nu12: float = math.nan
    g12: float = math.nan


def largest_modes(
    candidates: Candidates, where: Indices | None = None, modes: Sequence[str] = MODES
) -> Codes:
    """Return the mode of the largest candidate at all or some flat indices.

    Ties go to the first candidate.
    """
    values = np.stack([v if where is None else v.ravel()[where] for _, v in candidates])
    codes = np.array([modes.index(mode) for mode, _ in candidates], np.int8)
    return np.where(values.max(axis=0) > 0.0, codes[values.argmax(axis=0)], 0).astype(np.int8)


def exposure_of(candidates: Candidates) -> Floats:
    """Return the largest candidate."""
    return reduce(np.maximum, [value for _, value in candidates])


def max_stress(ply: Strengths, s1: Floats, s2: Floats, tau: Floats) -> Candidates:
    """Return the ratios of the stresses to their strengths."""
    return (
        ("fibre tension", s1 / ply.xt),
        ("fibre compression", s1 / -ply.xc),
        ("matrix tension", s2 / ply.yt),
        ("matrix compression", s2 / -ply.yc),
        ("shear", np.abs(tau) / ply.s12),
    )


def tsai_wu(ply: Strengths, s1: Floats, s2: Floats, tau: Floats) -> Candidates:
    """Return the positive root f of f^2 - l f - q = 0, with linear and quadratic terms l, q."""
    x, y = ply.xt * ply.xc, ply.yt * ply.yc
    q = s1 * (s1 / x + (2.0 * ply.f12 / math.sqrt(x * y)) * s2) + s2**2 / y + (tau / ply.s12) ** 2
    linear = s1 * (1.0 / ply.xt - 1.0 / ply.xc) + s2 * (1.0 / ply.yt - 1.0 / ply.yc)
    return (("interactive", (linear + np.sqrt(linear**2 + 4.0 * q)) / 2.0),)


def hashin(ply: Strengths, s1: Floats, s2: Floats, tau: Floats) -> Candidates:
    """Return exposures of fibre and matrix failure, each in tension and in compression."""
    shear = (tau / ply.s12) ** 2
    matrix = np.where(s2 >= 0.0, s2 / ply.yt, s2 / ply.yc)
    combined = np.sqrt(matrix**2 + shear)
    fibre = np.sqrt((s1 / ply.xt) ** 2 + shear)
    return (
        ("fibre tension", np.where(s1 >= 0.0, fibre, 0.0)),
        ("fibre compression", s1 / -ply.xc),
        ("matrix tension", np.where(s2 >= 0.0, combined, 0.0)),
        ("matrix compression", np.where(s2 < 0.0, combined, 0.0)),
    )


def puck(ply: Strengths, s1: Floats, s2: Floats, tau: Floats) -> Candidates:
    """Return exposures of fibre failure, and of inter-fibre failure in the modes A, B and C."""
    s, yc, plus, minus = ply.s12, ply.yc, puck_slope(ply), ply.p_minus
    resistance, critical = puck_limits(ply)
    slope = minus * resistance / s
    t, pressed = np.abs(tau), s2 < 0.0
    # Mode A in tension and mode B in compression have the same form.
    factor = np.where(pressed, minus / s, 1.0 / ply.yt - plus / s) * s2
    ab = np.sqrt((t / s) ** 2 + factor**2) + np.where(pressed, minus / s, plus / s) * s2
    steep = pressed & (-s2 * critical > t * resistance)
    below = np.where(steep, s2, -1.0)
    c = (t**2 * (yc / (2.0 * (1.0 + slope) * s) ** 2) + s2**2 / yc) / -below
    return (
        ("fibre tension", s1 / ply.xt),
        ("fibre compression", s1 / -ply.xc),
        ("inter-fibre A", np.where(pressed, 0.0, ab)),
        ("inter-fibre B", np.where(pressed & ~steep, ab, 0.0)),
        ("inter-fibre C", np.where(steep, c, 0.0)),
    )


def puck_slope(ply: Strengths) -> float:
    """Return the slope p+ in tension, at most S12/YT.

    The envelope is straight at S12/YT, and concave beyond.
    """
    return min(ply.p_plus, ply.s12 / ply.yt)


def puck_limits(ply: Strengths) -> tuple[float, float]:
    """Return the fracture resistance R_A of the action plane, and tau_c where B meets C."""
    s, minus = ply.s12, ply.p_minus
    resistance = s / (2.0 * minus) * (math.sqrt(1.0 + 2.0 * minus * ply.yc / s) - 1.0)
    return resistance, s * math.sqrt(1.0 + 2.0 * minus * resistance / s)


Criterion = Callable[[Strengths, Floats, Floats, Floats], Candidates]
CRITERIA: dict[str, Criterion] = {
    "max_stress": max_stress,
    "tsai_wu": tsai_wu,
    "hashin": hashin,
    "puck": puck,
}
UNIDIRECTIONAL = ("puck",)  # criteria that hold for fibres in one direction


def is_evaluated(criterion: str, *, fabric: bool) -> bool:
    """Return whether a criterion is evaluated for a ply; Puck's is not evaluated for a fabric."""
    return not (fabric and criterion in UNIDIRECTIONAL)


class PlyExposure(NamedTuple):
    """Largest exposure of a criterion in the plies of a laminate."""

    criterion: str
    exposure: float
    mode: str
    ply: int  # from 1 at the struck face


def largest_in_plies(
    strengths: Sequence[Strengths | None],
    plies: Sequence[PlyConstants],
    stresses: Floats,
    criteria: Mapping[str, Criterion] = CRITERIA,
) -> list[PlyExposure]:
    """Return the largest exposure of each criterion under ply stresses, (plies, faces, 3).

    The strengths of a ply may be None.  A criterion that is evaluated for no ply is left out of the
    list.
    """
    largest = []
    for name, criterion in criteria.items():
        exposures = [
            _largest_in_ply(criterion, name, ply, number, stresses[number])
            for number, ply in enumerate(strengths)
            if ply is not None and is_evaluated(name, fabric=is_fabric(plies[number]))
        ]
        if exposures:
            largest.append(max(exposures, key=lambda entry: entry.exposure))
    return largest


def _largest_in_ply(
    criterion: Criterion, name: str, ply: Strengths, number: int, stresses: Floats
) -> PlyExposure:
    """Return the largest exposure of a ply under the stresses of its faces, (faces, 3)."""
    candidates = criterion(ply, *stresses.T)
    exposure = exposure_of(candidates)
    worst = int(exposure.argmax())
    modes = ("none", *(mode for mode, _ in candidates))
    mode = modes[largest_modes(candidates, modes=modes)[worst]]
    return PlyExposure(name, float(exposure[worst]), mode, number + 1)


def failure_load_factor(
    ply: Strengths, criterion: Criterion, at_rest: Floats, added: Floats
) -> float:
    """Return the factor on the stresses `added` to `at_rest`, (3,) each, at which f is 1.

    The factor is found by bisection, because the exposure f is not proportional to it.  It is 0 if
    the stresses at rest reach f = 1 on their own, and infinite if no factor reaches f = 1.
    """

    def exposure(factor: float) -> float:
        s1, s2, tau = (at_rest + factor * added)[:, None]
        return float(exposure_of(criterion(ply, s1, s2, tau))[0])

    if exposure(0.0) >= 1.0:
        return 0.0
    low, high = 0.0, 1.0
    while exposure(high) < 1.0:
        low, high = high, 2.0 * high
        if high > LARGEST_FACTOR:
            return math.inf
    while high - low > FACTOR_ERROR * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if exposure(middle) < 1.0 else (low, middle)
    return high


def interlaminar(
    s13: float | Floats, s23: float | Floats, tau_13: Floats, tau_23: Floats
) -> Floats:
    """Return the root of the summed squares of tau_13 and tau_23 over their strengths."""
    return np.hypot(tau_13 / s13, tau_23 / s23)


MOST_MODES = 32  # modes of one criterion
MOST_CODES = 127  # modes of all criteria, whose codes are stored as int8
ROUNDING = 1e-9  # a negative exposure of this size is rounding
# Other names in a result's group `failure`, and the name of the interlaminar criterion.
RESERVED = ("x", "y", "under_load", "interlaminar")


class CriterionError(FecmError, ValueError):
    """A user's failure criterion raises an exception or does not return exposures."""


@runtime_checkable
class FailureCriterion(Protocol):
    """A failure criterion of plies that FAIL evaluates beside its own criteria.

    The exposure is the reciprocal of the factor on all stresses at which the ply fails: it is 0
    without stress, and 1 at failure.  The exposure of a quadratic criterion is the square root.

    Examples
    --------
    The quadratic criterion of Norris:

    >>> import numpy as np
    >>> def norris(ply, s1, s2, tau):
    ...     x = np.where(s1 > 0.0, ply.xt, ply.xc)
    ...     y = np.where(s2 > 0.0, ply.yt, ply.yc)
    ...     square = (s1 / x) ** 2 - s1 * s2 / (x * y) + (s2 / y) ** 2 + (tau / ply.s12) ** 2
    ...     return np.sqrt(square)

    Two modes of failure; the larger exposure counts:

    >>> def two_modes(ply, s1, s2, tau):
    ...     return {"fibre": abs(s1) / ply.xt, "matrix": np.hypot(s2 / ply.yt, tau / ply.s12)}
    """

    def __call__(
        self, ply: Strengths, s1: Floats, s2: Floats, tau: Floats, /
    ) -> Floats | Mapping[str, Floats]:
        """Return exposures under many states of stress, as an array or as an array per mode.

        Each array has the shape of the stresses.  The stresses (force/area) are along the fibres,
        across the fibres, and in shear, in the axes of the ply.
        """


class OwnCriterion:
    """A user's criterion with checked exposures.  :class:`CriterionError` names the stress."""

    def __init__(self, name: str, function: FailureCriterion) -> None:
        self.name, self._function = name, function
        self.modes: tuple[str, ...] = ()

    def with_modes(self, ply: Strengths) -> OwnCriterion:
        """Return the criterion with the modes that it returns for a ply without stress."""
        criterion = OwnCriterion(self.name, self._function)
        criterion.modes = tuple(mode for mode, _ in criterion(ply, *np.zeros((3, 1, 1))))
        return criterion

    def __call__(self, ply: Strengths, s1: Floats, s2: Floats, tau: Floats) -> Candidates:
        """Return the exposures by mode."""
        try:
            result = self._function(ply, s1, s2, tau)
        except Exception as error:
            raise self._error(f"failed with {type(error).__name__}: {error}") from error
        by_mode = result if isinstance(result, Mapping) else {self.name.replace("_", " "): result}
        if not by_mode or not all(isinstance(mode, str) for mode in by_mode):
            raise self._error(f"returned {result!r}, not exposures by the names of modes")
        if len(by_mode) > MOST_MODES:
            raise self._error(f"returned {len(by_mode)} modes; at most {MOST_MODES} are allowed")
        if names := [mode for mode in by_mode if not mode.isprintable()]:
            raise self._error(
                f"returned the mode {names[0]!r}; the names of modes are printable texts"
            )
        if self.modes and (unknown := [mode for mode in by_mode if mode not in self.modes]):
            raise self._error(
                f"returned the mode {unknown[0]!r}, and without stress {', '.join(self.modes)}: "
                "return all modes, 0 where one does not apply"
            )
        candidates = tuple(
            (mode, self._check_values(v, s1, s2, tau)) for mode, v in by_mode.items()
        )
        largest = exposure_of(candidates)
        if (wrong := largest < -ROUNDING).any():
            text = "return 0 where the criterion does not apply"
            raise self._wrong_value(largest, wrong, s1, s2, tau, f"; {text}")
        return candidates

    def _wrong_value(
        self, exposure: Floats, wrong: Bools, s1: Floats, s2: Floats, tau: Floats, hint: str = ""
    ) -> CriterionError:
        """Return an error that names the first wrong exposure and its stresses."""
        first = tuple(np.argwhere(wrong)[0].tolist())
        where = f"sigma_1 = {s1[first]:.6g}, sigma_2 = {s2[first]:.6g}, tau_12 = {tau[first]:.6g}"
        return self._error(f"returned {exposure[first]:g} for {where}{hint}")

    def _check_values(self, values: object, s1: Floats, s2: Floats, tau: Floats) -> Floats:
        """Return the exposures of one mode as an array of floats."""
        try:
            array = np.asarray(values)
            if array.dtype.kind not in "fiu":  # neither complex numbers nor booleans
                raise TypeError
            exposure = array.astype(float)
        except (TypeError, ValueError, OverflowError):
            raise self._error(f"returned {reprlib.repr(values)}, not real numbers") from None
        if exposure.shape != s1.shape:
            raise self._error(
                f"returned an array of the shape {exposure.shape} for stresses of {s1.shape}"
            )
        wrong = ~np.isfinite(exposure)
        # Stresses that are not finite belong to a diverging motion.
        wrong &= np.isfinite(s1) & np.isfinite(s2) & np.isfinite(tau)
        if wrong.any():
            raise self._wrong_value(exposure, wrong, s1, s2, tau)
        return exposure

    def _error(self, fault: str) -> CriterionError:
        return CriterionError(f"failure criterion {self.name} {fault}")


def own_criteria(user_criteria: Iterable[FailureCriterion | str]) -> tuple[OwnCriterion, ...]:
    """Return the user's criteria, passed as functions or as names of entry points.

    A function keeps its own name.  Raises CriterionError if a criterion can't be used,
    ExtensionError if no package has the name.
    """
    if isinstance(user_criteria, str) or not isinstance(user_criteria, Iterable):
        raise CriterionError(f"criteria is {user_criteria!r}; pass a list of functions or names")
    criteria: dict[str, OwnCriterion] = {}
    for item in user_criteria:
        if isinstance(item, OwnCriterion):
            criteria[item.name] = item
            continue
        name = item if isinstance(item, str) else getattr(item, "__name__", type(item).__name__)
        function = installed(EntryPoints.CRITERIA, item) if isinstance(item, str) else item
        if not callable(function) or isinstance(function, type):
            raise CriterionError(f"failure criterion {name} is {function!r}, not a function")
        if not name.isidentifier():
            raise CriterionError(f"failure criterion {name}: a function with a name is needed")
        if name in CRITERIA or name in RESERVED or name in criteria:
            raise CriterionError(f"failure criterion {name}: there is another one of this name")
        criteria[name] = OwnCriterion(name, function)
    return tuple(criteria.values())


def with_own(user_criteria: Iterable[OwnCriterion]) -> tuple[dict[str, Criterion], tuple[str, ...]]:
    """Return all criteria of a run by name, and the modes of failure by code."""
    criteria: dict[str, Criterion] = {**CRITERIA}
    modes = dict.fromkeys(MODES)
    for criterion in user_criteria:
        criteria[criterion.name] = criterion
        modes |= dict.fromkeys(criterion.modes)
    if len(modes) > MOST_CODES:
        raise CriterionError(
            f"the failure criteria have {len(modes)} modes; at most {MOST_CODES} are allowed"
        )
    return criteria, tuple(modes)
