"""Stored data of a sweep: values and results of every case by name, and the deck.

:class:`~fecm.sweeps.result.SweepResult` adds what can be computed from these data.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._arrays import read_only
from fecm._errors import FecmError, ResultFileError, did_you_mean
from fecm._typing import Bools
from fecm.authoring.values import REFINE, dimension_of
from fecm.deck.model import Deck
from fecm.deck.units import unit_of
from fecm.problem.loading import load_deck
from fecm.results.groups import NotStoredError, check_name
from fecm.results.metrics import COLUMNS, VALIDITY
from fecm.results.schema import SWEEP_DATASETS
from fecm.results.stored import deck_in
from fecm.sweeps.convergence import Convergence, convergence
from fecm.sweeps.outcome import Column, Status, was_run
from fecm.sweeps.reduced import ReducedModel
from fecm.sweeps.statistics import RandomResult, open_cases

# Arrays beside the tables, and their dimensions.
OWN_ARRAYS = ("dt", "steps", "unsettled_steps", "force")
OWN_DIMENSIONS = {
    name: SWEEP_DATASETS[f"history/{name}"].dimension for name in ("force", "dt", "steps")
}


@dataclass(repr=False, eq=False)
class StoredSweep:
    """Values, results and deck of a sweep; see :class:`fecm.SweepResult`."""

    cases: dict[str, Column]
    summary: dict[str, Column]
    dt: Column
    steps: Column
    force: Column | None = None
    unsettled_steps: Column | None = None
    deck_text: str = ""
    title: str = ""
    units: dict[str, str] = field(default_factory=dict)
    random: RandomResult | None = None
    reduced: ReducedModel | None = None
    law: str = ""
    index: Any = None
    measured: dict[str, Column] = field(default_factory=dict)
    measured_units: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.cases = {name: read_only(values) for name, values in self.cases.items()}
        self.summary = {name: read_only(values) for name, values in self.summary.items()}
        self.measured = {name: read_only(values) for name, values in self.measured.items()}
        for name in OWN_ARRAYS:
            if (values := getattr(self, name)) is not None:
                setattr(self, name, read_only(values))

    def __len__(self) -> int:
        return len(self.dt)

    def __getitem__(self, name: str) -> Column:
        """Return values or results of every case, by name."""
        name = check_name(name, "a sweep has columns by name; rows are in to_dataframe()")
        for columns in (self.cases, self.summary, self.measured):
            if name in columns:
                return columns[name]
        raise self._lacks(name)

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            if name.startswith("_") or "summary" not in vars(self):
                raise AttributeError(name)
            return self[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def __contains__(self, name: str) -> bool:
        return name in self.cases or name in self.summary or name in self.measured

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of values and results."""
        return iter(self.cases | self.summary | self.measured)

    def keys(self) -> list[str]:
        """Return the names of values and results."""
        return list(self)

    def _lacks(self, name: str) -> NotStoredError:
        """Return the error about an unknown name."""
        alternatives = did_you_mean(name, self) or f"; there are {', '.join(self)}"
        return NotStoredError(f"there is no {name} in this sweep{alternatives}")

    @property
    def deck(self) -> Deck:
        """Deck that was varied; with decks of the caller, the deck of the first case that has one.

        Raises
        ------
        ResultFileError
            If the result holds no deck that can be read.
        """
        return deck_in(self.deck_text)

    @property
    def completed(self) -> Bools:
        """Cases that were run to the end; the others failed, for the reason in ``status``."""
        return was_run(self.summary["status"])

    @property
    def still_in_contact(self) -> Bools:
        """Completed cases that end in contact."""
        return np.asarray(self.summary["status"] == Status.STILL)

    @property
    def validity(self) -> Column:
        """``"ok"``, reasons to doubt a case, or ``"failed"``; empty texts in earlier files."""
        return self.summary.get(VALIDITY, np.full(len(self), ""))

    @property
    def contact_over(self) -> Bools:
        """Completed cases whose contact is over at the end, so that no value is open."""
        return self.completed & ~open_cases(self.summary)

    @property
    def convergence(self) -> dict[str, Convergence]:
        """Order, limit and band of every quantity of a refinement study; empty for others."""
        if REFINE not in self.cases:
            return {}
        try:
            nodes = self.deck.control.nen
        except ResultFileError:  # of a damaged file
            nodes = 0
        return convergence(self.cases, self.summary, nodes, self._patch_ratio)

    @property
    def _patch_ratio(self) -> float:
        """Side of the elements at the patch over its radius; 0 if it is not known."""
        with suppress(FecmError, ValueError):
            (problem,) = load_deck(self.deck).problems
            if problem.patch is not None:
                return problem.patch_side / problem.patch.radius
        return 0.0

    def unit(self, name: str) -> str:
        """Return the unit of a column; empty for texts and pure numbers, or without named units.

        Parameters
        ----------
        name : str
            One of :meth:`keys`, ``"force"``, ``"dt"`` or ``"steps"``.

        Raises
        ------
        NotStoredError
            If there is no such column; a KeyError.
        """
        if name not in self and name not in OWN_DIMENSIONS:
            raise self._lacks(name)
        return self._unit(name)

    def _unit(self, name: str) -> str:
        """Return the unit of any name; empty if it is unknown."""
        if name in self.measured:
            return self.measured_units.get(name, "")
        dimension = COLUMNS[name].dimension if name in COLUMNS else dimension_of(name)
        return unit_of(OWN_DIMENSIONS.get(name, dimension), self.units)
