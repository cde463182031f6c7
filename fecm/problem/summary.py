"""Summary of a checked deck for ``fecm check``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np

from fecm._machine import format_bytes
from fecm._table import Row, Table, titled_lines
from fecm._text import significant
from fecm._typing import FiniteFloat, Floats
from fecm.deck.macros import flat
from fecm.deck.model import Compact, Cure, Impact, Shear
from fecm.deck.units import MASS, MODULUS, mass_in_si, quantity, unit_names, unit_of
from fecm.judge.threshold import from_threshold
from fecm.mechanics.interpolation import W
from fecm.mechanics.plate import UnsoundPlateError
from fecm.mechanics.ply_stresses import equilibrium_shear_stiffness
from fecm.mechanics.solutions import FAR, SingularStiffnessError, compliance
from fecm.mechanics.stiffness_product import SAFE
from fecm.mechanics.strains import midplane_height
from fecm.mechanics.time_step import taken_time_step
from fecm.problem.estimates import MOST_SOLVED, format_mesh_error, resolution
from fecm.problem.problem import Problem
from fecm.problem.rules.preload import FEWEST_ELEMENTS
from fecm.problem.support_summary import SupportsSummary, support_rows, supports_summary
from fecm.results.stored import whole_plate

ROOM = 0.6  # share of the critical time step below which the step that DT 0 takes is shown
LABEL_WIDTH = 20  # of the lines of a summary, at least
ROUNDING = 1e-12  # of entries of a matrix, relative to their size


def leaves_out_equilibrium(problem: Problem) -> bool:
    """Return whether an impact has assumed shear strains and the factor 1 without EQUI."""
    card = problem.deck.last(Shear)
    plain = card is not None and card.assumed and not card.equilibrium and card.factor == 1.0
    return plain and problem.contact is not None


def equilibrium_change(problem: Problem) -> float | None:
    """Return the relative change of the static deflection by SHEA EQUI.

    The deck has the factor 1. Returns None for a plate that is not held, or with more elements than
    MOST_SOLVED: its static solution would take longer than all other checks.
    """
    plate, contact = problem.moving_plate, problem.contact
    if contact is None or problem.deck.control.numel > MOST_SOLVED:
        return None
    first, *other_laminates = (
        replace(laminate, shear=equilibrium_shear_stiffness(laminate))
        for laminate in plate.laminates
    )
    softer = replace(plate, laminate=first, others=tuple(other_laminates))
    try:
        return compliance(softer, contact) / compliance(plate, contact) - 1.0
    except SingularStiffnessError:
        return None


def larger_steps(problem: Problem) -> list[Row]:
    """Return the row about DT 0 if the deck's time step is far smaller."""
    largest = max((m.value for m in flat(problem.program) if m.word == "DT"), default=0.0)
    if not problem.work.steps or not 0.0 < largest < ROOM * problem.safe_time_step:
        return []
    least = problem.safe_time_step  # known, and a few per cent below the critical one
    default = f"{taken_time_step(least):.3g} {unit_of('time', unit_names(problem.deck))}".rstrip()
    fewer = (
        f"DT 0 takes at least {default}: {taken_time_step(least) / largest:.1f} times fewer steps"
    )
    return [("time step", f"DT is at most {largest / least:.2f} of the critical one; {fewer}")]


