"""Layups and their materials, with units, strengths, toughness and expansions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from textwrap import shorten
from typing import NamedTuple

import numpy as np

from fecm._errors import did_you_mean
from fecm._table import Row, Table, html_table
from fecm._typing import Floats
from fecm.authoring.parameters import ObjectError, check_numbers, check_positive, parameter_in_units
from fecm.deck import catalogue
from fecm.deck.catalogue import MATERIALS, STANDARD, NamedPly
from fecm.deck.findings import Findings
from fecm.deck.layup import LARGEST_ANGLE, parse_plies
from fecm.deck.material_cards import MATERIAL
from fecm.deck.model import (
    Allowables,
    Control,
    Cure,
    Deck,
    Delamination,
    Expansion,
    Integration,
    LaminateNumber,
    Laminates,
    Layer,
    Material,
    MaterialNumber,
    Materials,
    NumberedLaminate,
    NumberedPly,
    Ply,
    Segment,
)
from fecm.deck.quantities import text_of
from fecm.deck.units import MODULUS, UnitsError, in_si, system_named, unit_of, units_of
from fecm.mechanics.laminate import ROUNDING, EngineeringConstants
from fecm.mechanics.laminate import LaminateSection as Stiffness
from fecm.mechanics.laminate import laminate as stiffness_of
from fecm.problem.check import check_segment
from fecm.problem.parts import laminates_of_deck
from fecm.problem.rules.units import looks_like

THINNEST = 1e-6  # smallest plausible thickness of a ply, m; thin plies have 15e-6
USUAL_THICKNESS = 2e-4  # m
ORDER = 3  # integration order of stiffness and mass
NODAL_POINTS = -3  # order K of MATE: stresses at the nodes
# Dimensions of the stiffness matrices, and indices of their entries 11, 22, 66, 12, 16, 26.
STIFFNESS = {"A": "force/length", "B": "force", "D": "force*length"}
ENTRIES = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]

AnyPly = str | Ply | NamedPly
# Angle, name of the material, and thickness of a ply. The laminate supplies missing parts.
Entry = float | tuple[float, str] | tuple[float, str, float | str] | Sequence[float | str]
Layup = str | Iterable[Entry]


class LaminatePly(NamedTuple):
    """Ply of a laminate."""

    angle: float  # degrees
    name: str = ""  # name of the material; empty if the layup does not name it
    thickness: float | str | None = None  # length; None if the layup does not give it


@dataclass(frozen=True)
class Laminate:
    """Layup of a plate, and its stiffness.

    The laminate has the x-axis of the plate. Angles are counter-clockwise from it. z runs from the
    struck face, z = -h/2, to the other face. The matrices have the order xx, yy, xy, with the
    engineering shear strain. All numbers are in the units of the source of the first named ply (see
    ``fecm.materials()``), or without a named ply in the units of the constants in `ply`.

    Attributes
    ----------
    layup : str or sequence
        Layup as in ``"[0/45]2s"``, or angles in degrees, from the struck face on. With several
        materials, plies have a letter, ``"[0C/90G]s"``, or are tuples of angle, name and
        thickness, ``[(0, "C"), (0, "foam", 10.0)]``. Without a thickness a tuple takes
        `ply_thickness`. The laminate keeps a list or an array as a tuple.
    ply : str or Ply or NamedPly or dict, optional
        Name of a ply from the list of `fecm materials`, or constants in the units of the deck. A
        dictionary has several materials by their names in the layup; ``""`` stands for plies
        without a name.
    ply_thickness : float, str or dict, optional
        Thickness of one ply, length, also with a unit, as in ``"0.131mm"``. A dictionary has
        thicknesses by the names of materials. The default is the thickness of the named ply, if it
        is known.

    Raises
    ------
    ValueError
        If the layup can't be read, the name of a ply is unknown, or a thickness is not positive.

    Examples
    --------
    >>> import fecm
    >>> fecm.Laminate("[0/45]s", "T300/5208", 0.125).angles
    (0.0, 45.0, 45.0, 0.0)
    >>> fecm.Laminate("[0/90]2s", "AS4/8552").thickness
    1.04
    >>> hybrid = {"C": "IM7/8552", "G": "E-glass/MY750"}
    >>> fecm.Laminate("[0C/90G]s", hybrid, {"C": 0.125, "G": 0.25}).thickness
    0.75

    The constants are in MPa:

    >>> constants = fecm.Laminate("[0/90]s", "AS4/8552", 0.13).in_plane_constants
    >>> print(f"Ex {constants.ex:.0f}, Gxy {constants.gxy:.0f}, nu_xy {constants.nu_xy:.4f}")
    Ex 72699, Gxy 5300, nu_xy 0.0425
    """

    layup: Layup
    ply: AnyPly | Mapping[str, AnyPly] | None = None
    ply_thickness: float | str | Mapping[str, float | str] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.layup, str):  # an array or a list of the caller may change
            object.__setattr__(self, "layup", tuple(map(_short_entry, _parse_layup(self.layup))))
        plies = self.ply.values() if isinstance(self.ply, Mapping) else [self.ply]
        for constants in plies:
            if constants is not None:  # the laminate of a zone may take the material of the plate
                _resolve_ply(constants)
        for ply in self.plies:
            self.material(ply.name)
            self.thickness_of(ply, STANDARD)  # any system: the text is checked

    @property
    def plies(self) -> tuple[LaminatePly, ...]:
        """Plies from the struck face on."""
        if isinstance(self.layup, str):
            return tuple(LaminatePly(*ply) for ply in parse_plies(self.layup))
        return _parse_layup(self.layup)

    @property
    def angles(self) -> tuple[float, ...]:
        """Angles of the plies, degrees."""
        return tuple(ply.angle for ply in self.plies)

    @property
    def thickness(self) -> float:
        """Total thickness, length.

        Raises ValueError if the thickness of a ply is missing. Thicknesses of named plies are
        converted to the units of the laminate.
        """
        named = [item for ply in self.plies if isinstance(item := self._resolve(ply), NamedPly)]
        system = named[0].system if named else None
        return _total(
            [self.thickness_of(ply, system) or self._listed(ply, system) for ply in self.plies]
        )

    @property
    def A(self) -> Floats:
        """Extensional stiffness, (3, 3), force/length.

        Raises ValueError if the laminate is incomplete.
        """
        return self._stiffness.A

    @property
    def B(self) -> Floats:
        """Coupling stiffness of membrane forces and curvatures, (3, 3), force."""
        return self._stiffness.B

    @property
    def D(self) -> Floats:
        """Bending stiffness, (3, 3), force*length."""
        return self._stiffness.D

    @property
    def in_plane_constants(self) -> EngineeringConstants:
        """Moduli `ex`, `ey`, `gxy` (force/area) and `nu_xy` under membrane forces.

        The laminate is free to bend: Ex = 1/(h a11), where a is a part of the inverse of A, B, D.
        """
        return self._stiffness.in_plane_constants

    @property
    def flexural_constants(self) -> EngineeringConstants:
        """Moduli `ex`, `ey`, `gxy` (force/area) and `nu_xy` under moments.

        The laminate is free to stretch: Ex = 12/(h^3 d11), where d is a part of the inverse.
        """
        return self._stiffness.flexural_constants

    @property
    def _stiffness(self) -> Stiffness:
        return stiffness_of_laminate(self, None, [])[0]

    def __hash__(self) -> int:
        return hash(self.plies)  # a layup may be a list, and `ply` a dictionary

    def _repr_html_(self) -> str:
        """Return a table of plies, stiffness and engineering constants, for notebooks."""
        angles = "/".join(f"{ply.angle:g} {ply.name}".rstrip() for ply in self.plies)
        rows: list[Row] = [("angles", shorten(angles, 200))]
        try:
            rows += _stiffness_rows(*stiffness_of_laminate(self, None, []))
        except ObjectError as error:
            rows.append(("note", str(error)))
        return html_table(Table(tuple(rows), title=repr(self)))

    def _resolve(self, ply: LaminatePly) -> Ply | NamedPly | None:
        """Return the constants or the named ply of a ply; None if the laminate has no material."""
        material = self.material(ply.name)
        return None if material is None else _resolve_ply(material)

    def _listed(self, ply: LaminatePly, system: str | None) -> float:
        """Return the thickness that the catalogue lists for a ply."""
        material = self._resolve(ply)
        return _listed_thickness(material if isinstance(material, NamedPly) else None, system)

    def material(self, name: str) -> object:
        """Return the part of `ply` that belongs to a name in the layup."""
        materials = self.ply if isinstance(self.ply, Mapping) else {"": self.ply}
        if name in materials:
            return materials[name]
        if name in MATERIALS:
            return name
        names = ", ".join(filter(None, materials)) or "only plies without a name"
        what = f"the material {name!r}" if name else "a ply without a material"
        raise ObjectError(f"`layup` has {what}; the given materials are {names}")

    def thickness_of(self, ply: LaminatePly, system: str | None) -> float | None:
        """Return the thickness of a ply in a system of units; None if the laminate lacks it."""
        default = self.ply_thickness
        if isinstance(default, Mapping):
            default = default.get(ply.name)
        stated = default if ply.thickness is None else ply.thickness
        thickness = parameter_in_units("ply_thickness", stated, "length", system)
        check_positive(ply_thickness=thickness)
        return thickness


def _parse_layup(layup: Iterable[Entry]) -> tuple[LaminatePly, ...]:
    """Return the plies of a sequence of angles; raise ObjectError if it is not one."""
    try:
        plies = tuple(map(_parse_entry, layup))
    except ObjectError:
        raise
    except (TypeError, ValueError):
        plies = ()
    if not plies:
        raise ObjectError(f"the layup {layup!r} is not a list of angles")
    if wrong := [ply.angle for ply in plies if not abs(ply.angle) <= LARGEST_ANGLE]:
        raise ObjectError(
            f"`layup` has the angle {wrong[0]:g}, beyond ±{LARGEST_ANGLE:g}; angles are in degrees"
        )
    return plies


def _short_entry(ply: LaminatePly) -> Entry:
    """Return a ply without the parts that the layup does not give."""
    if ply.thickness is not None:
        return ply.angle, ply.name, ply.thickness
    return (ply.angle, ply.name) if ply.name else ply.angle


def _parse_entry(entry: Entry) -> LaminatePly:
    if not isinstance(entry, Sequence) or isinstance(entry, str):
        return LaminatePly(_angle(entry))
    angle, name, *thickness = entry
    if not isinstance(name, str):
        raise TypeError
    return LaminatePly(_angle(angle), name, *thickness)


def _angle(value: float | str) -> float:
    if text_of(value) is not value:  # float() of a quantity of pint is in radians
        raise ObjectError(f"`layup` has the angle {value}; give a number of degrees without a unit")
    return float(value)


def _total(thicknesses: Sequence[float]) -> float:
    """Return the thickness of a laminate, rounded to the digits of a card."""
    if len(set(thicknesses)) == 1:
        return float(f"{len(thicknesses) * thicknesses[0]:.9g}")
    return float(f"{math.fsum(thicknesses):.9g}")


class Bound(NamedTuple):
    """Material in the units of a deck."""

    ply: Ply
    named: NamedPly | None  # source of the constants; None if they have no name

    @property
    def nu23(self) -> float:
        """Poisson's ratio across the fibres."""
        return self.named.nu23 if self.named else catalogue.nu23_of(self.ply, None)


