"""Options of a run."""

from __future__ import annotations

from dataclasses import field

from fecm._frozen import frozen
from fecm.mechanics.contact_law import Law
from fecm.mechanics.kernels import LIBRARY
from fecm.mechanics.projectile import RodMethod
from fecm.mechanics.stiffness_product import AUTO, KERNELS, SOLVERS

ENERGY_LIMIT = 0.1  # relative error of the energy balance that ends a run


@frozen
class RunOptions:
    """Options of a run, by default the report's.  Raises ValueError if a value is not valid."""

    # Slips of the printed program that are on: see :func:`~fecm.problem.slips.active_slips`.
    slips: frozenset[str] = frozenset()
    # Computation of K·u, one of ``SOLVERS``: compiled kernels where there are any, else NumPy; or
    # one of them; or a sparse matrix.
    solver: str = AUTO
    # Threads that share the work of a step; 0 takes every core for a large mesh.  The result does
    # not depend on it.
    threads: int = 0
    rod_method: RodMethod = field(default_factory=RodMethod)  # the rod's mass matrix and integrator
    # Error of the energy balance, relative to the supplied energy, that ends a run without slips.
    energy_limit: float = ENERGY_LIMIT
    law: Law | None = None  # contact law instead of the deck's

    def __post_init__(self) -> None:
        if self.solver not in SOLVERS:
            raise ValueError(f"unknown solver {self.solver!r}; known are {', '.join(SOLVERS)}")
        if self.solver == KERNELS and LIBRARY is None:
            raise ValueError("this installation has no compiled kernels; take the solver numpy")
        if self.threads < 0:
            raise ValueError(f"threads is {self.threads}; it must be 0 or more")
        if not self.energy_limit > 0.0:
            raise ValueError(f"energy_limit is {self.energy_limit:g}; it must be positive")
