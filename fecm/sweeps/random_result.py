"""Results of a random sweep: statistics, sensitivity indices and probabilities."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.results.errors import ResultFileError
from fecm.results.metrics import COLUMNS, VALIDITY, VERDICTS
from fecm.results.validity import Reason
from fecm.sweeps.cases import DESIGNS, REMEDY, THRESHOLD, Design, Law, Limit
from fecm.sweeps.plan import RUN, Status, check_limits

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents

Array = NDArray[Any]
Columns = Mapping[str, Array]
Counts = NDArray[np.int64]
FEW = 0.01  # share of failed draws above which the results are doubtful
QUANTILES = (0.01, 0.05, 0.5, 0.95, 0.99)
RESAMPLES, COUNTS = 1000, 2_000_000  # of the bootstrap, and counts of them in memory at once
ENDS = (0.025, 0.975)  # of a 95 % interval
Z = 1.959963984540054  # the standard normal distribution is 0.975 there
ROUNDING = 1e-12  # variation relative to the largest value below which a quantity is constant
PRINTED = 4  # most quantities of MAIN, and most combinations, that are printed
MAIN = ("found_velocity", "found_energy", "peak_force", "max_indentation", "contact_time",
        "energy_absorbed")  # fmt: skip
FORCE = "threshold_force"
# Description and axes of the parts of the indices in the file.
PARTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "first": ("first-order Sobol' index of every random value", ("laws",)),
    "total": ("total Sobol' index of every random value", ("laws",)),
    "first_interval": ("its 95 % interval", ("laws", "bounds")),
    "total_interval": ("its 95 % interval", ("laws", "bounds")),
}
GROUPS = {
    "random": "laws of the random values",
    "design": "design that the random values were drawn from",
    "statistics": "statistics of every quantity over the draws",
    "sensitivity": "Sobol' indices of every quantity",
    "exceedance": "probabilities that quantities exceed limits",
}
LIMIT_PARTS = {
    "quantity": "name of the quantity",
    "limit": "limit, in the unit of the quantity; NaN: the threshold of each case",
    "probability": "probability that the quantity exceeds the limit",
    "lower": "lower end of its 95 % interval, whatever the open draws are",
    "upper": "upper end of its 95 % interval, whatever the open draws are",
    "draws": "number of draws that have a value",
    "open": "number of draws that ended before they had a value",
}


class Exceedance(NamedTuple):
    """Probabilities that quantities exceed limits; with varied values, the combinations first."""

    quantity: NDArray[np.str_]  # (e,)
    limit: Floats  # (e,): in the unit of the quantity; NaN: the threshold of each case
    probability: Floats  # (e,)
    lower: Floats  # (e,): ends of its 95 % interval; see :func:`bounds`
    upper: Floats
    draws: NDArray[np.int64]  # (e,): number of draws that have a value
    open: NDArray[np.int64]  # (e,): number of draws that ended before they had one


@dataclass(frozen=True)
class RandomResult:
    """Results of a random sweep.

    With varied values, arrays have one more axis, the first: the combinations of these values.

    Attributes
    ----------
    design : Design
        Laws by name, samples, seed, kind, and whether sensitivity indices were asked for.
    statistics : dict of Statistics
        ``draws``, ``mean``, ``standard_deviation`` and ``quantiles`` (1, 5, 50, 95 and 99 %) of
        every quantity over the draws that have a value.
    sensitivity : dict of Indices
        Sobol' indices ``first`` and ``total`` (d,) of every quantity, in the order of
        ``design.laws``, and their 95 % intervals ``first_interval`` and ``total_interval`` (d, 2).
        Empty unless asked for; NaN of a quantity that is constant or lacks values.
    exceedance : Exceedance
        ``quantity``, ``limit``, ``probability``, its 95 % interval from ``lower`` to ``upper``,
        ``draws``, those that have a value, and ``open``, those that ended before they had one, for
        every limit asked for.
    combinations : dict of ndarray
        Varied values of every combination.
    notes : tuple of str
        What is doubtful.
    """

    design: Design
    statistics: dict[str, Statistics]
    sensitivity: dict[str, Indices]
    exceedance: Exceedance
    combinations: dict[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def label(self, combination: int) -> str:
        """Varied values of a combination, in words."""
        return ", ".join(f"{n} {values[combination]}" for n, values in self.combinations.items())


def evaluate(
    design: Design, cases: Columns, summary: Columns, limits: Sequence[Limit]
) -> RandomResult:
    """Evaluate the cases of a random sweep, (combinations * rows,) each."""
    fine, is_open = np.isin(summary["status"], RUN), open_ends(summary)
    made = {n: v[:: design.rows] for n, v in cases.items() if n not in design.laws}
    shape = (-1, design.rows) if made else (design.rows,)
    numbers = {name: values for name, values in summary.items() if name not in VERDICTS}
    columns = {n: np.where(fine, values, np.nan).reshape(shape) for n, values in numbers.items()}
    draws = {name: values[..., : design.draws] for name, values in columns.items()}
    check_limits(limits, list(columns), threshold=FORCE in columns)
    found: dict[str, Indices] = {}
    notes: list[str] = []
    if (lost := int((~fine).sum())) > FEW * len(fine):
        text = "of the draws failed, and the statistics are those of the others"
        notes.append(f"{lost / len(fine):.3%} {text}; {REMEDY}")
    if design.sensitivity:
        table = np.array(list(columns.values()))
        flat = table.reshape(-1, len(design.laws) + 2, design.samples)
        split = [p.reshape(*table.shape[:-1], *p.shape[1:]) for p in indices(flat, design.seed)]
        found = {n: Indices(*(part[row] for part in split)) for row, n in enumerate(columns)}
        lacking = {n: int(np.isnan(v).sum()) for n, v in columns.items()}
        if names := [name for name, count in lacking.items() if 0 < count < len(fine)]:
            text = f"{', '.join(names)} ({max(lacking.values())} of {len(fine)} cases)"
            notes.append(f"no indices where a case has no value: {text}")
    return RandomResult(
        design, {name: statistics(values) for name, values in draws.items()}, found,
        _exceedance(draws, is_open.reshape(shape)[..., : design.draws], limits), made, tuple(notes),
    )  # fmt: skip


def open_ends(summary: Columns) -> Bools:
    """Cases that were run and ended before their contact was over, so that values are open."""
    rising = np.char.find(summary.get(VALIDITY, summary["status"]), Reason.OPEN) >= 0
    return np.asarray((summary["status"] == Status.STILL) | rising)


def _exceedance(draws: Columns, is_open: Bools, limits: Sequence[Limit]) -> Exceedance:
    """Probabilities that quantities (..., draws) exceed limits."""
    thresholds = draws.get(FORCE, np.full(1, np.nan))
    known = thresholds[np.isfinite(thresholds)]
    common = known[0] if len(known) and not np.ptp(known) else np.nan
    over = [draws[n] - (thresholds if isinstance(v, str) else v) for n, v in limits]
    axes = next(iter(draws.values())).shape[:-1]
    count, hits, lacking = (
        np.array([one.sum(axis=-1) for one in which], dtype=np.int64).reshape(len(limits), *axes).T
        for which in (
            [np.isfinite(one) for one in over],
            [one > 0.0 for one in over],
            [np.isnan(one) & is_open for one in over],
        )
    )
    return Exceedance(
        np.array([name for name, _ in limits], dtype=np.str_),
        np.array([common if isinstance(v, str) else v for _, v in limits], dtype=float),
        *bounds(hits, count, lacking), count, lacking,
    )  # fmt: skip


def tables(random: RandomResult, unit: Callable[[str], str]) -> list[str]:
    """Lines of the most important quantities: statistics, indices and probabilities."""
    design, found = random.design, random.exceedance
    lines = [f"design            {design.kind}, {design.samples} samples, seed {design.seed}"]
    lines += [f"random            {name} {law}" for name, law in design.laws.items()]
    chosen = [name for name in MAIN if name in random.statistics][:PRINTED]
    labels = ["mean", "std. dev.", *(f"{q:.0%}".replace("%", " %") for q in QUANTILES)]
    count = len(next(iter(random.combinations.values()), [0]))
    for number in range(min(count, PRINTED)):
        place = (number,) if random.combinations else ()
        lines += ["", *([random.label(number)] if place else [])]
        own = [random.statistics[name] for name in chosen]
        rows = [[s.mean[place], s.standard_deviation[place], *s.quantiles[place]] for s in own]
        columns = [chosen, [unit(name) for name in chosen]]
        columns += [[f"{value:.6g}" for value in row] for row in zip(*rows, strict=True)]
        lacking = [design.draws - int(s.draws[place]) for s in own]
        columns.append([str(count) for count in lacking] if any(lacking) else [""] * len(own))
        lines += [
            f"{label:12}{''.join(f'{text:>16}' for text in row)}".rstrip()
            for label, row in zip(["", "", *labels, "no value"], columns, strict=True)
            if any(row)
        ]
        if random.sensitivity:
            lines += ["", *_index_lines(random, chosen[0], place)]
        for row, (name, limit) in enumerate(zip(found.quantity, found.limit, strict=True)):
            p, low, high, n, lacking = (values[(*place, row)] for values in found[2:])
            value = THRESHOLD if np.isnan(limit) else f"{limit:.6g}"
            lines.append(f"P({name} > {value}) = {chance(p, low, high, lacking, design.draws - n)}")
    if count > PRINTED:
        lines += ["", f"{count - PRINTED} more combinations of varied values are in the file"]
    return lines


def chance(p: float, low: float, high: float, is_open: int, lacking: int) -> str:
    """A probability, its interval and the number of draws without a value, in words."""
    text = f"{'open' if np.isnan(p) else f'{p:.5g}'} ({low:.5g} to {high:.5g})"
    if is_open:
        text += f"; {is_open} draws are open, counted as below and as above"
    if lacking > is_open:
        text += f"; {lacking - is_open} draws have no value"
    return text


def _index_lines(random: RandomResult, name: str, place: tuple[int, ...]) -> Iterator[str]:
    laws = random.design.laws
    width = max(12, *map(len, (name, *laws)))
    yield f"{name:{width}}{'first-order index (95 %)':>29}{'total index (95 %)':>29}"
    columns = [values[place].tolist() for values in random.sensitivity[name]]
    for law, first, total, *intervals in zip(laws, *columns, strict=True):
        texts = [
            f"{value:.4f} ({low:.4f} to {high:.4f})"
            for value, (low, high) in zip((first, total), intervals, strict=True)
        ]
        yield f"{law:{width}}{texts[0]:>29}{texts[1]:>29}"


def stored(random: RandomResult) -> Iterator[tuple[Any, ...]]:
    """Path, values, description, dimension and axes of every dataset of the file."""
    first = ("combinations",) if random.combinations else ()
    for name, made in random.statistics.items():
        text, dimension = COLUMNS.get(name, (name, ""))
        values = np.concatenate([np.stack(made[:3], axis=-1), made.quantiles], axis=-1)
        text = f"draws with a value, and their statistics: {text}"
        yield f"statistics/{name}", values, text, dimension, *first, "statistics"
    for name, found in random.sensitivity.items():
        for part, values in found._asdict().items():
            text, axes = PARTS[part]
            yield f"sensitivity/{name}/{part}", values, text, "", *first, *axes
    if len(random.exceedance.quantity):
        for part, values in random.exceedance._asdict().items():
            own = () if part in ("quantity", "limit") else first
            yield f"exceedance/{part}", values, LIMIT_PARTS[part], "", *own, "limits"


def attributes(random: RandomResult) -> dict[str, dict[str, Any]]:
    """Attributes of the groups of the file."""
    design = random.design
    empty = set() if random.sensitivity else {"sensitivity"}
    empty |= set() if len(random.exceedance.quantity) else {"exceedance"}
    made: dict[str, dict[str, Any]] = {
        name: {"description": text} for name, text in GROUPS.items() if name not in empty
    }
    about = {name: getattr(design, name) for name in ("kind", "samples", "seed", "sensitivity")}
    made["design"] |= {**about, "names": list(design.laws), "notes": random.notes}
    for name, law in design.laws.items():
        made[f"random/{name}"] = {"law": law.kind, "parameters": np.array(law.parameters)}
    return made


def random_of(
    contents: Contents, cases: Columns, quantities: Iterable[str], count: int
) -> RandomResult | None:
    """Results of a random sweep, None if it is none; ResultFileError if they are incomplete."""
    if "design" not in contents.groups:
        return None
    try:
        about, groups = contents.groups["design"], contents.groups
        owns = {name: groups[f"random/{name}"] for name in about["names"]}
        laws = {n: Law(str(o["law"]), tuple(map(float, o["parameters"]))) for n, o in owns.items()}
        kind = DESIGNS[DESIGNS.index(about["kind"])]
        samples, seed = int(about["samples"]), int(about["seed"])
        design = Design(laws, samples, seed, kind, bool(about["sensitivity"]))
        made = {n: v[:: design.rows] for n, v in cases.items() if n not in laws}
        first = (count // design.rows,) if made else ()
        sizes = {"laws": len(laws), "bounds": len(ENDS), "statistics": 3 + len(QUANTILES)}

        def read(path: str, *axes: str) -> Any:
            values = contents[path]
            if values.shape != (*first, *map(sizes.get, axes)) or values.dtype.kind != "f":
                raise ValueError(path)
            return values

        def statistics_of(name: str) -> Statistics:
            values = read(f"statistics/{name}", "statistics")
            draws, mean, deviation = np.moveaxis(values[..., :3], -1, 0)
            return Statistics(draws.astype(int), mean, deviation, values[..., 3:])

        known = [name for name in quantities if name not in VERDICTS]
        none = {name: np.empty((*first, 0)) for name in known}
        exceedance = _exceedance(none, np.empty((*first, 0), dtype=bool), [])
        if "exceedance/quantity" in contents:
            parts = {p: contents[f"exceedance/{p}"] for p in Exceedance._fields if p != "open"}
            missing = np.zeros_like(parts["draws"])  # in files of earlier versions
            exceedance = Exceedance(**parts, open=contents.get("exceedance/open", missing))
            shape = (*first, len(exceedance.quantity))
            if exceedance.limit.shape != shape[-1:] or {v.shape for v in exceedance[2:]} != {shape}:
                raise ValueError("exceedance")
        whole = count % design.rows == 0 if made else count == design.rows
        if not (whole and laws.keys() <= cases.keys()):
            raise ValueError("cases")
        return RandomResult(
            design,
            {name: statistics_of(name) for name in known},
            {name: Indices(*(read(f"sensitivity/{name}/{part}", *PARTS[part][1]) for part in PARTS))
             for name in known if design.sensitivity},
            exceedance, made, tuple(map(str, about["notes"])),
        )  # fmt: skip
    except (KeyError, ValueError, TypeError, AttributeError, ArithmeticError) as error:
        message = f"{contents.path}: the results of this random sweep are incomplete ({error})"
        raise ResultFileError(message) from None


class Indices(NamedTuple):
    """Sobol' indices of a quantity; with varied values, the combinations come first."""

    first: Floats  # (d,): first-order index of each random value
    total: Floats  # (d,): total index
    first_interval: Floats  # (d, 2): 95 % interval
    total_interval: Floats  # (d, 2)


