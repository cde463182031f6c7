"""The kernel of sweeps as WebAssembly, for pages that compute impacts in a browser.

``.ci/wasm`` compiles ``sweep.wasm`` from the sources in this folder and writes their checksum into
the last section of the module.  The module has the C library inside and imports nothing.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from fecm.mechanics.kernels import Structure

PATH = Path(__file__).with_name("sweep.wasm")
SECTION = b"fecm sources"  # name of the last section
POINTER = 4  # bytes of a pointer


class WasmField(NamedTuple):
    """Field of a structure in the memory of the module."""

    name: str
    kind: str  # "int64", "double", or "pointer" to doubles
    offset: int  # bytes


def sources_of(module: bytes) -> int:
    """Return the checksum of the sources that a module was compiled from; 0 if it has none."""
    _, found, digits = module.rpartition(SECTION)
    return int(digits) if found and digits.isdigit() else 0


def wasm_fields(structure: type[Structure]) -> Iterator[WasmField]:
    """Yield the fields of a structure with their offsets where pointers have four bytes.

    The other fields have eight bytes.
    """
    kinds = {ctypes.c_int64: "int64", ctypes.c_double: "double"}
    offset = 0
    for name, declared, *_ in structure._fields_:
        kind = kinds.get(declared, "pointer")
        size = POINTER if kind == "pointer" else 8
        offset += -offset % size
        yield WasmField(name, kind, offset)
        offset += size
