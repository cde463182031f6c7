"""Result of a sweep: values and results of every case, in memory or in a file."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from fecm._errors import did_you_mean
from fecm._tables import html_table
from fecm._version import __version__
from fecm.deck.model import Delamination
from fecm.deck.reader import Reader
from fecm.deck.units import quantity, unit_names, unit_of
from fecm.results import schema
from fecm.results.errors import ExportError, NotStoredError, ResultFileError
from fecm.results.linear_plate import TOO_SOFT, UNSAFE, InPlane, softness
from fecm.results.metrics import (
    COLUMNS,
    FOUND,
    RATIO,
    SUMMARY,
    THRESHOLD,
    VALIDITY,
    VERDICTS,
    described,
)
from fecm.results.pictures import plot
from fecm.results.validity import BENT, MEANING, counted
from fecm.sweeps.cases import REFINE, pair
from fecm.sweeps.convergence import Convergence, convergence
from fecm.sweeps.plan import RUN, Forces, Outcome, Plan, Status
from fecm.sweeps.random_result import (
    RandomResult,
    attributes,
    evaluate,
    open_ends,
    random_of,
    stored,
)

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

    from fecm.results.hdf5_reader import Contents

Array = NDArray[Any]
WEIGHED = ("mass", "rod_mass", "energy")  # values that the summary shows in g and J
WORDS = 18  # letters of the names in the lines of the summary
SAME = 1e-9  # distance from the place given, relative to its coordinates, that is rounding
FORCE = "history/force"
DIGITS = 6  # of the values of a case, unless others are closer
LISTED = 5  # reasons of failure that the summary lists
TEXTS_OF = {
    "status": "ok, still in contact, or why the case failed",
    "validity": "ok, reasons to doubt the case, or failed",
}
DIMENSIONS = {  # of the values, and of the stored force
    "velocity": "length/time", "energy": "force*length", "force": "force",
    "k": "force/length^1.5",
    **dict.fromkeys(("thickness", "laminate_thickness", "ply_thickness"), "length"),
    **dict.fromkeys(("alpha_p", "radius", "rod_length", "patch", "x0", "y0"), "length"),
    **dict.fromkeys(("mass", "rod_mass"), "force*time^2/length"),
    **dict.fromkeys(("density", "rod_density"), "force*time^2/length^4"),
    **dict.fromkeys(("e1", "e2", "g12", "g13", "g23", "rod_modulus"), "force/length^2"),
    **dict.fromkeys(("dt", "duration"), "time"),
}  # fmt: skip
GROUPS = {  # of the file
    "cases": "values of what varies",
    "summary": "what came out of every case",
    "history": "time steps of every case, and its contact force if asked for",
}
FORMULA = re.compile(r"[=+@\x00-\x1f-]")  # how a formula begins
CASES, HISTORY = "cases", "history"  # tables of the CSV export


def summary(result: SweepResult) -> list[str]:
    """Return summary lines: number of cases, smallest and largest peak or velocity, failures."""
    fine = result.fine
    lines = [f"cases             {len(result)}"]
    word, names = "peak", ["peak_force"]
    if "found_velocity" in result.summary:
        word, names = "found", ["found_velocity", "found_energy"]
    shown = np.where(fine, result[names[0]], np.nan)
    if np.isfinite(shown).any():
        digits = 8 if word == "found" else 6
        for size, case in (("smallest", np.nanargmin(shown)), ("largest", np.nanargmax(shown))):
            texts = [quantity(result[n][case], result.unit(n), digits) for n in names]
            values = ", ".join(f"{name} {_shown(result, name, int(case))}" for name in result.cases)
            given = f" ({values})" if values else ""
            lines.append(f"{size} {word:{16 - len(size)}} {', '.join(texts)}{given}")
    if "at" in result.cases and "hit_x" in result.summary:
        asked = np.array([pair("at", text) for text in result.cases["at"].tolist()]).T
        moved = np.hypot(*(asked - (result["hit_x"], result["hit_y"])))
        if count := np.count_nonzero(moved > SAME * np.abs(asked).max()):
            distance = f"{np.nanmax(moved):.4g} {result.unit('hit_x')}".rstrip()
            lines.append(f"moved             {count}: to the nearest node, up to {distance} away")
    failed = Counter(result["status"][~fine].tolist())
    for reason, times in failed.most_common(LISTED):
        lines.append(f"failed            {times}: {reason}")
    if (others := len(failed) - LISTED) > 0:
        lines.append(f"failed            for {others} other reason{'s' * (others > 1)}")
    if result.random is not None and failed:
        lines.append(f"failed share      {(~fine).mean():.3%} of the draws")
    return lines


def _shown(result: SweepResult, name: str, case: int) -> str:
    """Value of a case with six digits, or as many as tell it from those that are not random."""
    values = result.cases[name]
    if values.dtype.kind != "f":
        return str(values[case])
    digits = DIGITS
    if result.random is None:
        size = max(abs(float(values[case])), 1e-300)
        others = np.abs(values[values != values[case]] - values[case])
        gap = float(np.min(others / size, initial=1.0))
        digits = min(max(DIGITS, 1 - math.floor(math.log10(gap))), 17)
    return quantity(values[case], result.unit(name) if name in WEIGHED else "", digits)


def verdict(result: SweepResult) -> str:
    """Count the cases, the failures, and the cases with doubtful results."""
    found = ", ".join(f"{count} {what}" for count, what in _counts(result))
    return f"{len(result)} case{'' if len(result) == 1 else 's'}: {found or 'all ok'}"


def reasons(status: Array) -> str:
    """The most common reason of failure, and the number of others."""
    (first, _), *others = Counter(status.tolist()).most_common()
    more = f", and {len(others)} other reason{'s' * (len(others) > 1)}" if others else ""
    return f"{first}{more}"


def _counts(result: SweepResult) -> list[tuple[int, str]]:
    """Numbers of cases with doubtful results and of failures, which are last."""
    fine, steps = result.fine, result.unconverged_steps
    unconverged = np.zeros_like(fine) if steps is None else fine & (steps > 0)
    cases = {
        "still in contact at the end": result.still,
        **_doubts(result),
        "with a contact iteration that did not converge": unconverged,
        "failed": ~fine,
    }
    return [(int(some.sum()), what) for what, some in cases.items() if some.any()]


def _doubts(result: SweepResult) -> dict[str, NDArray[np.bool_]]:
    """Cases beyond the range of the model, by what they are."""
    found = {}
    for reason, some in counted(result.validity):
        what = MEANING[reason]
        if reason in BENT.values():
            ratio = result.summary.get(RATIO, np.full(len(some), np.nan))[some]
            if np.isfinite(ratio).any():
                what = f"{what[:-1]}, up to {np.nanmax(ratio):.3g} h)"
        found[what] = some
    return found


def remarks(result: SweepResult) -> Iterator[str]:
    """What open values and cases beyond the linear plate mean, and what helps."""
    is_open = result.fine & ~result.over
    if is_open.any():
        duration = 2.0 * float((result.dt * result.steps)[is_open].max())
        yield (
            f"{is_open.sum()} of {len(result)} cases end before their contact does: what comes "
            f"after is open; a longer run decides it, as with --vary duration={duration:.3g}"
        )
    bent = [reason for reason, _ in counted(result.validity) if reason in BENT.values()]
    if bent:
        held = any(reason != BENT[InPlane.FREE] for reason in bent)
        ratio = result.summary.get(RATIO, np.full(1, np.nan))
        size = ""
        if np.isfinite(ratio).any():
            largest = float(np.nanmax(ratio))
            in_plane = InPlane.UNKNOWN if held else InPlane.FREE
            size = f" (at w = {largest:.3g} h {softness(largest, in_plane)})"
        yield f"beyond its range {TOO_SOFT}{size}; {UNSAFE}"


@dataclass(repr=False)
class SweepResult:
    """Result of a sweep.

    Attributes
    ----------
    cases : dict of ndarray (n,)
        Values of every case, by name.
    summary : dict of ndarray (n,)
        Results of every case; ``status``: ``"ok"``, ``"still in contact"``, or the reason for the
        failure; and ``validity``: ``"ok"``, the reasons to doubt the case, or ``"failed"``.
    dt, steps : ndarray (n,)
        Time step and number of steps of every case.
    force : ndarray (n, steps) or None
        Contact force after every step, NaN after the last step; None unless requested.
    unconverged_steps : ndarray (n,) or None
        Steps whose contact iteration did not converge; None if the file does not contain them.
    deck : str
        Text of the deck.
    title : str
        Title of the deck.
    units : dict
        Names of the units; empty if the deck states none.
    random : RandomResult or None
        Statistics, sensitivity indices and probabilities of a random sweep.
    """

    cases: dict[str, Array]
    summary: dict[str, Array]
    dt: Array
    steps: Array
    force: Array | None = None
    unconverged_steps: Array | None = None
    deck: str = ""
    title: str = ""
    units: dict[str, str] = field(default_factory=dict)
    random: RandomResult | None = None

    def __len__(self) -> int:
        return len(self.dt)

    def __repr__(self) -> str:
        return f"<fecm sweep {self.title!r} over {', '.join(self.cases)}: {verdict(self)}>"

    def _repr_html_(self) -> str:
        """Table of the summary, for notebooks."""
        lines = ((line[:WORDS].strip(), line[WORDS:]) for line in summary(self))
        return html_table(repr(self)[1:-1], lines)

    def __getitem__(self, name: str) -> Array:
        """Values or results of every case, by name."""
        if name in self.cases:
            return self.cases[name]
        if name not in self.summary:
            names = [*self.cases, *self.summary]
            others = did_you_mean(name, names) or f"; there are {', '.join(names)}"
            raise NotStoredError(f"there is no {name} in this sweep{others}")
        return self.summary[name]

    @property
    def fine(self) -> NDArray[np.bool_]:
        """Cases that were run."""
        return np.isin(self.summary["status"], RUN)

    @property
    def still(self) -> NDArray[np.bool_]:
        """Cases that were run and ended in contact."""
        return np.asarray(self.summary["status"] == Status.STILL)

    @property
    def validity(self) -> Array:
        """``"ok"``, reasons to doubt a case, or ``"failed"``; of earlier files empty texts."""
        return self.summary.get(VALIDITY, np.full(len(self), ""))

    @property
    def over(self) -> NDArray[np.bool_]:
        """Cases that were run until their contact was over."""
        return self.fine & ~open_ends(self.summary)

    @property
    def convergence(self) -> dict[str, Convergence]:
        """Order, limit and band of every quantity of a refinement study; empty for others."""
        if REFINE not in self.cases:
            return {}
        # The text of a file, which is no path even if it is one line.
        decks = (problem.deck for problem in Reader(self.deck).problems())
        nodes = next((deck.control.nen for deck in decks if deck is not None), 0)
        return convergence(self.cases, self.summary, nodes)

    @property
    def notes(self) -> tuple[str, ...]:
        """Numbers of cases that failed or whose results are doubtful."""
        texts = [f"{count} of {len(self)} cases {what}" for count, what in _counts(self)]
        if not self.fine.all():
            texts[-1] += f": {reasons(self['status'][~self.fine])}"
        return (*texts, *remarks(self), *(() if self.random is None else self.random.notes))

    def unit(self, name: str) -> str:
        """Return the unit of a value or result; empty if the deck states none."""
        dimension = COLUMNS[name][1] if name in COLUMNS else DIMENSIONS.get(name, "")
        return unit_of(dimension, self.units)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return values and results as a table with one row per case (requires pandas)."""
        import pandas

        table = pandas.DataFrame({**self.cases, **self.summary})
        table.index.name = "case"
        return table

    def to_xarray(self) -> xarray.Dataset:
        """Return values and results as labelled arrays (requires xarray).

        A full grid has one dimension per name of its values, which are the coordinates: numbers in
        ascending order, texts in the order of the cases.  Other cases have the dimension ``case``.
        The last dimension of ``force`` is ``step``.  ``units`` are those of the deck.

        Raises
        ------
        ImportError
            If xarray is not installed.

        Examples
        --------
        >>> from fecm import sweep
        >>> found = sweep("decks/appendix.inp", {"velocity": [50.0, 115.0], "k": [1e6, 2e6]})
        >>> found.to_xarray().max_indentation.sel(velocity=115.0).dims
        ('k',)
        """
        try:
            import xarray
        except ImportError:
            raise ImportError("a Dataset needs xarray: pip install 'fecm[xarray]'") from None
        levels, rows = _grid(self.cases, len(self))
        coordinates = levels or {"case": np.arange(len(self))}
        axes, shape = [*coordinates, "step"], [len(values) for values in coordinates.values()]

        def about(name: str) -> dict[str, str]:
            texts = {"long_name": COLUMNS.get(name, ("",))[0], "units": self.unit(name)}
            return {key: text for key, text in texts.items() if text}

        columns = {**self.cases, **self.summary, "dt": self.dt, "steps": self.steps}
        added = {"unsettled_steps": self.unconverged_steps, "force": self.force}
        columns |= {name: values for name, values in added.items() if values is not None}
        found = xarray.Dataset(
            {name: (axes[: len(shape) + v.ndim - 1], v[rows].reshape(*shape, *v.shape[1:]),
                    about(name))
             for name, v in columns.items() if name not in levels},
            {name: (name, values, about(name)) for name, values in coordinates.items()},
            {"title": self.title},
        )  # fmt: skip
        if self.force is not None:
            found = found.assign_coords(step=np.arange(1, self.force.shape[1] + 1))
        return found.set_coords(list(self.cases))

    def plot(
        self,
        quantity: str = "",
        over: str | Sequence[str] = (),
        path: str | Path | None = None,
        *,
        kind: Literal["map", "exceedance", "sensitivity", "scatter"] = "map",
        ax: Axes | None = None,
        **options: Any,
    ) -> Axes:
        """Draw a map on a new figure of pyplot, on given axes, or in a file; or another kind.

        Parameters
        ----------
        quantity : str
            Name in the summary; the peak force, or the velocity found, if empty.
        over : str or sequence of str
            One or two names of varied values; all varied values if empty.
        path : str or Path, optional
            File to write or replace instead, as ``fecm plot`` does, in the format of its suffix.
        kind : {"map", "exceedance", "sensitivity", "scatter"}
            Kind of picture; those but map are of random sweeps.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on.
        **options
            Other options of the kind, such as ``where``, ``level``, ``width``.

        Returns
        -------
        matplotlib.axes.Axes
            The picture's first axes.

        Raises
        ------
        PlotError
            If the sweep does not contain the data.
        ImportError
            If matplotlib is not installed.
        """
        names = (over,) if isinstance(over, str) else tuple(over)
        named = {self.title or "the sweep": self}
        if names or kind == "map":
            options["over"] = names
        return plot(kind, named, path, ax, quantity=quantity, **options)


