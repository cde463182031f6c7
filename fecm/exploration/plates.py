"""What a page needs of a plate and its impacts: what the kernel takes, scales and limits.

All values are in the deck's units; forces, masses and k are those of the deck's part of a symmetric
plate, thresholds those of the whole plate.
"""

from __future__ import annotations

import base64
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from fecm._errors import FecmError, FecmWarning
from fecm._typing import Floats
from fecm.authoring.case import Case, CasesError
from fecm.authoring.strike_values import set_radius, strike_of
from fecm.authoring.time_values import duration_of, with_clock
from fecm.authoring.values import apply_case
from fecm.deck.model import Deck
from fecm.deck.units import quantity, unit_names, unit_of
from fecm.exploration.places import ModalResponses, picture
from fecm.judge.limits import (
    ENERGY_BALANCE,
    INDENTATION,
    ITERATION,
    THRESHOLD,
    ModelLimit,
    TrustLevel,
)
from fecm.judge.threshold import from_threshold
from fecm.mechanics.impact_steps import kernel_law
from fecm.mechanics.impact_sweep import Swept, sweep_structure
from fecm.mechanics.kernels import Structure
from fecm.mechanics.kernels.webassembly import wasm_fields
from fecm.mechanics.projectile import WilsonStep
from fecm.mechanics.reduced_plate import motion_struct
from fecm.mechanics.rod_modes import ProjectileModes
from fecm.problem.problem import Problem
from fecm.results.result import Result
from fecm.simulation.job import run_one
from fecm.sweeps.backends import BendingModes, ImpulseResponse
from fecm.sweeps.impact_columns import Impacts, impacts_of
from fecm.sweeps.limits import PEAK_FORCE
from fecm.sweeps.outcome import About, Status
from fecm.sweeps.reduced import LIMIT, PLATE_PHASE, PROJECTILE_PHASE, by_halvings
from fecm.sweeps.task import MODES, REDUCED, Settings

# Factors on the deck's values at the ends of the sliders.
SPANS = {
    "energy": (0.05, 5.0),
    "mass": (0.25, 4.0),
    "k": (0.1, 10.0),
    "giic": (0.25, 4.0),
}
# Deflections over the thickness at which the error of a linear plate is put into words.
RATIOS = np.arange(0.3, 5.2, 0.005)
# Factors on the deck's energy at which a plate in modes is compared with full runs: its own, and
# the next ones until they agree.
COMPARED = (1.0, SPANS["energy"][1], 2.5)

# Largest difference of a peak force in natural modes, relative to the exact response.
MODAL = 0.01

Lengthened = TypeVar("Lengthened", ImpulseResponse, BendingModes)


class ExploreError(FecmError, ValueError):
    """No page can be made of a deck."""


class StepSize(NamedTuple):
    """What the kernel takes to compute impacts with a time step."""

    dt: float
    steps: int
    structures: Sequence[Structure]


class PagePlate(ABC):
    """A plate of a page: how the kernel computes its impacts, and what bounds its model."""

    sweep_model: ClassVar[str | None] = None  # of a sweep that computes the same; None of either
    model: ClassVar[str]
    options: ClassVar[str] = ""  # of a sweep that computes the same
    function: ClassVar[str]  # of the kernel
    draws: ClassVar[int]  # random impacts of a chance
    search: ClassVar[tuple[int, float]]  # velocities that a search tries first, and their span
    unjudged: ClassVar[str]
    price: ClassVar[str] = ""  # what takes long

    def __init__(self, problem: Problem, impacts: Impacts) -> None:
        self._problem, self._impacts = problem, impacts

    @abstractmethod
    def sizes(self) -> Iterator[StepSize]:
        """Yield the arguments of the function for each size of the time step, the largest first."""

    @property
    def resolved(self) -> dict[str, float] | None:
        """What the largest time step of an impact follows from; None if all have the same."""
        return None

    @staticmethod
    def fixed(problem: Problem) -> str:
        """Explain why the impact can't be moved; empty if it can."""
        return "a plate with NONL has modes for one place only: leave out `modes`"

    def places(self, modes: int) -> dict[str, Any]:
        """Return the places of the impact, and the response at each in some modes.

        Raises ExploreError if the impact can't be moved, or the modes are too few.
        """
        raise ExploreError(self.fixed(self._problem))

    @abstractmethod
    def bounds(self, own: Result | None) -> Iterator[dict[str, Any]]:
        """Yield what bounds the model; `own` is the run of the deck, if it was run.

        Raises ExploreError if the model does not hold for the deck's impact.
        """


