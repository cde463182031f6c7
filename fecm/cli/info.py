"""``fecm info``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from fecm.cli.common import FILE_PATH, FORMAT_OPTION
from fecm.cli.isolation import reads
from fecm.results.hdf5_reader import Contents, read
from fecm.results.info import (
    DatasetInformation,
    GroupInformation,
    Information,
    information,
    summary_of_run,
)
from fecm.results.result import result_of
from fecm.results.schema import FORMAT, SWEEP, jsonable, printable, shown
from fecm.sweeps.result import summary, sweep_of

# Attributes of the file that have lines of their own.
TOLD = ("title", "mode", "slips", "fecm_version", "format", "format_version",
        "unit_length", "unit_force", "unit_time")  # fmt: skip

# Of these, what a sweep has as well.
IN_FRONT = ("title", "fecm_version", "format", "format_version")

PERMANENT = "permanent_indentation"


@click.command(short_help="Show what is in RESULT.")
@click.argument("result", type=FILE_PATH)
@FORMAT_OPTION
@reads("result")
def info(result: Path, form: str) -> None:
    """Show what is in RESULT, of a run or of a sweep: its units, its summary, every dataset."""
    contents = read(result, FORMAT, SWEEP)
    about = _of_sweep(contents) if contents.form == SWEEP else _of_run(contents)
    if about.get("still_in_contact") and PERMANENT in contents.groups["history"]:
        contents.groups["history"][PERMANENT] = math.nan  # it depends on the end of the contact
    told = information(contents)
    if form == "json":
        click.echo(json.dumps(jsonable(_json(told, about))))
    else:
        click.echo("\n".join(_lines(told, about)))


def _of_run(contents: Contents) -> dict[str, Any]:
    """Steps, first and last time, and summary of a run."""
    result = result_of(contents)
    steps, span = 0, None
    if "history/time" in result and (steps := len(times := result["history/time"])):
        span = float(times[0]), float(times[-1])
    return {
        "steps": steps,
        "time": span,
        "still_in_contact": result.still_in_contact,
        "summary": summary_of_run(result),
    }


def _of_sweep(contents: Contents) -> dict[str, Any]:
    """Cases, failed ones among them, and summary of a sweep."""
    result = sweep_of(contents, history=False)
    failed = len(result) - int(result.fine.sum())
    return {"cases": len(result), "failed": failed, "summary": summary(result)}


def _extent(about: Mapping[str, Any]) -> tuple[str, str]:
    """How much was computed."""
    if "cases" in about:
        return "cases", f"{about['cases']}, {about['failed'] or 'none'} failed"
    first_last = about["time"]
    span = f", time {first_last[0]:.6g} to {first_last[1]:.6g}" if first_last else ""
    return "steps", f"{about['steps']}{span}"


def _lines(told: Information, about: Mapping[str, Any]) -> list[str]:
    """The whole page."""
    attributes = told.attributes
    slips = attributes.get("slips", [])
    listed = ", ".join(map(str, slips)) if isinstance(slips, list) and slips else "none"
    of_a_run = [("mode", attributes.get("mode", "not told")), ("slips", listed)]
    units = ", ".join(f"{name} {unit}" for name, unit in told.units.items())
    rows = [
        ("file", f"{told.path}, {told.size} bytes"),
        *([] if "cases" in about else of_a_run),
        ("written by", f"fecm {attributes.get('fecm_version', 'of no version')}, "
                       f"format version {attributes.get('format_version')}"),
        ("units", units or "the deck names none"),
        _extent(about),
        *((name, shown(value)) for name, value in attributes.items() if name not in TOLD),
    ]  # fmt: skip
    lines = [printable(str(attributes.get("title", "") or "(no title)"))]
    lines += [f"  {printable(name):17} {printable(str(value))}" for name, value in rows]
    lines += ["", "summary", *(f"  {printable(line)}" for line in about["summary"])]
    for group in told.groups:
        lines += ["", *_group(group)]
    if told.texts:
        lines += ["", "texts"]
        lines += [f"  {printable(name):17} {count} lines" for name, count in told.texts.items()]
    return lines


def _group(group: GroupInformation) -> list[str]:
    """A group and a line for each of its datasets."""
    head = printable(group.name) or "/"
    if group.description:
        head += f": {printable(group.description)}"
    if group.rows is not None:
        head += f"; {group.rows} row{'s' * (group.rows != 1)}"
    attributes = [f"{printable(name)} = {shown(v)}" for name, v in group.attributes.items()]
    lines = [head, *(f"  {text}" for text in attributes)]
    cells = [_cells(dataset) for dataset in group.datasets]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row in cells:
        text = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        lines.append(f"  {text}".rstrip())
    return lines


def _cells(dataset: DatasetInformation) -> tuple[str, ...]:
    """Name, shape, type, dimension and unit, range."""
    name = dataset.path.rpartition("/")[2]
    dimension = dataset.dimension + (f" ({dataset.unit})" if dataset.unit else "")
    if dataset.different is not None:
        span = f"{dataset.different} different"
    elif dataset.minimum is None:
        span = "no finite number"
    else:
        span = f"{dataset.minimum:.6g} to {dataset.maximum:.6g}"
    if dataset.not_finite:
        span += f", {dataset.not_finite} not finite"
    shape = "x".join(map(str, dataset.shape)) or "single"
    return printable(name), shape, dataset.dtype, printable(dimension), span


def _json(told: Information, about: Mapping[str, Any]) -> dict[str, Any]:
    """Everything for programs."""
    attributes = told.attributes
    return {
        "file": printable(str(told.path)),
        "size": told.size,
        **{name: attributes.get(name) for name in (IN_FRONT if "cases" in about else TOLD[:6])},
        "units": told.units,
        **{name: value for name, value in about.items() if name != "summary"},
        "attributes": {n: v for n, v in attributes.items() if n not in TOLD},
        "summary": about["summary"],
        "groups": [
            {
                "name": group.name,
                "description": group.description,
                "rows": group.rows,
                "attributes": group.attributes,
                "datasets": [_entry(dataset) for dataset in group.datasets],
            }
            for group in told.groups
        ],
        "texts": {name: {"lines": count} for name, count in told.texts.items()},
    }


def _entry(dataset: DatasetInformation) -> dict[str, Any]:
    """One dataset for programs."""
    return {
        "name": dataset.path,
        "shape": dataset.shape,
        "dtype": dataset.dtype,
        "description": dataset.description,
        "dimension": dataset.dimension,
        "unit": dataset.unit,
        "min": dataset.minimum,
        "max": dataset.maximum,
        "not_finite": dataset.not_finite,
        "different": dataset.different,
    }
