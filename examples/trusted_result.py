"""A regression test of your own
=============================

A project keeps a result that it trusts, and pytest compares each new run with it by
:func:`fecm.assert_same`. Here the test passes, and fails when somebody edits the deck. Needs
pytest: ``pip install 'fecm[examples]'``.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import fecm

TEST = """\
import fecm


def test_the_impact_is_the_trusted_one():
    result = fecm.run_one("plate.inp")
    fecm.assert_same(result, "trusted.h5", rtol=1e-6, only=["history/force", "history/plate_w"])
"""

deck = fecm.read_one(fecm.examples.path("impact-patch.inp"))
with TemporaryDirectory() as folder:
    project = Path(folder)
    fecm.run_one(deck, output=project / "trusted.h5")
    (project / "test_impact.py").write_text(TEST)
    for tried in (deck, deck.with_(velocity=115.01)):
        (project / "plate.inp").write_text(tried.to_text())
        pytest = [sys.executable, "-m", "pytest", "-q", "--tb=line", "-p", "no:cacheprovider"]
        print(subprocess.run(pytest, cwd=project, capture_output=True, text=True).stdout)