class DeckPlies(NamedTuple):
    """Laminates of the plate and of its zones, in the units of a deck."""

    layups: tuple[tuple[Layer, ...], ...]
    materials: tuple[Bound, ...]  # the first is material 1
    system: str | None  # system of units; None if the deck has none

    @property
    def thickness(self) -> float:
        """Thickness of the laminate of the plate."""
        return _total([layer.thickness for layer in self.layups[0]])

    @property
    def thickest(self) -> float:
        """Thickness of the thickest laminate."""
        return max(_total([layer.thickness for layer in layers]) for layers in self.layups)

    @property
    def description(self) -> str:
        """Number of plies and thickness of the thickest laminate, for messages."""
        layers = max(self.layups, key=lambda layup: _total([layer.thickness for layer in layup]))
        sizes = {f"{layer.thickness:g}" for layer in layers}
        each = f" of `ply_thickness` {sizes.pop()}" if len(sizes) == 1 else ""
        return f"{len(layers)} plies{each} are {self.thickest:g} thick"

    @property
    def named(self) -> list[tuple[int, NamedPly]]:
        """Numbers of the materials that have names."""
        numbered = enumerate(self.materials, start=MATERIAL)
        return [(number, bound.named) for number, bound in numbered if bound.named]

    @property
    def is_coupled(self) -> bool:
        """Whether bending and stretching are coupled."""
        return any(
            stiffness_of(
                [self.of(layer).ply for layer in layers],
                [layer.angle for layer in layers],
                [layer.thickness for layer in layers],
            ).is_coupled
            for layers in self.layups
        )

    def of(self, layer: Layer) -> Bound:
        """Return the material of a layer."""
        return self.materials[layer.material - MATERIAL]

    def segments(self) -> list[Segment]:
        """Return MATE, MATS if there are several materials, and LAMS if several laminates."""
        (first, *further), (layup, *zones) = self.materials, self.layups
        integration = Integration(ORDER, ORDER, NODAL_POINTS, self.thickness)
        segments: list[Segment] = [Material(integration, first.ply, layup)]
        if further:
            numbered = enumerate(further, start=MATERIAL + 1)
            segments.append(
                Materials(tuple(NumberedPly(MaterialNumber(n), b.ply) for n, b in numbered))
            )
        if zones:
            heads = [LaminateNumber(n, len(z)) for n, z in enumerate(zones, start=MATERIAL + 1)]
            segments.append(Laminates(tuple(map(NumberedLaminate, heads, zones))))
        return segments


