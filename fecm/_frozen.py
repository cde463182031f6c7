"""Frozen dataclasses whose definition takes little time."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass, field, fields
from functools import cache
from typing import TYPE_CHECKING, TypeVar, dataclass_transform

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: type[T]) -> type[T]:
    """``dataclass(frozen=True)`` whose methods but ``__init__`` are the functions below.

    A dataclass compiles its own methods: 0.73 ms a class against 0.19 ms here, which for the
    classes of a short run is about 45 of 350 ms.
    """
    made = dataclass(eq=False, repr=False)(cls)
    for name, method in METHODS.items():
        if name not in vars(cls):
            setattr(made, name, method)
    return made


def _set(self: DataclassInstance, name: str, value: object) -> None:
    if name not in self.__dataclass_fields__ or name in vars(self):  # __init__ sets it once
        raise FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(self, name, value)


def _delete(self: DataclassInstance, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


def _equal(self: DataclassInstance, other: DataclassInstance) -> bool:
    same = type(other) is type(self)
    return _compared(self) == _compared(other) if same else NotImplemented


def _hash(self: DataclassInstance) -> int:
    return hash(_compared(self))


def _text(self: DataclassInstance) -> str:
    shown = (f"{f.name}={getattr(self, f.name)!r}" for f in fields(self) if f.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


METHODS = {
    "__setattr__": _set,
    "__delattr__": _delete,
    "__eq__": _equal,
    "__hash__": _hash,
    "__repr__": _text,
}


def _compared(value: DataclassInstance) -> tuple[object, ...]:
    """Values that two equal objects have in common."""
    return tuple([getattr(value, name) for name in _names_to_compare(type(value))])


@cache  # cases of a sweep are compared and hashed often
def _names_to_compare(cls: type[DataclassInstance]) -> tuple[str, ...]:
    return tuple(f.name for f in fields(cls) if f.compare)
