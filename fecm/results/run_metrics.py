"""Impact metrics of one run, and the state of the contact at its end."""

from __future__ import annotations

import contextlib
import math

import numpy as np

from fecm.deck.model import Impact
from fecm.results.end import End, decided
from fecm.results.errors import ResultFileError
from fecm.results.metrics import (
    INTEGERS,
    METRICS,
    MOBILITY,
    Indentation,
    Metrics,
    Projectiles,
    summarise,
)
from fecm.results.stored import Stored


def end_of(stored: Stored) -> End | None:
    """State of the contact at the end of the run; None without impact steps."""
    found = _summarised(stored)
    return None if found is None else End(found.end.item())


def metrics_of(stored: Stored) -> dict[str, float]:
    """Impact metrics by their names; NaN where they are not known, empty without impact steps."""
    if (found := _summarised(stored)) is None:
        return {}
    w = stored["history/plate_w"]
    columns = found.columns | {"max_deflection": decided(w[[w.argmax()]], w[-1:], found.end)}
    values: dict[str, float] = {name: columns[name].item() for name in METRICS if name in columns}
    return values | {name: int(values[name]) for name in INTEGERS if math.isfinite(values[name])}


def _summarised(stored: Stored) -> Metrics | None:
    """Metrics of the run as of a single case; None without impact steps."""
    if "history/force" not in stored or not len(stored["history/force"]):
        return None
    force, time, indentation = (
        stored[f"history/{name}"] for name in ("force", "time", "indentation")
    )
    history = stored.attributes_of("history")
    depths = Indentation(
        largest=indentation.max(keepdims=True, initial=0.0),
        last=indentation[-1:],
        permanent=np.array([_number(history.get("permanent_indentation"))]),
    )
    initial = _number(stored.attributes_of("energy").get("initial"))
    velocity = np.float64(_impact_velocity(stored))
    with np.errstate(all="ignore"):
        return summarise(
            force[:, None],
            time,
            depths,
            Projectiles(mass=2.0 * initial / velocity**2, velocity=velocity),
            threshold=_number(stored.threshold.get("force")) if stored.threshold else None,
            mobility=_number(history.get(MOBILITY, 0.0)),
        )


def _impact_velocity(stored: Stored) -> float:
    """Impact velocity of the deck; NaN if the deck can't be read or has none."""
    with contextlib.suppress(ResultFileError):
        if (card := stored.deck.last(Impact)) is not None and card.velocity:
            return card.velocity
    return math.nan


def _number(value: object) -> float:
    """A number of a file's attribute; NaN for anything else."""
    return float(value) if isinstance(value, int | float) else math.nan
