"""Plates that stretch as they bend, under loads and an impact (mm, N, s)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import fecm.verification.decks as decks
from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.grid import ElementGrid, graded, grid_lines, uniform_section
from fecm.deck.model import Deck, Impact, NodeValues, Patch, Ply, Projectile, Segment
from fecm.mechanics.interpolation import interpolate
from fecm.mechanics.reduced_plate import reduced_plate
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.problem.generate import generate
from fecm.problem.parts import build_plate
from fecm.verification.case import Value, case

NEWTON = decks.program("LOOP=30 TANG FORM SOLV CONV NEXT DISP")
STRETCHES: tuple[Segment, ...] = (decks.MITC, model.Nonlinear())
FACTOR = 5.0 / 6.0  # factor of the transverse shear moduli
THICKNESS = 2.0
ALUMINIUM = decks.isotropic(70e3, 0.3, 2.7e-9, FACTOR)
FIBRES = Ply(1.53e-9, 0.3, 141e3, 9700.0, 5500.0, 5500.0 * FACTOR, 3700.0 * FACTOR)
ELEMENTS = 6  # elements along a side of a quarter
# Codes of all nodes, and of the left and bottom edges of a quarter, its lines of symmetry.
QUARTER = "00000 10010 01001"
# Codes of the right and top edges.
CLAMPED = "11111 11111"
RESTS = "00100 00100"
PRESSURES = (0.1022849258, 0.02069852564)  # on a clamped disc, and on a disc that rests on its rim
VELOCITY = 2271.56334  # velocity of the mass


def middle_deflection(deck: Deck) -> float:
    """Return the deflection of node 1."""
    return float(decks.run_of_deck(deck).tape3.w[-1, 0])


@case
def _stretching_plate() -> Sequence[Value]:
    """Compute the deflection of Levy's clamped plate with side 1, thickness 1/100 and modulus 1."""
    h = 0.01
    plate = decks.material(decks.isotropic(1.0, 0.1**0.5, 1.0, FACTOR), [0.0], h)
    codes = f"{QUARTER} {CLAMPED}"
    deck = decks.quarter_plate(ELEMENTS, plate, NEWTON, 134.9 * h**4, codes, STRETCHES)
    return [middle_deflection(deck) / h]


def strip(
    end: str, pressure: float, further: Sequence[Segment] = STRETCHES, *, slant: float = 0.0
) -> Deck:
    """Build half a strip of [0_4/90_4] in cylindrical bending, from its middle to an end.

    The lines of nodes across the strip slant to alternate sides by `slant`, a share of an element.
    """
    half, width = 50.0, 10.0
    grid = ElementGrid(uniform_section(half, 8), uniform_section(width, 1))
    loads = np.zeros((grid.up, grid.across, 5))
    across, along = (decks.weights(grid_lines(parts)) for parts in (grid.rows, grid.columns))
    loads[..., 2] = pressure * np.outer(across, along)
    loads[:, -1] = 0.0  # on a restrained dof, FORC is a displacement
    plate = decks.material(FIBRES, 4 * (0.0,) + 4 * (90.0,), 0.25)
    supports = decks.restraints(grid, f"01001 11011 01001 {end} 01001")
    x, y = (v.ravel() for v in np.meshgrid(grid_lines(grid.columns), grid_lines(grid.rows)))
    side = half / 8
    x = x + slant * side * np.sin(np.pi * x / (2.0 * side)) * (2.0 * y / width - 1.0)
    places = np.column_stack([x, y]).tolist()
    cards = (NodeValues(n, 0, tuple(place)) for n, place in enumerate(places, start=1))
    coordinates = model.Coordinates(tuple(cards)) if slant else None
    segments = (supports, decks.forces(loads), plate, *further)
    return decks.deck(grid, segments, NEWTON, coordinates)


@case
def _cylindrical_bending() -> Sequence[Value]:
    pinned, clamped, sliding = "11101", "11111", "01101"
    pressure = 0.1
    bent, linear = strip(sliding, pressure), strip(sliding, pressure, [decks.MITC])
    return [
        middle_deflection(strip(pinned, 0.01)),
        middle_deflection(strip(pinned, -0.01)),
        middle_deflection(strip(clamped, 0.03)),
        middle_deflection(bent) / middle_deflection(linear),
        middle_deflection(strip(pinned, 0.01, slant=0.3)),
    ]


