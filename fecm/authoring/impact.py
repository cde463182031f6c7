"""Deck of an impact, built from plate, laminate, projectile and contact."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

from fecm._errors import warn
from fecm.authoring.contact import (
    AnyContact,
    Sphere,
    doubts_of_soft_tip,
    doubts_of_sphere,
    indentation_law,
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
    Layup,
    check_thickness,
    cure_segment,
    damage_segments,
    deck_plies,
    strengths_of,
    system_asked,
    toughness_segment,
)
from fecm.authoring.mesh import (
    AnyMesh,
    InPlane,
    MembraneSupport,
    curvature_of,
    place_impact,
    support_plate,
)
from fecm.authoring.numerics import (
    AUTO,
    AUTO_KINEMATICS,
    FULL,
    MITC,
    Kinematics,
    Numerics,
    Quadrature,
    SupportedDeck,
    kinematics_of,
    with_kinematics,
)
from fecm.authoring.parameters import ObjectError, check_kind, check_positive, in_units, is_finite
from fecm.authoring.plate import DropWeight, Plate
from fecm.authoring.zones import ElementLaminates, Zone, laminates_of, placed_zones
from fecm.deck import model
from fecm.deck.catalogue import STANDARD, SYSTEM, NamedContact
from fecm.deck.findings import DeckError
from fecm.deck.grid import IN_PLANE
from fecm.deck.material_cards import MATERIAL
from fecm.deck.model import Control, Gage
from fecm.deck.units import MODULUS, TOUGHNESS, quantity, unit_of, units_of
from fecm.mechanics.laminate import are_cores
from fecm.mechanics.points import RADIUS_PER_THICKNESS
from fecm.mechanics.projectile import DeckProjectile, RigidMass
from fecm.problem.loading import load_deck
from fecm.problem.parts import projectile_segment

LONGEST_LAYUP = 60  # characters; a title has the number of plies instead of a longer layup


def title_of(plate: Plate, laminate: Laminate, plies: DeckPlies) -> str:
    """Return a title such as ``D7136 [45/0/-45/90]3s IM7/8552``."""
    names = dict.fromkeys(named.name for _, named in plies.named)
    words = (_plate_name(plate), _layup_name(laminate), " + ".join(names))
    return " ".join(filter(None, words))


def _plate_name(plate: Plate) -> str:
    if plate.fixture is not None:
        return plate.fixture.name
    if plate.size is None:
        return "plate"
    x, y = plate.size
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
AnyProjectile = DeckProjectile | model.Projectile
GagePlace = tuple[float, float, float, float]  # x, y, z and degrees


@dataclass(frozen=True)
class ImpactParameters:
    """Projectile, contact law, velocity or energy, and impact point."""

    projectile: AnyProjectile | None = None
    contact: AnyContact | None = None
    velocity: float | str | None = None
    energy: float | str | None = None
    at: tuple[float, float] | None = None


class Request(NamedTuple):
    """Arguments of :func:`impact`, and options of ``fecm new``."""

    plate: Plate
    laminate: Laminate
    strike: ImpactParameters
    numerics: Numerics
    units: str | None = None
    in_plane: InPlane | None = None
    radius_x: float | str | None = None
    radius_y: float | str | None = None
    kinematics: Kinematics = AUTO_KINEMATICS
    preload: Sequence[float | str] | None = None
    gages: Iterable[GagePlace] = ()
    giic: float | str | None = None
    cure: float | str | None = None
    title: str | None = None  # None for the default title
    zones: Sequence[Zone] = ()

    @property
    def test(self) -> DropWeight | None:
        """Values that the standard of the fixture prescribes; None without a standard."""
        return self.plate.fixture.test if self.plate.fixture else None

    def check(self) -> None:
        """Raise ObjectError if an argument is not an object of fecm, or a text is invalid."""
        strike, numerics = self.strike, self.numerics
        check_kind("plate", self.plate, Plate)
        check_kind("laminate", self.laminate, Laminate)
        if numerics.patch is not None:
            check_kind("patch", numerics.patch, str | model.Patch)
        if strike.projectile is not None:
            check_kind("projectile", strike.projectile, AnyProjectile)
        if strike.contact is not None:
            check_kind("contact", strike.contact, AnyContact)
        _check_choice("shear", numerics.shear, (MITC, FULL))
        _check_choice("in_plane", self.in_plane, (None, *IN_PLANE))
        _check_choice("kinematics", self.kinematics, get_args(Kinematics))
        if "\n" in (self.title or ""):
            raise ObjectError("`title` has more than one line")


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


def impact(
    plate: Plate,
    laminate: Laminate,
    projectile: AnyProjectile | None = None,
    contact: model.Indentation | NamedContact | Sphere | str | None = None,
    *,
    velocity: float | str | None = None,
    energy: float | str | None = None,
    at: tuple[float, float] | None = None,
    duration: float | str | None = None,
    dt: float | str | None = None,
    every: int | None = None,
    plies: int | bool | tuple[int, int] | None = None,
    failure: int | bool | None = None,
    units: str | None = None,
    patch: str | model.Patch | None = AUTO,
    shear: Quadrature = "mitc",
    shear_factor: float | Literal["equi"] | None = None,
    in_plane: InPlane | None = None,
    radius_x: float | str | None = None,
    radius_y: float | str | None = None,
    kinematics: Kinematics | None = None,
    nonlinear: bool | None = None,
    preload: Sequence[float | str] | None = None,
    gages: Iterable[tuple[float, float, float, float]] = (),
    damage: bool = False,
    giic: float | str | None = None,
    cure: float | str | None = None,
    title: str | None = None,
    zones: Sequence[tuple[str | Sequence[float], Layup | Laminate]] = (),
) -> model.Deck:
    """Return the deck of an impact, as `fecm new` writes it.

    A flat, linear plate with an uncoupled laminate has all in-plane dofs restrained, as in the
    report. In any other plate only the supports restrain in-plane dofs; `in_plane` chooses which.

    Parameters
    ----------
    plate : Plate
        Mesh and supports.
    laminate : Laminate
        Layup and ply.
    projectile : Rod or RigidMass, optional
        Projectile in the units of the deck; by default the mass that the standard of a fixture
        prescribes, or the rod of the report.
    contact : Contact or str
        Indentation law, or the name of a published law.
    velocity, energy : float or str
        Approach velocity (length/time) or energy (force*length) of the projectile. A number is in
        the units of the deck (mJ in mm-N-s). A text may have a unit: ``"3m/s"``, ``"10J"``.
    at : tuple of float, optional
        Impact point; the middle of the plate by default. The projectile hits the nearest node. On
        an imported mesh the patch is centred at the point itself.
    duration : float or str
        Simulated time; a text may have a unit, ``"4ms"``. By default the steps end once the impact
        is over (``OVER``), after at most 4 times the expected time: 1.25 half periods of the
        projectile on the plate, or 1.1 times the duration of the contact with the indentation if
        that is longer.
    dt : float or str, optional
        Time step, also with a unit, ``"0.5us"``; 0.9 of the critical time step by default.
    every : int, optional
        Steps between stored rows; about 200 rows by default.
    plies : int or bool or tuple of int, optional
        Store stresses and strains ply by ply for :attr:`Result.plies`. An integer is the number of
        steps between rows; True stores about 20 rows. A pair has the steps and the number of
        elements nearest to the load. Rows are large, so there are none by default. With `damage`
        and strengths the default is about 20 rows of the elements around the load.
    failure : int or bool, optional
        Evaluate the failure criteria. They need a named ply with strengths. An integer is the
        number of steps between evaluations; True evaluates them at the rows of `every`. The default
        is True if `damage` finds strengths.
    units : str, optional
        Units of length, force and time, as in ``"mm-N-s"``, or of length, time and mass, as in
        ``"mm-ms-kg"``. Named plies and contacts are converted to them. The default is the system of
        the source of a named ply.
    patch : str or Patch or None
        Area of the contact force: ``"disc"`` or ``"hertz"``; a disc by default. None is a point
        force. The radius may follow, ``"disc:RADIUS"``; the mesh of a rectangle is then refined to
        it.
    shear : str
        Transverse shear: assumed strains, ``"mitc"``, or full quadrature, ``"full"``.
    shear_factor : float or str, optional
        Factor of the transverse shear stiffness, or ``"equi"`` for the stiffness from equilibrium.
        The default is ``"equi"``, and 1 with full quadrature.
    in_plane : str, optional
        Restraint of u and v on the supports of a curved or nonlinear plate, or of a coupled
        laminate: ``"held"``, ``"free"``, ``"normal"`` (held across the edge only) or
        ``"tangential"`` (held along the edge only). The default is ``"free"`` on fixtures,
        ``"tangential"`` on the simple edges of a curved panel, and ``"held"`` elsewhere. Pinned
        edges always hold both.
    radius_x, radius_y : float or str, optional
        Radii of a shallow curved panel (length); a text may have a unit, ``"1m"``. They are
        positive if the struck face is hollow. Without them the plate is flat.
    kinematics : str, optional
        ``"von-karman"`` for a plate that stretches as it bends; `shear` must be ``"mitc"``.
        ``"linear"`` for a plate that does not. ``"auto"``, the default, chooses von Kármán if the
        static estimate of the deflection exceeds 0.3 times the thickness.
    nonlinear : bool, optional
        Older name: True means `kinematics` ``"von-karman"``, and False ``"linear"``.
    preload : sequence of float or str, optional
        Uniform membrane force N0x, N0y and N0xy in the plate before the impact (force/length,
        tension positive). N0xy is 0 by default. A text may have a unit, ``"50N/mm"``.
    gages : iterable of tuple
        Strain gages: x, y and z (length, z from the mid-plane) and direction (degrees) of each.
    damage : bool
        Add the known strengths and toughness of a named ply, and store the data for the pictures of
        failure and of stresses through the thickness.
    giic : float or str, optional
        Toughness G_IIc for the delamination threshold, force/length; a text may have a unit,
        ``"800J/m^2"``. With `damage` the default is the toughness of a named ply.
    cure : float or str, optional
        Residual stresses of the cure; they need a named ply with coefficients of expansion. The
        value is the temperature of use minus the stress-free temperature, K, or both temperatures,
        ``"177:20"``. ``":20"`` takes the stress-free temperature of the ply.
    title : str, optional
        Title of the deck; by default plate, layup, ply and energy.
    zones : sequence of tuple, optional
        Place and layup of parts of the plate. Later zones cover earlier ones. A place is a
        rectangle ``(x0, y0, x1, y1)`` or the name of a group of elements of an imported mesh. A
        rectangle includes the elements with their centres in it. A layup takes the materials and
        the ply thickness of `laminate`; a `Laminate` brings its own. All laminates share the
        mid-plane.

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
    authored = author(
        Request(
            plate,
            laminate,
            ImpactParameters(projectile, contact, velocity, energy, at),
            Numerics(patch, shear, shear_factor, duration, dt, every, plies, failure, damage),
            units=units,
            in_plane=in_plane,
            radius_x=radius_x,
            radius_y=radius_y,
            kinematics=kinematics_of(kinematics, nonlinear),
            preload=preload,
            gages=gages,
            giic=giic,
            cure=cure,
            title=title,
            zones=tuple(zones),
        )
    )
    for doubt in authored.doubts:
        warn(doubt)
    loaded = load_deck(authored.deck)
    if errors := loaded.errors():
        raise DeckError(errors, "<deck>")
    return replace(loaded.problems[0].deck, text="")


