"""Preparation of a location: model of the strains, symmetry of the gages, finer mesh."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._errors import FecmError, StudyError
from fecm._machine import require_memory
from fecm._measured_tables import UNITS, plain_unit
from fecm._options import option
from fecm._typing import Floats, Indices
from fecm.deck import model
from fecm.deck.macros import flat
from fecm.deck.model import Deck, Gages
from fecm.deck.units import unit_names
from fecm.location.fit import LocationFit
from fecm.location.location import LocateError
from fecm.location.model import (
    ROWS,
    Footprint,
    Sampling,
    StrainModel,
    deflections,
    moving_plate,
    observe,
    responses,
    rows_of,
)
from fecm.location.search import BEFORE, Region
from fecm.location.table import StrainTable
from fecm.mechanics.interpolation import NDOF, W
from fecm.mechanics.mesh import MeshArrays, longest_sides
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.points import RADIUS_PER_THICKNESS, gages
from fecm.mechanics.symmetry import images
from fecm.mechanics.time_step import critical_time_step, taken_time_step
from fecm.problem.generate import generate
from fecm.problem.loading import sole_problem
from fecm.problem.parts import build_plate
from fecm.problem.problem import Problem
from fecm.problem.refine import refined_deck
from fecm.problem.symmetry import symmetry_lines
from fecm.simulation.run import ENOUGH
from fecm.sweeps.responses import plate_response

SAME = 1e-9  # relative difference that is rounding, of stiffnesses and rows


class Symmetry(NamedTuple):
    """Symmetry of a plate."""

    name: str  # in messages
    flip: tuple[float, float]  # factors of x and y from the centre

    @property
    def is_mirror(self) -> bool:
        """Whether the symmetry reverses angles; the half turn does not."""
        return self.flip[0] != self.flip[1]

    @property
    def signs(self) -> Floats:
        """Signs of u, v, w, theta_x, theta_y of the image, (5,)."""
        x, y = self.flip
        return np.array([x, y, 1.0, x, y])


SYMMETRIES = (
    Symmetry("mirror across the middle of x", (-1.0, 1.0)),
    Symmetry("mirror across the middle of y", (1.0, -1.0)),
    Symmetry("half turn about the centre", (-1.0, -1.0)),
)


def shared_symmetry(plate: PlateModel, rows: Floats) -> Symmetry | None:
    """Return a symmetry of plate, supports and laminates that keeps every gage's reading.

    `rows` are the strains of the gages per displacement, (gages, nodes, 5). Returns None if there
    is no such symmetry.
    """
    for symmetry in SYMMETRIES:
        nodes = images(plate.mesh.coordinates, symmetry.flip)
        if nodes is None or not _is_symmetric(plate, symmetry, nodes):
            continue
        images_of_rows = symmetry.signs * rows[:, nodes]
        if np.abs(images_of_rows - rows).max() <= SAME * np.abs(rows).max():
            return symmetry
    return None


def _is_symmetric(plate: PlateModel, symmetry: Symmetry, nodes: Indices) -> bool:
    """Return whether a symmetry of the nodes also maps elements, supports and laminates."""
    mesh = plate.mesh
    if ((mesh.codes != 0) != (mesh.codes[nodes] != 0)).any():
        return False
    if symmetry.is_mirror and not _is_mirror_symmetric(plate):
        return False
    numbers = np.zeros(len(mesh.elements), int)
    if plate.laminate_numbers is not None:
        numbers = plate.laminate_numbers
    return np.array_equal(
        _sorted_elements(mesh, numbers, None), _sorted_elements(mesh, numbers, nodes)
    )


def _sorted_elements(mesh: MeshArrays, numbers: Indices, nodes: Indices | None) -> Floats:
    """Return a sorted table of the elements, or of their images: nodes and laminate of each."""
    elements = mesh.elements.astype(np.intp)
    if nodes is not None:
        elements = np.where(elements > 0, nodes[elements - 1] + 1, 0)
    table = np.column_stack([np.sort(elements, axis=1), numbers])
    return np.asarray(table[np.lexsort(table.T[::-1])])


def _is_mirror_symmetric(plate: PlateModel) -> bool:
    """Return whether laminates, preload and curvature stay the same if angles are reversed."""
    for laminate in plate.laminates:
        for matrix in (laminate.A, laminate.B, laminate.D):
            scale = SAME * np.abs(laminate.A if matrix is laminate.B else matrix).max()
            if matrix is laminate.B:
                scale *= laminate.thickness
            if np.abs(matrix[:2, 2]).max() > scale:
                return False
        if abs(laminate.shear[0, 1]) > SAME * np.abs(laminate.shear).max():
            return False
    return plate.preload[2] == 0.0 and plate.curvature[2] == 0.0


FEWEST_STEPS, MOST_STEPS = 10.0, 1e5  # critical time steps in a record
MOST_PERIODS = 50.0  # fundamental periods in a record
LIKELY = math.log(30.0)  # logarithm of a likely record over the fundamental period, at most
HATS = 40  # hats of the force in the search, by default
MOST_HATS = 400
SAMPLES = 8  # fewest samples between the peaks of two hats
UNIFORM = 1e-3  # relative deviation from equal intervals that is rounding
LATE = 0.5  # largest first time over the length of the record
# Width of the hats over the width of the responses' hats, in the search and with a given basis.
SEARCHED, GIVEN = 4, 2


@dataclass(kw_only=True, eq=False, repr=False)
class LocationOptions:
    """Options of a location."""

    region: Sequence[float] | None = option(
        None,
        "Rectangle that contains the place; the plate by default.",
        python="x0, y0, x1, y1.",
        group="Search",
        metavar="X0,Y0,X1,Y1",
    )
    grid: float | None = option(
        None,
        "Distance of the places that are tried first; by default the region has about 126 of them.",
        group="Search",
        metavar="LENGTH",
    )
    basis: float | None = option(
        None,
        "Time between two values of the force; by default 1/40 of the record in the search, then a "
        "half or a quarter of it.",
        python="The force is linear between them.",
        group="Search",
        metavar="TIME",
    )
    noise: float | None = option(
        None,
        "Standard deviation of the errors of the strains; by default from the residual.",
        group="Search",
        metavar="STRAIN",
    )
    shift: bool = option(
        False,
        "Fit the time at which the force may begin: the record begins after the impact.",
        group="Search",
    )
    gains: bool = option(
        False,
        "Fit the gains of three or more gages over their geometric mean.",
        group="Search",
    )
    mass: float | None = option(
        None, "Mass of the projectile, for a bound of its energy.", group="Search", metavar="MASS"
    )
    mesh_error: bool = option(
        True,
        "Add the error of the mesh to the standard deviations, by a run of elements half as long; "
        "it takes longer than all the rest.",
        group="Search",
        flag="--mesh-error/--no-mesh-error",
    )

    def check(self) -> None:
        """Raise StudyError if an option is not positive, or the region has not four numbers."""
        for name in ("grid", "basis", "noise", "mass"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise StudyError(f"{name} is {value:g}; it must be positive")
        if self.region is not None and len(self.region) != 4:
            raise StudyError(f"region has {len(self.region)} numbers; it takes x0, y0, x1, y1")


class Timing(NamedTuple):
    """Times of a fit, in samples except for the origin and the interval."""

    origin: float  # time in the table from which on the force may act
    interval: float  # between two samples
    unit: int  # width of the hat of the responses
    width: int  # of the hats of the force
    length: int  # of the record
    samples: int
    shift: bool  # whether the time at which the force may begin is fitted


def timing(table: StrainTable, basis: float | None, *, shift: bool) -> Timing:
    """Return the samples and hats for a table; see :class:`LocationOptions`.

    Raises StudyError if the table is too coarse or starts too late.
    """
    name, time = table.name, table.time
    origin = min(0.0, float(time[0]))
    record = float(time[-1]) - origin
    if time[0] > LATE * record:
        raise StudyError(
            f"{name} begins at time {time[0]:g} and ends at {time[-1]:g}: the plate is at rest "
            "before time 0; subtract the time from which on the force may act"
        )
    spacing = float(np.median(np.diff(time)))
    width = basis or max(record / HATS, 2.0 * spacing)
    if width < spacing:
        raise StudyError(
            f"{name} has a point every {spacing:.3g}, too few for a value of the force every "
            f"{width:.3g}; take a larger basis"
        )
    parts = GIVEN if basis else SEARCHED
    interval = _interval(time, width)
    unit = max(1, math.floor(width / interval / parts + 0.5 + UNIFORM))
    if basis and abs(parts * unit * interval - basis) > UNIFORM * basis:
        # Hats of the width that was asked for, or of the next number of samples.
        interval, unit = interval / 2.0, round(basis / interval)
    length = math.ceil(record * (1.0 + BEFORE * shift) / interval - UNIFORM)
    hats = math.ceil(length / (parts * unit))
    if hats > MOST_HATS or 2 * (hats + 2) > table.strains.size:
        raise StudyError(
            f"{name}: a force of {hats} values does not follow from {table.strains.size} strains; "
            "take a larger basis"
        )
    return Timing(origin, interval, unit, parts * unit, length, length + 3, shift)


def _interval(time: Floats, basis: float) -> float:
    """Return the time between two samples, which include equally spaced times if possible."""
    spacing = (float(time[-1]) - float(time[0])) / (len(time) - 1)
    equal = time[0] + spacing * np.arange(len(time))
    if np.abs(time - equal).max() > UNIFORM * spacing:
        return basis / SAMPLES
    if spacing * SAMPLES <= basis * (1.0 + UNIFORM):
        return spacing * math.floor(basis * (1.0 + UNIFORM) / (spacing * SAMPLES))
    return spacing / math.ceil(spacing * SAMPLES / basis)


def prepared(
    problem: Problem, table: StrainTable, options: LocationOptions, times: Timing
) -> tuple[LocationFit, Region]:
    """Return the fit of the strains, and the region of the search."""
    footprint = _footprint(problem)
    region = Region.of(problem.mesh, footprint.radius, options.region)
    samples = times.interval, times.unit, times.samples
    nodes, strains = _responses_in_region(
        problem.deck, tuple(table.gages.tolist()), samples, region
    )
    observation = observe(table.time - times.origin, table.strains, times.interval, times.samples)
    model = StrainModel(
        footprint, observation, nodes, strains, times.unit, times.width, times.length
    )
    side = float(np.median(longest_sides(problem.mesh.elements, problem.mesh.coordinates)))
    return LocationFit(model, side, times.shift, options.gains), region


def _footprint(problem: Problem) -> Footprint:
    """Return the circle of the deck's patch, or a point."""
    mesh = problem.mesh
    held = np.asarray(mesh.codes[:, W] != 0)
    card = problem.deck.last(model.Patch)
    if card is None:
        return Footprint(mesh, "", 0.0, held)
    radius = card.radius or RADIUS_PER_THICKNESS[card.shape] * problem.laminate.thickness
    return Footprint(mesh, card.shape, radius, held)


