"""Peak forces of random plates that stretch, by the reduced model, against full runs.

    python benchmarks/reduced_plates.py [--plates N] [--modes M,M]

The plates have 48 or 64 elements.  In turns they are symmetric, unsymmetric, curved, preloaded,
cured (unsymmetric, half of them curved) and D7136 coupons.  Each is hit three times, such that it
deflects by about 0.65, 1.25 and 1.95 thicknesses.  Projectiles of the coupons have the fixture's
mass, others 50 g to 5 kg.  Prints the table of docs/confidence.md.  Takes some ten minutes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

import fecm
from fecm.authoring.case import Case
from fecm.mechanics.quick_models import static_curve
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from fecm.sweeps.backends import BendingModes
from fecm.sweeps.impact_columns import impacts_of
from fecm.sweeps.limits import PEAK_FORCE

Floats = NDArray[np.float64]
KINDS = ("symmetric", "unsymmetric", "curved", "preloaded", "cured", "D7136")
ANGLES = (0, 90, 45, -45, 30, -30, 60)
HEAVY = 10.0  # mass of a projectile over the mass of the plate


class Struck(NamedTuple):
    """A plate, the velocities of its impacts, and their full peaks and deflections."""

    problem: Problem
    velocities: list[float]
    peaks: Floats
    ratios: Floats  # over the thickness

    @property
    def is_heavy(self) -> bool:
        """Whether the projectile is heavy."""
        return bool(self.problem.projectile_mass > HEAVY * self.problem.plate_mass)


def options_of(number: int) -> list[str]:
    """Return the options of `fecm new` of a random plate."""
    random, kind = np.random.default_rng(number), KINDS[number % len(KINDS)]
    symmetric = kind not in ("unsymmetric", "cured")
    count = int(random.integers(3, 6) if symmetric else random.integers(2, 7))
    angles = "/".join(str(angle) for angle in random.choice(ANGLES, count))
    material = "AS4/3501-6" if kind == "cured" else "IM7/8552"
    options = ["--layup", f"[{angles}]{'s' if symmetric else ''}", "--material", material]
    in_plane = str(random.choice(["free", "normal", "held"]))
    if kind == "D7136":
        ply = f"{random.uniform(0.13, 0.3):.3f}"
        return [*options, *("--fixture", "D7136", "--mesh", "8x6", "--ply-thickness", ply),
                "--in-plane", in_plane]  # fmt: skip
    lx, ly, h = random.uniform(80, 150), random.uniform(60, 120), random.uniform(1, 3)
    place = (0.5, 0.5) if random.uniform() < 0.5 else random.uniform(0.3, 0.7, 2)
    options += [
        *("--size", f"{lx:.1f}x{ly:.1f}", "--mesh", "8x8"),
        *("--ply-thickness", f"{h / (count * (2 if symmetric else 1)):.4f}"),
        *("--support", str(random.choice(["clamped", "simple", "pinned"]))),
        *("--in-plane", in_plane),
        *("--projectile", f"mass:{10 ** random.uniform(-4.3, -2.3):.3e}"),
        *("--at", f"{lx * place[0]:.2f},{ly * place[1]:.2f}"),
    ]
    if kind == "curved" or (kind == "cured" and random.uniform() < 0.5):
        radius = random.choice([-1, 1]) * random.uniform(2, 10) * max(lx, ly)
        options.append(f"--radius-{random.choice(['x', 'y'])}={radius:.0f}")
    if kind == "cured":
        options += ["--cure", "177:20", "--damage"]
    if kind == "preloaded":
        nx, ny = random.uniform(-0.3, 1.0, 2) * 30.0 * h**3 / (ly / 80.0) ** 2
        options.append(f"--preload={nx:.1f},{ny:.1f}")
    return options


def struck_plate(number: int) -> Struck:
    """Build a plate, and run its impacts in full."""
    common = ("--kinematics", "von-karman", "--contact", "estimate:8", "--energy", "1J", "--quiet")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plate.inp"
        command = [sys.executable, "-m", "fecm", "new", str(path), *options_of(number), *common]
        subprocess.run(command, check=True, capture_output=True)
        deck = fecm.read_one(path)
        (problem,) = load_deck(path.read_text()).problems
    assert problem.contact is not None
    h, random = problem.laminate.thickness, np.random.default_rng(1000 + number)
    curve = static_curve(problem.plate, problem.contact, h / 20, lambda w, force, work: w > 2.3 * h)
    energies = curve.at(h * (np.array([0.5, 1.1, 1.8]) + 0.3 * random.uniform(size=3)))[1]
    velocities = (1.05 * np.sqrt(2.0 * energies / problem.projectile_mass)).tolist()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fecm.FecmWarning)
        full = fecm.sweep(deck, {"velocity": velocities}, measure="max_deflection")
    return Struck(problem, velocities, full["peak_force"], full["deflection_ratio"])


def errors(struck: Struck, modes: int) -> Floats:
    """Return the relative differences of the peaks by the model."""
    cases: list[Case] = [{"velocity": velocity} for velocity in struck.velocities]
    impacts, _ = impacts_of(struck.problem, range(len(cases)), cases)
    assert impacts is not None
    backend = BendingModes(struck.problem, (), modes, history=False, has_fields=False)
    outcome = backend.outcomes(impacts, judged=False)
    return np.asarray(outcome.columns[PEAK_FORCE] / struck.peaks - 1.0)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plates", type=int, default=54)
    parser.add_argument("--modes", default="13,21,30")
    options = parser.parse_args()
    counts = [int(text) for text in options.modes.split(",")]
    found: dict[tuple[bool, int], list[Floats]] = {}
    for number in range(options.plates):
        struck = struck_plate(number)
        for modes in counts:
            error = errors(struck, modes)
            found.setdefault((struck.is_heavy, modes), []).append(error)
            ratios = ", ".join(
                f"{ratio:.2f} h {e:+.2%}" for ratio, e in zip(struck.ratios, error, strict=True)
            )
            print(
                f"{number:3d} {KINDS[number % len(KINDS)]:11s} {modes} modes: {ratios}", flush=True
            )
    for (is_heavy, modes), several in sorted(found.items(), reverse=True):
        all_of = np.abs(several)
        print(
            f"{'heavy' if is_heavy else 'light'}, {len(all_of)} plates, {modes} modes: "
            f"rms {np.sqrt((all_of**2).mean()):.2%}, largest {all_of.max():.2%}, "
            f"above 1 %: {np.count_nonzero(all_of > 0.01)}, above 2 %: "
            f"{np.count_nonzero(all_of > 0.02)} of {all_of.size}"
        )


if __name__ == "__main__":
    main()
