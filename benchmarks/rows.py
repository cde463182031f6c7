"""Cost of stored rows and of FAIL of a plate that stretches, by the kernels and by NumPy, in turns.

    python benchmarks/rows.py [--rounds N] [--layup LAYUP] [--energy E]

A run of a D7136 coupon in memory gives the displacements of its rows, from which strains, values of
the midplane and exposures are computed again.  The figures are processor times, the least of some
rounds.  Pin it to one core: ``taskset -c 0 python benchmarks/rows.py``.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterator

import numpy as np
from reduced_failure import deck_of

import fecm
from fecm.mechanics.stiffness_product import KERNELS, NUMPY
from fecm.problem.build import ImpactModel, RunOptions, build_model
from fecm.problem.loading import load_deck

ROWS = 3  # that a run computes together


def parts(
    model: ImpactModel, rows: list[tuple[np.ndarray, list[float]]]
) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield what is computed for rows, by name."""
    failure, stretching = model.failure, model.stretching
    assert failure is not None
    assert stretching is not None

    def exposures() -> None:
        envelope = failure.start()
        for fields, times in rows:
            failure.update(envelope, fields, times)

    yield "strains", lambda: [model.strains.evaluate(fields) for fields, _ in rows]
    yield "midplane", lambda: [stretching.evaluate(fields) for fields, _ in rows]
    yield "exposures", exposures


def seconds(computed: Callable[[], object]) -> float:
    """Processor time of a computation."""
    begin = time.process_time()
    computed()
    return time.process_time() - begin


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--layup", default="[45/0/-45/90]2s")
    parser.add_argument("--energy", default="14J")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    deck = deck_of(options.layup, options.energy)
    result = fecm.run_one(deck)
    fields, times = result["tape3/displacement"], result["tape3/time"].tolist()
    cuts = (slice(start, start + ROWS) for start in range(0, len(fields), ROWS))
    rows = [(fields[cut], times[cut]) for cut in cuts]
    problem = load_deck(deck.to_text()).problems[0]
    solvers = (KERNELS, NUMPY)
    models = {solver: build_model(problem, RunOptions(solver=solver)) for solver in solvers}
    least: dict[str, dict[str, float]] = {}
    for _ in range(options.rounds):
        for solver, model in models.items():
            for name, computed in parts(model, rows):
                of_name = least.setdefault(name, {})
                of_name[solver] = min(of_name.get(solver, np.inf), seconds(computed))
    print(f"{len(fields)} rows")
    for name, values in least.items():
        print(f"{name:10}" + "".join(f"  {solver} {s:.3f} s" for solver, s in values.items()))


if __name__ == "__main__":
    main()
