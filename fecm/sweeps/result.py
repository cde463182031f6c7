"""A sweep's result: values and numbers of every case, in memory or in a file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fecm._version import __version__
from fecm.deck.units import unit_names, unit_of
from fecm.results.schema import FORMAT_VERSION, SWEEP, Dataset, ResultFileError, declared_units
from fecm.sweeps.outcome import RUN, STILL, SUMMARY, Outcome
from fecm.sweeps.plan import Plan

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from fecm.results.hdf5_reader import Contents


# Reasons of failed cases that are told one by one.
TOLD = 5


def summary(result: SweepResult) -> list[str]:
    """Summarise a sweep: its cases, the smallest and the largest peak force, why cases failed."""
    fine = result.fine
    lines = [f"cases             {len(result)}"]
    force = np.where(fine, result["peak_force"], np.nan)
    if np.isfinite(force).any():
        for word, case in (("smallest", np.nanargmin(force)), ("largest", np.nanargmax(force))):
            values = ", ".join(f"{name} {values[case]}" for name, values in result.cases.items())
            peak = f"{force[case]:.6g} {result.unit('peak_force')}".rstrip()
            lines.append(f"{word + ' peak':17} {peak} ({values})")
    reasons = Counter(result["status"][~fine].tolist())
    for reason, times in reasons.most_common(TOLD):
        lines.append(f"failed            {times}: {reason}")
    if len(reasons) > TOLD:
        lines.append(f"failed            for {len(reasons) - TOLD} other reasons")
    return lines


def verdict(result: SweepResult) -> str:
    """Count the cases, those that failed, and those whose numbers are in doubt."""
    unconverged_steps = (
        0
        if result.unconverged_steps is None
        else int((result.unconverged_steps > 0)[result.fine].sum())
    )
    counts = (
        (int(result.still.sum()), "still in contact at the end"),
        (unconverged_steps, "with a contact iteration that did not converge"),
        (int((~result.fine).sum()), "failed"),
    )
    told = ", ".join(f"{count} {what}" for count, what in counts if count)
    return f"{len(result)} case{'' if len(result) == 1 else 's'}: {told or 'all ok'}"


Array = NDArray[Any]

# Physical dimension of what varies.
DIMENSIONS = {
    "velocity": "length/time", "k": "force/length^1.5", "alpha_p": "length",
    "rod_length": "length", "rod_modulus": "force/length^2",
    "rod_density": "force*time^2/length^4", "rod_mass": "force*time^2/length",
    "thickness": "length", "density": "force*time^2/length^4", "dt": "time",
    **dict.fromkeys(("e1", "e2", "g12", "g13", "g23"), "force/length^2"),
}  # fmt: skip

# Groups of the file.
GROUPS = {
    "cases": "values of what varies",
    "summary": "what came out of every case",
    "history": "time steps of every case, and its contact force if asked for",
}


@dataclass
class SweepResult:
    """What a sweep gave.

    Attributes
    ----------
    cases : dict of ndarray (n,)
        Values of every case, by name.
    summary : dict of ndarray (n,)
        Numbers of every case, and ``status``: ``"ok"``, ``"still in contact"``, or why a case
        failed.
    dt, steps : ndarray (n,)
        Time step and number of steps of every case.
    force : ndarray (n, steps) or None
        Contact force after every step, NaN beyond a case's steps; None unless asked for.
    unsettled : ndarray (n,) or None
        Steps of every case whose contact iteration did not converge; None where the file does not
        tell.
    deck : str
        The deck that was varied.
    title : str
        Its title.
    units : dict
        Names of its units; empty where it gives none.
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

    def __len__(self) -> int:
        return len(self.dt)

    def __getitem__(self, name: str) -> Array:
        """Values or numbers of every case, by name."""
        return self.cases[name] if name in self.cases else self.summary[name]

    @property
    def fine(self) -> NDArray[np.bool_]:
        """Which cases were run."""
        return np.isin(self.summary["status"], RUN)

    @property
    def still(self) -> NDArray[np.bool_]:
        """Which cases were run, and ended while the projectile was on the plate."""
        return np.asarray(self.summary["status"] == STILL)

    def unit(self, name: str) -> str:
        """Unit of a value or a number, as the deck names it; empty where it has none."""
        dimension = SUMMARY[name][1] if name in SUMMARY else DIMENSIONS.get(name, "")
        return unit_of(dimension, self.units)

    def to_dataframe(self) -> pandas.DataFrame:
        """Values and numbers as a table, a row a case (needs pandas)."""
        import pandas

        table = pandas.DataFrame({**self.cases, **self.summary})
        table.index.name = "case"
        return table

    def plot(
        self,
        quantity: str = "peak_force",
        over: str | Sequence[str] = (),
        path: str | Path | None = None,
        **options: Any,
    ) -> Figure:
        """Draw a map, and write it if there is a path.

        Parameters
        ----------
        quantity : str
            What it shows, a name of the summary.
        over : str or sequence of str
            One or two names of what varies; all that does if empty.
        path : str or Path, optional
            Where to write it, in place of what is there; its suffix is the format.
        **options
            Other fields of :class:`fecm.plot.pictures.Options`: ``where``, ``level``, ``width``.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        PlotError
            If the sweep lacks what is asked for.
        ImportError
            If matplotlib is not installed.
        """
        from fecm.plot.pictures import Options, figure

        names = (over,) if isinstance(over, str) else tuple(over)
        chosen = Options(quantity=quantity, over=names, **options)
        return figure("map", {self.title or "the sweep": self}, chosen, path)


