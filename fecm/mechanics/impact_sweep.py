"""Many impacts on one plate by the compiled kernels.

In: the plate, by its response to a unit force or reduced to a few modes, a projectile in its modes,
and the rows :class:`Given` with a value per case.  Out: the contact force at every step, and the
rows :class:`ResultRow` with a value per case.
"""

from __future__ import annotations

import ctypes
from ctypes import c_double, c_int64
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.impact_steps import LawKind
from fecm.mechanics.kernels import LIBRARY, Doubles, Longs, Structure, filled, floats
from fecm.mechanics.projectile import RodIntegrator
from fecm.mechanics.rod_modes import ProjectileModes


class Given(IntEnum):
    """Rows of the input, one value per case."""

    K = 0  # contact coefficient, force/length^1.5
    Q = 1  # power of the unloading curve
    CRITICAL = 2  # critical indentation, length
    SLOPE = 3  # s_p of equation 3-8
    VELOCITY = 4  # approach velocity
    FACTOR = 5  # mass and stiffness over the mass and stiffness of the projectile


class ResultRow(IntEnum):
    """Rows of the results, one value per case."""

    DEEPEST = 0  # largest indentation
    INDENTATION = 1  # last indentation
    PERMANENT = 2  # permanent indentation after unloading from the last point
    HIGHEST = 3  # largest displacement of the plate under the load
    W = 4  # last displacement of the plate under the load
    LARGEST_DDW = 5  # largest second difference of the displacement
    LOST = 6  # largest difference of the energy from the initial energy
    INITIAL = 7  # kinetic energy of the approach
    UNCONVERGED = 8  # steps whose contact iteration did not converge
    # Without the rigid motion of a plate that is not held:
    LARGEST_DW = 9  # largest change of the displacement in a step
    BENT_WORK = 10  # work of the contact force on the plate
    COMPLIANCE = 11  # largest w^2/(2 E) of the plate; see :data:`~fecm.judge.end.LEAST_WORK`
    CONTACT_WORK = 12  # work of the contact force on the indentation


class SweepStruct(Structure):
    """Impacts of `cases` cases by one kind of projectile.

    The arrays; the kernel writes the last two:

    ============  ===================  ========================================================
    `T`           (9, modes)           step of the modes; see ``impact_steps.RodStruct``
    `h`           (3, modes)           new motion per force on the tip
    `stiffness`   (modes,)             squares of the angular frequencies
    `tip_shape`   (modes,)             displacement of the tip
    `plate`       (steps,)             the plate's displacement per force 1, 2, ... steps ago
    `given`       (given, stride)      rows of :class:`Given`; the first `cases` columns count
    `force`       (cases, steps)       contact force
    `found`       (found, stride)      rows of :class:`ResultRow`; the first `cases` columns count
    ============  ===================  ========================================================
    """

    _fields_ = (
        ("cases", c_int64),
        ("stride", c_int64),  # columns of `given` and `found`
        ("steps", c_int64),
        ("modes", c_int64),
        ("law", c_int64),  # a LawKind
        ("dt", c_double),
        ("theta", c_double),  # as in ``impact_steps.RodStruct``
        ("weight_before", c_double),
        ("weight", c_double),
        ("rigid", c_double),  # rigid displacement of the plate per force and step since
        ("T", Doubles),
        ("h", Doubles),
        ("stiffness", Doubles),
        ("tip_shape", Doubles),
        ("plate", Doubles),
        ("given", Doubles),
        ("force", Doubles),
        ("found", Doubles),
    )


class ReducedStruct(Structure):
    """A nonlinear plate in n coordinates, of bending and of the membrane.

    Matrices are cut by :func:`tiles`.  The arrays:

    ============  =======================  =====================================================
    `stiffness`   (n,)                     squares of the angular frequencies
    `deflection`  (n,)                     displacement under the load
    `keep`        (n,)                     increment of a coordinate per increment before
    `share`       (n,)                     increment per force
    `rate`        (n,)                     velocity per sum of the increments before and after
    `part`        (shapes, bending)        amplitudes of the coordinates
    `spread`      (bending, shapes)        its transpose
    `factor`      (rows, pairs)            B over the rows of C from `coupled` on
    `transposed`  (pairs, rows)            its transpose
    `step`        (rows,)                  first step that ends at or after each stored time
    `back`        (rows,)                  time from there to the end of the step, over the step
    `stored`      (cases, rows, n)         coordinates; the kernel writes them
    ============  =======================  =====================================================
    """

    _fields_ = (
        ("bending", c_int64),
        ("membrane", c_int64),
        ("shapes", c_int64),
        ("rank", c_int64),
        ("coupled", c_int64),  # first row of C that is not 0
        ("flexibility", c_double),  # displacement of a spring at the contact per force
        ("damping", c_double),  # a dt of the damping matrix a M
        ("stiffness", Doubles),
        ("deflection", Doubles),
        ("keep", Doubles),
        ("share", Doubles),
        ("rate", Doubles),
        ("part", Doubles),
        ("spread", Doubles),
        ("factor", Doubles),
        ("transposed", Doubles),
        ("rows", c_int64),  # stored times
        ("step", Longs),
        ("back", Doubles),
        ("stored", Doubles),
    )


def tiles(matrix: Floats) -> Floats:
    """Cut a matrix into tiles of four rows, filled up with zeros: (rows / 4, columns, 4)."""
    columns = filled(matrix.T)
    return np.ascontiguousarray(columns.reshape(len(columns), -1, 4).swapaxes(0, 1))


class Swept(NamedTuple):
    """Impacts of many cases by a projectile; the kernels write `force` and `found`.

    `given` (given, cases) and `found` (found, cases) may be columns of larger arrays.
    """

    modes: ProjectileModes
    step: RodIntegrator
    law: LawKind
    given: Floats
    force: Floats  # (cases, steps)
    found: Floats
    coordinates: Floats | None = None  # (cases, rows, n): of a reduced plate at stored times


def sweep_linear(response: Floats, rigid: float, swept: Swept) -> None:
    """Compute impacts on a plate with a response to a unit force, (steps,).

    A plate that is not held has a rigid motion: `rigid` times the number of steps since a force of
    1.  Raises MemoryError.
    """
    if not LIBRARY.fecm_sweep(ctypes.byref(sweep_structure(response, rigid, swept))):
        raise MemoryError


def sweep_reduced(plate: ReducedStruct, swept: Swept) -> None:
    """Compute impacts on a nonlinear plate in a few modes.  Raises MemoryError."""
    if swept.coordinates is not None:
        plate.stored = floats(swept.coordinates)
    structure = sweep_structure(np.empty(0), 0.0, swept)
    if not LIBRARY.fecm_reduced(ctypes.byref(structure), ctypes.byref(plate)):
        raise MemoryError


def sweep_structure(response: Floats, rigid: float, swept: Swept) -> SweepStruct:
    """Return what the kernel of a linear plate takes; see :func:`sweep_linear`."""
    modes, step, law, given, force, found, _ = swept
    T, h = modes.step(step)
    before, after = step.weights
    cases, steps = force.shape
    return SweepStruct(
        cases=cases,
        stride=given.strides[0] // given.itemsize,
        steps=steps,
        modes=len(modes.stiffness),
        law=law,
        dt=step.dt,
        theta=step.theta,
        weight_before=before,
        weight=after,
        rigid=rigid,
        T=T,
        h=h,
        stiffness=modes.stiffness,
        tip_shape=modes.shapes[0].copy(),
        plate=response,
        given=floats(given),
        force=force,
        found=floats(found),
    )
