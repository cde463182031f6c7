"""Contact laws that users define: a check of their methods, and of every value they return.

Such a law is one of single cases.  :class:`CaseByCase` applies it to many.
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
# Indentations beyond this, in any unit, are those of a diverging motion: no fault of the law.
FAR = 1e30


class LawError(FecmError, ValueError):
    """A contact law by a user lacks a method, raises an exception, or returns no number."""


class OwnLaw(NamedTuple):
    """A law by a user whose values are checked; :class:`LawError` names the indentation.

    Where the indentation is no longer finite, the force is not either, and the law is not asked.
    """

    law: Law
    name: str

    def start(self) -> Any:
        """Memory before the first contact."""
        return self._ask("start", 0.0)

    def trial(self, memory: Any, last: ContactPoint, indentation: float) -> tuple[float, Any]:
        """Contact force at a trial indentation, and the memory after the trial."""
        if not math.isfinite(indentation):
            return indentation, memory
        found = self._ask("trial", indentation, memory, last, indentation)
        try:
            force, memory = found
        except (TypeError, ValueError):
            text = f"trial returned {found!r}, not a pair of force and memory"
            raise self._error(text, indentation) from None
        if type(force) is not float or not math.isfinite(force):
            force = self._number("force", force, indentation)
        return force, memory

    def accept(self, memory: Any, last: ContactPoint, indentation: float) -> Any:
        """Memory after a step that ends at an indentation."""
        if not math.isfinite(indentation):
            return memory
        return self._ask("accept", indentation, memory, last, indentation)

    def permanent(self, memory: Any, last: ContactPoint) -> float:
        """Permanent indentation after unloading from the last point (length)."""
        a = last.indentation
        found = self._ask("permanent", a, memory, last)
        return self._number("permanent indentation", found, a)

    def _ask(self, method: str, indentation: float, *arguments: Any) -> Any:
        """Call a method of the law."""
        try:
            return getattr(self.law, method)(*arguments)
        except Exception as error:
            if isinstance(error, OverflowError) and abs(indentation) > FAR:
                raise  # which the run reports as its divergence
            text = f"{method} failed with {type(error).__name__}: {error}"
            raise self._error(text, indentation) from error

    def _number(self, what: str, value: object, indentation: float) -> float:
        """A number that the law has returned."""
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


def own_law(given: Law | str | None) -> Law | None:
    """The law that a user gives, as an object or by the name of an entry point.

    A law of the report with its own constants stays as it is.  Raises LawError if the object is no
    law, ExtensionError if no package has the name.
    """
    if given is None:
        return None
    law: Any = given
    name = type(given).__name__
    if isinstance(given, str):
        name, law = given, installed(EntryPoints.LAWS, given)
        if isinstance(law, type) or not hasattr(law, "trial"):
            law = _made(name, law)
    elif isinstance(given, OwnLaw) or (isinstance(given, HystereticLaw) and knows(given.constants)):
        return given
    elif isinstance(given, type):
        own = given.__name__
        raise LawError(f"contact law {own} is a class; pass an object of it: law={own}()")
    missing = [method for method in METHODS if not callable(getattr(law, method, None))]
    if missing:
        raise LawError(
            f"contact law {name} has no method {', '.join(missing)}; a law has {', '.join(METHODS)}"
        )
    made = OwnLaw(law, name)
    made.trial(made.start(), ContactPoint(0.0, 0.0), 0.0)
    return made


def _made(name: str, factory: Any) -> object:
    """The law that a class or function of an entry point makes without arguments."""
    try:
        return factory()
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        raise LawError(
            f"contact law {name}: its entry point is neither a law nor makes one without arguments "
            f"({text})"
        ) from error


def law_name(law: Law) -> str:
    """Name of a law that a user has given, for messages and results."""
    return law.name if isinstance(law, OwnLaw) else type(law).__name__


class CaseByCase(NamedTuple):
    """A law of single cases for many cases, one after the other.

    The memories are an array of objects.  Where the law fails, the force is NaN.
    """

    law: Law
    cases: int

    def start(self) -> NDArray[np.object_]:
        """Memories before the first contact."""
        return _objects([self.law.start() for _ in range(self.cases)])

    def trial(
        self, memory: NDArray[np.object_], last: ContactPoint[Floats], indentation: Floats
    ) -> tuple[Floats, NDArray[np.object_]]:
        """Contact forces at trial indentations, and the memories after the trials."""
        force, memories = np.full(self.cases, np.nan), list(memory)
        for case, (point, a) in enumerate(_points(last, indentation)):
            try:
                force[case], memories[case] = self.law.trial(memory[case], point, a)
            except (LawError, OverflowError):
                continue  # the case is run again alone, which tells why
        return force, _objects(memories)

    def accept(
        self, memory: NDArray[np.object_], last: ContactPoint[Floats], indentation: Floats
    ) -> NDArray[np.object_]:
        """Memories after a step that ends at these indentations."""
        memories = list(memory)
        for case, (point, a) in enumerate(_points(last, indentation)):
            try:
                memories[case] = self.law.accept(memory[case], point, a)
            except (LawError, OverflowError):
                continue
        return _objects(memories)

    def permanent(self, memory: NDArray[np.object_], last: ContactPoint[Floats]) -> Floats:
        """Permanent indentations after unloading from the last points (length)."""
        found = np.full(self.cases, np.nan)
        for case, (point, _) in enumerate(_points(last, last.indentation)):
            try:
                found[case] = self.law.permanent(memory[case], point)
            except (LawError, OverflowError):
                continue
        return found


def _points(last: ContactPoint[Floats], indentation: Floats) -> list[tuple[ContactPoint, float]]:
    """The last point and an indentation of each case."""
    points = map(ContactPoint, last.indentation.tolist(), last.force.tolist())
    return list(zip(points, indentation.tolist(), strict=True))


def _objects(values: list[Any]) -> NDArray[np.object_]:
    """An array of objects, whatever their types are."""
    found = np.empty(len(values), dtype=object)
    for place, value in enumerate(values):
        found[place] = value
    return found
