"""Mistakes of an engineer in a sound deck, each of which has a finding that names its cause."""

from __future__ import annotations

import re

import numpy as np
import pytest

import fecm
from fecm import DivergenceError, Result
from fecm.mechanics.time_step import critical_time_step
from fecm.problem.loading import load_deck
from fecm.problem.parts import build_plate
from tests.decks import DATA

BASE = (DATA / "plate-100x100x2.inp").read_text()
COARSE = "W415"
Change = tuple[str, str]
ANY_TIME_STEP = ("DT         38-8", "DT          0.0")


def changed(*changes: Change) -> str:
    """The plate's deck with patterns replaced, each of which it must have."""
    text = BASE
    for pattern, new in changes:
        text, count = re.subn(pattern, new, text, flags=re.MULTILINE)
        assert count, pattern
    return text


def run_one(text: str) -> Result:
    """Run the deck's only problem."""
    return fecm.run_one(text)


def codes(text: str) -> set[str]:
    """Codes of a deck's findings, but for that of its mesh."""
    return {finding.code for finding in load_deck(text).findings} - {COARSE}


def scaled_coordinates(factor: float) -> str:
    """The deck with its coordinates multiplied."""
    start, end = BASE.index("COOR\n"), BASE.index("ELEM\n")
    cards = re.sub(
        r"(?m)^(.{10})(.{10})(.{10})$",
        lambda m: f"{m[1]}{float(m[2]) * factor:10.5g}{float(m[3]) * factor:10.5g}",
        BASE[start:end].replace("!:nod incr         x         y\n", ""),
    )
    return BASE[:start] + cards + BASE[end:]


def restrained(first: str, *cards: str) -> str:
    """The deck with other BOUN cards."""
    start, end = BASE.index("BOUN\n"), BASE.index("PROJ\n")
    return BASE[:start] + "\n".join(["BOUN", first, *cards, "", ""]) + BASE[end:]


MODULI = "  138000.0    8960.0    7100.0    7100.0    3200.0"
LAYER = r"^(.{10})     0.125$"


def test_the_plate_itself_has_no_finding_but_that_of_its_mesh() -> None:
    assert codes(BASE) == set()


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (changed(("    3000.0", "       3.0")), "W435"),
        (restrained("   13    0    0    0    1    0    0"), "W319"),
        (restrained("    1    1   -1   -1   -1    0    0", "  312    0    1    1    1    0    0",
                    "  313    0    1    1    0    0    0", "  314    1   -1   -1   -1    0    0",
                    "  625    0    1    1    1    0    0"), "W441"),
        (changed(("    4.1667$", "    5.6667")), "W323"),
        (changed(("       0.3  138000.0", "    0.0195  138000.0")), "W434"),
        (changed(("DT         38-8", "DT        38-11")), "W516"),
        (changed(("RODP          5", "EXCD           ")), "E519"),
        (changed(("     0.094       2.5", "     0.094       0.5")), "W437"),
        (changed(("     0.017", "      17.0")), "W436"),
        (changed(("   7.85E-9", "    7850.0")), "W438"),
        (changed(("  200000.0", "     200.0")), "W439"),
        (changed(("    3    3   -3", "    2    2   -3")), "W322"),
        (changed((LAYER, r"\1      62.5"), ("       2.0$", "    1000.0"), ANY_TIME_STEP), "W430"),
        (changed(("    2 45.0", "    2450.0")), "W431"),
        (changed(("^mm N s", "m N s")), "W435"),
        (changed(("  138000.0", "    1380.0")), "W433"),
    ],
    ids=[
        "velocity in m/s", "one node held", "all nodes held but one", "row of side nodes off",
        "nu21 for nu12", "DT in another unit", "EXCD for RODP", "q = 0.5",
        "alpha_p beyond the thickness", "rod's density in kg/m^3", "rod's modulus in GPa",
        "L1 = L2 = 2", "a thickness of 1000", "an angle of 450", "UNIT of another system",
        "E1 a hundredth",
    ],
)  # fmt: skip
def test_a_mistake_that_would_give_a_wrong_number_in_silence_is_named(text: str, code: str) -> None:
    assert code in codes(text)


