"""New decks from plate, laminate, projectile and contact: :func:`impact` and :func:`plate_deck`.

:mod:`fecm.authoring.deck_options` declares their values.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from fecm._errors import warn
from fecm._options import with_parameters_of
from fecm.authoring.contact import (
    Sphere,
    doubts_of_core,
    doubts_of_soft_tip,
    doubts_of_sphere,
    indentation_law,
    is_sandwich,
)
from fecm.authoring.deck_options import (
    AnyProjectile,
    DeckOptions,
    ImpactOptions,
    PlateDeckOptions,
)
from fecm.authoring.energy import (
    doubts_of_energy,
    energy_note,
    energy_of,
    format_energy,
    with_energy,
)
from fecm.authoring.laminate import (
    DeckPlies,
    Laminate,
    check_thickness,
    cure_segment,
    damage_segments,
    deck_plies,
    strengths_of,
    system_asked,
    toughness_segment,
)
from fecm.authoring.masses import masses_segment
from fecm.authoring.mesh import (
    AnyMesh,
    MembraneSupport,
    Placed,
    curvature_of,
    place_impact,
    support_plate,
    tips_on,
)
from fecm.authoring.numerics import (
    SupportedDeck,
    band_comment,
    chosen_time_step,
    contact_patch,
    shear_segment,
    with_impact_program,
    with_kinematics,
)
from fecm.authoring.parameters import (
    ObjectError,
    check_positive,
    is_finite,
    lengths_in_units,
    parameter_in_units,
    projectile_in_units,
)
from fecm.authoring.plate import DropWeight, Plate
from fecm.authoring.zones import ElementLaminates, laminates_of, placed_zones
from fecm.deck import model
from fecm.deck.catalogue import STANDARD, SYSTEM
from fecm.deck.findings import DeckError
from fecm.deck.material_cards import MATERIAL, Layer
from fecm.deck.model import Control, Gage
from fecm.deck.reader import with_cards
from fecm.deck.units import MODULUS, TOUGHNESS, quantity, unit_of, units_of
from fecm.mechanics.points import RADIUS_PER_THICKNESS
from fecm.mechanics.projectile import RigidMass
from fecm.problem.loading import load_deck
from fecm.problem.parts import projectile_segment

LONGEST_LAYUP = 60  # characters; a title has the number of plies instead of a longer layup


def title_of(plate: Plate, laminate: Laminate, plies: DeckPlies) -> str:
    """Return a title such as ``D7136 [45/0/-45/90]3s IM7/8552``."""
    names = dict.fromkeys(named.name for _, named in plies.named)
    words = (_plate_name(plate, plies.system), _layup_name(laminate), " + ".join(names))
    return " ".join(filter(None, words))


def _plate_name(plate: Plate, system: str | None) -> str:
    if plate.fixture is not None:
        return plate.fixture.name
    if (sides := plate.sides(system)) is None:
        return "plate"
    x, y = sides
    return f"plate {x:g}x{y:g}"


def _layup_name(laminate: Laminate) -> str:
    """Return the layup as the literature writes it, ``[45/0/-45/90]3s``."""
    plies = [f"{ply.angle:g}{ply.name if len(ply.name) == 1 else ''}" for ply in laminate.plies]
    count, symmetric = len(plies), ""
    if count % 2 == 0 and plies == plies[::-1]:
        count, symmetric = count // 2, "s"
    unit = next(n for n in range(1, count + 1) if plies[:count] == plies[:n] * (count // n))
    repeated = f"{count // unit}" if count > unit else ""
    layup = f"[{'/'.join(plies[:unit])}]{repeated}{symmetric}"
    return layup if len(layup) <= LONGEST_LAYUP else f"{len(plies)} plies"


def _note_of_laminate(laminate: Laminate, plies: DeckPlies) -> str:
    """Return a note with the layup, the number of plies and the thickness of a plate."""
    names = units_of(plies.system) if plies.system else {}
    thickness = quantity(plies.thickness, unit_of("length", names))
    count = len(plies.layups[0])
    return f"the laminate {_layup_name(laminate)} has {count} plies and is {thickness} thick"


def _notes_of_preload(deck: model.Deck, plies: DeckPlies) -> list[str]:
    """Return a note with the mean stresses under a preload."""
    if (card := deck.last(model.Preload)) is None:
        return []
    names = units_of(plies.system) if plies.system else {}
    forces = ", ".join(quantity(n, unit_of("force/length", names)) for n in card.forces if n)
    stresses = ", ".join(
        quantity(n / plies.thickness, unit_of(MODULUS, names)) for n in card.forces if n
    )
    return [f"the preload {forces} is a mean stress of {stresses}"] if forces else []


MOST_STEPS = 1e6  # largest plausible number of steps; beyond it, `duration` may have a wrong unit


class Motion(NamedTuple):
    """Velocity, energy, duration and time step as numbers, in the units of the deck."""

    velocity: float | None
    energy: float | None
    duration: float | None
    dt: float | None


class Authored(NamedTuple):
    """New deck that is not checked yet."""

    deck: model.Deck
    comments: str  # comment lines for the head of the deck
    notes: list[str]  # values that were filled in
    doubts: list[str]  # values that may be mistakes, or differ from the request


@with_parameters_of(ImpactOptions)
def impact(options: ImpactOptions) -> model.Deck:
    """Return the deck of an impact, as `fecm new` writes it.

    A flat, linear plate with an uncoupled laminate has all in-plane dofs restrained, as in the
    report. In any other plate only the supports restrain in-plane dofs; `in_plane` chooses which.

    Parameters
    ----------
    {parameters}

    Returns
    -------
    Deck
        Deck without errors.

    Raises
    ------
    ValueError
        If an argument is missing or implausible.
    DeckError
        If the deck has errors.

    Examples
    --------
    >>> import fecm
    >>> deck = fecm.impact(
    ...     fecm.Plate.rectangle((100, 80), (10, 8), support="simple"),
    ...     fecm.Laminate("[0/90]2s", "T300/5208", 0.25),
    ...     fecm.RigidMass(1e-3),
    ...     fecm.Contact.estimate(radius=8),
    ...     energy=500, duration=5e-4, units="mm-N-s",
    ... )
    >>> deck.control.numel
    80
    """
    authored = author(options)
    return _checked(authored.deck, authored.doubts)


@with_parameters_of(PlateDeckOptions)
def plate_deck(options: PlateDeckOptions) -> model.Deck:
    r"""Return the deck of a plate that no projectile hits, for statics and natural modes.

    The plate is linear unless `kinematics` says otherwise. A flat, linear plate with an uncoupled
    laminate has all in-plane dofs restrained, so that its modes are those of bending.

    Parameters
    ----------
    {parameters}

    Returns
    -------
    Deck
        Deck without errors.

    Raises
    ------
    ValueError
        If an argument is missing or implausible.
    DeckError
        If the deck has errors.

    Examples
    --------
    >>> import fecm
    >>> plate = fecm.Plate.rectangle((100, 80), (10, 8), support="simple")
    >>> laminate = fecm.Laminate("[0/90]2s", "T300/5208", 0.25)
    >>> deck = fecm.plate_deck(plate, laminate, "TANG\nFORM\nSOLV\nDISP", force=10, units="mm-N-s")
    >>> round(float(fecm.run_one(deck).tape3.w.max()), 4)
    0.0259
    """
    options.check()
    doubts: list[str] = []
    zones = tuple(options.zones)
    laminates = laminates_of(options.laminate, zones)
    system = STANDARD if options.test else system_asked(options.units)
    plies, in_zones = deck_plies(options.laminate, laminates, system, [])
    force = parameter_in_units("force", options.force, "force", plies.system)
    if force is not None and not is_finite(force):
        raise ObjectError(f"`force` is {options.force!r}; it must be a finite number")
    patch = None if force is None else contact_patch(options, plies.system)
    doubts_of_place = [] if force is None else doubts
    placed = place_impact(options.plate, plies, options.at, patch, doubts_of_place, "force")
    load = None if force is None else _static_load(placed, force)
    laminates_of_elements = placed_zones(
        zones, in_zones, placed.mesh, placed.node, doubts, plies.system
    )
    strengths = [strengths_of(plies)] if options.failure else []
    plain = assemble(options, plies, placed.mesh, laminates_of_elements, doubts, [load], strengths)
    title = options.title
    if title is None:
        title = title_of(options.plate, options.laminate, plies)
    plain = replace(plain, title=title)
    structure = with_kinematics(
        options.kinematics,
        lambda nonlinear: with_supports(options, plain, placed.mesh, plies, nonlinear=nonlinear),
    )
    return _checked(with_cards(structure.deck, options.program), doubts)


def _static_load(placed: Placed, force: float) -> model.Segment:
    """Return the segment of a static force on a patch or a node."""
    if placed.patch is None:
        values = (0.0, 0.0, force, 0.0, 0.0)
        return model.Forces((model.NodeValues(placed.node, 0, values),))
    return replace(placed.patch.centred(placed.point), load=force)


def _checked(deck: model.Deck, doubts: Sequence[str]) -> model.Deck:
    """Warn of the doubts about a new deck, and return it; raise DeckError if it has errors."""
    for doubt in doubts:
        warn(doubt)
    loaded = load_deck(deck)
    if errors := loaded.errors():
        raise DeckError(errors, "<deck>")
    return replace(loaded.problems[0].deck, text="")


def author(options: ImpactOptions) -> Authored:
    """Build the deck of an impact, but do not check it."""
    options.check()
    kinematics, units = options.chosen_kinematics(), system_asked(options.units)
    notes: list[str] = []
    doubts: list[str] = []
    fixture, test = options.plate.fixture, options.test
    if test is not None and units not in (None, STANDARD):
        raise ObjectError(f"the fixture's standard is in {STANDARD}; leave out `units`")
    zones = tuple(options.zones)
    laminates = laminates_of(options.laminate, zones)
    plies, in_zones = deck_plies(options.laminate, laminates, STANDARD if test else units, notes)
    motion = _parse_motion(options, plies)
    giic = parameter_in_units("giic", options.giic, TOUGHNESS, plies.system)
    check_positive(giic=giic)
    if fixture is not None and test is not None:
        options, motion = _apply_standard(test, options, motion, plies.thickness)
        if not test.allows(plies.thickness):
            doubts.append(_doubt_of_thickness(fixture.name, test, plies.thickness))
    if plies.is_coupled:
        notes.append(
            f"the laminate is not symmetric, B is not zero: {plies.description} (an s after the "
            "bracket of a layup adds the mirrored plies)"
        )
    if fixture is None and set(options.plate.supports.values()) <= {"free"}:
        notes.append(
            "nothing supports the plate (`support` is free): it flies away with the projectile"
        )
    patch = contact_patch(options, plies.system)
    _check_complete(options, motion, plies.system)
    if motion.duration is None:  # with far too thin plies, the estimate of the duration takes long
        check_thickness(plies)

    mesh, node, patch, _ = place_impact(options.plate, plies, options.at, patch, doubts)
    placed = placed_zones(zones, in_zones, mesh, node, doubts, plies.system)
    struck = plies.layups[placed.struck - MATERIAL]
    law, comment = indentation_law(options.contact, plies, struck)
    if comment:
        notes.append(
            f"k = {law.k:g} is estimated from the ply's constants (fecm indent estimate) for an "
            "elastic law; prefer a measured law"
        )
        doubts += doubts_of_core(plies, struck)
    if isinstance(options.contact, Sphere):
        doubts += doubts_of_sphere(options.contact, plies.system, test)
    damage = _segments_of_failure(options, plies, struck, giic, notes)
    hit = model.Impact(node, 3, 1.0 if motion.velocity is None else motion.velocity)
    load = (_projectile_segment(options.projectile, plies.system), hit, patch)
    plain = assemble(options, plies, mesh, placed, doubts, load, damage, law)
    if motion.energy is not None:
        plain = with_energy(plain, motion.energy)
    notes += [
        _note_of_laminate(options.laminate, plies),
        *_notes_of_preload(plain, plies),
    ]
    notes.append(energy_note(plain, plies, per_thickness=options.test is not None))
    is_bare = options.energy is not None and not str(options.energy).strip()[-1:].isalpha()
    doubts += doubts_of_energy(plain, fixture, plies, is_bare=is_bare)
    doubts += _doubts_of_tip(options, plain, plies, struck, law.k)
    title = options.title
    if title is None:
        named = title_of(options.plate, options.laminate, plies)
        title = f"{named}, {format_energy(plain, plies)}"
    plain = replace(plain, title=title)

    structure = with_kinematics(
        kinematics,
        lambda nonlinear: with_supports(options, plain, mesh, plies, nonlinear=nonlinear),
    )
    dt = motion.dt or chosen_time_step(options, structure.deck)
    doubts += _doubts_of_duration(motion.duration, dt, plies.system)
    deck = with_impact_program(options, structure, dt, motion.duration)
    comments = structure.comment + comment
    if fixture is not None:
        comments = fixture.comment + band_comment(structure, tips_on(mesh, fixture)) + comments
    return Authored(deck, comments, [*notes, *structure.notes], doubts)


def _segments_of_failure(
    options: ImpactOptions,
    plies: DeckPlies,
    struck: Sequence[Layer],
    giic: float | None,
    notes: list[str],
) -> list[model.Segment]:
    """Return strengths and toughness; a sandwich has no delamination threshold."""
    segments = damage_segments(plies, giic, notes) if options.damage else toughness_segment(giic)
    if is_sandwich(plies, struck) and any(isinstance(s, model.Delamination) for s in segments):
        segments = [s for s in segments if not isinstance(s, model.Delamination)]
        notes.append(
            "the deck has no delamination threshold (DELA): it holds for a solid laminate, and "
            "the faces of a sandwich delaminate or leave the core far below it"
        )
    if options.failure and not any(isinstance(s, model.Allowables) for s in segments):
        segments = [strengths_of(plies), *segments]
    return segments


def _doubts_of_tip(
    options: ImpactOptions, plain: model.Deck, plies: DeckPlies, struck: Sequence[Layer], k: float
) -> list[str]:
    """Return a doubt about the patch of a soft sphere, whose contact circle is larger."""
    patch = plain.last(model.Patch)
    if not isinstance(options.contact, Sphere) or patch is None:
        return []
    radius = patch.radius or RADIUS_PER_THICKNESS[patch.shape] * plies.thickness
    softest = min(plies.of(layer).ply.e2 for layer in struck)
    return doubts_of_soft_tip(options.contact, plies.system, radius, k, energy_of(plain), softest)


def assemble(
    options: DeckOptions,
    plies: DeckPlies,
    mesh: AnyMesh,
    zones: ElementLaminates,
    doubts: list[str],
    load: Iterable[model.Segment | None],
    damage: Iterable[model.Segment],
    law: model.Indentation | None = None,
) -> model.Deck:
    """Return a deck with the segments in their usual order, without title, supports and program.

    `load` has the segments of the impact or of the static load. `doubts` gets a text about each
    point mass that is moved to a node.
    """
    segments = (
        _unit_segment(options, plies),
        mesh.coordinates(),
        mesh.element_cards(),
        *load,
        masses_segment(options.masses, mesh, doubts, plies.system),
        _gage_segment(options.gages, plies.system),
        *damage,
        cure_segment(plies, options.cure),
        law,
        shear_segment(options),
        curvature_of(
            parameter_in_units("radius_x", options.radius_x, "length", plies.system),
            parameter_in_units("radius_y", options.radius_y, "length", plies.system),
        ),
        _preload_segment(options, plies),
        *plies.segments(),
        zones.card,
    )
    control = Control(mesh.nodes, mesh.elements, len(plies.layups[0]), 2, 5, mesh.most_nodes)
    return model.Deck("", control, tuple(s for s in segments if s is not None), ())


def with_supports(
    options: DeckOptions, plain: model.Deck, mesh: AnyMesh, plies: DeckPlies, *, nonlinear: bool
) -> SupportedDeck:
    """Add the supports to a deck, and NONL for a nonlinear plate."""
    notes: list[str] = []
    membrane = MembraneSupport.of(
        curved=plain.has(model.Curvature), stretches=nonlinear or plies.is_coupled
    )
    supports, comment = support_plate(
        options.plate, mesh, options.in_plane, notes, membrane, plies.system
    )
    segments: list[model.Segment] = []
    for segment in plain.segments:
        segments.append(segment)
        if isinstance(segment, model.Elements):
            segments += supports
    if nonlinear:  # before the preload and the laminate
        later = (model.Preload, model.Material)
        place = next(n for n, part in enumerate(segments) if isinstance(part, later))
        segments.insert(place, model.Nonlinear())
    return SupportedDeck(replace(plain, segments=tuple(segments)), comment, notes)


def _doubts_of_duration(duration: float | None, dt: float, system: str | None) -> list[str]:
    """Return a doubt about a duration with very many steps."""
    if duration is None or duration / dt <= MOST_STEPS:
        return []
    unit = units_of(system)["time"] if system else ""
    return [
        f"the duration {duration:g} {unit}".rstrip()
        + f" takes {duration / dt:.2g} steps: `duration` is in the deck's unit of time unless it "
        'has a unit, as in "4ms"'
    ]


def _parse_motion(options: ImpactOptions, plies: DeckPlies) -> Motion:
    """Return velocity, energy and duration in the units of the deck."""
    system = plies.system
    motion = Motion(
        parameter_in_units("velocity", options.velocity, "length/time", system),
        parameter_in_units("energy", options.energy, "force*length", system),
        parameter_in_units("duration", options.duration, "time", system),
        parameter_in_units("dt", options.dt, "time", system),
    )
    check_positive(
        energy=motion.energy,
        duration=motion.duration,
        dt=motion.dt,
        every=options.every,
    )
    return motion


def _apply_standard(
    test: DropWeight, options: ImpactOptions, motion: Motion, thickness: float
) -> tuple[ImpactOptions, Motion]:
    """Fill missing arguments with the values that a standard prescribes."""
    if motion.velocity is None and motion.energy is None:
        motion = motion._replace(energy=test.energy * thickness)
    contact = options.contact
    if contact in (None, Sphere()):
        contact = Sphere(test.radius)
    projectile = options.projectile or RigidMass(test.mass)
    return replace(options, projectile=projectile, contact=contact), motion


def _doubt_of_thickness(name: str, test: DropWeight, thickness: float) -> str:
    """Return a doubt about a laminate with a thickness outside the range of a standard."""
    limits = f"{test.thinnest:g} to {test.thickest:g} mm"
    return f"{name} is for laminates of {limits}; this one has {thickness:.4g} mm"


def _check_complete(options: ImpactOptions, motion: Motion, system: str | None) -> None:
    """Raise ObjectError if projectile or velocity is missing."""
    if options.projectile is None and system not in (None, SYSTEM):
        raise ObjectError(
            "give `projectile`, a rigid mass or a rod: without it the projectile is the report's "
            f"steel rod, whose numbers are in {SYSTEM}"
        )
    if (motion.velocity is None) == (motion.energy is None):
        raise ObjectError("give either `velocity` or `energy`")


def _unit_segment(options: DeckOptions, plies: DeckPlies) -> model.Units | None:
    """Return the UNIT segment; None for a deck like the report's, without named units."""
    if plies.system is None or (plies.system == SYSTEM and options.units is None):
        return None
    return model.Units(*units_of(plies.system).values())


