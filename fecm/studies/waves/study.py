"""Waves in the laminate of a deck, or of a layup."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fecm._errors import StudyError
from fecm._table import Row, Table, html_table, text_lines
from fecm.authoring.laminate import Laminate, stiffness_of_laminate
from fecm.authoring.parameters import check_positive
from fecm.deck.model import Deck
from fecm.deck.units import VELOCITY, quantity, unit_names, unit_of
from fecm.mechanics.laminate import LaminateSection as Stiffness
from fecm.problem.loading import sole_problem
from fecm.problem.problem import Problem
from fecm.studies.waves.fronts import Cusp, Fronts, WaveSurfaces
from fecm.studies.waves.harmonic import Dispersion, Medium, dispersion

NORMALS = (0.0, 45.0, 90.0)  # of the fronts that ``print`` shows


class Waves:
    """Plane waves and wave fronts in an infinite laminate, created by `fecm.waves`.

    Angles are in degrees, counter-clockwise from the x-axis.

    Attributes
    ----------
    medium : Medium
        Stiffness and inertia.
    units : dict of str to str
        Names of the units; empty if they are unknown.
    notes : tuple of str
        Assumptions and omissions.
    """

    def __init__(self, medium: Medium, units: dict[str, str], notes: tuple[str, ...] = ()) -> None:
        self.medium: Medium = medium
        self.units: dict[str, str] = units
        self.notes: tuple[str, ...] = notes

    @property
    def thickness(self) -> float:
        """Thickness of the laminate, length."""
        return self.medium.laminate.thickness

    @cached_property
    def surfaces(self) -> WaveSurfaces:
        """The five fronts, tracked over all normals."""
        return WaveSurfaces(self.medium)

    def dispersion(self, angle: float, wavelengths: ArrayLike) -> Dispersion:
        """Return phase velocities and frequencies of all five modes, equations 2-27 to 2-34.

        Parameters
        ----------
        angle : float
            Direction of propagation.
        wavelengths : array_like (n,)
            Wavelengths over the thickness.

        Returns
        -------
        Dispersion
            Velocities (length/time) and angular frequencies (radian/time), (n, modes).

        Raises
        ------
        StudyError
            If a wavelength is outside 1e-9 to 1e9, or the laminate's constants are out of range.
        """
        return dispersion(self.medium, angle, wavelengths)

    def fronts(self, normals: ArrayLike) -> Fronts:
        """Return velocities, rays and positions of the five fronts, equations 2-60 to 2-87.

        Parameters
        ----------
        normals : array_like (n,)
            Angles of the fronts' normals.

        Returns
        -------
        Fronts
            Normal velocities (length/time), (n, fronts); the method `positions` gives the fronts
            at a time.
        """
        return self.surfaces.fronts(normals)

    def cusps(self, time: float, radius: float | None = None) -> list[Cusp]:
        """Return the cusps of the fronts that start as a circle.

        Parameters
        ----------
        time : float
            Time since the start.
        radius : float, optional
            Radius of the circle, length; the thickness by default.

        Returns
        -------
        list of Cusp
            Cusps by front, then by the angle of the normal.

        Raises
        ------
        StudyError
            If time or radius is negative or not finite.
        """
        start = self.thickness if radius is None else radius
        if not (np.isfinite([time, start]).all() and time >= 0.0 and start >= 0.0):
            raise StudyError(f"time {time:g} and radius {start:g} must not be negative")
        return self.surfaces.cusps(time, start)

    def _table(self) -> Table:
        """Return the velocities of the fronts along three normals."""
        speed, length = (unit_of(kind, self.units) for kind in (VELOCITY, "length"))
        fronts = self.fronts(NORMALS)
        rows: tuple[Row, ...] = tuple(
            (mode, *(quantity(value, speed) for value in values))
            for mode, values in zip(fronts.modes, fronts.velocity.T, strict=True)
        )
        header = ("front", *(f"normal at {normal:g} deg" for normal in NORMALS))
        return Table(rows, header, f"waves in a laminate of {quantity(self.thickness, length)}")

    def __repr__(self) -> str:
        return f"<fecm {self._table().title}>"

    def __str__(self) -> str:
        table = self._table()
        return "\n".join([table.title, *text_lines(table), *(f"note: {n}" for n in self.notes)])

    def _repr_html_(self) -> str:
        """Return the table of velocities, for notebooks."""
        return html_table(self._table())


def waves(
    laminate: Laminate | str | Path | Deck, *, shear_factor: float = 1.0, units: str | None = None
) -> Waves:
    """Return plane waves and wave fronts in a laminate (report, chapter 2).

    The laminate is a layup, or the laminate of a deck. In a plate with several laminates it is the
    laminate under the load. An initial membrane force is neglected, with a note.

    Parameters
    ----------
    laminate : Laminate, str, Path or Deck
        Layup and plies, or a deck with a single problem.
    shear_factor : float
        Factor of the transverse shear stiffness, in addition to a deck's SHEA; with pi^2/12 the
        cut-off frequencies are exact.
    units : str, optional
        Units to which a named ply of a `Laminate` is converted, as in ``"mm-N-s"``; by default the
        units of its source.

    Returns
    -------
    Waves
        Dispersion, fronts and cusps.

    Raises
    ------
    DeckError
        If the deck has errors.
    StudyError
        If stiffness or inertia is not positive definite.
    ValueError
        If the laminate is incomplete or impossible, or the deck has several problems or none.

    Examples
    --------
    >>> import fecm
    >>> waves = fecm.waves(fecm.Laminate("[0/45/0/-45/0]2s", "report", 0.0053))
    >>> curve = waves.dispersion(0.0, [1.0, 10.0])
    >>> curve.modes
    ('flexural_1', 'flexural_2', 'flexural_3', 'extension', 'in_plane_shear')
    >>> print(f"{curve.phase_velocity[1, 0]:.0f} {waves.units['length']}/{waves.units['time']}")
    43050 in/s
    """
    check_positive(shear_factor=shear_factor)
    if not isinstance(laminate, Laminate):
        if units is not None:
            raise StudyError("the deck has its own `units`; leave them out")
        return waves_of(sole_problem(laminate, warns=False), shear_factor)
    notes: list[str] = []
    stiffness, names = stiffness_of_laminate(laminate, units, notes)
    return _waves_in_section(stiffness, shear_factor, names, notes)


def waves_of(problem: Problem, shear_factor: float) -> Waves:
    """Return the waves in the laminate of a checked problem."""
    notes: list[str] = []
    if problem.plate.is_preloaded:
        notes.append("PREL is left out: these are waves of the laminate without preload")
    if problem.plate.is_curved:
        notes.append("CURV is left out: these are waves of the flat laminate")
    if problem.plate.others:
        notes.append("the plate has several laminates; these are waves of the one under the load")
    return _waves_in_section(problem.laminate, shear_factor, unit_names(problem.deck), notes)


def _waves_in_section(
    stiffness: Stiffness, factor: float, units: dict[str, str], notes: list[str]
) -> Waves:
    """Return the waves in a laminate with a factor on its shear stiffness."""
    scaled = replace(stiffness, shear=factor * stiffness.shear)
    return Waves(Medium(scaled), units, tuple(notes))
