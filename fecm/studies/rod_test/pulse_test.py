"""Free rod under a force pulse, and the calibration of its transducer, report section 4.2.

The pulse acts on one end of the rod from t = 0 (figures 4.7 to 4.9). The rod has the elements, mass
and integrator of the projectile in an impact; x is the distance from the struck end. Forces are
positive in compression, accelerations in the direction of the pulse.

The calibration gives the sensitivity of the transducer from the acceleration of a target. The
output of the transducer is V_F = c_F F. An accelerometer on a free target of mass m has the output
V_a = c_a a, and F = m a (equations 4-1 to 4-3). The slope of V_F over V_a gives
c_F = (c_a / m) V_F / V_a (equation 4-4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fecm._errors import StudyError
from fecm._measured_tables import NO_UNITS, read_table
from fecm._typing import Floats
from fecm.mechanics.projectile import STEPS, WILSON, Rod, RodState

# Pulses: the two of the report, and tables --------------------------------------------------------

FORMS = {"gauss": ("F0", "TAU", "B"), "sine": ("F0", "B")}
USAGE = "gauss:F0,TAU,B, sine:F0,B or a CSV file of time and force"


class Pulse(NamedTuple):
    """Force as a function of an array of times, and the default duration of a test."""

    force: Callable[[Floats], Floats]
    duration: float


def gauss_pulse(peak: float, tau: float, b: float) -> Pulse:
    """Return the exponential pulse F0 exp(-(t - tau)^2 / 4 b^2), equation 4-5.

    It starts at t = 0 with a jump of F0 exp(-tau^2 / 4 b^2), and has fallen to 1/500 of its peak at
    the end of the test.
    """
    return Pulse(
        lambda time: np.asarray(peak * np.exp(-(((time - tau) / (2.0 * b)) ** 2))),
        max(0.0, tau) + 10.0 * b,
    )


def sine_pulse(peak: float, b: float) -> Pulse:
    """Return the half wave F0 sin(pi t / b), equation 4-6; the rod rings for b/2 after it."""
    return Pulse(
        lambda time: np.where((time >= 0.0) & (time < b), peak * np.sin(np.pi * time / b), 0.0),
        1.5 * b,
    )


def table_pulse(times: Floats, forces: Floats) -> Pulse:
    """Return the pulse of a table of forces: linear between rows, zero before and after."""
    return Pulse(
        lambda time: np.asarray(np.interp(time, times, forces, left=0.0, right=0.0)),
        float(times[-1]),
    )


def pulse_of(text: str, units: Mapping[str, str] = NO_UNITS) -> Pulse:
    """Parse ``gauss:F0,TAU,B``, ``sine:F0,B``, or the path of a CSV file of time and force.

    A file that names its units is converted to `units`. Raises StudyError if the text is anything
    else, a width is not positive, or a table is invalid.
    """
    kind, colon, rest = text.partition(":")
    if not colon or kind not in FORMS:
        return _pulse_of_file(text, units)
    names = FORMS[kind]
    try:
        values = [float(part) for part in rest.split(",")]
    except ValueError:
        values = []
    if len(values) != len(names) or not all(map(math.isfinite, values)):
        raise StudyError(f"{text}: {kind} takes {len(names)} numbers, {kind}:{','.join(names)}")
    if not values[-1] > 0.0:
        raise StudyError(f"{text}: the width B must be positive")
    return gauss_pulse(*values) if kind == "gauss" else sine_pulse(*values)


def _pulse_of_file(text: str, units: Mapping[str, str]) -> Pulse:
    """Read the pulse in a CSV file."""
    path = Path(text)
    if not path.is_file():
        raise StudyError(f"{text} is neither a file nor a pulse; use {USAGE}")
    table = read_table(path)
    columns = table.find(("time", "force"), units=units)
    time, force = table.values(columns, units, increasing="time")
    if time[-1] <= 0.0:
        raise StudyError(f"{path}: the pulse ends before time 0")
    return table_pulse(time, force)


# The rod ------------------------------------------------------------------------------------------

MOST_STEPS = 2_000_000
PART = 0.8  # default time step, over the travel time of a wave through an element
COUNTS = 0.01  # share of the pulse's peak above which a row counts in the mean ratio

POINTS = ("struck_end", "middle", "far_end")


@dataclass(frozen=True, eq=False)
class RodHistory:
    """History of a rod under a pulse."""

    time: Floats  # (rows,), from 0
    applied: Floats  # force on the struck end, (rows,)
    stations: tuple[float, ...]  # distances from the struck end
    forces: Floats  # at the stations, (rows, stations)
    accelerations: Floats  # of the struck end, the middle and the far end, (rows, 3)

    @property
    def ratios(self) -> Floats:
        """Force at the stations over the applied force, (rows, stations); NaN without a force."""
        with np.errstate(all="ignore"):
            ratios = self.forces / self.applied[:, None]
        return np.where(self.applied[:, None] == 0.0, np.nan, ratios)

    @property
    def mean_ratios(self) -> Floats:
        """Mean ratio over all rows with a pulse above 1 % of its peak, (stations,).

        The report gives 0.498 for its exponential pulse (section 4.2).
        """
        size = np.abs(self.applied)
        counted = size > COUNTS * size.max()
        if not counted.any():
            return np.full(len(self.stations), np.nan)
        return np.asarray(self.ratios[counted].mean(axis=0))


def default_time_step(rod: Rod) -> float:
    """Return 0.8 of the travel time of a wave through an element, to two digits."""
    return float(f"{PART * rod.length / rod.elements * math.sqrt(rod.density / rod.modulus):.2g}")


def simulate_pulse(
    rod: Rod,
    pulse: Pulse,
    dt: float,
    duration: float,
    stations: Sequence[float],
    integrator: str = WILSON,
) -> RodHistory:
    """Compute the response of a free rod, initially at rest, to a pulse at x = 0.

    As in an impact, the force is linear between two steps, and extrapolated linearly to t + theta
    dt. If the pulse starts with a jump, the rod has the corresponding acceleration at t = 0. The
    last step ends at or after the duration. The integrator is a key of
    :data:`fecm.mechanics.projectile.STEPS`. Raises StudyError if a station is not on the rod, there
    are more than two million steps, or the motion is not finite.
    """
    for x in stations:
        if not 0.0 <= x <= rod.length:
            raise StudyError(f"the station {x:g} is not on the rod of length {rod.length:g}")
    if duration / dt > MOST_STEPS:
        raise StudyError(
            f"{duration:g} in steps of {dt:g} is more than {MOST_STEPS:,} steps: increase the "
            "time step or reduce the duration"
        )
    with np.errstate(all="ignore"):  # overflow is reported below
        steps = max(1, math.ceil(duration / dt * (1.0 - 1e-12)))
        time = np.asarray(dt * np.arange(steps + 1.0))
        applied = pulse.force(time)
        try:
            rows = _march(rod, applied, dt, stations, integrator)
        except np.linalg.LinAlgError:
            rows = np.full((1, 1), np.nan)
    if not (np.isfinite(rows).all() and np.isfinite(applied).all()):
        raise StudyError("the motion is not finite: check the numbers and their units")
    count = len(stations)
    return RodHistory(time, applied, tuple(stations), rows[:, :count], rows[:, count:])


def _march(
    rod: Rod, applied: Floats, dt: float, stations: Sequence[float], integrator: str
) -> Floats:
    """Return forces at the stations and accelerations, (rows, stations + 3)."""
    m = rod.mass()
    step = STEPS[integrator](rod.stiffness(), m, dt)
    at_rest, load = np.zeros((2, step.n))
    load[0] = applied[0]
    start = np.linalg.solve(m if m.ndim == 2 else np.diag(m), load)
    state = RodState.of(at_rest, at_rest, np.asarray(start, dtype=np.float64))
    strain = np.array([force_row(rod, x) for x in stations]).reshape(-1, step.n)
    middle = np.array([displacement_row(rod, part * rod.length) for part in (0.0, 0.5, 1.0)])
    history = np.empty((len(applied), len(strain) + len(middle)))
    forces = ((1.0 - step.theta) * applied[:-1] + step.theta * applied[1:]).tolist()
    for row in range(len(applied)):
        if row > 0:
            state = step.advance(state, forces[row - 1])
        history[row, : len(strain)] = strain @ state.deformation
        history[row, len(strain) :] = middle @ state.acceleration
    return history


def _element_at(rod: Rod, x: float) -> tuple[int, float]:
    """Return the element at x, at a node the farther one, and the local coordinate from 0 to 1."""
    along = x / rod.length * rod.elements
    node = round(along)
    if abs(along - node) < 1e-9 * rod.elements:
        along = float(node)
    element = min(int(along), rod.elements - 1)
    return element, along - element


def force_row(rod: Rod, x: float) -> Floats:
    """Return the row (n,) that maps the dofs to the force at x, -E A du/dx."""
    (element, s), L = _element_at(rod, x), rod.element_length
    row = np.zeros(2 * rod.elements + 2)
    row[2 * element : 2 * element + 4] = [
        6.0 * (s**2 - s) / L,
        1.0 - 4.0 * s + 3.0 * s**2,
        6.0 * (s - s**2) / L,
        3.0 * s**2 - 2.0 * s,
    ]
    return -rod.modulus * float(rod.areas[element]) * row


def displacement_row(rod: Rod, x: float) -> Floats:
    """Return the row (n,) that maps the dofs to the displacement at x, equation 4-19."""
    (element, s), L = _element_at(rod, x), rod.element_length
    row = np.zeros(2 * rod.elements + 2)
    row[2 * element : 2 * element + 2] = (1.0 - s) ** 2 * (1.0 + 2.0 * s), L * s * (1.0 - s) ** 2
    row[2 * element + 2 : 2 * element + 4] = s**2 * (3.0 - 2.0 * s), L * s**2 * (s - 1.0)
    return row


def pulse_table(
    history: RodHistory, filtered: Floats | None = None
) -> tuple[dict[str, str], list[list[float]]]:
    """Return the dimensions of a CSV table of the history, by column, and its rows.

    The table has the filtered forces at the stations if there are any.
    """
    names = [f"{x:.12g}" for x in history.stations]
    dimensions = {"time": "time", "force": "force"}
    dimensions |= dict.fromkeys((f"force_at_{x}" for x in names), "force")
    columns = [history.time[:, None], history.applied[:, None], history.forces]
    if filtered is not None:
        dimensions |= dict.fromkeys((f"filtered_at_{x}" for x in names), "force")
        columns.append(filtered)
    dimensions |= dict.fromkeys((f"ratio_at_{x}" for x in names), "")
    dimensions |= dict.fromkeys((f"acceleration_{point}" for point in POINTS), "length/time^2")
    columns += [history.ratios, history.accelerations]
    return dimensions, np.hstack(columns).tolist()


@dataclass(frozen=True)
class Calibration:
    """Straight line through V_F against V_a, and the sensitivity, with standard errors."""

    points: int
    slope: float  # V_F over V_a
    slope_error: float
    offset: float  # V_F at V_a = 0; 0 for a line through the origin
    offset_error: float
    r_squared: float  # share of the variation of V_F, about zero for a line through the origin
    sensitivity: float  # c_F of the transducer, V_F per force
    sensitivity_error: float


def calibrate_transducer(
    v_f: Floats, v_a: Floats, mass: float, c_a: float, *, through_origin: bool = False
) -> Calibration:
    """Fit the sensitivity of a transducer by least squares, equations 4-1 to 4-4.

    The fit attributes all scatter to V_F. Scatter of V_a flattens the line: the true slope lies
    between the fitted slope and the fitted slope divided by R².

    Both outputs, (points,), are recorded at the same instants. `mass` is the mass of the target
    (force*time^2/length), `c_a` the sensitivity of the accelerometer (output per length/time^2).
    Raises StudyError if there are fewer than three points, V_a or V_F is constant, or a sum
    overflows.
    """
    if len(v_f) < 3:
        raise StudyError(f"at least 3 points are required; there are {len(v_f)}")
    for name, values in (("V_a", v_a), ("V_F", v_f)):
        if float(np.ptp(values)) == 0.0:
            raise StudyError(f"{name} is constant ({values[0]:g}): the slope is undefined")
    middle_a, middle_f = (0.0, 0.0) if through_origin else (v_a.mean(), v_f.mean())
    x, y = v_a - middle_a, v_f - middle_f
    with np.errstate(all="ignore"):
        xx, yy = float(x @ x), float(y @ y)
        slope = float(x @ y) / xx
        residual = y - slope * x
        variance = float(residual @ residual) / (len(x) - (1 if through_origin else 2))
        slope_error = float(np.sqrt(variance / xx))
        variance_of_offset = 0.0 if through_origin else 1.0 / len(x) + middle_a**2 / xx
        factor = c_a / mass
    calibration = Calibration(
        points=len(x),
        slope=slope,
        slope_error=slope_error,
        offset=float(middle_f - slope * middle_a),
        offset_error=float(np.sqrt(variance * variance_of_offset)),
        r_squared=1.0 - float(residual @ residual) / yy,
        sensitivity=factor * slope,
        sensitivity_error=abs(factor) * slope_error,
    )
    if not np.isfinite(list(vars(calibration).values())).all():
        raise StudyError("the sums overflow: check the numbers and their units")
    return calibration
