"""Plates against series: deflections, frequencies, time steps and stresses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import fecm.verification.decks as decks
from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.catalogue import MATERIALS
from fecm.deck.grid import ElementGrid, grid_lines, uniform_section
from fecm.deck.model import Gage, LoadTable, Macro, Patch, Ply, Segment
from fecm.mechanics.laminate import laminate
from fecm.mechanics.ply_stresses import residual_stresses
from fecm.mechanics.solutions import buckling_factor
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.generate import generate
from fecm.problem.parts import build_plate
from fecm.results.exposures import largest_exposures
from fecm.results.result import Result
from fecm.verification.case import Value, case
from fecm.verification.parts import FIBRES

# Elements along a side of a quarter plate.
ELEMENTS = 8
FEWER = 6
THICKNESS = 0.1
STIFF = Ply(1.0, 0.25, 25.0, 1.0, 0.5, 0.5, 0.2)  # Pagano's ply
SANDWICH_CORE = Ply(0.2, 0.25, 0.04, 0.04, 0.016, 0.06, 0.06)
CROSS = (0.0, 90.0, 0.0)
QUASI = (45.0, 0.0, -45.0, 90.0)


@case
def _time_step() -> Sequence[Value]:
    grid = ElementGrid(uniform_section(0.3, 1), uniform_section(0.3, 1))
    deck = decks.deck(grid, [decks.material(decks.isotropic(1.0e7, 0.3, 2.5e-4), [0.0], 0.1)], ())
    mesh, steps = generate(deck), []
    for dof in (2, 3):  # w and theta_x of node 5, the centre
        codes, equations = np.ones_like(mesh.codes), np.zeros_like(mesh.equations)
        codes[4, dof], equations[4, dof] = 0, 1
        held = replace(mesh, codes=codes, equations=equations)
        steps.append(critical_time_step(build_plate(deck, held)))
    return steps


@case
def _static_bending() -> Sequence[Value]:
    """Compute deflections with shear order 2, which does not lock, and with order 3."""

    def w(thickness: float, factor: float = 1.0, shear_order: int = 2) -> Floats:
        ply = decks.isotropic(1.0, 0.3, 1.0, factor)
        plate = decks.material(ply, [0.0], thickness, shear_order)
        deck = decks.quarter_plate(ELEMENTS, plate, decks.DEFLECTION, 1.0)
        return np.asarray(decks.run_of_deck(deck).tape3.w[0])

    quarter = ELEMENTS + ELEMENTS * (2 * ELEMENTS + 1)  # the row of the node at (a/4, a/4)
    thick = w(0.1)
    return [
        thick[0],
        thick[quarter],
        w(0.01)[0],
        w(0.1, 5.0 / 6.0)[0],
        w(0.1, shear_order=3)[0],
        w(0.01, shear_order=3)[0],
    ]


@case
def _frequencies() -> Sequence[Value]:
    """Compute the frequencies of symmetric modes of a quarter plate, and of uniform shear."""
    plate = decks.material(decks.ONE, [0.0], 0.1, 2)
    macros = decks.program("LMAS EIGE=4 CMAS EIGE=4")
    frequencies = decks.run_of_deck(
        decks.quarter_plate(ELEMENTS, plate, macros)
    ).modes.angular_frequency
    scaled = frequencies * math.sqrt(0.1 / (0.1**3 / (12.0 * (1.0 - 0.3**2))))
    grid = ElementGrid(uniform_section(0.7, 2), uniform_section(1.3, 2))
    held = grid.boundary((1, 1, 1, 0, 1), {})
    deck = decks.deck(grid, (held, decks.material(decks.ONE, [0.0], 0.1)), ())
    free = build_plate(deck, generate(deck))
    ones = np.ones(free.neq)
    # Rayleigh's quotient of a free plate under uniform transverse shear.
    shear = math.sqrt(float(ones @ (free.stiffness @ ones)) / float(free.mass @ ones))
    # Modes 11, 13, 31 and 33 with the lumped mass, then the same modes with the consistent mass.
    return [scaled[0], scaled[1], scaled[4], scaled[7], shear]


def two_layers(angles: Sequence[float], codes: str, mode: int, node: int) -> Sequence[Value]:
    """Compute two frequencies, and under a load w in the middle and u at a node."""

    def run(shear_order: int, load: float, macros: Sequence[Macro]) -> Result:
        card = decks.material(FIBRES, angles, THICKNESS / 2.0, shear_order)
        return decks.run_of_deck(decks.quarter_plate(FEWER, card, macros, load, codes))

    modes = [run(n, 0.0, decks.program("LMAS EIGE=3")).modes.angular_frequency for n in (2, 3)]
    first, second = (run(n, 1.0, decks.DEFLECTION).tape3.displacement[0] for n in (2, 3))
    return [modes[0][0], modes[0][mode], modes[1][0], first[0, 2], first[node, 0], second[0, 2]]


@case
def _cross_ply_plate() -> Sequence[Value]:
    return two_layers((0.0, 90.0), decks.CROSS_PLY, 1, 2 * FEWER)


@case
def _angle_ply_plate() -> Sequence[Value]:
    return two_layers((45.0, -45.0), decks.ANGLE_PLY, 2, (2 * FEWER + 1) * 2 * FEWER)


TENSION = model.Preload(0.02, 0.005)
COMPRESSION = model.Preload(-0.004, -0.004)


@case
def _preload() -> Sequence[Value]:
    """Compute buckling loads of symmetric modes, frequencies, deflection, forces and stresses."""
    plate = decks.material(STIFF, CROSS, THICKNESS / len(CROSS))

    def build(preload: model.Preload, macros: str, load: float = 0.0) -> model.Deck:
        segments = [decks.MITC, preload]
        return decks.quarter_plate(ELEMENTS, plate, decks.program(macros), load, further=segments)

    def factor(n_x: float, n_y: float) -> float:
        deck = build(model.Preload(n_x, n_y), "")
        return buckling_factor(build_plate(deck, generate(deck)))

    modes = [
        decks.run_of_deck(build(preload, "LMAS EIGE=2")).modes.angular_frequency
        for preload in (TENSION, COMPRESSION)
    ]
    bent = decks.run_of_deck(build(TENSION, "TANG FORM SOLV DISP", 1.0))
    rest = decks.run_of_deck(build(TENSION, "STRE PLYS"))
    return [
        *(factor(*force) for force in ((-1.0, 0.0), (0.0, -1.0), (-1.0, 0.5))),
        *modes[0],
        modes[1][0],
        bent.tape3.w[0, 0],
        *decks.field_values(rest, "stresses", "N_x N_y"),
        rest["plies/sigma_1"][:, :, :, [0, 2]],
        rest["plies/sigma_2"][:, :, :, 1],
    ]


@case
def _forced_plate() -> Sequence[Value]:
    # The gage is on the face away from the load, at one of the 2 x 2 Gauss points, where the
    # strains of a 9-node element are most accurate.
    root = (1.0 - 1.0 / np.sqrt(3.0)) / 2.0 * 0.5 / FEWER
    gage = Gage(
        1, float(f"{1 / 12 + root:.9g}"), float(f"{0.25 + root:.9g}"), THICKNESS / 2.0, 30.0
    )
    steps = decks.program("LMAS DT=1.08e-7 PROP=1 LOOP=600 TIME EXCD DISP=600 NEXT")
    card = decks.material(FIBRES, (0.0, 90.0), THICKNESS / 2.0, 2)
    deck = decks.quarter_plate(FEWER, card, steps, 1.0, decks.CROSS_PLY, [model.Gages((gage,))])
    table = LoadTable(1, 2, 0.0, 1.0, (0.0, 0.0, 1.0, 5.0e4, 0.0))
    result = decks.run_of_deck(replace(deck, tables=(table,)))
    return [result.tape3.w[-1, 0], result.gages.strain[-1, 0]]


@case
def _patch_compliance() -> Sequence[Value]:
    compliances, radii = [], []
    for shape in ("DISC", "HERT"):
        patch = Patch(shape, 0.5, decks.SIDES[0] / 2.0, decks.SIDES[1] / 2.0, 1.0)
        result = decks.run_of_deck(decks.pressed_rectangle(12, patch, decks.DEFLECTION))
        compliances.append(result.tape3.w[0, result["patch/node"] - 1] @ result["patch/weight"])
        blank = decks.run_of_deck(
            decks.pressed_rectangle(3, replace(patch, radius=None), decks.DEFLECTION)
        )
        radii.append(blank.attributes_of("patch")["radius"] / 0.106)
    return compliances + radii


@case
def _equilibrium_shear() -> Sequence[Value]:

    def shear(ply: Ply, angles: Sequence[float]) -> Floats:
        plate = decks.material(ply, angles, 1.0 / len(angles))
        deck = decks.quarter_plate(1, plate, (), further=[model.Shear(equilibrium=True)])
        return build_plate(deck, generate(deck)).laminate.shear

    unsymmetric = shear(STIFF, (30.0, -45.0, 90.0))
    return [
        shear(decks.ONE, [0.0])[0, 0] / decks.ONE.g13,
        *shear(STIFF, CROSS).diagonal(),
        *shear(STIFF, (0.0, 90.0)).diagonal(),
        unsymmetric[0, 0],
        unsymmetric[1, 1],
        unsymmetric[0, 1],
    ]


def bent(
    ply: Ply,
    angles: Sequence[float],
    thickness: float = THICKNESS,
    word: str = "PLYS",
    *further: Segment,
    q: float = 1.0,
) -> Result:
    """Run a simply supported square under q cos(pi x) cos(pi y) with the origin in its middle."""
    along = np.cos(np.pi * np.array(grid_lines(uniform_section(0.5, ELEMENTS))))
    plate = decks.material(ply, angles, thickness / len(angles), points=2)
    macros, load = decks.program(f"TANG FORM SOLV STRE {word}"), q * np.outer(along, along)
    deck = decks.quarter_plate(ELEMENTS, plate, macros, load, further=[decks.MITC, *further])
    return decks.run_of_deck(deck)


@case
def _ply_stresses() -> Sequence[Value]:
    result = bent(STIFF, CROSS)
    x, y = decks.field_values(result, "stresses", "x y")
    even, odd = np.cos(np.pi * x) * np.cos(np.pi * y), np.sin(np.pi * x) * np.sin(np.pi * y)
    x, y = x.mean(axis=1), y.mean(axis=1)
    sigma_1, sigma_2, shear, xz, yz = (
        field[0]
        for field in decks.field_values(result, "plies", "sigma_1 sigma_2 tau_12 tau_xz tau_yz")
    )
    return [
        (sigma_1[:, :, 2, 1], even),
        (sigma_2[:, :, 2, 1], even),
        (shear[:, :, 2, 1], odd),
        (sigma_1[:, :, 1, 1], even),
        (xz[:, 1, 1], np.sin(np.pi * x) * np.cos(np.pi * y)),
        (yz[:, 1, 1], np.cos(np.pi * x) * np.sin(np.pi * y)),
    ]


def _sandwich_deck(ratio: float) -> model.Deck:
    """Build Pagano's sandwich, a square of side 1 and thickness 1/ratio.

    The load is cos(pi x) cos(pi y).
    """
    along = np.cos(np.pi * np.array(grid_lines(uniform_section(0.5, ELEMENTS))))
    parts = ((0.1, 1), (0.8, 2), (0.1, 1))  # share of the thickness, and material
    layers = tuple(
        model.Layer(n, 0.0, share / ratio, material)
        for n, (share, material) in enumerate(parts, start=1)
    )
    plate = model.Material(model.Integration(3, 3, 2, 1.0 / ratio), STIFF, layers)
    core = model.Materials((model.NumberedPly(model.MaterialNumber(2), SANDWICH_CORE),))
    shear = model.Shear(assumed=True, equilibrium=True)
    macros = decks.program("TANG FORM SOLV DISP PLYS STRE")
    load = np.outer(along, along)
    return decks.quarter_plate(ELEMENTS, plate, macros, load, further=[shear, core])


@case
def _unlike_densities() -> Sequence[Value]:
    """Compute mass and inertia of a sandwich; its core has a fifth of the faces' density."""
    deck = _sandwich_deck(1.0)
    laminate = build_plate(deck, generate(deck)).laminate
    return [laminate.mass, laminate.rotary_inertia]


