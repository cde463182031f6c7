"""The location of an impact from strain gages, and the reciprocity that it rests on."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from fecm import examples
from fecm._errors import FecmWarning
from fecm.deck.model import Gages
from fecm.deck.unit_systems import units_of
from fecm.location.locate import locate
from fecm.location.responses import Sampling, W, moving_plate, responses, rows_of
from fecm.location.table import strain_table
from fecm.mechanics.interpolation import NDOF
from fecm.mechanics.plate_motion import AppliedForce, PlateMotion
from fecm.mechanics.points import gages, patch_weights
from fecm.sweeps.api import problem_of
from fecm.verification import decks
from fecm.verification.case import Value, case

STRUCK = (112.5, 81.0)  # place of the impact (mm)
POINTS = 150  # of the strains: 0.3 ms


@case
def _location() -> Sequence[Value]:
    panel = decks.panel_with_gages(30, 20)
    numbers = [gage.number for gage in panel.require(Gages).records]
    table = strain_table(examples.path("panel-strains.csv"), units_of("mm-N-s"), numbers)
    strains = table.time[:POINTS], table.strains[:, :POINTS].T
    near = (90.0, 60.0, 140.0, 100.0)
    with warnings.catch_warnings(action="ignore", category=FecmWarning):
        found = locate(panel, strains, region=near, grid=25.0, basis=2e-5)
    return [found.x, found.y, found.peak_force]


@case
def _reciprocity() -> Sequence[Value]:
    problem = problem_of(decks.panel_with_gages(9, 6))
    mesh = problem.mesh
    read = gages(mesh, problem.deck.require(Gages).records)
    weights = patch_weights(mesh, "DISC", 4.0, *STRUCK)
    motion = PlateMotion(moving_plate(problem.plate))
    sampling = Sampling(dt=4e-7, every=5, count=60, width=3)

    every = np.arange(len(weights))
    found = responses(motion, rows_of(read, len(every)), every, sampling, dtype=np.float64)
    by_gages = np.einsum("n,gns->sg", weights, found)

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
            dofs = motion.field(state, 0.0).ravel()[read.dof_indices]
            direct[sample] = read.strains((read.weights * dofs).sum(axis=1))
    return [(by_gages - direct) / np.abs(direct).max()]
