"""Reasons to doubt the result of a finished run: notes for its reader, and its validity."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fecm._dataclasses import frozen
from fecm.deck.units import in_si
from fecm.mechanics.mesh import rigid_deflections
from fecm.mechanics.solutions import static_support
from fecm.problem.static_plate import MOST_SOLVED
from fecm.results.criteria import spelt
from fecm.results.end import LATE, OPEN_ENDS, OPEN_PEAKS, End
from fecm.results.exposures import (
    FEWEST,
    RESOLVED,
    count_evaluations,
    largest_exposures,
)
from fecm.results.linear_plate import REMEDY, TOO_SOFT, unsafe
from fecm.results.result import Result
from fecm.results.run_metrics import steps_to_decide
from fecm.results.validity import BENT, CROSSED, INDENTATION, SLOPE, STRAIN, Reason, joined
from fecm.simulation import membrane, peaks
from fecm.simulation.peaks import Peak
from fecm.simulation.simulation import Simulation

# Error of the energy balance, relative to the supplied energy, that triggers a warning.
ENERGY_WARNING = 0.01
# Share of the force above which a note says that supports pull, and least share of the static
# deflection at the peak force at which they are taken to carry it.
PULL = 0.1
STATIC = 0.5
STANDARD_GRAVITY = 9.80665  # m/s^2
HEAVY = 0.02  # share of the peak force that gravity adds, above which a note says so
LATER = 1.1  # peak of a later contact over that of the first, above which a note says so


@frozen
class Verdict:
    """What speaks against a result."""

    notes: list[str]  # sentences; empty if there is no doubt
    validity: str  # ``"ok"`` or reasons; empty without impact steps


@frozen
class Doubt:
    """A quantity beyond the range of the model."""

    reason: Reason
    note: str


def judge(simulation: Simulation, result: Result) -> Verdict:
    """Judge the result of a finished run."""
    beyond = list(_beyond(simulation, result))
    notes = [
        *_numerical(simulation),
        *(doubt.note for doubt in beyond),
        *_few_evaluations(simulation, result),
        *membrane.doubts(simulation, result),
    ]
    end = result.end
    if end is None:
        return Verdict(notes, "")
    if end in OPEN_ENDS:
        notes.append(OPEN_ENDS[end] + _remedy(result, end))
    notes += [*_later_peak(result), *_late_values(result, end)]
    notes += [*_pull(simulation, result), *_gravity(simulation, result)]
    reasons = [Reason.AGAIN] if end is End.AGAIN else [Reason.OPEN] if end in OPEN_PEAKS else []
    reasons += [doubt.reason for doubt in beyond]
    peak_force = simulation.state.monitor.peak_force
    if peak_force > CROSSED * result.threshold.get("force", np.inf):
        reasons.append(Reason.DELAMINATED)
    return Verdict(notes, joined(reasons))


def _remedy(result: Result, end: End) -> str:
    """How many steps decide whether the plate touches the projectile again."""
    if end is not End.AGAIN:
        return ""
    if (steps := steps_to_decide(result)) is None:
        return "; take more steps"
    return f"; about {steps} more steps decide it"


def _later_peak(result: Result) -> Iterator[str]:
    """Note of a peak force that a later contact has raised."""
    metrics, unit = result.metrics, result.units.get("force", "")
    if metrics["peak_force"] > LATER * metrics["first_peak"]:
        first = f"{metrics['first_peak']:.4g} {unit}".rstrip()
        yield (
            f"the peak force is reached in contact {metrics['peak_contact']}, after reflections in "
            f"the plate: it depends on damping; the peak of the first contact is {first}"
        )


def _late_values(result: Result, end: End) -> Iterator[str]:
    """Note of deflections and exposures that are largest near the end of the run."""
    if end is not End.OVER:
        return
    times, w = result["history/time"], result["history/plate_w"]
    late = []
    if times[w.argmax()] > LATE * times[-1]:
        late.append("deflection")
    late += [
        f"exposure {spelt(one.criterion)}"
        for one in largest_exposures(result)
        if one.time > LATE * times[-1]
    ]
    if late:
        yield (
            f"the largest {', '.join(late)} came in the last fifth of the run, after the contact: "
            "the plate vibrates on and may exceed it; take more steps"
        )


def _pull(simulation: Simulation, result: Result) -> Iterator[str]:
    """Note of supports that pull where they can only push.

    The pull is computed for a static load. A light projectile is gone before its wave reaches the
    supports: the note needs a deflection at the peak that is near to the static one.
    """
    problem = simulation.problem
    contact, force = problem.contact, result["history/force"]
    if contact is None or not force.any() or problem.deck.control.numel > MOST_SOLVED:
        return
    support = static_support(problem.moving_plate, contact)
    if support is None:
        return
    stiffness, pull = support
    peak = int(force.argmax())
    if pull > PULL and result["history/plate_w"][peak] * stiffness > STATIC * force[peak]:
        yield (
            f"the supports pull the plate down with {pull:.0%} of a static load at the "
            "impact; a window or a ring can only push: the plate lifts off there, is softer, and "
            "its peak force is lower"
        )


def _gravity(simulation: Simulation, result: Result) -> Iterator[str]:
    """Note of a projectile so heavy and slow that its weight counts.

    Until it turns, the weight does the work M g w, where w is the way of the projectile. On a
    linear spring with the energy E this raises the force by x + (1 + x^2)^(1/2) - 1, where
    x = M g w/(2 E) is the weight over the peak force.
    """
    impact, unit = simulation.model.impact, in_si("length/time^2", result.units)
    if impact is None or unit is None:
        return
    mass, velocity = impact.rod.total_mass, impact.contact.velocity
    energy = 0.5 * mass * velocity**2
    in_contact = result["history/force"] > 0.0
    if not energy or not in_contact.any():
        return
    way = (result["history/plate_w"] + result["history/indentation"])[in_contact].max()
    share = float(mass * STANDARD_GRAVITY / unit * way / energy)
    x = 0.5 * share
    rise = x + math.hypot(1.0, x) - 1.0
    if rise > HEAVY:
        yield (
            f"gravity is left out: the weight of a projectile that falls adds {share:.1%} to the "
            "impact energy until it turns (M g w); the force and the deflection are then about "
            f"{rise:.0%} larger"
        )


def _numerical(simulation: Simulation) -> Iterator[str]:
    """Notes of the energy balance and the contact iteration; slips excuse both."""
    state = simulation.state
    has_slips = bool(simulation.options.slips)
    error, step = state.monitor.worst_error, state.monitor.worst_step
    if error > ENERGY_WARNING:
        off = f"the energy balance is off by {error:.2%} of the supplied energy, at step {step}"
        yield f"{off} (not a failure, as slips are active)" if has_slips else off
    unconverged = state.impact.unconverged_steps if state.impact is not None else 0
    if unconverged and not has_slips:
        yield f"the contact iteration did not converge in {unconverged} steps; a smaller DT helps"


def _few_evaluations(simulation: Simulation, result: Result) -> Iterator[str]:
    """Note of a contact in which FAIL is evaluated so rarely that maxima are missed."""
    if simulation.state.failure is None:
        return
    yield from _coarse_elements(simulation, result)
    count = count_evaluations(result)
    if "history/force" in result and count < FEWEST and result["history/force"].any():
        yield (
            f"FAIL was evaluated {count} times during contact, less than {FEWEST}: larger "
            "exposures and the first failure may be missed; evaluate more often, in the loop of "
            "the steps"
        )


def _coarse_elements(simulation: Simulation, result: Result) -> Iterator[str]:
    """Note of elements so large that exposures at the load are lower bounds."""
    monitor = simulation.model.failure
    if monitor is None or monitor.around is None or monitor.around.coarseness <= RESOLVED:
        return
    reach, unit = simulation.problem.reach_of_load, result.units.get("length", "")
    side, radius, wanted = (
        f"{factor * reach:.3g} {unit}".rstrip()
        for factor in (monitor.around.coarseness, 1.0, RESOLVED)
    )
    yield (
        f"exposures at the load are lower bounds: the elements there have sides of {side}, and "
        f"c + h/2 is {radius}; refine the mesh at the load to sides of {wanted}"
    )


def _beyond(simulation: Simulation, result: Result) -> Iterator[Doubt]:
    """Deflection, strain, indentation and exposures beyond their limits."""
    with np.errstate(all="ignore"):
        deflection = peaks.deflection(simulation, result)
        slope = peaks.slope(result)
        strain = peaks.strain(simulation, result)
        indentation = peaks.indentation(simulation, result)
    limits = simulation.problem.judge
    h = limits.thickness
    if deflection.value > limits.limit * h:
        yield Doubt(BENT[limits.in_plane], _bent(simulation, result, deflection))
    if slope.value > SLOPE:
        reached = _reached(result, "slope", f"{slope.value:.3g}", slope)
        yield Doubt(
            Reason.STEEP,
            f"{reached} {SLOPE} von Kármán strains, which are for moderate rotations, have an "
            f"error of about slope²/2 = {slope.value**2 / 2.0:.1%}",
        )
    if strain.value > STRAIN:
        reached = _reached(result, "strain", f"{strain.value:.2%}", strain)
        yield Doubt(Reason.STRAINED, f"{reached} 1 % linear plies are doubtful")
    if indentation.value > INDENTATION * limits.indented:
        size = _size(result, indentation.value, limits.indented)
        reached = _reached(result, "indentation", size, indentation)
        of_face = ", h being the struck face's," if limits.struck else ""
        yield Doubt(
            Reason.SOFT, f"{reached} h/4{of_face} the contact law of a half-space is doubtful"
        )
    broken = [spelt(one.criterion) for one in largest_exposures(result) if one.exposure > CROSSED]
    if broken:
        yield Doubt(
            Reason.BROKEN,
            f"exposure above 1 ({', '.join(broken)}): the run continues elastically; the "
            "softening after the first failure is not modelled",
        )


def _bent(simulation: Simulation, result: Result, peak: Peak) -> str:
    """Note of a deflection beyond the linear plate."""
    limits = simulation.problem.judge
    is_free = rigid_deflections(simulation.problem.mesh).size > 0
    what = "deflection, less its rigid motion," if is_free else "deflection"
    h = limits.thickness
    size = _size(result, peak.value, h)
    note = f"{_reached(result, what, size, peak)} {limits.limit} h {TOO_SOFT}"
    if simulation.problem.has_impact:
        error, meaning = limits.softness(peak.value / h), unsafe(curved=limits.curved)
        note = f"{note}: {error}; {meaning}"
    return note if simulation.options.slips else f"{note}; {REMEDY}"


def _size(result: Result, value: float, thickness: float) -> str:
    """A length, and its ratio to the thickness."""
    length = f"{value:.4g} {result.units.get('length', '')}".rstrip()
    return f"{length} = {value / thickness:.3g} h"


def _reached(result: Result, what: str, value: str, peak: Peak) -> str:
    """Begin of a note: what a quantity reaches, and where and when."""
    time = f"time {peak.time:.6g} {result.units.get('time', '')}".rstrip()
    if not math.isnan(peak.x):
        time = f"({peak.x:.6g}, {peak.y:.6g}), {time}"
    return f"the {what} reaches {value} at {time}: beyond"
