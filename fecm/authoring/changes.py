"""Changes of a deck in Python: values, named as in sweeps, and parts as objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypedDict

from fecm.authoring.case import Case, CasesError, check_deck
from fecm.authoring.cases import checked
from fecm.authoring.parameters import in_units
from fecm.authoring.timing import clock_of, with_clock
from fecm.authoring.values import NAMES, apply_case, check_known, dimension_of
from fecm.deck.catalogue import system_of
from fecm.deck.model import Deck, Nonlinear
from fecm.deck.quantities import EXAMPLES, text_of

if TYPE_CHECKING:
    from fecm.authoring.contact import AnyContact
    from fecm.authoring.deck_options import AnyProjectile
    from fecm.authoring.laminate import Laminate
    from fecm.authoring.plate import Plate, Support

Number = float | str  # a number, or its text
OBJECTS = ("plate", "laminate", "projectile", "contact")
NONLINEAR = "nonlinear"


class Values(TypedDict, total=False):
    """Arguments of :meth:`fecm.Deck.with_`: parts as objects, and values named as in sweeps."""

    plate: Plate
    laminate: Laminate
    projectile: AnyProjectile
    contact: AnyContact
    nonlinear: bool
    velocity: Number
    energy: Number
    k: Number
    radius: Number
    alpha_p: Number
    s_p: Number
    q: Number
    mass: Number
    rod_mass: Number
    rod_length: Number
    rod_modulus: Number
    rod_density: Number
    at: str | Iterable[float]
    impact_node: int | str
    patch: Number
    x0: Number
    y0: Number
    laminate_thickness: Number
    ply_thickness: Number
    thickness: Number
    density: Number
    nu12: Number
    e1: Number
    e2: Number
    g12: Number
    g13: Number
    g23: Number
    layup: str | Iterable[float]
    layer_materials: str | Iterable[int]
    angle: Number
    preload_x: Number
    preload_y: Number
    preload_xy: Number
    radius_x: Number
    radius_y: Number
    giic: Number
    xt: Number
    xc: Number
    yt: Number
    yc: Number
    s12: Number
    s13: Number
    s23: Number
    cure_dT: Number
    size: str | Iterable[float]
    support: Support
    dt: Number
    duration: Number


def with_values(deck: Deck, values: Mapping[str, Any]) -> Deck:
    """Return a deck with other values and parts; see :meth:`fecm.Deck.with_`.

    Raises CasesError if a name is unknown or a value is invalid, and ObjectError if an object is.
    """
    for name in values:
        check_known(name, "with_", (*OBJECTS, NONLINEAR, *NAMES))
    if NONLINEAR in values:
        deck = _with_kinematics(deck, nonlinear=values[NONLINEAR])
    parts = {name: value for name, value in values.items() if name in OBJECTS}
    not_values = (*OBJECTS, NONLINEAR)
    numbers = _in_deck_units(deck, {n: value for n, value in values.items() if n not in not_values})
    (case,) = checked([numbers], "with_")
    objects = None
    if parts:
        from fecm.authoring.objects import Objects  # takes 30 ms; values do not need it

        objects = Objects(**parts)
        objects.check()
    try:
        changed = apply_case(deck, case, objects)
    except LookupError as error:  # the deck lacks the segment of a value
        raise CasesError(f"with_: {error}") from None
    is_new = "plate" in parts or "laminate" in parts
    return _update_time_step(deck, changed, case) if is_new and "dt" not in case else changed


def _in_deck_units(deck: Deck, values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert texts with a unit, as in ``10J``, to the units of the deck."""
    system = system_of(deck)
    return {
        name: in_units(name, value, dimension_of(name), system)
        if system and dimension_of(name) in EXAMPLES and _is_single(value)
        else value
        for name, value in values.items()
    }


def _is_single(value: object) -> bool:
    """Return whether a value is a number or a text with one; "auto" and several values are not."""
    text = text_of(value)
    return text != "auto" if isinstance(text, str) else not isinstance(text, Iterable)


def _with_kinematics(deck: Deck, *, nonlinear: object) -> Deck:
    """Return the deck without NONL if `nonlinear` is False; it must have NONL if True."""
    if not isinstance(nonlinear, bool):
        raise CasesError(f"with_: nonlinear is {nonlinear!r}, not True or False")
    if nonlinear and not deck.has(Nonlinear):
        raise CasesError(
            "with_: the deck has no NONL, and its supports may not suit it; make the nonlinear "
            'deck with fecm.impact(kinematics="von-karman"), and take NONL out with nonlinear=False'
        )
    if nonlinear:
        return deck
    kept = tuple(segment for segment in deck.segments if not isinstance(segment, Nonlinear))
    return replace(deck, segments=kept, text="")


def _update_time_step(deck: Deck, changed: Deck, case: Case) -> Deck:
    """Give the changed deck the time step of its plate, if the old time step follows a rule."""
    with suppress(CasesError):  # a run of either deck reports its errors
        if (clock := clock_of(check_deck(deck))) is not None:
            return with_clock(changed, clock, case).deck
    return changed
