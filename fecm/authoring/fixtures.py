"""Fixtures of drop-weight tests: a plate on the edges of a window."""

from __future__ import annotations

import re

from fecm._dataclasses import frozen
from fecm.authoring.parameters import ObjectError

CUSTOM = "window:LXxLY,WXxWY"


@frozen
class DropWeight:
    """What a test standard prescribes besides its fixture, in mm, N, s and t."""

    mass: float  # of the rigid projectile
    radius: float
    energy: float  # impact energy per thickness, force
    thinnest: float  # limits of the laminate's thickness, length
    thickest: float
    least_energy: float = 100.0  # per thickness, below which a unit is probably mistaken, force

    def allows(self, thickness: float) -> bool:
        """Whether a laminate's thickness is in the range of the standard."""
        return self.thinnest <= round(thickness, 9) <= self.thickest


@frozen
class Fixture:
    """A plate on the edges of a window in its middle."""

    name: str
    # Sides of the plate and of the window, length.
    size: tuple[float, float]
    window: tuple[float, float]
    test: DropWeight | None = None  # what the standard prescribes; None for a custom fixture

    @property
    def comment(self) -> str:
        """Comment lines of a deck."""
        (lx, ly), (wx, wy) = self.size, self.window
        return (
            f"! Fixture {self.name}: a plate of {lx:g} x {ly:g}, w = 0 along the edges of a "
            f"window of {wx:g} x {wy:g}.\n"
            "! Clamps and lift-off are not modelled.\n"
        )


# ASTM D7136/D7136M: 5.5 kg, hemisphere of 16 mm diameter, 6.7 J per mm of thickness.
D7136 = DropWeight(mass=5.5e-3, radius=8.0, energy=6700.0, thinnest=4.0, thickest=6.0)
FIXTURES = {"D7136": Fixture("D7136", (150.0, 100.0), (125.0, 75.0), D7136)}


def parse_fixture(text: str) -> Fixture:
    """Fixture of a name, or of ``window:LXxLY,WXxWY``, smaller than the plate."""
    if text in FIXTURES:
        return FIXTURES[text]
    number = r"\s*(\d+\.?\d*|\.\d+)\s*"
    match = re.fullmatch(f"window:{number}[xX×]{number},{number}[xX×]{number}", text)
    if match is None:
        raise ObjectError(f"{text!r} is not a fixture: {', '.join(FIXTURES)} or {CUSTOM}")
    lx, ly, wx, wy = map(float, match.groups())
    if not (0.0 < wx < lx < 1e30 and 0.0 < wy < ly < 1e30):
        message = f"the window of {wx:g} x {wy:g} is not smaller than the plate of {lx:g} x {ly:g}"
        raise ObjectError(message)
    return Fixture("window", (lx, ly), (wx, wy))
