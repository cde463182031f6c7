"""``fecm rod``: the instrumented rod by itself, its calibration, its rise time."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from click import option

from fecm._errors import StudyError
from fecm._measured_tables import read_table
from fecm._record_faults import record_faults
from fecm.cli.common import DASH, RefusedError, echo, note
from fecm.cli.decks import load_valid
from fecm.cli.options import (
    DECK_PATH,
    FORMAT_OPTION,
    POSITIVE,
    SYSTEM,
    Finite,
    Format,
    HelpGroup,
    Parsed,
    collected,
    list_of,
    typical,
)
from fecm.cli.outputs import OutputPaths, outputs
from fecm.mechanics.projectile import (
    INTEGRATORS,
    LUMPED,
    MASSES,
    REPORT_ELEMENTS,
    WILSON,
    Integrator,
    MassMatrix,
    Rod,
)
from fecm.studies.rod_test import pulse_test
from fecm.studies.rod_test.filters import FILTERS, Filter, filter_of, recorded
from fecm.studies.rod_test.pulse_test import calibrate_transducer as fit_sensitivity
from fecm.studies.rod_test.study import Struck, rod_of, simulate_rod_test, uniform_rod


class _PulseGroup(HelpGroup):
    """Group whose default command is ``pulse``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Insert the default command's name if the call names no command."""
        if args and args[0] not in self.commands and args[0] not in ("-h", "--help"):
            args = ["pulse", *args]
        return super().parse_args(ctx, args)


@click.group("rod", cls=_PulseGroup)
def rod_command() -> None:
    """Compute with the rod alone: response to a pulse, filters, calibration.

    `fecm rod [DECK] --pulse ...` is short for `fecm rod pulse [DECK] --pulse ...`.
    """


@dataclass(frozen=True)
class Shape:
    """Uniform rod, and the system of its units."""

    length: float | None
    modulus: float | None
    density: float | None
    diameter: float | None
    elements: int | None
    units: str | None

    def given(self) -> list[str]:
        """Return the names of the options that are given."""
        return [name for name, value in vars(self).items() if value is not None]


@dataclass(frozen=True)
class PulseOptions:
    """Argument and options of ``fecm rod pulse``."""

    deck: Path | None
    shape: Shape
    pulse: str
    dt: float | None
    duration: float | None
    stations: tuple[float, ...]
    transducer: Filter | None
    mass_matrix: MassMatrix
    integrator: Integrator
    targets: OutputPaths


@rod_command.command(
    epilog=typical(
        "fecm rod impact-patch.inp --pulse gauss:1000,200e-6,40e-6 --plot pulse.png",
        "fecm rod impact-patch.inp --pulse pulse.csv --station .25 --station .5 -o forces.csv",
    )
)
@click.argument("deck", type=DECK_PATH, required=False)
@option(
    "--pulse",
    metavar="PULSE",
    required=True,
    help="gauss:F0,TAU,B (F0 exp(-(t-TAU)²/4B²)), sine:F0,B (F0 sin(πt/B), zero after B), or a "
    "CSV of time and force, linear between its rows, in the units of its header or of the rod.",
)
@option("--length", type=POSITIVE, help="Length of the rod, without a deck.")
@option("--modulus", type=POSITIVE, help="Young's modulus, without a deck.")
@option("--density", type=POSITIVE, help="Mass per volume, without a deck.")
@option("--diameter", type=POSITIVE, help="Diameter, without a deck.")
@option(
    "--elements",
    type=click.IntRange(1, 1000),
    metavar="N",
    help="Number of elements, without a deck.  [default: 20]",
)
@option(
    "--units",
    type=SYSTEM,
    help="Names the units on the picture, without a deck, as in in-lbf-s.",
)
@option(
    "--dt",
    type=POSITIVE,
    help="Time step.  [default: the deck's DT, or 0.8 of the travel time of a wave through an "
    "element]",
)
@option(
    "--duration",
    type=POSITIVE,
    help="Simulated time.  [default: TAU + 10 B, 1.5 B, or the table's]",
)
@option(
    "--station",
    "stations",
    type=Finite(),
    multiple=True,
    metavar="X",
    help="Distance from the struck end at which to compute the force; may be repeated.  "
    "[default: the middle]",
)
@option(
    "--filter",
    "transducer",
    type=Parsed(filter_of, "FILTER"),
    help=f"Also filter these forces as a transducer does: {FILTERS}",
)
@option(
    "--mass-matrix",
    type=click.Choice(MASSES),
    default=LUMPED,
    show_default=True,
    help="Mass matrix; the report's program lumps it.",
)
@option(
    "--integrator",
    type=click.Choice(INTEGRATORS),
    default=WILSON,
    show_default=True,
    help="Time integration; the report's is Wilson's.",
)
@outputs()
@collected(Shape, "shape")
@collected(PulseOptions)
def pulse(options: PulseOptions) -> None:
    """Compute forces and accelerations of a free rod under a pulse on one end, as CSV.

    The rod is the projectile of DECK, or uniform by --length, --modulus, --density and --diameter.
    Force is positive in compression.
    """
    struck = _uniform(options.shape) if options.deck is None else _of_deck(options)
    test = simulate_rod_test(
        struck,
        pulse_test.pulse_of(options.pulse, struck.units),
        options.dt,
        options.duration,
        options.stations,
        options.transducer,
        options.mass_matrix,
        options.integrator,
    )
    targets = options.targets
    targets.draw("studies:pulse_picture", test, test.filtered, test.units)
    columns, rows = pulse_test.pulse_table(test, test.filtered)
    targets.write(columns, test.units, rows)
    if targets.table != DASH:
        echo(test)


