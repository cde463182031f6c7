"""Failure criteria of plies that users define: a check of what they return."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Mapping
from typing import Protocol, runtime_checkable

import numpy as np

from fecm._errors import FecmError
from fecm._extensions import Group, installed
from fecm._typing import Bools, Floats
from fecm.mechanics.failure import CRITERIA, MODES, Candidates, Criterion, Strengths, exposure_of

MOST_MODES = 32  # of one criterion
MOST_CODES = 127  # codes of the modes of all criteria are stored as int8
ROUNDING = 1e-9  # size of a negative exposure that is rounding
# Other names of a result's group `failure`, and of the criterion of the interfaces.
RESERVED = ("x", "y", "under_load", "interlaminar")


class CriterionError(FecmError, ValueError):
    """A user's failure criterion raises an exception, or does not return exposures."""


@runtime_checkable
class FailureCriterion(Protocol):
    """A failure criterion of plies, for FAIL to evaluate beside its own.

    The exposure is the reciprocal of the factor on all stresses at which the ply fails: it is 0
    without stress, and 1 at failure.  Of a quadratic criterion it is the square root.

    Examples
    --------
    The quadratic criterion of Norris:

    >>> import numpy as np
    >>> def norris(ply, s1, s2, tau):
    ...     x = np.where(s1 > 0.0, ply.xt, ply.xc)
    ...     y = np.where(s2 > 0.0, ply.yt, ply.yc)
    ...     square = (s1 / x) ** 2 - s1 * s2 / (x * y) + (s2 / y) ** 2 + (tau / ply.s12) ** 2
    ...     return np.sqrt(square)

    Two modes of failure, of which the larger exposure counts:

    >>> def two_modes(ply, s1, s2, tau):
    ...     return {"fibre": abs(s1) / ply.xt, "matrix": np.hypot(s2 / ply.yt, tau / ply.s12)}
    """

    def __call__(
        self, ply: Strengths, s1: Floats, s2: Floats, tau: Floats, /
    ) -> Floats | Mapping[str, Floats]:
        """Exposures under many states of stress, in an array of their shape or one for each mode.

        The stresses (force/area) are those along and across the fibres, and the shear stress, in
        the axes of the ply.
        """


class OwnCriterion:
    """A user's criterion, whose exposures are checked; :class:`CriterionError` names the stress."""

    def __init__(self, name: str, function: FailureCriterion) -> None:
        self.name, self._function = name, function
        self.modes: tuple[str, ...] = ()

    def with_modes(self, ply: Strengths) -> OwnCriterion:
        """The same with the modes of failure that it returns for a ply without stress."""
        made = OwnCriterion(self.name, self._function)
        made.modes = tuple(mode for mode, _ in made(ply, *np.zeros((3, 1, 1))))
        return made

    def __call__(self, ply: Strengths, s1: Floats, s2: Floats, tau: Floats) -> Candidates:
        """Exposures by mode."""
        try:
            found = self._function(ply, s1, s2, tau)
        except Exception as error:
            raise self._error(f"failed with {type(error).__name__}: {error}") from error
        by_mode = found if isinstance(found, Mapping) else {self.name.replace("_", " "): found}
        if not by_mode or not all(isinstance(mode, str) for mode in by_mode):
            raise self._error(f"returned {found!r}, not exposures by the names of modes")
        if len(by_mode) > MOST_MODES:
            raise self._error(f"returned {len(by_mode)} modes; at most {MOST_MODES} are allowed")
        if names := [mode for mode in by_mode if not mode.isprintable()]:
            raise self._error(
                f"returned the mode {names[0]!r}; the names of modes are printable texts"
            )
        if self.modes and (new := [mode for mode in by_mode if mode not in self.modes]):
            raise self._error(
                f"returned the mode {new[0]!r}, and without stress {', '.join(self.modes)}: "
                "return all modes, 0 where one does not apply"
            )
        made = tuple((mode, self._checked(v, s1, s2, tau)) for mode, v in by_mode.items())
        largest = exposure_of(made)
        if (wrong := largest < -ROUNDING).any():
            text = "return 0 where the criterion does not apply"
            raise self._wrong_value(largest, wrong, s1, s2, tau, f"; {text}")
        return made

    def _wrong_value(
        self, exposure: Floats, wrong: Bools, s1: Floats, s2: Floats, tau: Floats, hint: str = ""
    ) -> CriterionError:
        """Error that names the first wrong exposure and its stresses."""
        first = tuple(np.argwhere(wrong)[0].tolist())
        where = f"sigma_1 = {s1[first]:.6g}, sigma_2 = {s2[first]:.6g}, tau_12 = {tau[first]:.6g}"
        return self._error(f"returned {exposure[first]:g} for {where}{hint}")

    def _checked(self, values: object, s1: Floats, s2: Floats, tau: Floats) -> Floats:
        """Exposures of one mode as numbers."""
        try:
            given = np.asarray(values)
            if given.dtype.kind not in "fiu":  # neither complex numbers nor booleans
                raise TypeError
            exposure = given.astype(float)
        except (TypeError, ValueError, OverflowError):
            raise self._error(f"returned {reprlib.repr(values)}, not real numbers") from None
        if exposure.shape != s1.shape:
            raise self._error(
                f"returned an array of the shape {exposure.shape} for stresses of {s1.shape}"
            )
        wrong = ~np.isfinite(exposure)
        # Stresses that are not finite are those of a diverging motion.
        wrong &= np.isfinite(s1) & np.isfinite(s2) & np.isfinite(tau)
        if wrong.any():
            raise self._wrong_value(exposure, wrong, s1, s2, tau)
        return exposure

    def _error(self, fault: str) -> CriterionError:
        return CriterionError(f"failure criterion {self.name} {fault}")


def own_criteria(given: Iterable[FailureCriterion | str]) -> tuple[OwnCriterion, ...]:
    """The criteria that a user gives, as functions or by the names of entry points.

    A function has its own name.  Raises CriterionError if one can't be used, ExtensionError if no
    package has the name.
    """
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise CriterionError(f"criteria is {given!r}; pass a list of functions or names")
    found: dict[str, OwnCriterion] = {}
    for one in given:
        if isinstance(one, OwnCriterion):
            found[one.name] = one
            continue
        name = one if isinstance(one, str) else getattr(one, "__name__", type(one).__name__)
        function = installed(Group.CRITERIA, one) if isinstance(one, str) else one
        if not callable(function) or isinstance(function, type):
            raise CriterionError(f"failure criterion {name} is {function!r}, not a function")
        if not name.isidentifier():
            raise CriterionError(f"failure criterion {name}: a function with a name is needed")
        if name in CRITERIA or name in RESERVED or name in found:
            raise CriterionError(f"failure criterion {name}: there is another one of this name")
        found[name] = OwnCriterion(name, function)
    return tuple(found.values())


def with_own(own: Iterable[OwnCriterion]) -> tuple[dict[str, Criterion], tuple[str, ...]]:
    """All criteria of a run by name, and the modes of failure that their codes mean."""
    criteria: dict[str, Criterion] = {**CRITERIA}
    modes = dict.fromkeys(MODES)
    for one in own:
        criteria[one.name] = one
        modes |= dict.fromkeys(one.modes)
    if len(modes) > MOST_CODES:
        raise CriterionError(
            f"the failure criteria have {len(modes)} modes; at most {MOST_CODES} are allowed"
        )
    return criteria, tuple(modes)
