"""Standard streams whose errors do not disturb a command.

Errors of standard error are ignored. Standard output raises its first error, remembers it, and
drops what follows: the command's exit status then says that something was not printed. Characters
that an encoding lacks are escaped.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from typing import TextIO


class _Guarded(io.FileIO):
    """Stream that remembers its first error of writing and drops what follows."""

    error: OSError | None = None

    def __init__(self, number: int, *, raises: bool) -> None:
        super().__init__(number, "w", closefd=False)
        self._raises = raises

    def write(self, data: object) -> int:
        """Write bytes, and return their number."""
        view = memoryview(data)  # type: ignore[arg-type]
        if self.error is None:
            try:
                return super().write(view)
            except OSError as error:
                self.error = error
                if self._raises:
                    raise
        return view.nbytes


_guarded: list[_Guarded] = []  # the standard output, once it is guarded


def guard_streams() -> None:
    """Guard the standard streams of this process; replaced streams stay as they are."""
    # In order, as each takes the lowest free number.  No other file may get such a number, or what
    # is printed would go there.  A write to what is open for reading fails.
    for number, flags in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, flags)
    if _is_own(sys.stdout, 1):
        _guarded[:] = [_Guarded(1, raises=True)]
        sys.stdout = _text(_guarded[0], sys.stdout)
    if _is_own(sys.stderr, 2):
        sys.stderr = standard_error(2, sys.stderr)


def standard_error(number: int, like: TextIO | None) -> TextIO:
    """Return a guarded text stream to an open file, in the encoding of another stream."""
    return _text(_Guarded(number, raises=False), like, line_buffering=True)


def _is_own(stream: TextIO | None, number: int) -> bool:
    """Return whether a stream is the process's own, or was closed before the process began."""
    if stream is None:
        return True
    try:
        return isinstance(stream, io.TextIOWrapper) and stream.fileno() == number
    except (OSError, ValueError):
        return False


def _text(raw: _Guarded, like: TextIO | None, *, line_buffering: bool = False) -> TextIO:
    encoding = "utf-8" if like is None else like.encoding
    through = isinstance(like, io.TextIOWrapper) and (like.line_buffering or like.write_through)
    buffer = io.BufferedWriter(raw)
    lines = line_buffering or through
    return io.TextIOWrapper(buffer, encoding, "backslashreplace", line_buffering=lines)


def output_error() -> OSError | None:
    """Print what is still buffered, and return the first error of standard output, if any."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    return _guarded[0].error if _guarded else None
