"""``fecm identify``."""

from __future__ import annotations

from pathlib import Path

import click

from fecm.cli.common import DECK_PATH, FILE_PATH, FORMAT_OPTION, NO, echo, echo_json, note
from fecm.cli.decks import load_single
from fecm.cli.outputs import STANDARD_OUTPUT, OutputPaths, write_lines
from fecm.cli.rod import FILTER_HELP
from fecm.cli.types import ListOf, Parsed
from fecm.deck.units import unit_names, unit_of
from fecm.studies.comparison import measurement_of
from fecm.studies.rod_test.filters import Filter, filter_of
from fecm.sweeps.identify import FREE, Identification, fit


@click.command()
@click.argument("deck", type=DECK_PATH)
@click.argument("measured", type=DECK_PATH, metavar="MEASURED.csv")
@click.option("--free", type=ListOf("NAME,...", click.Choice(FREE)), required=True,
              metavar="NAME,...",
              help=f"Parameters to fit: {', '.join(FREE)}.")  # fmt: skip
@click.option("--filter", "sensor", type=Parsed(filter_of), metavar="FILTER",
              help=f"Filter of the measurement, which the computed force passes too: {FILTER_HELP}",
              )  # fmt: skip
@click.option("-o", "--output", type=FILE_PATH, metavar="FITTED.inp",
              help="Also write the deck with the fitted values.")  # fmt: skip
@click.option("--plot", "picture", type=FILE_PATH, metavar="FILE",
              help="Also draw measured and fitted force and the residual: .png, .svg or "
                   ".pdf.")  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@FORMAT_OPTION
def identify(
    deck: Path,
    measured: Path,
    free: tuple[str, ...],
    sensor: Filter | None,
    output: Path | None,
    picture: Path | None,
    overwrite: bool,
    form: str,
) -> None:
    """Fit parameters of the impact of DECK to a measured contact force.

    MEASURED.csv has the columns time and force, in the deck's units; time 0 is the first contact,
    unless delay is fitted.  The deck's values are the start of the fit.  The exit status is 1 if
    the measurement does not determine the parameters, or the fit does not converge.
    """
    targets = OutputPaths(output or STANDARD_OUTPUT, picture, overwrite, deck, measured)
    problem = load_single(deck, "identify")
    units = unit_names(problem.deck)
    found = fit(problem.deck, measurement_of(measured, units), free, sensor)
    targets.draw("histories:fit_picture", found, units)
    if output is not None:
        write_lines([found.deck.to_text()], output, overwrite=overwrite)
        note(f"wrote {output}")
    for text in found.notes:
        note(text)
    if form == "json":
        echo_json(_plain(found))
    else:
        echo("\n".join(_lines(found, units)))
        echo(found.cards())
    if not found.converged:
        raise SystemExit(NO)


def _plain(found: Identification) -> dict[str, object]:
    """The result as plain values."""
    return {
        "values": {
            name: {"value": value, "error": found.errors[name], "start": found.start[name]}
            for name, value in found.values.items()
        },
        "correlation": found.correlation.tolist(),
        "points": len(found.time), "dof": found.dof, "rms": found.rms, "share": found.share,
        "converged": found.converged, "notes": list(found.notes), "cards": found.cards(),
    }  # fmt: skip


def _lines(found: Identification, units: dict[str, str]) -> list[str]:
    """Lines of text about a fit."""
    rms = f"{found.rms:.4g} {unit_of('force', units)}".rstrip()
    lines = [
        f"points       {len(found.time)}, {found.dof} degrees of freedom",
        f"residual     {rms} rms, {100.0 * found.share:.2g} % of the peak",
        f"converged    {'yes' if found.converged else 'no'}",
        *(
            f"{name:<11}  {value:.5g} ± {found.errors[name]:.2g}, from {found.start[name]:.5g}"
            for name, value in found.values.items()
        ),
    ]
    if len(found.values) > 1:
        lines.append("correlation  " + "".join(f"{name:>12}" for name in found.values))
        lines += [
            f"  {name:<11}" + "".join(f"{value:12.3f}" for value in row)
            for name, row in zip(found.values, found.correlation, strict=True)
        ]
    return lines
