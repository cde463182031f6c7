"""Parts of the program: laminates, K u, waves, rods, the indentation law (lb, in, s).

Layer 1 lies at z = -h/2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh

from fecm.deck.grid import ElementGrid, grid_lines, uniform_section
from fecm.deck.model import Coordinates, NodeValues, Ply
from fecm.mechanics.contact_law import (
    ContactPoint,
    HystereticLaw,
    LinearPermanent,
    YangSunPermanent,
    follow,
)
from fecm.mechanics.laminate import LaminateSection, effective_rigidity, laminate, threshold_force
from fecm.mechanics.plate_motion import PlateMotion
from fecm.mechanics.projectile import CONSISTENT, Rod, report_rod
from fecm.problem.generate import generate
from fecm.problem.parts import build_plate
from fecm.studies.rod_test.pulse_test import gauss_pulse, simulate_pulse, sine_pulse
from fecm.studies.waves import FRONTS, MODES, Medium, WaveSurfaces, dispersion
from fecm.verification.case import Value, case
from fecm.verification.decks import (
    MITC,
    REPORT_ANGLES,
    REPORT_PLY,
    REPORT_THICKNESS,
    deck,
    isotropic,
    material,
)

# A ply like the report's with a different G23, and the thickness of two layers.
FIBRES = Ply(2.5e-4, 0.3, 17.5e6, 1.15e6, 0.8e6, 0.8e6, 0.5e6)
THICK = 0.02
ENTRIES = [0, 0, 2], [0, 1, 2]  # indices of the entries 11, 12 and 66
DT = 2e-7  # for the report's steel bar and its pulse, section 4.2
# The report's laminate with the 0.75 in indenter.
K = 1.912e6
ALPHA_P = 6.564e-4
S_P = 0.094
Q = 2.0
ALPHA_CR = 1.2e-3  # critical indentation of equation 3-7
PEAK = 2e-3
REMAINS = S_P * (PEAK - ALPHA_P)
HALFWAY = (PEAK + REMAINS) / 2.0
ACR_REMAINS = PEAK - ALPHA_CR**0.4 * PEAK**0.6


@case
def _isotropic_ply() -> Sequence[Value]:
    h, plate = 0.1, 1.0e7 / (1.0 - 0.3**2)
    section = laminate(isotropic(1.0e7, 0.3, 2.5e-4), [30.0], [h])
    vanishing = [*section.A[:2, 2] / h, *section.B.ravel() / h**2, *section.D[:2, 2] / h**3]
    return [
        *section.A[ENTRIES],
        np.abs(vanishing).max() / plate,
        *section.D[ENTRIES],
        section.shear[0, 0],
        section.mass,
        section.rotary_inertia,
    ]


@case
def _cross_ply() -> Sequence[Value]:
    section = laminate(FIBRES, [0.0, 90.0], [THICK / 2.0] * 2)
    b = section.B.diagonal()
    return [*section.A[ENTRIES], b[0], b[1], section.D[0, 0], section.D[2, 2], section.shear[0, 0]]


@case
def _angle_ply() -> Sequence[Value]:
    section = laminate(FIBRES, [45.0, -45.0], [THICK / 2.0] * 2)
    turned, a11 = laminate(FIBRES, [45.0], [THICK]), section.A[0, 0]
    return [
        *section.A[ENTRIES],
        section.A[0, 2] / a11,
        section.B[0, 2],
        section.B[0, 0] / (a11 * THICK),
        section.D[0, 0],
        section.D[2, 2],
        turned.shear[0, 1],
    ]


def report_laminate() -> LaminateSection:
    """Return the section of the report's laminate, [0/45/0/-45/0]2s graphite/epoxy."""
    return laminate(REPORT_PLY, REPORT_ANGLES, [REPORT_THICKNESS] * len(REPORT_ANGLES))


@case
def _internal_force() -> Sequence[Value]:
    """Compare K u with the sum over the elements, on a mesh without parallel sides."""
    grid = ElementGrid(uniform_section(2.0, 3), uniform_section(2.0, 3))
    x, y = (v.ravel() for v in np.meshgrid(grid_lines(grid.columns), grid_lines(grid.rows)))
    corners = enumerate(np.stack([x + 0.1 * x * y, y + 0.2 * x * y], axis=1).tolist(), start=1)
    places = Coordinates(tuple(NodeValues(n, 0, tuple(place)) for n, place in corners))
    plate, differences = material(FIBRES, (0.0, 30.0), THICK / 2.0), []
    for shear in (None, MITC):
        plate_deck = deck(grid, (shear, plate), (), places)
        built = build_plate(plate_deck, generate(plate_deck))
        u = np.cos(np.arange(built.neq))
        force = built.stiffness @ u
        differences.append(
            np.abs(PlateMotion(built).product(u) - force).max() / np.abs(force).max()
        )
    return differences


