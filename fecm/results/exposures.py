"""Exposures of FAIL: largest values, number of evaluations, and first failure."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Annotated, Any, NamedTuple, TypedDict, cast

import numpy as np

from fecm._errors import ResultFileError
from fecm._typing import Array, Floats
from fecm.deck.material_cards import MATERIAL
from fecm.judge.criteria import INTERLAMINAR, criteria_of, materials_at, mode_at, where
from fecm.judge.exposure_bands import LoadMesh, mesh_band
from fecm.judge.exposures import LargestExposure
from fecm.results.stored import Stored, computed_once

TIE = 1e-9  # relative difference of equal exposures; see fecm/mechanics/exposures.py
# Attributes of a criterion's group, with CURE.
AT_REST = "at_rest"
LOAD_FACTOR = "load_factor"


@computed_once
def largest_exposures(stored: Stored) -> list[LargestExposure]:
    """Return the largest exposure of each criterion, outside the load and on its circle.

    Ties go to the lowest element, point and ply. The list is empty without FAIL. Raises
    ResultFileError if the result names no such mode.
    """
    if "failure/x" not in stored:
        return []
    largest = []
    for number, criterion in enumerate(criteria_of(stored.attributes_of("failure"))):
        candidates = [_outside(stored, criterion), _on_circle(stored, criterion, number)]
        present = [candidate for candidate in candidates if candidate is not None]
        if present:
            largest.append(max(present, key=lambda candidate: candidate.exposure))
    return largest


def _outside(stored: Stored, criterion: str) -> LargestExposure | None:
    """Return the largest exposure of a criterion at points outside the load, if there are any."""
    exposure = stored[f"failure/{criterion}/exposure"]
    outside = np.where(near_load(stored, criterion), -1.0, exposure)
    if not outside.size or not (outside >= 0.0).any():
        return None
    limit = np.nanmax(outside) * (1.0 - TIE)
    place = np.unravel_index(int((outside >= limit).argmax()), outside.shape)
    # (element, point, ply, face), or (element, interface)
    points = 2 if exposure.ndim > 2 else 1
    point, ply = place[:points], place[points]
    x, y = stored["failure/x"], stored["failure/y"]
    tied = (outside >= limit).reshape(*outside.shape[:points], -1).any(axis=-1)
    return _largest(
        stored,
        criterion,
        float(exposure[place]),
        int(stored[f"failure/{criterion}/mode"][place]),
        int(ply) + 1,
        float(x[point].mean()),
        float(y[point].mean()),
        float(stored[f"failure/{criterion}/time"][place]),
        int(np.count_nonzero(tied)) - 1,
    )


def _on_circle(stored: Stored, criterion: str, number: int) -> LargestExposure | None:
    """Return the largest exposure of a criterion on the circle around the load, if it has one."""
    path = "failure/circle"
    if f"{path}/exposure" not in stored:
        return None
    exposure, mode, ply, x, y, time, points = (
        stored[f"{path}/{name}"][number].item()
        for name in ("exposure", "mode", "ply", "x", "y", "time", "points")
    )
    if not exposure >= 0.0:
        return None
    return _largest(stored, criterion, exposure, mode, ply, x, y, time, points - 1)


def _largest(
    stored: Stored,
    criterion: str,
    exposure: float,
    code: int,
    ply: int,
    x: float,
    y: float,
    time: float,
    mirrors: int,
) -> LargestExposure:
    """Return an exposure with the name of its mode and the contribution of CURE."""
    modes = stored.attributes_of("failure").get("modes", ())
    if not 0 <= code < len(modes):
        raise ResultFileError(f"failure/{criterion}/mode has the mode {code}, which has no name")
    about = stored.attributes_of(f"failure/{criterion}")
    mesh = LoadMesh.of_attributes(stored.attributes_of("failure/circle"))
    band = None if mesh is None else mesh_band(exposure, criterion, mesh)
    mode, materials = of_material(stored, criterion, ply, (x, y), modes[code])
    return LargestExposure(
        criterion,
        exposure=exposure,
        mode=mode,
        ply=ply,
        x=x,
        y=y,
        time=time,
        mirrors=mirrors,
        band=band,
        at_rest=_number(about.get(AT_REST)),
        load_factor=_number(about.get(LOAD_FACTOR)),
        materials=materials,
    )


def of_material(
    stored: Stored, criterion: str, ply: int, place: tuple[float, float], mode: str
) -> tuple[str, tuple[str, ...]]:
    """Return the name of a mode in a ply, and the materials of the ply or the interface.

    The mode remains as it is, without materials, if the result's deck does not have the ply.
    """
    try:
        deck, laminate = stored.deck, _laminate_at(stored, place)
        return (
            mode_at(deck, laminate, criterion, ply, mode),
            materials_at(deck, laminate, criterion, ply),
        )
    except (ResultFileError, LookupError):
        return mode, ()


def _laminate_at(stored: Stored, place: tuple[float, float]) -> int:
    """Return the number of the laminate of the element whose points are nearest to a place."""
    if "mesh/laminate" not in stored:
        return MATERIAL
    x, y = stored["failure/x"], stored["failure/y"]
    element = int(np.hypot(x - place[0], y - place[1]).argmin()) // x.shape[1]
    return int(stored["mesh/laminate"][element])


def _number(value: object) -> float | None:
    """Return an attribute if it is a number, else None."""
    return float(value) if isinstance(value, int | float) else None


def near_load(stored: Stored, criterion: str) -> Array:
    """Return a mask of the exposures of a criterion under the load, in a shape that fits them."""
    if criterion == INTERLAMINAR and "failure/centre_under_load" in stored:
        return np.asarray(stored["failure/centre_under_load"] != 0)[:, None]
    under = stored["failure/under_load"] != 0
    if criterion == INTERLAMINAR:  # of older versions
        return np.asarray(under.any(axis=1))[:, None]
    return np.asarray(under[:, :, None, None])


def count_evaluations(stored: Stored) -> int:
    """Count the evaluations of FAIL at steps with a contact force; 0 without impact."""
    if "history/force" not in stored or "exposures/step" not in stored:
        return 0
    touching = stored["history/step"][stored["history/force"] > 0.0]
    return int(np.count_nonzero(np.isin(stored["exposures/step"], touching)))


def evaluations_in_contact(stored: Stored) -> int | None:
    """Return the stored :func:`count_evaluations`; None without FAIL and in older files."""
    count = stored.attributes_of("failure").get("evaluations_in_contact")
    return int(count) if isinstance(count, int | np.integer) else None


NEEDED = tuple(f"exposures/{name}" for name in ("time", "exposure", "mode", "ply", "x", "y"))


@dataclass(frozen=True)
class FirstFailure:
    """First time at which a criterion reaches an exposure outside the load: 1 for failure.

    FAIL evaluates every N-th pass, so that the time lies between two evaluations. Time, force and
    energy are interpolated linearly between them. Mode, ply and place belong to the largest
    exposure at the later evaluation.

    Attributes
    ----------
    criterion, mode : str
        Names of the criterion and of its mode.
    ply : int
        Its number from 1 at the struck face; an interface has the number of the ply above it.
    x, y : float
        Place.
    time : float
        When the criterion first reaches the level.
    earliest, latest : float
        The last evaluation below the level, 0 before the first evaluation, and the next one.
    force : float
        Contact force at this time; NaN without impact.
    energy : float
        Work of the contact force so far on plate and indentation: what the projectile has given up
        of its kinetic energy, force*length; NaN without impact.
    materials : tuple of str
        Material of the ply, or of both plies of an interface; empty if the deck has one material.
    """

    criterion: str
    mode: str
    ply: int
    x: float
    y: float
    time: float
    earliest: float
    latest: float
    force: float
    energy: float
    materials: tuple[str, ...] = ()

    @property
    def where(self) -> str:
        """The ply, or the interface, in words."""
        return where(self.criterion, self.ply, self.materials)


def first_failures(stored: Stored, level: float = 1.0) -> list[FirstFailure]:
    """Find the first time at which each criterion reaches an exposure, the earliest first.

    The list is empty without FAIL. Criteria that stay below the level are not in it.
    """
    if any(path not in stored for path in NEEDED):
        return []
    exposures, times = stored["exposures/exposure"], stored["exposures/time"]
    about = stored.attributes_of("failure")
    modes = dict(enumerate(map(str, about.get("modes", ()))))
    history = _history(stored)
    failures = []
    for number, (criterion, exposure) in enumerate(
        zip(criteria_of(about), exposures.T, strict=False)
    ):
        (reached,) = np.nonzero(exposure >= level)
        if not len(reached):
            continue
        row = int(reached[0])
        before, below = (times[row - 1], exposure[row - 1]) if row else (0.0, 0.0)
        share = (level - below) / (exposure[row] - below)
        time = float(before + share * (times[row] - before))
        mode, ply, x, y = (
            stored[f"exposures/{name}"][row, number].item() for name in ("mode", "ply", "x", "y")
        )
        name, materials = of_material(stored, criterion, ply, (x, y), modes.get(mode, "unknown"))
        failures.append(
            FirstFailure(
                criterion,
                mode=name,
                ply=ply,
                x=x,
                y=y,
                time=time,
                earliest=float(before),
                latest=float(times[row]),
                force=float(np.interp(time, history.time, history.force)),
                energy=float(np.interp(time, history.time, history.work)),
                materials=materials,
            )
        )
    return sorted(failures, key=lambda failure: failure.time)


def threshold_energy(stored: Stored) -> float:
    """Return the work of the contact force when it first reaches the delamination threshold.

    It is NaN if the force does not reach the threshold.
    """
    time = float(stored.threshold.get("time", math.nan)) if stored.threshold else math.nan
    if not math.isfinite(time):
        return math.nan
    history = _history(stored)
    return float(np.interp(time, history.time, history.work))


class _History(NamedTuple):
    """Contact force on the whole plate and its work at every step; NaN without impact."""

    time: Floats
    force: Floats
    work: Floats


def _history(stored: Stored) -> _History:
    if "history/force" not in stored:
        unknown = np.full(1, math.nan)
        return _History(np.zeros(1), unknown, unknown)
    time, force, tip = (
        np.concatenate([[0.0], stored.whole(f"history/{name}")])
        for name in ("time", "force", "displacement")
    )
    means = 0.5 * (force[1:] + force[:-1])
    # The tip's displacement is positive away from the plate.
    work = np.concatenate([[0.0], np.cumsum(-means * np.diff(tip))])
    return _History(time, force, work)


class ExposureHistoryJson(TypedDict):
    """Largest exposures outside the load so far, at every evaluation of FAIL."""

    time: list[float]
    exposure: Annotated[dict[str, list[float]], "A number for every time, by criterion."]


class CureJson(TypedDict, total=False):
    """Residual stresses of a run with FAIL and CURE, in JSON."""

    at_rest: Annotated[
        dict[str, float], "Largest exposure of the residual stresses alone, by criterion."
    ]
    load_factor: Annotated[
        dict[str, float],
        "Factor on the load's stresses at the largest exposure at which it is 1, by criterion.",
    ]


class FailureJson(CureJson):
    """Failure of a run with FAIL, in JSON."""

    evaluations_in_contact: Annotated[int | None, "Null in results of older versions."]
    largest: Annotated[dict[str, float], "Largest exposure outside the load, by criterion."]
    history: ExposureHistoryJson
    first: Annotated[
        list[Annotated[dict[str, Any], FirstFailure]], "First failures, the earliest first."
    ]


def failure_metrics(stored: Stored) -> FailureJson:
    """Return evaluations, largest exposures and first failures of a run with FAIL.

    ``history`` has the largest exposures so far at every evaluation. Runs with CURE also have the
    exposures at rest and the load factors.
    """
    times: list[float] = []
    so_far: dict[str, list[float]] = {}
    if "exposures/exposure" in stored and "exposures/time" in stored:
        times = stored["exposures/time"].tolist()
        columns = stored["exposures/exposure"].T.tolist()
        criteria = criteria_of(stored.attributes_of("failure"))
        so_far = dict(zip(criteria, columns, strict=False))
    return {
        "evaluations_in_contact": evaluations_in_contact(stored),
        "largest": {criterion: exposures[-1] for criterion, exposures in so_far.items()},
        "history": {"time": times, "exposure": so_far},
        "first": [asdict(failure) for failure in first_failures(stored)],
        **_of_cure(stored),
    }


def _of_cure(stored: Stored) -> CureJson:
    """Return the attributes of the criteria of a run with CURE, by criterion."""
    criteria = criteria_of(stored.attributes_of("failure"))
    groups = {name: stored.attributes_of(f"failure/{name}") for name in criteria}
    attribute_values = {
        attribute: {
            name: float(attributes[attribute])
            for name, attributes in groups.items()
            if attribute in attributes
        }
        for attribute in (AT_REST, LOAD_FACTOR)
    }
    return cast("CureJson", {name: values for name, values in attribute_values.items() if values})
