"""Faults of measured records that betray their instrument: clipping, few bits, lost samples, hum.

A fault is found by what a free signal does not do: it does not stay at its largest value and leave
it by a jump, take few equally spaced values, or hold a value in steep parts. What rounding
explains, such as equal values at a flat top, is no fault.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fecm._measured_tables import UNITS, plain_unit
from fecm._typing import Bools, Floats

ACTIVE = 0.1  # share of the range beyond which a value belongs to the event
FEWEST = 16  # points of the event from which on a record is judged
# Clipping.
AT_LIMIT = 5  # fewest points at the limit
SHARE_AT_LIMIT = 0.03  # of the points of the event
STEEP = 10.0  # fall beside the limit, over the resolution
# Quantisation.
BITS = 8
REPEATED = 0.9  # largest number of different values, over the points of the event
REGULAR = 0.98  # share of differences that are multiples of the smallest one
# Held values.
HELD = 0.3  # share of points that repeat the value before
STUCK = 6  # equal values in a row
JUMP = 5.0  # usual change of value, over the resolution
# Gaps in the times.
GAP = 1.5  # step over the usual one
MOST_GAPS = 0.1  # share of the steps from which on the sampling is irregular on purpose
EQUAL = 0.05  # relative difference of equal steps
# The signal without the event.
HUM = (50.0, 60.0)  # Hz
DRIFT = 0.03  # change of the baseline, over the peak
CONTACT = 0.25  # change that is another contact
SURE = 6.0  # standard errors
EXPLAINED = 0.4  # share of the variance
FEWEST_QUIET = 10
HIGH = 0.3  # share of the range that the event exceeds whatever the baseline does
MARGIN = 0.3  # of the duration of these values, which the event lasts longer on either side


def record_faults(
    name: str, values: Floats, time: Floats | None = None, *, clock: str = "", ends: bool = True
) -> list[str]:
    """Describe the faults of a record, with cause and remedy; empty for a record without faults.

    Parameters
    ----------
    name : str
        Name of the quantity.
    values : ndarray (n,)
        Record, in any unit.
    time : ndarray (n,), optional
        Times; without them gaps and the baseline are not judged.
    clock : str
        Unit of the times; hum is not looked for if it is unknown.
    ends : bool
        Whether the quantity is 0 again after the event, as a contact force is. Strains ring.
    """
    event = _event(values)
    if np.count_nonzero(event) < FEWEST:
        return []
    step = _resolution(values[np.abs(values) > 0.5 * np.abs(values).max()])
    faults = [*_limits(name, values, event, step)]
    grid = "" if faults else _quantised(name, values, event, _resolution(values))
    faults += [grid] if grid else [] if faults else [*_held(name, values, event, step)]
    if time is not None:
        unit = UNITS["time"].get(plain_unit(clock))
        second = 1.0 / unit if unit else 0.0
        faults += _gaps(name, time, event)
        faults += _baseline(name, values, time, second, ends=ends)
    return faults


def _event(values: Floats) -> Bools:
    """Return which values are away from the rest, which is the median of the first ones."""
    base = float(np.median(values[: max(3, len(values) // 100)]))
    return np.asarray(np.abs(values - base) > ACTIVE * np.ptp(values))


def _resolution(values: Floats) -> float:
    """Return the smallest difference of two different values, above rounding errors."""
    different = np.unique(values)
    steps = np.diff(different)
    steps = steps[steps > 1e-9 * np.abs(values).max()]
    return float(steps.min()) if len(steps) else 0.0


def _limits(name: str, values: Floats, event: Bools, step: float) -> Iterator[str]:
    """Yield the limits at which a record is cut off."""
    count, size = np.count_nonzero(event), float(np.ptp(values))
    for sign, side in ((1.0, "largest"), (-1.0, "smallest")):
        signed = sign * values
        limit = float(signed.max())
        at = np.flatnonzero(signed >= limit - 1e-9 * size)
        if not (limit and event[at].all()) or len(at) < max(AT_LIMIT, SHARE_AT_LIMIT * count):
            continue
        rows = max(np.split(at, np.flatnonzero(np.diff(at) > 1) + 1), key=len)
        before = signed[max(0, rows[0] - len(rows)) : rows[0]]
        behind = signed[rows[-1] + 1 : rows[-1] + 1 + len(rows)]
        falls = [limit - float(part.min()) for part in (before, behind) if len(part)]
        is_largest = abs(limit) == np.abs(values).max()
        if len(rows) < AT_LIMIT or len(falls) < (1 if is_largest else 2):
            continue  # a state of rest at the start or the end
        if min(falls) <= STEEP * step:
            continue  # a flat top of rounded values
        yield (
            f"{len(at)} of the {count} points of {name} are exactly at its {side} value, "
            f"{sign * limit:.4g}: the record is clipped at the range of the amplifier or "
            "recorder; its peak is not known: repeat the test with a larger range"
        )


def _quantised(name: str, values: Floats, event: Bools, step: float) -> str:
    """Describe a record of few equally spaced values; empty for others."""
    levels = np.unique(values[event])
    if not step or np.ptp(values) / step > 2**BITS or len(levels) > REPEATED * event.sum():
        return ""
    ratio = np.diff(np.unique(values)) / step
    if np.mean(np.abs(ratio - np.round(ratio)) < 0.05) < REGULAR:
        return ""
    return (
        f"{name} has steps of {step:.3g}, {step / float(np.ptp(values)):.1%} of its range: it is "
        f"quantised by a recorder of {BITS} bits or by rounding; errors below a step are not seen: "
        "use a smaller range of the recorder, more bits, or export more digits"
    )


def _held(name: str, values: Floats, event: Bools, step: float) -> Iterator[str]:
    """Yield samples that repeat the one before in steep parts."""
    change = np.abs(np.diff(values))
    inner = event[1:] & event[:-1] & (values[1:] != 0.0)  # without contact a force is 0
    moving = change[inner & (change > 0.0)]
    if not len(moving) or float(np.median(moving)) < JUMP * step:
        return  # rounding explains equal neighbours
    equal = (change == 0.0) & inner
    share = np.count_nonzero(equal) / np.count_nonzero(inner)
    ends = np.flatnonzero(np.diff(np.concatenate(([0], equal.astype(int), [0]))))
    longest = max(
        (int(b - a) + 1 for a, b in ends.reshape(-1, 2) if _passes(values, a, b, step)), default=0
    )
    if share >= HELD:
        yield (
            f"{share:.0%} of the points of {name} repeat the point before: the converter or the "
            "export held values; keep one point of each, with its own time"
        )
    elif longest >= STUCK:
        yield (
            f"{name} stands still for {longest} points in a steep part: samples were lost and "
            "replaced by the last one; delete the repeated points"
        )


def _passes(values: Floats, first: int, last: int, step: float) -> bool:
    """Return whether a record rises or falls through a held value, from `first` to `last`."""
    reach = last - first + 1
    before = values[first] - values[max(0, first - reach)]
    behind = values[min(len(values) - 1, last + reach)] - values[last]
    return bool(before * behind > 0.0 and min(abs(before), abs(behind)) > JUMP * step)


def _is_smooth(rest: Floats) -> bool:
    """Return whether neighbours are alike, as those of a signal are and those of noise are not."""
    power = float(rest @ rest)
    return power > 0.0 and float(rest[1:] @ rest[:-1]) > 0.5 * power


def _gaps(name: str, time: Floats, event: Bools) -> Iterator[str]:
    """Yield gaps in times that are equally spaced otherwise."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    wide = steps > GAP * usual
    even = np.abs(steps - usual) <= EQUAL * usual
    during = wide & (event[1:] | event[:-1])
    if not during.any() or wide.mean() > MOST_GAPS or np.mean(even | wide) < REGULAR:
        return
    row = int(np.argmax(np.where(during, steps, 0.0)))
    yield (
        f"{np.count_nonzero(during)} gaps in the times of {name}, the largest of "
        f"{steps[row] / usual:.3g} steps at {time[row]:.4g}: samples were dropped, and the curve "
        "is a straight line there; export the record again without gaps"
    )