@pytest.mark.parametrize(
    ("text", "code", "without_unit"),
    [
        (changed((MODULI, "   1.38E11    8.96E9     7.1E9     7.1E9     3.2E9")), "W435", "W439"),
        (changed(("  138000.0", "   1.38E11")), "W435", "W439"),
        (changed((r"^(.{5}) 45\.0", r"\1 .785"), (r"^(.{5}) -45\.", r"\1-.785"),
                 (r"^(.{5}) 90\.0", r"\g<1>1.571")), "W432", "W432"),
        (scaled_coordinates(1.0 / 25.4), "W430", "W430"),
        (changed(("       0.3  138000.0", "       3.0  138000.0")), "W434", "W434"),
        (changed((LAYER, r"\1  0.000125"), ("-3       2.0", "-3     0.002")), "W430", "W430"),
    ],
    ids=["moduli in Pa", "E1 in Pa", "angles in radians", "coordinates in inches", "nu12 = 3",
         "plies in m"],
)  # fmt: skip
@pytest.mark.few(2)  # of 6, 0.05 s each
def test_what_only_the_time_step_had_caught_is_named_where_the_deck_lets_fecm_choose_it(
    text: str, code: str, without_unit: str
) -> None:
    text = text.replace(*ANY_TIME_STEP)
    assert code in codes(text)
    assert without_unit in codes(text.replace("UNIT\nmm N s\n", ""))


@pytest.mark.parametrize(
    ("k", "stable"), [("      6E6", True), ("    1.2E7", False)], ids=["6e6", "1.2e7"]
)
def test_the_stable_step_with_the_contact_tells_which_run_diverges(k: str, stable: bool) -> None:
    text = BASE.replace("  100000.0     0.017", f" {k}     0.017")
    assert ("W517" not in codes(text)) is stable
    if stable:
        assert 200.0 < run_one(text).force.max() < 500.0
    else:
        with pytest.raises(DivergenceError, match=r"stable step with the contact's stiffness k_t"):
            run_one(text)


def test_steps_that_alternate_are_named_where_they_diverge() -> None:
    program = "DT         42-8\nTIME\nRODP\nDT         21-8\nTIME\nRODP\n"
    text = f"{BASE[: BASE.index('DT  ')]}LOOP        400\n{program}NEXT\nEND\nSTOP\n"
    with pytest.raises(DivergenceError, match=r"below the plate's.*but DT changes"):
        run_one(text)


def test_a_spring_far_stiffer_than_the_plate_leaves_a_mass_on_a_spring() -> None:
    problem = load_deck(BASE).problems[0]
    plate = build_plate(problem.deck, problem.mesh)
    node = np.zeros(plate.neq)
    node[problem.mesh.equations[312, 2] - 1] = 1.0
    # A corner node has 1/9 of an element's mass: 1.6e-9 * 2 * (100/12)^2.
    mass = 1.6e-9 * 2.0 * (100.0 / 12.0) ** 2 / 9.0
    assert critical_time_step(plate, (node, 1e9)) == pytest.approx(2.0 * (mass / 1e9) ** 0.5, 1e-3)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_assumed_shear_strains_need_no_order_l2(order: int) -> None:
    text = changed(("    3    3   -3", f"    3    {order}   -3"))
    orders = {"W316", "W322", "E321"}
    assert orders & codes(text)
    assumed = text.replace("EXPE\n", "SHEA MITC\nEXPE\n", 1)
    assert not orders & codes(assumed)
    free = restrained("   13    0    0    0    0    0    0")
    assert not orders & codes(free.replace("EXPE\n", "SHEA MITC\nEXPE\n", 1))


def half_laminate() -> str:
    """The deck with the first half of its symmetric laminate."""
    cut = BASE.index("    9 90.0     0.125")
    text = BASE[:cut] + BASE[BASE.index("END\nMACR") :]
    return text.replace("  625  144   16", "  625  144    8").replace(
        "-3       2.0", "-3       1.0"
    )


def test_half_of_a_symmetric_laminate_is_named_for_its_coupling() -> None:
    assert "W318" in codes(half_laminate().replace(*ANY_TIME_STEP))
