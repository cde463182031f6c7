"""Locate an impact from the strains of gages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fecm._errors import StudyError, warn
from fecm._memory import require
from fecm.deck import model
from fecm.deck.macros import flat
from fecm.deck.model import Deck, Gages, Nonlinear
from fecm.deck.units import unit_names
from fecm.location.errors import LocateError
from fecm.location.fit import Fit
from fecm.location.force import judged_force
from fecm.location.location import Location
from fecm.location.mirrors import shared_symmetry
from fecm.location.model import Footprint, StrainModel
from fecm.location.observation import interpolation, observe
from fecm.location.responses import ROWS, Sampling, W, moving_plate, responses, rows_of
from fecm.location.search import BEFORE, Found, Region, best_fits
from fecm.location.table import StrainSource, StrainTable, strain_table
from fecm.location.verdict import doubts
from fecm.mechanics.interpolation import NDOF
from fecm.mechanics.mesh import longest_sides
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.points import RADIUS_PER_THICKNESS, gages
from fecm.mechanics.time_step import critical_time_step, taken_time_step
from fecm.problem.problem import Problem
from fecm.sweeps.api import problem_of

HATS = 40  # of the force, by default
MOST_HATS = 400
SAMPLES = 10  # fewest between the peaks of two hats
UNIFORM = 1e-3  # deviation of times from equal intervals, over these, that is rounding
LATE = 0.5  # largest first time over the length of the record


class Options(NamedTuple):
    """Options of a location; see :func:`locate`."""

    region: tuple[float, float, float, float] | None = None
    grid: float | None = None
    basis: float | None = None
    noise: float | None = None
    shift: bool = False
    gains: bool = False
    mass: float | None = None

    def check(self) -> None:
        """Refuse values that make no sense, by a StudyError."""
        for name in ("grid", "basis", "noise", "mass"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise StudyError(f"{name} is {value:g}; it must be positive")


def locate(
    deck: str | Path | Deck,
    strains: Any,
    *,
    region: Sequence[float] | None = None,
    grid: float | None = None,
    basis: float | None = None,
    noise: float | None = None,
    shift: bool = False,
    gains: bool = False,
    mass: float | None = None,
) -> Location:
    """Locate an impact, and find its force history, from the strains of gages.

    The plate is linear: the strain of a gage is the sum of its responses to the force.  One run of
    the plate a gage gives these for a force anywhere (reciprocity).  The force is a sum of hats and
    nowhere negative; its history follows from least squares at every candidate place, and the place
    from a Gauss-Newton iteration that starts at the best ones.  The plate is at rest before time 0
    of the table, or its first time if that is negative.  The notes of the result are
    :class:`FecmWarning`.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem: plate, supports, GAGE, and PATC, the circle on which the force
        acts; without it the force acts on a point.  What it says of projectile, contact and
        program is not used, except the time step.
    strains : str, Path, tuple, mapping or DataFrame
        Measured strains: a CSV file with the columns time and those of gages, which are matched by
        their numbers (``gage 1``) or else taken in the order of the deck; times and strains
        (points, gages); or columns by name.  Times are in the deck's unit.
    region : sequence of float, optional
        x0, y0, x1, y1 of the rectangle that contains the place; the plate by default.
    grid : float, optional
        Distance of the candidate places; by default that of about 126 in the region.
    basis : float, optional
        Time between the peaks of two hats of the force; 1/40 of the record by default.
    noise : float, optional
        Standard deviation of the strains' errors; by default that of the residual.
    shift : bool
        Fit the time at which the force may begin, for a record that begins after the impact.
    gains : bool
        Fit the gains of three gages or more, over their geometric mean.
    mass : float, optional
        Mass of the projectile, for :attr:`Location.energy_bound`.

    Returns
    -------
    Location
        Place, force, their errors, and the strains that were fitted.

    Raises
    ------
    LocateError
        If the gages can't tell two places apart, or no force explains the strains.
    StudyError
        If the table or an option is invalid, or the deck has NONL, or too few gages.
    DeckError
        If the deck has errors.
    CasesError
        If the deck has several problems.

    Examples
    --------
    >>> found = fecm.locate("panel.inp", "strains.csv", noise=4e-6)  # doctest: +SKIP
    >>> found.x, found.y, found.peak_force  # doctest: +SKIP
    (112.5, 81.0, 160.5)
    """
    box = None if region is None else tuple(map(float, region))
    if box is not None and len(box) != 4:
        raise StudyError(f"region has {len(box)} numbers; it takes x0, y0, x1, y1")
    options = Options(box, grid, basis, noise, shift, gains, mass)
    found = located(problem_of(deck), strains, options)
    for text in found.notes:
        warn(text)
    return found


def located(problem: Problem, strains: StrainSource, options: Options) -> Location:
    """Locate an impact on the plate of a checked deck; see :func:`locate`."""
    options.check()
    deck = problem.deck
    if deck.has(Nonlinear):
        raise StudyError(
            "locate needs a linear plate, and the deck has NONL; take an impact that leaves the "
            "deflection below a quarter of the plate's thickness, without NONL"
        )
    cards = deck.last(Gages)
    numbers = [card.number for card in cards.records] if cards is not None else []
    if len(numbers) < 2:
        raise StudyError(f"the deck has {len(numbers)} gages (GAGE); a place needs two at least")
    table = strain_table(strains, unit_names(deck), numbers)
    if options.gains and len(table.gages) < 3:
        raise StudyError("gains needs the strains of three gages at least")
    fit, region = _prepared(problem, table, options)
    found = best_fits(fit, region, options.grid)
    return _location(problem, table, options, (fit, region), found)


# What is fitted -----------------------------------------------------------------------------------


class Timing(NamedTuple):
    """Times of a fit."""

    origin: float  # time of the table from which on the force may act
    basis: float  # between two hats
    interval: float  # between two samples
    width: int  # samples between two hats
    samples: int
    hats: int


def timing(table: StrainTable, options: Options) -> Timing:
    """Samples and hats for a table; StudyError if it is too coarse for them."""
    name, time = table.name, table.time
    origin = min(0.0, float(time[0]))
    record = float(time[-1]) - origin
    if time[0] > LATE * record:
        raise StudyError(
            f"{name} begins at time {time[0]:g} and ends at {time[-1]:g}: the plate is at rest "
            "before time 0; subtract the time from which on the force may act"
        )
    steps = np.diff(time)
    each = float(np.median(steps))
    basis = options.basis or max(record / HATS, 2.0 * each)
    if basis < each:
        raise StudyError(
            f"{name} has a point every {each:.3g}, too few for a force every {basis:.3g}; take a "
            "larger basis"
        )
    spacing = (float(time[-1]) - float(time[0])) / (len(time) - 1)
    equal = time[0] + spacing * np.arange(len(time))
    if np.abs(time - equal).max() > UNIFORM * spacing:
        interval = basis / SAMPLES
    elif spacing * SAMPLES <= basis * (1.0 + UNIFORM):
        interval = spacing * math.floor(basis * (1.0 + UNIFORM) / (spacing * SAMPLES))
    else:
        interval = spacing / math.ceil(spacing * SAMPLES / basis)
    width = round(basis / interval)
    longest = record * (1.0 + BEFORE * options.shift)
    hats = math.ceil(longest / (width * interval) - UNIFORM)
    if hats > MOST_HATS or 2 * (hats + 2) > table.strains.size:
        raise StudyError(
            f"{name}: a force of {hats} values does not follow from {table.strains.size} strains; "
            "take a larger basis"
        )
    count = math.ceil(longest / interval - UNIFORM) + 3
    return Timing(origin, width * interval, interval, width, count, hats)


def _prepared(problem: Problem, table: StrainTable, options: Options) -> tuple[Fit, Region]:
    """The model of the strains, and the region in which the place is sought."""
    own = timing(table, options)
    footprint = _footprint(problem)
    region = Region.of(problem.mesh, footprint.radius, options.region)
    shared = _shared(problem.deck, tuple(table.gages.tolist()), own[2:5], region)
    seen = observe(table.time - own.origin, table.strains, own.interval, own.samples)
    strain_model = StrainModel(footprint, seen, *shared, own.width, own.hats)
    side = float(np.median(longest_sides(problem.mesh.elements, problem.mesh.coordinates)))
    return Fit(strain_model, side, options.shift, options.gains), region


def _footprint(problem: Problem) -> Footprint:
    """The circle of the deck's patch, or a point."""
    mesh = problem.mesh
    held = np.asarray(mesh.codes[:, W] != 0)
    card = problem.deck.last(model.Patch)
    if card is None:
        return Footprint(mesh, "", 0.0, held)
    radius = card.radius or RADIUS_PER_THICKNESS[card.shape] * problem.laminate.thickness
    return Footprint(mesh, card.shape, radius, held)


