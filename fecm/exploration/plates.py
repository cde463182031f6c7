"""What a page needs of a plate and its impacts: the response to a unit force, scales and limits.

All values are in the deck's units; forces, masses and k are those of the deck's part of a symmetric
plate, thresholds those of the whole plate.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.authoring.case import Case, CasesError
from fecm.authoring.strike_values import set_radius, strike_of
from fecm.authoring.time_values import with_clock
from fecm.authoring.values import apply_case
from fecm.judge.limits import INDENTATION, THRESHOLD
from fecm.judge.threshold import from_threshold
from fecm.mechanics.impact_steps import kernel_law
from fecm.mechanics.impact_sweep import Swept, sweep_structure
from fecm.mechanics.projectile import WilsonStep
from fecm.mechanics.rod_modes import ProjectileModes
from fecm.problem.problem import Problem
from fecm.sweeps.backends import ImpulseResponse, PlateResponse
from fecm.sweeps.impact_columns import Impacts, impacts_of
from fecm.sweeps.limits import PEAK_FORCE
from fecm.sweeps.outcome import About, Status
from fecm.sweeps.task import Settings

# Factors on the deck's values at the ends of the sliders.
SPANS = {
    "energy": (0.05, 5.0),
    "mass": (0.25, 4.0),
    "k": (0.1, 10.0),
    "giic": (0.25, 4.0),
}
# Deflections over the thickness at which the error of a linear plate is put into words.
RATIOS = np.concatenate([np.arange(0.3, 1.0, 0.05), np.arange(1.0, 5.2, 0.25)])


def page_plates(settings: Settings, cases: Sequence[Case]) -> Iterator[dict[str, Any]]:
    """Yield the plate of each case as a mapping for JSON."""
    for case in cases:
        problem = with_clock(apply_case(settings.deck, case), settings.clock, case)
        (impacts, faults) = impacts_of(problem, [0], [{}])
        if impacts is None:
            raise CasesError(faults[0])
        yield {
            "values": {name: str(value) for name, value in case.items()},
            "program": problem.work.steps,
            **_response(_long_enough(problem, impacts), impacts),
            **_strike(problem, impacts),
            **_judged(problem),
        }


def _long_enough(problem: Problem, impacts: Impacts) -> PlateResponse:
    """Return the shortest response of a plate after which all impacts of the sliders are over."""
    backend = ImpulseResponse(problem)
    ends = SPANS["energy"], SPANS["mass"] if _scales(impacts) else (1.0,)
    energies, masses = np.array(list(product(*ends))).T
    rows = np.zeros(len(masses), dtype=np.intp)
    velocities = impacts.velocity[rows] * np.sqrt(energies / masses)
    corners = replace(
        impacts.at_velocities(rows, velocities),
        mass=impacts.mass[rows] * masses,
        scale=impacts.scale[rows] * masses,
    )
    # A heavier projectile stays longer: the duration of the deck alone is hardly ever enough.
    longer = backend
    for factor in backend.durations[1:] if _scales(impacts) else backend.durations:
        longer = backend.lengthened(factor)
        columns = longer.outcomes(corners, judged=False).columns
        is_over = (columns[About.STATUS] == Status.OK) & np.isfinite(columns[PEAK_FORCE])
        if is_over.all():
            break
    return longer.response


def _scales(impacts: Impacts) -> bool:
    """Return whether the mass of the projectile may change: a rod has its own for each length."""
    return impacts.kinds[0].scales


def _response(plate: PlateResponse, impacts: Impacts) -> dict[str, Any]:
    """Return what the kernel takes; arrays are base64 of doubles."""
    rod, none = impacts.kinds[0], np.empty((0, 0))
    step = WilsonStep(rod.stiffness(), rod.mass(), plate.dt, rigid=rod.rigid)
    modes = ProjectileModes.of(rod.stiffness(), rod.mass(), rod.rigid)
    law = kernel_law(impacts.constants)
    taken = sweep_structure(
        plate.response,
        plate.mobility * plate.dt**2,
        Swept(modes, step, law.kind, none, np.empty((1, plate.steps)), none),
    ).held
    kept = {name: value for name, value in taken.items() if name not in ("given", "force", "found")}
    return {
        "structure": {
            name: encoded(value) if isinstance(value, np.ndarray) else value
            for name, value in kept.items()
        },
        "nodeMass": plate.node_mass,
        "mobility": plate.mobility,
    }


def encoded(values: Floats) -> str:
    """Return the doubles of an array, in C order, as base64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode("ascii")


def _strike(problem: Problem, impacts: Impacts) -> dict[str, Any]:
    """Return the impact of the deck, and the k of a steel sphere of radius 1 if it is known."""
    law = kernel_law(impacts.constants)
    unit_k = None
    with suppress(CasesError):
        unit_k = set_radius(strike_of(problem.deck), 1.0).law.k
    return {
        "strike": {
            "velocity": float(impacts.velocity[0]),
            "mass": float(impacts.mass[0]),
            "unitMass": float(impacts.mass[0] / impacts.scale[0]),
            "scales": _scales(impacts),
            "k": float(impacts.constants.k[0]),
            "q": float(np.ravel(impacts.constants.q)[0]),
            "critical": float(np.ravel(law.critical)[0]),
            "slope": float(np.ravel(law.slope)[0]),
            "unitK": unit_k,
            "factor": impacts.factor,
        }
    }


def _judged(problem: Problem) -> dict[str, Any]:
    """Return scales and limits of the plate, in the words of their rows."""
    judge, threshold = problem.judge, problem.threshold
    bounds = {"deflection": judge.deflection, "indentation": INDENTATION}
    delaminates: Mapping[str, Any] | None = None
    if threshold is not None:
        card = strike_of(problem.deck).delamination
        assert card is not None  # the deck has a threshold
        delaminates = {
            "force": threshold.force,
            "toughness": card.toughness,
            "band": threshold.band,
            "from": from_threshold(threshold.number),
        }
    return {
        "thickness": judge.thickness,
        "indented": judge.indented,
        "mass": judge.plate_mass,
        "limits": {
            name: {
                "quantity": limit.quantity,
                "most": judge.largest(limit),
                "level": limit.level,
                "words": limit.page,
            }
            for name, limit in bounds.items()
        },
        "crossed": THRESHOLD.value,
        "softness": [(round(float(ratio), 2), judge.softness(ratio)) for ratio in RATIOS],
        "threshold": delaminates,
    }
