"""Writes the three tapes as text, in the formats of the printed program.

tape3 holds w of every node, (6E12.4).  In the report tape8 holds strains, (2I6,5E12.4), and tape9
contact, (6E12.4); the slip ``tapes`` exchanges both tapes and the columns of the shear strains.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from fecm._files import beside
from fecm._typing import Floats
from fecm.results.result import Result
from fecm.results.schema import ResultFileError

CURVATURES = ("kappa_x", "kappa_y", "kappa_xy")
CONTACT = ("force", "indentation", "transducer", "displacement", "velocity", "acceleration")


def fortran_e(value: float) -> str:
    """Write a number in the format E12.4: ``  0.2322E+01``."""
    if not np.isfinite(value):
        text = "NaN" if np.isnan(value) else ("-Infinity" if value < 0 else "Infinity")
        return text.rjust(12)
    mantissa, _, power = f"{value:.3e}".partition("e")
    sign = "-" if mantissa.startswith("-") else ""
    digits = mantissa.lstrip("-").replace(".", "")
    exponent = int(power) + (digits != "0000")
    # A three-digit exponent has no letter.
    mark = f"E{exponent:+03d}" if abs(exponent) < 100 else f"{exponent:+04d}"
    return f"{sign}0.{digits}{mark}".rjust(12)


def _lines(table: Floats) -> Iterator[str]:
    """Lines of six numbers; the last line of a row may be shorter."""
    for row in table:
        for start in range(0, len(row), 6):
            yield "".join(map(fortran_e, row[start : start + 6].tolist()))


def _strains(result: Result, shears: tuple[str, str]) -> Iterator[str]:
    columns = [result[f"tape8/{name}"] for name in (*CURVATURES, *shears)]
    rows, numel, npt = columns[0].shape
    for row in range(rows):
        values = np.stack([column[row] for column in columns], axis=-1).tolist()
        for element in range(numel):
            for point in range(npt):
                text = "".join(map(fortran_e, values[element][point]))
                yield f"{element + 1:6d}{point + 1:6d}{text}"


def tape_texts(result: Result) -> dict[str, Iterator[str]]:
    """Lines of every tape that the run stored, by name."""
    listing = result.has_listing_tapes
    strains, contact = ("tape9", "tape8") if listing else ("tape8", "tape9")
    shears = ("gamma_xz", "gamma_yz") if listing else ("gamma_yz", "gamma_xz")
    texts: dict[str, Iterator[str]] = {}
    if "tape3/w" in result:
        texts["tape3"] = _lines(result["tape3/w"])
    if "tape8/kappa_x" in result:
        _require(result, [f"tape8/{name}" for name in (*CURVATURES, *shears)])
        texts[strains] = _strains(result, shears)
    if "tape9/force" in result:
        _require(result, [f"tape9/{name}" for name in CONTACT])
        texts[contact] = _lines(np.stack([result[f"tape9/{n}"] for n in CONTACT], axis=-1))
    return dict(sorted(texts.items()))


def _require(result: Result, paths: Iterable[str]) -> None:
    """Require the datasets of a tape."""
    for path in paths:
        if path not in result:
            raise ResultFileError(f"the result lacks {path}, which a tape needs")


def write_tapes(result: Result, folder: Path, *, overwrite: bool = True) -> list[Path]:
    """Write all tapes into a folder, or none; a missing folder is created.

    Returns the paths of the files.  Raises OSError if a file can't be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    texts = {folder / name: lines for name, lines in tape_texts(result).items()}
    with contextlib.ExitStack() as stack:
        for path, lines in texts.items():
            partial = stack.enter_context(beside(path, overwrite=overwrite))
            with partial.open("w", encoding="ascii", newline="\n") as file:
                file.writelines(f"{line}\n" for line in lines)
    return list(texts)
