"""Panels with strain gages, and the strains of impacts on them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

import fecm
from fecm.deck import model
from fecm.deck.output_cards import Gage, Gages
from fecm.deck.segment import Segment
from tests.decks import DATA

Floats = NDArray[np.float64]
Place = tuple[float, float]

# x, y, z and degrees of gages off the axes of a plate of 100 x 80 mm.
OFF_AXIS = ((22.0, 18.0, 0.72, 0.0), (80.0, 24.0, 0.72, 45.0), (26.0, 64.0, 0.72, 90.0))
STRUCK = (61.0, 47.0)
SMALL = 0.5  # radius of a disc that acts as a point: both give places within .003
TIME = 3e-6 * np.arange(1.0, 101.0)

# Simply supported panel of 300 x 200 x 2 mm, [0/90/0/90/0]s, struck at (112.5, 81) by 20 g at
# 2 m/s, K = 1, disc of 4 mm, F = 2e4 alpha^1.5: Navier modes with shear deformation, not computed
# by fecm; half the waves change its strains by 5e-5 to 4e-4.  The noise is 2 %.
PUBLIC = np.loadtxt(DATA / "locate_public.csv", delimiter=",", skiprows=1)
PUBLIC_PLACE = (112.5, 81.0)
PUBLIC_PEAK, PUBLIC_IMPULSE = 161.019, 0.0374152
PUBLIC_GAGES = (
    (60.0, 50.0, 1.0, 0.0),
    (240.0, 60.0, 1.0, 45.0),
    (70.0, 150.0, 1.0, 90.0),
    (230.0, 140.0, -1.0, 0.0),
)


def with_patch(deck: fecm.Deck, radius: float, at: Place) -> fecm.Deck:
    """A deck with a disc, on the mesh that it has."""
    return replace(deck, segments=(*deck.segments, model.Patch("DISC", radius, *at)), text="")


def with_gages(deck: fecm.Deck, *places: tuple[float, float, float, float]) -> fecm.Deck:
    """A deck with other gages."""
    cards = Gages(tuple(Gage(number, *place) for number, place in enumerate(places, start=1)))
    others = tuple(s for s in deck.segments if not isinstance(s, Gages))
    return replace(deck, segments=(*others, cards), text="")


def without(deck: fecm.Deck, *kinds: type[Segment]) -> fecm.Deck:
    """A deck without segments of some kinds."""
    kept = tuple(s for s in deck.segments if not isinstance(s, kinds))
    return replace(deck, segments=kept, text="")


def panel(layup: str = "[45/0/-45/90]s", at: Place = STRUCK, radius: float = 5.0) -> fecm.Deck:
    """A small panel of 10 x 8 elements, struck by 2 g at 2 m/s."""
    deck = fecm.impact(
        fecm.Plate.rectangle((100.0, 80.0), (10, 8), support="simple"),
        fecm.Laminate(layup, "AS4/8552", 0.18),
        fecm.RigidMass(2e-6),
        fecm.Contact(2e4, 0.0, 0.0, 1.5),
        velocity=2000.0,
        duration=TIME[-1],
        units="mm-N-s",
        patch=None,
        kinematics="linear",
        shear_factor=1.0,
        gages=OFF_AXIS,
    )
    return with_patch(deck, radius, at)


def public_panel(nx: int, ny: int, at: Place = (150.0, 100.0), e1: float = 171420.0) -> fecm.Deck:
    """The panel of the series with uniform elements."""
    ply = fecm.Ply(density=1.57e-9, nu12=0.32, e1=e1, e2=9080.0, g12=5290.0, g13=5290.0, g23=3242.9)
    deck = fecm.impact(
        fecm.Plate.rectangle((300.0, 200.0), (nx, ny), support="simple"),
        fecm.Laminate("[0/90/0/90/0]s", ply, 0.2),
        fecm.RigidMass(2e-5),
        fecm.Contact(2e4, 0.0, 0.0, 1.5),
        velocity=2000.0,
        duration=8.02e-4,
        units="mm-N-s",
        patch=None,
        kinematics="linear",
        shear_factor=1.0,
        gages=PUBLIC_GAGES,
    )
    return with_patch(deck, 4.0, at)


@cache
def run_of(layup: str = "[45/0/-45/90]s", at: Place = STRUCK, radius: float = 5.0) -> fecm.Result:
    """A run of the small panel."""
    return fecm.run_one(panel(layup, at, radius))


def at_times(run: fecm.Result) -> Floats:
    """Strains of a run at :data:`TIME`, (times, gages)."""
    return np.column_stack([np.interp(TIME, run.time, one) for one in run.gages.strain.T])


@cache
def struck(
    layup: str = "[45/0/-45/90]s", at: Place = STRUCK, radius: float = 5.0
) -> tuple[fecm.Deck, Floats, float]:
    """The small panel, the strains of an impact on it at :data:`TIME`, and its peak force."""
    run = run_of(layup, at, radius)
    return panel(layup, at, radius), at_times(run), float(run.force.max())


@cache
def struck_on_a_point(
    layup: str = "[45/0/-45/90]s", at: Place = STRUCK
) -> tuple[fecm.Deck, Floats, float]:
    """The same for a small disc, but the panel without it: forces on points are soon located."""
    deck, strains, peak = struck(layup, at, SMALL)
    return without(deck, model.Patch), strains, peak


def scatter(strains: Floats, share: float, seed: int) -> tuple[Floats, float]:
    """Strains with errors of a share of the largest one, and their standard deviation."""
    noise = share * float(np.abs(strains).max())
    return strains + noise * np.random.default_rng(seed).normal(size=strains.shape), noise
