"""Plates: fields that every mesh must reproduce, plates against series, and impacts on plates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fecm._typing import Floats
from fecm.api import load_deck
from fecm.deck import model
from fecm.deck.catalogue import MATERIALS
from fecm.deck.grid import Grid, Section, lines, refined, uniform
from fecm.deck.model import Deck, Impact, Indentation, Patch, Projectile, Segment
from fecm.deck.records import Gage, LoadTable, Macro, NodeCodes, NodeValues, Ply
from fecm.mechanics.laminate import effective_rigidity, laminate
from fecm.mechanics.solutions import static_stiffness
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.build import build_plate
from fecm.problem.generate import generate
from fecm.results.result import Result
from fecm.studies.estimate import inelasticity, infinite_plate, static_plate
from fecm.sweeps.api import carry_out, problem_of
from fecm.sweeps.plan import plan
from fecm.verification import decks
from fecm.verification.case import Value, case
from fecm.verification.parts import ALPHA_CR, FIBRES, THICK

ELEMENTS = 8  # of 16 a side
FEWER = 6  # of 12 a side
H = 0.1
SIDES = (6.0, 4.0)  # of rectangles
V = 100.0  # of projectiles
ONE = decks.isotropic(1.0, 0.3, 1.0)
STIFF = Ply(1.0, 0.25, 25.0, 1.0, 0.5, 0.5, 0.2)  # Pagano's
CROSS = (0.0, 90.0, 0.0)
DEFLECTION = decks.program("TANG FORM SOLV DISP")
STRESSES = decks.program("TANG FORM SOLV STRE")
IN_PLANE = "eps_xx eps_yy gamma_xy kappa_x kappa_y kappa_xy"
# Corners of the four elements of the patch: no side is parallel to another or to an axis.
CORNERS = np.array([
    [(0.0, 0.0), (1.1, -0.1), (2.0, 0.1)],
    [(-0.1, 0.9), (1.2, 1.1), (2.1, 0.8)],
    [(0.1, 2.0), (0.9, 2.2), (2.0, 1.9)],
])  # fmt: skip


@case
def _patch() -> Sequence[Value]:
    fine = np.empty((5, 5, 2))
    fine[::2, ::2] = CORNERS
    fine[::2, 1::2] = (CORNERS[:, 1:] + CORNERS[:, :-1]) / 2.0
    fine[1::2] = (fine[2::2] + fine[:-2:2]) / 2.0
    x, y = fine.reshape(-1, 2).T
    field = decks.constant_strains(x, y, (0.4, -0.5, 0.6), strain=(1e-3, 2e-3, 3e-3))
    field = field.reshape(5, 5, 5)
    field[1:-1, 1:-1] = 0.0  # the inner nodes are free
    grid = Grid(uniform(2.0, 2), uniform(2.0, 2))
    places = enumerate(fine.reshape(-1, 2).tolist(), start=1)
    plate = decks.material(FIBRES, (0.0, 90.0), THICK / 2.0)
    segments = (decks.supports(grid, "00000" + 4 * " 11111"), decks.forces(field), plate)
    coordinates = model.Coordinates(tuple(NodeValues(n, 0, tuple(place)) for n, place in places))
    found = decks.result_of(decks.deck(grid, segments, STRESSES, coordinates))
    shears = np.array(decks.fields(found, "stresses", "gamma_xz gamma_yz"))
    return [*decks.fields(found, "stresses", IN_PLANE), shears, found["stresses/M_x"]]


def loaded_rectangle(x: Sequence[float], y: Sequence[float], *, shears: bool = False) -> Deck:
    """Build a rectangle of [0/45] under edge tractions, on supports without reactions.

    `x` and `y` are the forces per length of the five dofs on an edge with normal x or y.  With
    `shears` only w moves, and a shear correction factor acts.
    """
    columns = [Section(0.0, 1.2, 1), Section(1.2, 2.0, 1)]
    grid = Grid(columns, [Section(0.0, 0.5, 1), Section(0.5, 1.5, 1)])
    codes = np.tile([1, 1, 0, 1, 1] if shears else [0] * 5, (grid.up, grid.across, 1))
    codes[0, 0, :3] = 1
    if not shears:
        codes[0, -1, 1:3] = codes[-1, 0, 2] = 1
    loads = np.zeros(codes.shape)
    for place, sign in ((-1, 1.0), (0, -1.0)):
        loads[:, place] += sign * np.outer(decks.weights(lines(grid.rows)), x)
        loads[place] += sign * np.outer(decks.weights(lines(grid.columns)), y)
    rows = enumerate(codes.reshape(-1, 5).tolist(), start=1)
    segments = (
        model.Boundary(tuple(NodeCodes(n, 0, tuple(code)) for n, code in rows if any(code))),
        decks.forces(np.where(codes == 0, loads, 0.0)),
        decks.material(FIBRES, (0.0, 45.0), THICK / 2.0),
        model.Shear(0.8) if shears else None,
    )
    return decks.deck(grid, segments, STRESSES)


@case
def _resultants() -> Sequence[Value]:
    n_x, n_y, n_xy, m_x, m_y, m_xy = 100.0, -40.0, 30.0, 0.5, 0.3, -0.2
    # A couple M does work on -theta.
    pulled = loaded_rectangle((n_x, n_xy, 0.0, -m_x, -m_xy), (n_xy, n_y, 0.0, -m_xy, -m_y))
    shears = (0.0, 0.0, 20.0, 0.0, 0.0), (0.0, 0.0, -8.0, 0.0, 0.0)
    found = decks.result_of(pulled)
    sheared = decks.result_of(loaded_rectangle(*shears, shears=True))
    return [
        *decks.fields(found, "stresses", f"{IN_PLANE} N_x N_y N_xy M_x M_y M_xy"),
        *decks.fields(sheared, "stresses", "gamma_xz gamma_yz Q_x Q_y"),
    ]


@case
def _tape8() -> Sequence[Value]:
    """Strains of a plate whose nodes are held in a field of constant strains, except one w.

    A very slow rigid mass hits this dof, in the middle of the first element, for one step: the
    other elements keep the field.
    """
    grid = Grid(uniform(2.0, 2), uniform(2.0, 2))
    struck = 2 + grid.across
    x, y = (v.ravel() for v in np.meshgrid(lines(grid.columns), lines(grid.rows)))
    field = decks.constant_strains(x, y, (0.4, -0.5, 0.6), shear=(0.02, -0.03))
    field[struck - 1, 2] = 0.0
    codes = [NodeCodes(n, 0, (1, 1, int(n != struck), 1, 1)) for n in range(1, grid.nodes + 1)]
    hit = (Projectile(0, 0, 1e-6), Impact(struck, 3, 1e-12), decks.elastic(1.0))
    plate = decks.material(FIBRES, (0.0, 90.0), 0.01)
    segments = (model.Boundary(tuple(codes)), decks.forces(field), *hit, plate)
    found = decks.result_of(decks.deck(grid, segments, decks.impact_program(1e-7, 1)))
    names = "kappa_x kappa_y kappa_xy gamma_yz gamma_xz"
    return [field[:, 1:] for field in decks.fields(found, "tape8", names)]


@case
def _time_step() -> Sequence[Value]:
    grid = Grid(uniform(0.3, 1), uniform(0.3, 1))
    made = decks.deck(grid, [decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4), [0.0], 0.1)], ())
    mesh, found = generate(made), []
    for dof in (2, 3):  # of node 5, the centre
        codes, equations = np.ones_like(mesh.codes), np.zeros_like(mesh.equations)
        codes[4, dof], equations[4, dof] = 0, 1
        held = replace(mesh, codes=codes, equations=equations)
        found.append(critical_time_step(build_plate(made, held)))
    return found


@case
def _static_bending() -> Sequence[Value]:
    """Transverse shear is integrated by order 2, which does not lock, and by order 3."""

    def w(thickness: float, factor: float = 1.0, shear_order: int = 2) -> Floats:
        ply = decks.isotropic(1.0, 0.3, 1.0, factor)
        plate = decks.material(ply, [0.0], thickness, shear_order)
        made = decks.quarter_plate(ELEMENTS, plate, DEFLECTION, 1.0)
        return np.asarray(decks.result_of(made).tape3.w[0])

    quarter = ELEMENTS + ELEMENTS * (2 * ELEMENTS + 1)  # the row of the node at (a/4, a/4)
    thick = w(0.1)
    return [
        thick[0], thick[quarter], w(0.01)[0], w(0.1, 5.0 / 6.0)[0],
        w(0.1, shear_order=3)[0], w(0.01, shear_order=3)[0],
    ]  # fmt: skip


@case
def _frequencies() -> Sequence[Value]:
    """Frequencies of the symmetric modes, on a quarter of the plate, and of uniform shear."""
    plate = decks.material(ONE, [0.0], 0.1, 2)
    macros = decks.program("LMAS EIGE=4 CMAS EIGE=4")
    found = decks.result_of(decks.quarter_plate(ELEMENTS, plate, macros)).modes.angular_frequency
    scaled = found * math.sqrt(0.1 / (0.1**3 / (12.0 * (1.0 - 0.3**2))))
    grid = Grid(uniform(0.7, 2), uniform(1.3, 2))
    held = grid.boundary((1, 1, 1, 0, 1), {})
    made = decks.deck(grid, (held, decks.material(ONE, [0.0], 0.1)), ())
    free = build_plate(made, generate(made))
    ones = np.ones(free.neq)
    # Rayleigh's quotient of a free plate in uniform transverse shear.
    shear = math.sqrt(float(ones @ (free.stiffness @ ones)) / float(free.mass @ ones))
    # Modes 11, 13 and 31, 33 with the lumped mass, then with the consistent mass.
    return [scaled[0], scaled[1], scaled[4], scaled[7], shear]


def two_layers(angles: Sequence[float], codes: str, mode: int, node: int) -> Sequence[Value]:
    """Frequencies of the first and another mode; w in the middle and u at a node under a load."""

    def made(shear_order: int, load: float, macros: Sequence[Macro]) -> Result:
        card = decks.material(FIBRES, angles, H / 2.0, shear_order)
        return decks.result_of(decks.quarter_plate(FEWER, card, macros, load, codes))

    modes = [made(n, 0.0, decks.program("LMAS EIGE=3")).modes.angular_frequency for n in (2, 3)]
    first, second = (made(n, 1.0, DEFLECTION).tape3.displacement[0] for n in (2, 3))
    return [modes[0][0], modes[0][mode], modes[1][0], first[0, 2], first[node, 0], second[0, 2]]


@case
def _cross_ply_plate() -> Sequence[Value]:
    return two_layers((0.0, 90.0), decks.CROSS_PLY, 1, 2 * FEWER)


@case
def _angle_ply_plate() -> Sequence[Value]:
    return two_layers((45.0, -45.0), decks.ANGLE_PLY, 2, (2 * FEWER + 1) * 2 * FEWER)


@case
def _forced_plate() -> Sequence[Value]:
    # One of the 2 x 2 points where the strains of a 9-node element are most accurate; the face away
    # from the load.
    root = (1.0 - 1.0 / np.sqrt(3.0)) / 2.0 * 0.5 / FEWER
    gage = Gage(1, float(f"{1 / 12 + root:.9g}"), float(f"{0.25 + root:.9g}"), H / 2.0, 30.0)
    steps = decks.program("LMAS DT=1.08e-7 PROP=1 LOOP=600 TIME EXCD DISP=600 NEXT")
    card = decks.material(FIBRES, (0.0, 90.0), H / 2.0, 2)
    made = decks.quarter_plate(FEWER, card, steps, 1.0, decks.CROSS_PLY, [model.Gages((gage,))])
    table = LoadTable(1, 2, 0.0, 1.0, (0.0, 0.0, 1.0, 5.0e4, 0.0))
    found = decks.result_of(replace(made, tables=(table,)))
    return [found.tape3.w[-1, 0], found.gages.strain[-1, 0]]


def rectangle(along: int, patch: Patch, macros: Sequence[Macro], *others: Segment) -> Deck:
    """Build a simply supported [0/90]5s of the report's ply with MITC, pressed on a patch."""
    grid = Grid(uniform(SIDES[0], along), uniform(SIDES[1], along * 2 // 3))
    plate = decks.material(decks.REPORT_PLY, 5 * (0.0, 90.0) + 5 * (90.0, 0.0), 0.106 / 20)
    held = decks.supports(grid, decks.SUPPORTED)
    return decks.deck(grid, (held, patch, *others, decks.MITC, plate), macros)


@case
def _patch_compliance() -> Sequence[Value]:
    found, radii = [], []
    for shape in ("DISC", "HERT"):
        patch = Patch(shape, 0.5, SIDES[0] / 2.0, SIDES[1] / 2.0, 1.0)
        result = decks.result_of(rectangle(12, patch, DEFLECTION))
        found.append(result.tape3.w[0, result["patch/node"] - 1] @ result["patch/weight"])
        blank = decks.result_of(rectangle(3, replace(patch, radius=None), DEFLECTION))
        radii.append(blank.attributes_of("patch")["radius"] / 0.106)
    return found + radii


def held_trapezoid() -> Deck:
    """Build one element with MITC, x = ξ and y = η (1 + ξ/2)/2, that is held in θ_y = ξ².

    The other dofs are 0, so that γ_yz is -θ_y, of which a cubic part in ξ is interpolated.
    """
    grid = Grid(uniform(2.0, 1), uniform(1.0, 1))
    xi, eta = (v.ravel() for v in np.meshgrid((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)))
    corners = enumerate(np.stack([xi, eta * (1.0 + xi / 2.0) / 2.0], axis=1).tolist(), start=1)
    places = model.Coordinates(tuple(NodeValues(n, 0, tuple(place)) for n, place in corners))
    field = np.zeros((9, 5))
    field[:, 4] = xi**2
    held, plate = decks.held_but(0), decks.material(ONE, [0.0], 0.1)
    return decks.deck(grid, (held, decks.forces(field), decks.MITC, plate), STRESSES, places)


@case
def _assumed_shear() -> Sequence[Value]:
    cards = (decks.material(ONE, [0.0], h) for h in (0.1, 0.001))
    made = [decks.quarter_plate(4, card, DEFLECTION, 1.0, others=[decks.MITC]) for card in cards]
    x, shear = decks.fields(decks.result_of(held_trapezoid()), "stresses", "x gamma_yz")
    sides = [shear[:, np.isclose(x, at)] for at in (-1.0, 1.0)]
    return [*(decks.result_of(one).tape3.w[0, 0] for one in made), *sides]


@case
def _equilibrium_shear() -> Sequence[Value]:

    def shear(ply: Ply, angles: Sequence[float]) -> Floats:
        plate = decks.material(ply, angles, 1.0 / len(angles))
        made = decks.quarter_plate(1, plate, (), others=[model.Shear(equilibrium=True)])
        return build_plate(made, generate(made)).laminate.shear

    unsymmetric = shear(STIFF, (30.0, -45.0, 90.0))
    return [
        shear(ONE, [0.0])[0, 0] / ONE.g13, *shear(STIFF, CROSS).diagonal(),
        *shear(STIFF, (0.0, 90.0)).diagonal(),
        unsymmetric[0, 0], unsymmetric[1, 1], unsymmetric[0, 1],
    ]  # fmt: skip


def bent(
    ply: Ply, angles: Sequence[float], thickness: float = H, word: str = "PLYS", *others: Segment
) -> Result:
    """Run a simply supported square under q = cos(pi x) cos(pi y), its origin in the middle."""
    along = np.cos(np.pi * np.array(lines(uniform(0.5, ELEMENTS))))
    plate = decks.material(ply, angles, thickness / len(angles), points=2)
    macros, load = decks.program(f"TANG FORM SOLV STRE {word}"), np.outer(along, along)
    made = decks.quarter_plate(ELEMENTS, plate, macros, load, others=[decks.MITC, *others])
    return decks.result_of(made)


@case
def _ply_stresses() -> Sequence[Value]:
    found = bent(STIFF, CROSS)
    x, y = decks.fields(found, "stresses", "x y")
    even, odd = np.cos(np.pi * x) * np.cos(np.pi * y), np.sin(np.pi * x) * np.sin(np.pi * y)
    x, y = x.mean(axis=1), y.mean(axis=1)
    one, two, shear, xz, yz = (
        field[0] for field in decks.fields(found, "plies", "sigma_1 sigma_2 tau_12 tau_xz tau_yz")
    )
    return [
        (one[:, :, 2, 1], even), (two[:, :, 2, 1], even), (shear[:, :, 2, 1], odd),
        (one[:, :, 1, 1], even), (xz[:, 1, 1], np.sin(np.pi * x) * np.cos(np.pi * y)),
        (yz[:, 1, 1], np.cos(np.pi * x) * np.sin(np.pi * y)),
    ]  # fmt: skip


@case
def _ply_shear() -> Sequence[Value]:
    found = bent(ONE, (0.0,) * 4)
    x, y = (place.mean(axis=1) for place in decks.fields(found, "stresses", "x y"))
    shape = np.sin(np.pi * x) * np.cos(np.pi * y)
    tau = found["plies/tau_xz"][0]
    at_faces = (tau[:, [0, 3], [0, 2]], shape[:, None])
    return [*((tau[:, 2, height], shape) for height in (0, 2, 1)), at_faces]


@case
def _failure() -> Sequence[Value]:
    named = MATERIALS["T300/5208"]
    strengths = named.allowables("m-N-s")
    assert strengths is not None
    found = bent(named.ply, (0.0, 90.0, 90.0, 0.0), 0.01, "FAIL", strengths)
    return [1.0 / found[f"failure/{name}/exposure"].max() for name in ("max_stress", "tsai_wu")]


def peak(found: Result) -> list[float]:
    """Largest force, and its time."""
    return [found.force.max(), found.time[found.force.argmax()]]


@case
def _rigid_target() -> Sequence[Value]:

    def values(law: Indentation) -> list[float]:
        found = decks.result_of(decks.fixed_target(2.0e-4, V, law, 2e-8, 9000))
        touching = found.time[found.force > 0.0]
        return [found.indentation.max(), found.force.max(), touching[-1], found.velocity[-1]]

    return values(decks.elastic(1.0e6)) + values(Indentation(1.0e6, ALPHA_CR, 0.0, 2.5, "ACR"))


@case
def _free_plate() -> Sequence[Value]:
    """A plate so stiff that it moves as a rigid body, which DAMP slows down."""
    grid = Grid(uniform(1.0, 2), uniform(1.0, 2))
    plate, law = decks.material(decks.isotropic(1e9, 0.3, 2.5e-4), [0.0], 0.2), decks.elastic(1e5)
    made = decks.struck_plate(grid, plate, Projectile(0, 0, 2.0e-4), V, law, 3e-8, 10000)
    found = decks.result_of(replace(made, segments=(*made.segments, model.Damping(2000.0))))
    ends = (found.velocity[-1], found.plate_w[-1], found.energy.damping_work[-1])
    return [found.force.max(), *ends]


@case
def _infinite_plate() -> Sequence[Value]:
    """A thin plate of 12 x 12 in, stiff in shear; no reflection returns within 200 us."""
    grid = Grid(uniform(12.0, 48), uniform(12.0, 48))
    plate = decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4, 13.0), [0.0], 0.1)
    mass, law = Projectile(0, 0, 2.0e-5), decks.elastic(5.0e4)
    found = decks.result_of(decks.struck_plate(grid, plate, mass, V, law, 5e-8, 4000))
    return [*peak(found), found.velocity[-1]]