class LinearPlate(PagePlate):
    """A linear plate, by its response to a unit force."""

    model = "Linear plate"
    function = "fecm_sweep"
    draws, search = 1000, (25, 100.0)
    unjudged = "failure of plies"

    def __init__(self, problem: Problem, impacts: Impacts) -> None:
        super().__init__(problem, impacts)
        self._backend = _long_enough(ImpulseResponse(problem), problem, impacts)

    def sizes(self) -> Iterator[StepSize]:
        """Yield the impacts with the response."""
        response = self._backend.response
        swept = _swept(self._impacts, response.dt, response.steps)
        rigid = response.mobility * response.dt**2
        structure = sweep_structure(response.response, rigid, swept)
        yield StepSize(response.dt, response.steps, [structure])

    @staticmethod
    def fixed(problem: Problem) -> str:
        """Explain why the impact can't be moved; empty if it can."""
        if problem.symmetry.lines:
            return "the deck has a part of a symmetric plate, on which the impact can't be moved"
        if problem.static is None:
            return "the plate is not held, and modes give its bending alone"
        return ""

    def places(self, modes: int) -> dict[str, Any]:
        """Return the places, whose responses are compared with the exact one at the deck's."""
        plate, exact = ModalResponses(self._problem, modes), self._backend
        own, response, modal = plate.own, exact.response, replace(exact)
        modal.response = response._replace(
            response=plate.response(own, response.dt, response.steps)
        )
        (peak,), (exact_peak,) = (
            one.outcomes(self._impacts, judged=False).columns[About.REACHED]
            for one in (modal, exact)
        )
        difference = float(peak / exact_peak - 1.0)
        if not abs(difference) <= MODAL:
            raise ExploreError(
                f"the peak force in {modes} modes differs from that of the exact response by "
                f"{difference:+.1%}, and a page allows {MODAL:.0%}: take more modes"
            )
        places = [*plate.places()]
        table = [[*place.deflection, *place.stiffness] for place in (*places, own)]
        return {
            "stiffness": encoded(plate.stiffness),
            "damping": self._problem.damping,
            "own": [own.x, own.y],
            "at": [[place.x, place.y] for place in places],
            "table": encoded(np.array(table), "<f4"),  # the last row is the deck's place
            **picture(self._problem),
            "bound": {
                "quantity": "peak by modes",
                "of": "modal",
                "most": MODAL,
                "level": TrustLevel.DOUBTFUL,
                "words": f"difference of {len(plate.stiffness)} modes from the exact response, for "
                "this impact at the deck's place; the commands have the exact response",
                "unit": "percent",
                "scale": 0.01,
            },
        }

    def bounds(self, own: Result | None) -> Iterator[dict[str, Any]]:
        """Yield the limit of the deflection, with the error of the force beyond it."""
        judge = self._problem.judge
        first = {judge.softness(ratio): round(float(ratio), 3) for ratio in RATIOS[::-1]}
        yield {
            **_bound(judge.deflection, "highest", float(judge.largest(judge.deflection))),
            "unit": "thickness",
            "scale": judge.thickness,
            "beyond": [(ratio, text) for text, ratio in reversed(first.items())],
        }