@lru_cache(maxsize=1)
def _shared(
    deck: Deck, numbers: tuple[int, ...], samples: tuple[float, int, int], region: Region
) -> tuple[Any, Any]:
    """Nodes of a region and the responses of gages there, which another table may need too."""
    interval, width, count = samples
    problem = problem_of(deck)
    mesh, plate = problem.mesh, moving_plate(problem.plate)
    every = {card.number: card for card in deck.require(Gages).records}
    read = gages(mesh, [every[number] for number in numbers])
    rows = rows_of(read, len(mesh.coordinates))
    if (symmetry := shared_symmetry(plate, rows)) is not None:
        low, high = mesh.coordinates.min(axis=0), mesh.coordinates.max(axis=0)
        one = region.low + 0.25 * (region.high - region.low)
        other = 0.5 * (low + high) + (one - 0.5 * (low + high)) * symmetry.flip
        named = ", ".join(map(str, numbers))
        raise LocateError(
            f"mirror places can't be told apart: a {symmetry.name} maps plate, supports, laminate "
            f"and the readings of all gages ({named}) onto themselves, so that an impact at "
            f"({one[0]:.4g}, {one[1]:.4g}) and one at ({other[0]:.4g}, {other[1]:.4g}) give the "
            "same strains; add a gage off its axis"
        )
    asked = [macro.value for macro in flat(problem.program) if macro.word == "DT"]
    most = next(filter(None, asked), 0.0) or taken_time_step(critical_time_step(plate))
    steps = math.ceil(interval / most * (1.0 - 1e-9))
    sampling = Sampling(interval / steps, steps, count, width)
    nodes = region.nodes(mesh)
    stored = 4 * len(numbers) * len(nodes) * count
    fields = 2 * 8 * NDOF * ROWS * len(mesh.coordinates)
    require(stored + fields, f"the responses of {len(numbers)} gages at {len(nodes)} nodes")
    motion = PlateMotion(plate, damping=problem.damping)
    return nodes, responses(motion, rows, nodes, sampling)


