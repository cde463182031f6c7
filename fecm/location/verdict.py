"""Whether a location is to be trusted."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fecm.deck.units import unit_of
from fecm.identification.misfit import COLOURED
from fecm.location.causes import Cause
from fecm.location.force import CLEAR
from fecm.location.location import Location
from fecm.location.search import Region

RIVAL = 1.1  # misfit ratio of a place that can hardly be told from the first
NOT_DESCRIBED = 1.5  # misfit over the noise
UNLIKELY = 3.0  # standard deviations of a misfit that noise explains
LARGE = 0.01  # strain: plies fail at one to two per cent
LEFT = 0.5  # share of the squares of a gage that is not described
OF_MESH = 0.8  # share of the mesh in the standard deviation of the place
VAGUE = 0.25  # standard deviation of a place over the side of the region


def is_doubtful(found: Location) -> bool:
    """Whether the model does not describe the strains down to their noise."""
    bad = found.misfit > NOT_DESCRIBED or neighbours(found) > COLOURED
    return bad or found.misfit > likely_misfit(found) or bool(undescribed_gages(found))


def likely_misfit(found: Location) -> float:
    """Largest misfit that noise explains: its standard deviation is 1/sqrt(2 n) of n values."""
    parameters = 2 + int((found.force > 0.0).sum())
    return 1.0 + UNLIKELY / math.sqrt(2.0 * max(1, found.strains.size - parameters))


def undescribed_gages(found: Location) -> list[int]:
    """Numbers of gages whose residual has a shape, and is a large share of their strains."""
    rest = found.strains - found.fitted
    own = (rest**2).sum(axis=1)
    follow = (rest[:, 1:] * rest[:, :-1]).sum(axis=1)
    large = own > LEFT * (found.strains**2).sum(axis=1)
    return [int(n) for n in found.gages[large & (follow > COLOURED * own)]]


def judged(found: Location, region: Region, wide: bool, cause: Cause | None) -> Location:
    """The location with its notes, and whether it is accepted.

    `wide`: whether narrower hats of the force describe the strains better; `cause`: what may be
    wrong with the strains.
    """
    serious = [*_serious(found, region)]
    if cause is not None:
        serious.append(str(cause))
    return replace(found, notes=(*serious, *_remarks(found, wide)), accepted=not serious)


def _serious(found: Location, region: Region) -> Iterator[str]:
    """Reasons not to accept a location."""
    near = neighbours(found)
    compare = "compare supports, laminate, patch, mesh and gages with those of the test"
    share = float(((found.strains - found.fitted) ** 2).sum() / (found.strains**2).sum())
    if found.misfit > NOT_DESCRIBED:
        yield (
            f"the model does not describe these signals: the residual is {found.misfit:.2g} times "
            f"the noise; {compare}"
        )
    elif not found.noise_given and near > COLOURED:
        yield (
            f"the model does not describe these signals: neighbouring residuals have the "
            f"correlation {near:.2f}, and {100.0 * share:.2g} % of the squares of the strains are "
            f"left; {compare}"
        )
    elif gages := undescribed_gages(found):
        which = ", ".join(map(str, gages))
        yield (
            f"the model does not describe gage {which}: more than half of the squares of its "
            f"strains are left; {compare}"
        )
    largest = float(np.abs(found.strains).max())
    if largest > LARGE:
        yield (
            f"the largest strain is {100.0 * largest:.2g} %, at which plies fail: the peak force "
            "is doubtful; are the strains in per cent?"
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
    near = neighbours(found)
    if likely_misfit(found) < found.misfit <= NOT_DESCRIBED:
        yield (
            f"the residual is {found.misfit:.3g} times the noise, which chance does not explain: "
            "the model has errors, and the standard deviations are multiplied by it"
        )
    if found.noise_given and near > COLOURED:
        yield (
            f"neighbouring residuals have the correlation {near:.2f}: the model does not describe "
            "the strains down to their noise, and the standard deviations are too small"
        )
    if found.mesh_error is None:
        yield "the standard deviations do not include the error of the mesh, which is unknown"
    elif found.mesh_error > OF_MESH * math.hypot(found.sd_x, found.sd_y):
        length = f"{found.mesh_error:.2g} {unit_of('length', found.units)}".rstrip()
        yield (
            f"elements half as long move the place by {length}, which is in the standard "
            "deviations; take a finer mesh"
        )
    if found.contact_end is None:
        until = f"{found.determined_until:.4g} {clock}".rstrip()
        yield f"the force has not ended at {until}: the impulse is at least that until then"


def neighbours(found: Location) -> float:
    """Correlation of residuals that follow each other."""
    rest = found.strains - found.fitted
    size = float((rest**2).sum())
    return float((rest[:, 1:] * rest[:, :-1]).sum()) / size if size else 0.0
