"""The commands and snippets of the README and the pages run from an empty folder."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import subprocess
import sys
import textwrap
import warnings
from pathlib import Path

import pytest

from tests.calls import call
from tests.decks import ROOT
from tests.printed import differences, outputs

BLOCK = re.compile(r"^( *)```(sh|python)\n(.*?)^ *```$", re.M | re.S)
PAGES = [
    page.name for page in sorted((ROOT / "docs").glob("*.md")) if BLOCK.search(page.read_text())
]
# Commands of a checkout, which .ci/run executes.
SET_UP = "python3 -m venv"


def run_shell(block: str, folder: Path) -> None:
    """Run commands in a folder: those of ``fecm`` in this process if there are no others."""
    lines = block.replace("\\\n", " ").strip().split("\n")
    if all(line.startswith("fecm ") and not re.search("[|>]", line) for line in lines):
        for line in lines:
            done = call(*shlex.split(line, comments=True)[1:], cwd=folder)
            assert done.exit_code == 0, f"{line}\n{done.stdout}{done.stderr}"
        return
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block],
        cwd=folder,
        env=os.environ | {"PATH": path},
        check=True,
        stdout=subprocess.DEVNULL,
    )


def run_page(page: Path, folder: Path) -> None:
    """Run the blocks of a page in order; a warning in Python is an error."""
    names: dict[str, object] = {"__name__": page.stem}
    for _, language, indented in BLOCK.findall(page.read_text(encoding="utf-8")):
        block = textwrap.dedent(indented)
        if language == "python":
            with contextlib.chdir(folder), warnings.catch_warnings(action="error"):
                exec(compile(block, str(page), "exec"), names)
        elif not block.startswith(SET_UP):
            run_shell(block, folder)


@pytest.fixture(autouse=True)
def _close_figures() -> object:
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


def test_the_commands_and_snippets_of_the_readme_run(tmp_path: Path) -> None:
    run_page(ROOT / "README.md", tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("page", PAGES)
def test_the_commands_and_snippets_of_a_page_run(page: str, tmp_path: Path) -> None:
    run_page(ROOT / "docs" / page, tmp_path)


# Pages whose printed outputs are those of their commands.
PRINTED = ["README.md", "docs/damage-energy.md", "docs/tutorial.md"]


@pytest.mark.long
@pytest.mark.parametrize("page", PRINTED)
def test_a_page_shows_what_its_commands_print(page: str, tmp_path: Path) -> None:
    for shown, output in outputs(ROOT / page, tmp_path):
        assert differences(shown, output) == []


def test_a_number_that_a_command_does_not_print_is_a_difference() -> None:
    output = ["peak  85.0 N", "contact 1 s", "result  a.h5, 3.2 MB"]
    assert differences("peak 85.0 N\n...\nresult a.h5, 9 MB", output) == []
    assert differences("peak 85.1 N\ncontact 1 s", output) == ["peak 85.1 N"]
    assert differences("contact 1 s\npeak 85.0 N", output) == ["peak 85.0 N"]
