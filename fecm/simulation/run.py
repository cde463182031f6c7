"""Carries out a run: header, macro program, footer, and reasons to doubt its result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm._version import __version__
from fecm.deck.model import Deck, Gages, Material
from fecm.deck.units import unit_names
from fecm.mechanics.failure import MODES
from fecm.mechanics.mesh import Mesh
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.plate_motion import DivergenceError
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.build import ImpactModel, RunOptions
from fecm.problem.check_plausibility import contact_step
from fecm.problem.problem import Problem
from fecm.problem.slips import mode_of
from fecm.results.first_failure import FEWEST, count_evaluations
from fecm.results.result import Result
from fecm.results.schema import FORMAT, FORMAT_VERSION, row_blocks
from fecm.results.sinks import Sink
from fecm.results.summary import OPEN_END, largest_exposures
from fecm.simulation.macros import bind, bind_loop
from fecm.simulation.simulation import Observer, Simulation

# Error of the energy balance, relative to the supplied energy, that triggers a warning.
ENERGY_WARNING = 0.01
STRAIN = 0.01  # largest strain for which plies are taken as linear

Peak = tuple[float, float, float, float]  # value, time, x and y


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
    _judge(simulation)


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
        "format": FORMAT,
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
    """Store the permanent indentation, and the number of steps that did not converge."""
    state, threshold = simulation.state, simulation.problem.threshold
    if threshold is not None:
        values = {
            "force": threshold.force, "d_star": threshold.rigidity, "time": state.monitor.crossing,
            "margin": 1.0 - state.monitor.peak_force / threshold.force,
            "number": threshold.number, "interfaces": threshold.interfaces,
            "band": np.array(threshold.band),
        }  # fmt: skip
        simulation.sink.attributes("threshold", values)
    if state.failure is not None:
        count = count_evaluations(Result(simulation.sink.arrays, {}, {}))
        simulation.sink.attributes("failure", {"evaluations_in_contact": count})
    impact, system = state.impact, simulation.model.impact
    if impact is not None and system is not None and impact.plate.step:
        permanent = system.law.permanent(impact.memory, impact.contact)
        values = {"permanent_indentation": permanent, "unsettled_steps": impact.unconverged_steps}
        simulation.sink.attributes("history", values)


def _judge(simulation: Simulation) -> None:
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
    units = _units(simulation.problem.deck)
    groups: dict[str, dict[str, Any]] = {"": units, "failure": {"modes": list(MODES)}}
    result = Result(simulation.sink.arrays, {}, groups)
    notes += _warnings(simulation, result)
    if state.failure is not None:
        notes += _few_evaluations(result)
    if result.still_in_contact:
        notes.append(OPEN_END)
    if notes:
        simulation.sink.attributes("", {"notes": notes})


def _warnings(simulation: Simulation, result: Result) -> list[str]:
    """Warn of deflection, strain, indentation and exposures beyond their limits, once each."""
    h = simulation.model.plate.laminate.thickness
    length, clock = result.unit("length"), result.unit("time")
    free = _rigid_deflections(simulation.problem.mesh)

    def size(value: float) -> str:
        return f"{value:.4g} {length}".rstrip() + f" = {value / h:.3g} h"

    less = ", less its rigid motion," if free.size else ""
    checks = (
        (f"deflection{less}", _deflections(simulation, result, free), h / 2.0, size,
         "h/2 a linear plate, without membrane stiffening, is too soft"),
        ("strain", _strains(simulation, result), STRAIN, "{:.2%}".format,
         "1 % linear plies are doubtful"),
        ("indentation", _indentations(simulation, result), h / 4.0, size,
         "h/4 the contact law of a half-space is doubtful"),
    )  # fmt: skip
    found = []
    with np.errstate(all="ignore"):
        for what, peaks, limit, shown, why in checks:
            value, time, x, y = max(peaks, default=(0.0, 0.0, 0.0, 0.0))
            if value > limit:
                at = f"at ({x:.6g}, {y:.6g}), time {time:.6g} {clock}".rstrip()
                found.append(f"the {what} reaches {shown(value)} {at}: beyond {why}")
    beyond = [e.criterion.replace("_", " ") for e in largest_exposures(result) if e.exposure > 1.0]
    if beyond:
        found.append(
            f"exposure above 1 ({', '.join(beyond)}): the run goes on elastically, without the "
            "softening that follows the first failure"
        )
    return found


def _few_evaluations(result: Result) -> list[str]:
    """Warn of contacts in which FAIL is evaluated so rarely that maxima are missed."""
    count = count_evaluations(result)
    if "history/force" not in result or count >= FEWEST or not result["history/force"].any():
        return []
    return [
        f"FAIL was evaluated {count} times during contact, less than {FEWEST}: larger exposures "
        "and the first failure may be missed; evaluate more often, in the loop of the steps"
    ]


def _rigid_deflections(mesh: Mesh) -> Floats:
    """Orthonormal basis of w, (numnp, n), of the rigid motions that the supports allow."""
    used = mesh.used
    place = mesh.coordinates[used, :2] - mesh.coordinates[used, :2].mean(axis=0)
    w = np.column_stack([np.ones(len(place)), place / np.abs(place).max()])
    slopes = np.broadcast_to(np.eye(3)[1:], (len(place), 2, 3))
    motions = np.concatenate([w[:, None], slopes], axis=1)  # of w, theta_x, theta_y
    held = motions[mesh.equations[used, 2:] == 0]
    resistance, combined = np.linalg.eigh(held.T @ held)
    basis = np.zeros((len(used), 3))
    basis[used] = w
    return np.linalg.qr(basis @ combined[:, resistance < 1e-9 * len(place)])[0]


def _peak(values: Floats, times: Floats, x: Any, y: Any) -> Peak:
    """The largest of values, (rows, ...), at places (...)."""
    row, *at = np.unravel_index(int(values.argmax()), values.shape)
    return float(values[row, *at]), float(times[row]), float(x[*at]), float(y[*at])


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
    for times, (w,) in _rows(result, "tape3", "w"):
        yield _peak(np.abs(w - (w @ free) @ free.T), times, x, y)
    if (place := simulation.problem.load_place) is not None and not free.size:
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