@case
def _supported_plate() -> Sequence[Value]:
    """A quarter of the plate, with a quarter of mass and contact coefficient."""
    plate = decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4), [0.0], 0.03)
    hit = (Projectile(0, 0, 5.0e-6 / 4.0), Impact(1, 3, V), decks.elastic(1.0e5 / 4.0))
    macros = decks.impact_program(8e-8, 2500)
    found = decks.result_of(decks.quarter_plate(8, plate, macros, others=hit))
    force, time = peak(found)
    return [4.0 * force, time, found.plate_w.max(), found.velocity[-1]]


@case
def _report_impact() -> Sequence[Value]:
    found = decks.result_of(decks.report_impact())
    energy = found.energy
    balance = float(np.abs(energy.balance_error).max()) / float(energy.attributes["initial"])
    first = int(found.force[found.time < 500e-6].argmax())
    return [
        balance, _at(found, "force", 42e-6), _at(found, "force", 642e-6),
        _at(found, "transducer", 642e-6), found.force[first], found.time[first], *peak(found),
    ]  # fmt: skip


def _at(result: Result, name: str, time: float) -> float:
    """Value of a history at the step nearest to a time."""
    values: Floats = result[f"history/{name}"]
    return float(values[int(np.abs(result.time - time).argmin())])