def deck_plies(
    laminate: Laminate, zones: Sequence[Laminate], units: str | None, notes: list[str]
) -> tuple[DeckPlies, list[int]]:
    """Return the laminates of a plate and its zones, and the laminate number of each zone.

    The default `units` are the units of the first named ply. Equal laminates share a number. The
    function adds a note for each ply thickness that it takes from the catalogue.
    """
    laminates = (laminate, *zones)
    owners = {ply.name: item for item in reversed(laminates) for ply in reversed(item.plies)}
    names = list(dict.fromkeys(ply.name for item in laminates for ply in item.plies))
    plies_by_name = {name: _resolve_ply(owners[name].material(name)) for name in names}
    named = {name: item for name, item in plies_by_name.items() if isinstance(item, NamedPly)}
    system = units or next((item.system for item in named.values()), None)
    if named and len(named) < len(plies_by_name) and units is None:
        raise ObjectError("constants of a `ply` beside a named ply need their `units`")
    numbers = {name: number for number, name in enumerate(names, start=MATERIAL)}
    materials = [
        Bound(item.converted(system or item.system), item)
        if isinstance(item, NamedPly)
        else Bound(item, None)
        for item in plies_by_name.values()
    ]
    listed: dict[str, float] = {}  # ply thicknesses from the catalogue, by the names in the layup

    def layer(number: int, ply: LaminatePly, thickness: float | None) -> Layer:
        if thickness is None:
            if ply.name not in listed:
                listed[ply.name] = _listed_thickness(named.get(ply.name), system)
                notes.append(_note_of_thickness(listed[ply.name], named[ply.name], system))
            thickness = listed[ply.name]
        return Layer(number, ply.angle, thickness, numbers[ply.name])

    layups = [
        tuple(
            layer(n, ply, item.thickness_of(ply, system))
            for n, ply in enumerate(item.plies, start=1)
        )
        for item in laminates
    ]
    different = list(dict.fromkeys(layups))
    in_zones = [different.index(item) + MATERIAL for item in layups[1:]]
    return DeckPlies(tuple(different), tuple(materials), system), in_zones


