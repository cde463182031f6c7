"""``fecm indent``: indentation tests, and the law that follows from them."""

from __future__ import annotations

import json
import math
from pathlib import Path

import click

from fecm.cli.common import DECK_PATH, FORMAT_OPTION, RefusedError
from fecm.cli.indent_curve import curve
from fecm.cli.outputs import OVERWRITE, PLOT, STANDARD_OUTPUT, OutputPaths
from fecm.cli.types import POSITIVE, Finite
from fecm.deck.catalogue import CONTACTS
from fecm.deck.model import Indentation
from fecm.mechanics.contact_law import hertz_coefficient
from fecm.plot.kinds import Picture
from fecm.studies.indentation_test import LIMITS_Q
from fecm.studies.indentation_test.constants import fit as fitted
from fecm.studies.indentation_test.cycles import NoTestError
from fecm.studies.indentation_test.report import card, lines, notes, plain
from fecm.studies.indentation_test.table import Test, read_test
from fecm.studies.tables import TableError


@click.group(short_help="Indentation tests and the law of contact.")
def indent() -> None:
    """Indentation tests and the law of contact (the report's chapter 3)."""


indent.add_command(curve)


# fit ---------------------------------------------------------------------------------------------


@indent.command()
@click.argument("test", type=DECK_PATH, metavar="TEST.csv")
@click.option("--acr", is_flag=True,
              help="Find alpha_cr of the law with one unloading rigidity (q = 5/2) instead of s_p "
                   "and alpha_p.")  # fmt: skip
@click.option("--q", type=Finite(*LIMITS_Q), help="Unloading power, instead of finding it.")
@click.option("--turn", type=POSITIVE, metavar="LENGTH",
              help="How far the indentation goes back before a turn counts.  [default: 2 % of its "
                   "range, or 8 standard deviations of its noise]")  # fmt: skip
@click.option("--columns", metavar="INDENTATION,FORCE",
              help="Names or numbers (from 1) of the two columns.  [default: indentation, "
                   "displacement, extension, stroke or depth; force or load]")  # fmt: skip
@click.option("--unit", "units", metavar="LENGTH,FORCE",
              help="Units of the card; a file that names its units is converted to them.  "
                   "[default: in,lbf or mm,N or m,N, by those of the file]")  # fmt: skip
@PLOT
@OVERWRITE
@FORMAT_OPTION
def fit(
    test: Path,
    acr: bool,
    q: float | None,
    turn: float | None,
    columns: str | None,
    units: str | None,
    picture: Path | None,
    overwrite: bool,
    form: str,
) -> None:
    """Find the constants of the indentation law from a test, and print an EXPE card.

    TEST.csv has the columns indentation and force, its rows in the order of measurement:
    first loading, unloading, reloading, as often as was done.  Commas, semicolons or tabs separate
    them.  Units are in brackets after the names, or in the line below.
    """
    if acr and q not in (None, 2.5):
        raise click.UsageError("--acr takes q = 5/2, as equation 3-7 holds for no other")
    pair = _pair(units, "--unit", "units", "in,lbf")
    chosen = _pair(columns, "--columns", "columns", "2,3")
    targets = OutputPaths.checked(STANDARD_OUTPUT, picture, overwrite, test)
    try:
        read = read_test(test, chosen or (), pair)
        found = fitted(read.indentation, read.force, retreat=turn, q=q, acr=acr)
    except TableError as error:
        raise RefusedError(str(error)) from None
    except NoTestError as error:
        raise RefusedError(f"{test}: {error}") from None

    def draw() -> Picture:
        from fecm.plot.indentation import fit_picture

        names = {**read.units, "time": "s"} if read.units else {}
        return fit_picture(read.indentation, read.force, found, names)

    targets.draw(draw)
    for note in notes(found):
        click.echo(f"fecm: note: {note}", err=True)
    if form == "json":
        click.echo(json.dumps({"file": str(test), "units": read.units or None, **plain(found)}))
        return
    click.echo("\n".join(lines(found)))
    click.echo(_units_line(read))
    if text := card(found):
        click.echo(text)