@case
def _listing_impact() -> Sequence[Value]:
    found = decks.result_of(decks.report_impact(500), "listing")
    end = found.time[found.force > 0.0][-1]
    return [_at(found, "force", 46e-6), _at(found, "transducer", 46e-6), end]


@case
def _convolution() -> Sequence[Value]:
    made = decks.report_impact(1000)
    problem = problem_of(made)
    swept = carry_out(problem, plan(problem, [{"velocity": 60.0}], history=True)).force
    if swept is None:
        raise ValueError("the sweep has kept no forces")
    slower = tuple(replace(s, velocity=60.0) if isinstance(s, Impact) else s for s in made.segments)
    full = decks.result_of(replace(made, segments=slower)).force
    return [np.abs(swept[0] - full).max() / full.max()]


@case
def _patch_impact() -> Sequence[Value]:
    patch = Patch("DISC", 0.125, SIDES[0] / 2.0, SIDES[1] / 2.0)
    middle = 97 * 32 + 49  # of 97 by 65 nodes
    hit = (Projectile(0, 0, 0.000181), Impact(middle, 3, 115.0), decks.elastic(1.912e6))
    return peak(decks.result_of(rectangle(48, patch, decks.impact_program(1.0e-7, 1250), *hit)))


# A square of 0.256 kg: ply and thickness; contact coefficient (SI).
SQUARE, SQUARE_H, SQUARE_K = decks.isotropic(240e9, 0.3, 1600.0), 0.004, 8.2641942e9


