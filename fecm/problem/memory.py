"""Estimate of the memory of a run, before the run.

The large parts are the element matrices, the assembled stiffness and its factors if a macro or the
solver needs them, the nodal vectors and, without an output file, the result. The estimate is
between 0.7 and 2 times the memory that was measured on meshes of 400 to 40 000 nodes. The memory of
interpreter and libraries is not counted.
"""

from __future__ import annotations

import math

import numpy as np

from fecm import _machine
from fecm.deck.macros import every, flat
from fecm.deck.model import Gages, Projectile
from fecm.mechanics import interpolation
from fecm.mechanics.impact_steps import FIELDS, TOGETHER
from fecm.mechanics.plate import ASSEMBLED, BLOCK, PlateModel
from fecm.mechanics.projectile import REPORT_ELEMENTS
from fecm.mechanics.solutions import DENSE, FACTORS
from fecm.mechanics.stiffness_product import AUTO, CSR, KERNELS, WORTH_GROUPING, resolved
from fecm.mechanics.strains import STRAINS
from fecm.mechanics.time_step import PART
from fecm.problem.problem import Problem
from fecm.results.sinks import RowBuffer

NODE = 800  # bytes per node: mesh, state, fields, buffered rows
PLACE = 60  # bytes per dof of an element: its indices, its forces, and the matrix that sums them
POINT = 250  # bytes per strain point of an element: Jacobians and strains
STRETCHING = 400  # bytes per Gauss point of a nonlinear plate whose stretching is stored
NUMBERS = 400  # bytes per point of an element that the kernels have no matrix for
KEPT = 12  # bytes per entry of the element matrices that are kept
INTEGRATED = 24  # bytes per entry under integration, for each row of B and each point
ROWS = 8  # strains in B: six of the membrane and of bending, two of the transverse shear
SHIFTED = 70  # bytes of EIGE's factors of a plate without coupling, over n^1.5
GAGE = 10_000  # bytes per gage: its weights, as they are found and as the solver has them
GATHERED = 1024  # steps whose strains at the gages are gathered, twice when they are stored
STEP = 80  # bytes per step of the summary after a run
STATIC = {"TANG", "EIGE"}


def needed_bytes(
    checked: Problem, *, solver: str = AUTO, in_memory: bool = False, exact: bool = True
) -> int:
    """Estimate the memory of a run, whose result may be kept in memory.

    An `exact` estimate counts congruent elements once, instead of taking all elements as different.
    """
    words = {macro.word for macro in flat(checked.program)}
    output, model, control = checked.output_bytes, checked.plate, checked.deck.control
    bending, _, strains = checked.rules
    total = NODE * control.numnp + POINT * control.numel * max(len(strains.xi), len(bending.xi))
    if model.nonlinear:
        total += STRETCHING * control.numel * len(bending.xi)
    if solver == CSR or words & STATIC:
        total += ASSEMBLED * model.entries
    if solver != CSR:
        total += _product(model, compiled=resolved(solver) == KERNELS, exact=exact)
    if (gages := checked.deck.last(Gages)) is not None:
        total += _gages(checked, len(gages.records))
    # The check has freed the memory of the buckling load before steps are taken.
    together = checked.has_impact and resolved(solver) == KERNELS
    total += max(
        _fields(checked) if together else 0, _buckling(model) if model.is_compressed else 0
    )
    total += factor_bytes(model, words)
    n = checked.mesh.number_of_equations
    if modes := max(
        (min(n, every(m)) for m in flat(checked.program) if m.word == "EIGE"), default=0
    ):
        # EIGE's matrices are dense where it looks for many modes.
        total += 8 * n * (5 * n if n < DENSE or modes >= n // 2 else 6 * modes + 60)
    card = checked.deck.last(Projectile)
    rod_elements = REPORT_ELEMENTS if card is None else card.elements
    total += 8 * 6 * (2 * rod_elements + 2) ** 2
    if in_memory:
        return total + output
    held = output if "CONV" in words else 0  # CONV may leave rows empty; they are removed in memory
    return total + held + STEP * checked.work.steps + 5 * RowBuffer.BYTES


def check_run_memory(checked: Problem, *, solver: str = AUTO, in_memory: bool = False) -> None:
    """Raise NotEnoughMemoryError for a run that needs more memory than is free."""
    remedy = "write it to a file, or store fewer rows" if in_memory else "take a coarser mesh"
    _machine.check_available_memory(
        "the run",
        lambda exact: needed_bytes(checked, solver=solver, in_memory=in_memory, exact=exact),
        lambda free: remedy,
    )


def _product(model: PlateModel, *, compiled: bool, exact: bool) -> int:
    """Return the bytes of the element matrices of K u, and of the vectors around it."""
    points = max(len(rule.xi) for rule in (model.rules.bending, model.rules.shear))
    total = 0
    for family in model.families:
        count, n = len(family.rows), interpolation.NDOF * family.nodes.shape[1]
        alone, shared = count, 0
        if exact:
            sizes = np.bincount(family.congruence.group)
            shared = int((sizes >= WORTH_GROUPING).sum())
            alone = int(sizes[sizes < WORTH_GROUPING].sum())
        total += count * n * PLACE
        if compiled:  # no matrices, but numbers at the points of elements that differ
            total += alone * points * NUMBERS + min(alone, PART) * points * ROWS * n * INTEGRATED
            continue
        total += (alone + shared) * n * n * KEPT
        total += max(shared, min(alone, BLOCK)) * points * ROWS * n * INTEGRATED
    return total


def _gages(checked: Problem, count: int) -> int:
    """Return the bytes of weights of gages, and of their strains in two orders."""
    steps = checked.work.steps
    together = min(steps, TOGETHER.interval(checked.moving_plate.neq))
    strains = 8 * (2 * together + GATHERED + min(steps, GATHERED))
    return count * (GAGE + strains)


def _fields(checked: Problem) -> int:
    """Return the bytes of fields that one call of the kernels stores, with derived arrays."""
    plate, work, control = checked.plate, checked.work, checked.deck.control
    field, n = plate.mesh.equations.size, checked.moving_plate.neq
    stored = max(work.contact_rows, *(work.passes[word] for word in ("DISP", "PLYS", "FAIL")))
    rows = min(stored, max(1, FIELDS // field))
    interval = TOGETHER.interval(n)
    if work.steps > interval:
        rows = min(rows, -(-stored * interval // work.steps))
    # The vectors of the kernels are freed before strains are computed.
    strains = len(STRAINS) * control.numel * len(checked.rules[2].xi) if work.contact_rows else 0
    return 8 * rows * (field + max(n, strains))


def _buckling(model: PlateModel) -> int:
    """Return the bytes of the matrices for the buckling load, and of the factors with copies."""
    if model.is_curved:
        n, share, coupled = model.neq, 1.0, 25 / 13
    else:
        n, share, coupled = int(np.count_nonzero(model.mesh.equations[:, 2:])), 9 / 25, 1.0
    return int(ASSEMBLED * share * model.entries + FACTORS * coupled * n * math.log2(n + 1))


def factor_bytes(model: PlateModel, words: set[str]) -> int:
    """Return the bytes of the factors of the stiffness.

    They grow with n log n for a well-ordered plane mesh, and with n^1.5 for nodes in columns.
    """
    n = model.neq
    total = FACTORS * n * math.log2(max(2, n)) if "TANG" in words else 0.0
    total += SHIFTED * n**1.5 if "EIGE" in words else 0.0
    # Where u and v move with w all 5 x 5 dofs of two nodes interact, instead of 2 x 2 and 3 x 3.
    return int(total * (25 / 13 if model.moves_in_plane else 1.0))
