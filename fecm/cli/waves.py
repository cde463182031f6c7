"""``fecm waves``: dispersion, speeds and fronts of waves in a laminate, as CSV and as pictures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from fecm.api import load_deck
from fecm.cli.common import DECK_PATH, RefusedError, count_errors
from fecm.cli.laminate_options import laminate_of_options
from fecm.cli.new import OptionError
from fecm.cli.outputs import OUTPUT, OVERWRITE, PLOT, OutputPaths
from fecm.cli.types import ListCommand, number
from fecm.deck.units import unit_names
from fecm.mechanics.laminate import Laminate
from fecm.plot.kinds import Picture
from fecm.problem.build import laminate_of_deck
from fecm.studies.waves import FRONTS, MODES, Medium, WaveSurfaces
from fecm.studies.waves import dispersion as compute

# A table of more rows is certainly a typo.
MOST = 1_000_000


# What is typed -----------------------------------------------------------------------------------


def _range(context: click.Context, parameter: click.Parameter, text: str) -> tuple[float, ...]:
    """Wavelengths at equal distances, from FROM:TO:N."""
    parts = text.split(":")
    try:
        first, last, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        first, last, count = math.nan, math.nan, 0
    if len(parts) != 3 or not 0.0 < first <= last < math.inf or count < 1:
        raise RefusedError(
            f"--wavelengths takes FROM:TO:N with 0 < FROM <= TO and N >= 1, as in 0.1:20:200, "
            f"not `{text}`"
        )
    if (count == 1) != (first == last):
        raise RefusedError(f"--wavelengths {text}: one wavelength, and only one, has FROM = TO")
    if count > MOST // 5:
        raise RefusedError(f"--wavelengths {text}: {MOST // 5} wavelengths are the most")
    step = (last - first) / max(1, count - 1)
    return (*(first + n * step for n in range(count - 1)), last)


_SHARED = (
    click.argument("deck", type=DECK_PATH, required=False),
    click.option("--layup", metavar="LAYUP",
                 help='Without a deck: layup from the struck face on, as in "[0/45/0/-45/0]2s".'),
    click.option("--ply-thickness", callback=number(0.0, above=True), metavar="T",
                 help="Thickness of a ply."),
    click.option("--ply", metavar="RHO,NU12,E1,E2,G12,G13,G23", help="Constants of a ply."),
    click.option("--material", metavar="NAME",
                 help="A named ply instead; `fecm materials` lists them."),
    click.option("--units", metavar="SYSTEM",
                 help="in-lbf-s, m-N-s or mm-N-s: names the units, and gives a named ply in them."),
    click.option("--shear-factor", callback=number(0.0, above=True), default="1", metavar="F",
                 show_default=True,
                 help="Multiplies the transverse shear stiffness (a deck's own by SHEA, too); with "
                      "pi^2/12 = 0.822467 the cut-off frequencies are exact."),
    OUTPUT,
    PLOT,
    OVERWRITE,
)  # fmt: skip


def _shared(function: Callable[..., None]) -> Callable[..., None]:
    """Add what the three commands share, behind their own options."""
    for decorator in reversed(_SHARED):
        function = decorator(function)
    return function


@dataclass(frozen=True)
class _Job:
    """A laminate, and where what is found about it goes."""

    medium: Medium
    units: dict[str, str]
    targets: OutputPaths

    def finish(
        self,
        header: str,
        rows: Iterable[Sequence[object]],
        draw: Callable[[], Picture],
        notes: Iterable[str] = (),
    ) -> None:
        """Tell the notes, write the table and the picture."""
        self.targets.draw(draw)
        for note in notes:
            _note(note)
        lines = (",".join(map(str, row)) + "\n" for row in rows)
        self.targets.write(itertools.chain([header + "\n"], lines))


def _job(
    *,
    deck: Path | None,
    layup: str | None,
    shear_factor: float,
    output: Path,
    picture: Path | None,
    overwrite: bool,
    **constants: Any,
) -> _Job:
    """Check the outputs and make the laminate."""
    targets = OutputPaths.checked(output, picture, overwrite, deck)
    laminate, units = _laminate(deck, layup, constants)
    try:
        medium = Medium(replace(laminate, shear=shear_factor * laminate.shear))
    except ValueError as error:
        raise RefusedError(str(error)) from None
    return _Job(medium, units, targets)


def _laminate(
    deck: Path | None, layup: str | None, constants: dict[str, Any]
) -> tuple[Laminate, dict[str, str]]:
    """Laminate and names of units, from a deck or from options."""
    given = [name for name, value in constants.items() if value is not None]
    if deck is None and layup is None:
        raise RefusedError("give a DECK, or --layup, --ply-thickness and --ply or --material")
    if deck is not None and (layup is not None or given):
        option = "layup" if layup is not None else given[0]
        raise RefusedError(
            f"--{option.replace('_', '-')} describes a laminate; {deck} has one already"
        )
    if deck is not None:
        return _laminate_of_deck(deck)

    try:
        return laminate_of_options(layup or "", **constants)
    except OptionError as error:
        raise RefusedError(str(error)) from None


def _laminate_of_deck(path: Path) -> tuple[Laminate, dict[str, str]]:

    prepared = load_deck(path)
    if errors := prepared.errors(force=True):
        for finding in errors:
            click.echo(finding.render(prepared.source), err=True)
        raise RefusedError(f"{count_errors(errors)}; no waves were computed")
    if len(prepared.problems) > 1:
        _note(f"{path} has {len(prepared.problems)} problems; the first one's laminate is taken")
    deck = prepared.problems[0].deck
    return laminate_of_deck(deck), unit_names(deck)


def _note(text: str) -> None:
    click.echo(f"fecm: note: {text}", err=True)


def _normals(step: float) -> list[float]:
    """Angles from 0 to 360 degrees."""
    count = math.floor(360.0 / step * (1.0 + 1e-12))
    return [n * step for n in range(count)] + [min(360.0, count * step)]


# Commands ----------------------------------------------------------------------------------------


@click.group(short_help="Waves in a laminate.")
def waves() -> None:
    """Waves in the laminate of a DECK, or of a layup: the report's chapter 2, for any laminate."""


