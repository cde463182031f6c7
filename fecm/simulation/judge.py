"""Judgement of a finished run: largest values, notes, and validity."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from fecm._typing import Array, Floats
from fecm.deck.model import Gages, Indentation
from fecm.deck.units import MODULUS, in_si, quantity, unit_of
from fecm.mechanics.mesh import rigid_deflections
from fecm.mechanics.points import shortest_side
from fecm.mechanics.solutions import static_support
from fecm.problem.contact_estimates import mean_pressure
from fecm.problem.estimates import MOST_SOLVED
from fecm.results.criteria import spelt, yield_stress
from fecm.results.end import GO_ON, LATE, OPEN_ENDS, OPEN_PEAKS, End
from fecm.results.exposure_bands import LEAST_REACH
from fecm.results.exposures import FEWEST, count_evaluations, largest_exposures
from fecm.results.metrics import MOBILITY
from fecm.results.result import Result
from fecm.results.run_metrics import start_w_of, steps_to_decide
from fecm.results.stored import row_blocks
from fecm.results.validity import (
    BENT,
    CROSSED,
    INDENTATION,
    REMEDY,
    SLOPE,
    STRAIN,
    TOO_SOFT,
    Reason,
    joined,
    unsafe,
)
from fecm.simulation.simulation import Simulation

BENDING = ("kappa_x", "kappa_y", "kappa_xy")
MEMBRANE = ("eps_xx", "eps_yy", "gamma_xy")


class RunPeak(NamedTuple):
    """Largest value of a quantity, with its time and place."""

    value: float
    time: float
    # Place; NaN where it is not known.
    x: float = math.nan
    y: float = math.nan


NO_PEAK = RunPeak(0.0, 0.0, 0.0, 0.0)


def largest_deflection(simulation: Simulation, result: Result) -> RunPeak:
    """Return the largest deflection, without the rigid motion of a plate that is not held."""
    return max(_deflections(simulation, result), default=NO_PEAK)


def largest_strain(simulation: Simulation, result: Result) -> RunPeak:
    """Return the largest principal strain of both faces, away from the load, and of the gages.

    It is zero if no strain of the elements comes near :data:`~fecm.results.validity.STRAIN`.
    """
    stored = [
        *_face_strains(simulation, result, "tape8"),
        *_face_strains(simulation, result, "stresses"),
        *_gage_strains(simulation, result),
        *_of_membrane(result, "largest_strain"),
    ]
    return max(stored, default=NO_PEAK)


def largest_slope(result: Result) -> RunPeak:
    """Return the largest slope of a nonlinear plate at its stored rows."""
    return max(_of_membrane(result, "largest_slope"), default=NO_PEAK)


def membrane_force(result: Result) -> RunPeak:
    """Return the largest principal membrane force of a nonlinear plate at its stored rows."""
    return max(_of_membrane(result, "largest_force"), default=NO_PEAK)


def largest_indentation(simulation: Simulation, result: Result) -> RunPeak:
    """Return the largest indentation in contact."""
    return max(_indentations(simulation, result), default=NO_PEAK)


def _deflections(simulation: Simulation, result: Result) -> Iterator[RunPeak]:
    """Yield the peaks of the stored deflections.

    DISP stores all nodes; every step stores the deflection under the load.
    """
    problem = simulation.problem
    free = rigid_deflections(problem.mesh)
    root = np.ones(1)
    if free.size and problem.symmetry.factor > 1:  # the least squares of the whole plate
        root = np.sqrt(problem.symmetry.images(problem.mesh))
        free = np.linalg.qr(root[:, None] * free)[0]
    x, y = problem.mesh.coordinates[:, :2].T
    place = problem.load_place
    by_step = place is not None and not free.size and "history/plate_w" in result
    # Under the load the deflection is the mean over the patch, as in the summary.
    under = problem.under_load(x, y) & by_step
    for times, (w,) in _blocks(result, "tape3", ["w"]):
        bent = np.abs(w - (root * w @ free) @ free.T / root)
        yield _peak(np.where(under, 0.0, bent), times, x, y)
    if place is not None and by_step:
        for times, (w,) in _blocks(result, "history", ["plate_w"]):
            yield _peak_at(np.abs(w), times, place)


def _indentations(simulation: Simulation, result: Result) -> Iterator[RunPeak]:
    if (place := simulation.problem.load_place) is not None:
        for times, (force, alpha) in _blocks(result, "history", ["force", "indentation"]):
            yield _peak_at(np.where(force > 0.0, alpha, 0.0), times, place)


def _face_strains(simulation: Simulation, result: Result, group: str) -> Iterator[RunPeak]:
    """Yield the peaks of the face strains in a group, with the uniform strain of the preload.

    The group is `tape8` without membrane strains, or `stresses`.
    """
    model, problem = simulation.model, simulation.problem
    half = model.plate.thicknesses / 2.0
    preload = model.plate.preload_strain if model.plate.is_preloaded else np.zeros(3)
    has_membrane = group == "stresses"
    points = model.stress_points if has_membrane else model.strains
    names = [*MEMBRANE, *BENDING] if has_membrane else [*BENDING]
    for times, values in _blocks(result, group, names):
        sizes = [max(part.max(), -part.min()) for part in values]
        if np.abs(preload).sum() + sum(sizes[:-3]) + half.max() * sum(sizes[-3:]) < STRAIN:
            continue  # a bound, as few runs come near the limit
        membrane = values[:-3] or [np.zeros(())] * 3
        curvature = [half * kappa for kappa in values[-3:]]
        middle = [m + initial for m, initial in zip(membrane, preload, strict=True)]
        x, y = points.places(problem.mesh.coordinates)
        near = problem.under_load(x, y)
        for side in (1.0, -1.0):
            xx, yy, xy = (m + side * k for m, k in zip(middle, curvature, strict=True))
            largest = 0.5 * (np.abs(xx + yy) + np.hypot(xx - yy, xy))
            yield _peak(np.where(near | ~np.isfinite(largest), 0.0, largest), times, x, y)


def _gage_strains(simulation: Simulation, result: Result) -> Iterator[RunPeak]:
    if (cards := simulation.problem.deck.last(Gages)) is not None:
        x, y = np.array([(gage.x, gage.y) for gage in cards.records]).T
        for times, (values,) in _blocks(result, "gages", ["strain"]):
            yield _peak(np.abs(values), times, x, y)


def _of_membrane(result: Result, name: str) -> Iterator[RunPeak]:
    """Return the peak of a dataset of ``membrane``, whose places are not stored."""
    for times, (values,) in _blocks(result, "membrane", [name]):
        row = int(values.argmax())
        yield RunPeak(float(values[row]), float(times[row]))


def _blocks(
    result: Result, group: str, names: Iterable[str]
) -> Iterator[tuple[Floats, list[Floats]]]:
    """Yield times and datasets of a group, block by block, if they are stored."""
    paths = [f"{group}/{name}" for name in names]
    if paths[-1] in result:
        times = result[f"{group}/time"]
        shape = (len(times), *result.rows(paths[-1], 0, 1).shape[1:])
        for start, stop in row_blocks(shape):
            yield times[start:stop], [result.rows(path, start, stop) for path in paths]


def _peak(values: Floats, times: Floats, x: Array, y: Array) -> RunPeak:
    """Return the largest of values, (rows, ...), at places (...)."""
    row, *place = np.unravel_index(int(values.argmax()), values.shape)
    return RunPeak(
        float(values[row, *place]), float(times[row]), float(x[*place]), float(y[*place])
    )


def _peak_at(values: Floats, times: Floats, place: tuple[float, float]) -> RunPeak:
    """Return the largest of values, (rows,), at one place."""
    return _peak(values, times, *map(np.asarray, place))


# Share of the largest frequency that the time step allows, from which on there is a note.
NEAR = 0.95
# Share of the bending stress at the load from which on membrane stress counts there.
STRETCHED = 0.2


def doubts(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield notes about the stored rows of a nonlinear plate."""
    if "membrane/largest_force" in result:
        yield from _time_step(simulation, result)
        yield from _delamination(simulation, result)


