"""The kernel of sweeps as WebAssembly, run by the optional library wasmtime."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.contact_law import ContactParameters, LinearPermanent, YangSunPermanent
from fecm.mechanics.impact_steps import kernel_law
from fecm.mechanics.impact_sweep import (
    Given,
    ReducedStruct,
    ResultRow,
    Swept,
    sweep_structure,
)
from fecm.mechanics.kernels import Structure
from fecm.mechanics.kernels.webassembly import PATH, wasm_fields
from fecm.mechanics.projectile import RigidMass, WilsonStep
from fecm.mechanics.rod_modes import ProjectileModes
from fecm.verification.case import Value, case
from fecm.verification.parts import ALPHA_CR

SPACE = 1024  # bytes for the structure, which are more than it needs
MASS, V = 2.0e-4, 100.0  # of the projectile, in lb, in and s
DT, STEPS = 2.0e-8, 9000


class WasmKernel:
    """Instance of the module, whose memory the calls use.  Raises ImportError without wasmtime."""

    def __init__(self) -> None:
        import wasmtime  # optional

        library: Any = wasmtime
        self._store = library.Store()
        module = library.Module(self._store.engine, PATH.read_bytes())
        self._exports = library.Instance(self._store, module, []).exports(self._store)
        self._exports["_initialize"](self._store)

    def sweep_linear(self, response: Floats, rigid: float, swept: Swept) -> None:
        """Compute impacts, as :func:`fecm.mechanics.impact_sweep.sweep_linear` does."""
        self._call("fecm_sweep", swept, response, rigid)

    def sweep_reduced(self, plate: ReducedStruct, swept: Swept) -> None:
        """Compute impacts, as :func:`fecm.mechanics.impact_sweep.sweep_reduced` does.

        The coordinates of the plate are not stored.
        """
        self._call("fecm_reduced", swept, np.empty(0), 0.0, plate)

    def _call(
        self, function: str, swept: Swept, response: Floats, rigid: float, *more: Structure
    ) -> None:
        """Call a function with impacts, whose `force` and `found` it writes, and more structures.

        Raises MemoryError.
        """
        given, found = (np.ascontiguousarray(rows) for rows in (swept.given, swept.found))
        impacts = sweep_structure(response, rigid, swept._replace(given=given, found=found))
        impacts.held |= {"given": given, "found": found}
        places: list[dict[str, int]] = []
        addresses = []
        for structure in (impacts, *more):
            packed, of_arrays = self._copied(structure)
            places.append(of_arrays)
            addresses.append(self._allocated(packed))
        if not self._exports[function](self._store, *addresses):
            raise MemoryError
        for array, name in ((swept.force, "force"), (swept.found, "found")):
            start = places[0][name]
            stored = self._exports["memory"].read(self._store, start, start + array.nbytes)
            array[:] = np.frombuffer(stored).reshape(array.shape)
        self._free([*addresses, *(place for part in places for place in part.values())])

    def _copied(self, structure: Structure) -> tuple[bytes, dict[str, int]]:
        """Copy the arrays of a structure; return its bytes, and the addresses of the arrays."""
        places = {
            name: self._allocated(np.ascontiguousarray(value).tobytes())
            for name, value in structure.held.items()
            if isinstance(value, np.ndarray)
        }
        packed = bytearray(SPACE)
        for name, kind, offset in wasm_fields(type(structure)):
            form = {"int64": "<q", "double": "<d", "pointer": "<I"}[kind]
            value = places.get(name, structure.held.get(name, 0))
            struct.pack_into(form, packed, offset, value)
        return bytes(packed), places

    def _allocated(self, data: bytes) -> int:
        """Return the address of a copy of some bytes."""
        at: int = self._exports["malloc"](self._store, max(len(data), 8))
        if not at:
            raise MemoryError
        self._exports["memory"].write(self._store, data, at)
        return at

    def _free(self, places: Sequence[int]) -> None:
        for at in places:
            self._exports["free"](self._store, at)


def _rigid_target_hit(constants: ContactParameters) -> list[float]:
    """Hit a fixed target with a rigid mass.

    Returns the deepest indentation, the largest force, the time of the contact, the velocity after
    it, and the work that the indentation keeps.
    """
    mass, law = RigidMass(MASS), kernel_law(constants)
    step = WilsonStep(mass.stiffness(), mass.mass(), DT, rigid=mass.rigid)
    modes = ProjectileModes.of(mass.stiffness(), mass.mass(), mass.rigid)
    rows = {
        Given.K: constants.k,
        Given.Q: constants.q,
        Given.CRITICAL: law.critical,
        Given.SLOPE: law.slope,
        Given.VELOCITY: V,
        Given.FACTOR: 1.0,
    }
    given = np.array([[float(rows[row])] for row in Given])
    force, found = np.empty((1, STEPS)), np.empty((len(ResultRow), 1))
    swept = Swept(modes, step, law.kind, given, force, found)
    WasmKernel().sweep_linear(np.zeros(STEPS), 0.0, swept)
    return [
        float(found[ResultRow.DEEPEST, 0]),
        float(force.max()),
        DT * (np.flatnonzero(force[0])[-1] + 1),
        float(force.sum()) * DT / MASS - V,
        float(found[ResultRow.CONTACT_WORK, 0]),
    ]


@case
def _webassembly() -> Sequence[Value]:
    elastic = _rigid_target_hit(LinearPermanent(1e6, 0.0, 0.0, 1.5))
    return [*elastic[:-1], *_rigid_target_hit(YangSunPermanent(1e6, ALPHA_CR))]
