"""Runs some cases of a sweep: together where they share a plate, each by itself where not.

Cases share a plate where they differ in the projectile, its approach or the law alone.  The plate
is then stepped once, under a unit force, and everything else follows from that response.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm.assembly import PlateModel
from fecm.check import Checked, check
from fecm.check.impact import check_impact, check_law, check_projectile
from fecm.deck.findings import Findings
from fecm.deck.model import Deck, Impact, Indentation, Projectile
from fecm.deck.reader import Problem
from fecm.dynamics import DivergenceError
from fecm.impact import Encounter, meet
from fecm.indentation import MemoryLaw, Point, stacked
from fecm.mesh import Mesh, generate
from fecm.parts import build_law, build_projectile, set_up
from fecm.program import Body, Loop, estimate, flat
from fecm.projectile import WilsonStep
from fecm.results.schema import Dataset
from fecm.simulation import simulate
from fecm.solvers import SAFE
from fecm.stability import critical_time_step
from fecm.sweeps.cases import Case, CasesError
from fecm.sweeps.outcome import FINE, SUMMARY, Outcome, summarise
from fecm.sweeps.responses import Convolution, TipState, TipSteps, plate_response
from fecm.sweeps.variations import varied

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """Cases that are run together.

    Attributes
    ----------
    number : int
        The task's number.
    deck : Deck
        What is varied.
    numbers : tuple of int
        The cases' numbers.
    cases : tuple of dict
        Their values.
    history : bool
        Whether the forces are wanted.
    """

    number: int
    deck: Deck
    numbers: tuple[int, ...]
    cases: tuple[Case, ...]
    history: bool = False


def run(task: Task) -> Outcome:
    """Run the cases of a task; one that can't be run is a row with its reason."""
    good: list[tuple[int, Deck]] = []
    lost: dict[int, str] = {}
    for number, case in zip(task.numbers, task.cases, strict=True):
        try:
            good.append((number, varied(task.deck, case)))
        except CasesError as error:
            lost[number] = str(error)
    parts: list[Outcome] = []
    mesh = generate(good[0][1]) if good else None
    sound = [] if mesh is None else [pair for pair in good if not _refuse(*pair, mesh, lost)]
    if sound:
        checked, reason = _checked(sound[0][1])
        if checked is None:
            lost |= dict.fromkeys((number for number, _ in sound), reason)
        else:
            if shares_plate(checked):
                parts.append(_together([n for n, _ in sound], [d for _, d in sound], checked))
            else:
                parts += [_alone(number, replace(checked, deck=deck)) for number, deck in sound]
    if lost:
        parts.append(Outcome.failed(list(lost), list(lost.values())))
    outcome = joined(parts)
    return outcome if task.history else replace(outcome, force=None)


def _checked(deck: Deck) -> tuple[Checked | None, str]:
    """Check a deck whole; the first error where it has any."""
    findings = Findings()
    checked = check(Problem(deck), findings)
    if findings.errors:
        return None, findings.errors[0].message
    return checked, ""


def _refuse(number: int, deck: Deck, mesh: Mesh, lost: dict[int, str]) -> bool:
    """Whether a case's own cards, the plate's apart, can't be used; note why."""
    findings = Findings()
    check_impact(deck.need(Impact), deck, mesh, findings)
    check_law(deck.need(Indentation), findings)
    if (projectile := deck.last(Projectile)) is not None:
        check_projectile(projectile, findings)
    if findings.errors:
        lost[number] = findings.errors[0].message
    return bool(findings.errors)


def shares_plate(checked: Checked) -> bool:
    """Whether a program only takes impact steps of one size, on a plate without other loads."""
    words = [macro.word for macro in flat(checked.program)]
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    return (
        "RODP" in words
        and len(sizes) == 1
        and words.index("DT") < words.index("RODP")
        and not {"EXCD", "TANG", "FORM", "SOLV"}.intersection(words)
        and not checked.mesh.forces.any()
    )


def _time_step(checked: Checked, plate: PlateModel) -> float:
    """The program's time step; 0 is 0.9 of the critical one, as in a run."""
    dt = next(macro.value for macro in flat(checked.program) if macro.word == "DT")
    return dt or float(f"{SAFE * critical_time_step(plate):.3g}")


def _together(numbers: list[int], decks: list[Deck], checked: Checked) -> Outcome:
    """Run cases that share a plate, by its response to a unit force."""
    setup = set_up(checked.deck, checked.mesh, moves_only=True)
    if setup.impact is None:
        raise ValueError("nothing hits in this deck")
    steps = estimate(checked.program).steps
    dt = _time_step(checked, setup.plate)
    projectiles = [build_projectile(deck) for deck in decks]
    kinds = {projectile: number for number, projectile in enumerate(dict.fromkeys(projectiles))}
    # Cases of a kind side by side.
    order = sorted(range(len(decks)), key=lambda case: kinds[projectiles[case]])
    kind = np.array([kinds[projectiles[case]] for case in order], dtype=np.intp)
    with np.errstate(all="ignore"):
        response = plate_response(setup.motion, setup.impact.contact.row, dt, steps)
        rods = [WilsonStep(rod.stiffness(), rod.mass(), dt) for rod in kinds]
        law = MemoryLaw(stacked([build_law(decks[case]).constants for case in order]))
        speed = np.array([decks[case].need(Impact).velocity for case in order])
        force, deepest, permanent = impacts(response, TipSteps(rods, kind, steps), law, speed)
        times = np.add.accumulate(np.full(steps, dt))
        mass = np.array([projectiles[case].total_mass for case in order])
        summary = summarise(force, times, deepest, permanent, mass, speed)
    back = np.argsort(order)
    finite = np.isfinite(summary["impulse"])[back]
    return Outcome(
        numbers,
        {name: np.where(finite, values[back], np.nan) for name, values in summary.items()},
        [FINE if sound else "the motion is no longer finite" for sound in finite],
        np.full(len(numbers), dt),
        np.full(len(numbers), steps, dtype=np.int64),
        np.ascontiguousarray(force.T[back]),
    )


