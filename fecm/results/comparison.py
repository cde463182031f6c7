"""Comparison of a measured force with the force of a result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fecm._errors import StudyError, warn
from fecm._measured_tables import IN_MEMORY, Record, factor, read_table
from fecm._record_faults import record_faults
from fecm._typing import Floats
from fecm.results.stored import Stored

LEAST = 0.05  # of the peak, above which there is a contact
TRIGGER = 0.2  # time between two rises, over the time above half of the peak

# A CSV file, or times and forces.
Source = str | Path | tuple[Any, Any]


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured force in the deck's units."""

    name: str
    column: str  # what it is compared with: ``"force"`` or ``"transducer"``
    time: Floats  # (points,), increasing
    force: Floats  # (points,)
    faults: tuple[str, ...] = ()  # of the instrument, with causes and remedies
    record: Record = IN_MEMORY

    @property
    def quantity(self) -> str:
        """Name of the column in words."""
        return "contact force" if self.column == "force" else self.column

    def corrected(self, delay: float, offset: float) -> Measurement:
        """Return the measurement without a delay of its times and an offset of its force.

        The signs are as in ``fecm identify``: `delay` is the measured time at which the
        projectile touches the plate, `offset` is the measured force without a contact. Raises
        StudyError if one is not finite.

        >>> late = Measurement("m", "force", np.array([1.0, 2.0]), np.array([5.0, 6.0]))
        >>> late.corrected(1.0, 5.0).force
        array([0., 1.])
        """
        if not (math.isfinite(delay) and math.isfinite(offset)):
            raise StudyError(f"delay and offset must be finite, not {delay:g} and {offset:g}")
        return replace(self, time=self.time - delay, force=self.force - offset)


@dataclass(frozen=True)
class Comparison:
    """Force of a result, interpolated at measured times, against the measured force.

    ``str()`` summarises it in one line.

    Attributes
    ----------
    points : int
        Number of measured times within the times of the result.
    begin, end : float
        The first and the last of them.
    peak, measured_peak : float
        Largest forces.
    impulse, measured_impulse : float
        Time integrals of the forces, linear between the points.
    duration, measured_duration : float
        Times from the first to the last point at which the forces exceed 5 % of their peaks.
    rms : float
        Root of the mean square of the difference, force.
    correlation : float
        Pearson's coefficient; NaN if one of the forces is constant.
    units : dict of str
        Names of the units; empty if the deck names none.
    doubts : tuple of str
        Faults of the record, such as clipping, with causes and remedies.
    """

    points: int
    begin: float
    end: float
    peak: float
    measured_peak: float
    impulse: float
    measured_impulse: float
    duration: float
    measured_duration: float
    rms: float
    correlation: float
    units: Mapping[str, str]
    doubts: tuple[str, ...] = ()

    def __str__(self) -> str:
        clock, pound = (self.units.get(name, "") for name in ("time", "force"))
        both = f"{pound}*{clock}" if clock and pound else ""
        parts = (
            f"{self.points} points from time {self.begin:g} to {self.end:g} {clock}".rstrip(),
            _against("peak", self.peak, self.measured_peak, pound),
            _against("impulse", self.impulse, self.measured_impulse, both),
            f"rms of the difference {self.rms:.4g} {pound}".rstrip(),
            f"correlation {self.correlation:.4f}",
        )
        return ", ".join(parts)


def _against(name: str, computed: float, measured: float, unit: str) -> str:
    """Format two values and their relative difference."""
    text = f"{name} {computed:.4g} against {measured:.4g} {unit}".rstrip()
    return f"{text} ({computed / measured - 1.0:+.1%})" if measured else text


def measurement_of(
    source: Source,
    units: Mapping[str, str],
    columns: Sequence[str] = (),
    stated: Sequence[str] = (),
) -> Measurement:
    """Read a measured force from a file, or from two arrays of time and force.

    A file has time and force, or time and transducer. `units` has the names of the deck's units,
    which may be empty. A file that names its units is converted to the deck's units. `columns` has
    the names or the numbers (from 1) of the columns of time and force. `stated` has the units of a
    measurement that names none. Raises StudyError if the file is invalid, a unit is unknown, the
    times do not increase, or times and forces are not finite numbers of equal count. Raises OSError
    if the file can't be read.
    """
    for what, pair in (("columns", columns), ("units", stated)):
        if isinstance(pair, str) or len(pair) not in (0, 2) or not all(map(_is_text, pair)):
            raise StudyError(f"`{what}` is {pair!r}, not two names, of time and force")
    if isinstance(source, str | Path):
        return _from_file(Path(source), units, columns, stated)
    if columns:
        raise StudyError("`columns` selects columns of a file, and the measurement is arrays")
    try:
        time, force = (np.asarray(values, dtype=float) for values in source)
    except (TypeError, ValueError):
        raise StudyError("a measurement is a CSV file, or a pair of times and forces") from None
    if time.ndim != 1 or time.shape != force.shape or len(time) < 2:
        raise StudyError(
            f"a measurement needs as many times as forces, two at least: {time.shape} and "
            f"{force.shape} were given"
        )
    if not (np.isfinite([time, force]).all() and (np.diff(time) > 0.0).all()):
        raise StudyError("a measurement needs finite numbers at increasing times")
    factors = [
        factor("the measurement", unit, units.get(dimension, ""), dimension)
        for unit, dimension in zip(stated, ("time", "force"), strict=False)
    ] or [1.0, 1.0]
    return _with_faults(
        Measurement("measured", "force", time * factors[0], force * factors[1]), units
    )