def _grid(cases: Mapping[str, Array], count: int) -> tuple[dict[str, Array], NDArray[np.intp]]:
    """Values of each name of a full grid and its cases in their order; no values if it is none."""
    levels: dict[str, Array] = {}
    places: list[NDArray[np.intp]] = []
    for name, values in cases.items():
        found, first, place = np.unique(values, return_index=True, return_inverse=True)
        order = np.argsort(first) if values.dtype.kind == "U" else np.arange(len(found))
        levels[name] = found[order]
        places.append(np.argsort(order)[place])
    if math.prod(map(len, levels.values())) == count == len(set(zip(*places, strict=True))):
        return levels, np.lexsort(places[::-1])
    return {}, np.arange(count)


def result_of(plan: Plan, outcome: Outcome) -> SweepResult:
    """Create the result from a plan and its outcome."""
    cases = {name: np.array([case[name] for case in plan.cases]) for name in plan.cases[0]}
    columns, deck = outcome.columns, plan.deck
    limited = deck.last(Delamination) is not None or not columns.keys().isdisjoint(THRESHOLD)
    found = [*SUMMARY, *(THRESHOLD if limited else ())]
    found += FOUND if plan.until is not None else ()
    found += [name for name in COLUMNS if name in columns and name not in found]
    found += [RATIO] if RATIO not in found else []
    none = np.full(len(plan.cases), np.nan)
    summary = {name: columns.get(name, none) for name in (*found, *outcome.measured, *VERDICTS)}
    design = plan.design
    return SweepResult(
        cases, summary,
        columns["dt"], columns["steps"], outcome.force, columns["unsettled"],
        deck.text or deck.to_text(), deck.title, unit_names(deck),
        None if design is None else evaluate(design, cases, summary, plan.limits),
    )  # fmt: skip


