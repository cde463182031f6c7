"""Section about the model of a run: plate, laminate, plies, projectile, contact, program."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from fecm._table import Cell, Row, ShownNumber
from fecm._text import DECK_DIGITS
from fecm.deck import model
from fecm.deck.catalogue import material_names
from fecm.deck.layup import layup_text
from fecm.deck.macros import flat
from fecm.deck.units import (
    COEFFICIENT,
    DENSITY,
    MASS,
    MODULUS,
    TOUGHNESS,
    mass_in_si,
    quantity,
    unit_names,
    unit_of,
)
from fecm.problem.problem import Problem
from fecm.problem.summary import rise_of
from fecm.problem.support_summary import support_rows, supports_summary
from fecm.report.content import (
    PageBlock,
    PagePicture,
    number_with_unit,
    page_table,
)
from fecm.report.figures import inside, stack
from fecm.report.subject import impactor, plate_extent
from fecm.results.result import Result
from fecm.results.stored import whole_plate
from fecm.results.summary import radii_of

PLY = (
    ("density", DENSITY),
    ("e1", MODULUS),
    ("e2", MODULUS),
    ("g12", MODULUS),
    ("g13", MODULUS),
    ("g23", MODULUS),
    ("nu12", ""),
)
STRENGTHS = ("xt", "xc", "yt", "yc", "s12", "s13", "s23")
LAW = (COEFFICIENT, "length", "", "")  # dimensions of the constants of EXPE


def of_problem(result: Result, problem: Problem) -> Iterator[PageBlock]:
    """Yield the tables and pictures of a problem."""
    deck = problem.deck
    yield from page_table(_plate(result, problem), title="Plate")
    struck = None if impactor(result, deck) is None else problem.laminate_number
    for place, (number_of, layers) in enumerate(deck.layers.items()):
        if place == struck:  # drawn on the first sheet
            continue
        layup = layup_text([layer.angle for layer in layers])
        name = f"Laminate {number_of}: {layup}" if len(deck.layers) > 1 else f"Laminate {layup}"
        words = f"{name}, {len(layers)} plies, the struck face on top."
        yield PagePicture(inside(stack(layers, material_names(deck))), words, words)
    yield from _materials(deck)
    yield from page_table(_impact(result, deck), title="Projectile and contact")
    yield from page_table(_program(problem), title="Program")


def _plate(result: Result, problem: Problem) -> Iterator[Row]:
    """Yield rows about the plate, its mesh, supports and loads."""
    from fecm.plot.mesh import RESTRAINTS, support_masks

    deck, plate = problem.deck, problem.plate
    in_units = partial(_in_units, deck)
    yield "extent", plate_extent(problem)
    if text := whole_plate(problem.symmetry.factor):
        yield "symmetry", f"{problem.symmetry.places}, {text}"
    yield "thickness", in_units(problem.laminate.thickness, "length")
    control = deck.control
    yield "mesh", f"{control.numel} elements of up to {control.nen} nodes, {control.numnp} nodes"
    if "mesh/equations" in result:
        held = {kind: int(nodes.sum()) for kind, nodes in support_masks(result).items()}
        texts = [f"{held[kind]} nodes {kind}" for kind in RESTRAINTS if held[kind]]
        if texts or plate.supports is None:
            yield "supports", ", ".join(texts) or "none: the plate is free"
    if (supports := supports_summary(problem)) is not None:
        yield from support_rows(supports, unit_names(deck))
    for axis, radius in radii_of(result).items():
        yield f"radius R{axis}", in_units(radius, "length")
    if "mesh/z" in result:
        yield "rise of the curved panel", in_units(rise_of(problem), "length")
    yield "kinematics", "von Kármán: stretches as it bends" if plate.nonlinear else "linear"
    mass = problem.plate_mass
    yield "mass", ShownNumber(mass, _mass(deck, mass))
    for name, force in zip(("N0x", "N0y", "N0xy"), plate.preload, strict=True):
        if force:
            yield f"preload {name}", in_units(force, "force/length")
    if (cure := deck.last(model.Cure)) is not None:
        yield "cure", f"temperature difference {cure.delta_t:g}"
    for name in "ABD":
        matrix = _rounded(getattr(problem.laminate, name))
        if not matrix.any():
            continue
        dimension = {"A": "force/length", "B": "force", "D": "force*length"}[name]
        rows = "; ".join(" ".join(f"{value:.4g}" for value in row) for row in matrix)
        yield f"{name} ({unit_of(dimension, unit_names(deck)) or 'deck units'})", rows


def _rounded(matrix: np.ndarray) -> np.ndarray:
    """Return a matrix with its rounding errors as zeros."""
    return np.where(np.abs(matrix) < 1e-9 * max(1.0, np.abs(matrix).max()), 0.0, matrix)


def _materials(deck: model.Deck) -> Iterator[PageBlock]:
    """Yield tables of constants and strengths of the plies of every material."""
    plies = dict(sorted(deck.plies.items()))
    names = _headings(deck)
    header = ["constant", *(names[number] for number in plies)]
    if len(plies) == 1:
        header = ["constant", "ply"]
    rows = [
        (name, *(_in_units(deck, getattr(ply, name), dimension) for ply in plies.values()))
        for name, dimension in PLY
    ]
    yield from page_table(rows, header, "Ply constants")
    if (strengths := deck.last(model.Allowables)) is None:
        return
    allowables = {strength.material: strength for strength in (strengths, *strengths.others)}
    header = ["strength", *(names[number] for number in allowables)]
    if len(allowables) == 1:
        header = ["strength", "ply"]
    rows = [
        (
            name,
            *(
                _in_units(deck, getattr(strength, name), MODULUS)
                for strength in allowables.values()
            ),
        )
        for name in STRENGTHS
    ]
    yield from page_table(rows, header, "Ply strengths")


def _headings(deck: model.Deck) -> dict[int, str]:
    """Return numbers and names of the materials, by number."""
    names = {number: f"material {number}" for number in deck.plies}
    named = material_names(deck)
    return {n: name if named[n] == name else f"{n}: {named[n]}" for n, name in names.items()}


def _impact(result: Result, deck: model.Deck) -> Iterator[Row]:
    """Yield rows about projectile, velocity, energy, contact law, patch and toughness."""
    hits, law = impactor(result, deck), deck.last(model.Indentation)
    in_units = partial(_in_units, deck)
    if hits is None or law is None:
        return
    yield "projectile", hits.name
    yield "mass", ShownNumber(hits.mass, _mass(deck, hits.mass))
    yield "velocity", in_units(hits.velocity, "length/time")
    yield "energy", in_units(hits.energy, "force*length")
    if user_law := result.attributes.get("law"):
        yield "contact law", f"{user_law}, instead of EXPE"
    else:
        yield "contact law", "equation 3-7 (ACR)" if law.word else "equation 3-8"
        factors = [result.symmetry_factor, 1, 1, 1]
        for name, part, factor, dimension in zip(
            law.names(), law.values(), factors, LAW, strict=True
        ):
            value = factor * part
            if value or dimension == COEFFICIENT:
                yield name, in_units(value, dimension)
    if (patch := deck.last(model.Patch)) is not None:
        yield "patch", {"DISC": "uniform pressure", "HERT": "Hertz's pressure"}[patch.shape]
    if (toughness := deck.last(model.Delamination)) is not None:
        yield "mode II toughness", in_units(toughness.toughness, TOUGHNESS)


def _program(problem: Problem) -> Iterator[Row]:
    """Yield rows about the time steps."""
    steps = [m.value for m in flat(problem.program) if m.word == "DT"]
    yield "impact steps", ShownNumber(problem.work.steps, str(problem.work.steps))
    if steps:
        yield "time step", _in_units(problem.deck, max(steps), "time")


def _in_units(deck: model.Deck, value: float, dimension: str) -> Cell:
    """Return a value in the units of the deck."""
    return number_with_unit(float(value), unit_of(dimension, unit_names(deck)), DECK_DIGITS)


def _mass(deck: model.Deck, mass: float) -> str:
    """Format a mass in g or kg where the units are known."""
    names = unit_names(deck)
    return mass_in_si(mass, names) or quantity(mass, unit_of(MASS, names), DECK_DIGITS)
