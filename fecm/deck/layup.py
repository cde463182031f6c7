"""Layups in the usual notation: ``[0/45/0/-45/0]2s``.

docs/making.md, *Layups*, describes the grammar. Angles are in degrees, and the first ply is at the
struck face. One layup has one separator: ``/``, ``,`` or blanks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

from fecm._errors import FecmError

MOST_PLIES = 10_000  # more plies are certainly a typo
NESTING = 32  # deepest nesting of groups
QUOTED = 60  # largest number of characters of a layup that a message quotes
LARGEST_ANGLE = 180.0  # degrees
_PLY = re.compile(
    r"(?:(?P<pair>[±∓])?"
    r"(?P<angle>[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[+-]?[0-9]+)?)°?(?P<of>[A-Z])?"
    r"|(?P<alone>[A-Z]))(?:_\{?(?P<times>[0-9]+)\}?)?"
)
_SUFFIX = re.compile(r"_?\{?([0-9]*)([sST]?)\}?")
_LEADING_ZERO = re.compile(r"[+-]?0([0-9].*)")
_LOST_SUBSCRIPT = re.compile(r"([+-]?[0-9]+)([2-9])")
_SEPARATORS = {" ": "blanks", "/": "`/`", ",": "`,`"}
# Spellings of characters of the grammar.
_PAIRS = (("+/-", "±"), ("-/+", "∓"), ("+-", "±"), ("-+", "∓"))
_CHARACTERS = str.maketrans(
    {
        **dict.fromkeys("\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}\N{NON-BREAKING HYPHEN}", "-"),
        **dict.fromkeys("\N{FRACTION SLASH}\N{DIVISION SLASH}", "/"),
        **dict.fromkeys("\N{MASCULINE ORDINAL INDICATOR}\N{RING ABOVE}", "°"),
        "\N{LATIN SUBSCRIPT SMALL LETTER S}": "s",
        "\N{LATIN SUBSCRIPT SMALL LETTER T}": "T",
    }
)
_SUBSCRIPTS = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
# Blanks that do not separate plies.
_INSIDE = re.compile(r"(?<=[\[(/,_{±∓]) | (?=[\])/,_{}°s])")
_AFTER_SIGN = re.compile(r"(?<=[\[(/,][+-]) ")
_BEFORE_REPEATS = re.compile(r"(?<=[\])]) (?=[0-9ST])")  # or before a ply
_LONE_DIGIT = re.compile(r"(?<=[0-9°]) (?=[2-9](?:[ \])]|$))")  # a small angle, or a subscript
_DECIMAL_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9])")


class LayupError(FecmError, ValueError):
    """A layup can't be read."""


class LayupPly(NamedTuple):
    """A ply of a layup."""

    angle: float  # degrees
    name: str = ""  # letter of its material; may be empty


def parse_layup(text: str, largest: float = LARGEST_ANGLE) -> list[float]:
    """Return the angles of a layup such as ``"[0_2/(±45)2/90]s"``, from the struck face down.

    No angle may be beyond plus or minus `largest`. Raises LayupError if the text is not a layup or
    names materials. The message shows the place.
    """
    plies = parse_plies(text, largest)
    if named := next((ply.name for ply in plies if ply.name), ""):
        raise LayupError(
            f"the layup `{_quote(text)}` has the material {named}; here a layup has angles only"
        )
    return [ply.angle for ply in plies]


def parse_plies(text: str, largest: float = LARGEST_ANGLE) -> list[LayupPly]:
    """Return the plies of a layup such as ``"[0C/90G]s"``, with the letters of their materials.

    No angle may be beyond plus or minus `largest`. Raises LayupError if the text is not a layup.
    The message shows the place.
    """
    plain = _normalize(text)
    compact = _AFTER_SIGN.sub("", _INSIDE.sub("", plain))
    opening, bracket, end = compact.rpartition("]")
    compact = opening + bracket + (end.replace(" ", "") if bracket else end)
    used = [name for mark, name in _SEPARATORS.items() if mark in compact]
    if len(used) > 1:
        what = f"separates plies by {' and by '.join(used)}"
        raise _ambiguity_error(text, what, _possible_readings(plain, compact, largest))
    if _BEFORE_REPEATS.search(compact):
        what = "has a blank between a group and what follows it"
        raise _ambiguity_error(text, what, _possible_readings(plain, compact, largest))
    if _LONE_DIGIT.search(compact):
        what = "has a digit after a blank, which is an angle or a lost subscript"
        readings = [_LONE_DIGIT.sub(mark, compact).replace(" ", "/") for mark in ("/", "_")]
        raise _ambiguity_error(text, what, readings)
    return _parse_compact(compact.replace(" ", "/"), largest)


def _normalize(text: str) -> str:
    """Return a layup with single blanks and only characters of the grammar."""
    plain = " ".join(text.split()).translate(_CHARACTERS)
    for written, mark in _PAIRS:
        plain = plain.replace(written, mark)
    return re.sub("[₀-₉]+", lambda match: "_" + match[0].translate(_SUBSCRIPTS), plain)


def _possible_readings(plain: str, compact: str, largest: float) -> list[str]:
    """Return the layups, separated by ``/``, that a layup with ambiguous separators may mean."""
    # A comma before a blank is a separator.
    commas = [_DECIMAL_COMMA.sub(".", compact)] if ", " not in plain else []
    readings: list[str] = []
    for candidate in (*commas, compact.replace(",", "/")):
        for blanks in (candidate, _BEFORE_REPEATS.sub("", candidate), candidate.replace(" ", "")):
            reading = blanks.replace(" ", "/")
            try:
                _parse_compact(reading, largest)
            except LayupError:
                continue
            if "," not in reading and reading not in readings:
                readings.append(reading)
    return readings


