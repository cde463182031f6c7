"""Impacts: on a rigid target, on an infinite plate, and the report's experiment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecm._typing import Floats
from fecm.deck.grid import Grid, uniform
from fecm.deck.model import Deck, Impact, Indentation, Projectile
from fecm.deck.records import Ply
from fecm.results.result import Result
from fecm.sweeps.api import sweep
from fecm.verification.case import AGAINST_CHANGE, CONSISTENCY, Check, case
from fecm.verification.decks import (
    hertz,
    impact_program,
    isotropic,
    material,
    quarter_plate,
    report_impact,
    result_of,
    struck_plate,
)

M, V, K = 2.0e-4, 100.0, 1.0e6
DEEPEST, LARGEST, DURATION = hertz(M, V, K)
STIFF = "8450 steps; the error falls with the square of the step"


def elastic(k: float) -> Indentation:
    """Build Hertz' law, without permanent indentation."""
    return Indentation(k, 1.0, 0.0, 1.5)


def rigid_target() -> Deck:
    """Build the impact of a rigid mass on a plate of extreme stiffness and density."""
    grid = Grid(uniform(2.0, 2), uniform(2.0, 2))
    ply = Ply(1.48e6, 0.3, 1.75e16, 1.75e16, 5e15, 5e15, 5e15)
    plate = material(ply, (0.0, 90.0), 0.053)
    return struck_plate(grid, plate, Projectile(0, 0, M), V, elastic(K), 2e-8, 9000)


@case(
    "rigid-target",
    "rigid mass on a fixed target",
    Check("deepest indentation (in)", DEEPEST, "Hertz: (5 m v²/4 k)^0.4", 1e-6, STIFF),
    Check("largest force (lb)", LARGEST, "Hertz: k a^1.5", 1e-6, STIFF),
    Check("contact (s)", DURATION, "Hertz: 2.9432 a/v", 1.2e-4, "one step"),
    Check("velocity after it (in/s)", V, "energy", 1e-6, STIFF),
)
def rigid() -> Sequence[float]:
    """Extremes of the history, and its end."""
    found = result_of(rigid_target())
    touching = found.time[found.force > 0.0]
    return [found.indentation.max(), found.force.max(), touching[-1], found.velocity[-1]]


# A plate so large that no reflection returns within 200 us.  The expected values are those of
# Zener's two equations, integrated to 12 digits.
LIGHT, SOFT = 2.0e-5, 5.0e4
MESH = "elements of 0.25 in under a point force; falls with their square"
ZENER = "Zener 1941, w' = F/8√(Dρh)"


def large_plate() -> Deck:
    """Build the impact of a rigid mass on a thin plate of 12 x 12 in, stiff in transverse shear."""
    grid = Grid(uniform(12.0, 48), uniform(12.0, 48))
    plate = material(isotropic(1.0e7, 0.3, 2.5e-4, 13.0), [0.0], 0.1)
    return struck_plate(grid, plate, Projectile(0, 0, LIGHT), V, elastic(SOFT), 5e-8, 4000)


@case(
    "infinite-plate",
    "rigid mass on a large thin plate",
    Check("largest force (lb)", 26.419503561, ZENER, 1e-2, MESH),
    Check("its time (s)", 105.22152965e-6, ZENER, 1e-2, MESH),
    Check("velocity at 200 µs (in/s)", 63.238216754, ZENER, 1e-2, MESH),
)
def infinite_plate() -> Sequence[float]:
    """Extreme of a history, its time, and its end."""
    found = result_of(large_plate())
    return [found.force.max(), found.time[found.force.argmax()], found.velocity[-1]]


# A simply supported plate of side 1, hit in the middle.  The expected values are those of Mindlin's
# series of 20 x 20 terms; each mode is integrated by its exact solution.
HEAVY, SLENDER, SUPPORTED_K = 5.0e-6, 0.03, 1.0e5
MODES = "Mindlin's series, 20 × 20 modes, and Hertz' law"
LOGARITHM = "a point force: 0.4 % between 16 and 24 elements a side, and between 40 and 100 terms"
IMPULSE = "the logarithm of the point force: 0.2 % between 16 and 24 elements a side"


def supported_plate() -> Deck:
    """Build a quarter of the plate with a quarter of mass and contact coefficient."""
    plate = material(isotropic(1.0e7, 0.3, 2.5e-4), [0.0], SLENDER)
    quarter = elastic(SUPPORTED_K / 4.0)
    hit = (Projectile(0, 0, HEAVY / 4.0), Impact(1, 3, V), quarter)
    return quarter_plate(8, plate, impact_program(8e-8, 2500), others=hit)