@lru_cache(maxsize=1)
def _responses_in_region(
    deck: Deck, numbers: tuple[int, ...], samples: tuple[float, int, int], region: Region
) -> tuple[Indices, NDArray[np.floating]]:
    """Return the nodes of a region and the gages' responses there, cached for other tables."""
    interval, unit, count = samples
    problem = sole_problem(deck, warns=False)
    if lines := " and ".join(map(str, symmetry_lines(deck, problem.mesh))):
        raise StudyError(
            f"locate needs the whole plate, and the deck has the line of symmetry {lines}: it "
            "mirrors every force"
        )
    mesh, plate = problem.mesh, moving_plate(problem.plate)
    rows = gage_rows(problem, numbers, plate)
    _check_symmetry(plate, rows, numbers, region)
    critical = critical_time_step(plate)
    _check_length_of_record(problem, interval * count, critical)
    steps = steps_between(problem, interval, critical)
    sampling = Sampling(interval / steps, steps, count, unit)
    nodes = region.nodes(mesh)
    needed = response_bytes(mesh, len(numbers), len(nodes), count)
    require_memory(needed, f"the responses of {len(numbers)} gages at {len(nodes)} nodes")
    motion = PlateMotion(plate, damping=problem.damping)
    return nodes, responses(motion, rows, nodes, sampling)


