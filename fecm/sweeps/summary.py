"""Summary of a sweep: its cases, their validity, and random results."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from fecm._errors import ResultFileError
from fecm._table import Row, ShownNumber, Summary, Table
from fecm._text import DIGITS, significant
from fecm._typing import Bools
from fecm.authoring.case import pair_of_text
from fecm.deck.model import Curvature, Delamination, Preload, Segment
from fecm.deck.units import column_name, quantity, readable
from fecm.judge.exposures import finer_meshes
from fecm.judge.limits import EXPOSURE, FREE_DEFLECTION, TOO_SOFT
from fecm.judge.limits import THRESHOLD as THRESHOLD_LIMIT
from fecm.judge.threshold import AT_THE_LATEST, from_threshold
from fecm.judge.validity import (
    BENT,
    InPlane,
    counted,
    in_plane_of,
    reasons_of,
    softness,
    unsafe,
)
from fecm.problem.generate import generate
from fecm.problem.symmetry import symmetry_of
from fecm.results.metrics import FACTOR, FOUND_BAND, RATIO, THRESHOLD_FORCE
from fecm.results.stored import whole_plate
from fecm.sweeps.convergence import Convergence, convergence_table
from fecm.sweeps.limits import THRESHOLD
from fecm.sweeps.measured import comparisons, ratios_in_words
from fecm.sweeps.outcome import Column
from fecm.sweeps.random import pairs_of
from fecm.sweeps.statistics import QUANTILES, ROUNDING, RandomResult
from fecm.sweeps.stored import StoredSweep

GIVEN = 6  # digits of the values of a case, unless others are closer
MOST_REASONS = 5  # of failure, that the summary lists
WEIGHED = ("mass", "rod_mass", "energy")  # values that the summary shows in g and J
WIDE = 0.75  # share of an energy found that finer meshes leave if the load is resolved
SAME_FORCE = 1e-4  # distance of a force found from the threshold, relative to the threshold
SAME_PLACE = 1e-9  # distance from the place given, relative to its coordinates, that is rounding


def summary_of_sweep(result: StoredSweep) -> Summary:
    """Return answer and groups of rows of a sweep; its notes are those of the result."""
    studies = result.convergence
    groups = [Table(tuple(_case_rows(result)), title="Cases")]
    if studies:
        groups.append(convergence_table(result.cases, result.summary, studies))
    if result.random is not None:
        groups += random_tables(result.random, result.unit)
    return Summary(result.title or "(no title)", sweep_answer(result), tuple(groups))


def sweep_answer(result: StoredSweep) -> str:
    """Say in one line how large the peak forces are, or which energies were found."""
    if not result.completed.any():
        return f"No case was computed: {reasons(result['status'])}"
    parts = _found_answer(result) if "found_energy" in result.summary else _peak_answer(result)
    if result.random is not None:
        parts += _chances(result.random)
    parts += [f"{compared.name} {ratios_in_words(compared)}" for compared in comparisons(result)]
    answer = "; ".join(parts)
    return f"{answer[0].upper()}{answer[1:]}"


def _peak_answer(result: StoredSweep) -> list[str]:
    """Say how large the peak forces are, and how many cases delaminate or fail."""
    parts = [f"peak force {range_of(result, 'peak_force')}"]
    if (study := result.convergence.get("peak_force")) is not None:
        parts = [limit_answer(result, study)]
    reasons_by_case = [reasons_of(validity) for validity in result.validity.tolist()]
    for limit, what in ((THRESHOLD_LIMIT, "delamination threshold"), (EXPOSURE, "first failure")):
        beyond = np.array([limit.reason in reasons for reasons in reasons_by_case])
        if beyond.any():
            parts.append(
                f"{beyond.sum()} of {len(result)} beyond the {what}{_from(result, beyond)}"
            )
    return parts


def range_of(result: StoredSweep, name: str) -> str:
    """Format the mean and the standard deviation of draws, or the range of other cases."""
    unit = result.unit(name)
    if result.random is not None and not result.random.combinations:
        statistics = result.random.statistics[name]
        mean, deviation = float(statistics.mean), float(statistics.standard_deviation)
        if math.isnan(mean):
            return "open"
        power, name = readable(mean, unit)
        spread = f" ± {significant(deviation / 10.0**power, 2)}"
        texts = [significant(mean / 10.0**power) + spread * (deviation > ROUNDING * abs(mean))]
    else:
        values = result[name][result.completed]
        values = values[np.isfinite(values)]
        if not values.size:
            return "open"
        power, name = readable(float(values.min()), unit)
        ends = (float(values.min()), float(values.max()))
        texts = [*dict.fromkeys(significant(end / 10.0**power) for end in ends)]
    return f"{' to '.join(texts)} {name}".rstrip()


def limit_answer(result: StoredSweep, study: Convergence) -> str:
    """Format the peak force of the finest mesh, and its limit."""
    unit = result.unit("peak_force")
    finest = f"peak force {quantity(float(result['peak_force'][-1]), unit)} on the finest mesh"
    if math.isnan(study.limit):
        return f"{finest}: {study.remark}"
    band = "" if math.isnan(study.band) else f" (±{quantity(study.band, unit, 2)})"
    return f"{finest}{band}, limit {quantity(study.limit, unit)}"


def _from(result: StoredSweep, beyond: Bools) -> str:
    """Say from which value on the cases are beyond a limit, if one value alone decides it."""
    (name, values), *others = result.cases.items()
    if others or values.dtype.kind != "f" or beyond.all():
        return ""
    first = float(values[beyond].min())
    if values[~beyond].max() >= first:
        return ""
    return f", from {name} {quantity(first, result.unit(name))} on"


def _found_answer(result: StoredSweep) -> list[str]:
    """Say at which energies the value searched for is reached."""
    if is_at_threshold(result):
        what = f"delaminates, {from_threshold_of(result)}"
    elif all(name in result.summary for name in FOUND_BAND):
        what = "first failure at"
    else:
        what = f"peak force {range_of(result, 'peak_force')} from"
    velocity = f" ({range_of(result, 'found_velocity')})" if len(result) == 1 else ""
    return [f"{what} {range_of(result, 'found_energy')}{velocity}"]


def _case_rows(result: StoredSweep) -> list[Row]:
    """Return rows about extreme peaks or velocities, and failures."""
    fine = result.completed
    failed = Counter(result["status"][~fine].tolist())
    rows: list[Row] = []
    if result.law:
        rows.append(("contact law", f"{result.law}, instead of EXPE"))
    if result.measured:
        rows.append(("measured", f"{', '.join(result.measured)}, which are not varied"))
        rows += [(compared.name, str(compared)) for compared in comparisons(result)]
    if text := symmetry_text(result):
        rows.append(("symmetry", text))
    rows += [*_extremes(result), *_moved(result)]
    if text := threshold_text(result):
        rows.append(("delamination", text))
    for reason, times in failed.most_common(MOST_REASONS):
        rows.append(("failed", f"{times}: {reason}"))
    if (more := len(failed) - MOST_REASONS) > 0:
        rows.append(("failed", f"for {more} other reason{'s' * (more > 1)}"))
    if result.random is not None and failed:
        rows.append(("failed share", f"{(~fine).mean():.3%} of the draws"))
    return [*rows, *(() if result.reduced is None else result.reduced.rows())]


def symmetry_text(result: StoredSweep) -> str:
    """Say which cases are of a half or a quarter of a plate; empty if none is."""
    if FACTOR not in result.summary:
        return ""
    factors = result[FACTOR][result.completed].astype(int)
    texts = {factor: whole_plate(factor) for factor in sorted(set(factors.tolist())) if factor > 1}
    if len(set(factors.tolist())) == 1:
        return next(iter(texts.values()), "")
    counts = {factor: np.count_nonzero(factors == factor) for factor in texts}
    return "; ".join(f"{counts[factor]} of {len(result)}: {text}" for factor, text in texts.items())


def _extremes(result: StoredSweep) -> Iterator[Row]:
    """Yield the cases with the smallest and the largest peak, or velocity that was searched."""
    what, names = "peak", ["peak_force"]
    if "found_velocity" in result.summary:
        what, names = "found", ["found_velocity", "found_energy"]
    shown = np.where(result.completed, result[names[0]], np.nan)
    if not np.isfinite(shown).any():
        return
    ends = {"smallest ": int(np.nanargmin(shown)), "largest ": int(np.nanargmax(shown))}
    if len(set(ends.values())) == 1:
        ends = {"": ends["largest "]}
    for size, case in ends.items():
        texts = [quantity(result[name][case], result.unit(name), DIGITS) for name in names]
        values = ", ".join(f"{name} {_shown(result, name, case)}" for name in result.cases)
        values_text = f" ({values})" if values else ""
        text = f"{', '.join(texts)}{values_text}{_found_band(result, case)}"
        yield (f"{size}{what}", text)


def _found_band(result: StoredSweep, case: int) -> str:
    """Format the energies that finer meshes may give a case."""
    if not all(name in result.summary for name in FOUND_BAND):
        return ""
    low, high = (float(result[name][case]) for name in FOUND_BAND)
    if math.isnan(low) or math.isnan(high):
        return ""
    unit = result.unit("found_energy")
    return f"; {finer_meshes((low, high), lambda energy: quantity(energy, unit, 3))}"


def from_threshold_of(result: StoredSweep) -> str:
    """Return the words before the delamination threshold of a sweep."""
    try:
        card = result.deck.last(Delamination)
    except ResultFileError:  # of a damaged file
        return from_threshold(0)
    return from_threshold(0 if card is None else int(card.number))


def is_at_threshold(result: StoredSweep) -> bool:
    """Return whether a search has found the velocities at the delamination threshold."""
    if not {"found_energy", THRESHOLD_FORCE} <= result.summary.keys():
        return False
    ratio = result["peak_force"][result.completed] / result[THRESHOLD_FORCE][result.completed]
    return bool((np.abs(ratio - 1.0) < SAME_FORCE).all())


def threshold_text(result: StoredSweep) -> str:
    """Say what the energies found at the threshold are; empty for other sweeps and searches."""
    if not is_at_threshold(result) or from_threshold_of(result) != AT_THE_LATEST:
        return ""
    return (
        f"{AT_THE_LATEST} these energies, which are for one delamination; plies and interfaces may "
        "fail before (--until exposure=1, with FAIL)"
    )


def _moved(result: StoredSweep) -> Iterator[Row]:
    """Yield how far impact positions were moved to nodes."""
    if "at" not in result.cases or "hit_x" not in result.summary:
        return
    asked = np.array([pair_of_text("at", text) for text in result.cases["at"].tolist()]).T
    moved = np.hypot(*(asked - (result["hit_x"], result["hit_y"])))
    if count := np.count_nonzero(moved > SAME_PLACE * np.abs(asked).max()):
        distance = f"{np.nanmax(moved):.4g} {result.unit('hit_x')}".rstrip()
        yield ("moved", f"{count}: to the nearest node, up to {distance} away")


def _shown(result: StoredSweep, name: str, case: int) -> str:
    """Format a value of a case with six digits, or enough to distinguish it from fixed values."""
    values = result.cases[name]
    if values.dtype.kind != "f":
        return str(values[case])
    digits = GIVEN
    if result.random is None:
        size = max(abs(float(values[case])), 1e-300)
        distances = np.abs(values[values != values[case]] - values[case])
        gap = float(np.min(distances / size, initial=1.0))
        digits = min(max(GIVEN, 1 - math.floor(math.log10(gap))), 17)
    return quantity(values[case], result.unit(name) if name in WEIGHED else "", digits)


def sweep_verdict(result: StoredSweep) -> str:
    """Count the cases, the failures, and the cases with doubtful results."""
    counts = ", ".join(f"{count} {what}" for count, what in doubtful_counts(result))
    return f"{len(result)} case{'' if len(result) == 1 else 's'}: {counts or 'all ok'}"


def reasons(status: Column) -> str:
    """Return the most common reason of failure, and the number of other reasons."""
    (first, _), *other_reasons = Counter(status.tolist()).most_common()
    more = (
        f", and {len(other_reasons)} other reason{'s' * (len(other_reasons) > 1)}"
        if other_reasons
        else ""
    )
    return f"{first}{more}"


def doubtful_counts(result: StoredSweep) -> list[tuple[int, str]]:
    """Count the cases by doubt; failures come last."""
    fine, steps = result.completed, result.unsettled_steps
    unconverged = np.zeros_like(fine) if steps is None else fine & (steps > 0)
    cases = {
        "still in contact at the end": result.still_in_contact,
        **_doubts(result),
        "with a contact iteration that did not converge": unconverged,
        "failed": ~fine,
    }
    return [(int(mask.sum()), what) for what, mask in cases.items() if mask.any()]


def _doubts(result: StoredSweep) -> dict[str, Bools]:
    """Count the cases beyond the range of the model, by kind."""
    masks = {}
    for doubt, mask in counted(result.validity):
        what = doubt.case
        if doubt in BENT:
            ratio = result.summary.get(RATIO, np.full(len(mask), np.nan))[mask]
            if np.isfinite(ratio).any():
                what = f"{what[:-1]}, up to {np.nanmax(ratio):.3g} h)"
        masks[what] = mask
    return masks


def remarks(result: StoredSweep) -> Iterator[str]:
    """Explain open values and cases beyond the linear plate, and name remedies."""
    is_open = result.completed & ~result.contact_over
    if is_open.any():
        duration = 2.0 * float((result.dt * result.steps)[is_open].max())
        yield (
            f"{is_open.sum()} of {len(result)} cases end before their contact does: what comes "
            f"after is open; a longer run decides it, as with --vary duration={duration:.3g}"
        )
    if wide := _decided_by_mesh(result):
        yield (
            f"the mesh decides the energy in {wide} of {len(result)} cases: finer meshes may "
            f"find less than {WIDE:g} of it; refine the mesh at "
            "the load, and place a corner of elements there (fecm new --grading)"
        )
    bent = [doubt for doubt, _ in counted(result.validity) if doubt in BENT]
    if bent:
        held = any(doubt != FREE_DEFLECTION.doubt for doubt in bent)
        ratio = result.summary.get(RATIO, np.full(1, np.nan))
        size = ""
        if np.isfinite(ratio).any():
            largest = float(np.nanmax(ratio))
            in_plane = _in_plane(result) if held else InPlane.FREE
            error = softness(largest, in_plane, preloaded=_has(result, Preload))
            size = f" (at w = {largest:.3g} h {error})"
        curved = _has(result, Curvature) or any(name in result for name in ("radius_x", "radius_y"))
        yield f"beyond its range, {TOO_SOFT}{size}; {unsafe(curved=curved)}"


def _decided_by_mesh(result: StoredSweep) -> int:
    """Count the cases whose energy found has a wide band."""
    names = ("found_energy_low", "found_energy")
    if not all(name in result.summary for name in names):
        return 0
    low, energy = (result[name] for name in names)
    return int(np.count_nonzero(low < WIDE * energy))


def _in_plane(result: StoredSweep) -> InPlane:
    """Return the in-plane support of the plate; unknown where the deck can't be read or meshed."""
    try:
        mesh = generate(result.deck)
    except (ResultFileError, ValueError, LookupError):  # of a damaged file
        return InPlane.UNKNOWN
    in_plane = in_plane_of(mesh.codes, mesh.coordinates, symmetry_of(result.deck, mesh).cut)
    return in_plane if in_plane is InPlane.WINDOW else InPlane.UNKNOWN


