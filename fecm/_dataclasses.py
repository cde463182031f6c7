"""Data classes whose definition takes little time.

``dataclass`` compiles the methods of each class, in 0.2 to 0.7 ms.  The classes of this module
share theirs, and their fields are found when they are needed first: a short run defines a hundred
of these classes, and creates objects of less than half of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, FrozenInstanceError, dataclass, field, fields
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

if TYPE_CHECKING:
    from inspect import Signature

    from _typeshed import DataclassInstance

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: type[T]) -> type[T]:
    """``dataclass(frozen=True)`` with the methods of this module."""
    return _with(FROZEN, cls)


@dataclass_transform(field_specifiers=(field,))
def mutable(cls: type[T]) -> type[T]:
    """``dataclass`` with the methods of this module."""
    return _with(MUTABLE, cls)


def _with(methods: Mapping[str, object], cls: type[T]) -> type[T]:
    """The class, with the methods that it does not define itself."""
    for name, method in methods.items():
        if name not in vars(cls):
            setattr(cls, name, method)
    cls.__dataclass_fields__ = _FieldsOf(cls)  # type: ignore[attr-defined]
    if any(isinstance(value, Field) for value in vars(cls).values()):
        fields(cls)  # type: ignore[arg-type]  # puts the defaults in their place
    return cls


class _FieldsOf:
    """``__dataclass_fields__`` of a class until it is read; it then has the fields."""

    def __init__(self, cls: type) -> None:
        self._cls = cls

    def __get__(self, instance: object, owner: type) -> dict[str, Field[Any]]:
        # Without docstrings (python -OO) dataclass would write the signature in their place, of a
        # class whose defaults may not exist yet.
        self._cls.__doc__ = self._cls.__doc__ or self._cls.__name__
        made: Any = dataclass(init=False, repr=False, eq=False)(self._cls)
        found: dict[str, Field[Any]] = made.__dataclass_fields__
        return found


class _SignatureOf:
    """``__signature__`` of a class, for its documentation and for errors."""

    def __get__(self, instance: object, owner: type) -> Signature:
        if instance is not None or owner.__init__ is not _create:  # type: ignore[misc]
            raise AttributeError("__signature__")  # of a call, or of the class's own constructor
        return _signature_of(owner)


def _signature_of(cls: Any) -> Signature:
    from inspect import Parameter, Signature  # a short run needs none

    parameters = []
    for one in filter(lambda one: one.init, fields(cls)):
        kind = Parameter.KEYWORD_ONLY if one.kw_only else Parameter.POSITIONAL_OR_KEYWORD
        default = one.default if one.default_factory is MISSING else one.default_factory()
        if default is MISSING:
            default = Parameter.empty
        parameters.append(Parameter(one.name, kind, default=default, annotation=one.type))
    parameters.sort(key=lambda parameter: parameter.kind)
    return Signature(parameters, return_annotation=None)


class _Parameters:
    """What the objects of a class are created from."""

    def __init__(self, cls: type[DataclassInstance]) -> None:
        taken = [one for one in fields(cls) if one.init]
        self.names = dict.fromkeys(one.name for one in taken).keys()
        self.positional = [one.name for one in taken if not one.kw_only]
        self.defaults = {one.name: one.default for one in taken if one.default is not MISSING}
        self.factories = {
            one.name: one.default_factory for one in taken if one.default_factory is not MISSING
        }
        self.is_checked = hasattr(cls, "__post_init__")

    def completed(self, given: dict[str, Any]) -> dict[str, Any]:
        """The values with the defaults of those that are not given."""
        made = {name: make() for name, make in self.factories.items() if name not in given}
        return {**self.defaults, **made, **given}


_parameters_of = cache(_Parameters)
_assign = object.__setattr__


def _create(self: Any, /, *args: object, **named: object) -> None:
    cls: type[DataclassInstance] = type(self)
    parameters = _parameters_of(cls)
    values = dict(zip(parameters.positional, args, strict=False))
    values.update(named)
    count = len(values)
    if count != len(parameters.names):
        values = parameters.completed(values)
    if count != len(args) + len(named) or values.keys() != parameters.names:
        _refuse(cls, args, named)
    for name in parameters.names:
        _assign(self, name, values[name])
    if parameters.is_checked:
        self.__post_init__()


def _refuse(cls: type, args: tuple[object, ...], named: dict[str, object]) -> None:
    """Raise the TypeError of arguments that do not fit."""
    try:
        _signature_of(cls).bind(*args, **named)
    except TypeError as error:
        raise TypeError(f"{cls.__qualname__}: {error}") from None


def _set(self: object, name: str, value: object) -> None:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _delete(self: object, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


def _equal(self: DataclassInstance, other: DataclassInstance) -> bool:
    same = type(other) is type(self)
    return _compared(self) == _compared(other) if same else NotImplemented


def _hash(self: DataclassInstance) -> int:
    return hash(_compared(self))


def _text(self: DataclassInstance) -> str:
    shown = (f"{f.name}={getattr(self, f.name)!r}" for f in fields(self) if f.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


MUTABLE = {
    "__init__": _create,
    "__signature__": _SignatureOf(),
    "__eq__": _equal,
    "__hash__": None,
    "__repr__": _text,
}
FROZEN = {**MUTABLE, "__hash__": _hash, "__setattr__": _set, "__delattr__": _delete}


def _compared(value: DataclassInstance) -> tuple[object, ...]:
    """Values that two equal objects have in common."""
    return tuple([getattr(value, name) for name in _names_to_compare(type(value))])


@cache  # cases of a sweep are compared and hashed often
def _names_to_compare(cls: type[DataclassInstance]) -> tuple[str, ...]:
    return tuple(f.name for f in fields(cls) if f.compare)
