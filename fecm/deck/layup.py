"""Layups in the usual notation: ``[0/45/0/-45/0]2s``.

Angles in degrees, from the struck face on, separated by ``/``.  ``_2`` or ``_{2}`` repeats a ply,
``±45`` (or ``+-45``) is 45/-45, a number after a group repeats it, ``s`` mirrors it, ``T``
marks a total layup.  Groups may be nested.  A capital letter after an angle names the material of
the ply, as in ``[0C/90G]s``; alone, as in ``[0/90/K/90/0]``, it is a ply at 0 degrees, a core say.
An exponent has a small letter, ``1e-05``, as Python writes it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

from fecm._errors import FecmError

MOST_PLIES = 10_000  # a layup of more plies is certainly a typo
NESTING = 32  # deepest nesting of groups
QUOTED = 60  # characters of a layup that a message quotes
_PLY = re.compile(
    r"(?:(?P<pair>±|\+-|\+/-)?"
    r"(?P<angle>[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?)(?P<of>[A-Z])?"
    r"|(?P<alone>[A-Z]))(?:_\{?(?P<times>\d+)\}?)?"
)
_SUFFIX = re.compile(r"_?\{?(\d*)([sST]?)\}?")


class LayupError(FecmError, ValueError):
    """A layup can't be read."""


class LayupPly(NamedTuple):
    """A ply of a layup."""

    angle: float  # degrees
    name: str = ""  # letter of its material; empty if it has none


def parse_layup(text: str) -> list[float]:
    """Angles of the plies of a layup such as ``"[0_2/(±45)2/90]s"``, from the struck face on.

    Raises LayupError, whose message shows where, if the text is not a layup or has materials.
    """
    plies = parse_plies(text)
    if named := next((ply.name for ply in plies if ply.name), ""):
        raise LayupError(
            f"the layup `{_quoted(text)}` has the material {named}; here a layup has angles alone"
        )
    return [ply.angle for ply in plies]


def parse_plies(text: str) -> list[LayupPly]:
    """Plies of a layup such as ``"[0C/90G]s"``, with the letters of their materials.

    Raises LayupError, whose message shows where, if the text is not a layup.
    """
    compact = re.sub(r"\s", "", text)
    if not compact.startswith("["):
        compact = f"[{compact}]" if compact[-1:] not in "])" or "[" not in compact else compact
    plies, end = _group(compact, 0)
    if end != len(compact) or len(plies) > MOST_PLIES:
        raise _error(compact, end)
    return plies


def _error(text: str, position: int) -> LayupError:
    rest = text[position : position + 10]
    what = f"at `{rest}`" if rest else "at its end"
    hint = "write for example [0/45/-45/90]2s"
    return LayupError(f"the layup `{_quoted(text)}` can't be read {what}; {hint}")


def _quoted(text: str) -> str:
    return text if len(text) <= QUOTED else f"{text[:QUOTED]}..."


def _group(text: str, start: int, depth: int = 1) -> tuple[list[LayupPly], int]:
    """Plies of the group that begins at `start`, and where it ends."""
    if depth > NESTING:
        raise LayupError(f"the layup `{_quoted(text)}` has groups nested deeper than {NESTING}")
    if text[start : start + 1] not in ("[", "("):
        raise _error(text, start)
    close = "]" if text[start] == "[" else ")"
    plies: list[LayupPly] = []
    position = start + 1
    while True:
        if text[position : position + 1] in ("[", "("):
            inner, position = _group(text, position, depth + 1)
            plies += inner
        else:
            match = _PLY.match(text, position)
            if match is None or not math.isfinite(angle := float(match["angle"] or 0.0)):
                raise _error(text, position)
            name = match["of"] or match["alone"] or ""
            signs = (1.0, -1.0) if match["pair"] else (1.0,)
            one = [LayupPly(sign * angle, name) for sign in signs]
            plies += one * _times(match["times"] or "1", len(one), text, position)
            position = match.end()
        if len(plies) > MOST_PLIES:
            raise _error(text, position)
        following = text[position : position + 1]
        position += 1
        if following == close:
            break
        if following not in ("/", ","):
            raise _error(text, position - 1)
    suffix = _SUFFIX.match(text, position)
    if suffix is not None:
        plies = plies * _times(suffix[1] or "1", len(plies), text, position)
        if suffix[2] in ("s", "S"):
            plies = plies + plies[::-1]
        position = suffix.end()
    return plies, position


def _times(digits: str, plies: int, text: str, position: int) -> int:
    """Number of repeats, limited to :data:`MOST_PLIES` plies."""
    if len(digits) > 5 or int(digits) * plies > MOST_PLIES or int(digits) < 1:
        where = f"{_quoted(digits)} times at `{text[position : position + 10]}`"
        possible = f"1 to {MOST_PLIES} plies are possible"
        raise LayupError(f"the layup `{_quoted(text)}` repeats {where}; {possible}")
    return int(digits)


def layup_text(angles: Sequence[float]) -> str:
    """Shortest usual notation of a laminate's angles, which :func:`parse_layup` reads back.

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
