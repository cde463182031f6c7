"""Text of a deck: from a file or a stream, or given as it is."""

from __future__ import annotations

from pathlib import Path

from fecm._errors import OptionsError
from fecm._inputs import InputError, decoded
from fecm._memory import NotEnoughMemoryError, available, format_bytes, require
from fecm._typing import AnyFile

LARGEST_FILE = 1_000_000_000  # no deck needs more bytes
# Largest memory of a deck per byte of text and per line, measured at 10 MB.
BYTES_A_BYTE = 12
BYTES_A_LINE = 1100
FIRST = 4096  # number of bytes that identify a binary file
HDF5 = b"\x89HDF\r\n\x1a\n"  # first bytes of an HDF5 file
INLINE = "<text>"  # name of a deck that is given as text, or in a stream without a name


def load_text(path_or_text: str | Path | AnyFile) -> tuple[str, str]:
    """Text and name of a deck, see :func:`fecm.read_deck`.

    Raises OptionsError if it is no path, text or open file.
    """
    if isinstance(path_or_text, str) and ("\n" in path_or_text or not path_or_text.strip()):
        return path_or_text, INLINE
    if isinstance(path_or_text, str | Path):
        with Path(path_or_text).open("rb") as file:
            return _text(file, str(path_or_text)), str(path_or_text)
    if not hasattr(path_or_text, "read"):
        raise OptionsError(
            f"a deck is a path, a text, an open file or a Deck, not {path_or_text!r}"
        )
    name = getattr(path_or_text, "name", None)
    name = name if isinstance(name, str) else INLINE
    return _text(path_or_text, name), name


def _text(file: AnyFile, path: str) -> str:
    """Text of a deck, which may be an endless pipe; see :func:`decoded`."""
    free = available()
    most = LARGEST_FILE if free is None else min(LARGEST_FILE, free // BYTES_A_BYTE)
    begin = _read(file, FIRST)
    if begin.startswith(HDF5):
        raise InputError(f"{path} is an HDF5 file, not a deck; `fecm info {path}` shows a result")
    decoded(begin, path)
    data = begin + _read(file, max(0, most + 1 - len(begin)))
    if len(data) > most:
        raise NotEnoughMemoryError(f"{path}: a deck of more than {format_bytes(most)} is not read")
    lines = data.count(b"\n") + data.count(b"\r") - data.count(b"\r\n")
    require(BYTES_A_BYTE * len(data) + BYTES_A_LINE * lines, f"{path}: the deck")
    return decoded(data, path)


def _read(file: AnyFile, size: int) -> bytes:
    """Bytes of a file that is open as bytes or as text."""
    data = file.read(size)
    return data.encode("utf-8", "surrogateescape") if isinstance(data, str) else data
