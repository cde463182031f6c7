"""Results of three small decks under ``solver="numpy"``, against stored ones.

A deck keeps its datasets from one version to the next. Whole numbers (steps, nodes, plies, modes of
failure) are the same everywhere: their bytes have a checksum. The last bits of the others depend on
the machine: products of matrices are BLAS's, which sums in another order on each kind of processor.
A dataset of floats therefore has its number of NaN, the sum of its magnitudes and a weighted sum,
which change with a value, its sign and its place. They agree to 1e-12. Acceleration, transducer and
strain of the rod are differences of nearly equal numbers and lose two digits. The error of the
balance of energy loses more.

``python -m tests.test_stored_results`` writes the file again, where a change of results is meant.
"""

from __future__ import annotations

import json
import zlib
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from tests.decks import DATA, DATA_CARDS, DISC, MESH, PROGRAM, small

FILE = DATA / "stored_results.json"

# Two unlike plies, struck off the middle, so that no two exposures are equal but for rounding.
UNLIKE = (
    DATA_CARDS.replace("   13    3", "    8    3")
    .replace(".106", ".116")
    .replace("2  90.     0.053", "2  30.     0.063")
)
STORING = PROGRAM.replace(
    "DISP          5", "DISP          5\nFAIL          2\nPLYS          5    2\nSTRE          5"
)
STRENGTHS = "ALLO\n   200000.   200000.     7000.    28000.    13000.\n\n"
# w is held at y = 0; u, v and w at y = 2.
MOVING = (
    MESH.partition("BOUN")[0]
    + "BOUN\n    1    1    0    0   -1    0    0\n    5    0    0    0    1    0    0\n"
    + "   21    1    1    1   -1    0    0\n   25    0    1    1    1    0    0\n\n"
)
DECKS = {
    "linear": small(STORING, data=DISC + STRENGTHS + UNLIKE),
    "nonlinear": small(STORING, mesh=MOVING, data=f"SHEA MITC\nNONL\n{DISC}{STRENGTHS}{UNLIKE}"),
    "rod": small(data=DISC + DATA_CARDS),
}
TOLERANCES = {"acceleration": 1e-10, "transducer": 1e-10, "projectile_strain": 1e-10,
              "balance_error": 1e-7}  # fmt: skip


def sums(values: NDArray[Any]) -> list[float]:
    """Number of NaN, sum of the magnitudes and sum with rising weights; of integers a checksum."""
    if values.dtype.kind != "f":
        return [zlib.crc32(values.astype("<i8").tobytes())]
    known = np.nan_to_num(values).ravel()
    weights = np.arange(1, known.size + 1) / max(known.size, 1)
    return [int(np.isnan(values).sum()), float(np.abs(known).sum()), float(weights @ known)]


def stored(deck: str) -> dict[str, Any]:
    """Type, shape and sums of every dataset of a deck's result."""
    result = fecm.run_one(deck, solver="numpy")
    values = {path: np.asarray(result[path]) for path in result}
    return {
        path: [str(array.dtype), list(array.shape), sums(array)] for path, array in values.items()
    }


@pytest.mark.parametrize("name", DECKS)
def test_a_deck_keeps_its_datasets(name: str) -> None:
    expected, actual = json.loads(FILE.read_text(encoding="utf-8"))[name], stored(DECKS[name])
    assert {path: row[:2] for path, row in actual.items()} == {
        path: row[:2] for path, row in expected.items()
    }
    for path, (kind, _, wanted) in expected.items():
        got = actual[path][2]
        if not kind.startswith("float"):
            assert got == wanted, path
            continue
        assert got[0] == wanted[0], path
        near = TOLERANCES.get(path.rpartition("/")[2], 1e-12) * wanted[1]
        assert got[1:] == pytest.approx(wanted[1:], rel=0.0, abs=near), path


if __name__ == "__main__":
    tables = [
        f'"{name}": {{\n'
        + ",\n".join(f'  "{path}": {json.dumps(row)}' for path, row in stored(deck).items())
        + "\n}"
        for name, deck in DECKS.items()
    ]
    FILE.write_text("{\n" + ",\n".join(tables) + "\n}\n", encoding="utf-8")
