"""Head of the page of a sweep: answers and headline figures."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fecm._errors import ResultFileError
from fecm._table import Cell
from fecm._typing import Bools, Floats
from fecm.authoring.values import NAMES
from fecm.deck.model import Allowables, Impact, Nonlinear
from fecm.deck.units import prefixed, unit_of
from fecm.judge.limits import EXPOSURE, THRESHOLD
from fecm.judge.validity import VALID, reasons_of
from fecm.problem.parts import build_projectile
from fecm.report.content import Answer, Headline
from fecm.results.metrics import BAND, EXPOSURES, FACTOR, FOUND_BAND, RATIO, THRESHOLD_FORCE
from fecm.sweeps.measured import RATIOS, comparisons, ratios_in_words
from fecm.sweeps.result import SweepResult
from fecm.sweeps.search import LEVEL_EXCESS, VELOCITY_ERROR
from fecm.sweeps.statistics import ROUNDING, with_threshold
from fecm.sweeps.summary import (
    chance,
    from_threshold_of,
    is_at_threshold,
    limit_answer,
    reasons,
)

ENERGY = "force*length"
OF_PROJECTILE = ("rod_length", "rod_modulus", "rod_density")  # which change its mass
DIGITS = 4
FEW_DIGITS = 3  # of headline figures


def answers(sweep: SweepResult) -> Iterator[Answer]:
    """Answer the question of a sweep: from which energy the plate delaminates, how probable it is.

    Results beside measured values are answers too.
    """
    if not sweep.completed.any():
        yield Answer("Computed", "no case", f": {reasons(sweep['status'])}")
        return
    if "found_energy" in sweep.summary:
        yield _found(sweep)
    elif sweep.random is not None:
        yield from _chances(sweep)
    elif (study := sweep.convergence.get("peak_force")) is not None:
        is_said = not study.remark or math.isnan(study.limit)  # by the words about the limit
        rest = limit_answer(sweep, study) + ("" if is_said else f"; {study.remark}")
        yield Answer("Converged", "in doubt" if study.remark else "yes", f": {rest}")
    else:
        yield _delamination(sweep)
        yield _first_failure(sweep)
    for compared in comparisons(sweep):
        question = f"{_words(compared.name).capitalize()}, {RATIOS}"
        mean, _, spread = ratios_in_words(compared).removeprefix(f"{RATIOS} ").partition(" ")
        yield Answer(question, mean, f" {spread}")


def _words(name: str) -> str:
    return name.replace("_", " ")


def _found(sweep: SweepResult) -> Answer:
    """Say at which energy a search reaches its level, and how well it is bracketed."""
    energy, velocity = (_range(sweep, f"found_{name}") for name in ("energy", "velocity"))
    rest = f" ({velocity})"
    if all(name in sweep.summary for name in FOUND_BAND):
        low, high = (sweep[name][sweep.completed] for name in FOUND_BAND)
        unit = sweep.unit("found_energy")
        ends = [prefixed(float(end), unit, DIGITS) for end in (low.min(), high.max())]
        band = " to ".join(ends) if math.isfinite(high.max()) else "not bounded"
        return Answer("First failure", f"from {energy} on", f"{rest}; finer meshes: {band}")
    rest += f"; bracketed to {_bracket(sweep)}"
    if is_at_threshold(sweep):
        return Answer("Delaminates", f"{from_threshold_of(sweep)} {energy} on", rest)
    return Answer(f"Peak force {_range(sweep, 'peak_force')}", f"from {energy} on", rest)


def _bracket(sweep: SweepResult) -> str:
    """Say how closely a search for a peak force brackets the velocity."""
    try:
        is_nonlinear = sweep.deck.has(Nonlinear)
    except ResultFileError:  # of a damaged file
        is_nonlinear = False
    if is_nonlinear:
        return f"{LEVEL_EXCESS:.0e} of the peak force"
    return f"{VELOCITY_ERROR:.0e} of the velocity"


def _chances(sweep: SweepResult) -> Iterator[Answer]:
    """Say the probabilities of a random sweep, first that of reaching the threshold."""
    random = sweep.random
    assert random is not None
    if random.combinations:
        count = len(next(iter(random.combinations.values())))
        yield Answer("Probabilities", f"of {count} combinations", ": see Results")
        return
    exceedance = with_threshold(random, sweep.summary)
    thresholds = sweep.summary.get(THRESHOLD_FORCE, np.empty(0))
    for row, (name, limit) in enumerate(zip(exceedance.quantity, exceedance.limit, strict=True)):
        p, low, high, draws, is_open = (float(values[row]) for values in exceedance[2:])
        lacking = random.design.draws - int(draws)
        text = chance(p, low, high, int(is_open), lacking)
        share, _, rest = text.partition(" ")
        of = _words(str(name))
        size = "" if np.isnan(limit) else f" {limit:.4g} {sweep.unit(str(name))}".rstrip()
        what = f"Probability that the {of} exceeds{size}"
        if name == "peak_force" and (np.isnan(limit) or (limit == thresholds).any()):
            what = f"Probability that the {of} exceeds the delamination threshold{size}"
        yield Answer(what, share, f" {rest}")


def _delamination(sweep: SweepResult) -> Answer:
    """Say how many cases reach the delamination threshold, and from which energy on."""
    if THRESHOLD_FORCE not in sweep.summary:
        return Answer("Delaminates", "not judged", ", as the deck has no DELA")
    reached = _beyond(sweep, THRESHOLD.reason)
    with np.errstate(invalid="ignore"):
        below = sweep.completed & ~reached & (sweep["threshold_margin"] > 0.0)
    return _outcome(sweep, "Delaminates", reached, below, from_threshold_of(sweep))


def _first_failure(sweep: SweepResult) -> Answer:
    """Say in how many cases a ply fails, and from which energy on."""
    names = [name for name in EXPOSURES if name in sweep.summary]
    if not names:
        return Answer("First ply fails", "not judged", f", as {_why_no_exposures(sweep)}")
    failed = _beyond(sweep, EXPOSURE.reason)
    known = np.isfinite([sweep[name] for name in names]).any(axis=0)
    answer = _outcome(sweep, "First ply fails", failed, sweep.completed & ~failed & known, "from")
    if not all(name in sweep.summary for name in BAND):
        return answer
    low, high = (sweep[name] for name in BAND)
    if decides := int(np.count_nonzero(known & (low < 1.0) & (high >= 1.0))):
        return answer._replace(rest=f"{answer.rest}; the mesh decides {decides} of them")
    return answer


def _why_no_exposures(sweep: SweepResult) -> str:
    try:
        has_strengths = sweep.deck.has(Allowables)
    except ResultFileError:  # of a damaged file
        has_strengths = False
    return "--measure failure is not given" if has_strengths else "the deck has no ALLO"


def _beyond(sweep: SweepResult, reason: str) -> Bools:
    """Return a mask of the cases whose validity has a reason."""
    return np.array([reason in reasons_of(validity) for validity in sweep.validity.tolist()], bool)


def _outcome(sweep: SweepResult, question: str, yes: Bools, no: Bools, start: str) -> Answer:
    """Answer a question that is decided for some cases; `start` are the words before an energy."""
    is_open = int(np.count_nonzero(sweep.completed & ~yes & ~no))
    undecided = f"; open in {is_open}" if is_open else ""
    answer = f"in {np.count_nonzero(yes)} of {len(sweep)} cases"
    if yes.all() or not yes.any():
        answer = "yes" if yes.any() else "no" if no.any() else "open"
    name, values, unit = _strengths(sweep)
    if values is None:
        return Answer(question, answer, undecided)
    least, most = (
        prefixed(float(end(values[mask])), unit, DIGITS) if mask.any() else ""
        for end, mask in ((np.min, yes), (np.max, no))
    )
    if yes.any() and no.any() and values[no].max() >= values[yes].min():
        rest = f"; least {name} of these {least}, largest of the others {most}"
    else:
        from_least = f", {start} {least} on" if least else ""
        not_up_to = "; not" if least else ","
        rest = from_least + (f"{not_up_to} up to {most}" if most else "")
    return Answer(question, answer, f"{rest}{undecided}")


def _strengths(sweep: SweepResult) -> tuple[str, Floats | None, str]:
    """Return what says how hard the cases are struck: name, values, and unit.

    It is the impact energy where it is known, or the only number that varies.
    """
    if (energies := impact_energies(sweep)) is not None:
        return "energy", energies, unit_of(ENERGY, sweep.units)
    names = [n for n, v in sweep.cases.items() if v.dtype.kind == "f" and np.ptp(v) > 0.0]
    if len(names) != 1 or len(sweep.cases) > 1:
        return "", None, ""
    return _words(names[0]), sweep.cases[names[0]], sweep.unit(names[0])


def impact_energies(sweep: SweepResult) -> Floats | None:
    """Return the impact energy of every case; None if it does not follow from velocity and mass.

    The energies of a half or a quarter of a plate are those of the whole impact.
    """
    cases = sweep.cases
    if "found_energy" in sweep.summary:
        return np.asarray(sweep["found_energy"])
    if "energy" in cases:
        return np.asarray(cases["energy"], float)
    try:
        impact = sweep.deck.last(Impact)
    except ResultFileError:  # of a damaged file
        return None
    if impact is None or not cases.keys() <= {*NAMES} or not cases.keys().isdisjoint(OF_PROJECTILE):
        return None
    mass = cases.get("mass", cases.get("rod_mass"))
    if mass is None:
        mass = np.full(len(sweep), build_projectile(sweep.deck).total_mass)
    parts = sweep[FACTOR] if FACTOR in sweep.summary else np.ones(len(sweep))
    velocity = cases.get("velocity", np.full(len(sweep), impact.velocity))
    return np.asarray(0.5 * parts * mass * velocity**2)


def headlines(sweep: SweepResult) -> list[Headline]:
    """Return the figures of a sweep."""
    if not sweep.completed.any():
        return []
    figures = []
    if "found_energy" in sweep.summary:
        figures += [_figure(sweep, f"found_{name}", name) for name in ("energy", "velocity")]
    elif (energies := impact_energies(sweep)) is not None:
        unit = unit_of(ENERGY, sweep.units)
        ends = (float(energies.min()), float(energies.max()))
        figures.append(Headline("impact energy", _together(ends, "to", unit, FEW_DIGITS)))
    figures.append(_figure(sweep, "peak_force", "peak force"))
    if THRESHOLD_FORCE in sweep.summary:
        figures.append(_figure(sweep, THRESHOLD_FORCE, "delamination threshold"))
    figures.append(_figure(sweep, "contact_time", "contact"))
    if RATIO in sweep.summary and np.isfinite(sweep[RATIO]).any():
        figures.append(Headline("deflection", f"{_range(sweep, RATIO, FEW_DIGITS)} h"))
    valid = int((sweep.validity == VALID).sum())
    random = sweep.random
    name, count = ("cases", len(sweep)) if random is None else ("draws", random.design.draws)
    figures.append(Headline(name, f"{count}", (f"{valid} of {len(sweep)} without a doubt",)))
    return figures


def _range(sweep: SweepResult, name: str, digits: int = DIGITS) -> str:
    """Format the range of a result over the cases, or mean and standard deviation of draws."""
    unit, random = sweep.unit(name), sweep.random
    if random is not None and not random.combinations:
        moments = random.statistics[name]
        mean, deviation = float(moments.mean), float(moments.standard_deviation)
        return "open" if math.isnan(mean) else _together((mean, deviation), "±", unit, digits)
    values = sweep[name][sweep.completed]
    values = values[np.isfinite(values)]
    if not len(values):
        return "open"
    return _together((values.min(), values.max()), "to", unit, digits)


def _together(ends: tuple[float, float], word: str, unit: str, digits: int) -> str:
    """Format two values with a word between them; one if both are equal or the second is small.

    >>> _together((0.0036, 0.0037), "to", "s", 2), _together((360.0, 16000.0), "to", "N*mm", 2)
    ('3.6 to 3.7 ms', '360 mJ to 16 J')
    """
    first, second = (prefixed(float(end), unit, digits) for end in ends)
    if first == second or not abs(ends[1]) > ROUNDING * abs(ends[0]):
        return first
    (number, *name), (_, *other_name) = first.split(" ", 1), second.split(" ", 1)
    return f"{number if name == other_name else first} {word} {second}"


def _figure(sweep: SweepResult, name: str, label: str) -> Headline:
    """Return the range of a result over the cases, or mean and standard deviation of draws."""
    value: Cell = _range(sweep, name, FEW_DIGITS)
    is_mean = sweep.random is not None and not sweep.random.combinations and "±" in value
    known = int(np.isfinite(sweep[name][sweep.completed]).sum())
    remarks = ["mean ± standard deviation"] if is_mean else []
    if known < len(sweep):
        remarks.append(f"in the {known} of {len(sweep)} cases that have it")
    return Headline(label, value, tuple(remarks))
