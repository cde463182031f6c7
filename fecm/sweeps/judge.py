"""Validity of cases, and the columns that are measured on request."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.laminate import threshold_force
from fecm.problem.problem import Problem
from fecm.results.end import decided
from fecm.results.exposures import largest_exposures
from fecm.results.metrics import EXPOSURES, GAGE, RATIO, THRESHOLD_FORCE, Metrics
from fecm.results.result import Result
from fecm.results.validity import Extent
from fecm.sweeps.outcome import About, Outcome
from fecm.sweeps.plan import Measure


class Peak(NamedTuple):
    """Largest and last value of a history of cases, (cases,) each."""

    largest: Floats
    last: Floats


def thresholds_of(checked: Problem, toughness: Floats) -> Floats | None:
    """Return the delamination thresholds (force) of cases; None without a DELA segment.

    `toughness` (force/length) is (cases,).
    """
    if (own := checked.threshold) is None:
        return None
    values = {g: threshold_force(own.rigidity, g, own.number) for g in set(toughness.tolist())}
    return np.array([values[g] for g in toughness.tolist()])


def judge(
    outcome: Outcome,
    checked: Problem,
    measures: Sequence[Measure],
    metrics: Metrics,
    *,
    peaks: Mapping[str, Peak],
    indentation: Floats,
    of_rows: Collection[str] = (),
) -> None:
    """Add the validity of cases, and the columns of what was measured, with its open values.

    `peaks` has the strains of gages and the exposures, `indentation` (cases,) is the largest.
    `of_rows` has the reasons that the stored rows of a full run gave.
    """
    rules, end, plate = checked.judge, metrics.end, metrics.plate
    known = {name: decided(peak.largest, peak.last, end) for name, peak in peaks.items()}
    deflection = plate.largest
    if rules.mobility:  # the plate moves as a whole
        deflection = np.full(len(end), np.nan)
    exposures = [peak.largest for name, peak in peaks.items() if name in EXPOSURES]
    extent = Extent(
        end=end,
        peak=outcome.columns[About.REACHED],
        indentation=indentation,
        deflection=deflection,
        exposure=np.nanmax(exposures, axis=0) if exposures else np.nan,
        threshold=metrics.columns.get(THRESHOLD_FORCE, np.nan),
        of_rows=of_rows,
    )
    ratio = metrics.deflection / rules.thickness
    if Measure.DEFLECTION in measures:
        known[Measure.DEFLECTION] = metrics.deflection
    known[RATIO] = np.where(np.isnan(deflection), np.nan, ratio)
    outcome.columns |= {**known, About.VALIDITY: rules.validity(extent)}


def peaks_of(measures: Sequence[Measure], result: Result) -> dict[str, Peak]:
    """Peaks of the columns of a run that are measured on request."""
    peaks: dict[str, Peak] = {}
    if Measure.GAGES in measures and "gages/number" in result:
        strains = np.abs(result["gages/strain"]).T
        numbers = result["gages/number"]
        for number, values in zip(numbers, strains, strict=True):
            peaks[f"{GAGE}{number}"] = Peak(values.max(keepdims=True), values[-1:])
    for one in largest_exposures(result) if Measure.FAILURE in measures else ():
        last = one.exposure if one.time >= result["history/time"][-1] else 0.0
        peaks[f"exposure_{one.criterion}"] = Peak(np.array([one.exposure]), np.array([last]))
    return peaks
