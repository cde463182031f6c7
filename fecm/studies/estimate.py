"""Quick estimates of an impact, and the velocities at which they reach the threshold of DELA."""

from __future__ import annotations

import math
from collections.abc import Callable

from scipy.optimize import brentq

from fecm._frozen import frozen
from fecm._typing import Floats
from fecm.deck.model import Impact, Indentation
from fecm.mechanics.delamination import SMALL_MASS, effective_rigidity
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.statics import SingularStiffnessError, Tangent
from fecm.problem.build import build_projectile
from fecm.problem.problem import Problem
from fecm.studies import StudyError
from fecm.studies.quick_models import (
    LARGE,
    SMALL,
    QuickImpact,
    inelasticity,
    infinite_plate,
    static_plate,
)


@frozen
class Model:
    """One quick model of an impact."""

    name: str
    impact: QuickImpact
    threshold: float  # delamination threshold that applies to the model, force; NaN without DELA
    velocity: float  # at which the model reaches it; NaN without DELA


@frozen
class Estimate:
    """Quick estimates of an impact."""

    mass: float  # of the projectile
    mass_ratio: float  # to the plate's
    parameter: float  # Zener's lambda
    stiffness: float  # of the plate under its load, force/length; NaN for a free plate
    models: tuple[Model, ...]

    @property
    def response(self) -> str:
        """Class of the response by the mass ratio."""
        if self.mass_ratio < SMALL:
            return "wave-controlled: the infinite plate applies"
        if self.mass_ratio > LARGE:
            return "quasi-static: the static plate applies, about 10 % low"
        return "neither small nor large: run it"


def estimate(problem: Problem) -> Estimate:
    """Estimate the impact of a checked problem; without an impact, raise a StudyError."""
    contact = problem.contact
    if contact is None:
        raise StudyError("the deck has no impact: RODP in the program, with ROD and EXPE")
    deck, laminate = problem.deck, problem.laminate
    mass, velocity = build_projectile(deck).total_mass, deck.require(Impact).velocity
    k, rigidity = deck.require(Indentation).k, effective_rigidity(laminate)
    ratio = mass / (problem.plate.area() * laminate.mass)
    force = math.nan if problem.threshold is None else problem.threshold.force

    def small(v: float) -> QuickImpact:
        return infinite_plate(mass, v, k, inelasticity(mass, v, k, laminate.mass, rigidity))

    models = [_model("infinite plate", small, velocity, SMALL_MASS * force)]
    stiffness = static_stiffness(problem.moving_plate, contact)
    if math.isfinite(stiffness):

        def large(v: float) -> QuickImpact:
            return static_plate(mass, v, k, stiffness)

        models.append(_model("static plate", large, velocity, force))
    parameter = inelasticity(mass, velocity, k, laminate.mass, rigidity)
    return Estimate(mass, ratio, parameter, stiffness, tuple(models))


def _model(
    name: str, impact: Callable[[float], QuickImpact], velocity: float, threshold: float
) -> Model:
    """A model, with the velocity at which its peak reaches the threshold."""
    found = math.nan
    if math.isfinite(threshold):
        low = high = velocity
        while impact(low).peak > threshold:
            low /= 2.0
        while impact(high).peak < threshold:
            high *= 2.0
        if low == high:
            low /= 2.0
        found = float(brentq(lambda v: impact(v).peak - threshold, low, high, rtol=1e-9))
    return Model(name, impact(velocity), threshold, found)


def static_stiffness(plate: PlateModel, contact: Floats) -> float:
    """Force per displacement under the load; NaN for a plate that is not held."""
    load = contact[plate.mesh.equations > 0]
    try:
        return 1.0 / float(load @ Tangent(plate).solve(load))
    except SingularStiffnessError:
        return math.nan
