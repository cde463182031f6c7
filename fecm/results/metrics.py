"""Impact metrics from contact forces: numbers of one run, or of many cases."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats
from fecm.judge.criteria import ALL_CRITERIA, spelt
from fecm.judge.end import (
    GONE,
    Deflection,
    LastContact,
    Texts,
    decided,
    ends,
    over,
    peak_known,
    settled_deflection,
)


class Quantity(NamedTuple):
    """Description of a column of numbers."""

    description: str
    dimension: str = ""  # physical dimension; may be empty


# Metrics of every case.
SUMMARY = {
    "peak_force": Quantity("largest contact force", "force"),
    "time_of_peak": Quantity("time of the largest contact force", "time"),
    "peak_contact": Quantity("number of the contact with the largest force, from 1"),
    "first_peak": Quantity("largest contact force of the first contact", "force"),
    "contacts": Quantity("number of contacts"),
    "contact_time": Quantity("time in contact", "time"),
    "last_contact": Quantity("time of the last step in contact", "time"),
    "max_indentation": Quantity("largest indentation", "length"),
    "permanent_indentation": Quantity("permanent indentation", "length"),
    "impulse": Quantity("time integral of the contact force", "force*time"),
    "rebound_velocity": Quantity(
        "velocity of the projectile's centre at the end, positive away from the plate",
        "length/time",
    ),
    "energy_absorbed": Quantity(
        "kinetic energy that the projectile's centre has lost at the end: left in the vibration "
        "of the plate, the indentation and the projectile",
        "force*length",
    ),
    "contact_loop": Quantity(
        "area of the loop of contact force and indentation: work that the indentation keeps",
        "force*length",
    ),
}
# Dimensions of quantities of which a symmetric part has its share.
SHARED = ("force", "force*length", "force*time")
THRESHOLD_FORCE = "threshold_force"
# Metrics of decks with a delamination threshold.
THRESHOLD = {
    THRESHOLD_FORCE: Quantity("delamination threshold", "force"),
    "threshold_margin": Quantity("1 less the largest contact force over the threshold"),
    "threshold_time": Quantity(
        "time at which the contact force first reaches the threshold", "time"
    ),
    "time_above": Quantity("time at or above the threshold", "time"),
}
# All metrics of a run.
METRICS = {
    **SUMMARY,
    "max_deflection": Quantity("largest displacement of the plate under the load", "length"),
    **THRESHOLD,
}
INTEGERS = ("contacts", "peak_contact")


class MetricAttributes:
    """Names of :data:`METRICS` as attributes, for type checkers and editors."""

    peak_force: float
    time_of_peak: float
    peak_contact: float
    first_peak: float
    contacts: float
    contact_time: float
    last_contact: float
    max_indentation: float
    permanent_indentation: float
    impulse: float
    rebound_velocity: float
    energy_absorbed: float
    contact_loop: float
    max_deflection: float
    threshold_force: float
    threshold_margin: float
    threshold_time: float
    time_above: float


# Metrics of a search for velocities.
FOUND = {
    "found_velocity": Quantity(
        "velocity at which the value searched for is reached", "length/time"
    ),
    "found_energy": Quantity("kinetic energy of the projectile at that velocity", "force*length"),
}
# Metrics of a sweep that are measured on request.
EXPOSURES = {
    f"exposure_{name}": Quantity(f"largest exposure {spelt(name)} outside the load")
    for name in ALL_CRITERIA
}
BAND = {
    "exposure_low": Quantity("lowest value of the largest exposure that finer meshes may give"),
    "exposure_high": Quantity("highest value of the largest exposure that finer meshes may give"),
}
# Metrics of a search for an exposure, from that band.
FOUND_BAND = {
    "found_energy_low": Quantity("lowest energy that finer meshes may find", "force*length"),
    "found_energy_high": Quantity("highest energy that finer meshes may find", "force*length"),
}
EVALUATIONS = {
    "fail_evaluations": Quantity("evaluations of FAIL during contact"),
}
# Place that is hit instead of the given place.
HIT = {
    "hit_x": Quantity("x of the impact node or of the patch", "length"),
    "hit_y": Quantity("y of the impact node or of the patch", "length"),
}
# Of decks of a half or a quarter of a plate.
FACTOR = "symmetry_factor"
FACTORS = {
    FACTOR: Quantity("number of equal parts of the plate of which the deck has one"),
}
RATIO = "deflection_ratio"
RATIOS = {
    RATIO: Quantity("largest displacement of the plate under the load over its thickness"),
}
# All metrics of a sweep.  Gages have one metric each; its name begins with GAGE.
COLUMNS = {
    **METRICS,
    **FOUND,
    **FOUND_BAND,
    **EXPOSURES,
    **BAND,
    **EVALUATIONS,
    **HIT,
    **RATIOS,
    **FACTORS,
}
GAGE = "gage_"
# Columns of texts: whether a case was run, and whether its result is valid.
STATUS = "status"
VALIDITY = "validity"
VERDICTS = (STATUS, VALIDITY)


def described(name: str) -> str:
    """Return the description of a column of a sweep."""
    if name.startswith(GAGE):
        return f"largest absolute strain of gage {name.removeprefix(GAGE)}"
    return COLUMNS[name].description if name in COLUMNS else "measured by the caller"


# Attributes of the history of a run: the mass of its plate, and the mobility of a plate that is not
# held; see `Judge`.
PLATE_MASS, MOBILITY = "plate_mass", "rigid_mobility"
# Attributes of a run whose plate is deflected when the impact starts. Those of the history are
# displacements under the load: where the projectile starts, and where the nodal forces hold the
# plate during the impact, if they do. That of the energy is the plate's part of the initial energy.
START_W = "start_w"
REST_W = "rest_w"
INITIAL_PLATE = "initial_plate"
PART = 16  # cases whose forces stay in the cache


class IndentationMetrics(NamedTuple):
    """Largest, last and permanent indentation of cases (length), and work on it up to the end."""

    largest: Floats
    last: Floats
    permanent: Floats
    work: Floats  # of the contact force, force*length


class Projectiles(NamedTuple):
    """Mass and impact velocity of the projectiles of cases: numbers, or (cases,)."""

    mass: Floats | float
    velocity: Floats | float


class Metrics(NamedTuple):
    """Metrics of cases, and which of them the ends have decided."""

    columns: dict[str, Floats]  # (cases,) each; NaN where the end of the case has not decided them
    end: Texts  # (cases,): state of the contact at the end, :class:`~fecm.judge.end.End`
    # (cases,): largest contact force of the whole plate up to the end, a lower bound of the peak.
    reached: Floats
    last: LastContact
    plate: Deflection
    is_held: bool  # whether supports hold the plate

    @property
    def deflection(self) -> Floats:
        """Largest displacement under the load, (cases,); NaN where it can still grow."""
        return settled_deflection(self.end, self.plate, is_held=self.is_held)


def impact_metrics(
    force: Floats,
    times: Floats,
    indentation: IndentationMetrics,
    projectiles: Projectiles,
    plate: Deflection,
    threshold: float | Floats | None = None,
    mobility: float = 0.0,
    factor: int = 1,
    plate_mass: float = np.nan,
) -> Metrics:
    """Summarise many cases from their contact forces.

    Contact forces are (steps, cases), times of the steps (steps,). Returns the names of
    :data:`SUMMARY`; with a delamination threshold (force, or (cases,)) also the names of
    :data:`THRESHOLD`. `plate` is the motion of the plate under the load, `mobility` (1/mass) the
    mobility of its rigid motion, and `plate_mass` its mass; see
    :class:`~fecm.judge.validity.Judge`. Values that the end of a case has not decided are NaN.
    Forces, masses and energies are those of one of `factor` symmetric parts; the threshold, and
    the forces and energies returned, are those of the whole plate. If a case ends in contact or
    within reach of the plate, only the peaks can be decided, and only if they have passed and the
    projectile leaves.
    """
    limit = None if threshold is None else np.broadcast_to(threshold, force.shape[1])
    of_forces = _from_forces(force, times, None if limit is None else limit / factor)
    mass, velocity = (np.broadcast_to(v, force.shape[1]) for v in projectiles)
    impulse, reached, met = of_forces.impulse, of_forces.reached, of_forces.met
    rebound = impulse / mass - velocity
    leaving = rebound + mobility * impulse
    # What is still near may be reached by the plate.
    is_apart = (of_forces.last <= 0.0) & (leaving <= GONE * plate.speed)
    last = LastContact(
        of_forces.last,
        reached,
        _present_peak(force, of_forces.last),
        leaving,
        _position(force, times, mass, velocity, is_apart, mobility),
        mass / plate_mass,
    )
    end = ends(last, plate, is_held=mobility == 0.0)
    finished, peak_is_known = over(end), peak_known(end)
    is_first_over = peak_is_known | (of_forces.contacts > 1.0) | (of_forces.last == 0.0)

    def where(mask: Bools, values: Floats) -> Floats:
        return np.where(mask, values, np.nan)

    columns = {
        "peak_force": where(peak_is_known, reached),
        "time_of_peak": where(peak_is_known & met, of_forces.time_of_peak),
        "peak_contact": where(peak_is_known & met, of_forces.peak_contact),
        "first_peak": where(is_first_over, of_forces.first_peak),
        "contacts": where(finished, of_forces.contacts),
        "contact_time": where(finished, of_forces.contact_time),
        "last_contact": where(finished & met, of_forces.last_contact),
        "max_indentation": decided(indentation.largest, indentation.last, end),
        "permanent_indentation": where(finished, indentation.permanent),
        "impulse": where(finished, impulse),
        "rebound_velocity": where(finished, rebound),
        "energy_absorbed": where(finished, 0.5 * mass * (velocity**2 - rebound**2)),
        "contact_loop": where(finished, indentation.work),
    }
    for name in columns:
        if SUMMARY[name].dimension in SHARED:
            columns[name] = factor * columns[name]
    reached = factor * reached
    if limit is not None:
        columns[THRESHOLD_FORCE] = limit.copy()
        columns["threshold_margin"] = where(peak_is_known, 1.0 - reached / limit)
        columns["threshold_time"] = of_forces.threshold_time
        columns["time_above"] = where(finished, of_forces.time_above)
    return Metrics(columns, end, reached, last, plate, is_held=mobility == 0.0)


def _present_peak(force: Floats, last: Floats) -> Floats:
    """Return the largest force of the last contact, (cases,); 0 after a contact."""
    peak = np.zeros_like(last)
    for case in np.flatnonzero(last > 0.0):
        history = force[:, case]
        gaps = np.flatnonzero(history <= 0.0)
        peak[case] = history[gaps[-1] + 1 if len(gaps) else 0 :].max()
    return peak


def _position(
    force: Floats,
    times: Floats,
    mass: Floats,
    velocity: Floats,
    chosen: Bools,
    mobility: float,
) -> Floats:
    """Return the displacement of the projectiles at the end, (cases,), NaN where not chosen.

    It is relative to the rigid motion of a plate with a mobility (1/mass).
    """
    position = np.full(len(chosen), np.nan)
    dt = np.diff(times, prepend=0.0)
    lever = 0.5 * (dt + np.append(dt[1:], 0.0)) * (times[-1] - times)
    for case in np.flatnonzero(chosen):
        push = float((lever * force[:, case]).sum())
        position[case] = velocity[case] * times[-1] - push * (1.0 / mass[case] + mobility)
    return position


class _OfForces(NamedTuple):
    """Quantities that follow from the contact forces of cases alone, (cases,) each."""

    impulse: Floats
    reached: Floats  # largest force
    last: Floats  # the last one
    met: Bools  # whether there is a contact
    time_of_peak: Floats
    contacts: Floats
    peak_contact: Floats  # number of the contact with the largest force, from 1
    first_peak: Floats  # largest force of the first contact
    contact_time: Floats
    last_contact: Floats  # time; meaningless without a contact
    threshold_time: Floats  # NaN without a threshold, or where it is not reached
    time_above: Floats


def _from_forces(force: Floats, times: Floats, threshold: Floats | None) -> _OfForces:
    """Evaluate contact forces (steps, cases), as many cases at a time as fit in the cache."""
    dt = np.diff(times, prepend=0.0)
    product = np.empty((min(PART, force.shape[1]), len(times)))
    parts = [
        _of_part(
            np.ascontiguousarray(force[:, n : n + PART].T),
            times,
            dt,
            None if threshold is None else threshold[n : n + PART],
            product,
        )
        for n in range(0, force.shape[1], PART)
    ]
    if len(parts) == 1:
        return parts[0]
    return _OfForces(*map(np.concatenate, zip(*parts, strict=True)))


def _durations(dt: Floats, chosen: Bools, product: Floats) -> Floats:
    """Return durations (cases,) of the chosen steps, (cases, steps).

    `product` is memory of that shape.
    """
    np.copyto(product, chosen)
    product *= dt
    return np.asarray(product.sum(axis=1))


def _of_part(
    force: Floats, times: Floats, dt: Floats, threshold: Floats | None, product: Floats
) -> _OfForces:
    """Evaluate contact forces (cases, steps); `product` is memory of that shape."""
    cases = len(force)
    product = product[:cases]
    touching = force > 0.0
    rises = touching[:, 1:] > touching[:, :-1]
    ends = touching.copy()  # last steps of contacts
    ends[:, :-1] &= ~touching[:, 1:]
    first_end = np.argmax(ends, axis=1) + 1
    last = len(times) - 1 - np.argmax(touching[:, ::-1], axis=1)
    peak = np.argmax(force, axis=1)
    threshold_time = time_above = np.full(cases, np.nan)
    if threshold is not None:
        above = force >= threshold[:, None]
        first = times[np.argmax(above, axis=1)]
        threshold_time = np.where(above.any(axis=1), first, np.nan)
        time_above = _durations(dt, above, product)
    return _OfForces(
        # The force is linear between steps, and 0 before the first.  These sums are the same for a
        # case with any others.
        impulse=np.multiply(0.5 * (dt + np.append(dt[1:], 0.0)), force, out=product).sum(axis=1),
        reached=force[np.arange(cases), peak],
        last=force[:, -1],
        met=np.asarray(touching.any(axis=1)),
        time_of_peak=times[peak],
        contacts=touching[:, 0] + np.array([np.count_nonzero(row) for row in rises], dtype=float),
        peak_contact=touching[:, 0]
        + np.array([np.count_nonzero(rises[n, :row]) for n, row in enumerate(peak)], dtype=float),
        first_peak=np.array([force[n, :row].max() for n, row in enumerate(first_end)]),
        contact_time=_durations(dt, touching, product),
        last_contact=times[last],
        threshold_time=threshold_time,
        time_above=time_above,
    )