def _uniform(shape: Shape) -> Struck:
    """Return the rod of the options."""
    length, modulus, density, diameter = shape.length, shape.modulus, shape.density, shape.diameter
    if length is None or modulus is None or density is None or diameter is None:
        needed = ("length", "modulus", "density", "diameter")
        missing = ", ".join(f"--{name}" for name in needed if name not in shape.given())
        raise click.UsageError(f"the rod lacks {missing}; or name a deck with a rod")
    elements = shape.elements or REPORT_ELEMENTS
    return uniform_rod(Rod.cylinder(length, diameter, modulus, density, elements), shape.units)


def _of_deck(options: PulseOptions) -> Struck:
    """Return the rod of the first problem of a deck."""
    deck, options_given = options.deck, options.shape.given()
    assert deck is not None
    if options_given:
        raise click.UsageError(f"--{options_given[0]} is for a rod without a deck; {deck} has one")
    problems = load_valid(deck)
    if not problems:
        raise RefusedError(f"{deck} contains no problem")
    return rod_of(problems[0].deck)


@rod_command.command(
    "filter",
    epilog=typical(
        "fecm rod filter impact-patch.h5 --filter first-order:10e-6 -o filtered.csv",
        "fecm rod filter calibration-test.csv --column V_F --filter cfc:1000",
    ),
)
@click.argument("history", type=DECK_PATH, metavar="RESULT")
@option("--filter", "transducer", type=Parsed(filter_of, "FILTER"), required=True, help=FILTERS)
@option(
    "--column",
    metavar="NAME",
    help="Column of a result's history, or of a CSV, to filter.  [default: transducer; of a "
    "CSV without one, the second]",
)
@outputs("history")
def filter_(history: Path, transducer: Filter, column: str | None, targets: OutputPaths) -> None:
    """Filter a history as a transducer with a rise time does, or by a channel frequency class.

    RESULT is a result of `fecm run`, or a CSV with a column of times.  The output is a CSV with the
    columns time, the history, and filtered.
    """
    series = recorded(history, column)
    clock = series.units.get("time", "")
    sensor = transducer.in_unit(clock)
    sensor.warn_without_effect(series.time, clock)
    note(*record_faults(series.name, series.values, series.time, clock=clock, ends=False))
    filtered = sensor(series.time, series.values)
    named = {**series.beside, series.name: series.values, "filtered": filtered}
    targets.draw("studies:filter_picture", series.time, named, series.units, series.dimension)
    columns = np.stack([series.time, series.values, filtered], axis=1)
    dimensions = {"time": "time", series.name: series.dimension, "filtered": series.dimension}
    targets.write(dimensions, dict(series.units), columns[series.first :].tolist())


@rod_command.command(
    "calibrate",
    epilog=typical(
        "fecm rod calibrate calibration-test.csv --mass 2.862e-3 --c-a 1e-5",
        "fecm rod calibrate calibration-test.csv --mass 2.862e-3 --c-a 1e-5 --plot fit.png",
    ),
)
@click.argument("test", type=DECK_PATH, metavar="TEST.csv")
@option("--mass", type=POSITIVE, required=True, help="Mass of the target.")
@option(
    "--c-a",
    type=POSITIVE,
    required=True,
    help="Sensitivity of the accelerometer, V_a per acceleration.",
)
@option(
    "--columns",
    type=list_of("TIME,V_F,V_a", click.STRING, [3]),
    help="Names or numbers (from 1) of the columns; a minus before one changes its sign.",
)
@option("--through-origin", is_flag=True, help="Fit a line without an offset.")
@FORMAT_OPTION
@outputs("test", table=False)
def calibrate_command(
    test: Path,
    mass: float,
    c_a: float,
    columns: tuple[str, ...] | None,
    through_origin: bool,
    form: Format,
    targets: OutputPaths,
) -> None:
    """Calibrate the impact-force transducer with TEST.csv.

    TEST.csv has the columns time, V_F and V_a: outputs of the transducer on the projectile and of
    the accelerometer on a free target.  V_F is converted to the unit of V_a.  The slope of V_F over
    V_a gives c_F = (c_a / m) V_F / V_a.
    """
    measured = read_table(test)
    columns_found = measured.find(("time", "V_F", "V_a"), columns or ())
    units = [column.unit for column in columns_found]
    if bool(units[1]) != bool(units[2]):
        raise RefusedError(
            f"{test}: one of V_F and V_a is in {units[1] or units[2]}; name both units"
        )
    target = {"time": units[0], "voltage": units[2]}
    time, v_f, v_a = measured.values(columns_found, target, increasing="time")
    try:
        fit = fit_sensitivity(v_f, v_a, mass, c_a, through_origin=through_origin)
    except StudyError as error:
        raise RefusedError(f"{test}: {error}") from None
    units[1] = units[2]
    if fit.slope < 0.0:
        note("the slope is negative: V_F and V_a have opposite signs; --columns time,V_F,-V_a")
    targets.draw("studies:calibration_picture", time, v_f, v_a, fit, units)
    faults = [
        fault
        for name, values in (("V_F", v_f), ("V_a", v_a))
        for fault in record_faults(name, values, time, clock=units[0], ends=False)
    ]
    note(*faults)
    if form is Format.JSON:
        click.echo(json.dumps({**vars(fit), "notes": faults}))
        return
    echo(f"points            {fit.points}")
    echo(f"slope V_F/V_a     {fit.slope:.6g} ± {fit.slope_error:.2g}")
    echo(f"offset of V_F     {fit.offset:.6g} ± {fit.offset_error:.2g}")
    echo(f"R²                {fit.r_squared:.6f}")
    echo(f"sensitivity c_F   {fit.sensitivity:.6g} ± {fit.sensitivity_error:.2g}")
