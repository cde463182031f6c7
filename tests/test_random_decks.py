"""Random decks: the compiled kernels, NumPy and the sparse matrix give the same results.

``python -m tests.test_random_decks 0 200`` runs decks 0 to 199 and prints those that differ.
"""

from __future__ import annotations

import re
import sys
import warnings

import numpy as np
import pytest

import fecm
from fecm._errors import FecmWarning
from fecm.listing.slips import LISTING, NAMES
from fecm.mechanics import kernels
from tests.builders import distorted_square, simple_support, square
from tests.test_element_decks import deck
from tests.test_kernels import assert_close

SIDE = 2.0
ORDERS = {
    3: ["2,1,2", "3,2,1"], 4: ["2,1,2", "2,2,-2", "3,2,2"], 8: ["3,2,3", "3,3,-3"],
    9: ["3,2,3", "3,3,-3", "4,4,3"], 10: ["4,3,4", "4,4,-4"], 12: ["4,3,4", "4,4,-4"],
}  # fmt: skip
ALLO = "ALLO\n200000.,200000.,7000.,28000.,13000.\n\n"


def random_deck(seed: int) -> tuple[str, str, tuple[str, ...]]:
    """A deck with a mode and slips, all of them drawn."""
    rng = np.random.default_rng(seed)

    def some(share: float, text: str) -> str:
        return text if rng.random() < share else ""

    def between(low: float, high: float) -> str:
        return f"{rng.uniform(low, high):.6g}"

    def one(*texts: str) -> str:
        return str(rng.choice(texts))

    kind = int(rng.choice(list(ORDERS)))
    maker = one("square", "distorted", "distorted")
    nx, ny = rng.choice([2, 3, 4, 4, 6], 2).tolist()
    coordinates, elements = (square if maker == "square" else distorted_square)(nx, ny, kind)
    text = deck((coordinates, elements), (3, 2, 3), side=SIDE, steps=0)
    free = np.flatnonzero(~simple_support(coordinates)[:, 2]) + 1
    listing, slips = rng.random() < 0.1, ()
    if not listing and rng.random() < 0.3:
        slips = tuple(rng.choice(NAMES, rng.integers(1, 4), replace=False).tolist())
    plain = listing or bool(slips)  # without the words that the report's program lacks

    # Material: B is 0 where the layers are mirrored, or only one angle is there.
    layers = [
        (one("0.", "30.", "45.", "90.", "-60."), 1e-3 * rng.integers(20, 60))
        for _ in range(rng.integers(1, 4))
    ]
    layers += layers[::-1] if rng.random() < 0.4 else []
    cards = "".join(f"{n},{angle},{h:.3f}\n" for n, (angle, h) in enumerate(layers, 1))
    text = text.replace("1,0.,.053\n2,90.,.053\n", cards)
    text = text.replace(f",{len(elements)},2,2,5,", f",{len(elements)},{len(layers)},2,5,")
    text = text.replace(
        "MATE\n3,2,3,0.106", f"MATE\n{one(*ORDERS[kind])},{sum(h for _, h in layers):.3f}"
    )
    if len({angle for angle, _ in layers}) > 1 or rng.random() < 0.2:
        text = text.replace(",0,1,1,", ",0,0,0,")

    # Impact and loads.
    point = rng.choice(free) if rng.random() < 0.5 else None
    words = ""
    if not plain:
        centre = "" if point is None else f",{between(0.7, 1.3)},{between(0.7, 1.3)}"
        shape = one("DISC", "HERT")
        patch = some(0.4, f"PATC\n{shape},{between(0.1, 0.4)}{centre}\n")
        words += some(0.3, f"DAMP\n{between(100.0, 5000.0)}\n")
        words += some(0.3, f"GAGE\n1,{between(0.2, 1.8)},{between(0.2, 1.8)},.053,30.\n\n")
        words += patch + some(0.5 if kind in (4, 9) else 0.0, "SHEA MITC\n")
        mass = f"0,0,{between(5e-5, 3e-4)}\n\n"
        rod = f"4,3,1.,30.E6,.0006875\n1,1,{between(0.2, 0.6)}\n4,0,{between(0.2, 0.6)}\n\n"
        words += some(0.6, f"PROJ\n{one(mass, rod)}")
    if point is not None:
        text = re.sub(r"ROD\n\d+,", f"ROD\n{point},", text)
    most = 0.5 if plain else 20.0  # some slips multiply it by the contact force, and may diverge
    words += some(0.3, f"FORC\n{rng.choice(free)},0,0.,0.,{between(-most, most)}\n\n")
    text = text.replace("EXPE\n", f"{words}EXPE\n")
    if not plain and rng.random() < 0.3:
        text = text.replace("EXPE\n1912000.,.0006564,.094,2.", "EXPE ACR\n1912000.,.0006564")

    # Program: loops with time steps of their own.
    fails = some(0.0 if plain else 0.3, ALLO)
    program = "LMAS\n"
    steps = ["0.", "7.0E-8"]
    if listing or "rod-dt" in slips:  # the rod keeps the first DT, and diverges under others
        steps = [one(*steps)]
    for _ in range(rng.integers(1, 4)):
        every, count = int(rng.integers(3, 40)), int(rng.choice([150, 200, 900], p=[0.6, 0.3, 0.1]))
        program += f"DT,,{one(*steps)}\nLOOP,,{count}\nTIME\n"
        program += f"RODP,,{every}\n" + some(0.5, f"DISP,,{every}\n") + some(0.2, "STRE,,50\n")
        if not plain:
            program += some(0.4, f"PLYS,,{every},2\n") + (fails and f"FAIL,,{every}\n")
        program += "NEXT\n"
    text = re.sub(r"LMAS\n.*(?=END\nSTOP)", program, text, flags=re.DOTALL)
    text = text.replace("\nEXPE", f"\n{fails}EXPE", 1)
    return text, LISTING if listing else "report", slips


