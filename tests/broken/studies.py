"""Sweeps and studies broken on purpose."""

from __future__ import annotations

import numpy as np

from fecm.identification import fitting
from fecm.location import model
from fecm.location.model import Footprint
from fecm.mechanics import half_space
from fecm.sweeps import convergence, distributions, statistics
from fecm.sweeps import random as random_values
from fecm.sweeps.responses import Convolution
from tests.breaks import (
    Breaks,
    changed,
    exchanged_matrices,
    in_numpy,
    instead,
    partly_given,
    value,
)

BREAKS: Breaks = {
    "a millionth of a step's force missing in the convolution": (
        in_numpy(instead(Convolution, "give", partly_given)), {"convolution": ("largest",)},
    ),
    "the matrices A and B exchanged": (
        instead(random_values, "matrix", exchanged_matrices), {"random-values": ("first", "total")},
    ),
    "the median of a lognormal law taken for its mean": (
        instead(distributions.ValueDistribution, "values",
                lambda right, law, unit: right(law, unit) * np.exp(-law.parameters[1] ** 2 / 2.0)),
        {"random-values": ("mean", "its")},
    ),
    "an interval of 90 %": (
        value(statistics, "Z", 1.6448536), {"random-values": ("lower", "upper")},
    ),
    "meshes in the opposite order": (
        instead(convergence, "_limit", lambda right, values, order: right(values[::-1], order)),
        {"refinement": ("",)},
    ),
    "the computed force 1 % too large": (
        changed(fitting.ForceModel, "at", lambda force: 1.01 * force), {"identification": ("",)},
    ),
    "the strains of the gages 1 % too large in their runs": (
        changed(model, "rows_of", lambda rows: 1.01 * rows), {"reciprocity": ("",)},
    ),
    "a force on the panel 2 mm beside its place, and 10 % too large": (
        instead(Footprint, "weights", lambda right, self, x, y: 1.1 * right(self, x + 2, y + 2)),
        {"location": ("",)},
    ),
    "E3 taken for the indentation modulus": (
        instead(half_space, "indentation_modulus", lambda _, C: 1.0 / np.linalg.inv(C)[2, 2]),
        {"contact-coefficient": ("",)},
    ),
}  # fmt: skip
