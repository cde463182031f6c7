"""Options that describe a laminate, of ``fecm new`` and ``fecm waves``."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence

import click
from click import option

from fecm._frozen import frozen
from fecm.cli.options import (
    POSITIVE,
    Decorated,
    Finite,
    Parsed,
    collected,
    file_of,
    list_of,
    stacked,
)
from fecm.deck.catalogue import MATERIALS, SYSTEMS, NamedPly, read_plies
from fecm.deck.findings import Findings
from fecm.deck.layup import parse_layup
from fecm.deck.model import Integration, Layer, Material, Ply
from fecm.mechanics.laminate import Laminate
from fecm.problem.check import check_segment
from fecm.problem.parts import laminate_of

_META = "fecm.plies"  # key of the plies of --materials among the values of a context

PLIES = file_of(read_plies)


@frozen
class LaminateOptions:
    """Layup and ply."""

    layup: Sequence[float] | None  # angles, degrees
    ply_thickness: float | None
    ply: Sequence[float] | None  # constants
    material: NamedPly | None
    units: str | None  # system to which a named ply is converted

    def one_ply(self) -> Ply | NamedPly:
        """The ply of one of the two options."""
        if self.ply is not None and self.material is None:
            return Ply(*self.ply)
        if self.ply is not None or self.material is None:
            raise click.UsageError("give either --ply or --material")
        return self.material

    def constants(self) -> Ply:
        """Constants of the ply; of a named one in the units."""
        chosen = self.one_ply()
        return chosen if isinstance(chosen, Ply) else chosen.converted(self.units or chosen.system)

    def laminate(self) -> tuple[Laminate, dict[str, str]]:
        """Laminate, checked as in a deck, and the names of its units."""
        thickness, material = self.ply_thickness, self.material
        if thickness is None and material is not None:
            thickness = material.value("thickness", self.units or material.system)
        if thickness is None:
            raise click.UsageError("--layup needs --ply-thickness")
        angles = self.layup or ()
        layers = tuple(Layer(n, angle, thickness) for n, angle in enumerate(angles, start=1))
        integration = Integration(3, 3, -3, thickness * len(layers))
        segment = Material(integration, self.constants(), layers)
        findings = Findings()
        check_segment(segment, findings)
        if findings.errors:
            raise click.UsageError(findings.errors[0].message)
        return laminate_of(segment), {} if self.units is None else SYSTEMS[self.units]


def laminate_options(
    *, required: bool, thickness_required: bool = False
) -> Callable[[Decorated], Decorated]:
    """Add the options of a laminate, whose object is the parameter `laminate`."""
    own = "" if thickness_required else "  [default: that of a named ply]"
    return stacked(
        option(
            "--layup",
            type=Parsed(parse_layup, "LAYUP"),
            required=required,
            help='Layup from the struck face, as in "[0/45/0/-45/0]2s".',
        ),
        option(
            "--ply-thickness",
            type=POSITIVE,
            required=thickness_required,
            metavar="T",
            help=f"Thickness of a ply.{own}",
        ),
        option(
            "--ply",
            type=list_of("RHO,NU12,E1,E2,G12,G13,G23", Finite(), [7]),
            help="Density and moduli of a ply.",
        ),
        option(
            "--material",
            callback=_named,
            type=Parsed(str, "NAME", MATERIALS),
            help="Named ply, instead of --ply; `fecm materials` lists them.",
        ),
        option(
            "--materials",
            "file",
            type=PLIES,
            is_eager=True,
            expose_value=False,
            callback=lambda context, _, plies: context.meta.update({_META: plies or {}}),
            help="Named plies of your own; `fecm materials FILE.toml` checks them.",
        ),
        option(
            "--units",
            type=click.Choice(list(SYSTEMS)),
            metavar="SYSTEM",
            help="in-lbf-s, m-N-s or mm-N-s: names the units, and converts a named ply to "
            "them.  [default for a named ply: its source's]",
        ),
        collected(LaminateOptions, "laminate"),
    )


def _named(context: click.Context, parameter: click.Parameter, name: str | None) -> NamedPly | None:
    """Callback of --material: the ply of a name."""
    plies: dict[str, NamedPly] = MATERIALS | context.meta[_META]
    if name is None or name in plies:
        return plies.get(name or "")
    near = ", ".join(difflib.get_close_matches(name, plies, cutoff=0.4))
    hint = f"did you mean {near}?" if near else "`fecm materials` lists them"
    raise click.BadParameter(f"{name!r} is not a named ply; {hint}", context, parameter)
