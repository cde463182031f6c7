"""Fit of parameters of an impact to a measured force history."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fecm._errors import StudyError, warn
from fecm._options import described_by, documented, option
from fecm._table import html_summary
from fecm._typing import Floats
from fecm._watch import SILENT, StoppedError, Watch
from fecm.authoring.strike_values import lacks_value
from fecm.deck.model import Deck, Impact, Indentation, Projectile
from fecm.deck.units import unit_names
from fecm.identification.alignment import IdentifyError, check_measured, lags
from fecm.identification.confirmation import Confirmed, confirmed
from fecm.identification.fitting import (
    DELAY,
    FIRST_EVALUATIONS,
    LOST,
    MOST_EVALUATIONS,
    OF_RECORD,
    OFFSET,
    POINTS,
    FittedPoints,
    ForceModel,
    Scaling,
    covariance,
    during_run,
    fit_parameters,
    fitted,
    parameter_bounds,
    rounded,
    share_lost,
)
from fecm.identification.misfit import (
    has_few_sign_runs,
    has_shape,
    neighbour_correlation,
    plate_errors,
    proposal,
    sign_runs,
    undescribed,
)
from fecm.identification.plates import plate_of_fit
from fecm.identification.result import CARDS, Identification
from fecm.judge.end import PEAK_NOT_REACHED
from fecm.judge.fits import (
    AT_BOUND,
    CORRELATED,
    DOUBTFUL_RUN,
    FAILED_RUN,
    FEW_RUNS,
    LEFT_OUT,
    NOT_CONVERGED,
    SHAPED,
    UNDESCRIBED,
)
from fecm.judge.validity import DOUBTS, OTHER, reasons_of
from fecm.mechanics.contact_law import Law
from fecm.mechanics.own_law import law_name, own_law
from fecm.problem.loading import AnyDeck, sole_problem
from fecm.problem.memory import needed_bytes
from fecm.problem.parts import build_projectile
from fecm.problem.problem import Problem
from fecm.results.comparison import Measurement, Source, measurement_of
from fecm.simulation.job import Price
from fecm.studies.rod_test.filters import FILTERS, Filter, filter_of
from fecm.sweeps.outcome import Outcome
from fecm.sweeps.plan import check_law

FREE = (*CARDS, *OF_RECORD)
USUAL_EVALUATIONS = 30  # of a fit, each with one force more than there are parameters
UNIT_OFFSET = 0.01  # unit of the offset, over the peak of the deck's run


@documented
@dataclass(eq=False, repr=False)
class IdentificationJob:
    """Measured force of an impact, ready for the fit of parameters.

    Deck, measurement and options are checked at once. :attr:`price` says what the fit takes, and
    :meth:`execute` carries it out.

    The fit is by least squares with equal weights, and starts at the values of the deck. The delay
    starts at several lags in turn. Standard errors hold for independent errors of the measured
    points, with the variance of the residual. Errors of the model come in addition;
    :attr:`Identification.plate_errors` has two of them.

    The first fit of a plate that stretches (NONL) takes the forces of the reduced model of sweeps.
    A full run at the fitted values then gives the force, and the model its derivatives, until the
    values settle. The last full run confirms them (:attr:`Identification.full_run`), and full runs
    beside it give the derivatives for the errors.

    Parameters
    ----------
    deck : str, Path or Deck
        Deck with a single problem.
    measured : str, Path or pair of array_like (points,)
        Measured contact force: a CSV file, or increasing times and forces in the deck's units.
        Forces are positive in compression. At time 0 the projectile touches the plate, as in the
        deck.
    free : str or sequence of str
        Parameters to fit. Parameters of the impact are ``"velocity"``, ``"energy"``, ``"k"``,
        ``"alpha_p"``, ``"s_p"``, ``"q"``, ``"mass"``, ``"rod_length"``, ``"rod_modulus"`` and
        ``"rod_density"``. Parameters of the record are ``"delay"``, the measured time at which the
        projectile touches the plate, and ``"offset"``, the measured force without contact.
    {parameters}
    columns, units : sequence of str
        Names of the file's columns of time and force, and their units, where the file does not say
        them.

    Attributes
    ----------
    problem : Problem
        The problem of the deck, checked.
    measurement : Measurement
        The measured force in the deck's units.

    Raises
    ------
    StudyError
        If the measurement is invalid or in other units; or if a name or the filter is unknown.
    DeckError
        If the deck has errors.
    CasesError
        If the deck has several problems, or `law` replaces a constant that is to be fitted.
    LawError
        If `law` is not a contact law.
    ExtensionError
        If no installed package has an entry point of the name `law`.

    Examples
    --------
    >>> job = IdentificationJob("impact-patch.inp", "measured-force.csv", "k")  # doctest: +SKIP
    >>> fit = job.execute()  # doctest: +SKIP
    """

    deck: AnyDeck
    measured: Source
    free: str | Sequence[str]
    filter: str | Filter | None = option(
        None,
        f"Filter of the measurement, also applied to the computed force: {FILTERS}",
        group="Fit",
        metavar="FILTER",
    )
    law: Law | str | None = option(
        None,
        "Contact law instead of EXPE: the name that an installed package gives it (entry points of "
        "the group fecm.laws).",
        python="Or an object with the methods of Law.  The constants of EXPE can't be fitted then.",
        group="Fit",
        metavar="NAME",
    )
    columns: Sequence[str] = ()
    units: Sequence[str] = ()

    def __post_init__(self) -> None:
        self.problem: Problem = sole_problem(self.deck, warns=False)
        self.measurement: Measurement = measurement_of(
            self.measured, unit_names(self.problem.deck), self.columns, self.units
        )
        self._free = (self.free,) if isinstance(self.free, str) else tuple(self.free)
        if not self._free or not {*self._free} <= {*FREE} or len({*self._free}) < len(self._free):
            names = ", ".join(map(str, self._free)) or "none"
            raise StudyError(f"can't fit {names}; fit different ones of {', '.join(FREE)}")
        self._filter = filter_of(self.filter) if isinstance(self.filter, str) else self.filter
        self._law = own_law(self.law)
        if self._law is not None:
            check_law(self._law, self._free)

    @cached_property
    def price(self) -> Price:
        """What the fit takes.

        The time covers the plate's response, a usual number of forces, and the full runs of a plate
        that stretches.
        """
        begin = time.perf_counter()
        model = _model(self.problem.deck, None, self._law)
        model.histories([{}])
        first = time.perf_counter()
        model.histories([{}] * (len(self._free) + 1))
        each = time.perf_counter() - first
        memory = needed_bytes(self.problem, in_memory=False)
        impact = len({*self._free} - {*OF_RECORD})
        seconds = first - begin + USUAL_EVALUATIONS * each + model.plate.seconds_of_runs(impact)
        return Price(self.problem.work.steps, 0, memory, seconds)

    def execute(self, watch: Watch = SILENT) -> Identification:
        """Fit the parameters.

        Parameters
        ----------
        watch : Watch, optional
            Gets the number of trial forces that are computed, and their usual number. It may stop
            the fit.

        Returns
        -------
        Identification
            Fitted values, their errors and correlations, and the deck with them.

        Raises
        ------
        IdentifyError
            If the measurement does not determine the parameters, or is constant.
        StudyError
            If the measurement is too short; or if more than 20 % of the points of the contact are
            outside the run of the deck.
        CasesError
            If the cases of the deck do not share a plate.
        LawError
            If the contact law fails.
        StoppedError
            If the watch stops the fit.
        """
        usual, computed = USUAL_EVALUATIONS * (len(self._free) + 1), 0

        def count(forces: int) -> None:
            nonlocal computed
            computed += forces
            watch.advance(computed, max(usual, computed))
            if watch.stops():
                raise StoppedError(f"stopped after {computed} trial forces; nothing is fitted yet")

        return fit_deck(
            self.problem.deck, self.measurement, self._free, self._filter, self._law, count
        )

    def __repr__(self) -> str:
        return f"<fecm fit of {', '.join(self._free)} to {self.measurement.name}>"

    def _repr_html_(self) -> str:
        """Return a table of the title and the price, for notebooks."""
        rows = (("title", self.problem.deck.title), ("price", str(self.price)))
        return html_summary(self, rows)


@described_by(IdentificationJob)
def identify(
    deck: AnyDeck,
    time: Any,
    force: Any,
    free: str | Sequence[str],
    filter: str | Filter | None = None,
    law: Law | str | None = None,
) -> Identification:
    """Fit parameters of an impact to a measured contact force.

    :class:`IdentificationJob` says how, and has the errors of the parameters. The notes of the
    result are :class:`FecmWarning`.

    Parameters
    ----------
    {deck}
    time, force : array_like (points,)
        Measured contact force, positive in compression, at increasing times, in the deck's units.
        At time 0 the projectile touches the plate, as in the deck.
    {free}
    {filter}
    {law}

    Returns
    -------
    Identification
        Fitted values, their errors and correlations, and the deck with them.

    Raises
    ------
    IdentifyError
        If the measurement does not determine the parameters, or is constant.
    StudyError
        If the measurement is invalid, in other units, or too short; if more than 20 % of the points
        of the contact are outside the run of the deck; or if a name or the filter is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> table = fecm.examples.path("measured-force.csv")
    >>> time, force = np.loadtxt(table, delimiter=",", skiprows=3, unpack=True)
    >>> fit = fecm.identify("impact-patch.inp", time, force, ["k"], filter="first-order:5e-6")
    >>> round(fit.values["k"], -4)
    1900000.0
    """
    fit = IdentificationJob(deck, (time, force), free, filter, law).execute()
    warn(*fit.notes)
    return fit


def fit_deck(
    deck: Deck,
    measured: Measurement,
    free: Sequence[str],
    sensor: Filter | None = None,
    law: Law | None = None,
    computed: Callable[[int], object] = lambda forces: None,
) -> Identification:
    """Fit parameters of a deck to a measurement; see :class:`IdentificationJob`.

    `computed` is called with the number of new trial forces.
    """
    units = unit_names(deck)
    sensor = None if sensor is None else sensor.in_unit(units.get("time", ""))
    model = _model(deck, sensor, law, computed)
    clock, force = model.histories([{}])
    if sensor is not None:
        sensor.warn_without_effect(clock, units.get("time", ""))
    width = check_measured(measured, clock, force[:, 0], units)
    if len(measured.time) < POINTS:
        text = f"{len(measured.time)} points; at least {POINTS} are needed"
        raise StudyError(f"{measured.name} has {text}")
    starts = lags(measured, clock, force[:, 0])
    depth = (force.max() / deck.require(Indentation).k) ** (2.0 / 3.0)
    sizes = {DELAY: width, OFFSET: UNIT_OFFSET * float(force.max()), "alpha_p": depth}
    first = min(0.0, float(measured.time[0]), *starts)
    model = model.covering(float(measured.time[-1]) - first + width)

    def fit_from_starts(names: Sequence[str], trial_model: ForceModel) -> FittedPoints | None:
        """Return the best fit from all starts of the delay; None if the deck's run is too short."""
        start_values = {name: _start(deck, name) for name in names}
        trials = (
            [{**start_values, DELAY: lag} for lag in starts] if DELAY in names else [start_values]
        )
        scalings, x = [_scaling(scaling, sizes) for scaling in trials], np.zeros(len(names))
        best = 0
        if len(scalings) > 1:
            short_fits = [
                fit_parameters(trial_model, measured, scaling, x, FIRST_EVALUATIONS)
                for scaling in scalings
            ]
            best = min(range(len(short_fits)), key=lambda n: _rank(short_fits[n]))
        points = fit_parameters(trial_model, measured, scalings[best], x, MOST_EVALUATIONS)
        return None if points is None or points.lost > LOST else points

    points = fit_from_starts(free, model)
    if points is None:
        lag = starts[0] if DELAY in free else 0.0
        if share_lost(measured.force, during_run(measured.time, clock, lag)) <= LOST:
            raise IdentifyError(UNDESCRIBED.say(why="the fit shifts the run away from the contact"))
        raise StudyError(
            f"{measured.name}: {_explain_points_outside(free, starts[0], width, units)}"
        )

    def fit_again(corrected: ForceModel, before: FittedPoints) -> FittedPoints | None:
        """Return the fit of a corrected model from the values of a fit."""
        return fit_parameters(corrected, measured, before.scaling, before.x, MOST_EVALUATIONS)

    fit = confirmed(model, points, fit_again)
    model, points = fit.model, fit.points

    def fit_with_filter(filter: Filter) -> FittedPoints | None:
        """Return the best fit with a filter of the measurement."""
        return fit_from_starts(free, model._replace(sensor=filter))

    fault, suspicion = proposal(
        model, points, lambda: fit_from_starts([*free, DELAY], model), fit_with_filter, units
    )
    fault = fault or undescribed(points, units)
    try:
        cov = covariance(points)
    except IdentifyError as error:
        raise IdentifyError(f"{fault}; besides, {error}" if fault else str(error)) from None
    identification = _identification(fit, measured, cov, fault)
    if not suspicion:
        return identification
    notes, doubts = identification.notes, identification.doubts
    return replace(identification, notes=(*notes, suspicion), doubts=(*doubts, suspicion))


