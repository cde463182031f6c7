"""Contact patches, assumed shear strains and shear stiffness from equilibrium against series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fecm.deck.grid import Grid, uniform
from fecm.deck.model import Deck, Impact, Indentation, Patch, Projectile, Segment, Shear
from fecm.deck.records import Macro, Ply
from fecm.problem.build import build_plate
from fecm.problem.generate import generate
from fecm.verification import sine
from fecm.verification.case import Check, case
from fecm.verification.decks import (
    deck,
    impact_program,
    isotropic,
    material,
    quarter_plate,
    result_of,
)
from fecm.verification.plates import NU, STATICS, E

# The report's ply in [0/90/0/90/0/90/0/90/0/90]s, 6 x 4 in.
PLY = Ply(0.000148, 0.3, 17.5e6, 1.15e6, 0.8e6, 0.8e6, 0.8e6)
ANGLES = 5 * (0.0, 90.0) + 5 * (90.0, 0.0)
THICKNESS = 0.106
SIDES = (6.0, 4.0)
MITC = Shear(assumed=True)

D, S = sine.bending_and_shear(PLY, ANGLES, THICKNESS)
WIDE = 0.5
DISC, HERTZ = (sine.compliance(D, S, SIDES, shape, WIDE) for shape in (sine.disc, sine.hertz))
AS_WIDE = "the element's side is c; falls with the 4th power of it"


def rectangle(along: int, patch: Patch, program: Sequence[Macro], *others: Segment) -> Deck:
    """Build the simply supported rectangle of square elements, with MITC, pressed on a patch."""
    grid = Grid(uniform(SIDES[0], along), uniform(SIDES[1], along * 2 // 3))
    ends, sides = (1, 1, 1, 0, 1), (1, 1, 1, 1, 0)
    edges = {"left": ends, "right": ends, "bottom": sides, "top": sides}
    plate = material(PLY, ANGLES, THICKNESS / len(ANGLES))
    segments = (grid.coordinates(), grid.boundary((1, 1, 0, 0, 0), edges), patch, *others, MITC)
    return deck("rectangle", grid, (*segments, plate), program)


@case(
    "patch-compliance",
    "middle of a simply supported [0/90]5s plate under a unit force on a circle, c = 0.5 in, MITC",
    Check("W, disc (in/lb)", DISC, "double sine series", 1e-3, AS_WIDE),
    Check("W, Hertz (in/lb)", HERTZ, "double sine series", 1e-3, AS_WIDE),
)
def compliance() -> Sequence[float]:
    """Mean of w, weighted by the pressure."""
    found = []
    for shape in ("DISC", "HERT"):
        patch = Patch(shape, WIDE, SIDES[0] / 2.0, SIDES[1] / 2.0, 1.0)
        result = result_of(rectangle(12, patch, (*STATICS, Macro("DISP"))))
        found.append(result.tape3.w[0, result["patch/node"] - 1] @ result["patch/weight"])
    return found


MODES = "modal series with rotary inertia, a rigid mass and F = k α^1.5"


@case(
    "patch-impact",
    "rigid mass on the middle of the same plate, disc of 0.125 in, MITC, 115 in/s",
    Check("largest force (lb)", 87.275116, MODES, 1e-3, "the element's side is c"),
    Check("its time (s)", 113.2e-6, MODES, 1e-2, "a flat peak"),
)
def impact() -> Sequence[float]:
    """Peak of the force."""
    patch = Patch("DISC", 0.125, SIDES[0] / 2.0, SIDES[1] / 2.0)
    middle = 97 * 32 + 49  # of 97 by 65 nodes
    hit = (
        Projectile(0, 0, 0.000181), Impact(middle, 3, 115.0), Indentation(1.912e6, 1.0, 0.0, 1.5)
    )  # fmt: skip
    found = result_of(rectangle(48, patch, impact_program(1.0e-7, 1250), *hit))
    return [found.force.max(), found.time[found.force.argmax()]]


COARSE = "8 × 8 elements; falls with the 4th power of their size, as much on thin plates"
THICK, THIN = (
    sine.middle_under_uniform_load(*sine.bending_and_shear(isotropic(E, NU, 1.0), (0.0,), h))
    for h in (0.1, 0.001)
)


@case(
    "assumed-shear",
    "simply supported square plate under a uniform load, E = q = a = 1, MITC",
    Check("w in the middle, h/a = 1/10", THICK, "double sine series", 1e-4, COARSE),
    Check("w in the middle, h/a = 1/1000", THIN, "double sine series", 1e-4, COARSE),
)
def assumed_shear() -> Sequence[float]:
    """Deflections of a plate of four times four elements a quarter."""

    def w(h: float) -> float:
        plate = material(isotropic(E, NU, 1.0), [0.0], h)
        made = quarter_plate(4, plate, (*STATICS, Macro("DISP")), 1.0, others=[MITC])
        return float(result_of(made).tape3.w[0, 0])

    return [w(0.1), w(0.001)]


# Pagano's ply.
STIFF = Ply(1.0, 0.25, 25.0, 1.0, 0.5, 0.5, 0.2)
CROSS = (0.0, 90.0, 0.0)
XZ, YZ = sine.equilibrium_shear(STIFF, CROSS, 1.0)
PARABOLAS = "energy of the parabolas of shear stress in each ply"


@case(
    "equilibrium-shear",
    "SHEA EQUI",
    Check("A*55 of one isotropic ply over G h", 5.0 / 6.0, "Reissner", 1e-12, "rounding"),
    Check("A*55 of [0/90/0]", XZ, PARABOLAS, 1e-12, "rounding"),
    Check("A*44 of [0/90/0]", YZ, PARABOLAS, 1e-12, "rounding"),
)
def equilibrium_shear() -> Sequence[float]:
    """Transverse shear stiffness of the plates of two decks."""

    def shear(ply: Ply, angles: Sequence[float], *words: Segment) -> list[float]:
        plate = material(ply, angles, 1.0 / len(angles))
        plate = replace(plate, integration=replace(plate.integration, thickness=1.0))
        made = quarter_plate(1, plate, (), others=words)
        diagonal = build_plate(made, generate(made)).laminate.shear.diagonal()
        return [float(value) for value in diagonal]

    equi = Shear(equilibrium=True)
    one = isotropic(E, NU, 1.0)
    return [shear(one, [0.0], equi)[0] / one.g13, *shear(STIFF, CROSS, equi)]


CASES = (compliance, impact, assumed_shear, equilibrium_shear)
