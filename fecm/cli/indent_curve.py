"""``fecm indent curve``: forces and rigidities by the law of a deck."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from fecm.cli.common import DECK_PATH, RefusedError, echo, note
from fecm.cli.outputs import OutputPaths, outputs
from fecm.cli.types import NOT_NEGATIVE, POSITIVE, Finite, ListOf
from fecm.deck.catalogue import ALPHA_CR, ALPHA_P, S_P, SYSTEM, SYSTEMS, convert
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
from fecm.problem.build import build_constants
from fecm.problem.check_impact import check_law


def _law(deck: Path) -> tuple[Deck, Indentation]:
    """First problem of a deck that has an EXPE segment, and the segment."""
    reader = Reader(load_text(deck)[0])
    problems = [problem.deck for problem in reader.problems() if problem.deck is not None]
    laws = [(one, law) for one in problems if (law := one.last(Indentation)) is not None]
    if laws:
        check_law(laws[0][1], reader.findings)
    for finding in reader.findings:
        echo(finding.render(str(deck)), err=True)
    if reader.findings.errors:
        raise RefusedError(f"{deck} has errors")
    if not laws:
        raise RefusedError(f"{deck} has no indentation law: it has no EXPE segment")
    return laws[0]


@click.command()
@click.argument("deck", type=DECK_PATH)
@click.option("--path", type=ListOf("A,B,C,...", Finite()), metavar="A,B,C,...",
              help="Indentations at which the path turns, from 0; with --rigidity the range "
                   "FROM,TO of alpha_m.")  # fmt: skip
@click.option("--points", type=click.IntRange(min=1, max=100_000), default=100, show_default=True,
              help="Points between two turns.")  # fmt: skip
@click.option("--rigidity", is_flag=True,
              help="Tabulate the unloading rigidity s over alpha_m by equations 3-9 and 3-7 "
                   "instead.")  # fmt: skip
@click.option("--q", type=POSITIVE,
              help="With --rigidity: power of 3-9.  [default: the deck's]")  # fmt: skip
@click.option("--alpha-cr", type=POSITIVE,
              help="With --rigidity: alpha_cr of 3-7.  [default: the deck's, or the report's]",
              )  # fmt: skip
@click.option("--line", type=ListOf("ALPHA_P,S_P", NOT_NEGATIVE, [2]), metavar="ALPHA_P,S_P",
              help="With --rigidity: parameters of 3-8.  [default: the deck's, or the report's]",
              )  # fmt: skip
@outputs("deck")
def curve(
    deck: Path,
    path: tuple[float, ...] | None,
    points: int,
    rigidity: bool,
    targets: OutputPaths,
    **parameters: Any,
) -> None:
    """Write the force along an indentation path, by the law of DECK, as CSV.

    The columns are indentation, force and the branch of the law; with --rigidity alpha_m, s_3_9 and
    s_3_7.
    """
    if rigidity:
        _rigidities(deck, path, points, targets, **parameters)
    elif not path:
        raise click.UsageError("--path is missing: indentations separated by commas")
    elif any(value is not None for value in parameters.values()):
        raise click.UsageError("--q, --alpha-cr and --line require --rigidity")
    else:
        _forces(deck, path, points, targets)


def _forces(deck: Path, path: Sequence[float], points: int, targets: OutputPaths) -> None:
    """Write indentation, force and branch along a path."""
    problem, card = _law(deck)
    law = HystereticLaw(build_constants(card))
    try:
        walk = list(follow(law, path, points))
    except OverflowError:
        walk = []
    if not walk or not all(math.isfinite(point.force) for point, _ in walk):
        raise RefusedError("the forces along --path overflow")
    columns = np.array([point for point, _ in walk]).T
    targets.draw("indentation:path_picture", *columns, unit_names(problem))
    branches = ("loading", "unloading", "reloading")
    rows = ((point.indentation, point.force, branches[branch]) for point, branch in walk)
    targets.write("indentation,force,branch", rows)


def _rigidities(
    deck: Path,
    path: Sequence[float] | None,
    points: int,
    targets: OutputPaths,
    *,
    q: float | None,
    alpha_cr: float | None,
    line: tuple[float, float] | None,
) -> None:
    """Write largest indentations and rigidities by both equations."""
    if path and (len(path) != 2 or not 0.0 <= path[0] < path[1]):
        raise click.BadParameter("with --rigidity the range FROM,TO", param_hint="--path")
    if line is not None and line[1] >= 1.0:
        raise click.BadParameter("s_p must be below 1", param_hint="--line")
    problem, card = _law(deck)
    own = build_constants(card)
    alpha_p, s_p = line or _line(problem, own)
    critical = YangSunPermanent(card.k, alpha_cr or _alpha_cr(problem, own))
    slope = LinearPermanent(card.k, alpha_p, s_p, own.q if q is None else q)
    if slope.q != ACR_POWER:
        units = f"s of 3-9 is force/length^{slope.q:g} here, that of 3-7 force/length^2.5"
        if targets.picture:
            raise RefusedError(f"{units}: they can't share axes; --q 2.5 makes them comparable")
        note(f"{units}: --q 2.5 makes them comparable")
    low, high = path or (0.0, 2.0 * max(critical.alpha_cr, slope.alpha_p))
    peaks = np.linspace(low, high, points + 1)
    peaks = peaks[peaks > 0.0]
    with np.errstate(all="ignore"):
        by = [np.asarray(relation.rigidity(peaks)) for relation in (slope, critical)]
    if not np.all(np.isfinite(by)):
        raise RefusedError("the rigidities along --path overflow")
    named = dict(zip(("equation 3-9", "equation 3-7"), by, strict=True))
    targets.draw("indentation:rigidity_picture", peaks, named, slope.q, unit_names(problem))
    targets.write("alpha_m,s_3_9,s_3_7", np.column_stack([peaks, *by]).tolist())


def _report_length(deck: Deck, value: float, name: str, option: str) -> float:
    """Convert a length of the report to the deck's unit, by default inches, and note it."""
    unit = unit_names(deck).get("length", "in")
    system = {names["length"]: key for key, names in SYSTEMS.items()}.get(unit)
    if system is None:
        raise RefusedError(
            f"the report's {name} is in inches and the deck's in {unit}: give {option}"
        )
    note(f"{name} is the report's {value:g} in; {option} replaces it")
    return convert(value, "length", SYSTEM, system)


def _alpha_cr(deck: Deck, own: ContactParameters) -> float:
    """alpha_cr of the deck, or of the report."""
    if isinstance(own, YangSunPermanent):
        return float(own.alpha_cr)
    return _report_length(deck, ALPHA_CR, "alpha_cr", "--alpha-cr")


def _line(deck: Deck, own: ContactParameters) -> tuple[float, float]:
    """alpha_p and s_p of the deck, or of the report."""
    if isinstance(own, LinearPermanent):
        return float(own.alpha_p), float(own.s_p)
    return _report_length(deck, ALPHA_P, "alpha_p", "--line"), S_P
