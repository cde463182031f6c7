"""Fits to records of a plate that stretches: by the reduced model, and by full runs alone.

    python benchmarks/identify_stretching.py [SEEDS [MESH]]

A drop-weight test of 20 J on a coupon of D7136, 2 mm thick, is run in full.  Its force with a noise
of 2 % of the peak is fitted from a deck that is off by 4 % in velocity and 14 % in k: by
``fecm.identify``, and from its values on by full runs alone.  The figures are the differences of
both fits in standard errors, and processor seconds.  MESH is the number of elements, such as 12x10,
instead of those that ``fecm new`` chooses.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import fecm
from fecm._typing import Floats
from fecm.deck.units import unit_names
from fecm.identification.fitting import ForceModel, Scaling, covariance, fit_parameters
from fecm.identification.plates import ExactPlate
from fecm.problem.loading import sole_problem
from fecm.results.comparison import measurement_of
from fecm.sweeps.backends import FullRuns
from fecm.sweeps.impact_columns import Impacts
from fecm.sweeps.outcome import Outcome

COUPON = (
    *("--fixture", "D7136", "--layup", "[45/0/-45/90]2s", "--material", "IM7/8552"),
    *("--ply-thickness", ".125", "--energy", "20J", "--kinematics", "von-karman"),
)
TRUE = {"k": 48000.0, "velocity": 2600.0}
TIME = np.linspace(0.0, 8e-3, 200)  # s
NOISE = 0.02
SEEDS = 20
EVALUATIONS = 6  # of a fit by full runs, from the values of the other fit


class RunsOfOneLength(FullRuns):
    """Full runs; their force is 0 after the end."""

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Run each impact."""
        outcome = super().outcomes(impacts, judged=judged)
        assert outcome.force is not None
        steps = int(TIME[-1] / outcome.columns["dt"][0]) + 1
        force = np.nan_to_num(outcome.force)[:, :steps]
        outcome.force = np.pad(force, ((0, 0), (0, steps - force.shape[1])))
        return outcome


def coupon(mesh: list[str]) -> fecm.Deck:
    """Return the deck of the test as it was ordered."""
    options = ["--mesh", *mesh] if mesh else []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drop.inp"
        command = [sys.executable, "-m", "fecm", "new", str(path), *COUPON, *options, "--quiet"]
        subprocess.run(command, check=True)
        return fecm.read_one(path.read_text())


def by_full_runs(
    deck: fecm.Deck, force: Floats, start: dict[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return values and standard errors of a fit by full runs."""
    problem = sole_problem(deck, warns=False)
    model = ForceModel(deck, ExactPlate(problem, RunsOfOneLength(problem)), None)
    count = len(start)
    scaling = Scaling(start, np.zeros(count), np.full(count, -1.0), np.ones(count))
    measured = measurement_of((TIME, force), unit_names(deck))
    points = fit_parameters(model, measured, scaling, np.zeros(count), EVALUATIONS)
    assert points is not None
    deviation = np.sqrt(np.diagonal(covariance(points))) * scaling.slopes(points.x)
    return points.values, dict(zip(start, deviation.tolist(), strict=True))


def main() -> None:
    """Measure and print."""
    warnings.simplefilter("ignore", fecm.FecmWarning)
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    deck = coupon(sys.argv[2:])
    truth = fecm.run_one(deck.with_(k=TRUE["k"], velocity=TRUE["velocity"]))
    true_force = np.interp(TIME, truth.time, truth.force, right=0.0)
    apart, seconds, fits = [], [], []
    for seed in range(seeds):
        noise = NOISE * true_force.max() * np.random.default_rng(seed).normal(size=len(TIME))
        begin = time.process_time()
        fit = fecm.identify(deck, TIME, true_force + noise, list(TRUE))
        seconds.append(time.process_time() - begin)
        assert fit.full_run is not None
        fits.append(fit.full_run.fits)
        values, errors = by_full_runs(deck, true_force + noise, fit.values)
        apart.append([(fit.values[name] - values[name]) / errors[name] for name in TRUE])
        texts = [
            f"seed {seed}: {seconds[-1]:.1f} s, {fits[-1]} fits beside full runs, {fit.verdict}"
        ]
        for name, difference in zip(TRUE, apart[-1], strict=True):
            error = (values[name] - TRUE[name]) / errors[name]
            texts.append(f"{name} {difference:+.3f} from full runs, {error:+.2f} from the truth")
        print("; ".join(texts), flush=True)
    largest = np.abs(apart).max(axis=1)
    inside = np.count_nonzero(largest <= 2.0)
    print(
        f"within two standard errors of full runs: {inside} of {seeds}, largest {largest.max():.2f}"
    )
    print(f"seconds: median {np.median(seconds):.1f} ({min(seconds):.1f} to {max(seconds):.1f})")


if __name__ == "__main__":
    main()
