"""Test of a projectile's rod under a force pulse."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fecm._errors import StudyError, warn
from fecm._typing import Floats
from fecm.authoring.laminate import system_asked
from fecm.authoring.parameters import check_positive
from fecm.deck.model import Deck
from fecm.deck.units import unit_names, units_of
from fecm.mechanics.projectile import (
    INTEGRATORS,
    MASSES,
    Integrator,
    MassMatrix,
    Rod,
)
from fecm.problem.loading import sole_problem
from fecm.problem.parts import build_projectile, build_station, rod_of_deck
from fecm.studies.rod_test.filters import Filter, filter_of
from fecm.studies.rod_test.pulse_test import (
    Pulse,
    RodHistory,
    default_time_step,
    pulse_of,
    simulate_pulse,
    table_pulse,
)

MOST_TRAVELS = 1000.0  # travel times of a wave along the rod in a usual pulse, at most


class Struck(NamedTuple):
    """Rod under a pulse, with its default station and time step."""

    rod: Rod
    station: float
    dt: float | None
    units: dict[str, str]


@dataclass(frozen=True, eq=False)
class PulseTest(RodHistory):
    """History of a rod under a pulse; ``str()`` is the summary of `fecm rod`.

    Attributes
    ----------
    rod : Rod
        The rod.
    time : ndarray (rows,)
        Times from 0.
    applied : ndarray (rows,)
        Force on the struck end, positive in compression.
    stations : tuple of float
        Distances from the struck end.
    forces : ndarray (rows, stations)
        Forces at the stations.
    accelerations : ndarray (rows, 3)
        Accelerations of the struck end, the middle and the far end.
    filtered : ndarray (rows, stations) or None
        Filtered forces; None without a filter.
    units : dict of str to str
        Names of the units; empty if they are unknown.
    """

    rod: Rod
    filtered: Floats | None = None
    units: dict[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<fecm pulse test of a rod: {len(self.time)} rows, stations {self.stations}>"

    def __str__(self) -> str:
        size = f"length {self.rod.length:g}, mass {self.rod.total_mass:.5g}"
        lines = [
            f"rod               {self.rod.elements} elements, {size}",
            f"steps             {len(self.time) - 1} of {self.time[1]:g}",
            f"applied           {self._peak(self.applied)}",
        ]
        columns = self.stations, self.forces.T, self.mean_ratios
        for x, force, ratio in zip(*columns, strict=True):
            about = f"mean ratio to the applied {ratio:.3f}"
            lines.append(f"force at {x:<8.4g} {self._peak(force)}; {about}")
        return "\n".join(lines)

    def _peak(self, force: Floats) -> str:
        row = abs(force).argmax()
        return f"peak {force[row]:.6g} at time {self.time[row]:.6g}"


def pulse_test(
    rod: Rod | str | Path | Deck,
    pulse: str | Path | tuple[ArrayLike, ArrayLike],
    *,
    dt: float | None = None,
    duration: float | None = None,
    stations: Iterable[float] = (),
    filter: str | Filter | None = None,
    mass_matrix: MassMatrix = "lumped",
    integrator: Integrator = "wilson",
    units: str | None = None,
) -> PulseTest:
    """Compute forces and accelerations of a free rod under a pulse on one end (report, 4.2).

    Parameters
    ----------
    rod : Rod, str, Path or Deck
        The rod, or a deck with a single problem, whose projectile is a rod.
    pulse : str, Path or tuple of array_like
        ``"gauss:F0,TAU,B"``, F0 exp(-(t - TAU)^2/4 B^2); ``"sine:F0,B"``, F0 sin(pi t/B) until B; a
        table of time and force; or arrays of both (points,). A table is linear between its points.
    dt : float, optional
        Time step; by default the deck's, or 0.8 of the travel time of a wave through an element.
    duration : float, optional
        Simulated time; by default TAU + 10 B, 1.5 B, or the last time of the table.
    stations : iterable of float
        Distances from the struck end at which forces are computed; by default the middle of a
        `Rod`, or the transducer of a deck.
    filter : str, optional
        Filter of the forces at the stations: ``"first-order:RISE"``, ``"moving-average:RISE"`` or
        ``"cfc:CLASS"``.
    mass_matrix : str
        ``"lumped"``, as in the report's program, or ``"consistent"``.
    integrator : str
        ``"wilson"``, as in the report's program, or ``"average-acceleration"``.
    units : str, optional
        Units of a `Rod`, as in ``"mm-N-s"``. A filter with a class needs them.

    Returns
    -------
    PulseTest
        The history.

    Raises
    ------
    DeckError
        If the deck has errors.
    StudyError
        If the pulse, the filter or a station is invalid, the projectile is a rigid mass, there are
        more than two million steps, or the motion is not finite.
    ValueError
        If a number is not positive, or the deck has several problems or none.
    OSError
        If the table can't be read.

    Examples
    --------
    >>> import fecm
    >>> rod = fecm.Rod.cylinder(1.0, 0.625, 30e6, 7.33e-4)
    >>> test = fecm.pulse_test(rod, "gauss:1000,200e-6,40e-6", stations=[0.5])
    >>> print(f"mean ratio to the applied force: {test.mean_ratios[0]:.3f}")  # report: 0.498
    mean ratio to the applied force: 0.498
    """
    check_positive(dt=dt, duration=duration)
    for name, value, choices in (
        ("mass_matrix", mass_matrix, MASSES),
        ("integrator", integrator, INTEGRATORS),
    ):
        if value not in choices:
            raise StudyError(f"`{name}` is {value!r}, none of {', '.join(choices)}")
    if isinstance(rod, Rod):
        struck = uniform_rod(rod, units)
    elif units is not None:
        raise StudyError("the deck has its own `units`; leave them out")
    else:
        struck = rod_of(sole_problem(rod, warns=False).deck)
    transducer = filter_of(filter) if isinstance(filter, str) else filter
    return simulate_rod_test(
        struck,
        _pulse(pulse, struck.units),
        dt,
        duration,
        tuple(stations),
        transducer,
        mass_matrix,
        integrator,
    )


def uniform_rod(rod: Rod, units: str | None) -> Struck:
    """Return the test of a uniform rod in a system of units."""
    system = system_asked(units)
    return Struck(rod, rod.length / 2.0, None, units_of(system) if system else {})


def rod_of(deck: Deck) -> Struck:
    """Return the rod of a checked deck.

    Raises StudyError if the projectile is not a rod.
    """
    rod = rod_of_deck(deck)
    if rod is None:
        kind = build_projectile(deck).kind
        raise StudyError(f"the projectile is a {kind}; a pulse needs a rod")
    node = build_station(deck, rod).node
    station = (node - 1) * rod.length / rod.elements
    steps = [macro.value for macro in deck.macros if macro.word == "DT" and macro.value > 0.0]
    return Struck(rod, station, steps[0] if steps else None, unit_names(deck))


def simulate_rod_test(
    struck: Struck,
    pulse: Pulse,
    dt: float | None,
    duration: float | None,
    stations: tuple[float, ...],
    transducer: Filter | None,
    mass_matrix: MassMatrix,
    integrator: Integrator,
) -> PulseTest:
    """Simulate a test.

    Raises StudyError like :func:`pulse_test`.
    """
    rod = struck.rod.with_mass(mass_matrix)
    travels = pulse.duration / (rod.length * math.sqrt(rod.density / rod.modulus))
    if travels > MOST_TRAVELS:
        warn(
            f"the pulse lasts {travels:.2g} times the travel time of a wave along the rod; if its "
            "times are in another unit, name it in the header, as in `time (ms)`"
        )
    history = simulate_pulse(
        rod,
        pulse,
        dt or struck.dt or default_time_step(rod),
        duration or pulse.duration,
        tuple(dict.fromkeys(stations)) or (struck.station,),
        integrator,
    )
    filtered = None
    if transducer is not None:
        clock = struck.units.get("time", "")
        sensor = transducer.in_unit(clock)
        sensor.warn_without_effect(history.time, clock)
        filtered = sensor(history.time, history.forces)
    return PulseTest(**vars(history), rod=rod, filtered=filtered, units=struck.units)


def _pulse(pulse: str | Path | tuple[ArrayLike, ArrayLike], units: Mapping[str, str]) -> Pulse:
    """Return the pulse of a text, a table or arrays."""
    if isinstance(pulse, str | Path):
        return pulse_of(str(pulse), units)
    try:
        time, force = (np.asarray(values, dtype=np.float64) for values in pulse)
    except (TypeError, ValueError):
        raise StudyError("a pulse is a text, a path, or arrays of time and force") from None
    if time.ndim != 1 or time.shape != force.shape or len(time) < 2:
        raise StudyError("time and force of a pulse are two arrays of the same length, 2 or more")
    if not (np.isfinite(force).all() and np.isfinite(time).all() and (np.diff(time) > 0.0).all()):
        raise StudyError("the times of a pulse must increase, and all values must be finite")
    if time[-1] <= 0.0:
        raise StudyError("the pulse ends before time 0")
    return table_pulse(time, force)
