"""``fecm waves``: dispersion, speeds and fronts of waves in a laminate, as CSV and as pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import click
import numpy as np
from click import option

from fecm.authoring.parameters import ObjectError
from fecm.cli.common import RefusedError, note
from fecm.cli.decks import load_valid
from fecm.cli.laminate_options import LaminateOptions, as_options, laminate_options
from fecm.cli.options import (
    DECK_PATH,
    NOT_NEGATIVE,
    POSITIVE,
    Finite,
    HelpGroup,
    OneOf,
    Parsed,
    collected,
    list_of,
    stack_options,
    typical,
)
from fecm.cli.outputs import OutputPaths, outputs
from fecm.deck.units import VELOCITY
from fecm.studies.waves import MODES
from fecm.studies.waves.study import Waves, waves_of
from fecm.studies.waves.study import waves as waves_in

MOST = 1_000_000  # rows of a table; more are certainly a typo


def _wavelengths(text: str) -> tuple[float, ...]:
    """Parse FROM:TO:N, wavelengths at equal distances."""
    parts = text.split(":")
    try:
        first, last, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        first, last, count = math.nan, math.nan, 0
    if len(parts) != 3 or not 0.0 < first <= last < math.inf or count < 1:
        message = f"{text!r} is not FROM:TO:N with 0 < FROM <= TO and N >= 1, as in 0.1:20:200"
        raise ValueError(message)
    if (count == 1) != (first == last):
        raise ValueError(f"{text}: FROM = TO is required for N = 1, and excluded for more")
    if count > MOST // 5:
        raise ValueError(f"{text}: at most {MOST // 5} wavelengths are allowed")
    return tuple(np.linspace(first, last, count).tolist())


def _joined(_: Any, __: Any, lists: tuple[tuple[Any, ...], ...]) -> tuple[Any, ...]:
    """Join the values of a repeated option of lists, each value once."""
    return tuple(dict.fromkeys(chain(*lists)))


class _ListCommand(click.Command):
    """Command whose repeated options also take several values: ``--time 2e-6 4e-6``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the option before every further number that follows one of these options."""
        options = [param for param in self.params if isinstance(param, click.Option)]
        names = {name for option in options if option.multiple for name in option.opts}
        end = args.index("--") if "--" in args else len(args)
        repeated: list[str] = []
        last, waits = "", False
        for argument in args[:end]:
            if last and not waits and _is_number(argument):
                repeated.append(last)
            elif waits:
                waits = False
            else:
                name = argument.partition("=")[0]
                last, waits = (name, argument == name) if name in names else ("", False)
            repeated.append(argument)
        return super().parse_args(ctx, repeated + args[end:])


def _is_number(text: str) -> bool:
    """Return whether a text is a number, or several with commas between them."""
    try:
        list(map(float, text.split(",")))
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class LaminateSource:
    """Source of a laminate: a deck, or options."""

    deck: Path | None
    laminate: LaminateOptions
    shear_factor: float

    def waves(self) -> Waves:
        """Return the waves in the laminate."""
        if self.deck is not None:
            result = self._of_deck(self.deck)
        elif self.laminate.layup is None:
            message = "give a DECK, or --layup, --ply-thickness and --ply or --material"
            raise click.UsageError(message)
        else:
            laminate, options = self.laminate.authored({}, ()), self.laminate
            try:
                result = waves_in(laminate, shear_factor=self.shear_factor, units=options.units)
            except ObjectError as error:
                raise click.UsageError(as_options(str(error), vars(options))) from None
        note(*result.notes)
        return result

    def _of_deck(self, deck: Path) -> Waves:
        """Return the waves in the laminate of a deck's first problem."""
        for name, value in vars(self.laminate).items():
            if value is not None:
                option = name.replace("_", "-")
                raise click.UsageError(f"--{option} describes a laminate; {deck} has one already")
        problems = load_valid(deck, "; no waves were computed", warnings=False)
        if len(problems) > 1:
            note(f"{deck} has {len(problems)} problems; the laminate of the first is used")
        return waves_of(problems[0], self.shear_factor)


# The argument and the options of all three commands.
_SHARED = stack_options(
    click.argument("deck", type=DECK_PATH, required=False),
    laminate_options(required=False),
    option(
        "--shear-factor",
        type=POSITIVE,
        default=1.0,
        metavar="F",
        show_default=True,
        help="Factor of the transverse shear stiffness, in addition to a deck's SHEA; with "
        "pi^2/12 = 0.822467 the cut-off frequencies are exact.",
    ),
    outputs("deck"),
    collected(LaminateSource, "source"),
)

STEP = option(
    "--step",
    type=POSITIVE,
    default=5.0,
    show_default=True,
    metavar="DEG",
    help="Angle between two normals, degrees.",
)


def _normals(step: float) -> list[float]:
    """Return angles from 0 to 360 degrees."""
    count = math.floor(360.0 / step * (1.0 + 1e-12))
    return [n * step for n in range(count)] + [min(360.0, count * step)]


@click.group("waves", cls=HelpGroup)
def waves_command() -> None:
    """Compute waves in the laminate of a DECK, or of a layup (the report's chapter 2)."""


