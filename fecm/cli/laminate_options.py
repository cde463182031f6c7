"""Options that describe a laminate, of ``fecm new`` and ``fecm waves``."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import click

from fecm.cli.types import POSITIVE, Finite, ListOf, Parsed
from fecm.deck.catalogue import MATERIALS, SYSTEMS
from fecm.deck.findings import Findings
from fecm.deck.layup import parse_layup
from fecm.deck.model import Material
from fecm.deck.records import Integration, Layer, Ply
from fecm.mechanics.laminate import Laminate
from fecm.problem.build import laminate_of
from fecm.problem.check_material import check_material

Decorated = Callable[..., None]


def laminate_options(*, required: bool) -> Callable[[Decorated], Decorated]:
    """Add ``--layup``, ``--ply-thickness``, ``--ply``, ``--material`` and ``--units``."""
    options = (
        click.option("--layup", type=Parsed(parse_layup), required=required, metavar="LAYUP",
                     help='Layup from the struck face, as in "[0/45/0/-45/0]2s".'),
        click.option("--ply-thickness", type=POSITIVE, required=required, metavar="T",
                     help="Thickness of a ply."),
        click.option("--ply", type=ListOf("RHO,NU12,E1,E2,G12,G13,G23", Finite(), [7]),
                     metavar="RHO,NU12,E1,E2,G12,G13,G23", help="Density and moduli of a ply."),
        click.option("--material", type=click.Choice(list(MATERIALS)), metavar="NAME",
                     help="Named ply, instead of --ply; `fecm materials` lists them."),
        click.option("--units", type=click.Choice(list(SYSTEMS)), metavar="SYSTEM",
                     help="in-lbf-s, m-N-s or mm-N-s: names the units, and converts a named ply "
                          "to them.  [default for a named ply: its source's]"),
    )  # fmt: skip

    def decorate(function: Decorated) -> Decorated:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


def ply_of_options(ply: Sequence[float] | None, material: str | None, units: str | None) -> Ply:
    """Constants of the ply; of a named one in the units."""
    if (ply is None) == (material is None):
        raise click.UsageError("give either --ply or --material")
    if ply is not None:
        return Ply(*ply)
    named = MATERIALS[material or ""]
    return named.converted(units or named.system)


def laminate_of_options(
    layup: Sequence[float],
    ply_thickness: float | None,
    ply: Sequence[float] | None,
    material: str | None,
    units: str | None,
) -> tuple[Laminate, dict[str, str]]:
    """Laminate of these options, checked as in a deck, and the names of its units."""
    if ply_thickness is None:
        raise click.UsageError("--layup needs --ply-thickness")
    constants = ply_of_options(ply, material, units)
    layers = tuple(Layer(n, angle, ply_thickness) for n, angle in enumerate(layup, start=1))
    segment = Material(Integration(3, 3, -3, ply_thickness * len(layers)), constants, layers)
    findings = Findings()
    check_material(segment, findings)
    if findings.errors:
        raise click.UsageError(findings.errors[0].message)
    return laminate_of(segment), {} if units is None else SYSTEMS[units]