def author(request: Request) -> Authored:
    """Build the deck of a request, but do not check it."""
    request.check()
    units = system_asked(request.units)
    notes: list[str] = []
    doubts: list[str] = []
    fixture, test = request.plate.fixture, request.test
    if test is not None and units not in (None, STANDARD):
        raise ObjectError(f"the fixture's standard is in {STANDARD}; leave out `units`")
    laminates = laminates_of(request.laminate, request.zones)
    plies, in_zones = deck_plies(request.laminate, laminates, STANDARD if test else units, notes)
    strike, motion = request.strike, _parse_motion(request, plies)
    giic = in_units("giic", request.giic, TOUGHNESS, plies.system)
    check_positive(giic=giic)
    if fixture is not None and test is not None:
        strike, motion = _apply_standard(test, strike, motion, plies.thickness)
        if not test.allows(plies.thickness):
            doubts.append(_doubt_of_thickness(fixture.name, test, plies.thickness))
    if plies.is_coupled:
        notes.append(
            f"the laminate is not symmetric, B is not zero: {plies.description} (an s after the "
            "bracket of a layup adds the mirrored plies)"
        )
    if fixture is None and set(request.plate.supports.values()) <= {"free"}:
        notes.append(
            "nothing supports the plate (`support` is free): it flies away with the projectile"
        )
    patch = request.numerics.contact_patch(prescribed=test is not None)
    _check_complete(request, strike, motion, plies.system)
    if motion.duration is None:  # with far too thin plies, the estimate of the duration takes long
        check_thickness(plies)

    mesh, node, patch, _ = place_impact(request.plate, plies, strike.at, patch, doubts)
    zones = placed_zones(request.zones, in_zones, mesh, node, doubts)
    struck = plies.layups[zones.struck - MATERIAL]
    law, comment = indentation_law(strike.contact, plies, struck)
    if comment:
        notes.append(
            f"k = {law.k:g} is estimated from the ply's constants (fecm indent estimate) for an "
            "elastic law; prefer a measured law"
        )
        doubts += doubts_of_core(plies, struck)
    if isinstance(strike.contact, Sphere):
        doubts += doubts_of_sphere(strike.contact, plies.system, test)
    if request.numerics.damage:
        damage = damage_segments(plies, giic, notes)
    else:
        damage = toughness_segment(giic)
    if is_sandwich(plies, struck) and any(isinstance(s, model.Delamination) for s in damage):
        damage = [s for s in damage if not isinstance(s, model.Delamination)]
        notes.append(
            "the deck has no delamination threshold (DELA): it holds for a solid laminate, and "
            "the faces of a sandwich delaminate or leave the core far below it"
        )
    if request.numerics.failure and not any(isinstance(s, model.Allowables) for s in damage):
        damage = [strengths_of(plies), *damage]
    hit = model.Impact(node, 3, 1.0 if motion.velocity is None else motion.velocity)
    load = (_projectile_segment(strike.projectile), hit, patch)
    plain = assemble(request, plies, mesh, zones, load, damage, law)
    if motion.energy is not None:
        plain = with_energy(plain, motion.energy)
    notes += [
        _note_of_laminate(request.laminate, plies),
        *_notes_of_preload(plain, plies),
    ]
    notes.append(energy_note(plain, plies, per_thickness=request.test is not None))
    is_bare = strike.energy is not None and not str(strike.energy).strip()[-1:].isalpha()
    doubts += doubts_of_energy(plain, fixture, plies, is_bare=is_bare)
    if isinstance(strike.contact, Sphere) and patch is not None:
        radius = patch.radius or RADIUS_PER_THICKNESS[patch.shape] * plies.thickness
        softest = min(plies.of(layer).ply.e2 for layer in struck)
        doubts += doubts_of_soft_tip(strike.contact, radius, law.k, energy_of(plain), softest)
    title = request.title
    if title is None:
        named = title_of(request.plate, request.laminate, plies)
        title = f"{named}, {format_energy(plain, plies)}"
    plain = replace(plain, title=title)

    structure = with_kinematics(
        request.kinematics,
        lambda nonlinear: with_supports(request, plain, mesh, plies, nonlinear=nonlinear),
    )
    dt = motion.dt or request.numerics.time_step(structure.deck)
    doubts += _doubts_of_duration(motion.duration, dt, plies.system)
    deck = request.numerics.with_program(structure.deck, dt, motion.duration)
    comments = (fixture.comment if fixture else "") + structure.comment + comment
    return Authored(deck, comments, [*notes, *structure.notes], doubts)


