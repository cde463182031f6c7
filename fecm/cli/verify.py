"""``fecm verify``."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import click

from fecm.cli.common import FORMAT_OPTION, CheckFailedError, RefusedError
from fecm.verification import Case, Row, carry_out, chosen
from fecm.verification.case import fields, page, table


@click.command()
@click.argument("cases", nargs=-1, metavar="[CASE]...")
@click.option("--list", "listing", is_flag=True, help="List the cases without computing them.")
@click.option("--markdown", is_flag=True, help="Write the page of the documentation instead.")
@FORMAT_OPTION
def verify(cases: tuple[str, ...], listing: bool, markdown: bool, form: str) -> None:
    """Compare this program with closed forms and the literature.

    By default all cases are computed.  The exit status is 1 if a row is beyond its tolerance.
    """
    if markdown and (listing or form == "json"):
        raise RefusedError("--markdown goes with neither --list nor --format json")
    wanted = chosen(cases)
    if listing:
        _name(wanted, form)
        return
    rows = _printed(wanted, form, markdown)
    bad = sum(not row.within for row in rows)
    count = f"{len(rows)} row{'s' * (len(rows) != 1)}"
    if bad:
        raise CheckFailedError(f"{bad} of {count} {'is' if bad == 1 else 'are'} beyond tolerance")
    if form == "text" and not markdown:
        click.echo(f"{count}, all within tolerance")


def _name(cases: Sequence[Case], form: str) -> None:
    """List the cases."""
    if form == "json":
        listed = [{"case": c.name, "title": c.title, "rows": len(c.checks)} for c in cases]
        click.echo(json.dumps({"cases": listed}, ensure_ascii=False))
        return
    width = max(len(one.name) for one in cases)
    for one in cases:
        click.echo(f"{one.name.ljust(width)}  {one.title}")


def _printed(cases: Sequence[Case], form: str, markdown: bool) -> list[Row]:
    """Compute cases and print their rows; a table grows while they are computed."""
    found: list[Row] = []

    def rows() -> Iterator[Row]:
        for one in cases:
            for row in carry_out(one):
                found.append(row)
                yield row

    if markdown:
        click.echo(page(rows()), nl=False)
    elif form == "json":
        values = [fields(row) for row in rows()]
        fine = all(row.within for row in found)
        click.echo(json.dumps({"ok": fine, "rows": values}, ensure_ascii=False, allow_nan=False))
    else:
        for line in table(cases, rows()):
            click.echo(line)
    return found
