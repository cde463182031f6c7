"""``fecm diff``."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import click

from fecm.cli.common import FILE_PATH, FORMAT_OPTION, NO, RefusedError
from fecm.cli.isolation import reads
from fecm.results.diff import (
    SCALE_NAMES,
    Comparison,
    Difference,
    IncomparableError,
    Listed,
    Place,
    Tolerance,
    difference,
    opened,
)
from fecm.results.schema import jsonable, printable, told_apart


def _tolerance(_: click.Context, option: click.Parameter, value: str) -> float:
    """Read a tolerance, a number from 0 on, or refuse it in one line."""
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not 0.0 <= number < math.inf:
        raise RefusedError(f"{option.opts[0]}: `{printable(value)}` is not a number of at least 0")
    return number


@click.command()
@click.argument("a", type=FILE_PATH)
@click.argument("b", type=FILE_PATH)
@click.option("--rtol", default="0", show_default=True, callback=_tolerance, metavar="R",
              help="Relative tolerance: a share of each dataset's own largest absolute value, in A "
                   "and B together; so zero crossings of a history do not count.")  # fmt: skip
@click.option("--atol", default="0", show_default=True, callback=_tolerance, metavar="T",
              help="Absolute tolerance, in each dataset's own unit.")  # fmt: skip
@click.option("--only", multiple=True, metavar="PATH",
              help="Compare only this dataset (tape9/force) or group (tape9); may be "
                   "repeated.")  # fmt: skip
@click.option("--brief", is_flag=True, help="Print only what differs, by name, and the verdict.")
@FORMAT_OPTION
@reads("a", "b")
def diff(
    a: Path, b: Path, rtol: float, atol: float, only: tuple[str, ...], brief: bool, form: str
) -> None:
    """Compare two results dataset by dataset.

    A and B are result files or folders of tapes, or both results of sweeps.

    Two numbers are the same if |a - b| <= T + R * max, max being the largest absolute value of the
    whole dataset; for energy/balance_error the largest energy, for laminate/B the root of the
    largest A times the largest D, for indentation the largest one in contact.  NaN is the same as
    NaN, an infinity as the same infinity.  Whole numbers (steps, node numbers) must be equal at any
    tolerance.  A dataset that only one side has, another shape and another type are differences;
    title, mode, slips, other attributes and the deck are listed where they differ, and not judged.

    A folder of tapes holds tape3, tape8 and tape9 (or tape3.txt and so on) as `fecm tapes` or the
    original program wrote them, in either order.  Only what tapes hold is then compared, and their
    four digits need a tolerance: --rtol 1e-3.

    Exit status: 0 the same, 1 different, 2 a file or the call can't be used.
    """
    try:
        with opened(a) as left, opened(b) as right:
            found = difference(left, right, Tolerance(rtol, atol), only)
    except IncomparableError as error:
        raise RefusedError(printable(str(error))) from None
    if form == "json":
        head = {"a": printable(str(a)), "b": printable(str(b)), "rtol": rtol, "atol": atol}
        click.echo(json.dumps(jsonable(_json(found, head, brief))))
    else:
        lines = _brief(found) if brief else _lines(found)
        click.echo("\n".join([*lines, _verdict(found, rtol, atol)]))
    if not found.same:
        raise SystemExit(NO)


def _brief(found: Difference) -> list[str]:
    """Names of what differs."""
    return [printable(name) for name in sorted(_different(found))]


def _different(found: Difference) -> list[str]:
    return [*(c.path for c in found.compared if not c.same), *found.only[0], *found.only[1]]


def _verdict(found: Difference, rtol: float, atol: float) -> str:
    """The last line."""
    count = len(found.compared) + sum(map(len, found.only))
    within = f"rtol {rtol:g}, atol {atol:g}"
    if found.same:
        return f"same: {count} dataset{'s' * (count != 1)} within {within}"
    return f"different: {len(_different(found))} of {count} dataset{'s' * (count != 1)} at {within}"


def _lines(found: Difference) -> list[str]:
    """A line for every dataset, then what is listed."""
    told = {c.path: ("same" if c.same else "different", _told(c)) for c in found.compared}
    for side, names in zip("AB", found.only, strict=True):
        told.update(dict.fromkeys(names, (f"only in {side}", "")))
    width = max((len(printable(name)) for name in told), default=0)
    lines = [
        f"{word:10} {printable(name):{width}}  {text}".rstrip()
        for name, (word, text) in sorted(told.items())
    ]
    return [*lines, *map(_listed, found.listed)]


def _told(found: Comparison) -> str:
    """What there is to say about a dataset: sizes, then where, then since when."""
    a, b = found.layouts
    parts: list[str] = []
    if a.shape != b.shape:
        parts.append(f"shape {_shape(a.shape)} against {_shape(b.shape)}")
    if not found.same_type:
        parts.append(f"type {a.kind} against {b.kind}")
    if found.at and found.values:
        left, right = _values(found.values)
        if math.isinf(found.largest):
            parts.append(f"{left} against {right}{_where(found.at)}")
        else:
            what = SCALE_NAMES.get(found.path, "") if found.scale != found.maximum else ""
            share = f"{found.relative:.2g} of {what or 'max'} {found.scale:.6g}"
            parts.append(
                f"largest {found.largest:.3g} ({share}), {left} against {right}{_where(found.at)}"
            )
    if found.differing:
        what = "text" if a.holds_texts else "number"
        parts.append(f"{found.differing} {what}{'s differ' if found.differing > 1 else ' differs'}")
    if found.first:
        parts.append(f"first{_where(found.first)}")
    return "; ".join(parts)


def _values(values: tuple[float, float] | tuple[str, str]) -> list[str]:
    """Two values that differ, in as many digits as it takes to see it."""
    if any(isinstance(value, str) for value in values):
        return [f"`{text}`" for text in told_apart(*values)]
    short = [f"{value:.6g}" for value in values]
    return short if short[0] != short[1] else list(map(repr, values))


def _shape(shape: tuple[int, ...]) -> str:
    return "x".join(map(str, shape)) or "single"


def _where(place: Place) -> str:
    """A place in words, beginning with a blank."""
    words: list[str] = []
    if place.step is not None:
        words.append(f"step {place.step} (time {place.time:.6g})")
    words += [f"{name} {value}" for name, value in place.names.items()]
    if not words and place.index:
        words.append(f"index {', '.join(map(str, place.index))}")
    return f" at {', '.join(words)}" if words else ""


def _listed(item: Listed) -> str:
    """A line about what differs and is not judged."""
    texts = told_apart(*item.values)
    left, right = (
        "nothing" if value is None else f"`{text}`"
        for value, text in zip(item.values, texts, strict=True)
    )
    line = f" line {item.line}" if item.line else ""
    return f"listed     {printable(item.name)}{line}: {left} against {right}"


def _json(found: Difference, head: dict[str, Any], brief: bool) -> dict[str, Any]:
    """Everything for programs; numbers that JSON has none for are made plain later."""
    return {
        "verdict": "same" if found.same else "different",
        **head,
        "datasets": [_entry(c) for c in found.compared if not (brief and c.same)],
        "only_in_a": found.only[0],
        "only_in_b": found.only[1],
        "listed": [
            {"name": item.name, "a": item.values[0], "b": item.values[1], "line": item.line}
            for item in found.listed
        ],
    }


def _entry(found: Comparison) -> dict[str, Any]:
    """One dataset for programs."""
    a, b = found.layouts
    numbers = found.comparable and not a.holds_texts
    finite = numbers and math.isfinite(found.largest)
    values = found.values or (None, None)
    return {
        "name": found.path,
        "same": found.same,
        "shape_a": list(a.shape), "shape_b": list(b.shape),
        "dtype_a": a.kind, "dtype_b": b.kind,
        "largest_difference": found.largest if finite else None,
        "relative": found.relative if finite else None,
        "maximum": found.maximum if numbers else None,
        "scale": found.scale if numbers else None,
        "tolerance": found.tolerance if numbers else None,
        "differing": found.differing if found.comparable else None,
        "at": _place(found.at), "a": values[0], "b": values[1],
        "first": _place(found.first),
    }  # fmt: skip


def _place(place: Place | None) -> dict[str, Any] | None:
    if place is None:
        return None
    told = {"index": list(place.index), "step": place.step, "time": place.time}
    return {**told, **place.names}
