"""The deck of an impact from plate, laminate, projectile and contact."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Literal

from fecm import objects
from fecm._errors import warn
from fecm._frozen import frozen
from fecm.api import load_deck
from fecm.deck import catalogue, model
from fecm.deck.catalogue import MATERIALS, STANDARD, SYSTEM, SYSTEMS, NamedContact, NamedPly
from fecm.deck.findings import DeckError
from fecm.deck.grid import IN_PLANE, Grid
from fecm.deck.records import Control, Gage, Integration, Layer, Macro, Ply
from fecm.deck.units import in_si, unit_of
from fecm.mechanics.laminate import laminate as stiffness_of
from fecm.mechanics.points import HERTZ
from fecm.mechanics.projectile import RigidMass, Rod
from fecm.mechanics.solutions import static_stiffness
from fecm.mechanics.time_step import critical_time_step, rounded_time_step
from fecm.objects import (
    Contact,
    DropWeight,
    Fixture,
    Laminate,
    ObjectError,
    Plate,
    Sphere,
    check_positive,
    in_units,
)
from fecm.problem.build import build_plate, build_projectile, projectile_segment
from fecm.problem.generate import generate
from fecm.problem.plate_mesh import PlateMesh
from fecm.studies.estimate import contact_time

ORDER, NODAL_POINTS = 3, -3  # integration order of stiffness and mass, stress points
ROWS = 200  # default number of stored rows of strains and displacements
# Simulated time over half a period of the projectile on the plate's static stiffness, and least
# simulated time over the contact of the two with the indentation in series: a plate that vibrates
# ends it up to 2 % later.
HALF_PERIODS, CONTACT_TIMES = 1.25, 1.1
AUTO = "auto"  # the default patch: a disc, or what a standard has
MITC, FULL = "mitc", "full"
HELD, FREE = "held", "free"  # u and v on supports
InPlane = Literal["free", "held", "normal"]
EQUI = "equi"  # the shear stiffness from equilibrium


@frozen
class Authored:
    """A new deck, not yet checked."""

    deck: model.Deck
    comments: str  # comment lines for the deck's head
    # What was filled in, and what differs from what was asked.
    notes: list[str]
    doubts: list[str]


def impact(
    plate: Plate,
    laminate: Laminate,
    projectile: Rod | RigidMass | model.Projectile | None = None,
    contact: model.Indentation | NamedContact | Sphere | str | None = None,
    *,
    velocity: float | str | None = None,
    energy: float | str | None = None,
    at: tuple[float, float] | None = None,
    duration: float | str | None = None,
    dt: float | None = None,
    every: int | None = None,
    units: str | None = None,
    patch: str | model.Patch | None = AUTO,
    shear: Literal["mitc", "full"] = "mitc",
    shear_factor: float | Literal["equi"] = 1.0,
    in_plane: InPlane | None = None,
    gages: Iterable[tuple[float, float, float, float]] = (),
    damage: bool = False,
    giic: float | None = None,
    title: str = "",
) -> model.Deck:
    """Deck of an impact, as `fecm new` writes it.

    A laminate without coupling has its in-plane dofs restrained, as the report's does; any other
    has them free inside the plate, and restrained on its supports as `in_plane` says.

    Parameters
    ----------
    plate : Plate
        Mesh and supports.
    laminate : Laminate
        Layup and ply.
    projectile : Rod or RigidMass, optional
        In the deck's units; the report's rod, or the mass of a fixture's standard, by default.
    contact : Contact or str
        Indentation law, or the name of a published one.
    velocity, energy : float or str
        Approach velocity (length/time) or energy (force*length) of the projectile, in the deck's
        units (mJ in mm-N-s) or with a unit, as in ``"3m/s"`` and ``"10J"``.
    at : tuple of float, optional
        Impact point; the middle of the plate by default.  The nearest node is hit; on an imported
        mesh a patch is centred at the point itself.
    duration : float or str
        Simulated time, also with a unit, ``"4ms"``; with a fixture by default 1.25 half periods of
        the projectile on the plate, or 1.1 times the contact with the indentation where that is
        longer.
    dt : float, optional
        Time step; 0.9 of the critical one by default.
    every : int, optional
        Steps between stored rows; about 200 rows by default.
    units : str, optional
        ``"in-lbf-s"``, ``"m-N-s"`` or ``"mm-N-s"``, to which a named ply and contact are converted;
        those of a named ply's source by default.
    patch : str or Patch or None
        Area of the contact force: ``"disc"`` or ``"hertz"``, with ``":RADIUS"``, to which the mesh
        of a rectangle is then refined; None is a point force.  By default a disc.
    shear : str
        Transverse shear: assumed strains, ``"mitc"``, or full quadrature, ``"full"``.
    shear_factor : float or str
        Factor of the transverse shear stiffness, or ``"equi"``, the stiffness from equilibrium.
    in_plane : str, optional
        Displacements u and v of a coupled laminate where the plate is supported: ``"held"``, the
        default of edges; ``"free"``, that of fixtures; or ``"normal"``, held across the edge only.
    gages : iterable of tuple
        Place x, y and z from the mid-plane (length) and direction (degrees) of strain gages.
    damage : bool
        Add strengths and toughness of a named ply.
    giic : float, optional
        Toughness G_IIc of the delamination threshold, force/length; a named ply's by default.
    title : str, optional
        Title of the deck.

    Returns
    -------
    Deck
        It has no errors.

    Raises
    ------
    ValueError
        If something is missing or makes no sense.
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
    made = author(
        plate, laminate, projectile, contact, velocity=velocity, energy=energy, at=at,
        duration=duration, dt=dt, every=every, units=units, patch=patch, shear=shear, gages=gages,
        shear_factor=shear_factor, in_plane=in_plane, damage=damage, giic=giic, title=title,
    )  # fmt: skip
    loaded = load_deck(made.deck)
    if errors := loaded.errors():
        raise DeckError(errors, "<deck>")
    for doubt in made.doubts:
        warn(doubt)
    return replace(loaded.problems[0].deck, text="")


