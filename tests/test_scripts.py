"""The scripts in examples/ run."""

from __future__ import annotations

import ast
import contextlib
import runpy
import warnings
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

import fecm
from tests.decks import ROOT

SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
QUICK = ("own_projectile", "plate_with_a_hole")
# Lines of those that have models of their own: finite elements, and the density of a posterior.
LONGER = {"axisymmetric_projectile": 70, "posterior": 40}
RUNS = [
    pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else pytest.mark.long)
    for path in SCRIPTS
]


def _imports(script: Path) -> Iterator[str]:
    """Names of the packages that a script imports."""
    for node in ast.walk(ast.parse(script.read_text())):
        match node:
            case ast.Import(names=imported):
                yield from (alias.name.partition(".")[0] for alias in imported)
            case ast.ImportFrom(module=str(module)):
                yield module.partition(".")[0]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_has_a_title_and_is_short(script: Path) -> None:
    tree = ast.parse(script.read_text())
    title, rule, blank, *text = (ast.get_docstring(tree) or "").splitlines()
    assert rule == "=" * len(title)
    assert not blank
    assert text
    assert tree.body[0].end_lineno
    below = script.read_text().splitlines()[tree.body[0].end_lineno :]
    code = [line for line in below if line and not line.startswith("# ")]
    assert 6 <= len(code) <= LONGER.get(script.stem, 25)


@pytest.mark.parametrize("script", RUNS)
@pytest.mark.few(1)  # of 2, 0.7 s each
def test_a_script_runs_and_warns_of_nothing_but_its_results(script: Path, tmp_path: Path) -> None:
    import matplotlib.pyplot as plt

    if missing := [name for name in _imports(script) if find_spec(name) is None]:
        pytest.skip(f"{script.stem} needs {', '.join(missing)}: pip install 'fecm[examples]'")
    with contextlib.chdir(tmp_path), warnings.catch_warnings(action="error"):
        warnings.simplefilter("ignore", fecm.FecmWarning)
        runpy.run_path(str(script), run_name="__main__")
    plt.close("all")
