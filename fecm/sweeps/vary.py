"""Apply the values of a case to a deck."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from fecm.deck import model
from fecm.deck.catalogue import NU23, STANDARD, STEEL_MODULUS, STEEL_POISSON, SYSTEMS
from fecm.deck.findings import Findings
from fecm.deck.layup import LayupError, parse_layup
from fecm.deck.macros import STEPS, compile_program, every, flat
from fecm.deck.reader import ParsedProblem
from fecm.deck.records import Layer, Macro, NodeCodes, NodeValues
from fecm.deck.units import MODULUS, in_si, unit_names
from fecm.mechanics.contact_law import hertz_coefficient
from fecm.mechanics.half_space import effective_stiffness, indentation_modulus
from fecm.mechanics.mesh import element_blocks, holds_the_plane
from fecm.mechanics.points import locate
from fecm.mechanics.projectile import RigidMass
from fecm.mechanics.time_step import rounded_time_step, taken_time_step
from fecm.problem.check import check
from fecm.problem.generate import generate, restraint_codes
from fecm.problem.parts import build_projectile, is_coupled, projectile_segment
from fecm.problem.plate_mesh import BOUNDARY, PlateMesh
from fecm.problem.problem import Problem
from fecm.problem.refine import RefineError, refined
from fecm.problem.rules.time_step import UNSTABLE
from fecm.sweeps.cases import (
    LAMINATE,
    REFINE,
    THICKNESS,
    Case,
    CasesError,
    Value,
    check_names,
    pair,
)

MASS = ("mass", "rod_mass")


def apply_case(deck: model.Deck, case: Case) -> model.Deck:
    """Return a deck with the values of a case.

    A layup uses the ply thickness of the deck, so that more plies give a thicker plate; the
    thickness of the laminate scales every layer.  A mass scales the density of a rod.  A time step
    changes the number of steps, so that the duration is kept; 0 is 0.9 of the critical time step of
    the case.

    A deck with B = 0 may restrain u and v at every node, because they are zero anyway.  If the case
    has B != 0, they are restrained only at the nodes that restrain w, as in a deck of ``fecm new``.

    A deck without a patch gets a disc.  Raises CasesError if a value is invalid for this deck.
    """
    check_names(case)
    made = deck
    for name, setter in _SETTERS.items():
        if name in case:
            made = setter(made, name, case[name])
    before = deck.last(model.Material)
    if before and not is_coupled(before) and is_coupled(made.require(model.Material)):
        made = _free_in_plane(made)
    dt, duration = (None if n not in case else float(case[n]) for n in ("dt", "duration"))
    if duration is not None and not duration > 0.0:
        raise CasesError(f"duration must be positive, not {duration:g}")
    if dt == 0.0:
        dt = stable_time_step(made)
    if dt is not None or duration is not None:
        given = all(macro.value for macro in deck.macros if macro.word == "DT")
        made = with_time_step(made, dt, 0.0 if given else stable_time_step(deck), duration)
    return replace(made, text="")


def check_deck(deck: model.Deck) -> Problem:
    """Check a complete deck.  Raises CasesError if it has an error; the first is the message."""
    findings = Findings()
    checked = check(ParsedProblem(deck), findings)
    raise_first(findings)
    assert checked is not None  # the deck has a control card
    return checked


def raise_first(findings: Findings) -> None:
    """Raise the first error as that of a case."""
    if findings.errors:
        first = findings.errors[0]
        remedy = " Vary dt=auto, or take DT 0." if first.code == UNSTABLE else ""
        raise CasesError(f"{first.message}{remedy}")


@lru_cache(maxsize=8)
def stable_time_step(deck: model.Deck) -> float:
    """Time step that DT 0 would mean in a deck."""
    # DT 0 is below the critical time step of any plate.
    return taken_time_step(check_deck(with_time_step(deck, 0.0)).critical_time_step)


def _free_in_plane(deck: model.Deck) -> model.Deck:
    """Restrain u and v only where w is, if the deck restrains them at every node."""
    boundaries = tuple(deck.all(model.Boundary))
    if not holds_the_plane(restraint_codes(boundaries, deck.control.numnp, deck.control.ndf)):
        return deck

    # Codes are generated for each dof independently, so that copies of the codes of w act like w's.
    def freed(record: NodeCodes) -> NodeCodes:
        w = record.codes[2]
        return replace(record, codes=(w, w, *record.codes[2:]), source=None)

    for old in boundaries:
        deck = _swap(deck, old, replace(old, records=tuple(map(freed, old.records)), source=None))
    return deck


def _swap(deck: model.Deck, old: model.Segment | None, new: model.Segment) -> model.Deck:
    """Replace a segment, or add one."""
    if old is None:
        return replace(deck, segments=(*deck.segments, new))
    segments = tuple(new if segment is old else segment for segment in deck.segments)
    return replace(deck, segments=segments)


# Segment and field of the values that are fields of a segment.
_FIELDS: dict[str, tuple[type[model.Impact | model.Indentation | model.Patch], str]] = {
    "velocity": (model.Impact, "velocity"),
    "impact_node": (model.Impact, "node"),
    **{name: (model.Indentation, name) for name in ("k", "alpha_p", "s_p", "q")},
    "patch": (model.Patch, "radius"),
    "x0": (model.Patch, "x"),
    "y0": (model.Patch, "y"),
}


def _field(deck: model.Deck, name: str, value: Value) -> model.Deck:
    """Change a field of a segment; add a patch if the deck has none."""
    kind, field = _FIELDS[name]
    old = deck.last(kind) if kind is model.Patch else deck.require(kind)
    changed: dict[str, Any] = {field: value, "source": None}
    return _swap(deck, old, replace(old or model.Patch(), **changed))


def _rod(deck: model.Deck, name: str, value: Value) -> model.Deck:
    """Change the projectile; add the segment if the deck has none."""
    rod, old, number = build_projectile(deck), deck.last(model.Projectile), float(value)
    if isinstance(rod, RigidMass):
        if name not in MASS:
            raise CasesError(f"{name}: the projectile of the deck is a rigid mass")
        return _swap(deck, old, projectile_segment(RigidMass(number)))
    field = {"rod_length": "size", "rod_modulus": "modulus"}.get(name, "density")
    if name in MASS:
        number = rod.density * number / rod.total_mass
    changed: dict[str, Any] = {field: number}
    new = projectile_segment(rod, 0 if old is None else old.transducer)
    return _swap(deck, old, replace(new, **changed))


def _energy(deck: model.Deck, name: str, value: Value) -> model.Deck:
    mass, energy = build_projectile(deck).total_mass, float(value)
    if not (mass > 0.0 and energy >= 0.0):
        raise CasesError(f"no velocity gives the energy {energy:g} to the mass {mass:g}")
    return _field(deck, "velocity", math.sqrt(2.0 * energy / mass))


def _radius(deck: model.Deck, name: str, value: Value) -> model.Deck:
    """Change k to that of a steel sphere on the laminate of the deck."""
    unit = in_si(MODULUS, unit_names(deck))
    if unit is None:
        hint = "add a UNIT segment, or vary k instead"
        raise CasesError(f"radius: the modulus of steel needs the units of the deck; {hint}")
    steel = STEEL_MODULUS * (in_si(MODULUS, SYSTEMS[STANDARD]) or 1.0) / unit
    try:
        modulus = _indentation_modulus(deck.require(model.Material))
        k = hertz_coefficient(float(value), steel, STEEL_POISSON, modulus)
    except ValueError as error:
        raise CasesError(f"k cannot be estimated: {error}") from None
    return _field(deck, "k", k)


@lru_cache(maxsize=256)
def _indentation_modulus(material: model.Material) -> float:
    angles = [layer.angle for layer in material.layers]
    thicknesses = [layer.thickness for layer in material.layers]
    return indentation_modulus(effective_stiffness(material.ply, angles, thicknesses, NU23))


def _at(deck: model.Deck, name: str, value: Value) -> model.Deck:
    """Move the centre of the patch; without one, hit the nearest node."""
    x, y = pair(name, str(value))
    patch = deck.last(model.Patch)
    if patch is not None:
        return _swap(deck, patch, replace(patch, x=x, y=y, source=None))
    mesh = generate(deck)
    blocks = element_blocks(mesh.elements, mesh.coordinates)
    if not any(len(locate(block, np.array([[x, y]]))[0]) for block in blocks):
        raise CasesError(f"at {value} is outside the plate")
    distances = np.hypot(*(mesh.coordinates - (x, y)).T)
    return _field(deck, "impact_node", int(np.where(mesh.used, distances, np.inf).argmin()) + 1)


def _size(deck: model.Deck, name: str, value: Value) -> model.Deck:
    """Scale coordinates, the centre of the patch and the gages."""
    a, b = pair(name, str(value))
    if not min(a, b) > 0.0:
        raise CasesError(f"the sides of the plate must be positive, not {value}")
    mesh = generate(deck)
    width, height = np.ptp(mesh.coordinates[mesh.used], axis=0).tolist()

    def moved(part: Any) -> Any:
        """A node, gage or patch, or all that a segment has."""
        if type(part) in (model.Coordinates, model.Gages):
            return replace(part, records=tuple(map(moved, part.records)), source=None)
        if isinstance(part, NodeValues):
            x, y = part.values[:2]
            return replace(part, values=(x * a / width, y * b / height), source=None)
        if getattr(part, "x", None) is not None:
            return replace(part, x=part.x * a / width, y=part.y * b / height, source=None)
        return part

    return replace(deck, segments=tuple(map(moved, deck.segments)))


def _support(deck: model.Deck, name: str, value: Value) -> model.Deck:
    """Replace all restraints by a support of the outline, as ``fecm new`` writes it."""
    mesh, support = generate(deck), str(value)
    if deck.has(model.Forces) or mesh.elements.shape[1] not in (4, 9) or not mesh.elements.all():
        raise CasesError("support: the deck must have no FORC, and all elements four or nine nodes")
    plate = PlateMesh(mesh.coordinates, mesh.elements.astype(int) - 1, {}, np.array([], int))
    everywhere = (0, 0, 0, 0, 0) if is_coupled(deck.require(model.Material)) else (1, 1, 0, 0, 0)
    made = plate.supported(everywhere, {BOUNDARY: support})
    others = tuple(s for s in deck.segments if not isinstance(s, model.Boundary))
    if made is not None and support == "simple" and mesh.elements.shape[1] == 4:
        codes = restraint_codes([made], deck.control.numnp, deck.control.ndf) != 0
        if (codes[:, 2] & ~codes[:, 3:].any(axis=1)).any():
            raise CasesError("support simple: elements of four nodes need sides along x or y")
    return replace(deck, segments=others if made is None else (*others, made))


def _material(deck: model.Deck, name: str, value: Value) -> model.Deck:
    """Change all plies, or their number."""
    old, control = deck.require(model.Material), deck.control
    ply, layers, integration = old.ply, old.layers, old.integration
    if name in ("layup", "ply_thickness") and len({layer.thickness for layer in layers}) > 1:
        raise CasesError(f"{name}: the plies of the deck differ in thickness")
    if name == "layup":
        try:
            angles = parse_layup(str(value))
        except LayupError as error:
            raise CasesError(f"layup: {error}") from None
        thickness = layers[0].thickness
        layers = tuple(Layer(n, angle, thickness) for n, angle in enumerate(angles, start=1))
        integration = replace(integration, thickness=len(angles) * thickness, source=None)
        control = replace(control, layers=len(layers), source=None)
    elif name == "ply_thickness":
        layers = tuple(replace(y, thickness=float(value), source=None) for y in layers)
        integration = replace(integration, thickness=len(layers) * float(value), source=None)
    elif name in (THICKNESS, "laminate_thickness"):
        factor = float(value) / sum(layer.thickness for layer in layers)
        layers = tuple(replace(y, thickness=y.thickness * factor, source=None) for y in layers)
        integration = replace(integration, thickness=float(value), source=None)
    elif name == "angle":
        layers = tuple(replace(y, angle=y.angle + float(value), source=None) for y in layers)
    else:
        changed: dict[str, Any] = {name: float(value), "source": None}
        ply = replace(ply, **changed)
    new = replace(old, ply=ply, layers=layers, integration=integration)
    return replace(_swap(deck, old, new), control=control)


def _refined(deck: model.Deck, name: str, value: Value) -> model.Deck:
    """Divide the sides of all elements by a power of two."""
    try:
        for _ in range(int(value).bit_length() - 1):
            deck = refined(deck, generate(deck))
    except RefineError as error:
        raise CasesError(f"refine: {error}") from None
    return deck


# In the order in which they are applied.
_SETTERS: dict[str, Callable[[model.Deck, str, Value], model.Deck]] = {
    REFINE: _refined,
    **dict.fromkeys(("layup", "angle", *LAMINATE), _material),
    "size": _size,
    "support": _support,
    **dict.fromkeys(_FIELDS, _field),
    "at": _at,
    "radius": _radius,
    **dict.fromkeys(("rod_length", "rod_modulus", "rod_density", *MASS), _rod),
    "energy": _energy,
}
LONGEST = 1e15  # longest loop; the checks reject much shorter programs
STORING = ("RODP", "DISP", "STRE", "PLYS")  # macros that store every N-th step or pass
# Time step of the deck, and the rule that gives that of a plate from its critical time step.
Clock = tuple[float, Callable[[float], float]]


def clock_of(checked: Problem) -> Clock | None:
    """Rule of a deck, that of DT 0 or of ``fecm new``; None if its DT applies to every case."""
    sizes = {macro.value for macro in flat(checked.program) if macro.word == "DT"}
    if len(sizes) != 1:
        return None
    (dt,) = sizes
    rule = rounded_time_step if dt else taken_time_step
    taken = rule(checked.critical_time_step)
    return (taken, rule) if dt in (0.0, taken) else None


def with_time_step(
    deck: model.Deck, dt: float | None, taken: float = 0.0, duration: float | None = None
) -> model.Deck:
    """Change every DT of a deck, and the loops so that the duration is kept, or is another.

    `taken` is the time step that DT 0 means in the deck; 0 if no DT is 0.  If the new one is None,
    every DT is kept; if it is not positive, only the DT cards change.  Macros that store rows keep
    approximately their number of rows.

    Raises CasesError if whole numbers of passes miss the duration by a step and by 1 %.
    """
    walked = list(_walk(deck.macros, taken))
    before, _ = _duration(deck.macros, taken)
    share = 1.0 if duration is None or not before else duration / before
    ratios: dict[int, float] = {}
    for macro, loop, _, now in walked:
        if macro.word in STEPS and loop is not None and now > 0.0 and (dt is None or dt > 0.0):
            ratios[loop] = share * (1.0 if dt is None else now / dt)

    def changed(place: int, macro: Macro) -> Macro:
        loop = walked[place][1]
        if macro.word == "DT" and dt is not None:
            return replace(macro, value=dt, source=None)
        if macro.word == "LOOP" and place in ratios:
            count = min(max(1.0, macro.value) * ratios[place], LONGEST)
            return replace(macro, value=float(max(1, math.ceil(count - 1e-9))), source=None)
        if macro.word in STORING and loop in ratios:
            count = min(every(macro) * ratios[loop], LONGEST)
            return replace(macro, value=float(max(1, round(count))), source=None)
        return macro

    macros = tuple(changed(place, macro) for place, macro in enumerate(deck.macros))
    wanted, (made, step) = share * before, _duration(macros, taken)
    if ratios and abs(made - wanted) > max(0.01 * wanted, step):
        text = f"the loops of the deck give the duration {made:.6g} instead of {wanted:.6g}"
        raise CasesError(f"{text}; take all steps in one loop")
    return replace(deck, macros=macros)


def lengthened(checked: Problem, factor: float) -> Problem:
    """Return a problem that runs `factor` times as long, with the same time step."""
    deck, taken = checked.deck, taken_time_step(checked.critical_time_step)
    duration, _ = _duration(deck.macros, taken)
    macros = with_time_step(deck, None, taken, factor * duration).macros
    return replace(checked, program=compile_program(macros, Findings()))


def _duration(macros: Sequence[Macro], taken: float) -> tuple[float, float]:
    """Time of all steps of a program, and its largest time step."""
    steps = [(passes, now) for macro, _, passes, now in _walk(macros, taken) if macro.word in STEPS]
    return sum(passes * now for passes, now in steps), max((now for _, now in steps), default=0.0)


def _walk(cards: Sequence[Macro], taken: float) -> Iterator[tuple[Macro, int | None, float, float]]:
    """Each macro, the place of the innermost LOOP around it, its passes and the time step."""
    loops: list[tuple[int, float]] = []  # place and passes of the open ones
    now = 0.0
    for place, macro in enumerate(cards):
        if macro.word == "NEXT" and loops:
            loops.pop()
        elif macro.word == "DT":
            now = macro.value or taken
        loop, passes = loops[-1] if loops else (None, 1.0)
        yield macro, loop, passes, now
        if macro.word == "LOOP":
            loops.append((place, passes * max(1.0, macro.value)))
