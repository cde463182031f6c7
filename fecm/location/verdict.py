"""Whether a location is to be trusted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fecm.deck.units import unit_of
from fecm.identification.misfit import COLOURED, UNDESCRIBED
from fecm.location.force import CLEAR
from fecm.location.location import Location
from fecm.location.search import Region

RIVAL = 1.1  # misfit ratio of a place that can hardly be told from the first
NOT_DESCRIBED = 3.0  # misfit over the noise
VAGUE = 0.25  # standard deviation of a place over the side of the region


def judged(found: Location, region: Region, wide: bool) -> Location:
    """The location with its notes, and whether it is accepted.

    `wide`: whether narrower hats of the force describe the strains better.
    """
    serious = [*_serious(found, region)]
    return replace(found, notes=(*serious, *_remarks(found, wide)), accepted=not serious)


def _serious(found: Location, region: Region) -> Iterator[str]:
    """Reasons not to accept a location."""
    if found.misfit > NOT_DESCRIBED:
        yield (
            f"the model does not describe these signals: the residual is {found.misfit:.2g} times "
            "the noise; compare supports, laminate, patch and gages with those of the test"
        )
    elif not found.noise_given and _undescribed(found):
        share = float(((found.strains - found.fitted) ** 2).sum() / (found.strains**2).sum())
        yield (
            f"the model does not describe these signals: {100.0 * share:.0f} % of their squares "
            "are left; compare supports, laminate, patch and gages with those of the test"
        )
    if found.second is not None and found.second.ratio < RIVAL:
        x, y, ratio = found.second
        yield (
            f"({x:.4g}, {y:.4g}) explains the strains almost as well: its misfit is {ratio:.3f} "
            "times that of the place found"
        )
    if region.at_edge(found.x, found.y):
        yield "the place is on the edge of the region; the impact may be outside"
    for name, error, side in zip("xy", (found.sd_x, found.sd_y), region.size, strict=True):
        if not error < VAGUE * side:
            yield (
                f"{name} is not determined: its standard deviation is {error:.3g}, and the region "
                f"is {side:.3g} wide"
            )
    top = int(np.abs(found.time - found.time_of_peak).argmin())
    if found.peak_force < CLEAR * float(found.force_sd[top]):
        yield "the force is not above its noise"


def _remarks(found: Location, wide: bool) -> Iterator[str]:
    """Other notes."""
    clock = unit_of("time", found.units)
    if wide:
        half = f"{0.5 * (found.time[1] - found.time[0]):.3g} {clock}".rstrip()
        yield (
            f"a force every {half} describes the strains better: its error is not in the standard "
            "deviations; take a smaller basis"
        )
    near = _neighbours(found)
    if near > COLOURED:
        yield (
            f"neighbouring residuals have the correlation {near:.2f}: the model does not describe "
            "the strains down to their noise, and the standard deviations are too small"
        )
    if found.contact_end is None:
        until = f"{found.determined_until:.4g} {clock}".rstrip()
        yield f"the force has not ended at {until}: the impulse is that until then"


def _neighbours(found: Location) -> float:
    """Correlation of residuals that follow each other."""
    rest = found.strains - found.fitted
    size = float((rest**2).sum())
    return float((rest[:, 1:] * rest[:, :-1]).sum()) / size if size else 0.0


def _undescribed(found: Location) -> bool:
    """Whether a residual with a shape is a large share of the strains."""
    rest = float(((found.strains - found.fitted) ** 2).sum())
    return rest > UNDESCRIBED * float((found.strains**2).sum()) and _neighbours(found) > COLOURED