def author(
    plate: Plate, laminate: Laminate, projectile: Rod | RigidMass | model.Projectile | None,
    contact: model.Indentation | NamedContact | Sphere | str | None, *,
    velocity: float | str | None, energy: float | str | None, at: tuple[float, float] | None,
    duration: float | str | None, dt: float | None, every: int | None, units: str | None,
    patch: str | model.Patch | None, shear: str, shear_factor: float | str,
    in_plane: str | None, gages: Iterable[tuple[float, float, float, float]], damage: bool,
    giic: float | None, title: str,
) -> Authored:  # fmt: skip
    """Make the deck of :func:`impact` without checking it."""
    _check_kinds(plate=plate, laminate=laminate, patch=patch, projectile=projectile,
                 contact=contact)  # fmt: skip
    _check_choices(shear, in_plane, units, title)
    notes: list[str] = []
    doubts: list[str] = []
    test = plate.fixture.test if plate.fixture else None
    if test is not None:
        if units not in (None, STANDARD):
            raise ObjectError(f"the fixture's standard is in {STANDARD}; leave out `units`")
        units = STANDARD
    given = _known(laminate.ply)
    named = given if isinstance(given, NamedPly) else None
    system = units or (named.system if named else None)
    shown = system if units or system != SYSTEM else None  # the report's decks have no UNIT
    ply = named.converted(system or named.system) if named else given
    if not isinstance(ply, Ply):
        raise ObjectError(f"`ply` is {ply!r}, not a name or a Ply")
    laminate, thickness = _with_ply_thickness(laminate, named, system, notes)
    velocity = in_units("velocity", velocity, "length/time", system)
    energy = in_units("energy", energy, "force*length", system)
    duration = in_units("duration", duration, "time", system)
    check_positive(
        energy=energy, duration=duration, dt=dt, every=every, giic=giic, ply_thickness=thickness
    )
    if plate.fixture is not None and test is not None:
        doubts += _doubts_of_thickness(plate.fixture.name, test, laminate.thickness)
        projectile = projectile or RigidMass(test.mass)
        if velocity is None and energy is None:
            energy = test.energy * laminate.thickness
        if contact in (None, Sphere()):
            contact = Sphere(test.radius)
    if patch == AUTO:
        patch = model.Patch() if test is None else model.Patch(HERTZ)
    elif isinstance(patch, str):
        patch = objects.parse_patch(patch)
    if projectile is None and system not in (None, SYSTEM):
        raise ObjectError(
            "give `projectile`, a rigid mass or a rod: without it the projectile is the report's "
            f"steel rod, whose numbers are in {SYSTEM}"
        )
    if (velocity is None) == (energy is None):
        raise ObjectError("give either `velocity` or `energy`")
    if duration is None and plate.fixture is None:
        raise ObjectError("`duration` is missing")
    law, comment = _law(contact, laminate, ply, named, system)
    if comment:
        notes.append(
            f"k = {law.k:g} is estimated from the ply's constants (fecm indent estimate) for an "
            "elastic law; a measured one is better"
        )
    damages = _damages(named, system, giic, notes) if damage else _toughness(giic)
    mesh, node, patch = _placed(plate, laminate, at, patch, doubts)
    angles = laminate.angles
    layers = tuple(Layer(n, angle, thickness) for n, angle in enumerate(angles, start=1))
    coupled = stiffness_of(ply, angles, [thickness] * len(angles)).is_coupled
    supported, slides = _supported(plate, mesh, coupled, in_plane, notes)
    try:
        records = tuple(Gage(n, *map(float, gage)) for n, gage in enumerate(gages, start=1))
    except (TypeError, ValueError):
        raise ObjectError("`gages` are not x, y, z and degrees of each") from None
    if isinstance(projectile, Rod | RigidMass):
        projectile = projectile_segment(projectile)
    segments = (
        None if shown is None else model.Units(*SYSTEMS[shown].values()),
        mesh.coordinates(), mesh.element_cards(), supported, projectile,
        model.Impact(node, 3, 1.0 if velocity is None else velocity), patch,
        model.Gages(records) if records else None, *damages, law, _shear(shear, shear_factor),
        model.Material(Integration(ORDER, ORDER, NODAL_POINTS, laminate.thickness), ply, layers),
    )  # fmt: skip
    control = Control(mesh.nodes, mesh.elements, len(layers), 2, 5, mesh.most_nodes)
    deck = model.Deck(title, control, tuple(s for s in segments if s is not None), ())
    if dt is None:
        dt = rounded_time_step(critical_time_step(build_plate(deck, generate(deck))))
    if energy is not None:
        deck = _with_energy(deck, energy)
    _tell_energy(deck, system, plate.fixture, laminate, notes, doubts)
    program = partial(_program, dt=dt, every=every, fails=deck.has(model.Allowables))
    if duration is None:
        duration = _duration(replace(deck, macros=program(dt)))
    comments = (plate.fixture.comment if plate.fixture else "") + slides + comment
    return Authored(replace(deck, macros=program(duration)), comments, notes, doubts)