def _model(
    deck: Deck,
    sensor: Filter | None,
    law: Law | None,
    computed: Callable[[int], object] = lambda forces: None,
) -> ForceModel:
    """Return the forces of a deck, measured through a filter."""
    plate = plate_of_fit(deck, replaces_law=law is not None)
    return ForceModel(deck, plate, sensor, law, computed)


def _identification(
    fit: Confirmed, measured: Measurement, cov: Floats, fault: str
) -> Identification:
    """Return the result of a fit; `fault` is the reason to reject it, or empty."""
    model, points, outcome, full_run = fit
    deviation = np.sqrt(np.diagonal(cov))
    correlation = cov / np.outer(deviation, deviation)
    np.fill_diagonal(correlation, 1.0)
    values, start = points.values, points.scaling.start
    errors = deviation * points.scaling.slopes(points.x)
    plates = {}
    if not fault:
        plates = plate_errors(model, points, outcome)
    identification = Identification(
        values=values,
        errors=dict(zip(start, errors.tolist(), strict=True)),
        start=start,
        correlation=correlation,
        time=points.time,
        force=points.force,
        model=points.model,
        converged=points.converged,
        accepted=points.converged and not (fault or fit.rejects),
        plate_errors=plates,
        deck=fitted(model.deck, rounded(values)).deck(),
        notes=(),
        law="" if model.law is None else law_name(model.law),
        record=measured.record,
        full_run=full_run,
    )
    reasons = _doubts(identification, points, outcome)
    doubts = tuple(filter(None, (fault, *measured.faults, *reasons)))
    remark = _points_left_out(identification, measured)
    if remark and points.lost > LEFT_OUT.value:
        doubts = (remark, *doubts)
    notes = doubts if not remark or remark in doubts else (*doubts, remark)
    return replace(identification, notes=notes, doubts=doubts)