# What was found -----------------------------------------------------------------------------------


def _location(
    problem: Problem,
    table: StrainTable,
    options: Options,
    fitted: tuple[Fit, Region],
    minima: Found,
) -> Location:
    """Errors, verdict and notes of a fit."""
    (fit, region), found = fitted, minima.best
    points = table.strains.size
    rms = math.sqrt(found.square / max(1, points - fit.parameters(found)))
    noise = options.noise or rms
    if noise == 0.0:
        noise = float(np.finfo(np.float32).eps) * float(np.abs(table.strains).max())
    errors = fit.errors(found, noise)
    own = timing(table, options)
    knots = own.origin + fit.model.knots(found.shift)
    force = judged_force(knots, found.force, errors.force, own.basis)
    cards = {card.number: card for card in problem.deck.require(Gages).records}
    places = [(cards[number].x, cards[number].y) for number in table.gages.tolist()]
    samples = fit.model.strains(found.x, found.y, found.shift, found.force)
    fitted_strains = (
        samples @ interpolation((table.time - own.origin) / own.interval, own.samples).T
    )
    made = Location(
        x=found.x,
        y=found.y,
        covariance=errors.place,
        time=knots,
        force=np.where(force.determined, found.force, 0.0),
        force_sd=errors.force,
        determined=force.determined,
        determined_until=force.determined_until,
        peak_force=force.peak,
        time_of_peak=force.time_of_peak,
        contact_end=force.end,
        impulse=force.impulse,
        mass=options.mass,
        candidates=minima.candidates,
        candidate_misfit=minima.misfit,
        second=minima.second,
        noise=noise,
        noise_given=options.noise is not None,
        misfit=rms / noise if options.noise is not None else 1.0,
        gages=table.gages,
        gage_places=np.array(places),
        strain_time=table.time,
        strains=table.strains,
        fitted=found.gains[:, None] * fitted_strains,
        shift=own.origin + found.shift,
        sd_shift=errors.shift,
        gains=found.gains,
        sd_gains=errors.gains,
        notes=(),
        accepted=True,
        deck=problem.deck,
    )
    return doubts(made, region)
