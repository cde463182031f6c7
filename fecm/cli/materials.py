"""``fecm materials``."""

from __future__ import annotations

import click

from fecm.cli.common import echo, echo_json
from fecm.cli.laminate_options import PLIES
from fecm.cli.options import FORMAT_OPTION, SYSTEM, Format, typical
from fecm.deck.catalogue import EXPANSIONS, STRENGTHS, NamedPly
from fecm.deck.catalogue import materials as named_plies

# Constants of a named ply, as `fecm materials` lists them.
LINES = (
    ("E1", "E2", "nu12", "nu23", "G12", "G13", "G23", "density", "thickness"),
    (*STRENGTHS, "S13", "S23"),
    ("GIc", "GIIc"),
    (*EXPANSIONS, "stress_free_temperature"),
)


@click.command(
    "materials",
    epilog=typical(
        "fecm materials own-plies.toml",
        "fecm materials --units mm-ms-kg --format json",
    ),
)
@click.argument("plies", type=PLIES, metavar="[FILE.toml]", required=False)
@click.option(
    "--units", type=SYSTEM, help="Units of the constants.  [default: from each ply's source]"
)
@FORMAT_OPTION
def materials_command(plies: dict[str, NamedPly] | None, units: str | None, form: Format) -> None:
    """List the named plies of `fecm new`, or of a file, with their sources.

    With --format json, each ply is a JSON object on a line, null where a constant is not known.
    """
    for material in (plies or named_plies()).values():
        system = units or material.system
        if form is Format.JSON:
            echo_json(material.to_dict(system))
            continue
        echo(f"{material.name} ({system})")
        values = material.constants(system)
        for keys in LINES:
            if line := ", ".join(f"{key} {values[key]:g}" for key in keys if key in values):
                echo(f"  {line}")
        texts = "; ".join(filter(None, (material.source, material.assumed)))
        echo(f"  {texts or '(no source)'}")