def save(
    result: SweepResult, path: Path, *, overwrite: bool = True, forces: Iterable[Forces] = ()
) -> None:
    """Write the result of a sweep.

    `forces` are those that the result does not hold, of some cases after the other.  Raises
    ResultWriteError if the file cannot be written; an existing file is then unchanged.
    """
    from fecm.results.hdf5_writer import writing

    if result.force is not None:
        forces = [(range(len(result)), result.force)]
    with writing(path, overwrite=overwrite) as sink:

        def put(name: str, values: Array, text: str, dimension: str, *axes: str) -> None:
            axes = axes or ("cases",)
            if values.dtype.kind in "US":
                sink.text(name, values.tolist(), text, axes)
                return
            dtype = "i8" if values.dtype.kind in "iu" else "f8"
            sink.create(schema.Dataset(name, axes, text, dimension, dtype), values.shape)
            sink.write(name, 0, values)

        about = {"format": schema.Form.SWEEP.value, "format_version": schema.FORMAT_VERSION}
        about |= {"fecm_version": __version__, "title": result.title}
        sink.attributes("", about | {f"unit_{name}": unit for name, unit in result.units.items()})
        sink.text("deck", result.deck, "the cards of the deck that was varied")
        if result.random is not None:
            sink.axis_names["laws"] = tuple(result.random.design.laws)
            for group, attribute_values in attributes(result.random).items():
                sink.attributes(group, attribute_values)
        for name, values in result.cases.items():
            put(f"cases/{name}", values, f"{name} of every case", DIMENSIONS.get(name, ""))
        for name, values in result.summary.items():
            text = TEXTS_OF.get(name) or described(name)
            put(f"summary/{name}", values, text, COLUMNS.get(name, ("", ""))[1])
        put("history/dt", result.dt, "time step of every case", "time")
        put("history/steps", result.steps, "number of steps of every case", "")
        if result.unconverged_steps is not None:
            text = "steps whose contact iteration did not converge"
            put("history/unsettled_steps", result.unconverged_steps, text, "")
        if forces and len(result):
            longest = int(result.steps.max())
            text = "contact force after every step"
            made = schema.Dataset(FORCE, ("cases", "steps"), text, "force")
            sink.create(made, (len(result), longest))
            for numbers, force in forces:
                rows = np.full((len(numbers), longest), np.nan)
                if force is not None:
                    rows[:, : force.shape[1]] = force
                ends = np.flatnonzero(np.diff(numbers) != 1) + 1
                for start, some in zip([0, *ends.tolist()], np.split(rows, ends), strict=True):
                    sink.write(FORCE, numbers[start], some)
        for row in () if result.random is None else stored(result.random):
            put(*row)
        for group, text in GROUPS.items():
            sink.attributes(group, {"description": text})
        for name, one in result.convergence.items():
            sink.attributes(f"convergence/{name}", vars(one))