def steps_between(problem: Problem, interval: float, critical: float) -> int:
    """Return the number of steps between two samples.

    The step is the DT of the deck if it is stable, otherwise 0.9 of the critical time step.
    """
    steps_of_deck = [macro.value for macro in flat(problem.program) if macro.word == "DT"]
    stable = [dt for dt in steps_of_deck if 0.0 < dt < critical]
    longest = stable[0] if stable else taken_time_step(critical)
    return math.ceil(interval / longest * (1.0 - 1e-9))


def seconds_of_step(motion: PlateMotion, row: Floats, sampling: Sampling) -> float:
    """Return the seconds of a step on this machine, from the response of a gage after its hat."""
    begin, steps = time.perf_counter(), 0
    for number, fields in enumerate(deflections(motion, row, sampling)):
        if number == 2 * sampling.width:  # the steps under a force take longer
            begin, steps = time.perf_counter(), 0
        steps += len(fields) * sampling.every
        if number > 2 * sampling.width and time.perf_counter() - begin > ENOUGH:
            break
    return (time.perf_counter() - begin) / steps


def gage_rows(problem: Problem, numbers: Sequence[int], plate: PlateModel) -> Floats:
    """Return the strain of every gage per displacement of every dof, (gages, nodes, 5)."""
    cards = {card.number: card for card in problem.deck.require(Gages).records}
    read = gages(problem.mesh, [cards[number] for number in numbers], curvature=plate.curvature)
    return rows_of(read, len(problem.mesh.coordinates))