def _check_kinds(**values: object) -> None:
    """Refuse arguments that are no objects of fecm."""
    kinds = {
        "plate": Plate, "laminate": Laminate, "patch": str | model.Patch,
        "projectile": Rod | RigidMass | model.Projectile,
        "contact": str | model.Indentation | NamedContact | Sphere,
    }  # fmt: skip
    for name, kind in kinds.items():
        value = values[name]
        if not isinstance(value, kind) and (value is not None or name in ("plate", "laminate")):
            raise ObjectError(f"`{name}` is {value!r}, not a {name} of fecm")


def _check_choices(shear: str, in_plane: str | None, units: str | None, title: str) -> None:
    """Refuse texts that are none of the choices."""
    for name, value, choices in (
        ("shear", shear, (MITC, FULL)), ("in_plane", in_plane, (*IN_PLANE, None)),
        ("units", units, (*SYSTEMS, None)),
    ):  # fmt: skip
        if value not in choices:
            known = ", ".join(choice for choice in choices if choice is not None)
            raise ObjectError(f"`{name}` is {value!r}, none of {known}")
    if "\n" in title:
        raise ObjectError("`title` has more than one line")


def _doubts_of_thickness(name: str, test: DropWeight, thickness: float) -> list[str]:
    """What a standard says about the thickness of a laminate that is outside its range."""
    if test.thinnest <= round(thickness, 9) <= test.thickest:
        return []
    limits = f"{test.thinnest:g} to {test.thickest:g} mm"
    return [f"{name} is for laminates of {limits}; this one has {thickness:.4g} mm"]


def _known(ply: object) -> object:
    """A ply; the named one of a name."""
    if not isinstance(ply, str):
        return ply
    if ply not in MATERIALS:
        raise ObjectError(f"{ply!r} is not a named ply: {', '.join(MATERIALS)}")
    return MATERIALS[ply]


def _with_ply_thickness(
    laminate: Laminate, named: NamedPly | None, system: str | None, notes: list[str]
) -> tuple[Laminate, float]:
    """The laminate with the thickness of a ply, and this; a named ply's own, if there is none."""
    if laminate.ply_thickness is not None:
        return laminate, laminate.ply_thickness
    own = None if named is None or system is None else named.value("thickness", system)
    if named is None or system is None or own is None:
        unknown = f": that of {named.name} is not known" if named else ""
        raise ObjectError(f"`ply_thickness` is missing{unknown}")
    unit = SYSTEMS[system]["length"]
    notes.append(f"the plies are {own:g} {unit} thick, as {named.name} is listed")
    return replace(laminate, ply_thickness=own), own