def _has(result: StoredSweep, kind: type[Segment]) -> bool:
    """Return whether the deck has a segment of one kind."""
    try:
        return result.deck.has(kind)
    except ResultFileError:  # of a damaged file
        return False


MOST_PRINTED = 4  # quantities of :data:`MAIN`, and combinations
TOUGHNESS = "giic"
MARGIN = ("threshold_margin",)  # the quantity that toughness affects
MAIN = (
    "found_velocity",
    "found_energy",
    "peak_force",
    "max_indentation",
    "contact_time",
    "energy_absorbed",
)


def random_tables(random: RandomResult, unit: Callable[[str], str]) -> Iterator[Table]:
    """Yield tables: random values, then statistics, indices and probabilities."""
    yield Table(tuple(_design_rows(random, unit)), title="Random values")
    count = len(next(iter(random.combinations.values()), [0]))
    for number in range(min(count, MOST_PRINTED)):
        place = (number,) if random.combinations else ()
        label = f" of {random.label(number)}" if place else ""
        yield replace(statistics_table(random, unit, place), title=f"Statistics{label}")
        for name in _of_indices(random):
            yield _index_table(random, name, place)
        yield Table(tuple(_chance_rows(random, place)), title=f"Probabilities{label}")
    if count > MOST_PRINTED:
        more = f"{count - MOST_PRINTED} more combinations of varied values are in the file"
        yield Table((("", more),), title="Combinations")


