"""Writer of results of sweeps: HDF5 files, including random sweeps, and CSV tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._errors import ResultFileError
from fecm._files import beside
from fecm._text import Decimal, csv_lines
from fecm._typing import Floats
from fecm.authoring.values import dimension_of
from fecm.deck.units import column_name, unit_of
from fecm.results import schema
from fecm.results.groups import ExportError
from fecm.results.metrics import VERDICTS
from fecm.sweeps import reduced
from fecm.sweeps.distributions import CustomDistribution, ValueDistribution
from fecm.sweeps.outcome import CONVERTED, MEASURED, Column, Forces
from fecm.sweeps.random import DESIGNS, Design, correlation_of
from fecm.sweeps.statistics import (
    INTERVAL_ENDS,
    QUANTILES,
    Columns,
    Exceedance,
    Indices,
    QuantityStatistics,
    RandomResult,
    Statistics,
    exceedances,
)
from fecm.sweeps.stored import OWN_ARRAYS, StoredSweep

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import FileContents
    from fecm.results.hdf5_writer import FileSink


OWN = "own"  # in place of the name of a law: the law is an object, described by a text


def stored(random: RandomResult) -> Iterator[tuple[str, Column]]:
    """Yield paths and values of the datasets of a random sweep."""
    for name, statistics in random.statistics.items():
        moments = np.stack(
            [statistics.draws, statistics.mean, statistics.standard_deviation], axis=-1
        )
        yield f"statistics/{name}", np.concatenate([moments, statistics.quantiles], axis=-1)
    for name, indices in random.sensitivity.items():
        for part, values in indices._asdict().items():
            yield f"sensitivity/{name}/{part}", values
    if len(random.exceedance.quantity):
        for part, values in random.exceedance._asdict().items():
            yield f"exceedance/{part}", values


def random_attributes(random: RandomResult) -> dict[str, dict[str, Any]]:
    """Return the attributes of the groups of the file."""
    design = random.design
    about = {name: getattr(design, name) for name in ("kind", "samples", "seed", "sensitivity")}
    groups: dict[str, dict[str, Any]] = {
        "random": {},
        "design": {**about, "names": list(design.laws), "notes": random.notes},
    }
    if random.sensitivity:
        groups["sensitivity"] = {}
    if design.correlation:
        groups["design"]["correlation"] = np.array(design.correlation)
    for name, law in design.laws.items():
        groups[f"random/{name}"] = (
            {"law": law.kind, "parameters": np.array(law.parameters)}
            if isinstance(law, ValueDistribution)
            else {"law": OWN, "text": law.text}
        )
    return groups


def random_of(
    contents: FileContents, cases: Columns, quantities: Iterable[str], count: int
) -> RandomResult | None:
    """Read the results of a random sweep; None for other sweeps.

    Raises ResultFileError if the results are incomplete.
    """
    if "design" not in contents.groups:
        return None
    try:
        design = _design(contents)
        combinations = {n: v[:: design.rows] for n, v in cases.items() if n not in design.laws}
        whole = count % design.rows == 0 if combinations else count == design.rows
        if not (whole and design.laws.keys() <= cases.keys()):
            raise ValueError("cases")
        first = (count // design.rows,) if combinations else ()
        names = [name for name in quantities if name not in VERDICTS]
        asked = names if design.sensitivity else []
        return RandomResult(
            design,
            QuantityStatistics((name, _statistics(contents, name, first)) for name in names),
            {name: _indices(contents, name, first, len(design.laws)) for name in asked},
            _exceedance(contents, names, first),
            combinations,
            tuple(map(str, contents.groups["design"]["notes"])),
        )
    except (KeyError, ValueError, TypeError, AttributeError, ArithmeticError) as error:
        message = f"{contents.path}: the results of this random sweep are incomplete ({error})"
        raise ResultFileError(message) from None


def _design(contents: FileContents) -> Design:
    groups = contents.groups
    about = groups["design"]
    laws: dict[str, ValueDistribution | CustomDistribution] = {}
    for name in about["names"]:
        law = groups[f"random/{name}"]
        if law["law"] == OWN:
            laws[name] = CustomDistribution(str(law["text"]))
        else:
            laws[name] = ValueDistribution(str(law["law"]), tuple(map(float, law["parameters"])))
    return Design(
        laws,
        samples=int(about["samples"]),
        seed=int(about["seed"]),
        kind=DESIGNS[DESIGNS.index(about["kind"])],
        sensitivity=bool(about["sensitivity"]),
        correlation=correlation_of([*laws], about["correlation"]) if "correlation" in about else (),
    )


def _numbers(contents: FileContents, path: str, shape: tuple[int, ...]) -> Floats:
    """Return the numbers of a dataset; ValueError if it has another shape or type."""
    values = contents[path]
    if values.shape != shape or values.dtype.kind != "f":
        raise ValueError(path)
    return values


def _statistics(contents: FileContents, name: str, first: tuple[int, ...]) -> Statistics:
    values = _numbers(contents, f"statistics/{name}", (*first, 3 + len(QUANTILES)))
    draws, mean, deviation = np.moveaxis(values[..., :3], -1, 0)
    return Statistics(draws.astype(int)[()], mean[()], deviation[()], values[..., 3:])


def _indices(contents: FileContents, name: str, first: tuple[int, ...], laws: int) -> Indices:
    sizes: dict[str | int, int] = {"laws": laws, "bounds": len(INTERVAL_ENDS)}
    axes = (schema.SWEEP_DATASETS[f"sensitivity/*/{part}"].shape for part in Indices._fields)
    return Indices(*(
        _numbers(contents, f"sensitivity/{name}/{part}", (*first, *(sizes[axis] for axis in shape)))
        for part, shape in zip(Indices._fields, axes, strict=True)
    ))  # fmt: skip


def _exceedance(contents: FileContents, names: Iterable[str], first: tuple[int, ...]) -> Exceedance:
    if "exceedance/quantity" not in contents:
        none = {name: np.empty((*first, 0)) for name in names}
        return exceedances(none, np.empty((*first, 0), dtype=bool), [])
    parts = {part: contents[f"exceedance/{part}"] for part in Exceedance._fields if part != "open"}
    missing = np.zeros_like(parts["draws"])  # in files of earlier versions
    exceedance = Exceedance(**parts, open=contents.get("exceedance/open", missing))
    shape = (*first, len(exceedance.quantity))
    if exceedance.limit.shape != shape[-1:] or {values.shape for values in exceedance[2:]} != {
        shape
    }:
        raise ValueError("exceedance")
    return exceedance


FORCE = "history/force"


def save_sweep(result: StoredSweep, path: Path, *, overwrite: bool = True) -> None:
    """Write the result of a sweep.

    Raises ResultWriteError if the file can't be written; an existing file then stays unchanged.
    """
    with beside(path, overwrite=overwrite) as partial:
        write_sweep(result, partial, path)


def write_sweep(
    result: StoredSweep, partial: Path, path: Path, forces: Iterable[Forces] = ()
) -> None:
    """Write the result of a sweep to the partial file of its final name, from :func:`beside`.

    `forces` yields the forces that the result does not hold, for some cases at a time.
    """
    from fecm.results.hdf5_writer import result_at  # h5py takes 60 ms to import

    if result.force is not None:
        forces = [(range(len(result)), result.force)]
    with result_at(partial, path, schema.Form.SWEEP) as sink:
        units = {f"unit_{name}": unit for name, unit in result.units.items()}
        law = {"law": result.law} if result.law else {}
        sink.attributes("", schema.heading(schema.Form.SWEEP, result.title) | units | law)
        sink.deck(result.deck_text)
        if result.random is not None:
            sink.axis_names["laws"] = tuple(result.random.design.laws)
            for group, values in random_attributes(result.random).items():
                sink.attributes(group, values)
        for group in ("cases", "summary"):
            sink.attributes(group, {})
        for name, column in result.cases.items():
            sink.store(f"cases/{name}", column, dimension_of(name))
        for name, column in result.summary.items():
            sink.store(f"summary/{name}", column)
        if result.measured:
            sink.attributes("measured", result.measured_units)
        for name, column in result.measured.items():
            unit = result.measured_units.get(name, "")
            dimension = next((d for d in CONVERTED if unit_of(d, result.units) == unit), "")
            sink.store(f"measured/{name.removeprefix(MEASURED)}", column, dimension)
        for name in OWN_ARRAYS:
            if name != "force" and (column := getattr(result, name)) is not None:
                sink.store(f"history/{name}", column)
        if forces and len(result):
            _write_forces(sink, len(result), int(result.steps.max()), forces)
        for name, column in () if result.random is None else stored(result.random):
            sink.store(name, column)
        if result.reduced is not None:
            sink.attributes(reduced.GROUP, reduced.reduced_attributes(result.reduced))
            for name, column in result.reduced.columns.items():
                sink.store(f"{reduced.GROUP}/{name}", column)
        for name, limit in result.convergence.items():
            sink.attributes(f"convergence/{name}", vars(limit))


def _write_forces(sink: FileSink, count: int, longest: int, forces: Iterable[Forces]) -> None:
    """Write contact forces as they come, NaN where a case has none."""
    sink.create(schema.SWEEP_DATASETS[FORCE], (count, longest))
    for numbers, force in forces:
        rows = np.full((len(numbers), longest), np.nan)
        if force is not None:
            rows[:, : force.shape[1]] = force
        # Numbers without a gap are written at once.
        ends = np.flatnonzero(np.diff(numbers) != 1) + 1
        for start, block in zip([0, *ends.tolist()], np.split(rows, ends), strict=True):
            sink.write(FORCE, numbers[start], block)


CASES = "cases"
HISTORY = "history"


def sweep_csv_lines(
    sweep: StoredSweep, name: str = CASES, decimal: Decimal = "point"
) -> Iterator[str]:
    """Return the lines of a CSV table, with line ends.

    ``"cases"`` has the values and results of every case, ``"history"`` the contact force after
    every step of every case that was run.  Cases count from 0, steps from 1.  Units follow the
    names in the header.  Raises ExportError if there is no such table.
    """
    if name not in (CASES, HISTORY):
        raise ExportError(f"unknown table {name}; a sweep has {CASES} and {HISTORY}")
    if name == HISTORY and sweep.force is None:
        raise ExportError("the sweep has no stored forces; run it again with --history")
    return csv_lines(_case_rows(sweep) if name == CASES else _step_rows(sweep), decimal)


def _case_rows(sweep: StoredSweep) -> Iterator[Iterable[Any]]:
    columns = {**sweep.cases, **sweep.summary, **sweep.measured}
    texts = {name: columns.pop(name) for name in VERDICTS if name in columns}
    columns |= {"dt": sweep.dt, "steps": sweep.steps, **texts}
    yield ("case", *_headings(sweep, columns))
    yield from zip(range(len(sweep)), *(v.tolist() for v in columns.values()), strict=True)


def _headings(sweep: StoredSweep, names: Iterable[str]) -> list[str]:
    """Return the names of columns, with units."""
    return [column_name(name, sweep.unit(name)) for name in names]


def _step_rows(sweep: StoredSweep) -> Iterator[Iterable[Any]]:
    assert sweep.force is not None
    yield ("case", "step", column_name("time", sweep.unit("dt")), *_headings(sweep, ["force"]))
    for case in np.flatnonzero(sweep.completed).tolist():
        count = int(sweep.steps[case])
        times = np.add.accumulate(np.full(count, sweep.dt[case])).tolist()
        forces = sweep.force[case, :count].tolist()
        yield from zip([case] * count, range(1, count + 1), times, forces, strict=True)