@waves.command(cls=ListCommand)
@click.option("--angle", "angles", multiple=True, callback=number(), default=("0", "45", "90"),
              show_default=True, metavar="A ...",
              help="Directions of propagation, degrees; several, or repeated.")  # fmt: skip
@click.option("--wavelengths", callback=_range, default="0.1:20:200", show_default=True,
              metavar="FROM:TO:N",
              help="N wavelengths over the thickness at equal distances.")  # fmt: skip
@_shared
def dispersion(angles: tuple[float, ...], wavelengths: tuple[float, ...], **shared: Any) -> None:
    """Phase velocity and frequency of all modes against wavelength (figures 2.4, 2.5)."""
    _bound(5 * len(angles) * len(wavelengths))
    job = _job(**shared)
    try:
        curves = [compute(job.medium, angle, wavelengths) for angle in angles]
    except ValueError as error:
        raise RefusedError(str(error)) from None
    rows = (
        (curve.angle, wavelength, mode, velocity, frequency)
        for curve in curves
        for wavelength, velocities, frequencies in zip(
            curve.wavelength.tolist(),
            curve.phase_velocity.tolist(),
            curve.angular_frequency.tolist(),
            strict=True,
        )
        for mode, velocity, frequency in zip(MODES, velocities, frequencies, strict=True)
    )

    def draw() -> Picture:
        from fecm.plot.waves import dispersion_picture

        return dispersion_picture(job.medium, curves)

    job.finish("angle_deg,wavelength_over_h,mode,phase_velocity,angular_frequency", rows, draw)


@waves.command()
@click.option("--step", callback=number(0.0, above=True), default="5", show_default=True,
              metavar="DEG", help="Degrees from one normal to the next.")  # fmt: skip
