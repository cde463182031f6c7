"""Cost of FAIL: runs with FAIL,,20 beside the same runs without it, in one process and in turns.

    python benchmarks/failure.py [--rounds N] [--write]

The decks are the report's with the strengths of its ply, and the example drop-weight-held.inp, a
test of ASTM D7136.  Runs are those of ``fecm.run``, in memory; the figures are processor times, the
least of some rounds.  Pin it to one core: ``taskset -c 0 python benchmarks/failure.py``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does

import argparse
import time
import warnings
from pathlib import Path

from figures import keep

import fecm

HERE = Path(__file__).parents[1]
STRENGTHS = "ALLO\n200000,200000,7000,28000,13000\n\nEXPE\n"


def without_fail(text: str) -> str:
    """Return a deck without FAIL."""
    return "".join(line for line in text.splitlines(keepends=True) if not line.startswith("FAIL"))


def with_fail(text: str, every: int = 20) -> str:
    """Return a deck with FAIL at every `every`-th pass of its loop."""
    plain = without_fail(text)
    (output,) = (line for line in plain.splitlines(keepends=True) if line.startswith("DISP"))
    return plain.replace(output, f"{output}FAIL,,{every}\n")


def report() -> str:
    """Return the report's plate with strengths."""
    text = (HERE / "decks" / "impact-115.inp").read_text()
    return text.replace("EXPE\n", STRENGTHS)


def drop_weight() -> str:
    """Return the drop-weight test of the examples."""
    return (HERE / "fecm" / "examples" / "drop-weight-held.inp").read_text()


CASES = {"impact-115": report, "drop-weight": drop_weight}


def seconds(text: str) -> float:
    """Processor time of a run in memory."""
    begin = time.process_time()
    fecm.run(text)
    return time.process_time() - begin


def main() -> None:
    """Measure, print a table, and keep it if asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--write", action="store_true", help="keep the figures as JSON")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    figures: list[dict[str, object]] = []
    for name, made in CASES.items():
        texts = without_fail(made()), with_fail(made())
        rounds = [[seconds(text) for text in texts] for _ in range(options.rounds + 1)][1:]
        plain, failing = map(min, zip(*rounds, strict=True))
        row = {
            "case": name,
            "seconds": round(plain, 3),
            "with_fail": round(failing, 3),
            "ratio": round(failing / plain, 2),
        }
        figures.append(row)
        print(" ".join(f"{key}={value}" for key, value in row.items()), flush=True)
    if options.write:
        print(keep({"failure": figures}, "-failure"))


if __name__ == "__main__":
    main()
