"""Outcomes of cases: columns, measured columns and forces; and the protocol of back ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fecm._typing import Bools, Floats
from fecm.deck.units import MASS, VELOCITY
from fecm.judge.validity import FAILED, VALID
from fecm.results.metrics import COLUMNS, SUMMARY, Metrics
from fecm.sweeps.impact_columns import Impacts

Column = NDArray[Any]  # of numbers or of texts
Forces = tuple[Sequence[int], Floats | None]  # of cases, with contact forces (cases, steps)
MEASURED = "measured_"  # before the names of measured columns
# Dimensions of measured columns that are converted.
CONVERTED = ("force", "length", "time", "force*length", VELOCITY, MASS)


class MeasuredColumn(NamedTuple):
    """Column of a table of cases that is not varied, such as a measured peak force."""

    values: NDArray[Any]  # (cases,): numbers, NaN in empty fields, or texts
    unit: str  # the deck's unit of a converted column, else the stated one; empty if unknown
    dimension: str  # empty if the unit is not converted


class Status(StrEnum):
    """Status of a case that was run. A failed case has the reason instead."""

    OK = "ok"
    STILL = "still in contact"  # at the end


class About(StrEnum):
    """Columns that describe the run of a case."""

    STATUS = "status"  # a :class:`Status`, or the reason for the failure
    VALIDITY = "validity"  # ``"ok"``, the reasons to doubt the case, or ``"failed"``
    DT = "dt"
    STEPS = "steps"
    UNSETTLED = "unsettled"  # number of steps whose contact iteration did not converge
    REACHED = "reached"  # the largest contact force, a lower bound of the peak


def was_run(status: Column) -> Bools:
    """Return a mask of the cases that were run, by their status."""
    return np.isin(status, tuple(Status))


@dataclass
class Outcome:
    """Results of some cases."""

    numbers: list[int]  # of the cases, from 0
    # (cases,) each, by name: the columns of :class:`About`, and results.  A result of
    # :data:`~fecm.results.metrics.METRICS` is NaN if the case failed, or if its end has not
    # decided the result.
    columns: dict[str, Column]
    force: Floats | None = None  # (cases, steps): contact force after every step

    @property
    def status(self) -> list[str]:
        """Status of each case."""
        return list(map(str, self.columns[About.STATUS]))

    @property
    def fine(self) -> Bools:
        """Mask of the cases that were run."""
        return was_run(self.columns[About.STATUS])

    @property
    def measured(self) -> list[str]:
        """Names of the columns that the caller computes."""
        return [name for name in self.columns if name not in (*COLUMNS, *About)]

    def select(self, rows: NDArray[np.intp]) -> Outcome:
        """Return the outcome of some of the cases."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        force = None if self.force is None else self.force[rows]
        return Outcome([self.numbers[row] for row in rows], columns, force)

    @classmethod
    def failed(cls, reasons: Mapping[int, str]) -> Outcome:
        """Return the outcome of failed cases, from their reasons by number."""
        count = len(reasons)
        about: dict[About, Column] = {
            About.STATUS: np.array(list(reasons.values()), dtype=np.str_),
            About.VALIDITY: np.full(count, FAILED),
            About.DT: np.full(count, np.nan),
            About.STEPS: np.zeros(count, dtype=np.int64),
            About.UNSETTLED: np.zeros(count, dtype=np.int64),
            About.REACHED: np.full(count, np.nan),
        }
        return cls(list(reasons), {name: np.full(count, np.nan) for name in SUMMARY} | about)


class Backend(Protocol):
    """Computes impacts on one plate, and keeps what they share."""

    @property
    def computes_together(self) -> bool:
        """Whether many impacts take hardly longer than one."""

    @property
    def lengthens(self) -> bool:
        """Whether a longer run takes little time, so that it decides open values."""

    @property
    def durations(self) -> Sequence[float]:
        """Factors on the duration of the program, until open values are decided."""

    def outcomes(self, impacts: Impacts, *, judged: bool = True) -> Outcome:
        """Compute impacts; if judged, impacts with doubtful energies in full."""

    def lengthened(self, factor: float) -> Backend:
        """Return the back end of a run `factor` times as long."""


def outcome_of(
    numbers: list[int],
    metrics: Metrics,
    *,
    last: Floats,
    steps: int,
    dt: float,
    unsettled: NDArray[np.int64],
    force: Floats | None = None,
) -> Outcome:
    """Return the outcome of cases that were run with one time step, before they are judged.

    `last` (cases,) are the contact forces after the last step, `force` (cases, steps) the forces of
    all.
    """
    cases = len(numbers)
    about: dict[About, Column] = {
        About.STATUS: np.where(last > 0.0, Status.STILL, Status.OK),
        About.VALIDITY: np.full(cases, VALID),
        About.DT: np.full(cases, dt),
        About.STEPS: np.full(cases, steps, dtype=np.int64),
        About.UNSETTLED: unsettled,
        About.REACHED: metrics.reached,
    }
    return Outcome(numbers, metrics.columns | about, force)


def merge(parts: Sequence[Outcome], *, history: bool = True) -> Outcome:
    """Merge outcomes, ordered by the numbers of the cases, with their forces if `history`."""
    case_numbers = [number for part in parts for number in part.numbers]
    order, numbers = np.argsort(case_numbers), sorted(case_numbers)
    columns: dict[str, Column] = {}
    for name in dict.fromkeys(name for part in parts for name in part.columns):
        column_parts = [
            part.columns.get(name, np.full(len(part.numbers), np.nan)) for part in parts
        ]
        columns[name] = np.concatenate(column_parts)[order]
    if not history:
        return Outcome(numbers, columns)
    longest = max((0 if part.force is None else part.force.shape[1] for part in parts), default=0)
    force = np.full((len(numbers), longest), np.nan)
    ends = np.cumsum([len(part.numbers) for part in parts])
    for part, end in zip(parts, ends, strict=True):
        if part.force is not None:
            force[end - len(part.numbers) : end, : part.force.shape[1]] = part.force
    return Outcome(numbers, columns, force[order])