def load(path: Path) -> SweepResult:
    """Read the result of a sweep.

    Raises
    ------
    ResultFileError
        If the file is not the result of a sweep.
    OSError
        If the file cannot be opened.
    """
    from fecm.results.hdf5_reader import read

    return sweep_of(read(path, schema.Form.SWEEP))


def sweep_of(contents: Contents, *, history: bool = True) -> SweepResult:
    """Create the result of a sweep from the contents of its file.

    Without `history` the forces, which may be large, are not read.  Raises ResultFileError if data
    are missing, or their number of cases differs.
    """
    path = contents.path
    names = sorted(contents, key=lambda name: name in contents.lists)  # numbers before texts
    cases, summary = (
        {n.removeprefix(group): contents[n] for n in names if n.startswith(group)}
        for group in ("cases/", "summary/")
    )
    given = [n for n in ("dt", "steps", "unsettled_steps") if f"history/{n}" in contents]
    steps = {n: contents[f"history/{n}"] for n in given}
    required = (*SUMMARY, "status")
    if not (summary.keys() >= {*required} and steps.keys() >= {"dt", "steps"}):
        raise ResultFileError(f"{path}: the result of the sweep is incomplete")
    summary = {name: summary[name] for name in required} | summary  # in their order
    count = np.shape(steps["dt"])[:1]
    rows = (*cases.values(), *summary.values(), *steps.values())
    shape = contents.shapes.get(FORCE)
    kinds = {name: values.dtype.kind for name, values in summary.items() if name not in VERDICTS}
    if (
        any(values.shape != count for values in rows)
        or (shape is not None and (len(shape), shape[:1]) != (2, count))
        or not set(kinds.values()) <= set("fiu")
        or (VALIDITY in summary and summary[VALIDITY].size and summary[VALIDITY].dtype.kind != "U")
    ):
        message = f"{path}: the data of this sweep do not match in type or number of cases"
        raise ResultFileError(message)
    counts, most = steps["steps"], np.inf if shape is None else shape[1]
    if counts.dtype.kind not in "iu" or not ((counts >= 0) & (counts <= most)).all():
        raise ResultFileError(f"{path}: history/steps does not match the stored steps")
    return SweepResult(
        cases, summary, steps["dt"], counts, contents.get(FORCE) if history else None,
        steps.get("unsettled_steps"),
        contents.texts.get("deck", ""), str(contents.attributes.get("title", "")),
        schema.declared_units(contents.attributes),
        random_of(contents, cases, summary, count[0]),
    )  # fmt: skip