CORE = "2,\n.00003,.3,200000.,200000.,70000.,30000.,30000.\n"
GLASS = "3,\n.00019,.27,6500000.,1900000.,750000.,700000.,600000.\n"


def several_laminates(seed: int) -> str:
    """A deck of report mode with two materials more, and laminates of zones."""
    rng = np.random.default_rng([seed, 1])
    plain = (random_deck(number) for number in range(1000 + 20 * seed, 1020 + 20 * seed))
    text = next(text for text, mode, slips in plain if mode == "report" and not slips)
    text = text.replace(",0,1,1,", ",0,0,0,")

    def layer(n: int) -> str:
        angle = rng.choice(["0.", "30.", "90.", "-60."])
        return f"{n},{angle},{1e-3 * rng.integers(20, 60):.3f},{rng.integers(1, 4)}\n"

    head, mate, rest = text.partition("MATE\n")
    cards = rest.splitlines(keepends=True)
    count = int(text.splitlines()[1].split(",")[2])
    for n in range(2, 2 + count):
        cards[n] = cards[n].rstrip() + f",{rng.integers(1, 4)}\n"
    elements = int(text.splitlines()[1].split(",")[1])
    words = f"MATS\n{CORE}{GLASS}\nLAMS\n"
    for number in (2, 3):
        layers = rng.integers(1, 5)
        words += f"{number},{layers}\n" + "".join(layer(n) for n in range(1, layers + 1))
    words += "\nZONE\n"
    for _ in range(rng.integers(1, 4)):
        first, last = np.sort(rng.integers(1, elements + 1, 2)).tolist()
        words += f"{first},{last},{rng.integers(1, 4)},{rng.integers(1, 4)}\n"
    text = f"{head}{words}\n{mate}{''.join(cards)}"
    strengths = ALLO.rstrip() + "\n,\n" + "300000.,200000.,9000.,30000.,15000.,,,2\n\n"
    return text.replace(ALLO, strengths) if rng.random() < 0.6 else text


def compare(seed: int) -> None:
    """Compare the solvers on a deck."""
    agree(*random_deck(seed))


def agree(text: str, mode: str = "report", slips: tuple[str, ...] = ()) -> None:
    """Let every solver run a deck, and compare the results."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FecmWarning)
        csr, array, *compiled = (
            fecm.run_one(text, mode, slips, solver=solver)  # type: ignore[arg-type]
            for solver in ("csr", "numpy", "kernels")[: 2 + (kernels.LIBRARY is not None)]
        )
    assert_close(array, csr)
    for actual in compiled:
        assert_close(actual, array)


def test_the_decks_have_every_word_slip_and_family_of_elements() -> None:
    texts, modes, slips = zip(*map(random_deck, range(200)), strict=True)
    for word in (
        "PATC\nDISC",
        "PATC\nHERT",
        "GAGE",
        "DAMP",
        "PROJ\n0",
        "PROJ\n4",
        "FORC",
        "SHEA",
        "EXPE ACR",
        "ALLO",
        "DISP",
        "STRE",
        "PLYS",
        "FAIL",
    ):
        assert any(word in text for text in texts)
    assert {text.splitlines()[1].split(",")[5] for text in texts} == set(map(str, ORDERS))
    assert set(modes) == {"report", LISTING}
    assert {slip for some in slips for slip in some} == set(NAMES)


# They have every word and family of elements, slips and the listing's mode.
SHORT = (7, 11, 21, 22, 31, 36)


@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=() if n in SHORT else pytest.mark.long) for n in range(200)]
)
@pytest.mark.few(3)  # of 6, 0.2 s each
def test_every_solver_gives_the_same_result(seed: int) -> None:
    compare(seed)


# Without and with assumed shear strains.
SHORT_ZONES = (1, 2)


@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=() if n in SHORT_ZONES else pytest.mark.long) for n in range(40)]
)
@pytest.mark.few(1)  # of 2, 0.2 s each
def test_every_solver_gives_the_same_result_of_several_laminates(seed: int) -> None:
    agree(several_laminates(seed))


if __name__ == "__main__":
    for number in range(*map(int, sys.argv[1:])):
        try:
            compare(number)
        except (AssertionError, fecm.FecmError) as error:
            lines = [line for line in str(error).splitlines() if line.strip()]
            print(number, *lines[:6], sep="\n  ", flush=True)
