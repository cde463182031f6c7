"""``fecm indent curve``: forces and rigidities by the law of a deck."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from fecm.cli.common import DECK_PATH, RefusedError
from fecm.cli.outputs import OUTPUT, OVERWRITE, PLOT, OutputPaths
from fecm.cli.types import POSITIVE
from fecm.deck.catalogue import ALPHA_CR, ALPHA_P, S_P, SYSTEM, SYSTEMS, lengths
from fecm.deck.model import Deck, Indentation
from fecm.deck.reader import Reader, load_text
from fecm.deck.units import unit_names
from fecm.mechanics.contact_law import (
    ACR_POWER,
    ContactParameters,
    HystereticLaw,
    LinearPermanent,
    YangSunPermanent,
    follow,
)
from fecm.plot.kinds import Picture
from fecm.problem.build import build_constants
from fecm.problem.check_impact import check_law


def _path(text: str | None) -> list[float]:
    """Corners of a path."""
    try:
        corners = [] if text is None else [float(part) for part in text.split(",")]
    except ValueError:
        corners = [math.nan]
    if not all(map(math.isfinite, corners)):
        raise click.BadParameter(f"{text} is not of the form A,B,C", param_hint="--path")
    return corners


def _law(deck: Path) -> tuple[Deck, Indentation]:
    """The first problem of a deck that has an EXPE segment, and the segment."""
    reader = Reader(load_text(deck)[0])
    problems = [problem.deck for problem in reader.problems() if problem.deck is not None]
    laws = [(one, law) for one in problems if (law := one.last(Indentation)) is not None]
    if laws:
        check_law(laws[0][1], reader.findings)
    for finding in reader.findings:
        click.echo(finding.render(str(deck)), err=True)
    if reader.findings.errors:
        raise RefusedError(f"{deck} has errors")
    if not laws:
        raise RefusedError(f"{deck} has no EXPE segment, and so no indentation law")
    return laws[0]


@click.command()
@click.argument("deck", type=DECK_PATH)
@click.option("--path", "corners", metavar="A,B,C,...",
              help="Indentations between which the path goes straight, from 0 on; with --rigidity "
                   "the range.")  # fmt: skip
@click.option("--points", type=click.IntRange(min=1, max=100_000), default=100, show_default=True,
              help="Points from one corner to the next.")  # fmt: skip
@click.option("--rigidity", is_flag=True,
              help="Unloading rigidity s against alpha_m by equations 3-9 and 3-7 instead.",
              )  # fmt: skip
@click.option("--q", type=POSITIVE, help="With --rigidity: power of 3-9, instead of the deck's.")
@click.option("--alpha-cr", type=POSITIVE,
              help="With --rigidity: alpha_cr of 3-7.  [default: the deck's, or the report's]",
              )  # fmt: skip
@click.option("--line", metavar="ALPHA_P,S_P",
              help="With --rigidity: constants of 3-8.  [default: the deck's, or the report's]",
              )  # fmt: skip
@OUTPUT
@PLOT
@OVERWRITE
def curve(
    deck: Path,
    corners: str | None,
    points: int,
    rigidity: bool,
    output: Path,
    picture: Path | None,
    overwrite: bool,
    **constants: Any,
) -> None:
    """Write the force along an indentation path, by the law of DECK, as CSV.

    Columns are indentation, force and the branch of the law; with --rigidity alpha_m, s_3_9 and
    s_3_7.
    """
    path = _path(corners)
    targets = OutputPaths.checked(output, picture, overwrite, deck)
    if not rigidity:
        if not path:
            raise click.UsageError("--path is missing: indentations with commas between them")
        if any(value is not None for value in constants.values()):
            raise click.UsageError("--q, --alpha-cr and --line belong to --rigidity")
    made = _rigidities if rigidity else _forces
    rows, draw = made(deck, path, points, picture is not None, **constants)
    targets.draw(draw)
    targets.write(f"{','.join(map(_cell, row))}\n" for row in rows)


def _cell(value: float | str) -> str:
    return value if isinstance(value, str) else repr(float(value))


Rows = Iterable[Sequence[float | str]]


def _forces(
    deck: Path, path: list[float], points: int, draws: bool, **_: Any
) -> tuple[Rows, Callable[[], Picture]]:
    """Indentation, force and branch along a path, and how they are drawn."""
    problem, card = _law(deck)
    law = HystereticLaw(build_constants(card))
    try:
        walk = list(follow(law, path, points))
    except OverflowError:
        walk = []
    if not walk or not all(math.isfinite(point.force) for point, _ in walk):
        raise RefusedError("--path leads to forces beyond the range of numbers")
    names = ("loading", "unloading", "reloading")
    rows: list[Sequence[float | str]] = [("indentation", "force", "branch")]
    rows += [(point.indentation, point.force, names[branch]) for point, branch in walk]

    def draw() -> Picture:
        from fecm.plot.indentation import path_picture

        columns = np.array([point for point, _ in walk])
        return path_picture(columns[:, 0], columns[:, 1], unit_names(problem))

    return rows, draw


def _rigidities(
    deck: Path,
    path: list[float],
    points: int,
    draws: bool,
    *,
    q: float | None,
    alpha_cr: float | None,
    line: str | None,
) -> tuple[Rows, Callable[[], Picture]]:
    """Largest indentation and rigidities by both equations, and how they are drawn."""
    if path and (len(path) != 2 or not 0.0 <= path[0] < path[1]):
        raise click.BadParameter("with --rigidity the range FROM,TO", param_hint="--path")
    problem, card = _law(deck)
    own = build_constants(card)
    alpha_p, s_p = _line(problem, own, line)
    critical = YangSunPermanent(card.k, _alpha_cr(problem, own, alpha_cr))
    slope = LinearPermanent(card.k, alpha_p, s_p, own.q if q is None else q)
    if slope.q != ACR_POWER and draws:
        raise RefusedError(
            f"s of 3-9 is force/length^{slope.q:g} here, that of 3-7 force/length^2.5: they can't "
            "share axes; --q 2.5 makes them comparable"
        )
    if slope.q != ACR_POWER:
        click.echo(
            f"fecm: note: s of 3-9 is force/length^{slope.q:g} here, that of 3-7 "
            "force/length^2.5: --q 2.5 makes them comparable",
            err=True,
        )
    low, high = path or [0.0, 2.0 * max(critical.alpha_cr, slope.alpha_p)]
    peaks = np.linspace(low, high, points + 1)
    peaks = peaks[peaks > 0.0]
    with np.errstate(all="ignore"):
        by = [np.asarray(relation.rigidity(peaks)) for relation in (slope, critical)]
    if not np.all(np.isfinite(by)):
        raise RefusedError("--path leads to rigidities beyond the range of numbers")
    rows: list[Sequence[float | str]] = [("alpha_m", "s_3_9", "s_3_7")]
    rows += list(zip(peaks, *by, strict=True))

    def draw() -> Picture:
        from fecm.plot.indentation import rigidity_picture

        named = dict(zip(("equation 3-9", "equation 3-7"), by, strict=True))
        return rigidity_picture(peaks, named, slope.q, unit_names(problem))

    return rows, draw


def _report_length(deck: Deck, value: float, what: str, option: str) -> float:
    """A length of the report in a deck's unit; without a unit the report's, and a note of it."""
    name = unit_names(deck).get("length", "in")
    system = {names[0]: key for key, (names, _) in SYSTEMS.items()}.get(name)
    if system is None:
        raise RefusedError(
            f"the report's {what} is in inches and the deck's in {name}: give {option}"
        )
    click.echo(f"fecm: note: {what} is the report's {value:g} in; {option} gives another", err=True)
    return value * (1.0 if system == SYSTEM else lengths(system))


def _alpha_cr(deck: Deck, own: ContactParameters, given: float | None) -> float:

    if given is not None:
        return given
    if isinstance(own, YangSunPermanent):
        return float(own.alpha_cr)
    return _report_length(deck, ALPHA_CR, "alpha_cr", "--alpha-cr")


def _line(deck: Deck, own: ContactParameters, given: str | None) -> tuple[float, float]:
    """alpha_p and s_p."""
    if given is not None:
        values = _path(given)
        if len(values) != 2 or values[0] < 0.0 or not 0.0 <= values[1] < 1.0:
            raise click.BadParameter("alpha_p and s_p, s_p below 1", param_hint="--line")
        return values[0], values[1]
    if isinstance(own, LinearPermanent):
        return float(own.alpha_p), float(own.s_p)
    return _report_length(deck, ALPHA_P, "alpha_p", "--line"), S_P