def response_bytes(mesh: MeshArrays, gages: int, nodes: int, samples: int) -> int:
    """Return the memory of the responses of gages at nodes, and of the fields that are stepped."""
    return 4 * gages * nodes * samples + 2 * 8 * NDOF * ROWS * len(mesh.coordinates)


def _check_length_of_record(problem: Problem, record: float, critical: float) -> None:
    """Raise StudyError if the record is far too long or too short for the waves of the plate."""
    steps, period = record / critical, _period(problem)
    if FEWEST_STEPS <= steps <= MOST_STEPS and record <= MOST_PERIODS * period:
        return
    units = unit_names(problem.deck)
    clock, sizes = plain_unit(units.get("time", "")), UNITS["time"]
    duration = f"{record:.3g} {clock}".rstrip()
    expected = f"{period:.2g} {clock}".rstrip()
    times = record / period
    text = (
        f"the record lasts {duration}, {times:.2g} times the fundamental period of the plate "
        f"(about {expected})"
    )
    other_units = [u for u in ("s", "ms", "us") if clock in sizes and sizes[u] != sizes[clock]]
    likely = [(abs(math.log(times * sizes[u] / sizes[clock])), u) for u in other_units]
    scales = [1e-3, 1e-6, 1e3, 1e6] if clock not in sizes else []
    factors = [(abs(math.log(times * scale)), f"{scale:g}") for scale in scales]
    if likely and min(likely)[0] < LIKELY:
        unit = min(likely)[1]
        hint = f"the times seem to be in {unit}: name the unit in the header, as in `time ({unit})`"
    elif factors and min(factors)[0] < LIKELY:
        hint = f"the times seem to be in another unit than the deck's: times {min(factors)[1]}?"
    elif steps < FEWEST_STEPS:
        hint = "no wave reaches a gage in it: check the unit of time"
    else:
        hint = "no wave needs it: cut the record, or check the unit of time"
    raise StudyError(f"{text}; {hint}")


def _period(problem: Problem) -> float:
    """Return the fundamental period of a simply supported plate with the sides of the mesh.

    It is Navier's formula for an orthotropic plate without shear deformation.
    """
    places = problem.mesh.coordinates[problem.mesh.used]
    a, b = np.ptp(places, axis=0).tolist()
    laminate = problem.laminate
    d = laminate.D
    stiffness = d[0, 0] / a**4 + 2.0 * (d[0, 1] + 2.0 * d[2, 2]) / (a * b) ** 2 + d[1, 1] / b**4
    return float(2.0 / math.pi * math.sqrt(laminate.mass / stiffness))


def _check_symmetry(
    plate: PlateModel, rows: Floats, numbers: tuple[int, ...], region: Region
) -> None:
    """Raise LocateError if the gages can't distinguish a place from its image."""
    if (symmetry := shared_symmetry(plate, rows)) is None:
        return
    low, high = plate.mesh.coordinates.min(axis=0), plate.mesh.coordinates.max(axis=0)
    middle = 0.5 * (low + high)
    place = region.low + 0.25 * region.size
    image = middle + (place - middle) * symmetry.flip
    gage_numbers = ", ".join(map(str, numbers))
    raise LocateError(
        f"mirror places can't be told apart: a {symmetry.name} maps plate, supports, laminate and "
        f"the readings of all gages ({gage_numbers}) onto themselves, so that an impact at "
        f"({place[0]:.4g}, {place[1]:.4g}) and one at ({image[0]:.4g}, {image[1]:.4g}) give the "
        "same strains; add a gage off its axis"
    )


# Error of the deck's mesh over the difference of the two meshes. The error falls with the square of
# the element side.
EXTRAPOLATED = 4.0 / 3.0


def finer_strains(
    problem: Problem,
    numbers: list[int],
    place: tuple[float, float],
    history: tuple[Floats, Floats],
    footprint: Footprint,
    times: Timing,
) -> Floats | None:
    """Return the strains on a mesh of elements half as long, (gages, samples).

    The force acts at a place, on the area of the footprint. `history` has times from 0 on, and the
    forces at these times. Returns None if an element can't be bisected or the finer plate can't be
    run.
    """
    try:
        deck = refined_deck(problem.deck, problem.mesh)
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
