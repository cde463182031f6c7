"""The notation of layups, which all commands and Python share."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import fecm
from fecm.authoring.case import CasesError
from fecm.authoring.values import apply_case
from fecm.deck.layup import LayupError, parse_layup, parse_plies
from fecm.deck.model import Material
from tests.calls import call
from tests.decks import APPENDIX

SEPARATORS = ("/", " / ", ",", ", ", " ", "   ", "\N{NO-BREAK SPACE}", "\N{FRACTION SLASH}")
MINUS = ("-", "\N{MINUS SIGN}", "\N{EN DASH}")
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
Written = Callable[[int], str]
AFTER_GROUP: Written = "{}".format
REPEATS: tuple[Written, ...] = (
    lambda n: f"_{n}",
    lambda n: f"_{{{n}}}",
    lambda n: str(n).translate(SUBSCRIPTS),
)
MIRRORS = ("s", "S", "_s", "_{s}", "ₛ", " s")

Item = tuple[str, list[float]]  # an item of a layup as text, and its plies

angles = st.integers(-360, 360).map(lambda half: half / 2)


@st.composite
def plies(draw: st.DrawFn, minus: str, depth: int = 0) -> Item:
    """One item of a layup, and what it means; `|` stands for the separator."""
    angle, degree = draw(angles), draw(st.sampled_from(["", "°"]))
    text = f"{abs(angle):g}{degree}"
    choice = draw(st.integers(0, 4 if depth < 2 else 3))
    if choice == 1:
        mark = draw(st.sampled_from(["±", "+-", "+/-"]))
        return f"{mark}{text}", [abs(angle), -abs(angle)]
    if choice == 2:
        return f"∓{text}", [-abs(angle), abs(angle)]
    signed = f"{minus if angle < 0 else ''}{text}"
    if choice == 3:
        times = draw(st.integers(1, 4))
        return signed + draw(st.sampled_from(REPEATS))(times), [angle] * times
    if choice == 4:
        inner = draw(st.lists(plies(minus, depth + 1), min_size=1, max_size=3))
        times = draw(st.integers(1, 3))
        written = draw(st.sampled_from((AFTER_GROUP, *REPEATS)))(times)
        together = [angle for _, own in inner for angle in own]
        return f"({'|'.join(one for one, _ in inner)}){written}", together * times
    return signed, [angle]


@st.composite
def layups(draw: st.DrawFn) -> Item:
    """A layup without separators, and its plies."""
    minus = draw(st.sampled_from(MINUS))
    items = draw(st.lists(plies(minus), min_size=1, max_size=5))
    values = [angle for _, own in items for angle in own]
    text = f"[{'|'.join(one for one, _ in items)}]"
    if draw(st.booleans()):
        text, values = text + draw(st.sampled_from(MIRRORS)), values + values[::-1]
    return text, values


@settings(max_examples=40)
@given(layups(), st.sampled_from(SEPARATORS))
def test_plies_written_in_one_notation_are_read_as_these_plies(layup: Item, mark: str) -> None:
    text, actual = layup
    written = text.replace("|", mark)
    assume(not re.search(r"\s[2-9](?![0-9.e_])", written))  # may be a lost subscript
    assert parse_layup(written) == actual


@settings(max_examples=40)
@given(layups(), st.data())
def test_plies_written_in_several_notations_are_read_as_these_plies_or_refused(
    layup: Item, data: st.DataObject
) -> None:
    text, actual = layup
    first, *parts = text.split("|")
    mixed = first + "".join(data.draw(st.sampled_from(SEPARATORS)) + part for part in parts)
    with contextlib.suppress(LayupError):
        assert parse_layup(mixed) == actual


@given(st.lists(angles, min_size=2, max_size=6))
def test_decimal_commas_are_refused_with_the_layup_that_has_points(plies: list[float]) -> None:
    written = [f"{angle:.1f}" for angle in plies]
    with pytest.raises(LayupError) as caught:
        parse_layup(f"[{'/'.join(written)}]s".replace(".", ","))
    assert f"`[{'/'.join(written)}]s`" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "readings"),
    [
        ("[22,5/-22,5]s", ["[22.5/-22.5]s", "[22/5/-22/5]s"]),
        ("[22,5 -22,5]s", ["[22.5/-22.5]s", "[22/5/-22/5]s"]),
        ("[90 2]s", ["[90/2]s", "[90_2]s"]),
        ("[1 0/45]", ["[1/0/45]", "[10/45]"]),
        ("[0 C/90]", ["[0/C/90]", "[0C/90]"]),
        ("[(0 90) 45]", ["[(0/90)/45]", "[(0/90)45]"]),
        ("[(0/90) 2/45]", ["[(0/90)/2/45]", "[(0/90)2/45]"]),
        ("[02/±45]s", ["0_2", "2"]),
        ("[-045]", ["0_45", "45"]),
        ("[902/45]", ["90_2"]),
        ("[-452]", ["-45_2"]),
    ],
)
def test_what_has_two_readings_is_refused_with_both(text: str, readings: list[str]) -> None:
    with pytest.raises(LayupError) as caught:
        parse_plies(text)
    message = str(caught.value)
    assert [f"`{reading}`" in message for reading in readings] == [True] * len(readings)


@pytest.mark.parametrize(
    "text", ["[0 - 45]", "[4°5]", "[0 + 45]", "[181]", "[0/-180.5]", "[1e999]"]
)
def test_what_no_notation_has_is_refused(text: str) -> None:
    with pytest.raises(LayupError):
        parse_layup(text)


def test_the_largest_angles_are_half_a_turn() -> None:
    assert parse_layup("[180/-180]") == [180.0, -180.0]
    with pytest.raises(ValueError, match="200, beyond ±180"):
        fecm.Laminate([0, 200], "report", 0.0053)


def test_blanks_separate_the_plies_of_every_command_and_of_python() -> None:
    four = (0.0, 90.0, 90.0, 0.0)
    assert fecm.Laminate("[0 90]s", "report", 0.0053).angles == four
    deck = fecm.read_one(APPENDIX)
    layers = apply_case(deck, {"layup": "[0 90]s"}).require(Material).layers
    assert tuple(layer.angle for layer in layers) == four
    both = []
    for layup in ("[0 90]s", "[0/90]s"):
        options = ["--layup", layup, "--ply-thickness", ".0053", "--material", "report"]
        both.append(call("waves", "speeds", *options).stdout)
    assert both[0] == both[1]


def test_a_sweep_refuses_what_fecm_new_refuses() -> None:
    deck = fecm.read_one(APPENDIX)
    for text in ("[22,5/-22,5]s", "[02/±45]s", "[0/200]"):
        with pytest.raises(CasesError, match="layup"):
            apply_case(deck, {"layup": text})
        refused = call("waves", "speeds", "--layup", text)
        assert refused.exit_code == 2
        assert "layup" in refused.stderr
