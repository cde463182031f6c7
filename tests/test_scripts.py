"""The scripts in examples/ run."""

from __future__ import annotations

import ast
import contextlib
import runpy
import warnings
from pathlib import Path

import pytest

from tests.decks import ROOT

SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
QUICK = ("own_projectile", "plate_with_a_hole")
RUNS = [
    pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else pytest.mark.long)
    for path in SCRIPTS
]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_has_25_lines_at_most_below_its_docstring(script: Path) -> None:
    tree = ast.parse(script.read_text())
    assert ast.get_docstring(tree)
    lines = [line for line in script.read_text().splitlines()[1:] if line]
    assert 8 <= len(lines) <= 25


@pytest.mark.parametrize("script", RUNS)
def test_a_script_runs_and_warns_of_nothing(script: Path, tmp_path: Path) -> None:
    import matplotlib.pyplot as plt

    with contextlib.chdir(tmp_path), warnings.catch_warnings(action="error"):
        runpy.run_path(str(script), run_name="__main__")
    plt.close("all")