def _projectile_segment(
    projectile: AnyProjectile | None, system: str | None
) -> model.Projectile | None:
    """Return the PROJ segment of a projectile; None for the rod of the report."""
    if projectile is None or isinstance(projectile, model.Projectile):
        return projectile
    return projectile_segment(projectile_in_units(projectile, system))


def _preload_segment(options: DeckOptions, plies: DeckPlies) -> model.Preload | None:
    """Return the PREL segment of a membrane force, if there is one."""
    if options.preload is None:
        return None
    values = list(options.preload) if isinstance(options.preload, Iterable) else []
    forces = [
        parameter_in_units("preload", value, "force/length", plies.system) for value in values
    ]
    numbers = [force for force in forces if is_finite(force)]
    if len(numbers) < len(values) or len(values) not in (2, 3):
        raise ObjectError(f"`preload` is {options.preload!r}, not N0x, N0y and perhaps N0xy")
    return model.Preload(*map(float, numbers))


def _gage_segment(
    places: Iterable[tuple[float | str, float | str, float | str, float]], system: str | None
) -> model.Gages | None:
    """Return the GAGE segment of strain gages, if there are any."""
    gages: list[Gage] = []
    try:
        for number, (x, y, z, degrees) in enumerate(places, start=1):
            at_x, at_y, depth = lengths_in_units("gages", (x, y, z), 3, system)
            gages.append(Gage(number, at_x, at_y, depth, float(degrees)))
    except ObjectError:
        raise
    except (TypeError, ValueError):
        raise ObjectError("`gages` are not x, y, z and degrees of each") from None
    return model.Gages(tuple(gages)) if gages else None
