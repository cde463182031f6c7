"""A pool with a bad deck
======================

Decks in the processes of a pool. The error of a deck comes back as the exception that
:func:`fecm.run_one` raises, with its findings; the pool and the other decks go on.
"""

from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

import fecm

good = fecm.read_one(fecm.examples.path("impact-patch.inp"))
decks = {
    "as in the report": good.to_text(),
    "mistyped": good.to_text().replace("    1  0.0    0.0053", "    1  0.0    0.OO53"),
    "faster": good.with_(velocity=150).to_text(),
}

if __name__ == "__main__":  # worker processes import this script
    outcomes = {}
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        futures = {pool.submit(fecm.run_one, deck): name for name, deck in decks.items()}
        for future in as_completed(futures):
            try:
                outcomes[futures[future]] = f"{future.result().force.max():.1f} lbf"
            except fecm.DeckError as error:
                outcomes[futures[future]] = error.findings[0].render(error.source)
    for name in decks:
        print(f"{name}: {outcomes[name]}")
