"""Compiled kernels, where the installation has them; :data:`LIBRARY` is None otherwise."""

from __future__ import annotations

import ctypes
import zlib
from ctypes import POINTER, Structure, c_double, c_int8, c_int32, c_int64
from importlib.util import find_spec
from io import SEEK_END
from pathlib import Path
from struct import Struct
from typing import Any

from fecm._typing import Floats

Doubles, Integers, Longs = POINTER(c_double), POINTER(c_int32), POINTER(c_int64)
Codes = POINTER(c_int8)

# The structures of kernels.c and impact.h, field by field.


def _fields(text: str, **kinds: Any) -> list[tuple[str, Any]]:
    """Fields of a structure from `kind: name name; ...`."""
    known = {"int": c_int64, "float": c_double, "floats": Doubles, "ints": Integers} | kinds
    found: list[tuple[str, Any]] = []
    for part in text.split(";"):
        kind, names = part.split(":")
        found += [(name, known[kind.strip()]) for name in names.split()]
    return found


class Group(Structure):
    """Elements with the same nodes present, and either one matrix or none."""

    _fields_ = _fields(
        "int: kind nodes pairs; floats: matrix; int: bending shear tying; floats: rotations"
        " deflection rotations_t deflection_t in_plane_t tied tied_t"
    )


class Block(Structure):
    """Eight elements."""

    _fields_ = _fields("group: group; ints: place; floats: data", group=POINTER(Group))


class Chunk(Structure):
    """Blocks of near elements."""

    _fields_ = _fields(
        "int: blocks; blocks: block; int: first nodes shared fixed; ints: shares copies at_rest;"
        " floats: signs force",
        blocks=POINTER(Block),
    )


class Plate(Structure):
    """A plate and its state."""

    _fields_ = _fields(
        "int: nd chunks nodes most; chunks: chunk; ints: lane; floats: stiffness shear;"
        " int: transposed planes;"
        " floats: mass inverse ratio rate u d s shared; float: damping",
        chunks=POINTER(Chunk),
    )


class Strains(Structure):
    """Strains of elements with the same nodes present."""

    _fields_ = _fields(
        "int: elements nodes points width; longs: row node shape; floats: table metric",
        longs=Longs,
    )


class Failure(Structure):
    """Largest exposures of plies."""

    _fields_ = _fields(
        "int: points states width; floats: in_plane; float: xt xc yt yc s12 f12 p_plus p_minus"
        " resistance critical; floats: exposure time; codes: mode",
        codes=Codes,
    )


class Impact(Structure):
    """Contact, projectile and records of steps."""

    _fields_ = _fields(
        "float: k q critical slope; int: law; float: branch f b w p peak peak_force permanent"
        " indentation force plate_w work time; int: unconverged; float: dt theta weight_before"
        " weight gain; int: modes; floats: T h stiffness tip_shape station motion;"
        " float: tip dt2; int: loaded; longs: entry; floats: load_weight mobility last;"
        " int: gages gage_dofs; longs: gage_entry; floats: gage_weight; int: rows; longs: stored;"
        " floats: records strains fields",
        longs=Longs,
    )


class Sweep(Structure):
    """Impacts of many cases by one kind of projectile."""

    _fields_ = _fields(
        "int: cases stride steps modes law; float: dt theta weight_before weight;"
        " floats: T h stiffness tip_shape plate given force found"
    )


COLUMNS = (
    "time", "inertia", "power", "strain", "internal", "load_d", "load_s", "force", "indentation",
    "plate_w", "contact_work", "displacement", "velocity", "acceleration", "projectile_kinetic",
    "projectile_strain", "station",
)  # fmt: skip


ELF64 = b"\x7fELF\x02\x01"  # begin of a little-endian 64-bit ELF file
# e_phoff and e_phnum of its header; p_offset and p_filesz of a segment's.
ELF_HEADER, SEGMENT = Struct("<32x Q 16x H"), Struct("<8x Q 16x Q 16x")


def _load() -> Any:
    """Compiled library of these sources, None without one.

    One of other sources, left by an earlier installation in place, is not used.
    """
    found = find_spec(f"{__name__}._compiled")
    if found is None or found.origin is None:
        return None
    try:
        if not _is_whole(Path(found.origin)):
            return None
        library = ctypes.CDLL(found.origin)
        if library.fecm_stamp() != stamp(Path(__file__).parent):
            return None
    except (OSError, AttributeError):  # no library, or an older one without a stamp
        return None
    library.fecm_impact_steps.restype = c_int64
    return library


def _is_whole(path: Path) -> bool:
    """Whether a library has all bytes that loading it maps; one cut short would crash the process.

    Only 64-bit ELF files are judged (System V ABI, gABI 4.1, chapters 4 and 5).
    """
    with path.open("rb") as file:
        head = file.read(ELF_HEADER.size)
        if len(head) < ELF_HEADER.size or not head.startswith(ELF64):
            return True  # the system's loader refuses it, or knows its format
        table, count = ELF_HEADER.unpack(head)
        file.seek(table)
        headers = file.read(count * SEGMENT.size)
        size = file.seek(0, SEEK_END)
    complete = len(headers) == count * SEGMENT.size
    return complete and all(a + length <= size for a, length in SEGMENT.iter_unpack(headers))


def stamp(folder: Path) -> int:
    """Checksum of the sources in a folder, which the compiled library carries."""
    return zlib.crc32(b"".join(path.read_bytes() for path in sorted(folder.glob("*.[ch]")))) >> 1


LIBRARY = _load()


def description() -> str:
    """Which kernels are in use, in words."""
    if LIBRARY is None:
        return "not compiled; NumPy is used"
    return f"compiled, {'AVX2' if LIBRARY.fecm_has_avx2() else 'portable'}"


def floats(array: Floats) -> Any:
    """Pointer to an array of numbers."""
    return array.ctypes.data_as(Doubles)