def result_of(plan: Plan, outcome: Outcome) -> SweepResult:
    """Put a plan and its outcome together."""
    names = list(plan.cases[0])
    cases = {name: np.array([case[name] for case in plan.cases]) for name in names}
    summary: dict[str, Array] = dict(outcome.summary)
    summary["status"] = np.array(outcome.status)
    deck = plan.deck
    return SweepResult(
        cases, summary, outcome.dt, outcome.steps, outcome.force, outcome.unconverged_steps,
        deck.text or deck.to_text(), deck.title, unit_names(deck),
    )  # fmt: skip


def save(result: SweepResult, path: Path, *, overwrite: bool = True) -> None:
    """Write a sweep's result.

    Parameters
    ----------
    result : SweepResult
    path : Path
    overwrite : bool
        Replace a file that exists.

    Raises
    ------
    ResultWriteError
        If the file can't be written; what stood under the name is then untouched.
    """
    from fecm.results.hdf5_writer import writing

    count = len(result)
    with writing(path, overwrite=overwrite) as sink:
        sink.attributes(
            "",
            {
                "format": SWEEP,
                "format_version": FORMAT_VERSION,
                "fecm_version": __version__,
                "title": result.title,
                **{f"unit_{name}": unit for name, unit in result.units.items()},
            },
        )
        sink.text("deck", result.deck, "the cards of the deck that was varied")

        def store(path: str, values: Array, text: str, dimension: str = "") -> None:
            if values.dtype.kind in "US":
                sink.texts(path, values.tolist(), text)
                return
            dtype = "i8" if values.dtype.kind in "iu" else "f8"
            dataset = Dataset(path, ("cases",), text, dimension, dtype)
            sink.create(dataset, values.shape)
            sink.write(path, 0, values)

        for name, values in result.cases.items():
            dimension = DIMENSIONS.get(name, "")
            store(f"cases/{name}", values, f"{name} of every case", dimension)
        for name, (text, dimension) in SUMMARY.items():
            store(f"summary/{name}", result.summary[name], text, dimension)
        store(
            "summary/status",
            result.summary["status"],
            "ok, still in contact, or why the case failed",
        )
        store("history/dt", result.dt, "time step of every case", "time")
        store("history/steps", result.steps, "number of steps of every case")
        if result.unconverged_steps is not None:
            text = "steps whose contact iteration did not converge"
            store("history/unsettled_steps", result.unconverged_steps, text)
        if result.force is not None and count:
            store("history/force", result.force, "contact force after every step", "force")
        for group, text in GROUPS.items():
            sink.attributes(group, {"description": text})


def load(path: Path) -> SweepResult:
    """Read a sweep's result.

    Raises
    ------
    ResultFileError
        If the file is none.
    OSError
        If it can't be opened.
    """
    from fecm.results.hdf5_reader import read

    return sweep_of(read(path, SWEEP))


def sweep_of(contents: Contents, *, history: bool = True) -> SweepResult:
    """A sweep's result, of what stands in its file.

    Parameters
    ----------
    contents : Contents
    history : bool
        Read the forces as well, which may be many.

    Raises
    ------
    ResultFileError
        If something of it is missing, or does not belong to as many cases.
    """
    arrays, path = contents.arrays, contents.path

    def group(prefix: str) -> dict[str, Array]:
        found = {p.removeprefix(prefix): arrays[p] for p in arrays if p.startswith(prefix)}
        lists = contents.lists.items()
        texts = {p.removeprefix(prefix): np.array(v) for p, v in lists if p.startswith(prefix)}
        return found | texts

    cases, summary = group("cases/"), group("summary/")
    missing = [name for name in (*SUMMARY, "status") if name not in summary]
    if missing or "history/dt" not in arrays or "history/steps" not in arrays:
        raise ResultFileError(f"{path}: this result of a sweep is not whole")
    summary = {name: summary[name] for name in (*SUMMARY, "status")} | summary  # in their order
    count = np.shape(arrays["history/dt"])[:1]
    rows = (*cases.values(), *summary.values(), arrays["history/dt"], arrays["history/steps"])
    unconverged_steps = arrays.get("history/unsettled_steps")
    rows += () if unconverged_steps is None else (unconverged_steps,)
    shape = arrays.shapes.get("history/force")
    kinds = {name: summary[name].dtype.kind for name in SUMMARY}
    if (
        any(values.shape != count for values in rows)
        or (shape is not None and (len(shape), shape[:1]) != (2, count))
        or not set(kinds.values()) <= set("fiu")
    ):
        raise ResultFileError(f"{path}: the cases of this result of a sweep are not all there")
    steps = arrays["history/steps"]
    most = np.inf if shape is None else shape[1]
    if steps.dtype.kind not in "iu" or not ((steps >= 0) & (steps <= most)).all():
        raise ResultFileError(f"{path}: history/steps counts other steps than there are")
    return SweepResult(
        cases, summary, arrays["history/dt"], steps,
        arrays.get("history/force") if history else None,
        unconverged_steps,
        contents.texts.get("deck", ""), str(contents.attributes.get("title", "")),
        declared_units(contents.attributes),
    )  # fmt: skip
