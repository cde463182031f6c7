"""Draw the logo and the icon of the site: a ball on a laminate that bends under it.

``python docs/logo.py`` writes both into ``docs/_static``.
"""

from __future__ import annotations

import math
from pathlib import Path

STATIC = Path(__file__).parent / "_static"
SIDE = 64  # of the picture
BALL = 10.0  # radius
TOP = 31.0  # height of the upper ply at the edges, from above
DIP = 11.0  # deflection in the middle
PLY = 7.0  # thickness of a ply with the gap to the next
# Struck face first; dark enough on white and bright enough on black.
PLIES = ("#0a7d91", "#14a0b8", "#6fc7d6")
STEEL = "#e4572e"


def deflected(x: float) -> float:
    """Deflection of the laminate at x, a smooth dip that ends at the edges."""
    return DIP * math.cos(math.pi * (x / SIDE - 0.5)) ** 4


def ply(number: int, colour: str) -> str:
    """Draw a ply as a line."""
    stations = [2 + 4 * n for n in range(16)]
    middle = TOP + PLY * number + PLY / 2
    points = " ".join(f"{x},{middle + deflected(x):.2f}" for x in stations)
    return (
        f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{PLY - 1.5}" '
        'stroke-linejoin="round"/>'
    )


def picture() -> str:
    """Return the ball and the plies as SVG."""
    touching = TOP + deflected(SIDE / 2) + 0.75 - BALL
    ball = f'<circle cx="{SIDE / 2}" cy="{touching:.2f}" r="{BALL}" fill="{STEEL}"/>'
    plies = [ply(number, colour) for number, colour in enumerate(PLIES)]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIDE} {SIDE}">'
    return "\n".join([head, "<title>fecm</title>", *plies, ball, "</svg>", ""])


if __name__ == "__main__":
    (STATIC / "logo.svg").write_text(picture(), encoding="utf-8")