def _baseline(
    name: str, values: Floats, time: Floats, second: float, *, ends: bool
) -> Iterator[str]:
    """Yield hum or drift of a record where the quantity is 0: before the event, and after it."""
    rows = np.flatnonzero(np.abs(values - np.median(values)) > HIGH * np.ptp(values))
    margin = max(1, round(MARGIN * (rows[-1] - rows[0])))
    numbers = np.arange(len(values))
    before, after = numbers < rows[0] - margin, numbers > rows[-1] + margin
    parts = [part for part in (before, after & ends) if np.count_nonzero(part) >= FEWEST_QUIET]
    if not parts:
        return
    quiet = np.any(parts, axis=0)
    peak = float(np.abs(values).max())
    trend = np.polynomial.Polynomial.fit(time[quiet], values[quiet], 1)
    of_trend = float(np.var(values[quiet] - trend(time[quiet])))
    for frequency in HUM if second else ():
        if np.ptp(time[quiet]) < second / frequency:
            continue
        phase = 2.0 * np.pi * frequency * time[quiet] / second
        basis = np.column_stack([np.ones(len(phase)), np.cos(phase), np.sin(phase)])
        solution = np.linalg.lstsq(basis, values[quiet], rcond=None)[0]
        rest = float(np.var(values[quiet] - basis @ solution))
        amplitude = float(np.hypot(solution[1], solution[2]))
        error = SURE * np.sqrt(2.0 * rest / len(phase))
        if amplitude > max(DRIFT * peak / 2.0, error) and rest < (1.0 - EXPLAINED) * of_trend:
            yield (
                f"{name} has mains hum: {frequency:g} Hz with an amplitude of "
                f"{amplitude / peak:.1%} of the peak before and after the event; shield and earth "
                "the cables, or subtract it"
            )
            return
    if not ends:
        return
    low, high, error = [], [], 0.0
    for part in parts:
        line = np.polynomial.Polynomial.fit(time[part], values[part], 1)
        shown = line(time[part][[0, -1]])
        low.append(float(shown.min()))
        high.append(float(shown.max()))
        rest = values[part] - line(time[part])
        scatter = float(np.std(rest))
        if _is_smooth(rest) and scatter > np.ptp(shown) / SURE:
            return  # another contact, and no drift
        error = max(error, 2.0 * scatter / np.sqrt(np.count_nonzero(part)))
    drift = max(high) - min(low)
    if max(DRIFT * peak, SURE * error) < drift < CONTACT * peak:
        yield (
            f"the baseline of {name} moves by {drift / peak:.1%} of the peak beside the event: "
            "drift of the amplifier, or mains hum, whose period is 20 ms or 17 ms; measure the "
            "zero longer, and subtract it"
        )
