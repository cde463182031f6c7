"""Decks for the tests: small plates that run in milliseconds, and the report's own."""

from __future__ import annotations

import re
from pathlib import Path

import fecm
from fecm.deck.model import Deck
from fecm.problem.build import ImpactModel, build_model
from fecm.problem.loading import load_deck

ROOT = Path(__file__).parent.parent
DATA = Path(__file__).parent / "data"
APPENDIX = ROOT / "decks" / "appendix.inp"
LONG = ROOT / "decks" / "impact-115.inp"
# With so many steps that the kernels write several checkpoints, and as many stored rows.
LONGER = re.sub(r"(RODP|DISP) {9}20", r"\1         80", LONG.read_text()).replace(
    "LOOP       4000", "LOOP      16000"
)

# A 2 x 2 in plate of four 9-node elements, hit in the middle.
MESH = """\
COOR
    1    1       0.0       0.0
    5    0       2.0       0.0
    6    1       0.0       0.5
   10    0       2.0       0.5
   11    1       0.0       1.0
   15    0       2.0       1.0
   16    1       0.0       1.5
   20    0       2.0       1.5
   21    1       0.0       2.0
   25    0       2.0       2.0

ELEM
    1    1    3   13   11    2    8   12    6    7    2
    3   11   13   23   21   12   18   22   16   17    2

BOUN
    1    1   -1   -1    0    0    0
   25    0    1    1    0    0    0

"""
DATA_CARDS = """\
ROD
   13    3     115.0
EXPE
  1912000. 0.0006564     0.094       2.0
MATE
    3    3   -3      .106
  0.000148       0.3 17500000.  1150000.   800000.   800000.   800000.
    1   0.     0.053
    2  90.     0.053
"""
PROGRAM = """\
LMAS
DT        .5E-6
LOOP         10
TIME
RODP          5
DISP          5
NEXT
"""


# A disc in the fourth element, whose stresses and those of its nearest neighbour are stored.
DISC = "PATC\nDISC             .2       1.5       1.5\n"
PLY_PROGRAM = PROGRAM.replace("NEXT", "PLYS          5    2\nNEXT")

# Findings that the small plate has: its coupled laminate is held in its plane at every node, it has
# no projectile of its own, and its mesh is coarse.
OWN_FINDINGS = ("W318", "N414", "W415")


def ready(deck: str | Path) -> ImpactModel:
    """Model of a deck's first problem."""
    return build_model(load_deck(deck).problems[0])


def small(
    program: str = PROGRAM, *, mesh: str = MESH, data: str = DATA_CARDS, stop: bool = True
) -> str:
    """A deck of one small problem."""
    end = "STOP\n" if stop else ""
    control = "   25    4    2    2    5    9\n"
    return f"FECM small plate\n{control}{mesh}{data}END\nMACR\n{program}END\n{end}"


def model(text: str | Path) -> Deck:
    """Model of a deck of one problem."""
    return fecm.read_one(text)
