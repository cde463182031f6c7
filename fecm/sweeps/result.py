"""Result of a sweep: values and results of every case, and what its cases are worth."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from fecm._errors import did_you_mean
from fecm._files import check_outputs, writing
from fecm._tables import html_table
from fecm._typing import Bools
from fecm.deck.model import Delamination, Preload
from fecm.deck.reader import Reader
from fecm.deck.units import quantity, unit_names, unit_of
from fecm.mechanics.own_law import name_of
from fecm.results.errors import NotStoredError
from fecm.results.linear_plate import TOO_SOFT, UNSAFE, InPlane, softness
from fecm.results.metrics import COLUMNS, FOUND, RATIO, SUMMARY, THRESHOLD, VALIDITY, VERDICTS
from fecm.results.pictures import plot
from fecm.results.validity import BENT, MEANING, counted
from fecm.sweeps.case import pair
from fecm.sweeps.convergence import Convergence, convergence
from fecm.sweeps.outcome import About, Column, Outcome, Status, was_run
from fecm.sweeps.plan import Plan
from fecm.sweeps.random_result import RandomResult, evaluate, open_ends
from fecm.sweeps.reduced_check import ReducedModel
from fecm.sweeps.values import REFINE, dimension_of

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

LABEL_WIDTH = 18  # of the lines of the summary
DIGITS = 6  # of the values of a case, unless others are closer
MOST_REASONS = 5  # of failure, that the summary lists
WEIGHED = ("mass", "rod_mass", "energy")  # values that the summary shows in g and J
SAME_PLACE = 1e-9  # distance from the place given, relative to its coordinates, that is rounding


def summary(result: SweepResult) -> list[str]:
    """Return summary lines: number of cases, smallest and largest peak or velocity, failures."""
    fine = result.fine
    failed = Counter(result["status"][~fine].tolist())
    lines = [f"cases             {len(result)}"]
    if result.law:
        lines.append(f"contact law       {result.law}, instead of EXPE")
    lines += [*_extremes(result), *_moved(result)]
    for reason, times in failed.most_common(MOST_REASONS):
        lines.append(f"failed            {times}: {reason}")
    if (others := len(failed) - MOST_REASONS) > 0:
        lines.append(f"failed            for {others} other reason{'s' * (others > 1)}")
    if result.random is not None and failed:
        lines.append(f"failed share      {(~fine).mean():.3%} of the draws")
    return [*lines, *(() if result.reduced is None else result.reduced.lines())]


def _extremes(result: SweepResult) -> Iterator[str]:
    """The cases with the smallest and the largest peak, or velocity found."""
    what, names, digits = "peak", ["peak_force"], 6
    if "found_velocity" in result.summary:
        what, names, digits = "found", ["found_velocity", "found_energy"], 8
    shown = np.where(result.fine, result[names[0]], np.nan)
    if not np.isfinite(shown).any():
        return
    for size, case in (("smallest", np.nanargmin(shown)), ("largest", np.nanargmax(shown))):
        texts = [quantity(result[name][case], result.unit(name), digits) for name in names]
        values = ", ".join(f"{name} {_shown(result, name, int(case))}" for name in result.cases)
        given = f" ({values})" if values else ""
        yield f"{size} {what:{LABEL_WIDTH - 2 - len(size)}} {', '.join(texts)}{given}"


def _moved(result: SweepResult) -> Iterator[str]:
    """How far the places that were hit are from those given."""
    if "at" not in result.cases or "hit_x" not in result.summary:
        return
    asked = np.array([pair("at", text) for text in result.cases["at"].tolist()]).T
    moved = np.hypot(*(asked - (result["hit_x"], result["hit_y"])))
    if count := np.count_nonzero(moved > SAME_PLACE * np.abs(asked).max()):
        distance = f"{np.nanmax(moved):.4g} {result.unit('hit_x')}".rstrip()
        yield f"moved             {count}: to the nearest node, up to {distance} away"


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


def reasons(status: Column) -> str:
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


def _doubts(result: SweepResult) -> dict[str, Bools]:
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
            error = softness(largest, in_plane, preloaded=_is_preloaded(result.deck))
            size = f" (at w = {largest:.3g} h {error})"
        yield f"beyond its range {TOO_SOFT}{size}; {UNSAFE}"


def _is_preloaded(deck: str) -> bool:
    """Whether the text of a deck has a PREL segment."""
    return any(problem.deck and problem.deck.has(Preload) for problem in Reader(deck).problems())


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
    reduced : ReducedModel or None
        Full runs beside the reduced model; None if the cases are not by that model.
    law : str
        Name of the contact law that took the place of EXPE; empty if none did.
    """

    cases: dict[str, Column]
    summary: dict[str, Column]
    dt: Column
    steps: Column
    force: Column | None = None
    unconverged_steps: Column | None = None
    deck: str = ""
    title: str = ""
    units: dict[str, str] = field(default_factory=dict)
    random: RandomResult | None = None
    reduced: ReducedModel | None = None
    law: str = ""

    def __len__(self) -> int:
        return len(self.dt)

    def __repr__(self) -> str:
        return f"<fecm sweep {self.title!r} over {', '.join(self.cases)}: {verdict(self)}>"

    def _repr_html_(self) -> str:
        """Table of the summary, for notebooks."""
        lines = ((line[:LABEL_WIDTH].strip(), line[LABEL_WIDTH:]) for line in summary(self))
        return html_table(repr(self)[1:-1], lines)

    def __getitem__(self, name: str) -> Column:
        """Values or results of every case, by name."""
        if name in self.cases:
            return self.cases[name]
        if name not in self.summary:
            names = [*self.cases, *self.summary]
            others = did_you_mean(name, names) or f"; there are {', '.join(names)}"
            raise NotStoredError(f"there is no {name} in this sweep{others}")
        return self.summary[name]

    @property
    def fine(self) -> Bools:
        """Cases that were run."""
        return was_run(self.summary["status"])

    @property
    def still(self) -> Bools:
        """Cases that were run and ended in contact."""
        return np.asarray(self.summary["status"] == Status.STILL)

    @property
    def validity(self) -> Column:
        """``"ok"``, reasons to doubt a case, or ``"failed"``; of earlier files empty texts."""
        return self.summary.get(VALIDITY, np.full(len(self), ""))

    @property
    def over(self) -> Bools:
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
        if name == "force":
            return unit_of("force", self.units)
        dimension = COLUMNS[name][1] if name in COLUMNS else dimension_of(name)
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
        variables = {}
        for name, values in columns.items():
            if name not in levels:
                own = axes[: len(shape) + values.ndim - 1]
                variables[name] = (
                    own,
                    values[rows].reshape(*shape, *values.shape[1:]),
                    about(name),
                )
        places = {name: (name, values, about(name)) for name, values in coordinates.items()}
        found = xarray.Dataset(variables, places, {"title": self.title})
        if self.force is not None:
            found = found.assign_coords(step=np.arange(1, self.force.shape[1] + 1))
        return found.set_coords(list(self.cases))

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the sweep as a file, such as one in memory; ``fecm.load_sweep`` reads it.

        Parameters
        ----------
        path : str or Path
            File to write.
        overwrite : bool
            Whether an existing file is replaced.

        Raises
        ------
        OSError
            If the file exists and may not be replaced, or can't be written.
        """
        from fecm.sweeps.result_file import save  # which imports this module

        check_outputs([Path(path)], overwrite)
        save(self, Path(path), overwrite=overwrite)

    def export(
        self,
        path: str | Path,
        table: Literal["cases", "history"] = "cases",
        *,
        overwrite: bool = False,
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

        Raises
        ------
        ExportError
            If there is no such table.
        OSError
            If the file exists and may not be replaced, or can't be written.

        Examples
        --------
        >>> import fecm
        >>> deck = fecm.examples.path("impact-115")
        >>> found = fecm.sweep(deck, {"velocity": [100.0, 115.0, 130.0]})
        >>> found.export("velocities.csv")
        """
        from fecm.sweeps.csv import csv_lines  # which imports this module

        lines = csv_lines(self, table)
        check_outputs([Path(path)], overwrite)
        with writing(Path(path), overwrite=overwrite) as file:
            file.writelines(lines)

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


def _grid(cases: Mapping[str, Column], count: int) -> tuple[dict[str, Column], NDArray[np.intp]]:
    """Values of each name of a full grid and its cases in their order; no values if it is none."""
    levels: dict[str, Column] = {}
    places: list[NDArray[np.intp]] = []
    for name, values in cases.items():
        found, first, place = np.unique(values, return_index=True, return_inverse=True)
        order = np.argsort(first) if values.dtype.kind == "U" else np.arange(len(found))
        levels[name] = found[order]
        places.append(np.argsort(order)[place])
    if math.prod(map(len, levels.values())) == count == len(set(zip(*places, strict=True))):
        return levels, np.lexsort(places[::-1])
    return {}, np.arange(count)


def result_of(plan: Plan, outcome: Outcome, reduced: ReducedModel | None = None) -> SweepResult:
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
        unconverged_steps=columns[About.UNSETTLED],
        deck=deck.text or deck.to_text(),
        title=deck.title,
        units=unit_names(deck),
        random=random,
        reduced=reduced,
        law="" if plan.settings.law is None else name_of(plan.settings.law),
    )


def _summary_names(plan: Plan, outcome: Outcome) -> list[str]:
    """Names of the results of every case, whether or not one of them has a value."""
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
