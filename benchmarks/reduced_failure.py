"""Random impacts with failure on a plate that stretches, by the reduced model: processor times.

    python benchmarks/reduced_failure.py [--cases N] [--layup LAYUP] [--energy E]

A coupon of D7136 is hit with random velocities and contact coefficients, and its program has FAIL.
The cases are computed by the reduced model, with the full runs beside them and without, and some of
them in full.  The figures are processor seconds in one process.  The largest difference of each
exposure is that from the full runs.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


import fecm
from fecm.sweeps.task import MODES

COUPON = (
    *("--fixture", "D7136", "--material", "IM7/8552"),
    *("--kinematics", "von-karman", "--damage", "--quiet"),
)
COMPARED = 3


def deck_of(layup: str, energy: str) -> fecm.Deck:
    """Return the deck of a coupon."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drop.inp"
        given = (str(path), *COUPON, "--layup", layup, "--energy", energy)
        subprocess.run([sys.executable, "-m", "fecm", "new", *given], check=True)
        return fecm.read_one(path)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--layup", default="[45/0/-45/90]4s")
    parser.add_argument("--energy", default="20J")
    options = parser.parse_args()
    deck = deck_of(options.layup, options.energy)
    (fastest,) = {segment.velocity for segment in deck.segments if hasattr(segment, "velocity")}
    random = {"velocity": f"uniform:{0.3 * fastest},{fastest}", "k": "uniform:3e4,6e4"}
    begin = time.process_time()
    swept = fecm.sweep(
        deck,
        random=random,
        samples=options.cases,
        seed=1,
        measure="failure",
        model="reduced",
        modes=MODES,
        workers=1,
    )
    seconds = time.process_time() - begin
    assert swept.reduced is not None
    fulls = [int(case) for case in swept.reduced.columns["case"]][-COMPARED:]
    begin = time.process_time()
    values = [{name: float(swept.cases[name][case]) for name in random} for case in fulls]
    for case, value in zip(fulls, values, strict=True):
        full = fecm.sweep(
            deck, {name: [number] for name, number in value.items()}, measure="failure"
        )
        names = [name for name in full.summary if name.startswith(("exposure_", "peak_force"))]
        shown = (f"{name} {swept[name][case] / full[name][0] - 1.0:+.2%}" for name in names)
        print(f"case {case}, w {full['deflection_ratio'][0]:.2f} h: {', '.join(shown)}")
    a_run = (time.process_time() - begin) / len(fulls)
    trials = len(swept.reduced.columns["case"])
    print(f"{options.cases} cases: {seconds:.1f} s, of them {trials} full runs beside the cases")
    print(
        f"a full run: {a_run:.2f} s; {options.cases} of them {a_run * options.cases / 60:.1f} min"
    )
    print(f"cases that were run in full for their energy: {swept.reduced.in_full}")


if __name__ == "__main__":
    main()