class Statistics(NamedTuple):
    """Statistics of a quantity over the draws that have a value."""

    draws: NDArray[np.int64]  # number of them
    mean: Floats
    standard_deviation: Floats
    quantiles: Floats  # (5,): at the probabilities `QUANTILES`


def indices(values: Floats, seed: int) -> Indices:
    """Estimate the first-order and total Sobol' indices of quantities.

    `values` (m, d + 2, n) are those of the rows of A, B, and A with column i of B.  The indices are
    those of Saltelli et al., Computer Physics Communications 181 (2010) 259, table 2 (b) and (f);
    NaN of a quantity that is constant or lacks values.  The variance is that over A and B together.
    The values are taken relative to their mean there, which does not change the expected values.
    The intervals are percentiles of bootstraps over the rows of the matrices.
    """
    m, rows, n = values.shape
    d = rows - 2
    values = np.where(np.isfinite(values), values, np.nan)
    flat = values.reshape(m, -1)
    with np.errstate(invalid="ignore"):
        varies = np.ptp(flat[:, : 2 * n], axis=1) > ROUNDING * np.abs(flat).max(axis=1)
    centred = values - values[:, :2].mean(axis=(1, 2), keepdims=True)
    f_a, f_b, f_ab = centred[:, :1], centred[:, 1:2], centred[:, 2:]
    # Means of these columns make the indices: those of f, f^2, and the products, (m, 2 + 2 d, n).
    means = (f_a + f_b) / 2.0, (f_a**2 + f_b**2) / 2.0
    columns = np.concatenate([*means, f_b * (f_ab - f_a), (f_a - f_ab) ** 2 / 2.0], axis=1)
    columns[~varies] = np.nan

    def ratios(means: Floats) -> Floats:
        """First-order and total indices (..., m, 2 d) from means (..., m, 2 + 2 d)."""
        variance = means[..., 1] - means[..., 0] ** 2
        variance = np.where(variance > 0.0, variance, np.nan)  # else there are no indices
        return np.asarray(means[..., 2:] / variance[..., None])

    generator = np.random.default_rng([seed, 1])
    step = max(1, COUNTS // n)
    table = columns.reshape(-1, n).T
    resampled = np.concatenate([
        # einsum, because the last digits of a product by BLAS may depend on its threads
        np.einsum("rn,nm->rm", generator.multinomial(n, np.full(n, 1.0 / n), count) / n, table)
        for start in range(0, RESAMPLES, step)
        for count in [min(step, RESAMPLES - start)]
    ])  # fmt: skip
    found = ratios(columns.mean(axis=2))
    ends = np.moveaxis(np.quantile(ratios(resampled.reshape(-1, m, rows + d)), ENDS, axis=0), 0, 2)
    return Indices(found[:, :d], found[:, d:], ends[:, :d], ends[:, d:])


def statistics(values: Floats) -> Statistics:
    """Return the statistics of draws (..., n); NaN are left out."""
    kept = [row[np.isfinite(row)] for row in values.reshape(-1, values.shape[-1])]
    none = np.full(len(QUANTILES), np.nan)
    columns: tuple[list[Any], ...] = (
        [len(row) for row in kept],
        [row.mean() if len(row) else np.nan for row in kept],
        [row.std(ddof=1) if len(row) > 1 else np.nan for row in kept],
        [np.quantile(row, QUANTILES) if len(row) else none for row in kept],
    )
    arrays = map(np.array, columns)
    return Statistics(*(a.reshape((*values.shape[:-1], *a.shape[1:])) for a in arrays))


def bounds(hits: Counts, count: Counts, lacking: Counts) -> tuple[Floats, Floats, Floats]:
    """Probability from draws with a value, and the ends of an interval that holds for all draws.

    `hits` of `count` draws exceed a limit, and it is not known whether `lacking` more do.  The
    interval is Wilson's from its lower end, if none of them does, to its upper end, if all do.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = hits / count
    lower, _ = wilson(hits, count + lacking)
    _, upper = wilson(hits + lacking, count + lacking)
    return share, lower, upper


def wilson(hits: Counts, count: Counts) -> tuple[Floats, Floats]:
    """Ends of Wilson's 95 % interval of a probability (E. B. Wilson, JASA 22, 1927, 209)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = hits / count
        middle = share + Z**2 / (2.0 * count)
        half = Z * np.sqrt(share * (1.0 - share) / count + (Z / (2.0 * count)) ** 2)
        scale = 1.0 + Z**2 / count
        lower, upper = (middle - half) / scale, (middle + half) / scale
    return np.where(hits == 0, 0.0, lower), np.where(hits == count, 1.0, upper)