def _design_rows(random: RandomResult, unit: Callable[[str], str]) -> Iterator[Row]:
    """Yield rows about the draws, the laws and their correlations."""
    design = random.design
    yield ("design", f"{design.kind}, {design.samples} samples, seed {design.seed}")
    for name, law in design.laws.items():
        yield ("random", f"{column_name(name, unit(name))} {law}")
    for (a, b), value in pairs_of([*design.laws], design.correlation).items():
        if value:
            yield ("correlation", f"{a}, {b} {value:.6g}")


def _main_quantities(random: RandomResult) -> list[str]:
    """Return the names of the quantities that the summary shows."""
    return [name for name in MAIN if name in random.statistics][:MOST_PRINTED]


def statistics_table(
    random: RandomResult, unit: Callable[[str], str], place: tuple[int, ...]
) -> Table:
    """Return the statistics of the main quantities in a combination of varied values."""
    names = _main_quantities(random)
    moments = [random.statistics[name] for name in names]
    lacking = [random.design.draws - int(moment.draws[place]) for moment in moments]
    columns = [
        (moment.mean[place], moment.standard_deviation[place], *moment.quantiles[place])
        for moment in moments
    ]
    labels = ("mean", "std. dev.", *(f"{q:.0%}".replace("%", " %") for q in QUANTILES))
    rows: list[Row] = [
        (label, *(ShownNumber(value, significant(value)) for value in values))
        for label, values in zip(labels, map(tuple, zip(*columns, strict=True)), strict=True)
    ]
    if any(lacking):
        rows.append(("no value", *(ShownNumber(count, str(count)) for count in lacking)))
    return Table(tuple(rows), ("", *(column_name(name, unit(name)) for name in names)))


