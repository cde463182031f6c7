"""Impact metrics of one run, and the state of the contact at its end."""

from __future__ import annotations

import contextlib
import math

import numpy as np

from fecm._errors import ResultFileError
from fecm.deck.model import Impact
from fecm.results.end import Deflection, End, time_to_decide
from fecm.results.metrics import (
    INTEGERS,
    METRICS,
    MOBILITY,
    IndentationMetrics,
    Metrics,
    Projectiles,
    impact_metrics,
)
from fecm.results.stored import Stored


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
    initial = _number(stored.attributes_of("energy").get("initial"))
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
        )


def steps_to_decide(stored: Stored) -> int | None:
    """Return the number of steps after which the plate can't reach the projectile any more.

    Returns None if no number of steps is known to decide it.
    """
    summarised = _summarised(stored)
    if summarised is None or not summarised.is_held:
        return None
    time = float(time_to_decide(summarised.last, summarised.plate)[0])
    dt = float(np.diff(stored["history/time"][-2:], prepend=0.0)[-1])
    return math.ceil(time / dt) if math.isfinite(time) else None


def deflection_of(stored: Stored) -> Deflection:
    """Return the motion of the plate under the load in a run with impact steps."""
    energy = stored["energy/plate_kinetic"] + stored["energy/plate_strain"]
    initial = _number(stored.attributes_of("energy").get("initial"))
    return Deflection.of(stored["history/plate_w"], stored["history/time"], energy, initial)


def _impact_velocity(stored: Stored) -> float:
    """Return the impact velocity of the deck; NaN if the deck can't be read or has none."""
    with contextlib.suppress(ResultFileError):
        if (card := stored.deck.last(Impact)) is not None and card.velocity:
            return card.velocity
    return math.nan


def _number(value: object) -> float:
    """Return an attribute of a file if it is a number, else NaN."""
    return float(value) if isinstance(value, int | float) else math.nan
