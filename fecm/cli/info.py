"""``fecm info``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fecm.cli.apart import reads
from fecm.cli.common import FILE_PATH, FORMAT_OPTION
from fecm.results.plain import jsonable, printable, shown

if TYPE_CHECKING:
    from fecm.results.information import DatasetInformation, GroupInformation, Information

# Attributes of the file that have lines of their own.
TOLD = ("title", "mode", "slips", "fecm_version", "format", "format_version",
        "unit_length", "unit_force", "unit_time")  # fmt: skip


@click.command()
@click.argument("result", type=FILE_PATH)
@FORMAT_OPTION
@reads("result")
def info(result: Path, form: str) -> None:
    """Tell what is in RESULT: the run, its units and summary, and every group and dataset."""
    from fecm.results.information import information

    told = information(result)
    if form == "json":
        click.echo(json.dumps(jsonable(_json(told))))
    else:
        click.echo("\n".join(_lines(told)))


def _lines(told: Information) -> list[str]:
    """The whole page."""
    attributes = told.attributes
    slips = attributes.get("slips", [])
    units = ", ".join(f"{name} {unit}" for name, unit in told.units.items())
    span = f", time {told.time[0]:.6g} to {told.time[1]:.6g}" if told.time else ""
    rows = [
        ("file", f"{told.path}, {told.size} bytes"),
        ("mode", attributes.get("mode", "not told")),
        ("slips", ", ".join(map(str, slips)) if isinstance(slips, list) and slips else "none"),
        ("written by", f"fecm {attributes.get('fecm_version', 'of no version')}, "
                       f"format version {attributes.get('format_version')}"),
        ("units", units or "the deck names none"),
        ("steps", f"{told.steps}{span}"),
        *((name, shown(value)) for name, value in attributes.items() if name not in TOLD),
    ]  # fmt: skip
    lines = [printable(str(attributes.get("title", "") or "(no title)"))]
    lines += [f"  {printable(name):17} {printable(str(value))}" for name, value in rows]
    lines += ["", "summary", *(f"  {printable(line)}" for line in told.summary)]
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
    if dataset.minimum is None:
        span = "no finite number"
    else:
        span = f"{dataset.minimum:.6g} to {dataset.maximum:.6g}"
    if dataset.not_finite:
        span += f", {dataset.not_finite} not finite"
    shape = "x".join(map(str, dataset.shape)) or "single"
    return printable(name), shape, dataset.dtype, printable(dimension), span


def _json(told: Information) -> dict[str, Any]:
    """Everything for programs."""
    attributes = told.attributes
    return {
        "file": printable(str(told.path)),
        "size": told.size,
        **{name: attributes.get(name) for name in TOLD[:6]},
        "units": told.units,
        "steps": told.steps,
        "time": told.time,
        "attributes": {n: v for n, v in attributes.items() if n not in TOLD},
        "summary": told.summary,
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
    }
