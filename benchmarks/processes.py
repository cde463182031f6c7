"""Time of whole commands beside the imports that all of them need.

Commands and ``import numpy, h5py, click`` are started in turns; the figures are processor times
of the processes, the least of many.  Pin it to one core: ``taskset -c 0 python
benchmarks/processes.py``.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from figures import keep

ROOT = Path(__file__).parents[1]
DECKS = ROOT / "decks"
EXAMPLES = ROOT / "fecm" / "examples"
BARE = ["-c", "import numpy, h5py, click"]
RUN = ["-m", "fecm", "run", "--overwrite"]
COMMANDS = {
    "bare imports": BARE,
    "run impact-115": [*RUN, str(DECKS / "impact-115.inp")],
    "run impact-115, NumPy": [*RUN, str(DECKS / "impact-115.inp"), "--solver", "numpy"],
    "run appendix": [*RUN, str(DECKS / "appendix.inp")],
    "check impact-115": ["-m", "fecm", "check", str(DECKS / "impact-115.inp")],
    "info": ["-m", "fecm", "info", "impact-115.h5"],
    "estimate drop-weight": ["-m", "fecm", "estimate", str(EXAMPLES / "drop-weight.inp")],
    "new of 160,000 elements": [
        *("-m", "fecm", "new", "large.inp", "--overwrite", "--size", "400x400"),
        *("--mesh", "400x400", "--support", "simple", "--layup", "[0/90]4s"),
        *("--material", "IM7/8552", "--projectile", "mass:1e-3", "--contact", "estimate:8"),
        *("--velocity", "3m/s", "--duration", "1ms"),
    ],
    "--version": ["-m", "fecm", "--version"],
    "plot": ["-m", "fecm", "plot", "impact-115.h5", "--overwrite"],
}


def seconds(arguments: list[str], folder: str) -> float:
    """Processor time of one process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], cwd=folder, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Measure, print a table, and keep it if asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="keep the figures as JSON")
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rounds = [
            [seconds(arguments, folder) for arguments in COMMANDS.values()]
            for _ in range(options.rounds + 1)
        ][1:]  # the first one warms the caches
    least = dict(zip(COMMANDS, map(min, zip(*rounds, strict=True)), strict=True))
    bare = least["bare imports"]
    rows = [
        {"process": name, "seconds": round(own, 3), "over_bare_imports": round(own / bare, 2)}
        for name, own in least.items()
    ]
    for row in rows:
        print(f"{row['process']:24}{row['seconds']:8}{row['over_bare_imports']:8}")
    if options.write:
        print(keep({"processes": rows}, "-processes"))


if __name__ == "__main__":
    main()
