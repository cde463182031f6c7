"""Studies: random values, refinement, identification, location."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from scipy.special import beta, betaincinv

import fecm.verification.decks as decks
from fecm import examples
from fecm._errors import FecmWarning
from fecm.deck.model import Gages, Ply
from fecm.deck.units import units_of
from fecm.identification.identify import identify
from fecm.location.locate import locate
from fecm.location.model import Sampling, moving_plate, responses, rows_of
from fecm.location.table import strain_table
from fecm.mechanics.contact_law import hertz_coefficient
from fecm.mechanics.half_space import (
    effective_stiffness,
    indentation_modulus,
    ply_stiffness,
)
from fecm.mechanics.interpolation import NDOF, W
from fecm.mechanics.plate_motion import AppliedForce, PlateMotion
from fecm.mechanics.points import gages, patch_weights
from fecm.problem.loading import sole_problem
from fecm.sweeps.convergence import convergence
from fecm.sweeps.distributions import ValueDistribution
from fecm.sweeps.random import Design, matrix
from fecm.sweeps.statistics import indices, statistics, wilson
from fecm.verification.case import Value, case


@case
def _random_values() -> Sequence[Value]:
    """Compute the indices of Ishigami's function, statistics, and Wilson's interval.

    The statistics describe a lognormal value. The interval is for 3 hits in 40 draws.
    """
    law, samples = ValueDistribution("uniform", (-np.pi, np.pi)), 1024
    design = Design(dict.fromkeys("xyz", law), samples, 0, "sobol", sensitivity=True)
    x, y, z = matrix(design).T
    values = np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)
    estimates = indices(values.reshape(1, 5, samples), 0)
    drawn = statistics(
        matrix(Design({"k": ValueDistribution("lognormal", (115.0, 0.08))}, samples))[:, 0]
    )
    low, high = wilson(np.array(3), np.array(40))
    return [
        *estimates.first[0],
        *estimates.total[0],
        float(drawn.mean),
        float(drawn.standard_deviation),
        drawn.quantiles[3],
        float(low),
        float(high),
    ]


@case
def _refinement() -> Sequence[Value]:
    factors = np.array([1, 2, 4])
    cases, summary = {"refine": factors}, {"peak_force": 1.0 + 3.0 * factors**-1.7}
    study = convergence(cases, summary, nodes=9)["peak_force"]
    return [study.order, study.limit]


@case
def _identification() -> Sequence[Value]:
    """Fit k and the velocity to the force of Hertz's impact on a fixed target.

    The fit starts at other values.
    """
    k, mass, velocity = 1.0e6, 2.0e-4, 100.0
    deepest = (5.0 * mass * velocity**2 / (4.0 * k)) ** 0.4
    # t = a/v times the integral of dx/sqrt(1 - x^2.5), an incomplete beta function of x^2.5.
    half = 0.4 * beta(0.4, 0.5) * deepest / velocity
    time = np.linspace(0.0, 2.0 * half, 101)
    share = betaincinv(0.4, 0.5, 1.0 - np.abs(time / half - 1.0))
    deck = decks.fixed_target(mass, 110.0, decks.elastic(0.9e6), 2e-7, 900)
    with warnings.catch_warnings(action="ignore", category=FecmWarning):
        fit = identify(deck, time, k * deepest**1.5 * share**0.6, ["k", "velocity"])
    return [fit.values["k"], fit.values["velocity"]]


@case
def _contact_coefficient() -> Sequence[Value]:
    ply = Ply(1.0, 0.28, 181e9, 10.3e9, 7.17e9, 7.17e9, 3.68e9)
    angles = (0.0, 45.0, -45.0, 90.0)
    modulus = indentation_modulus(effective_stiffness(ply, angles, [1.0] * 4, 0.4))
    unit_modulus = indentation_modulus(ply_stiffness(decks.isotropic(1.0, 0.3, 1.0), 0.3))
    return [unit_modulus, modulus, hertz_coefficient(0.008, 207e9, 0.3, modulus)]


STRUCK = (112.5, 81.0)  # impact point (mm)
POINTS = 150  # times of the strains: 0.3 ms


@case
def _location() -> Sequence[Value]:
    panel = decks.panel_with_gages(30, 20)
    numbers = [gage.number for gage in panel.require(Gages).records]
    table = strain_table(examples.path("panel-strains.csv"), units_of("mm-N-s"), numbers)
    strains = table.time[:POINTS], table.strains[:, :POINTS].T
    near = (90.0, 60.0, 140.0, 100.0)
    with warnings.catch_warnings(action="ignore", category=FecmWarning):
        location = locate(panel, strains, region=near, grid=25.0, basis=2e-5)
    return [location.x, location.y, location.peak_force]


@case
def _reciprocity() -> Sequence[Value]:
    problem = sole_problem(decks.panel_with_gages(9, 6), warns=False)
    mesh = problem.mesh
    sensors = gages(mesh, problem.deck.require(Gages).records)
    weights = patch_weights(mesh, "DISC", 4.0, *STRUCK)
    motion = PlateMotion(moving_plate(problem.plate))
    sampling = Sampling(dt=4e-7, every=5, count=60, width=3)

    nodes = np.arange(len(weights))
    computed = responses(motion, rows_of(sensors, len(nodes)), nodes, sampling, dtype=np.float64)
    by_gages = np.einsum("n,gns->sg", weights, computed)

    shares = np.zeros((len(weights), NDOF))
    shares[:, W] = weights
    load, state = motion.load(shares), motion.start()
    hat = sampling.hat().tolist()
    direct = np.zeros_like(by_gages)
    for step in range((sampling.count - 1) * sampling.every):
        applied = AppliedForce(load, hat[step]) if step < len(hat) else None
        motion.advance(state, sampling.dt, 0.0, applied)
        sample, rest = divmod(step + 1, sampling.every)
        if not rest:
            dofs = motion.field(state, 0.0).ravel()[sensors.dof_indices]
            direct[sample] = sensors.strains((sensors.weights * dofs).sum(axis=1))
    return [(by_gages - direct) / np.abs(direct).max()]
