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
# A study of the report redone, with finite elements of its own.
STUDY = "axisymmetric_projectile"
RUNS = [
    pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else pytest.mark.long)
    for path in SCRIPTS
]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_has_a_title_and_25_lines_of_code_at_most(script: Path) -> None:
    tree = ast.parse(script.read_text())
    title, rule, blank, *text = (ast.get_docstring(tree) or "").splitlines()
    assert rule == "=" * len(title)
    assert not blank
    assert text
    assert tree.body[0].end_lineno
    below = script.read_text().splitlines()[tree.body[0].end_lineno :]
    code = [line for line in below if line and not line.startswith("# ")]
    assert 8 <= len(code) <= (70 if script.stem == STUDY else 25)


@pytest.mark.parametrize("script", RUNS)
def test_a_script_runs_and_warns_of_nothing(script: Path, tmp_path: Path) -> None:
    import matplotlib.pyplot as plt

    if script.stem == STUDY:
        pytest.importorskip("skfem")
    with contextlib.chdir(tmp_path), warnings.catch_warnings(action="error"):
        runpy.run_path(str(script), run_name="__main__")
    plt.close("all")