def _of_indices(random: RandomResult) -> list[str]:
    """Return the names of the quantities whose indices the summary shows."""
    if not random.sensitivity:
        return []
    return [_main_quantities(random)[0], *(MARGIN if TOUGHNESS in random.design.laws else ())]


def _index_table(random: RandomResult, name: str, place: tuple[int, ...]) -> Table:
    """Return the indices of a quantity, with their 95 % intervals."""
    columns = [values[place].tolist() for values in random.sensitivity[name]]
    rows: list[Row] = []
    for law, first, total, *intervals in zip(random.design.laws, *columns, strict=True):
        texts = [
            f"{value:.4f} ({low:.4f} to {high:.4f})"
            for value, (low, high) in zip((first, total), intervals, strict=True)
        ]
        rows.append((law, *texts))
    header = (name, "first-order index (95 %)", "total index (95 %)")
    return Table(tuple(rows), header, f"Indices of {name}")


def _chance_rows(random: RandomResult, place: tuple[int, ...]) -> Iterator[Row]:
    """Yield rows of the probabilities that quantities exceed their limits."""
    exceedance, draws = random.exceedance, random.design.draws
    for row, (name, limit) in enumerate(zip(exceedance.quantity, exceedance.limit, strict=True)):
        p, low, high, n, is_open = (values[(*place, row)] for values in exceedance[2:])
        value = THRESHOLD if np.isnan(limit) else f"{limit:.6g}"
        yield (f"P({name} > {value})", chance(p, low, high, is_open, draws - n))


def _chances(random: RandomResult) -> list[str]:
    """Return the probabilities of draws without varied values."""
    rows = () if random.combinations else _chance_rows(random, ())
    return [f"{label} = {text}" for label, text in rows]


def chance(p: float, low: float, high: float, is_open: int, lacking: int) -> str:
    """Format a probability, its interval and the number of draws without a value."""
    text = (
        f"{'open' if np.isnan(p) else significant(p)} ({significant(low)} to {significant(high)})"
    )
    if is_open:
        text += f"; {is_open} draws are open, counted as below and as above"
    if lacking > is_open:
        text += f"; {lacking - is_open} draws have no value"
    return text
