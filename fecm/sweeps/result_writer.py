"""Writes results of sweeps into HDF5 files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fecm._version import __version__
from fecm.results import schema
from fecm.results.metrics import COLUMNS, described
from fecm.sweeps import reduced_check
from fecm.sweeps.outcome import Column, Forces
from fecm.sweeps.random_file import attributes, stored
from fecm.sweeps.stored import StoredSweep
from fecm.sweeps.values import dimension_of

if TYPE_CHECKING:
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
    result: StoredSweep, path: Path, *, overwrite: bool = True, forces: Iterable[Forces] = ()
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
        if result.unsettled_steps is not None:
            text = "steps whose contact iteration did not converge"
            _write(sink, "history/unsettled_steps", result.unsettled_steps, text)
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


def _write_attributes(sink: FileSink, result: StoredSweep) -> None:
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
    sink.text("deck", result.deck_text, "the cards of the deck that was varied")
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
