"""Frozen dataclasses whose definition takes little time."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass, field, fields
from typing import Any, ClassVar, TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: type[T]) -> type[T]:
    """``dataclass(frozen=True)`` whose methods but ``__init__`` are those of one class.

    A dataclass compiles its own, which takes a tenth of the time of a short run.
    """
    made = dataclass(eq=False, repr=False)(cls)
    for name in ("__setattr__", "__delattr__", "__eq__", "__hash__", "__repr__"):
        if name not in vars(cls):
            setattr(made, name, vars(_Methods)[name])
    return made


class _Methods:
    """Methods of frozen dataclasses."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __setattr__(self, name: str, value: object) -> None:
        if name not in self.__dataclass_fields__ or name in vars(self):  # __init__ sets it once
            raise FrozenInstanceError(f"cannot assign to field {name!r}")
        object.__setattr__(self, name, value)

    def __delattr__(self, name: str) -> None:
        raise FrozenInstanceError(f"cannot delete field {name!r}")

    def __eq__(self, other: object) -> bool:
        same = type(other) is type(self)
        return _compared(self) == _compared(other) if same else NotImplemented

    def __hash__(self) -> int:
        return hash(_compared(self))

    def __repr__(self) -> str:
        shown = (f"{f.name}={getattr(self, f.name)!r}" for f in fields(self) if f.repr)
        return f"{type(self).__qualname__}({', '.join(shown)})"


def _compared(value: Any) -> tuple[object, ...]:
    """Values that two equal objects have in common."""
    return tuple(getattr(value, f.name) for f in fields(value) if f.compare)
