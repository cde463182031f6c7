"""``fecm check`` and ``fecm fmt``."""

from __future__ import annotations

import contextlib
import io
import math
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

import click
from click import option

from fecm._errors import FecmError
from fecm._files import check_outputs
from fecm._text import printable
from fecm._version import __version__
from fecm.cli.common import (
    DASH,
    CheckFailedError,
    RefusedError,
    echo,
    echo_findings,
    echo_json,
    echo_lines,
    note,
    progress,
    write_text,
)
from fecm.cli.options import FILE_PATH, MODE_OPTION, Format, format_option, typical
from fecm.deck.findings import DeckError, Finding
from fecm.deck.reader import load_text
from fecm.deck.units import unit_names, unit_of
from fecm.judge.criteria import spelt
from fecm.listing.slips import REPORT, active_slips
from fecm.problem.build import RunOptions
from fecm.problem.deck_check import check_loaded
from fecm.problem.loading import LoadedDeck, load_deck, sole
from fecm.problem.problem import Problem


def count_findings(findings: Sequence[Finding]) -> str:
    """Say how many errors, or how many warnings, a deck has."""
    count = sum(finding.code[1:] != "000" for finding in findings)
    more = " or more" if count < len(findings) else ""
    return f"the deck has {count} {findings[0].severity}{'s' if count != 1 else ''}{more}"


def load_valid(
    deck: Path,
    otherwise: str = "",
    mode: str = REPORT,
    *,
    force: bool = True,
    warnings: bool = True,
) -> list[Problem]:
    """Return the problems of a deck; its findings go to standard error.

    Without `warnings` only errors are printed. With `force`, errors that `--force` permits are
    permitted. Raises RefusedError, whose message ends with `otherwise`, if the deck has other
    errors.
    """
    loaded = load_deck(deck, mode)
    errors = loaded.errors(force)
    echo_findings(loaded.findings if warnings else errors, loaded.source)
    if errors:
        raise RefusedError(count_findings(errors) + otherwise)
    return loaded.problems


@contextlib.contextmanager
def refusing_errors(otherwise: str = "") -> Iterator[None]:
    """Print the findings of a deck with errors, and raise RefusedError; see :func:`load_valid`."""
    try:
        yield
    except DeckError as error:
        echo_findings(error.findings, error.source)
        errors = [finding for finding in error.findings if finding.severity == "error"]
        raise RefusedError(count_findings(errors) + otherwise) from None


def load_single(deck: Path) -> Problem:
    """Return the only problem of a deck; raises as :func:`load_valid`, or OptionsError."""
    return sole(load_valid(deck), deck)


DECK_OR_DASH = click.Path(exists=True, dir_okay=False, allow_dash=True, path_type=Path)
DECKS = click.argument("decks", nargs=-1, required=True, metavar="DECK...", type=DECK_OR_DASH)


def _input(deck: Path) -> Path | BinaryIO:
    """Return a file to read, or standard input for ``-``."""
    if deck != DASH:
        return deck
    piped: BinaryIO = getattr(sys.stdin, "buffer", None) or io.BytesIO()
    return piped


def _failures(decks: Sequence[Path], work: Callable[[Path], None]) -> list[Exception]:
    """Apply a function to every deck, and return the errors.

    The worst exit status of the errors is the status of the command.
    """
    failed: list[Exception] = []
    for deck in dict.fromkeys(decks):
        try:
            work(deck)
        except (FecmError, OSError) as error:
            failed.append(error)
    return failed


