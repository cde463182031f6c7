"""Estimate of the memory of a run, before the run.

The large parts are the element matrices, the assembled stiffness and its factors if a macro or the
solver needs them, the nodal vectors and, without an output file, the result.
The factors below are upper bounds of what was measured on meshes of 4 000 to 160 000 nodes; the
memory of interpreter and libraries is not counted.
"""

from __future__ import annotations

import math

import numpy as np

from fecm import _memory
from fecm.deck.macros import every, flat
from fecm.deck.model import Gages, Projectile
from fecm.mechanics import interpolation
from fecm.mechanics.plate import ASSEMBLED, BLOCK, PlateModel
from fecm.mechanics.projectile import REPORT_ELEMENTS
from fecm.mechanics.solutions import DENSE, FACTORS
from fecm.mechanics.stiffness_product import AUTO, CSR, WORTH_GROUPING
from fecm.problem.problem import Problem
from fecm.results.sinks import RowBuffer

NODE = 800  # bytes per node: mesh, state, fields, buffered rows
PLACE = 60  # bytes per dof of an element: its indices, its forces, and the matrix that sums them
POINT = 250  # bytes per strain point of an element: Jacobians and strains
STRETCHING = 400  # bytes per Gauss point of a nonlinear plate whose stretching is stored
KEPT = 12  # bytes per entry of the element matrices that are kept
INTEGRATED = 24  # and of one under integration, for each row of B and point
ROWS = 8  # strains in B: six of the membrane and of bending, two of the transverse shear
SHIFTED = 70  # bytes of EIGE's factors of a plate without coupling, over n^1.5
GAGE = 60_000  # bytes per gage: its weights, and its strains in buffers and on the way to them
STEP = 80  # bytes per step of the summary after a run
STATIC = {"TANG", "EIGE"}


def needed_bytes(
    checked: Problem, *, solver: str = AUTO, in_memory: bool = False, exact: bool = True
) -> int:
    """Approximate upper bound of the memory of a run, whose result may be kept in memory.

    An `exact` one counts congruent elements once, instead of taking all elements as different.
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
        total += _product(model, exact=exact)
    if (gages := checked.deck.last(Gages)) is not None:
        total += GAGE * len(gages.records)
    total += _factors(model, words)
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


def check_memory(checked: Problem, *, solver: str = AUTO, in_memory: bool = False) -> None:
    """Raise NotEnoughMemoryError for a run that needs more memory than is free."""
    remedy = "write it to a file, or store fewer rows" if in_memory else "take a coarser mesh"
    _memory.check(
        "the run",
        lambda exact: needed_bytes(checked, solver=solver, in_memory=in_memory, exact=exact),
        lambda free: remedy,
    )


def _product(model: PlateModel, *, exact: bool) -> int:
    """Element matrices of the product K u, and the vectors that it gathers and sums."""
    points = max(len(rule.xi) for rule in (model.rules.bending, model.rules.shear))
    total = 0
    for family in model.families:
        count, n = len(family.rows), interpolation.NDOF * family.nodes.shape[1]
        alone, shared = count, 0
        if exact:
            sizes = np.bincount(family.congruence.group)
            shared = int((sizes >= WORTH_GROUPING).sum())
            alone = int(sizes[sizes < WORTH_GROUPING].sum())
        total += (alone + shared) * n * n * KEPT + count * n * PLACE
        total += max(shared, min(alone, BLOCK)) * points * ROWS * n * INTEGRATED
    return total


def _factors(model: PlateModel, words: set[str]) -> int:
    """Factors of the stiffness: n log n in a plane mesh ordered well, n^1.5 ordered by columns."""
    n = model.neq
    total = FACTORS * n * math.log2(max(2, n)) if "TANG" in words else 0.0
    total += SHIFTED * n**1.5 if "EIGE" in words else 0.0
    # Where u and v move with w all 5 x 5 dofs of two nodes interact, instead of 2 x 2 and 3 x 3.
    return int(total * (25 / 13 if model.moves_in_plane else 1.0))