def assemble(
    request: Request,
    plies: DeckPlies,
    mesh: AnyMesh,
    zones: ElementLaminates,
    load: Iterable[model.Segment | None],
    damage: Iterable[model.Segment],
    law: model.Indentation | None = None,
) -> model.Deck:
    """Return a deck with the segments in their usual order, without title, supports and program.

    `load` has the segments of the impact or of the static load.
    """
    segments = (
        _unit_segment(request, plies),
        mesh.coordinates(),
        mesh.element_cards(),
        *load,
        _gage_segment(request.gages),
        *damage,
        cure_segment(plies, request.cure),
        law,
        request.numerics.shear_segment(),
        curvature_of(
            in_units("radius_x", request.radius_x, "length", plies.system),
            in_units("radius_y", request.radius_y, "length", plies.system),
        ),
        _preload_segment(request, plies),
        *plies.segments(),
        zones.card,
    )
    control = Control(mesh.nodes, mesh.elements, len(plies.layups[0]), 2, 5, mesh.most_nodes)
    return model.Deck("", control, tuple(s for s in segments if s is not None), ())


def with_supports(
    request: Request, plain: model.Deck, mesh: AnyMesh, plies: DeckPlies, *, nonlinear: bool
) -> SupportedDeck:
    """Add the supports to a deck, and NONL for a nonlinear plate."""
    notes: list[str] = []
    membrane = MembraneSupport.of(
        curved=plain.has(model.Curvature), stretches=nonlinear or plies.is_coupled
    )
    boundary, comment = support_plate(request.plate, mesh, request.in_plane, notes, membrane)
    segments: list[model.Segment] = []
    for segment in plain.segments:
        segments.append(segment)
        if isinstance(segment, model.Elements) and boundary is not None:
            segments.append(boundary)
    if nonlinear:  # before the preload and the laminate
        later = (model.Preload, model.Material)
        place = next(n for n, part in enumerate(segments) if isinstance(part, later))
        segments.insert(place, model.Nonlinear())
    return SupportedDeck(replace(plain, segments=tuple(segments)), comment, notes)