@click.command(
    "check",
    short_help="Check decks without running them, and summarise them.",
    epilog=typical(
        "fecm check impact-patch.inp",
        "fecm check impact-patch.inp --mesh-error --strict",
    ),
)
@DECKS
@MODE_OPTION
@format_option(*Format, about="Text for people, JSON for programs, or SARIF for code hosts.")
@option("--strict", is_flag=True, help="Exit with 1 for warnings too.")
@option(
    "--mesh-error",
    is_flag=True,
    help="Run DECK twice, with its elements and with those around the load bisected, and "
    "compare the peak forces.",
)
def check_command(
    decks: tuple[Path, ...], mode: str, form: Format, strict: bool, mesh_error: bool
) -> None:
    """Check decks without running them; print their findings and a summary.

    A DECK of - is standard input.  With several decks, each deck that passes has one line instead
    of a summary.  With --format json, each finding and each problem is a JSON object on a line.
    The exit status is the worst of all decks: 1 if one has errors, 2 if one can't be read.
    """
    if mesh_error and form is Format.SARIF:
        raise click.UsageError("--mesh-error has no form in SARIF")
    checked: dict[Path, list[Finding]] = {}

    def one(deck: Path) -> None:
        prepared = load_deck(_input(deck), mode)
        checked[Path(prepared.source)] = prepared.findings
        severe = ("error", "warning") if strict else ("error",)
        wrong = [finding for finding in prepared.findings if finding.severity in severe]
        name = f"{prepared.source}: " if len(decks) > 1 else ""
        _print(prepared, form, brief=bool(name), passes=not wrong)
        if wrong:
            raise CheckFailedError(name + count_findings(prepared.errors() or wrong))
        if mesh_error:
            _compare_meshes(prepared, mode, form)

    failed = _failures(decks, one)
    if form is Format.SARIF:
        unread = [str(error) for error in failed if not isinstance(error, CheckFailedError)]
        echo_json(_sarif(checked, unread))
    if failed:
        raise ExceptionGroup("errors of decks", failed)


def _print(prepared: LoadedDeck, form: Format, *, brief: bool, passes: bool) -> None:
    """Print findings and, if there are no errors, a summary or one line."""
    if form is Format.JSON:
        for values in check_loaded(prepared).to_dicts():
            echo_json(values)
    elif form is Format.TEXT:
        echo_findings(prepared.findings, prepared.source, err=False)
        if not brief:
            for problem in check_loaded(prepared).problems:
                echo_lines(problem.lines)
        elif passes:
            counts = Counter(finding.severity for finding in prepared.findings)
            counted = [f"{n} {word}{'s' * (n != 1)}" for word, n in counts.items()]
            echo(f"{printable(prepared.source)}: {', '.join(counted) or 'no findings'}")


def _compare_meshes(prepared: LoadedDeck, mode: str, form: Format) -> None:
    """Print the mesh error of the peak force of every problem."""
    # 28 ms, which a check without --mesh-error does not need.
    from fecm.sweeps.mesh_error import bisected, compare_peaks

    for problem in prepared.problems:
        units = unit_names(problem.deck)
        force, length = (unit_of(name, units) for name in ("force", "length"))
        fine = bisected(problem)
        with progress("fecm", problem.work.steps + fine.work.steps) as advance:
            estimate = compare_peaks(problem, fine, RunOptions(active_slips(mode, ())), advance)
        if form is Format.JSON:
            changes = {"change": estimate.change, "relative_change": estimate.relative_change}
            head = {"kind": "mesh_error", "file": prepared.source}
            echo_json({**head, **vars(estimate), **changes, "units": units})
            continue
        share = estimate.relative_change
        about = "no contact" if share is None else f"{share:+.2%}"
        coarse, refined = (
            f"{peak:.5g} {force}".rstrip()
            for peak in (estimate.peak_force, estimate.refined_peak_force)
        )
        near = f"within {estimate.distance:.3g} {length}".rstrip()
        change = f"{estimate.change:+.3g} {force}".rstrip()
        label = "largest force so far" if estimate.undecided else "peak force"
        echo(f"  {label:22}{coarse} on {estimate.elements} elements")
        echo(
            f"    bisected            {refined} on {estimate.refined_elements}, {near} of the load"
        )
        echo(f"    change              {change} ({about})")
        for criterion, exposure in estimate.exposures.items():
            finer = estimate.refined_exposures.get(criterion, math.nan)
            change = f" ({finer / exposure - 1.0:+.1%})" if exposure else ""
            values = f"{exposure:.4g}, bisected {finer:.4g}{change}"
            echo(f"  exposure            {spelt(criterion)} {values}")
        if estimate.undecided:
            note("a run ends before its peak: these forces are lower bounds; take more steps")


SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
HOME = "https://fecm.readthedocs.io"