def _ambiguity_error(text: str, what: str, readings: Sequence[str]) -> LayupError:
    listing = " or ".join(f"`{_quote(reading)}`" for reading in readings)
    hint = f"write {listing}" if readings else "write for example [0/45/-45/90]2s"
    return LayupError(f"the layup `{_quote(text)}` {what}; {hint}")


def _parse_compact(compact: str, largest: float) -> list[LayupPly]:
    """Return the plies of a layup without blanks."""
    if not compact.startswith("["):
        compact = f"[{compact}]" if compact[-1:] not in "])" or "[" not in compact else compact
    plies, end = _parse_group(compact, 0, largest)
    if end != len(compact) or len(plies) > MOST_PLIES:
        raise _syntax_error(compact, end)
    return plies


def _syntax_error(text: str, position: int) -> LayupError:
    rest = text[position : position + 10]
    what = f"at `{rest}`" if rest else "at its end"
    hint = "write for example [0/45/-45/90]2s"
    return LayupError(f"the layup `{_quote(text)}` can't be read {what}; {hint}")


def _quote(text: str) -> str:
    return text if len(text) <= QUOTED else f"{text[:QUOTED]}..."


def _parse_angle(written: str, text: str, position: int, largest: float) -> float:
    """Read an angle; raise LayupError if it has probably lost a subscript."""
    angle = float(written)
    if zero := _LEADING_ZERO.fullmatch(written):
        ply = zero[1].lstrip("0") or "0"
        plies = (
            f"`0_{ply}` for {ply} plies at 0 degrees, or " if ply.isdigit() and ply > "0" else ""
        )
        what = f"has a zero before other digits, `{_quote(written)}`"
        raise LayupError(f"the layup `{_quote(text)}` {what}; write {plies}`{_quote(ply)}`")
    if not math.isfinite(angle):
        raise _syntax_error(text, position)
    if abs(angle) > largest:
        lost = _LOST_SUBSCRIPT.fullmatch(written)
        hint = "angles are in degrees"
        if lost and abs(float(lost[1])) <= largest:
            hint = f"write `{lost[1]}_{lost[2]}` for {lost[2]} plies at {lost[1]} degrees"
        what = f"has the angle {_quote(written)}, beyond ±{largest:g}"
        raise LayupError(f"the layup `{_quote(text)}` {what}; {hint}")
    return angle


def _parse_group(
    text: str, start: int, largest: float, depth: int = 1
) -> tuple[list[LayupPly], int]:
    """Return the plies of the group that starts at `start`, and the position after the group."""
    if depth > NESTING:
        raise LayupError(f"the layup `{_quote(text)}` has groups nested deeper than {NESTING}")
    if text[start : start + 1] not in ("[", "("):
        raise _syntax_error(text, start)
    close = "]" if text[start] == "[" else ")"
    plies: list[LayupPly] = []
    position = start + 1
    while True:
        if text[position : position + 1] in ("[", "("):
            inner, position = _parse_group(text, position, largest, depth + 1)
            plies += inner
        else:
            match = _PLY.match(text, position)
            if match is None:
                raise _syntax_error(text, position)
            angle = _parse_angle(match["angle"] or "0", text, position, largest)
            name = match["of"] or match["alone"] or ""
            signs = {"±": (1.0, -1.0), "∓": (-1.0, 1.0)}.get(match["pair"], (1.0,))
            signed_plies = [LayupPly(sign * angle, name) for sign in signs]
            repeats = _parse_repeats(match["times"] or "1", len(signed_plies), text, position)
            plies += signed_plies * repeats
            position = match.end()
        if len(plies) > MOST_PLIES:
            raise _syntax_error(text, position)
        following = text[position : position + 1]
        position += 1
        if following == close:
            break
        if following not in ("/", ","):
            raise _syntax_error(text, position - 1)
    suffix = _SUFFIX.match(text, position)
    if suffix is not None:
        plies = plies * _parse_repeats(suffix[1] or "1", len(plies), text, position)
        if suffix[2] in ("s", "S"):
            plies = plies + plies[::-1]
        position = suffix.end()
    return plies, position


def _parse_repeats(digits: str, plies: int, text: str, position: int) -> int:
    """Read the number of repeats of some plies; at most :data:`MOST_PLIES` plies may result."""
    if len(digits) > 5 or int(digits) * plies > MOST_PLIES or int(digits) < 1:
        where = f"{_quote(digits)} times at `{text[position : position + 10]}`"
        possible = f"1 to {MOST_PLIES} plies are possible"
        raise LayupError(f"the layup `{_quote(text)}` repeats {where}; {possible}")
    return int(digits)


def layup_text(angles: Sequence[float]) -> str:
    """Return the shortest usual notation for angles; :func:`parse_layup` reads it back.

    Examples
    --------
    >>> layup_text([45, 0, -45, 90, 45, 0, -45, 90, 90, -45, 0, 45, 90, -45, 0, 45])
    '[45/0/-45/90]2s'
    """
    plies = list(angles)
    half = len(plies) // 2
    mirrored = len(plies) > 1 and plies == plies[::-1] and len(plies) % 2 == 0
    repeated = plies[:half] if mirrored else plies
    count = len(repeated)
    period = next(n for n in range(1, count + 1) if repeated == repeated[:n] * (count // n))
    times = count // period
    runs = [(angle, len(list(same))) for angle, same in groupby(repeated[:period])]
    inside = "/".join(f"{angle:g}" + (f"_{n}" if n > 1 else "") for angle, n in runs)
    return f"[{inside}]{times if times > 1 else ''}{'s' if mirrored else ''}"
