"""Printed outputs in the documentation, compared with what their commands print.

The blocks ``sh`` and ``python`` of a page run in order in one folder.  A block ``text`` shows the
output of the block before it in the same section, or is a transcript: lines that begin with ``$ ``
are commands, and the output of each follows.  Other blocks ``text`` are not compared.  Transcripts
that can't run (a damaged file, Ctrl-C) are blocks ``console``.

A line ``...`` stands for any number of lines, and ``...`` at the end of a line for its rest.  Times
of computing, sizes of files and memory, versions and paths differ from machine to machine:
:data:`MASKED` are not compared.

``python -m tests.printed --write docs/tutorial.md`` runs a page and writes the lines anew whose
numbers have changed.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
import textwrap
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from fecm import FecmWarning
from tests.calls import call

BLOCK = re.compile(r"^( *)```(\w+)\n(.*?)^ *```$|^#+ [^\n]*$", re.M | re.S)
MASKED = re.compile(
    r"\d[\d.,]* ?(?:kB|MB|GB|TB|min|seconds|minutes|steps per second)\b"
    r"|fecm \d[\w.+]*|about \d+ s\b|(?:/[\w.-]+){2,}"
)
GAP = "..."
# Lines that install the package in a clone; .ci/run executes them.
SET_UP = "python3 -m venv"
ROOT = Path(__file__).parents[1]


class Printed(NamedTuple):
    """An output that a page shows, and what its command prints."""

    shown: str
    printed: list[str]


def text_of(pattern: str) -> str:
    """Text of the pages of docs/ whose names match, such as ``api*.md``."""
    pages = sorted((ROOT / "docs").glob(pattern))
    return "".join(page.read_text(encoding="utf-8") for page in pages)


def outputs(page: Path, folder: Path) -> Iterator[Printed]:
    """Run the blocks of a page in a folder, and yield the outputs that it shows.

    The commands of a block ``sh`` must succeed; those that install are left out.  In Python a
    warning is an error, except for the notes about a result.  The folder gets the decks of the
    clone.
    """
    (folder / "decks").symlink_to(ROOT / "decks")
    names: dict[str, object] = {"__name__": page.stem}
    last: list[str] = []
    for match in BLOCK.finditer(page.read_text(encoding="utf-8")):
        language, text = match[2], textwrap.dedent(match[3] or "")
        if language == "python":
            last = lines_of(run_python(text, folder, names))
        elif language == "sh":
            commands = [line for line in text.splitlines() if not line.startswith(SET_UP)]
            last = lines_of(run_shell("\n".join(commands), folder)) if commands else []
        elif language == "text" and text.startswith("$ "):
            yield Printed(match[3], transcript(text, folder))
        elif language == "text" and last:
            yield Printed(match[3], last)
            last = []
        elif not language:  # a heading
            last = []


def run_python(text: str, folder: Path, names: dict[str, object]) -> str:
    """Run a snippet in a folder with the names of those before; returns what it prints."""
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(io.StringIO()) as out,
        warnings.catch_warnings(action="error"),
    ):
        warnings.simplefilter("ignore", FecmWarning)  # notes about the results of the examples
        exec(compile(text, str(names["__name__"]), "exec"), names)
    return out.getvalue()


def run_shell(text: str, folder: Path, *, fails: bool = False) -> str:
    """Run commands: those of ``fecm`` in this process if there are no others.

    Returns what they print, in the order of a terminal.
    """
    commands = text.replace("\\\n", " ").strip().split("\n")
    if all(line.startswith("fecm ") and not re.search("[|>]", line) for line in commands):
        printed = ""
        for line in commands:
            done = call(*shlex.split(line, comments=True)[1:], cwd=folder, is_mixed=True)
            printed += done.stdout
            assert fails or done.exit_code == 0, f"{line}\n{printed}"
        return printed
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", text],
        cwd=folder,
        env=os.environ | {"PATH": path},
        check=not fails,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
    ).stdout


def transcript(text: str, folder: Path) -> list[str]:
    """Run the commands of a transcript; returns each with the lines that it prints."""
    lines: list[str] = []
    for line in text.replace("\\\n", " ").split("\n"):
        if line.startswith("$ "):
            lines += [line, *lines_of(run_shell(line[2:], folder, fails=True))]
    return lines


def lines_of(printed: str) -> list[str]:
    """Lines that are not blank."""
    return [line.rstrip() for line in printed.split("\n") if line.strip()]


def differences(shown: str, printed: list[str]) -> list[str]:
    """Lines of a block that the output does not have in this order."""
    wrong, place = [], 0
    masked = [_masked(line) for line in printed]
    for line in filter(str.strip, shown.replace("\\\n", " ").split("\n")):
        text = _masked(line)
        fits = [n for n in range(place, len(masked)) if _fits(text, masked[n])]
        if fits:
            place = fits[0] + (text != GAP)
        elif text != GAP:
            wrong.append(line)
    return wrong


def _masked(line: str) -> str:
    return MASKED.sub("#", " ".join(line.split()))


def _fits(shown: str, line: str) -> bool:
    return line == shown or (shown.endswith(GAP) and line.startswith(shown.removesuffix(GAP)))


def updated(shown: str, printed: list[str]) -> str:
    """The block with the lines of the output that begin as its own do, in their order.

    A line that begins with a number is the next line of the output.
    """
    indent = shown[: len(shown) - len(shown.lstrip())] if "$ " in shown else ""
    shown_lines = shown.split("\n")
    if GAP not in shown and len(lines_of(shown)) == len(printed):
        rest = iter(printed)
        return "\n".join(indent + next(rest) if line.strip() else line for line in shown_lines)
    lines, place = [], 0
    for line in shown_lines:
        text = line.removeprefix(indent)
        start = re.split(r"[\d(]|[+-]\d", text, maxsplit=1)[0].rstrip()
        rows = [n for n, one in enumerate(printed) if n >= place and one.startswith(start)]
        if rows and text.strip() and not text.endswith(GAP) and not text.startswith("$"):
            lines.append(indent + printed[rows[0]])
            place = rows[0] + 1
        else:
            lines.append(line)
    return "\n".join(lines)


def main(pages: list[str], *, write: bool) -> None:
    """Print the differences of pages, or write their blocks anew."""
    for name in pages:
        page = Path(name)
        with tempfile.TemporaryDirectory() as folder:
            for shown, printed in outputs(page, Path(folder)):
                wrong = differences(shown, printed)
                if not wrong:
                    continue
                print(f"--- {name}", *wrong, sep="\n")
                if write:
                    text = page.read_text(encoding="utf-8")
                    page.write_text(text.replace(shown, updated(shown, printed)), encoding="utf-8")


if __name__ == "__main__":
    main([name for name in sys.argv[1:] if name != "--write"], write="--write" in sys.argv)
