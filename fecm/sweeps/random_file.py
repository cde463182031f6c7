"""Results of a random sweep in a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.results.errors import ResultFileError
from fecm.results.metrics import COLUMNS, VERDICTS
from fecm.sweeps.copula import correlation_of
from fecm.sweeps.distributions import Law, OwnLaw
from fecm.sweeps.outcome import Column
from fecm.sweeps.random import DESIGNS, Design
from fecm.sweeps.random_result import Columns, Exceedance, RandomResult, exceedances
from fecm.sweeps.statistics import INTERVAL_ENDS, QUANTILES, Indices, Statistics

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents

# Description and axes of the parts of the indices.
INDEX_PARTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "first": ("first-order Sobol' index of every random value", ("laws",)),
    "total": ("total Sobol' index of every random value", ("laws",)),
    "first_interval": ("its 95 % interval", ("laws", "bounds")),
    "total_interval": ("its 95 % interval", ("laws", "bounds")),
}
OWN = "own"  # instead of the name of a law: that of an object, of which the file has a text
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


class Dataset(NamedTuple):
    """A dataset of the file."""

    path: str
    values: Column
    text: str
    dimension: str
    axes: tuple[str, ...]


def stored(random: RandomResult) -> Iterator[Dataset]:
    """Every dataset of the file."""
    first = ("combinations",) if random.combinations else ()
    for name, made in random.statistics.items():
        text, dimension = COLUMNS.get(name, (name, ""))
        moments = np.stack([made.draws, made.mean, made.standard_deviation], axis=-1)
        values = np.concatenate([moments, made.quantiles], axis=-1)
        text = f"draws with a value, and their statistics: {text}"
        yield Dataset(f"statistics/{name}", values, text, dimension, (*first, "statistics"))
    for name, found in random.sensitivity.items():
        for part, values in found._asdict().items():
            text, axes = INDEX_PARTS[part]
            yield Dataset(f"sensitivity/{name}/{part}", values, text, "", (*first, *axes))
    if len(random.exceedance.quantity):
        for part, values in random.exceedance._asdict().items():
            own = () if part in ("quantity", "limit") else first
            yield Dataset(f"exceedance/{part}", values, LIMIT_PARTS[part], "", (*own, "limits"))


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
    if design.correlation:
        made["design"]["correlation"] = np.array(design.correlation)
    for name, law in design.laws.items():
        made[f"random/{name}"] = (
            {"law": law.kind, "parameters": np.array(law.parameters)}
            if isinstance(law, Law)
            else {"law": OWN, "text": law.text}
        )
    return made


def random_of(
    contents: Contents, cases: Columns, quantities: Iterable[str], count: int
) -> RandomResult | None:
    """Results of a random sweep, None if it is none; ResultFileError if they are incomplete."""
    if "design" not in contents.groups:
        return None
    try:
        design = _design(contents)
        combinations = {n: v[:: design.rows] for n, v in cases.items() if n not in design.laws}
        whole = count % design.rows == 0 if combinations else count == design.rows
        if not (whole and design.laws.keys() <= cases.keys()):
            raise ValueError("cases")
        first = (count // design.rows,) if combinations else ()
        known = [name for name in quantities if name not in VERDICTS]
        asked = known if design.sensitivity else []
        return RandomResult(
            design,
            {name: _statistics(contents, name, first) for name in known},
            {name: _indices(contents, name, first, len(design.laws)) for name in asked},
            _exceedance(contents, known, first),
            combinations,
            tuple(map(str, contents.groups["design"]["notes"])),
        )
    except (KeyError, ValueError, TypeError, AttributeError, ArithmeticError) as error:
        message = f"{contents.path}: the results of this random sweep are incomplete ({error})"
        raise ResultFileError(message) from None


def _design(contents: Contents) -> Design:
    groups = contents.groups
    about = groups["design"]
    laws: dict[str, Law | OwnLaw] = {}
    for name in about["names"]:
        law = groups[f"random/{name}"]
        if law["law"] == OWN:
            laws[name] = OwnLaw(str(law["text"]))
        else:
            laws[name] = Law(str(law["law"]), tuple(map(float, law["parameters"])))
    return Design(
        laws,
        samples=int(about["samples"]),
        seed=int(about["seed"]),
        kind=DESIGNS[DESIGNS.index(about["kind"])],
        sensitivity=bool(about["sensitivity"]),
        correlation=correlation_of([*laws], about["correlation"]) if "correlation" in about else (),
    )


def _numbers(contents: Contents, path: str, shape: tuple[int, ...]) -> Floats:
    """Numbers of a shape; ValueError if they are others."""
    values = contents[path]
    if values.shape != shape or values.dtype.kind != "f":
        raise ValueError(path)
    return values


def _statistics(contents: Contents, name: str, first: tuple[int, ...]) -> Statistics:
    values = _numbers(contents, f"statistics/{name}", (*first, 3 + len(QUANTILES)))
    draws, mean, deviation = np.moveaxis(values[..., :3], -1, 0)
    return Statistics(draws.astype(int), mean, deviation, values[..., 3:])


def _indices(contents: Contents, name: str, first: tuple[int, ...], laws: int) -> Indices:
    sizes = {"laws": laws, "bounds": len(INTERVAL_ENDS)}
    return Indices(*(
        _numbers(contents, f"sensitivity/{name}/{part}", (*first, *(sizes[axis] for axis in axes)))
        for part, (_, axes) in INDEX_PARTS.items()
    ))  # fmt: skip


def _exceedance(contents: Contents, known: Iterable[str], first: tuple[int, ...]) -> Exceedance:
    if "exceedance/quantity" not in contents:
        none = {name: np.empty((*first, 0)) for name in known}
        return exceedances(none, np.empty((*first, 0), dtype=bool), [])
    parts = {part: contents[f"exceedance/{part}"] for part in Exceedance._fields if part != "open"}
    missing = np.zeros_like(parts["draws"])  # in files of earlier versions
    found = Exceedance(**parts, open=contents.get("exceedance/open", missing))
    shape = (*first, len(found.quantity))
    if found.limit.shape != shape[-1:] or {values.shape for values in found[2:]} != {shape}:
        raise ValueError("exceedance")
    return found
