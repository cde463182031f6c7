"""Notes and validity of a finished run, from its largest values.

What a note says, and from which size on, are rows of :mod:`fecm.judge.limits`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from fecm._typing import Array, Floats
from fecm.deck.model import Gages, Impact, Indentation
from fecm.deck.units import MODULUS, in_si, quantity, unit_of
from fecm.judge.criteria import spelt, yield_stress
from fecm.judge.end import DECIDING_STEPS, ENDS, End
from fecm.judge.exposure_bands import coarse_mesh_note
from fecm.judge.limits import (
    ENERGY_BALANCE,
    EXPOSURE,
    FAIL_EVALUATIONS,
    GRAVITY,
    INDENTATION,
    ITERATION,
    LATE_VALUE,
    LATER_CONTACT,
    PULL,
    SLOPE,
    SPRING_BACK,
    STRAIN,
    STRETCHED_FREQUENCY,
    STRETCHED_THRESHOLD,
    THRESHOLD,
    YIELDING,
    ModelLimit,
)
from fecm.judge.validity import joined, of_face, unsafe
from fecm.mechanics.mesh import rigid_deflections
from fecm.mechanics.points import shortest_side
from fecm.mechanics.quick_models import static_energy, static_peak
from fecm.problem.contact_estimates import mean_pressure
from fecm.problem.estimates import pull_of_edges, pushing_compliance
from fecm.problem.problem import Problem
from fecm.results.exposures import count_evaluations, largest_exposures
from fecm.results.metrics import MOBILITY
from fecm.results.onset import energy_at_force
from fecm.results.result import Result
from fecm.results.run_metrics import peak_and_deflection, start_w_of, steps_to_decide
from fecm.results.stored import row_blocks
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

    It is zero if no strain of the elements comes near :data:`~fecm.judge.limits.STRAIN`.
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
    free = rigid_deflections(problem.plate.supported)
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
        if np.abs(preload).sum() + sum(sizes[:-3]) + half.max() * sum(sizes[-3:]) < STRAIN.value:
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
    near = STRETCHED_FREQUENCY.value**2
    if (2.0 / problem.safe_time_step) ** 2 + growth <= near * allowed:
        return
    linear = (2.0 / problem.critical_time_step) ** 2
    # A time step that is as near to the linear plate's limit was chosen on purpose.
    limit = allowed * (near if linear < near * allowed else 1.0)
    if linear + growth > limit:
        yield STRETCHED_FREQUENCY.say(
            force=quantity(largest.value, unit_of("force/length", result.units)),
            time=quantity(largest.time, unit_of("time", result.units)),
            linear=math.sqrt(linear / allowed),
            share=math.sqrt((linear + growth) / allowed),
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
    if bending > 0.0 and force > STRETCHED_THRESHOLD.value * bending:
        yield STRETCHED_THRESHOLD.say(
            time=quantity(when, unit_of("time", result.units)),
            force=quantity(force, unit_of("force/length", result.units)),
            share=force / bending,
        )


STANDARD_GRAVITY = 9.80665  # m/s^2


class RunVerdict(NamedTuple):
    """Reasons to doubt a result, and its largest values."""

    notes: list[str]  # sentences; empty without a doubt
    validity: str  # ``"ok"`` or reasons; empty without impact steps


class Beyond(NamedTuple):
    """Limit of the model that a run exceeds."""

    limit: ModelLimit
    note: str


def judge_run(simulation: Simulation, result: Result) -> RunVerdict:
    """Judge the result of a finished run."""
    beyond = list(_beyond(simulation, result))
    notes = [
        *_numerical(simulation),
        *(exceeded.note for exceeded in beyond),
        *_few_evaluations(simulation, result),
        *doubts(simulation, result),
    ]
    end = result.end
    if end is None:
        return RunVerdict(notes, "")
    meaning = ENDS[end]
    if end is not End.OVER:
        notes.append(meaning.note(_remedy(result, end)))
    notes += [*_later_peak(result), *_late_values(result, end)]
    notes += [*_pull(simulation, result), *_gravity(simulation, result)]
    notes += [*_springs_back(simulation, result), *_yielding(simulation, result)]
    reasons = [] if meaning.doubt is None else [meaning.doubt.reason]
    reasons += [exceeded.limit.reason for exceeded in beyond]
    peak_force = result.symmetry_factor * simulation.state.monitor.peak_force
    if peak_force > THRESHOLD.value * result.threshold.get("force", np.inf):
        reasons.append(THRESHOLD.reason)
    return RunVerdict(notes, joined(reasons))


def _remedy(result: Result, end: End) -> str:
    """Say how many steps decide whether the plate touches the projectile again, if it is known."""
    if end not in (End.AGAIN, End.APART) or (steps := steps_to_decide(result)) is None:
        return ""
    return DECIDING_STEPS.format(steps=steps)


def _later_peak(result: Result) -> Iterator[str]:
    """Yield a note if a later contact has raised the peak force."""
    metrics, unit = result.metrics, result.units.get("force", "")
    if metrics["peak_force"] > LATER_CONTACT.value * metrics["first_peak"]:
        first = f"{metrics['first_peak']:.4g} {unit}".rstrip()
        yield LATER_CONTACT.say(contact=metrics["peak_contact"], first=first)


def _late_values(result: Result, end: End) -> Iterator[str]:
    """Yield a note if deflections and exposures are largest near the end of the run."""
    if end is not End.OVER:
        return
    times, w = result["history/time"], result["history/plate_w"]
    late = []
    is_held = MOBILITY not in result.attributes_of("history")  # a free plate moves away
    if is_held and times[w.argmax()] > LATE_VALUE.value * times[-1]:
        late.append("deflection")
    late += [
        f"exposure {spelt(exposure.criterion)}"
        for exposure in largest_exposures(result)
        if exposure.time > LATE_VALUE.value * times[-1]
    ]
    if late:
        yield LATE_VALUE.say(quantities=", ".join(late))


def _pull(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if supports pull that can only push. The pull is computed for a static load."""
    problem = simulation.problem
    pull = pull_of_edges(problem, *peak_and_deflection(result))
    if pull > PULL.value:
        assert problem.static is not None  # it has the pull
        band = _band_without_pull(problem, result, problem.static.compliance)
        yield PULL.say(pull=pull, band=band, remedy=simulation.model.variant.is_report)


