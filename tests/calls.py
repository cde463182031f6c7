"""Calls of the command line inside the tests' own process: quick, and with all that `main` does."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import h5py
import pytest

import fecm
from fecm.cli import main
from fecm.cli.interrupts import signals
from fecm.deck.model import Deck


@dataclass(frozen=True)
class Done:
    """A call that has ended."""

    exit_code: int
    stdout: str
    stderr: str


def _stream() -> io.TextIOWrapper:
    """A text stream in memory that encodes as the program's own streams do."""
    return io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace", write_through=True)


def _written(stream: io.TextIOWrapper) -> str:
    stream.seek(0)
    return stream.read()


def call(*arguments: object, cwd: Path | None = None, is_mixed: bool = False) -> Done:
    """Call ``fecm`` with these arguments, in a folder if one is named.

    With `is_mixed`, ``stdout`` has the lines of both streams in their order.
    """
    out = _stream()
    err = out if is_mixed else _stream()
    with (
        contextlib.chdir(cwd or Path.cwd()),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        mock.patch.object(signals, "install"),
        pytest.raises(SystemExit) as left,
    ):
        main(list(map(str, arguments)))
    assert isinstance(left.value.code, int)
    return Done(left.value.code, _written(out), "" if is_mixed else _written(err))


def datasets_of(path: Path) -> list[str]:
    """Return the paths of all datasets in the groups of a file."""
    paths: list[str] = []

    def visit(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and "/" in name:  # neither the deck nor a scale
            paths.append(name)

    with h5py.File(path) as file:
        file.visititems(visit)
    return paths


def record_of(path: Path) -> dict[str, str]:
    """Name and SHA-256 of a file, as texts for machines name a record."""
    return {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}


def program(*arguments: object, cwd: Path, **options: object) -> Done:
    """Run ``python -m fecm`` in a folder, in a process of its own."""
    done: subprocess.CompletedProcess[str] = subprocess.run(
        [sys.executable, "-W", "error", "-m", "fecm", *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        **options,
    )  # type: ignore[call-overload]
    return Done(done.returncode, done.stdout, done.stderr)


def diff(*arguments: object) -> Done:
    """Call ``fecm diff``."""
    return call("diff", *arguments)


def line_about(done: Done, name: str) -> str:
    """Return the line about a dataset in the output of ``fecm diff``."""
    return next(line for line in done.stdout.splitlines() if name in line.split())


def assert_unusable(done: Done) -> None:
    """Status 2, nothing on standard output, one line on standard error."""
    assert done.exit_code == 2
    assert done.stdout == ""
    assert done.stderr.startswith("fecm: error: ")
    assert done.stderr.count("\n") == 1
    assert done.stderr.endswith("\n")


def new(*options: str | Path) -> Done:
    """Run ``fecm new`` to standard output."""
    return call("new", "-", *options)


def new_deck(*options: str | Path) -> Deck:
    """Deck that ``fecm new`` writes."""
    answer = new(*options)
    assert answer.exit_code == 0, answer.stderr
    return fecm.read_one(answer.stdout)


def rows(done: Done) -> list[dict[str, str]]:
    """The table that a call has printed, by names without units."""
    assert done.exit_code == 0, done.stderr
    head, *lines = csv.reader(io.StringIO(done.stdout))
    names = [name.partition(" (")[0] for name in head]
    return [dict(zip(names, line, strict=True)) for line in lines]