@_shared
def speeds(step: float, **shared: Any) -> None:
    """Normal velocities of the five wave fronts (figures 2.7, 2.8)."""
    _bound(360.0 / step)
    job = _job(**shared)
    surfaces = _surfaces(job.medium)
    fronts = surfaces.fronts(_normals(step))
    rows = (
        (normal, *velocities)
        for normal, velocities in zip(fronts.normal.tolist(), fronts.velocity.tolist(), strict=True)
    )

    def draw() -> Picture:
        from fecm.plot.waves import speeds_picture

        return speeds_picture(surfaces, job.units)

    job.finish(",".join(("angle_deg", *FRONTS)), rows, draw, _notes_of_names(surfaces))


@waves.command(cls=ListCommand)
@click.option("--time", "times", multiple=True, required=True, callback=number(0.0),
              metavar="T ...", help="Times; several, or repeated.")  # fmt: skip
@click.option("--radius", callback=number(0.0), metavar="R",
              help="Radius of the circle that the fronts are at time 0.  "
                   "[default: the thickness]")  # fmt: skip
@click.option("--step", callback=number(0.0, above=True), default="5", show_default=True,
              metavar="DEG", help="Degrees from one normal to the next.")  # fmt: skip
@_shared
def fronts(times: tuple[float, ...], radius: float | None, step: float, **shared: Any) -> None:
    """Front positions and rays (figures 2.9 to 2.12); cusps go to standard error."""
    _bound(5 * len(times) * 360.0 / step)
    job = _job(**shared)
    start = job.medium.laminate.thickness if radius is None else radius
    surfaces = _surfaces(job.medium)
    found = surfaces.fronts(_normals(step))
    if not math.isfinite(max(times) * float(found.velocity.max()) + start):
        raise RefusedError("the fronts would be beyond all range at these times")
    positions = [found.positions(time, start).tolist() for time in times]
    rays, normals = found.ray_angle.tolist(), found.normal.tolist()
    rows = (
        (mode, normal, time, *positions[at][row][place], rays[row][place])
        for place, mode in enumerate(FRONTS)
        for row, normal in enumerate(normals)
        for at, time in enumerate(times)
    )

    def draw() -> Picture:
        from fecm.plot.waves import fronts_picture

        return fronts_picture(surfaces, times, start, job.units)

    notes = _notes_of_names(surfaces) + _notes_of_cusps(surfaces, times, start)
    job.finish("mode,normal_deg,time,x,y,ray_deg", rows, draw, notes)


def _bound(rows: float) -> None:
    if rows > MOST:
        raise RefusedError(f"the table would have {rows:.3g} rows; {MOST} are the most")


def _surfaces(medium: Medium) -> WaveSurfaces:

    try:
        return WaveSurfaces(medium)
    except ValueError as error:
        raise RefusedError(str(error)) from None


def _notes_of_names(surfaces: WaveSurfaces) -> list[str]:
    """Where fronts move mostly in another way than their names say."""
    notes = []
    for front, runs in surfaces.misnamed().items():
        places = ", ".join(f"{first:g} to {last:g}" for first, last in runs)
        notes.append(f"the front named {front} moves more in another way at normals {places} deg")
    return notes


def _notes_of_cusps(surfaces: WaveSurfaces, times: Sequence[float], radius: float) -> list[str]:
    """Where the fronts have cusps: a line for each time and mode."""
    notes = []
    for time in times:
        found = surfaces.cusps(time, radius)
        if not found:
            notes.append(f"no cusps at time {time:g}")
        for mode in FRONTS:
            if ones := [cusp for cusp in found if cusp.mode == mode]:
                told = "; ".join(f"normal {c.normal:.4f} deg at {c.x:.6g}, {c.y:.6g}" for c in ones)
                notes.append(f"{mode} has {len(ones)} cusps at time {time:g}: {told}")
    return notes