def csv_lines(sweep: SweepResult, name: str = CASES) -> Iterator[str]:
    """Return the lines of a CSV table, with line ends.

    ``"cases"`` has the values and results of every case, ``"history"`` the contact force after
    every step of every case that was run.  Cases count from 0, steps from 1.  Numbers are written
    as Python's repr, which preserves every bit.  An apostrophe precedes texts that a spreadsheet
    would read as formulas.  Raises ExportError if there is no such table.
    """
    if name not in (CASES, HISTORY):
        raise ExportError(f"unknown table {name}; a sweep has {CASES} and {HISTORY}")
    if name == HISTORY and sweep.force is None:
        raise ExportError("the sweep has no stored forces; run it again with --history")
    echo: Any = SimpleNamespace(write=str)  # writerow returns what write returns
    writer = csv.writer(echo, lineterminator="\n")
    return (
        writer.writerow([f"'{v}" if isinstance(v, str) and FORMULA.match(v) else v for v in row])
        for row in (_case_rows(sweep) if name == CASES else _step_rows(sweep))
    )


def _case_rows(sweep: SweepResult) -> Iterator[Iterable[Any]]:
    columns = {**sweep.cases, **sweep.summary}
    texts = {name: columns.pop(name) for name in VERDICTS if name in columns}
    columns |= {"dt": sweep.dt, "steps": sweep.steps, **texts}
    yield ("case", *columns)
    yield from zip(range(len(sweep)), *(v.tolist() for v in columns.values()), strict=True)


def _step_rows(sweep: SweepResult) -> Iterator[Iterable[Any]]:
    assert sweep.force is not None
    yield ("case", "step", "time", "force")
    for case in np.flatnonzero(sweep.fine).tolist():
        count = int(sweep.steps[case])
        times = np.add.accumulate(np.full(count, sweep.dt[case])).tolist()
        forces = sweep.force[case, :count].tolist()
        yield from zip([case] * count, range(1, count + 1), times, forces, strict=True)
