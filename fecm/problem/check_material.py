"""Checks of MATE: quadrature, ply constants, layers."""

from __future__ import annotations

from fecm.deck.findings import Findings
from fecm.deck.model import Allowables, Damping, Delamination, Material
from fecm.deck.records import Integration, Ply
from fecm.mechanics.elements.quadrature import HIGHEST_ORDER

THICKNESS_TOLERANCE = 1.0e-6


def check_material(material: Material, findings: Findings) -> None:
    """Check a MATE segment."""
    _check_orders(material.integration, findings)
    _check_ply(material.ply, findings)
    _check_layers(material, findings)


def check_allowables(card: Allowables, findings: Findings) -> None:
    """Check an ALLO segment."""
    for name, value in zip(("XT", "XC", "YT", "YC", "S12", "S13", "S23"), card.row(), strict=False):
        if isinstance(value, str) or not value > 0.0:
            hint = "compressive strengths are positive on this card" if name in ("XC", "YC") else ""
            findings.add(
                "E455", f"The strength {name} is {value:g}; it must be positive.",
                card.place(name), hint,
            )  # fmt: skip
    for name, value in (("p+", card.p_plus), ("p-", card.p_minus)):
        if not 0.0 < value < 1.0:
            findings.add(
                "E456", f"Puck's slope {name} is {value:g}; it must be between 0 and 1.",
                card.place(), "a blank takes 0.35 for p+ and 0.3 for p-",
            )  # fmt: skip
    if not abs(card.f12) < 1.0:
        findings.add(
            "E456", f"F12* is {card.f12:g}; it must be between -1 and 1.", card.place(),
            "a blank takes -0.5",
        )  # fmt: skip


def check_delamination(card: Delamination, findings: Findings) -> None:
    """Check a DELA segment."""
    if not card.toughness > 0.0:
        findings.add(
            "E457", f"G_IIc is {card.toughness:g}; it must be positive.", card.place("G_IIc")
        )
    if not (card.number >= 1.0 and card.number.is_integer()):
        findings.add(
            "E457",
            f"The number of delaminations is {card.number:g}; it must be a whole number from 1.",
            card.place("number of delaminations"),
        )


def check_damping(card: Damping, findings: Findings) -> None:
    """Check a DAMP segment."""
    if not card.coefficient >= 0.0:
        findings.add(
            "E459", f"The damping a is {card.coefficient:g}; it must not be negative.",
            card.place("a"), "the amplitude of a free plate decays as exp(-a t/2)",
        )  # fmt: skip


def _check_orders(card: Integration, findings: Findings) -> None:
    for name, order in (("bending order L1", card.bending), ("shear order L2", card.shear)):
        if not 1 <= order <= HIGHEST_ORDER:
            used = min(HIGHEST_ORDER, max(1, order))
            findings.add(
                "W401", f"The {name} is {order} ; {used} is used instead.", card.place(name)
            )
    if not 1 <= abs(card.points) <= HIGHEST_ORDER:
        findings.add(
            "E402",
            f"The stress-point order K is {card.points}; it must be 1 to 4 (Gauss points) or "
            "-1 to -4 (nodal points).",
            card.place("stress-point order K"),
        )


def _check_ply(ply: Ply, findings: Findings) -> None:
    valid = True
    for name, value in (
        ("mass density", ply.density),
        ("Young's modulus E1", ply.e1),
        ("Young's modulus E2", ply.e2),
        ("shear modulus G12", ply.g12),
        ("shear modulus G13", ply.g13),
        ("shear modulus G23", ply.g23),
    ):
        if value <= 0.0:
            valid = False
            findings.add("E403", f"The {name} is {value:g}; it must be positive.", ply.place(name))
    # The square of nu12 against E1/E2, written so that no number overflows.
    if valid and abs(ply.nu12) >= (ply.e1 / ply.e2) ** 0.5:
        findings.add(
            "E404",
            f"Poisson's ratio NU12 = {ply.nu12:g} is too large: its square must stay below "
            f"E1/E2 = {ply.e1 / ply.e2:g}.",
            ply.place("Poisson's ratio NU12"),
        )


def _check_layers(material: Material, findings: Findings) -> None:
    thick = True
    for position, layer in enumerate(material.layers, start=1):
        if layer.thickness <= 0.0:
            thick = False
            findings.add(
                "E405",
                f"Layer {position} has the thickness {layer.thickness:g}; it must be positive.",
                layer.place("layer thickness"),
            )
        if layer.number != position:
            findings.add(
                "W408",
                f"Layer {position} has the number {layer.number}: layers are stacked in the order "
                "of their cards, whatever their numbers.",
                layer.place("layer"),
            )
    total = sum(layer.thickness for layer in material.layers)
    given = material.integration.thickness
    place = material.integration.place("total thickness")
    if given <= 0.0:
        findings.add("E406", f"The total thickness is {given:g}; it must be positive.", place)
    elif thick and abs(total - given) > THICKNESS_TOLERANCE * given:
        findings.add(
            "E407",
            f"The layers are {total:g} thick together, the MATE card says {given:g}.",
            place,
            "stiffness follows the layers, inertia the card: they must agree",
        )
