"""Impact metrics of one run, and the state of the contact at its end."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fecm._errors import ResultFileError
from fecm._table import Row, Table, html_table, text_lines
from fecm.deck.model import Impact
from fecm.deck.units import quantity, unit_of
from fecm.judge.end import Deflection, End, RigidMotion, time_to_decide
from fecm.results.groups import NotStoredError, remedy, suggestion
from fecm.results.metrics import (
    INITIAL_PLATE,
    INTEGERS,
    METRICS,
    MOBILITY,
    PLATE_MASS,
    REST_W,
    START_W,
    IndentationMetrics,
    MetricAttributes,
    Metrics,
    Projectiles,
    impact_metrics,
)
from fecm.results.stored import Stored, computed_once

NOT_KNOWN = "not known"


class ImpactMetrics(dict[str, float], MetricAttributes):
    """Impact metrics of a run: ``metrics.peak_force`` is ``metrics["peak_force"]``.

    The values are numbers in the deck's units, and NaN where they are not known. ``print`` shows
    them with their units and meanings.

    Parameters
    ----------
    values : mapping of str to float
        Values by the names of :data:`~fecm.results.metrics.METRICS`; empty without impact steps.
    units : dict of str to str
        Names of the units of length, force and time; empty if the deck names none.
    validity : str
        ``"ok"``, or the reasons to doubt the result.

    Examples
    --------
    >>> import fecm
    >>> metrics = fecm.run_one(fecm.examples.path("impact-patch")).metrics
    >>> f"{metrics.peak_force:.2f} {metrics.unit('peak_force')}"
    '85.01 lbf'
    """

    def __init__(self, values: Mapping[str, float], units: dict[str, str], validity: str) -> None:
        super().__init__(values)
        self.units: dict[str, str] = units
        self.validity: str = validity

    def unit(self, name: str) -> str:
        """Return the unit of a metric; empty for a pure number, or if the deck names no units.

        Raises
        ------
        NotStoredError
            If there is no such metric; a KeyError.
        """
        if name not in self:
            raise self._lacks(name)
        return unit_of(METRICS[name].dimension, self.units)

    def _lacks(self, name: str) -> NotStoredError:
        """Return the error about an unknown name, or about a metric that this run does not have."""
        if name not in METRICS:
            reason = suggestion(str(name), (), METRICS) or f"; there are {', '.join(METRICS)}"
        elif self:
            reason = "; add DELA to the deck and run it again"
        else:
            reason = remedy("history")
        return NotStoredError(f"there is no metric {name} in this result{reason}")

    def __missing__(self, name: str) -> float:
        raise self._lacks(name)

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            if name.startswith("_"):
                raise AttributeError(name)
            return self[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def _table(self) -> Table:
        """Return the metrics with their units and meanings, and the doubts about the result."""
        rows: list[Row] = [
            (name, self._formatted(name, value), METRICS[name].description)
            for name, value in self.items()
        ]
        if self.validity:
            rows.append(("validity", self.validity, ""))
        return Table(tuple(rows), ("metric", "value", "meaning"), "impact metrics")

    def _formatted(self, name: str, value: float) -> str:
        return quantity(value, self.unit(name)) if math.isfinite(value) else NOT_KNOWN

    def __str__(self) -> str:
        if not self:
            return "no impact metrics: the run has no impact steps"
        return "\n".join(text_lines(self._table()))

    def _repr_html_(self) -> str:
        """Return a table of the metrics, for notebooks."""
        return html_table(self._table())


def start_w_of(stored: Stored) -> float:
    """Return the displacement of the plate under the load when the impact starts."""
    return _number(stored.attributes_of("history").get(START_W, 0.0))


def peak_and_deflection(stored: Stored) -> tuple[float, float]:
    """Return the peak force, and the deflection by the impact at that time, of the part of a deck.

    Returns zeros without a contact force.
    """
    force = stored["history/force"]
    if not force.any():
        return 0.0, 0.0
    peak = int(force.argmax())
    deflection = stored["history/plate_w"][peak] - start_w_of(stored)
    return float(force[peak]), float(deflection)


def impact_energy(stored: Stored) -> float:
    """Return the energy of the impact on the whole plate, without energy of a static load."""
    return stored.symmetry_factor * _energy_of_part(stored)


def _energy_of_part(stored: Stored) -> float:
    """Return the energy of the projectile of the deck before the impact."""
    energy = stored.attributes_of("energy")
    return _number(energy.get("initial")) - _number(energy.get(INITIAL_PLATE, 0.0))


def end_of(stored: Stored) -> End | None:
    """Return the state of the contact at the end of the run; None without impact steps."""
    metrics = _summarised(stored)
    return None if metrics is None else End(metrics.end.item())


def metrics_of(stored: Stored) -> dict[str, float]:
    """Return the impact metrics by name: NaN where not known, empty without impact steps."""
    if (metrics := _summarised(stored)) is None:
        return {}
    columns = metrics.columns | {"max_deflection": metrics.deflection}
    values: dict[str, float] = {name: columns[name].item() for name in METRICS if name in columns}
    return values | {name: int(values[name]) for name in INTEGERS if math.isfinite(values[name])}


@computed_once
def _summarised(stored: Stored) -> Metrics | None:
    """Return the metrics of the run as a single case; None without impact steps."""
    if "history/force" not in stored or not len(stored["history/force"]):
        return None
    force, time, indentation = (
        stored[f"history/{name}"] for name in ("force", "time", "indentation")
    )
    history = stored.attributes_of("history")
    depths = IndentationMetrics(
        largest=indentation.max(keepdims=True, initial=0.0),
        last=indentation[-1:],
        permanent=np.array([_number(history.get("permanent_indentation"))]),
        work=stored["energy/contact_work"][-1:],
    )
    initial = _energy_of_part(stored)
    velocity = np.float64(_impact_velocity(stored))
    with np.errstate(all="ignore"):
        return impact_metrics(
            force[:, None],
            time,
            depths,
            Projectiles(mass=2.0 * initial / velocity**2, velocity=velocity),
            deflection_of(stored),
            threshold=_number(stored.threshold.get("force")) if stored.threshold else None,
            mobility=_number(history.get(MOBILITY, 0.0)),
            factor=stored.symmetry_factor,
            plate_mass=_number(history.get(PLATE_MASS)),
        )


def steps_to_decide(stored: Stored) -> int | None:
    """Return the number of steps after which the plate can't reach the projectile any more.

    Returns None if no number of steps is known to decide it.
    """
    summarised = _summarised(stored)
    if summarised is None:
        return None
    time = float(time_to_decide(summarised.last, summarised.plate)[0])
    dt = float(np.diff(stored["history/time"][-2:], prepend=0.0)[-1])
    return math.ceil(time / dt) if math.isfinite(time) else None


def deflection_of(stored: Stored) -> Deflection:
    """Return the motion of the plate under the load in a run with impact steps."""
    energy = stored["energy/plate_kinetic"] + stored["energy/plate_strain"]
    rest = stored.attributes_of("history").get(REST_W)
    if rest is not None:  # the energy above the equilibrium under the load
        of_plate = _number(stored.attributes_of("energy").get(INITIAL_PLATE, 0.0))
        energy = energy - of_plate - stored["energy/external_work"]
    times, rigid = stored["history/time"], None
    if mobility := _number(stored.attributes_of("history").get(MOBILITY, 0.0)):
        rigid = RigidMotion.of(stored["history/force"][:, None], times, mobility)
    return Deflection.of(
        stored["history/plate_w"][:, None],
        times,
        energy[:, None],
        _energy_of_part(stored),
        rigid,
        start=start_w_of(stored),
        rest=0.0 if rest is None else _number(rest),
    )


def _impact_velocity(stored: Stored) -> float:
    """Return the impact velocity of the deck; NaN if the deck can't be read or has none."""
    with contextlib.suppress(ResultFileError):
        if (card := stored.deck.last(Impact)) is not None and card.velocity:
            return card.velocity
    return math.nan


def _number(value: object) -> float:
    """Return an attribute of a file if it is a number, else NaN."""
    return float(value) if isinstance(value, int | float) else math.nan