def _sarif(checked: Mapping[Path, Sequence[Finding]], failures: Sequence[str]) -> dict[str, Any]:
    """Return SARIF 2.1.0: findings by deck, and messages about decks that could not be read."""
    # 0.3 ms, for the text of the reader's rules, which only SARIF shows.
    from fecm.problem.findings_page import RULES

    severities = {f.code: f.severity for findings in checked.values() for f in findings}
    codes = sorted(severities)
    rules = [
        {
            "id": code,
            "helpUri": f"{HOME}/page/findings.html#{code.lower()}",
            "shortDescription": {"text": RULES[code].summary},
            "fullDescription": {"text": f"{RULES[code].summary} {RULES[code].cause}".strip()},
            "help": {"text": RULES[code].remedy, "markdown": RULES[code].remedy},
            "defaultConfiguration": {"level": severities[code]},
        }
        for code in codes
    ]
    driver = {"name": "fecm", "version": __version__, "informationUri": HOME, "rules": rules}
    notifications = [{"level": "error", "message": {"text": text}} for text in failures]
    called = {"executionSuccessful": not failures, "toolExecutionNotifications": notifications}
    results = [
        {
            "ruleId": f.code,
            "ruleIndex": codes.index(f.code),
            "level": f.severity,
            "message": {"text": _text(f)},
            "locations": [{"physicalLocation": _location(deck, f)}],
        }
        for deck, findings in checked.items()
        for f in findings
    ]
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "invocations": [called],
        "results": results,
    }
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


def _text(finding: Finding) -> str:
    """Return message and hint as sentences; a hint gets a full stop unless it is a question."""
    if not finding.hint:
        return finding.message
    stop = "" if finding.hint.endswith((".", "?")) else "."
    return f"{finding.message} Hint: {finding.hint}{stop}"


def _location(deck: Path, finding: Finding) -> dict[str, Any]:
    """Return file and region; without a place the region is the first line."""
    uri = deck.as_uri() if deck.is_absolute() else quote(os.fsencode(deck.as_posix()))
    region: dict[str, Any] = {"startLine": 1}
    if place := finding.place:
        region = {
            "startLine": place.line,
            "startColumn": place.first,
            "endColumn": max(place.first, place.last) + 1,
            "snippet": {"text": place.text},
        }
    return {"artifactLocation": {"uri": uri}, "region": region}


@click.command(
    "fmt",
    short_help="Align the columns of decks.",
    epilog=typical(
        "fecm fmt impact-patch.inp -o aligned.inp",
        "fecm fmt impact-patch.inp --check",
    ),
)
@DECKS
@option(
    "-o",
    "--output",
    type=FILE_PATH,
    metavar="FILE",
    help="File to write; - is standard output.  [default: DECK itself]",
)
@option(
    "--check", "only_check", is_flag=True, help="Write nothing; exit with 1 if a deck would change."
)
@option("--overwrite", is_flag=True, help="Replace an existing FILE other than DECK.")
def fmt_command(
    decks: tuple[Path, ...], output: Path | None, only_check: bool, overwrite: bool
) -> None:
    """Align the columns of decks and put a ruler above each kind of card.

    The model, comments, blank cards and line ends stay as they are.  The output is UTF-8.  A
    DECK of - is standard input, whose aligned deck goes to standard output.
    """
    from fecm.deck.format import format_deck  # which other commands do not need

    if output is not None and len(decks) > 1:
        raise click.UsageError("-o takes one DECK")

    def one(deck: Path) -> None:
        in_place = output is None or (output.exists() and deck.exists() and output.samefile(deck))
        target = deck if output is None or in_place else output
        if not only_check and target != DASH:
            check_outputs([target], overwrite or in_place, [] if in_place else [deck])
        before, source = load_text(_input(deck))
        if "\ufffd" in before:
            raise RefusedError(f"{source} has characters that can't be read; save it as UTF-8")
        try:
            after = format_deck(before, source)
        except DeckError as error:
            echo_findings(error.findings, error.source)
            name = f"{source}: " if len(decks) > 1 else ""
            raise RefusedError(f"{name}the deck can't be read; nothing was written") from None
        if only_check:
            if after != before:
                raise CheckFailedError(f"{source} would change")
        elif after != before or not in_place or target == DASH:
            write_text(target, after, overwrite=overwrite or in_place)

    if failed := _failures(decks, one):
        raise ExceptionGroup("errors of decks", failed)