def is_sandwich(plies: DeckPlies, layers: Sequence[model.Layer]) -> bool:
    """Return whether a layer is the core of a sandwich: it is very soft in shear."""
    return any(are_cores([plies.of(layer).ply for layer in layers]))


def doubts_of_core(plies: DeckPlies, layers: Sequence[model.Layer]) -> list[str]:
    """Return a doubt about an estimated k of a sandwich."""
    if not is_sandwich(plies, layers):
        return []
    return [
        "k is estimated of a sandwich, as if its core were spread over the thickness; its face "
        "indents into the core, and the core is crushed: measure the law (`law`)"
    ]


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


def _check_choice(name: str, value: str | None, choices: Sequence[str | None]) -> None:
    """Raise ObjectError if a text is not one of the choices."""
    if value not in choices:
        listed = ", ".join(choice for choice in choices if choice is not None)
        raise ObjectError(f"`{name}` is {value!r}, none of {listed}")


def _parse_motion(request: Request, plies: DeckPlies) -> Motion:
    """Return velocity, energy and duration in the units of the deck."""
    strike, numerics, system = request.strike, request.numerics, plies.system
    motion = Motion(
        in_units("velocity", strike.velocity, "length/time", system),
        in_units("energy", strike.energy, "force*length", system),
        in_units("duration", numerics.duration, "time", system),
        in_units("dt", numerics.dt, "time", system),
    )
    check_positive(
        energy=motion.energy,
        duration=motion.duration,
        dt=motion.dt,
        every=numerics.every,
    )
    return motion


