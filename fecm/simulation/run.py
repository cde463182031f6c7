"""Carries out a run: header, macro program, footer, and reasons to doubt its result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm._version import __version__
from fecm.deck.model import Deck, Gages, Material
from fecm.deck.units import unit_names
from fecm.mechanics.failure import MODES
from fecm.mechanics.mesh import rigid_deflections
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import ImpactModel, RunOptions
from fecm.problem.check_plausibility import contact_step
from fecm.problem.problem import Problem
from fecm.problem.slips import mode_of
from fecm.results.blocks import row_blocks
from fecm.results.end import OPEN_ENDS, End
from fecm.results.exposures import FEWEST, count_evaluations, largest_exposures
from fecm.results.linear_plate import TOO_SOFT, UNSAFE, softness
from fecm.results.metrics import MOBILITY, VALIDITY
from fecm.results.result import Result
from fecm.results.schema import FORMAT_VERSION, Form
from fecm.results.sinks import Sink
from fecm.results.validity import BENT, CROSSED, INDENTATION, STRAIN, Reason, joined
from fecm.simulation.macros import bind, bind_loop
from fecm.simulation.simulation import Observer, Simulation

# Error of the energy balance, relative to the supplied energy, that triggers a warning.
ENERGY_WARNING = 0.01


class Peak(NamedTuple):
    """Largest value of a quantity, and where and when it occurs."""

    value: float
    time: float
    x: float
    y: float


def simulate(
    problem: Problem,
    sink: Sink,
    options: RunOptions | None = None,
    observers: Sequence[Observer] = (),
) -> Simulation:
    """Run a problem into a sink and return the finished simulation; see :func:`run`."""
    simulation = Simulation(problem, sink, options or RunOptions(), observers=observers)
    run(simulation)
    return simulation


def run(simulation: Simulation) -> None:
    """Carry out a program, from its beginning or from the restored state.

    Raises DivergenceError, with the likely cause, if the motion grows without bound or the energy
    balance exceeds its limit.  Raises SingularStiffnessError if a static solution is
    requested and the plate is not held.
    """
    problem, state = simulation.problem, simulation.state
    if not state.position:
        _write_header(simulation)
        simulation.printer.problem(problem.deck, problem.mesh, simulation.model.plate)
    try:
        with np.errstate(all="ignore"):  # an overflow is reported as a divergence
            simulation.interpreter.run(
                partial(bind, simulation),
                state.position,
                partial(simulation.on_macro, simulation),
                partial(bind_loop, simulation),
            )
            if state.failure is not None:
                simulation.recorder.failure(state.failure)
            simulation.recorder.finish()
    except DivergenceError as diverged:
        cause = _likely_cause(problem, simulation.model, state.dt)
        raise DivergenceError(diverged.step, f"{diverged.reason}; {cause}") from None
    _write_footer(simulation)


def _likely_cause(problem: Problem, model: ImpactModel, dt: float) -> str:
    """Explain a divergence, as far as the time step does."""
    plate = model.motion.plate
    try:
        critical = critical_time_step(plate)
        contact = contact_step(problem, plate, dt, critical)
    except UnsoundPlateError as error:
        return str(error)
    side = "above" if dt > critical else "below"
    cause = f"DT = {dt:.4g} is {side} the plate's critical time step {critical:.4g}"
    if dt > critical:
        return cause
    if contact is not None and dt >= contact.limit:
        return (
            f"{cause}, but not below {contact.limit:.4g}, the stable step with the contact's "
            f"stiffness k_t of about {contact.stiffness:.3g} (the contact needs DT < "
            f"2 (m/k_t)^(1/2), m = {contact.mass:.3g})"
        )
    if len({macro.value for macro in problem.deck.macros if macro.word == "DT"}) > 1:
        return f"{cause}, but DT changes: steps that alternate diverge below the critical one"
    return cause


def _write_header(simulation: Simulation) -> None:
    """Store the attributes of the file, the deck, and every dataset without its rows."""
    sink, options, deck = simulation.sink, simulation.options, simulation.problem.deck
    attributes = {
        "format": Form.RUN.value,
        "format_version": FORMAT_VERSION,
        "fecm_version": __version__,
        "title": deck.title,
        "mode": mode_of(options.slips),
        "slips": sorted(options.slips),
        "solver": simulation.model.motion.solver,
        **options.rod_method.attributes,
        **({} if options.law is None else {"law": type(options.law).__name__}),
        **_units(deck),
    }
    sink.attributes("", attributes)
    sink.text("deck", deck.text or deck.to_text(), "the cards of the problem")
    at_nodes = deck.require(Material).integration.points < 0 and "tapes" not in options.slips
    simulation.recorder.create("nodes" if at_nodes else "gauss")


def _units(deck: Deck) -> dict[str, str]:
    """Attributes that name the units; empty without UNIT."""
    return {f"unit_{name}": unit for name, unit in unit_names(deck).items()}


def _write_footer(simulation: Simulation) -> None:
    """Store what the end of the run has decided, and reasons to doubt the result."""
    problem, state, sink = simulation.problem, simulation.state, simulation.sink
    impact, system = state.impact, simulation.model.impact
    attributes: dict[str, Any] = {}
    if impact is not None and system is not None and impact.plate.step:
        permanent = system.law.permanent(impact.memory, impact.contact)
        attributes["permanent_indentation"] = permanent
        attributes["unsettled_steps"] = impact.unconverged_steps
        if problem.judge.mobility:
            attributes[MOBILITY] = problem.judge.mobility
        sink.attributes("history", attributes)
    groups: dict[str, dict[str, Any]] = {
        "": _units(problem.deck),
        "failure": {"modes": list(MODES)},
        "history": attributes,
        "energy": {"initial": simulation.recorder.steps.initial},
    }
    threshold = problem.threshold
    if threshold is not None:
        groups["threshold"] = {"force": threshold.force}
    result = Result(sink.arrays, {}, groups, problem.deck)
    if threshold is not None:
        values = {
            "force": threshold.force, "d_star": threshold.rigidity, "time": state.monitor.crossing,
            "margin": result.metrics.get("threshold_margin", 1.0),
            "number": threshold.number, "interfaces": threshold.interfaces,
            "band": np.array(threshold.band),
        }  # fmt: skip
        sink.attributes("threshold", values)
    if state.failure is not None:
        sink.attributes("failure", {"evaluations_in_contact": count_evaluations(result)})
    _judge(simulation, result)


def _judge(simulation: Simulation, result: Result) -> None:
    """Store reasons to doubt the result, if there are any."""
    notes: list[str] = []
    state, enforced = simulation.state, not simulation.options.slips
    error, step = state.monitor.worst_error, state.monitor.worst_step
    if error > ENERGY_WARNING:
        off = f"the energy balance is off by {error:.2%} of the supplied energy, at step {step}"
        notes.append(off if enforced else f"{off} (not a failure, as slips are active)")
    steps = state.impact.unconverged_steps if state.impact is not None else 0
    if steps and enforced:
        notes.append(f"the contact iteration did not converge in {steps} steps; a smaller DT helps")
    beyond = list(_beyond(simulation, result))
    notes += [text for _, text in beyond]
    if state.failure is not None:
        notes += _few_evaluations(result)
    end = result.end
    if end is not None:
        notes += [OPEN_ENDS[end]] if end in OPEN_ENDS else []
        reasons: list[str] = [Reason.OPEN] if end in (End.RISING, End.BETWEEN) else []
        reasons += [reason for reason, _ in beyond]
        if state.monitor.peak_force > CROSSED * result.threshold.get("force", np.inf):
            reasons.append(Reason.DELAMINATED)
        simulation.sink.attributes("", {VALIDITY: joined(reasons)})
    if notes:
        simulation.sink.attributes("", {"notes": notes})


def _beyond(simulation: Simulation, result: Result) -> Iterator[tuple[str, str]]:
    """Reason and note of deflection, strain, indentation and exposures beyond their limits."""
    judge = simulation.problem.judge
    h = judge.thickness
    length, clock = result.unit("length"), result.unit("time")
    free = rigid_deflections(simulation.problem.mesh)

    def size(value: float) -> str:
        return f"{value:.4g} {length}".rstrip() + f" = {value / h:.3g} h"

    def told(what: str, value: str, peak: Peak) -> str:
        at = f"at ({peak.x:.6g}, {peak.y:.6g}), time {peak.time:.6g} {clock}".rstrip()
        return f"the {what} reaches {value} {at}: beyond"

    with np.errstate(all="ignore"):
        bent, strained, indented = (
            max(peaks, default=Peak(0.0, 0.0, 0.0, 0.0))
            for peaks in (
                _deflections(simulation, result, free),
                _strains(simulation, result),
                _indentations(simulation, result),
            )
        )
    if bent.value > judge.limit * h:
        what = f"deflection{', less its rigid motion,' if free.size else ''}"
        text = f"{told(what, size(bent.value), bent)} {judge.limit} h {TOO_SOFT}"
        if simulation.problem.has_impact:
            text += f": {softness(bent.value / h, judge.in_plane)}; {UNSAFE}"
        yield BENT[judge.in_plane], text
    if strained.value > STRAIN:
        text = told("strain", f"{strained.value:.2%}", strained)
        yield Reason.STRAINED, f"{text} 1 % linear plies are doubtful"
    if indented.value > INDENTATION * h:
        text = told("indentation", size(indented.value), indented)
        yield Reason.SOFT, f"{text} h/4 the contact law of a half-space is doubtful"
    found = [e.criterion.replace("_", " ") for e in largest_exposures(result) if e.exposure > 1.0]
    if found:
        yield (
            Reason.BROKEN,
            f"exposure above 1 ({', '.join(found)}): the run goes on elastically, without the "
            "softening that follows the first failure",
        )


def _few_evaluations(result: Result) -> list[str]:
    """Warn of contacts in which FAIL is evaluated so rarely that maxima are missed."""
    count = count_evaluations(result)
    if "history/force" not in result or count >= FEWEST or not result["history/force"].any():
        return []
    return [
        f"FAIL was evaluated {count} times during contact, less than {FEWEST}: larger exposures "
        "and the first failure may be missed; evaluate more often, in the loop of the steps"
    ]


def _peak(values: Floats, times: Floats, x: Any, y: Any) -> Peak:
    """The largest of values, (rows, ...), at places (...)."""
    row, *at = np.unravel_index(int(values.argmax()), values.shape)
    return Peak(float(values[row, *at]), float(times[row]), float(x[*at]), float(y[*at]))


def _rows(result: Result, group: str, *names: str) -> Iterator[tuple[Floats, list[Floats]]]:
    """Times and datasets of a group, block by block; nothing if they are not stored."""
    paths = [f"{group}/{name}" for name in names]
    if paths[-1] in result:
        times = result[f"{group}/time"]
        shape = (len(times), *result.rows(paths[-1], 0, 1).shape[1:])
        for start, stop in row_blocks(shape):
            yield times[start:stop], [result.rows(path, start, stop) for path in paths]


def _deflections(simulation: Simulation, result: Result, free: Floats) -> Iterator[Peak]:
    """Peaks of the deflection less the rigid motions."""
    x, y = simulation.problem.mesh.coordinates[:, :2].T
    place = simulation.problem.load_place
    by_step = place is not None and not free.size and "history/plate_w" in result
    # Under the load the deflection is that of the summary, the mean over the patch.
    under = simulation.problem.under_load(x, y) & by_step
    for times, (w,) in _rows(result, "tape3", "w"):
        bent = np.abs(w - (w @ free) @ free.T)
        yield _peak(np.where(under, 0.0, bent), times, x, y)
    if place is not None and by_step:
        for times, (w,) in _rows(result, "history", "plate_w"):
            yield _peak(np.abs(w), times, *map(np.asarray, place))


def _indentations(simulation: Simulation, result: Result) -> Iterator[Peak]:
    """Peaks of the indentation in contact."""
    if (place := simulation.problem.load_place) is not None:
        for times, (force, alpha) in _rows(result, "history", "force", "indentation"):
            yield _peak(np.where(force > 0.0, alpha, 0.0), times, *map(np.asarray, place))


def _strains(simulation: Simulation, result: Result) -> Iterator[Peak]:
    """Peaks of the largest principal strain of both faces, away from the load, and of gages."""
    model, problem = simulation.model, simulation.problem
    half = model.plate.laminate.thickness / 2.0
    bending = ("kappa_x", "kappa_y", "kappa_xy")
    both = ("eps_xx", "eps_yy", "gamma_xy", *bending)
    stored = ("tape8", model.strains, bending), ("stresses", model.stress_points, both)
    for group, points, names in stored:
        for times, values in _rows(result, group, *names):
            sizes = [max(part.max(), -part.min()) for part in values]
            if sum(sizes[:-3]) + half * sum(sizes[-3:]) < STRAIN:
                continue  # a bound, as few runs come near the limit
            curvature = [half * kappa for kappa in values[-3:]]
            middle = values[:-3] or [np.zeros(())] * 3
            x, y = points.places(problem.mesh.coordinates)
            near = problem.under_load(x, y)
            for side in (1.0, -1.0):
                xx, yy, xy = (m + side * k for m, k in zip(middle, curvature, strict=True))
                largest = 0.5 * (np.abs(xx + yy) + np.hypot(xx - yy, xy))
                yield _peak(np.where(near | ~np.isfinite(largest), 0.0, largest), times, x, y)
    if (cards := problem.deck.last(Gages)) is not None:
        x, y = np.array([(gage.x, gage.y) for gage in cards.records]).T
        for times, (strain,) in _rows(result, "gages", "strain"):
            yield _peak(np.abs(strain), times, x, y)