@case(
    "supported-plate",
    "rigid mass on the middle of a simply supported plate of 1 × 1 × 0.03 in",
    Check("largest force (lb)", 10.826232612, MODES, 1e-2, LOGARITHM),
    Check("its time (s)", 125.33e-6, MODES, 1e-2, LOGARITHM),
    Check("largest w under the mass (in)", 4.42436496e-3, MODES, 5e-3, IMPULSE),
    Check("velocity after it (in/s)", 83.606832, MODES, 5e-3, IMPULSE),
)
def supported() -> Sequence[float]:
    """Extremes of a history, and its end."""
    found = result_of(supported_plate())
    return [
        4.0 * found.force.max(), found.time[found.force.argmax()], found.plate_w.max(),
        found.velocity[-1],
    ]  # fmt: skip


ORIGINAL = "the original program, slips mended"
SAME = "the same steps in another order of sums"
OWN = "this program"
DIGITS = "to the digits stated"


def _guard(quantity: str, expected: float, source: str, tolerance: float, why: str) -> Check:
    return Check(quantity, expected, source, tolerance, why, AGAINST_CHANGE)


@case(
    "report-impact",
    "the report's experiment, 115 in/s, 4000 steps of 0.2 µs",
    Check("worst error of the energy balance", 0.0, "the initial energy", 1e-4,
          "steps of 0.2 µs", CONSISTENCY, scale=1.0),
    _guard("force at 42 µs (lb)", 78.4377951, ORIGINAL, 1e-7, SAME),
    _guard("force at 642 µs (lb)", 86.1562088, ORIGINAL, 1e-7, SAME),
    _guard("transducer at 642 µs (lb)", 52.1759105, ORIGINAL, 1e-7, SAME),
    _guard("largest force of the first contact (lb)", 78.7, OWN, 1e-3, DIGITS),
    _guard("its time (s)", 42.6e-6, OWN, 1e-3, DIGITS),
    _guard("largest force (lb)", 86.2016, OWN, 1e-5, DIGITS),
    _guard("its time (s)", 641.2e-6, OWN, 1e-4, DIGITS),
)  # fmt: skip
def report() -> Sequence[float]:
    """Energy, and forces at instants and at their peaks."""
    found = result_of(report_impact())
    energy = found.energy
    balance = float(np.abs(energy.balance_error).max()) / float(energy.attributes["initial"])
    first = int(found.force[found.time < 500e-6].argmax())
    second = int(found.force.argmax())
    return [
        balance, _at(found, "force", 42e-6), _at(found, "force", 642e-6),
        _at(found, "transducer", 642e-6), found.force[first], found.time[first],
        found.force[second], found.time[second],
    ]  # fmt: skip


def _at(result: Result, name: str, time: float) -> float:
    """Value of a history at the step nearest to a time."""
    values: Floats = result[f"history/{name}"]
    return float(values[int(np.abs(result.time - time).argmin())])


@case(
    "listing-impact",
    "the same in listing mode, whose target is fixed",
    _guard("force at 46 µs (lb)", 395.179758, "the original program", 1e-7, SAME),
    _guard("transducer at 46 µs (lb)", -208.981648, "the original program", 1e-7, SAME),
    _guard("end of the contact (s)", 90.6e-6, OWN, 1e-3, DIGITS),
)
def listing() -> Sequence[float]:
    """Listing mode."""
    found = result_of(report_impact(500), "listing")
    end = found.time[found.force > 0.0][-1]
    return [_at(found, "force", 46e-6), _at(found, "transducer", 46e-6), end]


@case(
    "convolution",
    "a sweep's case, which answers by the plate's response to a unit force, and its full run",
    Check("largest difference of the forces", 0.0, "Duhamel's integral", 1e-9,
          "rounding of 1000 steps", CONSISTENCY, scale=1.0),
)  # fmt: skip
def convolution() -> Sequence[float]:
    """Force of 60 in/s where the deck says 115."""
    deck = report_impact(1000)
    swept = sweep(deck, {"velocity": [60.0]}, history=True).force
    if swept is None:
        raise ValueError("the sweep has kept no forces")
    slower = tuple(replace(s, velocity=60.0) if isinstance(s, Impact) else s for s in deck.segments)
    full = result_of(replace(deck, segments=slower)).force
    return [float(np.abs(swept[0] - full).max() / full.max())]


CASES = (rigid, infinite_plate, supported, report, listing, convolution)
