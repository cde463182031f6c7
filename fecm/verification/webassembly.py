"""The kernel of sweeps as WebAssembly, run by the optional library wasmtime."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from fecm._typing import Floats
from fecm.mechanics.impact_sweep import SweepStruct, Swept, sweep_structure
from fecm.mechanics.kernels.webassembly import PATH, wasm_fields

SPACE = 1024  # bytes for the structure, which are more than it needs


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
