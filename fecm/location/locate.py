"""Location of an impact from the strains of gages."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import NamedTuple

import numpy as np

from fecm._errors import FecmError, StudyError, warn
from fecm._options import documented, with_parameters_of
from fecm._table import html_summary
from fecm._typing import Floats
from fecm._watch import SILENT, StoppedError, Watch
from fecm.deck.model import Gages
from fecm.deck.units import unit_names
from fecm.judge.locations import OTHER_PLACES
from fecm.location.causes import BETTER, Cause, likely_cause
from fecm.location.fit import LocationFit, PlaceTrial, judged_force
from fecm.location.location import Location
from fecm.location.model import Sampling, interpolation, moving_plate
from fecm.location.prepare import (
    EXTRAPOLATED,
    LocationOptions,
    Timing,
    finer_strains,
    gage_rows,
    prepared,
    response_bytes,
    seconds_of_step,
    steps_between,
    timing,
)
from fecm.location.search import Region, SearchResult, best_fits, is_wide, narrowed
from fecm.location.stretching import GagedPlate, linear_problem, unconfirmed
from fecm.location.table import StrainSource, StrainTable, strain_table
from fecm.location.verdict import is_doubtful, judged
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.loading import AnyDeck, sole_problem
from fecm.problem.problem import Problem
from fecm.simulation.job import Price

CERTAIN = 2.0  # fall of the misfit above which no other cause is tried
PARTS = 4  # of a search: responses, places, force, errors
FINER_NODES = 4  # nodes of the mesh with elements half as long, over the nodes of the deck's mesh


@documented
@dataclass(eq=False, repr=False)
class LocationJob(LocationOptions):
    """Measured strains of an impact, ready for the search of its place and force.

    Deck, strains and options are checked at once. :attr:`price` says what the search takes, and
    :meth:`execute` carries it out.

    On a linear plate the strain of a gage is the sum of its responses to the force. By reciprocity,
    one run of the plate per gage gives the responses to a force anywhere. The force is a sum of
    hats and nowhere negative. Least squares give its history at every candidate place, and a
    Gauss-Newton iteration from the best candidates gives the place.

    On a plate that stretches (NONL) the iteration goes on from the place on the linear plate, with
    the strains of the reduced model of sweeps, and then with those of runs of the whole plate.

    The plate is at rest before time 0 of the table, or before its first time if that is negative.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem: plate, supports, GAGE, and PATC, the circle on which the force
        acts. Without PATC the force acts on a point. Of projectile, contact and program, only the
        time step is used.
    strains : str, Path, tuple, mapping or DataFrame
        Measured strains: a CSV file with a column time and a column per gage; times and strains
        (points, gages); or columns by name. Columns are matched by the numbers of the gages
        (``gage 1``), or taken in the order of the deck if they have none. Times are in the deck's
        unit.
    {parameters}

    Attributes
    ----------
    problem : Problem
        The problem of the deck, checked.

    Raises
    ------
    StudyError
        If the table or an option is invalid, or the deck has UNIL or too few gages.
    DeckError
        If the deck has errors.
    CasesError
        If the deck has several problems.

    Examples
    --------
    >>> job = LocationJob("panel.inp", "strains.csv", noise=4e-6)  # doctest: +SKIP
    >>> location = job.execute()  # doctest: +SKIP
    """

    deck: AnyDeck
    strains: StrainSource

    def __post_init__(self) -> None:
        self.check()
        self.problem: Problem = sole_problem(self.deck, warns=False)
        deck = self.problem.deck
        if self.problem.plate.lifts:
            raise StudyError(
                "locate needs supports that hold, and the deck has UNIL, from which the plate "
                "lifts off: locate the impact on supports that hold (fecm new --window held)"
            )
        if self.problem.plate.nonlinear and (self.shift or self.gains):
            raise StudyError(
                "shift and gains are for linear plates, and the deck has NONL: correct times and "
                "gains in the table"
            )
        self._linear = linear_problem(self.problem)
        cards = deck.last(Gages)
        numbers = [card.number for card in cards.records] if cards is not None else []
        if len(numbers) < 2:
            raise StudyError(
                f"the deck has {len(numbers)} gages (GAGE); a place needs two at least"
            )
        self._table = strain_table(self.strains, unit_names(deck), numbers)
        if self.gains and len(self._table.gages) < 3:
            raise StudyError("gains needs the strains of three gages at least")
        self._times = timing(self._table, self.basis, shift=self.shift)

    @cached_property
    def price(self) -> Price:
        """What the location takes.

        The time is estimated from some steps of the linear plate and covers its runs. The least
        squares may take as long again; a plate that stretches takes half a minute more.
        """
        gages, mesh, times = len(self._table.gages), self.problem.mesh, self._times
        plate = moving_plate(self._linear.plate)
        each = steps_between(self._linear, times.interval, critical_time_step(plate))
        # The mesh of the second run has four times as many nodes and half the step, for one force.
        steps = each * times.samples
        work = steps * (gages + 2 * FINER_NODES * self.mesh_error)
        memory = response_bytes(mesh, gages, len(mesh.coordinates), times.samples)
        sampling = Sampling(times.interval / each, each, times.samples, times.unit)
        rows = gage_rows(self._linear, self._table.gages.tolist(), plate)
        motion = PlateMotion(plate, damping=self.problem.damping)
        seconds = work * seconds_of_step(motion, rows[0], sampling)
        return Price(steps * (gages + 2 * self.mesh_error), 0, memory, seconds)

    def execute(self, watch: Watch = SILENT) -> Location:
        """Search for place and force.

        Parameters
        ----------
        watch : Watch, optional
            Gets the number of finished parts of the search, and may stop it between two parts.

        Returns
        -------
        Location
            Place, force, their errors, and measured and fitted strains.

        Raises
        ------
        LocateError
            If the gages can't tell two places apart, or no force explains the strains.
        StudyError
            If the record is far too long or too short for the waves of the plate.
        StoppedError
            If the watch stops the search.
        """
        problem, table = self.problem, self._table
        finished = count()

        def advance() -> None:
            watch.advance(next(finished), PARTS)
            if watch.stops():
                raise StoppedError("stopped; no place is known yet")

        advance()
        fit, region = prepared(self._linear, table, self, self._times)
        advance()
        minima = best_fits(fit, region, self.grid)
        searched = Searched(fit, minima.best, region)
        stretching = None
        if problem.plate.nonlinear:
            stretching = GagedPlate(problem, table.gages.tolist(), fit)
            fit, best = stretching.approached(minima.best, region, self.grid)
            minima = minima._replace(best=best)
        advance()
        wide = False
        if self.basis is None:
            fit, minima = narrowed(fit, minima, region, self.noise)
        else:
            wide = is_wide(fit, minima.best, self.noise)
        advance()
        faults = table.faults(unit_names(problem.deck).get("time", ""))
        change = cause = None
        if stretching is not None:
            fit, best, change = stretching.settled(fit, minima.best, region)
            minima = minima._replace(best=best)
            faults += unconfirmed(change, table.strains)
        location = _location(problem, table, self, (fit, self._times), minima, change)
        if stretching is None and is_doubtful(location):
            cause = _find_cause(problem, table, self, searched)
        watch.advance(PARTS, PARTS)
        location = judged(location, region, wide, cause, faults)
        if stretching is None:
            return location
        return replace(location, notes=(*location.notes, OTHER_PLACES.say()))

    def __repr__(self) -> str:
        return f"<fecm location by {len(self._table.gages)} gages of {self._table.name}>"

    def _repr_html_(self) -> str:
        """Return a table of the title and the price, for notebooks."""
        rows = (("title", self.problem.deck.title), ("price", str(self.price)))
        return html_summary(self, rows)


@with_parameters_of(LocationJob)
def locate(job: LocationJob) -> Location:
    """Locate an impact and find its force history from the strains of gages.

    :class:`LocationJob` says how, and has the errors of the parameters. The notes of the result are
    :class:`FecmWarning`.

    Parameters
    ----------
    {parameters}

    Returns
    -------
    Location
        Place, force, their errors, and measured and fitted strains.

    Raises
    ------
    LocateError
        If the gages can't tell two places apart, or no force explains the strains.

    Examples
    --------
    >>> location = fecm.locate("panel.inp", "strains.csv", noise=4e-6)  # doctest: +SKIP
    >>> location.x, location.y, location.peak_force  # doctest: +SKIP
    (112.5, 81.0, 160.5)
    """
    location = job.execute()
    warn(*location.notes)
    return location


class Searched(NamedTuple):
    """Fit and best trial of the search, before the hats are narrowed."""

    fit: LocationFit
    best: PlaceTrial
    region: Region


def _find_cause(
    problem: Problem, table: StrainTable, options: LocationOptions, searched: Searched
) -> Cause | None:
    """Return the likely cause of strains that the model does not describe."""
    fit, best, region = searched
    cause = likely_cause(fit, best, region, options.grid, table.gages.tolist())
    if options.shift or (cause is not None and cause.ratio > CERTAIN):
        return cause
    try:
        times = timing(table, options.basis, shift=True)
        late_fit, _ = prepared(problem, table, options, times)
        shifted = best_fits(late_fit, region, options.grid).best
    except FecmError:  # the record is too short for a shift
        return cause
    ratio = fit.deviation(best) / max(late_fit.deviation(shifted), np.finfo(float).tiny)
    if ratio < max(BETTER, 0.0 if cause is None else cause.ratio) or shifted.shift >= 0.0:
        return cause
    clock = unit_names(problem.deck).get("time", "")
    text = f"a force that begins {-shifted.shift:.2g} {clock}".rstrip()
    return Cause(f"{text} before the record explains", "take --shift", ratio)


def _location(
    problem: Problem,
    table: StrainTable,
    options: LocationOptions,
    fitted: tuple[LocationFit, Timing],
    minima: SearchResult,
    change: Floats | None = None,
) -> Location:
    """Return the location that a fit gives, with errors and without notes.

    `change` is the error of the strains, (gages, samples), if it is not that of the mesh.
    """
    (fit, times), best = fitted, minima.best
    rms = fit.deviation(best)
    noise = options.noise or rms
    if noise == 0.0:
        noise = float(np.finfo(np.float32).eps) * float(np.abs(table.strains).max())
    misfit = rms / noise if options.noise is not None else 1.0
    mesh_change = None
    if options.mesh_error and change is None:
        mesh_change = _find_mesh_error(problem, table, (fit, times), best)
    rows = mesh_change if change is None else fit.model.observation.of(change)
    errors = fit.errors(best, noise * max(1.0, misfit), rows)
    knots = times.origin + fit.model.knots(best.shift)
    force = judged_force(knots, best.force, errors, fit.model.basis)
    cards = {card.number: card for card in problem.deck.require(Gages).records}
    places = [(cards[number].x, cards[number].y) for number in table.gages.tolist()]
    samples = fit.model.strains(best.x, best.y, best.shift, best.force)
    interpolated = interpolation((table.time - times.origin) / times.interval, times.samples)
    return Location(
        x=best.x,
        y=best.y,
        covariance=errors.place,
        time=knots,
        force=np.where(force.determined, best.force, 0.0),
        force_sd=force.sd,
        determined=force.determined,
        determined_until=force.determined_until,
        peak_force=force.peak,
        sd_peak_force=force.peak_sd,
        peak_bias=force.peak_bias,
        time_of_peak=force.time_of_peak,
        contact_end=force.end,
        impulse=force.impulse,
        sd_impulse=force.impulse_sd,
        mesh_error=None if mesh_change is None else float(np.hypot(*errors.place_change)),
        mass=options.mass,
        candidates=minima.candidates,
        candidate_misfit=minima.misfit,
        second=minima.second,
        noise=noise,
        noise_given=options.noise is not None,
        misfit=misfit,
        gages=table.gages,
        gage_places=np.array(places),
        strain_time=table.time,
        strains=table.strains,
        fitted=best.gains[:, None] * (samples @ interpolated.T),
        shift=times.origin + best.shift,
        sd_shift=errors.shift,
        gains=best.gains,
        sd_gains=errors.gains,
        notes=(),
        accepted=True,
        deck=problem.deck,
        record=table.record,
    )


def _find_mesh_error(
    problem: Problem, table: StrainTable, fitted: tuple[LocationFit, Timing], best: PlaceTrial
) -> Floats | None:
    """Return the error of the strains due to the mesh, (gages, rows); None if it is unknown."""
    fit, times = fitted
    history = (
        np.append(0.0, fit.model.knots(0.0)),
        np.append(0.0, best.force),
    )
    place, numbers = (best.x, best.y), table.gages.tolist()
    finer = finer_strains(problem, numbers, place, history, fit.model.footprint, times)
    if finer is None:
        return None
    count = finer.shape[1]
    if best.shift:
        shifted = np.arange(float(count)) - best.shift / times.interval
        finer = finer @ interpolation(shifted, count).T
    change = finer - fit.model.strains(best.x, best.y, best.shift, best.force)
    return EXTRAPOLATED * best.gains[:, None] * fit.model.observation.of(change)
