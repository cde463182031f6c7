"""Frozen dataclasses behave as those of the standard library."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, replace
from typing import Any

import pytest

import fecm
from fecm._frozen import frozen
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
