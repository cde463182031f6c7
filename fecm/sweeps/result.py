"""Result of a sweep: values and results of every case, from a sweep or from a file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from fecm._errors import ResultFileError
from fecm._files import check_outputs, open_for_writing
from fecm._table import html_of
from fecm._text import Decimal
from fecm._typing import AnyFile
from fecm.deck.model import Delamination
from fecm.deck.units import declared_units, unit_names
from fecm.mechanics.own_law import law_name
from fecm.results import schema
from fecm.results.metrics import COLUMNS, FOUND, RATIO, SUMMARY, THRESHOLD, VERDICTS
from fecm.results.pictures import SweepKind, plot_results
from fecm.results.written import Reported, Saved
from fecm.sweeps import reduced as reduced_check
from fecm.sweeps.files import FORCE, random_of, save_sweep, sweep_csv_lines
from fecm.sweeps.measured import CaseComparison, compare_cases
from fecm.sweeps.outcome import MEASURED, About, Column, Outcome
from fecm.sweeps.reduced import ReducedModel
from fecm.sweeps.statistics import evaluate
from fecm.sweeps.stored import StoredSweep
from fecm.sweeps.summary import (
    doubtful_counts,
    reasons,
    remarks,
    summary_of_sweep,
    sweep_verdict,
)
from fecm.sweeps.task import Plan

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

    from fecm.results.hdf5_reader import FileContents

LATER = {"contact_loop"}  # results of every case that earlier files lack


class SweepResult(StoredSweep, Saved, Reported):
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
    unsettled_steps : ndarray (n,) or None
        Steps whose contact iteration did not converge; None if the file does not contain them.
    deck_text : str
        The cards of the deck that was varied, as in the file; :attr:`deck` has them read.
    title : str
        Title of the deck.
    units : dict
        Names of the units; empty if the deck states none.
    random : RandomResult or None
        Statistics, sensitivity indices and probabilities of a random sweep.
    measured : dict of ndarray (n,)
        Columns of the table of cases that are not varied, such as measured peaks, by their names
        after ``measured_``; numbers are in the deck's units where their unit is known.
    measured_units : dict
        Units of these columns; a column without a unit is left out.
    reduced : ReducedModel or None
        Full runs beside the reduced model; None if the cases are not by that model.
    law : str
        Name of the contact law that took the place of EXPE; empty if none did.
    index : pandas.Index or None
        Index of the DataFrame that was given as `cases`. A file does not store it.
    """

    def __repr__(self) -> str:
        return f"<fecm sweep {self.title!r} over {', '.join(self.cases)}: {sweep_verdict(self)}>"

    def _repr_html_(self) -> str:
        """Return answer, tables and notes, for notebooks."""
        return html_of(self, replace(summary_of_sweep(self), notes=self.notes))

    @property
    def notes(self) -> tuple[str, ...]:
        """Numbers of cases that failed or whose results are doubtful."""
        texts = [f"{count} of {len(self)} cases {what}" for count, what in doubtful_counts(self)]
        if not self.completed.all():
            texts[-1] += f": {reasons(self['status'][~self.completed])}"
        return (*texts, *remarks(self), *(() if self.random is None else self.random.notes))

    def _write(self, path: Path, *, overwrite: bool) -> None:
        save_sweep(self, path, overwrite=overwrite)

    @property
    def _name(self) -> str:
        return self.title or "the sweep"

    def to_dataframe(self) -> pandas.DataFrame:
        """Return values and results as a table with one row per case (requires pandas).

        The rows have the index of the DataFrame that was given as `cases`, so that pandas joins
        both row by row. Otherwise, and if the result comes from a file, the index is the number of
        the case. ``attrs["units"]`` has the units of the columns that have one.

        Examples
        --------
        >>> import pandas
        >>> from fecm import sweep
        >>> tests = pandas.DataFrame({"velocity": [115.0, 50.0]}, index=["B", "A"])
        >>> table = sweep("decks/appendix.inp", cases=tests).to_dataframe()
        >>> float(table["velocity"]["A"])
        50.0
        """
        import pandas

        numbers = pandas.RangeIndex(len(self), name="case")
        index = numbers if self.index is None else self.index
        if index.name is None and index.equals(numbers):
            index = numbers
        table = pandas.DataFrame({**self.cases, **self.summary, **self.measured}, index=index)
        table.attrs["units"] = {str(n): unit for n in table.columns if (unit := self.unit(str(n)))}
        return table

    def to_xarray(self) -> xarray.Dataset:
        """Return values and results as labelled arrays (requires xarray).

        A full grid has one dimension per name of its values, which are the coordinates: numbers in
        ascending order, texts in the order of the cases. Other cases have the dimension ``case``.
        The last dimension of ``force`` is ``step``, with the coordinate ``time`` if all cases have
        the same time step. ``units`` are the deck's units.

        Raises
        ------
        ImportError
            If xarray is not installed.

        Examples
        --------
        >>> from fecm import sweep
        >>> result = sweep("decks/appendix.inp", {"velocity": [50.0, 115.0], "k": [1e6, 2e6]})
        >>> result.to_xarray().max_indentation.sel(velocity=115.0).dims
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
            texts = {"long_name": COLUMNS.get(name, ("",))[0], "units": self._unit(name)}
            return {key: text for key, text in texts.items() if text}

        columns = {**self.cases, **self.summary, **self.measured}
        columns |= {"dt": self.dt, "steps": self.steps}
        added = {"unsettled_steps": self.unsettled_steps, "force": self.force}
        columns |= {name: values for name, values in added.items() if values is not None}
        variables = {}
        for name, values in columns.items():
            if name not in levels:
                own_axes = axes[: len(shape) + values.ndim - 1]
                variables[name] = (
                    own_axes,
                    values[rows].reshape(*shape, *values.shape[1:]),
                    about(name),
                )
        places = {name: (name, values, about(name)) for name, values in coordinates.items()}
        data_set = xarray.Dataset(variables, places, {"title": self.title})
        if self.force is not None:
            steps = np.arange(1, self.force.shape[1] + 1)
            data_set = data_set.assign_coords(step=steps)
            if len(np.unique(self.dt)) == 1:
                data_set = data_set.assign_coords(time=("step", self.dt[0] * steps, about("dt")))
        return data_set.set_coords(list(self.cases))

    def export(
        self,
        path: str | Path,
        table: Literal["cases", "history"] = "cases",
        *,
        overwrite: bool = False,
        decimal: Decimal = "point",
    ) -> None:
        """Write the cases, or their contact forces, as CSV, as ``fecm export`` does.

        Parameters
        ----------
        path : str or Path
            File to write.
        table : {"cases", "history"}
            A row per case, or a row per step of every case.
        overwrite : bool
            Whether an existing file is replaced.
        decimal : {"point", "comma"}
            Decimal mark. With commas, semicolons separate the values.

        Raises
        ------
        ExportError
            If there is no such table.
        OSError
            If the file exists and may not be replaced, or can't be written.

        Examples
        --------
        >>> import fecm
        >>> deck = fecm.examples.path("impact-patch")
        >>> result = fecm.sweep(deck, {"velocity": [100.0, 115.0, 130.0]})
        >>> result.export("velocities.csv")
        """
        lines = sweep_csv_lines(self, table, decimal)
        check_outputs([Path(path)], overwrite)
        with open_for_writing(Path(path), overwrite=overwrite) as file:
            file.writelines(lines)

    def compare(self, name: str = "") -> CaseComparison:
        """Compare a result of every case with the measured column of the table of cases.

        Parameters
        ----------
        name : str
            Name in the summary, such as ``"peak_force"``, whose measured column is named after it,
            as in ``measured_peak_force``; by default the first that has one.

        Returns
        -------
        CaseComparison
            Both columns, their ratios, bias and rms; ``str()`` says them in words.

        Raises
        ------
        StudyError
            If there is no such measured column, or it is in another unit.

        Examples
        --------
        >>> import fecm
        >>> tests = [
        ...     {"velocity": 50.0, "measured peak_force": 21.0},
        ...     {"velocity": 115.0, "measured peak_force": 50.0},
        ... ]
        >>> result = fecm.sweep("decks/appendix.inp", cases=tests)
        >>> result.compare("peak_force").measured
        array([21., 50.])
        """
        return compare_cases(self, name)

    def plot(
        self,
        kind: SweepKind = "map",
        path: str | Path | None = None,
        *,
        quantity: str = "",
        over: str | Sequence[str] = (),
        ax: Axes | None = None,
        overwrite: bool = False,
        **options: Any,
    ) -> Axes:
        """Draw a picture on a new figure of pyplot, on given axes, or in a file.

        Parameters
        ----------
        kind : {"map", "exceedance", "sensitivity", "scatter", "measured"}
            Kind of picture; exceedance, sensitivity and scatter are for random sweeps, measured is
            for tables of cases with measured columns.
        path : str or Path, optional
            File to write instead, as ``fecm plot`` does.  The suffix selects the format.
        quantity : str
            Name in the summary; the peak force, or the velocity found, if empty.
        over : str or sequence of str
            One or two names of varied values; all varied values if empty.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on.
        overwrite : bool
            Replace an existing file.
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
        FileExistsError
            If the file exists and may not be replaced.
        ImportError
            If matplotlib is not installed.

        Examples
        --------
        >>> result.plot(quantity="max_indentation", over="velocity")  # doctest: +SKIP
        """
        names = (over,) if isinstance(over, str) else tuple(over)
        if names or kind == "map":
            options["over"] = names
        return plot_results(
            kind, {self._name: self}, path, ax, overwrite=overwrite, quantity=quantity, **options
        )


def _grid(cases: Mapping[str, Column], count: int) -> tuple[dict[str, Column], NDArray[np.intp]]:
    """Return the values of each name of a full grid, and its cases in their order.

    Other cases have no values.
    """
    levels: dict[str, Column] = {}
    places: list[NDArray[np.intp]] = []
    for name, values in cases.items():
        distinct, first, place = np.unique(values, return_index=True, return_inverse=True)
        order = np.argsort(first) if values.dtype.kind == "U" else np.arange(len(distinct))
        levels[name] = distinct[order]
        places.append(np.argsort(order)[place])
    if math.prod(map(len, levels.values())) == count == len(set(zip(*places, strict=True))):
        return levels, np.lexsort(places[::-1])
    return {}, np.arange(count)


def sweep_result(plan: Plan, outcome: Outcome, reduced: ReducedModel | None = None) -> SweepResult:
    """Create the result from a plan and its outcome."""
    cases = {name: np.array([case[name] for case in plan.cases]) for name in plan.cases[0]}
    columns, deck = outcome.columns, plan.settings.deck
    names = [*_summary_names(plan, outcome), *outcome.measured, *VERDICTS]
    none = np.full(len(plan.cases), np.nan)
    summary = {name: columns.get(name, none) for name in names}
    random = None
    if plan.design is not None:
        random = evaluate(plan.design, cases, summary, plan.limits)
    return SweepResult(
        cases=cases,
        summary=summary,
        dt=columns[About.DT],
        steps=columns[About.STEPS],
        force=outcome.force,
        unsettled_steps=columns[About.UNSETTLED],
        deck_text=deck.text or deck.to_text(),
        title=deck.title,
        units=unit_names(deck),
        random=random,
        reduced=reduced,
        law="" if plan.settings.law is None else law_name(plan.settings.law),
        measured={name: column.values for name, column in plan.measured.items()},
        measured_units={name: column.unit for name, column in plan.measured.items() if column.unit},
    )


def _summary_names(plan: Plan, outcome: Outcome) -> list[str]:
    """Return the names of the results of every case, whether or not a case has a value."""
    columns = outcome.columns
    names = [*SUMMARY]
    if plan.settings.deck.last(Delamination) is not None or not columns.keys().isdisjoint(
        THRESHOLD
    ):
        names += THRESHOLD
    if plan.settings.search is not None:
        names += FOUND
    names += [name for name in COLUMNS if name in columns and name not in names]
    return names if RATIO in names else [*names, RATIO]


def load_sweep(path: str | Path | AnyFile) -> SweepResult:
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


def sweep_of(contents: FileContents, *, history: bool = True) -> SweepResult:
    """Create the result of a sweep from the contents of its file.

    Without `history` the forces, which may be large, are not read. Raises ResultFileError if data
    are missing, or if their numbers of cases differ.
    """
    from fecm.results.hdf5_reader import first_misfit  # h5py takes 60 ms to import

    path = contents.path
    cases, summary = _group(contents, "cases/"), _group(contents, "summary/")
    required_names = ("dt", "steps", "unsettled_steps")
    steps = {n: contents[f"history/{n}"] for n in required_names if f"history/{n}" in contents}
    required = {*SUMMARY, "status"} - LATER
    if not (summary.keys() >= required and steps.keys() >= {"dt", "steps"}):
        raise ResultFileError(f"{path}: the result of the sweep is incomplete")
    # Texts come last, as in the result that was written.
    summary = {name: summary[name] for name in SUMMARY if name in summary} | summary
    groups = ("history/", "cases/", "summary/", "measured/")
    if first_misfit(contents, [dataset for dataset in contents if dataset.startswith(groups)]):
        message = f"{path}: the data of this sweep do not match in type or number of cases"
        raise ResultFileError(message)
    shape = contents.shapes.get(FORCE)
    counts, most = steps["steps"], np.inf if shape is None else shape[1]
    if not ((counts >= 0) & (counts <= most)).all():
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
        measured={f"{MEASURED}{n}": v for n, v in _group(contents, "measured/").items()},
        measured_units={n: str(v) for n, v in contents.groups.get("measured", {}).items()},
    )


def _group(contents: FileContents, group: str) -> dict[str, Column]:
    """Return the datasets of a group by name, numbers before texts."""
    names = sorted(contents, key=lambda name: name in contents.lists)
    members = [name for name in names if name.startswith(group) and name.count("/") == 1]
    return {name.removeprefix(group): contents[name] for name in members}
