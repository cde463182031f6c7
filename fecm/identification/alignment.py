"""Alignment of a measured force with the run of the deck: units, noise, onset and lags."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError, StudyError
from fecm._typing import Floats
from fecm.deck.units import KNOWN
from fecm.results.comparison import Measurement

OFF = 20.0  # factor between measured and computed peak or duration that shows a wrong unit
TOP_POINTS = 3  # fewest measured points above half of the peak
# Limits of the level of an onset, as a share of the peak; between them it is just above the noise.
LEAST_LEVEL = 0.1
MOST_LEVEL = 0.5
CLEAR = 5.0  # level of an onset in standard deviations of the noise
FIRST = 3  # first points, whose median is the base line of an onset
LAGS = 2  # lags that are tried: those with the largest cross-correlations
LONGEST = 2**22  # most points of a record that are correlated
FLAT = 1e-3  # variation, over the largest value, below which a force is constant


class IdentifyError(FecmError):
    """The measurement does not determine the parameters."""

    exit_code = 1


def noise(force: Floats) -> float:
    """Return the standard deviation of the noise of a force, from its second differences.

    Independent errors have second differences with the variance 6 sigma^2; a smooth force has
    almost none. The median makes the estimate robust against the few points where the force bends.

    >>> values = np.random.default_rng(0).normal(size=4000)
    >>> round(noise(values + 1e-5 * np.arange(4000.0) ** 2), 1)
    1.0
    """
    return float(np.median(np.abs(np.diff(force, 2)))) / (0.6745 * math.sqrt(6.0))


def contact_points(force: Floats) -> NDArray[np.bool_]:
    """Return a mask of the points whose force is above the level of an onset."""
    return np.asarray(force > level(force) * force.max())


def level(force: Floats) -> float:
    """Return the level of an onset, just above the noise, as a share of the peak."""
    share = CLEAR * noise(force) / float(force.max())
    return min(max(share, LEAST_LEVEL), MOST_LEVEL)


def onset(time: Floats, force: Floats, share: float) -> float:
    """Return the first time at which two consecutive forces exceed a share of the peak."""
    base = min(float(np.median(force[:FIRST])), 0.5 * float(force.max()))
    above = force > base + share * (force.max() - base)
    both = np.flatnonzero(above[:-1] & above[1:])
    return float(time[both[0]] if len(both) else time[np.argmax(force)])


def lags(measured: Measurement, clock: Floats, computed: Floats) -> list[float]:
    """Return likely delays of a measurement.

    They are the difference of the onsets and the lags of the largest cross-correlations. `clock`
    has the equally spaced times of the computed force.
    """
    share = level(measured.force)
    delays = [onset(measured.time, measured.force, share) - onset(clock, computed, share)]
    dt = float(clock[1] - clock[0])
    start = float(measured.time[0])
    count = math.ceil((float(measured.time[-1]) - start) / dt) + 1
    grid = start + dt * np.arange(min(count, LONGEST))
    force = np.interp(grid, measured.time, measured.force)
    size = len(grid) + len(computed)
    spectrum = np.fft.rfft(force, size) * np.conj(np.fft.rfft(computed, size))
    # Element n + len(computed) is the sum of force[i + n] computed[i].
    products = np.roll(np.fft.irfft(spectrum, size), len(computed))
    shift = start - float(clock[0]) + dt * (np.arange(size) - len(computed))
    inner = products[1:-1]
    peaks = 1 + np.flatnonzero((inner > products[:-2]) & (inner >= products[2:]))
    for peak in peaks[np.argsort(-products[peaks])][:LAGS]:
        delays.append(float(shift[peak]))
    return delays


def _duration_of_top(time: Floats, force: Floats) -> float:
    """Return the time from the first to the last value above half of the peak."""
    top = time[force > 0.5 * force.max()]
    return float(np.ptp(top)) if len(top) else 0.0


def check_measured(
    measured: Measurement, clock: Floats, computed: Floats, units: Mapping[str, str]
) -> float:
    """Compare peak and duration of a measurement with the run of the deck.

    Returns the time for which the computed force is above half of its peak. Raises StudyError or
    IdentifyError if the measurement can't be the force of this impact.
    """
    name, force, peak = measured.name, measured.force, float(computed.max())
    width = _duration_of_top(clock, computed)
    if measured.column != "force":
        text = "has a column transducer and no force; the contact force is fitted"
        raise StudyError(f"{name} {text}")
    if not (peak > 0.0 and width > 0.0):
        raise StudyError("the deck's own run has no contact force to compare with; check its ROD")
    if np.ptp(force) <= FLAT * np.abs(force).max():
        text = f"the measured force is constant, {np.mean(force):.3g}"
        raise IdentifyError(f"{name}: {text}; it contains no contact")
    if -force.min() > force.max():
        raise StudyError(
            f"{name}: the contact force is negative; it is positive in compression; write "
            "`columns` as time,-force"
        )
    if np.count_nonzero(force > 0.5 * force.max()) < TOP_POINTS:
        raise StudyError(f"{name} has fewer than {TOP_POINTS} points above half of its peak")
    measured_width = _duration_of_top(measured.time, force)
    for dimension, measured_value, expected in (
        ("force", force.max(), peak),
        ("time", measured_width, width),
    ):
        if not 1.0 / OFF < measured_value / expected < OFF:
            name_of_value = {"force": "peak force", "time": "time above half of the peak"}[
                dimension
            ]
            unit = units.get(dimension, "")
            cause = _likely_cause(dimension, measured_value / expected, units)
            usual = f"the deck's own run gives {expected:.3g} {unit}".rstrip()
            raise StudyError(
                f"{name}: the {name_of_value} is {measured_value:.3g}, {usual}; {cause}"
            )
    return width


def _likely_cause(dimension: str, ratio: float, units: Mapping[str, str]) -> str:
    """Describe the likely cause of a measurement that is off by a ratio, and the remedy."""
    factors, unit_of_deck = KNOWN[dimension], units.get(dimension, "")
    text = f"is the column in another unit of {dimension}?  Name the unit in its header"
    if unit_of_deck in factors:
        unit = min(
            factors,
            key=lambda name: abs(math.log(ratio * factors[name] / factors[unit_of_deck])),
        )
        if 0.2 < ratio * factors[unit] / factors[unit_of_deck] < 5.0:
            text = f"the column seems to be in {unit}; name the unit in its header"
    return f"{text}, or exchange time and force if they are swapped"
