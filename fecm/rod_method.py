"""Choices of the rod's mass matrix and integration, named without importing anything else."""

from __future__ import annotations

from dataclasses import dataclass

# The report's program lumps the mass; its text has the consistent one (equation 4-24).
LUMPED, CONSISTENT = "lumped", "consistent"
MASSES = (LUMPED, CONSISTENT)

WILSON, AVERAGE = "wilson", "average-acceleration"
INTEGRATORS = (WILSON, AVERAGE)


@dataclass(frozen=True)
class RodMethod:
    """How a rod is made to move; the default is the report's program.

    Attributes
    ----------
    mass : str
        One of `MASSES`.
    integrator : str
        One of `INTEGRATORS`.

    Raises
    ------
    ValueError
        If one of them is unknown.
    """

    mass: str = LUMPED
    integrator: str = WILSON

    def __post_init__(self) -> None:
        for what, value, known in (
            ("mass", self.mass, MASSES),
            ("integrator", self.integrator, INTEGRATORS),
        ):
            if value not in known:
                raise ValueError(f"unknown rod {what} {value!r}; known are {', '.join(known)}")

    @property
    def attributes(self) -> dict[str, str]:
        """What a result tells of it: nothing of what is the default."""
        default = RodMethod()
        told = {"rod_mass": self.mass, "rod_integrator": self.integrator}
        usual = {"rod_mass": default.mass, "rod_integrator": default.integrator}
        return {name: value for name, value in told.items() if value != usual[name]}
