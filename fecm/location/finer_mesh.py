"""Strains on a mesh of elements half as long, which show the error of the deck's mesh."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fecm._errors import FecmError
from fecm._typing import Floats
from fecm.deck import model
from fecm.location.model import Footprint
from fecm.location.prepare import Timing
from fecm.location.responses import W, moving_plate
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.points import gages
from fecm.mechanics.time_step import critical_time_step, taken_time_step
from fecm.problem.generate import generate
from fecm.problem.parts import build_plate
from fecm.problem.problem import Problem
from fecm.problem.refine import refined
from fecm.sweeps.responses import plate_response

# Error of the deck's mesh over the difference of both meshes: errors fall with the square of the
# elements' side.
EXTRAPOLATED = 4.0 / 3.0


def finer_strains(
    problem: Problem,
    numbers: list[int],
    place: tuple[float, float],
    history: tuple[Floats, Floats],
    footprint: Footprint,
    times: Timing,
) -> Floats | None:
    """Samples of the strains of gages on a mesh of elements half as long, (gages, samples).

    The force acts at a place on the area of a footprint on the deck's mesh; its history is times
    from 0 on, and the forces then.  Returns None if an element can't be bisected, or the finer
    plate can't be run.
    """
    try:
        deck = refined(problem.deck, problem.mesh)
        mesh = generate(deck)
        plate = moving_plate(build_plate(deck, mesh))
        held = np.asarray(mesh.codes[:, W] != 0)
        weights = replace(footprint, mesh=mesh, held=held).weights(*place)
        longest = taken_time_step(critical_time_step(plate))
    except FecmError:
        return None
    every = math.ceil(times.interval / longest * (1.0 - 1e-9))
    dt, count = times.interval / every, (times.samples - 1) * every
    cards = {record.number: record for record in deck.require(model.Gages).records}
    read = gages(mesh, [cards[number] for number in numbers], curvature=plate.curvature)
    motion = PlateMotion(plate, damping=problem.damping)
    load = np.zeros((len(mesh.coordinates), 5))
    load[:, W] = weights
    sums = motion.dof_sums(read.dof_indices, read.weights)
    _, impulse = plate_response(motion, motion.load(load), dt, count, sums)
    force = np.interp(dt * np.arange(count), *history, right=0.0)
    size = 2 * count
    spectrum = np.fft.rfft(impulse, size) * np.fft.rfft(force, size)
    strains = np.fft.irfft(spectrum, size)[:, :count]
    return np.hstack([np.zeros((len(numbers), 1)), strains[:, every - 1 :: every]])
