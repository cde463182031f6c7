"""A free rod under a force pulse on its end, report section 4.2, figures 4.7 to 4.9.

Element, mass and step are those of the projectile in an impact; x runs from the struck end into the
rod.  Forces are positive in compression, accelerations positive in the sense of the push.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.projectile import Rod
from fecm.mechanics.rod_integrators import STEPS, WILSON, RodState
from fecm.studies.rod_test.pulses import Pulse

MOST_STEPS = 2_000_000
# Part of the time that a wave takes through an element, which is the step where none is given.
PART = 0.8
# Part of the pulse's peak from which on the ratio to it counts in the mean.
COUNTS = 0.01

POINTS = ("struck_end", "middle", "far_end")


@dataclass(frozen=True)
class RodHistory:
    """What a rod did.

    Attributes
    ----------
    time : ndarray (rows,)
        From 0 on.
    applied : ndarray (rows,)
        Force on the end.
    stations : tuple of float
        Distances from the struck end.
    forces : ndarray (rows, stations)
        Force at the stations, positive in compression.
    accelerations : ndarray (rows, 3)
        At the struck end, the middle and the far end.
    """

    time: Floats
    applied: Floats
    stations: tuple[float, ...]
    forces: Floats
    accelerations: Floats

    @property
    def ratios(self) -> Floats:
        """Force at the stations over the applied one, (rows, stations); NaN where that is 0."""
        with np.errstate(all="ignore"):
            ratios = self.forces / self.applied[:, None]
        return np.where(self.applied[:, None] == 0.0, np.nan, ratios)

    @property
    def mean_ratios(self) -> Floats:
        """Mean of the ratio over all rows at which the pulse is above 1 % of its peak, (stations,).

        The report's 0.498 (section 4.2) for its exponential pulse is this.
        """
        size = np.abs(self.applied)
        counted = size > COUNTS * size.max()
        if not counted.any():
            return np.full(len(self.stations), np.nan)
        return np.asarray(self.ratios[counted].mean(axis=0))


def default_time_step(rod: Rod) -> float:
    """Most of the time that a wave takes through an element, to two figures."""
    return float(f"{PART * rod.length / rod.elements * math.sqrt(rod.density / rod.modulus):.2g}")


def simulate_pulse(
    rod: Rod,
    pulse: Pulse,
    dt: float,
    duration: float,
    stations: Sequence[float],
    integrator: str = WILSON,
) -> RodHistory:
    """Push a free rod, at rest at first, at its end x = 0.

    As in an impact, the force between two steps, and beyond the second where the integrator looks
    there, is taken to be linear.  A pulse that starts with a jump meets a rod whose end is
    accelerated by it at once.

    Parameters
    ----------
    rod : Rod
    pulse : Pulse
    dt : float
        Time step.
    duration : float
        Time to be covered; the last step ends at it or behind it.
    stations : sequence of float
        Distances from the struck end, 0 to the rod's length.
    integrator : str
        One of :data:`fecm.mechanics.rod_integrators.INTEGRATORS`.

    Raises
    ------
    ValueError
        If a station is not on the rod, there would be more than two million steps, or the numbers
        are beyond all range.
    """
    for x in stations:
        if not 0.0 <= x <= rod.length:
            raise ValueError(
                f"the station {x:g} is not on the rod, which reaches to {rod.length:g}"
            )
    if duration / dt > MOST_STEPS:
        raise ValueError(
            f"{duration:g} in steps of {dt:g} are more than {MOST_STEPS:,} steps: take a longer "
            "time step or a shorter duration"
        )
    with np.errstate(all="ignore"):  # an overflow is found, and said better, below
        steps = max(1, math.ceil(duration / dt * (1.0 - 1e-12)))
        time = np.asarray(dt * np.arange(steps + 1.0))
        applied = pulse.force(time)
        try:
            noted = _march(rod, applied, dt, stations, integrator)
        except np.linalg.LinAlgError:
            noted = np.full((1, 1), np.nan)
    if not (np.isfinite(noted).all() and np.isfinite(applied).all()):
        raise ValueError("the motion is not finite: look at the numbers and their units")
    count = len(stations)
    return RodHistory(time, applied, tuple(stations), noted[:, :count], noted[:, count:])


def _march(
    rod: Rod, applied: Floats, dt: float, stations: Sequence[float], integrator: str
) -> Floats:
    """Step through the pulse; forces at the stations and accelerations, (rows, stations + 3)."""
    m = rod.mass()
    step = STEPS[integrator](rod.stiffness(), m, dt)
    push = np.zeros(step.n)
    push[0] = applied[0]
    at_rest = np.zeros(step.n)
    start = np.linalg.solve(m if m.ndim == 2 else np.diag(m), push)
    state = RodState.of(at_rest, at_rest, np.asarray(start, dtype=np.float64))
    strain = np.array([force_row(rod, x) for x in stations]).reshape(-1, step.n)
    middle = np.array([displacement_row(rod, part * rod.length) for part in (0.0, 0.5, 1.0)])
    noted = np.empty((len(applied), len(strain) + len(middle)))

    def note(row: int) -> None:
        noted[row, : len(strain)] = strain @ state.deformation
        noted[row, len(strain) :] = middle @ state.acceleration

    note(0)
    forces = (1.0 - step.theta) * applied[:-1] + step.theta * applied[1:]
    for row, force in enumerate(forces.tolist(), start=1):
        state = step.advance(state, force)
        note(row)
    return noted


def _place(rod: Rod, x: float) -> tuple[int, float]:
    """The element at x, of two the one behind, and how far into it, from 0 to 1."""
    along = x / rod.length * rod.elements
    node = round(along)
    if abs(along - node) < 1e-9 * rod.elements:
        along = float(node)
    element = min(int(along), rod.elements - 1)
    return element, along - element


def force_row(rod: Rod, x: float) -> Floats:
    """Row that gives the force at x, -E A du/dx, from the unknowns: (n,)."""
    element, s = _place(rod, x)
    L = rod.length / rod.elements
    row = np.zeros(2 * rod.elements + 2)
    row[2 * element : 2 * element + 4] = [
        6.0 * (s**2 - s) / L,
        1.0 - 4.0 * s + 3.0 * s**2,
        6.0 * (s - s**2) / L,
        3.0 * s**2 - 2.0 * s,
    ]
    return -rod.modulus * float(rod.areas[element]) * row


def displacement_row(rod: Rod, x: float) -> Floats:
    """Row that gives the displacement at x from the unknowns, equation 4-19: (n,)."""
    element, s = _place(rod, x)
    L = rod.length / rod.elements
    row = np.zeros(2 * rod.elements + 2)
    row[2 * element : 2 * element + 4] = [
        (1.0 - s) ** 2 * (1.0 + 2.0 * s),
        L * s * (1.0 - s) ** 2,
        s**2 * (3.0 - 2.0 * s),
        L * s**2 * (s - 1.0),
    ]
    return row


def table(history: RodHistory, filtered: Floats | None = None) -> Iterator[str]:
    """Lines of a CSV of everything, with their ends.

    Parameters
    ----------
    history : RodHistory
    filtered : ndarray (rows, stations), optional
        Forces at the stations as a transducer with a rise time shows them.
    """
    names = [f"{x:.12g}" for x in history.stations]
    header = ["time", "force", *(f"force_at_{x}" for x in names)]
    columns = [history.time[:, None], history.applied[:, None], history.forces]
    if filtered is not None:
        header += [f"filtered_at_{x}" for x in names]
        columns.append(filtered)
    header += [f"ratio_at_{x}" for x in names] + [f"acceleration_{point}" for point in POINTS]
    columns += [history.ratios, history.accelerations]
    yield ",".join(header) + "\n"
    for row in np.hstack(columns).tolist():
        yield ",".join(map(repr, row)) + "\n"