def _supported(
    plate: Plate, mesh: Grid | PlateMesh, coupled: bool, in_plane: str | None, notes: list[str]
) -> tuple[model.Boundary | None, str]:
    """Supports, and a comment line about a window; without coupling u and v are held everywhere."""
    if not coupled:
        if in_plane is not None:
            notes.append(
                "`in_plane` has no effect: the laminate is not coupled, and its u and v are held "
                "everywhere"
            )
        everywhere, in_plane = (1, 1, 0, 0, 0), HELD
    else:
        everywhere = (0, 0, 0, 0, 0)
        in_plane = in_plane or (FREE if plate.fixture else HELD)
    if isinstance(mesh, PlateMesh):
        return mesh.supported(everywhere, plate.supports, in_plane=in_plane), ""
    window = plate.fixture.window if plate.fixture else None
    supported = mesh.supported(everywhere, plate.supports, window, in_plane=in_plane)
    slides = window is not None and in_plane == FREE
    return supported, "! The plate slides on the window: u and v are free.\n" if slides else ""


def _shear(shear: str, factor: float | str) -> model.Shear | None:
    """SHEA segment; None for the report's shear stiffness and quadrature."""
    if factor == EQUI:
        return model.Shear(assumed=shear == MITC, equilibrium=True)
    if isinstance(factor, str):
        raise ObjectError(f"`shear_factor` is {factor!r}, not a number or {EQUI}")
    check_positive(shear_factor=factor)
    return None if shear == FULL and factor == 1.0 else model.Shear(factor, assumed=shear == MITC)


def _tell_energy(
    deck: model.Deck, system: str | None, fixture: Fixture | None, laminate: Laminate,
    notes: list[str], doubts: list[str],
) -> None:  # fmt: skip
    """Note energy and velocity; doubt an energy far below that of a standard."""
    velocity, mass = deck.require(model.Impact).velocity, build_projectile(deck).total_mass
    energy = 0.5 * mass * velocity**2
    names = SYSTEMS[system] if system else {}
    joule = in_si("force*length", names)
    each = ""
    if fixture is not None and (test := fixture.test) is not None:
        share = energy / laminate.thickness
        each = f" ({share / 1e3:.3g} J per mm of thickness)"
        if share < test.least_energy:
            doubts.append(
                f"the energy is {energy / 1e3:.3g} J, {share / 1e3:.2g} J per mm of thickness, "
                f"where {fixture.name} has {test.energy / 1e3:g}: `energy` is in mJ unless it has "
                'a unit, as in "10J"'
            )
    said = f"{energy * joule:.4g} J" if joule else f"{energy:.4g}"
    speed = f"{velocity:.4g} {unit_of('length/time', names)}".rstrip()
    notes.append(f"energy {said}{each}, {speed}")