def _rank(points: FittedPoints | None) -> tuple[bool, float]:
    """Return the sort key of a fit: first whether it covers the contact, then its residual."""
    return (True, math.inf) if points is None else (points.lost > LOST, points.variance)


def _scaling(start: dict[str, float], sizes: Mapping[str, float]) -> Scaling:
    """Return the scaling of parameters with these start values."""
    size, low, high = np.array([parameter_bounds(n, v, sizes) for n, v in start.items()]).T
    return Scaling(start, size, low, high)


def _explain_points_outside(
    free: Sequence[str], lag: float, width: float, units: dict[str, str]
) -> str:
    """Explain why points of the contact are outside the run of the deck."""
    text = f"more than {100.0 * LOST:.0f} % of the points of the contact are outside the run"
    if DELAY not in free and abs(lag) > width:
        side = "after" if lag > 0.0 else "before"
        shift = f"{abs(lag):.3g} {units.get('time', '')}".rstrip()
        rise = f"the force rises {shift} {side} the deck's own run"
        return f"{text}, and {rise}; fit delay too, or shift the times"
    return f"{text} of the deck; lengthen the run, or cut the table"


def _start(deck: Deck, name: str) -> float:
    """Return the value at which the fit of a parameter starts."""
    if name in OF_RECORD:
        return 0.0
    projectile = build_projectile(deck)
    if name == "mass":
        return projectile.total_mass
    if name == "energy":
        return 0.5 * projectile.total_mass * deck.require(Impact).velocity ** 2
    if CARDS[name] is not Projectile:
        return float(getattr(deck.require(CARDS[name]), name))
    if name not in projectile.values:
        raise StudyError(f"{name}: {lacks_value(projectile)}")
    return float(getattr(projectile, projectile.values[name]))


