"""``fecm identify``."""

from __future__ import annotations

from pathlib import Path

import click
from click import option

from fecm.cli.common import DASH, FAILED, echo, echo_json, note
from fecm.cli.decks import load_single
from fecm.cli.help import typical
from fecm.cli.options import DECK_PATH, FILE_PATH, FORMAT_OPTION, Format, OneOf, Parsed, list_of
from fecm.cli.outputs import OutputPaths, write_lines
from fecm.cli.rod import FILTER_HELP
from fecm.deck.units import unit_names, unit_of
from fecm.results.comparison import measurement_of
from fecm.studies.rod_test.filters import Filter, filter_of
from fecm.sweeps.identify import CARDS, FREE, Identification, fit


@click.command(
    epilog=typical(
        "fecm identify impact-115.inp measured-force.csv --free k",
        "fecm identify impact-115.inp measured-force.csv --free k,velocity --plot fit.png",
    )
)
@click.argument("deck", type=DECK_PATH)
@click.argument("measured", type=DECK_PATH, metavar="MEASURED.csv")
@option(
    "--free",
    type=list_of("NAME,...", OneOf(FREE)),
    required=True,
    help=f"Parameters to fit: {', '.join(FREE)}.",
)
@option(
    "--filter",
    "sensor",
    type=Parsed(filter_of, "FILTER"),
    help=f"Filter of the measurement, which the computed force passes too: {FILTER_HELP}",
)
@option(
    "-o",
    "--output",
    type=FILE_PATH,
    metavar="FITTED.inp",
    help="Also write the deck with the fitted values.",
)
@option(
    "--plot",
    "picture",
    type=FILE_PATH,
    metavar="FILE",
    help="Also draw measured and fitted force and the residual: .png, .svg or .pdf.",
)
@option("--overwrite", is_flag=True, help="Replace existing files.")
@FORMAT_OPTION
def identify(
    deck: Path,
    measured: Path,
    free: tuple[str, ...],
    sensor: Filter | None,
    output: Path | None,
    picture: Path | None,
    overwrite: bool,
    form: Format,
) -> None:
    """Fit parameters of the impact of DECK to a measured contact force.

    MEASURED.csv has the columns time and force, in the deck's units; time 0 is the first contact,
    unless delay is fitted.  The deck's values are the start of the fit.  The exit status is 1 if
    the measurement does not determine the parameters, the fit does not converge, the model does
    not describe the data, or a delay or an offset should be fitted too.
    """
    targets = OutputPaths(output or DASH, picture, overwrite, deck, measured)
    problem = load_single(deck, "identify")
    units = unit_names(problem.deck)
    found = fit(problem.deck, measurement_of(measured, units), free, sensor)
    targets.draw("histories:fit_picture", found, units)
    if output is not None:
        write_lines([found.deck.to_text()], output, overwrite=overwrite)
        note(f"wrote {output}")
    note(*found.notes)
    if form is Format.JSON:
        values = {
            name: {"value": value, "error": found.errors[name], "start": found.start[name]}
            for name, value in found.values.items()
        }
        echo_json(
            {
                "values": values,
                "correlation": found.correlation.tolist(),
                "points": len(found.time),
                "dof": found.dof,
                "rms": found.rms,
                "share": found.share,
                "converged": found.converged,
                "accepted": found.accepted,
                "plate_errors": found.plate_errors,
                "notes": list(found.notes),
                "cards": found.cards(),
            }
        )
    else:
        rms = f"{found.rms:.4g} {unit_of('force', units)}".rstrip()
        echo(f"points       {len(found.time)}, {found.dof} degrees of freedom")
        echo(f"residual     {rms} rms, {100.0 * found.share:.2g} % of the peak")
        echo(f"converged    {'yes' if found.converged else 'no'}")
        echo(f"accepted     {'yes' if found.accepted else 'no'}")
        for name, value in found.values.items():
            error, start = found.errors[name], found.start[name]
            echo(f"{name:<11}  {value:.5g} ± {error:.2g}, from {start:.5g}")
        if len(found.values) > 1:
            echo("correlation  " + "".join(f"{name:>12}" for name in found.values))
            for name, row in zip(found.values, found.correlation, strict=True):
                echo(f"  {name:<11}" + "".join(f"{value:12.3f}" for value in row))
        for line in _plate_errors(found):
            echo(line)
        echo(found.cards())
    if not found.accepted:
        raise SystemExit(FAILED)


def _plate_errors(found: Identification) -> list[str]:
    """Table of the changes of the values with 1 % more of a property of the plate."""
    if not found.plate_errors:
        return []
    lines = ["1 % more in the deck" + "".join(f"{name:>12}" for name in found.plate_errors)]
    for name, value in found.values.items():
        changes = [changes[name] for changes in found.plate_errors.values()]
        texts = [f"{c / value:+.2%}" if name in CARDS and value else f"{c:+.2g}" for c in changes]
        lines.append(f"  {name:<18}" + "".join(f"{text:>12}" for text in texts))
    return lines