def _apply_standard(
    test: DropWeight, strike: ImpactParameters, motion: Motion, thickness: float
) -> tuple[ImpactParameters, Motion]:
    """Fill missing arguments with the values that a standard prescribes."""
    if motion.velocity is None and motion.energy is None:
        motion = motion._replace(energy=test.energy * thickness)
    contact = strike.contact
    if contact in (None, Sphere()):
        contact = Sphere(test.radius)
    projectile = strike.projectile or RigidMass(test.mass)
    return replace(strike, projectile=projectile, contact=contact), motion


def _doubt_of_thickness(name: str, test: DropWeight, thickness: float) -> str:
    """Return a doubt about a laminate with a thickness outside the range of a standard."""
    limits = f"{test.thinnest:g} to {test.thickest:g} mm"
    return f"{name} is for laminates of {limits}; this one has {thickness:.4g} mm"


def _check_complete(
    request: Request, strike: ImpactParameters, motion: Motion, system: str | None
) -> None:
    """Raise ObjectError if projectile or velocity is missing."""
    if strike.projectile is None and system not in (None, SYSTEM):
        raise ObjectError(
            "give `projectile`, a rigid mass or a rod: without it the projectile is the report's "
            f"steel rod, whose numbers are in {SYSTEM}"
        )
    if (motion.velocity is None) == (motion.energy is None):
        raise ObjectError("give either `velocity` or `energy`")


def _unit_segment(request: Request, plies: DeckPlies) -> model.Units | None:
    """Return the UNIT segment; None for a deck like the report's, without named units."""
    if plies.system is None or (plies.system == SYSTEM and request.units is None):
        return None
    return model.Units(*units_of(plies.system).values())


def _projectile_segment(projectile: AnyProjectile | None) -> model.Projectile | None:
    """Return the PROJ segment of a projectile; None for the rod of the report."""
    if projectile is None or isinstance(projectile, model.Projectile):
        return projectile
    return projectile_segment(projectile)


def _preload_segment(request: Request, plies: DeckPlies) -> model.Preload | None:
    """Return the PREL segment of a membrane force, if there is one."""
    if request.preload is None:
        return None
    values = list(request.preload) if isinstance(request.preload, Iterable) else []
    forces = [in_units("preload", value, "force/length", plies.system) for value in values]
    numbers = [force for force in forces if is_finite(force)]
    if len(numbers) < len(values) or len(values) not in (2, 3):
        raise ObjectError(f"`preload` is {request.preload!r}, not N0x, N0y and perhaps N0xy")
    return model.Preload(*map(float, numbers))


def _gage_segment(places: Iterable[GagePlace]) -> model.Gages | None:
    """Return the GAGE segment of strain gages, if there are any."""
    try:
        gages = tuple(Gage(n, *map(float, place)) for n, place in enumerate(places, start=1))
    except (TypeError, ValueError):
        raise ObjectError("`gages` are not x, y, z and degrees of each") from None
    return model.Gages(gages) if gages else None
