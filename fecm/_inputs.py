"""Input files, read within bounds: regular files of a size that fits in memory.

Text is UTF-8, UTF-16 with a byte order mark, or else Windows-1252. Lines end at LF, CRLF or CR.
"""

from __future__ import annotations

import codecs
import contextlib
import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from fecm._errors import FecmError
from fecm._files import NO_WAIT
from fecm._machine import format_bytes, require_memory

LARGEST = 1_000_000_000  # bytes of a file; no mesh or measurement needs more
LARGEST_SETTINGS = 1_000_000  # bytes of a file of settings, such as tolerances or plies
BYTES_A_BYTE = 12  # memory of a table of numbers or of a mesh, per byte of its text
MOST_DOTS = 100  # of a line of TOML: tomllib takes a time quadratic in the depth of a key


T = TypeVar("T")


class InputError(FecmError, OSError):
    """A file can't be read; the message says why."""


class ContentError(FecmError, ValueError):
    """The text of a file is invalid; the message names the file."""


@contextlib.contextmanager
def open_input(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file.

    Raises InputError for devices and FIFOs, which may never end.
    """
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | NO_WAIT)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise InputError(f"{path} is not a regular file")
        yield file


def read_input(path: Path, most: int = LARGEST) -> bytes:
    """Return the contents of a regular file of at most `most` bytes.

    Raises InputError for any other file, NotEnoughMemoryError if there is not enough memory to work
    with the contents, and OSError if the file can't be read.
    """
    with open_input(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            raise InputError(
                f"{path} has {format_bytes(size)}; no more than {format_bytes(most)} are read"
            )
        require_memory(BYTES_A_BYTE * size, f"{path}: reading it")
        return file.read()


def decoded(data: bytes, name: str) -> str:
    """Decode the text of a file.

    A byte order mark of UTF-8 stays. Bytes that Windows-1252 does not define become U+FFFD. Raises
    InputError if the file is not text.

    >>> decoded("5 €".encode("cp1252"), "a"), decoded("5 €".encode("utf-16"), "a")
    ('5 €', '5 €')
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", "replace")
    else:
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            text = data.decode("cp1252", "replace")
    if "\0" in text:
        raise InputError(f"{name} is binary, or text in an unknown encoding; save it as UTF-8")
    return text


def lines_of(text: str) -> list[str]:
    r"""Split a text into lines without their ends.

    ``str.splitlines`` also splits at form feeds, U+0085 and U+2028.

    >>> lines_of("a\r\nb\rc\u2028d\n")
    ['a', 'b', 'c\u2028d']
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines if lines[-1] else lines[:-1]


def parsed_file(path: Path, parse: Callable[[str], T]) -> T:
    """Apply a parser to the text of a file of settings and return its result.

    A ValueError of the parser becomes a ContentError. Raises InputError and OSError as
    :func:`read_input`.
    """
    text = decoded(read_input(path, LARGEST_SETTINGS), str(path)).removeprefix("\ufeff")
    try:
        return parse(text)
    except ValueError as error:
        raise ContentError(f"{path}: {error}") from None


def parsed_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text.

    Raises ValueError if the text is not TOML, or nested too deeply.
    """
    import tomllib  # 2 ms, and few commands read TOML

    for number, line in enumerate(lines_of(text), start=1):
        if line.count(".") > MOST_DOTS:
            raise ValueError(f"line {number} has more than {MOST_DOTS} dots; write it as several")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("tables or lists are nested too deeply") from None
    except ValueError as error:
        if "set_int_max_str_digits" not in str(error):
            raise
        raise ValueError("a whole number has too many digits") from None
