"""What a sweep has found, as plain values for JSON."""

from __future__ import annotations

from typing import Annotated, Any, TypedDict

from fecm._typing import FiniteFloat
from fecm.results.metrics import RATIO
from fecm.sweeps.reduced import ReducedModel
from fecm.sweeps.result import SweepResult
from fecm.sweeps.statistics import Exceedance, Indices, RandomResult, Statistics
from fecm.sweeps.summary import summary_of_sweep, sweep_verdict

CaseColumns = dict[str, list[FiniteFloat | str]]


class RandomJson(TypedDict):
    """Statistics of a random sweep in JSON."""

    samples: int
    seed: int
    laws: dict[str, str]
    combinations: Annotated[CaseColumns, "Varied values of the combinations; empty without."]
    statistics: Annotated[
        dict[str, Any], "By quantity; numbers, or lists with an item for each combination."
    ]
    sensitivity: Annotated[dict[str, Any], "Sobol' indices by quantity; empty unless asked for."]
    exceedance: Annotated[dict[str, Any], "Lists with an item for each limit."]


class ReducedJson(TypedDict):
    """Reduced model beside full runs in JSON."""

    modes: int
    limit: Annotated[float, "Largest relative difference that is allowed."]
    in_full: Annotated[int, "Number of cases that were run in full, as the model differs more."]
    cases: Annotated[list[int], "Cases that were also run in full."]
    differences: Annotated[
        CaseColumns, "Relative differences of the model from these full runs, by quantity."
    ]


class SweepJson(TypedDict):
    """Sweep in JSON."""

    title: str
    result: Annotated[str | None, "File of the result; null in memory."]
    cases: int
    failed: int
    answer: Annotated[str, "The summary in one line."]
    verdict: Annotated[str, "Numbers of cases that failed or are doubtful."]
    notes: list[str]
    units: Annotated[dict[str, str], "Units of the columns that have one."]
    values: Annotated[CaseColumns, "Varied values of every case, by name."]
    results: Annotated[CaseColumns, "Results of every case, by name."]
    convergence: Annotated[
        dict[str, Any], "Order, limit and band of a refinement study; empty for others."
    ]
    reduced: Annotated[ReducedJson | None, "Null unless the reduced model computed cases."]
    random: Annotated[RandomJson | None, "Null for a sweep without random values."]


def about_sweep(result: SweepResult, path: object = None) -> SweepJson:
    """Return answer, columns, statistics and notes of a sweep."""
    columns = {**result.cases, **result.measured}
    names = [*columns, *result.summary]
    return {
        "title": result.title,
        "result": None if path is None else str(path),
        "cases": len(result),
        "failed": len(result) - int(result.completed.sum()),
        "answer": summary_of_sweep(result).answer,
        "verdict": sweep_verdict(result),
        "notes": list(result.notes),
        "units": {name: unit for name in names if (unit := result.unit(name))},
        "values": {name: values.tolist() for name, values in columns.items()},
        "results": {name: values.tolist() for name, values in result.summary.items()},
        "convergence": {name: vars(study) for name, study in result.convergence.items()},
        "reduced": None if result.reduced is None else _about_reduced(result.reduced),
        "random": None if result.random is None else _about_random(result.random),
    }


def _about_reduced(model: ReducedModel) -> ReducedJson:
    """Return how far the model is from full runs."""
    names = ("peak_force", RATIO, *model.measured)
    return {
        "modes": model.modes,
        "limit": model.limit,
        "in_full": model.in_full,
        "cases": model.columns["case"].tolist(),
        "differences": {name: model.difference(name).tolist() for name in names},
    }


def _about_random(random: RandomResult) -> RandomJson:
    """Return design, statistics, indices and probabilities."""
    design = random.design
    return {
        "samples": design.samples,
        "seed": design.seed,
        "laws": {name: str(law) for name, law in design.laws.items()},
        "combinations": {name: values.tolist() for name, values in random.combinations.items()},
        "statistics": {name: _plain(values) for name, values in random.statistics.items()},
        "sensitivity": {name: _plain(values) for name, values in random.sensitivity.items()},
        "exceedance": _plain(random.exceedance),
    }


def _plain(values: Statistics | Indices | Exceedance) -> dict[str, Any]:
    """Return arrays by name as lists."""
    return {name: value.tolist() for name, value in values._asdict().items()}
