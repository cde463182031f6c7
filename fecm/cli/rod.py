"""``fecm rod``: the instrumented rod by itself, its calibration, its rise time."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from fecm.api import load_deck
from fecm.cli.common import DECK_PATH, FORMAT_OPTION, RefusedError, count_errors, report
from fecm.cli.outputs import OUTPUT, OVERWRITE, PLOT, STANDARD_OUTPUT, OutputPaths
from fecm.cli.types import POSITIVE, Finite
from fecm.deck.units import unit_names
from fecm.mechanics.projectile import REPORT_ELEMENTS, RigidMass, Rod
from fecm.mechanics.rod_integrators import INTEGRATORS, LUMPED, MASSES, WILSON
from fecm.plot.kinds import Picture
from fecm.problem.build import build_projectile, build_station
from fecm.studies.rod_test import calibration
from fecm.studies.rod_test.filters import filter_of
from fecm.studies.rod_test.history import recorded
from fecm.studies.rod_test.pulse_test import RodHistory, default_time_step, simulate_pulse, table
from fecm.studies.rod_test.pulses import pulse_of
from fecm.studies.tables import read_columns

FILTER_HELP = ("first-order:RISE or moving-average:RISE; RISE is the time from 10 to 90 % of the "
               "answer to a step.")  # fmt: skip


class _PulseGroup(click.Group):
    """A group of commands; what begins with none of their names is meant for the first."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the first command's name where there is none."""
        if args and args[0] not in self.commands and args[0] not in ("-h", "--help"):
            args = ["pulse", *args]
        return super().parse_args(ctx, args)


@click.group(cls=_PulseGroup, short_help="The rod of the projectile by itself.")
def rod() -> None:
    """The projectile's rod by itself: a pulse on its end, its transducer.

    `fecm rod [DECK] --pulse ...` is short for `fecm rod pulse [DECK] --pulse ...`.
    """


@rod.command()
@click.argument("deck", type=DECK_PATH, required=False)
@click.option("--pulse", "pulse_text", required=True, metavar="PULSE",
              help="gauss:F0,TAU,B (F0 exp(-(t-TAU)²/4B²)), sine:F0,B (F0 sin(πt/B), zero after "
                   "B), or a CSV of time and force, linear between its rows.")  # fmt: skip
@click.option("--length", type=POSITIVE, help="Length of the rod, without a deck.")
@click.option("--modulus", type=POSITIVE, help="Young's modulus, without a deck.")
@click.option("--density", type=POSITIVE, help="Mass per volume, without a deck.")
@click.option("--diameter", type=POSITIVE, help="Diameter, without a deck.")
@click.option("--elements", type=click.IntRange(1, 1000), metavar="N",
              help="Number of elements, without a deck.  [default: 20]")  # fmt: skip
@click.option("--dt", type=POSITIVE,
              help="Time step.  [default: the deck's DT, or 0.8 of a wave's time through an "
                   "element]")  # fmt: skip
@click.option("--duration", type=POSITIVE,
              help="Time to cover.  [default: TAU + 10 B, 1.5 B, or the table's]")  # fmt: skip
@click.option("--station", "stations", type=Finite(), multiple=True, metavar="X",
              help="Distance from the struck end at which the force is wanted; may be repeated.  "
                   "[default: the middle]")  # fmt: skip
@click.option("--filter", "filter_text", metavar="FILTER",
              help=f"Also show these forces through a transducer that rises slowly: {FILTER_HELP}",
              )  # fmt: skip
@click.option("--mass-matrix", type=click.Choice(MASSES), default=LUMPED, show_default=True,
              help="The report's program lumps the mass.")  # fmt: skip
@click.option("--integrator", type=click.Choice(INTEGRATORS), default=WILSON, show_default=True,
              help="The report's is Wilson's.")  # fmt: skip
