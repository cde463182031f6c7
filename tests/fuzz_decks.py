"""A long fuzz run of the deck reader and its checks, by hand.

    python -m tests.fuzz_decks --count 1000000 --seed 0

Every mutated deck must give a model or findings within a second of processor time and without
another exception; a model must be written and read back the same, and formatting it must not change
it.  Prints what broke, with the seed that makes it again.
"""

from __future__ import annotations

import argparse
import random
import signal
import time
from collections import Counter
from types import FrameType

from fecm.deck.format import format_deck
from fecm.deck.reader import Reader
from fecm.problem.loading import load_deck
from tests.decks import APPENDIX, small

SECONDS = 1.0
FORC = (
    "FORC\n    1    1       0.0       0.0       1.0\n   25    0       0.0       0.0       1.0\n\n"
)
OWN = (
    "PROJ\n    3    0       1.0     30.E6 .0006875\n    1    1      0.22\n    3    0     0.625\n\n"
    "SHEA MITC EQUI\n  0.822467\nPATC\nHERT           0.3       1.0       0.9\n"
    "MATS\n    2\n.00003,.3,15000.,15000.,6000.,6000.,6000.\n\n"
    "LAMS\n    2    1\n    1   0.     0.070    2\n\nZONE\n    2    4    2    2\n\n"
    "ALLO\n1.E5,1.E5,5.E3,2.E4,9.E3\n\n1.E5,1.E5,5.E3,2.E4,9.E3,,,2\n\n"
    "GAGE\n    1           0.5       0.5     0.053       45.\n\n"
)
SPECIAL = [
    "999999999", "99999", "-1", "0", "1E300", "1E-300", "NaN", "inf", ",", "!", "\t", "1.5-3", "é",
    "\x00", "9" * 400, "LOOP      99999", "COOR", "END", "STOP", "MACR", "FECM", "", "RODP", "NEXT",
]  # fmt: skip


def mutate(text: str, random: random.Random) -> str:
    """Flip characters, shift columns, drop, double and swap cards, put in what hurts."""
    lines = text.split("\n")
    for _ in range(random.choice([1, 1, 1, 2, 3, 5, 12])):
        row = random.randrange(len(lines))
        line = lines[row]
        column = random.randrange(len(line) + 1)
        match random.randrange(10):
            case 0 | 1:
                char = random.choice(" 0123456789.-+EeDx,!\tAZ")
                lines[row] = line[:column] + char + line[column + 1 :]
            case 2:
                lines[row] = " " + line if random.random() < 0.5 else line[1:]
            case 3:
                lines[row] = line[:column] + random.choice(SPECIAL) + line[column:]
            case 4:
                del lines[row]
                lines = lines or [""]
            case 5:
                lines.insert(row, line)
            case 6:
                other = random.randrange(len(lines))
                lines[row], lines[other] = lines[other], line
            case 7:
                lines[row] = random.choice(SPECIAL)
            case 8:
                lines[row] = line[: -1 or None]
            case _:
                digits = [i for i, c in enumerate(line) if c.isdigit()]
                if digits:
                    at = random.choice(digits)
                    lines[row] = line[:at] + random.choice("0123456789") + line[at + 1 :]
    return "\n".join(lines)


def examine(text: str) -> str:
    """Read, check, write and format a deck; what became of it in a word."""
    prepared = load_deck(text + "\n")
    if prepared.errors():
        return "errors"
    for problem in Reader(text).problems():
        deck = problem.deck
        if deck is not None:
            again = Reader(deck.to_text()).problems()
            assert [p.deck for p in again] == [deck], "written and read, the model differs"
    formatted = format_deck(text)
    assert [p.deck for p in Reader(formatted).problems()] == [
        p.deck for p in Reader(text).problems()
    ], "formatting changes the model"
    assert format_deck(formatted) == formatted, "formatting twice differs"
    return "warnings" if prepared.findings else "sound"


def main() -> int:
    """Run the decks of a range of seeds and count what became of them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    appendix = APPENDIX.read_text()
    bases = [
        small(),
        small().replace("ROD\n", FORC + "ROD\n"),
        small().replace("ROD\n", OWN + "ROD\n"),
        small(stop=False) + small(),
    ]
    counted: Counter[str] = Counter()
    broken = 0

    def too_long(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"longer than {SECONDS} s")

    signal.signal(signal.SIGPROF, too_long)
    begin = time.monotonic()
    for seed in range(options.seed, options.seed + options.count):
        source = random.Random(seed)
        base = appendix if source.random() < 0.01 else source.choice(bases)
        text = mutate(base, source)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            counted[examine(text)] += 1
        except Exception as error:
            broken += 1
            print(f"seed {seed}: {type(error).__name__}: {error}", flush=True)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
    import resource  # not on Windows, which can import this module

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{options.count} decks from seed {options.seed} in {time.monotonic() - begin:.0f} s: "
        f"{dict(counted)}, broken {broken}, peak memory {peak:.0f} MB"
    )
    return 1 if broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