class StretchingPlate(PagePlate):
    """A plate that stretches as it bends, in some bending modes."""

    sweep_model = REDUCED
    model = f"Stretching plate in {MODES} bending modes"
    options = f"--model {REDUCED}"
    function = "fecm_reduced"
    draws, search = 200, (16, 4.0)
    unjudged = "failure of plies, slope and strain"
    price = (
        "two or three full runs of each plate check its bending modes before the page is written"
    )

    def __init__(self, problem: Problem, impacts: Impacts) -> None:
        super().__init__(problem, impacts)
        modes = BendingModes(problem, (), MODES, history=False, has_fields=False)
        self._backend = _long_enough(modes, problem, impacts)

    def sizes(self) -> Iterator[StepSize]:
        """Yield the impacts and the plate, as many times as a sweep may halve the time step."""
        plate = self._backend.plate
        most = max(by_halvings(plate, _corners(self._problem, self._impacts, "k")))
        for times in range(most + 2):  # a search goes beyond the sliders
            halved = plate.halved(times)
            swept = _swept(self._impacts, halved.dt, halved.steps)
            structures = (
                sweep_structure(np.empty(0), 0.0, swept),
                motion_struct(plate.plate, halved.dt),
            )
            yield StepSize(halved.dt, halved.steps, structures)

    @property
    def resolved(self) -> dict[str, float] | None:
        """Constants of :func:`~fecm.sweeps.reduced.largest_time_steps`."""
        plate = self._backend.plate.plate
        return {
            "platePhase": PLATE_PHASE,
            "projectilePhase": PROJECTILE_PHASE,
            "flexibility": plate.flexibility,
            "mobility": float((plate.deflection**2).sum()),
            # Infinite for a rigid mass.
            "elementTime": min(self._impacts.kinds[0].element_time, 1e300),
        }

    def bounds(self, own: Result | None) -> Iterator[dict[str, Any]]:
        """Yield the largest energy at which the peak force agrees with a full run."""
        strike = strike_of(self._problem.deck)
        unit = unit_of("force*length", unit_names(self._problem.deck))
        texts, most = [], 0.0
        for factor in COMPARED:
            difference = self._difference(factor, own if factor == 1.0 else None)
            texts.append(f"{difference:+.1%} at {quantity(factor * strike.energy, unit)}")
            if abs(difference) <= LIMIT:
                most = max(most, factor * strike.energy)
            if not most:
                raise ExploreError(
                    f"the peak force in {MODES} bending modes differs from that of a full run by "
                    f"{texts[0]}, and a page allows {LIMIT:.0%}: make the deck without NONL (fecm "
                    "new --kinematics linear); the notes of a run then say by how much the force "
                    "is off"
                )
            if most > strike.energy:
                break
        yield {
            "quantity": "energy",
            "of": "energy",
            "most": most,
            "level": TrustLevel.DOUBTFUL,
            "words": f"peak force in {MODES} bending modes, less that of full runs: "
            f"{', '.join(texts)}; a sweep with {self.options} compares each state",
            "unit": "energy",
        }

    def _difference(self, factor: float, run: Result | None) -> float:
        """Return the relative difference of the peak from a full run at a factor on the energy."""
        velocity = self._impacts.velocity * factor**0.5
        impacts = self._impacts.at_velocities(np.zeros(1, dtype=np.intp), velocity)
        outcome = self._backend.outcomes(impacts, judged=False)
        full = run or run_quietly(impacts.deck(0))
        if np.isnan(full.peak_force):
            raise ExploreError(
                "the run ends before its peak force is known, so that the modes of the plate can't "
                "be compared with it: take more steps"
            )
        return float(outcome.columns[PEAK_FORCE][0] / full.peak_force - 1.0)


# Kinds of plates by the segments that make a deck nonlinear.
KINDS: Mapping[str, type[PagePlate]] = {"": LinearPlate, "NONL": StretchingPlate}


def page_plates(
    kind: type[PagePlate], settings: Settings, cases: Sequence[Case], own: Result, modes: int
) -> Iterator[dict[str, Any]]:
    """Yield the plate of each case as a mapping for JSON; `own` is the run of the deck.

    The impact can be moved with natural modes, if there are any.
    """
    for case in cases:
        problem = with_clock(apply_case(settings.deck, case), settings.clock, case)
        (impacts, faults) = impacts_of(problem, [0], [{}])
        if impacts is None:
            raise CasesError(faults[0])
        if modes and (reason := kind.fixed(problem)):
            raise ExploreError(reason)
        plate = kind(problem, impacts)
        sizes, arrays = [*plate.sizes()], dict[str, int]()
        yield {
            "values": {name: str(value) for name, value in case.items()},
            "model": plate.model,
            "options": plate.options,
            "function": plate.function,
            "draws": plate.draws,
            "search": plate.search,
            "resolved": plate.resolved,
            "duration": sizes[0].dt * sizes[0].steps,
            "program": duration_of(problem),
            "places": plate.places(modes) if modes else None,
            "mobility": problem.judge.mobility,
            "mass": problem.judge.plate_mass,
            "thickness": problem.judge.thickness,
            "sizes": [
                {
                    "dt": size.dt,
                    "steps": size.steps,
                    "structures": [_encoded(structure, arrays) for structure in size.structures],
                }
                for size in sizes
            ],
            "arrays": [*arrays],
            "strike": _strike(problem, impacts),
            "threshold": _threshold(problem),
            "bounds": [*plate.bounds(None if case else own), *_bounds(problem)],
            "unjudged": plate.unjudged,
        }