@waves_command.command(
    "dispersion",
    cls=_ListCommand,
    epilog=typical(
        "fecm waves dispersion impact-patch.inp --angle 0 45 90 --plot dispersion.png",
        "fecm waves dispersion impact-patch.inp --wavelengths 1:20:100 -o dispersion.csv",
    ),
)
@option(
    "--angle",
    "angles",
    type=list_of("A,B,...", Finite()),
    multiple=True,
    callback=_joined,
    default=("0", "45", "90"),
    show_default=True,
    metavar="A ...",
    help="Directions of propagation, degrees; one or several.",
)
@option(
    "--wavelengths",
    type=Parsed(_wavelengths, "FROM:TO:N"),
    default="0.1:20:200",
    show_default=True,
    help="N wavelengths at equal distances, in thicknesses.",
)
@option(
    "--mode",
    "modes",
    type=list_of("NAME,...", OneOf(MODES)),
    default=",".join(MODES),
    show_default=True,
    help="Modes to write and draw; flexural_1 is the lowest flexural wave.",
)
@_SHARED
def dispersion_command(
    angles: tuple[float, ...],
    wavelengths: tuple[float, ...],
    modes: tuple[str, ...],
    source: LaminateSource,
    targets: OutputPaths,
) -> None:
    """Write phase velocity and frequency of the modes by wavelength (figures 2.4, 2.5)."""
    _bound(5 * len(angles) * len(wavelengths))
    waves = source.waves()
    curves = [waves.dispersion(angle, wavelengths) for angle in angles]
    rows = (
        (
            curve.angle,
            wavelength,
            mode,
            curve.phase_velocity.item(row, place),
            curve.angular_frequency.item(row, place),
        )
        for curve in curves
        for row, wavelength in enumerate(curve.wavelength.tolist())
        for place, mode in enumerate(curve.modes)
        if mode in modes
    )
    targets.draw("studies:dispersion_picture", waves.medium, curves, modes)
    dimensions = {
        "angle_deg": "",
        "wavelength_over_h": "",
        "mode": "",
        "phase_velocity": VELOCITY,
        "angular_frequency": "1/time",
    }
    targets.write(dimensions, waves.units, rows)


@waves_command.command(
    epilog=typical(
        "fecm waves speeds impact-patch.inp -o speeds.csv",
        "fecm waves speeds impact-patch.inp --plot speeds.png",
    )
)
@STEP
@_SHARED
def speeds(step: float, source: LaminateSource, targets: OutputPaths) -> None:
    """Write the normal velocities of the five wave fronts (figures 2.7, 2.8)."""
    _bound(360.0 / step)
    waves = source.waves()
    fronts = waves.fronts(_normals(step))
    rows = np.column_stack([fronts.normal, fronts.velocity]).tolist()
    targets.draw("studies:speeds_picture", waves.surfaces, waves.units)
    _note_names(waves)
    targets.write({"angle_deg": "", **dict.fromkeys(fronts.modes, VELOCITY)}, waves.units, rows)


@waves_command.command(
    cls=_ListCommand,
    epilog=typical(
        "fecm waves fronts impact-patch.inp --time 10e-6 -o fronts.csv",
        "fecm waves fronts impact-patch.inp --time 10e-6 20e-6 --plot fronts.png",
    ),
)
@option(
    "--time",
    "times",
    type=list_of("T,T,...", NOT_NEGATIVE),
    multiple=True,
    callback=_joined,
    required=True,
    metavar="T ...",
    help="Times; one or several.",
)
@option(
    "--radius",
    type=NOT_NEGATIVE,
    metavar="R",
    help="Radius of the circular fronts at time 0.  [default: the thickness]",
)
@STEP
@_SHARED
def fronts(
    times: tuple[float, ...],
    radius: float | None,
    step: float,
    source: LaminateSource,
    targets: OutputPaths,
) -> None:
    """Write front positions, rays and strengths (figures 2.9 to 2.12).

    The strength of a front is 1 at the first time.  Cusps go to standard error.
    """
    _bound(5 * len(times) * 360.0 / step)
    waves = source.waves()
    start = waves.thickness if radius is None else radius
    surfaces = waves.fronts(_normals(step))
    if not math.isfinite(max(times) * float(surfaces.velocity.max()) + start):
        raise RefusedError("the positions of the fronts overflow at these times")
    positions = [surfaces.positions(time, start).tolist() for time in times]
    lengths = [np.abs(surfaces.growth(time, start)).tolist() for time in times]
    strengths = [surfaces.strength(times[0], time, start).tolist() for time in times]
    rays, normals = surfaces.ray_angle.tolist(), surfaces.normal.tolist()
    rows = (
        (
            mode,
            normal,
            time,
            *positions[number][row][place],
            rays[row][place],
            lengths[number][row][place],
            strengths[number][row][place],
        )
        for place, mode in enumerate(surfaces.modes)
        for row, normal in enumerate(normals)
        for number, time in enumerate(times)
    )
    targets.draw("studies:fronts_picture", waves.surfaces, times, start, waves.units)
    _note_names(waves)
    for time in times:
        cusps = waves.cusps(time, start)
        if not cusps:
            note(f"no cusps at time {time:g}")
        for mode in surfaces.modes:
            if cusps_of_mode := [cusp for cusp in cusps if cusp.mode == mode]:
                texts = (
                    f"normal {c.normal:.4f} deg at {c.x:.6g}, {c.y:.6g}" for c in cusps_of_mode
                )
                note(f"{mode} has {len(cusps_of_mode)} cusps at time {time:g}: {'; '.join(texts)}")
    dimensions = {
        "mode": "",
        "normal_deg": "",
        "time": "time",
        "x": "length",
        "y": "length",
        "ray_deg": "",
        "length_per_radian": "length",
        "strength": "",
    }
    targets.write(dimensions, waves.units, rows)


def _bound(rows: float) -> None:
    if rows > MOST:
        raise RefusedError(f"the table would have {rows:.3g} rows; at most {MOST} are allowed")


def _note_names(waves: Waves) -> None:
    """Note where another component than the name's dominates a front."""
    for front, runs in waves.surfaces.misnamed().items():
        places = ", ".join(f"{first:g} to {last:g}" for first, last in runs)
        note(f"at normals {places} deg, another component dominates the front named {front}")
