"""``fecm indent``: indentation tests, and the law that follows from them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fecm.cli.common import DECK_PATH, FORMAT_OPTION, Refused
from fecm.cli.indent_curve import curve
from fecm.cli.numbers import POSITIVE, Finite
from fecm.cli.tables import OVERWRITE, PLOT, STANDARD_OUTPUT, Targets
from fecm.fitting import LIMITS_Q

if TYPE_CHECKING:
    from fecm.fitting.curves import Floats
    from fecm.plot import Picture


@click.group()
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
@click.option("--unit", "units", metavar="LENGTH,FORCE", help="Names of units, for the picture.")
@PLOT
@OVERWRITE
@FORMAT_OPTION
def fit(
    test: Path,
    acr: bool,
    q: float | None,
    turn: float | None,
    units: str | None,
    picture: Path | None,
    overwrite: bool,
    form: str,
) -> None:
    """Find the constants of the indentation law from a test, and print an EXPE card.

    TEST.csv has the columns indentation and force, its rows in the order of measurement:
    first loading, unloading, reloading, as often as was done.
    """
    from fecm.columns import TableError
    from fecm.fitting.constants import fit as fitted
    from fecm.fitting.cycles import NoTestError
    from fecm.fitting.report import card, lines, notes, plain

    if acr and q not in (None, 2.5):
        raise click.UsageError("--acr takes q = 5/2, as equation 3-7 holds for no other")
    names = _unit_names(units)
    targets = Targets.checked(STANDARD_OUTPUT, picture, overwrite, test)
    try:
        indentation, force = _test(test)
        found = fitted(indentation, force, retreat=turn, q=q, acr=acr)
    except TableError as error:
        raise Refused(str(error)) from None
    except NoTestError as error:
        raise Refused(f"{test}: {error}") from None

    def draw() -> Picture:
        from fecm.plot.indentation import fit_picture

        return fit_picture(indentation, force, found, names)

    targets.draw(draw)
    for note in notes(found):
        click.echo(f"fecm: note: {note}", err=True)
    if form == "json":
        click.echo(json.dumps({"file": str(test), **plain(found)}))
        return
    click.echo("\n".join(lines(found)))
    if text := card(found):
        click.echo(text)


def _test(path: Path) -> tuple[Floats, Floats]:
    """Indentation and force of a file; its first two columns where it names none."""
    from fecm.columns import TableError, names_of, read_columns, same_name

    wanted = ("indentation", "force")
    present = names_of(path)
    for name in wanted:
        count = sum(same_name(name, one) for one in present)
        if present and count != 1:
            raise TableError(
                f"{path}: the columns are {', '.join(present)[:80]}; there must be one called "
                f"{name}"
            )
    table = read_columns(path, wanted)
    return table["indentation"], table["force"]


def _unit_names(text: str | None) -> dict[str, str]:
    """Names of units for axes."""
    names = [] if text is None else [part.strip() for part in text.split(",")]
    if text is not None and (len(names) != 2 or not all(names)):
        raise click.BadParameter("two names with a comma between them, as in in,lbf",
                                 param_hint="--unit")  # fmt: skip
    return dict(zip(("length", "force"), names, strict=False)) | ({"time": "s"} if names else {})


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

    All in one system of units.  Without further options it is elastic: nothing remains.
    """
    from fecm.deck.model import Indentation
    from fecm.indentation import hertz_coefficient

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
    from fecm.authoring.contacts import CONTACTS

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