@OUTPUT
@PLOT
@OVERWRITE
def pulse(
    deck: Path | None,
    pulse_text: str,
    dt: float | None,
    duration: float | None,
    stations: tuple[float, ...],
    filter_text: str | None,
    mass_matrix: str,
    integrator: str,
    output: Path,
    picture: Path | None,
    overwrite: bool,
    **shape: float | int | None,
) -> None:
    """Push a free rod at one end; the forces and accelerations in it as CSV.

    The rod is the projectile of DECK, or uniform by --length, --modulus, --density and --diameter.
    Force is positive in compression.
    """
    targets = OutputPaths.checked(output, picture, overwrite)
    _check_shape(deck, shape)

    units: Mapping[str, str] = {}
    deck_dt = None
    if deck is None:
        struck = _uniform(shape)
        middle = struck.length / 2.0
    else:
        struck, middle, deck_dt, units = _of_deck(deck)
    struck = struck.with_mass(mass_matrix)
    try:
        push = pulse_of(pulse_text)
        slow = None if filter_text is None else filter_of(filter_text)
        history = simulate_pulse(
            struck,
            push,
            dt or deck_dt or default_time_step(struck),
            duration or push.duration,
            tuple(dict.fromkeys(stations)) or (middle,),
            integrator,
        )
    except ValueError as error:
        raise RefusedError(str(error)) from None
    filtered = None if slow is None else slow(history.time, history.forces)

    def draw() -> Picture:
        from fecm.plot.rod import pulse_picture

        return pulse_picture(history, filtered, units)

    targets.draw(draw)
    targets.write(table(history, filtered))
    if targets.table is not None:
        click.echo("\n".join(_summary(struck, history)))


def _check_shape(deck: Path | None, shape: Mapping[str, float | int | None]) -> None:
    """Refuse a rod that is given twice, or not wholly."""
    given = [name for name, value in shape.items() if value is not None]
    if deck is not None and given:
        raise click.UsageError(f"--{given[0]} is for a rod without a deck; {deck} has its own")
    missing = [name for name, value in shape.items() if value is None and name != "elements"]
    if deck is None and missing:
        options = ", ".join(f"--{name}" for name in missing)
        raise click.UsageError(f"the rod lacks {options}; or name a deck whose rod it is")


def _uniform(shape: Mapping[str, Any]) -> Rod:
    """The rod of the options."""
    diameters = (shape["diameter"],) * (shape["elements"] or REPORT_ELEMENTS)
    return Rod(shape["length"], diameters, shape["modulus"], shape["density"])


def _of_deck(deck: Path) -> tuple[Rod, float, float | None, Mapping[str, str]]:
    """The projectile of a deck's first problem, its transducer's x, its first DT, its units."""
    prepared = load_deck(deck)
    report(prepared)
    if errors := prepared.errors(force=True):
        raise RefusedError(count_errors(errors))
    if not prepared.problems:
        raise RefusedError(f"{deck} holds no problem")
    first = prepared.problems[0].deck
    steps = [macro.value for macro in first.macros if macro.word == "DT" and macro.value > 0.0]
    projectile = build_projectile(first)
    if isinstance(projectile, RigidMass):
        raise RefusedError(f"{deck}: the projectile is a rigid mass, through which no wave runs")
    node = build_station(first, projectile, frozenset()).node
    x = (node - 1) * projectile.length / projectile.elements
    return projectile, x, steps[0] if steps else None, unit_names(first)


def _summary(struck: Rod, history: RodHistory) -> list[str]:
    """What came out, for a person."""
    dt, peak = history.time[1], abs(history.applied).argmax()
    lines = [
        f"rod               {struck.elements} elements, length {struck.length:g}, "
        f"mass {struck.total_mass:.5g}",
        f"steps             {len(history.time) - 1} of {dt:g}",
        f"applied           peak {history.applied[peak]:.6g} at time {history.time[peak]:.6g}",
    ]
    for x, force, ratio in zip(
        history.stations, history.forces.T, history.mean_ratios, strict=True
    ):
        row = abs(force).argmax()
        lines.append(
            f"force at {x:<8.4g} peak {force[row]:.6g} at time {history.time[row]:.6g}; "
            f"mean ratio to the applied {ratio:.3f}"
        )
    return lines


