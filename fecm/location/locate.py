"""Locate an impact from the strains of gages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fecm._errors import StudyError, warn
from fecm.deck.model import Deck, Gages, Nonlinear
from fecm.deck.units import unit_names
from fecm.location.fit import Fit
from fecm.location.force import judged_force
from fecm.location.location import Location
from fecm.location.observation import interpolation
from fecm.location.prepare import Options, Timing, prepared
from fecm.location.search import Found, best_fits, is_wide, narrowed
from fecm.location.table import StrainSource, StrainTable, strain_table
from fecm.location.verdict import judged
from fecm.problem.problem import Problem
from fecm.sweeps.api import problem_of


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
        Rectangle that contains the place: x0, y0, x1, y1; the plate by default.
    grid : float, optional
        Distance of the candidate places; by default that of about 126 in the region.
    basis : float, optional
        Time between the peaks of two hats of the force.  By default about 1/40 of the record in the
        search; place and force are then fitted with hats half as wide if there are strains enough,
        and with narrower ones that describe the strains significantly better.
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
    fit, region, times = prepared(problem, table, options)
    found = best_fits(fit, region, options.grid)
    wide = False
    if options.basis is None:
        fit, found = narrowed(fit, found, region, options.noise)
    else:
        wide = is_wide(fit, found.best, options.noise)
    made = _location(problem, table, options, (fit, times), found)
    return judged(made, region, wide)


def _location(
    problem: Problem,
    table: StrainTable,
    options: Options,
    fitted: tuple[Fit, Timing],
    minima: Found,
) -> Location:
    """Errors, verdict and notes of a fit."""
    (fit, times), found = fitted, minima.best
    rms = fit.deviation(found)
    noise = options.noise or rms
    if noise == 0.0:
        noise = float(np.finfo(np.float32).eps) * float(np.abs(table.strains).max())
    errors = fit.errors(found, noise)
    knots = times.origin + fit.model.knots(found.shift)
    force = judged_force(knots, found.force, errors.force, fit.model.basis)
    cards = {card.number: card for card in problem.deck.require(Gages).records}
    places = [(cards[number].x, cards[number].y) for number in table.gages.tolist()]
    samples = fit.model.strains(found.x, found.y, found.shift, found.force)
    at = interpolation((table.time - times.origin) / times.interval, times.samples)
    return Location(
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
        fitted=found.gains[:, None] * (samples @ at.T),
        shift=times.origin + found.shift,
        sd_shift=errors.shift,
        gains=found.gains,
        sd_gains=errors.gains,
        notes=(),
        accepted=True,
        deck=problem.deck,
    )