def _program(duration: float, dt: float, every: int | None, fails: bool) -> tuple[Macro, ...]:
    """Macro program of an impact."""
    steps = max(1, math.ceil(duration / dt - 1e-9))
    rows = float(every if every is not None else max(1, steps // ROWS))
    stored = dict.fromkeys(("RODP", "DISP", "FAIL") if fails else ("RODP", "DISP"), rows)
    words = {"LMAS": 0.0, "DT": dt, "LOOP": float(steps), "TIME": 0.0, **stored, "NEXT": 0.0}
    return tuple(Macro(word, value=value) for word, value in words.items())


def _law(
    contact: model.Indentation | NamedContact | Sphere | str | None, laminate: Laminate, ply: Ply,
    named: NamedPly | None, system: str | None,
) -> tuple[model.Indentation, str]:  # fmt: skip
    """Indentation law, a named one in the units of the ply, and comment lines about it."""
    if isinstance(contact, str):
        contact = Contact.named(contact)
    if isinstance(contact, model.Indentation):
        return model.Indentation(*contact.values(), contact.word), ""
    if isinstance(contact, Sphere):
        return contact.law(laminate, ply, named.nu23 if named else catalogue.NU23, system)
    if contact is None:
        raise ObjectError(f"give `contact`, a law or one of {', '.join(catalogue.CONTACTS)}")
    if system is None:
        raise ObjectError("a named `contact` with constants of a `ply` needs `units`, theirs")
    return contact.converted(system), ""


def _toughness(giic: float | None) -> list[model.Segment]:
    """DELA segment of a given toughness."""
    return [] if giic is None else [model.Delamination(toughness=giic)]


def _damages(
    named: NamedPly | None, system: str | None, giic: float | None, notes: list[str]
) -> list[model.Segment]:
    """Strengths and toughness of a named ply; adds what it does not have to `notes`."""
    if named is None or system is None:
        raise ObjectError("`damage` needs a named ply with strengths or toughness")
    toughness = named.delamination(system) if giic is None else model.Delamination(giic)
    parts = {
        " and ".join(key for key in catalogue.STRENGTHS if key not in named.values): (
            named.allowables(system),
            "no failure exposures (ALLO, FAIL); a file of your own plies may have them "
            "(fecm new --materials)",
        ),
        "GIIc": (toughness, "no delamination threshold (DELA); `giic` gives it"),
    }  # fmt: skip
    missing = [f"no {key}, so {what}" for key, (part, what) in parts.items() if part is None]
    if len(missing) == len(parts):
        raise ObjectError(f"`damage`: {named.name} has {'; '.join(missing)}")
    notes += [f"{named.name} has {text}" for text in missing]
    return [part for part, _ in parts.values() if part is not None]


def _placed(
    plate: Plate, laminate: Laminate, at: Sequence[float] | None, patch: model.Patch | None,
    doubts: list[str],
) -> tuple[Grid | PlateMesh, int, model.Patch | None]:  # fmt: skip
    """Mesh, node that is hit, and patch; adds what was changed in them to `doubts`."""
    place = None if at is None else objects.pair("at", at)
    mesh = plate.imported or objects.grid_of(plate, place, None if patch is None else patch.radius)
    low, high = mesh.extent
    side = min(high[0] - low[0], high[1] - low[1])
    if laminate.thickness >= side:
        raise ObjectError(
            f"{len(laminate.angles)} plies of `ply_thickness` {laminate.ply_thickness:g} are "
            f"{laminate.thickness:g} thick, and the plate's shorter side is {side:g}"
        )
    x, y = place or ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0)
    if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
        raise ObjectError("`at` is outside the plate")
    if isinstance(mesh, PlateMesh) and mesh.groups and not plate.supports:
        doubts.append(
            f"the plate is free: no group of the mesh has a support, of {', '.join(mesh.groups)}"
        )
    node, node_x, node_y = mesh.nearest(x, y)
    distance = math.hypot(node_x - x, node_y - y)
    if distance > 1e-9 * max(map(abs, (x, y, node_x, node_y))):
        asked = "the plate's centre" if at is None else "`at`"
        if patch is not None and isinstance(mesh, PlateMesh):
            patch = replace(patch, x=float(f"{x:.6g}"), y=float(f"{y:.6g}"))
        else:
            doubts.append(
                f"the impact point is moved by {distance:.4g}: from {asked} at {x:g}, {y:g} to the "
                f"nearest node, {node} at {node_x:g}, {node_y:g}"
            )
    if isinstance(mesh, Grid) and plate.mesh and not plate.fixture and patch and patch.radius:
        counts = mesh.across // 2, mesh.up // 2
        if counts != plate.mesh:
            new, old = (f"{nx}x{ny}" for nx, ny in (counts, plate.mesh))
            doubts.append(
                f"the mesh has {new} elements instead of {old}: their sides at the patch are at "
                f"most its radius {patch.radius:g}"
            )
    return mesh, node, patch


def _with_energy(deck: model.Deck, energy: float) -> model.Deck:
    """The deck with a velocity for an energy, in as many digits as its card has."""
    mass = build_projectile(deck).total_mass
    velocity = math.sqrt(2.0 * energy / mass) if mass > 0.0 else math.inf
    if not 0.0 < velocity < math.inf:
        raise ObjectError(f"no velocity gives the energy {energy:g} to the mass {mass:g}")
    old = deck.require(model.Impact)
    new = replace(old, velocity=float(f"{velocity:.6g}"))
    return replace(deck, segments=tuple(new if s is old else s for s in deck.segments))


def _duration(deck: model.Deck) -> float:
    """Simulated time: longer than the contact of the projectile with the static plate."""
    loaded = load_deck(deck)
    if loaded.errors():
        return 1.0  # the deck is refused later
    (problem,) = loaded.problems
    assert problem.contact is not None
    stiffness = static_stiffness(problem.moving_plate, problem.contact)
    mass, velocity = build_projectile(deck).total_mass, deck.require(model.Impact).velocity
    duration = HALF_PERIODS * math.pi * math.sqrt(mass / stiffness)
    if velocity > 0.0:
        with suppress(OverflowError):  # of a k that the checks doubt
            k = deck.require(model.Indentation).k
            duration = max(duration, CONTACT_TIMES * contact_time(mass, velocity, k, stiffness))
    return float(f"{duration:.2g}")
