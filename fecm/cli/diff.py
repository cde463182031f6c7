"""``fecm diff``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click
from click import option

from fecm._frozen import frozen
from fecm._inputs import parsed_toml
from fecm._text import printable, shown_apart
from fecm.cli.common import FAILED, echo_json
from fecm.cli.help import typical
from fecm.cli.isolation import reads
from fecm.cli.options import (
    FILE_PATH,
    FORMAT_OPTION,
    NOT_NEGATIVE,
    Format,
    Parsed,
    assignment,
    collected,
    file_of,
)
from fecm.results.diff import SCALE_NAMES, Comparison, Difference, difference


@frozen
class Tolerances:
    """Tolerances, patterns that are left out, and patterns with tolerances of their own."""

    rtol: float | None = None
    atol: float | None = None
    exclude: tuple[str, ...] = ()
    own: tuple[tuple[str, tuple[float, ...]], ...] = ()


@frozen
class Options:
    """Arguments and options of ``fecm diff``."""

    a: Path
    b: Path
    rtol: float | None
    atol: float | None
    only: tuple[str, ...]
    exclude: tuple[str, ...]
    own: tuple[tuple[str, tuple[float, ...]], ...]
    file: Tolerances | None
    brief: bool
    form: Format

    def tolerances(self) -> Tolerances:
        """Tolerances of the options, and of the file where they give none."""
        file = self.file or Tolerances()
        return Tolerances(
            rtol=file.rtol if self.rtol is None else self.rtol,
            atol=file.atol if self.atol is None else self.atol,
            exclude=(*file.exclude, *self.exclude),
            own=(*file.own, *self.own),
        )


def _tolerance(name: str, values: object) -> tuple[float, ...]:
    """Relative tolerance, or relative and absolute tolerance."""
    parts: list[Any] = values if isinstance(values, list) else [values]
    try:
        numbers = tuple(float("" if isinstance(part, bool) else part) for part in parts)
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) not in (1, 2) or not all(0 <= number < math.inf for number in numbers):
        given = ",".join(map(str, parts))
        raise ValueError(f"{name}: `{given}` is not R or R,T with finite numbers from 0")
    return numbers


def _own(text: str) -> tuple[str, tuple[float, ...]]:
    """Pattern and tolerances of ``PATTERN=RTOL[,ATOL]``."""
    pattern, values = assignment(text)
    return pattern, _tolerance(pattern, values.split(","))


def _tolerances(text: str) -> Tolerances:
    """Contents of a tolerance file."""
    given = parsed_toml(text)
    if unknown := given.keys() - {"rtol", "atol", "exclude", "tol"}:
        raise ValueError(f"{min(unknown)} is unknown; the keys are rtol, atol, exclude and tol")
    exclude, own = given.get("exclude", []), given.get("tol", {})
    if not isinstance(exclude, list) or not all(isinstance(name, str) for name in exclude):
        raise ValueError("exclude is not a list of texts")
    if not isinstance(own, dict):
        raise ValueError('tol is not a table; begin it with [tol], and give "NAME" = RTOL')
    rtol, atol = (
        _tolerance(name, [given[name]])[0] if name in given else None for name in ("rtol", "atol")
    )
    return Tolerances(
        rtol, atol, tuple(exclude), tuple((name, _tolerance(name, own[name])) for name in own)
    )


@click.command(
    epilog=typical(
        "fecm diff a.h5 b.h5 --rtol 1e-6",
        "fecm diff a.h5 tapes --only tape9/force",
    )
)
@click.argument("a", type=FILE_PATH)
@click.argument("b", type=FILE_PATH)
@option(
    "--rtol",
    type=NOT_NEGATIVE,
    metavar="R",
    help="Relative tolerance, of the dataset's largest absolute value.  [default: 0; of "
    "tapes their last digit]",
)
@option(
    "--atol",
    type=NOT_NEGATIVE,
    metavar="T",
    help="Absolute tolerance, in the dataset's unit.  [default: 0]",
)
@option(
    "--only",
    multiple=True,
    metavar="PATTERN",
    help="Compare only this dataset (tape9/force), group (tape9) or pattern ('tape?/force'); "
    "may be repeated.",
)
@option(
    "--exclude",
    multiple=True,
    metavar="PATTERN",
    help="Leave out a dataset, group or pattern; may be repeated.",
)
@option(
    "--tol",
    "own",
    type=Parsed(_own, "PATTERN=R[,T]"),
    multiple=True,
    help="Tolerances of a dataset, group or pattern instead of --rtol and --atol; may be "
    "repeated, and the last one that matches applies.",
)
@option(
    "--tol-file",
    "file",
    type=file_of(_tolerances),
    help="File of these tolerances, with the keys rtol, atol, exclude and tol; options go "
    "before it.",
)
@option("--brief", is_flag=True, help="Print only names of differences and the verdict.")
@FORMAT_OPTION
@reads("a", "b")
@collected(Options)
def diff(options: Options) -> None:
    """Compare two results dataset by dataset.

    A and B are result files or folders of tapes, or both results of sweeps.

    Two numbers are equal if |a - b| <= T + R * max, where max is the largest absolute value of the
    entire dataset; for energy/balance_error it is the energy put in, for laminate/B the square root
    of the largest A times the largest D, for indentation the largest one in contact.  NaN equals
    NaN, and an infinity the same infinity.  Integers (steps, node numbers) must be equal at
    any tolerance.  A dataset that only A or B has, or that has another shape or type, is a
    difference.  Differing titles, modes, slips, other attributes and decks are only listed.

    A folder of tapes holds tape3, tape8 and tape9 (or tape3.txt etc.) as `fecm tapes` or the
    original program wrote them, in either order.  Only datasets of tapes are then compared, by
    default to one unit of the last of their four digits.

    Exit status: 0 equal, 1 different, 2 unusable file or call.
    """
    asked = options.tolerances()
    found = difference(
        options.a, options.b, asked.rtol, asked.atol, options.only, asked.exclude, asked.own
    )
    if options.form is Format.JSON:
        echo_json(_document(found, asked, options))
    else:
        click.echo("\n".join(_page(found, asked, brief=options.brief)))
    if not found.same:
        raise SystemExit(FAILED)


def _document(found: Difference, asked: Tolerances, options: Options) -> dict[str, Any]:
    """JSON of a comparison."""
    shown = [c for c in found.compared if not (options.brief and c.same)]
    return {
        "verdict": "same" if found.same else "different",
        "a": printable(str(options.a)),
        "b": printable(str(options.b)),
        "rtol": asked.rtol or 0.0,
        "atol": asked.atol or 0.0,
        "last_digit": found.to_last_digit,
        "tol": dict(asked.own),
        "datasets": [_entry(comparison) for comparison in shown],
        "only_in_a": found.only[0],
        "only_in_b": found.only[1],
        "excluded": found.excluded,
        "listed": found.listed,
    }


def _page(found: Difference, asked: Tolerances, *, brief: bool) -> list[str]:
    """Lines about a comparison; the last one is the verdict."""
    different = [c.path for c in found.compared if not c.same] + [*found.only[0], *found.only[1]]
    lines = list(map(printable, sorted(different))) if brief else _lines(found)
    count = len(found.compared) + len(found.only[0]) + len(found.only[1])
    compared = f"{count} dataset{'s' * (count != 1)}"
    within = f"rtol {asked.rtol or 0.0:g}, atol {asked.atol or 0.0:g}"
    if found.to_last_digit:
        within = "the last digit of the tapes"
    if asked.own:
        within += ", --tol"
    if found.excluded:
        within += f"; {len(found.excluded)} excluded"
    if found.same:
        return [*lines, f"same: {compared} within {within}"]
    return [*lines, f"different: {len(different)} of {compared} at {within}"]


def _lines(found: Difference) -> list[str]:
    """One line per dataset, then what is listed."""
    rows = {c.path: ("same" if c.same else "different", _describe(c)) for c in found.compared}
    for source, names in zip("AB", found.only, strict=True):
        rows.update(dict.fromkeys(names, (f"only in {source}", "")))
    width = max((len(printable(name)) for name in rows), default=0)
    lines = [
        f"{word:10} {printable(name):{width}}  {text}".rstrip()
        for name, (word, text) in sorted(rows.items())
    ]
    for item in found.listed:
        values = item["a"], item["b"]
        left, right = (
            "nothing" if value is None else f"`{text}`"
            for value, text in zip(values, shown_apart(*values), strict=True)
        )
        line = f" line {item['line']}" if item["line"] else ""
        lines.append(f"listed     {printable(item['name'])}{line}: {left} against {right}")
    return lines


def _describe(found: Comparison) -> str:
    """Shapes and types that differ, largest difference, number of differences and first one."""
    parts: list[str] = []
    if found.shapes[0] != found.shapes[1]:
        left, right = ("x".join(map(str, shape)) or "single" for shape in found.shapes)
        parts.append(f"shape {left} against {right}")
    if found.types[0] != found.types[1]:
        parts.append(f"type {found.types[0]} against {found.types[1]}")
    if found.at and found.values:
        quote = "`" if found.holds_texts else ""
        left, right = (f"{quote}{value}{quote}" for value in shown_apart(*found.values))
        text = f"{left} against {right}{_where(found.at)}"
        if math.isfinite(found.largest):
            name = SCALE_NAMES.get(found.path, "") if found.scale != found.maximum else ""
            share = f"{found.relative:.2g} of {name or 'max'} {found.scale:.6g}"
            text = f"largest {found.largest:.3g} ({share}), {text}"
        parts.append(text)
    if found.differing:
        noun = "text" if found.holds_texts else "number"
        parts.append(f"{found.differing} {noun}{'s differ' if found.differing > 1 else ' differs'}")
    if found.first:
        parts.append(f"first{_where(found.first)}")
    return "; ".join(parts)


def _where(place: dict[str, Any]) -> str:
    """A place in words, with a leading blank."""
    words: list[str] = []
    if place["time"] is not None:
        words.append(f"step {place['step']} (time {place['time']:.6g})")
    words += [f"{n} {value}" for n, value in place.items() if n not in ("index", "step", "time")]
    if place["step"] is not None and place["time"] is None:  # an index of a sweep's histories
        words.append(f"step {place['step']}")
    if not words and place["index"]:
        words.append(f"index {', '.join(map(str, place['index']))}")
    return f" at {', '.join(words)}" if words else ""


def _entry(found: Comparison) -> dict[str, Any]:
    """JSON of one dataset."""
    numbers = found.comparable and not found.holds_texts
    finite = numbers and math.isfinite(found.largest)
    values = found.values or (None, None)
    return {
        "name": found.path,
        "same": found.same,
        "shape_a": list(found.shapes[0]),
        "shape_b": list(found.shapes[1]),
        "dtype_a": found.types[0],
        "dtype_b": found.types[1],
        "largest_difference": found.largest if finite else None,
        "relative": found.relative if finite else None,
        "maximum": found.maximum if numbers else None,
        "scale": found.scale if numbers else None,
        "tolerance": found.tolerance if numbers else None,
        "differing": found.differing if found.comparable else None,
        "at": found.at,
        "a": values[0],
        "b": values[1],
        "first": found.first,
    }
