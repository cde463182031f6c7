"""Contact laws of users, with checks of their methods and of every value that they return.

A user's law handles a single case.  :class:`CaseByCase` applies it to many cases.
"""

from __future__ import annotations

import math
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError
from fecm._extensions import EntryPoints, installed
from fecm._typing import Floats
from fecm.mechanics.contact_law import ContactPoint, HystereticLaw, Law
from fecm.mechanics.impact_steps import knows

METHODS = ("start", "trial", "accept", "permanent")
# An indentation beyond this, in any unit, belongs to a diverging motion, not to a fault.
FAR = 1e30


class LawError(FecmError, ValueError):
    """A user's contact law lacks a method, raises an exception, or does not return a number."""


class OwnLaw(NamedTuple):
    """A user's law with checked values.  :class:`LawError` names the indentation.

    The law is not called for an indentation that is no longer finite; the force is not finite then.
    """

    law: Law
    name: str

    def start(self) -> Any:
        """Return the memory before the first contact."""
        return self._call("start", 0.0)

    def trial(self, memory: Any, last: ContactPoint, indentation: float) -> tuple[float, Any]:
        """Return the contact force at a trial indentation, and the memory after the trial."""
        if not math.isfinite(indentation):
            return indentation, memory
        result = self._call("trial", indentation, memory, last, indentation)
        try:
            force, memory = result
        except (TypeError, ValueError):
            text = f"trial returned {result!r}, not a pair of force and memory"
            raise self._error(text, indentation) from None
        if type(force) is not float or not math.isfinite(force):
            force = self._check_number("force", force, indentation)
        return force, memory

    def accept(self, memory: Any, last: ContactPoint, indentation: float) -> Any:
        """Return the memory after a step that ends at an indentation."""
        if not math.isfinite(indentation):
            return memory
        return self._call("accept", indentation, memory, last, indentation)

    def permanent(self, memory: Any, last: ContactPoint) -> float:
        """Return the permanent indentation after unloading from the last point (length)."""
        a = last.indentation
        result = self._call("permanent", a, memory, last)
        return self._check_number("permanent indentation", result, a)

    def _call(self, method: str, indentation: float, *arguments: Any) -> Any:
        """Call a method of the law."""
        try:
            return getattr(self.law, method)(*arguments)
        except Exception as error:
            if isinstance(error, OverflowError) and abs(indentation) > FAR:
                raise  # the run reports this as its divergence
            text = f"{method} failed with {type(error).__name__}: {error}"
            raise self._error(text, indentation) from error

    def _check_number(self, what: str, value: object, indentation: float) -> float:
        """Return a value of the law as a float; raise LawError if it is not a finite number."""
        if isinstance(value, np.ndarray) and not value.ndim:
            value = value.item()
        if not isinstance(value, Real):
            raise self._error(f"the {what} is {value!r}, not a real number", indentation)
        try:
            number = float(value)
        except OverflowError:  # an integer of hundreds of digits
            number = math.inf
        if not math.isfinite(number):
            if abs(indentation) > FAR:
                raise OverflowError
            raise self._error(f"the {what} is {number:g}", indentation)
        return number

    def _error(self, fault: str, indentation: float) -> LawError:
        where = f"at the indentation {indentation:.6g}"
        if indentation < 0.0:
            where += ", where the bodies are apart"
        return LawError(f"contact law {self.name}: {fault} {where}")


def own_law(user_law: Law | str | None) -> Law | None:
    """Return the user's law, passed as an object or as the name of an entry point.

    A law of the report with known constants is returned as it is.  Raises LawError if the object is
    not a law, ExtensionError if no package has the name.
    """
    if user_law is None:
        return None
    law: Any = user_law
    name = type(user_law).__name__
    if isinstance(user_law, str):
        name, law = user_law, installed(EntryPoints.LAWS, user_law)
        if isinstance(law, type) or not hasattr(law, "trial"):
            law = _create_law(name, law)
    elif isinstance(user_law, OwnLaw) or (
        isinstance(user_law, HystereticLaw) and knows(user_law.constants)
    ):
        return user_law
    elif isinstance(user_law, type):
        class_name = user_law.__name__
        raise LawError(
            f"contact law {class_name} is a class; pass an object of it: law={class_name}()"
        )
    missing = [method for method in METHODS if not callable(getattr(law, method, None))]
    if missing:
        raise LawError(
            f"contact law {name} has no method {', '.join(missing)}; a law has {', '.join(METHODS)}"
        )
    checked_law = OwnLaw(law, name)
    checked_law.trial(checked_law.start(), ContactPoint(0.0, 0.0), 0.0)
    return checked_law


def _create_law(name: str, factory: Any) -> object:
    """Create a law with a class or function of an entry point, called without arguments."""
    try:
        return factory()
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        raise LawError(
            f"contact law {name}: its entry point is neither a law nor makes one without arguments "
            f"({text})"
        ) from error


def law_name(law: Law) -> str:
    """Return the name of a user's law, for messages and results."""
    return law.name if isinstance(law, OwnLaw) else type(law).__name__


class CaseByCase(NamedTuple):
    """A law of single cases, applied to many cases one after another.

    The memories are an array of objects.  The force is NaN where the law fails.
    """

    law: Law
    cases: int

    def start(self) -> NDArray[np.object_]:
        """Return the memories before the first contact."""
        return _objects([self.law.start() for _ in range(self.cases)])

    def trial(
        self, memory: NDArray[np.object_], last: ContactPoint[Floats], indentation: Floats
    ) -> tuple[Floats, NDArray[np.object_]]:
        """Return the contact forces at trial indentations, and the memories after the trials."""
        force, memories = np.full(self.cases, np.nan), list(memory)
        for case, (point, a) in enumerate(_points(last, indentation)):
            try:
                force[case], memories[case] = self.law.trial(memory[case], point, a)
            except (LawError, OverflowError):
                continue  # a single run of the case reports the reason
        return force, _objects(memories)

    def accept(
        self, memory: NDArray[np.object_], last: ContactPoint[Floats], indentation: Floats
    ) -> NDArray[np.object_]:
        """Return the memories after a step that ends at these indentations."""
        memories = list(memory)
        for case, (point, a) in enumerate(_points(last, indentation)):
            try:
                memories[case] = self.law.accept(memory[case], point, a)
            except (LawError, OverflowError):
                continue
        return _objects(memories)

    def permanent(self, memory: NDArray[np.object_], last: ContactPoint[Floats]) -> Floats:
        """Return the permanent indentations after unloading from the last points (length)."""
        permanent = np.full(self.cases, np.nan)
        for case, (point, _) in enumerate(_points(last, last.indentation)):
            try:
                permanent[case] = self.law.permanent(memory[case], point)
            except (LawError, OverflowError):
                continue
        return permanent


def _points(last: ContactPoint[Floats], indentation: Floats) -> list[tuple[ContactPoint, float]]:
    """Pair the last point and an indentation of each case."""
    points = map(ContactPoint, last.indentation.tolist(), last.force.tolist())
    return list(zip(points, indentation.tolist(), strict=True))


def _objects(values: list[Any]) -> NDArray[np.object_]:
    """Return an array of objects of any type."""
    array = np.empty(len(values), dtype=object)
    for place, value in enumerate(values):
        array[place] = value
    return array