def _time_step(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if a membrane force brings the largest frequency near 2/DT.

    w^2 <= w_linear^2 + N k^2/(rho h), where k is the wave number of the shortest wave of the mesh.
    Its length is the shortest side, as nodes are half a side apart.
    """
    from fecm.mechanics.stretching import principal_values  # 0.5 ms, for NONL only

    problem, dt, plate = simulation.problem, simulation.state.dt, simulation.model.motion.plate
    largest = membrane_force(result)
    # The frequencies of the linear plate contain the preload.
    mean, radius = principal_values(np.array(plate.preload))
    tension = largest.value - float(mean - radius)
    if not simulation.state.plate.step or tension <= 0.0 or plate is not problem.moving_plate:
        return
    side = min(map(shortest_side, plate.families))
    growth = (
        tension * (2.0 * math.pi / side) ** 2 / min(laminate.mass for laminate in plate.laminates)
    )
    allowed = (2.0 / dt) ** 2
    if (2.0 / problem.safe_time_step) ** 2 + growth <= NEAR**2 * allowed:
        return
    linear = (2.0 / problem.critical_time_step) ** 2
    # A time step that is as near to the linear plate's limit was chosen on purpose.
    limit = allowed * (NEAR**2 if linear < NEAR**2 * allowed else 1.0)
    if linear + growth > limit:
        force = quantity(largest.value, unit_of("force/length", result.units))
        when = quantity(largest.time, unit_of("time", result.units))
        share = math.sqrt((linear + growth) / allowed)
        yield (
            f"the membrane force reaches {force} at time {when}: it may raise the plate's largest "
            f"frequency from {math.sqrt(linear / allowed):.1%} of 2/DT to {share:.1%}; a smaller "
            "DT is safer"
        )


def _delamination(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if the plate stretches under the load when it reaches DELA's threshold."""
    crossing = simulation.state.monitor.crossing
    if simulation.problem.threshold is None or "membrane/force_at_load" not in result:
        return
    if math.isnan(crossing):
        crossing = float(result["history/time"][result["history/force"].argmax()])
    row = int(np.abs(result["membrane/time"] - crossing).argmin())
    when, force, moment = (
        float(result[f"membrane/{name}"][row])
        for name in ("time", "force_at_load", "moment_at_load")
    )
    bending = 6.0 * moment / simulation.problem.laminate.thickness
    if bending > 0.0 and force > STRETCHED * bending:
        time = quantity(when, unit_of("time", result.units))
        pull = quantity(force, unit_of("force/length", result.units))
        yield (
            f"at time {time} the membrane force under the load is {pull}, {force / bending:.0%} of "
            "6 M/h: the threshold of DELA is for a plate in bending"
        )


# Error of the energy balance, relative to the supplied energy, that triggers a warning.
ENERGY_WARNING = 0.01
# Share of the force above which a note says that supports pull, and least share of the static
# deflection at the peak force at which they are taken to carry it.
PULL = 0.1
STATIC = 0.5
STANDARD_GRAVITY = 9.80665  # m/s^2
HEAVY = 0.02  # share of the peak force that gravity adds, above which a note says so
FULLY_PLASTIC = 3.0  # mean pressure over the yield stress at which a metal flows under a sphere
LATER = 1.1  # least ratio of a later contact's peak to the first's for a note


class RunVerdict(NamedTuple):
    """Reasons to doubt a result, and its largest values."""

    notes: list[str]  # sentences; empty without a doubt
    validity: str  # ``"ok"`` or reasons; empty without impact steps


class Doubt(NamedTuple):
    """Quantity beyond the range of the model."""

    reason: Reason
    note: str


def judge_run(simulation: Simulation, result: Result) -> RunVerdict:
    """Judge the result of a finished run."""
    beyond = list(_beyond(simulation, result))
    notes = [
        *_numerical(simulation),
        *(doubt.note for doubt in beyond),
        *_few_evaluations(simulation, result),
        *doubts(simulation, result),
    ]
    end = result.end
    if end is None:
        return RunVerdict(notes, "")
    if end in OPEN_ENDS:
        notes.append(OPEN_ENDS[end] + _remedy(result, end))
    notes += [*_later_peak(result), *_late_values(result, end)]
    notes += [*_pull(simulation, result), *_gravity(simulation, result)]
    notes += [*_springs_back(simulation, result), *_yielding(simulation, result)]
    reasons = [Reason.AGAIN] if end is End.AGAIN else [Reason.OPEN] if end in OPEN_PEAKS else []
    reasons += [doubt.reason for doubt in beyond]
    peak_force = result.symmetry_factor * simulation.state.monitor.peak_force
    if peak_force > CROSSED * result.threshold.get("force", np.inf):
        reasons.append(Reason.DELAMINATED)
    return RunVerdict(notes, joined(reasons))


def _remedy(result: Result, end: End) -> str:
    """Say how many steps decide whether the plate touches the projectile again."""
    if end not in (End.AGAIN, End.APART):
        return ""
    if (steps := steps_to_decide(result)) is None:
        return f"; {GO_ON}"
    return f"; about {steps} more steps decide it (--extend)"


def _later_peak(result: Result) -> Iterator[str]:
    """Yield a note if a later contact has raised the peak force."""
    metrics, unit = result.metrics, result.units.get("force", "")
    if metrics["peak_force"] > LATER * metrics["first_peak"]:
        first = f"{metrics['first_peak']:.4g} {unit}".rstrip()
        yield (
            f"the peak force is reached in contact {metrics['peak_contact']}, after reflections in "
            f"the plate: it depends on damping; the peak of the first contact is {first}"
        )


def _late_values(result: Result, end: End) -> Iterator[str]:
    """Yield a note if deflections and exposures are largest near the end of the run."""
    if end is not End.OVER:
        return
    times, w = result["history/time"], result["history/plate_w"]
    late = []
    is_held = MOBILITY not in result.attributes_of("history")  # a free plate moves away
    if is_held and times[w.argmax()] > LATE * times[-1]:
        late.append("deflection")
    late += [
        f"exposure {spelt(exposure.criterion)}"
        for exposure in largest_exposures(result)
        if exposure.time > LATE * times[-1]
    ]
    if late:
        yield (
            f"the largest {', '.join(late)} came in the last fifth of the run, after the contact: "
            "the plate vibrates on and may exceed it; take more steps"
        )


def _pull(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if supports pull that can only push.

    The pull is computed for a static load. A light projectile is gone before its wave reaches the
    supports, so the note requires that the deflection at the peak is near the static deflection.
    """
    problem = simulation.problem
    contact, force = problem.contact, result["history/force"]
    if contact is None or not force.any() or problem.deck.control.numel > MOST_SOLVED:
        return
    held = problem.symmetry.held(problem.mesh)
    support = static_support(problem.moving_plate, contact, held)
    if support is None:
        return
    stiffness, pull = support
    peak = int(force.argmax())
    w = result["history/plate_w"][peak] - start_w_of(result)
    if pull > PULL and w * stiffness > STATIC * force[peak]:
        yield (
            f"the supports pull the plate down with {pull:.0%} of a static load at the "
            "impact; a window or a ring can only push: the plate lifts off there, is softer, and "
            "its peak force is lower"
        )


def _gravity(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if the projectile is so heavy and slow that its weight counts.

    Until the projectile turns, its weight does the work M g w, where w is its displacement. On a
    linear spring with the energy E this raises the force by x + (1 + x^2)^(1/2) - 1, where x = M g
    w/(2 E) is the weight over the peak force.
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
    way -= start_w_of(result)
    share = float(mass * STANDARD_GRAVITY / unit * way / energy)
    x = 0.5 * share
    rise = x + math.hypot(1.0, x) - 1.0
    if rise > HEAVY:
        yield (
            f"gravity is left out: the weight of a projectile that falls adds {share:.1%} to the "
            "impact energy until it turns (M g w); the force and the deflection are then about "
            f"{rise:.0%} larger"
        )


def _springs_back(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if the plate is deflected before the impact and nothing holds it so."""
    start = start_w_of(result)
    if start and simulation.state.rest_factor is None:
        w = quantity(start, unit_of("length", result.units))
        yield (
            f"the impact starts at w = {w} under the load, but the nodal forces do not hold the "
            "plate there during the impact: it moves without the projectile too; a static solution "
            "at the load factor of the impact, to the default tolerance, would be held"
        )


def _yielding(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if an elastic contact presses on a metal far beyond its yield stress."""
    deck, number = simulation.problem.deck, simulation.problem.laminate_number
    material = list(deck.layers.values())[number][0].material
    if deck.last(Indentation) is None or "law" in result.attributes:
        return
    stress = yield_stress(deck, material)
    if not stress:
        return
    peak = float(result.whole("history/force").max())
    pressure = mean_pressure(deck, deck.plies[material], peak, result.symmetry_factor)
    if pressure > FULLY_PLASTIC * stress:
        size = quantity(stress, unit_of(MODULUS, result.units))
        yield (
            f"the mean contact pressure reaches about {pressure / stress:.2g} times the yield "
            f"stress {size} of the struck face: beyond 3 a metal flows, and an elastic law has too "
            "large a force and rebound and no permanent indentation; measure the law (fecm indent "
            "fit)"
        )


def _numerical(simulation: Simulation) -> Iterator[str]:
    """Yield notes about the energy balance and the contact iteration; slips excuse both."""
    state = simulation.state
    has_slips = not simulation.model.variant.is_report
    error, step = state.monitor.worst_error, state.monitor.worst_step
    if error > ENERGY_WARNING:
        off = f"the energy balance is off by {error:.2%} of the supplied energy, at step {step}"
        yield f"{off} (not a failure, as slips are active)" if has_slips else off
    unconverged = state.impact.unconverged_steps if state.impact is not None else 0
    if unconverged and not has_slips:
        yield f"the contact iteration did not converge in {unconverged} steps; a smaller DT helps"


def _few_evaluations(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if FAIL is evaluated so rarely in a contact that maxima are missed."""
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
    """Yield a note if finer meshes may change the exposures at the load much."""
    mesh = simulation.model.load_mesh
    if mesh is None or (mesh.is_measured and mesh.coarseness <= mesh.resolved):
        return
    reach, unit = simulation.problem.reach_of_load, result.units.get("length", "")
    side, radius, needed, length = (
        f"{factor * reach:.3g} {unit}".rstrip()
        for factor in (mesh.coarseness, 1.0, mesh.resolved, mesh.bending_reach)
    )
    band = "have a wide band" if mesh.is_measured else "are not bounded"
    compare = "compare them with those of a finer mesh (fecm check --mesh-error)"
    if not mesh.nine_nodes:
        why = f"the elements there do not have nine nodes; {compare}"
    elif mesh.bending_reach < LEAST_REACH:
        why = (
            f"the load bends the plate over {length}, and c + h/2 is {radius}: the plate is too "
            f"thick for a band; {compare}"
        )
    else:
        where = "" if mesh.at_corner else ", and place a corner of elements at the load"
        why = (
            f"the elements there have sides of {side}, and c + h/2 is {radius}; refine the mesh at "
            f"the load to sides of {needed}{where}"
        )
    yield f"exposures at the load {band}: {why}"


def _beyond(simulation: Simulation, result: Result) -> Iterator[Doubt]:
    """Yield deflection, strain, indentation and exposures that are beyond their limits."""
    with np.errstate(all="ignore"):
        deflection = largest_deflection(simulation, result)
        slope = largest_slope(result)
        strain = largest_strain(simulation, result)
        indentation = largest_indentation(simulation, result)
    limits = simulation.problem.judge
    h = limits.thickness
    if deflection.value > limits.limit * h:
        yield Doubt(BENT[limits.in_plane], _bent(simulation, result, deflection))
    if slope.value > SLOPE:
        reached = _reached(result, "slope", f"{slope.value:.3g}", slope)
        yield Doubt(
            Reason.STEEP,
            f"{reached} {SLOPE}, von Kármán strains, which are for moderate rotations, have an "
            f"error of about slope²/2 = {slope.value**2 / 2.0:.1%}",
        )
    if strain.value > STRAIN:
        reached = _reached(result, "strain", f"{strain.value:.2%}", strain)
        yield Doubt(Reason.STRAINED, f"{reached} 1 %, linear plies are doubtful")
    if indentation.value > INDENTATION * limits.indented:
        size = _size(result, indentation.value, limits.indented)
        reached = _reached(result, "indentation", size, indentation)
        of_face = ", where h is the struck face's thickness" if limits.struck else ""
        yield Doubt(
            Reason.SOFT, f"{reached} h/4{of_face}, the contact law of a half-space is doubtful"
        )
    broken = [
        spelt(exposure.criterion)
        for exposure in largest_exposures(result)
        if exposure.exposure > CROSSED
    ]
    if broken:
        yield Doubt(
            Reason.BROKEN,
            f"exposure above 1 ({', '.join(broken)}): the run continues elastically; "
            "softening after the first failure is not modelled",
        )


def _bent(simulation: Simulation, result: Result, peak: RunPeak) -> str:
    """Yield a note if the deflection is beyond the linear plate."""
    limits = simulation.problem.judge
    is_free = rigid_deflections(simulation.problem.mesh).size > 0
    what = "deflection without the rigid-body motion" if is_free else "deflection"
    h = limits.thickness
    size = _size(result, peak.value, h)
    note = f"{_reached(result, what, size, peak)} {limits.limit} h, {TOO_SOFT}"
    if simulation.problem.has_impact:
        error, meaning = limits.softness(peak.value / h), unsafe(curved=limits.curved)
        note = f"{note}: {error}; {meaning}"
    return f"{note}; {REMEDY}" if simulation.model.variant.is_report else note


def _size(result: Result, value: float, thickness: float) -> str:
    """Format a length and its ratio to the thickness."""
    length = f"{value:.4g} {result.units.get('length', '')}".rstrip()
    return f"{length} = {value / thickness:.3g} h"


def _reached(result: Result, what: str, value: str, peak: RunPeak) -> str:
    """Return the start of a note: the value that a quantity reaches, where and when."""
    time = f"time {peak.time:.6g} {result.units.get('time', '')}".rstrip()
    if not math.isnan(peak.x):
        time = f"({peak.x:.6g}, {peak.y:.6g}), {time}"
    return f"the {what} reaches {value} at {time}: beyond"
