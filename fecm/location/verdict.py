"""Verdict on a location: which of the limits of the judge its values exceed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from fecm.deck.units import unit_of
from fecm.judge.fits import COLOURED
from fecm.judge.locations import (
    AT_EDGE,
    FAINT_FORCE,
    LARGE_MESH_ERROR,
    LARGE_STRAIN,
    MISFIT,
    OPEN_FORCE,
    RIVAL,
    SHAPED_NOISE,
    SHAPED_SIGNALS,
    UNDESCRIBED_GAGE,
    UNKNOWN_MESH_ERROR,
    UNLIKELY_MISFIT,
    VAGUE,
    WIDE_HATS,
)
from fecm.location.causes import Cause
from fecm.location.location import Location
from fecm.location.search import Region


def is_doubtful(location: Location) -> bool:
    """Return whether the model does not describe the strains down to their noise."""
    is_poor = location.misfit > MISFIT.value or residual_correlation(location) > COLOURED
    return is_poor or location.misfit > likely_misfit(location) or bool(undescribed_gages(location))


def likely_misfit(location: Location) -> float:
    """Return the largest misfit that noise explains.

    Its standard deviation is 1/sqrt(2 n) for n values.
    """
    parameters = 2 + int((location.force > 0.0).sum())
    return 1.0 + UNLIKELY_MISFIT.value / math.sqrt(2.0 * max(1, location.strains.size - parameters))


def undescribed_gages(location: Location) -> list[int]:
    """Return the gages whose residual has a shape and is a large share of their strains."""
    residual = location.strains - location.fitted
    energies = (residual**2).sum(axis=1)
    neighbours = (residual[:, 1:] * residual[:, :-1]).sum(axis=1)
    large = energies > UNDESCRIBED_GAGE.value * (location.strains**2).sum(axis=1)
    return [int(n) for n in location.gages[large & (neighbours > COLOURED * energies)]]


def judged(
    location: Location,
    region: Region,
    wide: bool,
    cause: Cause | None,
    faults: Sequence[str] = (),
) -> Location:
    """Return the location with its notes and the verdict whether it is accepted.

    `wide` says whether narrower hats of the force would describe the strains better. `cause` says
    what may be wrong with the strains. `faults` are those of their records.
    """
    reasons = [*faults, *_reasons_to_reject(location, region)]
    if cause is not None:
        reasons.append(str(cause))
    return replace(location, notes=(*reasons, *_remarks(location, wide)), accepted=not reasons)


def _reasons_to_reject(location: Location, region: Region) -> Iterator[str]:
    """Yield the reasons to reject a location."""
    correlation = residual_correlation(location)
    share = float(((location.strains - location.fitted) ** 2).sum() / (location.strains**2).sum())
    if location.misfit > MISFIT.value:
        yield MISFIT.say(misfit=location.misfit)
    elif not location.noise_given and correlation > SHAPED_SIGNALS.value:
        yield SHAPED_SIGNALS.say(correlation=correlation, share=100.0 * share)
    elif gages := undescribed_gages(location):
        yield UNDESCRIBED_GAGE.say(gages=", ".join(map(str, gages)))
    largest = float(np.abs(location.strains).max())
    if largest > LARGE_STRAIN.value:
        yield LARGE_STRAIN.say(percent=100.0 * largest)
    if location.second is not None and location.second.ratio < RIVAL.value:
        yield RIVAL.say(**location.second._asdict())
    if region.at_edge(location.x, location.y):
        yield AT_EDGE.say()
    for name, error, side in zip("xy", (location.sd_x, location.sd_y), region.size, strict=True):
        if not error < VAGUE.value * side:
            yield VAGUE.say(name=name, error=error, side=side)
    peak = int(np.abs(location.time - location.time_of_peak).argmin())
    if location.peak_force < FAINT_FORCE.value * float(location.force_sd[peak]):
        yield FAINT_FORCE.say()


def _remarks(location: Location, wide: bool) -> Iterator[str]:
    """Yield the notes that do not reject a location."""
    time_unit = unit_of("time", location.units)
    if wide:
        half = f"{0.5 * (location.time[1] - location.time[0]):.3g} {time_unit}".rstrip()
        yield WIDE_HATS.say(half=half)
    correlation = residual_correlation(location)
    if likely_misfit(location) < location.misfit <= MISFIT.value:
        yield UNLIKELY_MISFIT.say(misfit=location.misfit)
    if location.noise_given and correlation > SHAPED_NOISE.value:
        yield SHAPED_NOISE.say(correlation=correlation)
    if location.mesh_error is None:
        yield UNKNOWN_MESH_ERROR.say()
    elif location.mesh_error > LARGE_MESH_ERROR.value * math.hypot(location.sd_x, location.sd_y):
        length = f"{location.mesh_error:.2g} {unit_of('length', location.units)}".rstrip()
        yield LARGE_MESH_ERROR.say(length=length)
    if location.contact_end is None:
        yield OPEN_FORCE.say(until=f"{location.determined_until:.4g} {time_unit}".rstrip())


def residual_correlation(location: Location) -> float:
    """Return the correlation of consecutive residuals."""
    residual = location.strains - location.fitted
    size = float((residual**2).sum())
    return float((residual[:, 1:] * residual[:, :-1]).sum()) / size if size else 0.0