def run_quietly(deck: Deck) -> Result:
    """Run a deck; the page says what the warnings say."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FecmWarning)
        return run_one(deck)


def _scales(impacts: Impacts) -> bool:
    """Return whether the mass of the projectile may change: a rod has its own for each length."""
    return impacts.kinds[0].scales


def _corners(problem: Problem, impacts: Impacts, *more: str) -> Impacts:
    """Return the impacts at the ends of the sliders of energy and mass, and of more names."""
    strike = strike_of(problem.deck)
    values = {"energy": strike.energy, "k": float(impacts.constants.k[0])}
    names = ["energy", *more]
    if _scales(impacts):
        values["mass"] = strike.projectile.total_mass
        names.append("mass")
    ends = [[values[name] * factor for factor in SPANS[name]] for name in names]
    cases: list[Case] = [dict(zip(names, corner, strict=True)) for corner in product(*ends)]
    corners, faults = impacts_of(problem, range(len(cases)), cases)
    if corners is None or faults:
        raise CasesError(next(iter(faults.values())))
    return corners


def _long_enough(backend: Lengthened, problem: Problem, impacts: Impacts) -> Lengthened:
    """Return the shortest run of a plate after which all impacts of the sliders are over."""
    corners, longer = _corners(problem, impacts), backend
    # A heavier projectile stays longer: the duration of the deck alone is hardly ever enough.
    for factor in backend.durations[1:] if _scales(impacts) else backend.durations:
        longer = backend.lengthened(factor)
        columns = longer.outcomes(corners, judged=False).columns
        is_over = (columns[About.STATUS] == Status.OK) & np.isfinite(columns[PEAK_FORCE])
        if is_over.all():
            break
    return longer


def _swept(impacts: Impacts, dt: float, steps: int) -> Swept:
    """Return the projectile and the law of impacts, whose values the page gives."""
    rod, none = impacts.kinds[0], np.empty((0, 0))
    step = WilsonStep(rod.stiffness(), rod.mass(), dt, rigid=rod.rigid)
    modes = ProjectileModes.of(rod.stiffness(), rod.mass(), rod.rigid)
    law = kernel_law(impacts.constants)
    return Swept(modes, step, law.kind, none, np.empty((1, steps)), none)


# Arrays of a call, which the page allocates.
OF_CALL = ("given", "force", "found")


def _encoded(structure: Structure, arrays: dict[str, int]) -> list[list[Any]]:
    """Return the fields of a structure: name, kind, offset, and value.

    The value of an array is its number in `arrays`, which has each once; None for missing arrays.
    """
    values = {name: value for name, value in structure.held.items() if name not in OF_CALL}
    return [
        [
            *field,
            arrays.setdefault(encoded(value), len(arrays))
            if isinstance(value, np.ndarray)
            else value,
        ]
        for field in wasm_fields(type(structure))
        for value in [values.get(field.name)]
    ]


def encoded(values: Floats, kind: str = "<f8") -> str:
    """Return the numbers of an array, in C order, as base64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _strike(problem: Problem, impacts: Impacts) -> dict[str, Any]:
    """Return the impact of the deck, and the k of a steel sphere of radius 1 if it is known."""
    law = kernel_law(impacts.constants)
    unit_k = None
    with suppress(CasesError):
        unit_k = set_radius(strike_of(problem.deck), 1.0).law.k
    return {
        "velocity": float(impacts.velocity[0]),
        "mass": float(impacts.mass[0]),
        "unitMass": float(impacts.mass[0] / impacts.scale[0]),
        "scales": _scales(impacts),
        "k": float(impacts.constants.k[0]),
        "q": float(np.ravel(impacts.constants.q)[0]),
        "law": law.kind.name,
        "critical": float(np.ravel(law.critical)[0]),
        "slope": float(np.ravel(law.slope)[0]),
        "unitK": unit_k,
        "factor": impacts.factor,
    }


def _threshold(problem: Problem) -> dict[str, Any] | None:
    """Return the delamination threshold of the plate; None without one."""
    threshold, card = problem.threshold, strike_of(problem.deck).delamination
    if threshold is None or card is None:
        return None
    return {
        "force": threshold.force,
        "toughness": card.toughness,
        "band": threshold.band,
        "from": from_threshold(threshold.number),
    }


def _bound(limit: ModelLimit, of: str, most: float) -> dict[str, Any]:
    """Return a limit of a quantity of the page."""
    return {
        "quantity": limit.quantity,
        "of": of,
        "most": most,
        "level": limit.level,
        "words": limit.page,
    }


def _bounds(problem: Problem) -> Iterator[dict[str, Any]]:
    """Yield the limits of all kinds of plates, in the words of their rows."""
    judge = problem.judge
    indentation = float(judge.largest(INDENTATION))
    yield _bound(INDENTATION, "deepest", indentation) | {
        "unit": "thickness",
        "scale": judge.indented,
    }
    yield _bound(THRESHOLD, "overThreshold", THRESHOLD.value)
    yield _bound(ITERATION, "unconverged", 0.0)
    yield _bound(ENERGY_BALANCE, "balance", ENERGY_BALANCE.value) | {
        "unit": "percent",
        "scale": 0.01,
    }
