"""The kernel of sweeps as WebAssembly, run by the optional library wasmtime."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.contact_law import ContactParameters, LinearPermanent, YangSunPermanent
from fecm.mechanics.impact_steps import kernel_law
from fecm.mechanics.impact_sweep import Given, ResultRow, SweepStruct, Swept, sweep_structure
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
        """Compute impacts, as :func:`fecm.mechanics.impact_sweep.sweep_linear` does.

        The arrays of `swept` are whole, not columns of larger ones.
        """
        given = np.ascontiguousarray(swept.given)
        values = sweep_structure(response, rigid, swept._replace(given=given)).held
        values |= {"given": given, "found": swept.found, "stride": given.shape[1]}
        memory = self._exports["memory"]
        places = {
            name: self._allocated(np.ascontiguousarray(value).tobytes())
            for name, value in values.items()
            if isinstance(value, np.ndarray)
        }
        packed = bytearray(SPACE)
        for name, kind, offset in wasm_fields(SweepStruct):
            form = {"int64": "<q", "double": "<d", "pointer": "<I"}[kind]
            struct.pack_into(form, packed, offset, places.get(name, values[name]))
        at = self._allocated(bytes(packed))
        if not self._exports["fecm_sweep"](self._store, at):
            raise MemoryError
        for array, name in ((swept.force, "force"), (swept.found, "found")):
            stored = memory.read(self._store, places[name], places[name] + array.nbytes)
            array[:] = np.frombuffer(stored).reshape(array.shape)
        self._free([*places.values(), at])

    def _allocated(self, data: bytes) -> int:
        """Return the address of a copy of some bytes."""
        at: int = self._exports["malloc"](self._store, len(data))
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
