"""Processor time of ``fecm check`` on large meshes, without that of reading the deck.

    python benchmarks/checking.py [--rounds N] [CASE ...]

`critical` is the Lanczos iteration, `bound` the lower bound of the critical step from the elements,
`rest` everything else: imports, the mesh, the other rules and the summary.  Each round is a process
of its own; the figures are the least of the rounds.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from run import distorted, refined, time_step

from fecm.deck.model import Deck

CASES: dict[str, Callable[[], Deck]] = {
    "14,000 equal": lambda: refined(10),
    "56,000 equal": lambda: refined(20),
    "14,000 distorted": lambda: distorted(refined(10), 0.004),
    "56,000 distorted": lambda: distorted(refined(20), 0.002),
}
PARTS = "reading", "critical", "bound", "rest"
T = TypeVar("T")


def written(deck: Deck) -> str:
    """Return the text of a deck with a short program."""
    mesh = deck.to_text().partition("MACR\n")[0]
    program = "LOOP,,20\nTIME\nRODP,,20\nNEXT\nEND\nSTOP\n"
    return f"{mesh}MACR\nLMAS\nDT,,{time_step(deck):.6E}\n{program}"


def parts_of_check(path: str) -> dict[str, float]:
    """Seconds of the parts of a check in this process, which did nothing else before."""
    from fecm import check
    from fecm.deck.reader import Reader
    from fecm.problem import problem

    spent = dict.fromkeys(PARTS, 0.0)

    def timed(part: str, function: Callable[..., T]) -> Callable[..., T]:
        def call(*arguments: object, **named: object) -> T:
            start = time.process_time()
            try:
                return function(*arguments, **named)
            finally:
                spent[part] += time.process_time() - start

        return call

    Reader.__init__ = timed("reading", Reader.__init__)  # type: ignore[method-assign]
    Reader._read_problem = timed("reading", Reader._read_problem)  # type: ignore[method-assign]
    names = vars(problem)
    names["critical_time_step"] = timed("critical", names["critical_time_step"])
    names["safe_time_step"] = timed("bound", names["safe_time_step"])
    check(path)
    spent["rest"] = time.process_time() - sum(spent.values())
    return spent


def main() -> None:
    """Measure and print a table, or measure one check and print its parts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("cases", nargs="*", choices=[*CASES, []], metavar="CASE")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--one", metavar="DECK", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(parts_of_check(options.one)))
        return
    print(f"{'elements':20}{'check':>9}" + "".join(f"{part:>9}" for part in PARTS[1:]))
    for name in options.cases or CASES:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "deck.inp"
            path.write_text(written(CASES[name]()))
            command = [sys.executable, __file__, "--one", str(path)]
            rounds = [
                json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
                for _ in range(options.rounds)
            ]
        least = [min(one[part] for one in rounds) for part in PARTS[1:]]
        print(f"{name:20}{sum(least):9.2f}" + "".join(f"{value:9.2f}" for value in least))


if __name__ == "__main__":
    main()