@dataclass(frozen=True, eq=False)
class ProblemSummary:
    """Numbers of a problem without errors, in the deck's units.

    Attributes
    ----------
    title : str
        Title of the deck.
    nodes, elements, equations : int
        Size of the mesh, and number of free degrees of freedom.
    layers : int
        Plies of the laminate under the load.
    thickness : float
        Thickness of this laminate.
    steps : int
        Impact steps of the program.
    nonlinear : bool
        Whether the deck has NONL.
    free_in_plane : int
        Nodes whose u and v are both free.
    preload : tuple of float
        N0x, N0y and N0xy of PREL, force/length; zeros without it.
    curvature : tuple of float
        1/Rx, 1/Ry and 1/Rxy of CURV, 1/length; zeros without it.
    rise : float
        Difference of the largest and the least height of a curved panel, length; 0 without CURV.
    A, B, D : ndarray (3, 3)
        Stiffness of the laminate under the load.
    shear : ndarray (2, 2)
        Its transverse shear stiffness, of xz and yz.
    plate_mass, projectile_mass : float
        Masses.
    critical_time_step : float
        Largest stable time step of the plate; NaN if a mass or stiffness is missing.
    buckling_factor : float or None
        Factor on the preload at which the plate buckles, infinite if that is far away; None where
        the preload does not compress the plate.
    elements_per_buckle : float or None
        Least number of elements along a buckle of a curved panel; None for a flat plate.
    time_steps : tuple of float
        Every DT of the program; 0 takes 0.9 of the critical time step.
    output_bytes : int
        Approximate size of the result, before compression.
    rows : dict
        Number of its rows by the macro that stores them.
    compact : bool
        Whether the result is compressed.
    at_most : bool
        Whether OVER may end the program earlier, so that steps and bytes are upper bounds.
    elements_per_wave : float or None
        Elements at the impact node per bending wave of the contact; None without impact.
    mesh_error : float or None
        Estimated error of the peak force due to the mesh, relative to it.
    equilibrium_change : float or None
        Relative change of the static deflection under the load by SHEA EQUI; None where it does not
        apply or is not computed.
    units : dict
        Names of the units; empty if the deck names none.
    laminate : int or None
        Number of the laminate under the load, where there are several.
    leaves_out_equilibrium : bool
        Whether SHEA EQUI would apply: an impact with SHEA MITC and the shear factor 1.
    velocity, energy : float or None
        Impact velocity and kinetic energy of the projectile; None without impact.
    cure : float or None
        Change of temperature of CURE, kelvin; None without CURE.
    threshold : float or None
        Delamination threshold, force; None without one.
    delaminations : int
        Number of delaminations at the threshold; 0 without one.
    symmetry_factor : int
        Number of equal parts of the plate of which the deck has one: 1, 2 or 4. Masses and energy
        are of the whole plate.
    symmetry_lines : str
        Lines of symmetry through the impact node; empty without.
    supports : dict or None
        Springs, one-sided supports and point masses; None without SPRI, UNIL and MASS.
    """

    title: str
    nodes: int
    elements: int
    layers: int
    thickness: float
    equations: int
    steps: int
    nonlinear: bool
    free_in_plane: int
    preload: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    curvature: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    rise: FiniteFloat
    A: Annotated[Floats, (3, 3)]
    B: Annotated[Floats, (3, 3)]
    D: Annotated[Floats, (3, 3)]
    shear: Annotated[Floats, (2, 2)]
    plate_mass: float
    projectile_mass: float
    critical_time_step: float
    buckling_factor: float | None
    elements_per_buckle: float | None
    time_steps: tuple[FiniteFloat, ...]
    output_bytes: int
    rows: dict[str, int]
    compact: bool
    at_most: bool
    elements_per_wave: FiniteFloat | None
    mesh_error: FiniteFloat | None
    equilibrium_change: FiniteFloat | None
    units: dict[str, str]
    laminate: int | None
    leaves_out_equilibrium: bool
    velocity: FiniteFloat | None
    energy: FiniteFloat | None
    cure: FiniteFloat | None
    threshold: FiniteFloat | None
    delaminations: int
    symmetry_factor: int
    symmetry_lines: str
    supports: SupportsSummary | None

    def to_dict(self) -> dict[str, object]:
        """Return plain values, for JSON."""
        values = vars(self).items()
        return {name: v.tolist() if isinstance(v, np.ndarray) else v for name, v in values}

    def lines(self, columns: int | None = None) -> list[str]:
        """Return the lines of text that ``fecm check`` prints; `columns` is the longest."""
        return titled_lines(summary_table(self), width=LABEL_WIDTH, columns=columns)


def summary_table(summary: ProblemSummary) -> Table:
    """Return a table with a row for each quantity."""
    rows: list[Row] = [
        (name, str(getattr(summary, name))) for name in ("nodes", "elements", "equations", "layers")
    ]
    rows.append(("thickness", _quantity(summary, summary.thickness, "length")))
    if summary.laminate:
        rows.append(("laminate", f"{summary.laminate}, under the load"))
    rows += _stiffness_rows(summary)
    rows += _plate_rows(summary)
    rows += _impact_rows(summary)
    rows += _program_rows(summary)
    return Table(tuple(rows), title=summary.title or "(no title)")


def _quantity(summary: ProblemSummary, value: float, dimension: str) -> str:
    """Format a value with its unit."""
    return quantity(value, unit_of(dimension, summary.units))


