"""Indentation laws and contact patches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fecm.authoring.laminate import DeckPlies
from fecm.authoring.parameters import ObjectError, check_numbers, check_positive, parameter_in_units
from fecm.authoring.plate import DropWeight
from fecm.deck.catalogue import (
    CONTACTS,
    STANDARD,
    STEEL_MODULUS,
    STEEL_POISSON,
    NamedContact,
)
from fecm.deck.model import Indentation, Layer, Patch
from fecm.deck.units import MODULUS, convert, in_si, units_of
from fecm.mechanics.contact_law import hertz_coefficient
from fecm.mechanics.half_space import effective_stiffness, indentation_modulus
from fecm.mechanics.laminate import are_cores
from fecm.mechanics.points import DISC, HERTZ
from fecm.problem.rules.units import USED, likely_unit, needed_unit

# Moduli of spheres, Pa. A modulus outside the first range is doubted. The second range has metals
# and ceramics.
SOFTEST, HARDEST = 1e9, 2e12
SOLID = (5e10, 1e12)
STEEL_IN_SI = 2e11
ELASTIC_POWER = 1.5  # power of unloading of an elastic law, the same as of loading
SOFT_TIP = 0.3  # modulus of a tip over E2; a tip below this ratio is soft, and its contact wide
# Shapes of the contact patch.
PATCHES = {"disc": DISC, "hertz": HERTZ}


@dataclass(frozen=True)
class Sphere:
    """Elastic contact of a sphere; k is estimated from the constants of the plies."""

    radius: float | str | None = None  # length; None for the radius of a standard
    # Elastic constants; None for steel.
    modulus: float | str | None = None
    poisson: float | None = None

    def __repr__(self) -> str:
        values = ("radius", self.radius), ("modulus", self.modulus), ("poisson", self.poisson)
        shown = ", ".join(f"{name}={value!r}" for name, value in values if value is not None)
        return f"Contact.estimate({shown})"

    def radius_in(self, system: str | None) -> float | None:
        """Return the radius in a system of units; raise ObjectError if its unit needs a system."""
        return parameter_in_units("radius", self.radius, "length", system)

    def modulus_in(self, system: str | None) -> float | None:
        """Return the modulus in a system of units; raise ObjectError if its unit needs a system."""
        return parameter_in_units("modulus", self.modulus, MODULUS, system)

    def law(self, plies: DeckPlies, layers: Sequence[Layer]) -> tuple[Indentation, str]:
        """Return the contact law on layers, and comment lines that explain the estimate of k."""
        radius, modulus = self.radius_in(plies.system), self.modulus_in(plies.system)
        if radius is None:
            raise ObjectError("the `contact` estimate needs the sphere's radius")
        if modulus is None and plies.system is None:
            raise ObjectError(
                "the `contact` estimate with constants of a `ply` needs `units`, or the sphere's "
                "elastic constants"
            )
        if modulus is None:
            modulus = convert(STEEL_MODULUS, MODULUS, STANDARD, plies.system or STANDARD)
        poisson = STEEL_POISSON if self.poisson is None else self.poisson
        materials = [plies.of(layer) for layer in layers]
        try:
            stiffness = effective_stiffness(
                [material.ply for material in materials],
                [layer.angle for layer in layers],
                [layer.thickness for layer in layers],
                [material.nu23 for material in materials],
            )
            effective = indentation_modulus(stiffness)
            k = float(f"{hertz_coefficient(radius, modulus, poisson, effective):.6g}")
        except (ValueError, ArithmeticError) as error:
            raise ObjectError(f"k cannot be estimated: {error}; give a law") from None
        ratios = " and ".join(dict.fromkeys(f"{material.nu23:g}" for material in materials))
        return Indentation(k, 0.0, 0.0, ELASTIC_POWER), (
            "! k of EXPE is estimated by the laminate's indentation modulus "
            f"{effective:.5g}: a sphere of radius {radius:g},\n"
            f"! E {modulus:g} and nu {poisson:g}; nu23 of the ply {ratios}.  "
            "A measured k may be larger; the law is elastic.\n"
        )


def doubts_of_sphere(sphere: Sphere, system: str | None, test: DropWeight | None) -> list[str]:
    """Return doubts about a modulus in another unit, and a diameter instead of the radius."""
    doubts: list[str] = []
    names = units_of(system) if system else {}
    size, modulus = in_si(MODULUS, names), sphere.modulus_in(system)
    radius = sphere.radius_in(system)
    if modulus is not None and size is not None and not SOFTEST <= modulus * size <= HARDEST:
        unit = likely_unit(modulus, MODULUS, STEEL_IN_SI)
        least, greatest = SOLID
        if unit and least <= modulus * USED[MODULUS][unit] <= greatest:
            doubts.append(
                f"the sphere's modulus {modulus:g} in the `contact` estimate looks like {unit}; "
                f"{needed_unit(MODULUS, names)}"
            )
    if test is not None and radius == 2.0 * test.radius:
        doubts.append(
            f"the `contact` estimate takes the sphere's radius; {radius:g} is the diameter "
            f"of the standard's indenter, whose radius is {test.radius:g}"
        )
    return doubts


def doubts_of_soft_tip(
    sphere: Sphere, system: str | None, radius: float, k: float, energy: float, modulus: float
) -> list[str]:
    """Return a doubt about the patch if the sphere is far softer than the plies.

    The contact circle has the radius (R alpha)^(1/2). The indentation alpha is largest if the plate
    is rigid. It then follows from the energy (2/5) k alpha^(5/2).
    """
    tip, softness = sphere.radius_in(system), sphere.modulus_in(system)
    if tip is None or softness is None or softness > SOFT_TIP * modulus:
        return []
    circle = math.sqrt(tip * (2.5 * energy / k) ** 0.4)
    if circle < 2.0 * radius:
        return []
    return [
        f"the tip is soft: its contact circle has a radius of up to {circle:.2g}, and the patch "
        f"one of {radius:.3g}; `patch` disc:RADIUS sets another radius; stresses depend on it"
    ]


@dataclass(frozen=True)
class Contact(Indentation):
    """Measured indentation law in the units of the deck.

    :meth:`named` returns a published law, :meth:`estimate` an estimated one. With `k` only, the law
    is elastic: the force is k α^1.5 in loading and unloading.

    Parameters
    ----------
    k : float
        Contact coefficient, force/length^1.5.
    alpha_p : float, optional
        Critical indentation (length). Beyond it an indentation remains.
    s_p : float, optional
        Slope of the permanent over the maximum indentation.
    q : float, optional
        Power of the unloading curve.

    Examples
    --------
    >>> import fecm
    >>> fecm.Contact(1.912e6, 6.564e-4, 0.094, 2.0).k
    1912000.0
    """

    alpha_p: float = 0.0
    s_p: float = 0.0
    q: float = ELASTIC_POWER

    def __post_init__(self) -> None:
        check_numbers(k=self.k, alpha_p=self.alpha_p, s_p=self.s_p, q=self.q)

    @staticmethod
    def named(name: str) -> NamedContact:
        """Return a published law from the list of `fecm indent contacts`.

        A deck has the law in its own units.

        Raises
        ------
        ValueError
            If the name is unknown.
        """
        if name not in CONTACTS:
            raise ObjectError(f"{name!r} is not a named contact: {', '.join(CONTACTS)}")
        return CONTACTS[name]

    @staticmethod
    def estimate(
        radius: float | str | None = None,
        modulus: float | str | None = None,
        poisson: float | None = None,
    ) -> Sphere:
        """Return the elastic law of a sphere on the laminate, as `fecm indent estimate` does.

        Parameters
        ----------
        radius : float or str, optional
            Length, in the deck's units or with a unit, as in ``"8mm"``; by default the radius that
            the standard of a fixture prescribes.
        modulus : float or str, optional
            Young's modulus of the sphere, also with a unit, as in ``"207GPa"``; by default steel.
        poisson : float, optional
            Poisson's ratio of the sphere; by default steel.

        Examples
        --------
        >>> import fecm
        >>> fecm.Contact.estimate(radius=8)
        Contact.estimate(radius=8)
        """
        check_numbers(poisson=poisson)
        sphere = Sphere(radius, modulus, poisson)
        # In any system: the texts are checked.
        check_positive(radius=sphere.radius_in(STANDARD), modulus=sphere.modulus_in(STANDARD))
        return sphere


def parse_patch(text: str, system: str | None) -> Patch | None:
    """Parse a contact patch ``disc``, ``hertz``, ``disc:RADIUS`` or ``hertz:RADIUS``.

    Returns None for ``none``, a point force. A radius with a unit is converted to a system of
    units. Raises ObjectError for any other text, or if the unit needs a system.
    """
    shape, colon, radius_text = text.partition(":")
    if text == "none":
        return None
    if shape not in PATCHES:
        raise ObjectError(
            f"`patch` is {text!r}, not none, disc, hertz, disc:RADIUS or hertz:RADIUS"
        )
    radius = parameter_in_units("patch", radius_text, "length", system) if colon else None
    check_positive(patch=radius)
    return Patch(PATCHES[shape], radius)


AnyContact = Indentation | NamedContact | Sphere | str


def indentation_law(
    contact: AnyContact | None, plies: DeckPlies, layers: Sequence[Layer]
) -> tuple[Indentation, str]:
    """Return the contact law in the units of the deck, and comment lines about an estimate."""
    match contact:
        case str():
            return indentation_law(Contact.named(contact), plies, layers)
        case Indentation():
            return Indentation(*contact.values(), contact.word), ""
        case Sphere():
            return contact.law(plies, layers)
        case NamedContact():
            if plies.system is None:
                raise ObjectError(
                    "a named `contact` with constants of a `ply` needs the `units` of the constants"
                )
            return contact.converted(plies.system), ""
        case None:
            raise ObjectError(f"give `contact`, a law or one of {', '.join(CONTACTS)}")


def is_sandwich(plies: DeckPlies, layers: Sequence[Layer]) -> bool:
    """Return whether a layer is the core of a sandwich: it is very soft in shear."""
    return any(are_cores([plies.of(layer).ply for layer in layers]))


def doubts_of_core(plies: DeckPlies, layers: Sequence[Layer]) -> list[str]:
    """Return a doubt about an estimated k of a sandwich."""
    if not is_sandwich(plies, layers):
        return []
    return [
        "k is estimated of a sandwich, as if its core were spread over the thickness; its face "
        "indents into the core, and the core is crushed: measure the law (`law`)"
    ]
