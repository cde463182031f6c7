"""Limits of a place and a force that are located by strain gages.

Each reason to reject a location, and each remark, is a row with its limit and its words.
"""

from __future__ import annotations

from fecm.judge.fits import COLOURED, COMPARE
from fecm.judge.limits import STRAIN, ModelLimit

_SIGNALS = "the model does not describe these signals: "
_COMPARE_GAGES = COMPARE.format(what="gages")
MISFIT = ModelLimit(
    "residual over the noise",
    1.5,
    note=f"{_SIGNALS}the residual is {{misfit:.2g}} times the noise",
    remedy=_COMPARE_GAGES,
)
SHAPED_SIGNALS = ModelLimit(
    "correlation of neighbouring residuals",
    COLOURED,
    note=f"{_SIGNALS}neighbouring residuals have the correlation {{correlation:.2f}}, and "
    "{share:.2g} % of the squares of the strains are left",
    remedy=_COMPARE_GAGES,
)
UNDESCRIBED_GAGE = ModelLimit(
    "residual with a shape, of the squares of a gage's strains",
    0.5,
    note="the model does not describe gage {gages}: more than half of the squares of its strains "
    "are left",
    remedy=_COMPARE_GAGES,
)
LARGE_STRAIN = STRAIN._replace(
    note="the largest strain is {percent:.2g} %, at which plies fail: the peak force is doubtful; "
    "are the strains in per cent?",
)
RIVAL = ModelLimit(
    "misfit of a second place over the first",
    1.1,
    note="({x:.4g}, {y:.4g}) explains the strains almost as well: its misfit is {ratio:.3f} times "
    "the misfit of the located place",
)
AT_EDGE = ModelLimit(
    "edge of the region",
    note="the place is on the edge of the region; the impact may be outside",
)
VAGUE = ModelLimit(
    "standard deviation of the place, over the side of the region",
    0.25,
    note="{name} is not determined: its standard deviation is {error:.3g}, and the region is "
    "{side:.3g} wide",
)
FAINT_FORCE = ModelLimit(
    "peak force over its standard deviation",
    3.0,
    note="the force is not above its noise",
)
LIKELY_CAUSE = ModelLimit(
    "misfit over that without a mistake of the record",
    note="{cause} the strains {ratio:.2g} times better",
)
WIDE_HATS = ModelLimit(
    "time between two values of the force",
    note="a value of the force every {half} describes the strains better: its error is not in the "
    "standard deviations",
    remedy="take a smaller basis",
)
# Standard deviations of the misfit that noise explains.
UNLIKELY_MISFIT = ModelLimit(
    "misfit in standard deviations above 1",
    3.0,
    note="the residual is {misfit:.3g} times the noise, which chance does not explain: the model "
    "has errors, and the standard deviations are multiplied by it",
)
SHAPED_NOISE = ModelLimit(
    "correlation of neighbouring residuals",
    COLOURED,
    note="neighbouring residuals have the correlation {correlation:.2f}: the model does not "
    "describe the strains down to their noise, and the standard deviations are too small",
)
UNKNOWN_MESH_ERROR = ModelLimit(
    "error of the mesh",
    note="the standard deviations do not include the error of the mesh, which is unknown",
)
LARGE_MESH_ERROR = ModelLimit(
    "error of the mesh over the standard deviation of the place",
    0.8,
    note="elements half as long move the place by {length}, which is in the standard deviations",
    remedy="take a finer mesh",
)
# Share of the largest strain.
UNCONFIRMED_STRAINS = ModelLimit(
    "difference from the run of the whole plate",
    0.02,
    note="the fitted strains differ by up to {largest:.1%} of the largest strain from a run of the "
    "whole plate under the force",
    remedy="take a region around the place",
)
BEYOND_PLATE = ModelLimit(
    "force on the plate that stretches",
    note="the plate stretches, and a force of {force:.4g} at ({x:.4g}, {y:.4g}), where the search "
    "on the linear plate ended, is beyond the reduced model",
    remedy="take a region around the place",
)
UNSETTLED_PLACE = ModelLimit(
    "effect of a run of the whole plate on the place",
    note="the plate stretches, and after {runs} runs of the whole plate another moves the place by "
    "{effect} standard deviations",
    remedy="take a region around the place; waves of a short impact that bends the plate by more "
    "than half its thickness are beyond the method",
)
OTHER_PLACES = ModelLimit(
    "places on the linear plate",
    note="the plate stretches: the search went on from the best place on the linear plate alone; "
    "other places were compared on the linear plate",
)
OPEN_FORCE = ModelLimit(
    "end of the force",
    note="the force has not ended at {until}: the impulse is a lower bound",
)
