"""Results of sweeps in HDF5 files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fecm._version import __version__
from fecm.results import schema
from fecm.results.errors import ResultFileError
from fecm.results.metrics import COLUMNS, SUMMARY, VALIDITY, VERDICTS, described
from fecm.sweeps import reduced_check
from fecm.sweeps.outcome import Column, Forces
from fecm.sweeps.random_file import attributes, random_of, stored
from fecm.sweeps.result import SweepResult
from fecm.sweeps.values import dimension_of

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents
    from fecm.results.hdf5_writer import FileSink

FORCE = "history/force"
VERDICT_TEXTS = {
    "status": "ok, still in contact, or why the case failed",
    "validity": "ok, reasons to doubt the case, or failed",
}
GROUPS = {
    "cases": "values of what varies",
    "summary": "what came out of every case",
    "history": "time steps of every case, and its contact force if asked for",
}


def save(
    result: SweepResult, path: Path, *, overwrite: bool = True, forces: Iterable[Forces] = ()
) -> None:
    """Write the result of a sweep.

    `forces` are those that the result does not hold, of some cases after the other.  Raises
    ResultWriteError if the file cannot be written; an existing file is then unchanged.
    """
    from fecm.results.hdf5_writer import writing  # h5py takes 60 ms to import

    if result.force is not None:
        forces = [(range(len(result)), result.force)]
    with writing(path, overwrite=overwrite) as sink:
        _write_attributes(sink, result)
        for name, values in result.cases.items():
            text = f"{name} of every case"
            _write(sink, f"cases/{name}", values, text, dimension_of(name))
        for name, values in result.summary.items():
            text = VERDICT_TEXTS.get(name) or described(name)
            _, dimension = COLUMNS.get(name, ("", ""))
            _write(sink, f"summary/{name}", values, text, dimension)
        _write(sink, "history/dt", result.dt, "time step of every case", "time")
        _write(sink, "history/steps", result.steps, "number of steps of every case")
        if result.unconverged_steps is not None:
            text = "steps whose contact iteration did not converge"
            _write(sink, "history/unsettled_steps", result.unconverged_steps, text)
        if forces and len(result):
            _write_forces(sink, len(result), int(result.steps.max()), forces)
        for one in () if result.random is None else stored(result.random):
            _write(sink, one.path, one.values, one.text, one.dimension, one.axes)
        if result.reduced is not None:
            sink.attributes(reduced_check.GROUP, reduced_check.attributes(result.reduced))
            for name, text in reduced_check.TEXTS.items():
                values = result.reduced.columns[name]
                dimension = reduced_check.DIMENSIONS.get(name, "")
                place = f"{reduced_check.GROUP}/{name}"
                _write(sink, place, values, text, dimension, ("trials",))
        for group, text in GROUPS.items():
            sink.attributes(group, {"description": text})
        for name, limit in result.convergence.items():
            sink.attributes(f"convergence/{name}", vars(limit))


def _write_attributes(sink: FileSink, result: SweepResult) -> None:
    """Write what is known of the sweep, its deck, and the groups of a random sweep."""
    about = {
        "format": schema.Form.SWEEP.value,
        "format_version": schema.FORMAT_VERSION,
        "fecm_version": __version__,
        "title": result.title,
    }
    units = {f"unit_{name}": unit for name, unit in result.units.items()}
    law = {"law": result.law} if result.law else {}
    sink.attributes("", about | units | law)
    sink.text("deck", result.deck, "the cards of the deck that was varied")
    if result.random is not None:
        sink.axis_names["laws"] = tuple(result.random.design.laws)
        for group, values in attributes(result.random).items():
            sink.attributes(group, values)


def _write(
    sink: FileSink,
    name: str,
    values: Column,
    text: str,
    dimension: str = "",
    axes: tuple[str, ...] = ("cases",),
) -> None:
    """Write a dataset of numbers or of texts."""
    if values.dtype.kind in "US":
        sink.text(name, values.tolist(), text, axes)
        return
    dtype = "i8" if values.dtype.kind in "iu" else "f8"
    sink.create(schema.Dataset(name, axes, text, dimension, dtype), values.shape)
    sink.write(name, 0, values)


def _write_forces(sink: FileSink, count: int, longest: int, forces: Iterable[Forces]) -> None:
    """Write contact forces as they come, NaN where a case has none."""
    text = "contact force after every step"
    sink.create(schema.Dataset(FORCE, ("cases", "steps"), text, "force"), (count, longest))
    for numbers, force in forces:
        rows = np.full((len(numbers), longest), np.nan)
        if force is not None:
            rows[:, : force.shape[1]] = force
        # Numbers without a gap are written at once.
        ends = np.flatnonzero(np.diff(numbers) != 1) + 1
        for start, some in zip([0, *ends.tolist()], np.split(rows, ends), strict=True):
            sink.write(FORCE, numbers[start], some)


def load(path: Path) -> SweepResult:
    """Read the result of a sweep.

    Raises
    ------
    ResultFileError
        If the file is not the result of a sweep.
    OSError
        If the file cannot be opened.
    """
    from fecm.results.hdf5_reader import read  # h5py takes 60 ms to import

    return sweep_of(read(path, schema.Form.SWEEP))


def sweep_of(contents: Contents, *, history: bool = True) -> SweepResult:
    """Create the result of a sweep from the contents of its file.

    Without `history` the forces, which may be large, are not read.  Raises ResultFileError if data
    are missing, or their number of cases differs.
    """
    path = contents.path
    cases, summary = _group(contents, "cases/"), _group(contents, "summary/")
    given = ("dt", "steps", "unsettled_steps")
    steps = {n: contents[f"history/{n}"] for n in given if f"history/{n}" in contents}
    required = (*SUMMARY, "status")
    if not (summary.keys() >= {*required} and steps.keys() >= {"dt", "steps"}):
        raise ResultFileError(f"{path}: the result of the sweep is incomplete")
    summary = {name: summary[name] for name in required} | summary  # in their order
    shape = contents.shapes.get(FORCE)
    if not _agree(cases, summary, steps, shape):
        message = f"{path}: the data of this sweep do not match in type or number of cases"
        raise ResultFileError(message)
    counts, most = steps["steps"], np.inf if shape is None else shape[1]
    if counts.dtype.kind not in "iu" or not ((counts >= 0) & (counts <= most)).all():
        raise ResultFileError(f"{path}: history/steps does not match the stored steps")
    return SweepResult(
        cases=cases,
        summary=summary,
        dt=steps["dt"],
        steps=counts,
        force=contents.get(FORCE) if history else None,
        unconverged_steps=steps.get("unsettled_steps"),
        deck=contents.texts.get("deck", ""),
        title=str(contents.attributes.get("title", "")),
        units=schema.declared_units(contents.attributes),
        random=random_of(contents, cases, summary, len(steps["dt"])),
        reduced=reduced_check.reduced_of(contents),
        law=str(contents.attributes.get("law", "")),
    )


def _group(contents: Contents, group: str) -> dict[str, Column]:
    """The datasets of a group by their names, numbers before texts."""
    names = sorted(contents, key=lambda name: name in contents.lists)
    return {name.removeprefix(group): contents[name] for name in names if name.startswith(group)}


def _agree(
    cases: dict[str, Column],
    summary: dict[str, Column],
    steps: dict[str, Column],
    forces: tuple[int, ...] | None,
) -> bool:
    """Whether all datasets have one value for every case, and of their kind."""
    count = np.shape(steps["dt"])[:1]
    if any(v.shape != count for v in (*cases.values(), *summary.values(), *steps.values())):
        return False
    if forces is not None and (len(forces) != 2 or forces[:1] != count):
        return False
    if any(v.dtype.kind not in "fiu" for name, v in summary.items() if name not in VERDICTS):
        return False
    validity = summary.get(VALIDITY)
    return validity is None or not validity.size or validity.dtype.kind == "U"
