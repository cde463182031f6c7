"""Rules: every code has its text on the page of findings, and a deck that it fires on."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.deck.rules import Rule, Subject, declare
from fecm.problem.findings_page import all_rules, findings_page
from fecm.problem.loading import load_deck
from tests import decks
from tests.builders import square
from tests.decks import DATA, DATA_CARDS, MESH, PLY_PROGRAM, PROGRAM, ROOT, small
from tests.sound_plate import base, replaced, strengths, with_card
from tests.symmetric_parts import part_of, whole_deck
from tests.test_element_decks import deck as element_deck
from tests.test_input_mistakes import MISTAKES

Deck = Callable[[], str]
CODES = {rule.code for rule in all_rules()}
STATIC = "TANG\nFORM\nSOLV\nCONV\n"
IMPACT = "ROD\n   13    3     115.0\n"
ENDLESS = PROGRAM.replace("         10", "      99999").replace("          5", "")
ROD_CARDS = "PROJ\n3,0,1.,30.E6,.0006875\n1,1,.22\n3,0,.625\n\n"


RING = [n for n in range(9) if n != 4]  # elements of 3 x 3 around a hole


# Decks -------------------------------------------------------------------------------------------


def data(old: str, new: str) -> Deck:
    """The small plate with a change in its data."""
    assert old in DATA_CARDS
    return lambda: small(data=DATA_CARDS.replace(old, new))


def more(cards: str) -> Deck:
    """The small plate with more segments."""
    return lambda: small(data=cards + DATA_CARDS)


def mesh(old: str, new: str) -> Deck:
    """The small plate with a change in its mesh."""
    assert old in MESH
    return lambda: small(mesh=MESH.replace(old, new))


def on_rollers(cards: str) -> Deck:
    """The small plate without restraints of w, on one-sided supports."""
    head = MESH[: MESH.index("BOUN")]
    free = (
        f"{head}BOUN\n    1    1   -1   -1    0    0    0\n   25    0    1    1    0    0    0\n\n"
    )
    return lambda: small(mesh=f"{free}UNIL\n{cards}\n")


def supports(*cards: str) -> Deck:
    """The small plate with other BOUN cards."""
    head = MESH[: MESH.index("BOUN")]
    return lambda: small(mesh="\n".join([f"{head}BOUN", *cards, "", ""]))


def program(old: str, new: str) -> Deck:
    """The small plate with a change in its program."""
    assert old in PROGRAM
    return lambda: small(PROGRAM.replace(old, new))


def macros(cards: str) -> Deck:
    """The small plate with another program."""
    return lambda: small(cards)


def text(old: str, new: str) -> Deck:
    """The small plate with a change anywhere."""
    assert old in small()
    return lambda: small().replace(old, new, 1)


def plate(edit: Callable[[str], str]) -> Deck:
    """The sound plate with an edit."""
    return lambda: edit(base())


def wrong(name: str) -> Deck:
    """A deck of the folder of wrong ones."""
    return (ROOT / "tests" / "wrong" / f"{name}.inp").read_text


def elements(nodes: int, *orders: int) -> Deck:
    """A plate of 2 x 2 elements with other integration orders."""
    bending, shear, points = orders
    return lambda: element_deck(square(2, 2, nodes), (bending, shear, points))


def side_node_moved() -> str:
    coordinates, nodes = square(2, 2, 9)
    coordinates[nodes[0, 4] - 1, 0] += 0.05
    return element_deck((coordinates, nodes), (3, 3, 3))


def node_doubled() -> str:
    """The middle node is another one in the last element."""
    coordinates, nodes = square(2, 2, 4)
    middle = 5
    nodes[3][nodes[3] == middle] = len(coordinates) + 1
    return element_deck((np.vstack([coordinates, coordinates[middle - 1]]), nodes), (2, 1, 2))


def side_node_hanging() -> str:
    """The first element, of five nodes, has a mid-side node that its neighbour lacks."""
    coordinates, nodes = square(2, 2, 4)
    wide = np.zeros((len(nodes), 9), int)
    wide[:, :4] = nodes
    a, b = (coordinates[nodes[0][n] - 1] for n in (1, 2))
    wide[0, 5] = len(coordinates) + 1
    return element_deck((np.vstack([coordinates, (a + b) / 2.0]), wide), (3, 3, 2))


def quadrilateral_in_two() -> str:
    coordinates, nodes = square(2, 2, 4)
    a, b, c, d = nodes[0]
    nodes[0] = a, b, c, 0
    return element_deck(
        (coordinates, np.vstack([nodes, [[c, d, a, 0]]]).astype(np.int32)), (2, 1, 2)
    )


def many_layers() -> str:
    layers = "".join(f"{n:5}   0.     0.004\n" for n in range(1, 27))
    head = DATA_CARDS[: DATA_CARDS.index("    1   0.")].replace("      .106", "      .104")
    return small(data=head + layers).replace("    4    2    2    5", "    4   26    2    5")


def stiff_contact() -> str:
    sound = (DATA / "plate-100x100x2.inp").read_text()
    return sound.replace("  100000.0     0.017", "       1E7     0.017")


def edge_held(*codes: str) -> list[str]:
    """BOUN cards of the small plate: codes of the nodes of its left edge."""
    return [f"{node:5}    0    {'    '.join(codes)}" for node in range(1, 26, 5)]


def nonlinear(
    *codes: str, orders: str = "    3    3   -3", words: str = "SHEA MITC\n", program: str = PROGRAM
) -> Deck:
    """The small plate with NONL, held along its left edge."""
    mesh = "\n".join([MESH[: MESH.index("BOUN")] + "BOUN", *edge_held(*codes), "", ""])
    cards = DATA_CARDS.replace("    3    3   -3", orders)
    return lambda: small(program, mesh=mesh, data=f"NONL\n{words}{cards}")


def nonlinear_of_8_nodes() -> str:
    return wrong("assumed-shear-of-8-nodes")().replace("SHEA MITC", "NONL\nSHEA MITC")


MATS = "MATS\n    2\n.00003,.3,15000.,15000.,6000.,6000.,6000.\n\n"


def pad(*cards: str) -> Deck:
    """The small plate, of one ply, with another laminate on an element."""
    head = DATA_CARDS[: DATA_CARDS.index("    2  90.")].replace(".106", ".053")
    lams = "LAMS\n    2    1\n    1   0.     0.070\n\nZONE\n    2              2\n\n"
    built = small(data="".join(cards) + lams + head)
    return lambda: built.replace("    4    2    2    5", "    4    1    2    5")


CLAMPED = "11111"
SYMMETRIC = "01010"  # v, theta_x: u is missing


def on_window() -> str:
    """A plate on the edges of a window, hit beside the window."""
    return impact(fecm.Plate.on_fixture("window:40x30,20x10", (2, 2)), at=(5.0, 15.0)).to_text()


def coarse_panel() -> str:
    """A curved panel under compression with elements that are longer than its buckles."""
    plate = fecm.Plate.rectangle((40.0, 30.0), (2, 2), support="simple")
    return impact(plate, radius_y=200.0, preload=(-1e-3, 0.0)).to_text()


def with_hole() -> str:
    """A preloaded plate with a hole in its middle."""
    places = [(10.0 * x, 10.0 * y) for y in range(4) for x in range(4)]
    corners = [(n + n // 3) for n in RING]
    cells = [(n, n + 1, n + 5, n + 4) for n in corners]
    left = {"left": np.array([0, 4, 8, 12])}
    plate = fecm.Plate.from_mesh((places, cells), {"left": "simple"}, groups=left)
    return impact(plate, at=(10.0, 10.0), preload=(1.0, 0.0)).to_text()


def impact(plate: fecm.Plate, **options: Any) -> fecm.Deck:
    """Deck of a small impact."""
    return fecm.impact(
        plate,
        fecm.Laminate("[0/90]s", "IM7/8552"),
        fecm.RigidMass(1e-5),
        fecm.Contact(1000.0),
        velocity=1000.0,
        patch=None,
        duration=1e-7,
        dt=1e-8,
        units="mm-N-s",
        **options,
    )


DECKS: dict[str, Deck] = {code: plate(edit) for edit, code, _ in MISTAKES.values()} | {
    "E000": macros("XXXX\n" * 1001),
    "W000": macros(PROGRAM + f"CHEC{'beyond':>40}\n" * 1002),
    "E001": lambda: "STOP\n",
    "W002": lambda: small(stop=False),
    "E003": text("   25    4    2    2    5    9\n", ""),
    "E004": text("END\nMACR", "MACR"),
    "E005": text("COOR\n", " COOR\n"),
    "E006": more("    3   0.     0.053\n"),
    "E007": text("\nELEM", "ELEM"),
    "E008": data(IMPACT, "ROD\n"),
    "E009": text("MACR\n", ""),
    "E010": more("UNIT\nin lbf\n"),
    "E011": macros("PROP          1\n" + PROGRAM),
    "E012": lambda: "FECM\n9000,1,1,2,5,3\n" + "COOR\n\n" * 50 + "END\nMACR\nEND\nSTOP\n",
    "E013": text("FECM", "FEAP"),
    "E101": data("  1912000.", "  19x2000."),
    "E103": data("   13    3", "   13\t3"),
    "E104": wrong("blank-in-number"),
    "W104": wrong("blank-in-number"),
    "E105": wrong("shifted-column"),
    "E106": data("  1912000. 0.0006564     0.094       2.0", "1912000.,.0006564,.094,2.,5."),
    "W106": data("     115.0", "      115.00"),
    "E107": data("  1912000.", "  1912E999"),
    "E108": wrong("patch-radius-in-column-6"),
    "E109": wrong("patch-hertz-in-full"),
    "E201": wrong("huge-count"),
    "E202": wrong("missing-layer"),
    "E203": wrong("missing-segment"),
    "W204": more(DATA_CARDS[: DATA_CARDS.index("EXPE")]),
    "E301": mesh("   25    0       2.0", "   26    0       2.0"),
    "E302": mesh("    5    0       2.0", "    1    0       2.0"),
    "E303": mesh("    3   11   13", "    9   11   13"),
    "E304": mesh("    3   11   13", "    1   11   13"),
    "E305": mesh("    1    1    3   13", "    2    1    3   13"),
    "E306": wrong("node-without-coordinates"),
    "E307": wrong("node-in-no-element"),
    "E308": mesh("    3   11   13   23   21   12   18   22   16   17    2", "    3"),
    "E309": wrong("unknown-node"),
    "E310": mesh("    1    1    3   13   11", "    1    1    3   13    0"),
    "E311": supports("    1    1   -1   -1   -1   -1   -1", "   25    0    1    1    1    1    1"),
    "E312": mesh("    1    1    3   13   11", "    1    1    1   13   11"),
    "E313": wrong("clockwise-element"),
    "W314": node_doubled,
    "E324": side_node_hanging,
    "E315": data("    3    3   -3", "    1    3   -3"),
    "W316": elements(12, 3, 2, 2),
    "E317": elements(3, 2, 1, -2),
    "W318": decks.small,
    "W319": supports("    2    0    0    0    1    0    0"),
    "W320": elements(4, 3, 2, 2),
    "E321": data("    3    3   -3", "    3    2   -3"),
    "W322": elements(9, 3, 2, 2),
    "W323": side_node_moved,
    "W401": data("    3    3   -3", "    5    3   -3"),
    "E402": data("    3    3   -3", "    3    3    0"),
    "E403": data("  1150000.", "       0.0"),
    "E404": wrong("not-positive-definite"),
    "E534": data("   800000.\n", "   1.E-300\n"),
    "E405": data("    1   0.     0.053", "    1   0.     -.053"),
    "E406": data("      .106", "       0.0"),
    "E407": wrong("layers-do-not-add-up"),
    "W408": data("    1   0.     0.053", "    7   0.     0.053"),
    "E408": data("   13    3", "   26    3"),
    "E409": data("   13    3", "   13    6"),
    "E410": data("   13    3", "   13    1"),
    "E411": data("     115.0", "    -115.0"),
    "W411": data("     115.0", "       0.0"),
    "E412": data("  1912000.", "       -1."),
    "E413": data("   13    3", "   13    4"),
    "W413": lambda: small(
        mesh=MESH[: MESH.index("BOUN")], data=DATA_CARDS.replace("   13    3", "   13    1")
    ),
    "N414": small,
    "W414": more("UNIT\nmm N s\n"),
    "W415": small,
    "W416": data("EXPE", "EXPE ABC"),
    "E417": data(" 17500000.", "   1.E+308"),
    "E486": plate(lambda text: with_card("PREL", "-1.0")(replaced(r"^BOUN\n(.+\n)*", "")(text))),
    "E487": plate(with_card("PREL", "-1000.")),
    "W488": plate(with_card("PREL", "-580.")),
    "W489": plate(with_card("PREL", "2000.")),
    "E418": more("PROJ\n-1,0,1.\n"),
    "E419": more("PROJ\n0,0,-1.\n"),
    "E420": more(ROD_CARDS.replace("3,0,.625", "9,0,.625")),
    "E421": more(ROD_CARDS.replace("3,0,.625", "1,0,.625")),
    "E422": more(ROD_CARDS.replace("3,0,.625\n", "")),
    "E423": more(ROD_CARDS.replace("3,0,1.,", "3,99,1.,")),
    "E424": more("GAGE\n1,9.,.5\n\n"),
    "E425": more("GAGE\n1,.5,.5\n1,.5,.6\n\n"),
    "W426": more("GAGE\n1,.5,.5,7.\n\n"),
    "E427": more("SHEA\n       0.0\n"),
    "W428": more("SHEA\n       1.2\n"),
    "E429": more(ROD_CARDS.replace("1,1,.22", "1,1,1.E200")),
    "N430": lambda: small(
        data=DATA_CARDS.replace("     0.053", "      0.15").replace("      .106", "       0.3")
    ),
    "W430": lambda: small(
        data=DATA_CARDS.replace("     0.053", "       0.5").replace("      .106", "       1.0")
    ),
    "W431": data("    2  90.", "    2 190."),
    "W432": data("    2  90.", "    2 1.57"),
    "W433": data(" 17500000.", "   500000."),
    "W434": data("       0.3 ", "      0.02 "),
    "W436": data(" 0.0006564", "        1."),
    "W437": data("     0.094       2.0", "     0.094       0.5"),
    "W439": more(ROD_CARDS.replace("30.E6", "30.")),
    "W440": data("     115.0", "      1.E9"),
    "W441": supports(
        "    1    1   -1   -1   -1    0    0",
        "   12    0    1    1    1    0    0",
        "   13    0    1    1    0    0    0",
        "   14    1   -1   -1   -1    0    0",
        "   25    0    1    1    1    0    0",
    ),
    "E442": wrong("patch-of-unknown-shape"),
    "E443": wrong("patch-without-radius"),
    "E444": wrong("patch-without-y0"),
    "E445": wrong("patch-beside-the-plate"),
    "E446": wrong("shear-word-misspelt"),
    "W447": wrong("plys-of-two-counts"),
    "E448": wrong("plys-of-two-counts"),
    "W449": macros(PLY_PROGRAM),
    "W450": lambda: elements(4, 3, 1, 2)().replace("RODP,,400", "RODP,,400\nPLYS,,400"),
    "E451": wrong("assumed-shear-of-8-nodes"),
    "W452": more("GAGE\n1,1.,1.\n\n"),
    "E453": plate(with_card("CURE", "-100.,", "")),
    "E454": plate(with_card("CURE", "-100.,", ",.02,22.5", "")),
    "E455": plate(strengths(-1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)),
    "E456": plate(replaced("^      -0.5      0.35", "      -2.0      0.35")),
    "E457": plate(with_card("DELA", "-1.,")),
    "W458": lambda: decks.small(data="DELA\n.8,\n" + decks.DATA_CARDS),
    "E570": more("SPRI LINES\n\n"),
    "E571": more("MASS\n13,0,-1.,0.\n\n"),
    "E572": more("UNIL\n13,0,2,0.,0.\n\n"),
    "E573": more("SPRI LINE\n1,13,0.,0.,1.,0.,0.\n\n"),
    "E574": lambda: supports("    1    0    1    1    1    0    0")().replace(
        "ROD\n", "UNIL\n1,0,1,0.,0.\n\nROD\n"
    ),
    "W575": more("SPRI\n1,0,1.,0.,0.,0.,0.\n\n"),
    "W576": on_rollers("3,0,1,0.,1.\n"),
    "W577": lambda: on_rollers("3,0,1,1.E9,0.\n")().replace("DT        .5E-6", "DT        .5E-9"),
    "W578": on_rollers("3,0,1,1.,0.\n11,2,1,1.,0.\n15,0,1,1.,0.\n23,0,1,1.,0.\n"),
    "E579": on_rollers("3,0,1,0.,0.\n"),
    "E459": more("DAMP\n-1.,\n"),
    "W460": more("DAMP\n1.E6,\n"),
    "W556": on_window,
    "W565": lambda: part_of(whole_deck(), (0,)).with_(at=(75.0, 40.0)).to_text(),
    "W566": lambda: part_of(
        whole_deck(laminate=fecm.Laminate("[45/-45]s", "IM7/8552", 0.25)), (0,)
    ).to_text(),
    "W567": lambda: supports(
        "    1    1   -1   -1    0    0    0",
        "   25    0    1    1    0    0    0",
        "   11    0    1    1    0    1    0",
    )().replace("ROD\n   13", "ROD\n   11"),
    "N559": plate(replaced("171420.0    9080.0", " 65000.0   63000.0")),
    "N560": plate(strengths(2326.2, 1200.1, 62.3, 199.8, 20.0, 92.3, 92.3)),
    "W557": with_hole,
    "W561": coarse_panel,
    "E483": more("PREL\n1.,2.,3.\n"),
    "W484": plate(with_card("PREL", "0.,2.E3,0.")),
    "W485": plate(with_card("PREL", ",,")),
    "E535": plate(with_card("PREL", "-12,5")),
    "E490": lambda: small(data="NONL\nSHEA MITC\n" + DATA_CARDS),
    "E491": nonlinear(*CLAMPED, words=""),
    "E492": nonlinear_of_8_nodes,
    "E493": nonlinear(*CLAMPED, program=PROGRAM + "CMAS\nEIGE          2\n"),
    "E494": nonlinear(*CLAMPED, orders="    2    3   -3"),
    "W495": nonlinear(*SYMMETRIC),
    "E496": more(MATS.replace("    2\n", "    1\n")),
    "E497": data("    2  90.     0.053", "    2  90.     0.053    2"),
    "E498": more("ZONE\n    1    5\n\n"),
    "E499": pad("PREL\n1.,,\n"),
    "W466": lambda: small(
        data=MATS + DATA_CARDS.replace("    2  90.     0.053", "    2  90.     0.053    2")
    ),
    "W558": lambda: small(
        data=MATS
        + DATA_CARDS.replace("    1   0.     0.053", "    1   0.     0.096").replace(
            "    2  90.     0.053", "    2  90.     0.010    2"
        )
    ),
    "W562": lambda: small(
        data=DATA_CARDS.replace("    1   0.     0.053", "    1  25.     0.030").replace(
            "    2  90.     0.053", "    2  50.     0.046\n    3  25.     0.030"
        )
    ).replace("   25    4    2    2", "   25    4    3    2"),
    "W500": more(MATS),
    "W497": lambda: small(
        data=MATS + DATA_CARDS.replace("    2  90.     0.053", "    2  90.     0.053    2")
    ),
    "W498": lambda: small(
        PROGRAM.replace("DISP", "FAIL"),
        data=MATS
        + "ALLO\n1.E5,1.E5,5.E3,2.E4,9.E3\n\n"
        + DATA_CARDS.replace("    2  90.     0.053", "    2  90.     0.053    2"),
    ),
    "W461": plate(replaced(r"^(.{5}).{5}(     0\.184)$", r"\1 45.0\2")),
    "N589": plate(replaced(r"^(   1[45]).{5}(     0\.184)$", r"\1 45.0\2")),
    "W462": plate(with_card("CURE", "-600.,", ",.02E-6,22.5E-6", "")),
    "W540": plate(with_card("CURE", "155.,", ",.02E-6,22.5E-6", "")),
    "W541": lambda: small(
        data="DELA\n.5\n"
        + MATS
        + DATA_CARDS.replace("    2  90.     0.053", "    2  90.     0.053    2")
    ),
    "W564": lambda: with_card("PREL", "500.")(
        with_card("CURE", "-200.,", ",.02E-6,22.5E-6", "")(base())
    ),
    "W463": plate(with_card("CURE", "-400.,", ",.02E-6,22.5E-6", "")),
    "W464": more("CURE\n-200.,\n,.02E-6,22.5E-6\n\n"),
    "W496": plate(with_card("CURE", ",.5", ",.02E-6,22.5E-6,,.6", "")),
    "W465": more("CURE\n-100.,\n,.02E-6,22.5E-6\n\n"),
    "E501": macros("XXXX\n"),
    "E502": wrong("loop-without-next"),
    "E503": macros(PROGRAM + "NEXT\n"),
    "E504": wrong("rodp-before-lmas"),
    "E505": wrong("plys-negative"),
    "E506": macros("LOOP          1\n" * 65 + "NEXT\n" * 65),
    "W507": program("TIME\n", ""),
    "E508": program(".5E-6", ".8E-6"),
    "E509": wrong("loops-that-run-for-years"),
    "W510": program("RODP          5", "RODP         50"),
    "W511": macros("LMAS\n"),
    "W512": macros(f"LOOP          9\n{ENDLESS}NEXT\n"),
    "E513": macros(STATIC),
    "E514": program("TIME", "TIME AB"),
    "E515": program(".5E-6", "1E-15"),
    "W516": program(".5E-6", "5E-11"),
    "W517": stiff_contact,
    "W518": macros(PROGRAM + "EXCD\n"),
    "W563": macros(STATIC.replace("CONV\n", "") + PROGRAM.replace("NEXT", "FORM\nSOLV\nNEXT")),
    "E519": macros("LMAS\nDT        .5E-6\nLOOP          3\nTIME\nDISP\nNEXT\n"),
    "W520": lambda: small(
        PROGRAM.replace("RODP          5", "EXCD"), data="FORC\n13,0,0.,0.,1.\n\n" + DATA_CARDS
    ),
    "W521": more("CURV\n,,\n"),
    "E522": lambda: wrong("assumed-shear-of-8-nodes")().replace("SHEA MITC", "CURV\n9.,,"),
    "E523": more("CURV\n.9,,\n"),
    "W524": more("CURV\n,,1.5\n"),
    "W525": more("CURV\n,-2.1,\n"),
    "W526": more("CURV\n9.,,\n"),
    "E527": lambda: elements(9, 2, 3, 2)().replace("MATE\n", "CURV\n9.,,\nMATE\n"),
    "E528": more("CURV\n9.,,\nPREL\n1.,2.,\n"),
    "E601": quadrilateral_in_two,
    "E602": many_layers,
    "E603": more("PATC\n\n"),
}
LISTING = {"W104", "E601", "E602", "E603"}  # codes of the printed program's mode


# Tests -------------------------------------------------------------------------------------------


def test_every_rule_has_a_deck_and_every_deck_a_rule() -> None:
    assert DECKS.keys() == CODES


@pytest.mark.parametrize("code", sorted(DECKS))
def test_a_rule_fires_on_its_deck(code: str) -> None:
    mode = "listing" if code in LISTING else "report"
    assert code in {finding.code for finding in load_deck(DECKS[code](), mode).findings}


def test_every_code_that_is_reported_has_a_rule() -> None:
    sources = "\n".join(path.read_text() for path in (ROOT / "fecm").rglob("*.py"))
    assert set(re.findall(r'"([EWN]\d{3})"', sources)) == CODES


def test_the_page_of_findings_is_that_of_the_rules() -> None:
    # Write it anew by: python -m fecm.problem.findings_page docs/findings.md
    assert (ROOT / "docs" / "findings.md").read_text(encoding="utf-8") == findings_page()
    assert len(re.findall(r"^\| \[[EWN]\d{3}\]\{#", findings_page(), re.MULTILINE)) == len(CODES)


@pytest.mark.parametrize("rule", all_rules(), ids=lambda rule: rule.code)
def test_a_summary_is_one_plain_sentence_and_a_remedy_is_given(rule: Rule) -> None:
    assert re.fullmatch(r"[^`\[\]|]+\.", rule.summary)
    assert not re.search(r"\. [A-Z]", rule.summary)
    assert len(rule.summary) <= 80
    assert rule.remedy.endswith(".")
    assert rule.cause == "" or rule.cause.endswith(".")


def test_a_code_is_declared_once() -> None:
    with pytest.raises(ValueError, match="the code E001 is taken"):
        declare("E001", Subject.FRAME, "Another.", remedy="None.")
