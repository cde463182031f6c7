"""``fecm info``."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

import click
import h5py
import numpy as np

from fecm._inputs import lines_of
from fecm._machine import available_processors
from fecm._table import Summary, aligned
from fecm._text import printable, short_text
from fecm._version import __version__
from fecm.cli.common import echo, echo_json
from fecm.cli.isolation import reads
from fecm.cli.options import FORMAT_OPTION, NAMED_PATH, Format, typical
from fecm.deck.units import declared_units
from fecm.results.contents import GroupJson, describe_groups
from fecm.results.hdf5_reader import FileContents, read
from fecm.results.result import result_of
from fecm.results.schema import Form
from fecm.results.summary import RunJson, about_run

# Attributes of the file that are keys of the JSON output, of runs and of others.
RUN_KEYS = ("title", "mode", "slips", "fecm_version", "format", "format_version")
OTHER_KEYS = ("title", "fecm_version", "format", "format_version")

# Attributes of the file with lines of their own.
HEADING = (*RUN_KEYS, "unit_length", "unit_force", "unit_time", "notes")

PERMANENT = "permanent_indentation"


def _system(context: click.Context, _: object, asked: bool) -> None:
    if not asked:
        return
    # 10 ms each, which a description does not need.
    import scipy

    from fecm.mechanics import kernels

    for name, text in (
        ("fecm", __version__),
        ("kernels", kernels.description()),
        ("Python", f"{platform.python_version()}, {platform.system()} {platform.machine()}"),
        ("NumPy", np.__version__),
        ("SciPy", scipy.__version__),
        ("h5py", f"{h5py.__version__}, HDF5 {h5py.version.hdf5_version}"),
        ("cores", str(available_processors())),
    ):
        click.echo(f"{name:9} {text}")
    context.exit()


@click.command(
    "info",
    short_help="Describe the contents of RESULT.",
    epilog=typical(
        "fecm info impact-patch.h5",
        "fecm info impact-patch.h5 --format json",
    ),
)
@click.argument("result", type=NAMED_PATH)
@click.option(
    "--system",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_system,
    help="Show the versions in use instead, and whether the kernels are compiled.",
)
@FORMAT_OPTION
@reads("result")
def info_command(result: Path, form: Format) -> None:
    """Describe units, summary and every dataset of RESULT, of a run, a sweep or a location."""
    contents = read(result, *Form)
    with contents.held():
        about = _about(contents)
    if form is Format.JSON:
        echo_json(about)
    else:
        echo("\n".join(_page(about)))


class FileJson(TypedDict):
    """File of a run, a sweep or a location in JSON."""

    file: str
    size: int
    title: str | None
    fecm_version: str | None
    format_version: int
    units: Annotated[dict[str, str], "Names of the units; empty if the deck names none."]
    attributes: dict[str, Any]
    groups: list[GroupJson]
    texts: dict[str, TextJson]


class TextJson(TypedDict):
    """Text of a file in JSON."""

    lines: int


class RunFileJson(FileJson, RunJson):
    """File of a run in JSON."""

    format: Literal[Form.RUN]
    mode: str | None
    slips: list[str] | None


class SweepFileJson(FileJson):
    """File of a sweep in JSON."""

    format: Literal[Form.SWEEP]
    answer: Annotated[str, "The summary in one line."]
    summary: list[str]
    cases: int
    failed: int


class LocationFileJson(FileJson):
    """File of a location in JSON."""

    format: Literal[Form.LOCATION]
    answer: Annotated[str, "The summary in one line."]
    summary: list[str]


def _about(contents: FileContents) -> dict[str, Any]:
    """Return what is shown, under the keys of the JSON output."""
    if contents.form == Form.SWEEP:
        extent: dict[str, Any] = _about_sweep(contents)
    elif contents.form == Form.LOCATION:
        # 5 ms, which the result of a run does not need.
        from fecm.location.location import location_of, summary_of_location

        extent = _answer_and_lines(summary_of_location(location_of(contents)))
    else:
        extent = {**about_run(result_of(contents))}
    if extent.get("still_in_contact") and PERMANENT in contents.groups["history"]:
        contents.groups["history"][PERMANENT] = math.nan  # unknown before the end of the contact
    attributes, lines, answer = (
        contents.attributes,
        extent.pop("summary"),
        extent.pop("answer"),
    )
    return {
        "file": printable(str(contents.path)),
        "size": contents.path.stat().st_size,
        **{
            name: attributes.get(name)
            for name in (RUN_KEYS if contents.form == Form.RUN else OTHER_KEYS)
        },
        "units": declared_units(attributes),
        **extent,
        "attributes": {n: value for n, value in attributes.items() if n not in HEADING},
        "answer": answer,
        "summary": lines,
        "groups": describe_groups(contents),
        "texts": {n: {"lines": len(lines_of(text))} for n, text in contents.texts.items()},
    }


def _about_sweep(contents: FileContents) -> dict[str, Any]:
    """Return the number of cases, and the summary."""
    # 48 ms, which the result of a run does not need.
    from fecm.sweeps.result import sweep_of
    from fecm.sweeps.summary import summary_of_sweep

    sweep = sweep_of(contents, history=False)
    failed = len(sweep) - int(sweep.completed.sum())
    return {"cases": len(sweep), "failed": failed, **_answer_and_lines(summary_of_sweep(sweep))}


def _answer_and_lines(summary: Summary) -> dict[str, object]:
    """Return the answer of a summary, and the lines of its groups."""
    return {"answer": summary.answer, "summary": [*summary.lines()]}


def _page(about: Mapping[str, Any]) -> list[str]:
    """Return the lines of the text output."""
    rows = [("file", f"{about['file']}, {about['size']} bytes")]
    if about["format"] == Form.SWEEP:
        extent = [("cases", f"{about['cases']}, {about['failed'] or 'none'} failed")]
    elif about["format"] == Form.RUN:
        slips = about["slips"] if isinstance(about["slips"], list) else []
        mode, span = about["mode"], about["time"]
        rows.append(("mode", "unknown" if mode is None else mode))
        rows.append(("slips", ", ".join(map(str, slips)) or "none"))
        times = f", time {span[0]:.6g} to {span[1]:.6g}" if span else ""
        extent = [("steps", f"{about['steps']}{times}")]
    else:
        extent = []
    version = about["fecm_version"]
    units = ", ".join(f"{name} {unit}" for name, unit in about["units"].items())
    rows += [
        (
            "written by",
            f"fecm {'of unknown version' if version is None else version}, "
            f"format version {about['format_version']}",
        ),
        ("units", units or "the deck names none"),
        *extent,
        *(("note", text) for text in about.get("notes", ())),
        *((name, short_text(value)) for name, value in about["attributes"].items()),
    ]
    lines = [printable(str(about["title"] or "(no title)"))]
    lines += [f"  {printable(name):17} {printable(str(value))}" for name, value in rows]
    summary = dict.fromkeys([about["answer"], *about["summary"]])  # the answer may be all
    lines += ["", "summary", *(f"  {printable(line)}".rstrip() for line in summary)]
    for group in about["groups"]:
        lines += ["", *_group(group)]
    lines += ["", "texts"] if about["texts"] else []
    for name, text in about["texts"].items():
        lines.append(f"  {printable(name):17} {text['lines']} lines")
    return lines


def _group(group: Mapping[str, Any]) -> list[str]:
    """Return a heading of a group, and one line for each of its datasets."""
    head = printable(group["name"]) or "/"
    if group["description"]:
        head += f": {printable(group['description'])}"
    if group["rows"] is not None:
        head += f"; {group['rows']} row{'s' * (group['rows'] != 1)}"
    attributes = [f"{printable(name)} = {short_text(v)}" for name, v in group["attributes"].items()]
    datasets = aligned([_cells(dataset) for dataset in group["datasets"]])
    return [head, *(f"  {text}" for text in (*attributes, *datasets))]


def _cells(dataset: Mapping[str, Any]) -> tuple[str, ...]:
    """Return name, shape, type, dimension and unit, and range."""
    name = dataset["name"].rpartition("/")[2]
    dimension = dataset["dimension"] + (f" ({dataset['unit']})" if dataset["unit"] else "")
    if dataset["different"] is not None:
        span = f"{dataset['different']} different"
    elif dataset["min"] is None:
        span = "no finite number"
    else:
        span = f"{dataset['min']:.6g} to {dataset['max']:.6g}"
    if dataset["not_finite"]:
        span += f", {dataset['not_finite']} not finite"
    shape = "x".join(map(str, dataset["shape"])) or "single"
    return printable(name), shape, dataset["dtype"], printable(dimension), span