@case
def _sandwich() -> Sequence[Value]:
    thin, thick = (decks.run_of_deck(_sandwich_deck(ratio)) for ratio in (100.0, 10.0))
    x, y = decks.field_values(thin, "stresses", "x y")
    even, odd = np.cos(np.pi * x) * np.cos(np.pi * y), np.sin(np.pi * x) * np.sin(np.pi * y)
    x, y = x.mean(axis=1), y.mean(axis=1)
    along, across = np.sin(np.pi * x) * np.cos(np.pi * y), np.cos(np.pi * x) * np.sin(np.pi * y)
    values: list[Value] = [
        (thin[f"plies/{name}"][0, :, :, 2, 1] / 100.0**2, shape)
        for name, shape in (("sigma_1", even), ("sigma_2", even), ("tau_12", odd))
    ]
    for ratio, result in ((100.0, thin), (10.0, thick)):
        for name, shape in (("tau_xz", along), ("tau_yz", across)):
            values.append((result[f"plies/{name}"][0, :, 1, 1] / ratio, -shape))
    return [*values, 100.0 * thick.tape3.w[0, 0] / 10.0**3]


@case
def _ply_shear() -> Sequence[Value]:
    result = bent(decks.ONE, (0.0,) * 4)
    x, y = (place.mean(axis=1) for place in decks.field_values(result, "stresses", "x y"))
    shape = np.sin(np.pi * x) * np.cos(np.pi * y)
    tau = result["plies/tau_xz"][0]
    at_faces = (tau[:, [0, 3], [0, 2]], shape[:, None])
    return [*((tau[:, 2, height], shape) for height in (0, 2, 1)), at_faces]


