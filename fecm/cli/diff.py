"""``fecm diff``."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import click
from click import option

from fecm._inputs import parsed_toml
from fecm._text import printable
from fecm.cli.common import FAILED, echo, echo_json
from fecm.cli.isolation import reads
from fecm.cli.options import (
    FORMAT_OPTION,
    NAMED_PATH,
    NOT_NEGATIVE,
    Format,
    Parsed,
    assignment,
    collected,
    file_of,
    typical,
)
from fecm.results.diff import diff as compare


class Tolerances(NamedTuple):
    """Tolerances, patterns that are left out, and patterns with their own tolerances."""

    rtol: float | None = None
    atol: float | None = None
    exclude: tuple[str, ...] = ()
    own: tuple[tuple[str, tuple[float, ...]], ...] = ()


@dataclass(frozen=True)
class DiffOptions:
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
        """Return the tolerances of the options, or of the file where the options give none."""
        file = self.file or Tolerances()
        return Tolerances(
            rtol=file.rtol if self.rtol is None else self.rtol,
            atol=file.atol if self.atol is None else self.atol,
            exclude=(*file.exclude, *self.exclude),
            own=(*file.own, *self.own),
        )


def _tolerance(name: str, values: object) -> tuple[float, ...]:
    """Parse a relative tolerance, or a relative and an absolute tolerance."""
    parts: list[Any] = values if isinstance(values, list) else [values]
    try:
        numbers = tuple(float("" if isinstance(part, bool) else part) for part in parts)
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) not in (1, 2) or not all(0 <= number < math.inf for number in numbers):
        text = ",".join(map(str, parts))
        raise ValueError(f"{name}: `{text}` is not R or R,T with finite numbers from 0")
    return numbers


def _own(text: str) -> tuple[str, tuple[float, ...]]:
    """Parse pattern and tolerances of ``PATTERN=RTOL[,ATOL]``."""
    pattern, values = assignment(text)
    return pattern, _tolerance(pattern, values.split(","))


def _tolerances(text: str) -> Tolerances:
    """Parse the contents of a tolerance file."""
    tables = parsed_toml(text)
    if unknown := tables.keys() - {"rtol", "atol", "exclude", "tol"}:
        raise ValueError(f"{min(unknown)} is unknown; the keys are rtol, atol, exclude and tol")
    exclude, patterns = tables.get("exclude", []), tables.get("tol", {})
    if not isinstance(exclude, list) or not all(isinstance(name, str) for name in exclude):
        raise ValueError("exclude is not a list of texts")
    if not isinstance(patterns, dict):
        raise ValueError('tol is not a table; begin it with [tol], and give "NAME" = RTOL')
    rtol, atol = (
        _tolerance(name, [tables[name]])[0] if name in tables else None for name in ("rtol", "atol")
    )
    return Tolerances(
        rtol,
        atol,
        tuple(exclude),
        tuple((name, _tolerance(name, patterns[name])) for name in patterns),
    )


@click.command(
    "diff",
    epilog=typical(
        "fecm diff a.h5 b.h5 --rtol 1e-6",
        "fecm diff a.h5 tapes --only tape9/force",
    ),
)
@click.argument("a", type=NAMED_PATH)
@click.argument("b", type=NAMED_PATH)
@option(
    "--rtol",
    type=NOT_NEGATIVE,
    metavar="R",
    help="Relative tolerance, as a share of the dataset's largest absolute value.  [default: 0; "
    "for tapes one unit of the last digit]",
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
@collected(DiffOptions)
def diff_command(options: DiffOptions) -> None:
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
    difference = compare(
        options.a,
        options.b,
        asked.rtol,
        asked.atol,
        only=options.only,
        exclude=asked.exclude,
        tol=_by_pattern(asked.own),
    )
    if options.form is Format.JSON:
        echo_json(difference.to_dict(same=not options.brief))
    elif options.brief:
        echo("\n".join([*map(printable, difference.different), difference.verdict]))
    else:
        echo("\n".join(difference.lines()))
    if not difference.same:
        raise SystemExit(FAILED)


def _by_pattern(pairs: Iterable[tuple[str, tuple[float, ...]]]) -> dict[str, tuple[float, ...]]:
    """Return the tolerances by pattern, in the order in which each was given last."""
    latest: dict[str, tuple[float, ...]] = {}
    for pattern, values in pairs:
        latest.pop(pattern, None)
        latest[pattern] = values
    return latest