def stiffness_of_laminate(
    laminate: Laminate, units: str | None, notes: list[str]
) -> tuple[Stiffness, dict[str, str]]:
    """Return the stiffness and inertia of a laminate, and the names of its units.

    The laminate is checked as in a deck. Raises ObjectError if it is incomplete or impossible.
    """
    plies, _ = deck_plies(laminate, (), system_asked(units), notes)
    control = Control(0, 0, len(plies.layups[0]), 2, 5, 4)
    deck = Deck("", control, tuple(plies.segments()), ())
    findings = Findings()
    for segment in deck.segments:
        check_segment(segment, findings)
    if findings.errors:
        raise ObjectError(findings.errors[0].message)
    names = units_of(plies.system) if plies.system else {}
    return laminates_of_deck(deck)[0], names


def _stiffness_rows(stiffness: Stiffness, names: dict[str, str]) -> list[tuple[str, str]]:
    """Return rows with the thickness, the matrices and the engineering constants.

    Entries of matrices that are only rounding errors are shown as 0.
    """

    def text(values: Iterable[float], dimension: str) -> str:
        numbers = ", ".join(f"{value:.5g}" for value in values)
        return f"{numbers} {unit_of(dimension, names)}".rstrip()

    h = stiffness.thickness
    least = ROUNDING * float(np.abs(stiffness.A).max())
    rows = [("thickness", text([h], "length"))]
    for power, (name, dimension) in enumerate(STIFFNESS.items()):
        entries = getattr(stiffness, name)[ENTRIES].tolist()
        kept = [value if abs(value) > least * h**power else 0.0 for value in entries]
        label = ", ".join(f"{name}{number}" for number in (11, 22, 66, 12, 16, 26))
        rows.append((label, text(kept, dimension)))
    for name, constants in (
        ("in-plane", stiffness.in_plane_constants),
        ("flexural", stiffness.flexural_constants),
    ):
        *moduli, ratio = constants
        rows.append((f"{name} Ex, Ey, Gxy", text(moduli, MODULUS)))
        rows.append((f"{name} nu_xy", text([ratio], "")))
    return rows


