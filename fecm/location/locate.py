"""Location of an impact from the strains of gages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fecm._errors import FecmError, StudyError, warn
from fecm._typing import Floats
from fecm.deck.model import Deck, Gages, Nonlinear
from fecm.deck.units import unit_names
from fecm.location.fit import LocationFit, PlaceTrial, judged_force
from fecm.location.location import Location
from fecm.location.model import interpolation
from fecm.location.prepare import EXTRAPOLATED, LocationSettings, Timing, finer_strains, prepared
from fecm.location.search import Region, SearchResult, best_fits, is_wide, narrowed
from fecm.location.table import StrainSource, StrainTable, strain_table
from fecm.location.verdict import BETTER, Cause, is_doubtful, judged, likely_cause
from fecm.problem.problem import Problem
from fecm.sweeps.job import checked_problem

CERTAIN = 2.0  # fall of the misfit above which no other cause is tried


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
    mesh_error: bool = True,
) -> Location:
    """Locate an impact and find its force history from the strains of gages.

    The plate is linear: the strain of a gage is the sum of its responses to the force. By
    reciprocity, one run of the plate per gage gives the responses to a force anywhere. The force is
    a sum of hats and nowhere negative. Least squares give its history at every candidate place, and
    a Gauss-Newton iteration from the best candidates gives the place.

    The plate is at rest before time 0 of the table, or before its first time if that is negative.
    The notes of the result are :class:`FecmWarning`.

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
    region : sequence of float, optional
        Rectangle that contains the place: x0, y0, x1, y1; the plate by default.
    grid : float, optional
        Distance between candidate places; by default the region has about 126 of them.
    basis : float, optional
        Time between the peaks of two hats of the force; by default about 1/40 of the record in the
        search. Place and force are then fitted with hats half as wide if there are enough strains,
        and with narrower hats as long as they describe the strains significantly better.
    noise : float, optional
        Standard deviation of the errors of the strains; by default taken from the residual.
    shift : bool
        Fit the time at which the force may begin; for a record that begins after the impact.
    gains : bool
        Fit the gains of three or more gages, relative to their geometric mean.
    mass : float, optional
        Mass of the projectile, for :attr:`Location.energy_bound`.
    mesh_error : bool
        Add the error of the mesh to the standard deviations. It takes a run on a mesh of elements
        half as long, which is longer than the rest of the work.

    Returns
    -------
    Location
        Place, force, their errors, and measured and fitted strains.

    Raises
    ------
    LocateError
        If the gages can't tell two places apart, or no force explains the strains.
    StudyError
        If the table or an option is invalid, or the deck has NONL or too few gages.
    DeckError
        If the deck has errors.
    CasesError
        If the deck has several problems.

    Examples
    --------
    >>> location = fecm.locate("panel.inp", "strains.csv", noise=4e-6)  # doctest: +SKIP
    >>> location.x, location.y, location.peak_force  # doctest: +SKIP
    (112.5, 81.0, 160.5)
    """
    box = None if region is None else tuple(map(float, region))
    if box is not None and len(box) != 4:
        raise StudyError(f"region has {len(box)} numbers; it takes x0, y0, x1, y1")
    options = LocationSettings(box, grid, basis, noise, shift, gains, mass, mesh_error)
    location = located(checked_problem(deck), strains, options)
    for text in location.notes:
        warn(text)
    return location


def located(problem: Problem, strains: StrainSource, options: LocationSettings) -> Location:
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
    fit, region, times = prepared(problem, table, options)
    minima = best_fits(fit, region, options.grid)
    searched = Searched(fit, minima.best, region)
    wide = False
    if options.basis is None:
        fit, minima = narrowed(fit, minima, region, options.noise)
    else:
        wide = is_wide(fit, minima.best, options.noise)
    location = _location(problem, table, options, (fit, times), minima)
    cause = _find_cause(problem, table, options, searched) if is_doubtful(location) else None
    return judged(location, region, wide, cause)


class Searched(NamedTuple):
    """Fit and best trial of the search, before the hats are narrowed."""

    fit: LocationFit
    best: PlaceTrial
    region: Region


def _find_cause(
    problem: Problem, table: StrainTable, options: LocationSettings, searched: Searched
) -> Cause | None:
    """Return the likely cause of strains that the model does not describe."""
    fit, best, region = searched
    cause = likely_cause(fit, best, region, options.grid, table.gages.tolist())
    if options.shift or (cause is not None and cause.ratio > CERTAIN):
        return cause
    try:
        late_fit, *_ = prepared(problem, table, options._replace(shift=True))
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
    options: LocationSettings,
    fitted: tuple[LocationFit, Timing],
    minima: SearchResult,
) -> Location:
    """Return the location that a fit gives, with errors and without notes."""
    (fit, times), best = fitted, minima.best
    rms = fit.deviation(best)
    noise = options.noise or rms
    if noise == 0.0:
        noise = float(np.finfo(np.float32).eps) * float(np.abs(table.strains).max())
    misfit = rms / noise if options.noise is not None else 1.0
    mesh_change = (
        _find_mesh_error(problem, table, (fit, times), best) if options.mesh_error else None
    )
    errors = fit.errors(best, noise * max(1.0, misfit), mesh_change)
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