def impacts(
    response: Floats, tips: TipSteps, law: MemoryLaw, speed: Floats
) -> tuple[Floats, Floats, Floats]:
    """Many impacts on a plate of which the response to a unit force is known.

    Parameters
    ----------
    response : ndarray (steps,)
        See :func:`~fecm.sweeps.responses.plate_response`.
    tips : TipSteps
        The projectiles.
    law : MemoryLaw
        With arrays of constants.
    speed : ndarray (cases,)
        Approach velocities.

    Returns
    -------
    force : ndarray (steps, cases)
        Contact force after every step.
    deepest, permanent : ndarray (cases,)
        Largest and permanent indentation.
    """
    steps, cases = len(response), len(speed)
    none = np.zeros(cases)
    plate = Convolution(response, np.zeros(cases, dtype=np.intp))
    state = Encounter(
        TipState(none, -speed, none), law.start(), Point(none, none), unsettled=none.astype(int)
    )
    force, deepest = np.empty((steps, cases)), none
    for step in range(steps):
        meet(tips, law, state, plate.next())
        plate.give(state.contact.force)
        force[step] = state.contact.force
        deepest = np.maximum(deepest, state.contact.indentation)
    return force, deepest, law.permanent(state.memory, state.contact)


class _HistorySink:
    """Keeps the contact's history of a run and forgets the rest."""

    KEPT = ("history/force", "history/time", "history/indentation")

    def __init__(self) -> None:
        self.arrays: dict[str, Floats] = {}
        self.permanent = 0.0

    def attributes(self, group: str, values: Any) -> None:
        self.permanent = values.get("permanent_indentation", self.permanent)

    def create(self, dataset: Dataset, shape: tuple[int, ...]) -> None:
        if dataset.path in self.KEPT:
            self.arrays[dataset.path] = np.zeros(shape)

    def write(self, path: str, start: int, rows: NDArray[Any]) -> None:
        if path in self.arrays:
            self.arrays[path][start : start + len(rows)] = rows

    def trim(self, path: str, rows: int) -> None:
        if path in self.arrays:
            self.arrays[path] = self.arrays[path][:rows]

    def text(self, path: str, value: str, description: str) -> None:
        pass


def _alone(number: int, checked: Checked) -> Outcome:
    """Run one case as a whole, without storing fields."""
    sink = _HistorySink()
    try:
        simulation = simulate(replace(checked, program=quiet(checked.program)), sink)
    except (DivergenceError, ArithmeticError) as error:
        return Outcome.failed([number], [str(error)])
    force, times = sink.arrays["history/force"], sink.arrays["history/time"]
    deepest = np.maximum(sink.arrays["history/indentation"].max(keepdims=True), 0.0)
    mass = build_projectile(checked.deck).total_mass
    speed = checked.deck.need(Impact).velocity
    summary = summarise(
        force[:, None], times, deepest, np.array([sink.permanent]), mass, np.array([speed])
    )
    steps = np.array([len(force)], dtype=np.int64)
    return Outcome([number], summary, [FINE], np.array([simulation.dt]), steps, force[None])


def quiet(body: Body) -> Body:
    """A program that stores no fields."""
    kept: list[Any] = []
    for item in body:
        if isinstance(item, Loop):
            kept.append(replace(item, body=quiet(item.body)))
        elif item.word == "RODP":
            kept.append(replace(item, value=1e9))
        elif item.word not in ("DISP", "STRE", "REAC", "EIGE"):
            kept.append(item)
    return tuple(kept)


def joined(parts: list[Outcome]) -> Outcome:
    """One outcome of several, in the order of the cases' numbers."""
    numbers = [number for part in parts for number in part.numbers]
    order = np.argsort(numbers)
    longest = max((0 if part.force is None else part.force.shape[1] for part in parts), default=0)
    force = np.full((len(numbers), longest), np.nan)
    row = 0
    for part in parts:
        if part.force is not None:
            force[row : row + len(part.numbers), : part.force.shape[1]] = part.force
        row += len(part.numbers)
    status = [text for part in parts for text in part.status]
    return Outcome(
        [numbers[i] for i in order],
        {name: np.concatenate([part.summary[name] for part in parts])[order] for name in SUMMARY},
        [status[i] for i in order],
        np.concatenate([part.dt for part in parts])[order],
        np.concatenate([part.steps for part in parts])[order],
        force[order],
    )
