"""Reads results of sweeps from HDF5 files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fecm._typing import AnyFile
from fecm.deck.units import declared_units
from fecm.results import schema
from fecm.results.errors import ResultFileError
from fecm.results.metrics import SUMMARY, VALIDITY, VERDICTS
from fecm.sweeps import reduced_check
from fecm.sweeps.outcome import Column
from fecm.sweeps.random_file import random_of
from fecm.sweeps.result import SweepResult
from fecm.sweeps.result_writer import FORCE

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents


def load(path: str | Path | AnyFile) -> SweepResult:
    """Read the result of a sweep.

    Parameters
    ----------
    path : str, Path or file
        HDF5 file, or one that is open as bytes.

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
        unsettled_steps=steps.get("unsettled_steps"),
        deck_text=contents.texts.get("deck", ""),
        title=str(contents.attributes.get("title", "")),
        units=declared_units(contents.attributes),
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
