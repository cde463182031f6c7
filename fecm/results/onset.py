"""Impact energy at which the peak force reaches a level, scaled from one run.

The plate's energy at the peak grows as the square of the force. With NONL the plate is a spring
F = K w + K_3 w^3, whose two parts have the membrane's share of the run's strain energy. Hertz's
contact stores 2/5 F alpha, which grows as F^(5/3). These powers are exact for a heavy projectile on
a linear plate, and for a light one whose energy stays in the indentation.

Linear plates of D7136 under 3 g to 5.5 kg deviate by at most 3.5 % of the energy from the search
`fecm sweep --find velocity`, plates with NONL by 3 %.
"""

from __future__ import annotations

import math

import numpy as np

from fecm.judge.end import OPEN_PEAKS
from fecm.mechanics.roots import root
from fecm.results.metrics import INITIAL_PLATE
from fecm.results.run_metrics import end_of, impact_energy, start_w_of
from fecm.results.schema import Kinematics
from fecm.results.stored import Stored

CONTACT = 0.4  # of F alpha: energy of a contact F = k alpha^1.5
CONTACT_POWER = 5.0 / 3.0  # of the force
MOST_RATIO = 1.5  # of a level over the peak force, up to which a nonlinear plate is extrapolated


def energy_at_force(stored: Stored, force: float) -> float:
    """Return the energy of the impact, by the same projectile, whose peak force is `force`.

    Parameters
    ----------
    stored : Stored
        Result of a run with impact.
    force : float
        Peak force on the whole plate.

    Returns
    -------
    float
        Energy, force*length. It is NaN without a contact, if the peak is open or the plate is
        loaded before the impact, with a contact law of the user, for a nonlinear curved panel, and
        for a force far above the peak of a nonlinear plate.
    """
    if end_of(stored) is None or end_of(stored) in OPEN_PEAKS or "law" in stored.attributes:
        return math.nan
    if start_w_of(stored) or stored.attributes_of("energy").get(INITIAL_PLATE):
        return math.nan
    forces = stored.whole("history/force")
    row = int(forces.argmax())
    peak, share = float(forces[row]), membrane_share(stored)
    if not peak > 0.0 or math.isnan(share):
        return math.nan
    contact = CONTACT * peak * float(stored["history/indentation"][row])
    ratio = force / peak
    if share and ratio > MOST_RATIO:
        return math.nan
    plate = (impact_energy(stored) - contact) * _spring_energy(ratio, share / (1.0 - share))
    return plate + contact * math.pow(ratio, CONTACT_POWER)


def _spring_energy(ratio: float, membrane: float) -> float:
    """Return the energy of the spring F = w + 2 m w^3 at a ratio of the force at w = 1.

    The energy is relative to the energy at w = 1; m is the membrane's energy over the bending's.
    """
    force = ratio * (1.0 + 2.0 * membrane)
    w = root(lambda w: w * (1.0 + 2.0 * membrane * w * w) - force, 0.0, max(1.0, force), 1e-12)
    return w * w * (1.0 + membrane * w * w) / (1.0 + membrane)


def membrane_share(stored: Stored) -> float:
    """Return the membrane's share of the strain energy at the stored row nearest to the peak force.

    It is 0 for a linear plate, and NaN if the result does not have it or the panel is curved.
    """
    if stored.kinematics == Kinematics.LINEAR:
        return 0.0
    if "mesh/z" in stored or not all(
        path in stored and stored[path].size
        for path in ("membrane/energy", "membrane/strain_energy")
    ):
        return math.nan
    time = stored["history/time"][stored["history/force"].argmax()]
    row = int(np.abs(stored["membrane/time"] - time).argmin())
    elastic = float(stored["membrane/strain_energy"][row])
    if "membrane/preload_energy" in stored:
        elastic -= float(stored["membrane/preload_energy"][row])
    return float(stored["membrane/energy"][row] / elastic) if elastic > 0.0 else math.nan
