"""Options that describe a laminate, for ``fecm new`` and ``fecm waves``."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NoReturn, TypeVar

import click
from click import option

from fecm.authoring.laminate import Laminate as AuthoredLaminate
from fecm.authoring.parameters import ObjectError, parameter_in_units
from fecm.cli.options import (
    POSITIVE,
    SYSTEM,
    Decorated,
    Finite,
    Parsed,
    collected,
    file_of,
    list_of,
    stack_options,
)
from fecm.deck.catalogue import MATERIALS, STANDARD, NamedPly, read_plies
from fecm.deck.layup import LayupPly, parse_plies
from fecm.deck.model import Ply

T = TypeVar("T")

_META = "fecm.plies"  # key of the plies of --materials among the values of a context

PLIES = file_of(read_plies)
LETTER = "[A-Z]"  # name of a material in a layup
CORE = "K"  # letter of a core that has no other


@dataclass(frozen=True)
class LaminateOptions:
    """Layup and plies; values by the letter of a material, empty for plies without a letter."""

    layup: Sequence[LayupPly] | None
    ply_thickness: dict[str, float | str] | None
    ply: Sequence[float] | None  # constants
    material: dict[str, NamedPly] | None
    units: str | None  # system to which a named ply is converted

    def one_ply(self) -> Ply | NamedPly:
        """Return the ply of one of the two options, for a layup without letters."""
        if self.ply is not None and self.named is None:
            return Ply(*self.ply)
        if self.ply is not None or self.named is None:
            raise click.UsageError("give either --ply or --material")
        return self.named

    @property
    def named(self) -> NamedPly | None:
        """Named ply of a layup without letters."""
        return (self.material or {}).get("")

    @property
    def thickness(self) -> float | None:
        """Thickness of a ply of a layup without letters, in the units of the laminate."""
        system = self.units or (None if self.named is None else self.named.system)
        thickness = (self.ply_thickness or {}).get("")
        try:
            return parameter_in_units("ply_thickness", thickness, "length", system)
        except ObjectError as error:
            raise click.UsageError(as_options(str(error), vars(self))) from None

    @property
    def angles(self) -> list[float]:
        """Angles of a layup of one material, degrees."""
        plies = self.layup or ()
        if letter := next((ply.name for ply in plies if ply.name), ""):
            raise click.UsageError(
                f"the layup has the material {letter}; this command takes one material: `fecm new` "
                "writes a deck of several"
            )
        return [ply.angle for ply in plies]

    def constants(self) -> Ply:
        """Return the constants of the ply; a named ply is converted to the units."""
        chosen = self.one_ply()
        return chosen if isinstance(chosen, Ply) else chosen.converted(self.units or chosen.system)

    def authored(
        self, plies: Mapping[str, Ply], cores: Sequence[tuple[str, float]]
    ) -> AuthoredLaminate:
        """Return a laminate of one or several materials.

        `plies` has constants by name. `cores` has names and thicknesses of a letter, or of a
        material that has the letter :data:`CORE`.
        """
        materials: dict[str, Ply | NamedPly] = {**(self.material or {}), **plies}
        if self.ply is not None or not materials:
            materials[""] = self.one_ply()
        thicknesses = dict(self.ply_thickness or {})
        default = thicknesses.get("")
        plies_by_name = MATERIALS | click.get_current_context().meta[_META] | materials
        for name, thickness in cores:
            letter = name if re.fullmatch(LETTER, name) else CORE
            if letter != name and letter in materials:
                raise click.UsageError(f"--core {name}: {CORE} is another material already")
            materials[letter] = (
                plies_by_name[name] if name in plies_by_name else _unknown(name, plies_by_name)
            )
            thicknesses[letter] = thickness
        used = {ply.name for ply in self.layup or ()}
        if default is not None:
            thicknesses = dict.fromkeys(materials, default) | thicknesses
        if set(materials) == {""} and not any(used):
            return AuthoredLaminate(self.angles, materials[""], default)
        return AuthoredLaminate(self.layup or (), materials, thicknesses)


def as_options(message: str, options: Collection[str]) -> str:
    """Return a message with options in place of the parameters that it quotes."""
    names = "|".join(options)
    name = {"edges": "edge", "zones": "zone", "masses": "mass-at"}
    return re.sub(f"`({names})`", lambda m: "--" + name.get(m[1], m[1]).replace("_", "-"), message)


def laminate_options(
    *, required: bool, thickness_required: bool = False
) -> Callable[[Decorated], Decorated]:
    """Add the options of a laminate, which the command receives as `laminate`."""
    default = "" if thickness_required else "  [default: from the named ply]"
    return stack_options(
        option(
            "--layup",
            type=Parsed(parse_plies, "LAYUP"),
            required=required,
            help='Layup from the struck face, as in "[0/45/0/-45/0]2s"; with letters of materials '
            'in `fecm new`, as in "[0C/90G]s".',
        ),
        option(
            "--ply-thickness",
            type=Parsed(_thickness, "[LETTER=]T"),
            multiple=True,
            callback=_by_letter,
            required=thickness_required,
            help=f"Thickness of a ply, also with a unit, and also of one material.{default}",
        ),
        option(
            "--ply",
            type=list_of("RHO,NU12,E1,E2,G12,G13,G23", Finite(), [7]),
            help="Density and moduli of a ply.",
        ),
        option(
            "--material",
            callback=_named,
            type=Parsed(str, "[LETTER=]NAME", MATERIALS),
            multiple=True,
            help="Named ply, instead of --ply; `fecm materials` lists them.  With a letter, as in "
            "C=IM7/8552, it is for the plies with this letter in the layup.",
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
            type=SYSTEM,
            help="Names the units, and converts a named ply to them: in-lbf-s, mm-N-s, mm-ms-kg or "
            "any others of length, time, and force or mass.  [default for a named ply: its "
            "source's]",
        ),
        collected(LaminateOptions, "laminate"),
    )


def _lettered(text: str) -> tuple[str, str]:
    """Return letter and value of ``C=VALUE``; the letter is empty without one."""
    letter, equals, value = (part.strip() for part in text.partition("="))
    return (letter, value) if equals and re.fullmatch(LETTER, letter) else ("", text)


def _thickness(text: str) -> tuple[str, float | str]:
    """Parse a thickness, perhaps with a letter; ``0.131mm`` stays a text."""
    letter, value = _lettered(text)
    try:
        return letter, float(POSITIVE.convert(value, None, None))
    except click.BadParameter:
        with suppress(ObjectError):
            if (parameter_in_units("ply_thickness", value, "length", STANDARD) or 0.0) > 0.0:
                return letter, value
        raise


def _by_letter(
    context: click.Context, parameter: click.Parameter, pairs: Iterable[tuple[str, float | str]]
) -> dict[str, float | str] | None:
    """Collect the values by letter; None without values."""
    return unique(pairs, context, parameter) or None


def unique(
    pairs: Iterable[tuple[str, T]], context: click.Context, parameter: click.Parameter
) -> dict[str, T]:
    """Return values by name; each name may occur once."""
    by_name: dict[str, T] = {}
    for name, value in pairs:
        if name in by_name:
            message = f"{name} is given twice" if name else "give it once, or with letters"
            raise click.BadParameter(message, context, parameter)
        by_name[name] = value
    return by_name


def _named(
    context: click.Context, parameter: click.Parameter, names: Sequence[str]
) -> dict[str, NamedPly] | None:
    """Collect the plies of --material by letter; None without plies."""
    plies: dict[str, NamedPly] = MATERIALS | context.meta[_META]
    pairs = [("", name) if name in plies else _lettered(name) for name in names]
    plies_by_letter = {
        letter: plies[name] if name in plies else _unknown(name, plies, context, parameter)
        for letter, name in unique(pairs, context, parameter).items()
    }
    return plies_by_letter or None


def _unknown(
    name: str,
    plies: Iterable[str],
    context: click.Context | None = None,
    parameter: click.Parameter | None = None,
) -> NoReturn:
    """Refuse a name that no ply has."""
    near = ", ".join(difflib.get_close_matches(name, filter(None, plies), cutoff=0.4))
    hint = f"did you mean {near}?" if near else "`fecm materials` lists them"
    raise click.BadParameter(f"{name!r} is not a named ply; {hint}", context, parameter)
