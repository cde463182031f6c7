"""Laminates whose stretching, bending and twisting are coupled: resultants, series, gage, tape8."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecm._typing import Floats
from fecm.deck.grid import Grid, Section, lines, uniform
from fecm.deck.model import (
    Boundary,
    Deck,
    Gages,
    Impact,
    Indentation,
    Projectile,
    Shear,
)
from fecm.deck.records import Gage, LoadTable, Macro, NodeCodes
from fecm.results.result import Result
from fecm.verification.case import Case, Check, case, checks
from fecm.verification.decks import (
    ANGLE_PLY,
    CROSS_PLY,
    Supports,
    constant_strains,
    deck,
    farthest_of,
    forces,
    impact_program,
    material,
    quarter_plate,
    result_of,
    weights,
)
from fecm.verification.laminates import THICK
from fecm.verification.plates import EXACT, IN_FIELD, IN_PLANE, STATICS
from fecm.verification.series import PLY, TwoLayers, angle_ply, cross_ply, off_axis, terms

# Resultants -------------------------------------------------------------------------------------

PAIR = off_axis(THICK)
LOADS = (100.0, -40.0, 30.0, 0.5, 0.3, -0.2)  # N_x, N_y, N_xy (lb/in); M_x, M_y, M_xy (lb)
CAUSED = np.linalg.solve(PAIR.stiffness, LOADS)
RESULTANTS = ("N_x", "N_y", "N_xy", "M_x", "M_y", "M_xy")
FACTOR = 0.8
SHEARS = (20.0, -8.0)  # Q_x, Q_y (lb/in)
SHEARED = np.linalg.solve(FACTOR * THICK * PAIR.shear, SHEARS)
SIDES = ([Section(0.0, 1.2, 1), Section(1.2, 2.0, 1)], [Section(0.0, 0.5, 1), Section(0.5, 1.5, 1)])
APPLIED = "the resultants applied at the edges"
INVERTED = "the inverse of A, B, D times these resultants"


def edge_forces(grid: Grid, x: Sequence[float], y: Sequence[float]) -> Floats:
    """Nodal forces of tractions on the edges of a rectangle, (nodes, 5).

    Parameters
    ----------
    grid : Grid
    x, y : sequence of float
        Force per length of the five dofs on an edge with normal x or y.
    """
    total = np.zeros((grid.up, grid.across, 5))
    for place, sign in ((-1, 1.0), (0, -1.0)):
        total[:, place] += sign * np.outer(weights(lines(grid.rows)), x)
        total[place] += sign * np.outer(weights(lines(grid.columns)), y)
    return total.reshape(-1, 5)


def loaded_rectangle(x: Sequence[float], y: Sequence[float], *, shears: bool = False) -> Deck:
    """Build a rectangle of [0/45] under edge tractions, on supports without reactions.

    With `shears` only w moves, and a shear correction factor acts.
    """
    grid = Grid(*SIDES)
    a, last = grid.across, grid.nodes
    moves = (1, 1, 0, 1, 1) if shears else (0,) * 5
    codes = dict.fromkeys(range(1, last + 1), moves)
    codes[1] = (1, 1, 1, *moves[3:])
    if not shears:
        codes[a] = (0, 1, 1, 0, 0)
        codes[last - a + 1] = (0, 0, 1, 0, 0)
    loads = np.where(np.array(list(codes.values())) == 0, edge_forces(grid, x, y), 0.0)
    segments = (
        grid.coordinates(),
        Boundary(tuple(NodeCodes(n, 0, code) for n, code in codes.items() if any(code))),
        forces(loads),
        material(PLY, (0.0, 45.0), THICK / 2.0),
        Shear(FACTOR) if shears else None,
    )
    return deck("resultants", grid, segments, (*STATICS, Macro("STRE")))


@case(
    "resultants",
    "[0/45] under uniform edge forces and couples; then under transverse shear, SHEA 0.8",
    *checks("ε_x, ε_y, γ_xy, κ_x (1/in), κ_y (1/in), κ_xy (1/in)", CAUSED.tolist(), INVERTED,
            EXACT, IN_FIELD),
    *checks("N_x (lb/in), N_y (lb/in), N_xy (lb/in), M_x (lb), M_y (lb), M_xy (lb)", LOADS,
            APPLIED, EXACT, IN_FIELD),
    *checks("γ_xz, γ_yz", SHEARED.tolist(), "the inverse of 0.8 A* times Q", EXACT, IN_FIELD),
    *checks("Q_x (lb/in), Q_y (lb/in)", SHEARS, APPLIED, EXACT, IN_FIELD),
)  # fmt: skip
def resultants() -> Sequence[float]:
    """Uniform strains and resultants."""
    n_x, n_y, n_xy, m_x, m_y, m_xy = LOADS
    # A couple M does work on -theta.
    found = result_of(
        loaded_rectangle((n_x, n_xy, 0.0, -m_x, -m_xy), (n_xy, n_y, 0.0, -m_xy, -m_y))
    )
    q_x, q_y = SHEARS
    sheared = result_of(
        loaded_rectangle((0.0, 0.0, q_x, 0.0, 0.0), (0.0, 0.0, q_y, 0.0, 0.0), shears=True)
    )
    return [
        *farthest_of(found, "stresses", (*IN_PLANE, *RESULTANTS), (*CAUSED.tolist(), *LOADS)),
        *farthest_of(
            sheared, "stresses", ("gamma_xz", "gamma_yz", "Q_x", "Q_y"),
            (*SHEARED.tolist(), *SHEARS),
        ),
    ]  # fmt: skip


# Strains on tape8 --------------------------------------------------------------------------------

TAPE8 = (0.4, -0.5, 0.6, 0.02, -0.03)
ON_TAPE8 = ("kappa_x", "kappa_y", "kappa_xy", "gamma_yz", "gamma_xz")


def prescribed_strains() -> Deck:
    """Build a plate whose nodes are held in a field of constant strains, except one w.

    A very slow rigid mass hits this dof, in the middle of the first element, for one step: the
    other elements keep the field.
    """
    grid = Grid(uniform(2.0, 2), uniform(2.0, 2))
    struck, h = 2 + grid.across, 0.01
    x, y = (v.ravel() for v in np.meshgrid(lines(grid.columns), lines(grid.rows)))
    field = constant_strains(x, y, TAPE8[:3], shear=TAPE8[3:])
    field[struck - 1, 2] = 0.0
    codes = [NodeCodes(n, 0, (1, 1, int(n != struck), 1, 1)) for n in range(1, grid.nodes + 1)]
    segments = (
        grid.coordinates(),
        Boundary(tuple(codes)),
        forces(field),
        Projectile(0, 0, 1e-6),
        Impact(struck, 3, 1e-12),
        Indentation(1.0, 1.0, 0.0, 1.5),
        material(PLY, (0.0, 90.0), h),
    )
    return deck("tape8", grid, segments, impact_program(1e-7, 1))


@case(
    "tape8",
    "strains that an impact step stores, of a field that is held",
    *checks("κ_x (1/in), κ_y (1/in), κ_xy (1/in), γ_yz, γ_xz", TAPE8, "the field that is held",
            EXACT, IN_FIELD),
)  # fmt: skip
def tape8() -> Sequence[float]:
    """Strains of the stored row, in all elements but the first."""
    return farthest_of(result_of(prescribed_strains()), "tape8", ON_TAPE8, TAPE8, first=1)


# Series ------------------------------------------------------------------------------------------

H = 0.1
ELEMENTS = 6  # of 12 a side
MESH = "12 × 12 elements; falls with the 4th power of their size"
LOCKS = MESH + ", on which order 3 locks more"
SERIES = "Navier's series"
MOST = 79


def _series_plate(
    name: str, title: str, layup: TwoLayers, angles: Sequence[float], supports: Supports
) -> Case:
    """Frequencies and deflections of a plate of two layers."""
    a, b, loads = terms(MOST)
    amplitudes = np.linalg.solve(
        layup.modal_stiffness(a, b), loads[:, None, None] * np.eye(5)[:, 2:3]
    )[..., 0]
    middle = float(amplitudes[:, 2].sum())
    edge = np.sin((b if layup.twists else a) / 2.0)
    moved = float((amplitudes[:, 0] * edge).sum())
    along = "(0, 1/2)" if layup.twists else "(1/2, 0)"
    lowest, higher = (
        float(layup.modes(np.array(np.pi), np.array(n * np.pi))[0][0]) for n in (1.0, 3.0)
    )

    @case(
        name,
        title,
        Check("ω11 (1/s)", lowest, f"{SERIES}, m = n = 1", 2e-6, MESH),
        Check("ω13 (1/s)", higher, f"{SERIES}, m = 1, n = 3", 3e-4, MESH),
        Check("ω11, L2 = 3 (1/s)", lowest, f"{SERIES}, m = n = 1", 1e-4, LOCKS),
        Check("w in the middle (in)", middle, SERIES, 5e-5, MESH),
        Check(f"u at {along} (in)", moved, SERIES, 5e-5, MESH),
        Check("w in the middle, L2 = 3 (in)", middle, SERIES, 1e-4, LOCKS),
    )
    def plate() -> Sequence[float]:
        """Lowest frequencies of the doubly symmetric modes; deflections under a uniform load."""

        def made(shear_order: int, load: float | None, macros: Sequence[Macro]) -> Result:
            card = material(PLY, angles, H / 2.0, shear_order)
            return result_of(quarter_plate(ELEMENTS, card, macros, load, supports))

        modal, static = (Macro("LMAS"), Macro("EIGE", value=3.0)), (*STATICS, Macro("DISP"))
        found = made(2, None, modal).modes.angular_frequency
        fields = [made(order, 1.0, static).tape3.displacement[0] for order in (2, 3)]
        across = 2 * ELEMENTS + 1
        node = across * (across - 1) if layup.twists else across - 1
        return [
            found[0], min(found, key=lambda omega: abs(omega - higher)),
            made(3, None, modal).modes.angular_frequency[0],
            fields[0][0, 2], fields[0][node, 0], fields[1][0, 2],
        ]  # fmt: skip

    return plate


cross_ply_plate = _series_plate(
    "cross-ply-plate", "simply supported square plate of [0/90], side 1 in, h/a = 1/10, q = 1",
    cross_ply(H), (0.0, 90.0), CROSS_PLY,
)  # fmt: skip
angle_ply_plate = _series_plate(
    "angle-ply-plate", "simply supported square plate of [45/-45], side 1 in, h/a = 1/10, q = 1",
    angle_ply(H), (45.0, -45.0), ANGLE_PLY,
)  # fmt: skip

# A plate under a load that varies in time ---------------------------------------------------------

PLATE = cross_ply(H)
DT, STEPS = 1.08e-7, 600
PULSE = 5.0e4  # sin²(PULSE t), 1/s
# One of the 2 x 2 points where the strains of a 9-node element are most accurate; the face away
# from the load.
ROOT = (1.0 - 1.0 / np.sqrt(3.0)) / 2.0 * 0.5 / ELEMENTS
GAGE = Gage(1, float(f"{1 / 12 + ROOT:.9g}"), float(f"{0.25 + ROOT:.9g}"), H / 2.0, 30.0)


def _forced(time: float) -> tuple[float, float]:
    """Deflection in the middle and strain of the gage under a uniform load of sin²(PULSE t)."""
    a, b, loads = terms(MOST)
    omega, shapes = PLATE.modes(a, b)
    twice = 2.0 * PULSE  # sin² is half of 1 - cos
    answer = (1.0 - np.cos(omega * time)) / omega**2
    answer -= (np.cos(twice * time) - np.cos(omega * time)) / (omega**2 - twice**2)
    amplitudes = shapes @ (loads[:, None] * shapes[:, 2] * answer / 2.0)[..., None]
    strains = (PLATE.strains(a, b) @ amplitudes)[..., 0]
    along = np.cos(a * GAGE.x) * np.cos(b * GAGE.y)
    across = np.sin(a * GAGE.x) * np.sin(b * GAGE.y)
    strains *= np.stack([along, along, across] * 2, axis=-1)
    at = strains[:, :3].sum(axis=0) + GAGE.z * strains[:, 3:].sum(axis=0)
    c, s = np.cos(np.deg2rad(GAGE.direction)), np.sin(np.deg2rad(GAGE.direction))
    return float(amplitudes[:, 2].sum()), float(at @ [c * c, s * s, c * s])


DEFLECTION, STRAIN = _forced(STEPS * DT)


def forced_plate() -> Deck:
    """Build the plate of [0/90] under a uniform load that varies as sin² (PROP)."""
    steps = (
        Macro("LMAS"), Macro("DT", value=DT), Macro("PROP", value=1.0),
        Macro("LOOP", value=float(STEPS)), Macro("TIME"), Macro("EXCD"),
        Macro("DISP", value=float(STEPS)), Macro("NEXT"),
    )  # fmt: skip
    card = material(PLY, (0.0, 90.0), H / 2.0, 2)
    made = quarter_plate(ELEMENTS, card, steps, 1.0, CROSS_PLY, [Gages((GAGE,))])
    table = LoadTable(1, 2, 0.0, 1.0, (0.0, 0.0, 1.0, PULSE, 0.0))
    return replace(made, tables=(table,))


@case(
    "forced-plate",
    "simply supported plate of [0/90] under a uniform load of sin²(5·10⁴ t), EXCD, at 64.8 µs",
    Check("w in the middle (in)", DEFLECTION, "Navier's series in time", 1e-4,
          MESH + "; 600 steps"),
    Check("strain of a gage at 30°, z = h/2", STRAIN, "Navier's series in time", 3e-3,
          "12 × 12 elements; a strain falls with the 3rd power of their size"),
)  # fmt: skip
def forced() -> Sequence[float]:
    """Last rows of tape3 and of the gage."""
    found = result_of(forced_plate())
    return [found.tape3.w[-1, 0], found.gages.strain[-1, 0]]


CASES = (resultants, tape8, cross_ply_plate, angle_ply_plate, forced)
