"""What of a fitted force is determined, and whether a location is to be trusted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fecm._typing import Bools, Floats
from fecm.deck.units import unit_of
from fecm.identification.misfit import COLOURED, UNDESCRIBED
from fecm.location.location import Location
from fecm.location.search import Region

UNCERTAIN = 5.0  # standard deviation of a force that is not determined, over the usual one
USUAL = 25.0  # percentile of the standard deviations that is the usual one
CLEAR = 3.0  # standard deviations of a force that is not 0
STAYS = 3  # hats that stay below at the end of the contact
RIVAL = 1.1  # misfit ratio of a place that can hardly be told from the first
NOT_DESCRIBED = 3.0  # misfit over the noise
VAGUE = 0.25  # standard deviation of a place over the side of the region


class Force(NamedTuple):
    """A fitted force as far as it is determined."""

    determined: Bools  # (hats,)
    determined_until: float
    peak: float
    time_of_peak: float
    end: float | None  # of the contact
    impulse: float


def judged_force(time: Floats, force: Floats, error: Floats, basis: float) -> Force:
    """Judge a force and its standard errors at the peaks of hats.

    A force shortly before the end of the record has not yet reached a gage: its standard error is
    far above those of the others, and it is not determined.
    """
    usual = float(np.percentile(error, USUAL))
    determined = error <= UNCERTAIN * usual
    known = np.where(determined, force, 0.0)
    top = int(known.argmax())
    quiet = known < CLEAR * error
    end = None
    for hat in range(top + 1, len(force)):
        after = slice(hat, hat + STAYS)
        if determined[hat] and quiet[after][determined[after]].all():
            end = hat
            break
    return Force(
        determined=determined,
        determined_until=float(time[np.flatnonzero(determined)[-1]]),
        peak=float(known[top]),
        time_of_peak=float(time[top]),
        end=None if end is None else float(time[end]),
        impulse=basis * float(known[:end].sum()),
    )


def doubts(found: Location, region: Region) -> Location:
    """The location with its notes, and whether it is accepted."""
    serious = [*_serious(found, region)]
    return replace(found, notes=(*serious, *_remarks(found)), accepted=not serious)


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


def _remarks(found: Location) -> Iterator[str]:
    """Other notes."""
    near = _neighbours(found)
    if near > COLOURED:
        yield (
            f"neighbouring residuals have the correlation {near:.2f}: the model does not describe "
            "the strains down to their noise, and the standard deviations are too small"
        )
    clock = unit_of("time", found.units)
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