@rod.command("filter")
@click.argument("history", type=DECK_PATH, metavar="RESULT")
@click.option("--filter", "filter_text", required=True, metavar="FILTER", help=FILTER_HELP)
@click.option("--column", metavar="NAME",
              help="What to filter: a column of a result's history, or of a CSV.  [default: "
                   "transducer; of a CSV without one, the second]")  # fmt: skip
@OUTPUT
@PLOT
@OVERWRITE
def filter_(
    history: Path,
    filter_text: str,
    column: str | None,
    output: Path,
    picture: Path | None,
    overwrite: bool,
) -> None:
    """Show a history as a transducer with a rise time would.

    RESULT is what `fecm run` wrote, or a CSV with a column of times; the CSV that comes out has the
    columns time, the history, and filtered.
    """
    targets = OutputPaths.checked(output, picture, overwrite, history)

    try:
        slow = filter_of(filter_text)
        series = recorded(history, column)
    except ValueError as error:
        raise RefusedError(str(error)) from None
    filtered = slow(series.time, series.values)

    def draw() -> Picture:
        from fecm.plot.rod import filter_picture

        named = {**series.beside, series.name: series.values, "filtered": filtered}
        return filter_picture(series.time, named, series.units, series.dimension)

    def lines() -> Iterable[str]:
        yield f"time,{series.name},filtered\n"
        columns = (series.time.tolist(), series.values.tolist(), filtered.tolist())
        for row in list(zip(*columns, strict=True))[series.first :]:
            yield ",".join(map(repr, row)) + "\n"

    targets.draw(draw)
    targets.write(lines())


@rod.command()
@click.argument("test", type=DECK_PATH, metavar="TEST.csv")
@click.option("--mass", type=POSITIVE, required=True, help="Mass of the target.")
@click.option("--c-a", type=POSITIVE, required=True,
              help="Sensitivity of the accelerometer, V_a per acceleration.")  # fmt: skip
@click.option("--through-origin", is_flag=True, help="Fit a line without an offset.")
@FORMAT_OPTION
@PLOT
@OVERWRITE
def calibrate(
    test: Path,
    mass: float,
    c_a: float,
    through_origin: bool,
    form: str,
    picture: Path | None,
    overwrite: bool,
) -> None:
    """Sensitivity of the impact-force transducer from TEST.csv.

    TEST.csv has the columns time, V_F and V_a: outputs of the transducer on the projectile and of
    the accelerometer on a free target.  The slope of V_F over V_a gives c_F = (c_a / m) V_F / V_a.
    """
    targets = OutputPaths.checked(STANDARD_OUTPUT, picture, overwrite)

    try:
        columns = read_columns(test, ("time", "V_F", "V_a"), increasing="time")
    except ValueError as error:
        raise RefusedError(str(error)) from None
    try:
        found = calibration.calibrate(
            columns["V_F"], columns["V_a"], mass, c_a, through_origin=through_origin
        )
    except ValueError as error:
        raise RefusedError(f"{test}: {error}") from None

    def draw() -> Picture:
        from fecm.plot.rod import calibration_picture

        return calibration_picture(columns["time"], columns["V_F"], columns["V_a"], found)

    text = json.dumps(vars(found)) if form == "json" else "\n".join(_told(found))
    targets.draw(draw)
    targets.write([text + "\n"])


def _told(found: Any) -> list[str]:
    """A calibration, for a person."""
    return [
        f"points            {found.points}",
        f"slope V_F/V_a     {found.slope:.6g} ± {found.slope_error:.2g}",
        f"offset of V_F     {found.offset:.6g} ± {found.offset_error:.2g}",
        f"R²                {found.r_squared:.6f}",
        f"sensitivity c_F   {found.sensitivity:.6g} ± {found.sensitivity_error:.2g}",
    ]