def _band_without_pull(problem: Problem, result: Result, held: float) -> str:
    """Say how much softer a plate is whose supports only push, and what that does to the impact.

    The run has the peak and the energy at the delamination threshold of the plate whose supports
    pull. The ratio of both plates is computed for the impact on the static plate.
    `held` is the compliance of the plate whose supports pull as well.
    """
    pushed = pushing_compliance(problem)
    if math.isnan(pushed):
        return "without clamps the plate tips off them"
    softer = f"the plate is then {pushed / held - 1.0:.1%} more flexible"
    factor, k = problem.symmetry.factor, problem.contact_coefficient
    mass, velocity = problem.projectile_mass, problem.deck.require(Impact).velocity
    stiffness = factor / held, factor / pushed
    first, second = (static_peak(mass, velocity, k, each) for each in stiffness)
    peak = float(result["history/force"].max()) * factor
    unit = unit_of("force", result.units)
    low, high = quantity(peak * second / first, unit), quantity(peak, unit)
    text = f"{softer}, and the peak force lies between {low} and {high}"
    if not result.threshold:
        return text
    force, unit = float(result.threshold["force"]), unit_of("force*length", result.units)
    energy = energy_at_force(result, force)
    if math.isnan(energy):
        return text
    first, second = (static_energy(force, k, each) for each in stiffness)
    # As many digits as the summary has of this energy.
    low, high = quantity(energy, unit, 3), quantity(energy * second / first, unit, 3)
    return f"{text}, and the impact energy at the delamination threshold between {low} and {high}"


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
    if rise > GRAVITY.value:
        yield GRAVITY.say(share=share, rise=rise)