def struck_square(mass: float, end: float) -> Deck:
    """Build the simply supported square, hit in the middle at 1 m/s, until a time."""
    side, radius = 0.2, 0.002
    sections = refined(side, 12, side / 2.0, 4.0, radius)
    grid = Grid(sections, sections)
    middle = grid.nearest(side / 2.0, side / 2.0)[0]
    segments = (
        decks.supports(grid, decks.SUPPORTED), Projectile(0, 0, mass), Impact(middle, 3, 1.0),
        Patch("DISC", radius), decks.elastic(SQUARE_K), decks.MITC,
        decks.material(SQUARE, [0.0], SQUARE_H),
    )  # fmt: skip
    made = decks.deck(grid, segments, ())
    dt = rounded_time_step(critical_time_step(build_plate(made, generate(made))))
    return replace(made, macros=decks.impact_program(dt, round(end / dt)))


@case
def _small_mass() -> Sequence[Value]:
    dashpot, mass = infinite_plate(1.0, 1.0, 1.0, 1.0), 0.0128
    plate = laminate(SQUARE, [0.0], [SQUARE_H])
    parameter = inelasticity(mass, 1.0, SQUARE_K, plate.mass, effective_rigidity(plate))
    return [
        dashpot.peak, dashpot.time, parameter,
        infinite_plate(mass, 1.0, SQUARE_K, parameter).peak,
        decks.result_of(struck_square(mass, 3e-5)).force.max(),
    ]  # fmt: skip


@case
def _large_mass() -> Sequence[Value]:
    (problem,) = load_deck(struck_square(1.0, 1e-6).to_text()).problems
    assert problem.contact is not None
    stiffness = static_stiffness(problem.moving_plate, problem.contact)
    return [stiffness, static_plate(5.5, 2.0, 1e9, 2.5e6).peak]