def _stiffness_rows(summary: ProblemSummary) -> Iterator[Row]:
    """Yield rows of the stiffness matrices under the load, and of the shear factor."""
    largest_a, largest_d, largest_shear = (
        float(np.abs(matrix).max()) for matrix in (summary.A, summary.D, summary.shear)
    )
    largest_b = math.sqrt(largest_a * largest_d)  # the bound on entries of B
    for label, matrix, dimension, size in (
        ("A", summary.A, "force/length", largest_a),
        ("B", summary.B, "force", largest_b),
        ("D", summary.D, "force*length", largest_d),
        ("shear xz, yz", summary.shear, "force/length", largest_shear),
    ):
        yield from _matrix_rows(label, matrix, unit_of(dimension, summary.units), size)
    if summary.leaves_out_equilibrium:
        yield ("shear factor", f"1; {_effect_of_equilibrium(summary)}")


def _plate_rows(summary: ProblemSummary) -> Iterator[Row]:
    """Yield rows about kinematics, preload, curvature, cure and delamination threshold."""
    in_units = partial(_quantity, summary)
    if summary.nonlinear:
        share = f"{summary.free_in_plane} of {summary.nodes} nodes"
        yield ("kinematics", f"von Kármán plate, u and v free at {share}")
    elif summary.energy is not None:
        yield ("kinematics", "linear plate")
    if any(summary.preload):
        named = zip(("N0x", "N0y", "N0xy"), summary.preload, strict=True)
        forces = (f"{name} {in_units(force, 'force/length')}" for name, force in named)
        yield ("preload", ", ".join(forces))
        stresses = (in_units(n / summary.thickness, MODULUS) for n in summary.preload if n)
        yield ("preload stress", f"{', '.join(stresses)} on average over the thickness")
    if any(summary.curvature):
        named = zip(("Rx", "Ry", "Rxy"), summary.curvature, strict=True)
        radii = [f"{name} {in_units(1.0 / k, 'length')}" for name, k in named if k]
        rise = f"rise {in_units(summary.rise, 'length')}"
        yield ("curved panel", ", ".join([*radii, rise]))
    if summary.supports is not None:
        yield from support_rows(summary.supports, summary.units)
    if summary.cure is not None:
        yield ("cure", f"{summary.cure:+g} K")
    if summary.threshold is not None:
        words, count = from_threshold(summary.delaminations), summary.delaminations
        of_several = f" ({count} delaminations)" if count > 1 else ""
        yield ("delamination", f"{words} {in_units(summary.threshold, 'force')}{of_several}")


def _impact_rows(summary: ProblemSummary) -> Iterator[Row]:
    """Yield rows about masses, velocity and energy, which are those of the whole plate."""

    def mass_text(mass: float) -> str:
        text = f"{significant(mass)} {unit_of(MASS, summary.units)}".rstrip()
        in_si = mass_in_si(mass, summary.units)
        return f"{text} ({in_si})" if in_si else text

    if text := whole_plate(summary.symmetry_factor):
        yield ("symmetry", f"{summary.symmetry_lines}, {text}")
    yield ("plate mass", mass_text(summary.plate_mass))
    if summary.velocity is not None and summary.energy is not None:
        yield ("projectile mass", mass_text(summary.projectile_mass))
        energy = _quantity(summary, summary.energy, "force*length")
        velocity = _quantity(summary, summary.velocity, "length/time")
        yield ("impact", f"{velocity}, {energy}")


def _program_rows(summary: ProblemSummary) -> Iterator[Row]:
    """Yield rows about time steps, resolution of the mesh, and size of the result."""
    critical = summary.critical_time_step
    of_plate = _share_of_step(summary)
    yield ("critical time step", f"{_quantity(summary, critical, 'time')}{of_plate}")
    if summary.buckling_factor is not None:
        far = math.isinf(summary.buckling_factor)
        times = f"more than {FAR:g}" if far else significant(summary.buckling_factor)
        count = summary.elements_per_buckle
        bound = "at most " if count is not None and count < FEWEST_ELEMENTS else ""
        yield ("buckling load", f"{bound}{times} times the preload")
    for dt in dict.fromkeys(summary.time_steps):
        step = dt or SAFE * critical
        share = step / critical
        longer = ""
        if share < ROOM:
            default = taken_time_step(critical)
            longer = f"; DT 0 takes {default:.3g}: {default / step:.1f} times fewer steps"
        yield ("DT", f"{_quantity(summary, step, 'time')} ({share:.0%} of it{longer})")
    if summary.elements_per_wave is not None:
        error = "" if summary.mesh_error is None else f" ({format_mesh_error(summary.mesh_error)})"
        yield ("elements per wave", f"{summary.elements_per_wave:.1f}{error}")
    at_most = "at most " if summary.at_most else ""
    yield ("impact steps", f"{at_most}{summary.steps}")
    before = " before compression" if summary.compact else ""
    yield ("output", f"{at_most}{format_bytes(summary.output_bytes)}{before}")
    if summary.rows:
        yield ("rows", f"{at_most}{format_rows(summary.rows)}")


