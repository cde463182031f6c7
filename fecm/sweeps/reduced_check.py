"""Full runs beside the reduced model: those of the smallest, middle and largest energy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm.results.errors import ResultFileError
from fecm.results.metrics import RATIO
from fecm.sweeps.case import CasesError
from fecm.sweeps.outcome import About, Column, Outcome, merge
from fecm.sweeps.plan import MOST_MODES, Plan, Task
from fecm.sweeps.vary import strike

if TYPE_CHECKING:
    from fecm.results.hdf5_reader import Contents

GROUP = "reduced"
LIMIT = 0.02  # largest difference of the peaks, relative to that of the full run
TEXTS = {
    "case": "number of the case that was also run in full",
    "peak_force": "largest contact force of the reduced model",
    "full_peak_force": "largest contact force of the full run",
    RATIO: "largest displacement under the load over the thickness, of the reduced model",
    f"full_{RATIO}": "largest displacement under the load over the thickness, of the full run",
}
DIMENSIONS = {"peak_force": "force", "full_peak_force": "force"}


@dataclass(frozen=True)
class ReducedModel:
    """The reduced model of a sweep, beside full runs of some of its cases.

    Attributes
    ----------
    modes : int
        Largest number of bending modes.
    columns : dict of ndarray (n,)
        Of the cases that were also run in full: ``case``, their numbers; ``peak_force`` and
        ``deflection_ratio`` by the model; ``full_peak_force`` and ``full_deflection_ratio`` by the
        full runs.
    """

    modes: int
    columns: dict[str, Column]

    def difference(self, name: str) -> Column:
        """Difference of the model from the full runs, relative to these, (n,)."""
        full = self.columns[f"full_{name}"]
        return np.asarray((self.columns[name] - full) / full)

    @property
    def _modes(self) -> str:
        return f"{self.modes} mode{'' if self.modes == 1 else 's'}"

    def lines(self) -> Iterator[str]:
        """What the summary of the sweep says of the model."""
        yield f"reduced model     {self._modes} of bending; difference from full runs:"
        rows = zip(
            self.columns["case"], self.difference("peak_force"), self.difference(RATIO), strict=True
        )
        for case, peak, w in rows:
            of_w = "open" if np.isnan(w) else f"{w:+.3%}"
            yield f"{'':18}peak {peak:+.2%}, w {of_w} (case {case})"
        yield f"{'':18}slopes and strains are not judged"

    def check(self) -> None:
        """Raise CasesError if a peak differs by more than the limit."""
        peaks = self.difference("peak_force")
        worst = int(np.abs(peaks).argmax())
        if not abs(peaks[worst]) <= LIMIT:
            remedy = "take more modes, or full runs (leave out the reduced model)"
            if self.modes >= MOST_MODES:
                remedy = "these are all its modes; take full runs: leave out the reduced model"
            raise CasesError(
                f"the peak force of the reduced model with {self._modes} differs by "
                f"{peaks[worst]:+.1%} from the full run of case {self.columns['case'][worst]}; "
                f"at most {LIMIT:.0%} is allowed: {remedy}"
            )


def trials(made: Plan, first: int) -> tuple[list[Task], list[Task]]:
    """Tasks of the cases of smallest, middle and largest energy: full runs, and by the model.

    They are numbered from `first`.  Raises CasesError if no case has an energy.
    """
    settings = replace(made.settings, history=False)
    in_full = replace(settings, modes=None)
    chosen = _chosen(made)
    fulls, models = (
        [
            Task(own, number, (case,), (made.cases[case],))
            for number, case in enumerate(chosen, start=start)
        ]
        for own, start in ((in_full, first), (settings, first + len(chosen)))
    )
    return fulls, models


def _chosen(made: Plan) -> list[int]:
    """Cases of smallest, middle and largest energy; CasesError if none has an energy."""
    energies: list[tuple[float, int]] = []
    for number, case in enumerate(made.cases):
        with suppress(CasesError):  # the case will fail
            energies.append((strike(made.settings.deck, case).energy, number))
    ordered = [number for energy, number in sorted(energies) if energy > 0.0]
    if not ordered:
        raise CasesError("no case has an energy, by which the reduced model could be checked")
    return list(dict.fromkeys([ordered[0], ordered[len(ordered) // 2], ordered[-1]]))


def compared(modes: int, fulls: Sequence[Outcome], models: Sequence[Outcome]) -> ReducedModel:
    """Compare outcomes of the trials; CasesError if they differ too much, or if all failed."""
    full, model = merge(fulls, history=False), merge(models, history=False)
    fine = np.flatnonzero(full.fine & model.fine)
    if not len(fine):
        (failed, *_) = (one for one in (model, full) if not one.fine.all())
        reason = failed.status[int(np.flatnonzero(~failed.fine)[0])]
        raise CasesError(f"the reduced model can't be checked by full runs: {reason}")
    full, model = full.select(fine), model.select(fine)
    found = ReducedModel(
        modes,
        {
            "case": np.array(full.numbers),
            "peak_force": model.columns[About.REACHED],
            "full_peak_force": full.columns[About.REACHED],
            RATIO: model.columns[RATIO],
            f"full_{RATIO}": full.columns[RATIO],
        },
    )
    found.check()
    return found


def attributes(model: ReducedModel) -> dict[str, Any]:
    """Attributes of the group in the file."""
    return {"description": "full runs beside the reduced model", "modes": model.modes}


def reduced_of(contents: Contents) -> ReducedModel | None:
    """The reduced model of a sweep's file, None without one; ResultFileError if incomplete."""
    if GROUP not in contents.groups:
        return None
    try:
        modes = int(contents.groups[GROUP]["modes"])
        columns = {name: contents[f"{GROUP}/{name}"] for name in TEXTS}
    except (KeyError, ValueError, TypeError) as error:
        message = f"{contents.path}: what is stored of the reduced model is incomplete ({error})"
        raise ResultFileError(message) from None
    if len({np.shape(values) for values in columns.values()}) != 1:
        raise ResultFileError(f"{contents.path}: columns of the reduced model differ in length")
    return ReducedModel(modes, columns)
