"""Encodings and line ends of decks and of files of settings."""

from __future__ import annotations

from pathlib import Path

import pytest

import fecm
from fecm.deck.format import format_deck
from tests.calls import assert_unusable, call
from tests.decks import small

TITLE = (
    "FECM Prüfung – 5 € “x” …"  # the last six characters differ between Windows-1252 and Latin-1
)
DECK = small().replace("FECM small plate", TITLE, 1)
INNER = "\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"  # line ends of Python's str.splitlines


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_deck_is_the_same_in_every_encoding_with_every_line_end(
    tmp_path: Path, encoding: str, end: str
) -> None:
    path = tmp_path / "a.inp"
    path.write_bytes(DECK.replace("\n", end).encode(encoding))
    assert fecm.read_one(path) == fecm.read_one(DECK)
    assert fecm.read_one(path).title == TITLE.removeprefix("FECM").strip()


def test_only_lf_crlf_and_cr_end_a_line() -> None:
    comment = f"! a comment with {INNER} in it\n"
    lines = small().split("\n")
    for number in range(len(lines) - 1):
        text = "\n".join(lines[:number]) + "\n" * bool(number) + comment
        assert fecm.read_deck(text + "\n".join(lines[number:])) == fecm.read_deck(small())
    assert INNER in format_deck(comment + small())


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_aligning_keeps_line_ends_and_the_byte_order_mark(
    tmp_path: Path, mark: str, end: str
) -> None:
    path = tmp_path / "a.inp"
    path.write_bytes((mark + DECK.replace("\n", end)).encode())
    assert call("fmt", path).exit_code == 0
    written = path.read_bytes().decode()
    assert written == mark + format_deck(DECK).replace("\n", end)
    assert call("fmt", path, "--check").exit_code == 0


def test_aligning_writes_the_characters_of_windows_as_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "a.inp"
    path.write_bytes(f"! … in a comment\n{DECK}".encode("cp1252"))
    assert call("fmt", path).exit_code == 0
    first, second = path.read_bytes().decode("utf-8").split("\n")[:2]
    assert (first, second) == ("! … in a comment", TITLE)


def test_a_deck_in_another_encoding_is_read_and_not_rewritten(tmp_path: Path) -> None:
    path = tmp_path / "a.inp"
    data = b"! \x81 is no character of Windows-1252\n" + small().encode()
    path.write_bytes(data)
    assert fecm.read_one(path) == fecm.read_one(small())
    done = call("fmt", path)
    assert_unusable(done)
    assert "save it as UTF-8" in done.stderr
    assert path.read_bytes() == data


def test_plies_are_read_in_the_encoding_of_windows(tmp_path: Path) -> None:
    path = tmp_path / "plies.toml"
    text = '["a"]\nE1 = 1e5\nE2 = 9e3\nnu12 = .3\nG12 = 5e3\ndensity = 1.6e-9\nsource = "µ – x"\n'
    path.write_bytes(text.replace(" .3", " 0.3").encode("cp1252"))
    assert fecm.materials(path)["a"].source == "µ – x"
