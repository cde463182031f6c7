"""Summary of each case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Floats
from fecm.results.metrics import COLUMNS, SUMMARY

# Numbers of cases, and their contact forces, (cases, steps).
Forces = tuple[Sequence[int], Floats | None]
FINE = "ok"
# The run ends during contact.
STILL = "still in contact"
RUN = (FINE, STILL)
ABOUT = ("status", "dt", "steps", "unsettled")  # columns that describe the run of a case


@dataclass
class Outcome:
    """Results of some cases."""

    numbers: list[int]  # numbers of the cases, from 0
    # (cases,) each, by name: those of :data:`~fecm.results.metrics.METRICS` are NaN if the case
    # failed, or if they are unknown because the run ended in contact.  ``status`` is ``"ok"``,
    # ``"still in contact"``, or the reason for the failure; ``dt``, ``steps``; ``unsettled`` counts
    # the steps whose contact iteration did not converge.
    columns: dict[str, NDArray[Any]]
    # (cases, steps) or None: contact force after every step.
    force: Floats | None = field(default=None, repr=False)

    @property
    def status(self) -> list[str]:
        """Status of each case."""
        texts: list[str] = self.columns["status"].tolist()
        return texts

    @property
    def measured(self) -> list[str]:
        """Names of the columns that the caller computes."""
        return [name for name in self.columns if name not in (*COLUMNS, *ABOUT)]

    def select(self, rows: NDArray[np.intp]) -> Outcome:
        """Return the outcome of some of the cases."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        force = None if self.force is None else self.force[rows]
        return Outcome([self.numbers[row] for row in rows], columns, force)

    @classmethod
    def failed(cls, reasons: Mapping[int, str]) -> Outcome:
        """Return the outcome of cases that could not be run, from the reasons by their numbers."""
        count, texts = len(reasons), list(reasons.values())
        columns: dict[str, NDArray[Any]] = {name: np.full(count, np.nan) for name in SUMMARY}
        columns |= {"status": np.array(texts, dtype=np.str_), "dt": np.full(count, np.nan)}
        columns |= {name: np.zeros(count, dtype=np.int64) for name in ("steps", "unsettled")}
        return cls(list(reasons), columns)


def merge(parts: Sequence[Outcome]) -> Outcome:
    """Merge outcomes, ordered by the numbers of the cases."""
    numbers = [number for part in parts for number in part.numbers]
    order = np.argsort(numbers)
    longest = max((0 if part.force is None else part.force.shape[1] for part in parts), default=0)
    force = np.full((len(numbers), longest), np.nan)
    row = 0
    for part in parts:
        if part.force is not None:
            force[row : row + len(part.numbers), : part.force.shape[1]] = part.force
        row += len(part.numbers)
    names = dict.fromkeys(name for part in parts for name in part.columns)
    columns = {
        name: np.concatenate(
            [part.columns.get(name, np.full(len(part.numbers), np.nan)) for part in parts]
        )[order]
        for name in names
    }
    return Outcome([numbers[i] for i in order], columns, force[order])


def outcome_of(
    numbers: list[int], summary: Mapping[str, Floats], last: Floats, steps: int, dt: float,
    unsettled: NDArray[np.int64], force: Floats | None = None,
) -> Outcome:  # fmt: skip
    """Return the outcome of cases that were run with one time step.

    `last` (cases,) are the contact forces after the last step, `force` (cases, steps) all.
    """
    cases, status = len(numbers), np.where(last > 0.0, STILL, FINE)
    about = status, np.full(cases, dt), np.full(cases, steps, dtype=np.int64), unsettled
    return Outcome(numbers, {**summary, **dict(zip(ABOUT, about, strict=True))}, force)