def disc(rim: str, pressure: float) -> Deck:
    """Build a quarter of a circular plate under pressure; its mesh is a mapped square."""
    radius = 100.0
    grid = ElementGrid(uniform_section(1.0, ELEMENTS), uniform_section(1.0, ELEMENTS))
    x, y = (v.ravel() for v in np.meshgrid(grid_lines(grid.columns), grid_lines(grid.rows)))
    places = radius * np.stack([x * np.sqrt(1.0 - y**2 / 2.0), y * np.sqrt(1.0 - x**2 / 2.0)], 1)
    cards = (NodeValues(n, 0, tuple(place)) for n, place in enumerate(places.tolist(), start=1))
    supports = decks.restraints(grid, f"{QUARTER} {rim}")
    plate = decks.material(ALUMINIUM, [0.0], THICKNESS)
    segments = (supports, plate, *STRETCHES)
    deck = decks.deck(grid, segments, NEWTON, model.Coordinates(tuple(cards)))
    loads = pressure * areas(deck)
    loads[(x == 1.0) | (y == 1.0)] = 0.0  # on a restrained dof, FORC is a displacement
    field = np.zeros((grid.nodes, 5))
    field[:, 2] = loads
    return replace(deck, segments=(*deck.segments, decks.forces(field)))


def areas(deck: Deck) -> Floats:
    """Return the integrals of the shape functions of the nodes, (numnp,)."""
    plate = build_plate(deck, generate(deck))
    integrals = np.zeros(len(plate.mesh.coordinates))
    for family in plate.families:
        points = interpolate(family, plate.rules.bending)
        np.add.at(integrals, family.nodes, points.jxw @ points.N)
    return integrals


@case
def _stretching_disc() -> Sequence[Value]:
    rims = zip((CLAMPED, RESTS), PRESSURES, strict=True)
    return [middle_deflection(disc(rim, pressure)) / THICKNESS for rim, pressure in rims]


@case
def _stretching_impact() -> Sequence[Value]:
    """Compute an impact on the middle of a clamped square plate, until both peaks have passed."""
    side, end = 100.0, 1.7e-3
    sections = graded(side, 8, side / 2.0, 2.0)
    grid = ElementGrid(sections, sections)
    segments = (
        decks.restraints(grid, f"00000 {CLAMPED} {CLAMPED}"),
        Projectile(0, 0, 1e-3),
        Impact(grid.nearest(side / 2.0, side / 2.0)[0], 3, VELOCITY),
        Patch("HERT", 8.0, side / 2.0, side / 2.0),
        decks.elastic(1e5),
        *STRETCHES,
        decks.material(ALUMINIUM, [0.0], THICKNESS),
    )
    deck = decks.deck(grid, segments, ())
    dt = rounded_time_step(critical_time_step(build_plate(deck, generate(deck))))
    deck = replace(deck, macros=decks.history_program(dt, round(end / dt)))
    result = decks.run_of_deck(deck)
    balance = np.abs(result.energy.balance_error).max() / result.energy.attributes["initial"]
    return [result.plate_w.max(), result.force.max(), balance]


@case
def _reduced_plate() -> Sequence[Value]:
    """Compute the reduced model of a simply supported square plate with w = h in the middle.

    The value is the internal force of the first mode over its linear part.
    """
    codes = f"{QUARTER} 10101 01110"
    material = decks.material(ALUMINIUM, [0.0], THICKNESS)
    side = 200.0 * THICKNESS
    deck = decks.quarter_plate(4, material, (), 0.0, codes, STRETCHES, side)
    stretched = build_plate(deck, generate(deck))
    load = np.zeros((len(stretched.mesh.coordinates), 5))
    load[0, 2] = 1.0
    plate = reduced_plate(stretched, load, 1)
    bending = plate.bending
    mode = int(np.argmax(plate.deflection[:bending] ** 2 / plate.stiffness[:bending]))
    q = np.zeros(len(plate.stiffness))
    q[mode] = THICKNESS / plate.deflection[mode]
    first, second = np.triu_indices(plate.shapes)
    z = plate.part @ q[:bending]
    pull = plate.cubic[plate.shapes :] @ (z[first] * z[second])
    q[bending:] = -pull / plate.stiffness[bending:]  # the membrane in equilibrium
    force = plate.internal_forces(q[:, None])[mode, 0]
    return [float(force / (plate.stiffness[mode] * q[mode]))]
