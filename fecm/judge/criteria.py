"""Names of failure criteria and modes, and of the plies or interfaces where they occur."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fecm.deck.model import Allowables, Deck
from fecm.mechanics.failure import CRITERIA, PlyExposure
from fecm.mechanics.laminate import are_cores

INTERLAMINAR = "interlaminar"  # criterion of the interfaces; the others belong to plies
ALL_CRITERIA = (*CRITERIA, INTERLAMINAR)
CORE_SHEAR = "shear of the core"  # mode of the interfaces of a sandwich's core
YIELD = "yield"  # mode of all criteria of plies in an isotropic material
# Largest relative difference of a shear modulus from E/(2 (1 + nu)) of an isotropic material, as
# moduli are measured: 2 % in a named metal and 25 % in a named foam; more than half in fabrics.
SHEAR_SHARE = 0.3


OWN_CRITERIA = "own_criteria"  # attribute of failure: names of users' criteria of the plies


def criteria_of(failure: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the criteria of a result, from the attributes of its group ``failure``."""
    user_criteria = failure.get(OWN_CRITERIA, ())
    return (
        *ALL_CRITERIA,
        *(map(str, user_criteria) if isinstance(user_criteria, list | tuple) else ()),
    )


def spelt(criterion: str) -> str:
    """Return the name of a criterion in words."""
    return criterion.replace("_", " ")


def where(criterion: str, ply: int, materials: Sequence[str] = ()) -> str:
    """Name a ply, or an interface for the interlaminar criterion.

    Examples
    --------
    >>> where("puck", 3), where("puck", 3, ["2024-T3"])
    ('ply 3', 'ply 3 (2024-T3)')
    >>> where("interlaminar", 3, ["2024-T3", "E-glass/MY750"])
    'interface of plies 3 (2024-T3) and 4 (E-glass/MY750)'
    """
    words = plies_in_words(criterion, ply, materials)
    return f"interface of {words}" if criterion == INTERLAMINAR else words


def plies_in_words(criterion: str, ply: int, materials: Sequence[str] = ()) -> str:
    """Name the ply, or the plies of the interface."""
    numbers = [ply, ply + 1] if criterion == INTERLAMINAR else [ply]
    names = [f" ({name})" for name in materials] or [""] * len(numbers)
    texts = [f"{number}{name}" for number, name in zip(numbers, names, strict=True)]
    return f"{'ply' if len(texts) == 1 else 'plies'} {' and '.join(texts)}"


def materials_at(deck: Deck, laminate: int, criterion: str, ply: int) -> tuple[str, ...]:
    """Name the materials of a ply, or of the plies of an interface, in a numbered laminate.

    The text is empty if all plies of the deck have the same material, or if the laminate has no
    such ply.
    """
    layers = deck.layers.get(laminate, ())
    count = 2 if criterion == INTERLAMINAR else 1
    numbers = [layer.material for layer in layers[ply - 1 : ply - 1 + count]]
    used = {layer.material for layers in deck.layers.values() for layer in layers}
    if len(used) < 2 or len(numbers) < count:
        return ()
    from fecm.deck.catalogue import material_names  # reads the catalogue, which few results need

    names = material_names(deck)
    return tuple(names.get(number, f"material {number}") for number in numbers)


def mode_at(deck: Deck, laminate: int, criterion: str, ply: int, mode: str) -> str:
    """Return the name of a mode in a ply of a numbered laminate.

    Isotropic materials have the mode :data:`YIELD`, interfaces of a core :data:`CORE_SHEAR`: face
    and core have the same shear stress, and the core is the weaker one.
    """
    layers = deck.layers.get(laminate, ())
    layer = next(iter(layers[ply - 1 : ply]), None)
    if criterion == INTERLAMINAR and layer is not None:
        is_core = are_cores([deck.plies[layer.material] for layer in layers])
        return CORE_SHEAR if any(is_core[ply - 1 : ply + 1]) else mode
    if criterion in CRITERIA and layer is not None and is_isotropic(deck, layer.material):
        return YIELD
    return mode


def exposed(deck: Deck, laminate: int, exposure: PlyExposure) -> str:
    """Return mode, criterion and ply of an exposure in a numbered laminate."""
    criterion, ply = exposure.criterion, exposure.ply
    mode = mode_at(deck, laminate, criterion, ply, exposure.mode)
    place = where(criterion, ply, materials_at(deck, laminate, criterion, ply))
    return failure_in_words(criterion, mode, place)


def failure_in_words(criterion: str, mode: str, where: str) -> str:
    """Name mode, criterion, and ply or interface.

    Examples
    --------
    >>> failure_in_words("tsai_wu", "interactive", "ply 3")
    'interactive (tsai wu), ply 3'
    """
    return f"{mode} ({spelt(criterion)}), {where}"


def yield_stress(deck: Deck, material: int) -> float:
    """Return the yield stress of an isotropic material: XT of ALLO, or of the catalogue.

    It is 0 for other materials, and where it is not known.
    """
    if not is_isotropic(deck, material):
        return 0.0
    card = deck.last(Allowables)
    if card is not None and (strengths := card.of(material)) is not None:
        return strengths.xt
    from fecm.deck.catalogue import named_ply, system_of  # reads the catalogue: 2 ms

    system = system_of(deck)
    named = named_ply(deck.plies[material], system)
    strengths = None if named is None or system is None else named.allowables(system)
    return 0.0 if strengths is None else strengths.xt


def is_isotropic(deck: Deck, material: int) -> bool:
    """Return whether a material has the same constants and strengths in all directions."""
    if (ply := deck.plies.get(material)) is None or ply.e1 != ply.e2:
        return False
    shear = ply.e1 / (2.0 * (1.0 + ply.nu12))
    if any(abs(modulus - shear) > SHEAR_SHARE * shear for modulus in (ply.g12, ply.g13, ply.g23)):
        return False
    card = deck.last(Allowables)
    strengths = None if card is None else card.of(material)
    return strengths is None or (strengths.xt, strengths.xc) == (strengths.yt, strengths.yc)
