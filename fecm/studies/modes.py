"""Natural modes of a deck's plate, without its projectile and its macro program."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Annotated, TypedDict

import numpy as np

from fecm._errors import OptionsError
from fecm._table import Row, ShownNumber, Table, html_table, titled_lines
from fecm._text import significant
from fecm._typing import Floats
from fecm.deck import model
from fecm.deck.model import Deck, OneSidedSupports
from fecm.deck.reader import with_cards
from fecm.deck.units import column_name, unit_names
from fecm.mechanics.interpolation import W
from fecm.mechanics.projectile import CONSISTENT, LUMPED, MassMatrix
from fecm.mechanics.solutions import SingularStiffnessError, Tangent
from fecm.mechanics.symmetry import restrain_resting_dofs
from fecm.problem.build import RunOptions
from fecm.problem.loading import AnyDeck, load_deck, sole
from fecm.problem.problem import Problem
from fecm.problem.supports import closed_in_words
from fecm.problem.symmetry import symmetry_lines
from fecm.results.modes import frequencies_of, is_in_plane
from fecm.results.result import Result
from fecm.simulation.job import ProblemRun

MOST_MODES = 200
SEPARABLE = 0.95  # share of the squares of a shape by one product X(x) Y(y) that has nodal lines
ZERO = 0.05  # of the largest value of X or Y, below which its sign is not counted
SAME_PLACE = 1e-6  # difference of two coordinates, over the size of the mesh
DIGITS = 6
MASS_WORDS = {LUMPED: "LMAS", CONSISTENT: "CMAS"}  # macros of the mass matrices
# Segments that no natural mode feels.
OF_IMPACT = (
    model.Projectile,
    model.Indentation,
    model.Allowables,
    model.Delamination,
    model.Damping,
    model.Cure,
    model.Gages,
)


class ModeJson(TypedDict):
    """Natural mode in JSON."""

    number: int
    frequency: float
    period: Annotated[float, "Infinite for a rigid motion."]
    share: Annotated[float, "Of the static flexibility at the impact point; NaN if not known."]
    in_plane: Annotated[bool, "Whether the mode moves the plate in its plane only."]
    nodal_lines: Annotated[
        list[int] | None, "Numbers of lines that cross x and y; null if the shape has other ones."
    ]


class FrequenciesJson(TypedDict):
    """What natural modes and a fit to them have in common in JSON."""

    title: str
    units: Annotated[dict[str, str], "Names of the units; empty if the deck names none."]
    frequency_unit: Annotated[str, "Hz if the deck's unit of time is known."]


class ModesJson(FrequenciesJson):
    """Natural modes of a deck in JSON."""

    modes: list[ModeJson]
    notes: list[str]


@dataclass(frozen=True, eq=False)
class PlateModes:
    """Natural modes of a plate; ``str()`` is the page of `fecm modes`.

    Attributes
    ----------
    title : str
        Title of the deck.
    frequency : ndarray (n,)
        Natural frequencies, ascending; 0 for rigid motions.
    frequency_unit : str
        ``"Hz"`` if the deck's unit of time is known.
    period : ndarray (n,)
        Periods in the deck's unit of time; infinite for rigid motions.
    share : ndarray (n,)
        Share of each mode in the static flexibility at the impact point, (g phi)^2/(omega^2 C); NaN
        for a deck without PATC and ROD and for a plate that is not held.
    nodal_lines : tuple
        Numbers of nodal lines that cross x and that cross y; None for shapes without such lines.
    in_plane : tuple of bool
        Whether each mode moves the plate in its plane only.
    notes : tuple of str
        What the modes leave out.
    units : dict of str to str
        Names of the deck's units; empty if it states none.
    result : Result
        The result of the macro EIGE, with the group ``modes``.
    """

    title: str
    frequency: Floats
    frequency_unit: str
    period: Floats
    share: Floats
    nodal_lines: tuple[tuple[int, int] | None, ...]
    in_plane: tuple[bool, ...]
    notes: tuple[str, ...]
    units: dict[str, str]
    result: Result

    def to_dict(self) -> ModesJson:
        """Return plain values, as `fecm modes --format json` prints them."""
        modes: list[ModeJson] = [
            {
                "number": number,
                "frequency": frequency,
                "period": period,
                "share": share,
                "in_plane": in_plane,
                "nodal_lines": None if lines is None else [*lines],
            }
            for number, frequency, period, share, lines, in_plane in self._rows()
        ]
        return {
            "title": self.title,
            "units": self.units,
            "frequency_unit": self.frequency_unit,
            "modes": modes,
            "notes": [*self.notes],
        }

    def _rows(self) -> Iterator[tuple[int, float, float, float, tuple[int, int] | None, bool]]:
        return zip(
            range(1, len(self.frequency) + 1),
            self.frequency.tolist(),
            self.period.tolist(),
            self.share.tolist(),
            self.nodal_lines,
            self.in_plane,
            strict=True,
        )

    def _table(self) -> Table:
        rows: list[Row] = []
        for number, frequency, period, share, lines, in_plane in self._rows():
            shown = "in the plane" if in_plane else "-"
            if lines is not None:
                shown = "{}, {}".format(*lines)
            rows.append((
                ShownNumber(number, str(number)),
                ShownNumber(frequency, significant(frequency, DIGITS)),
                ShownNumber(period, significant(period, DIGITS) if frequency else "-"),
                ShownNumber(share, "-" if math.isnan(share) else f"{share:.2%}"),
                "rigid" if not frequency else shown,
            ))  # fmt: skip
        header = (
            "mode",
            column_name("frequency", self.frequency_unit),
            column_name("period", self.units.get("time", "")),
            "share of flexibility",
            "nodal lines across x, y",
        )
        return Table(tuple(rows), header, title=self.title or "(no title)")

    def lines(self, columns: int | None = None) -> list[str]:
        """Return the lines that `fecm modes` prints; `columns` is the longest."""
        return titled_lines(self._table(), columns=columns)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        """Return tables of the modes and their notes, for notebooks."""
        notes = (Table(tuple(("note", note) for note in self.notes)),) if self.notes else ()
        return html_table(self._table(), *notes)


def modes(
    deck: AnyDeck,
    number: int = 6,
    *,
    mass: MassMatrix = LUMPED,
    held: bool = False,
    output: str | Path | None = None,
    overwrite: bool = False,
) -> PlateModes:
    """Compute the natural modes of the plate of a deck.

    The deck needs no projectile and no macro program. u and v are held where they do not move with
    w: modes in the plane are then not found. :func:`fecm.check` has the warnings about the deck.

    Parameters
    ----------
    deck : str, Path, file or Deck
        Deck with a single problem.
    number : int
        Number of modes, from the lowest.
    mass : {"lumped", "consistent"}
        Mass matrix; a run has the lumped one.
    held : bool
        Close all one-sided supports (UNIL). Otherwise those with a gap are open.
    output : str or Path, optional
        Result file to write.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    PlateModes
        Frequencies, periods, shares of the static flexibility, nodal lines; the shapes are in its
        `result`.

    Raises
    ------
    DeckError
        If the deck has errors.
    OptionsError
        If the deck does not have exactly one problem, or an argument is not valid.
    OSError
        If a file can't be read or written.

    Examples
    --------
    >>> import fecm
    >>> modes = fecm.modes("decks/static-bending.inp", 3)
    >>> len(modes.frequency)
    3
    """
    problem = problem_of_modes(deck, number, mass=mass, held=held)
    path = None if output is None else Path(output)
    result = ProblemRun(problem, RunOptions(), path, overwrite=overwrite).execute()
    frequency, unit = frequencies_of(result)
    omega, shapes = result["modes/angular_frequency"], result["modes/shape"]
    rigid = omega == 0.0
    period = np.where(rigid, np.inf, 2.0 * np.pi / np.where(rigid, 1.0, omega))
    return PlateModes(
        title=problem.deck.title,
        frequency=frequency,
        frequency_unit=unit,
        period=period,
        share=_shares(problem, omega, shapes),
        nodal_lines=tuple(_nodal_lines(problem, shape) for shape in shapes),
        in_plane=tuple(map(is_in_plane, shapes)),
        notes=tuple(_notes(problem)),
        units=unit_names(problem.deck),
        result=result,
    )


def problem_of_modes(
    deck: AnyDeck, number: int, *, mass: MassMatrix = LUMPED, held: bool = False
) -> Problem:
    """Return the problem whose program finds the modes of a deck; see :func:`modes`."""
    if not 1 <= number <= MOST_MODES:
        raise OptionsError(f"number is {number}; it is a number from 1 to {MOST_MODES}")
    if mass not in MASS_WORDS:
        raise OptionsError(f"unknown mass {mass!r}; known are {', '.join(MASS_WORDS)}")
    program = f"{MASS_WORDS[mass]}\nEIGE,,{number}\nEND"
    loaded = load_deck(deck, change=partial(_changed, program=program, held=held))
    loaded.refuse_errors()
    return _bending(sole(loaded.problems))


def _changed(deck: Deck, *, program: str, held: bool) -> Deck:
    """Return a deck with the program of its modes, without the segments that no mode feels."""
    segments = tuple(s for s in deck.segments if not isinstance(s, OF_IMPACT))
    if held:
        segments = tuple(
            replace(s, records=tuple(replace(record, gap=0.0) for record in s.records))
            if isinstance(s, OneSidedSupports)
            else s
            for s in segments
        )
    return replace(with_cards(deck, program), segments=segments, text="")


def _bending(problem: Problem) -> Problem:
    """Return a problem whose u and v are held if they do not move with w."""
    plate = problem.plate
    mesh = restrain_resting_dofs(replace(plate, nonlinear=False), None).mesh
    if mesh is plate.mesh:
        return problem
    held = (mesh.codes != 0).astype(int).tolist()
    rows = (model.NodeCodes(node, 0, tuple(codes)) for node, codes in enumerate(held, start=1))
    segments = (*problem.deck.segments, model.Boundary(tuple(rows)))
    return Problem(replace(problem.deck, segments=segments), mesh, problem.program)


def _shares(problem: Problem, omega: Floats, shapes: Floats) -> Floats:
    """Return the share of each mode in the static flexibility at the impact point."""
    unknown = np.full(len(omega), np.nan)
    if (load := problem.unit_load) is None:
        return unknown
    plate = problem.plate
    at_load = load[plate.mesh.equations > 0]
    try:
        flexibility = float(at_load @ Tangent(plate).solve(at_load))
    except SingularStiffnessError:
        return unknown
    along = np.einsum("nd,mnd->m", load, shapes)
    return np.asarray(along**2 / (omega**2 * flexibility))


def _nodal_lines(problem: Problem, shape: Floats) -> tuple[int, int] | None:
    """Return the numbers of nodal lines of a mode, (numnp, 5), that cross x and that cross y.

    Returns None unless w is nearly a product X(x) Y(y) on a rectangular grid of corners of
    elements. Supported lines, and a rim outside them, are not counted.
    """
    if is_in_plane(shape):
        return None
    corners = np.unique(problem.mesh.elements[~problem.outside_supports, :4]) - 1
    places = problem.mesh.coordinates[corners, :2]
    near = SAME_PLACE * float(np.ptp(places, axis=0).max())
    columns, rows = (
        np.unique(np.round(places[:, axis] / near), return_inverse=True)[1] for axis in (0, 1)
    )
    grid = np.full((rows.max() + 1, columns.max() + 1), np.nan)
    grid[rows, columns] = shape[corners, W]
    if grid.size != len(corners) or np.isnan(grid).any():
        return None
    across_y, sizes, across_x = np.linalg.svd(grid)
    if sizes[0] ** 2 < SEPARABLE * (sizes**2).sum():
        return None
    return _changes_of_sign(across_x[0]), _changes_of_sign(across_y[:, 0])


def _changes_of_sign(values: Floats) -> int:
    """Count the changes of sign between values that are not small."""
    signs = np.sign(values[np.abs(values) > ZERO * np.abs(values).max()])
    return sum(a != b for a, b in pairwise(signs.tolist()))


def _notes(problem: Problem) -> Iterator[str]:
    """Yield what the modes of a deck leave out."""
    deck, plate = problem.deck, problem.plate
    if lines := [str(line) for line in symmetry_lines(deck, problem.mesh)]:
        yield (
            f"the edges {' and '.join(lines)} are held as lines of symmetry are: if the deck has "
            "one part of a plate, only the modes that are symmetric about them are found"
        )
    if plate.supports is not None and plate.lifts:
        yield closed_in_words(plate.supports, np.zeros(plate.mesh.equations.shape))