ROWS = {
    "RODP": "strains",
    "DISP": "displacements",
    "STRE": "stress resultants",
    "PLYS": "ply stresses",
    "FAIL": "exposures",
}


def format_rows(rows: Mapping[str, int]) -> str:
    """Return how many rows of what a run stores."""
    return ", ".join(f"{count} of {ROWS[word]}" for word, count in rows.items())


def _share_of_step(summary: ProblemSummary) -> str:
    """Return, in brackets, the share of the critical time step that springs leave."""
    supports = summary.supports
    if supports is None or not (supports["springs"] or supports["one_sided"]):
        return ""
    return f" ({supports['step_ratio']:.1%} of the plate's without springs)"


def _effect_of_equilibrium(summary: ProblemSummary) -> str:
    """Say how much SHEA EQUI would change."""
    if summary.equilibrium_change is not None:
        return f"SHEA EQUI changes the static deflection by {summary.equilibrium_change:+.1%}"
    if summary.elements > MOST_SOLVED:
        return f"the change by SHEA EQUI is computed up to {MOST_SOLVED} elements"
    return "the plate is not held: no static deflection to compare with SHEA EQUI"


def deck_summary(problem: Problem) -> ProblemSummary:
    """Summarise a problem without errors."""
    deck, plate, laminate = problem.deck, problem.plate, problem.laminate
    resolved = resolution(problem) if problem.has_impact else None
    critical = math.nan
    with suppress(UnsoundPlateError):  # the check reports it if the program takes steps
        critical = problem.critical_time_step
    without_equilibrium = leaves_out_equilibrium(problem)
    mass = problem.projectile_mass
    velocity = deck.require(Impact).velocity if problem.has_impact else None
    cure = deck.last(Cure)
    return ProblemSummary(
        title=deck.title,
        nodes=deck.control.numnp,
        elements=deck.control.numel,
        layers=len(laminate.plies.angles),
        thickness=laminate.thickness,
        equations=plate.neq,
        steps=problem.work.steps,
        nonlinear=plate.nonlinear,
        free_in_plane=int((plate.mesh.codes[:, :W] == 0).all(axis=1).sum()),
        preload=plate.preload,
        curvature=plate.curvature,
        rise=rise_of(problem) if plate.is_curved else 0.0,
        A=laminate.A,
        B=laminate.B,
        D=laminate.D,
        shear=laminate.shear,
        plate_mass=problem.plate_mass,
        projectile_mass=mass,  # even without impact
        critical_time_step=critical,
        buckling_factor=problem.buckling_factor if plate.is_compressed else None,
        elements_per_buckle=problem.elements_per_buckle if plate.is_curved else None,
        time_steps=tuple(macro.value for macro in flat(problem.program) if macro.word == "DT"),
        output_bytes=problem.output_bytes,
        rows=problem.stored_rows,
        compact=deck.has(Compact),
        at_most=problem.work.at_most,
        elements_per_wave=None if resolved is None else resolved.elements,
        mesh_error=None if resolved is None else resolved.error,
        equilibrium_change=equilibrium_change(problem) if without_equilibrium else None,
        units=unit_names(deck),
        laminate=list(deck.layers)[problem.laminate_number] if plate.others else None,
        leaves_out_equilibrium=without_equilibrium,
        velocity=velocity,
        energy=None if velocity is None else 0.5 * mass * velocity * velocity,
        cure=None if cure is None else cure.delta_t,
        threshold=None if problem.threshold is None else problem.threshold.force,
        delaminations=0 if problem.threshold is None else problem.threshold.number,
        symmetry_factor=problem.symmetry.factor,
        symmetry_lines=problem.symmetry.places,
        supports=supports_summary(problem),
    )


def rise_of(problem: Problem) -> float:
    """Return the height of a curved panel, of the whole plate, length."""
    places = problem.symmetry.unfolded(problem.mesh.coordinates[problem.mesh.used])
    return float(np.ptp(midplane_height(places, problem.plate.curvature)))


def _matrix_rows(label: str, matrix: Floats, unit: str, size: float) -> Iterator[Row]:
    """Yield the rows of a matrix. Rounding errors beside `size` are shown as 0."""
    shown = np.where(np.abs(matrix) < ROUNDING * size, 0.0, matrix)
    first, *other_rows = (" ".join(f"{value:12.5g}" for value in row) for row in shown)
    yield (label, f"{first}  {unit}".rstrip())
    yield from (("", row) for row in other_rows)