def _with_faults(measured: Measurement, units: Mapping[str, str]) -> Measurement:
    """Return a measurement with the faults of its record."""
    faults = record_faults(
        f"the {measured.quantity}", measured.force, measured.time, clock=units.get("time", "")
    )
    return replace(measured, faults=tuple(f"{measured.name}: {fault}" for fault in faults))


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _from_file(
    path: Path, units: Mapping[str, str], columns: Sequence[str], stated: Sequence[str]
) -> Measurement:
    table = read_table(path)
    column = "transducer" if table.has("transducer") and not table.has("force") else "force"
    columns_found = table.find(("time", column), columns, units)
    time, force = table.values(columns_found, units, stated=stated, increasing="time")
    measured = Measurement(table.record.file, column, time, force, record=table.record)
    return _with_faults(measured, units)


def _doubt_trigger(stored: Stored, measured: Measurement, clock: Floats) -> None:
    """Warn if the measured force rises much earlier or later than the force of the result."""
    force = np.append(0.0, stored.whole(f"history/{measured.column}"))
    if force.max() <= 0.0 or measured.force.max() <= 0.0:
        return
    above = force >= 0.5 * force.max()
    rise = measured.time[(measured.force >= 0.5 * measured.force.max()).argmax()]
    late = float(rise - clock[above.argmax()])
    if abs(late) > TRIGGER * np.count_nonzero(above) / len(clock) * clock[-1]:
        unit, word = stored.units.get("time", ""), "after" if late > 0.0 else "before"
        warn(
            f"{measured.name} rises {abs(late):.3g} {unit}".rstrip()
            + f" {word} the result; a delay of {late:.3g} (--delay, `delay=`) removes it"
        )


def _duration(time: Floats, force: Floats) -> float:
    """Return the time from the first to the last point at which a force is well above zero."""
    above = time[force > LEAST * max(float(force.max()), 0.0)]
    return float(above[-1] - above[0]) if len(above) else 0.0


def compare_force(stored: Stored, measured: Measurement) -> Comparison:
    """Compare the force on the whole plate with a measured force, at the measured times of the run.

    Raises StudyError if the result has no impact, or if fewer than two times are in both.
    """
    if "history/force" not in stored:
        raise StudyError("the result has no history to compare with: no impact step was taken")
    clock = np.append(0.0, stored["history/time"])  # at rest before the first step
    there = (measured.time >= 0.0) & (measured.time <= clock[-1])
    if np.count_nonzero(there) < 2:
        raise StudyError(
            f"{measured.name} has fewer than two times within the run of the result: measured from "
            f"{measured.time[0]:g} to {measured.time[-1]:g}, computed from 0 to {clock[-1]:g}; "
            "check its unit of time"
        )
    time, force = measured.time[there], measured.force[there]
    computed = np.append(0.0, stored.whole(f"history/{measured.column}"))
    interpolated = np.interp(time, clock, computed)
    _doubt_trigger(stored, measured, clock)
    for fault in measured.faults:
        warn(fault)
    weights = 0.5 * (np.diff(time, prepend=time[0]) + np.diff(time, append=time[-1]))
    varies = np.ptp(interpolated) > 0.0 and np.ptp(force) > 0.0
    return Comparison(
        points=len(time),
        begin=float(time[0]),
        end=float(time[-1]),
        peak=float(interpolated.max()),
        measured_peak=float(force.max()),
        impulse=float(weights @ interpolated),
        measured_impulse=float(weights @ force),
        duration=_duration(time, interpolated),
        measured_duration=_duration(time, force),
        rms=float(np.sqrt(np.mean((interpolated - force) ** 2))),
        correlation=float(np.corrcoef(interpolated, force)[0, 1]) if varies else math.nan,
        units=stored.units,
        doubts=measured.faults,
    )