def _units_line(read: Test) -> str:
    """Units of all values and of the card."""
    if not read.units:
        return "units           those of the test, which names none"
    own = tuple(read.units.values())
    told = "" if read.stated in (("", ""), own) else f" (the test: {', '.join(read.stated)})"
    return f"units           {', '.join(own)}{told}"


def _pair(text: str | None, option: str, what: str, example: str) -> tuple[str, str] | None:
    """Two texts with a comma between them."""
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 2 or not all(parts):
        raise click.BadParameter(f"two {what} with a comma between them, as in {example}",
                                 param_hint=option)  # fmt: skip
    return parts[0], parts[1]


# hertz and contacts ------------------------------------------------------------------------------


@indent.command()
@click.option("--radius", type=float, required=True, help="Radius of the sphere.")
@click.option("--es", "e_s", type=float, required=True, help="Young's modulus of the sphere.")
@click.option("--nus", "nu_s", type=float, required=True, help="Poisson's ratio of the sphere.")
@click.option("--et", "e_t", type=float, required=True,
              help="Young's modulus of the laminate through its thickness.")  # fmt: skip
@click.option("--alpha-p", type=Finite(min=0.0), default=0.0, show_default=True,
              help="Critical indentation for the card.")  # fmt: skip
@click.option("--s-p", type=Finite(0.0, 1.0, max_open=True), default=0.0,
              show_default=True, help="Slope of permanent indentation for the card.")  # fmt: skip
@click.option("--q", type=POSITIVE, default=1.5, show_default=True,
              help="Unloading power for the card; 1.5 is elastic.")  # fmt: skip
@FORMAT_OPTION
def hertz(
    radius: float,
    e_s: float,
    nu_s: float,
    e_t: float,
    alpha_p: float,
    s_p: float,
    q: float,
    form: str,
) -> None:
    """Print the EXPE card of Hertz' contact of a sphere, k by equation 3-2.

    All in one system of units.  Without further options the law is elastic.
    """
    try:
        k = hertz_coefficient(radius, e_s, nu_s, e_t)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    if not 0.0 < k < math.inf:
        raise click.UsageError("radius and moduli are so large or small that k is no number")
    law = Indentation(float(f"{k:.6g}"), alpha_p, s_p, q)
    if form == "json":
        click.echo(json.dumps({"k": k, "card": law.text()}))
    else:
        click.echo(law.text())


@indent.command()
@click.argument("name", required=False)
@click.option("--units", type=click.Choice(["in-lbf-s", "m-N-s", "mm-N-s"]), default="in-lbf-s",
              show_default=True, help="Units of the constants.")  # fmt: skip
@FORMAT_OPTION
def contacts(name: str | None, units: str, form: str) -> None:
    """List the named contacts of `fecm new --contact`, or print the EXPE card of one."""
    if name is not None and name not in CONTACTS:
        raise click.BadParameter(f"there is {', '.join(CONTACTS)}, not `{name}`",
                                 param_hint="NAME")  # fmt: skip
    for contact in [CONTACTS[name]] if name else list(CONTACTS.values()):
        law = contact.converted(units)
        if form == "json":
            values = {field: getattr(law, field) for field in ("k", "alpha_p", "s_p", "q", "word")}
            click.echo(json.dumps(
                {"name": contact.name, **values, "units": units, "source": contact.source,
                 "card": law.text()}
            ))  # fmt: skip
        elif name:
            click.echo(law.text())
        else:
            critical = "alpha_cr" if law.word else "alpha_p"
            line = "" if law.word else f", s_p {law.s_p:g}"
            click.echo(f"{contact.name} ({units})")
            click.echo(f"  k {law.k:g}, {critical} {law.alpha_p:g}{line}, q {law.q:g}")
            click.echo(f"  {contact.source}")
