"""``fecm verify``."""

from __future__ import annotations

import json
import sys
from itertools import chain, tee

import click

from fecm._table import hanging
from fecm.cli.common import CheckFailedError, RefusedError, echo
from fecm.cli.options import FORMAT_OPTION, Format, typical
from fecm.cli.terminal import terminal
from fecm.verification import chosen, compute_rows
from fecm.verification.case import table_lines, verification_page


@click.command(
    "verify",
    epilog=typical(
        "fecm verify",
        "fecm verify --list",
    ),
)
@click.argument("cases", nargs=-1, metavar="[CASE]...")
@click.option("--list", "listing", is_flag=True, help="List the cases without computing them.")
@click.option("--markdown", is_flag=True, help="Write the page of the documentation instead.")
@FORMAT_OPTION
def verify_command(cases: tuple[str, ...], listing: bool, markdown: bool, form: Format) -> None:
    """Compare this program with closed forms and the literature.

    By default all cases are computed.  The exit status is 1 if a row is beyond its tolerance.
    """
    if markdown and (listing or form is Format.JSON):
        raise RefusedError("--markdown goes with neither --list nor --format json")
    selected = chosen(cases)
    if listing and form is Format.JSON:
        listed = [{"case": c.name, "title": c.title, "rows": len(c.checks)} for c in selected]
        click.echo(json.dumps({"cases": listed}, ensure_ascii=False))
        return
    if listing:
        width = max(len(case.name) for case in selected)
        for case in selected:
            echo(f"{case.name.ljust(width)}  {case.title}")
        return
    # The same rows twice: for the output as they are computed, and for the verdict.
    rows, kept = tee(chain.from_iterable(map(compute_rows, selected)))
    if markdown:
        click.echo(verification_page(rows), nl=False)
    elif form is Format.JSON:
        rows_found = list(rows)
        values = [row.to_dict() for row in rows_found]
        document = {"ok": all(row.within for row in rows_found), "rows": values}
        click.echo(json.dumps(document, ensure_ascii=False, allow_nan=False))
    else:
        for line in table_lines(selected, rows):  # the table grows while the rows are computed
            click.echo("\n".join(hanging(line, terminal.columns(sys.stdout))))
    fine = [row.within for row in kept]
    bad, count = fine.count(False), f"{len(fine)} row{'s' * (len(fine) != 1)}"
    if bad:
        raise CheckFailedError(f"{bad} of {count} {'is' if bad == 1 else 'are'} beyond tolerance")
    if form is Format.TEXT and not markdown:
        echo(f"{count}, all within tolerance")
