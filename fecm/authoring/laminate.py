"""Layup and plies, their units, strengths and toughness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from fecm._frozen import frozen
from fecm.authoring.parameters import ObjectError
from fecm.deck import catalogue
from fecm.deck.catalogue import MATERIALS, SYSTEMS, NamedPly
from fecm.deck.layup import parse_layup
from fecm.deck.model import Cure, Delamination, Integration, Layer, Material, Ply, Segment
from fecm.mechanics.laminate import laminate as stiffness_of

ORDER = 3  # integration order of stiffness and mass
NODAL_POINTS = -3  # where stresses are computed


@frozen
class Laminate:
    """Layup of a plate.

    Attributes
    ----------
    layup : str or sequence of float
        As in ``"[0/45]2s"``, or angles in degrees, from the struck face on.
    ply : str or Ply or NamedPly
        Name of a ply, which `fecm materials` lists, or constants in the deck's units.
    ply_thickness : float, optional
        Thickness of one ply, length; a named ply's own by default, where it is known.

    Examples
    --------
    >>> import fecm
    >>> fecm.Laminate("[0/45]s", "T300/5208", 0.125).angles
    (0.0, 45.0, 45.0, 0.0)
    """

    layup: str | Sequence[float]
    ply: str | Ply | NamedPly
    ply_thickness: float | None = None

    @property
    def angles(self) -> tuple[float, ...]:
        """Angles of the plies, degrees."""
        if isinstance(self.layup, str):
            return tuple(parse_layup(self.layup))
        try:
            if angles := tuple(map(float, self.layup)):
                return angles
        except (TypeError, ValueError):
            pass
        raise ObjectError(f"the layup {self.layup!r} is not a list of angles")

    @property
    def thickness(self) -> float:
        """Total thickness, length; ValueError without the thickness of a ply."""
        if self.ply_thickness is None:
            raise ObjectError("`ply_thickness` is missing")
        return float(f"{len(self.angles) * self.ply_thickness:.9g}")


class Plies(NamedTuple):
    """Plies of a laminate in the units of a deck."""

    layup: Laminate  # with the thickness of a ply
    thickness: float  # of a ply
    ply: Ply
    named: NamedPly | None  # from which the constants are, if they have a name
    system: str | None  # of units; None if the deck names none

    @property
    def nu23(self) -> float:
        """Poisson's ratio across the fibres."""
        return self.named.nu23 if self.named else catalogue.NU23

    @property
    def is_coupled(self) -> bool:
        """Whether bending and stretching are coupled."""
        angles = self.layup.angles
        return stiffness_of(self.ply, angles, [self.thickness] * len(angles)).is_coupled

    def segment(self) -> Material:
        """Material segment of the deck."""
        layers = tuple(
            Layer(n, angle, self.thickness) for n, angle in enumerate(self.layup.angles, start=1)
        )
        return Material(
            Integration(ORDER, ORDER, NODAL_POINTS, self.layup.thickness), self.ply, layers
        )


def plies_of(laminate: Laminate, units: str | None, notes: list[str]) -> Plies:
    """Plies of a laminate in a system of units, by default that of a named ply's source.

    Notes the thickness of a ply that its name gives.
    """
    given = _known(laminate.ply)
    named = given if isinstance(given, NamedPly) else None
    system = units or (named.system if named else None)
    ply = named.converted(system or named.system) if named else given
    if not isinstance(ply, Ply):
        raise ObjectError(f"`ply` is {ply!r}, not a name or a Ply")
    thickness = laminate.ply_thickness
    if thickness is None:
        thickness = _own_thickness(named, system, notes)
    return Plies(replace(laminate, ply_thickness=thickness), thickness, ply, named, system)


def _known(ply: object) -> object:
    """A ply; the named one of a name."""
    if not isinstance(ply, str):
        return ply
    if ply not in MATERIALS:
        raise ObjectError(f"{ply!r} is not a named ply: {', '.join(MATERIALS)}")
    return MATERIALS[ply]


def _own_thickness(named: NamedPly | None, system: str | None, notes: list[str]) -> float:
    """Thickness of a named ply."""
    own = None if named is None or system is None else named.value("thickness", system)
    if named is None or system is None or own is None:
        unknown = f": that of {named.name} is not known" if named else ""
        raise ObjectError(f"`ply_thickness` is missing{unknown}")
    unit = SYSTEMS[system]["length"]
    notes.append(f"the plies are {own:g} {unit} thick, as {named.name} is listed")
    return own


def toughness(giic: float | None) -> list[Segment]:
    """DELA segment of a given toughness."""
    return [] if giic is None else [Delamination(toughness=giic)]


def damages(plies: Plies, giic: float | None, notes: list[str]) -> list[Segment]:
    """Strengths and toughness of a named ply; notes what it does not have."""
    named, system = plies.named, plies.system
    if named is None or system is None:
        raise ObjectError("`damage` needs a named ply with strengths or toughness")
    missing: list[str] = []
    strengths = named.allowables(system)
    if strengths is None:
        lacks = " and ".join(key for key in catalogue.STRENGTHS if key not in named.values)
        missing.append(
            f"no {lacks}, so no failure exposures (ALLO, FAIL); a file of your own plies may have "
            "them (fecm new --materials)"
        )
    delamination = named.delamination(system) if giic is None else Delamination(giic)
    if delamination is None:
        missing.append("no GIIc, so no delamination threshold (DELA); `giic` gives it")
    if strengths is None and delamination is None:
        raise ObjectError(f"`damage`: {named.name} has {'; '.join(missing)}")
    notes += [f"{named.name} has {text}" for text in missing]
    return [segment for segment in (strengths, delamination) if segment is not None]


def cured(plies: Plies, cure: float | str | None) -> Cure | None:
    """CURE segment of a named ply for a change of temperature, or for ``"177:20"``."""
    if cure is None:
        return None
    named = plies.named
    if named is None or (expansion := named.expansion) is None:
        lacks = f"{named.name} has no" if named else "it needs a named ply with"
        raise ObjectError(
            f"`cure`: {lacks} alpha1 and alpha2; a file of your own plies may have them (fecm new "
            "--materials)"
        )
    return Cure(delta_t=_cooling(cure, named), expansions=(expansion,))


def _cooling(cure: float | str, named: NamedPly) -> float:
    """Temperature of use minus stress-free temperature, K."""
    before, colon, after = str(cure).rpartition(":")
    own = named.values.get("stress_free_temperature")
    if colon and not before.strip():
        if own is None:
            raise ObjectError(
                f"`cure` is {cure!r}: the stress-free temperature of {named.name} is not known"
            )
        before = str(own)
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
