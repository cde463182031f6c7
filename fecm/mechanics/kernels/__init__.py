"""Compiled kernels, if the installation has them; :data:`LIBRARY` is None otherwise.

Each kernel has one Python file, which defines its structures, its input and its output:

- K u: :mod:`~fecm.mechanics.kernels.plate`, with :mod:`~fecm.mechanics.kernels.element_groups`
  and :mod:`~fecm.mechanics.kernels.membrane`;
- steps of an impact: :mod:`fecm.mechanics.impact_steps`;
- many impacts on one plate: :mod:`fecm.mechanics.impact_sweep`;
- strains: :mod:`~fecm.mechanics.kernels.strains`;
- exposures of plies: :mod:`~fecm.mechanics.kernels.failure`, from the strains of
  :mod:`~fecm.mechanics.kernels.strains`;
- energies and largest values of the midplane of a nonlinear plate:
  :mod:`~fecm.mechanics.kernels.stretching`.

This file finds and loads the library.
"""

from __future__ import annotations

import ctypes
import sys
import zlib
from ctypes import POINTER, c_double, c_int, c_int8, c_int32, c_int64, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fecm._errors import warn
from fecm._typing import Floats

if TYPE_CHECKING:
    from ctypes import _Pointer

# Types of structure fields that point to arrays.
Doubles = POINTER(c_double)
Integers = POINTER(c_int32)
Longs = POINTER(c_int64)
Codes = POINTER(c_int8)
POINTERS = {
    np.dtype(number).char: kind
    for number, kind in (
        (np.float64, Doubles),
        (np.int32, Integers),
        (np.int64, Longs),
        (np.int8, Codes),
    )
}

# Result and arguments of the library's functions.  Structures are passed by reference.
FUNCTIONS = {
    "fecm_stamp": (c_int, []),
    "fecm_has_avx2": (c_int, []),
    "fecm_internal_force": (c_int, [c_void_p, c_int64, Doubles]),
    "fecm_impact_steps": (c_int64, [c_void_p, c_void_p, c_int64, c_int64]),
    "fecm_sweep": (c_int, [c_void_p]),
    "fecm_reduced": (c_int, [c_void_p, c_void_p]),
    "fecm_strains": (None, [c_void_p, c_int64, c_int64, c_int64, Doubles, Doubles]),
    "fecm_failure": (None, [c_void_p, c_int64, c_int64, Doubles, Doubles, Doubles, Longs, Codes]),
    "fecm_stretching": (
        None,
        [c_void_p, c_int64, c_void_p, c_int64, c_int64, c_int64, Doubles, Doubles, Doubles],
    ),
}

# Library that the build puts beside this file.  It does not depend on Python.
PATH = Path(__file__).with_name(
    "libfecm" + {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
)


def _load() -> ctypes.CDLL | None:
    """Load the library compiled from these sources; return None if there is no such library.

    Warns if a library exists but can't be used.  NumPy, which is slower, then replaces it.
    """
    if not PATH.exists():
        return None
    try:
        library = ctypes.CDLL(str(PATH))
        if library.fecm_stamp() == stamp(Path(__file__).parent):
            return _declare_types(library)
        reason = "it was compiled from other sources"
    except OSError:
        reason = "this system can't load it"
    except AttributeError:
        reason = "it is another library"
    from multiprocessing import current_process  # 5 ms, only for the warning

    if current_process().name == "MainProcess":  # not in each worker of a sweep
        warn(
            f"the compiled kernels {PATH} are not used, as {reason}; NumPy is used instead and is "
            "slower.  Install fecm again, from its sources with `pip install -e .`"
        )
    return None


def _declare_types(library: ctypes.CDLL) -> ctypes.CDLL:
    """Declare the types of the results and arguments of the library's functions."""
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def stamp(folder: Path) -> int:
    """Return the checksum of the sources in a folder; the compiled library contains it."""
    return zlib.crc32(b"".join(path.read_bytes() for path in sorted(folder.glob("*.[ch]")))) >> 1


# Any, because the functions of a library have no types, and callers check beforehand that the
# library is not None.
LIBRARY: Any = _load()


def description() -> str:
    """Describe which kernels are in use."""
    if LIBRARY is None:
        return "not compiled; NumPy is used"
    return f"compiled, {'AVX2' if LIBRARY.fecm_has_avx2() else 'portable'}"


class Structure(ctypes.Structure):
    """A structure of structures.h, filled by keyword arguments.

    Pass pointers as arrays, in C order and of the field's type; the structure keeps the arrays
    alive.  For an array in another order pass a pointer of :func:`floats`, and keep the array
    alive.
    """

    def __init__(self, **values: Any) -> None:
        self.held = values
        super().__init__(**{name: _as_field(value) for name, value in values.items()})


def _as_field(value: Any) -> Any:
    """Convert an array to a pointer; return anything else unchanged."""
    if not isinstance(value, np.ndarray):
        return value
    if not value.flags.c_contiguous:
        raise ValueError("the array is not in C order")
    return value.ctypes.data_as(POINTERS[value.dtype.char])


def floats(array: Floats) -> _Pointer[c_double]:
    """Return a pointer to the first number of an array; the caller keeps the array alive."""
    return array.ctypes.data_as(Doubles)


def filled(array: Floats) -> Floats:
    """Return an array in C order whose last axis is zero-padded to a multiple of four."""
    *leading, count = array.shape
    padded = np.zeros((*leading, -(-count // 4) * 4))
    padded[..., :count] = array
    return padded