def _points_left_out(fit: Identification, measured: Measurement) -> str:
    """Return a remark about points outside the run of the deck; empty if there are none."""
    count = len(measured.time)
    if not (outside := count - len(fit.time)):
        return ""
    return LEFT_OUT.say(outside=outside, count=count)


def _doubts(fit: Identification, solution: FittedPoints, outcome: Outcome) -> Iterator[str]:
    """Yield reasons to doubt the values, from the fit and from the run of the fitted deck."""
    if not fit.converged:
        yield NOT_CONVERGED.say()
    for name, bound in zip(fit.values, solution.active, strict=True):
        if bound:
            yield AT_BOUND.say(name=name, value=fit.values[name])
    names = list(fit.values)
    correlated = np.triu(np.abs(fit.correlation) > CORRELATED.value, 1)
    for i, j in zip(*np.nonzero(correlated), strict=True):
        yield CORRELATED.say(first=names[i], second=names[j], correlation=fit.correlation[i, j])
    if has_shape(solution):
        yield SHAPED.say(correlation=neighbour_correlation(fit.residual))
    elif has_few_sign_runs(solution):
        yield FEW_RUNS.say(rarity=-sign_runs(fit.residual))
    if fit.full_run is not None:
        yield fit.full_run.doubt
    if not outcome.fine[0]:
        yield FAILED_RUN.say(why=outcome.status[0])
    # The measurement may end in contact. Other limits of the model bias the parameters.
    doubts = [DOUBTS.get(r, OTHER) for r in reasons_of(str(outcome.columns["validity"][0]))]
    limits = [doubt.case for doubt in doubts if doubt != PEAK_NOT_REACHED]
    if limits:
        yield DOUBTFUL_RUN.say(doubts=", ".join(limits))