def _springs_back(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if the plate is deflected before the impact and nothing holds it so."""
    start = start_w_of(result)
    if start and simulation.state.rest_factor is None:
        yield SPRING_BACK.say(w=quantity(start, unit_of("length", result.units)))


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
    if pressure > YIELDING.value * stress:
        size = quantity(stress, unit_of(MODULUS, result.units))
        yield YIELDING.say(ratio=pressure / stress, stress=size)


def _numerical(simulation: Simulation) -> Iterator[str]:
    """Yield notes about the energy balance and the contact iteration; slips excuse both."""
    state = simulation.state
    has_slips = not simulation.model.variant.is_report
    error, step = state.monitor.worst_error, state.monitor.worst_step
    if error > ENERGY_BALANCE.value:
        off = ENERGY_BALANCE.say(error=error, step=step)
        yield f"{off} (not a failure, as slips are active)" if has_slips else off
    unconverged = state.impact.unconverged_steps if state.impact is not None else 0
    if unconverged and not has_slips:
        yield ITERATION.say(steps=unconverged)


def _few_evaluations(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if FAIL is evaluated so rarely in a contact that maxima are missed."""
    if simulation.state.failure is None:
        return
    yield from _coarse_elements(simulation, result)
    count = count_evaluations(result)
    if (
        "history/force" in result
        and count < FAIL_EVALUATIONS.value
        and result["history/force"].any()
    ):
        yield FAIL_EVALUATIONS.say(count=count)


def _coarse_elements(simulation: Simulation, result: Result) -> Iterator[str]:
    """Yield a note if finer meshes may change the exposures at the load much."""
    mesh = simulation.model.load_mesh
    if mesh is None or (mesh.is_measured and mesh.coarseness <= mesh.resolved):
        return
    reach, unit = simulation.problem.reach_of_load, result.units.get("length", "")
    yield coarse_mesh_note(mesh, lambda factor: f"{factor * reach:.3g} {unit}".rstrip())


def _beyond(simulation: Simulation, result: Result) -> Iterator[Beyond]:
    """Yield the limits that deflection, strain, indentation and exposures exceed."""
    judge = simulation.problem.judge

    def beyond(limit: ModelLimit, peak: RunPeak, size: str, **sizes: Any) -> Iterator[Beyond]:
        if peak.value > judge.largest(limit):
            place = _place(result, peak)
            yield Beyond(limit, limit.say(size=size, place=place, **sizes))

    with np.errstate(all="ignore"):
        deflection = largest_deflection(simulation, result)
        slope = largest_slope(result)
        strain = largest_strain(simulation, result)
        indentation = largest_indentation(simulation, result)
    h, indented = judge.thickness, judge.indented
    is_free = rigid_deflections(simulation.problem.plate.supported).size > 0
    yield from beyond(
        judge.deflection,
        deflection,
        _size(result, deflection.value, h),
        quantity="deflection without the rigid-body motion" if is_free else "deflection",
        error=_error(simulation, deflection.value / h),
        remedy=simulation.model.variant.is_report,
    )
    yield from beyond(SLOPE, slope, f"{slope.value:.3g}", error=slope.value**2 / 2.0)
    yield from beyond(STRAIN, strain, f"{strain.value:.2%}")
    size = _size(result, indentation.value, indented)
    yield from beyond(INDENTATION, indentation, size, of_face=of_face(judge))
    broken = [
        spelt(exposure.criterion)
        for exposure in largest_exposures(result)
        if exposure.exposure > EXPOSURE.value
    ]
    if broken:
        yield Beyond(EXPOSURE, EXPOSURE.say(criteria=", ".join(broken)))


def _error(simulation: Simulation, ratio: float) -> str:
    """Format the error of the linear plate at a deflection over its thickness, if it is known."""
    judge = simulation.problem.judge
    if not simulation.problem.has_impact:
        return ""
    return f": {judge.softness(ratio)}; {unsafe(curved=judge.curved)}"


def _size(result: Result, value: float, thickness: float) -> str:
    """Format a length and its ratio to the thickness."""
    length = f"{value:.4g} {result.units.get('length', '')}".rstrip()
    return f"{length} = {value / thickness:.3g} h"


def _place(result: Result, peak: RunPeak) -> str:
    """Format where and when a quantity is largest."""
    time = f"time {peak.time:.6g} {result.units.get('time', '')}".rstrip()
    return time if math.isnan(peak.x) else f"({peak.x:.6g}, {peak.y:.6g}), {time}"
