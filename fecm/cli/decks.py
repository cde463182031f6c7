"""``fecm check`` and ``fecm fmt``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import click

from fecm._files import check_outputs
from fecm.api import LoadedDeck, load_deck
from fecm.cli.common import (
    DECK_PATH,
    FORMAT_OPTION,
    MODE_OPTION,
    CheckFailedError,
    RefusedError,
    echo,
    echo_file,
    progress,
    write_text,
)
from fecm.deck.findings import DeckError, Finding
from fecm.deck.format import format_deck
from fecm.deck.reader import load_text
from fecm.deck.units import unit_names, unit_of
from fecm.problem.options import RunOptions
from fecm.problem.problem import Problem
from fecm.problem.slips import REPORT, active_slips
from fecm.problem.summary import summarise


def count_errors(errors: Sequence[Finding]) -> str:
    """Say how many errors a deck has."""
    count = sum(error.code != "E000" for error in errors)
    more = " or more" if count < len(errors) else ""
    return f"the deck has {count} error{'s' if count != 1 else ''}{more}"


def load_valid(
    deck: Path,
    otherwise: str = "",
    mode: str = REPORT,
    *,
    force: bool = True,
    warnings: bool = True,
) -> LoadedDeck:
    """Load a deck and print its findings on standard error.

    Parameters
    ----------
    deck : Path
    otherwise : str
        End of the message if the deck has errors.
    mode : str
    force : bool
        Whether errors that `--force` permits are permitted.
    warnings : bool
        Whether warnings are printed too.

    Raises
    ------
    RefusedError
        If the deck has errors.
    """
    loaded = load_deck(deck, mode)
    errors = loaded.errors(force)
    for finding in loaded.findings if warnings else errors:
        echo(finding.render(loaded.source), err=True)
    if errors:
        raise RefusedError(count_errors(errors) + otherwise)
    return loaded


@click.command(short_help="Check DECK without running it, and summarise it.")
@click.argument("deck", type=DECK_PATH)
@MODE_OPTION
@FORMAT_OPTION
@click.option("--mesh-error", is_flag=True,
              help="Run DECK twice, with its elements and with those around the load bisected, and "
                   "compare the peak forces.")  # fmt: skip
def check(deck: Path, mode: str, form: str, mesh_error: bool) -> None:
    """Check DECK without running it; print its findings and a summary.

    With --format json, each finding and each problem is a JSON object on a line.  The exit status
    is 1 if the deck has errors.
    """
    prepared = load_deck(deck, mode)
    errors = prepared.errors()
    views = [] if errors else [summarise(problem) for problem in prepared.problems]
    if form == "json":
        for finding in prepared.findings:
            click.echo(json.dumps(finding.to_dict(str(deck))))
        for view in views:
            click.echo(json.dumps({"kind": "summary", **view.to_dict()}))
    else:
        for finding in prepared.findings:
            echo(finding.render(str(deck)))
        for view in views:
            echo("\n".join(view.lines()))
    if errors:
        raise CheckFailedError(count_errors(errors))
    if mesh_error:
        _compare_meshes(prepared.problems, mode, form)


def _compare_meshes(problems: Sequence[Problem], mode: str, form: str) -> None:
    """Print the mesh error of the peak force of every problem."""
    from fecm.sweeps.mesh_error import bisected, mesh_error

    for problem in problems:
        units = unit_names(problem.deck)
        force, length = (unit_of(name, units) for name in ("force", "length"))
        fine = bisected(problem)
        with progress("fecm", problem.work.steps + fine.work.steps) as advance:
            found = mesh_error(problem, fine, RunOptions(active_slips(mode, ())), advance)
        if form == "json":
            changes = {"change": found.change, "relative_change": found.relative_change}
            click.echo(json.dumps(
                {"kind": "mesh_error", **found.__dict__, **changes, "units": units}
            ))  # fmt: skip
            continue
        share = found.relative_change
        about = "no contact" if share is None else f"{share:+.2%}"
        for line in (
            f"peak force          {found.peak_force:.5g} {force}".rstrip()
            + f" on {found.elements} elements",
            f"  bisected          {found.refined_peak_force:.5g} {force}".rstrip()
            + f" on {found.refined_elements}, within {found.distance:.3g} {length}".rstrip()
            + " of the load",
            f"  change            {found.change:+.3g} {force}".rstrip() + f" ({about})",
        ):
            echo(f"  {line}")


@click.command(short_help="Align the columns of DECK.")
@click.argument("deck", type=DECK_PATH)
@click.option("-o", "--output", type=click.Path(path_type=Path, allow_dash=True), metavar="FILE",
              help="File to write; - is standard output.  [default: DECK itself]")  # fmt: skip
@click.option("--check", "only_check", is_flag=True,
              help="Write nothing; exit with 1 if the deck would change.")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace an existing FILE other than DECK.")
def fmt(deck: Path, output: Path | None, only_check: bool, overwrite: bool) -> None:
    """Align the columns of DECK and put a ruler above each kind of card.

    The model, comments and blank cards stay as they are.
    """
    target = deck if output is None or _same(output, deck) else output
    in_place = target is deck
    if not only_check and str(target) != "-":
        check_outputs([target], overwrite or in_place, [] if in_place else [deck])
    before, _ = load_text(deck)
    try:
        after = format_deck(before, str(deck))
    except DeckError as error:
        echo(error, err=True)
        raise RefusedError("the deck can't be read; nothing was written") from None
    if only_check:
        if after != before:
            raise CheckFailedError(f"{deck} would change")
    elif str(target) == "-":
        echo_file(after)
    else:
        write_text(target, after, overwrite=overwrite or in_place)


def _same(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file."""
    return one.exists() and one.samefile(other)