@case
def _failure() -> Sequence[Value]:
    named = MATERIALS["T300/5208"]
    strengths = named.allowables("m-N-s")
    assert strengths is not None
    result = bent(named.ply, (0.0, 90.0, 90.0, 0.0), 0.01, "FAIL", strengths)
    return [1.0 / result[f"failure/{name}/exposure"].max() for name in ("max_stress", "tsai_wu")]


def cure_of_named_ply(dt: float) -> model.Cure:
    """Return CURE for the named ply T300/5208 after a change of temperature."""
    expansion = MATERIALS["T300/5208"].expansion
    assert expansion is not None
    return model.Cure(dt, expansions=(expansion,))


@case
def _residual_stresses() -> Sequence[Value]:
    ply, cold = MATERIALS["T300/5208"].ply, cure_of_named_ply(-100.0)
    kaw = laminate(ply, (0.0, 90.0), (0.005, 0.005))
    stresses = residual_stresses(kaw, *cure_of_named_ply(-75.0).strains(1))
    lower, upper = stresses.stresses[0]
    across = [
        bent(ply, angles, 0.01, "PLYS", cold)["plies/cure_stress"][0, 0, 1]
        for angles in ((0.0, 90.0, 90.0, 0.0), 4 * QUASI + 4 * QUASI[::-1])
    ]
    moist = model.Cure(0.0, 0.5, (model.Expansion(beta1=2e-4, beta2=6e-3),)).strains(1)
    symmetric = laminate(ply, (0.0, 90.0, 90.0, 0.0), (0.0025,) * 4)
    return [
        stresses.strain[0],
        stresses.curvature[0],
        lower[0],
        upper[0],
        lower[1],
        upper[1],
        *across,
        residual_stresses(symmetric, *moist).stresses[0, 0, 1],
    ]


@case
def _cured_failure() -> Sequence[Value]:
    named = MATERIALS["T300/5208"]
    strengths = named.allowables("m-N-s")
    assert strengths is not None
    q, angles = 5e4, (0.0, 90.0, 90.0, 0.0)
    result = bent(named.ply, angles, 0.01, "FAIL", strengths, cure_of_named_ply(-100.0), q=q)
    factors = {exposure.criterion: exposure.load_factor for exposure in largest_exposures(result)}
    return [q * (factors[name] or 0.0) for name in ("max_stress", "tsai_wu", "puck")]
