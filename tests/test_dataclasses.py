"""Data classes of the package behave as those of the standard library."""

from __future__ import annotations

import copy
import inspect
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace
from typing import Any, ClassVar

import pytest

import fecm
from fecm._dataclasses import frozen, mutable
from tests.decks import small


@frozen
class Ours:
    """A frozen dataclass of the package."""

    name: str
    size: float = 1.0
    note: str = field(default="", compare=False, repr=False, kw_only=True)


Theirs: Any = dataclass(frozen=True)(
    type(
        "Ours",
        (),
        {
            "__annotations__": vars(Ours)["__annotations__"],
            "__module__": __name__,
            "size": 1.0,
            "note": field(default="", compare=False, repr=False, kw_only=True),
        },
    )
)


def test_equality_hash_and_text_are_those_of_a_standard_dataclass() -> None:
    ours, theirs = Ours("a", 2.0, note="b"), Theirs("a", 2.0, note="b")
    assert repr(ours) == repr(theirs)
    assert hash(ours) == hash(theirs)
    assert ours == Ours("a", 2.0, note="c") != Ours("a")
    assert ours != theirs
    assert replace(ours, size=1.0) == Ours("a")


@pytest.mark.parametrize("value", [Ours("a"), Theirs("a")])
def test_no_attribute_can_be_set_or_deleted(value: Ours) -> None:
    for name in ("name", "other"):
        with pytest.raises(FrozenInstanceError, match=f"cannot assign to field '{name}'"):
            setattr(value, name, 1)
        with pytest.raises(FrozenInstanceError, match=f"cannot delete field '{name}'"):
            delattr(value, name)


def test_a_deck_survives_pickling_and_copying() -> None:
    deck = fecm.read_one(small())
    for again in (pickle.loads(pickle.dumps(deck)), copy.deepcopy(deck)):
        assert again == deck
        assert hash(again.control) == hash(deck.control)


def made_by(decorate: Any) -> Any:
    """Two classes, one derived from the other, with every kind of field."""

    @decorate
    class Base:
        """A base."""

        name: str
        parts: list[int] = field(default_factory=list)
        total: int = field(default=0, init=False)
        UNITS: ClassVar[str] = "mm"

    @decorate
    class Derived(Base):
        """A derived class."""

        scale: float = 1.0
        note: str = field(default="", repr=False, kw_only=True)

    return Derived


KINDS = [(frozen, dataclass(frozen=True)), (mutable, dataclass)]


@pytest.mark.parametrize(("ours", "theirs"), KINDS)
def test_fields_defaults_and_constructor_are_those_of_a_standard_dataclass(
    ours: Any, theirs: Any
) -> None:
    one, other = made_by(ours), made_by(theirs)
    assert [(f.name, f.type) for f in fields(one)] == [(f.name, f.type) for f in fields(other)]
    expected = inspect.signature(other).parameters.values()
    found = inspect.signature(one).parameters.values()
    assert [(p.name, p.kind, p.annotation) for p in found] == [
        (p.name, p.kind, p.annotation) for p in expected
    ]
    for arguments, named in ((("a",), {}), (("a", [1], 2.0), {"note": "n"}), ((), {"name": "b"})):
        assert vars(one(*arguments, **named)) == vars(other(*arguments, **named))
        assert one(*arguments, **named).total == 0
    assert one("a").parts is not one("a").parts
    assert one.total == other.total == 0


@pytest.mark.parametrize("decorate", [frozen, mutable])
@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((), {}),
        (("a", [], 1.0, "too many"), {}),
        (("a",), {"name": "b"}),
        (("a",), {"unknown": 1}),
        (("a",), {"total": 1}),
        ((), {"parts": [], "scale": 1.0, "unknown": 1}),
    ],
)
def test_wrong_arguments_are_type_errors(
    decorate: Any, arguments: tuple[object, ...], named: dict[str, object]
) -> None:
    with pytest.raises(TypeError):
        made_by(decorate)(*arguments, **named)


def test_a_mutable_object_can_be_changed_and_has_no_hash() -> None:
    one = made_by(mutable)("a")
    one.scale = 3.0
    assert one.scale == 3.0
    assert one != replace(one, scale=1.0)
    with pytest.raises(TypeError, match="unhashable"):
        hash(one)


def test_methods_of_the_class_itself_stay() -> None:
    @frozen
    class Own:
        """A class with a constructor and equality of its own."""

        value: int

        def __init__(self) -> None:
            vars(self)["value"] = 1

        __eq__ = object.__eq__
        __hash__ = object.__hash__

        def __call__(self, x: float) -> float:
            return x

    assert Own().value == 1
    assert [*inspect.signature(Own()).parameters] == ["x"]
    assert Own() != Own()
    assert not inspect.signature(Own).parameters
