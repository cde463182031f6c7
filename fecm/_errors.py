"""Base class of the package's errors, errors without a room, and warnings."""

from __future__ import annotations

import contextlib
import sys
import warnings
from collections.abc import Iterable

# Files of this package, and of the standard library where it calls this package.
OURS = (__file__.removesuffix("_errors.py"), contextlib.__file__)


class FecmError(Exception):
    """Base class of all errors that fecm raises on purpose.

    Attributes
    ----------
    exit_code : int
        Exit status of the command line: 2 for unusable input, 1 for a failed check or run.
    """

    exit_code = 2


class OptionsError(FecmError, ValueError):
    """An option has a value that is not possible, or not with this deck."""


class ResultFileError(FecmError, ValueError):
    """A file is not a readable result."""


class StudyError(FecmError, ValueError):
    """A study can't be computed from these numbers, or their table is invalid."""


def did_you_mean(name: str, known_names: Iterable[str], similarity: float = 0.6) -> str:
    """Return the end of a message about an unknown name: the most similar known name.

    It is empty if no name is similar. Upper and lower case are alike. `similarity` is the least
    one, from 0 to 1.
    """
    import difflib  # 1 ms, only after a mistake

    folded = {name_known.casefold(): name_known for name_known in known_names}
    close = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=similarity)
    return f"; did you mean {folded[close[0]]}?" if close else ""


class FecmWarning(UserWarning):
    """Reason to doubt a deck or the result of a run."""


# A finding of a deck is shown once, however often the deck is used; filters of the user come first.
warnings.filterwarnings("once", r"[^\n]*: warning\[W", FecmWarning, append=True)


def warn(*texts: str) -> None:
    """Issue one :class:`FecmWarning` at the first caller outside this package; none without texts.

    Several texts, such as the notes of a result, are lines of one warning.
    """
    if not texts:
        return
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_code.co_filename.startswith(OURS):
        frame, level = frame.f_back, level + 1
    warnings.warn(FecmWarning("\n".join(texts)), stacklevel=level)
