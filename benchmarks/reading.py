"""Time to read a large deck, to set up its model and to write it, in both forms of its cards.

    python benchmarks/reading.py [--rounds N] [TIMES ...]

The deck is the report's plate with every element cut so many times in each direction and its inner
corners moved, so that every node has a card: 14,000 elements with 10, 143,000 with 32.  `model` is
the time from the text to the model whose first step can be taken, `write` that of the deck's text,
`problem` that of the checked problem of a deck made in Python.  Processor time, the least of some
rounds.
"""

from __future__ import annotations

import argparse
import os
import re
import time
import warnings
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does

from run import distorted, refined

from fecm.deck.model import Deck
from fecm.deck.reader import Reader
from fecm.problem.build import RunOptions, build_model
from fecm.problem.loading import load_deck, sole_problem


def in_columns(text: str) -> str:
    """Text of a deck whose nodes between commas are rounded to ten columns."""

    def card(match: re.Match[str]) -> str:
        node, increment, x, y = match[0].split(",")
        return f"{int(node):5d}{int(increment):5d}{float(x):10.7f}{float(y):10.7f}"

    before, keyword, rest = text.partition("COOR\n")
    cards, end, after = rest.partition("\n\n")
    return before + keyword + re.sub(r"^.*,.*$", card, cards, flags=re.MULTILINE) + end + after


def model(text: str) -> object:
    """Model of a deck's text, before its first step."""
    return build_model(load_deck(text).problems[0], RunOptions())


def cost(work: Callable[[], object], rounds: int) -> float:
    """Least processor time of some rounds."""
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def texts(times: int) -> dict[str, str]:
    """Text of the deck by the form of its cards; five columns hold numbers up to 99,999."""
    deck = distorted(refined(times), 0.04 / times)
    commas = deck.to_text()
    if deck.control.numnp > 99_999:
        return {"commas": commas}
    return {"commas": commas, "columns": in_columns(commas)}


def main() -> None:
    """Print a line a deck and form."""
    parser = argparse.ArgumentParser()
    parser.add_argument("times", type=int, nargs="*", default=[10])
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    print("  elements  form        read     model    write    problem  s")
    for times in options.times:
        for form, text in texts(times).items():
            deck = Reader(text).problems()[0].deck
            if not isinstance(deck, Deck):
                raise TypeError("the deck can't be read")
            works = (
                lambda text=text: Reader(text).problems(),
                lambda text=text: model(text),
                deck.to_text,
                lambda deck=deck: sole_problem(deck),
            )
            figures = "".join(f"{cost(work, options.rounds):9.3f}" for work in works)
            print(f"{deck.control.numel:10d}  {form:8}{figures}", flush=True)


if __name__ == "__main__":
    main()
