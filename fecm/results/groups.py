"""Groups of a result: their datasets as attributes.

The annotations below name what :data:`fecm.results.schema.DATASETS` defines, for type checkers and
editors.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fecm._tables import html_table
from fecm._typing import Floats
from fecm.results.schema import NotStoredError

Array = NDArray[Any]
Ints = NDArray[np.int64]
Int32s = NDArray[np.int32]


class Group:
    """The datasets of one group as attributes: ``result.tape3.w``."""

    def __init__(
        self, name: str, arrays: Mapping[str, Array], attributes: Mapping[str, Mapping[str, Any]]
    ) -> None:
        self._name = name
        self._arrays = arrays
        self._attributes = attributes

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the group."""
        return dict(self._attributes.get(self._name, {}))

    if not TYPE_CHECKING:  # so that a misspelt name is a type error

        def __getattr__(self, name):
            if not name.startswith("_"):
                path = f"{self._name}/{name}"
                if path in self._arrays:
                    return self._arrays[path]
                if any(other.startswith(f"{path}/") for other in self._arrays):
                    return group(path, self._arrays, self._attributes)
            raise NotStoredError(f"there is no {self._name}/{name} in this result")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *{name.partition("/")[0] for name in self._shapes()}]

    def _shapes(self) -> dict[str, str]:
        """Shapes of the datasets by their names."""
        head = f"{self._name}/"
        own = [path for path in self._arrays if path.startswith(head)]
        return {path.removeprefix(head): str(self._arrays[path].shape) for path in own}

    def __repr__(self) -> str:
        shapes = ", ".join(f"{name} {shape}" for name, shape in self._shapes().items())
        return f"<{self._name}: {shapes}>"

    def _repr_html_(self) -> str:
        """Table of the datasets, for notebooks."""
        return html_table(self._name, self._shapes().items())


class Rows(Group):
    """Rows with the number of steps taken, and the time."""

    step: Ints
    time: Floats


class Contact:
    """Contact and projectile, a value per row."""

    force: Floats
    indentation: Floats
    transducer: Floats
    displacement: Floats
    velocity: Floats
    acceleration: Floats


class Mesh(Group):
    """The finite element mesh."""

    coordinates: Floats
    elements: Int32s
    equations: Int32s


class LaminateStiffness(Group):
    """Stiffness of the laminate per area."""

    A: Floats
    B: Floats
    D: Floats
    shear: Floats


class Tape3(Rows):
    """Displacements of the nodes, stored by DISP."""

    w: Floats
    displacement: Floats


class Tape8(Rows):
    """Strains of the elements, stored by RODP."""

    kappa_x: Floats
    kappa_y: Floats
    kappa_xy: Floats
    gamma_yz: Floats
    gamma_xz: Floats


class Tape9(Contact, Rows):
    """Contact and projectile, stored by RODP."""


class History(Contact, Rows):
    """Contact and projectile at every step."""

    plate_w: Floats


class Energy(Rows):
    """Energies at every step."""

    plate_kinetic: Floats
    plate_strain: Floats
    projectile_kinetic: Floats
    projectile_strain: Floats
    contact_work: Floats
    external_work: Floats
    damping_work: Floats
    balance_error: Floats


class GageGroup(Rows):
    """Strain gages, read at every step."""

    number: Int32s
    strain: Floats


class Stresses(Tape8):
    """Strains, those of `Tape8` among them, and stress resultants, stored by STRE."""

    x: Floats
    y: Floats
    eps_xx: Floats
    eps_yy: Floats
    gamma_xy: Floats
    N_x: Floats
    N_y: Floats
    N_xy: Floats
    M_x: Floats
    M_y: Floats
    M_xy: Floats
    Q_x: Floats
    Q_y: Floats


class PatchGroup(Group):
    """Nodal weights of the contact force."""

    node: Int32s
    weight: Floats


class PlyRows(Rows):
    """Stresses ply by ply, stored by PLYS."""

    element: Int32s
    z: Floats
    under_load: Int32s
    sigma_1: Floats
    sigma_2: Floats
    tau_12: Floats
    tau_xz: Floats
    tau_yz: Floats
    residual: Floats


class Exposure(Group):
    """Largest exposures of a criterion, with their times and modes."""

    exposure: Floats
    time: Floats
    mode: NDArray[np.int8]


class Failure(Group):
    """Largest exposures over time, found by FAIL."""

    x: Floats
    y: Floats
    under_load: Int32s
    max_stress: Exposure
    tsai_wu: Exposure
    hashin: Exposure
    puck: Exposure
    interlaminar: Exposure


class Reactions(Rows):
    """Forces of the supports, stored by REAC."""

    force: Floats


class Modes(Rows):
    """Natural modes, found by EIGE."""

    number: Ints
    angular_frequency: Floats
    shape: Floats


GROUPS: dict[str, type[Group]] = {
    "mesh": Mesh, "laminate": LaminateStiffness, "tape3": Tape3, "tape8": Tape8, "tape9": Tape9,
    "history": History, "energy": Energy, "gages": GageGroup, "stresses": Stresses,
    "patch": PatchGroup, "plies": PlyRows, "failure": Failure, "reactions": Reactions,
    "modes": Modes,
}  # fmt: skip


def group(
    name: str, arrays: Mapping[str, Array], attributes: Mapping[str, Mapping[str, Any]]
) -> Group:
    """Return a group of a result by its path."""
    kind = Exposure if name.startswith("failure/") else GROUPS.get(name, Group)
    return kind(name, arrays, attributes)