@case
def _threshold() -> Sequence[Value]:
    turned = [angle + 37.0 for angle in REPORT_ANGLES]
    plates = (
        (laminate(isotropic(60e3, 0.3, 1.0), [0.0], [2.0]), 0.8),
        (report_laminate(), 2.9),
        (laminate(REPORT_PLY, turned, [REPORT_THICKNESS] * len(turned)), 2.9),
    )
    return [threshold_force(effective_rigidity(plate), toughness) for plate, toughness in plates]


@case
def _wave_fronts() -> Sequence[Value]:
    fronts = WaveSurfaces(Medium(report_laminate())).fronts([0.0, 45.0])
    names = ("extension", "in_plane_shear", "bending", "twisting", "transverse_shear")
    places = [FRONTS.index(name) for name in names]
    first = places[0]
    round_fronts = WaveSurfaces(Medium(laminate(isotropic(1.0, 0.3, 1.0), [0.0], [0.1])))
    strength = round_fronts.fronts([10.0]).strength(1.0, 4.0, 0.0)[0, first]
    velocities = [*fronts.velocity[0, places], fronts.velocity[1, first]]
    return [*velocities, fronts.ray_angle[1, first], strength]


@case
def _dispersion() -> Sequence[Value]:
    frequencies = dispersion(Medium(report_laminate()), 0.0, [10.0, 1.0, 1e5]).angular_frequency
    first, last = MODES.index("flexural_1"), MODES.index("flexural_3")
    return [frequencies[0, first], frequencies[1, first], frequencies[2, last]]


def bar(length: float) -> Rod:
    """Build a bar of elements of 0.05 in."""
    return Rod(length, (0.625,) * round(20 * length), 30.0e6, 7.33e-4)


@case
def _rod_pulse() -> Sequence[Value]:
    early, late = (gauss_pulse(1000.0, middle, 40e-6) for middle in (200e-6, 300e-6))
    result = simulate_pulse(bar(1.0), early, DT, 600e-6, (0.5,))
    second = simulate_pulse(bar(1.0), late, DT, 300e-6, (0.5,))
    force_of_late_pulse = np.interp(250e-6, second.time, second.forces[:, 0])
    velocity = result.accelerations[:, 2].sum() * DT
    return [
        result.forces.max(),
        force_of_late_pulse,
        result.mean_ratios[0],
        velocity,
        report_rod().total_mass,
    ]


@case
def _rod_waves() -> Sequence[Value]:
    ends = (1.0, 4.0)
    result = simulate_pulse(bar(5.0), sine_pulse(1000.0, 8e-6), DT / 2.0, 29e-6, ends)
    centroids = (result.time @ result.forces) / result.forces.sum(axis=0)
    speed = (ends[1] - ends[0]) / (centroids[1] - centroids[0])
    frequencies = []
    for rod in (bar(1.0), bar(1.0).with_mass(CONSISTENT)):
        mass = rod.mass()
        matrix = np.diag(mass) if mass.ndim == 1 else mass
        squares = eigh(rod.stiffness(), matrix, eigvals_only=True)
        frequencies.append(math.sqrt(float(squares[1])))  # the first belongs to the rigid motion
    return [speed, result.forces[:, 1].max(), *frequencies]


@case
def _indentation() -> Sequence[Value]:
    law = HystereticLaw(LinearPermanent(K, ALPHA_P, S_P, Q))
    acr = HystereticLaw(YangSunPermanent(K, ALPHA_CR))

    def path(*corners: float, points: int = 1, law: HystereticLaw = law) -> list[ContactPoint]:
        return [point for point, _ in follow(law, corners, points)]

    step = 1e-9 * PEAK
    down, top = path(PEAK, HALFWAY, REMAINS), path(PEAK, PEAK - step)
    turn, up = path(PEAK, HALFWAY, HALFWAY + step), path(PEAK, -PEAK, HALFWAY, PEAK)
    work = sum(
        (b.indentation - a.indentation) * (a.force + b.force) / 2.0
        for a, b in pairwise(path(PEAK, 0.0, points=2000))
    )
    half_inch = LinearPermanent(k=1.330e6, alpha_p=ALPHA_P, s_p=S_P, q=2.5)
    return [
        half_inch.loading(ALPHA_P),
        *(point.force for point in down[1:]),
        top[2].force - top[1].force,
        turn[3].force - turn[2].force,
        up[4].force,
        up[3].force,
        work,
        *(p.force for p in path(PEAK, (PEAK + ACR_REMAINS) / 2.0, ACR_REMAINS, law=acr)[1:]),
    ]


@case
def _permanent_indentation() -> Sequence[Value]:
    law = LinearPermanent(k=1.330e6, alpha_p=ALPHA_P, s_p=S_P, q=2.5)
    before = law.permanent(np.linspace(0.0, ALPHA_P, 7))
    beyond = law.permanent(ALPHA_P * np.array([2.0, 3.0]))
    return [float(before.max()), float(np.diff(beyond)[0]) / ALPHA_P]