def system_asked(units: str | None) -> str | None:
    """Return the usual name of the system of units that a user asks for."""
    if units is None:
        return None
    if not isinstance(units, str):
        raise ObjectError(f"`units` is {units!r}, not a text such as 'mm-N-s'")
    try:
        return system_named(units)
    except UnitsError as error:
        raise ObjectError(f"`units`: {error}") from None


def _resolve_ply(ply: object) -> Ply | NamedPly:
    """Return constants or a named ply as they are, and the named ply for a name."""
    if isinstance(ply, Ply):
        check_numbers(**{field.name: getattr(ply, field.name) for field in fields(Ply)[1:]})
        return ply
    if isinstance(ply, NamedPly):
        return ply
    if not isinstance(ply, str):
        raise ObjectError(f"`ply` is {ply!r}, not a name or a Ply")
    if ply not in MATERIALS:
        alternatives = did_you_mean(ply, MATERIALS) or f": {', '.join(MATERIALS)}"
        raise ObjectError(f"{ply!r} is not a named ply{alternatives}")
    return MATERIALS[ply]


def _listed_thickness(named: NamedPly | None, system: str | None) -> float:
    """Return the thickness that the catalogue lists for a ply; raise ObjectError without one."""
    thickness = None if named is None or system is None else named.value("thickness", system)
    if thickness is None:
        unknown = f": {named.name} has no known one" if named else ""
        raise ObjectError(f"`ply_thickness` is missing{unknown}")
    return thickness


def _note_of_thickness(thickness: float, named: NamedPly, system: str | None) -> str:
    """Return a note about a ply thickness from the catalogue."""
    unit = units_of(system or named.system)["length"]
    return f"the plies are {thickness:g} {unit} thick, as {named.name} is listed"


def check_thickness(plies: DeckPlies) -> None:
    """Raise ObjectError if plies are impossibly thin; the message guesses the right unit."""
    names = units_of(plies.system) if plies.system else {}
    unit = in_si("length", names)
    thinnest = min(layer.thickness for layers in plies.layups for layer in layers)
    if unit is not None and thinnest * unit < THINNEST:
        looks = looks_like(thinnest, "length", USUAL_THICKNESS, names)
        remark = f"; it {looks}" if looks else ""
        raise ObjectError(
            f"`ply_thickness` is {thinnest:g} {names['length']}, thinner than any ply{remark}"
        )


def toughness_segment(giic: float | None) -> list[Segment]:
    """Return the DELA segment of a toughness; empty without one."""
    return [] if giic is None else [Delamination(toughness=giic)]


def strengths_of(plies: DeckPlies) -> Allowables:
    """Return the ALLO segment of named plies; raise ObjectError if none of them has strengths."""
    strengths, lacking = _strengths(plies)
    if not strengths:
        why = "; ".join(f"{name} has {lacks}" for name, lacks in lacking.items())
        raise ObjectError(f"`failure` needs a named ply with strengths{why and ': '}{why}")
    return replace(strengths[0], others=tuple(strengths[1:]))


def _strengths(plies: DeckPlies) -> tuple[list[Allowables], dict[str, str]]:
    """Return the strengths of named plies, and a text by name about plies that lack strengths."""
    all_strengths: list[Allowables] = []
    lacking: dict[str, str] = {}
    for number, named in plies.named:
        if plies.system and (strengths := named.allowables(plies.system)) is not None:
            all_strengths.append(replace(strengths, material=number))
        else:
            lacks = " and ".join(key for key in catalogue.STRENGTHS if key not in named.values)
            lacking[named.name] = (
                f"no {lacks}, so no failure exposures (ALLO, FAIL); a file of your own plies may "
                "have them (fecm new --materials)"
            )
    return all_strengths, lacking


