"""Printed outputs in the documentation, compared with what their commands print.

A block ``text`` shows the output of the commands in the block ``sh`` before it, or is a
transcript: lines that begin with ``$ `` are commands, and the output of each follows.  A line
``...`` stands for any number of lines.  Times of computing, sizes of files and memory, versions and
paths differ from machine to machine: :data:`MASKED` are not compared.

``python -m tests.printed --write docs/tutorial.md`` runs the commands of a page and writes the
lines anew whose numbers have changed.
"""

from __future__ import annotations

import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests.calls import call

BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^ *```$", re.M | re.S)
MASKED = re.compile(
    r"\d[\d.,]* ?(?:kB|MB|GB|min|seconds|minutes|steps per second)\b"
    r"|fecm \d[\w.+]*|about \d+ s\b|(?:/[\w.-]+){2,}"
)
GAP = "..."


class Printed(NamedTuple):
    """An output that a page shows, and what its command prints."""

    shown: str
    printed: list[str]


def outputs(page: Path, folder: Path) -> Iterator[Printed]:
    """Run the commands of a page in a folder, and yield the outputs that it shows."""
    last: list[str] = []
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        _, language, text = block.groups()
        commands = [line.strip() for line in text.replace("\\\n", " ").strip().split("\n")]
        if language == "sh":
            last = []
            for line in commands:
                if line.startswith("fecm ") and not re.search("[|>]", line):
                    last += output_of(line, folder)
        elif language == "text" and commands[0].startswith("$ "):
            printed: list[str] = []
            for line in commands:
                if line.startswith("$ fecm "):
                    printed += [line, *output_of(line[2:], folder)]
            yield Printed(text, printed)
        elif language == "text" and last:
            yield Printed(text, last)
            last = []


def output_of(command: str, folder: Path) -> list[str]:
    """Lines of a command, standard error first."""
    done = call(*shlex.split(command, comments=True)[1:], cwd=folder)
    return [line.rstrip() for line in (done.stderr + done.stdout).split("\n") if line.strip()]


def differences(shown: str, printed: list[str]) -> list[str]:
    """Lines of a block that the output does not have in this order."""
    wrong, place = [], 0
    masked = [MASKED.sub("#", " ".join(line.split())) for line in printed]
    for line in filter(str.strip, shown.replace("\\\n", " ").split("\n")):
        if line.strip() == GAP:
            continue
        text = MASKED.sub("#", " ".join(line.split()))
        if text in masked[place:]:
            place = masked.index(text, place) + 1
        else:
            wrong.append(line)
    return wrong


def updated(shown: str, printed: list[str]) -> str:
    """The block with the lines of the output that begin as its own do, in their order."""
    lines, place = [], 0
    for line in shown.split("\n"):
        start = re.split(r"[\d(]", line, maxsplit=1)[0].rstrip()
        rows = [n for n, one in enumerate(printed) if n >= place and one.startswith(start)]
        if start.strip() and rows and line.strip() != GAP and not line.startswith("$"):
            lines.append(printed[rows[0]])
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
