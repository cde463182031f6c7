"""Estimates before a run: waves that the mesh resolves, and the impact on the static plate.

The static plate assumes that plate and indentation store the kinetic energy of the projectile. It
neglects waves: a light projectile bends the plate less.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Bools, Indices
from fecm.deck import model
from fecm.deck.model import Impact
from fecm.judge.exposure_bands import LoadMesh
from fecm.judge.limits import ELEMENTS_PER_WAVE
from fecm.mechanics.interpolation import W
from fecm.mechanics.laminate import effective_rigidity
from fecm.mechanics.mesh import longest_sides
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.quick_models import (
    StaticCurve,
    contact_time_on_curve,
    static_curve,
    static_peak,
    static_plate,
)
from fecm.mechanics.solutions import (
    ConvergenceError,
    SingularStiffnessError,
    WindowCompliances,
    pull_of_supports,
    static_response,
    window_compliances,
)
from fecm.mechanics.supports import one_sided
from fecm.mechanics.symmetry import with_codes
from fecm.problem.contact_estimates import wave_impedance
from fecm.problem.parts import build_projectile
from fecm.problem.problem import Problem
from fecm.problem.supports import default_stiffness

MOST_ERROR = 0.5  # largest mesh error of the peak that is estimated
NINE_NODES = 9
CORNERS = 4  # of an element of nine nodes, its first ones
SAME_PLACE = 0.01  # distance from a corner over the side up to which a load is at the corner
RIGID = 100.0  # times the default stiffness of UNIL: within 1e-5 of restraints that hold w
FULL = 3  # shear order at which 9-node elements have no zero-energy modes


class Resolution(NamedTuple):
    """Resolution of an impact by the mesh."""

    # Duration of a Hertz contact on a rigid target, 2.94 (5 m v^2/4 k)^(2/5)/v: S. P.
    # Timoshenko and J. N. Goodier, Theory of Elasticity, on the impact of spheres.
    contact: float
    wave: float  # length of the bending wave of that half period, 2 pi (D/(m (pi/contact)^2))^(1/4)
    side: float  # longest side of the elements at the impact node, length
    # Estimated mesh error of the peak force, relative to it; None for elements without
    # mid-side nodes.
    error: float | None

    @property
    def elements(self) -> float:
        """Elements per bending wave."""
        return self.wave / self.side


def resolution(problem: Problem) -> Resolution | None:
    """Compare the elements at the impact node with the bending waves of the impact.

    Returns None without an approach, or where a number overflows.
    """
    deck, mesh = problem.deck, problem.mesh
    impact, law = deck.require(model.Impact), deck.require(model.Indentation)
    if impact.velocity <= 0.0:
        return None
    laminate, mass = problem.laminate, build_projectile(deck).total_mass
    v = np.float64(impact.velocity)  # a division by zero is then infinite, not an error
    rigidity = float(min(laminate.D[0, 0], laminate.D[1, 1]))
    with np.errstate(all="ignore"):
        contact = 2.94 * (5.0 * mass * v**2 / (4.0 * law.k)) ** 0.4 / v
        wave = 2.0 * np.pi * (rigidity / (laminate.mass * (np.pi / contact) ** 2)) ** 0.25
    touching = (mesh.elements == impact.node).any(axis=1)
    side = float(longest_sides(mesh.elements[touching], mesh.coordinates).max())
    if not np.isfinite(wave):
        return None
    quadratic = bool((mesh.elements[touching, 4:8] > 0).all()) and mesh.elements.shape[1] <= 9
    shear = deck.require(model.Material).integration.shear
    # Fitted to point forces and shear strains by quadrature.
    fitted = quadratic and problem.patch is None and not problem.plate.rules.assumes_shear
    error = estimated_mesh_error(wave / side, side / laminate.thickness, shear) if fitted else None
    return Resolution(float(contact), float(wave), side, error)


def load_mesh(problem: Problem, elements: Indices) -> LoadMesh:
    """Describe the elements on the circle around the load, which decide the error of exposures.

    Parameters
    ----------
    problem : Problem
        Problem with a load.
    elements : ndarray of int
        Rows of the elements on the circle.
    """
    mesh, laminate, place = problem.mesh, problem.laminate, problem.load_place
    nodes = mesh.elements[elements]
    corners = mesh.coordinates[nodes[:, :CORNERS] - 1]
    apart = np.linalg.norm(corners - np.array(place), axis=-1).min(initial=math.inf)
    coarseness = problem.coarseness(elements)
    lengths = [problem.span.length]
    if problem.has_impact and (waves := resolution(problem)) is not None:
        lengths.append(waves.wave / 2.0)
    curvature = float(np.abs(problem.plate.curvature).max())
    if curvature:
        lengths.append(math.sqrt(laminate.thickness / curvature))
    rigidities = laminate.D[0, 0], laminate.D[1, 1]
    return LoadMesh(
        coarseness=coarseness,
        at_corner=bool(apart <= SAME_PLACE * coarseness * problem.reach_of_load),
        nine_nodes=nodes.shape[1] == NINE_NODES and bool((nodes > 0).all()),
        bending_reach=min(lengths) / problem.reach_of_load,
        anisotropy=float((max(rigidities) / min(rigidities)) ** 0.25),
    )


def estimated_mesh_error(elements: float, slenderness: float, shear: int) -> float:
    """Estimate the relative mesh error of the peak force, within a factor of about two.

    The formula was fitted to the peaks of 14 meshes of 8- or 9-node elements with L2 = 3, and
    compared with 18 meshes with L2 = 2, each against a mesh of 15 to 30 elements per wave: AS/3501
    plates of 100 x 100 x 1, 2 and 4 mm, and the report's plate.

    `elements` is the number of elements per bending wave of the contact's duration. `slenderness`
    is the side of an element over the thickness (under L2 = 3 a slender element locks). `shear` is
    the order L2.
    """
    if shear < FULL:
        return 0.045 * ELEMENTS_PER_WAVE.value / elements
    return (0.031 + 0.0011 * slenderness**2) * (ELEMENTS_PER_WAVE.value / elements) ** 2


def format_mesh_error(error: float) -> str:
    """Format an estimated mesh error of the peak force."""
    if error > MOST_ERROR:
        return f"mesh error of the peak above {MOST_ERROR:.0%}"
    return f"mesh error of the peak about {error:.1%}"


# Share of the static deflection at the peak force from which on the supports carry the force.
NEARLY_STATIC = 0.5
MOST_SOLVED = 1000  # elements up to which checks and notes take static solutions
# First step of a static curve: a fraction of the linear plate's deflection, and of the thickness.
CURVE_STEPS = 20
LONGEST_STEP = 0.25
POINTS_BETWEEN = 101  # of two points of the curve, to find its largest force
NO_CURVE = "there is no nonlinear static plate"
# Simulated time over half a period of the projectile on the plate's static stiffness.  Least
# simulated time over the contact with plate and indentation in series: the contact with a vibrating
# plate ends up to 2 % later.
HALF_PERIODS = 1.25
CONTACT_TIMES = 1.1


class NoCurveError(FecmError, ValueError):
    """A nonlinear plate has no static curve."""


def static_deflection(problem: Problem) -> float:
    """Estimate the largest deflection of the linear plate under the impact, length.

    It is the smaller of the deflections of the static plate and of an infinite plate. An infinite
    plate moves by I/(8 sqrt(m D*)) under an impulse I, here at most twice the momentum of the
    projectile. It is NaN for a plate that its supports do not hold.

    Parameters
    ----------
    problem : Problem
        Problem of an impact without errors.
    """
    mass, velocity = problem.projectile_mass, _velocity(problem)
    stiffness = whole_stiffness(problem)
    if not (math.isfinite(stiffness) and velocity > 0.0):
        return math.nan
    wave = 2.0 * mass * velocity / wave_impedance(problem.laminate)
    try:
        peak = static_peak(mass, velocity, problem.contact_coefficient, stiffness)
    except OverflowError:  # the checks doubt such a k
        return math.nan
    return min(wave, peak / stiffness)


def nonlinear_curve(problem: Problem, energy: float, force: float) -> StaticCurve:
    """Return the static curve of a nonlinear plate up to an energy and a force.

    A force of NaN sets no limit. Energy, force and curve are those of the whole plate.

    Raises NoCurveError if the plate has no such curve.
    """
    contact = problem.contact
    assert contact is not None  # the program has impact steps
    if problem.mesh.forces.any():
        raise NoCurveError(f"{NO_CURVE}: the deck has FORC")
    stiffness, factor = whole_stiffness(problem), problem.symmetry.factor
    if math.isnan(stiffness):
        raise NoCurveError(f"{NO_CURVE}: the plate is free")
    linear = max(math.sqrt(2.0 * energy / stiffness), np.nan_to_num(force) / stiffness)
    step = min(linear / CURVE_STEPS, LONGEST_STEP * problem.laminate.thickness)

    def enough(_: float, reached: float, work: float) -> bool:
        return factor * work >= energy and not factor * reached < force

    try:
        curve = static_curve(problem.moving_plate, contact, step, enough)
    except (SingularStiffnessError, ConvergenceError) as error:
        raise NoCurveError(f"{NO_CURVE}: {error}") from None
    if (falls := (np.diff(curve.force) < 0.0) | (curve.stiffness[1:] < 0.0)).any():
        first = int(falls.argmax())
        start, end = curve.deflection[first : first + 2]
        between = np.linspace(start, end, POINTS_BETWEEN)
        limit = factor * float(curve.at(between)[0].max())
        raise NoCurveError(f"{NO_CURVE}: the panel snaps through at the force {limit:.4g}")
    if factor == 1:
        return curve
    return curve._replace(
        force=factor * curve.force, stiffness=factor * curve.stiffness, work=factor * curve.work
    )


def whole_stiffness(problem: Problem) -> float:
    """Return the static stiffness of the whole plate under its load; NaN for a free plate."""
    response = problem.static
    return math.nan if response is None else problem.symmetry.factor / response.compliance


def pull_of_edges(problem: Problem, force: float, deflection: float) -> float:
    """Return the share of a static load with which the knife edges pull; 0 if they do not.

    A light projectile is gone before its wave reaches the supports, so that the share is 0 unless
    the deflection at the peak force is near the static one.

    Parameters
    ----------
    problem : Problem
        Problem of an impact.
    force, deflection : float
        Contact force and deflection under the load at the peak force, of the part of a deck.
    """
    contact = problem.contact
    if contact is None or not force > 0.0 or problem.deck.control.numel > MOST_SOLVED:
        return 0.0
    if not problem.knife_edges.any() or (response := problem.static) is None:
        return 0.0
    if not deflection > NEARLY_STATIC * force * response.compliance:
        return 0.0
    forces = pull_of_supports(problem.moving_plate, response, contact)
    return float(forces[problem.knife_edges].sum())


def pushing_compliance(problem: Problem) -> float:
    """Return the static compliance of a plate whose knife edges only push, for the part of a deck.

    The edges have the default stiffness of UNIL. The compliance is NaN if the plate tips off them.
    """
    contact, edges = problem.contact, problem.knife_edges
    assert contact is not None  # the program has impact steps
    try:
        return static_response(_on_pushing_edges(problem, edges), contact).compliance
    except (SingularStiffnessError, ConvergenceError):
        return math.nan


def compliances_on_window(problem: Problem, tips: Indices) -> WindowCompliances | None:
    """Return the static compliances of a plate on the window of a fixture, for the part of a deck.

    The deck has its supports: held, or pushing with clamps or without. `tips` are the nodes, from
    0, of the tips of clamps. Without a load, and where the plate tips off the window, there are
    none.
    """
    contact, edges = problem.contact, problem.knife_edges.copy()
    assert contact is not None  # the program has impact steps
    supports = problem.plate.supports
    if supports is not None:
        edges[supports.node[supports.is_one_sided]] = True
    at_tips = np.zeros_like(edges)
    at_tips[tips] = True
    try:
        plate = _on_pushing_edges(problem, edges, at_tips, RIGID)
        return window_compliances(plate, contact, tips)
    except (SingularStiffnessError, ConvergenceError):
        return None


def _on_pushing_edges(
    problem: Problem, edges: Bools, released: Bools | None = None, factor: float = 1.0
) -> PlateModel:
    """Return the moving plate with one-sided supports at the nodes `edges`, (numnp,).

    They have the default stiffness of UNIL times a factor, and take the place of what holds w
    there, and at the nodes `released`.
    """
    plate, contact = problem.moving_plate, problem.contact
    assert contact is not None
    freed = edges if released is None else edges | released
    codes = plate.mesh.codes.copy()
    codes[freed, W] = 0
    springs = plate.supports
    if springs is not None:
        springs = springs.select(~(freed[springs.node] & (springs.dof == W)))
    free = replace(with_codes(plate, codes), supports=springs)
    (nodes,) = np.nonzero(edges)
    stiffness = factor * default_stiffness(free, problem.safe_time_step)[nodes]
    side = np.full(len(nodes), np.sign(contact[:, W].sum()))
    supports = one_sided(nodes, side, stiffness, np.zeros(len(nodes)))
    if springs is not None:
        supports = supports.joined(springs)
    return replace(free, supports=supports)


def contact_duration(problem: Problem) -> float:
    """Return a simulated time that is longer than the contact with the static plate.

    A nonlinear plate has its static curve if there is one, and is taken as linear otherwise. A
    plate that nothing holds bends under its own inertia, here as softly as a beam of its longer
    side under half a sine: half a period of that bending, with the reduced mass.
    """
    mass, velocity, k = problem.projectile_mass, _velocity(problem), problem.contact_coefficient
    if problem.plate.nonlinear and velocity > 0.0:
        with suppress(NoCurveError, OverflowError):
            curve = nonlinear_curve(problem, 0.5 * mass * velocity**2, math.nan)
            bare = contact_time_on_curve(mass, velocity, math.inf, curve)
            whole = contact_time_on_curve(mass, velocity, k, curve)
            return _rounded(max(HALF_PERIODS * bare, CONTACT_TIMES * whole))
    stiffness = whole_stiffness(problem)
    if math.isnan(stiffness):
        side = float(np.ptp(problem.mesh.coordinates[:, :2], axis=0).max())
        bending = effective_rigidity(problem.laminate) * math.pi**4 / (4.0 * side**2)
        plate = problem.plate_mass
        return _rounded(math.pi * math.sqrt(mass * plate / (mass + plate) / bending))
    duration = HALF_PERIODS * math.pi * math.sqrt(mass / stiffness)
    if velocity > 0.0:
        with suppress(OverflowError):  # the checks doubt such a k
            duration = max(
                duration, CONTACT_TIMES * static_plate(mass, velocity, k, stiffness).duration
            )
    return _rounded(duration)


def _velocity(problem: Problem) -> float:
    return problem.deck.require(Impact).velocity


def _rounded(duration: float) -> float:
    return float(f"{duration:.2g}")