def toughness_of(plies: DeckPlies) -> float:
    """Return the smallest toughness G_IIc of named plies; raise ObjectError without any."""
    if toughnesses := _toughnesses(plies):
        return min(toughnesses)
    raise ObjectError("no named ply with GIIc")


def _toughnesses(plies: DeckPlies) -> list[float]:
    """Return the toughness G_IIc of the named plies that have it."""
    delaminations = [named.delamination(plies.system) for _, named in plies.named if plies.system]
    return [delamination.toughness for delamination in delaminations if delamination]


def damage_segments(plies: DeckPlies, giic: float | None, notes: list[str]) -> list[Segment]:
    """Return the ALLO and DELA segments of named plies, and add notes about missing values.

    DELA has `giic`, or else the smallest toughness of the plies.
    """
    if plies.system is None or not plies.named:
        raise ObjectError("`damage` needs a named ply with strengths or toughness")
    strengths, without = _strengths(plies)
    toughnesses = _toughnesses(plies) if giic is None else [giic]
    lacking: list[str] = []
    for _, named in plies.named:
        missing = [without[named.name]] if named.name in without else []
        if not toughnesses:
            missing.append("no GIIc, so no delamination threshold (DELA); `giic` gives it")
        if missing:
            lacking.append(f"{named.name} has {'; '.join(missing)}")
    if not strengths and not toughnesses:
        raise ObjectError(f"`damage`: {'; '.join(lacking)}")
    notes += lacking
    segments: list[Segment] = []
    if strengths:
        segments.append(replace(strengths[0], others=tuple(strengths[1:])))
    if toughnesses:
        segments.append(Delamination(min(toughnesses)))
    return segments


def _names_with_expansion() -> list[str]:
    """Return the names of the catalogue's plies with coefficients of expansion."""
    return [name for name, ply in MATERIALS.items() if ply.expansion is not None]


def cure_segment(plies: DeckPlies, cure: float | str | None) -> Cure | None:
    """Return the CURE segment of named plies for a change of temperature, or ``"177:20"``."""
    if cure is None:
        return None
    expansions: list[Expansion] = []
    for number, material in enumerate(plies.materials, start=MATERIAL):
        if material.named is None or (expansion := material.named.expansion) is None:
            lacks = (
                f"{material.named.name} has no" if material.named else "it needs a named ply with"
            )
            raise ObjectError(
                f"`cure`: {lacks} alpha1 and alpha2, which "
                f"{', '.join(_names_with_expansion())} have; a file of your own plies may have "
                "them (fecm new --materials)"
            )
        expansions.append(replace(expansion, material=number))
    named = [ply for _, ply in plies.named]
    return Cure(delta_t=_temperature_change(cure, named), expansions=tuple(expansions))


def _temperature_change(cure: float | str, plies: Sequence[NamedPly]) -> float:
    """Return the temperature of use minus the stress-free temperature, K.

    `cure` is the difference, or both temperatures, ``"177:20"``. ``":20"`` takes the stress-free
    temperature of the plies.
    """
    before, colon, after = str(cure).rpartition(":")
    if colon and not before.strip():
        before = str(_stress_free_temperature(cure, plies))
    try:
        change = float(after) - (float(before) if colon else 0.0)
    except ValueError:
        change = math.nan
    if not math.isfinite(change):
        raise ObjectError(
            f"`cure` is {cure!r}, not a change of temperature, as -100, or a stress-free "
            "temperature and one of use, as 177:20"
        )
    return float(f"{change:.9g}")


def _stress_free_temperature(cure: float | str, plies: Sequence[NamedPly]) -> float:
    """Return the common stress-free temperature of the plies that have one."""
    temperatures = {ply.values.get("stress_free_temperature") for ply in plies} - {None}
    if len(temperatures) != 1:
        names = " and ".join(ply.name for ply in plies)
        why = "not the same" if temperatures else "not known"
        raise ObjectError(f"`cure` is {cure!r}: the stress-free temperature of {names} is {why}")
    (temperature,) = temperatures
    assert temperature is not None
    return temperature
